"""A noise model as arrays, for the classes and signature lengths of one database."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from semsig_gis.core import DISTANCE_UNITS, WILDCARD, DistanceScale, InputError, Taxonomy
from semsig_gis.localization.noise.families import noise_by_class
from semsig_gis.localization.noise.model import ALL, BY_CLASS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization.noise.model import Noise, NoiseSpec

# No chance is exactly 0 or 1: a model that excludes an event is wrong one day, and then it excludes
# the true place.
LEAST_MISSED = 1e-3
MOST_MISSED = 0.95
LEAST_CLUTTER = 1e-3
FULL_TURN = 360.0
WIDEST_SIGMA = 180.0
FAMILY_SHARE = 0.7  # of the misnamed objects, that are given another class of their family
LONGEST_TABLE = 400  # longest signature with its own chances; longer ones use the same


@dataclass(frozen=True, repr=False, kw_only=True)
class DividedTaxonomy(Taxonomy):
    """The classes of a `whole` taxonomy, some of them divided by what is written on their objects.

    `parents` are the codes of the classes that parts of them have been taken from, by the code of
    the part. The code `rest` is that of false objects only: the detections that no text fits.
    """

    whole: Taxonomy
    parents: Mapping[int, int]
    rest: int

    def whole_code(self, code: int) -> int:
        """Return the code of the class of an object or a part of a class."""
        return self.parents.get(code, code)


@dataclass(frozen=True, eq=False, kw_only=True)
class NoiseTable:
    """One noise model for k classes and for signatures of every length up to a longest.

    By length and class, shape (longest + 1, k), `missed` is the chance that an object is missed and
    `misnamed` that a detected object is given another class. `others`, shape (k, k), are the
    shares of these: rows sum to one, the diagonal is zero. `clutter` is the number of false objects
    per signature by class, `sigma` the standard deviation of a bearing in degrees by class,
    `range_sigma` that of the logarithm of a rough distance, and `position_sigma` that of the place
    of the observer in metres. `ranges` are the visibility ranges of the classes in metres, and
    `fading`, shape (k, 256), the remaining share of detection by distance unit of `scale`.
    """

    codes: NDArray[np.uint8]
    missed: NDArray[np.float64]
    misnamed: NDArray[np.float64]
    others: NDArray[np.float64]
    clutter: NDArray[np.float64]
    sigma: NDArray[np.float64]
    range_sigma: NDArray[np.float64]
    position_sigma: float
    ranges: NDArray[np.float64]
    fading: NDArray[np.float64]
    scale: DistanceScale

    @property
    def distances(self) -> NDArray[np.float64]:
        """Metres of each distance unit, shape (256,); the nearest is above 0."""
        return self.scale.positive_metres

    @cached_property
    def inside(self) -> NDArray[np.float64]:
        """Chance that an object in range of the place is in range of the observer, shape (k, 256).

        At the edge of range, an observer off the centre of a cell sees other objects.
        """
        if self.position_sigma == 0:
            return np.ones((len(self.codes), DISTANCE_UNITS + 1))
        ranges, row_of = np.unique(self.ranges, return_inverse=True)  # most classes have the same
        distances = np.broadcast_to(self.distances, (len(ranges), len(self.distances)))
        if self.scale.logarithmic:
            # Units are wide far away: the mean distance of the objects in them that are in range.
            half = self.scale.rounding(distances)
            nearest, farthest = distances - half, np.minimum(distances + half, ranges[:, None])
            distances = np.maximum((nearest + farthest) / 2.0, nearest)
        beyond = (distances - ranges[:, None]) / (self.position_sigma * math.sqrt(2.0))
        return np.asarray(0.5 * np.vectorize(math.erfc, otypes=[np.float64])(beyond))[row_of]

    @cached_property
    def remaining(self) -> NDArray[np.float64]:
        """Remaining share of the detection of an object by class and unit, shape (k, 256)."""
        return np.asarray(self.fading * self.inside)

    @cached_property
    def leaving(self) -> NDArray[np.float64]:
        """Share of detection that is lost because the observer is out of range, shape (k, 256)."""
        return np.asarray(self.fading * (1.0 - self.inside))

    @cached_property
    def density(self) -> NDArray[np.float64]:
        """False objects a degree by class, and of any class, shape (k + 1,)."""
        return np.append(self.clutter, self.clutter.sum()) / FULL_TURN

    @cached_property
    def detected(self) -> NDArray[np.float64]:
        """Chance to detect a near object, by signature length and class: (longest + 1, k)."""
        return 1.0 - self.missed

    @cached_property
    def odds(self) -> NDArray[np.float64]:
        """Chance of detection over the chance of a miss, shape (longest + 1, k)."""
        return (1.0 - self.missed) / self.missed

    def named(self, length: int) -> NDArray[np.float64]:
        """Return the chance of each name of each class at a length of `misnamed`, shape (k, k)."""
        names = self.misnamed[length, :, None] * self.others
        np.fill_diagonal(names, 1.0 - self.misnamed[length])
        return np.asarray(names)

    @cached_property
    def row_of(self) -> NDArray[np.int64]:
        """Row of each class code, shape (256,); k for `WILDCARD`, -1 for other codes."""
        rows = np.full(256, -1)
        rows[self.codes] = np.arange(len(self.codes))
        rows[WILDCARD] = len(self.codes)
        return rows

    @cached_property
    def sigmas(self) -> NDArray[np.float64]:
        """Deviation of a bearing in degrees, at most 180, by class and distance unit, (k, 256)."""
        turned = np.degrees(self.position_sigma / self.distances)
        return np.asarray(np.minimum(np.hypot(self.sigma[:, None], turned), WIDEST_SIGMA))

    def divided(self, taxonomy: DividedTaxonomy) -> NoiseTable:
        """Return the table with a row for each part of a class, equal to that of the class.

        Nothing is named by a part: the texts of a view are in its scores. Half of the false objects
        are those of the code `rest`.
        """
        rows = [int(self.row_of[code]) for code in taxonomy.parents.values()]
        kinds = np.array([*range(len(self.codes)), *rows, 0])
        others = np.zeros((len(kinds), len(kinds)))
        others[:, : len(self.codes)] = self.others[kinds]
        halves = np.append(self.clutter, np.zeros(len(rows) + 1)) / 2.0
        halves[-1] = self.clutter.sum() / 2.0
        return replace(
            self,
            codes=np.array([*self.codes.tolist(), *taxonomy.parents, taxonomy.rest], np.uint8),
            missed=self.missed[:, kinds],
            misnamed=self.misnamed[:, kinds],
            others=others,
            clutter=halves,
            sigma=self.sigma[kinds],
            range_sigma=self.range_sigma[kinds],
            ranges=self.ranges[kinds],
            fading=self.fading[kinds],
        )

    def length_rows(self, lengths: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the row of each signature length, the last one for longer signatures."""
        return np.minimum(lengths, len(self.missed) - 1)

    def query_rows(self, query: Signature) -> NDArray[np.int64]:
        """Return the class row of each object of a query, k if unknown; InputError without any."""
        count = len(query)
        if not count:
            raise InputError("the query has no objects; give at least one type or bearing.")
        if query.codes is None:
            return np.full(count, len(self.codes))
        return self.class_rows(query.codes)

    def class_rows(self, codes: NDArray[np.uint8]) -> NDArray[np.int64]:
        """Return the row of each class code; InputError if the database lacks a class."""
        rows = self.row_of[codes]
        if (rows < 0).any():
            raise InputError(
                f"the query has an object of class code {int(codes[rows < 0][0])}, which no "
                "cell of the database sees; leave it out, or give its class as not known "
                f"(code {WILDCARD})."
            )
        return rows


