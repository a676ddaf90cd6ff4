"""A browser page, and the map of an evaluation in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from map_pages import MapPage, assert_quiet
from small_city import small_city, small_evaluation

from semsig_gis.output import ambiguity_map, evaluation_map, save_map

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from selenium.webdriver import Chrome


@pytest.fixture
def page(browser: Chrome, tmp_path: Path, map_files: None) -> Iterator[MapPage]:  # noqa: ARG001
    """Return a page to open a map in, which must report no error and request nothing."""
    yield MapPage(browser, tmp_path)
    assert_quiet(browser)


@pytest.fixture(scope="session")
def evaluation_address(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the address of a page with the map of an evaluation."""
    file = tmp_path_factory.mktemp("evaluation") / "map.html"
    save_map(evaluation_map(small_evaluation("medium"), small_city()[0]), file, self_contained=True)
    return file.as_uri()


@pytest.fixture
def evaluation_page(page: MapPage, evaluation_address: str) -> MapPage:
    """Return the page with the map of an evaluation."""
    page.visit(evaluation_address)
    return page


@pytest.fixture
def ambiguity_page(page: MapPage) -> MapPage:
    """Return the page with the map of the cells of a small city that look the same."""
    page.open(ambiguity_map(small_city()[0]))
    return page
