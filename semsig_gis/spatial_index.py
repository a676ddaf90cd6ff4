"""The R-tree over street objects: which of them lie near a viewpoint."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rtree import index as rtree_index

from semsig_gis.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["ObjectIndex"]


class ObjectIndex:
    """An R-tree over points.

    Parameters
    ----------
    xy : ndarray of float64, shape (n, 2)
        Positions in metres, finite.

    Raises
    ------
    InputError
        If there is no point, or one is not finite.

    Notes
    -----
    The tree is packed from the arrays in one go and asked for many boxes at once. It belongs to
    the process and thread that made it: an R-tree of this library pickles to an empty one.

    Examples
    --------
    >>> tree = ObjectIndex(np.array([[0.0, 0.0], [3.0, 4.0], [50.0, 0.0]]))
    >>> viewpoints, objects = tree.pairs_within(np.array([[0.0, 0.0]]), radius=5.0)
    >>> sorted(objects.tolist())
    [0, 1]
    """

    def __init__(self, xy: NDArray[np.float64]) -> None:
        points = np.array(xy, dtype=np.float64, order="C")  # a copy, as the tree has one too
        if len(points) == 0 or not np.isfinite(points).all():
            msg = "an R-tree needs at least one point, and finite coordinates."
            raise InputError(msg)
        self._xy = points
        self._tree = rtree_index.Index((np.arange(len(points)), points, points))

    def __reduce__(self) -> str | tuple[object, ...]:  # noqa: D105
        return (type(self), (self._xy,))

    def pairs_within(
        self, viewpoints: NDArray[np.float64], *, radius: float
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return every pair of viewpoint and point within a radius.

        Parameters
        ----------
        viewpoints : ndarray of float64, shape (v, 2)
            Places to look from, in metres.
        radius : float
            Metres; a point at exactly this distance counts.

        Returns
        -------
        viewpoint, point : ndarray of int64, shape (p,)
            Row numbers, ordered by viewpoint.
        """
        places = np.ascontiguousarray(viewpoints, dtype=np.float64)
        # The box is a touch larger than the circle: the exact test below decides alone.
        reach = np.nextafter(radius, np.inf) * (1 + 1e-12)
        found, counts = self._tree.intersection_v(places - reach, places + reach)
        point = found.astype(np.int64)
        viewpoint = np.repeat(np.arange(len(places)), counts.astype(np.int64))
        delta = self._xy[point] - places[viewpoint]
        near = np.hypot(delta[:, 0], delta[:, 1]) <= radius
        return viewpoint[near], point[near]