class NoiseModels(NamedTuple):
    """The noise models of a mixture as arrays, for the kernel `sum_associations`.

    By model, `log_weights` are the logarithms of their chances, `clutter` the expected number of
    false detections and `blur` the metres that the observer may be off. By model, length and class,
    `detected` and `misnamed` are chances. By model, class and distance unit, `remaining` and
    `leaving` are the shares of the detections of an object that is in range of the observer and
    that is not, and `sigma` is the deviation of its bearing. `distances` are by distance unit.
    """

    log_weights: NDArray[np.float64]
    detected: NDArray[np.float64]
    misnamed: NDArray[np.float64]
    clutter: NDArray[np.float64]
    remaining: NDArray[np.float64]
    leaving: NDArray[np.float64]
    sigma: NDArray[np.float64]
    blur: NDArray[np.float64]
    distances: NDArray[np.float64]


def noise_tables(
    noise: Noise, *, taxonomy: Taxonomy, codes: NDArray[np.uint8], longest: int, radius: float
) -> tuple[tuple[NoiseTable, ...], NDArray[np.float64]]:
    """Return one table for each model of a mixture, or for the only model, and the chance of each.

    Only classes in `codes` are used; the default visibility range is `radius` metres. Raises
    `InputError` if the model has a class that the taxonomy does not have, or gives a class no
    chance of any name in `codes`.
    """
    if isinstance(taxonomy, DividedTaxonomy):
        parts = [*taxonomy.parents, taxonomy.rest]
        present = np.union1d(np.setdiff1d(codes, parts), [*taxonomy.parents.values()])
        tables, weights = noise_tables(
            noise,
            taxonomy=taxonomy.whole,
            codes=present.astype(np.uint8),
            longest=longest,
            radius=radius,
        )
        return tuple(table.divided(taxonomy) for table in tables), weights
    return _noise_tables(noise, taxonomy, bytes(codes), longest, radius)


