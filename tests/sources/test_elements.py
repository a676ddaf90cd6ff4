"""Which elements a layer means."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core.errors import CatalogError
from semsig_gis.sources.layers import LayerSpec
from semsig_gis.sources.osm.elements import TagIndex, has_shape, has_tags

KEYS = st.sampled_from("abc")
VALUES = st.sampled_from(["x", "y", "no", "*"])
ALTERNATIVES = st.dictionaries(
    KEYS, st.lists(VALUES, min_size=1, max_size=2).map(tuple), min_size=1, max_size=2
).map(lambda alternative: tuple(alternative.items()))
SPECS = st.lists(ALTERNATIVES, min_size=1, max_size=3).map(
    lambda tags: LayerSpec(name="things", class_name="bench", tags=tuple(tags))
)
TAGS = st.dictionaries(KEYS, st.sampled_from(["x", "y", "z", "no"]), max_size=3)


def spec_of(*alternatives: dict[str, str]) -> LayerSpec:
    tags = tuple(
        tuple((key, tuple(values.split("|"))) for key, values in alternative.items())
        for alternative in alternatives
    )
    return LayerSpec(name="things", class_name="bench", tags=tags)


@pytest.mark.parametrize(
    ("tags", "expected"),
    [
        ({"natural": "tree"}, True),
        ({"natural": "tree", "name": "Old oak"}, True),
        ({"natural": "tree_row"}, False),
        ({"natural": "Tree"}, False),
        ({"natural": "tree;shrub"}, False),
        ({"denotation": "tree"}, False),
        ({"sign": "stop"}, True),
        ({"sign": "no"}, False),
        ({"public_transport": "platform", "bus": "yes"}, True),
        ({"public_transport": "platform", "bus": "designated"}, True),
        ({"public_transport": "platform", "bus": "no"}, False),
        ({"public_transport": "platform"}, False),
        ({"bus": "yes"}, False),
        ({}, False),
    ],
)
def test_values_are_compared_exactly(tags: dict[str, str], *, expected: bool) -> None:
    spec = spec_of(
        {"natural": "tree"},
        {"sign": "*"},
        {"public_transport": "platform", "bus": "yes|designated"},
    )
    assert has_tags(tags, spec) is expected
    assert TagIndex([spec]).layers(tags) == [0] * expected


def test_no_can_be_asked_for_by_name() -> None:
    assert has_tags({"building": "no"}, spec_of({"building": "no"}))


@given(st.lists(SPECS, min_size=1, max_size=4), TAGS)
def test_the_index_finds_what_trying_every_layer_finds(
    specs: list[LayerSpec], tags: dict[str, str]
) -> None:
    index = TagIndex(specs)
    expected = [number for number, spec in enumerate(specs) if has_tags(tags, spec)]
    assert index.layers(tags) == expected
    if expected:
        assert set(index.keys) & set(tags)


def test_a_layer_without_tags_is_refused() -> None:
    with refused(CatalogError, "'things'", "tags"):
        TagIndex([LayerSpec(name="things", class_name="bench")])


def test_kinds_of_element() -> None:
    points = LayerSpec(name="points", class_name="bench", elements=("node",))
    anything = LayerSpec(name="anything", class_name="bench")
    streets = LayerSpec(name="streets", class_name="", role="streets", elements=("way",))
    assert has_shape("node", {}, points)
    assert not has_shape("way", {}, points)
    assert has_shape("way", {}, anything)
    assert has_shape("relation", {"type": "multipolygon"}, anything)
    for kind in ("site", "building", "boundary"):
        assert not has_shape("relation", {"type": kind}, anything)
    assert not has_shape("relation", {}, anything)
    assert has_shape("way", {"highway": "pedestrian"}, streets)
    assert has_shape("way", {"highway": "pedestrian", "area": "no"}, streets)
    assert not has_shape("way", {"highway": "pedestrian", "area": "yes"}, streets)
    assert has_shape("way", {"area": "yes"}, anything)
