"""Optional programs and data of a machine, and limits of its disk and time."""

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
"""Timeout on the busiest machine; long programs have six times as much."""

Part = Literal["browser", "geodata", "qgis"]
"""A test that needs one of them is skipped if it is missing, unless SEMSIG_REQUIRE names it."""


def required() -> frozenset[str]:
    """Return the names in SEMSIG_REQUIRE, separated by commas."""
    listed = os.environ.get("SEMSIG_REQUIRE", "").split(",")
    return frozenset(name.strip() for name in listed) - {""}


def unavailable(name: Part, reason: str) -> NoReturn:
    """Skip the test, or fail it if SEMSIG_REQUIRE names the missing part."""
    if name in required():
        pytest.fail(f"{reason} (SEMSIG_REQUIRE names {name})", pytrace=False)
    pytest.skip(reason)


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Limit the size of files that this process writes, to simulate a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def qgis_variables(home: Path) -> dict[str, str]:
    """Return a clean environment for QGIS, without a screen and with a separate profile.

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
