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

    Parameters
    ----------
    width : float, default 0.5
        How wide each object is, in metres; 0 or more.

    Raises
    ------
    InputError
        If it is out of range.

    Notes
    -----
    An object is hidden when a nearer one covers its bearing: of width w at distance d, that one
    covers ``atan(w / 2 d)`` to either side.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.sight import CitySights, Sight
    >>> city = CitySights(
    ...     taxonomy=paper_taxonomy(), codes=np.array([3], np.uint8),
    ...     frequencies=np.array([9]), reach=30.0,
    ... )
    >>> row = Sight(
    ...     codes=np.full(3, 3, np.uint8), bearings=np.array([10.0, 11.0, 30.0]),
    ...     distances=np.array([4.0, 20.0, 20.0]),
    ... )
    >>> spoil = HiddenBehind(width=0.5).ready(city)
    >>> spoil(row, np.random.default_rng(0)).bearings.tolist()
    [10.0, 30.0]
    """

    width: float = 0.5

    def __post_init__(self) -> None:  # noqa: D105
        _check_amount("width of the objects", self.width)

    def ready(self, city: CitySights) -> Spoiling:  # noqa: ARG002 - all distortions take it
        """Return what is done to a query.

        Parameters
        ----------
        city : CitySights
            What there is to see in the city.

        Returns
        -------
        callable
            From what is seen and a generator to what seems to be seen.
        """

        def spoil(sight: Sight, rng: np.random.Generator) -> Sight:  # noqa: ARG001
            away = np.full(len(sight), self.width)
            return sight.only(~_behind(sight, sight.bearings, sight.distances, away))

        return spoil


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacles:
    """Things at the kerb, on no map, that hide what is behind them.

    Parameters
    ----------
    count : float, default 2.0
        How many there are around a place on average, 0 or more; the number is a Poisson one, and
        they stand anywhere in sight.
    width : float, default 4.0
        How wide each is, in metres, 0 or more.

    Raises
    ------
    InputError
        If a number is out of range.

    Examples
    --------
    >>> Obstacles(count=-2.0)
    Traceback (most recent call last):
    ...
    semsig_gis.errors.InputError: number of obstacles is -2.0; give a number, 0 or more.
    """

    count: float = 2.0
    width: float = 4.0

    def __post_init__(self) -> None:  # noqa: D105
        _check_amount("number of obstacles", self.count)
        _check_amount("width of the obstacles", self.width)

    def ready(self, city: CitySights) -> Spoiling:
        """Return what is done to a query.

        Parameters
        ----------
        city : CitySights
            Its range is how far obstacles may be away.

        Returns
        -------
        callable
            From what is seen and a generator to what seems to be seen.
        """

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

    Parameters
    ----------
    count : int, default 1
        How many there are, 0 or more, each anywhere in the turn; they may overlap.
    degrees : float, default 30.0
        How wide each is, 0 to 360.

    Raises
    ------
    InputError
        If a number is out of range.

    Examples
    --------
    >>> BlockedSectors(degrees=400.0)
    Traceback (most recent call last):
    ...
    semsig_gis.errors.InputError: 1 sectors of 400.0 degrees were given; give a whole number from
    0 up and degrees from 0 to 360.
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
        """Return what is done to a query.

        Parameters
        ----------
        city : CitySights
            What there is to see in the city.

        Returns
        -------
        callable
            From what is seen and a generator to what seems to be seen.
        """

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
