"""Several things on one map: layers in groups, and one colour of the cells at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from map_pages import IMAGES
from small_city import chances_of, small_city, small_evaluation, small_location

from semsig_gis.maps import (
    Cells,
    ambiguity_map,
    city_map,
    drift_map,
    evaluation_map,
    identifiability_map,
    layers_of,
    location_map,
    objects_map,
)

if TYPE_CHECKING:
    import folium
    from map_pages import MapPage

CITY, OBJECTS = small_city()
EVALUATION = small_evaluation("medium")


def story() -> folium.Map:
    """Return a map of everything that is known of a city."""
    drawn = evaluation_map(EVALUATION, CITY)
    ambiguity_map(CITY, map_=drawn)
    identifiability_map(chances_of(CITY), map_=drawn)
    drift_map(CITY, CITY.select(slice(900)), map_=drawn)
    location_map(small_location(), map_=drawn)
    return objects_map(OBJECTS, map_=drawn)


def checked(page: MapPage) -> list[str]:
    """Return the colours of the cells that are chosen."""
    return page.texts("[data-group=cells] label:has(:checked)")


# Of images, what they show, and in which order they lie.
LOOKS = """
return [...document.querySelectorAll(arguments[0])].map((one) =>
  [one.getAttribute("src"), getComputedStyle(one).zIndex]);
"""


def test_layers_are_in_groups_and_cells_have_one_colour(page: MapPage) -> None:
    page.open(story())
    groups = [one.text.splitlines()[0] for one in page.all("fieldset[data-group]")]
    assert groups == ["Colour cells by", "Queries", "Answer", "Street objects", "Ground"]
    names = [one.text.strip() for one in page.all("[data-group=cells] label")]
    assert names == [
        *("Objects seen from a cell", "Share of queries that fail", "Same types"),
        *("Same types and angle levels", "Chance to be found", "What has changed"),
        *("Chance within 50 m", "Chance of a cell", "Regions of 50, 90 and 99 %", "Nothing"),
    ]
    seen = {}
    for name in names:
        page.switch(name)
        assert checked(page) == [name]
        images = page.ask(LOOKS, IMAGES)
        seen[name] = tuple(source for source, _ in images)
        assert len(page.all(".semsig-field")) == (name == "Share of queries that fail")
        orders = [order for _, order in images]
        assert orders == sorted(orders)  # the first is below
    (city,) = seen["Objects seen from a cell"]
    assert seen["Share of queries that fail"] == (city,)
    assert seen["Regions of 50, 90 and 99 %"][0] == city
    assert {name: len(images) for name, images in seen.items() if len(images) != 2} == {
        **dict.fromkeys(names[:5], 1),
        "Nothing": 0,
    }
    # By the keyboard, and by whatever else puts a layer on the map.
    page.one("[data-group=cells] input:checked").send_keys("\ue013")  # arrow up
    assert checked(page) == ["Regions of 50, 90 and 99 %"]
    page.ask("shown((one) => one.getLayers?.().length === 2)[0].remove().addTo(map)")
    assert checked(page) == ["Regions of 50, 90 and 99 %"]


def test_what_is_asked_for_first_is_seen_first(page: MapPage) -> None:
    page.open(city_map(CITY, evaluation=EVALUATION, ambiguity=True, newer=CITY.select(slice(900))))
    assert [one.text.splitlines()[0] for one in page.all(".semsig-legend[open]")] == [
        "Localization errors"
    ]
    assert checked(page) == ["Share of queries that fail"]


def test_a_click_tells_of_what_is_coloured(page: MapPage) -> None:
    page.open(story())
    page.switch("Chance to be found")
    page.switch("Best place")
    cell = 400
    both = page.click(CITY, cell)
    assert {"It sees", "Found within 30 m"} <= set(both)
    assert any(line.startswith("Same types: ") for line in page.jumps())
    page.switch("What has changed")
    assert page.click(CITY, 950)["title"] == "A cell that no longer sees anything"
    page.switch("Same types")
    assert page.click(CITY, 950)["title"] == both["title"]


def test_numbers_that_two_layers_have_are_in_the_page_once() -> None:
    drawn = story()
    layers = [one for one in layers_of(drawn).values() if isinstance(one, Cells)]
    (groups, change), text = layers, drawn.get_root().render()
    for name in ("types", "levels", "x"):
        assert groups.arrays[f"now.{name}"] == change.arrays[f"before.{name}"]
        assert text.count(groups.arrays[f"now.{name}"][1]) == 1
    assert text.count(groups.arrays["metres"][1]) == 1
