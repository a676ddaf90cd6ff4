"""Spoil a signature as the paper does (section 4.2): objects missed, invented, misnamed, misplaced.

A distortion is a number of occurrences, each a miss, a false detection or a false classification
with equal chance, followed by noise on every bearing.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar, Literal, TypeVar, get_args

import numpy as np

from semsig_gis.core.errors import InputError, UnknownNameError, nearest_name
from semsig_gis.core.geometry import wrap_degrees
from semsig_gis.core.signature import Signature

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.queries.sight import CitySights, Sight, Spoiling

FalseClass = Literal["uniform", "frequency"]
D = TypeVar("D")

_OPERATIONS = 3
_MISS, _FALSE_DETECTION = 0, 1  # and 2, a false classification


@dataclass(frozen=True, slots=True, kw_only=True)
class Distortion:
    """What happens to a signature between the street and the query.

    Parameters
    ----------
    occurrences : int, default 7
        How many times an object is missed, invented or misnamed; 0 or more.
    bearing_sigma : float, default 5.0
        Standard deviation of the noise on each bearing, in degrees; 0 or more.
    bearing_clip : float, default 30.0
        Largest absolute value of that noise, in degrees; 0 or more.
    resort : bool, default True
        Whether the objects are put in clockwise order again after the noise, as a sweep would
        see them. Otherwise they keep the order they had before it.
    false_class : {"uniform", "frequency"}, default "uniform"
        Whether the class of a false object is drawn with equal chances or by how often each
        class is seen in the database.

    Raises
    ------
    InputError
        If a number is out of its range.
    UnknownNameError
        If `false_class` is not one of the two.

    Notes
    -----
    The source (section 4.2) leaves `resort` and `false_class` open.

    Examples
    --------
    >>> Distortion(occurrences=2).bearing_clip
    30.0
    """

    stream: ClassVar[int] = 795_306_091

    occurrences: int = 7
    bearing_sigma: float = 5.0
    bearing_clip: float = 30.0
    resort: bool = True
    false_class: FalseClass = "uniform"

    def __post_init__(self) -> None:  # noqa: D105
        if self.occurrences < 0:
            msg = f"{self.occurrences} occurrences of distortion were given; give 0 or more."
            raise InputError(msg)
        for label, value in (("sigma", self.bearing_sigma), ("clip", self.bearing_clip)):
            if not math.isfinite(value) or value < 0:
                msg = f"a bearing {label} of {value!r} was given; give degrees, 0 or more."
                raise InputError(msg)
        if self.false_class not in get_args(FalseClass):
            hint = nearest_name(str(self.false_class), get_args(FalseClass))
            msg = (
                f"{self.false_class!r} is no way to draw a false class{hint}; give "
                f"{' or '.join(get_args(FalseClass))}."
            )
            raise UnknownNameError(msg)

    def ready(self, city: CitySights) -> Spoiling:
        """Return what it does to a query of a city, whose classes false objects have."""
        chances = _class_chances(self, city.codes, city.frequencies)

        def spoil(sight: Sight, rng: np.random.Generator) -> Sight:
            codes, bearings, rows = _spoiled(sight.signature, self, (city.codes, chances), rng)
            distances = np.empty(len(rows))
            real = rows >= 0
            distances[real] = sight.distances[rows[real]]
            distances[~real] = city.false_distances(int((~real).sum()), rng)
            return replace(sight, codes=codes, bearings=bearings, distances=distances)

        return spoil


DISTORTIONS: Mapping[str, Distortion] = MappingProxyType(
    {
        "none": Distortion(occurrences=0, bearing_sigma=0.0),
        "light": Distortion(occurrences=1),
        "medium": Distortion(occurrences=7),
        "strong": Distortion(occurrences=13),
    }
)


def named_distortion(name: str) -> Distortion:
    """Return one of the paper's levels of distortion.

    Parameters
    ----------
    name : {"none", "light", "medium", "strong"}
        Its name.

    Returns
    -------
    Distortion
        0, 1, 7 or 13 occurrences; all but ``"none"`` with bearing noise.

    Raises
    ------
    UnknownNameError
        If there is no such level.

    Examples
    --------
    >>> named_distortion("strong").occurrences
    13
    """
    return distortion_of(name, DISTORTIONS)


def distortion_of(name: str, distortions: Mapping[str, D]) -> D:
    """Return a distortion by name; raises UnknownNameError if there is none."""
    if name not in distortions:
        *most, last = distortions
        hint = nearest_name(name, distortions)
        msg = f"{name!r} is no distortion{hint}; give {', '.join(most)} or {last}."
        raise UnknownNameError(msg)
    return distortions[name]


def distort(
    signature: Signature,
    distortion: Distortion,
    *,
    classes: ArrayLike,
    weights: ArrayLike | None = None,
    rng: np.random.Generator,
) -> Signature:
    """Return a signature as a faulty detector would have given it.

    Parameters
    ----------
    signature : Signature
        Types and bearings, in clockwise order.
    distortion : Distortion
        What to do to it.
    classes : array_like of int, shape (k,)
        Distinct class codes that a false object may have; at least one.
    weights : array_like of float, shape (k,), optional
        How often each class is seen, not all zero. Needed for, and used by, the false class
        ``"frequency"`` only.
    rng : numpy.random.Generator
        Source of the chances.

    Returns
    -------
    Signature
        The distorted signature, possibly empty, with bearings in [0, 360).

    Raises
    ------
    InputError
        If the signature lacks its types or its bearings, or the classes or weights do not serve.

    Notes
    -----
    Paper, section 4.2. A false object is placed where its bearing belongs before the noise. A
    miss or a false classification that finds no object, and a false classification that finds
    no other class, change nothing but count as an occurrence.

    Examples
    --------
    >>> seen = Signature(codes=np.array([1, 3], np.uint8), bearings=np.array([10.0, 200.0]))
    >>> rng = np.random.default_rng(0)
    >>> same = distort(seen, named_distortion("none"), classes=[1, 3], rng=rng)
    >>> same.codes.tolist(), same.bearings.tolist()
    ([1, 3], [10.0, 200.0])
    """
    false = np.asarray(classes, dtype=np.uint8)
    chances = _class_chances(distortion, false, weights)
    codes, bearings, _ = _spoiled(signature, distortion, (false, chances), rng)
    return Signature(codes=codes, bearings=bearings)


def _spoiled(
    signature: Signature,
    distortion: Distortion,
    false_classes: tuple[NDArray[np.uint8], NDArray[np.float64]],
    rng: np.random.Generator,
) -> tuple[NDArray[np.uint8], NDArray[np.float64], NDArray[np.int64]]:
    """Return codes, bearings, and which object each was; -1 for a false one."""
    if signature.codes is None or signature.bearings is None:
        msg = "a signature without types or without bearings was given; give one with both."
        raise InputError(msg)
    codes: list[int] = signature.codes.tolist()
    bearings: list[float] = signature.bearings.tolist()
    rows = list(range(len(codes)))
    for _ in range(distortion.occurrences):
        operation = int(rng.integers(_OPERATIONS))
        if operation == _FALSE_DETECTION:
            bearing = float(rng.uniform(0.0, 360.0))
            place = bisect_right(bearings, bearing)
            bearings.insert(place, bearing)
            codes.insert(place, int(rng.choice(false_classes[0], p=false_classes[1])))
            rows.insert(place, -1)
        elif codes:
            place = int(rng.integers(len(codes)))
            if operation == _MISS:
                del codes[place], bearings[place], rows[place]
            else:
                codes[place] = _other_class(codes[place], *false_classes, rng)
    noise = rng.normal(0.0, distortion.bearing_sigma, len(bearings))
    limit = distortion.bearing_clip
    seen = wrap_degrees(np.asarray(bearings, dtype=np.float64) + np.clip(noise, -limit, limit))
    # A stable sort, so that objects on one bearing stay in the order they were in.
    order = np.argsort(seen, kind="stable") if distortion.resort else np.arange(len(seen))
    return np.array(codes, np.uint8)[order], seen[order], np.array(rows, np.int64)[order]


def _class_chances(
    distortion: Distortion, classes: NDArray[np.uint8], weights: ArrayLike | None
) -> NDArray[np.float64]:
    """Return the chance of each class for a false object."""
    if classes.ndim != 1 or classes.size == 0 or len(np.unique(classes)) != classes.size:
        msg = "the classes of false objects are not a list of distinct codes; give at least one."
        raise InputError(msg)
    if distortion.false_class == "uniform":
        return np.full(classes.size, 1.0 / classes.size)
    if weights is None:
        msg = "false classes by frequency need weights; give one a class."
        raise InputError(msg)
    values = np.asarray(weights, dtype=np.float64)
    if values.shape != classes.shape or not np.isfinite(values).all() or (values < 0).any():
        msg = (
            f"{values.size} weights for {classes.size} classes were given; "
            "give one a class, 0 or more."
        )
        raise InputError(msg)
    if not values.any():
        msg = "class weights that are all zero were given; give at least one above zero."
        raise InputError(msg)
    return np.asarray(values / values.sum())


def _other_class(
    code: int,
    classes: NDArray[np.uint8],
    chances: NDArray[np.float64],
    rng: np.random.Generator,
) -> int:
    """Return another class than `code`, or `code` itself when there is no other."""
    others = np.where(classes == code, 0.0, chances)
    total = others.sum()
    return int(rng.choice(classes, p=others / total)) if total > 0 else code
