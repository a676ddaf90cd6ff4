"""The map of street objects in a real browser."""

from __future__ import annotations

import dataclasses
import html
import re
from typing import TYPE_CHECKING

import folium
import geopandas as gpd
import numpy as np
import pytest
import shapely
from map_pages import (
    HOSTILE,
    asked,
    assert_quiet,
    drawn,
    opened,
    popup_text,
    searched,
    switch,
)
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from sentences import assert_sentence
from worlds import random_town

from semsig_gis.core.errors import EmptyResultError
from semsig_gis.core.signs import class_signs
from semsig_gis.core.taxonomy import ObjectClass, Taxonomy
from semsig_gis.maps.localization import localization_map
from semsig_gis.maps.objects import objects_map
from semsig_gis.maps.page import save_map
from semsig_gis.maps.parts import to_latlon
from semsig_gis.matching.search import localize
from semsig_gis.objects.table import Licence, StreetObjects

if TYPE_CHECKING:
    from pathlib import Path

    from selenium.webdriver import Chrome

BOARD = ".leaflet-overlay-pane canvas.semsig-board"
WORLD = random_town()
CITY = WORLD.database
OBJECTS = WORLD.street_objects
SIGNS = class_signs(OBJECTS.taxonomy)
NUMBER = 7  # of the object that is asked for
CODE = int(OBJECTS.codes[NUMBER])
TITLE = OBJECTS.taxonomy.by_code(CODE).title
COUNT = OBJECTS.class_counts[CODE]


def place_of(number: int) -> list[float]:
    latlon: list[float] = to_latlon(OBJECTS.xy[number : number + 1], OBJECTS.crs)[0].tolist()
    return latlon


def click(browser: Chrome, place: list[float]) -> None:
    asked(browser, "map.setView(arguments[0], 20, {animate: false})", place)
    asked(browser, "map.fire('click', {latlng: L.latLng(arguments[0])})", place)


@pytest.mark.usefixtures("carried")
def test_objects_in_a_browser(browser: Chrome, tmp_path: Path) -> None:
    opened(browser, objects_map(OBJECTS, database=CITY), tmp_path)
    assert browser.title == "Street objects"
    names = [
        label.text.strip()
        for label in browser.find_elements(
            By.CSS_SELECTOR, ".leaflet-control-layers-overlays label"
        )
    ]
    # The letter of the sign, then the title.
    assert any(name.endswith(f"{TITLE} ({COUNT:,})") for name in names)
    assert len(names) == len(OBJECTS.class_counts) + 1
    legend = browser.find_element(By.CSS_SELECTOR, ".semsig-legend").text
    assert f"{len(OBJECTS):,} objects of {len(OBJECTS.class_counts)} classes" in legend
    for signs in (".semsig-legend", ".leaflet-control-layers-overlays"):
        for part, named in (("path", "colour"), ("text", "ink")):
            shown = browser.find_elements(By.CSS_SELECTOR, f"{signs} .semsig-sign {part}")
            colours = [getattr(SIGNS[code], named) for code in OBJECTS.class_counts]
            assert [one.get_attribute("fill") for one in shown] == colours
    credit = browser.find_element(By.CSS_SELECTOR, ".leaflet-control-attribution").text
    assert str(OBJECTS.licenses[0]) in credit
    assert drawn(browser, SIGNS[CODE].colour, BOARD) > 0
    boxes = ".leaflet-control-layers-overlays input:checked"
    asked(browser, "document.querySelectorAll(arguments[0]).forEach((box) => box.click())", boxes)
    assert drawn(browser, SIGNS[CODE].colour, BOARD) == 0
    switch(browser, next(name for name in names if TITLE in name))
    assert drawn(browser, SIGNS[CODE].colour, BOARD) > 0
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_a_click_tells_of_the_nearest_object(browser: Chrome, tmp_path: Path) -> None:
    table = OBJECTS.table.assign(count=3, merged="osm:node/9")
    objects = dataclasses.replace(OBJECTS, table=table)
    opened(browser, objects_map(objects), tmp_path)
    click(browser, place_of(NUMBER))
    popup = popup_text(browser)
    assert popup.startswith(TITLE)
    for said in ("world", "3 rows of its source", "osm:node/9"):
        assert said in popup
    # Whoever lies on it may be told of instead.
    there = np.hypot(*(OBJECTS.xy - OBJECTS.xy[NUMBER]).T) < 0.5
    ids = OBJECTS.table["source_id"][there]
    assert any(f"Identifier\t{one}" in popup for one in ids)
    assert len(browser.find_elements(By.CSS_SELECTOR, ".leaflet-shadow-pane canvas")) == 1
    asked(browser, "map.closePopup()")
    corner = OBJECTS.xy.min(axis=0) - 50.0
    asked(browser, "map.fire('click', {latlng: L.latLng(arguments[0])})",
          to_latlon(corner[None], OBJECTS.crs)[0].tolist())  # fmt: skip
    assert asked(browser, "return map._popup === null || !map._popup.isOpen()")
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_the_script_has_every_object_where_it_is(browser: Chrome, tmp_path: Path) -> None:
    opened(browser, objects_map(OBJECTS), tmp_path)
    browser.set_script_timeout(30)
    known = browser.execute_async_script(
        """
        const done = arguments[arguments.length - 1];
        const map = Object.values(window).find((value) => value instanceof L.Map);
        const found = [];
        const look = () => {
          for (let one = 0; one < arguments[0]; one += 1) {
            const name = semsig.finders.flatMap((finder) => finder(String(one), 99))
              .find((other) => other.name === String(one));
            if (!name) return setTimeout(look, 50);
            name.show(map);
            const place = map._popup.getLatLng();
            found.push([place.lat, place.lng]);
          }
          done(found);
        };
        look();
        """,
        40,
    )
    expected = np.array([place_of(number) for number in range(40)])
    assert np.abs(np.array(known) - expected).max() < 4e-6  # a quarter of a metre