@lru_cache(maxsize=24)
def _noise_tables(
    noise: Noise, taxonomy: Taxonomy, present: bytes, longest: int, radius: float
) -> tuple[tuple[NoiseTable, ...], NDArray[np.float64]]:
    """Return `noise_tables` of classes that are not divided; the last ones are kept."""
    codes = np.frombuffer(present, np.uint8)
    noise = noise_by_class(noise, taxonomy, set(codes.tolist()))
    # Values of other classes go to a row after the last, which is dropped.
    row_of = {code: row for row, code in enumerate(codes.tolist())}
    rows = {item.name: row_of.get(item.code, len(codes)) for item in taxonomy.classes}
    ranges = taxonomy.ranges(radius)
    scale = DistanceScale.of(taxonomy, radius)
    others = other_classes([taxonomy.by_code(code).family for code in codes.tolist()])
    tables = tuple(
        _table(spec, rows, codes, longest, ranges[codes], scale, others) for spec in noise.specs
    )
    return tables, np.asarray(noise.weights, dtype=np.float64)


def database_tables(
    database: SignatureDatabase, noise: Noise
) -> tuple[tuple[NoiseTable, ...], NDArray[np.float64]]:
    """Return `noise_tables` for the classes and lengths of a database."""
    return noise_tables(
        noise,
        taxonomy=database.taxonomy,
        codes=database.present_codes,
        longest=min(int(np.diff(database.offsets).max()), LONGEST_TABLE),
        radius=database.spec.radius,
    )


def other_classes(families: Sequence[str]) -> NDArray[np.float64]:
    """Return the share of each other class in the misnamed objects of each class, shape (k, k).

    `families` are those of the classes, empty for none. `FAMILY_SHARE` is divided among the other
    classes of the family, and the rest among the classes that are not in it. All others have equal
    shares if there is only one family, or the class has none or is the only one of it.
    """
    names = np.array(families, dtype=str)
    other = ~np.eye(len(names), dtype=np.bool_)
    equal = other / max(len(names) - 1, 1)
    if len({*families} - {""}) < 2:  # noqa: PLR2004 - families
        return np.asarray(equal)
    inside = other & (names[:, None] == names) & (names != "")
    outside = other & ~inside
    near, far = (np.maximum(part.sum(axis=1), 1) for part in (inside, outside))
    shares = np.where(inside, (FAMILY_SHARE / near)[:, None], 0.0)
    shares += np.where(outside, ((1.0 - FAMILY_SHARE) / far)[:, None], 0.0)
    return np.where(inside.any(axis=1)[:, None], shares, equal)


def mean_table(tables: tuple[NoiseTable, ...], weights: NDArray[np.float64]) -> NoiseTable:
    """Return the weighted mean of models: of chances, and of squares for deviations.

    The models are for the same classes and lengths; weights sum to one.
    """
    names = np.stack([table.misnamed.mean(axis=0)[:, None] * table.others for table in tables])
    mean_names = np.tensordot(weights, names, axes=1)
    totals = mean_names.sum(axis=1, keepdims=True)
    plain = np.tensordot(weights, np.stack([table.others for table in tables]), axes=1)
    position = sum(
        weight * table.position_sigma**2 for weight, table in zip(weights, tables, strict=True)
    )

    def mean(name: str, power: int = 1) -> NDArray[np.float64]:
        stacked = np.stack([getattr(table, name) for table in tables]) ** power
        return np.asarray(np.tensordot(weights, stacked, axes=1) ** (1 / power))

    return NoiseTable(
        codes=tables[0].codes,
        missed=mean("missed"),
        misnamed=mean("misnamed"),
        others=np.divide(mean_names, totals, out=plain, where=totals > 0),
        clutter=mean("clutter"),
        sigma=mean("sigma", 2),
        range_sigma=mean("range_sigma", 2),
        position_sigma=float(position) ** 0.5,
        ranges=tables[0].ranges,
        fading=mean("fading"),
        scale=tables[0].scale,
    )


def stack_models(tables: Sequence[NoiseTable], weights: NDArray[np.float64]) -> NoiseModels:
    """Stack the tables of a mixture as compiled kernels take them."""
    return _stacked(tuple(tables), tuple(weights.tolist()))


