"""Estimates of memory and time, and errors where memory is short."""

from __future__ import annotations

import subprocess
import sys
import warnings
from typing import TYPE_CHECKING

import pyarrow as pa
import pytest
from sentences import refused

from semsig_gis.core import InputError, resources
from semsig_gis.database import save_database

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis import SignatureDatabase

needs_limits = pytest.mark.skipif(sys.platform == "win32", reason="no such limits")

READ_WITH_LITTLE_MEMORY = """
import resource, sys
from pathlib import Path
from semsig_gis.storage.geoparquet import read_geoparquet
pages = int(Path("/proc/self/statm").read_text().split()[0])
limit = pages * resource.getpagesize() + int(sys.argv[2]) * 2**20
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
try:
    read_geoparquet(sys.argv[1], kind="signature database")
except MemoryError as error:
    print("short:", error)
"""


def test_too_large_work_is_refused_with_both_sizes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resources, "free_memory", lambda: 2_000_000_000)
    resources.require_memory(1.9e9, "this", advice="take less")
    with refused(InputError, "this would take about 2.1 GB", "2.0 GB are free", "take less"):
        resources.require_memory(2.1e9, "this", advice="take less")


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (61.0, "a minute"),
        (250.0, "4 minutes"),
        (7000.0, "1 h 57 min"),
        (1e7, "2,777 h 47 min"),
    ],
)
def test_long_work_is_announced(seconds: float, text: str) -> None:
    with pytest.warns(UserWarning, match=f"^building will take about {text}$"):
        resources.announce(seconds, "building")


def test_short_work_is_not_announced() -> None:
    with warnings.catch_warnings(action="error"):
        resources.announce(59.0, "building")


def test_limit_of_the_control_group_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, text in {"usage": "300\n", "limit": "1000\n", "unlimited": "max\n"}.items():
        (tmp_path / name).write_text(text)
    assert resources.free_memory() > 10_000
    files = [(tmp_path / "usage", tmp_path / name) for name in ("unlimited", "missing", "limit")]
    monkeypatch.setattr(resources, "CGROUP_FILES", files[:2])
    assert resources.free_memory() > 10_000
    monkeypatch.setattr(resources, "CGROUP_FILES", files)
    assert resources.free_memory() == 700


@needs_limits
def test_limit_of_the_process_counts() -> None:
    code = (
        "import resource\n"
        "from semsig_gis.core.resources import free_memory\n"
        "resource.setrlimit(resource.RLIMIT_AS, (2**30, 2**30))\n"
        "print(free_memory() < 2**30)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "True\n"


@needs_limits
@pytest.mark.skipif(
    int(pa.__version__.partition(".")[0]) < 26,
    reason="Arrow 25 and older end the process where they cannot launch a thread",
)
def test_short_memory_is_not_reported_as_a_damaged_file(
    demo_database: SignatureDatabase, tmp_path: Path
) -> None:
    path = tmp_path / "city.parquet"
    save_database(demo_database, path)
    for megabytes in (0, 1):
        call = [sys.executable, "-c", READ_WITH_LITTLE_MEMORY, str(path), str(megabytes)]
        run = subprocess.run(call, capture_output=True, text=True, check=True)
        assert run.stdout.startswith("short: "), run


def test_messages_of_short_memory_become_memory_errors() -> None:
    for error in (
        OSError("Memory mapping file failed: Cannot allocate memory"),
        pa.ArrowException("Failed to launch worker thread: Resource temporarily unavailable"),
        pa.ArrowMemoryError("realloc of size 262144 failed"),
    ):
        with pytest.raises(MemoryError, match=str(error)):
            resources.raise_if_short(error)
    resources.raise_if_short(OSError("Invalid: it is something else"))


@needs_limits
def test_limit_is_checked_before_the_compiler_is_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    import resource

    resources.require_address_space(2**60, "this")  # no limit
    monkeypatch.setattr(resource, "getrlimit", lambda _: (2**20, 2**20))
    with pytest.raises(MemoryError, match="this takes 1,000 MB, and the limit leaves 0 MB"):
        resources.require_address_space(10**9, "this")
    monkeypatch.setattr(resource, "getrlimit", lambda _: (2**60, resource.RLIM_INFINITY))
    resources.require_address_space(10**9, "this")
