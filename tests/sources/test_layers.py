from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from sentences import refused

from semsig_gis.core.errors import CatalogError
from semsig_gis.sources.catalog import paper_taxonomy
from semsig_gis.sources.layers import ClassBy, LayerSpec, WidthBy, layer_of, require_class

SHARED = {"files": ("all.gpkg",), "reader": "vector_file", "license": "CC0", "attribution": "Town"}


def read(item: object) -> LayerSpec:
    return layer_of(item, "town.toml", taxonomy=paper_taxonomy(), shared=SHARED)


def test_a_layer_has_what_all_of_the_catalogue_have() -> None:
    assert read({"name": "benches", "class": "bench"}) == LayerSpec(
        name="benches",
        class_name="bench",
        files=("all.gpkg",),
        license="CC0",
        attribution="Town",
    )


def test_streets_need_no_class_and_may_have_widths() -> None:
    item: dict[str, Any] = {"name": "streets", "role": "streets", "geometry": "line"}
    assert not read(item).has_width
    by = {"field": "KIND", "values": {"Rue": 14}}
    spec = read({**item, "width_by": by, "width_field": "W", "where": {"STATE": "open"}})
    assert spec.width_by == WidthBy("KIND", (("Rue", 14.0),))
    assert spec.has_width
    assert spec.fields == (("where", "STATE"), ("width_by", "KIND"), ("width_field", "W"))


@pytest.mark.parametrize(
    ("item", "words"),
    [
        ("benches", ["the layer 'benches'", "[[layers]]"]),
        ({"class": "bench"}, ["layer '?'", "the key 'name'"]),
        ({"name": "a", "class": "bench", "role": "streets"}, ["layer 'a'", "needs no class"]),
        ({"name": "a", "class": "bench", "width_by": {}}, ["width_by", "only streets"]),
        ({"name": "a", "class": "bench", "width_field": "W"}, ["width_field", "only streets"]),
        ({"name": "a", "role": "buildings", "width_field": "W"}, ["width_field", "only streets"]),
    ],
)
def test_a_mistake_has_its_sentence(item: object, words: list[str]) -> None:
    with refused(CatalogError, "town.toml", *words):
        read(item)


def test_an_unknown_class_is_named() -> None:
    require_class("bench", paper_taxonomy(), "town.toml")
    with refused(CatalogError, "town.toml", "'bensh'", "the nearest is 'bench'"):
        require_class("bensh", paper_taxonomy(), "town.toml")


def test_a_layer_is_a_value() -> None:
    spec = LayerSpec(
        name="lamps", class_name="street_light", tags=((("highway", ("street_lamp",)),),)
    )
    assert spec == dataclasses.replace(spec)
    assert len({spec, dataclasses.replace(spec), dataclasses.replace(spec, optional=True)}) == 2
    with pytest.raises(dataclasses.FrozenInstanceError):
        spec.name = "other"  # type: ignore[misc]


def test_a_layer_asks_for_nothing_unless_it_is_told_to() -> None:
    spec = LayerSpec(name="a", class_name="bench")
    assert spec.role == "objects"
    assert spec.elements == ("node", "way", "relation")
    assert not spec.optional
    assert not spec.unique_id
    assert (spec.where, spec.class_by, spec.rows, spec.crs) == ((), None, None, None)


def test_classes_by_field_are_a_value() -> None:
    by = ClassBy("kind", (("Taxi", "taxi_station"), (2, "bench")))
    assert {by: 1}[ClassBy("kind", (("Taxi", "taxi_station"), (2, "bench")))] == 1
