"""Distortions of queries: the paper's errors, weak detectors, narrow views and obstacles.

Two of them add observations instead: rough distances and class scores.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from bisect import bisect_right
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar, Literal, TypeVar, get_args

import numpy as np

from semsig_gis.core import (
    FULL_TURN,
    MAX_RANGE_M,
    InputError,
    Signature,
    UnknownNameError,
    angular_distance,
    nearest_name,
    require_number,
    wrap_degrees,
)
from semsig_gis.database import bearings
from semsig_gis.evaluation.queries.true_view import NEAREST_M
from semsig_gis.localization import LONGEST_TABLE, noise_tables
from semsig_gis.observation import CLASSES, Photo

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.evaluation.queries.true_view import CitySights, DistortFunction, Sight
    from semsig_gis.localization import Noise, NoiseTable


MOST_WIDTH_M = 1000
MOST_FALSE = 1000  # objects
MOST_PERCENT = 300
LEAST_RIGHT, MOST_RIGHT = 0.51, 0.999


class _AnyCity(ABC):
    """A distortion that does not depend on the city."""

    __slots__ = ()

    def prepare(self, city: CitySights) -> DistortFunction:  # noqa: ARG002 - other distortions need it
        """Return the function that distorts a query."""
        return self._apply

    @abstractmethod
    def _apply(self, sight: Sight, rng: np.random.Generator) -> Sight: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class CompassBias(_AnyCity):
    """A compass that is off by the same angle for all objects of a query.

    The angle is normal, with a standard deviation of `sigma` degrees, 0 to 360.
    """

    stream: ClassVar[int] = 3_628_719_812

    sigma: float = 10.0

    def __post_init__(self) -> None:  # noqa: D105
        require_number("deviation of the compass", self.sigma, least=0, most=FULL_TURN)

    def _apply(self, sight: Sight, rng: np.random.Generator) -> Sight:
        return sight.turned(float(rng.normal(0.0, abs(self.sigma))))  # -0.0 is 0, too


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingClasses:
    """A detector that does not detect some classes of the city.

    With `others`, it detects only the given classes.
    """

    stream: ClassVar[int] = 2_848_656_676

    classes: tuple[str, ...] = ()
    others: bool = False

    def prepare(self, city: CitySights) -> DistortFunction:
        """Return the function that distorts a query.

        Raises UnknownNameError if a class is not in the taxonomy of the city.
        """
        codes = [city.taxonomy.by_name(name).code for name in self.classes]

        def apply(sight: Sight, rng: np.random.Generator) -> Sight:  # noqa: ARG001
            return sight.only(np.isin(sight.codes, codes, invert=not self.others))

        return apply


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldOfView(_AnyCity):
    """A camera that looks in one random direction and sees part of the full turn.

    It sees `degrees`, above 0 and at most 360. Bearings are still from north. If `told`, the query
    states its view; otherwise objects outside the view count as missed.
    """

    stream: ClassVar[int] = 20_362_731

    degrees: float = 90.0
    told: bool = True

    def __post_init__(self) -> None:  # noqa: D105
        if not 0 < self.degrees <= FULL_TURN:
            raise InputError(
                f"a view of {self.degrees!r} degrees was given; give degrees above 0, at most 360."
            )

    def _apply(self, sight: Sight, rng: np.random.Generator) -> Sight:
        middle = rng.uniform(0.0, FULL_TURN)
        visible = sight.only(angular_distance(sight.bearings, middle) <= self.degrees / 2.0)
        if not self.told:
            return visible
        return replace(visible, photo=_common_view(sight.photo, middle, self.degrees))


def _common_view(photo: Photo, heading: float, fov: float) -> Photo:
    """Return the intersection of a photo and a view; the view if they do not overlap."""
    other = Photo.looking(heading=heading, fov=fov)
    if not (photo.sectors and other.sectors):
        return Photo(sectors=photo.sectors or other.sectors)
    # Sectors may cross north, so each pair is compared one turn apart as well.
    overlaps = [
        (max(low, start + turn), min(high, end + turn))
        for low, high in photo.sectors
        for start, end in other.sectors
        for turn in (-FULL_TURN, 0.0, FULL_TURN)
    ]
    return Photo(
        sectors=tuple((low, high) for low, high in overlaps if low < high) or other.sectors
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class HiddenBehind(_AnyCity):
    """Occlusion of objects by nearer objects.

    An object is hidden if a nearer one covers its bearing. An object of `width` w metres (0 to
    1,000) at distance d covers ``atan(w / 2 d)`` on each side.
    """

    stream: ClassVar[int] = 3_881_164_136

    width: float = 0.5

    def __post_init__(self) -> None:  # noqa: D105
        require_number("width of the objects", self.width, least=0, most=MOST_WIDTH_M)

    def _apply(self, sight: Sight, rng: np.random.Generator) -> Sight:  # noqa: ARG002
        return sight.only(~_behind(sight, sight.bearings, sight.distances, self.width))


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacles:
    """Unmapped obstacles, such as parked vans, that hide the objects behind them.

    Their number around a place is Poisson distributed with mean `count`; each is `width` metres
    wide, at a random place within the range of sight. Both are from 0 to 1,000.
    """

    stream: ClassVar[int] = 626_356_719

    count: float = 2.0
    width: float = 4.0

    def __post_init__(self) -> None:  # noqa: D105
        require_number("number of obstacles", self.count, least=0, most=MOST_FALSE)
        require_number("width of the obstacles", self.width, least=0, most=MOST_WIDTH_M)

    def prepare(self, city: CitySights) -> DistortFunction:
        """Return the function that distorts a query."""

        def apply(sight: Sight, rng: np.random.Generator) -> Sight:
            count = int(rng.poisson(self.count))
            bearings = rng.uniform(0.0, FULL_TURN, count)
            distances = city.false_distances(count, rng)
            return sight.only(~_behind(sight, bearings, distances, self.width))

        return apply


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockedSectors(_AnyCity):
    """Sectors of the view in which nothing is seen.

    There are `count` sectors (0 or more) of `degrees` (0 to 360) in random directions; they may
    overlap.
    """

    stream: ClassVar[int] = 4_207_042_345

    count: int = 1
    degrees: float = 30.0

    def __post_init__(self) -> None:  # noqa: D105
        if self.count < 0 or not 0 <= self.degrees <= FULL_TURN:
            raise InputError(
                f"{self.count} sectors of {self.degrees!r} degrees were given; give a whole number "
                "from 0 up and degrees from 0 to 360."
            )

    def _apply(self, sight: Sight, rng: np.random.Generator) -> Sight:
        middles = rng.uniform(0.0, FULL_TURN, self.count)
        deviations = angular_distance(sight.bearings[:, None], middles)
        return sight.only((deviations > self.degrees / 2.0).all(axis=1))


def _behind(
    sight: Sight, bearings: NDArray[np.float64], distances: NDArray[np.float64], width: float
) -> NDArray[np.bool_]:
    """Return which objects are hidden behind obstacles of the same width."""
    half = np.degrees(np.arctan2(width / 2.0, np.maximum(distances, NEAREST_M)))
    farther = sight.distances[:, None] > distances
    return np.asarray(
        (farther & (angular_distance(sight.bearings[:, None], bearings) < half)).any(axis=1)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedDetector:
    """A detector with the errors of a noise model.

    An object at distance d metres is detected with probability ``p * 2 ** -((d / half) ** 2)``,
    where p is that of the model: at `half` metres (above 0) half of the objects are detected. The
    ``position_sigma`` of the model moves the observer. From a mixture, one model is drawn for each
    query. As in `localization.noise.table`, no probability is exactly 0 or 1.
    """

    stream: ClassVar[int] = 4_129_241_295

    noise: Noise
    half: float = math.inf

    def __post_init__(self) -> None:  # noqa: D105
        if not self.half >= NEAREST_M:
            raise InputError(
                f"the setting half is {self.half!r} m; give the metres at which a detector sees "
                f"half of the objects, from {NEAREST_M}, or infinity if distance does not matter."
            )

    def prepare(self, city: CitySights) -> DistortFunction:
        """Return the function that distorts a query.

        Raises InputError if the noise model has a class that is not in the taxonomy of the city.
        """
        tables, weights = noise_tables(
            self.noise,
            taxonomy=city.taxonomy,
            codes=city.codes,
            longest=LONGEST_TABLE,
            radius=city.reach,
        )

        def apply(sight: Sight, rng: np.random.Generator) -> Sight:
            table = tables[int(rng.choice(len(tables), p=weights))]
            if table.position_sigma:
                sight = _moved_sight(sight, *rng.normal(0.0, table.position_sigma, 2))
            detections = self._detected(sight, table, rng)
            codes = np.repeat(table.codes, rng.poisson(table.clutter))
            false = rng.uniform(0.0, FULL_TURN, len(codes))
            distances = city.false_distances(len(codes), rng)
            return detections.with_false(codes, false, distances).clockwise()

        return apply

    def _detected(self, sight: Sight, table: NoiseTable, rng: np.random.Generator) -> Sight:
        """Return the detected objects with their reported classes and bearings."""
        length = min(len(sight), len(table.missed) - 1)
        # Detection: by class, by fading with distance and by `half`.
        chances = 1.0 - table.missed[length, table.row_of[sight.codes]]
        kinds = table.row_of[sight.codes]
        chances *= table.fading[kinds, table.scale.units(sight.distances)]
        chances *= np.exp2(-((sight.distances / self.half) ** 2))
        detections = sight.only(rng.random(len(sight)) < chances)
        # Classification: a random row of the cumulative confusion matrix.
        kinds = table.row_of[detections.codes]
        names = np.cumsum(table.named(length)[kinds], axis=1)
        labels = (rng.random(len(detections))[:, None] * names[:, -1:] >= names).sum(axis=1)
        noise = rng.normal(0.0, table.sigma[kinds])
        if detections.extents is not None:
            noise += rng.uniform(-0.5, 0.5, len(kinds)) * detections.extents
        return replace(
            detections.renamed(table.codes[labels]),
            bearings=wrap_degrees(detections.bearings + noise),
        )


def _moved_sight(sight: Sight, dx: float, dy: float) -> Sight:
    """Return the same objects seen from dx metres east and dy metres north."""
    directions = np.radians(sight.bearings)
    x = sight.distances * np.sin(directions) - dx
    y = sight.distances * np.cos(directions) - dy
    return replace(sight, bearings=bearings(x, y), distances=np.hypot(x, y))


@dataclass(frozen=True, slots=True, kw_only=True)
class RoughRanges(_AnyCity):
    """Rough distances of the objects, from a depth network or a person's estimate.

    The logarithm of a distance has a normal error of `percent` hundredths (0.1 to 300), which the
    query states. A false object is uniformly distributed within the range of sight.
    """

    stream: ClassVar[int] = 2_716_057_031

    percent: float = 25.0

    def __post_init__(self) -> None:  # noqa: D105
        require_number("error of the ranges", self.percent, least=0.1, most=MOST_PERCENT, unit="%")

    def _apply(self, sight: Sight, rng: np.random.Generator) -> Sight:
        error = self.percent / 100.0
        factors = np.exp(rng.normal(0.0, error, len(sight)))
        if sight.false is not None:
            factors[sight.false] = 1.0
        ranges = np.clip(sight.distances * factors, NEAREST_M, MAX_RANGE_M)
        return replace(sight, ranges=ranges, range_error=error)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassScores:
    """A detector that gives each object a score for every class of the city, not one class.

    The scores are calibrated: the probability of certain scores is proportional to the score of the
    true class in them. The mean score of the true class is `right` (0.51 to 0.999). Methods that
    use only one class take the one with the best score.
    """

    stream: ClassVar[int] = 1_530_938_417

    right: float = 0.8

    def __post_init__(self) -> None:  # noqa: D105
        require_number("mean score", self.right, least=LEAST_RIGHT, most=MOST_RIGHT)

    def prepare(self, city: CitySights) -> DistortFunction:
        """Return the function that distorts a query."""
        count = len(city.codes)
        # Drawing scores from a symmetric Dirichlet distribution and then a class from the scores is
        # the same as drawing the class first and then the scores from the Dirichlet distribution
        # in which the parameter of that class is one higher.
        spread = (1.0 - self.right) / (self.right * count - 1.0) if count > 1 else 1.0

        def apply(sight: Sight, rng: np.random.Generator) -> Sight:
            own = np.searchsorted(city.codes, sight.codes)
            gammas = rng.standard_gamma(spread + np.eye(count)[own])
            scores = np.zeros((len(sight), CLASSES))
            scores[:, city.codes] = gammas / gammas.sum(axis=1, keepdims=True)
            return replace(sight, codes=scores.argmax(axis=1).astype(np.uint8), scores=scores)

        return apply


FalseClass = Literal["uniform", "frequency"]
D = TypeVar("D")

_OPERATIONS = 3
_MISS, _FALSE_DETECTION = 0, 1  # and 2, a false classification


@dataclass(frozen=True, slots=True, kw_only=True)
class Distortion:
    """The paper's distortion: missed, false and misclassified objects, and bearing noise.

    Parameters
    ----------
    occurrences : int, default 7
        Number of errors: each misses, adds or misclassifies an object; 0 or more.
    bearing_sigma : float, default 5.0
        Standard deviation of the noise on each bearing, in degrees; 0 or more.
    bearing_clip : float, default 30.0
        Largest absolute value of that noise, in degrees; 0 or more.
    resort : bool, default True
        Whether the objects are sorted clockwise again after the noise, as a sweep would see them.
        The paper (section 4.2) does not say this, nor how false classes are drawn.
    false_class : {"uniform", "frequency"}, default "uniform"
        Whether the class of a false object is drawn with equal probabilities or by the frequency of
        each class in the database.

    Raises
    ------
    InputError
        If a number is out of its range.
    UnknownNameError
        If `false_class` is not one of the two.

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
        require_number("occurrences of distortion", self.occurrences, least=0, most=MOST_FALSE)
        for label, value in (("sigma", self.bearing_sigma), ("clip", self.bearing_clip)):
            require_number(f"bearing {label}", value, least=0, most=FULL_TURN, unit="degrees")
        if self.false_class not in get_args(FalseClass):
            hint = nearest_name(str(self.false_class), get_args(FalseClass))
            raise UnknownNameError(
                f"{self.false_class!r} is not a way to choose a false class{hint}; give "
                f"{' or '.join(get_args(FalseClass))}."
            )

    def prepare(self, city: CitySights) -> DistortFunction:
        """Return the function that distorts a query; false objects have classes of the city."""
        chances = _class_chances(self, city.codes, city.frequencies)

        def apply(sight: Sight, rng: np.random.Generator) -> Sight:
            codes, bearings, rows = _distorted(sight.signature, self, (city.codes, chances), rng)
            real = rows >= 0
            detections = sight.only(rows[real]).renamed(codes[real])
            detections = replace(detections, bearings=bearings[real])
            distances = city.false_distances(int((~real).sum()), rng)
            detections = detections.with_false(codes[~real], bearings[~real], distances)
            # The false objects are at the end; bring them back into the distorted order.
            return detections.only(np.argsort(np.argsort(~real, kind="stable")))

        return apply


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
    """Return a distortion by name; raise UnknownNameError if there is none."""
    if name not in distortions:
        *most, last = distortions
        hint = nearest_name(name, distortions)
        raise UnknownNameError(
            f"{name!r} is not a distortion{hint}; give {', '.join(most)} or {last}."
        )
    return distortions[name]


