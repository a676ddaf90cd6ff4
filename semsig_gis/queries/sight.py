"""What is seen from one place, and told in some order: types, bearings and distances.

A detector tells types and bearings only. The distances stay with them for as long as something
that happens to the query, a weak eye or a parked van, depends on how far away things are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.geometry import FULL_TURN, wrap_degrees
from semsig_gis.core.signature import BEARING_UNITS, DISTANCE_UNITS, Signature

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core.taxonomy import Taxonomy
    from semsig_gis.database.database import SignatureDatabase

    Spoiling = Callable[["Sight", np.random.Generator], "Sight"]
    """What a distortion does to what is seen, with all chances from a generator."""


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Sight:
    """What is seen from a place, or seems to be.

    Parameters
    ----------
    codes : ndarray of uint8, shape (n,)
        Class code of each object.
    bearings : ndarray of float64, shape (n,)
        Degrees clockwise from what is taken for north, in [0, 360).
    distances : ndarray of float64, shape (n,)
        Metres; of a false object, how far away it seems to be.
    heading : float, default 0
        Degrees to add to the bearings to have them from true north, in [0, 360).

    Examples
    --------
    >>> seen = Sight(
    ...     codes=np.array([1, 3], np.uint8),
    ...     bearings=np.array([350.0, 90.0]),
    ...     distances=np.array([5.0, 20.0]),
    ... )
    >>> seen.clockwise().codes.tolist(), len(seen.only(seen.distances < 10.0))
    ([3, 1], 1)
    """

    codes: NDArray[np.uint8]
    bearings: NDArray[np.float64]
    distances: NDArray[np.float64]
    heading: float = 0.0

    def __len__(self) -> int:  # noqa: D105
        return len(self.codes)

    @property
    def signature(self) -> Signature:
        """What a detector tells of it."""
        return Signature(self.codes, self.bearings)

    @classmethod
    def of_cell(cls, database: SignatureDatabase, cell: int) -> Sight:
        """Return the objects of a cell, given by row number, clockwise."""
        part = slice(database.offsets[cell], database.offsets[cell + 1])
        return cls(
            codes=database.codes[part],
            bearings=database.bearing_units[part] * np.float64(FULL_TURN / BEARING_UNITS),
            distances=database.distance_units[part] * np.float64(database.reach / DISTANCE_UNITS),
        )

    def only(self, objects: ArrayLike) -> Sight:
        """Return some of the objects: those of a mask, or of numbers in the order wanted."""
        index = np.asarray(objects)
        return replace(
            self,
            codes=self.codes[index],
            bearings=self.bearings[index],
            distances=self.distances[index],
        )

    def clockwise(self) -> Sight:
        """Return the objects sorted by bearing; those on one bearing stay in their order."""
        return self.only(np.argsort(self.bearings, kind="stable"))

    def turned(self, degrees: float) -> Sight:
        """Return the same with bearings so many degrees larger, clockwise from the new north."""
        return replace(
            self,
            bearings=wrap_degrees(self.bearings + degrees),
            heading=float(wrap_degrees(self.heading - degrees)),
        ).clockwise()


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class CitySights:
    """What there is to see in a city: what false objects are made of.

    `codes` (k,) are the classes of `taxonomy` that are seen somewhere, ascending; `frequencies`
    (k,) how often each is seen; `reach` the range of sight in metres.
    """

    taxonomy: Taxonomy
    codes: NDArray[np.uint8]
    frequencies: NDArray[np.int64]
    reach: float

    @classmethod
    def of(cls, database: SignatureDatabase) -> CitySights:
        """Return what is seen in the cells of a database."""
        codes = database.present_codes
        return cls(
            taxonomy=database.taxonomy,
            codes=codes,
            frequencies=database.occurrences[codes],
            reach=database.reach,
        )

    def false_distances(self, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Draw distances of false objects in metres, spread evenly over the circle within reach."""
        return self.reach * np.sqrt(rng.random(count))
