"""The panel of a map: what it says, where it lies, and how it opens and closes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from machine import PATIENCE_S
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.wait import WebDriverWait
from small_city import small_city, small_evaluation
from worlds import random_town

from semsig_gis.maps import ambiguity_map, evaluation_map, objects_map, to_latlon

if TYPE_CHECKING:
    from map_pages import MapPage

CITY = random_town().database
OBJECTS = random_town().street_objects
PLACES = to_latlon(CITY.xy, CITY.crs)
SCREENS = [(1440, 900), (390, 844)]
# The first of some places where the map is on top: its number, and where it is on the screen.
ON_TOP = """
for (const [number, place] of arguments[0].entries()) {
  const {x, y} = map.latLngToContainerPoint(place);
  const top = document.elementFromPoint(Math.round(x), Math.round(y));
  if (top && !top.closest(".semsig-panel, .leaflet-control")) return [number, x, y];
}
"""
# Click at a share of the half width from the middle: does the map glide?
GLIDES = """
map.once("semsig-told", () => arguments[1](Boolean(map._panAnim?._inProgress)));
const x = (1 + arguments[0]) * map.getSize().x / 2;
map.fire("click", {latlng: map.containerPointToLatLng([x, map.getSize().y / 2])});
"""
BESIDE_THE_PANEL = """
const {x, y} = map.latLngToContainerPoint(toldPlace());
const box = document.querySelector(".semsig-panel").getBoundingClientRect();
return 0 <= x && x <= innerWidth && 0 <= y && y <= innerHeight && !(box.x <= x && box.y <= y);
"""


def press(page: MapPage, x: float, y: float) -> None:
    mouse = ActionBuilder(page.browser)
    mouse.pointer_action.move_to_location(round(x), round(y)).click()
    mouse.perform()


def wait_for(page: MapPage, key: str | None) -> None:
    told = "return map.semsigPanel.told?.key ?? null"
    WebDriverWait(page.browser, PATIENCE_S, 0.02).until(lambda _: page.ask(told) == key, str(key))


@pytest.mark.parametrize("screen", SCREENS)
def test_every_click_on_a_cell_is_answered(page: MapPage, screen: tuple[int, int]) -> None:
    rng = np.random.default_rng(7)
    with page.screen(*screen, mobile=False):
        page.open(ambiguity_map(CITY))
        page.ask("map.setView(arguments[0], 18, {animate: false})", PLACES.mean(axis=0).tolist())
        for _ in range(20):
            some = rng.permutation(len(CITY))[:60]
            number, *where = page.ask(ON_TOP, PLACES[some].tolist())
            press(page, *where)
            wait_for(page, f"cell:{CITY.cell_ids[some[number]]}")
            assert page.ask(BESIDE_THE_PANEL)


@pytest.mark.parametrize("screen", SCREENS)
def test_what_is_told_of_is_never_covered(page: MapPage, screen: tuple[int, int]) -> None:
    with page.screen(*screen, mobile=False):
        page.open(evaluation_map(small_evaluation("medium"), small_city()[0]))
        count = page.ask("return signs('failed').length")
        for query in range(0, count, max(1, count // 12)):
            page.ask("signs('failed')[arguments[0]].fire('click')", query)
            assert page.ask(BESIDE_THE_PANEL)


@pytest.mark.parametrize("moving", [False, True])
def test_the_map_glides_unless_that_is_disliked(page: MapPage, moving: bool) -> None:  # noqa: FBT001
    with page.screen(1440, 900, mobile=False, moving=moving):
        page.open(ambiguity_map(CITY))
        page.ask("map.setView(arguments[0], 19, {animate: false})", PLACES[0].tolist())
        for side in (-0.95, 0.95):
            assert page.ask_later(GLIDES, side) == moving
            page.rest()
            assert page.ask(BESIDE_THE_PANEL)
            page.ask("semsig.hide(map)")


def test_a_click_beside_the_cells_is_answered_too(page: MapPage) -> None:
    page.open(ambiguity_map(CITY))
    page.ask("map.setZoom(19, {animate: false})")
    outermost = int(CITY.xy[:, 0].argmin())
    x, y = CITY.xy[outermost].tolist()
    for away, title in ((30.0, "Cells that look the same"), (90.0, "No cell here")):
        (place,) = to_latlon(np.array([[x - away, y]]), CITY.crs).tolist()
        page.click_at(place)
        said = page.told()
        assert said["title"] == title
        if away < 50.0:
            assert said["Nearest cell"] == "30 m from the click"
            assert said["Cell"] == str(CITY.cell_ids[outermost])
        else:
            assert said["Seen"] == "nothing from this place"
            numbers = [float(one) for one in said["Latitude, longitude"].split(", ")]
            assert numbers == pytest.approx(place, abs=2e-6)


def test_the_panel_is_named_and_closes_in_three_ways(page: MapPage) -> None:
    with page.screen(390, 844, mobile=False):
        page.open(ambiguity_map(CITY))
        panel = page.one(".semsig-panel")
        names = [panel.get_attribute(name) for name in ("role", "aria-live", "aria-label")]
        assert names == ["region", "polite", "About this place"]
        number = str(CITY.cell_ids[0])
        key = f"cell:{number}"
        # By keyboard it gets the focus, and gives it back.
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


def test_what_a_key_names_is_told_again(page: MapPage) -> None:
    city, evaluation = small_city()[0], small_evaluation("medium")
    map_ = evaluation_map(evaluation, city)
    for some in (OBJECTS, OBJECTS):
        objects_map(some, map_=map_)
    page.open(map_)
    opened = "return [semsig.openers[arguments[0]](map, arguments[1]), panel().split('\\n')[0]]"
    for kind, rest, title in (("query", "17", "Query 17: "), ("place", "48.1,2.1", "A place")):
        known, said = page.ask(opened, kind, rest)
        assert known
        assert said.startswith(title)
        wait_for(page, {"place": "place:48.100000,2.100000"}.get(kind, f"{kind}:{rest}"))
    layers = page.ask(
        "return Object.keys(semsig.held).filter("
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
  [...wheel.querySelectorAll(".object")].map((one) => one.classList.contains("lit")));
"""


