from __future__ import annotations

import itertools
import json
import shutil
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from machine import PATIENCE_S
from noisy_cells import every_association, random_database
from view_oracle import cell_loglik, random_view

from benchmarks import bayes, chances, history, see_more, stranger, tables, views
from benchmarks._measuring import FOLDER, INPUTS, LAST_ONLY, read_rows
from benchmarks.views import NOISE
from semsig_gis.observation import Photo, View
from semsig_gis.output.html import page

MEASURES = ("edit", "jaccard", "histogram")
SINGLES = {
    f"one {measure} query by {part}": measure == "edit"
    for measure in MEASURES
    for part in ("types", "angles")
}
# Parts of the names of benchmarks, and whether these have a bar.
PARTS = {
    **SINGLES,
    "one edit+edit query": False,
    "one edit+edit:5% query": False,
    "edit queries by types": True,
    "edit queries by angles": True,
    "growth: an edit query": False,
    "growth: a likelihood query": False,
    "one likelihood query": False,
    "likelihood queries": False,
    "the whole answer by likelihood": True,
    "identifying the cells": True,
    "a process that answers": True,
    "cold: semsig localize by likelihood": True,
    "peak memory of semsig localize": True,
    "files beside a database": True,
    "but for answering": True,
    "cold: semsig --help": True,
    "building and saving a database": True,
    "cold: semsig build of": True,
    "signatures of mean length": True,
    "opening the file of": True,
    "building footprints": False,
    "occlusion of": True,
    "outdoor cells with buildings": False,
    "by 2 processes": False,
    "peak memory of a process that builds": True,
    "growth of that memory": True,
    "reading every layer of a pbf file": True,
    "peak memory of reading": True,
}
# The same, if there are a browser and map files.
OF_MAPS = {
    "map of which": True,
    "in Chromium": True,
    "the longest frame of twenty": False,
}
FUSIONS = {f"one {measure}+{measure}:5% query" for measure in MEASURES}


FIGURES = [
    *("city", "cells", "queries", "distortion", "method", "setting"),
    *("p25", "p50", "p50_low", "p50_high", "recall10pct", "ms_per_query"),
]
SHARES = [
    *("p5", "p25", "p50", "p50_low", "p50_high", "recall10pct", "chance"),
    *("in_exact_region", "in_region", "region_mass", "coverage", "precision"),
    *("most_at_90", "most_at_95", "most_at_98"),
]
# Parts of the method and the setting of a row, and the number of rows with both.
ROWS = {
    ("edit+edit:5%, order kept", "on the grid"): 3,
    ("edit+edit:5%, sorted after the noise", "on the grid"): 3,
    ("noise generic, re-ranked", "answers only where sure"): 3,
    ("noise generic, re-ranked", "deg), modelled"): 1,
    ("noise generic, re-ranked", "deg), ignored"): 1,
    ("noise generic, re-ranked", "north unknown"): 1,
    ("noise generic, re-ranked", "route of"): 7,
    ("edit+edit:5%", "off the grid"): 2,
    ("noise generic, re-ranked, place in the cell unknown", "off the grid"): 1,
    ("noise generic, re-ranked, refined", "off the grid"): 1,
    ("noise medium", "on the grid"): 1,
    ("noise light", "on the grid"): 1,
    ("noise strong", "on the grid"): 1,
}


def run(module: str, out: Path) -> tuple[list[dict[str, Any]], str]:
    """Run the benchmarks of a module on small cities; return its rows and its output."""
    result = subprocess.run(
        f"{sys.executable} -W error -m {module} --size small --out {out}".split(),
        cwd=Path(__file__).parents[2],
        check=True,
        stdout=subprocess.PIPE,
        text=True,
        timeout=6 * PATIENCE_S,
    )
    return json.loads(out.read_text(encoding="utf-8")), result.stdout


