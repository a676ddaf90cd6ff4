"""R-trees and grids of street objects, to find the objects near a viewpoint.

`ObjectIndex` (libspatialindex) is faster for a few viewpoints, `PackedIndex` (GEOS) for very many;
the latter also answers queries by box. The grid of an `ObjectIndex` is the fastest where ranges are
short.
"""

from __future__ import annotations

import threading
from functools import cached_property
from typing import TYPE_CHECKING

import lazy_loader
import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.core.geometry import consecutive
from semsig_gis.core.threads import share_rows

if TYPE_CHECKING:
    import shapely
    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core.point_grid import PointGrid
else:
    shapely = lazy_loader.load("shapely")

# More than the rounding error of a coordinate anywhere on Earth.
ROUNDING_M = 1e-6
# Viewpoints in the same square, of a third of the radius, share one query of the tree.
SQUARES_PER_RADIUS = 3
PLACES_A_THREAD = 512  # the fewest places that are worth a thread


class ObjectIndex:
    """An R-tree over points in metres, shape (n, 2).

    InputError without points, or for one that is not finite. The tree is bulk-loaded and queried
    for many boxes at once. It can be used by one thread only, so each thread builds its own at its
    first query.
    """

    def __init__(self, xy: NDArray[np.float64]) -> None:
        self._xy = checked_points(xy)
        self._own = threading.local()

    def __reduce__(self) -> str | tuple[object, ...]:  # noqa: D105
        return (type(self), (self._xy,))

    def pairs_within(
        self, viewpoints: NDArray[np.float64], *, radius: float
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the indices of viewpoint and point of all pairs within a radius, by viewpoint.

        Viewpoints, shape (v, 2), and radius are in metres; a point at exactly the radius counts.
        """
        places = np.ascontiguousarray(viewpoints, dtype=np.float64)
        reach = _padded(radius)
        side = reach / SQUARES_PER_RADIUS
        # Query the tree once for each square, with a box that contains all circles around it.
        corners, square = np.unique(np.floor(places / side) * side, axis=0, return_inverse=True)
        if not hasattr(self._own, "tree"):
            from rtree import index as rtree_index  # noqa: PLC0415 - only for these queries

            self._own.tree = rtree_index.Index((np.arange(len(self._xy)), self._xy, self._xy))
        points, counts = self._own.tree.intersection_v(corners - reach, corners + (reach + side))
        # Repeat the points of a square for each of its viewpoints.
        sizes = counts.astype(np.int64)
        point = points[consecutive((np.cumsum(sizes) - sizes)[square], sizes[square])]
        viewpoint = np.repeat(np.arange(len(places)), sizes[square])
        return _within(viewpoint, point.astype(np.int64), places, self._xy, radius)

    @cached_property
    def _grid(self) -> PointGrid:
        from semsig_gis.core.point_grid import point_grid  # noqa: PLC0415 - numba, 0.25 s

        return point_grid(self._xy)

    def points_in_range(
        self,
        viewpoints: NDArray[np.float64],
        *,
        ranges: NDArray[np.float64],
        kinds: NDArray[np.uint8],
        reach: float,
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the points within the range of their kind of v viewpoints, in metres.

        Those of viewpoint i are ``points[offsets[i] : offsets[i + 1]]`` of the returned offsets,
        shape (v + 1,), and points. `kinds` are those of all points; kinds with ranges of more than
        `reach` are left out.
        """
        from semsig_gis.core.point_grid import near_points  # noqa: PLC0415 - numba, 0.25 s

        places = np.ascontiguousarray(viewpoints, dtype=np.float64)
        starts, counts = np.zeros((2, len(places)), np.int64)
        grid, room = self._grid, np.empty(0, np.int64)

        def fill(part: NDArray[np.int64]) -> None:
            near_points(part, places, grid, _padded(reach), ranges, kinds, starts, counts, room)

        fill(np.array([0, len(places)]))
        starts = np.cumsum(counts) - counts
        room = np.empty(counts.sum() + 1, np.int64)
        share_rows(fill, len(places), least=PLACES_A_THREAD)
        return np.append(0, np.cumsum(counts)), room[consecutive(starts, counts)]


class PackedIndex:
    """A packed R-tree over points in metres, shape (n, 2), for very many viewpoints.

    InputError without points, or for one that is not finite.
    """

    def __init__(self, xy: NDArray[np.float64]) -> None:
        self._xy = checked_points(xy)
        self._tree = shapely.STRtree(np.asarray(shapely.points(self._xy)))

    def pairs_within(
        self, viewpoints: NDArray[np.float64], *, radius: float
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return all pairs within a radius, like `ObjectIndex.pairs_within`."""
        places = np.ascontiguousarray(viewpoints, dtype=np.float64)
        viewpoint, point = self._tree.query(
            shapely.points(places), predicate="dwithin", distance=_padded(radius)
        )
        return _within(viewpoint, point, places, self._xy, radius)

    def pairs_in(
        self, low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the indices of box and point of all points in a box, ordered by box.

        Lower left and upper right corners have shape (b, 2); a point on an edge counts.
        """
        box, point = self._tree.query(shapely.box(*low.T, *high.T))
        return box, point


def checked_points(xy: ArrayLike) -> NDArray[np.float64]:
    """Return a C-ordered copy of points, shape (n, 2); InputError for none or one not finite."""
    points = np.array(xy, dtype=np.float64, order="C")  # a copy, because the tree keeps one too
    if len(points) == 0 or not np.isfinite(points).all():
        raise InputError("an R-tree needs at least one point, and finite coordinates.")
    return points


def _padded(radius: float) -> float:
    """Return a slightly larger search radius, so that rounding in the tree misses no point.

    `_within` removes the points beyond the exact radius.
    """
    return radius * (1 + 1e-12) + ROUNDING_M


def _within(
    viewpoint: NDArray[np.int64],
    point: NDArray[np.int64],
    places: NDArray[np.float64],
    xy: NDArray[np.float64],
    radius: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the pairs that are at most `radius` apart."""
    delta = xy[point] - places[viewpoint]
    within = np.hypot(delta[:, 0], delta[:, 1]) <= radius
    return viewpoint[within], point[within]
