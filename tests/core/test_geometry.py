from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.core.geometry import angular_distance, wrap_degrees
from semsig_gis.database.views import bearings

ANGLES = st.floats(-1e6, 1e6)
METRES = st.floats(-1e4, 1e4)


def apart(a: float, b: float) -> float:
    """Return the angle between two directions, by the complex plane."""
    turn = complex(math.cos(math.radians(a - b)), math.sin(math.radians(a - b)))
    return abs(math.degrees(math.atan2(turn.imag, turn.real)))


@given(ANGLES)
def test_wrapping_lands_on_one_turn_and_stays_there(angle: float) -> None:
    once = wrap_degrees(angle)
    assert 0.0 <= once < 360.0
    assert wrap_degrees(once) == once
    assert apart(float(once), angle) < 1e-6


def test_whole_turns_do_not_matter() -> None:
    assert wrap_degrees(np.arange(-720, 1080)).tolist() == [*range(360)] * 5
    # A tiny negative angle does not become a whole turn.
    assert wrap_degrees([-1e-20, -5e-324, -0.0, 360.0, 720.0]).tolist() == [0.0] * 5
    assert bearings([-1e-300, -5e-324], [1.0, 30.0]).tolist() == [0.0, 0.0]


def test_bearings_count_clockwise_from_north() -> None:
    dx, dy = [0, 7, 7, 7, 0, -7, -7], [7, 7, 0, -7, -7, -7, 0]
    assert bearings(dx, dy).tolist() == [0, 45, 90, 135, 180, 225, 270]
    assert bearings([0.0, -0.0, 0.0, -0.0], [0.0, 0.0, -0.0, -0.0])[0] == 0.0
    assert bearings([], []).shape == (0,)


@given(st.floats(allow_nan=False), st.floats(allow_nan=False))
def test_a_bearing_is_the_wrapped_arctangent(dx: float, dy: float) -> None:
    bearing = bearings(dx, dy)
    assert bearing == wrap_degrees(np.degrees(np.arctan2(dx, dy)))
    assert not np.signbit(bearing)


@given(METRES, METRES)
def test_a_bearing_points_along_its_displacement(dx: float, dy: float) -> None:
    bearing = float(bearings(dx, dy))
    length = math.hypot(dx, dy)
    assert 0.0 <= bearing < 360.0
    assert math.isclose(length * math.sin(math.radians(bearing)), dx, abs_tol=1e-9)
    assert math.isclose(length * math.cos(math.radians(bearing)), dy, abs_tol=1e-9)


@given(ANGLES, ANGLES)
def test_angular_distance_is_the_smaller_angle(a: float, b: float) -> None:
    distance = float(angular_distance(a, b))
    assert 0.0 <= distance <= 180.0
    assert distance == pytest.approx(apart(a, b), abs=1e-6)
    assert angular_distance(a, a) == 0.0


def test_arrays_keep_their_shape() -> None:
    grid = np.arange(-6.0, 6.0).reshape(3, 4)
    for angles in (wrap_degrees(grid), bearings(grid, grid), angular_distance(grid, 10.0)):
        assert angles.shape == (3, 4)
    assert wrap_degrees(np.arange(3, dtype=np.uint8)).dtype == np.float64
