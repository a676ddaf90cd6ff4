from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import tables
from semsig_gis.maps import page as map_assets

MEASURES = ("edit", "jaccard", "histogram")
SINGLES = {
    f"one {measure} query by {part}": measure == "edit"
    for measure in MEASURES
    for part in ("types", "angles")
}
# Words of the name of what is measured, and whether it has a bar.
PARTS = {
    **SINGLES,
    "one edit+edit query": False,
    "one edit+edit:5% query": False,
    "edit queries by types": True,
    "edit queries by angles": True,
    "growth: an edit query": False,
    "growth: a likelihood query": False,
    "likelihood index of": False,
    "one likelihood query, ": True,
    "one likelihood query with re-ranking": False,
    "likelihood queries": False,
    "cold: semsig localize by likelihood": True,
    "cold: semsig --help": True,
    "building and saving a database": True,
    "signatures of mean length": True,
    "opening the file of": True,
    "building footprints": False,
    "occlusion of": False,
    "outdoor cells with buildings": False,
    "by 2 processes": False,
    "peak memory of a process that builds": True,
    "growth of that memory": True,
    "reading every layer of a pbf file": True,
    "peak memory of reading": True,
}
# The same where there are a browser and map files.
OF_MAPS = {
    "map of which": True,
    "in Chromium": True,
    "the longest frame of twenty": False,
}
FUSIONS = {f"one {measure}+{measure}:5% query" for measure in MEASURES}


def test_every_benchmark_runs_and_is_written(tmp_path: Path) -> None:
    out = tmp_path / "results.json"
    checkout = Path(__file__).parents[2]
    subprocess.run(
        [sys.executable, "-W", "error", "-m", "benchmarks", "--size", "small", "--out", str(out)],
        cwd=checkout,
        check=True,
        timeout=300,
    )
    results = json.loads(out.read_text(encoding="utf-8"))
    names = [one["name"] for one in results]
    assert len(set(names)) == len(names)
    drawn = shutil.which("chromedriver") and shutil.which("chromium") and map_assets.available()
    for part, bar in {**PARTS, **(OF_MAPS if drawn else {})}.items():
        bars = {one["bar"] is not None for one in results if part in one["name"]}
        assert bars == {bar}, part
    for one in results:
        assert " ".join(one) == "name unit ours peer peer_name ratio bar met paper"
        assert one["ratio"] == pytest.approx(one["peer"] / one["ours"], rel=0.01)
        assert one["met"] == (None if one["bar"] is None else one["ratio"] >= one["bar"])
        assert (one["paper"] is None) == (one["name"].split(",")[0] not in FUSIONS | SINGLES.keys())


def test_the_page_of_figures_is_that_of_the_results() -> None:
    results = (
        json.loads((tables.FOLDER / name).read_text(encoding="utf-8"))
        for name in ("accuracy.json", "results.json", "reproduction.json")
    )
    assert tables.PAGE.read_text(encoding="utf-8") == tables.page(*results)
