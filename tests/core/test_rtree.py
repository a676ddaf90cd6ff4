"""Points near viewpoints and in boxes: every index against a plain search."""

from __future__ import annotations

import math
import pickle
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core import InputError, ObjectIndex, PackedIndex

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Points = list[tuple[float, float]]
    Places = NDArray[np.float64]
    Index = ObjectIndex | PackedIndex

# Quarters of a metre: sums of their squares are exact, so a circle has an exact edge, and places
# repeat and lie at exactly the radius.
QUARTERS = st.integers(-60, 60).map(lambda number: number / 4)
PLACES = st.tuples(QUARTERS, QUARTERS)
POINTS = st.lists(PLACES, min_size=1, max_size=40)
RADII = st.integers(1, 80).map(lambda number: number / 4)
ANYWHERE = st.tuples(st.floats(-100, 100), st.floats(-100, 100))
CORNERS = st.sampled_from([(0.0, 0.0), (765_200.0, 6_275_000.0), (-5e6, 1e7)])


def shifted(places: Points, corner: tuple[float, float]) -> Places:
    result: Places = np.array(places, float).reshape(-1, 2) + np.array(corner)
    return result


def distance(first: tuple[float, float], second: tuple[float, float]) -> float:
    return float(np.hypot(first[0] - second[0], first[1] - second[1]))


def pairs(index: Index, radius: float, xy: Places) -> list[tuple[int, int]]:
    viewpoint, point = index.pairs_within(xy, radius=radius)
    assert viewpoint.dtype == point.dtype == np.int64
    assert (np.diff(viewpoint) >= 0).all()
    return sorted(zip(viewpoint.tolist(), point.tolist(), strict=True))


def pairs_of(points: Points, views: Points, radius: float) -> list[tuple[int, int]]:
    """Return the pairs of viewpoints and points, on which both indexes in memory agree."""
    xy, places = shifted(points, (0, 0)), shifted(views, (0, 0))
    by_index, by_packed = (pairs(kind(xy), radius, places) for kind in (ObjectIndex, PackedIndex))
    assert by_index == by_packed
    return by_index


@given(
    POINTS | st.lists(ANYWHERE, min_size=20, max_size=50),
    st.lists(PLACES | ANYWHERE, max_size=10),
    RADII | st.floats(0.1, 80.0),
    CORNERS,
)
@settings(max_examples=100)
def test_pairs_equal_a_brute_force_search(
    points: Points, views: Points, radius: float, corner: tuple[float, float]
) -> None:
    points = [(x + corner[0], y + corner[1]) for x, y in points]
    views = [(x + corner[0], y + corner[1]) for x, y in views]
    expected = [
        (i, j)
        for i, view in enumerate(views)
        for j, point in enumerate(points)
        if distance(point, view) <= radius
    ]
    assert pairs_of(points, views, radius) == expected


@given(
    st.lists(st.tuples(PLACES | ANYWHERE, st.integers(0, 2)), min_size=1, max_size=40),
    st.lists(PLACES | ANYWHERE | st.just((1e9, -1e9)), max_size=10),
    st.tuples(RADII, RADII, RADII | st.floats(0.1, 1e4)),
    CORNERS,
)
@settings(max_examples=100)
def test_points_in_the_range_of_their_kind_equal_a_brute_force_search(
    points: list[tuple[tuple[float, float], int]],
    views: Points,
    ranges: tuple[float, float, float],
    corner: tuple[float, float],
) -> None:
    xy, places = shifted([place for place, _ in points], corner), shifted(views, corner)
    kinds = np.array([kind for _, kind in points], np.uint8)
    reach = max(ranges[:2])
    offsets, near = ObjectIndex(xy).points_in_range(
        places, ranges=np.array(ranges), kinds=kinds, reach=reach
    )
    assert len(offsets) == len(places) + 1
    for number, place in enumerate(places.tolist()):
        limits = [ranges[kind] for kind in kinds.tolist()]
        expected = [
            row
            for row, (point, limit) in enumerate(zip(xy.tolist(), limits, strict=True))
            if limit <= reach and distance(point, place) <= limit
        ]
        assert sorted(near[offsets[number] : offsets[number + 1]].tolist()) == expected


@pytest.mark.parametrize("corner", [(0.0, 0.0), (765_200.0, 6_275_000.0), (0.1, 0.7)])
def test_point_exactly_at_the_radius_is_included(corner: tuple[float, float]) -> None:
    ring = [(30, 0), (-30, 0), (0, 30), (0, -30), (18, 24), (-24, 18), (24, -18), (-18, -24)]
    for point in [(corner[0] + dx, corner[1] + dy) for dx, dy in ring]:
        radius = distance(point, corner)  # what the subtraction gives, not always 30
        assert pairs_of([point], [corner], radius) == [(0, 0)]
        assert pairs_of([point], [corner], math.nextafter(radius, 0.0)) == []


def test_either_all_points_at_a_place_are_returned_or_none() -> None:
    assert pairs_of([(1, 1)] * 300, [(1, 1)], 0.001) == [(0, j) for j in range(300)]
    assert pairs_of([(1, 1)], [], 5.0) == pairs_of([(1, 1)], [(9, 9), (8, 8)], 5.0) == []


@pytest.mark.parametrize("kind", [ObjectIndex, PackedIndex])
def test_index_is_picklable_and_independent_of_the_array(kind: type[ObjectIndex]) -> None:
    points = np.array([[0.0, 0.0], [3.0, 4.0], [50.0, 0.0]])
    index = kind(points)
    copy = pickle.loads(pickle.dumps(index))  # noqa: S301
    points[:] = 1000.0
    for tree in (index, copy):
        assert pairs(tree, 5.0, np.zeros((1, 2))) == [(0, 0), (0, 1)]


@pytest.mark.parametrize("make", [ObjectIndex, PackedIndex])
@pytest.mark.parametrize(
    "xy", [np.empty((0, 2)), [[0.0, math.nan]], [[math.inf, 0.0]], [[0.0, 0.0], [math.nan] * 2]]
)
def test_index_without_points_is_refused(xy: object, make: Callable[[object], object]) -> None:
    with refused(InputError, "at least one point", "finite"):
        make(np.asarray(xy))
