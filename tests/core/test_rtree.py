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
    moved: Places = np.array(places, float).reshape(-1, 2) + np.array(corner)
    return moved


def apart(one: tuple[float, float], other: tuple[float, float]) -> float:
    return float(np.hypot(one[0] - other[0], one[1] - other[1]))


def pairs(index: Index, radius: float, xy: Places) -> list[tuple[int, int]]:
    viewpoint, point = index.pairs_within(xy, radius=radius)
    assert viewpoint.dtype == point.dtype == np.int64
    assert (np.diff(viewpoint) >= 0).all()
    return sorted(zip(viewpoint.tolist(), point.tolist(), strict=True))


def pairs_of(points: Points, views: Points, radius: float) -> list[tuple[int, int]]:
    """Return the pairs of viewpoints and points, on which both indexes in memory agree."""
    xy, places = shifted(points, (0, 0)), shifted(views, (0, 0))
    one, other = (pairs(kind(xy), radius, places) for kind in (ObjectIndex, PackedIndex))
    assert one == other
    return one


@given(
    POINTS | st.lists(ANYWHERE, min_size=20, max_size=50),
    st.lists(PLACES | ANYWHERE, max_size=10),
    RADII | st.floats(0.1, 80.0),
    CORNERS,
)
@settings(max_examples=100)
def test_pairs_are_those_of_a_plain_search(
    points: Points, views: Points, radius: float, corner: tuple[float, float]
) -> None:
    points = [(x + corner[0], y + corner[1]) for x, y in points]
    views = [(x + corner[0], y + corner[1]) for x, y in views]
    expected = [
        (i, j)
        for i, view in enumerate(views)
        for j, point in enumerate(points)
        if apart(point, view) <= radius
    ]
    assert pairs_of(points, views, radius) == expected


@pytest.mark.parametrize("corner", [(0.0, 0.0), (765_200.0, 6_275_000.0), (0.1, 0.7)])
def test_a_point_at_exactly_the_radius_counts(corner: tuple[float, float]) -> None:
    ring = [(30, 0), (-30, 0), (0, 30), (0, -30), (18, 24), (-24, 18), (24, -18), (-18, -24)]
    for point in [(corner[0] + dx, corner[1] + dy) for dx, dy in ring]:
        radius = apart(point, corner)  # what the subtraction gives, not always 30
        assert pairs_of([point], [corner], radius) == [(0, 0)]
        assert pairs_of([point], [corner], math.nextafter(radius, 0.0)) == []


def test_all_points_at_one_place_or_none_are_returned() -> None:
    assert pairs_of([(1, 1)] * 300, [(1, 1)], 0.001) == [(0, j) for j in range(300)]
    assert pairs_of([(1, 1)], [], 5.0) == pairs_of([(1, 1)], [(9, 9), (8, 8)], 5.0) == []


@pytest.mark.parametrize("kind", [ObjectIndex, PackedIndex])
def test_a_pickled_copy_and_a_changed_array_make_no_difference(kind: type[ObjectIndex]) -> None:
    points = np.array([[0.0, 0.0], [3.0, 4.0], [50.0, 0.0]])
    index = kind(points)
    copy = pickle.loads(pickle.dumps(index))  # noqa: S301
    points[:] = 1000.0
    for one in (index, copy):
        assert pairs(one, 5.0, np.zeros((1, 2))) == [(0, 0), (0, 1)]


@pytest.mark.parametrize("make", [ObjectIndex, PackedIndex])
@pytest.mark.parametrize(
    "xy", [np.empty((0, 2)), [[0.0, math.nan]], [[math.inf, 0.0]], [[0.0, 0.0], [math.nan] * 2]]
)
def test_nothing_to_index_is_an_error(xy: object, make: Callable[[object], object]) -> None:
    with refused(InputError, "at least one point", "finite"):
        make(np.asarray(xy))
