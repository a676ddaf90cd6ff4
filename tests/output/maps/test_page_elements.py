"""Elements that all maps share: boxes, search, layers, and errors."""

from __future__ import annotations

import dataclasses
import re
from functools import partial
from importlib import resources
from typing import TYPE_CHECKING

import folium
import geopandas as gpd
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from map_pages import HOSTILE, LEGEND, hostile_database, maps_of
from pyproj import CRS, Transformer
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from sentences import refused
from small_city import chances_of
from worlds import TAXONOMY, random_town

from semsig_gis.core import (
    CANDIDATE_RAMP,
    OBJECT_COLOURS,
    CrsError,
    DatabaseError,
    EmptyResultError,
    InputError,
    SignatureSpec,
    Taxonomy,
)
from semsig_gis.database import build_database
from semsig_gis.evaluation import MissingClasses, QuerySpec, evaluate
from semsig_gis.localization import Method, localize, named_noise
from semsig_gis.objects import Licence, StreetObjects
from semsig_gis.output import (
    ambiguity_map,
    drift_map,
    evaluation_map,
    ground_map,
    layers_of,
    localization_map,
    objects_map,
    page_element,
    search_area,
    to_latlon,
)
from semsig_gis.sources import paper_taxonomy

if TYPE_CHECKING:
    from collections.abc import Callable

    from map_pages import MapPage

WORLD = random_town()
CITY, OBJECTS = WORLD.database, WORLD.street_objects
HOUSE = gpd.GeoDataFrame(geometry=[shapely.box(765_300, 6_275_100, 765_320, 6_275_120)], crs=2154)
NO_PLACE = gpd.GeoDataFrame(geometry=[None], crs=2154)
LANE = gpd.GeoDataFrame(geometry=[shapely.LineString([(3.0, 43.0), (3.1, 43.0)])], crs=4326)
EVALUATION = evaluate(CITY, queries=5, method=Method())
LOCALIZATION = localize(CITY, CITY.signature(0), top=5, method=Method())
OTHER_CHANCES = chances_of(CITY.select(slice(1, None)))
OTHER_CITY = dataclasses.replace(CITY, rows=CITY.rows + 10_000)
OTHER_SIGHT = dataclasses.replace(CITY, codes=CITY.codes[::-1].copy())
OTHER = dataclasses.replace(TAXONOMY.classes[0], name="other")
OTHER_CLASSES = dataclasses.replace(CITY, taxonomy=Taxonomy((OTHER, *TAXONOMY.classes[1:])))
EMPTY, NARROW = CITY.select(slice(0)), build_database(OBJECTS, spec=SignatureSpec(20.0))
NO_OBJECTS = dataclasses.replace(OBJECTS, table=OBJECTS.table.iloc[:0])
DRIFT = partial(drift_map, CITY, CITY)
TURNED = dataclasses.replace(OBJECTS, table=OBJECTS.table.to_crs("EPSG:32631"))
NOWHERE, FAR = LANE.set_crs(None, allow_override=True), (0.0, 0.0, 1.0, 1.0)
MAPS = maps_of(CITY, OBJECTS, EVALUATION, named_noise("light"))
LAYERS = {
    "evaluation": {"Share of queries found", "Lines from true to estimated places"},
    "localization": {"Candidates (5)"},
    "location": {"Best place", "Chance of a cell", "Candidates (5)"},
    "ambiguity": {"Same types", "Same types and angle levels"},
    "identifiability": {"Chance to be found"},
    "drift": {"What has changed"},
    "ground": {"Streets and buildings"},
}


@pytest.mark.parametrize("name", MAPS)
def test_maps_are_added_twice_to_a_given_map(name: str) -> None:
    draw, layers = MAPS[name], LAYERS.get(name, set())
    own = folium.Map([43.0, 3.0], zoom_start=12, tiles=None)
    assert draw(map_=own) is own
    assert draw(map_=own) is own
    names = [getattr(child, "layer_name", "") for child in layers_of(own).values()]
    assert layers | {f"{layer}, 2" for layer in layers} <= set(names)
    for once in ("Objects seen from a cell", "Describe a cell when clicked"):
        assert names.count(once) <= 1
    body = own.get_root().render().partition("</head>")[2]
    # Legends on a given map set no view.
    assert all(" null, " in call[-12:] for call in re.findall(r"semsig\.legend\(.*\);", body))
    assert "NaN" not in body


