"""The panel of a map: its text and position, and how it opens and closes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from small_city import small_city, small_evaluation
from worlds import random_town

from semsig_gis.output import ambiguity_map, evaluation_map, objects_map, to_latlon

if TYPE_CHECKING:
    from map_pages import MapPage

CITY = random_town().database
OBJECTS = random_town().street_objects
PLACES = to_latlon(CITY.xy, CITY.crs)
SCREENS = [(1440, 900), (390, 844)]
# The first place that nothing covers: its index, and its position on the screen.
ON_TOP = """
for (const [number, place] of arguments[0].entries()) {
  const {x, y} = map.latLngToContainerPoint(place);
  const top = document.elementFromPoint(Math.round(x), Math.round(y));
  if (top && !top.closest(".semsig-panel, .leaflet-control")) return [number, x, y];
}
"""
# Click at a share of the half width from the middle; return whether the map glides.
GLIDES = """
map.once("semsig-panel", () => arguments[1](Boolean(map._panAnim?._inProgress)));
const x = (1 + arguments[0]) * map.getSize().x / 2;
map.fire("click", {latlng: map.containerPointToLatLng([x, map.getSize().y / 2])});
"""
NOT_COVERED = """
const {x, y} = map.latLngToContainerPoint(panelPlace());
const box = document.querySelector(".semsig-panel").getBoundingClientRect();
return 0 <= x && x <= innerWidth && 0 <= y && y <= innerHeight && !(box.x <= x && box.y <= y);
"""


def press(page: MapPage, x: float, y: float) -> None:
    mouse = ActionBuilder(page.browser)
    mouse.pointer_action.move_to_location(round(x), round(y)).click()
    mouse.perform()


def wait_for(page: MapPage, key: str | None) -> None:
    script = "return map.semsigPanel.selection?.key ?? null"
    page.until(lambda: page.ask(script) == key)


@pytest.mark.parametrize("screen", SCREENS)
def test_every_click_on_a_cell_opens_the_panel(page: MapPage, screen: tuple[int, int]) -> None:
    rng = np.random.default_rng(7)
    with page.screen(*screen, mobile=False):
        page.open(ambiguity_map(CITY))
        page.ask("map.setView(arguments[0], 18, {animate: false})", PLACES.mean(axis=0).tolist())
        for _ in range(20):
            some = rng.permutation(len(CITY))[:60]
            number, *where = page.ask(ON_TOP, PLACES[some].tolist())
            press(page, *where)
            wait_for(page, f"cell:{CITY.cell_ids[some[number]]}")
            assert page.ask(NOT_COVERED)


@pytest.mark.parametrize("screen", SCREENS)
def test_selected_query_is_never_covered(page: MapPage, screen: tuple[int, int]) -> None:
    with page.screen(*screen, mobile=False):
        page.open(evaluation_map(small_evaluation("medium"), small_city()[0]))
        count = page.ask("return signs('failed').length")
        for query in range(0, count, max(1, count // 12)):
            page.ask("signs('failed')[arguments[0]].fire('click')", query)
            assert page.ask(NOT_COVERED)


@pytest.mark.parametrize("moving", [False, True])
def test_map_glides_unless_reduced_motion_is_set(page: MapPage, moving: bool) -> None:  # noqa: FBT001
    with page.screen(1440, 900, mobile=False, moving=moving):
        page.open(ambiguity_map(CITY))
        page.ask("map.setView(arguments[0], 19, {animate: false})", PLACES[0].tolist())
        for side in (-0.95, 0.95):
            assert page.ask_later(GLIDES, side) == moving
            page.rest()
            assert page.ask(NOT_COVERED)
            page.ask("semsig.hide(map)")


def test_click_outside_cells_describes_nearest_cell_or_place(page: MapPage) -> None:
    page.open(ambiguity_map(CITY))
    page.ask("map.setZoom(19, {animate: false})")
    outermost = int(CITY.xy[:, 0].argmin())
    x, y = CITY.xy[outermost].tolist()
    for away, title in ((30.0, "Cells that look the same"), (90.0, "No cell here")):
        (place,) = to_latlon(np.array([[x - away, y]]), CITY.crs).tolist()
        page.click_at(place)
        facts = page.facts()
        assert facts["title"] == title
        if away < 50.0:
            assert facts["Nearest cell"] == "30 m from the click"
            assert facts["Cell"] == str(CITY.cell_ids[outermost])
        else:
            assert facts["Seen"] == "nothing from this place"
            numbers = [float(part) for part in facts["Latitude, longitude"].split(", ")]
            assert numbers == pytest.approx(place, abs=2e-6)


def test_panel_has_a_name_and_closes_by_key_button_and_swipe(page: MapPage) -> None:
    with page.screen(390, 844, mobile=False):
        page.open(ambiguity_map(CITY))
        panel = page.one(".semsig-panel")
        names = [panel.get_attribute(name) for name in ("role", "aria-live", "aria-label")]
        assert names == ["region", "polite", "About this place"]
        number = str(CITY.cell_ids[0])
        key = f"cell:{number}"
        # Opened by keyboard, it gets the focus; closed, it returns the focus.
        page.search(number, Keys.ENTER)
        wait_for(page, key)
        focused = "return document.activeElement.className.split(' ')[0]"
        assert page.ask(focused) == "semsig-panel"
        page.browser.switch_to.active_element.send_keys(Keys.ESCAPE)
        wait_for(page, None)
        assert page.ask(focused) == "folium-map"
        page.click(CITY, 0)
        button = page.one(".semsig-hide")
        assert min(button.size.values()) >= 44
        button.click()
        wait_for(page, None)
        head = ".semsig-panel-head"
        for far, open_ in ((20, True), (120, False)):
            page.click(CITY, 0)
            swipe = ActionChains(page.browser).click_and_hold(page.one(head))
            swipe.move_by_offset(0, far).release().perform()
            wait_for(page, key if open_ else None)
        page.ask("semsig.hide(map)")  # which is closed
    with page.screen(1440, 900, mobile=False):
        page.click(CITY, 0)
        swipe = ActionChains(page.browser).click_and_hold(page.one(head))
        swipe.move_by_offset(100, 0).release().perform()
        wait_for(page, None)


def test_openers_open_the_panel_for_a_key(page: MapPage) -> None:
    city, evaluation = small_city()[0], small_evaluation("medium")
    map_ = evaluation_map(evaluation, city)
    for objects in (OBJECTS, OBJECTS):
        objects_map(objects, map_=map_)
    page.open(map_)
    opened = "return [semsig.openers[arguments[0]](map, arguments[1]), panel().split('\\n')[0]]"
    for kind, rest, title in (("query", "17", "Query 17: "), ("place", "48.1,2.1", "A place")):
        success, text = page.ask(opened, kind, rest)
        assert success
        assert text.startswith(title)
        wait_for(page, {"place": "place:48.100000,2.100000"}.get(kind, f"{kind}:{rest}"))
    layers = page.ask(
        "return Object.keys(semsig.layerSets).filter("
        "(name) => /^objects/.test(name)).map((name) => name.slice(7))"
    )
    assert len(layers) == 2
    for layer in layers:
        assert page.ask("return semsig.openers.object(map, arguments[0])", f"{layer}/3")
        wait_for(page, f"object:{layer}/3")
    for kind, rest in (("query", "0"), ("place", "nowhere"), ("object", "x/1"), ("object", "/-1")):
        assert not page.ask(opened, kind, rest)[0]


LIT = """
return [...document.querySelectorAll(".semsig-wheels figure")].map((wheel) =>
  [...wheel.querySelectorAll(".object")].map(({classList}) => classList.contains("lit")));
