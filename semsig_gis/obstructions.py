"""What stands in the way: nearer objects, vans and kiosks at the kerb, hands before the lens."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.errors import InputError
from semsig_gis.geometry import FULL_TURN, angular_distance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.sight import CitySights, Sight, Spoiling

__all__ = ["BlockedSectors", "HiddenBehind", "Obstacles"]

NEAREST_M = 0.01  # that anything stands, so that its width is an angle


@dataclass(frozen=True, slots=True, kw_only=True)
class HiddenBehind:
    """Objects that nearer objects hide.

    An object is hidden when a nearer one covers its bearing: one of `width` w metres (0 or more) at
    distance d covers ``atan(w / 2 d)`` to either side.
    """

    width: float = 0.5

    def __post_init__(self) -> None:  # noqa: D105
        _check_amount("width of the objects", self.width)

    def ready(self, city: CitySights) -> Spoiling:  # noqa: ARG002 - all distortions take it
        """Return the function that distorts a query."""

        def spoil(sight: Sight, rng: np.random.Generator) -> Sight:  # noqa: ARG001
            away = np.full(len(sight), self.width)
            return sight.only(~_behind(sight, sight.bearings, sight.distances, away))

        return spoil


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacles:
    """Things at the kerb, on no map, that hide what is behind them.

    Their number around a place is a Poisson one with mean `count`; each is `width` metres wide and
    stands anywhere within the range of the city. Both are 0 or more.
    """

    count: float = 2.0
    width: float = 4.0

    def __post_init__(self) -> None:  # noqa: D105
        _check_amount("number of obstacles", self.count)
        _check_amount("width of the obstacles", self.width)

    def ready(self, city: CitySights) -> Spoiling:
        """Return the function that distorts a query."""

        def spoil(sight: Sight, rng: np.random.Generator) -> Sight:
            count = int(rng.poisson(self.count))
            bearings = rng.uniform(0.0, FULL_TURN, count)
            distances = city.false_distances(count, rng)
            widths = np.full(count, self.width)
            return sight.only(~_behind(sight, bearings, distances, widths))

        return spoil


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockedSectors:
    """Sectors of the view in which nothing is seen, near or far.

    There are `count` of them (0 or more), each of `degrees` (0 to 360) anywhere in the turn; they
    may overlap.
    """

    count: int = 1
    degrees: float = 30.0

    def __post_init__(self) -> None:  # noqa: D105
        if self.count < 0 or not 0 <= self.degrees <= FULL_TURN:
            msg = (
                f"{self.count} sectors of {self.degrees!r} degrees were given; give a whole number "
                "from 0 up and degrees from 0 to 360."
            )
            raise InputError(msg)

    def ready(self, city: CitySights) -> Spoiling:  # noqa: ARG002 - all distortions take it
        """Return the function that distorts a query."""

        def spoil(sight: Sight, rng: np.random.Generator) -> Sight:
            middles = rng.uniform(0.0, FULL_TURN, self.count)
            aside = angular_distance(sight.bearings[:, None], middles)
            return sight.only((aside > self.degrees / 2.0).all(axis=1))

        return spoil


def _behind(
    sight: Sight,
    bearings: NDArray[np.float64],
    distances: NDArray[np.float64],
    widths: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Tell which objects are behind one of some things."""
    half = np.degrees(np.arctan2(widths / 2.0, np.maximum(distances, NEAREST_M)))
    farther = sight.distances[:, None] > distances
    return np.asarray(
        (farther & (angular_distance(sight.bearings[:, None], bearings) < half)).any(axis=1)
    )


def _check_amount(label: str, value: float) -> None:
    if not (math.isfinite(value) and value >= 0):
        msg = f"{label} is {value!r}; give a number, 0 or more."
        raise InputError(msg)
