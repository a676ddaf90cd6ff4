"""Estimates of memory and time."""

from __future__ import annotations

import subprocess
import sys
import warnings
from typing import TYPE_CHECKING

import pytest
from sentences import refused

from semsig_gis.core import InputError, effort

if TYPE_CHECKING:
    from pathlib import Path


def test_what_does_not_fit_is_refused_with_the_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(effort, "free_memory", lambda: 2_000_000_000)
    effort.require_memory(1.9e9, "this", advice="take less")
    with refused(InputError, "this would take about 2.1 GB", "2.0 GB are free", "take less"):
        effort.require_memory(2.1e9, "this", advice="take less")


@pytest.mark.parametrize(
    ("seconds", "said"), [(601.0, "10 min"), (7000.0, "1 h 57 min"), (1e7, "2,777 h 47 min")]
)
def test_long_work_is_announced(seconds: float, said: str) -> None:
    with pytest.warns(UserWarning, match=f"^building will take about {said}$"):
        effort.announce(seconds, "building")


def test_short_work_is_not_announced() -> None:
    with warnings.catch_warnings(action="error"):
        effort.announce(599.0, "building")


def test_a_group_of_processes_has_its_own_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, text in {"used": "300\n", "most": "1000\n", "none": "max\n"}.items():
        (tmp_path / name).write_text(text)
    free = effort.free_memory()
    assert free > 10_000
    groups = [(tmp_path / "used", tmp_path / most) for most in ("none", "nowhere", "most")]
    monkeypatch.setattr(effort, "GROUPS", groups[:2])
    assert effort.free_memory() > 10_000
    monkeypatch.setattr(effort, "GROUPS", groups)
    assert effort.free_memory() == 700


@pytest.mark.skipif(sys.platform == "win32", reason="no such limits")
def test_a_limit_of_the_process_counts() -> None:
    code = (
        "import resource\n"
        "from semsig_gis.core.effort import free_memory\n"
        "resource.setrlimit(resource.RLIMIT_AS, (2**30, 2**30))\n"
        "print(free_memory() < 2**30)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "True\n"
