"""`semsig reproduce` from end to end."""

from __future__ import annotations

import csv
import json
from typing import TYPE_CHECKING

from sentences import sentence
from worlds import QUERIES, save_town

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run, RunOk


def test_finished_run_is_reported_again(reproduced: Path, run_ok: RunOk) -> None:
    database = reproduced.parent / "city.parquet"
    options = ("--out", reproduced, "--queries", QUERIES, "--json")
    rows = json.loads(run_ok("reproduce", database, *options))
    assert (reproduced / "report.md").stat().st_size > 1000
    page = (reproduced / "report.html").read_text("utf-8")
    assert f"semsig reproduce {database}" in page
    assert page.count("<img") == len([*(reproduced / "figures").glob("*.svg")])
    content = json.loads((reproduced / "report.json").read_text("utf-8"))
    assert content["facts"]["settings"]["queries"] == QUERIES
    with (reproduced / "numbers.csv").open(encoding="utf-8", newline="") as file:
        numbers = list(csv.DictReader(file))
    assert len(numbers) == sum(len(part["numbers"]) for part in content["sections"])
    assert {"section", "row", "column", "unit", "ours", "low", "high", "paper"} == set(rows[0])
    assert any(row["paper"] == 0.3861 for row in rows)


def test_small_run_with_workers(tmp_path: Path, run_ok: RunOk) -> None:
    line = "reproduce --size small --queries 3 --workers 1 --tables"
    out = run_ok(line, save_town(tmp_path), "--out", tmp_path / "out")
    assert out.startswith("At medium distortion the method that the paper recommends places ")
    assert "0.3733" in out
    assert f"report: {tmp_path / 'out' / 'report.html'}" in out


def test_folder_with_other_settings_is_refused(reproduced: Path, tmp_path: Path, run: Run) -> None:
    town, out = save_town(tmp_path), tmp_path / "out"
    sentence(run("reproduce", town, "--out", reproduced), "other settings", "another folder")
    assert not out.exists()
