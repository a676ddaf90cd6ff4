"""Sharing a map: its title, picture, printed page and coordinates, and its state in the address."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

import pytest
from map_pages import HOSTILE
from selenium.webdriver.common.keys import Keys
from small_city import small_location

from semsig_gis.core import GROUP_COLOURS
from semsig_gis.output import location_map, save_map

if TYPE_CHECKING:
    from map_pages import MapPage

# The number of pixels of about a colour in a box of the picture of a map.
PICTURE = """
const [colour, box, done] = arguments;
const target = [1, 3, 5].map((at) => Number.parseInt(colour.slice(at, at + 2), 16));
semsig.picture(map).then((canvas) => {
  const [x, y, width, height] = box || [0, 0, canvas.width, canvas.height];
  const {data} = canvas.getContext("2d").getImageData(x, y, width, height);
  let count = 0;
  for (let at = 0; at < data.length; at += 4) {
    if (target.every((part, i) => Math.abs(data[at + i] - part) < 8)) count += 1;
  }
  done([count, canvas.width, canvas.height]);
});
"""


def test_title_shows_given_text_and_kind_of_map(page: MapPage) -> None:
    file = page.folder / "map.html"
    save_map(location_map(small_location()), file, title=HOSTILE)
    page.browser.get(file.as_uri())
    assert page.text(".semsig-title h1") == page.browser.title == HOSTILE
    more = page.text(".semsig-title p")
    assert more == "Where it was seen"
    assert page.one("[role=main]").get_attribute("aria-label") == HOSTILE


def test_title_is_the_kind_of_map_and_legend_explains_layers(
    ambiguity_page: MapPage,
) -> None:
    def explanations() -> list[str]:
        return [
            element.text.splitlines()[1]
            for element in ambiguity_page.all(".semsig-legend [data-layer]:not([hidden])")
        ]

    titles = [element.text for element in ambiguity_page.all(".semsig-title *")]
    assert titles == ["Cells that look the same"]
    assert explanations() == ["How many cells have the same types"]
    ambiguity_page.switch("Same types and angle levels")
    assert explanations() == ["How many cells have the same types and angle levels"]
    ambiguity_page.switch("Nothing")
    assert explanations() == []
    assert ambiguity_page.one(".semsig-legend details").get_attribute("open") is None


@pytest.mark.parametrize("dots", [1, 2])
def test_picture_shows_the_visible_map(ambiguity_page: MapPage, dots: int) -> None:
    colour = next(iter(GROUP_COLOURS.values()))
    with ambiguity_page.screen(1200, 800, mobile=False, dots=dots):
        count, width, height = ambiguity_page.ask_later(PICTURE, colour, None)
        assert (width, height) == (1200 * dots, 800 * dots)
        assert count > 10_000 * dots
        legend, title = (
            ambiguity_page.one(part).rect for part in (".semsig-legend", ".semsig-title")
        )
        for box in (legend, title):
            place = [box[key] * dots for key in ("x", "y", "width", "height")]
            assert ambiguity_page.ask_later(PICTURE, "#ffffff", place)[0] > place[2] * place[3] / 2
            assert ambiguity_page.ask_later(PICTURE, "#222222", place)[0] > 20
        # The picture shows no buttons.
        bar = ambiguity_page.one(".leaflet-bar").rect
        place = [bar[key] * dots for key in ("x", "y", "width", "height")]
        assert ambiguity_page.ask_later(PICTURE, "#222222", place)[0] == 0


def test_picture_has_dark_colours(page: MapPage) -> None:
    page.open(location_map(small_location()))
    light = page.ask_later(PICTURE, "#131518", None)[0]
    page.one(".semsig-colours").click()
    dark = page.ask_later(PICTURE, "#131518", None)[0]
    assert light < 1000
    assert dark > 100_000


def test_picture_file_is_named_after_the_map(ambiguity_page: MapPage) -> None:
    ambiguity_page.ask("""
    HTMLAnchorElement.prototype.click = function () { window.saved = this.download; };
    """)
    ambiguity_page.one(".semsig-save").click()
    saved: Any = ambiguity_page.ask_later("""
    const look = () => (window.saved ? arguments[0](window.saved) : setTimeout(look, 20));
    look();
    """)
    assert saved == "Cells-that-look-the-same.png"
    assert ambiguity_page.text(".semsig-status") == f"Saved: {saved}"


def test_printed_page_has_map_title_and_legend(ambiguity_page: MapPage) -> None:
    ambiguity_page.one(".semsig-colours").click()
    ambiguity_page.ask("semsig.remembered = map.getCenter()")
    printed: Any = ambiguity_page.ask_later("""
    window.print = () => {
      const {x, y} = map.getSize();
      window.printed = [x, y, semsig.isDark(map), document.querySelector(".semsig-legend").open,
        map.getCenter().distanceTo(semsig.remembered) < 1];
    };
    document.querySelector(".semsig-legend").open = false;
    document.querySelector(".semsig-print").click();
    const look = () => (window.printed ? arguments[0](window.printed) : setTimeout(look, 20));
    look();
    """)
    assert printed == [1040, 700, False, True, True]
    assert ambiguity_page.ask("return semsig.isDark(map)") is True
    assert ambiguity_page.ask("return map.getCenter().distanceTo(semsig.remembered) < 1") is True
    ambiguity_page.ask("document.querySelector('.semsig-legend').open = true")
    with ambiguity_page.screen(1040, 700, mobile=False, media="print"):
        for part, is_seen in (
            *((part, True) for part in (".semsig-title", ".semsig-legend")),
            *((part, False) for part in (".semsig-search", ".leaflet-bar", ".semsig-status")),
            *((part, False) for part in (".leaflet-control-layers", ".semsig-panel")),
        ):
            assert (part, ambiguity_page.one(part).is_displayed()) == (part, is_seen)


def test_coordinates_are_copied_by_button_and_key(ambiguity_page: MapPage) -> None:
    ambiguity_page.ask("""
    window.copied = [];
    navigator.clipboard.writeText = (text) => {
      window.copied.push(text);
      return window.copied.length < 3 ? Promise.resolve() : Promise.reject(new Error("no"));
    };
    map.setView([43.5, 3.25], 15, {animate: false});
    """)
    ambiguity_page.one("[role=main]").send_keys("c")
    ambiguity_page.one(".semsig-search input").send_keys("c")
    ambiguity_page.ask("semsig.showPlace(map, L.latLng(43.123456, 3.5))")
    for _ in range(2):
        ambiguity_page.one(".semsig-copy").click()
    copied = ambiguity_page.ask("return window.copied")
    assert copied == ["43.500000, 3.250000", *2 * ["43.123456, 3.500000"]]
    assert ambiguity_page.text(".semsig-status") == "Copy by hand: 43.123456, 3.500000"


# --- The state in the address -----------------------------------------------------------------

VIEW = """
return [map.getCenter().lat, map.getCenter().lng, map.getZoom(),
  semsig.isDark(map), [...document.querySelectorAll(".leaflet-control-layers :checked")].map(
    (input) => input.closest("label").innerText.trim()).join()];
