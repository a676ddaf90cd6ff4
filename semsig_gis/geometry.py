"""Array maths of directions: bearings, wrapping and angular distance, all in degrees."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["FULL_TURN", "angular_distance", "bearings", "wrap_degrees"]

FULL_TURN = 360.0


def wrap_degrees(angles: ArrayLike) -> NDArray[np.float64]:
    """Wrap angles onto one turn.

    Parameters
    ----------
    angles : array_like
        Angles in degrees, any finite value.

    Returns
    -------
    ndarray of float64
        The same directions in [0, 360).

    Examples
    --------
    >>> wrap_degrees([-10.0, 360.0, 725.0]).tolist()
    [350.0, 0.0, 5.0]
    """
    wrapped = np.mod(np.asarray(angles, dtype=np.float64), FULL_TURN)
    # The remainder of a tiny negative angle rounds to 360 itself.
    return np.where(wrapped >= FULL_TURN, 0.0, wrapped)


def bearings(dx: ArrayLike, dy: ArrayLike) -> NDArray[np.float64]:
    """Return the bearing of displacements.

    Parameters
    ----------
    dx, dy : array_like
        Displacements to grid east and grid north, in the same unit.

    Returns
    -------
    ndarray of float64
        Degrees clockwise from grid north, in [0, 360). A displacement of zero has bearing 0.

    Examples
    --------
    >>> bearings([0.0, 1.0, 0.0, -1.0], [1.0, 0.0, -1.0, 0.0]).tolist()
    [0.0, 90.0, 180.0, 270.0]
    """
    turned = np.degrees(np.arctan2(np.asarray(dx), np.asarray(dy)))
    # What `wrap_degrees` gives for half a turn to each side, without its costly remainder.
    wrapped = np.where(turned < 0.0, turned + FULL_TURN, np.abs(turned))
    return np.where(wrapped >= FULL_TURN, 0.0, wrapped)


def angular_distance(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """Return the smaller angle between directions.

    Parameters
    ----------
    a, b : array_like
        Directions in degrees.

    Returns
    -------
    ndarray of float64
        Degrees in [0, 180].

    Examples
    --------
    >>> angular_distance([350.0, 90.0], [10.0, 270.0]).tolist()
    [20.0, 180.0]
    """
    difference = wrap_degrees(np.asarray(a, dtype=np.float64) - np.asarray(b, dtype=np.float64))
    return np.minimum(difference, FULL_TURN - difference)
