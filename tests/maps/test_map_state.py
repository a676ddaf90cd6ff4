"""The address of a page: what is seen of its map, as far as a link can tell."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

import pytest
from machine import PATIENCE_S
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.wait import WebDriverWait
from small_city import small_city, small_location

from semsig_gis.maps import ambiguity_map, location_map

if TYPE_CHECKING:
    from map_pages import MapPage

SEEN = """
return [map.getCenter().lat, map.getCenter().lng, map.getZoom(),
  semsig.isDark(map), [...document.querySelectorAll(".leaflet-control-layers :checked")].map(
    (one) => one.closest("label").innerText.trim()).join()];
"""


@pytest.fixture
def alike(page: MapPage) -> MapPage:
    page.open(ambiguity_map(small_city()[0]))
    return page


def state(page: MapPage) -> dict[str, str]:
    fragment = urlsplit(page.browser.current_url).fragment
    return {key: values[0] for key, values in parse_qs(fragment).items()}


def wait_for(page: MapPage, **parts: str | None) -> None:
    """Wait until the address tells these parts, and not those that are None."""

    def told(_: object) -> bool:
        return all(state(page).get(key) == text for key, text in parts.items())

    WebDriverWait(page.browser, PATIENCE_S).until(told)


def follow(page: MapPage, address: str) -> None:
    """Open an address as a link from elsewhere does."""
    page.browser.get("about:blank")
    page.browser.execute_cdp_cmd(
        "Storage.clearDataForOrigin", {"origin": "file://", "storageTypes": "local_storage"}
    )
    for log in ("browser", "performance"):
        page.browser.get_log(log)
    page.browser.get(address)


def test_a_link_shows_what_was_seen_when_it_was_copied(alike: MapPage) -> None:
    assert state(alike) == {}
    alike.switch("Same types and angle levels")
    alike.switch("Describe a cell when clicked")
    changed = "~Same-types,Same-types-and-angle-levels,~Describe-a-cell-when-clicked"
    wait_for(alike, layers=changed)
    alike.ask("map.setView([43.5, 3.25], 15.25, {animate: false})")
    alike.one(".semsig-colours").click()
    wait_for(alike, place="43.50000,3.25000,15.25", colours="dark")
    seen, link = alike.ask(SEEN), alike.browser.current_url
    assert seen[2:] == [15.25, True, "Same types and angle levels"]
    follow(alike, link)
    assert alike.ask(SEEN) == seen
    alike.switch("Same types")
    alike.switch("Describe a cell when clicked")
    wait_for(alike, layers=None)


def test_what_a_link_colours_lies_on_the_cells(page: MapPage) -> None:
    above = """
    const images = [...document.querySelectorAll("img.leaflet-image-layer")];
    return images.map((one) => [one.style.opacity, one.style.zIndex]);
    """
    page.open(location_map(small_location()))
    assert page.ask(above) == [["", "1"], ["0.85", "1"]]
    address = page.browser.current_url
    follow(page, f"{address}#layers=~Chance-of-a-cell,Regions-of-50-90-and-99")
    assert page.ask(above) == [["", "1"], ["0.85", "1"]]
    assert page.ask(SEEN)[4].startswith("Regions")
    # A sign is told of by its number, and its edge follows the colours while it is on the map.
    page.switch("Candidates (10)")
    page.one(".semsig-colours").click()
    opened = "return semsig.openers.rank(map, arguments[0])"
    assert [page.ask(opened, number) for number in ("99", "2")] == [False, True]
    assert page.told()["title"].startswith("Rank 2")
    page.search("rank 3 of", Keys.ENTER)
    assert page.told()["title"].startswith("Rank 3")


def test_a_link_that_tells_nothing_of_the_map_shows_it_as_it_is(alike: MapPage) -> None:
    seen, address = alike.ask(SEEN), alike.browser.current_url
    for fragment in (
        "place=north,3,x&layers=~~,No-such&told=nobody:1",
        "colours=x&&=&told=",
        "what",
    ):
        follow(alike, f"{address}#{fragment}")
        assert alike.ask(SEEN) == seen


def test_another_part_of_the_same_page_is_shown_by_its_address(alike: MapPage) -> None:
    alike.ask("location.hash = 'place=43,3,14&colours=dark&other=kept'")
    WebDriverWait(alike.browser, PATIENCE_S).until(lambda _: alike.ask(SEEN)[2] == 14)
    assert alike.ask(SEEN)[:4] == pytest.approx([43, 3, 14, True])
    wait_for(alike, other="kept", place="43.00000,3.00000,14")


def test_what_was_told_is_told_again(alike: MapPage) -> None:
    told: list[Any] = []
    for key in ("query:17:b", "query:18", None):
        alike.ask("map.fire('semsig-told', {key: arguments[0]})", key)
        wait_for(alike, told=key)
        if key:
            told.append(alike.browser.current_url)
    alike.ask(
        "semsig.openers.query = (one, rest) => { window.asked = [one === map, rest]; return true; }"
    )
    alike.ask("location.hash = arguments[0]", urlsplit(told[0]).fragment)
    asked = WebDriverWait(alike.browser, PATIENCE_S).until(
        lambda _: alike.ask("return window.asked")
    )
    assert asked == [True, "17:b"]