"""


def state(page: MapPage) -> dict[str, str]:
    fragment = urlsplit(page.browser.current_url).fragment
    return {key: values[0] for key, values in parse_qs(fragment).items()}


def wait_for(page: MapPage, **parts: str | None) -> None:
    """Wait until the address contains these parts, and no parts that are None."""
    page.until(lambda: all(state(page).get(key) == text for key, text in parts.items()))


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
    ambiguity_page.follow(link)
    assert ambiguity_page.ask(VIEW) == view
    ambiguity_page.switch("Same types")
    ambiguity_page.switch("Describe a cell when clicked")
    wait_for(ambiguity_page, layers=None)


def test_link_restores_colours_and_finds_signs(page: MapPage) -> None:
    above = """
    const images = [...document.querySelectorAll("img.leaflet-image-layer")];
    return images.map(({style}) => [style.opacity, style.zIndex]);
    """
    page.open(location_map(small_location()))
    assert page.ask(above) == [["0.45", "1"]]
    address = page.browser.current_url
    page.follow(f"{address}#layers=~Chance-of-a-cell,Regions-of-50-90-and-99")
    assert page.ask(above) == [["0.45", "1"]]
    assert page.ask(VIEW)[4].startswith("Regions")
    # The opener finds a sign by its number, and the search too, after colours have changed.
    page.switch("Candidates (10)")
    page.one(".semsig-colours").click()
    opened = "return semsig.openers.rank(map, arguments[0])"
    assert [page.ask(opened, number) for number in ("99", "2")] == [False, True]
    assert page.facts()["title"].startswith("Rank 2")
    page.search("rank 3", Keys.ENTER)
    assert page.facts()["title"].startswith("Rank 3")


def test_invalid_link_shows_the_default_map(ambiguity_page: MapPage) -> None:
    view, address = ambiguity_page.ask(VIEW), ambiguity_page.browser.current_url
    invalid = "place=north,3,x&layers=~~,No-such&told=nobody:1"
    for fragment in (invalid, "colours=x&&=&told=", "what"):
        ambiguity_page.follow(f"{address}#{fragment}")
        assert ambiguity_page.ask(VIEW) == view


def test_changed_address_changes_the_map(ambiguity_page: MapPage) -> None:
    ambiguity_page.ask("location.hash = 'place=43,3,14&colours=dark&other=kept'")
    ambiguity_page.until(lambda: ambiguity_page.ask(VIEW)[2] == 14)
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
    opened = ambiguity_page.until(lambda: ambiguity_page.ask("return window.opened"))
    assert opened == [True, "17:b"]
