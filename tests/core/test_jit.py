from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from machine import PATIENCE_S
from numba.core.caching import CompileResultCacheImpl

from semsig_gis.core import compiled

if TYPE_CHECKING:
    import pytest


def test_without_a_cache_folder_code_is_compiled_in_each_process(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(CompileResultCacheImpl, "_locator_classes", [])
    assert compiled(lambda number: number + 1)(1) == 2


def test_later_processes_load_stored_code_without_the_compiler(tmp_path: Path) -> None:
    package = Path(__file__).parents[2]
    program = (
        "import sys\n"
        "import numpy as np\n"
        "from semsig_gis.localization.distance.metrics.edit import BitPlanes\n"
        "values = np.array([1, 2], np.uint8)\n"
        "print(BitPlanes.build(values, np.array([0, 2])).edit_distances([values]))\n"
        "from semsig_gis.localization.distance.kernels import scan\n"
        "print(sum(scan.stats.cache_hits.values()), sum(scan.stats.cache_misses.values()))\n"
        "print('numba.core.inline_closurecall' in sys.modules)\n"
    )
    outputs = [
        subprocess.run(
            [sys.executable, "-W", "error", "-c", program],
            check=True,
            capture_output=True,
            cwd=package,
            env={"NUMBA_CACHE_DIR": str(tmp_path), "PATH": ""},
            text=True,
            timeout=PATIENCE_S,
        ).stdout.split()
        for _ in range(2)
    ]
    assert outputs == [["[[0.]]", "0", "1", "True"], ["[[0.]]", "1", "0", "False"]]
