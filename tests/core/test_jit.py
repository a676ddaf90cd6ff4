from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numba
import numpy as np

from semsig_gis.core.jit import compiled
from semsig_gis.matching.metrics.edit import BitPlanes

if TYPE_CHECKING:
    import pytest


def test_without_a_folder_for_the_code_it_is_compiled_for_this_process(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    njit = numba.njit

    def refuse(*function: Any, cache: bool = False, **options: Any) -> Any:  # noqa: ANN401
        if cache:
            message = "cannot cache function: no locator available"
            raise RuntimeError(message)
        return njit(*function, **options)

    monkeypatch.setattr(numba, "njit", refuse)
    assert compiled(lambda number: number + 1)(1) == 2


def test_code_is_kept_for_later_processes(tmp_path: Path) -> None:
    package = Path(__file__).parents[2]
    program = (
        "import numpy as np\n"
        "from semsig_gis.matching.metrics.edit import BitPlanes\n"
        "values = np.array([1, 2], np.uint8)\n"
        "print(BitPlanes.build(values, np.array([0, 2])).edit_distances([values]))\n"
        "from semsig_gis.matching.kernels import scan\n"
        "print(sum(scan.stats.cache_hits.values()), sum(scan.stats.cache_misses.values()))\n"
    )
    seen = [
        subprocess.run(
            [sys.executable, "-W", "error", "-c", program],
            check=True,
            capture_output=True,
            cwd=package,
            env={"NUMBA_CACHE_DIR": str(tmp_path), "PATH": ""},
            text=True,
            timeout=120,
        ).stdout.split()
        for _ in range(2)
    ]
    assert seen == [["[[0.]]", "0", "1"], ["[[0.]]", "1", "0"]]


def test_what_is_compiled_equals_the_loops_themselves() -> None:
    from semsig_gis.matching import kernels

    rng = np.random.default_rng(1)
    values = rng.integers(0, 5, 60).astype(np.uint8)
    offsets = np.array([0, 3, 20, 60])
    planes = BitPlanes.build(values, offsets)
    slow = np.zeros_like(planes.planes)
    per_position = int(planes.digits.max()) + 1
    kernels.pack.py_func(  # type: ignore[attr-defined]
        values, offsets, planes.digits, planes.bounds, per_position, slow
    )
    np.testing.assert_array_equal(slow, planes.planes)
