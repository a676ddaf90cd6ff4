"""A map that is shown to others: its title, its picture, its page of paper, its coordinates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from map_pages import HOSTILE
from small_city import small_city, small_location

from semsig_gis.core import GROUP_COLOURS
from semsig_gis.maps import ambiguity_map, location_map, save_map

if TYPE_CHECKING:
    from map_pages import MapPage

# The number of pixels of about a colour on the picture of a map, in a box.
PICTURE = """
const [colour, box, done] = arguments;
const wanted = [1, 3, 5].map((at) => Number.parseInt(colour.slice(at, at + 2), 16));
semsig.picture(map).then((canvas) => {
  const [x, y, width, height] = box || [0, 0, canvas.width, canvas.height];
  const {data} = canvas.getContext("2d").getImageData(x, y, width, height);
  let count = 0;
  for (let at = 0; at < data.length; at += 4) {
    if (wanted.every((part, i) => Math.abs(data[at + i] - part) < 8)) count += 1;
  }
  done([count, canvas.width, canvas.height]);
});
"""


@pytest.fixture
def alike(page: MapPage) -> MapPage:
    page.open(ambiguity_map(small_city()[0]))
    return page


def test_a_title_says_what_it_was_given_what_is_shown_and_how_it_was_made(page: MapPage) -> None:
    file = page.folder / "map.html"
    save_map(location_map(small_location()), file, title=HOSTILE)
    page.browser.get(file.as_uri())
    assert page.text(".semsig-title h1") == page.browser.title == HOSTILE
    more = page.text(".semsig-title p")
    assert more == f"Where it was seen · Likelihood, light noise, {len(small_city()[0]):,} cells"
    assert page.one("[role=main]").get_attribute("aria-label") == HOSTILE


def test_without_a_title_a_map_says_what_it_shows(alike: MapPage) -> None:
    assert [one.text for one in alike.all(".semsig-title *")] == ["Cells that look the same"]


def test_a_legend_explains_what_is_switched_on(alike: MapPage) -> None:
    def told() -> list[str]:
        return [
            one.text.splitlines()[1]
            for one in alike.all(".semsig-legend [data-layer]:not([hidden])")
        ]

    assert told() == ["How many cells have the same types"]
    alike.switch("Same types and angle levels")
    assert told() == ["How many cells have the same types and angle levels"]
    alike.switch("Nothing")
    assert told() == []
    assert alike.one(".semsig-legend details").get_attribute("open") is None


@pytest.mark.parametrize("dots", [1, 2])
def test_a_picture_is_what_is_seen(alike: MapPage, dots: int) -> None:
    alone = next(iter(GROUP_COLOURS.values()))
    with alike.screen(1200, 800, mobile=False, dots=dots):
        count, width, height = alike.ask_later(PICTURE, alone, None)
        assert (width, height) == (1200 * dots, 800 * dots)
        assert count > 10_000 * dots
        legend, title = (alike.one(part).rect for part in (".semsig-legend", ".semsig-title"))
        for box in (legend, title):
            place = [box[key] * dots for key in ("x", "y", "width", "height")]
            assert alike.ask_later(PICTURE, "#ffffff", place)[0] > place[2] * place[3] / 2
            assert alike.ask_later(PICTURE, "#222222", place)[0] > 20
        # No button is on it.
        bar = alike.one(".leaflet-bar").rect
        place = [bar[key] * dots for key in ("x", "y", "width", "height")]
        assert alike.ask_later(PICTURE, "#222222", place)[0] == 0


def test_a_picture_has_the_numbers_and_the_colours_of_the_dark(page: MapPage) -> None:
    page.open(location_map(small_location()))
    light = page.ask_later(PICTURE, "#131518", None)[0]
    page.one(".semsig-colours").click()
    dark = page.ask_later(PICTURE, "#131518", None)[0]
    assert light < 1000
    assert dark > 100_000


def test_a_picture_is_saved_under_the_name_of_the_map(alike: MapPage) -> None:
    alike.ask("""
    HTMLAnchorElement.prototype.click = function () { window.saved = this.download; };
    """)
    alike.one(".semsig-save").click()
    saved: Any = alike.ask_later("""
    const look = () => (window.saved ? arguments[0](window.saved) : setTimeout(look, 20));
    look();
    """)
    assert saved == "Cells-that-look-the-same.png"
    assert alike.text(".semsig-said") == f"Saved: {saved}"


def test_a_page_of_paper_has_the_map_its_title_and_its_legend(alike: MapPage) -> None:
    alike.one(".semsig-colours").click()
    alike.ask("semsig.remembered = map.getCenter()")
    printed: Any = alike.ask_later("""
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
    assert alike.ask("return semsig.isDark(map)") is True
    assert alike.ask("return map.getCenter().distanceTo(semsig.remembered) < 1") is True
    alike.ask("document.querySelector('.semsig-legend').open = true")
    with alike.screen(1040, 700, mobile=False, media="print"):
        for part, is_seen in (
            *((part, True) for part in (".semsig-title", ".semsig-legend")),
            *((part, False) for part in (".semsig-search", ".leaflet-bar", ".semsig-said")),
            *((part, False) for part in (".leaflet-control-layers", ".semsig-panel")),
        ):
            assert (part, alike.one(part).is_displayed()) == (part, is_seen)


def test_coordinates_are_copied_by_a_button_and_a_key(alike: MapPage) -> None:
    alike.ask("""
    window.copied = [];
    navigator.clipboard.writeText = (text) => {
      window.copied.push(text);
      return window.copied.length < 3 ? Promise.resolve() : Promise.reject(new Error("no"));
    };
    map.setView([43.5, 3.25], 15, {animate: false});
    """)
    alike.one("[role=main]").send_keys("c")
    alike.one(".semsig-search input").send_keys("c")
    alike.ask("semsig.tellPlace(map, L.latLng(43.123456, 3.5))")
    for _ in range(2):
        alike.one(".semsig-copy").click()
    copied = alike.ask("return window.copied")
    assert copied == ["43.500000, 3.250000", *2 * ["43.123456, 3.500000"]]
    assert alike.text(".semsig-said") == "Copy by hand: 43.123456, 3.500000"
