from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.spatial_index import ObjectIndex
from semsig_gis.visibility import visible_objects

if TYPE_CHECKING:
    from semsig_gis.visibility import Sightings


def look(views: object, places: object, radius: float = 30.0) -> Sightings:
    objects = np.asarray(places, dtype=float)
    return visible_objects(
        np.asarray(views, dtype=float), objects, index=ObjectIndex(objects), radius=radius
    )


def test_what_is_seen_has_bearing_and_distance() -> None:
    seen = look([[100, 100]], [[100, 110], [120, 100], [100, 70], [82, 76], [100, 131]])
    order = np.argsort(seen.object)
    assert seen.object[order].tolist() == [0, 1, 2, 3]
    assert seen.bearing[order] == pytest.approx([0, 90, 180, 180 + math.degrees(math.atan2(3, 4))])
    assert seen.distance[order].tolist() == [10, 20, 30, 30]
    assert seen.viewpoint.tolist() == [0, 0, 0, 0]


def test_an_object_at_the_viewpoint_is_due_north() -> None:
    seen = look([[5, 5]], [[5, 5]])
    assert (seen.bearing.tolist(), seen.distance.tolist()) == ([0.0], [0.0])


def test_pairs_are_ordered_by_viewpoint() -> None:
    views = [[0, 0], [500, 0], [10, 0]]
    seen = look(views, [[5, 0], [500, 3], [6, 1]])
    assert seen.viewpoint.tolist() == [0, 0, 1, 2, 2]
    assert look([[900, 900]], [[0, 0]]).viewpoint.size == 0


@given(st.integers(-60, 60), st.integers(-60, 60), st.integers(1, 12))
def test_objects_in_one_direction_have_one_bearing(dx: int, dy: int, times: int) -> None:
    # The last digits of an arctangent depend on the processor; ties must not.
    seen = look([[0, 0]], [[dx, dy], [dx * times, dy * times]], radius=1e4)
    assert seen.bearing[0] == seen.bearing[1]


def test_some_of_the_pairs_can_be_left_out() -> None:
    seen = look([[0, 0]], [[5, 0], [6, 1], [7, 2]])
    kept = seen.only(seen.object != 1)
    assert sorted(kept.object.tolist()) == [0, 2]
    assert kept.distance.tolist() == seen.distance[seen.object != 1].tolist()
    assert len(kept.viewpoint) == len(kept.bearing) == 2


def test_noise_beside_north_is_north() -> None:
    seen = look([[0, 0]], [[-1e-13, 20], [1e-13, 20], [-1e-300, 20], [-5e-7, 20]])
    order = np.argsort(seen.object)
    assert seen.bearing[order][:3].tolist() == [0.0, 0.0, 0.0]
    assert 359.9999 < seen.bearing[order][3] < 360.0


@given(st.integers(0, 2**32 - 1))
def test_bearings_and_distances_lead_back_to_the_objects(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corner = np.array([765_200.0, 6_275_000.0])
    views = rng.uniform(0, 100, (5, 2)) + corner
    places = rng.uniform(0, 100, (30, 2)) + corner
    seen = look(views, places)
    assert ((seen.bearing >= 0) & (seen.bearing < 360) & (seen.distance <= 30)).all()
    angle = np.radians(seen.bearing)
    back = views[seen.viewpoint] + np.stack(
        [seen.distance * np.sin(angle), seen.distance * np.cos(angle)], axis=1
    )
    assert back == pytest.approx(places[seen.object], abs=1e-6)
