"""What all maps share: boxes, search, layers, and refusals."""

from __future__ import annotations

import dataclasses
from functools import partial
from importlib import resources
from typing import TYPE_CHECKING

import folium
import geopandas as gpd
import numpy as np
import pytest
import shapely
from folium.template import Template
from hypothesis import given, settings
from hypothesis import strategies as st
from map_pages import HOSTILE, LEGEND, hostile_database
from pyproj import CRS, Transformer
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait
from sentences import refused
from small_city import chances_of
from worlds import random_town

from semsig_gis.core.errors import CrsError, EmptyResultError, InputError
from semsig_gis.core.signature import Signature
from semsig_gis.core.signs import FAILED, SUCCESSFUL
from semsig_gis.evaluation.evaluate import evaluate
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.locate import locate
from semsig_gis.likelihood.noise.model import named_noise
from semsig_gis.maps.cells import ambiguity_map, identifiability_map
from semsig_gis.maps.drift import drift_map
from semsig_gis.maps.evaluation import evaluation_map
from semsig_gis.maps.location import localization_map, location_map
from semsig_gis.maps.objects import ground_map, objects_map
from semsig_gis.maps.parts import _area, layers_of, page_element, to_latlon
from semsig_gis.matching.search import localize
from semsig_gis.objects.table import StreetObjects
from semsig_gis.queries.distortions import MissingClasses
from semsig_gis.queries.draw import QuerySpec
from semsig_gis.sources.catalog import paper_taxonomy

if TYPE_CHECKING:
    from collections.abc import Callable

    from map_pages import MapPage

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.evaluation.result import Evaluation

WORLD = random_town()
CITY, OBJECTS = WORLD.database, WORLD.street_objects
HOUSE = gpd.GeoDataFrame(geometry=[shapely.box(765_300, 6_275_100, 765_320, 6_275_120)], crs=2154)
NO_PLACE = gpd.GeoDataFrame(geometry=[None], crs=2154)
LANE = gpd.GeoDataFrame(geometry=[shapely.LineString([(3.0, 43.0), (3.1, 43.0)])], crs=4326)
EVALUATION = evaluate(CITY, queries=5)
LOCALIZATION = localize(CITY, CITY.signature(0), top=5)
LOCATION = locate(build_index(CITY, named_noise("light")), CITY.signature(0), top=5)
TOLD, OTHER_TOLD = chances_of(CITY), chances_of(CITY.select(slice(1, None)))
OTHER_CITY = dataclasses.replace(CITY, rows=CITY.rows + 10_000)
OTHER_SIGHT = dataclasses.replace(CITY, codes=CITY.codes[::-1].copy())
NO_OBJECTS = dataclasses.replace(OBJECTS, table=OBJECTS.table.iloc[:0])
NOWHERE, FAR = LANE.set_crs(None, allow_override=True), (0.0, 0.0, 1.0, 1.0)
BROWSER_FILES = sorted(
    one.name for one in resources.files("semsig_gis.maps").joinpath("js").iterdir()
)


MAPS: dict[str, tuple[Callable[..., folium.Map], set[str]]] = {
    "evaluation": (
        partial(evaluation_map, EVALUATION, CITY),
        {"Expected errors", "Lines from true to estimated places"},
    ),
    "localization": (partial(localization_map, LOCALIZATION, CITY), {"Candidates (5)"}),
    "location": (
        partial(location_map, LOCATION),
        {"Best place", "Chance of a cell", "Candidates (5)"},
    ),
    "ambiguity": (
        partial(ambiguity_map, CITY),
        {"Same types", "Same types and angle levels", "Tell of a cell when clicked"},
    ),
    "identifiability": (
        partial(identifiability_map, TOLD),
        {"Chance to be found", "Tell of a cell when clicked"},
    ),
    "drift": (
        partial(drift_map, CITY, CITY),
        {"Cells that are the same", "Tell of a cell when clicked"},
    ),
    "objects": (partial(objects_map, OBJECTS), set()),
    "ground": (partial(ground_map, buildings=HOUSE), {"Streets and buildings"}),
}


@pytest.mark.parametrize("name", MAPS)
def test_a_map_of_ones_own_is_drawn_on_twice_and_keeps_its_view(name: str) -> None:
    draw, layers = MAPS[name]
    own = folium.Map([43.0, 3.0], zoom_start=12, tiles=None)
    assert draw(map_=own) is own
    assert draw(map_=own) is own
    names = [getattr(child, "layer_name", "") for child in layers_of(own).values()]
    assert layers | {f"{layer}, 2" for layer in layers} <= set(names)
    assert names.count("Objects seen from a cell") <= 1
    body = own.get_root().render().partition("</head>")[2]
    assert "fitBounds(null" not in body
    assert "NaN" not in body


