"""A browser with a page, and an evaluated city to show in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from map_pages import MapPage, assert_quiet

from semsig_gis.database.build import build_database
from semsig_gis.evaluation.evaluate import evaluate
from semsig_gis.maps.evaluation import evaluation_map
from semsig_gis.objects.load import build_objects
from semsig_gis.sources.catalog import paper_taxonomy
from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from selenium.webdriver import Chrome

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.evaluation.result import Evaluation


@pytest.fixture
def page(browser: Chrome, tmp_path: Path, carried: None) -> Iterator[MapPage]:  # noqa: ARG001
    """Return a page to open a map in, which must report no error and ask for nothing."""
    yield MapPage(browser, tmp_path)
    assert_quiet(browser)


@pytest.fixture(scope="session")
def database() -> SignatureDatabase:
    layers = synthetic_city(CitySpec(size=600.0))
    objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    return build_database(objects)


@pytest.fixture(scope="session")
def evaluation(database: SignatureDatabase) -> Evaluation:
    """Return an evaluation of 60 queries in the city."""
    return evaluate(database, queries=60, distortion="medium", seed=1)


@pytest.fixture
def evaluated(page: MapPage, evaluation: Evaluation, database: SignatureDatabase) -> MapPage:
    """Return the page with the map of the evaluation."""
    page.open(evaluation_map(evaluation, database))
    return page
