"""The maps of street objects, and of streets and buildings below them, in a real browser."""

from __future__ import annotations

import dataclasses
import html
import re
from typing import TYPE_CHECKING

import folium
import geopandas as gpd
import numpy as np
import pandas as pd
import pytest
import shapely
from map_pages import HOSTILE, LEGEND, MapPage, assert_quiet
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from worlds import many_classes, objects_of, random_town

from semsig_gis.core import Taxonomy, class_signs, codes_by_family, family_named, place_links
from semsig_gis.localization import Method, localize
from semsig_gis.objects import Licence, StreetObjects
from semsig_gis.output import ground_map, localization_map, objects_map, page_of_map, to_latlon

if TYPE_CHECKING:
    from pathlib import Path

    from selenium.webdriver import Chrome

BOARD = ".leaflet-overlay-pane canvas.semsig-board"
GROUND = ".leaflet-tile-pane canvas.semsig-board"
HOUSE, STREET = "#e4ded3", "#cfd3d8"
WORLD = random_town()
CITY, OBJECTS = WORLD.database, WORLD.street_objects
SIGNS = class_signs(OBJECTS.taxonomy)
NUMBER = 7  # index of the object of the tests
CODE = int(OBJECTS.codes[NUMBER])
TITLE = OBJECTS.taxonomy.by_code(CODE).title
COUNT = OBJECTS.class_counts[CODE]


def place_of(number: int) -> list[float]:
    latlon: list[float] = to_latlon(OBJECTS.xy[number : number + 1], OBJECTS.crs)[0].tolist()
    return latlon


def click(page: MapPage, number: int) -> str:
    """Click an object from close to; return what the panel says."""
    page.ask("map.setView(arguments[0], 20, {animate: false})", place_of(number))
    page.click_at(place_of(number))
    return page.panel()


def test_first_view_leaves_out_few_places_far_from_the_others(page: MapPage) -> None:
    table = OBJECTS.table.copy()
    far = table.geometry.to_numpy()
    far[NUMBER] = shapely.transform(far[NUMBER], lambda xy: xy + 90_000.0)
    many = pd.concat([OBJECTS.table] * 20 + [table.set_geometry(far)], ignore_index=True)
    objects = dataclasses.replace(OBJECTS, table=many)
    page.open(objects_map(objects))
    south, west, north, east = page.ask(
        "const box = map.getBounds();"
        "return [box.getSouth(), box.getWest(), box.getNorth(), box.getEast()]"
    )
    town = to_latlon(OBJECTS.xy, OBJECTS.crs)
    assert (np.array([south, west]) <= town.min(axis=0)).all()
    assert (np.array([north, east]) >= town.max(axis=0)).all()
    assert north - south < 0.1  # degrees, where the far object is about 0.8 away


def test_objects_map_has_layers_and_legend_by_class(page: MapPage) -> None:
    page.open(objects_map(OBJECTS, database=CITY))
    assert page.browser.title == "Street objects"
    names = page.layers()
    # The letter of the sign, then the title.
    assert any(name.endswith(f"{TITLE} ({COUNT:,})") for name in names)
    assert names[:2] == ["Objects seen from a cell", "Nothing"]
    assert len(names) == len(OBJECTS.class_counts) + 2
    legend = page.one(LEGEND).text
    assert f"{len(OBJECTS):,} objects of {len(OBJECTS.class_counts)} classes" in legend
    for signs in (".semsig-legend", ".leaflet-control-layers-overlays"):
        for at, field in enumerate(("colour", "ink"), start=1):
            shown = page.all(f"{signs} .semsig-sign path:nth-child({at})")
            colours = [getattr(SIGNS[code], field) for code in OBJECTS.class_counts]
            assert [element.get_attribute("fill") for element in shown] == colours
        pictograms = [element.get_attribute("d") for element in shown]
        assert pictograms == [SIGNS[code].pictogram for code in OBJECTS.class_counts]
    # The layers of a licence are in the part about the data.
    assert page.text(".leaflet-control-attribution") == OBJECTS.licenses[0].terms
    assert str(OBJECTS.licenses[0]) in page.text(LEGEND)
    assert page.drawn(SIGNS[CODE].colour, BOARD) > 0
    boxes = "'.leaflet-control-layers-overlays input:checked'"
    page.ask(f"document.querySelectorAll({boxes}).forEach((box) => box.click())")
    assert page.drawn(SIGNS[CODE].colour, BOARD) == 0
    page.switch(next(name for name in names if TITLE in name))
    assert page.drawn(SIGNS[CODE].colour, BOARD) > 0