@pytest.mark.usefixtures("carried")
def test_the_search_finds_names_cells_and_places(browser: Chrome, tmp_path: Path) -> None:
    opened(browser, objects_map(OBJECTS, database=CITY), tmp_path)
    offered = searched(browser, TITLE[:4].upper())
    assert f"{TITLE}\nall {COUNT:,}" in offered
    offered = searched(browser, str(len(OBJECTS) - 1), Keys.ENTER)
    assert offered[0].startswith(f"{len(OBJECTS) - 1}\n")
    assert f"Identifier\t{len(OBJECTS) - 1}" in popup_text(browser)
    assert asked(browser, "return map.getZoom()") >= 18
    middle = len(CITY) // 2
    x, y = CITY.xy[middle].tolist()
    latitude, longitude = to_latlon(CITY.xy[middle : middle + 1], CITY.crs)[0].tolist()
    centre = "const place = map.getCenter(); return [place.lat, place.lng];"
    cell = str(CITY.cell_ids[middle])
    degrees = "latitude, longitude"
    for text, said in (
        (cell, f"Cell {cell}"),
        (f"{CITY.cell_ids[middle]:,}", f"Cell {cell}"),
        (f"{latitude}, {longitude}", degrees),
        (f"({latitude}, {longitude})", degrees),
        (f"{latitude}N, {longitude}e", degrees),
        (f"{latitude}° {longitude}°", degrees),
        (f"{latitude} {longitude}".replace(".", ","), degrees),
        (f"{x} {y}", "x, y in EPSG:2154"),
    ):
        asked(browser, "map.setZoom(14, {animate: false})")
        (offer,) = searched(browser, text, Keys.ENTER)
        assert said in offer
        popup = popup_text(browser)
        assert re.findall(r"Cell\D*(\d+)", popup) == [cell]
        for label, place in (("Latitude, longitude", (latitude, longitude)),
                             ("x, y in EPSG:2154", (x, y))):  # fmt: skip
            (numbers,) = re.findall(rf"{label}\t(.*), (.*)", popup)
            assert [float(one) for one in numbers] == pytest.approx(place, abs=0.1, rel=1e-7)
        # Popups near the edge move the map a little.
        asked(browser, "map.setView(map._popup.getLatLng(), 19, {animate: false})")
        assert asked(browser, centre) == pytest.approx([latitude, longitude], abs=2e-6)
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_the_search_is_used_by_keyboard(browser: Chrome, tmp_path: Path) -> None:
    opened(browser, objects_map(OBJECTS, database=CITY), tmp_path)
    box = browser.find_element(By.CSS_SELECTOR, ".semsig-search input")
    offered = searched(browser, "1")
    assert len(offered) == 8
    chosen = "return document.querySelector('[aria-selected=true]').innerText"
    assert browser.execute_script(chosen) == offered[0]
    covered = """
    return [...document.querySelectorAll('[role=option]')].filter((one) => {
      const {left, top, height} = one.getBoundingClientRect();
      return !one.contains(document.elementFromPoint(left + 10, top + height / 2));
    }).length;
    """
    assert browser.execute_script(covered) == 0  # no button lies on what is offered
    box.send_keys(Keys.ARROW_DOWN, Keys.ARROW_DOWN)
    assert browser.execute_script(chosen) == offered[2]
    active = box.get_attribute("aria-activedescendant")
    assert browser.find_element(By.ID, str(active)).text == offered[2]
    box.send_keys(Keys.ARROW_UP, Keys.ESCAPE)
    assert box.get_attribute("aria-expanded") == "false"
    for nothing in ("no such thing", "0, 0", "1e400", "99999999999999999999"):
        assert searched(browser, nothing, Keys.ENTER) == []
        said = browser.find_element(By.CSS_SELECTOR, ".semsig-search [role=status]")
        assert said.text == "Nothing on this map is called so, or lies there."
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_light_and_dark(browser: Chrome, tmp_path: Path) -> None:
    dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    panel = "return getComputedStyle(document.querySelector('.semsig-legend')).color"
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
    try:
        opened(browser, objects_map(OBJECTS), tmp_path)
        assert asked(browser, "return semsig.isDark(map)")
        assert browser.execute_script(panel) == "rgb(233, 233, 230)"
        button = browser.find_element(By.CSS_SELECTOR, ".semsig-colours")
        assert button.get_attribute("aria-label") == "Light colours"
        button.send_keys(Keys.ENTER)
        assert not asked(browser, "return semsig.isDark(map)")
        assert browser.execute_script(panel) == "rgb(34, 34, 34)"
        assert drawn(browser, SIGNS[CODE].colour, BOARD) > 0
        assert_quiet(browser)
        browser.refresh()
        assert not asked(browser, "return semsig.isDark(map)")  # what was chosen is kept
        browser.execute_script("localStorage.clear()")
        # A page that may keep nothing.
        page = (tmp_path / "map.html").read_text(encoding="utf-8")
        frame = f'<iframe sandbox="allow-scripts" srcdoc="{html.escape(page)}"></iframe>'
        (tmp_path / "frame.html").write_text(frame, encoding="utf-8")
        browser.get((tmp_path / "frame.html").as_uri())
        browser.switch_to.frame(0)
        assert len(browser.find_elements(By.CSS_SELECTOR, ".semsig-dark")) == 1
        browser.find_element(By.CSS_SELECTOR, ".semsig-colours").send_keys(Keys.ENTER)
        assert browser.find_elements(By.CSS_SELECTOR, ".semsig-dark") == []
        browser.switch_to.default_content()
        assert browser.get_log("browser") == []
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