def test_every_benchmark_runs_and_is_written(tmp_path: Path) -> None:
    results, _ = run("benchmarks", tmp_path / "results.json")
    names = [row["name"] for row in results]
    assert len(set(names)) == len(names)
    has_maps = shutil.which("chromedriver") and shutil.which("chromium") and page.available()
    for part, bar in {**PARTS, **(OF_MAPS if has_maps else {})}.items():
        bars = {row["bar"] is not None for row in results if part in row["name"]}
        assert bars == {bar}, part
    for row in results:
        assert " ".join(row) == "name unit ours peer peer_name ratio bar met paper"
        assert row["ratio"] == pytest.approx(row["peer"] / row["ours"], rel=0.01)
        assert row["met"] == (None if row["bar"] is None else row["ratio"] >= row["bar"])
        assert (row["paper"] is None) == (row["name"].split(",")[0] not in FUSIONS | SINGLES.keys())


def test_answers_are_saved_and_compared(tmp_path: Path) -> None:
    out = tmp_path / "answers.json"
    lines = []
    for options in (
        [str(out), "--size", "small", "--city", "Paris-like", "--views", "1"],
        ["--compare", str(out), str(out)],
    ):
        result = subprocess.run(
            [sys.executable, "-W", "error", "-m", "benchmarks.same_answers", *options],
            cwd=Path(__file__).parents[2],
            check=True,
            stdout=subprocess.PIPE,
            text=True,
            timeout=6 * PATIENCE_S,
        )
        lines = result.stdout.splitlines()
    assert lines[-1] == "all: of 9 answers, the same place 100.0%, chance 100.0%, elsewhere 100.0%"


@pytest.mark.usefixtures("browser", "map_files")
def test_screenshots_of_pages_are_written(tmp_path: Path) -> None:
    subprocess.run(
        f"{sys.executable} -m benchmarks.pictures --size small --map drift workbench "
        f"--out {tmp_path}".split(),
        cwd=Path(__file__).parents[2],
        check=False,  # slow frames are a failure
        timeout=6 * PATIENCE_S,
    )
    rows = json.loads((tmp_path / "pictures.json").read_text(encoding="utf-8"))
    assert Counter(row["map"] for row in rows) == {"drift": 2, "workbench": 2}
    files = Counter(path.name.partition("-")[0] for path in tmp_path.glob("*.png"))
    assert files == {"drift": 2, "workbench": 4}
    assert not any(row["errors"] or row["requests"] or row["violations"] for row in rows)


