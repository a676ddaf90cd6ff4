"""What is said where memory is short."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import pyarrow as pa
import pytest

from semsig_gis.core import raise_if_short, require_address_space
from semsig_gis.database import save_database

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis import SignatureDatabase

resource = pytest.importorskip("resource")

PROGRAM = """
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


@pytest.mark.skipif(
    int(pa.__version__.partition(".")[0]) < 26,
    reason="Arrow 25 and older end the process where they cannot launch a thread",
)
def test_a_file_is_not_called_damaged_where_memory_is_short(
    demo_database: SignatureDatabase, tmp_path: Path
) -> None:
    path = tmp_path / "city.parquet"
    save_database(demo_database, path)
    for megabytes in (0, 1):
        call = [sys.executable, "-c", PROGRAM, str(path), str(megabytes)]
        done = subprocess.run(call, capture_output=True, text=True, check=True)
        assert done.stdout.startswith("short: "), done


def test_errors_that_say_so_become_memory_errors() -> None:
    for error in (
        OSError("Memory mapping file failed: Cannot allocate memory"),
        pa.ArrowException("Failed to launch worker thread: Resource temporarily unavailable"),
        pa.ArrowMemoryError("realloc of size 262144 failed"),
    ):
        with pytest.raises(MemoryError, match=str(error)):
            raise_if_short(error)
    raise_if_short(OSError("Invalid: it is something else"))


def test_a_limit_is_looked_at_before_the_compiler_is_loaded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    require_address_space(2**60, "this")  # no limit
    monkeypatch.setattr(resource, "getrlimit", lambda _: (2**20, 2**20))
    with pytest.raises(MemoryError, match="this takes 1,000 MB, and the limit leaves 0 MB"):
        require_address_space(10**9, "this")
    monkeypatch.setattr(resource, "getrlimit", lambda _: (2**60, resource.RLIM_INFINITY))
    require_address_space(10**9, "this")
