"""What tests of sources share: a server on this machine, a cache, and requests without pauses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from machine import PATIENCE_S
from servers import Server

from semsig_gis.sources import Cache, HttpSpec

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@pytest.fixture
def server() -> Iterator[Server]:
    with Server() as running:
        yield running


@pytest.fixture
def cache(tmp_path: Path) -> Cache:
    return Cache(tmp_path / "cache")


@pytest.fixture
def slept() -> list[float]:
    return []


@pytest.fixture
def quick(slept: list[float]) -> HttpSpec:
    """Return a specification that does not sleep, but says in `slept` how long it would."""
    return HttpSpec(timeout=(PATIENCE_S, PATIENCE_S), attempts=3, backoff_s=1.0, sleep=slept.append)
