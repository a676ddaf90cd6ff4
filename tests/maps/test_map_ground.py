"""Streets and buildings below a map, in a real browser."""

from __future__ import annotations

from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
import shapely
from map_pages import assert_quiet, drawn, opened, switch
from selenium.webdriver.common.by import By
from sentences import assert_sentence
from worlds import random_town

from semsig_gis.core.errors import CrsError, EmptyResultError
from semsig_gis.maps.localization import localization_map
from semsig_gis.maps.objects import ground_map, objects_map
from semsig_gis.maps.page import save_map
from semsig_gis.matching.search import localize

if TYPE_CHECKING:
    from pathlib import Path

    from selenium.webdriver import Chrome

    from semsig_gis.database.database import SignatureDatabase

BOARD = ".leaflet-tile-pane canvas.semsig-board"
HOUSE, STREET = "#e4ded3", "#cfd3d8"
WORLD = random_town()


@pytest.fixture(scope="module")
def database() -> SignatureDatabase:
    return WORLD.database


def table(*shapes: shapely.Geometry | None, crs: str | None = "EPSG:2154") -> gpd.GeoDataFrame:
    return gpd.GeoDataFrame(geometry=list(shapes), crs=crs)


def square(x: float, y: float, side: float) -> shapely.Polygon:
    return shapely.box(765_300.0 + x, 6_275_100.0 + y, 765_300.0 + x + side, 6_275_100.0 + y + side)


@pytest.mark.usefixtures("carried")
def test_buildings_and_streets_in_a_browser(browser: Chrome, tmp_path: Path) -> None:
    court = shapely.difference(square(0, 0, 100), square(25, 25, 50))
    lane = shapely.LineString([(765_280.0, 6_275_090.0), (765_420.0, 6_275_090.0)])
    opened(
        browser,
        ground_map(buildings=table(court, None), streets=table(lane)),
        tmp_path,
    )
    assert browser.title == "Streets and buildings"
    house, street = drawn(browser, HOUSE, BOARD), drawn(browser, STREET, BOARD)
    assert house > 5000
    # The courtyard is a quarter of the square, the street 140 m by 6 m.
    assert street / house == pytest.approx(140.0 * 6.0 / 7500.0, rel=0.15)
    browser.find_element(By.CSS_SELECTOR, ".semsig-colours").click()
    assert drawn(browser, HOUSE, BOARD) == 0
    assert drawn(browser, "#272b30", BOARD) == pytest.approx(house, rel=0.02)
    switch(browser, "Streets and buildings")
    assert browser.find_elements(By.CSS_SELECTOR, BOARD) == []
    switch(browser, "Streets and buildings")
    assert drawn(browser, "#272b30", BOARD) > 0
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_the_ground_lies_below_all_else(
    browser: Chrome, database: SignatureDatabase, tmp_path: Path
) -> None:
    x, y = database.xy.mean(axis=0)
    house = table(shapely.box(x - 50, y - 50, x + 50, y + 50))
    house.attrs["licenses"] = ["Mapper (CC0)"]
    chosen = localization_map(localize(database, database.signature(0), top=3), database)
    chosen = objects_map(WORLD.street_objects, map_=chosen)
    assert ground_map(buildings=house, map_=chosen) is chosen
    opened(browser, chosen, tmp_path)
    assert browser.title == "Candidate places"
    order = """
    return [...document.querySelectorAll('.leaflet-tile-pane > *')].map(
      (one) => [one.tagName, Number(getComputedStyle(one).zIndex)]);
    """
    layers = dict(browser.execute_script(order))
    assert layers["CANVAS"] > layers["IMG"]  # of the cells, on which streets are seen
    credit = browser.find_element(By.CSS_SELECTOR, ".leaflet-control-attribution")
    said = browser.execute_script("return arguments[0].textContent", credit)
    assert "Mapper (CC0)" in said
    assert str(WORLD.street_objects.licenses[0]) in said
    assert_quiet(browser)


def test_a_city_of_sixty_thousand_buildings_is_a_small_page(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    size = 60_000
    corners = np.array([[0, 0], [12, 0], [12, 6], [9, 6], [9, 14], [3, 14], [3, 9], [0, 9]])
    turn = rng.random(size) * np.pi
    turns = np.stack([np.cos(turn), -np.sin(turn), np.sin(turn), np.cos(turn)], axis=1)
    middles = 765_000.0 + 10_000.0 * rng.random((size, 1, 2))
    rings = middles + np.einsum("sij,pj->spi", turns.reshape(-1, 2, 2), corners)
    houses = gpd.GeoDataFrame(geometry=shapely.polygons(rings), crs="EPSG:2154")
    save_map(ground_map(buildings=houses), tmp_path / "map.html", self_contained=False)
    assert (tmp_path / "map.html").stat().st_size < 3_000_000


def test_only_what_is_in_the_box(tmp_path: Path) -> None:
    sizes = []
    many = table(*(square(30.0 * at, 0.0, 20.0) for at in range(200)))
    for box in (None, (765_300.0, 6_275_100.0, 765_600.0, 6_275_200.0)):
        save_map(ground_map(buildings=many, box=box), tmp_path / "map.html", self_contained=False)
        sizes.append((tmp_path / "map.html").stat().st_size)
    assert sizes[1] < sizes[0]
    with pytest.raises(EmptyResultError) as caught:
        ground_map(buildings=many, box=(0.0, 0.0, 1.0, 1.0))
    assert_sentence(caught.value, "streets or buildings")


def test_what_cannot_be_drawn() -> None:
    house = table(square(0, 0, 10))
    with pytest.raises(EmptyResultError):
        ground_map()
    with pytest.raises(EmptyResultError):
        ground_map(buildings=table(None))
    lane = shapely.LineString([(3.0, 43.0), (3.1, 43.0)])
    for other in (table(lane, crs="EPSG:4326"), table(lane, crs=None)):
        with pytest.raises(CrsError) as caught:
            ground_map(buildings=house, streets=other)
        assert_sentence(caught.value, "one CRS")
