"""What is seen from one place, and told in some order: types, bearings and distances.

A detector tells types and bearings, and perhaps rough distances and scores of several classes. The
true distances stay with them for as long as something that happens to the query, a weak eye or a
parked van, depends on how far away things are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import (
    BEARING_UNITS,
    DISTANCE_UNITS,
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

    Spoiling = Callable[["Sight", np.random.Generator], "Sight"]
    """What a distortion does to what is seen, with all chances from a generator."""

NEAREST_M = 0.01  # that anything stands, so that its width is an angle
_BY_OBJECT = ("codes", "bearings", "distances", "false", "ranges", "scores")


@dataclass(frozen=True, eq=False, repr=False, slots=True, kw_only=True)
class Sight(Displayed):
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
    false : ndarray of bool, shape (n,), or None
        Whether each object is a false one; None where none is.
    ranges, scores : ndarray of float64 or None
        Rough distances and scores of classes that a detector gives, as in `View`.
    range_error : float, default NaN
        The relative error that it states of the rough distances, as in `View`.
    photo : Photo, default the full turn
        The directions that are stated to have been looked at.

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
        """What a detector reports of it: a `View` if that is more than types and bearings."""
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
            distances=database.distance_units[part] * np.float64(database.reach / DISTANCE_UNITS),
        )

    def only(self, objects: ArrayLike) -> Sight:
        """Return some of the objects: those of a mask, or of numbers in the order wanted."""
        index = np.asarray(objects)
        columns = {name: getattr(self, name) for name in _BY_OBJECT}
        kept = {name: values[index] for name, values in columns.items() if values is not None}
        return replace(self, **kept)

    def in_view(self) -> Sight:
        """Return the objects in the directions that are stated to have been looked at."""
        return self.only(self.photo.sees(self.bearings)) if self.photo.sectors else self

    def renamed(self, codes: NDArray[np.uint8]) -> Sight:
        """Return the objects by other names; where a name changes, its scores are sure of it."""
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
        """Return the objects, and then false ones; their rough distances are just these."""
        more = {
            "codes": codes,
            "bearings": bearings,
            "distances": distances,
            "false": np.ones(len(codes), np.bool_),
            "ranges": np.maximum(distances, NEAREST_M),
            "scores": np.eye(CLASSES)[codes],
        }
        one = self if self.false is not None else replace(self, false=np.zeros(len(self), np.bool_))
        columns = {name: getattr(one, name) for name in _BY_OBJECT}
        joined: dict[str, Any] = {
            name: np.concatenate([values, more[name]])
            for name, values in columns.items()
            if values is not None
        }
        return replace(one, **joined)

    def clockwise(self) -> Sight:
        """Return the objects sorted by bearing; those on one bearing stay in their order."""
        return self.only(np.argsort(self.bearings, kind="stable"))

    def turned(self, degrees: float) -> Sight:
        """Return the same with bearings so many degrees larger, clockwise from the new north."""
        return replace(
            self,
            bearings=wrap_degrees(self.bearings + degrees),
            heading=float(wrap_degrees(self.heading - degrees)),
            photo=self.photo.turned(degrees),
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