@pytest.mark.parametrize("name", sorted(MAPS.keys() - {"ground"}))
def test_tiles_are_those_of_folium_and_of_a_new_map(name: str) -> None:
    draw, _ = MAPS[name]
    assert "tile.openstreetmap.org" in draw(tiles="OpenStreetMap").get_root().render()
    with refused(InputError, "Openstreetmop", "OpenStreetMap"):
        draw(tiles="Openstreetmop")
    with refused(InputError, "OpenStreetMap"):
        draw(tiles="OpenStreetMap", map_=folium.Map(tiles=None))


@pytest.mark.parametrize(
    ("draw", "error", "words"),
    [
        (partial(evaluation_map, EVALUATION, CITY.select(slice(9))), InputError, "evaluat"),
        (partial(localization_map, LOCALIZATION, OTHER_CITY), InputError, "localization"),
        (partial(localization_map, LOCALIZATION, OTHER_SIGHT), InputError, "localization"),
        (partial(ambiguity_map, CITY.select(slice(0))), InputError, "no cells"),
        (partial(ambiguity_map, CITY, identifiability=OTHER_TOLD), InputError, "other cells"),
        (partial(objects_map, NO_OBJECTS), EmptyResultError, "no street object"),
        (ground_map, EmptyResultError, "streets or buildings"),
        (partial(ground_map, buildings=NO_PLACE), EmptyResultError, "streets or buildings"),
        (partial(ground_map, buildings=HOUSE, box=FAR), EmptyResultError, "streets or buildings"),
        (partial(ground_map, buildings=HOUSE, streets=LANE), CrsError, "one CRS"),
        (partial(ground_map, buildings=HOUSE, streets=NOWHERE), CrsError, "one CRS"),
    ],
)
def test_what_cannot_be_drawn(
    draw: Callable[[], folium.Map], error: type[Exception], words: str
) -> None:
    with refused(error, words):
        draw()


@pytest.mark.parametrize("file", BROWSER_FILES)
def test_style_and_script_are_no_templates_themselves(file: str) -> None:
    element = page_element(file)
    assert Template(element).render() == element
    assert element.count("</") == 1


def test_hostile_data_is_shown_word_for_word_and_never_run(
    page: MapPage, evaluation: Evaluation, database: SignatureDatabase
) -> None:
    harmful = hostile_database(database)
    spec = QuerySpec(distortions=(MissingClasses(classes=(HOSTILE,)),))
    map_ = evaluation_map(dataclasses.replace(evaluation, asked=spec), harmful)
    query = Signature(harmful.signature(0).codes, None)
    localization_map(localize(harmful, query, top=3), harmful, map_=map_)
    page.open(map_)
    texts = [str(one.get_property("textContent")) for one in page.all(LEGEND)]
    assert sorted(text.count(HOSTILE) for text in texts) == [2, 3]
    page.ask("circles(arguments[0])[0].openPopup()", FAILED)
    symbol = evaluation.queries["types"][~evaluation.successful].iloc[0][0]
    assert f"{symbol} {symbol} {HOSTILE}" in page.text(".semsig-details")
    page.assert_text_stays_text()


@pytest.mark.parametrize("screen", [(390, 800), (844, 390), (720, 600)])
def test_a_small_screen_is_not_covered(
    page: MapPage, evaluation: Evaluation, database: SignatureDatabase, screen: tuple[int, int]
) -> None:
    map_ = evaluation_map(evaluation, database)
    localization_map(localize(database, database.signature(0), top=3), database, map_=map_)
    with page.screen(*screen):
        page.open(map_)
        legends = page.all(LEGEND)
        assert max(legend.size["height"] for legend in legends) < 60
        assert page.all(".leaflet-control-layers-expanded") == []
        top = page.one(".leaflet-top.leaflet-left").rect
        for legend in legends:
            legend.find_element(By.TAG_NAME, "summary").click()
            assert legend.size["height"] > 100
            assert legend.size["width"] <= screen[0] - 20
            # One is open at a time, and both are below the buttons.
            assert len(page.all(".semsig-legend[open]")) == 1
            assert min(one.rect["y"] for one in legends) >= top["y"] + top["height"]


def test_boxes_fold_when_the_window_becomes_small(evaluated: MapPage) -> None:
    boxes = ".semsig-legend[open], .leaflet-control-layers-expanded"
    wait = WebDriverWait(evaluated.browser, 10.0)
    assert len(evaluated.all(boxes)) == 2
    with evaluated.screen(500, 900, mobile=False):
        wait.until(lambda _: evaluated.all(boxes) == [])
    wait.until(lambda _: len(evaluated.all(boxes)) == 1)
    evaluated.switch("Failed")  # the layers are there again
    assert evaluated.circles(FAILED) == 0


