"""Accessibility of maps: keyboard, screen reader and touch."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from axe_core_python.selenium import Axe
from map_pages import maps_of
from selenium.webdriver.common.keys import Keys
from small_city import small_city, small_evaluation

from semsig_gis.localization import named_noise

if TYPE_CHECKING:
    from map_pages import MapPage

MAPS = maps_of(*small_city(), small_evaluation("medium"), named_noise("light"))
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
    assert page.until(lambda: status.text).startswith("Copied: ")