@pytest.mark.usefixtures("carried")
def test_a_narrow_screen(browser: Chrome, tmp_path: Path) -> None:
    size = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        opened(browser, objects_map(OBJECTS, database=CITY), tmp_path)
        box = browser.find_element(By.CSS_SELECTOR, ".semsig-search").rect
        layers = browser.find_element(By.CSS_SELECTOR, ".leaflet-control-layers").rect
        assert box["x"] + box["width"] <= layers["x"]
        assert searched(browser, "3", Keys.ENTER)
        popup = browser.find_element(By.CSS_SELECTOR, ".leaflet-popup-content-wrapper")
        assert popup.rect["x"] >= 0
        assert popup.rect["x"] + popup.rect["width"] <= 390
        for hidden in (".semsig-search", ".semsig-legend"):
            assert not browser.find_element(By.CSS_SELECTOR, hidden).is_displayed()
        asked(browser, "map.closePopup()")
        assert browser.find_element(By.CSS_SELECTOR, ".semsig-search").is_displayed()
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_hostile_data_is_shown_and_never_run(browser: Chrome, tmp_path: Path) -> None:
    harm = HOSTILE + "M" * 10_000
    classes = tuple(
        ObjectClass(item.code, item.symbol, item.name, f"{item.symbol} {harm}")
        for item in OBJECTS.taxonomy.classes
    )
    table = OBJECTS.table.assign(source=harm, source_id=harm, merged=harm)
    harmful = StreetObjects(table, Taxonomy(classes), (Licence(harm, (harm,)),))
    opened(browser, objects_map(harmful), tmp_path)  # an alert would fail the next command
    text = "return document.querySelector(arguments[0]).textContent"
    for selector, times in (
        (".semsig-legend", len(OBJECTS.class_counts) + 2),
        (".leaflet-control-layers-overlays", len(OBJECTS.class_counts)),
        (".leaflet-control-attribution", 2),
    ):
        assert browser.execute_script(text, selector).count(harm) == times
    # No sign of direction reaches what stands beside, and no name fills the page.
    for alone in (".leaflet-control-attribution bdi", ".leaflet-control-layers-overlays bdi"):
        assert browser.execute_script(text, alone).endswith(harm)
    highest = """
    const parts = [...document.querySelectorAll(arguments[0])];
    return Math.max(...parts.map((one) => one.getBoundingClientRect().height));
    """
    assert browser.execute_script(highest, ".leaflet-control-layers-overlays label") <= 90
    assert browser.execute_script(highest, ".semsig-legend tr") <= 90
    click(browser, place_of(NUMBER))
    popup_text(browser)
    assert browser.execute_script(text, ".semsig-details").count(harm) == 5
    assert browser.execute_script(highest, ".semsig-details > b") <= 90
    assert browser.execute_script(highest, ".semsig-details tr") <= 200
    asked(browser, "map.closePopup()")
    offered = searched(browser, "alert")
    assert len(offered) == 8
    assert browser.execute_script(text, ".semsig-search ul").count(harm) == 8
    for element in ("script", "img"):
        assert browser.find_elements(By.CSS_SELECTOR, f".leaflet-container {element}") == []
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_objects_over_another_map(browser: Chrome, tmp_path: Path) -> None:
    chosen = localization_map(localize(CITY, CITY.signature(0), top=3), CITY)
    assert objects_map(OBJECTS, map_=chosen) is chosen
    assert objects_map(OBJECTS, map_=chosen) is chosen
    opened(browser, chosen, tmp_path)
    assert browser.find_elements(By.CSS_SELECTOR, BOARD) == []  # hidden at first
    assert len(browser.find_elements(By.CSS_SELECTOR, ".semsig-search")) == 1
    assert len(browser.find_elements(By.CSS_SELECTOR, ".semsig-legend[open]")) == 1
    # Cells are still found by their number, and the credit is given once.
    assert searched(browser, str(CITY.cell_ids[0]), Keys.ENTER) == [f"Cell {CITY.cell_ids[0]}"]
    credit = browser.find_element(By.CSS_SELECTOR, ".leaflet-control-attribution")
    said = browser.execute_script("return arguments[0].textContent", credit)
    assert said.count(str(OBJECTS.licenses[0])) == 1
    assert_quiet(browser)


def test_a_hundred_thousand_objects_are_a_small_page(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    size = 100_000
    table = gpd.GeoDataFrame(
        {
            "class_code": rng.choice(OBJECTS.codes, size),
            "source": "many",
            "source_id": np.arange(size).astype(str),
            "count": np.ones(size, np.int32),
        },
        geometry=shapely.points(765_000.0 + 10_000.0 * rng.random((size, 2))),
        crs=OBJECTS.crs,
    )
    objects = StreetObjects(table, OBJECTS.taxonomy, OBJECTS.licenses)
    save_map(objects_map(objects), tmp_path / "map.html", self_contained=False)
    assert (tmp_path / "map.html").stat().st_size < 1_500_000


def test_no_objects() -> None:
    none = dataclasses.replace(OBJECTS, table=OBJECTS.table.iloc[:0])
    with pytest.raises(EmptyResultError) as caught:
        objects_map(none)
    assert_sentence(caught.value, "no street object")


def test_a_map_of_ones_own_keeps_its_view() -> None:
    own = folium.Map([43.0, 3.0], zoom_start=12, tiles=None)
    assert objects_map(OBJECTS, map_=own) is own
    assert "fitBounds(null" not in own.get_root().render()
