"""The log-likelihood of a view in every cell, straight from the database: no index file.

A first sum treats the detections one by one, so that one lamp may explain three of them; the best
cells are ranked again by one-to-one associations (`likelihood.association`). Errors of bearings and
ranges are computed at `DISTANCE_LEVELS` distances and `BINS` bearings: steps that are small against
the errors.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import (
    BEARING_UNITS,
    FULL_TURN,
    WILDCARD,
    Displayed,
    consecutive,
    crs_label,
    share_rows,
)
from semsig_gis.localization.likelihood.photo import PhotoTable
from semsig_gis.localization.likelihood.records import (
    BINS,
    COARSE_BINS,
    COARSE_LEVELS,
    DISTANCE_LEVELS,
    LANES,
    BinnedObjects,
    LevelModel,
    PhotoGains,
    PhotoRows,
    TurnedPhoto,
)
from semsig_gis.localization.likelihood.turns import (
    TURNS,
    WIDE_TURNS,
    TurnPrior,
    TurnScores,
    wide_turn_chances,
)
from semsig_gis.localization.noise.beyond import noise_with_objects_beyond
from semsig_gis.localization.noise.model import ROUNDING, cell_noise, place_noise
from semsig_gis.localization.noise.table import database_tables, extent_sigma, mean_table
from semsig_gis.observation import View, check_north

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization.noise.model import Noise
    from semsig_gis.localization.noise.table import NoiseTable

    _Models = tuple[tuple[NoiseTable, ...], NDArray[np.float64]]
    _Extents = tuple[NDArray[np.float64], NDArray[np.int64]] | None
    _PhotoScores = tuple[NDArray[np.float32], NDArray[np.float32] | None]
    _Scorer = Callable[[BinnedObjects], _PhotoScores]

BIN_OF = (np.arange(BEARING_UNITS) * BINS // BEARING_UNITS).astype(np.uint16)
FINE = 8 * BINS
"""Bearing steps of a detection."""
EXACT_GROUPS = 4  # classes with more different errors are grouped by similar ones
ERROR_RATIO = 1.3  # of errors that count as similar
EXTENT_RATIO = 3.0  # of errors of extended things that do

LENGTH_ODDS = 2.0  # ratio of odds up to which lengths of signatures share a row
FIRST_DETECTIONS, FIRST_TURNED_DETECTIONS = LANES, 12
"""Detections of a photo by which cells are chosen, if its north is known and if not."""

MOST_HELD = 1 << 24  # objects of all cells that an index keeps, in three bytes each
CELLS_A_BLOCK = 1 << 17
"""Cells that are scored at once if their objects are not kept."""

VERSION = 6  # increased whenever the same database and noise give other likelihoods
POINTS_A_SIDE = 3  # of the grid of points in a cell at which the best cells are compared
MOST_CHANCE = np.float32(1.0 - 1e-6)  # of a detection: a miss is possible
LEAST_WIDE_SIGMA = 20.0  # degrees of the deviation of north, for which wide turns are fine enough
LEAST_DENSITY = 1e-12  # densities below count as 0: products of them would be slow to compute
LAPS = np.arange(-3, 4)  # 180 degrees of deviation reach three turns


@dataclass(frozen=True, eq=False, kw_only=True)
class CellScores:
    """The log-likelihood (natural logarithm) of a view in every cell, and the likeliest headings.

    `headings` has one item a photo: degrees clockwise, in [-180, 180), to add to its bearings in
    each cell; None where its north is known or it has no bearings.
    """

    loglik: NDArray[np.floating]
    headings: tuple[NDArray[np.float32] | None, ...] = (None,)

    @property
    def heading(self) -> NDArray[np.float32] | None:
        """The headings of the first photo."""
        return self.headings[0]

    def headings_at(self, cell: int) -> list[float]:
        """Return the heading of each photo in a cell, 0 where its north is known."""
        return [0.0 if turns is None else float(turns[cell]) for turns in self.headings]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LikelihoodIndex(Displayed):
    """The cells of a database and a noise model, with which views are compared.

    Parameters
    ----------
    database, noise : SignatureDatabase, and NoiseSpec or NoiseMixture
        The cells and the noise model.

    Examples
    --------
    >>> from semsig_gis import build_index, named_noise
    >>> index = build_index(demo_database, named_noise("light"))
    >>> longest = int(demo_database.lengths.argmax())
    >>> int(index.scores(demo_database.signature(longest)).loglik.argmax()) == longest
    True
    """

    database: SignatureDatabase
    noise: Noise

    def _facts(self) -> dict[str, object]:
        return {
            "cells": len(self.database),
            "noise": self.noise.name,
            "classes": len(self.database.present_codes),
            "CRS": crs_label(self.database.crs),
        }

    @cached_property
    def models(self) -> _Models:
        """The noise model in numbers, or each model of the mixture, and the chance of each."""
        return database_tables(self.database, self.noise)

    @cached_property
    def table(self) -> NoiseTable:
        """The mean of the models, by which all cells are compared."""
        return mean_table(*self.models)

    @cached_property
    def observer_offsets(self) -> tuple[_Models, NDArray[np.float64]]:
        """The noise models for a point in a cell, and the points in metres from its centre, (p, 2).

        For a noise model that is for the centres of cells, the only point is the centre.
        """
        step = self.database.grid.step
        if any(spec.position_sigma**2 < step**2 / 12.0 - ROUNDING for spec in self.noise.specs):
            return self.models, np.zeros((1, 2))
        return self._points(POINTS_A_SIDE)

    def _points(self, side: int) -> tuple[_Models, NDArray[np.float64]]:
        """Return the models for a part of a cell, and the centres of all parts, `side` a side."""
        step = self.database.grid.step
        along = (np.arange(side) - (side - 1) / 2.0) * step / side
        points = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
        noise = cell_noise(place_noise(self.noise, step), step / side)
        return database_tables(self.database, noise), points

    @cached_property
    def _extents(self) -> _Extents:
        """Sums of squares of `extent_sigma` and numbers of objects, by class and distance unit."""
        database, shape = self.database, self.table.fading.shape
        if database.extents is None:
            return None
        cells = self.table.row_of[database.codes] * shape[1] + database.distance_units
        sums = np.bincount(cells, extent_sigma(database.extents) ** 2, math.prod(shape))
        numbers = np.bincount(cells, minlength=math.prod(shape))
        return np.asarray(sums.reshape(shape)), np.asarray(numbers.reshape(shape))

    @cached_property
    def levels(self) -> NoiseLevels:
        """The mean of the models at some distances."""
        return NoiseLevels.of(self.table, self._extents)

    @cached_property
    def objects(self) -> BinnedObjects:
        """The objects of all cells, as `kernels.scan` takes them."""
        return self._binned(self.database.offsets, slice(None))

    @property
    def _is_held(self) -> bool:
        """Whether `objects` are kept in memory for the next question."""
        return "objects" in vars(self) or len(self.database.codes) <= MOST_HELD

    def objects_of(self, cells: NDArray[np.int64]) -> tuple[BinnedObjects, NDArray[np.int64]]:
        """Return the objects of at least some cells, by row, and the place of each of these."""
        if self._is_held:
            return self.objects, cells
        starts = self.database.offsets[cells]
        lengths = self.database.offsets[cells + 1] - starts
        entries = consecutive(starts, lengths)
        return self._binned(np.append(0, np.cumsum(lengths)), entries), np.arange(len(cells))

    def _binned(
        self, offsets: NDArray[np.int64], entries: slice | NDArray[np.int64]
    ) -> BinnedObjects:
        """Return some objects by place, given their rows among those of all cells."""
        database = self.database
        return self.levels.objects(
            offsets,
            database.codes[entries],
            BIN_OF[database.bearing_units[entries]],
            database.distance_units[entries],
        )

    def _scan(self, scorer: _Scorer) -> _PhotoScores:
        """Return the scores of a photo in all cells, block by block if there are very many."""
        if self._is_held:
            return scorer(self.objects)
        parts = []
        for start in range(0, len(self.database), CELLS_A_BLOCK):
            offsets = self.database.offsets[start : start + CELLS_A_BLOCK + 1]
            block = self._binned(offsets - offsets[0], slice(offsets[0], offsets[-1]))
            parts.append(scorer(block))
        headings = [heading for _, heading in parts if heading is not None]
        scores = np.concatenate([score for score, _ in parts])
        return scores, np.concatenate(headings) if headings else None

    @cached_property
    def memo(self) -> dict[Any, Any]:
        """What is computed from the index for some questions, and kept with it."""
        return {}

    def scores(self, query: Signature, *, north_sigma: float = 0.0) -> CellScores:
        """Return the log-likelihood of a view in every cell, and the likeliest turns of its photos.

        Types may be unknown, all or some (code 0); bearings may be unknown, and then the order of
        the types has no effect. `north_sigma` is the standard deviation in degrees of the north of
        photos without their own, infinite if it is not known at all; the likelihood is summed over
        turns of 5.6 degrees. Raises `InputError` if the view has a class that no cell sees, or
        `north_sigma` is out of range.
        """

        def score_photo(photo: View, sigma: float) -> _PhotoScores:
            return self._scan(photo_scorer(photo, self.levels, sigma))

        return self.scores_by_photo(query, north_sigma, score_photo)

    def first_scores(self, query: Signature, *, north_sigma: float = 0.0) -> CellScores:
        """Return scores by which cells are chosen, from `FIRST_DETECTIONS` of each photo at most.

        The detections are evenly spaced. In cells with many objects, sums over more detections
        would count too often that an object explains several of them.
        """

        def score_photo(photo: View, sigma: float) -> _PhotoScores:
            most = FIRST_DETECTIONS if sigma == 0.0 else FIRST_TURNED_DETECTIONS
            share = min(most / max(len(photo), 1), 1.0)
            if share < 1.0:
                photo = photo.select(np.linspace(0, len(photo) - 1, most).round().astype(np.int64))
            if sigma == 0.0:
                return self._scan(gain_scorer(photo, self.levels, share=share))
            wide = sigma >= LEAST_WIDE_SIGMA and is_plain(photo)
            scorer = profile_scorer if wide else photo_scorer
            return self._scan(scorer(photo, self.levels, sigma, share=share))

        return self.scores_by_photo(query, north_sigma, score_photo)

    def scores_by_photo(
        self,
        query: Signature,
        north_sigma: float,
        score_photo: Callable[[View, float], _PhotoScores],
    ) -> CellScores:
        """Return `scores`, given what scores a photo with the deviation of its north."""
        check_north(north_sigma)
        view = View.of(query)
        if view.bearings is None and not len(view):
            view = View(np.empty(0, np.uint8), np.empty(0))
        if view.bearings is None:
            return CellScores(loglik=self._scores_by_counts(self.table.query_rows(view)))
        loglik = np.zeros(len(self.database), np.float32)
        headings = []
        for photo in view.split():
            scores, heading = score_photo(photo, own_sigma(photo, north_sigma))
            loglik += scores
            headings.append(heading)
        loglik *= photo_power(len(headings), self.noise)
        return CellScores(loglik=loglik, headings=tuple(headings))

    def _scores_by_counts(self, rows: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return the scores of a query without bearings, given the class rows of its objects."""
        from semsig_gis.localization.likelihood.kernels import count_types  # noqa: PLC0415 - numba, 0.25 s

        types = self.database.type_sequences
        distinct = np.empty(len(types), np.float32)
        count_types(
            types.offsets,
            types.values,
            self.table.row_of,
            np.bincount(rows, minlength=len(self.table.codes) + 1),
            self.table.detected,
            self.table.misnamed,
            self.table.others,
            self.table.clutter,
            distinct,
        )
        return distinct[types.inverse]


