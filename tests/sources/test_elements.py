from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core.errors import CatalogError
from semsig_gis.sources.layers import LayerSpec
from semsig_gis.sources.osm.elements import TagIndex, has_shape, has_tags, relation_shape, way_shape
from semsig_gis.sources.raw_layer import BadFeatureError

if TYPE_CHECKING:
    from numpy.typing import NDArray

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


def xy(*places: tuple[float, float]) -> NDArray[np.float64]:
    return np.array(places, dtype=float).reshape(-1, 2)


def square(size: float, x: float = 0.0, y: float = 0.0) -> NDArray[np.float64]:
    return xy((x, y), (x + size, y), (x + size, y + size), (x, y + size), (x, y))


def test_a_line_of_a_street_object_is_its_middle() -> None:
    assert way_shape(xy((0, 0), (4, 0)), "objects") == (2.0, 0.0)


def test_a_closed_street_object_is_the_middle_of_its_area() -> None:
    outline = xy((0, 0), (3, 0), (3, 0.5), (3, 1), (3, 1.5), (3, 3), (0, 3), (0, 0))
    assert way_shape(outline, "objects") == pytest.approx((1.5, 1.5))


def test_a_closed_street_object_without_area_is_the_middle_of_its_line() -> None:
    assert way_shape(xy((0, 0), (2, 0), (4, 0), (0, 0)), "objects") == pytest.approx((2.0, 0.0))


def test_a_building_is_the_polygon_of_its_outline() -> None:
    shape = way_shape(square(2), "buildings")
    assert isinstance(shape, shapely.Polygon)
    assert shape.equals(shapely.box(0, 0, 2, 2))


def test_a_crossed_outline_is_made_valid() -> None:
    shape = way_shape(xy((0, 0), (2, 2), (2, 0), (0, 2), (0, 0)), "buildings")
    assert isinstance(shape, shapely.MultiPolygon)
    assert shape.is_valid
    assert shape.area == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (xy((0, 0), (1, 0), (1, 1)), "not closed"),
        (xy((0, 0), (1, 0), (0, 0)), "not closed"),
        (xy((0, 0), (1, 0), (2, 0), (0, 0)), "no area"),
        (xy((0, 0)), "two nodes"),
        (xy(), "two nodes"),
    ],
)
def test_what_is_no_building(line: NDArray[np.float64], reason: str) -> None:
    with pytest.raises(BadFeatureError, match=reason):
        way_shape(line, "buildings")


def test_a_street_is_a_line_even_if_closed() -> None:
    shape = way_shape(square(1), "streets")
    assert isinstance(shape, shapely.LineString)
    assert len(shape.coords) == 5


def test_a_hole_is_left_out_and_an_island_in_it_is_not() -> None:
    shape = relation_shape([square(10), square(2, 4, 4)], [square(6, 2, 2)], "buildings")
    assert isinstance(shape, shapely.MultiPolygon)
    assert shape.area == 100 - 36 + 4


def test_adjoining_outlines_are_one_area() -> None:
    shape = relation_shape([square(2), square(2, 2)], [], "buildings")
    assert isinstance(shape, shapely.Polygon)
    assert shape.area == 8.0


def test_a_hole_at_the_edge_is_left_out() -> None:
    shape = relation_shape([square(4)], [square(2)], "buildings")
    assert isinstance(shape, shapely.Polygon)
    assert shape.area == 12.0


def test_an_area_of_a_street_object_is_its_middle() -> None:
    assert relation_shape([square(2, 1, 1)], [], "objects") == (2.0, 2.0)


@given(
    st.lists(st.integers(1, 11), min_size=0, max_size=5, unique=True),
    st.randoms(use_true_random=False),
)
def test_pieces_of_a_ring_join_in_any_order_and_direction(cuts: list[int], random: object) -> None:
    angles = np.linspace(0, 2 * np.pi, 13)
    ring = np.round(np.stack([np.cos(angles), np.sin(angles)], axis=1), 7)
    ring[-1] = ring[0]
    ends = [0, *sorted(cuts), 12]
    pieces = [ring[i : j + 1] for i, j in itertools.pairwise(ends)]
    pieces = [piece[::-1] if number % 2 else piece for number, piece in enumerate(pieces)]
    random.shuffle(pieces)  # type: ignore[attr-defined]
    shape = relation_shape(pieces, [], "buildings")
    assert isinstance(shape, shapely.Polygon)
    assert shape.area == pytest.approx(shapely.Polygon(ring).area)


@pytest.mark.parametrize(
    ("outer", "reason"),
    [
        ([xy((0, 0), (1, 0), (1, 1))], "join"),
        ([square(2), xy((5, 5), (6, 6))], "join"),
        ([], "no area"),
        ([xy((0, 0))], "no area"),
    ],
)
def test_what_is_no_area(outer: list[NDArray[np.float64]], reason: str) -> None:
    with pytest.raises(BadFeatureError, match=reason):
        relation_shape(outer, [], "buildings")
