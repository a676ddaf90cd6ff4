"""Limits of who looks: a compass that is off, classes that are not known, a narrow view."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.core.geometry import FULL_TURN, angular_distance, bearings, wrap_degrees
from semsig_gis.likelihood.noise.table import LONGEST_TABLE, noise_tables

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.likelihood.noise.model import Noise
    from semsig_gis.likelihood.noise.table import NoiseTable
    from semsig_gis.queries.sight import CitySights, Sight, Spoiling

NEAREST_M = 0.01  # that anything stands, so that its width is an angle


class _AnyCity(ABC):
    """A distortion that does the same whatever there is to see in a city."""

    __slots__ = ()

    def ready(self, city: CitySights) -> Spoiling:  # noqa: ARG002 - other distortions need it
        """Return what it does to a query."""
        return self._spoil

    @abstractmethod
    def _spoil(self, sight: Sight, rng: np.random.Generator) -> Sight: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class CompassBias(_AnyCity):
    """A compass that is off by the same angle for all objects of a query.

    The angle is normal, with a standard deviation of `sigma` degrees, 0 or more.
    """

    stream: ClassVar[int] = 3_628_719_812

    sigma: float = 10.0

    def __post_init__(self) -> None:  # noqa: D105
        _check_amount("standard deviation of the compass", self.sigma)

    def _spoil(self, sight: Sight, rng: np.random.Generator) -> Sight:
        return sight.turned(float(rng.normal(0.0, self.sigma)))


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingClasses:
    """A detector that does not know some classes of the city.

    With `others`, the named classes are the ones it knows, and all others are missing.
    """

    stream: ClassVar[int] = 2_848_656_676

    classes: tuple[str, ...] = ()
    others: bool = False

    def ready(self, city: CitySights) -> Spoiling:
        """Return what it does to a query.

        Raises UnknownNameError if the taxonomy of the city has no class of a name.
        """
        named = [city.taxonomy.by_name(name).code for name in self.classes]

        def spoil(sight: Sight, rng: np.random.Generator) -> Sight:  # noqa: ARG001
            return sight.only(np.isin(sight.codes, named, invert=not self.others))

        return spoil


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldOfView(_AnyCity):
    """A camera that looks in one direction, drawn at random, and sees part of the turn.

    It sees `degrees`, above 0 and at most 360. Bearings are still counted from north; nothing tells
    which part of the turn was looked at.
    """

    stream: ClassVar[int] = 20_362_731

    degrees: float = 90.0

    def __post_init__(self) -> None:  # noqa: D105
        if not 0 < self.degrees <= FULL_TURN:
            msg = (
                f"a view of {self.degrees!r} degrees was given; give degrees above 0, at most 360."
            )
            raise InputError(msg)

    def _spoil(self, sight: Sight, rng: np.random.Generator) -> Sight:
        aside = angular_distance(sight.bearings, rng.uniform(0.0, FULL_TURN))
        return sight.only(aside <= self.degrees / 2.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class HiddenBehind(_AnyCity):
    """Objects that nearer objects hide.

    An object is hidden when a nearer one covers its bearing: one of `width` w metres (0 or more) at
    distance d covers ``atan(w / 2 d)`` to either side.
    """

    stream: ClassVar[int] = 3_881_164_136

    width: float = 0.5

    def __post_init__(self) -> None:  # noqa: D105
        _check_amount("width of the objects", self.width)

    def _spoil(self, sight: Sight, rng: np.random.Generator) -> Sight:  # noqa: ARG002
        return sight.only(~_behind(sight, sight.bearings, sight.distances, self.width))


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacles:
    """Things at the kerb, on no map, that hide what is behind them.

    Their number around a place is a Poisson one with mean `count`; each is `width` metres wide and
    stands anywhere within the range of the city. Both are 0 or more.
    """

    stream: ClassVar[int] = 626_356_719

    count: float = 2.0
    width: float = 4.0

    def __post_init__(self) -> None:  # noqa: D105
        _check_amount("number of obstacles", self.count)
        _check_amount("width of the obstacles", self.width)

    def ready(self, city: CitySights) -> Spoiling:
        """Return what it does to a query."""

        def spoil(sight: Sight, rng: np.random.Generator) -> Sight:
            count = int(rng.poisson(self.count))
            bearings = rng.uniform(0.0, FULL_TURN, count)
            distances = city.false_distances(count, rng)
            return sight.only(~_behind(sight, bearings, distances, self.width))

        return spoil


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockedSectors(_AnyCity):
    """Sectors of the view in which nothing is seen, near or far.

    There are `count` of them (0 or more), each of `degrees` (0 to 360) anywhere in the turn; they
    may overlap.
    """

    stream: ClassVar[int] = 4_207_042_345

    count: int = 1
    degrees: float = 30.0

    def __post_init__(self) -> None:  # noqa: D105
        if self.count < 0 or not 0 <= self.degrees <= FULL_TURN:
            msg = (
                f"{self.count} sectors of {self.degrees!r} degrees were given; give a whole number "
                "from 0 up and degrees from 0 to 360."
            )
            raise InputError(msg)

    def _spoil(self, sight: Sight, rng: np.random.Generator) -> Sight:
        middles = rng.uniform(0.0, FULL_TURN, self.count)
        aside = angular_distance(sight.bearings[:, None], middles)
        return sight.only((aside > self.degrees / 2.0).all(axis=1))


def _behind(
    sight: Sight, bearings: NDArray[np.float64], distances: NDArray[np.float64], width: float
) -> NDArray[np.bool_]:
    """Tell which objects are behind one of some things, all of one width."""
    half = np.degrees(np.arctan2(width / 2.0, np.maximum(distances, NEAREST_M)))
    farther = sight.distances[:, None] > distances
    return np.asarray(
        (farther & (angular_distance(sight.bearings[:, None], bearings) < half)).any(axis=1)
    )


def _check_amount(label: str, value: float) -> None:
    if not (math.isfinite(value) and value >= 0):
        msg = f"the {label} is {value!r}; give a number, 0 or more."
        raise InputError(msg)


@dataclass(frozen=True, slots=True, kw_only=True)
class Detector:
    """A detector that fails as a noise model says.

    An object at distance d metres is detected with chance ``p * 2 ** -((d / half) ** 2)``, where p
    is that of the model: at `half` metres (above 0) only half of the objects are left. An uncertain
    place of the model (``position_sigma``) is a step aside of the observer. Of a mixture, one model
    is drawn for each query. As in `likelihood.noise.table`, no chance is quite 0 or 1.
    """

    stream: ClassVar[int] = 4_129_241_295

    noise: Noise
    half: float = math.inf

    def __post_init__(self) -> None:  # noqa: D105
        if not self.half > 0:
            msg = (
                f"a detector that sees half at {self.half!r} m was given; give metres above 0, or "
                "infinity where distance does not matter."
            )
            raise InputError(msg)

    def ready(self, city: CitySights) -> Spoiling:
        """Return what it does to a query.

        Raises InputError if the noise model names a class that the city does not have.
        """
        tables, weights = noise_tables(
            self.noise, taxonomy=city.taxonomy, codes=city.codes, longest=LONGEST_TABLE
        )

        def spoil(sight: Sight, rng: np.random.Generator) -> Sight:
            table = tables[int(rng.choice(len(tables), p=weights))]
            seen = self._detected(_from_aside(sight, table.position_sigma, rng), table, rng)
            codes = np.repeat(table.codes, rng.poisson(table.clutter))
            false = rng.uniform(0.0, FULL_TURN, len(codes))
            distances = city.false_distances(len(codes), rng)
            return replace(
                seen,
                codes=np.concatenate([seen.codes, codes]),
                bearings=np.concatenate([seen.bearings, false]),
                distances=np.concatenate([seen.distances, distances]),
            ).clockwise()

        return spoil

    def _detected(self, sight: Sight, table: NoiseTable, rng: np.random.Generator) -> Sight:
        """Return the objects that are detected, under the names and bearings they are given."""
        length = min(len(sight), len(table.missed) - 1)
        chances = 1.0 - table.missed[length, table.row_of[sight.codes]]
        chances *= np.exp2(-((sight.distances / self.half) ** 2))
        seen = sight.only(rng.random(len(sight)) < chances)
        kinds = table.row_of[seen.codes]
        names = np.cumsum(table.named[length, kinds], axis=1)
        labels = (rng.random(len(seen))[:, None] * names[:, -1:] >= names).sum(axis=1)
        off = rng.normal(0.0, table.sigma[kinds])
        return replace(seen, codes=table.codes[labels], bearings=wrap_degrees(seen.bearings + off))


def _from_aside(sight: Sight, sigma: float, rng: np.random.Generator) -> Sight:
    """Return what is seen a step aside."""
    if not sigma:
        return sight
    turned = np.radians(sight.bearings)
    dx, dy = rng.normal(0.0, sigma, 2)
    x = sight.distances * np.sin(turned) - dx
    y = sight.distances * np.cos(turned) - dy
    return replace(sight, bearings=bearings(x, y), distances=np.hypot(x, y))