def photo_scorer(
    photo: View,
    levels: NoiseLevels,
    north_sigma: float,
    *,
    share: float = 1.0,
    before: TurnScores | None = None,
    after: TurnScores | None = None,
) -> _Scorer:
    """Return a function of objects by place: the log-likelihood of a photo and its likeliest turns.

    The photo has a `share` of all detections, taken without regard to what they are. For a photo of
    uncertain north, the scores go on from those `before`, and fill `after`.
    """
    from semsig_gis.localization.likelihood.kernels import scan, scan_turned  # noqa: PLC0415 - numba, 0.25 s

    arrays, model = photo_rows(photo, levels, share=share), levels.model
    model = model._replace(detected=model.detected * np.float32(share))
    if before is not None:  # which has the clutter
        arrays = arrays._replace(
            base=arrays.base + float(levels.table.clutter.sum()) * arrays.width
        )
    if north_sigma == 0.0:

        def score(objects: BinnedObjects) -> _PhotoScores:
            size = len(objects.offsets) - 1
            totals, products = np.empty(size), np.empty(size)
            share_rows(lambda part: scan(part, objects, model, arrays, totals, products), size)
            totals += np.log(products)
            return totals.astype(np.float32), None

        return score

    # One row for each detection, in the place of blocks of them.
    size, rows = len(photo), arrays.rows
    by_detection = np.moveaxis(rows, 4, 1).reshape(-1, *rows.shape[1:4])[:size]
    turned = PhotoRows(
        _turned(by_detection),
        _turned(arrays.masses),
        np.ascontiguousarray(arrays.naming[..., :size]),
        arrays.disc[:size],
        arrays.width,
        arrays.base,
    )
    prior = TurnPrior.of(north_sigma)
    nothing = TurnScores(np.empty(0, np.float32), np.empty((0, len(prior.chances)), np.float32))

    def score_turned(objects: BinnedObjects) -> _PhotoScores:
        size = len(objects.offsets) - 1
        scores, best = np.empty(size, np.float32), np.empty(size, np.int16)
        old, new = before or nothing, after or nothing
        share_rows(
            lambda part: scan_turned(part, objects, model, turned, prior, old, new, scores, best),
            size,
        )
        return scores, best * np.float32(FULL_TURN / TURNS)

    return score_turned


