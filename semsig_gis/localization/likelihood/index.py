"""Every cell's likelihood of a view, from the database as it is: no index, no file.

A first sum over the detections one by one, in which one lamp may explain three; the best cells are
ranked again by one-to-one associations (`likelihood.association`). Errors of bearings and ranges
are computed at `LEVELS` distances and `BINS` bearings, steps that are small beside the errors.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import (
    BEARING_UNITS,
    DISTANCE_UNITS,
    FULL_TURN,
    Displayed,
    crs_label,
    distance_units_of,
    share_rows,
)
from semsig_gis.localization.likelihood.photo import PhotoTable
from semsig_gis.localization.noise.model import ROUNDING, cell_noise, place_noise
from semsig_gis.localization.noise.table import database_tables, mean_table
from semsig_gis.observation import View, check_north

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization.likelihood.incremental import TurnMemo
    from semsig_gis.localization.noise.model import Noise
    from semsig_gis.localization.noise.table import NoiseTable

    _Models = tuple[tuple[NoiseTable, ...], NDArray[np.float64]]
    _Scorer = Callable[["_Entries"], tuple[NDArray[np.float32], NDArray[np.float32] | None]]

BINS = 512
"""Bearing steps of an object."""
FINE = 8 * BINS
"""Bearing steps of a detection."""
LEVELS = 64
"""Distances at which errors are computed."""
TURNS = 64
"""Turns of a photo whose north is uncertain: steps of 5.625 degrees."""

VERSION = 6  # raised whenever the same database and noise give other likelihoods
LEAST_PRIOR = 1e-7  # turns that are less likely than this, against the likeliest, are left out
STANDS = 3  # places a side of a cell, at which the best cells are compared
LEAST_DENSITY = 1e-12
CELLS_A_PART = 256  # that are worth a thread, at places beside their centres
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


@dataclass(frozen=True, eq=False, slots=True)
class TurnScores:
    """The likelihood of a photo in every cell by turn: `shares`, times e to the power of `logs`."""

    logs: NDArray[np.float32]
    shares: NDArray[np.float32]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LikelihoodIndex(Displayed):
    """The cells of a database and a noise model: what views are compared with.

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
    def stands(self) -> tuple[_Models, NDArray[np.float64]]:
        """Where in a cell observers may stand, metres from its middle, and the models for each.

        For a noise model that is for the middles of cells, that is the middle alone.
        """
        step = self.database.grid.step
        if any(spec.position_sigma**2 < step**2 / 12.0 - ROUNDING for spec in self.noise.specs):
            return self.models, np.zeros((1, 2))
        return self._parts(STANDS)

    def _parts(self, side: int) -> tuple[_Models, NDArray[np.float64]]:
        """Return the middles of the parts of a cell, so many a side, and the models for a part."""
        step = self.database.grid.step
        along = (np.arange(side) - (side - 1) / 2.0) * step / side
        places = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
        noise = cell_noise(place_noise(self.noise, step), step / side)
        return database_tables(self.database, noise), places

    @cached_property
    def _quarters(self) -> tuple[_Levels, NDArray[np.float64]]:
        models, places = self._parts(2)
        return _Levels.of(mean_table(*models)), places

    @cached_property
    def _levels(self) -> _Levels:
        return _Levels.of(self.table)

    @cached_property
    def _entries(self) -> _Entries:
        database = self.database
        bin_of = (np.arange(BEARING_UNITS) * BINS // BEARING_UNITS).astype(np.uint16)
        bins = bin_of[database.bearing_units]
        return self._levels.entries(database.offsets, database.codes, bins, database.distance_units)

    def scores(
        self, query: Signature, *, north_sigma: float = 0.0, memo: TurnMemo | None = None
    ) -> CellScores:
        """Return the log-likelihood of a view in every cell, and the likeliest turns of its photos.

        Types may be unknown, all or those of code 0; bearings may be unknown, and then the order of
        the types plays no part. `north_sigma` is the standard deviation in degrees of the north of
        photos that do not tell their own, infinite where it is not known at all; the likelihood is
        summed over turns of 5.6 degrees. A `memo` goes on from what was seen before. Raises
        `InputError` if the view has a class that no cell sees, or `north_sigma` is out of range.
        """
        check_north(north_sigma)
        view = View.of(query)
        if view.bearings is None and not len(view):
            view = View(np.empty(0, np.uint8), np.empty(0))
        if view.bearings is None:
            return CellScores(loglik=self._by_counts(self.table.query_rows(view)))
        loglik = np.zeros(len(self.database), np.float32)
        headings = []
        for photo in view.split():
            sigma = own_sigma(photo, north_sigma)
            if memo is not None and sigma != 0.0:
                own, heading = memo.scores(self, photo, sigma)
            else:
                own, heading = _scorer(photo, self._levels, sigma)(self._entries)
            loglik += own
            headings.append(heading)
        return CellScores(loglik=loglik, headings=tuple(headings))

    def turned(
        self, photo: View, sigma: float, *, before: TurnScores | None, after: TurnScores
    ) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
        """Return the scores and turns of a photo, which go on from `before`, and fill `after`."""
        score = _scorer(photo, self._levels, sigma, before=before, after=after)
        return score(self._entries)

    def scorer_aside(
        self, view: View, *, north_sigma: float
    ) -> Callable[[NDArray[np.int64]], NDArray[np.float64]]:
        """Return what gives the log-likelihood of a view in some cells, at four places in each.

        It is the sum of `scores`, but who stands aside sees all objects aside.
        """
        levels, places = self._quarters
        scorers = [_scorer(one, levels, own_sigma(one, north_sigma)) for one in view.split()]
        return partial(self._aside, scorers, levels, places)

    def _aside(
        self,
        scorers: Sequence[_Scorer],
        levels: _Levels,
        places: NDArray[np.float64],
        cells: NDArray[np.int64],
    ) -> NDArray[np.float64]:
        from semsig_gis.localization.likelihood.off_centre import views_aside  # noqa: PLC0415 - numba loads slowly

        loglik = np.empty(len(cells))

        def look(part: NDArray[np.int64]) -> None:
            seen = views_aside(self.database, cells[slice(*part)], places)
            bins = (seen.bearings * (BINS / FULL_TURN)).astype(np.uint16) % np.uint16(BINS)
            units = distance_units_of(seen.distances, levels.table.reach)
            entries = levels.entries(seen.offsets, seen.codes, bins, units)
            total = sum(scorer(entries)[0] for scorer in scorers)
            by_place = np.asarray(total, np.float64).reshape(-1, len(places))
            loglik[slice(*part)] = np.logaddexp.reduce(by_place, axis=1) - math.log(len(places))

        share_rows(look, len(cells), least=CELLS_A_PART)
        return loglik

    def _by_counts(self, rows: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return the scores of a query without bearings."""
        from semsig_gis.localization.likelihood.kernels import count_types  # noqa: PLC0415

        types = self.database.type_sequences
        distinct = np.empty(len(types), np.float32)
        count_types(
            types.offsets,
            types.values,
            self.table.row_of,
            np.bincount(rows, minlength=len(self.table.codes) + 1),
            self.table.detected,
            self.table.named,
            self.table.clutter,
            distinct,
        )
        return distinct[types.inverse]


def turn_scores(cells: int, north_sigma: float) -> TurnScores:
    """Return room for the likelihood of a photo by turn."""
    turns = len(_turns(north_sigma)[1])
    return TurnScores(np.empty(cells, np.float32), np.empty((cells, turns), np.float32))


def _scorer(
    photo: View,
    levels: _Levels,
    north_sigma: float,
    *,
    before: TurnScores | None = None,
    after: TurnScores | None = None,
) -> _Scorer:
    """Return what gives the log-likelihood of a photo in every place, and its likeliest turns."""
    from semsig_gis.localization.likelihood.kernels import scan, scan_turned  # noqa: PLC0415 - slow to load

    table = levels.table
    asked = PhotoTable.of(photo, table)
    density = asked.density(table)
    rows, masses = levels.rows(asked), levels.masses(asked)
    named = asked.named(table)[: len(levels.detected)] / density
    what: dict[str, Any] = {
        "group_of": levels.group_of,
        "width": asked.width,
        "detected": levels.detected,
        "seen": levels.seen,
        "left": levels.left,
        "base": float(np.log(density).sum()),
    }
    if before is None:
        what["base"] -= float(table.clutter.sum() * asked.width)
    turned = north_sigma != 0.0
    if turned:
        by_detection = np.moveaxis(rows, 4, 1).reshape(-1, *rows.shape[1:4])[: len(density)]
        first, priors = _turns(north_sigma)
        what |= {
            "rows": _turned(by_detection),
            "masses": _turned(masses),
            "named": named.astype(np.float32),
            "disc": (asked.disc / FULL_TURN).astype(np.float32),
            "first": first,
            "priors": priors,
        }
        nothing = TurnScores(np.empty(0, np.float32), np.empty((0, len(priors)), np.float32))
        old, new = before or nothing, after or nothing
        what |= {"before_logs": old.logs, "before": old.shares}
        what |= {"logs": new.logs, "after": new.shares}
    else:
        what |= {
            "rows": rows,
            "masses": masses,
            "named": _padded(named),
            "disc": _padded(asked.disc / FULL_TURN),
        }

    def score(seen: _Entries) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
        size = len(seen.offsets) - 1
        places: dict[str, Any] = {
            "offsets": seen.offsets,
            "kinds": seen.kinds,
            "places": seen.places,
        }
        if not turned:
            totals, products = np.empty(size), np.empty(size)
            share_rows(partial(scan, **places, **what, totals=totals, products=products), size)
            totals += np.log(products)
            return totals.astype(np.float32), None
        scores, best = np.empty(size, np.float32), np.empty(size, np.int16)
        share_rows(partial(scan_turned, **places, **what, scores=scores, best=best), size)
        return scores, best * np.float32(FULL_TURN / TURNS)

    return score


def own_sigma(photo: View, north_sigma: float) -> float:
    """Return the standard deviation of the north of a photo, its own or that of all."""
    own = photo.photos[0].north_sigma
    return north_sigma if own is None else own


def _turns(north_sigma: float) -> tuple[int, NDArray[np.float64]]:
    """Return the first turn of a photo, in steps, and the chances of that and the next ones.

    Those that fill up the last block of `kernels.scan_turned` have no chance.
    """
    from semsig_gis.localization.likelihood.kernels import TURNED_LANES  # noqa: PLC0415 - numba loads slowly

    turns = np.arange(-TURNS // 2, TURNS // 2)
    chances = np.exp(-0.5 * (turns * (FULL_TURN / TURNS) / north_sigma) ** 2)
    likely = np.flatnonzero(chances > LEAST_PRIOR)
    chances = chances[likely] / chances[likely].sum()
    return int(turns[likely[0]]), np.pad(chances, (0, -len(chances) % TURNED_LANES))


def _turned(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return rows, shape (..., bins), with all turns of an object side by side."""
    from semsig_gis.localization.likelihood.kernels import turned_rows  # noqa: PLC0415 - numba loads slowly

    turned = np.empty((*rows.shape[:-1], BINS // TURNS, 2 * TURNS), np.float32)
    turned_rows(
        np.ascontiguousarray(rows.reshape(-1, BINS)),
        turned.reshape(-1, BINS // TURNS, 2 * TURNS),
    )
    return turned


def _padded(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return values, the last axis filled up to whole blocks with zeros."""
    from semsig_gis.localization.likelihood.kernels import LANES  # noqa: PLC0415

    size = values.shape[-1]
    more = [(0, 0)] * (values.ndim - 1) + [(0, _blocks(size) * LANES - size)]
    return np.pad(values, more).astype(np.float32)


def _blocks(size: int) -> int:
    """Return how many blocks hold so many detections: at least one."""
    from semsig_gis.localization.likelihood.kernels import LANES  # noqa: PLC0415

    return max(1, -(-size // LANES))


@dataclass(frozen=True, eq=False, slots=True)
class _Entries:
    """What is seen from some places, one after the other: class rows, and levels and bearings."""

    offsets: NDArray[np.int64]
    kinds: NDArray[np.uint8]
    places: NDArray[np.uint16]


@dataclass(frozen=True, eq=False, kw_only=True)
class _Levels:
    """A noise table at some distances, for classes grouped by their errors.

    `group_of` is by class row, `level_of` by distance unit; `sigma`, shape (groups, levels), is the
    deviation of bearings, `range_sigma` (groups,) and `blur` (levels,) that of logarithms of ranges
    by the detector and by the place, and `fine` the density of a deviation. By length of a
    signature and class, `detected` is the chance of detection of what is near; by class and level,
    `seen` is what is left of it, and `left` what has left the range.
    """

    table: NoiseTable
    group_of: NDArray[np.int64]
    level_of: NDArray[np.int64]
    sigma: NDArray[np.float64]
    range_sigma: NDArray[np.float64]
    distances: NDArray[np.float64]
    blur: NDArray[np.float64]
    fine: NDArray[np.float32]
    detected: NDArray[np.float32]
    seen: NDArray[np.float32]
    left: NDArray[np.float32]

    @classmethod
    def of(cls, table: NoiseTable) -> _Levels:
        """Return the levels of a table."""
        units = np.maximum(np.arange(DISTANCE_UNITS + 1), 1)
        level_of = np.rint((LEVELS - 1) * np.log(units) / math.log(DISTANCE_UNITS)).astype(np.int64)
        count = np.maximum(np.bincount(level_of, minlength=LEVELS), 1)
        logs = np.bincount(level_of, np.log(table.distances), LEVELS) / count
        distances = np.exp(logs)
        kinds = np.stack([table.sigma, table.range_sigma], axis=1)
        groups, group_of = np.unique(kinds, axis=0, return_inverse=True)
        turned = np.degrees(table.position_sigma / distances)
        sigma = np.minimum(np.hypot(groups[:, :1], turned), FULL_TURN / 2.0)
        away = np.arange(FINE) * (FULL_TURN / FINE)
        fine = np.zeros((*sigma.shape, FINE))
        for lap in LAPS:
            fine += np.exp(-0.5 * ((away + FULL_TURN * lap) / sigma[..., None]) ** 2)
        fine /= sigma[..., None] * math.sqrt(2.0 * math.pi)
        fine[fine < LEAST_DENSITY] = 0.0  # products of them would be slow to work out
        # Without draws that depend on the length of a signature, one row does for all.
        detected = table.detected
        same = (detected == detected[0]).all() and (table.misnamed == table.misnamed[0]).all()
        detected = detected[:1] if same else detected

        def by_level(shares: NDArray[np.float64]) -> NDArray[np.float32]:
            each = np.stack([np.bincount(level_of, row, LEVELS) / count for row in shares])
            return each.astype(np.float32)

        return cls(
            table=table,
            group_of=group_of.reshape(-1),
            level_of=level_of,
            sigma=sigma,
            range_sigma=groups[:, 1],
            distances=distances,
            blur=table.position_sigma / distances,
            fine=fine.astype(np.float32),
            detected=detected.astype(np.float32),
            seen=by_level(table.seen),
            left=by_level(table.left),
        )

    def entries(
        self,
        offsets: NDArray[np.int64],
        codes: NDArray[np.uint8],
        bins: NDArray[np.uint16],
        units: NDArray[np.uint8],
    ) -> _Entries:
        """Return what is seen, by class code, bearing in bins and distance unit."""
        places = (self.level_of * BINS).astype(np.uint16)[units]
        places += bins
        offsets = offsets.view()
        offsets.flags.writeable = False  # as a file's are, or kernels are loaded twice
        return _Entries(offsets, self.table.row_of.astype(np.uint8)[codes], places)

    def rows(self, asked: PhotoTable) -> NDArray[np.float32]:
        """Return the density of each detection by group, level and bearing of an object."""
        from semsig_gis.localization.likelihood.kernels import LANES, profile_rows  # noqa: PLC0415

        near = np.ones((*self.sigma.shape, len(asked.bearings)))
        known = ~np.isnan(asked.ranges)
        if known.any():
            errors = np.stack(
                [
                    asked.range_sigma(self.table)[self.group_of == group][0]
                    for group in range(len(self.sigma))
                ]
            )
            error = np.hypot(errors[:, None, known], self.blur[:, None])
            away = np.log(asked.ranges[known] / self.distances[:, None]) / error
            near[..., known] = np.exp(-0.5 * away**2) / (error * math.sqrt(2.0 * math.pi))
        rows = np.zeros((_blocks(len(asked.bearings)), *self.sigma.shape, BINS, LANES), np.float32)
        shifts = np.rint(asked.bearings * (FINE / FULL_TURN)).astype(np.int64)
        near[near < LEAST_DENSITY] = 0.0
        profile_rows(self.fine, shifts, near.astype(np.float32), rows)
        return rows

    def masses(self, asked: PhotoTable) -> NDArray[np.float32]:
        """Return the chance that an object is in the sectors, by group, level and bearing."""
        from semsig_gis.localization.likelihood.association_kernels import mass_rows  # noqa: PLC0415

        levels = LEVELS if len(asked.sectors) else 0
        masses = np.empty((len(self.sigma), levels, BINS), np.float32)
        if levels:
            mass_rows(self.sigma, asked.sectors, masses)
        return masses


def build_index(database: SignatureDatabase, noise: Noise) -> LikelihoodIndex:
    """Return what views are compared with: the cells of a database, by a noise model.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    noise : NoiseSpec or NoiseMixture
        The noise model.

    Returns
    -------
    LikelihoodIndex
        Both, ready for queries.

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
    index = LikelihoodIndex(database=database, noise=noise)
    _ = index.models
    return index


def index_fingerprint(database: SignatureDatabase, noise: Noise) -> str:
    """Return 32 hexadecimal digits that change with the database, the noise model and `VERSION`."""
    specs = json.dumps([VERSION, noise.to_dict(), database.taxonomy.to_list(), database.reach])
    digest = hashlib.blake2b(specs.encode(), digest_size=16)
    for array in (
        database.columns,
        database.rows,
        database.offsets,
        database.codes,
        database.bearing_units,
        database.distance_units,
    ):
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()