def test_objects_are_at_their_places_and_a_click_describes_the_nearest(page: MapPage) -> None:
    table = OBJECTS.table.assign(count=3, merged="osm:node/9")
    objects = dataclasses.replace(OBJECTS, table=table)
    page.open(objects_map(objects))
    places = page.ask_later("placesOfObjects(...arguments)", 40)
    expected = np.array([place_of(number) for number in range(40)])
    assert np.abs(np.array(places) - expected).max() < 4e-6  # a quarter of a metre
    text = click(page, NUMBER)
    assert text.startswith(TITLE)
    for words in ("world", "3 rows of its source", "osm:node/9"):
        assert words in text
    # An object at the same place may be described instead.
    there = np.hypot(*(OBJECTS.xy - OBJECTS.xy[NUMBER]).T) < 0.5
    ids = OBJECTS.table["source_id"][there]
    assert any(f"Identifier\t{identifier}" in text for identifier in ids)
    assert len(page.all(".leaflet-shadow-pane canvas")) == 1
    page.ask("semsig.hide(map)")
    corner = OBJECTS.xy.min(axis=0) - 50.0
    page.click_at(to_latlon(corner[None], OBJECTS.crs)[0].tolist())
    assert page.facts()["title"] == "A place on the map"


def test_search_finds_names_cells_and_places(page: MapPage) -> None:
    page.open(objects_map(OBJECTS, database=CITY))
    results = page.search(TITLE[:4].upper())
    assert f"{TITLE}\nall {COUNT:,}" in results
    page.ask("map.setZoom(20, {animate: false})")
    page.search(TITLE, Keys.ENTER)
    every = [place_of(number) for number in np.flatnonzero(OBJECTS.codes == CODE).tolist()]
    assert page.ask("return arguments[0].every((at) => map.getBounds().contains(at))", every)
    results = page.search(str(len(OBJECTS) - 1), Keys.ENTER)
    assert results[0].startswith(f"{len(OBJECTS) - 1}\n")
    assert f"Identifier\t{len(OBJECTS) - 1}" in page.panel()
    assert page.ask("return map.getZoom()") >= 18
    middle = len(CITY) // 2
    x, y = CITY.xy[middle].tolist()
    latitude, longitude = to_latlon(CITY.xy[middle : middle + 1], CITY.crs)[0].tolist()
    centre = "const place = map.getCenter(); return [place.lat, place.lng];"
    cell = str(CITY.cell_ids[middle])
    degrees = "latitude, longitude"
    for typed, words in (
        (cell, f"Cell {cell}"),
        (f"{CITY.cell_ids[middle]:,}", f"Cell {cell}"),
        (f"{latitude}, {longitude}", degrees),
        (f"({latitude}, {longitude})", degrees),
        (f"{latitude}N, {longitude}e", degrees),
        (f"{latitude}° {longitude}°", degrees),
        (f"{latitude} {longitude}".replace(".", ","), degrees),
        (f"{x} {y}", "x, y in EPSG:2154"),
    ):
        page.ask("map.setZoom(14, {animate: false})")
        (offer,) = page.search(typed, Keys.ENTER)
        assert words in offer
        text = page.panel()
        assert re.findall(r"Cell\D*(\d+)", text) == [cell]
        for label, place in (("Latitude, longitude", (latitude, longitude)),
                             ("x, y in EPSG:2154", (x, y))):  # fmt: skip
            (numbers,) = re.findall(rf"{label}\t(.*), (.*)", text)
            assert [float(number) for number in numbers] == pytest.approx(place, abs=0.1, rel=1e-7)
        # Uncovering a place near the edge moves the map a little.
        page.ask("map.setView(panelPlace(), 19, {animate: false})")
        assert page.ask(centre) == pytest.approx([latitude, longitude], abs=2e-6)


def test_search_works_by_keyboard(page: MapPage) -> None:
    page.open(objects_map(OBJECTS, database=CITY))
    box = page.one(".semsig-search input")
    results = page.search("1")
    assert len(results) == 8
    assert page.one("[aria-selected=true]").text == results[0]
    assert page.ask("return covered()") == 0  # no button lies on what is results
    box.send_keys(Keys.ARROW_DOWN, Keys.ARROW_DOWN)
    assert page.one("[aria-selected=true]").text == results[2]
    active = box.get_attribute("aria-activedescendant")
    assert page.browser.find_element(By.ID, str(active)).text == results[2]
    box.send_keys(Keys.ARROW_UP, Keys.ESCAPE)
    assert box.get_attribute("aria-expanded") == "false"
    for nothing in ("no such thing", "0, 0", "1e400", "99999999999999999999"):
        assert page.search(nothing, Keys.ENTER) == []
        status = page.one(".semsig-search [role=status]")
        assert status.text == "Nothing on this map has that name, number or place."


