"""Number of parallel test processes, and the made-up town for the examples in docstrings."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from semsig_gis import SignatureDatabase, StreetObjects


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Return one more worker than processors: many tests wait for browsers and other programs."""
    return (os.cpu_count() or 1) + 1


@pytest.fixture(scope="session")
def demo_objects() -> StreetObjects:
    """Return the street objects of a town of 300 m by 300 m, in EPSG:32631."""
    from semsig_gis import CitySpec, build_objects, paper_taxonomy, synthetic_city

    layers = synthetic_city(CitySpec(size=300.0))
    return build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")[0]


@pytest.fixture(scope="session")
def demo_database(demo_objects: StreetObjects) -> SignatureDatabase:
    """Return the database of the signatures of its cells."""
    from semsig_gis import build_database

    return build_database(demo_objects)


@pytest.fixture(autouse=True)
def _examples(request: pytest.FixtureRequest, doctest_namespace: dict[str, Any]) -> None:
    """Give `demo_objects` and `demo_database` to the examples of docstrings."""
    if isinstance(request.node, pytest.DoctestItem):
        for name in ("demo_objects", "demo_database"):
            doctest_namespace[name] = request.getfixturevalue(name)
