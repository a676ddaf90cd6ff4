"""R-trees over street objects: which of them lie near a viewpoint.

Two trees with one question: `ObjectIndex` (libspatialindex) for some places, `PackedIndex` (GEOS)
for very many; it answers for boxes too.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np
import shapely
from rtree import index as rtree_index

from semsig_gis.core.errors import InputError
from semsig_gis.core.geometry import consecutive

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

# More than the distance between neighbouring floats anywhere on Earth.
ROUNDING_M = 1e-6
BLOCKS = 3  # a radius: places in one block ask the tree together


class ObjectIndex:
    """An R-tree over points in metres, shape (n, 2).

    InputError if there is no point, or one is not finite. The tree is packed in one go and asked
    for many boxes at once. As a tree belongs to its thread, each makes its own when it asks.
    """

    def __init__(self, xy: NDArray[np.float64]) -> None:
        self._xy = checked_points(xy)
        self._own = threading.local()

    def __reduce__(self) -> str | tuple[object, ...]:  # noqa: D105
        return (type(self), (self._xy,))

    def pairs_within(
        self, viewpoints: NDArray[np.float64], *, radius: float
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the rows of viewpoint and point of every pair within a radius, by viewpoint.

        Viewpoints, shape (v, 2), and radius are in metres; a point at exactly the radius counts.
        """
        places = np.ascontiguousarray(viewpoints, dtype=np.float64)
        reach = _a_touch_more(radius)
        side = reach / BLOCKS
        corners, block = np.unique(np.floor(places / side) * side, axis=0, return_inverse=True)
        if not hasattr(self._own, "tree"):
            self._own.tree = rtree_index.Index((np.arange(len(self._xy)), self._xy, self._xy))
        found, counts = self._own.tree.intersection_v(corners - reach, corners + (reach + side))
        sizes = counts.astype(np.int64)
        point = found[consecutive((np.cumsum(sizes) - sizes)[block], sizes[block])]
        viewpoint = np.repeat(np.arange(len(places)), sizes[block])
        return _near(viewpoint, point.astype(np.int64), places, self._xy, radius)


class PackedIndex:
    """An R-tree over points that is packed once and asked by very many viewpoints.

    Positions are in metres, shape (n, 2). InputError if there is none, or one is not finite.
    """

    def __init__(self, xy: NDArray[np.float64]) -> None:
        self._xy = checked_points(xy)
        self._tree = shapely.STRtree(np.asarray(shapely.points(self._xy)))

    def pairs_within(
        self, viewpoints: NDArray[np.float64], *, radius: float
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return all pairs within a radius, as `ObjectIndex.pairs_within` does."""
        places = np.ascontiguousarray(viewpoints, dtype=np.float64)
        viewpoint, point = self._tree.query(
            shapely.points(places), predicate="dwithin", distance=_a_touch_more(radius)
        )
        return _near(viewpoint, point, places, self._xy, radius)

    def pairs_in(
        self, low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the rows of box and point of every point in a box, ordered by box.

        Lower left and upper right corners have shape (b, 2); a point on an edge counts.
        """
        box, point = self._tree.query(shapely.box(*low.T, *high.T))
        return box, point


def checked_points(xy: ArrayLike) -> NDArray[np.float64]:
    """Return a C-ordered copy of points, shape (n, 2); refuse none, or one that is not finite."""
    points = np.array(xy, dtype=np.float64, order="C")  # a copy, as the tree has one too
    if len(points) == 0 or not np.isfinite(points).all():
        raise InputError("an R-tree needs at least one point, and finite coordinates.")
    return points


def _a_touch_more(radius: float) -> float:
    """Return a reach that no rounding in a tree makes too small; `_near` decides alone."""
    return radius * (1 + 1e-12) + ROUNDING_M


def _near(
    viewpoint: NDArray[np.int64],
    point: NDArray[np.int64],
    places: NDArray[np.float64],
    xy: NDArray[np.float64],
    radius: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Keep the pairs that are at most so far apart."""
    delta = xy[point] - places[viewpoint]
    near = np.hypot(delta[:, 0], delta[:, 1]) <= radius
    return viewpoint[near], point[near]
