"""Accessibility of maps: keyboard, screen reader and touch."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import geopandas as gpd
import pytest
import shapely
from axe_core_python.selenium import Axe
from machine import PATIENCE_S
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait
from small_city import (
    chances_of,
    small_city,
    small_evaluation,
    small_localization,
    small_location,
)

from semsig_gis.database import build_database
from semsig_gis.maps import (
    ambiguity_map,
    drift_map,
    evaluation_map,
    ground_map,
    identifiability_map,
    localization_map,
    location_map,
    objects_map,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    import folium
    from map_pages import MapPage

CITY, OBJECTS = small_city()


def drift() -> folium.Map:
    later = dataclasses.replace(OBJECTS, table=OBJECTS.table[3:])
    return drift_map(CITY, build_database(later), objects_before=OBJECTS, objects_after=later)


def ground() -> folium.Map:
    house = shapely.box(*CITY.xy[0], *(CITY.xy[0] + 20))
    return ground_map(buildings=gpd.GeoDataFrame(geometry=[house], crs=CITY.crs))


MAPS: dict[str, Callable[[], folium.Map]] = {
    "evaluation": lambda: evaluation_map(small_evaluation("medium"), CITY),
    "localization": lambda: localization_map(small_localization(), CITY),
    "location": lambda: location_map(small_location()),
    "ambiguity": lambda: ambiguity_map(CITY, identifiability=chances_of(CITY)),
    "identifiability": lambda: identifiability_map(chances_of(CITY)),
    "drift": drift,
    "objects": lambda: objects_map(OBJECTS, database=CITY),
    "ground": ground,
}


# The rules of axe that a page violates, and the elements.
VIOLATIONS = """
axe.run({resultTypes: ["violations"]}).then(({violations}) => arguments[0](
  violations.map(({id, nodes}) => [id, nodes.map(({target}) => target)])));
"""


@pytest.mark.parametrize("name", MAPS)
def test_axe_finds_no_violation(name: str, page: MapPage) -> None:
    violations = {}
    page.open(MAPS[name]())
    page.browser.execute_script(Axe().axe_script)
    for screen in ((1440, 900), (390, 844)):
        with page.screen(*screen, mobile=screen[0] < 800):
            for colours in ("light", "dark"):
                page.ask("map.fire('click', {latlng: map.getCenter()})")
                page.facts()
                violations[(screen, colours, "panel")] = page.ask_later(VIOLATIONS)
                page.ask("semsig.hide(map)")
                page.ask("document.querySelectorAll('details').forEach((box) => box.open = true)")
                violations[(screen, colours, "")] = page.ask_later(VIOLATIONS)
                page.ask("document.querySelector('.semsig-colours').click()")
    assert {key: rules for key, rules in violations.items() if rules} == {}


def test_controls_are_at_least_44_pixels_large(page: MapPage) -> None:
    sizes = """
    const parts = "button, .leaflet-bar a, .semsig-search input, summary, .leaflet-control-layers "
      + "label, .leaflet-control-layers-toggle";
    return [...document.querySelectorAll(parts)].map((element) => {
      const {width, height} = element.getBoundingClientRect();
      return [element.className || element.textContent, width, height];
    }).filter(([, width, height]) => width && Math.min(width, height) < 44);
    """
    with page.screen(390, 844):
        page.open(MAPS["ambiguity"]())
        page.ask("map.fire('click', {latlng: map.getCenter()})")
        page.facts()
        small = page.ask(sizes)
        page.ask("semsig.hide(map)")
        page.ask("document.querySelectorAll('details').forEach((box) => { box.open = true; })")
        page.ask("document.querySelector('.leaflet-control-layers-toggle').click()")
        assert small + page.ask(sizes) == []


def test_map_has_a_name_and_works_by_keyboard(page: MapPage) -> None:
    page.browser.execute_cdp_cmd(
        "Browser.grantPermissions",
        {"permissions": ["clipboardReadWrite", "clipboardSanitizedWrite"]},
    )
    page.open(MAPS["ambiguity"]())
    map_ = page.one("[role=main]")
    assert map_.get_attribute("aria-roledescription") == "map"
    assert map_.accessible_name == "Cells that look the same"
    order = []
    for _ in range(9):
        page.browser.switch_to.active_element.send_keys(Keys.TAB)
        order.append(page.browser.switch_to.active_element.accessible_name)
    assert order[0] == "Cells that look the same"
    assert order[1].startswith("Search")
    assert [name for name in order if name in {"Zoom in", "Dark colours", "Print this view"}] == [
        *("Zoom in", "Dark colours", "Print this view")
    ]
    map_.send_keys("c")
    status = page.one("[role=status].semsig-status")
    # The clipboard answers later.
    WebDriverWait(page.browser, PATIENCE_S).until(lambda _: status.text)
    assert status.text.startswith("Copied: ")
