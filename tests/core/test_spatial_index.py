from __future__ import annotations

import math
import pickle
from typing import TYPE_CHECKING

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from sentences import assert_sentence

from semsig_gis.core.errors import InputError
from semsig_gis.core.rtree import ObjectIndex, PackedIndex

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# Quarters of a metre: sums of their squares are exact, so a circle has an exact edge.
QUARTERS = st.integers(-60, 60).map(lambda number: number / 4)
PLACES = st.tuples(QUARTERS, QUARTERS)
RADII = st.integers(1, 80).map(lambda number: number / 4)


def found(
    points: list[tuple[float, float]], views: list[tuple[float, float]], radius: float
) -> list[tuple[int, int]]:
    places = np.array(views, dtype=float).reshape(-1, 2)
    answers = []
    for kind in (ObjectIndex, PackedIndex):
        index = kind(np.array(points, dtype=float).reshape(-1, 2))
        viewpoint, point = index.pairs_within(places, radius=radius)
        assert viewpoint.dtype == point.dtype == np.int64
        assert (np.diff(viewpoint) >= 0).all()
        answers.append(sorted(zip(viewpoint.tolist(), point.tolist(), strict=True)))
    assert answers[0] == answers[1]
    return answers[0]


@given(
    st.lists(PLACES, min_size=1, max_size=40),
    st.lists(PLACES, max_size=10),
    RADII,
    st.sampled_from([(0.0, 0.0), (765_200.0, 6_275_000.0), (-5e6, 1e7)]),
)
def test_pairs_are_those_of_a_plain_search(
    points: list[tuple[float, float]],
    views: list[tuple[float, float]],
    radius: float,
    corner: tuple[float, float],
) -> None:
    points = [(x + corner[0], y + corner[1]) for x, y in points]
    views = [(x + corner[0], y + corner[1]) for x, y in views]
    expected = [
        (i, j)
        for i, (vx, vy) in enumerate(views)
        for j, (x, y) in enumerate(points)
        if (x - vx) ** 2 + (y - vy) ** 2 <= radius**2
    ]
    assert found(points, views, radius) == expected


@given(st.integers(0, 2**32 - 1), st.floats(0.1, 80.0))
def test_any_coordinates_will_do(seed: int, radius: float) -> None:
    rng = np.random.default_rng(seed)
    corner = np.array([765_200.3, 6_275_000.7])
    points = rng.uniform(-100, 100, (50, 2)) + corner
    views = rng.uniform(-100, 100, (8, 2)) + corner
    expected = [
        (i, j)
        for i, (vx, vy) in enumerate(views.tolist())
        for j, (x, y) in enumerate(points.tolist())
        if math.dist((x, y), (vx, vy)) <= radius
    ]
    assert found(points.tolist(), views.tolist(), radius) == expected


@pytest.mark.parametrize("corner", [(0.0, 0.0), (765_200.0, 6_275_000.0), (0.1, 0.7)])
def test_a_point_at_exactly_the_radius_counts(corner: tuple[float, float]) -> None:
    x, y = corner
    ring = [(30, 0), (-30, 0), (0, 30), (0, -30), (18, 24), (-24, 18), (24, -18), (-18, -24)]
    if corner[0] == int(corner[0]):
        points = [(x + dx, y + dy) for dx, dy in ring]
        assert len(found(points, [corner], 30.0)) == len(ring)
        assert found(points, [corner], math.nextafter(30.0, 0.0)) == []
    else:
        # Here the distance is what the subtraction gives; the box must not decide before it.
        points = [(x + dx, y) for dx in (30, -30)]
        for number, point in enumerate(points):
            exact = abs(point[0] - x)
            assert (0, number) in found(points, [corner], exact)
            assert (0, number) not in found(points, [corner], math.nextafter(exact, 0.0))


def test_points_at_one_place_are_all_found() -> None:
    assert found([(1, 1)] * 300, [(1, 1)], 0.001) == [(0, j) for j in range(300)]


def test_no_viewpoint_sees_nothing() -> None:
    assert found([(1, 1)], [], 5.0) == []
    assert found([(1, 1)], [(9, 9), (8, 8)], 5.0) == []


@given(
    st.lists(PLACES, min_size=1, max_size=40),
    st.lists(st.tuples(PLACES, PLACES), max_size=10),
    st.sampled_from([(0.0, 0.0), (765_200.0, 6_275_000.0), (-5e6, 1e7)]),
)
def test_points_in_boxes_are_those_of_a_plain_search(
    points: list[tuple[float, float]],
    boxes: list[tuple[tuple[float, float], tuple[float, float]]],
    corner: tuple[float, float],
) -> None:
    xy = np.array(points) + corner
    ends = np.array(boxes, dtype=float).reshape(-1, 2, 2) + corner
    low, high = ends.min(axis=1), ends.max(axis=1)
    box, point = PackedIndex(xy).pairs_in(low, high)
    again = PackedIndex(xy, np.asarray(shapely.points(xy))).pairs_in(low, high)
    assert np.array_equal(again, (box, point))
    expected = [
        (i, j)
        for i in range(len(low))
        for j in range(len(xy))
        if (low[i] <= xy[j]).all() and (xy[j] <= high[i]).all()
    ]
    assert (np.diff(box) >= 0).all()
    assert sorted(zip(box.tolist(), point.tolist(), strict=True)) == expected


@pytest.mark.parametrize("kind", [ObjectIndex, PackedIndex])
def test_a_copy_made_by_pickling_finds_the_same(kind: type[ObjectIndex | PackedIndex]) -> None:
    points = np.array([[0.0, 0.0], [3.0, 4.0], [50.0, 0.0]])
    copy = pickle.loads(pickle.dumps(kind(points)))  # noqa: S301
    assert copy.pairs_within(points[:1], radius=5.0)[1].size == 2


@pytest.mark.parametrize("kind", [ObjectIndex, PackedIndex])
def test_the_index_does_not_follow_a_change_of_the_array(
    kind: type[ObjectIndex | PackedIndex],
) -> None:
    points = np.array([[0.0, 0.0], [3.0, 4.0]])
    index = kind(points)
    points[:] = 1000.0
    assert index.pairs_within(np.zeros((1, 2)), radius=5.0)[1].size == 2


@pytest.mark.parametrize("kind", [ObjectIndex, PackedIndex])
@pytest.mark.parametrize(
    "xy", [np.empty((0, 2)), [[0.0, math.nan]], [[math.inf, 0.0]], [[0.0, 0.0], [math.nan] * 2]]
)
def test_nothing_to_index_is_an_error(xy: ArrayLike, kind: type[ObjectIndex | PackedIndex]) -> None:
    with pytest.raises(InputError) as caught:
        kind(np.asarray(xy))
    assert_sentence(caught.value, "at least one point", "finite")