def gain_scorer(photo: View, levels: NoiseLevels, *, share: float = 1.0) -> _Scorer:
    """Return about `photo_scorer` for a photo of at most `LANES` detections and known north.

    The sum over the objects is only its largest term, which is read from a table with wider steps
    of bearing and distance. So an object that explains several detections adds less.
    """
    from semsig_gis.localization.likelihood.kernels import gain_rows, scan_gains  # noqa: PLC0415 - numba, 0.25 s

    arrays, model = photo_rows(photo, levels, share=share), levels.model
    length_of, lengths = levels.length_groups
    shares = levels.level_shares
    remaining, leaving = (
        (part * shares).reshape(len(part), COARSE_LEVELS, -1).sum(axis=2)
        for part in (model.remaining, model.leaving)
    )
    near = model.detected[..., None] * np.float32(share)
    chances = np.minimum(near * remaining, MOST_CHANCE)
    away = near * leaving * np.float32(arrays.width)
    # Classes with the same chances share a row of the table.
    names = arrays.naming[lengths]
    logs = np.log(np.maximum(names, np.finfo(np.float32).tiny)).round(3)
    numbers = np.concatenate([chances[lengths], away[lengths], logs], axis=2)
    keys = [
        (group, numbers[:, kind].tobytes()) for kind, group in enumerate(model.group_of.tolist())
    ]
    distinct = list(dict.fromkeys(keys))
    kinds = np.array([keys.index(key) for key in distinct])
    kind_of = np.array([distinct.index(key) for key in keys], np.uint64)
    groups, some = model.group_of[kinds], np.ix_(lengths, kinds)
    gains = np.empty((len(lengths), len(kinds), COARSE_LEVELS, COARSE_BINS, LANES), np.uint8)
    scratch = np.empty(LANES, np.float32)
    inside = np.empty((len(levels.sigma), COARSE_LEVELS, COARSE_BINS), np.float32)
    gain_rows(
        arrays.rows[0],
        arrays.masses,
        shares,
        groups,
        chances[some],
        names[:, kinds],
        (scratch, scratch.view(np.int32)),
        gains,
        inside,
    )
    photo_gains = PhotoGains(
        gains=gains,
        length_of=length_of,
        kind_of=kind_of,
        missed=np.log(1.0 - chances) - away,
        inside=np.log(1.0 - chances[some][..., None] * inside[groups]) - away[some][..., None]
        if arrays.masses.size
        else np.empty((0, 0, 0, 0), np.float32),
        base=arrays.base,
    )

    def score(objects: BinnedObjects) -> _PhotoScores:
        scores = np.empty(len(objects.offsets) - 1, np.float32)
        share_rows(lambda part: scan_gains(part, objects, photo_gains, scores), len(scores))
        return scores, None

    return score


