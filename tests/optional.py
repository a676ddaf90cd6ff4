"""What a machine may lack, and what becomes of the tests that need it."""

from __future__ import annotations

import os
from typing import NoReturn

import pytest

# What a machine may lack. A test that needs one of them skips, with the reason, unless the
# environment variable SEMSIG_REQUIRE names it: then the missing thing is a failure.
OPTIONAL = frozenset({"browser", "geodata", "qgis"})


def required() -> frozenset[str]:
    """Return the names that SEMSIG_REQUIRE lists, separated by commas."""
    listed = os.environ.get("SEMSIG_REQUIRE", "").split(",")
    return frozenset(name.strip() for name in listed if name.strip())


def unavailable(name: str, reason: str) -> NoReturn:
    """Skip the test, or fail it where SEMSIG_REQUIRE names the missing thing."""
    if name not in OPTIONAL:
        msg = f"{name!r} is not one of {sorted(OPTIONAL)}"
        raise LookupError(msg)
    if name in required():
        pytest.fail(f"{reason} (SEMSIG_REQUIRE names {name})", pytrace=False)
    pytest.skip(reason)