@pytest.mark.parametrize("name", sorted(MAPS.keys() - {"ground"}))
def test_tiles_are_for_new_maps_only(name: str) -> None:
    draw = MAPS[name]
    body = draw(tiles="openstreetmap.mapnik").get_root().render()
    assert "tile.openstreetmap.org" in body
    assert "contributors" in body
    layers = layers_of(draw(tiles="CyclOSM")).values()
    tiles = [layer for layer in layers if isinstance(layer, folium.TileLayer)]
    assert [layer.layer_name for layer in tiles] == ["Online map: CyclOSM"]
    with refused(InputError, "OpenStreetMap"):
        draw(tiles="OpenStreetMap", map_=folium.Map(tiles=None))


@pytest.mark.parametrize(
    ("tiles", "words"),
    [
        ("Openstreetmop", "not known"),
        ("CartoDB.Positron", "need a key"),
        ("Thunderforest Outdoors", "need a key"),
        ("https://tiles.example/{z}/{x}/{y}.png", "not known"),
    ],
)
def test_unusable_tiles_are_refused(tiles: str, words: str) -> None:
    with refused(InputError, tiles, words, "'OpenStreetMap.Mapnik'"):
        MAPS["ambiguity"](tiles=tiles)


@pytest.mark.parametrize(
    ("draw", "error", "words"),
    [
        (partial(evaluation_map, EVALUATION, CITY.select(slice(9))), InputError, "evaluat"),
        (partial(localization_map, LOCALIZATION, OTHER_CITY), InputError, "localization"),
        (partial(localization_map, LOCALIZATION, OTHER_SIGHT), InputError, "localization"),
        (partial(ambiguity_map, EMPTY), InputError, "no cells"),
        (partial(ambiguity_map, CITY, identifiability=OTHER_CHANCES), InputError, "other cells"),
        (partial(drift_map, EMPTY, EMPTY), InputError, "no cells"),
        (partial(drift_map, CITY, OTHER_CITY), InputError, "same city"),
        (partial(drift_map, CITY, OTHER_CLASSES), InputError, "'other'"),
        (partial(drift_map, CITY, NARROW), DatabaseError, "radius=20.0"),
        (partial(DRIFT, objects_before=OBJECTS, objects_after=TURNED), CrsError, "EPSG:32631"),
        (partial(objects_map, NO_OBJECTS), EmptyResultError, "no street object"),
        (ground_map, EmptyResultError, "streets or buildings"),
        (partial(ground_map, buildings=NO_PLACE), EmptyResultError, "streets or buildings"),
        (partial(ground_map, buildings=HOUSE, box=FAR), EmptyResultError, "streets or buildings"),
        (partial(ground_map, buildings=HOUSE, streets=LANE), CrsError, "one CRS"),
        (partial(ground_map, buildings=HOUSE, streets=NOWHERE), CrsError, "one CRS"),
    ],
)
def test_unusable_inputs_are_refused(
    draw: Callable[[], folium.Map], error: type[Exception], words: str
) -> None:
    with refused(error, words):
        draw()


def test_browser_files_contain_no_end_tags() -> None:
    for file in resources.files("semsig_gis.output.html").joinpath("js").iterdir():
        assert page_element(file.name).count("</") == 1


HARMFUL = hostile_database(CITY)
HARMFUL_OBJECTS = dataclasses.replace(
    OBJECTS,
    table=OBJECTS.table.assign(source=HOSTILE, source_id=HOSTILE),
    taxonomy=HARMFUL.taxonomy,
    licenses=(Licence(HOSTILE),),
)
HARMFUL_MAPS = maps_of(
    HARMFUL,
    HARMFUL_OBJECTS,
    dataclasses.replace(
        EVALUATION, asked=QuerySpec(distortions=(MissingClasses(classes=(HOSTILE,)),))
    ),
    dataclasses.replace(named_noise("light"), name=HOSTILE),
)
HELPED = int(np.flatnonzero((chances_of(CITY).gains > 0.1).any(axis=1))[0])


