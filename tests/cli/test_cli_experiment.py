"""`semsig experiment` and `semsig compare`."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from sentences import sentence
from worlds import random_town

from semsig_gis.database.store import ObjectStore, save_with_store

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Done, Run

SPEC = """
database = "city.parquet"
queries = 30
seen_from = "anywhere"
[methods]
paper = "edit+edit:5%"
refined = "likelihood:light:refined"
[distortions]
phone = ["medium", "compass:5", "view:180"]
"""


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    town = random_town()
    save_with_store(town.database, ObjectStore.of(town.street_objects), tmp_path / "city.parquet")
    path = tmp_path / "spec.toml"
    path.write_text(SPEC, encoding="utf-8")
    return path


def test_an_experiment_is_run_and_compared(spec: Path, run: Run, done: Done) -> None:
    out = spec.parent / "results"
    code, shown, err = run("experiment", spec, "--out", out)
    assert code == 0
    assert "phone: medium, compass:5, view:180" in shown
    assert "refined, t = 1" in shown
    assert f"results: {out}" in shown
    assert "index does not exist yet" in err
    code, again, err = run("experiment", spec, "--out", out, "--json")
    assert (code, err) == (0, "")
    found = json.loads(again)
    assert list(found) == ["phone/paper-top1", "phone/refined-top1"]
    side_by_side = spec.parent / "side-by-side"
    shown = done("experiment", spec, "--out", side_by_side, "--workers", 2)
    assert (side_by_side / "figures.csv").read_text() == (out / "figures.csv").read_text()
    cases = [out / name for name in found]
    shown = done("compare", *cases)
    assert "P(error" not in shown
    assert "p50" in shown
    assert str(cases[0]) in "".join(shown.split())  # lines are broken at 80 signs
    shown = done("compare", out, out, "--json")
    same = json.loads(shown)
    assert list(same) == list(found)
    assert {row["difference"] for row in same["phone/paper-top1"]} <= {0.0, None}
    code, shown, _ = run("map", spec.parent / "city.parquet", "--evaluation", cases[1], "--out",
                         out.parent / "map.html")  # fmt: skip
    assert code == 0


def test_what_is_refused(spec: Path, run: Run, done: Done) -> None:
    out = spec.parent / "results"
    assert run("experiment", spec)[0] == 2
    sentence(run("experiment", spec, "--out", out, "--workers", -1), "-1 workers", "from 0 up")
    sentence(run("experiment", spec.parent / "no.toml", "--out", out), "no.toml", "cannot be read")
    spec.write_text(SPEC.replace("edit+edit", "edti+edit"), encoding="utf-8")
    sentence(run("experiment", spec, "--out", out), "'edti'", "nearest is 'edit'")
    spec.write_text(SPEC.replace("30", "1000000"), encoding="utf-8")
    sentence(run("experiment", spec, "--out", out), "1000000 queries")
    spec.write_text(SPEC, encoding="utf-8")
    done("experiment", spec, "--out", out)
    spec.write_text(SPEC.replace("compass:5", "compass:6"), encoding="utf-8")
    sentence(run("experiment", spec, "--out", out), "another experiment", "distortions")
    sentence(run("compare", out, spec.parent), "holds no results")
    other = spec.parent / "other"
    spec.write_text(SPEC.replace("paper", "best").replace("30", "20"), encoding="utf-8")
    done("experiment", spec, "--out", other)
    sentence(run("compare", out, other), "other queries")
    pair = (out / "phone" / "paper-top1", other)
    sentence(run("compare", *pair), "a single evaluation", "none in common")


def test_distortions_on_the_command_line(spec: Path, run: Run, done: Done) -> None:
    database = spec.parent / "city.parquet"
    options = ("--queries", 20, "--distortion", "medium,missing:bench,view:120", "--keep-order")
    shown = done("evaluate", database, *options, "--json")
    settings = json.loads(shown)["settings"]
    assert settings["distortions"] == ["medium:resort=false", "missing:bench", "view:120"]
    text = "light:resort=false:false_class=frequency"
    for more, said in (
        ((), text),
        (("--false-class", "uniform"), "light:resort=false"),
        (("--distortion", "light", "--false-class", "frequency"), "light:false_class=frequency"),
    ):
        few = ("--queries", 5, "--distortion", text, "--json")
        shown = done("evaluate", database, *few, *more)
        assert json.loads(shown)["settings"]["distortions"] == [said]
    sentence(run("evaluate", database, "--distortion", "medium,veiw:120"), "nearest is 'view'")
