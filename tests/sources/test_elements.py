from __future__ import annotations

import itertools
from functools import partial
from typing import TYPE_CHECKING, Any

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
    from shapely.geometry.base import BaseGeometry

    from semsig_gis.sources.layers import ElementKind

KEYS = st.sampled_from("abc")
VALUES = st.sampled_from(["x", "y", "no", "*"])
ALTERNATIVES = st.dictionaries(
    KEYS, st.lists(VALUES, min_size=1, max_size=2).map(tuple), min_size=1, max_size=2
).map(lambda alternative: tuple(alternative.items()))
SPECS = st.lists(ALTERNATIVES, min_size=1, max_size=3).map(
    lambda tags: LayerSpec(name="things", class_name="bench", tags=tuple(tags))
)
TAGS = st.dictionaries(KEYS, st.sampled_from(["x", "y", "z", "no"]), max_size=3)


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
        ({"building": "no"}, True),
        ({"public_transport": "platform", "bus": "yes"}, True),
        ({"public_transport": "platform", "bus": "designated"}, True),
        ({"public_transport": "platform", "bus": "no"}, False),
        ({"public_transport": "platform"}, False),
        ({"bus": "yes"}, False),
        ({}, False),
    ],
)
def test_values_are_compared_exactly(tags: dict[str, str], *, expected: bool) -> None:
    tree, sign, building = (("natural", ("tree",)),), (("sign", ("*",)),), (("building", ("no",)),)
    stop = (("public_transport", ("platform",)), ("bus", ("yes", "designated")))
    spec = LayerSpec(name="things", class_name="bench", tags=(tree, sign, stop, building))
    assert has_tags(tags, spec) is expected
    assert TagIndex([spec]).layers(tags) == [0] * expected


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


POINTS = LayerSpec(name="points", class_name="bench", elements=("node",))
ANYTHING = LayerSpec(name="anything", class_name="bench")
STREETS = LayerSpec(name="streets", class_name="", role="streets", elements=("way",))


@pytest.mark.parametrize(
    ("kind", "tags", "spec", "expected"),
    [
        ("node", {}, POINTS, True),
        ("way", {}, POINTS, False),
        ("way", {}, ANYTHING, True),
        ("relation", {"type": "multipolygon"}, ANYTHING, True),
        ("relation", {"type": "site"}, ANYTHING, False),
        ("relation", {"type": "building"}, ANYTHING, False),
        ("relation", {"type": "boundary"}, ANYTHING, False),
        ("relation", {}, ANYTHING, False),
        ("way", {"highway": "pedestrian"}, STREETS, True),
        ("way", {"highway": "pedestrian", "area": "no"}, STREETS, True),
        ("way", {"highway": "pedestrian", "area": "yes"}, STREETS, False),
        ("way", {"area": "yes"}, ANYTHING, True),
    ],
)
def test_kinds_of_element(
    kind: ElementKind, tags: dict[str, str], spec: LayerSpec, *, expected: bool
) -> None:
    assert has_shape(kind, tags, spec) == expected


def xy(*places: tuple[float, float]) -> NDArray[np.float64]:
    return np.array(places, dtype=float).reshape(-1, 2)


def square(size: float, x: float = 0.0, y: float = 0.0) -> NDArray[np.float64]:
    return xy((x, y), (x + size, y), (x + size, y + size), (x, y + size), (x, y))


@pytest.mark.parametrize(
    ("line", "middle"),
    [
        (xy((0, 0), (4, 0)), (2, 0)),
        (xy((0, 0), (3, 0), (3, 0.5), (3, 1), (3, 1.5), (3, 3), (0, 3), (0, 0)), (1.5, 1.5)),
        (xy((0, 0), (2, 0), (4, 0), (0, 0)), (2, 0)),
    ],
    ids=["open", "area", "closed without area"],
)
def test_an_object_is_the_middle(line: NDArray[np.float64], middle: tuple[float, float]) -> None:
    assert way_shape(line, "objects") == pytest.approx(middle)


def test_a_street_is_a_line_even_if_closed() -> None:
    shape = way_shape(square(1), "streets")
    assert isinstance(shape, shapely.LineString)
    assert len(shape.coords) == 5


BOW = xy((0, 0), (2, 2), (2, 0), (0, 2), (0, 0))


@pytest.mark.parametrize(
    ("shape", "kind", "area"),
    [
        (way_shape(square(2), "buildings"), "Polygon", 4),
        (way_shape(BOW, "buildings"), "MultiPolygon", 2),
        (
            relation_shape([square(10), square(2, 4, 4)], [square(6, 2, 2)], "buildings"),
            "MultiPolygon",
            100 - 36 + 4,
        ),
        (relation_shape([square(2), square(2, 2)], [], "buildings"), "Polygon", 8),
        (relation_shape([square(4)], [square(2)], "buildings"), "Polygon", 12),
    ],
    ids=["outline", "crossed", "island in a hole", "adjoining", "hole at the edge"],
)
def test_a_building_is_the_area_of_its_outlines(
    shape: BaseGeometry, kind: str, area: float
) -> None:
    assert (shape.geom_type, shape.is_valid) == (kind, True)
    assert shape.area == pytest.approx(area)


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
    ("line", "reason"),
    [
        (xy((0, 0), (1, 0), (1, 1)), "not closed"),
        (xy((0, 0), (1, 0), (0, 0)), "not closed"),
        (xy((0, 0), (1, 0), (2, 0), (0, 0)), "no area"),
        (xy((0, 0)), "two nodes"),
        (xy(), "two nodes"),
        ([xy((0, 0), (1, 0), (1, 1))], "join"),
        ([square(2), xy((5, 5), (6, 6))], "join"),
        ([], "no area"),
        ([xy((0, 0))], "no area"),
    ],
)
def test_what_is_no_building(line: Any, reason: str) -> None:  # noqa: ANN401 - of a way, or several
    shape = (
        partial(relation_shape, line, []) if isinstance(line, list) else partial(way_shape, line)
    )
    with pytest.raises(BadFeatureError, match=reason):
        shape("buildings")
