"""Array maths of directions: bearings, wrapping and angular distance, all in degrees."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

FULL_TURN, HALF_TURN = 360.0, 180.0


def wrap_degrees(angles: ArrayLike) -> NDArray[np.float64]:
    """Return any finite angles in degrees as the same directions in [0, 360)."""
    wrapped = np.mod(np.asarray(angles, dtype=np.float64), FULL_TURN)
    # The remainder of a tiny negative angle rounds to 360 itself.
    return np.where(wrapped >= FULL_TURN, 0.0, wrapped)


def signed_degrees(angles: ArrayLike) -> NDArray[np.float64]:
    """Return angles in degrees as the same directions in [-180, 180)."""
    return np.asarray((np.asarray(angles) + HALF_TURN) % FULL_TURN - HALF_TURN)


def bearings(dx: ArrayLike, dy: ArrayLike) -> NDArray[np.float64]:
    """Return degrees clockwise from grid north, in [0, 360), of displacements to east and north.

    A displacement of zero has bearing 0.
    """
    turned = np.degrees(np.arctan2(np.asarray(dx), np.asarray(dy)))
    # What `wrap_degrees` gives for half a turn to each side, without its costly remainder.
    wrapped = np.where(turned < 0.0, turned + FULL_TURN, np.abs(turned))
    return np.where(wrapped >= FULL_TURN, 0.0, wrapped)


def angular_distance(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """Return the smaller angle between directions in degrees, from 0 to 180."""
    difference = wrap_degrees(np.asarray(a, dtype=np.float64) - np.asarray(b, dtype=np.float64))
    return np.minimum(difference, FULL_TURN - difference)