def distort(
    signature: Signature,
    distortion: Distortion,
    *,
    classes: ArrayLike,
    weights: ArrayLike | None = None,
    rng: np.random.Generator,
) -> Signature:
    """Return a signature with the errors of a faulty detector.

    Parameters
    ----------
    signature : Signature
        Types and bearings, in clockwise order.
    distortion : Distortion
        The distortion.
    classes : array_like of int, shape (k,)
        Distinct class codes that a false object may have; at least one.
    weights : array_like of float, shape (k,), optional
        Frequency of each class, not all zero; only for the false class ``"frequency"``.
    rng : numpy.random.Generator
        Source of random numbers.

    Returns
    -------
    Signature
        The distorted signature, possibly empty, with bearings in [0, 360).

    Raises
    ------
    InputError
        If the signature lacks its types or its bearings, or the classes or weights are not valid.

    Notes
    -----
    Paper, section 4.2. A false object is inserted in the order of the bearings, before the noise. A
    miss or a false classification without an object, and a false classification without another
    class, change nothing but count as an occurrence.

    Examples
    --------
    >>> signature = Signature(codes=np.array([1, 3], np.uint8), bearings=np.array([10.0, 200.0]))
    >>> rng = np.random.default_rng(0)
    >>> same = distort(signature, named_distortion("none"), classes=[1, 3], rng=rng)
    >>> same.codes.tolist(), same.bearings.tolist()
    ([1, 3], [10.0, 200.0])
    """
    false = np.asarray(classes, dtype=np.uint8)
    chances = _class_chances(distortion, false, weights)
    codes, bearings, _ = _distorted(signature, distortion, (false, chances), rng)
    return Signature(codes=codes, bearings=bearings)


