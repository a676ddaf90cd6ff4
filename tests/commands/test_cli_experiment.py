"""`semsig experiment` and `semsig compare`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from sentences import sentence

if TYPE_CHECKING:
    from conftest import Run, RunOk

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


EXPERIMENT = "experiment spec.toml --out"


def write_spec(text: str = SPEC) -> None:
    Path("spec.toml").write_text(text, encoding="utf-8")


@pytest.fixture(autouse=True)
def _spec(town: Path) -> None:  # noqa: ARG001
    write_spec()


def test_experiment_is_run_resumed_and_compared(run: Run, run_ok: RunOk) -> None:
    code, out, _ = run(EXPERIMENT, "results", "--tables")
    assert code == 0
    assert out.startswith("The best of 2 evaluations is ")
    for words in ("phone: medium, compass:5, view:180", "refined, ", "results: results"):
        assert words in out
    code, out, err = run(EXPERIMENT, "results", "--json")
    assert (code, err) == (0, "")
    cases = list(json.loads(out))
    assert cases == ["phone/paper-top1", "phone/refined-top1"]
    run_ok(EXPERIMENT, "side-by-side", "--workers", 2)
    assert Path("side-by-side/figures.csv").read_text() == Path("results/figures.csv").read_text()
    paths = [f"results/{case}" for case in cases]
    out = run_ok("compare", *paths, "--tables")
    assert f"{paths[1]} places " in out.splitlines()[0]
    assert "p50" in out
    assert paths[0] in out
    same = json.loads(run_ok("compare results results --json"))
    assert list(same) == cases
    assert {row["difference"] for row in same["phone/paper-top1"]} <= {0.0, None}
    run_ok("map city.parquet --evaluation", paths[1], "--out", "map.html")


def test_invalid_experiments_and_comparisons_are_refused(run: Run, run_ok: RunOk) -> None:
    sentence(run(EXPERIMENT, "results", "--workers", -1), "--workers was given as -1", "0 to 1,024")
    write_spec(SPEC.replace("edit+edit", "edti+edit"))
    sentence(run(EXPERIMENT, "results"), "'edti'", "nearest is 'edit'")
    write_spec(SPEC.replace("30", "1000000"))
    sentence(run(EXPERIMENT, "results"), "1000000 queries")
    write_spec()
    run_ok(EXPERIMENT, "results")
    write_spec(SPEC.replace("compass:5", "compass:6"))
    sentence(run(EXPERIMENT, "results"), "another experiment", "distortions")
    write_spec(SPEC.replace("paper", "best").replace("30", "20"))
    run_ok(EXPERIMENT, "other")
    sentence(run("compare results other"), "different queries")
    pair = "compare results/phone/paper-top1 other"
    sentence(run(pair), "a single evaluation", "none in common")


def test_options_make_distortions(run_ok: RunOk) -> None:
    default = "light:resort=false:false_class=frequency"
    several = "--distortion medium,missing:bench,view:120 --keep-order"
    for options, distortions in (
        (several, ["medium:resort=false", "missing:bench", "view:120"]),
        (f"--distortion {default}", [default]),
        (f"--distortion {default} --false-class uniform", ["light:resort=false"]),
        ("--distortion light --false-class frequency", ["light:false_class=frequency"]),
    ):
        out = run_ok(f"evaluate city.parquet --queries 5 --json {options}")
        assert json.loads(out)["settings"]["distortions"] == distortions