"""


def lit(page: MapPage) -> list[list[bool]]:
    """Return for each object of each wheel whether it is highlighted."""
    return list(page.ask(LIT))


def test_object_is_highlighted_in_wheel_and_map(page: MapPage) -> None:
    """The oracle is the positions of the objects of the city."""
    cell = int(CITY.lengths.argmax())
    with page.screen(1440, 900, mobile=False):
        page.open(ambiguity_map(CITY))
        page.ask("map.setView(arguments[0], 19, {animate: false})", PLACES[cell].tolist())
        page.click(CITY, cell)
        key = f"cell:{CITY.cell_ids[cell]}"
        first = page.all(".semsig-wheels figure")[0]
        objects = first.find_elements(By.CSS_SELECTOR, ".object")
        hint = "Point at an object to see it on the map."
        assert page.text(".semsig-lit-object") == hint
        for number in range(0, len(objects), 4):
            ActionChains(page.browser).move_to_element(objects[number]).perform()
            assert lit(page)[0] == [at == number for at in range(len(objects))]
            (place, *mate) = page.ask("return litPlaces()")
            assert len(mate) == sum(lit(page)[1])
            code = CITY.codes[CITY.offsets[cell] + number]
            title = CITY.taxonomy.by_code(int(code)).title
            assert page.text(".semsig-lit-object").startswith(title)
            same = to_latlon(OBJECTS.xy[OBJECTS.codes == code], OBJECTS.crs)
            assert np.abs(same - place).max(axis=1).min() < 1e-5  # a metre
        ActionChains(page.browser).move_to_element(page.one("h2")).perform()
        assert page.text(".semsig-lit-object") == hint
        assert not any(map(any, lit(page)))
        # From the map to the wheel.
        page.ask(
            "shown((layer) => layer.getElement?.()?.matches?.('.semsig-object'))[2].fire('click')"
        )
        assert lit(page)[0].index(True) == 2
        # A click with a mouse describes the cell below the sign.
        sign = page.all(".semsig-object")[0]
        ActionChains(page.browser).move_to_element(sign).click().perform()
        script = "return map.semsigPanel.selection.key"
        page.until(lambda: page.ask(script) != key)
        page.click(CITY, cell)
        objects = page.all(".semsig-wheels figure:first-child .object")
        # By keyboard, round and back.
        page.ask("arguments[0].focus()", objects[0])
        page.browser.switch_to.active_element.send_keys(Keys.ARROW_LEFT)
        assert lit(page)[0].index(True) == len(objects) - 1
        page.browser.switch_to.active_element.send_keys(Keys.ARROW_RIGHT, "x")
        assert lit(page)[0].index(True) == 0


def test_object_without_distance_is_drawn_as_a_ray(page: MapPage) -> None:
    page.open(evaluation_map(small_evaluation("light"), small_city()[0]))
    longest = int(small_evaluation("light").queries["query_length"].argmax())
    page.search(f"Query {longest + 1}:", Keys.ENTER)
    ray = "return lines(({options}) => options.color === arguments[0] && options.dashArray)"
    count = len(page.all(".semsig-wheels figure:first-child .object"))
    assert page.ask(f"{ray}.length", "#808080") == count
    ActionChains(page.browser).move_to_element(page.one(".semsig-wheels .object")).perform()
    assert page.ask(f"{ray}.length", "#808080") == count - 1
    page.ask("lines(({options}) => options.color === semsig.highlight && options.weight === 5)[0]"
             ".fire('mouseout')")  # fmt: skip
    assert page.ask(f"{ray}.length", "#808080") == count