def _distorted(
    signature: Signature,
    distortion: Distortion,
    false_classes: tuple[NDArray[np.uint8], NDArray[np.float64]],
    rng: np.random.Generator,
) -> tuple[NDArray[np.uint8], NDArray[np.float64], NDArray[np.int64]]:
    """Return the distorted codes and bearings, and the original row of each object or -1."""
    if signature.codes is None or signature.bearings is None:
        raise InputError(
            "a signature without types or without bearings was given; give one with both."
        )
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
    noisy = wrap_degrees(np.asarray(bearings, dtype=np.float64) + np.clip(noise, -limit, limit))
    # A stable sort, so that objects of equal bearing stay in their order.
    order = np.argsort(noisy, kind="stable") if distortion.resort else np.arange(len(noisy))
    return np.array(codes, np.uint8)[order], noisy[order], np.array(rows, np.int64)[order]


def _class_chances(
    distortion: Distortion, classes: NDArray[np.uint8], weights: ArrayLike | None
) -> NDArray[np.float64]:
    """Return the probability of each class of a false object."""
    if classes.ndim != 1 or classes.size == 0 or len(np.unique(classes)) != classes.size:
        raise InputError(
            "the classes of false objects are not a list of distinct codes; give at least one."
        )
    if distortion.false_class == "uniform":
        return np.full(classes.size, 1.0 / classes.size)
    if weights is None:
        raise InputError("false classes by frequency need weights; give one for each class.")
    values = np.asarray(weights, dtype=np.float64)
    if values.shape != classes.shape or not np.isfinite(values).all() or (values < 0).any():
        raise InputError(
            f"{values.size} weights for {classes.size} classes were given; "
            "give one for each class, 0 or more."
        )
    if not values.any():
        raise InputError(
            "class weights that are all zero were given; give at least one above zero."
        )
    return np.asarray(values / values.sum())


def _other_class(
    code: int,
    classes: NDArray[np.uint8],
    chances: NDArray[np.float64],
    rng: np.random.Generator,
) -> int:
    """Draw another class than `code`; `code` itself if there is no other."""
    others = np.where(classes == code, 0.0, chances)
    total = others.sum()
    return int(rng.choice(classes, p=others / total)) if total > 0 else code