@pytest.mark.usefixtures("map_files")
def test_colours_are_switched_and_stored(browser: Chrome, tmp_path: Path) -> None:
    page = MapPage(browser, tmp_path)
    dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    panel = "return getComputedStyle(document.querySelector('.semsig-legend')).color"
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
    try:
        page.open(objects_map(OBJECTS))
        assert page.ask("return semsig.isDark(map)")
        assert page.ask(panel) == "rgb(233, 233, 230)"
        button = page.one(".semsig-colours")
        assert button.get_attribute("aria-label") == "Light colours"
        button.send_keys(Keys.ENTER)
        assert not page.ask("return semsig.isDark(map)")
        assert page.ask(panel) == "rgb(34, 34, 34)"
        assert page.drawn(SIGNS[CODE].colour, BOARD) > 0
        assert_quiet(browser)
        browser.refresh()
        assert not page.ask("return semsig.isDark(map)")  # the choice is stored
        page.ask("localStorage.clear()")
        # A page without local storage.
        text = html.escape((tmp_path / "map.html").read_text(encoding="utf-8"))
        frame = f'<iframe sandbox="allow-scripts" srcdoc="{text}"></iframe>'
        (tmp_path / "frame.html").write_text(frame, encoding="utf-8")
        browser.get((tmp_path / "frame.html").as_uri())
        browser.switch_to.frame(0)
        assert len(page.all(".semsig-dark")) == 1
        page.one(".semsig-colours").send_keys(Keys.SPACE)
        assert page.all(".semsig-dark") == []
        browser.switch_to.default_content()
        assert browser.get_log("browser") == []
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_panel_is_below_the_map_on_a_narrow_screen(page: MapPage) -> None:
    with page.screen(390, 844, dots=2):
        page.open(objects_map(OBJECTS, database=CITY))
        box = page.one(".semsig-search").rect
        layers = page.one(".leaflet-control-layers").rect
        assert box["x"] + box["width"] <= layers["x"]
        assert page.search("3", Keys.ENTER)
        panel = page.one(".semsig-panel").rect
        assert (panel["x"], panel["width"]) == (0, 390)
        assert panel["y"] >= 844 / 2
        assert not page.one(LEGEND).is_displayed()
        page.ask("semsig.hide(map)")
        assert page.one(LEGEND).is_displayed()


def test_hostile_data_is_shown_as_text(page: MapPage) -> None:
    harm = HOSTILE + "M" * 10_000
    classes = (dataclasses.replace(item, title=harm) for item in OBJECTS.taxonomy.classes)
    table = OBJECTS.table.assign(source=harm, source_id=harm, merged=harm)
    harmful = StreetObjects(table, Taxonomy(tuple(classes)), (Licence(harm, (harm,)),))
    page.open(objects_map(harmful))
    kinds, layers = len(OBJECTS.class_counts), ".leaflet-control-layers-overlays"
    credit = ".leaflet-control-attribution"
    for selector, times in {LEGEND: kinds + 2, layers: kinds, credit: 2}.items():
        assert page.text(selector).count(harm) == times
    # Text direction does not spread to other text, and long names do not fill the page.
    assert all(page.text(f"{part} bdi").endswith(harm) for part in (credit, layers))
    highest = "return Math.max(...[...document.querySelectorAll(arguments[0])].map(height))"
    click(page, NUMBER)
    assert page.text(".semsig-panel").count(harm) == 5
    for tall, most in ((f"{layers} label", 90), (f"{LEGEND} tr", 90), (".semsig-panel h2", 90),
                       (".semsig-details tr", 200)):  # fmt: skip
        assert page.ask(highest, tall) <= most
    page.ask("semsig.hide(map)")
    assert len(page.search("alert")) == 8
    assert page.text(".semsig-search ul").count(harm) == 8
    for element in ("script", "img"):
        assert page.all(f".leaflet-container {element}") == []


def test_page_of_100_000_objects_is_small() -> None:
    rng = np.random.default_rng(0)
    rows = rng.choice(len(OBJECTS), 100_000)
    table = OBJECTS.table.iloc[rows].assign(source_id=np.arange(len(rows)).astype(str))
    places = shapely.points(765_000.0 + 10_000.0 * rng.random((len(rows), 2)))
    objects = dataclasses.replace(OBJECTS, table=table.set_geometry(places, crs=OBJECTS.crs))
    assert len(page_of_map(objects_map(objects), self_contained=False)) < 1_500_000


