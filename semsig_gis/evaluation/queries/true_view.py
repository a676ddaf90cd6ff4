"""Objects seen from one place: types, bearings and true distances.

A detector reports types and bearings, and perhaps rough distances and class scores. The true
distances are kept as well, because some distortions (a weak detector, a parked van) depend on how
far away the objects are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import (
    BEARING_UNITS,
    FULL_TURN,
    Displayed,
    Signature,
    wrap_degrees,
)
from semsig_gis.observation import CLASSES, FULL_VIEW, View

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core import Taxonomy
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.observation import Photo

    DistortFunction = Callable[["Sight", np.random.Generator], "Sight"]
    """Function that distorts a sight with random numbers of a generator."""

NEAREST_M = 0.01  # least distance of an object, so that its width can be turned into an angle
_BY_OBJECT = ("codes", "bearings", "distances", "extents", "false", "ranges", "scores")


@dataclass(frozen=True, eq=False, repr=False, slots=True, kw_only=True)
class Sight(Displayed):
    """The objects that are seen, or seem to be seen, from a place.

    Parameters
    ----------
    codes : ndarray of uint8, shape (n,)
        Class code of each object.
    bearings : ndarray of float64, shape (n,)
        Degrees clockwise from the assumed north, in [0, 360).
    distances : ndarray of float64, shape (n,)
        Metres; of a false object, how far away it seems to be.
    extents : ndarray of float64, shape (n,), or None
        Angular widths of extended things in degrees, 0 for points; None if there are none.
    heading : float, default 0
        Degrees to add to the bearings to have them from true north, in [0, 360).
    false : ndarray of bool, shape (n,), or None
        Whether each object is a false one; None if there are no false objects.
    ranges, scores : ndarray of float64 or None
        Rough distances and class scores of a detector, as in `View`.
    range_error : float, default NaN
        Stated relative error of the rough distances, as in `View`.
    photo : Photo, default the full turn
        The directions that are stated as observed.

    Examples
    --------
    >>> sight = Sight(
    ...     codes=np.array([1, 3], np.uint8),
    ...     bearings=np.array([350.0, 90.0]),
    ...     distances=np.array([5.0, 20.0]),
    ... )
    >>> sight.clockwise().codes.tolist(), len(sight.only(sight.distances < 10.0))
    ([3, 1], 1)
    """

    codes: NDArray[np.uint8]
    bearings: NDArray[np.float64]
    distances: NDArray[np.float64]
    extents: NDArray[np.float64] | None = None
    heading: float = 0.0
    false: NDArray[np.bool_] | None = None
    ranges: NDArray[np.float64] | None = None
    range_error: float = math.nan
    scores: NDArray[np.float64] | None = None
    photo: Photo = FULL_VIEW

    def __len__(self) -> int:  # noqa: D105
        return len(self.codes)

    def _facts(self) -> dict[str, object]:
        return {
            "objects": len(self),
            "classes": len(np.unique(self.codes)),
            "farthest": f"{self.distances.max(initial=0.0):.1f} m",
            "heading": f"{self.heading:.1f}°",
        }

    @property
    def signature(self) -> Signature:
        """What a detector reports: a `View` if it has more than types and bearings."""
        if self.ranges is None and self.scores is None and self.photo == FULL_VIEW:
            return Signature(self.codes, self.bearings)
        return View(
            self.codes,
            self.bearings,
            ranges=self.ranges,
            range_errors=None if self.ranges is None else np.full(len(self), self.range_error),
            scores=self.scores,
            photos=(self.photo,),
        )

    @classmethod
    def of_cell(cls, database: SignatureDatabase, cell: int) -> Sight:
        """Return the objects of a cell, given by row number, clockwise."""
        part = slice(database.offsets[cell], database.offsets[cell + 1])
        return cls(
            codes=database.codes[part],
            bearings=database.bearing_units[part] * np.float64(FULL_TURN / BEARING_UNITS),
            distances=database.scale.metres[database.distance_units[part]],
            extents=None if database.extents is None else database.extents[part],
        )

    def only(self, objects: ArrayLike) -> Sight:
        """Return some of the objects, given by a mask or by their numbers in order."""
        index = np.asarray(objects)
        columns = {name: getattr(self, name) for name in _BY_OBJECT}
        selected = {name: values[index] for name, values in columns.items() if values is not None}
        return replace(self, **selected)

    def in_view(self) -> Sight:
        """Return the objects in the directions that are stated as observed."""
        return self.only(self.photo.sees(self.bearings)) if self.photo.sectors else self

    def renamed(self, codes: NDArray[np.uint8]) -> Sight:
        """Return the objects with other class codes; a changed class gets a score of 1."""
        scores = self.scores
        if scores is not None:
            scores = np.where((codes == self.codes)[:, None], scores, np.eye(CLASSES)[codes])
        return replace(self, codes=codes, scores=scores)

    def with_false(
        self,
        codes: NDArray[np.uint8],
        bearings: NDArray[np.float64],
        distances: NDArray[np.float64],
    ) -> Sight:
        """Return the objects followed by false ones; rough distances of these have no error."""
        false = {
            "codes": codes,
            "bearings": bearings,
            "distances": distances,
            "extents": np.zeros(len(codes)),
            "false": np.ones(len(codes), np.bool_),
            "ranges": np.maximum(distances, NEAREST_M),
            "scores": np.eye(CLASSES)[codes],
        }
        columns = {name: getattr(self, name) for name in _BY_OBJECT}
        if self.false is None:
            columns["false"] = np.zeros(len(self), np.bool_)
        # A column that the detector does not give stays empty.
        joined: dict[str, Any] = {
            name: np.concatenate([values, false[name]])
            for name, values in columns.items()
            if values is not None
        }
        return replace(self, **joined)

    def clockwise(self) -> Sight:
        """Return the objects sorted by bearing; equal bearings stay in their order."""
        return self.only(np.argsort(self.bearings, kind="stable"))

    def turned(self, degrees: float) -> Sight:
        """Return the sight with all bearings increased by `degrees`, sorted from the new north."""
        return replace(
            self,
            bearings=wrap_degrees(self.bearings + degrees),
            heading=float(wrap_degrees(self.heading - degrees)),
            photo=self.photo.turned(degrees),
        ).clockwise()


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class CitySights:
    """Classes that are visible in a city and the range of sight, for drawing false objects.

    `codes` (k,) are the classes of `taxonomy` that are visible somewhere, ascending; `frequencies`
    (k,) is how often each is seen; `reach` is the range of sight in metres, without landmarks.
    """

    taxonomy: Taxonomy
    codes: NDArray[np.uint8]
    frequencies: NDArray[np.int64]
    reach: float

    @classmethod
    def of(cls, database: SignatureDatabase) -> CitySights:
        """Return the classes that the cells of a database see."""
        codes = database.present_codes
        return cls(
            taxonomy=database.taxonomy,
            codes=codes,
            frequencies=database.occurrences[codes],
            reach=database.near_reach,
        )

    def false_distances(self, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Draw distances of false objects in metres, uniform over the area within reach."""
        return self.reach * np.sqrt(rng.random(count))