@lru_cache(maxsize=16)
def _stacked(tables: tuple[NoiseTable, ...], weights: tuple[float, ...]) -> NoiseModels:
    """Return `stack_models` of tables; the last ones are kept."""

    def stacked(name: str) -> NDArray[np.float64]:
        return np.stack([getattr(table, name) for table in tables])

    return NoiseModels(
        log_weights=np.log(weights),
        detected=stacked("detected"),
        misnamed=stacked("misnamed"),
        clutter=np.array([table.clutter.sum() for table in tables]),
        remaining=stacked("remaining"),
        leaving=stacked("leaving"),
        sigma=stacked("sigmas"),
        blur=stacked("position_sigma"),
        distances=tables[0].distances,
    )


def extent_sigma(extents: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the deviation of a bearing anywhere within some extents, all in degrees."""
    return np.asarray(extents / math.sqrt(12.0))


def query_bearings(query: Signature) -> NDArray[np.float64]:
    """Return the bearings of a query; raise InputError without any."""
    if query.bearings is None:
        raise InputError(
            "the query has no bearings, which the search between cells needs; give them."
        )
    return query.bearings


def _table(  # noqa: PLR0917 - a private helper of one caller
    spec: NoiseSpec,
    rows: Mapping[str, int],
    codes: NDArray[np.uint8],
    longest: int,
    ranges: NDArray[np.float64],
    scale: DistanceScale,
    others: NDArray[np.float64],
) -> NoiseTable:
    """Return the table of one model, given the row of each class of the taxonomy."""
    count = len(codes)
    if spec.general:
        tables = [getattr(spec, name) for name in (*BY_CLASS, "clutter_shares", "fading")]
        tables += [spec.confusion, *spec.confusion.values()]
        rows = dict.fromkeys(chain(*tables), count) | dict(rows)

    def by_class(overall: float, special: Mapping[str, float]) -> NDArray[np.float64]:
        values = np.full(count + 1, float(overall))
        for name, value in special.items():
            values[rows[name]] = value
        return values[:count]

    misnamed = by_class(spec.misnamed, spec.misnamed_by_class)
    others = others.copy()
    for name, by_name in spec.confusion.items():
        shares = by_class(0.0, by_name)
        if shares.sum() <= 0:
            raise InputError(
                f"confusion row {name!r} of the noise gives no chance to any class that is seen; "
                "give some chance to the class itself."
            )
        shares /= shares.sum()
        row = rows[name]
        if row < count:
            misnamed[row] = 1.0 - shares[row]
            shares[row] = 0.0
            if shares.sum() > 0:
                others[row] = shares / shares.sum()
    clutter = np.full(count, spec.clutter / count)
    if spec.clutter_shares:
        clutter = spec.clutter * by_class(0.0, spec.clutter_shares)
    # A draw among L objects does not hit a given one with chance 1 - 1/L.
    spared = 1.0 - 1.0 / np.maximum(np.arange(longest + 1), 1)
    detected = np.outer(spared**spec.missed_each, by_class(spec.detection, spec.detection_by_class))
    right = np.outer(spared**spec.misnamed_each, 1.0 - misnamed)
    return NoiseTable(
        codes=codes,
        missed=np.clip(1.0 - detected, LEAST_MISSED, MOST_MISSED),
        misnamed=np.clip(1.0 - right, LEAST_MISSED, MOST_MISSED) if count > 1 else 0.0 * right,
        others=others,
        clutter=np.maximum(clutter, LEAST_CLUTTER / count),
        sigma=by_class(spec.bearing_sigma, spec.bearing_sigma_by_class),
        range_sigma=by_class(spec.range_sigma, spec.range_sigma_by_class),
        position_sigma=spec.position_sigma,
        ranges=ranges,
        fading=_fading(spec, rows, count, scale),
        scale=scale,
    )


def _fading(
    spec: NoiseSpec, rows: Mapping[str, int], count: int, scale: DistanceScale
) -> NDArray[np.float64]:
    """Return the remaining share of detection by class and distance unit, shape (count, 256)."""
    metres = scale.metres

    def shares(points: Sequence[Sequence[float]]) -> NDArray[np.float64]:
        distances, values = np.transpose(np.asarray(points, dtype=np.float64))
        return np.asarray(np.interp(metres, distances, values))

    fading = np.ones((count + 1, len(metres)))
    if ALL in spec.fading:
        fading[:] = shares(spec.fading[ALL])
    for name, points in spec.fading.items():
        if name != ALL:
            fading[rows[name]] = shares(points)
    return fading[:count]
