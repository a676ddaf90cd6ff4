from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest


def test_every_benchmark_runs_and_is_written(tmp_path: Path) -> None:
    out = tmp_path / "results.json"
    checkout = Path(__file__).parents[1]
    subprocess.run(
        [sys.executable, "-W", "error", "-m", "benchmarks", "--size", "small", "--out", str(out)],
        cwd=checkout,
        check=True,
        timeout=300,
    )
    results = json.loads(out.read_text(encoding="utf-8"))
    assert len(results) == len({one["name"] for one in results}) == 12
    for one in results:
        assert list(one) == [
            "name",
            "unit",
            "ours",
            "peer",
            "peer_name",
            "ratio",
            "bar",
            "met",
        ]
        assert one["ratio"] == pytest.approx(one["peer"] / one["ours"], rel=0.01)
        assert one["met"] == (None if one["bar"] is None else one["ratio"] >= one["bar"])
    assert sum(one["bar"] is not None for one in results) == 6
