"""A few trials of `benchmarks.soak`: no file is lost, every refusal is one sentence."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from machine import PATIENCE_S


@pytest.mark.skipif(sys.platform != "linux", reason="forks, and mounts disks")
def test_some_of_the_soak(tmp_path: Path) -> None:
    out = tmp_path / "soak.json"
    result = subprocess.run(
        [*(sys.executable, "-m", "benchmarks.soak"), *f"--share 0.0086 --out {out}".split()],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        check=False,
        text=True,
        timeout=6 * PATIENCE_S,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    rows = {row["part"]: row for row in json.loads(out.read_text(encoding="utf-8"))}
    assert rows["kills"]["cases"] == 6
    assert rows["damaged files"]["cases"] >= 350
    assert all(row["clean"] == row["cases"] for row in rows.values())