def table(*shapes: shapely.Geometry | None, crs: str | None = "EPSG:2154") -> gpd.GeoDataFrame:
    return gpd.GeoDataFrame(geometry=list(shapes), crs=crs)


def square(x: float, y: float, side: float) -> shapely.Polygon:
    return shapely.box(765_300.0 + x, 6_275_100.0 + y, 765_300.0 + x + side, 6_275_100.0 + y + side)


def test_ground_map_draws_buildings_and_streets(page: MapPage) -> None:
    court = shapely.difference(square(0, 0, 100), square(25, 25, 50))
    lane = shapely.LineString([(765_280.0, 6_275_090.0), (765_420.0, 6_275_090.0)])
    hut = square(150, 0, 3)
    page.open(ground_map(buildings=table(court, hut, None), streets=table(lane)))
    assert page.browser.title == "Streets and buildings"
    house, street = page.drawn(HOUSE, GROUND), page.drawn(STREET, GROUND)
    assert house > 5000
    # The courtyard is a quarter of the square, the street 140 m by 6 m.
    assert street / house == pytest.approx(140.0 * 6.0 / 7500.0, rel=0.15)
    page.one(".semsig-colours").click()
    assert page.drawn(HOUSE, GROUND) == 0
    assert page.drawn("#272b30", GROUND) == pytest.approx(house, rel=0.02)
    # Shapes of a pixel or less are drawn too.
    page.ask("map.setZoom(13, {animate: false})")
    assert page.drawn("#272b30", GROUND) > 0
    # Colours are switched without local storage too.
    page.ask("Storage.prototype.setItem = () => { throw new Error('not allowed'); }")
    page.one(".semsig-colours").click()
    assert page.drawn(HOUSE, GROUND) > 0
    page.switch("Streets and buildings")
    assert page.all(GROUND) == []


def test_several_maps_are_drawn_on_one_map(page: MapPage) -> None:
    x, y = CITY.xy.mean(axis=0)
    house = table(shapely.box(x - 50, y - 50, x + 50, y + 50))
    house.attrs["licenses"] = ["Mapper (CC0)"]
    map_ = folium.Map([43.0, 3.0], zoom_start=12, tiles=None)
    localization_map(localize(CITY, CITY.signature(0), top=3, method=Method()), CITY, map_=map_)
    for _ in range(2):
        objects_map(OBJECTS, map_=map_)
    ground_map(buildings=house, map_=map_)
    page.open(map_)
    assert page.ask("return map.getZoom()") == 12  # the view is the caller's
    assert page.all(BOARD) == []  # hidden at first
    assert len(page.all(".semsig-search")) == 1
    assert len(page.all(".semsig-legend[open]")) == 1
    height = "return Number(getComputedStyle(document.querySelector(arguments[0])).zIndex)"
    cells = page.ask(height, ".leaflet-tile-pane > img")
    assert page.ask(height, ".leaflet-tile-pane > canvas") > cells  # on which streets are seen
    # Cells are still found by their number, and each credit is given once.
    assert page.search(str(CITY.cell_ids[0]), Keys.ENTER) == [f"Cell {CITY.cell_ids[0]}"]
    credit = page.text(".leaflet-control-attribution")
    assert [credit.count(line) for line in ("Mapper (CC0)", OBJECTS.licenses[0].terms)] == [1, 1]


def test_page_of_60_000_buildings_is_small() -> None:
    rng = np.random.default_rng(0)
    size = 60_000
    corners = np.array([[0, 0], [12, 0], [12, 6], [9, 6], [9, 14], [3, 14], [3, 9], [0, 9]])
    turn = rng.random(size) * np.pi
    turns = np.stack([np.cos(turn), -np.sin(turn), np.sin(turn), np.cos(turn)], axis=1)
    middles = 765_000.0 + 10_000.0 * rng.random((size, 1, 2))
    rings = middles + np.einsum("sij,pj->spi", turns.reshape(-1, 2, 2), corners)
    houses = gpd.GeoDataFrame(geometry=shapely.polygons(rings), crs="EPSG:2154")
    assert len(page_of_map(ground_map(buildings=houses), self_contained=False)) < 3_000_000


def test_ground_map_is_limited_to_the_box() -> None:
    many = table(*(square(30.0 * at, 0.0, 20.0) for at in range(200)))
    box = (765_300.0, 6_275_100.0, 765_600.0, 6_275_200.0)
    every, some = (
        ground_map(buildings=many, box=limits).get_root().render() for limits in (None, box)
    )
    assert len(some) < len(every)


