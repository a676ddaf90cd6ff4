"""What is seen from some places anywhere: the objects behind a signature, one by one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.database import BEARING_UNITS
from semsig_gis.occlusion import hidden
from semsig_gis.signatures import clockwise_order
from semsig_gis.visibility import seen_from

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.objects import StreetObjects
    from semsig_gis.occlusion import Footprints
    from semsig_gis.spatial_index import ObjectIndex
    from semsig_gis.stored_index import StoredIndex

__all__ = ["Views", "views_at", "views_in"]

HALF_UNIT = 180.0 / BEARING_UNITS


@dataclass(frozen=True, eq=False, kw_only=True)
class Views:
    """What is seen from v places, each clockwise from north.

    The entries of place ``i`` are ``offsets[i]`` to ``offsets[i + 1]``. `objects` are rows in the
    table of objects, -1 where not known; `codes` their classes; `bearings` are in degrees clockwise
    from grid north, `distances` in metres.
    """

    offsets: NDArray[np.int64]
    objects: NDArray[np.int64]
    codes: NDArray[np.uint8]
    bearings: NDArray[np.float64]
    distances: NDArray[np.float64]

    def __len__(self) -> int:  # noqa: D105
        return len(self.offsets) - 1

    @property
    def lengths(self) -> NDArray[np.int64]:
        """How many objects are seen from each place, shape (v,)."""
        return np.diff(self.offsets)


def views_at(
    objects: StreetObjects,
    places: NDArray[np.float64],
    *,
    index: ObjectIndex | StoredIndex,
    radius: float,
    footprints: Footprints | None = None,
) -> Views:
    """Return what is seen from places anywhere, in metres in the CRS of the objects, not rounded.

    `index` is an R-tree over ``objects.xy``; `radius` is the visibility range in metres of classes
    that have none of their own; what `footprints` hide is not seen.
    """
    ranges = objects.taxonomy.ranges(radius)
    places = np.ascontiguousarray(places, dtype=np.float64)
    codes = objects.codes
    seen = seen_from(places, objects.xy, index=index, ranges=ranges[codes])
    if footprints is not None:
        ends = places[seen.viewpoint], objects.xy[seen.object]
        seen = seen.only(~hidden(*ends, footprints=footprints))
    order = clockwise_order(seen, codes)
    lengths = np.bincount(seen.viewpoint, minlength=len(places))
    rows = seen.object[order]
    return Views(
        offsets=np.concatenate([[0], np.cumsum(lengths)]),
        objects=rows,
        codes=codes[rows],
        bearings=seen.bearing[order],
        distances=seen.distance[order],
    )


def views_in(database: SignatureDatabase, cells: NDArray[np.int64]) -> Views:
    """Return what a database says is seen from some of its cells; one may stand there twice.

    Bearings are in the middle of their units, and the rows of the objects are not known.
    """
    lengths = database.lengths[cells]
    offsets = np.concatenate([[0], np.cumsum(lengths)])
    entries = np.repeat(database.offsets[cells] - offsets[:-1], lengths) + np.arange(offsets[-1])
    units = database.bearing_units[entries]
    return Views(
        offsets=offsets,
        objects=np.full(len(entries), -1),
        codes=database.codes[entries],
        bearings=units * (360.0 / BEARING_UNITS) + HALF_UNIT,
        distances=database.distance_units[entries] * (database.reach / 255.0),
    )
