"""Several results on one map: layers in groups; only one layer at a time colours the cells."""

from __future__ import annotations

from typing import TYPE_CHECKING

from map_pages import IMAGES
from small_city import chances_of, small_city, small_evaluation, small_location

from semsig_gis.output import (
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


def map_of_results() -> folium.Map:
    """Return a map with several results for a city."""
    map_ = evaluation_map(EVALUATION, CITY)
    ambiguity_map(CITY, map_=map_)
    identifiability_map(chances_of(CITY), map_=map_)
    drift_map(CITY, CITY.select(slice(900)), map_=map_)
    location_map(small_location(), map_=map_)
    return objects_map(OBJECTS, map_=map_)


def checked(page: MapPage) -> list[str]:
    """Return the names of the visible layers that colour the cells."""
    return page.texts("[data-group=cells] label:has(:checked)")


# Source and z-index of images.
LOOKS = """
return [...document.querySelectorAll(arguments[0])].map((image) =>
  [image.getAttribute("src"), getComputedStyle(image).zIndex]);
"""


def test_layers_are_in_groups_and_only_one_colours_the_cells(page: MapPage) -> None:
    page.open(map_of_results())
    groups = [element.text.splitlines()[0] for element in page.all("fieldset[data-group]")]
    assert groups == ["Colour cells by", "Queries", "Answer", "Street objects", "Ground"]
    names = [element.text.strip() for element in page.all("[data-group=cells] label")]
    assert names == [
        *("Objects seen from a cell", "Share of queries found", "Same types"),
        *("Same types and angle levels", "Chance to be found", "What has changed"),
        *("Chance within 50 m", "Chance of a cell", "Regions of 50, 90 and 99 %", "Nothing"),
    ]
    images_of = {}
    for name in names:
        page.switch(name)
        assert checked(page) == [name]
        images = page.ask(LOOKS, IMAGES)
        images_of[name] = tuple(source for source, _ in images)
        assert len(page.all(".semsig-field")) == (name == "Share of queries found")
        orders = [order for _, order in images]
        assert orders == sorted(orders)  # the first is below
    (city,) = images_of["Objects seen from a cell"]
    assert images_of["Share of queries found"] == (city,)
    assert {name: len(images) for name, images in images_of.items() if len(images) != 1} == {
        "What has changed": 2,
        "Nothing": 0,
    }
    # By keyboard, and when a script adds a layer to the map.
    page.one("[data-group=cells] input:checked").send_keys("\ue013")  # arrow up
    assert checked(page) == ["Regions of 50, 90 and 99 %"]
    page.ask(
        """
    const regions = (layer) => layer.getLayers?.().some(({_url}) => _url === arguments[0]);
    shown(regions)[0].remove().addTo(map);
    """,
        *images_of["Regions of 50, 90 and 99 %"],
    )
    assert checked(page) == ["Regions of 50, 90 and 99 %"]


def test_first_result_is_shown_first(page: MapPage) -> None:
    page.open(city_map(CITY, evaluation=EVALUATION, ambiguity=True, newer=CITY.select(slice(900))))
    assert [element.text.splitlines()[0] for element in page.all(".semsig-legend[open]")] == [
        "Localization errors"
    ]
    assert checked(page) == ["Share of queries found"]


def test_click_describes_the_visible_layer(page: MapPage) -> None:
    page.open(map_of_results())
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


def test_shared_arrays_are_in_the_page_once() -> None:
    map_ = map_of_results()
    layers = [layer for layer in layers_of(map_).values() if isinstance(layer, Cells)]
    (groups, change), text = layers, map_.get_root().render()
    for name in ("types", "levels", "x"):
        assert groups.arrays[f"now.{name}"] == change.arrays[f"before.{name}"]
        assert text.count(groups.arrays[f"now.{name}"][1]) == 1
    assert text.count(groups.arrays["metres"][1]) == 1
