"""The state of a map in the address of its page."""

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

VIEW = """
return [map.getCenter().lat, map.getCenter().lng, map.getZoom(),
  semsig.isDark(map), [...document.querySelectorAll(".leaflet-control-layers :checked")].map(
    (input) => input.closest("label").innerText.trim()).join()];
"""


@pytest.fixture
def ambiguity_page(page: MapPage) -> MapPage:
    page.open(ambiguity_map(small_city()[0]))
    return page


def state(page: MapPage) -> dict[str, str]:
    fragment = urlsplit(page.browser.current_url).fragment
    return {key: values[0] for key, values in parse_qs(fragment).items()}


def wait_for(page: MapPage, **parts: str | None) -> None:
    """Wait until the address contains these parts, and no parts that are None."""
    WebDriverWait(page.browser, PATIENCE_S).until(
        lambda _: all(state(page).get(key) == text for key, text in parts.items())
    )


def follow(page: MapPage, address: str) -> None:
    """Open an address like a link on another page, without stored colours."""
    page.browser.get("about:blank")
    page.browser.execute_cdp_cmd(
        "Storage.clearDataForOrigin", {"origin": "file://", "storageTypes": "local_storage"}
    )
    for log in ("browser", "performance"):
        page.browser.get_log(log)
    page.browser.get(address)


def test_link_restores_layers_place_and_colours(ambiguity_page: MapPage) -> None:
    assert state(ambiguity_page) == {}
    ambiguity_page.switch("Same types and angle levels")
    ambiguity_page.switch("Describe a cell when clicked")
    changed = "~Same-types,Same-types-and-angle-levels,~Describe-a-cell-when-clicked"
    wait_for(ambiguity_page, layers=changed)
    ambiguity_page.ask("map.setView([43.5, 3.25], 15.25, {animate: false})")
    ambiguity_page.one(".semsig-colours").click()
    wait_for(ambiguity_page, place="43.50000,3.25000,15.25", colours="dark")
    view, link = ambiguity_page.ask(VIEW), ambiguity_page.browser.current_url
    assert view[2:] == [15.25, True, "Same types and angle levels"]
    follow(ambiguity_page, link)
    assert ambiguity_page.ask(VIEW) == view
    ambiguity_page.switch("Same types")
    ambiguity_page.switch("Describe a cell when clicked")
    wait_for(ambiguity_page, layers=None)


def test_link_restores_the_order_of_images(page: MapPage) -> None:
    above = """
    const images = [...document.querySelectorAll("img.leaflet-image-layer")];
    return images.map(({style}) => [style.opacity, style.zIndex]);
    """
    page.open(location_map(small_location()))
    assert page.ask(above) == [["", "1"], ["0.85", "1"]]
    address = page.browser.current_url
    follow(page, f"{address}#layers=~Chance-of-a-cell,Regions-of-50-90-and-99")
    assert page.ask(above) == [["", "1"], ["0.85", "1"]]
    assert page.ask(VIEW)[4].startswith("Regions")
    # The opener finds a sign by its number, and the search too, after colours have changed.
    page.switch("Candidates (10)")
    page.one(".semsig-colours").click()
    opened = "return semsig.openers.rank(map, arguments[0])"
    assert [page.ask(opened, number) for number in ("99", "2")] == [False, True]
    assert page.facts()["title"].startswith("Rank 2")
    page.search("rank 3 of", Keys.ENTER)
    assert page.facts()["title"].startswith("Rank 3")


def test_invalid_link_shows_the_default_map(ambiguity_page: MapPage) -> None:
    view, address = ambiguity_page.ask(VIEW), ambiguity_page.browser.current_url
    for fragment in (
        "place=north,3,x&layers=~~,No-such&told=nobody:1",
        "colours=x&&=&told=",
        "what",
    ):
        follow(ambiguity_page, f"{address}#{fragment}")
        assert ambiguity_page.ask(VIEW) == view


def test_changed_address_changes_the_map(ambiguity_page: MapPage) -> None:
    ambiguity_page.ask("location.hash = 'place=43,3,14&colours=dark&other=kept'")
    WebDriverWait(ambiguity_page.browser, PATIENCE_S).until(
        lambda _: ambiguity_page.ask(VIEW)[2] == 14
    )
    assert ambiguity_page.ask(VIEW)[:4] == pytest.approx([43, 3, 14, True])
    wait_for(ambiguity_page, other="kept", place="43.00000,3.00000,14")


def test_panel_state_is_restored(ambiguity_page: MapPage) -> None:
    addresses: list[Any] = []
    for key in ("query:17:b", "query:18", None):
        ambiguity_page.ask("map.fire('semsig-panel', {key: arguments[0]})", key)
        wait_for(ambiguity_page, told=key)
        if key:
            addresses.append(ambiguity_page.browser.current_url)
    ambiguity_page.ask(
        "semsig.openers.query = (own, rest) => { window.opened = [own === map, rest]; return 1; }"
    )
    ambiguity_page.ask("location.hash = arguments[0]", urlsplit(addresses[0]).fragment)
    opened = WebDriverWait(ambiguity_page.browser, PATIENCE_S).until(
        lambda _: ambiguity_page.ask("return window.opened")
    )
    assert opened == [True, "17:b"]