def test_a_command_runs_together_with_six_busy_processes() -> None:
    code = "import os, psutil; print(len(psutil.Process(os.getppid()).children())); exit(3)"
    result = subprocess.run(
        [*(sys.executable, "-m", "benchmarks.busy"), *(sys.executable, "-c", code)],
        cwd=Path(__file__).parents[2],
        check=False,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert (result.returncode, result.stdout) == (3, "7\n")  # the command is the seventh


def test_the_page_of_figures_is_current() -> None:
    names = ("accuracy", "results", "reproduction", "chances", "views", "bayes", "see_more")
    *others, limit, more = (read_rows(FOLDER / f"{name}.json") for name in names)
    page = tables.page(*others, bayes=limit, see_more=more)
    assert tables.PAGE.read_text(encoding="utf-8") == page
    trials = read_rows(FOLDER / "soak.json")
    page_of_trust = tables.TRUST.read_text(encoding="utf-8")
    assert page_of_trust == tables.trust_page(page_of_trust, trials)
    result = json.loads((FOLDER / "real_photographs.json").read_text(encoding="utf-8"))
    page_of_photographs = tables.PHOTOGRAPHS.read_text(encoding="utf-8")
    assert page_of_photographs == tables.photographs_page(page_of_photographs, result)


def test_accuracy_is_measured_and_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SEMSIG_GEODATA", raising=False)
    rows, printed = run("benchmarks.accuracy", tmp_path / "accuracy.json")
    assert "Montpellier is left out" in printed
    keys = [(row["city"], row["distortion"], row["method"], row["setting"]) for row in rows]
    assert len(set(keys)) == len(keys)
    for (method, setting), count in ROWS.items():
        assert sum(method in key[2] and setting in key[3] for key in keys) == count, method
    for row in rows:
        assert [name for name in row if name in FIGURES] == FIGURES
        assert all(0.0 <= row[name] <= 1.0 for name in SHARES if row[name] is not None)
        assert row["p50_low"] <= row["p50"] <= row["p50_high"]
        assert row["p5"] <= row["p25"] <= row["p50"]
        assert row["ms_per_query"] > 0.0
    bars = [bar for row in rows for bar in row["bars"]]
    assert f"of {len(bars)} bars met" in printed
    for bar in (bar for bar in bars if bar["met"]):
        assert bar["low"] is None or bar["value"] >= bar["low"]
        assert bar["high"] is None or bar["value"] <= bar["high"]


def test_chances_on_old_maps_are_measured_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("SEMSIG_GEODATA", raising=False)
    out = tmp_path / "chances.json"
    monkeypatch.setattr(sys, "argv", ["chances", "--size", "small", "--out", str(out)])
    chances.main()
    assert "Real cities are left out" in capsys.readouterr().out
    written = out.read_text(encoding="utf-8")
    rows = json.loads(written)
    assert [row[INPUTS] for row in rows] == [
        *("", "--map-age 3 --drift-report", "--map-age 3"),
    ]
    for row in rows:
        assert 0 <= row["right"] <= row["answered"] <= row["queries"] == 10
        assert sum(tenth["n"] for tenth in row["bins"]) <= 10
        assert row["bins"][-1]["n"] == row["answered"]
    chances.main()
    assert out.read_text(encoding="utf-8") == written
    assert "made up" not in capsys.readouterr().out


def test_views_are_measured_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("SEMSIG_GEODATA", raising=False)
    out = tmp_path / "views.json"
    every_line = [*views.lines()]
    lines = [*every_line[:16:5], *every_line[16:-2:7], every_line[-1]]
    monkeypatch.setattr(views, "lines", lambda: iter(lines))
    words = f"views --size small --queries 2 --processes 1 --out {out}"
    monkeypatch.setattr(sys, "argv", words.split())
    views.main()
    assert "Real cities are left out" in capsys.readouterr().out
    rows = json.loads(out.read_text(encoding="utf-8"))
    assert len(rows) == len(lines)
    for row in rows:
        assert 0.0 <= row["p50_low"] <= row["p50"] <= row["p50_high"] <= 1.0
        assert row["queries"] == sum(tenth["n"] for tenth in row["bins"]) == 2
    assert [row["photos"] for row in rows if LAST_ONLY in row] == [5]
    out.write_text(json.dumps(rows[:-1]), encoding="utf-8")
    views.main()  # measures the missing row
    assert json.loads(out.read_text(encoding="utf-8"))[:-1] == rows[:-1]
    page = tables.page([], [], [], [], rows, bayes=[])
    assert "as a full turn | sectors | sectors and ranges |" in page
    assert all(bar.what in page for _, bar in views.bars(rows))


def test_more_kinds_of_things_are_measured_once(
    geodata: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "see_more.json"
    monkeypatch.setattr(see_more, "ProcessPoolExecutor", lambda *_, **__: ThreadPoolExecutor(1))
    words = f"see_more --size small --geodata {geodata} --city Neukölln --north known --out {out}"
    lines = [see_more.TODAY, see_more.NAMES_READ]
    monkeypatch.setattr(sys, "argv", [*words.split(), "--line", lines[0], "--line", lines[1]])
    see_more.main()
    rows = json.loads(out.read_text(encoding="utf-8"))
    assert [row["line"] for row in rows] == lines
    for row in rows:
        assert 0 <= row["right"] <= row["answered"] <= row["queries"] == 5
        assert row["near_low"] <= row["near"] <= row["near_high"]
    assert rows[0]["objects"] < rows[1]["objects"]
    assert "Neukölln, the classes of before" in capsys.readouterr().out
    see_more.main()
    assert "within 50 m" not in capsys.readouterr().out
    page = tables.page([], [], [], [], [], bayes=[], see_more=rows)
    assert "| Neukölln | the classes of before |" in page
    assert all(bar.what in page for _, bar in see_more.bars(rows))


def test_the_upper_bound_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "bayes.json"
    monkeypatch.setattr(sys, "argv", f"bayes --size small --out {out}".split())
    bayes.main()
    rows = json.loads(out.read_text(encoding="utf-8"))
    lines = [(row["degrees"], row["ranges"]) for row in rows]
    assert lines == [*itertools.product((360, 120, 70), (False, True))]
    for row in rows:
        assert 0.0 < row["limit"] <= 1.0
        assert row["queries"] == 5
    assert "| 360 | no |" in tables.page([], [], [], [], [], bayes=rows)
    assert (FOLDER / "bayes.json").exists()


@given(st.integers(0, 10_000), st.integers(1, 4), st.integers(0, 4))
def test_associations_are_summed_exactly(seed: int, objects: int, detections: int) -> None:
    rng = np.random.default_rng(seed)
    weights = np.exp(rng.normal(0, 3, (objects, detections))) * (rng.random((1, detections)) < 0.8)
    expected, _ = every_association(weights)
    assert bayes.association_sum(weights) == pytest.approx(expected)


@pytest.mark.parametrize("seed", range(4))
def test_the_exact_likelihood_equals_the_oracle(seed: int) -> None:
    database = random_database(seed, cells=12, longest=4)
    view = random_view(
        database, np.random.default_rng(seed), size=3, photos=(Photo(sectors=((300, 60),)),)
    )
    plain = View(
        np.where(view.class_scores()[:, 0] > 0, 1, view.class_scores().argmax(axis=1)),
        view.bearings,
        ranges=None if view.ranges is None else np.where(np.isnan(view.ranges), 9.0, view.ranges),
        photos=view.photos,
    )
    loglik = bayes.ExactPosterior(database).loglik(plain)
    best = loglik.max()
    for cell in range(len(database)):
        exact = cell_loglik(database, plain, NOISE, cell)
        if np.isfinite(loglik[cell]):
            assert loglik[cell] == pytest.approx(exact, abs=1e-3)
        else:
            assert exact < best - 30.0


ROW = {"name": "a query, 10 cells", "unit": "ms", "ours": 2.0, "peer": 8.0, "peer_name": "cdist"}


def test_results_are_saved_by_commit(tmp_path: Path) -> None:
    rows = [ROW | {"bar": 3.0}]
    history.record(rows, commit="1" * 40, seconds=86_400, folder=tmp_path)
    slow = [rows[0] | {"ours": 4.0}, ROW | {"name": "a new one", "bar": None}]
    for _ in range(2):  # the second of a commit replaces the first
        history.record(slow, commit="2" * 40, seconds=3600, folder=tmp_path)
    early, late = history.runs(tmp_path)
    assert early.measured == {"a query, 10 cells": (4.0, 8.0), "a new one": (2.0, 8.0)}
    assert late.measured == {"a query, 10 cells": (2.0, 8.0)}
    lines = history.page(slow, [early, late]).splitlines()[-4:]
    assert lines == [
        "| benchmark | unit | 1970-01-01 01:00 | 1970-01-02 00:00 |",
        "| --- | --- | ---: | ---: |",
        "| a query, 10 cells | ms | 4 (2) | 2 (4) |",
        "| a new one | ms | 2 (4) |  |",
    ]
    picture = history.draw(slow, [early, late])
    assert "a query, 10 cells" in picture
    assert "a new one" not in picture


def test_commands_are_read_from_the_readme() -> None:
    readme = """`make bench` and

```
make demo     # first
$ semsig load monaco.osm.pbf --out a.parquet
the answer
make test     # later
semsig localize a.parquet "tree at 40" --map a.html
```

```console
semsig map a.parquet --out "a b.html"
semsig export a.parquet
```
"""
    assert stranger.commands(readme) == [
        "make demo",
        "semsig load monaco.osm.pbf --out a.parquet",
        "semsig localize a.parquet 'tree at 40' --map a.html",
        "semsig map a.parquet --out 'a b.html'",
    ]