def is_plain(photo: View) -> bool:
    """Whether a photo is a full turn of known classes, without ranges and errors of its own."""
    unknown = photo.codes is None or photo.scores is not None or (photo.codes == WILDCARD).any()
    rough = photo.bearing_errors is not None and np.nan_to_num(photo.bearing_errors).any()
    ranged = photo.ranges is not None and not np.isnan(photo.ranges).all()
    return not (unknown or rough or ranged or photo.photos[0].sectors)


def profile_scorer(
    photo: View, levels: NoiseLevels, north_sigma: float, *, share: float = 1.0
) -> _Scorer:
    """Return about `photo_scorer` for a plain photo of uncertain north.

    Bearings are rounded to the turns, and wrong names all have the chance of the likeliest.
    """
    from semsig_gis.localization.likelihood.kernels import scan_profiles  # noqa: PLC0415 - numba, 0.25 s

    table, model = levels.table, levels.model
    detections, same = PhotoTable.of(photo, table), np.eye(len(table.codes), dtype=np.bool_)
    density = share * table.clutter / FULL_TURN
    wrong = table.misnamed[: len(model.detected), :, None]
    names = ((1.0 - wrong) * same + wrong * table.others) / density
    other = np.where(same, 0.0, names).max(axis=2)
    rows = table.class_rows(np.asarray(photo.codes))
    classes, profiles = np.unique(rows, return_inverse=True)
    profile_of = np.zeros(len(table.codes), np.int64)
    profile_of[classes] = np.arange(1, len(classes) + 1)
    # An object at each step inside a turn, and the middles of the turns before and after it.
    steps = BINS // WIDE_TURNS
    away = (np.arange(-WIDE_TURNS, WIDE_TURNS) + 0.5) * steps - (np.arange(steps)[:, None] + 0.5)
    turned = TurnedPhoto(
        rows=levels.fine[:, :, np.rint(away * (FINE / BINS)).astype(np.int64) % FINE],
        own=(np.einsum("lkk->lk", names) - other).astype(np.float32),
        other=other.astype(np.float32),
        profile_of=profile_of,
        profiles=profiles.reshape(-1) + 1,
        sectors=(detections.bearings * (WIDE_TURNS / FULL_TURN)).astype(np.int64) % WIDE_TURNS,
        chances=wide_turn_chances(north_sigma),
        base=float(np.log(density[rows]).sum() - density.sum() * FULL_TURN),
    )
    model = model._replace(detected=model.detected * np.float32(share))

    def score(objects: BinnedObjects) -> _PhotoScores:
        size = len(objects.offsets) - 1
        scores, best = np.empty(size, np.float32), np.empty(size, np.int64)
        share_rows(lambda part: scan_profiles(part, objects, model, turned, scores, best), size)
        turns = (best + WIDE_TURNS // 2) % WIDE_TURNS - WIDE_TURNS // 2
        return scores, (turns * (FULL_TURN / WIDE_TURNS)).astype(np.float32)

    return score


def photo_rows(photo: View, levels: NoiseLevels, *, share: float = 1.0) -> PhotoRows:
    """Return a photo as the kernels take it, with detections in whole blocks of `LANES`.

    The photo has a `share` of all detections.
    """
    table = levels.table
    detections = PhotoTable.of(photo, table)
    density = share * detections.density(table)
    return PhotoRows(
        levels.rows(detections),
        levels.masses(detections),
        _padded(detections.named(table)[: len(levels.model.detected)] / density),
        _padded(detections.disc / FULL_TURN),
        detections.width,
        float(np.log(density).sum() - share * table.clutter.sum() * detections.width),
    )


def photo_power(photos: int, noise: Noise) -> float:
    """Return the power of the likelihood of some photos of one place (see `NoiseSpec.repeat`)."""
    return float(photos ** (noise.repeat - 1.0))


def own_sigma(photo: View, north_sigma: float) -> float:
    """Return the standard deviation of the north of a photo, its own or that of all."""
    own = photo.photos[0].north_sigma
    return north_sigma if own is None else own


def _turned(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return rows, shape (..., bins), with the values of all turns as neighbours."""
    from semsig_gis.localization.likelihood.kernels import turned_rows  # noqa: PLC0415 - numba, 0.25 s

    turned = np.empty((*rows.shape[:-1], BINS // TURNS, 2 * TURNS), np.float32)
    turned_rows(
        np.ascontiguousarray(rows.reshape(-1, BINS)),
        turned.reshape(-1, BINS // TURNS, 2 * TURNS),
    )
    return turned


def _wrapped_normal(away: NDArray[np.floating], sigma: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the density of deviations in degrees from one turn away, for each of some sigmas."""
    density = np.zeros((*sigma.shape, len(away)))
    for lap in LAPS:
        density += np.exp(-0.5 * ((away + FULL_TURN * lap) / sigma[..., None]) ** 2)
    density /= sigma[..., None] * math.sqrt(2.0 * math.pi)
    density[density < LEAST_DENSITY] = 0.0
    return density


def _padded(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """Pad the last axis with zeros to a whole number of blocks; return float32."""
    size = values.shape[-1]
    more = [(0, 0)] * (values.ndim - 1) + [(0, _blocks(size) * LANES - size)]
    return np.pad(values, more).astype(np.float32)


def _blocks(size: int) -> int:
    """Return the number of blocks for `size` detections: at least one."""
    return max(1, -(-size // LANES))


@dataclass(frozen=True, eq=False, kw_only=True)
class NoiseLevels:
    """A noise table at some distances, for classes grouped by their errors.

    `level_of` is by distance unit; `sigma`, shape (groups, levels), is the deviation of bearings,
    `range_sigma` (groups,) and `blur` (levels,) that of logarithms of ranges by the detector and by
    the place, and `fine` the density of a deviation. `model` has the chances of detection.
    """

    table: NoiseTable
    level_of: NDArray[np.int64]
    sigma: NDArray[np.float64]
    range_sigma: NDArray[np.float64]
    distances: NDArray[np.float64]
    blur: NDArray[np.float64]
    fine: NDArray[np.float32]
    model: LevelModel

    @classmethod
    def of(cls, table: NoiseTable, extents: _Extents = None) -> NoiseLevels:
        """Return the levels of a table; `extents` are those of `LikelihoodIndex`."""
        metres, detected = table.distances, table.detected
        remaining, leaving = table.remaining, table.leaving
        # Levels are spaced by the logarithm of the distance; a level is the mean of its units.
        steps = np.maximum(table.scale.steps, 1.0)
        logs = (DISTANCE_LEVELS - 1) * np.log(steps) / math.log(steps[-1])
        level_of = np.rint(logs).astype(np.int64)
        count = np.maximum(np.bincount(level_of, minlength=DISTANCE_LEVELS), 1)

        def by_level(values: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.bincount(level_of, values, DISTANCE_LEVELS) / count

        distances = np.exp(by_level(np.log(metres)))
        # Classes with the same errors share their rows; those of extended things only with others
        # that are about as wide.
        errors = np.stack([table.sigma, table.range_sigma], axis=1)
        wide = np.zeros(len(errors))
        if extents is not None:
            squares, numbers = (part.sum(axis=1) for part in extents)
            ratio = np.hypot(table.sigma, np.sqrt(squares / np.maximum(numbers, 1))) / table.sigma
            wide = np.rint(np.log(ratio) / math.log(EXTENT_RATIO))
        groups, group_of = np.unique(np.column_stack([wide, errors]), axis=0, return_inverse=True)
        if len(groups) > EXACT_GROUPS + len(np.unique(wide)) - 1:
            # Each group takes time, and the best cells are ranked again by exact errors.
            steps = np.column_stack([wide, np.rint(np.log(errors) / math.log(ERROR_RATIO))])
            _, group_of = np.unique(steps, axis=0, return_inverse=True)
            members = np.bincount(group_of.reshape(-1))
            columns = (wide, *errors.T)
            groups = np.stack(
                [np.bincount(group_of.reshape(-1), column) / members for column in columns], axis=1
            )
        turned = np.degrees(table.position_sigma / distances)
        sigma = np.hypot(groups[:, 1:2], turned)
        if extents is not None:
            # The mean square of the objects of the group at the level, or at any level.
            squares, numbers = (
                np.stack([np.bincount(group_of.reshape(-1), column) for column in part.T], axis=1)
                for part in extents
            )
            by_group = squares.sum(axis=1) / np.maximum(numbers.sum(axis=1), 1)
            totals, counts = (
                np.stack([np.bincount(level_of, row, DISTANCE_LEVELS) for row in part])
                for part in (squares, numbers)
            )
            means = np.where(counts > 0, totals / np.maximum(counts, 1), by_group[:, None])
            sigma = np.hypot(sigma, np.sqrt(means))
        sigma = np.minimum(sigma, FULL_TURN / 2.0)
        fine = _wrapped_normal(np.arange(FINE) * (FULL_TURN / FINE), sigma)
        # If the chances do not depend on the length of a signature, one row does for all lengths.
        same = (detected == detected[0]).all() and (table.misnamed == table.misnamed[0]).all()
        return cls(
            table=table,
            level_of=level_of,
            sigma=sigma,
            range_sigma=groups[:, 2],
            distances=distances,
            blur=table.position_sigma / distances,
            fine=fine.astype(np.float32),
            model=LevelModel(
                group_of=group_of.reshape(-1),
                detected=(detected[:1] if same else detected).astype(np.float32),
                remaining=np.stack([by_level(row) for row in remaining]).astype(np.float32),
                leaving=np.stack([by_level(row) for row in leaving]).astype(np.float32),
            ),
        )

    def objects(
        self,
        offsets: NDArray[np.int64],
        codes: NDArray[np.uint8],
        bins: NDArray[np.uint16],
        units: NDArray[np.uint8],
    ) -> BinnedObjects:
        """Return objects by place, given their class codes, bearing bins and distance units."""
        level_bins = (self.level_of * BINS).astype(np.uint16)[units]
        level_bins += bins
        offsets = offsets.view()
        offsets.flags.writeable = False  # as those of a file, or kernels are compiled twice
        return BinnedObjects(offsets, self.table.row_of.astype(np.uint8)[codes], level_bins)

    @cached_property
    def level_shares(self) -> NDArray[np.float32]:
        """The share of the distance units of each level among those of its coarse level."""
        counts = np.bincount(self.level_of, minlength=DISTANCE_LEVELS)
        counts = counts.reshape(COARSE_LEVELS, -1)
        shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
        return np.asarray(shares.reshape(-1), np.float32)

    @cached_property
    def length_groups(self) -> tuple[NDArray[np.uint64], NDArray[np.int64]]:
        """The group of each length, and a length of each group: those with about the same odds."""
        detected = self.model.detected
        chances = np.hstack([detected, self.table.misnamed[: len(detected)]]).clip(1e-3, 1.0 - 1e-3)
        logs, starts = np.log(chances / (1.0 - chances)), [0]
        for length, row in enumerate(logs):
            if np.abs(row - logs[starts[-1]]).max() > math.log(LENGTH_ODDS):
                starts.append(length)
        firsts = np.array(starts)
        ends = np.append(firsts[1:], len(logs))
        groups = np.repeat(np.arange(len(firsts), dtype=np.uint64), ends - firsts)
        return groups, (firsts + ends) // 2

    def rows(self, photo: PhotoTable) -> NDArray[np.float32]:
        """Return the density of each detection by group, level and bearing of an object."""
        from semsig_gis.localization.likelihood.kernels import profile_rows  # noqa: PLC0415 - numba, 0.25 s

        near = np.ones((*self.sigma.shape, len(photo.bearings)))
        ranged = ~np.isnan(photo.ranges)
        if ranged.any():
            group_of = self.model.group_of
            all_errors = photo.range_sigma(self.table)
            errors = np.stack([all_errors[group_of == row][0] for row in range(len(self.sigma))])
            error = np.hypot(errors[:, None, ranged], self.blur[:, None])
            away = np.log(photo.ranges[ranged] / self.distances[:, None]) / error
            near[..., ranged] = np.exp(-0.5 * away**2) / (error * math.sqrt(2.0 * math.pi))
        rows = np.zeros((_blocks(len(photo.bearings)), *self.sigma.shape, BINS, LANES), np.float32)
        shifts = np.rint(photo.bearings * (FINE / FULL_TURN)).astype(np.int64)
        near[near < LEAST_DENSITY] = 0.0
        profile_rows(self.fine, shifts, near.astype(np.float32), rows)
        for detection in np.flatnonzero(photo.bearing_errors).tolist():
            sigma = np.hypot(self.sigma, photo.bearing_errors[detection])
            away = (np.arange(BINS) + 0.5) * (FULL_TURN / BINS) - photo.bearings[detection]
            density = _wrapped_normal(away, np.minimum(sigma, FULL_TURN / 2.0))
            block, lane = divmod(detection, LANES)
            rows[block, ..., lane] = near[..., detection, None] * density
        return rows

    def masses(self, photo: PhotoTable) -> NDArray[np.float32]:
        """Return the chance that the bearing of an object falls into the sectors of the photo."""
        from semsig_gis.localization.likelihood.association_kernels import mass_rows  # noqa: PLC0415 - numba, 0.25 s

        levels = DISTANCE_LEVELS if len(photo.sectors) else 0
        masses = np.empty((len(self.sigma), levels, BINS), np.float32)
        if levels:
            mass_rows(self.sigma, photo.sectors, masses)
        return masses


def build_index(database: SignatureDatabase, noise: Noise) -> LikelihoodIndex:
    """Return the index of the cells of a database with a noise model.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    noise : NoiseSpec or NoiseMixture
        The noise model.

    Returns
    -------
    LikelihoodIndex
        The index, ready for queries.

    Raises
    ------
    InputError
        If the noise model does not fit the classes of the database.

    Examples
    --------
    >>> from semsig_gis import named_noise
    >>> index = build_index(demo_database, named_noise("generic"))
    >>> len(index.database) == len(demo_database)
    True
    """
    noise = noise_with_objects_beyond(noise, database)
    index = LikelihoodIndex(database=database, noise=noise)
    _ = index.models
    return index


def index_fingerprint(database: SignatureDatabase, noise: Noise) -> str:
    """Return 32 hexadecimal digits that change with the database, the noise model and `VERSION`.

    Titles of classes do not change them.
    """
    classes = [item | {"title": ""} for item in database.taxonomy.to_list()]
    specs = json.dumps([VERSION, noise.to_dict(), classes, database.reach])
    digest = hashlib.blake2b(specs.encode(), digest_size=16)
    for array in (
        database.columns,
        database.rows,
        database.offsets,
        database.codes,
        database.bearing_units,
        database.distance_units,
        *([] if database.extent_units is None else [database.extent_units]),
    ):
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()