@pytest.mark.parametrize(
    ("name", "subject", "counts"),
    [
        ("evaluation", "failed", (3, 12)),
        ("localization", CANDIDATE_RAMP[0], (3, 2)),
        ("location", None, (4, 3)),
        ("drift", OBJECT_COLOURS["removed"], (6, 3)),
        ("ambiguity", 0, (2, 1)),
        ("identifiability", HELPED, (9, 3)),
    ],
)
def test_hostile_data_is_shown_as_text(
    page: MapPage, name: str, subject: str | int | None, counts: tuple[int, int]
) -> None:
    page.open(HARMFUL_MAPS[name]())
    if isinstance(subject, str):
        page.panel_of(subject)
    elif subject is not None:  # the panel is open at first
        page.click(HARMFUL, subject)
    texts = (page.text(LEGEND), page.text(".semsig-panel"))
    assert tuple(text.count(HOSTILE) for text in texts) == counts
    page.assert_text_stays_text()


@pytest.mark.parametrize("screen", [(390, 800), (844, 390), (720, 600)])
def test_legends_are_folded_on_small_screens(page: MapPage, screen: tuple[int, int]) -> None:
    map_ = evaluation_map(EVALUATION, CITY)
    localization_map(LOCALIZATION, CITY, map_=map_)
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
            # Only one is open at a time, and both are below the buttons.
            assert len(page.all(".semsig-legend[open]")) == 1
            assert min(legend.rect["y"] for legend in legends) >= top["y"] + top["height"]


def test_boxes_fold_in_a_small_window(evaluation_page: MapPage) -> None:
    boxes = ".semsig-legend[open], .leaflet-control-layers-expanded"
    assert len(evaluation_page.all(boxes)) == 2
    with evaluation_page.screen(500, 900, mobile=False):
        evaluation_page.until_gone(boxes)
    evaluation_page.until(lambda: len(evaluation_page.all(boxes)) == 1)
    evaluation_page.switch("Failed")  # the layer control works again
    assert evaluation_page.circles("failed") == 0


def test_boxes_do_not_cover_queries(evaluation_page: MapPage) -> None:
    legend = evaluation_page.one(LEGEND).rect
    layers = evaluation_page.one(".leaflet-control-layers").rect
    west, east = legend["x"] + legend["width"], layers["x"]
    places = """
    return [...signs("successful"), ...signs("failed")].map(
      (sign) => map.latLngToContainerPoint(sign.getLatLng()).x);
    """
    across = evaluation_page.ask(places)
    assert west <= min(across) <= max(across) <= east
    for side in (-0.95, 0.95):
        evaluation_page.ask("clickAt(signs('failed')[0], arguments[0])", side)
        where = evaluation_page.ask("return map.latLngToContainerPoint(panelPlace()).x")
        assert west <= where <= evaluation_page.one(".semsig-panel").rect["x"]
        rows = [line.split("\t") for line in evaluation_page.panel().splitlines() if "\t" in line]
        labels = [label for label, *_ in rows[:3]]
        assert labels == ["Expected error", "P(error ≤ 50 m)", "True rank"]
        evaluation_page.ask("semsig.hide(map)")


def test_search_lists_the_best_match_first(evaluation_page: MapPage) -> None:
    for number in (1, 2, 5, 12, 60):  # of both outcomes
        for text in (f"Query {number}", f"query {number}:", str(number)):
            assert evaluation_page.search(text)[0].startswith(f"Query {number}: ")
    # Only the query itself has the number as its whole name.
    exact = "return semsig.finders.flatMap((find) => find('12', 9)).map(({rank}) => rank)"
    assert evaluation_page.ask(exact).count(0) == 1
    assert evaluation_page.search("query")[0].startswith("Query")
    assert evaluation_page.search(f"of {60}") == []
    evaluation_page.search("Query 3", Keys.ENTER)
    assert evaluation_page.panel().startswith("Query 3: ")
    evaluation_page.browser.switch_to.active_element.send_keys(Keys.ESCAPE)
    assert evaluation_page.ask("return panel() === ''")


@settings(max_examples=20)
@given(
    st.sampled_from(["EPSG:2154", "EPSG:32631", "EPSG:3879", "EPSG:2039", "EPSG:28992"]),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
    st.floats(10.0, 40_000.0),
)
def test_search_polynomial_is_exact_to_a_centimetre(
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
    area = search_area(StreetObjects(table, paper_taxonomy(), ()))
    place = corners[0] + size * np.array([across, along])
    u, v = (place - area["middle"]) / area["half"]
    result = sum(u**i * v**j * np.array(weights) for i, j, *weights in area["terms"])
    expected = to_latlon(place[None], system, digits=12)[0]
    metres = (result - expected) * 111_320.0 * [1.0, np.cos(np.radians(expected[0]))]
    assert np.hypot(*metres) < 0.01