def lit(page: MapPage) -> list[list[bool]]:
    """Return of each object of each wheel whether it is lit."""
    return list(page.ask(LIT))


def test_an_object_is_lit_in_the_wheel_and_on_the_map(page: MapPage) -> None:
    """The oracle is where the objects are that the city was made from."""
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
        page.ask("shown((one) => one.getElement?.()?.matches?.('.semsig-object'))[2].fire('click')")
        assert lit(page)[0].index(True) == 2
        # A click of a mouse asks for what is below.
        sign = page.all(".semsig-object")[0]
        ActionChains(page.browser).move_to_element(sign).click().perform()
        told = "return map.semsigPanel.told.key"
        WebDriverWait(page.browser, PATIENCE_S).until(lambda _: page.ask(told) != key)
        page.click(CITY, cell)
        objects = page.all(".semsig-wheels figure:first-child .object")
        # By keyboard, round and back.
        page.ask("arguments[0].focus()", objects[0])
        page.browser.switch_to.active_element.send_keys(Keys.ARROW_LEFT)
        assert lit(page)[0].index(True) == len(objects) - 1
        page.browser.switch_to.active_element.send_keys(Keys.ARROW_RIGHT, "x")
        assert lit(page)[0].index(True) == 0


def test_what_was_seen_but_not_how_far_is_a_ray(page: MapPage) -> None:
    page.open(evaluation_map(small_evaluation("light"), small_city()[0]))
    longest = int(small_evaluation("light").queries["query_length"].argmax())
    page.search(f"Query {longest + 1}:", Keys.ENTER)
    ray = "return lines((one) => one.options.color === arguments[0] && one.options.dashArray)"
    count = len(page.all(".semsig-wheels figure:first-child .object"))
    assert page.ask(f"{ray}.length", "#808080") == count
    ActionChains(page.browser).move_to_element(page.one(".semsig-wheels .object")).perform()
    assert page.ask(f"{ray}.length", "#808080") == count - 1
    page.ask("lines((one) => one.options.color === semsig.pointed && one.options.weight === 5)[0]"
             ".fire('mouseout')")  # fmt: skip
    assert page.ask(f"{ray}.length", "#808080") == count
