from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

FIGURES = [
    *("city", "cells", "queries", "distortion", "method", "setting"),
    *("p25", "p50", "p50_low", "p50_high", "recall10pct", "ms_per_query"),
]
SHARES = [
    *("p5", "p25", "p50", "p50_low", "p50_high", "recall10pct", "chance"),
    *("in_exact_region", "in_region", "region_mass", "coverage", "precision"),
]
# Words of the method and of the setting, and how many rows have both.
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


def test_every_figure_is_measured_and_written(tmp_path: Path) -> None:
    out = tmp_path / "accuracy.json"
    environment = {name: value for name, value in os.environ.items() if name != "SEMSIG_GEODATA"}
    done = subprocess.run(
        f"{sys.executable} -W error -m benchmarks.accuracy --size small --out {out}".split(),
        cwd=Path(__file__).parents[2],
        env=environment,
        check=True,
        capture_output=True,
        text=True,
        timeout=300,
    )
    rows = json.loads(out.read_text(encoding="utf-8"))
    assert "Montpellier is left out" in done.stdout
    named = [(one["city"], one["distortion"], one["method"], one["setting"]) for one in rows]
    assert len(set(named)) == len(named)
    for (method, setting), count in ROWS.items():
        assert sum(method in one[2] and setting in one[3] for one in named) == count, method
    for one in rows:
        assert [name for name in one if name in FIGURES] == FIGURES
        assert all(0.0 <= one[name] <= 1.0 for name in SHARES if one[name] is not None)
        assert one["p50_low"] <= one["p50"] <= one["p50_high"]
        assert one["p5"] <= one["p25"] <= one["p50"]
        assert one["ms_per_query"] > 0.0
    bars = [bar for one in rows for bar in one["bars"]]
    assert f"of {len(bars)} bars met" in done.stdout
    for bar in (bar for bar in bars if bar["met"]):
        assert bar["low"] is None or bar["value"] >= bar["low"]
        assert bar["high"] is None or bar["value"] <= bar["high"]
