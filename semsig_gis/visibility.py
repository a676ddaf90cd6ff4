"""What is seen from a viewpoint: the street objects within range."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.geometry import bearings, wrap_degrees

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.spatial_index import ObjectIndex, PackedIndex

__all__ = ["Sightings", "visible_objects"]

BEARING_DECIMALS = 9


@dataclass(frozen=True, eq=False, slots=True)
class Sightings:
    """Pairs of a viewpoint and an object that is seen from it.

    Parameters
    ----------
    viewpoint, object : ndarray of int64, shape (p,)
        Row numbers.
    bearing : ndarray of float64, shape (p,)
        Degrees clockwise from grid north, [0, 360), to nine decimals.
    distance : ndarray of float64, shape (p,)
        Metres.

    Examples
    --------
    >>> nothing = np.empty(0, np.int64)
    >>> len(Sightings(nothing, nothing, nothing.astype(float), nothing.astype(float)).bearing)
    0
    """

    viewpoint: NDArray[np.int64]
    object: NDArray[np.int64]
    bearing: NDArray[np.float64]
    distance: NDArray[np.float64]

    def only(self, kept: NDArray[np.bool_]) -> Sightings:
        """Return some of the pairs.

        Parameters
        ----------
        kept : ndarray of bool, shape (p,)
            Which pairs.

        Returns
        -------
        Sightings
            Those pairs, in the same order.
        """
        return Sightings(
            self.viewpoint[kept], self.object[kept], self.bearing[kept], self.distance[kept]
        )


def visible_objects(
    viewpoints: NDArray[np.float64],
    objects: NDArray[np.float64],
    *,
    index: ObjectIndex | PackedIndex,
    radius: float,
) -> Sightings:
    """Return what is seen from every viewpoint.

    Parameters
    ----------
    viewpoints : ndarray of float64, shape (v, 2)
        Places to look from, in metres.
    objects : ndarray of float64, shape (n, 2)
        Positions of the objects, in metres.
    index : ObjectIndex or PackedIndex
        R-tree over `objects`.
    radius : float
        Visibility range R in metres.

    Returns
    -------
    Sightings
        The pairs within range, ordered by viewpoint (paper, section on semantic signatures).

    Examples
    --------
    >>> from semsig_gis.spatial_index import ObjectIndex
    >>> places = np.array([[0.0, 10.0], [0.0, 99.0]])
    >>> tree = ObjectIndex(places)
    >>> seen = visible_objects(np.array([[0.0, 0.0]]), places, index=tree, radius=30.0)
    >>> seen.bearing.tolist(), seen.distance.tolist()
    ([0.0], [10.0])
    """
    viewpoint, item = index.pairs_within(viewpoints, radius=radius)
    delta = objects[item] - viewpoints[viewpoint]
    # Processors differ in the last digits of an arctangent: they must not decide about ties.
    bearing = wrap_degrees(np.round(bearings(delta[:, 0], delta[:, 1]), BEARING_DECIMALS))
    return Sightings(viewpoint, item, bearing, np.hypot(delta[:, 0], delta[:, 1]))
