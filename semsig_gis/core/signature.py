"""Semantic signatures: the clockwise sequence of object types and bearings at one viewpoint."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from typing_extensions import TypedDict

from semsig_gis.core.display import Displayed
from semsig_gis.core.errors import InputError
from semsig_gis.core.geometry import FULL_TURN, wrap_degrees
from semsig_gis.core.taxonomy import MAX_RANGE_M, WILDCARD

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core.taxonomy import Taxonomy

MAX_LEVELS = 255
# Stored steps of a full turn. The number is divisible by 8, 16, 24, 32 and 72, so that the usual
# angle levels are exact. A unit is 1 % of the noise of a good detector.
BEARING_UNITS = 7200
# Stored steps of the largest visibility range; a unit is 12 cm if that is 30 m.
DISTANCE_UNITS = 255
LOG_SCALE_M = 10.0  # far beyond it, logarithmic units grow in proportion to the distance


class SignatureRecord(TypedDict):
    """A signature as plain values: symbols, degrees and the number of objects."""

    types: str | None
    bearings: list[float] | None
    length: int


@dataclass(frozen=True, slots=True)
class SignatureSpec:
    """Parameters of a signature.

    Parameters
    ----------
    radius : float, default 30
        Visibility range R in metres, above 0 and at most 6000.
    levels : int, default 16
        Number Q of angle levels, 1 to 255.

    Raises
    ------
    InputError
        If a value is out of range.

    Examples
    --------
    >>> SignatureSpec().levels
    16
    """

    radius: float = 30.0
    levels: int = 16

    def __post_init__(self) -> None:  # noqa: D105
        if not (math.isfinite(self.radius) and 0 < self.radius <= MAX_RANGE_M):
            raise InputError(
                f"visibility range is {self.radius} m; "
                f"give a number of metres above 0 and up to {MAX_RANGE_M:.0f}."
            )
        if self.levels not in range(1, MAX_LEVELS + 1):
            raise InputError(
                f"{self.levels} angle levels were asked for; give a whole number from 1 to 255."
            )


def quantize(bearings: ArrayLike, levels: int) -> NDArray[np.uint8]:
    """Return the angle level of bearings in [0, 360): ``floor(bearing / (360 / levels))``.

    There are 1 to 255 levels; the paper takes Q = 16.
    """
    scaled = np.floor(np.asarray(bearings, dtype=np.float64) * levels / FULL_TURN)
    return np.minimum(scaled, levels - 1).astype(np.uint8)


@dataclass(frozen=True)
class DistanceScale:
    """The metres of the 256 stored distance units.

    Linear units are ``reach / 255``. Logarithmic ones, for databases with landmarks, grow with the
    distance: unit `u` is ``10 m * (exp(u b) - 1)``, and the last is `reach`.

    Parameters
    ----------
    reach : float
        Metres of the last unit.
    logarithmic : bool, default False
        Whether the units grow with the distance.

    Examples
    --------
    >>> DistanceScale(51.0).units(np.array([0.0, 10.0, 51.0])).tolist()
    [0, 50, 255]
    >>> far = DistanceScale(2000.0, logarithmic=True)
    >>> far.units(np.array([0.0, 10.0, 2000.0])).tolist()
    [0, 33, 255]
    >>> far.metres[[1, 254, 255]].round(2).tolist()
    [0.21, 1958.63, 2000.0]
    """

    reach: float
    logarithmic: bool = False

    @classmethod
    def of(cls, taxonomy: Taxonomy, radius: float) -> DistanceScale:
        """Return the scale of a database: logarithmic if a class is tall.

        `radius` is the visibility range in metres of classes without their own.
        """
        tall = any(item.tall for item in taxonomy.classes)
        return cls(float(taxonomy.ranges(radius).max()), logarithmic=tall)

    @property
    def _growth(self) -> float:
        return math.log1p(self.reach / LOG_SCALE_M) / DISTANCE_UNITS

    @property
    def unit(self) -> float:
        """Metres of the first unit."""
        if self.logarithmic:
            return LOG_SCALE_M * math.expm1(self._growth)
        return self.reach / DISTANCE_UNITS

    @cached_property
    def steps(self) -> NDArray[np.float64]:
        """Every unit in multiples of the first, shape (256,)."""
        units = np.arange(DISTANCE_UNITS + 1, dtype=np.float64)
        if self.logarithmic:
            return np.asarray(np.expm1(units * self._growth) / math.expm1(self._growth))
        return units

    @cached_property
    def metres(self) -> NDArray[np.float64]:
        """Metres of every unit, shape (256,)."""
        return self.steps * np.float64(self.unit)

    @cached_property
    def positive_metres(self) -> NDArray[np.float64]:
        """Metres of every unit, shape (256,), with half of the first instead of 0."""
        return np.asarray(np.maximum(self.steps, 0.5) * self.unit)

    def units(self, distances: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return distances in metres rounded to units, at most 255."""
        if self.logarithmic:
            units = np.rint(np.log1p(distances / LOG_SCALE_M) / self._growth)
        else:
            units = np.rint(distances * (DISTANCE_UNITS / self.reach))
        return np.minimum(units, DISTANCE_UNITS).astype(np.uint8)

    def rounding(self, distances: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return half a unit in metres, the largest rounding error, at some distances."""
        if self.logarithmic:
            return np.asarray((distances + LOG_SCALE_M) * math.expm1(self._growth / 2.0))
        return np.full(np.shape(distances), self.reach / DISTANCE_UNITS / 2.0)


def wrapped_bearings(bearings: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return bearings from -360 to 360 degrees wrapped to [0, 360); InputError for others."""
    try:
        angles = np.asarray(bearings, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"bearings {bearings!r} are not all numbers; give degrees clockwise from north."
        ) from error
    wrong = angles[~(np.abs(angles) <= FULL_TURN)]  # NaN too
    if len(wrong):
        raise InputError(
            f"bearing {wrong[0]:g} is not usable; give degrees clockwise from north, 0 to 360."
        )
    return wrap_degrees(angles)


def _listed(numbers: NDArray[Any] | None) -> str:
    return "unknown" if numbers is None else " ".join(f"{number:g}" for number in numbers.tolist())


@dataclass(frozen=True, eq=False, repr=False)
class Signature(Displayed):
    """The signature of a cell or of a query.

    Parameters
    ----------
    codes : ndarray of uint8, shape (n,), or None
        Class codes, clockwise from north; None where the types are unknown.
    bearings : ndarray of float64, shape (n,), or None
        Degrees clockwise from north in [0, 360); None where the bearings are unknown.

    Raises
    ------
    InputError
        If neither is given, their lengths differ, or a bearing is out of range.

    Examples
    --------
    >>> len(Signature(np.array([3, 3], np.uint8), None))
    2
    """

    codes: NDArray[np.uint8] | None
    bearings: NDArray[np.float64] | None

    def __post_init__(self) -> None:  # noqa: D105
        if self.codes is None and self.bearings is None:
            raise InputError(
                "a signature needs types, bearings or both; give at least one of them."
            )
        if self.codes is not None:
            object.__setattr__(self, "codes", np.asarray(self.codes, dtype=np.uint8))
        if self.bearings is not None:
            bearings = np.asarray(self.bearings, dtype=np.float64)
            # A bearing out of range would get a wrong angle level without an error.
            wrong = bearings[~((bearings >= 0.0) & (bearings < FULL_TURN))]
            if len(wrong):
                raise InputError(
                    f"bearing {wrong[0]:g} is not in [0, 360); wrap bearings onto one turn first."
                )
            object.__setattr__(self, "bearings", bearings)
        parts = [part for part in (self.codes, self.bearings) if part is not None]
        if any(part.ndim != 1 for part in parts):
            raise InputError(
                "a signature is one row of types and one of bearings; give lists of one dimension."
            )
        if len(set(map(len, parts))) > 1:
            raise InputError(
                f"{len(parts[0])} types and {len(parts[1])} bearings were given; "
                "give one bearing for each type, or leave one of the two out."
            )

    def _facts(self) -> dict[str, object]:
        return {
            "objects": len(self),
            "codes": _listed(self.codes),
            "bearings": _listed(self.bearings),
        }

    def __len__(self) -> int:  # noqa: D105
        part = self.codes if self.codes is not None else self.bearings
        return 0 if part is None else len(part)

    def to_dict(self, taxonomy: Taxonomy) -> SignatureRecord:
        """Return ``types`` (symbols), ``bearings`` (degrees) and ``length`` for JSON.

        Unknown types or bearings are None.
        """
        return {
            "types": None if self.codes is None else taxonomy.decode(self.codes),
            "bearings": None if self.bearings is None else self.bearings.tolist(),
            "length": len(self),
        }

    def among(self, codes: ArrayLike) -> NDArray[np.bool_]:
        """Return a mask of the objects of these classes or of unknown class, shape (n,)."""
        if self.codes is None:
            return np.ones(len(self), np.bool_)
        return np.asarray(np.isin(self.codes, codes) | (self.codes == WILDCARD))

    def select(self, objects: NDArray[np.bool_ | np.int64]) -> Signature:
        """Return the signature of some of the objects, by indices or a mask."""
        return Signature(
            None if self.codes is None else self.codes[objects],
            None if self.bearings is None else self.bearings[objects],
        )

    def turned(self, degrees: float) -> Signature:
        """Return the signature with `degrees` added to all bearings, sorted by bearing."""
        if self.bearings is None:
            return self
        bearings = wrap_degrees(self.bearings + degrees)
        order = np.argsort(bearings, kind="stable")
        return Signature(None if self.codes is None else self.codes[order], bearings[order])

    def levels(self, levels: int) -> NDArray[np.uint8]:
        """Return the angle level of each bearing, shape (n,); InputError if they are unknown."""
        if self.bearings is None:
            raise InputError("the query has no bearings; give them, or use a method on types.")
        return quantize(self.bearings, levels)

    @classmethod
    def parse(
        cls,
        types: str | None,
        bearings: Sequence[float] | NDArray[np.float64] | None = None,
        *,
        taxonomy: Taxonomy,
    ) -> Signature:
        """Return a query, sorted clockwise from north, from symbols and bearings.

        `types` are symbols such as ``"DDBL"``, clockwise if no bearings are given; `bearings` are
        degrees clockwise from north, -360 to 360, one for each type in any order. Both are empty
        if nothing was seen. UnknownNameError if a symbol belongs to no class; InputError if
        neither is given, the lengths differ, or a bearing is not a number or out of range.

        >>> query = Signature.parse("DB", [200, -10], taxonomy=demo_database.taxonomy)
        >>> query.codes.tolist(), query.bearings.tolist()
        ([3, 1], [200.0, 350.0])
        """
        codes = None if types is None else taxonomy.encode(types)
        if bearings is None:
            return cls(codes, None)
        return cls(codes, wrapped_bearings(bearings)).turned(0.0)
