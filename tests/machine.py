"""What a machine may lack: programs and data, room on its disk, and time."""

from __future__ import annotations

import os
import resource
from contextlib import contextmanager
from typing import TYPE_CHECKING, Literal, NoReturn

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

PATIENCE_S = 300.0
"""What takes longer hangs, on the busiest machine, too; programs that do much have six times it."""

Part = Literal["browser", "geodata", "qgis"]
"""A test that needs one of them skips where it is missing, unless SEMSIG_REQUIRE names it."""


def required() -> frozenset[str]:
    """Return the names that SEMSIG_REQUIRE lists, separated by commas."""
    listed = os.environ.get("SEMSIG_REQUIRE", "").split(",")
    return frozenset(name.strip() for name in listed) - {""}


def unavailable(name: Part, reason: str) -> NoReturn:
    """Skip the test, or fail it where SEMSIG_REQUIRE names the missing thing."""
    if name in required():
        pytest.fail(f"{reason} (SEMSIG_REQUIRE names {name})", pytrace=False)
    pytest.skip(reason)


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Let this process write no file beyond a size, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def qgis_variables(home: Path) -> dict[str, str]:
    """Return a clean environment for QGIS, without a screen and with a profile of its own.

    Nothing is inherited: our PYTHONPATH, GDAL_DATA or PROJ_LIB would crash QGIS's own Python.
    """
    return {
        "HOME": str(home),
        "LANG": "C.UTF-8",
        "PATH": os.defpath,
        "QGIS_CUSTOM_CONFIG_PATH": str(home / "profile"),
        "QT_QPA_PLATFORM": "offscreen",
        "XDG_RUNTIME_DIR": str(home),
    }