def test_search_finds_streets_by_name(page: MapPage) -> None:
    lines = [[(0, 0), (90, 5)], [(200, 0), (300, 0)], [(95, 5), (95, 60)], [(0, 90), (50, 90)]]
    streets = gpd.GeoDataFrame(
        {"name": ["Rue de l'Église", None, "Rue de l'Église", HOSTILE]},
        geometry=[shapely.LineString(np.add(line, (565_000, 4_830_000))) for line in lines],
        crs="EPSG:32631",
    )
    map_ = ground_map(streets=streets)
    page.open(map_)
    page.ask("semsig.openers.street(map, 'Rue X')")
    assert page.panel() == ""
    assert page.search("eglise") == ["Rue de l'Église\nstreet"]
    page.search("EGLISE", Keys.ENTER)
    assert page.facts()["title"] == "Rue de l'Église"
    marked = page.ask("return lines(({options}) => options.weight === 6)[0].getLatLngs().length")
    assert marked == 2
    page.browser.get_log("performance")
    page.until(lambda: "told=" in page.browser.current_url)
    page.browser.refresh()  # with the street in the address
    page.until(lambda: "Rue de" in page.panel())
    assert page.facts()["title"] == "Rue de l'Église"
    page.ask("semsig.openers.street(map, arguments[0])", HOSTILE)
    page.panel()
    assert page.text(".semsig-panel h2") == HOSTILE
    page.assert_text_stays_text()


@pytest.mark.parametrize("name", ["Rue Longue", None])
def test_streets_are_labelled_with_their_names(page: MapPage, name: str | None) -> None:
    """Pieces of a street are joined, so that there is room for its name."""
    east, north = 565_000.0, 4_830_000.0
    pieces = [
        shapely.LineString([(east + 20.0 * at, north), (east + 20.0 * (at + 1), north)])
        for at in range(10)
    ]
    streets = gpd.GeoDataFrame({"name": [name] * 10}, geometry=pieces, crs="EPSG:32631")
    page.open(ground_map(streets=streets))
    for zoom, near in ((18, True), (14, False)):
        page.ask("map.setZoom(arguments[0], {animate: false})", zoom)
        assert (page.drawn("#4a4f55", ".semsig-names") > 0) == (near and name is not None)


def test_every_panel_links_to_public_maps(page: MapPage) -> None:
    page.open(objects_map(OBJECTS))
    page.click_at([43.6, 3.9])
    assert page.panel()
    links = {link.text: link.get_attribute("href") for link in page.all(".semsig-links a")}
    assert links == place_links(43.6, 3.9)


def test_many_classes_are_listed_by_family_and_a_box_switches_a_family(page: MapPage) -> None:
    kinds = many_classes(2)
    things = [
        (*xy, item.code, "world", item.name)
        for xy, item in zip(OBJECTS.xy.tolist(), kinds.classes, strict=False)
    ]
    objects = objects_of(*things, licenses=OBJECTS.licenses, taxonomy=kinds)
    page.open(objects_map(objects))
    families = codes_by_family(kinds, objects.class_counts)
    assert len(families) > 10
    headings = [family_named(name).title for name in families]
    assert page.texts(".leaflet-control-layers .semsig-family summary") == headings
    legend = page.texts(".semsig-legend details summary")
    counts = [
        f"{title} ({len(codes)})" for title, codes in zip(headings, families.values(), strict=True)
    ]
    assert legend[: len(counts)] == counts
    shop = class_signs(kinds)[families["shop"][0]]
    assert page.drawn(shop.colour, BOARD) > 0
    box = "document.querySelector('[aria-label=\"All of Shops\"]')"
    page.ask(f"{box}.click()")
    assert page.drawn(shop.colour, BOARD) == 0
    assert page.ask(f"return [{box}.checked, {box}.indeterminate]") == [False, False]
    page.ask("document.querySelector('[data-group=\"objects:shop\"] input').click()")
    assert page.ask(f"return [{box}.checked, {box}.indeterminate]") == [True, True]
    assert page.drawn(shop.colour, BOARD) > 0


def test_names_of_objects_are_shown_and_found(page: MapPage) -> None:
    names = [f"Caf\u00e9 {row}" if row == NUMBER else "" for row in range(len(OBJECTS))]
    table = OBJECTS.table.assign(name=names, house_number="12 b")
    page.open(objects_map(dataclasses.replace(OBJECTS, table=table)))
    assert page.search(f"cafe {NUMBER}", Keys.ENTER)[0].startswith(f"Caf\u00e9 {NUMBER}")
    text = page.panel()
    assert f"Name\tCaf\u00e9 {NUMBER}" in text
    assert "House number\t12 b" in text
