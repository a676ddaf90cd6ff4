"""`semsig reproduce` from end to end."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from reproductions import QUERIES, save_town
from sentences import sentence

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Done, Run


def test_a_finished_run_is_reported_again(reproduced: Path, done: Done) -> None:
    database = reproduced.parent / "city.parquet"
    options = ("--out", reproduced, "--queries", QUERIES)
    shown = done("reproduce", database, *options)
    assert "0.3733" in shown
    assert f"report: {reproduced / 'report.html'}" in shown
    for name in ("report.html", "report.md", "numbers.csv", "report.json"):
        assert (reproduced / name).stat().st_size > 1000
    shown = done("reproduce", database, *options, "--json")
    rows = json.loads(shown)
    assert {"section", "row", "column", "unit", "ours", "low", "high", "paper"} == set(rows[0])
    assert any(row["paper"] == 0.3861 for row in rows)


def test_a_small_run_with_workers(tmp_path: Path, run: Run) -> None:
    options = ("--out", tmp_path / "out", "--size", "small", "--queries", 3, "--workers", 1)
    code, shown, err = run("reproduce", save_town(tmp_path), *options)
    assert (code, "report.html" in shown) == (0, True), err


def test_what_is_refused(reproduced: Path, tmp_path: Path, run: Run) -> None:
    town = save_town(tmp_path)
    out = tmp_path / "out"
    sentence(run("reproduce", tmp_path / "no.parquet", "--out", out), "no.parquet")
    sentence(run("reproduce", town, "--out", out, "--queries", 10**6), "1000000 queries")
    sentence(run("reproduce", town, "--out", out, "--workers", -2), "-2 workers")
    sentence(run("reproduce", town, "--out", reproduced), "other settings", "another folder")
    assert not out.exists()