def test_nothing_lies_below_the_boxes(evaluated: MapPage) -> None:
    legend = evaluated.one(LEGEND).rect
    layers = evaluated.one(".leaflet-control-layers").rect
    left, right = legend["x"] + legend["width"], layers["x"]
    places = """
    return [...circles(arguments[0]), ...circles(arguments[1])].map(
      (one) => map.latLngToContainerPoint(one.getLatLng()).x);
    """
    across = evaluated.ask(places, SUCCESSFUL, FAILED)
    assert left <= min(across) <= max(across) <= right
    opening = """
    const pan = map.panBy;
    map.panBy = (offset) => pan.call(map, offset, {animate: false});
    const [marker] = circles(arguments[0]);
    map.setView(marker.getLatLng(), 18, {animate: false});
    pan.call(map, [arguments[1] * map.getSize().x / 2, 0], {animate: false});
    marker.openPopup();
    """
    for side in (-0.95, 0.95):
        evaluated.ask(opening, FAILED, side)
        box = evaluated.one(".leaflet-popup-content-wrapper").rect
        assert left <= box["x"]
        assert box["x"] + box["width"] <= right
        labels = [line.partition("\t")[0] for line in evaluated.popup().splitlines()]
        assert labels[1:4] == ["Expected error", "P(error ≤ 50 m)", "True rank"]
        evaluated.ask("map.closePopup()")


def test_the_search_offers_the_best_match_first(evaluated: MapPage) -> None:
    for number in (1, 2, 5, 12, 60):  # of both layers
        for text in (f"Query {number}", f"query {number}:", str(number)):
            assert evaluated.search(text)[0].startswith(f"Query {number}: ")
    # By its number it is as well called as what is called so on another map.
    exact = "return semsig.finders.flatMap((one) => one('12', 9)).map((one) => one.rank)"
    assert evaluated.ask(exact).count(0) == 1
    assert evaluated.search("query")[0].startswith("Query")
    assert evaluated.search(f"of {60}") == []
    evaluated.search("Query 3", Keys.ENTER)
    assert evaluated.popup().startswith("Query 3: ")
    evaluated.browser.switch_to.active_element.send_keys(Keys.ESCAPE)
    assert evaluated.ask("return map._popup.isOpen()") is False


def test_maps_are_drawn_one_over_the_other(
    page: MapPage, evaluation: Evaluation, database: SignatureDatabase
) -> None:
    map_ = folium.Map([43.0, 3.0], zoom_start=12, tiles=None)
    evaluation_map(evaluation, database, map_=map_)
    for _ in range(2):
        localization_map(localize(database, database.signature(0), top=4), database, map_=map_)
    page.open(map_)
    names = page.layers()
    assert names[-2:] == ["Candidates (4)", "Candidates (4), 2"]
    assert names.count("Objects seen from a cell") == 1
    assert len(names) == 7
    assert page.ask("return map.getZoom()") == 12  # the view is the caller's
    page.switch("Candidates (4), 2")


@settings(max_examples=20)
@given(
    st.sampled_from(["EPSG:2154", "EPSG:32631", "EPSG:3879", "EPSG:2039", "EPSG:28992"]),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
    st.floats(10.0, 40_000.0),
)
def test_the_search_places_x_and_y_to_the_centimetre(
    crs: str, across: float, along: float, size: float
) -> None:
    system = CRS(crs)
    assert system.area_of_use is not None
    west, south, east, north = system.area_of_use.bounds
    middle = Transformer.from_crs("EPSG:4326", system, always_xy=True).transform(
        (west + east) / 2, (south + north) / 2
    )
    corners = np.array(middle) + size * np.array([[-0.5, -0.5], [0.5, 0.5]])
    table = gpd.GeoDataFrame(
        {"class_code": np.array([1, 1], np.uint8)}, geometry=shapely.points(corners), crs=system
    )
    area = _area(StreetObjects(table, paper_taxonomy(), ()))
    place = corners[0] + size * np.array([across, along])
    u, v = (place - area["middle"]) / area["half"]
    found = sum(u**i * v**j * np.array(weights) for i, j, *weights in area["terms"])
    expected = to_latlon(place[None], system, digits=12)[0]
    metres = (found - expected) * 111_320.0 * [1.0, np.cos(np.radians(expected[0]))]
    assert np.hypot(*metres) < 0.01
