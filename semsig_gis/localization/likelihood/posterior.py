"""The chance of every cell, and the place between the cells.

A place is sought part by part of the likeliest cells: a part of side s counts with an uncertainty
of ``s / 12 ** 0.5`` each way, the deviation of places anywhere in it, so that its likelihood stands
for the mean over the part.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import Displayed, InputError, cell_ids, percent, signed_degrees
from semsig_gis.database import visible_objects_at
from semsig_gis.localization.likelihood.association import turn_logs
from semsig_gis.localization.likelihood.index import own_sigma
from semsig_gis.localization.likelihood.photo import PhotoTable, photo_loglik
from semsig_gis.localization.noise.table import LONGEST_TABLE, noise_tables
from semsig_gis.observation import View, check_north

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core import ObjectIndex, Signature
    from semsig_gis.database import Footprints, SignatureDatabase
    from semsig_gis.localization.noise.model import Noise
    from semsig_gis.objects import StreetObjects


LEAST_LOG = -700.0  # whose exponential is a number
ROUNDING = 1e-3  # of a sum of chances that were written as float32
PLACES = 1000
"""Likeliest cells among which the best place is looked for."""
LEAST_POWER = -1100  # of two, below which there is no number


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Posterior(Displayed):
    """The chance that a query was seen from each cell of a database.

    Parameters
    ----------
    database, chances : SignatureDatabase, and ndarray of float64, shape (n,)
        The cells, and their chances, which sum to one.

    Examples
    --------
    >>> flat = posterior(demo_database, np.zeros(len(demo_database)))
    >>> bool(np.isclose(flat.entropy, np.log2(len(demo_database))))
    True
    """

    database: SignatureDatabase
    chances: NDArray[np.float64]

    def _facts(self) -> dict[str, object]:
        (best,) = self.likeliest(1).tolist()
        return {
            "cells": len(self.chances),
            "entropy": f"{self.entropy:.1f} bits",
            "likeliest cell": self.database.cell_ids[best],
            "its chance": percent(self.chances[best]),
        }

    @cached_property
    def _powers(self) -> NDArray[np.int64]:
        """The powers of two of the chances, from `LEAST_POWER` on; 0 where there is no chance."""
        return np.where(self.chances > 0, np.frexp(self.chances)[1] - LEAST_POWER, 0)

    def _top(self, amount: float, chances: NDArray[np.float64] | None = None) -> NDArray[np.int64]:
        """Return the cells that may be among the likeliest that make up an amount, in any order.

        It is a number of cells or, with the chances, a share of these. To sort all takes longer.
        """
        held = np.cumsum(np.bincount(self._powers, chances)[::-1])
        power = len(held) - 1 - int(np.searchsorted(held, amount))
        return np.flatnonzero(self._powers >= power)

    def likeliest(self, count: int) -> NDArray[np.int64]:
        """Return the row numbers of so many cells, likeliest first, or all if there are fewer."""
        cells = self._top(count)
        if len(cells) > 2 * count:
            some = self.chances[cells]
            # Of the negative, because equal zeros at the beginning would take ten times as long.
            least = -np.partition(-some, count - 1)[count - 1]
            above, equal = cells[some > least], cells[some == least]
            cells = np.concatenate([above, equal[: count - len(above)]])
        return _likeliest_first(self.chances, cells)[:count]

    @property
    def entropy(self) -> float:
        """How uncertain the cell is, in bits: 0 for one cell, 1 for two equally likely, ..."""
        chances = self.chances[self.chances > 0]
        return float(-(chances * np.log2(chances)).sum())

    def credible_cells(self, share: float = 0.9) -> NDArray[np.int64]:
        """Return the row numbers of the fewest cells that contain a share of the chance.

        The share is above 0 and at most 1, or raises `InputError`. Likeliest first, equal chances
        in the order of the database; cells without any chance are never among them.
        """
        if not 0 < share <= 1:
            raise InputError(
                f"a region of a share of {share} was asked for; give a number above 0, at most 1."
            )
        # The small term keeps a sum of 0.9 - 1e-17 from asking for one cell more.
        share *= 1.0 - 1e-12
        cells = self._top(share, self.chances)
        cells = _likeliest_first(self.chances, cells[self.chances[cells] > 0])
        return cells[: int(np.searchsorted(np.cumsum(self.chances[cells]), share)) + 1]

    def mass_within(
        self, radius: float, cells: NDArray[np.int64] | None = None
    ) -> NDArray[np.float64]:
        """Return the chance that the place is at most `radius` metres from a cell, shape (c,).

        It is the sum over the viewpoints in the circle, for some cells (row numbers) or all. A
        radius that is negative or not finite raises `InputError`.
        """
        if not (math.isfinite(radius) and radius >= 0):
            raise InputError(f"a radius of {radius} m was given; give metres, 0 or more.")
        database = self.database
        centres = slice(None) if cells is None else cells
        columns = database.columns[centres].astype(np.int64)
        rows = database.rows[centres].astype(np.int64)
        # The cells are ordered by column and row: in each column, the circle is one run of them.
        ids = database.cell_ids
        before = np.concatenate([[0.0], np.cumsum(self.chances)])
        # All cells are within the diagonal of the city.
        most = np.hypot(np.ptp(database.columns), np.ptp(database.rows)) + 1.0
        steps = min(radius / database.grid.step + 1e-9, float(most))
        total = np.zeros(len(columns))
        for aside in range(-math.floor(steps), math.floor(steps) + 1):
            up = math.floor(math.sqrt(steps**2 - aside**2))
            low = np.searchsorted(ids, cell_ids(columns + aside, rows - up), side="left")
            high = np.searchsorted(ids, cell_ids(columns + aside, rows + up), side="right")
            total += before[high] - before[low]
        return np.clip(total, 0.0, 1.0)

    def best_place(self, radius: float = 50.0) -> tuple[int, float]:
        """Return the cell around which the place most probably lies, and the chance that it does.

        Of the thousand likeliest cells it is the one with most of the chance within `radius`
        metres, of equals the likeliest.
        """
        cells = np.sort(self.likeliest(PLACES))
        # In steps, so that rounding does not choose among equals.
        mass = np.round(self.mass_within(radius, cells), 9)
        best = np.lexsort((-self.chances[cells], -mass))[0]
        return int(cells[best]), float(mass[best])


def open_posterior(path: str | Path, database: SignatureDatabase) -> Posterior:
    """Read the chances of all cells from a raster that `export_answer` wrote.

    Parameters
    ----------
    path : str or Path
        GeoTIFF with the chances.
    database : SignatureDatabase
        The database that was searched.

    Returns
    -------
    Posterior
        The chances, to the precision of the file.

    Raises
    ------
    SourceError
        If the file cannot be read as a raster.
    CrsError
        If its CRS is missing or does not fit that of the database.
    InputError
        If it does not contain the chances of the cells of the database.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import build_index, export_answer, locate, named_noise
    >>> index = build_index(demo_database, named_noise("generic"))
    >>> location = locate(index, demo_database.signature(0))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = export_answer(location, demo_database, f"{folder}/chances.tif")
    ...     again = open_posterior(f"{folder}/chances.tif", demo_database)
    >>> bool(np.allclose(again.chances, location.chances, atol=1e-6))
    True
    """
    from semsig_gis.storage import raster_at_cells  # noqa: PLC0415 - GDAL loads slowly

    chances = raster_at_cells(
        path,
        grid=database.grid,
        columns=database.columns,
        rows=database.rows,
        crs=database.crs,
    )
    total = chances.sum()
    if not (chances >= 0).all() or not math.isclose(total, 1.0, abs_tol=ROUNDING):
        raise InputError(
            f"{path} does not contain the chances of the cells of this database, which add up to "
            "1; give a .tif file that semsig localize --out wrote for it."
        )
    return Posterior(database=database, chances=chances / total)


def _likeliest_first(chances: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return some cells by falling chance, equal ones by row."""
    # One number for each, the row behind all but the last digits of the chance: plain numbers are
    # sorted ten times faster than pairs.
    bits = int(cells.max(initial=0)).bit_length()
    numbers = ~chances[cells].view(np.int64) >> bits << bits | cells
    numbers.sort()
    cells = numbers & ((1 << bits) - 1)
    if (np.diff(chances[cells]) > 0).any():
        cells.sort()
        cells = cells[np.argsort(-chances[cells], kind="stable")]
    return cells


def posterior(
    database: SignatureDatabase,
    loglik: ArrayLike,
    *,
    log_prior: NDArray[np.float64] | None = None,
) -> Posterior:
    """Return chances that are proportional to likelihood times prior, both as logarithms by cell.

    Both are up to a constant; without `log_prior` (see `likelihood.priors`) all cells are alike.
    Raises `InputError` if a number is NaN or plus infinity, or no cell is possible.
    """
    parts = [loglik] if log_prior is None else [loglik, log_prior]
    total = np.zeros(database.columns.size)
    for part in parts:
        values = np.asarray(part, dtype=np.float64)
        if values.shape != total.shape:
            raise InputError(
                f"{values.size} likelihoods or priors were given for {total.size} cells; "
                "give one for each cell."
            )
        total += values
    top = total.max()
    if np.isnan(top) or top == np.inf:
        raise InputError("a likelihood or a prior is not a number or is infinite; give logarithms.")
    if top == -np.inf:
        raise InputError("the prior excludes every cell that the query may be in; widen it.")
    chances = np.exp(total - top)
    return Posterior(database=database, chances=chances / chances.sum())


def prior_ratio(loglik: NDArray[np.floating], log_prior: NDArray[np.float64]) -> float:
    """Return how much likelier a query is under a prior than with all cells alike.

    Both are logarithms by cell, shape (n,), up to a constant: with chances p of the prior and
    likelihoods l, it is ``sum(p * l) / mean(l)``. Where the prior is right, it is below r for at
    most a share r of the queries, as its inverse is 1 in the mean (Markov's inequality).
    """
    both = np.logaddexp.reduce(loglik + log_prior) - np.logaddexp.reduce(log_prior)
    alike = np.logaddexp.reduce(loglik.astype(np.float64)) - math.log(len(loglik))
    return math.exp(max(float(both - alike), LEAST_LOG))


KEPT = (1000, 400, 200, 100)
"""How many parts are divided, level by level: cells, their quarters, and so on."""
LEAST_CHANCE = 1e-6  # of a part, against the likeliest, to be divided
TURNS = (7.5, 6.0, 4.5, 3.0)  # degrees to each side that are tried, level by level
TURNS_A_SIDE = 2
NEAR = 25.0  # metres from the best place that are averaged over
BEST = 300  # likeliest parts among which the best place is looked for
CORNERS = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])


@dataclass(frozen=True, eq=False, kw_only=True)
class Refinement:
    """The chances of places on and off the grid.

    By square part of a cell: `places`, shape (p, 2), its middle in metres; `sizes`, the length of
    its sides; `loglik`, the mean over the part; `headings`, the mean degrees to add to the bearings
    of the query (0 if north is known), with `heading_sigmas`; and `chances`, which sum to one. The
    best place is averaged over `near` metres around it.
    """

    places: NDArray[np.float64]
    sizes: NDArray[np.float64]
    loglik: NDArray[np.float64]
    headings: NDArray[np.float64]
    heading_sigmas: NDArray[np.float64]
    chances: NDArray[np.float64]
    near: float

    @property
    def mass(self) -> float:
        """Chance that the place is within `near` of the best one."""
        return float(self.chances[self._inside].sum())

    @cached_property
    def xy(self) -> tuple[float, float]:
        """The mean place around the best one, in metres."""
        inside = self._inside
        x, y = np.average(self.places[inside], axis=0, weights=self.chances[inside]).tolist()
        return x, y

    @cached_property
    def heading(self) -> float:
        """Degrees to add to the bearings of the query there, in [-180, 180)."""
        angles = np.radians(self.headings[self._inside])
        mean = np.exp(1j * angles) @ self.chances[self._inside]
        return float(signed_degrees(math.degrees(float(np.angle(mean)))))

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Of x, y (metres) and heading (degrees) around the best place, shape (3, 3)."""
        inside = self._inside
        weights = self.chances[inside] / self.chances[inside].sum()
        turned = signed_degrees(self.headings[inside] - self.heading)
        away = np.column_stack([self.places[inside] - self.xy, turned])
        covariance = (weights[:, None] * away).T @ away
        # The place may be anywhere in a part.
        covariance[[0, 1], [0, 1]] += weights @ self.sizes[inside] ** 2 / 12.0
        covariance[2, 2] += weights @ self.heading_sigmas[inside] ** 2
        return np.asarray(covariance)

    @cached_property
    def _inside(self) -> NDArray[np.bool_]:
        """Which parts are near the one around which most of the chance lies."""
        order = np.argsort(-self.chances, kind="stable")[:BEST]
        away = self.places[order, None] - self.places[None]
        inside = np.hypot(away[..., 0], away[..., 1]) <= self.near
        return np.asarray(inside[np.round(inside @ self.chances, 9).argmax()])


def refine(
    query: Signature,
    cells: NDArray[np.float64],
    noise: Noise,
    *,
    objects: StreetObjects,
    index: ObjectIndex,
    step: float = 10.0,
    radius: float = 30.0,
    north_sigma: float = 0.0,
    headings: Sequence[NDArray[np.floating] | None] | None = None,
    log_prior: NDArray[np.float64] | None = None,
    footprints: Footprints | None = None,
) -> Refinement:
    """Look for the place of a query within some cells; chances are likelihood times area.

    The query needs bearings; its types may be unknown. `cells`, shape (c, 2), are the middles in
    metres of the likeliest cells, likeliest first; some hundred will do. `noise` is for a known
    place. `step` and `radius` are in metres, `north_sigma`, of photos that do not tell their own,
    in degrees; where it is not 0, `headings`, by photo the likeliest one in each cell, are needed.
    Those of the parts are of the first photo. `log_prior` is what else is known of the
    cells.
    """
    check_north(north_sigma)
    photos = View.of(query).split()
    looked_for = [own_sigma(photo, north_sigma) for photo in photos]
    before = (None,) * len(photos) if headings is None else headings
    if len(cells) == 0 or any(
        sigma > 0 and heading is None for sigma, heading in zip(looked_for, before, strict=True)
    ):
        raise InputError(
            f"{len(cells)} cells and {'no' if headings is None else 'some'} headings were given; "
            "give at least one cell, and headings where north is not known."
        )
    tables, weights = noise_tables(
        noise,
        taxonomy=objects.taxonomy,
        codes=np.unique(objects.codes),
        longest=LONGEST_TABLE,
        radius=radius,
    )
    asked = [PhotoTable.of(photo, tables[0]) for photo in photos]
    size = float(step)
    parts = np.asarray(cells[: KEPT[0]], dtype=np.float64)
    prior = np.zeros(len(parts)) if log_prior is None else np.asarray(log_prior)[: KEPT[0]]
    turned = np.stack(
        [
            np.zeros(len(parts)) if heading is None else np.asarray(heading)[: KEPT[0]]
            for heading in before
        ]
    )
    finished: list[tuple[NDArray[np.float64], ...]] = []
    for level, turn in enumerate(TURNS):
        parts = (parts[:, None] + CORNERS * (size / 4.0)).reshape(-1, 2)
        prior, turned = np.repeat(prior, 4), np.repeat(turned, 4, axis=1)
        size /= 2.0
        views = visible_objects_at(
            objects, parts, index=index, radius=radius, footprints=footprints
        )
        wide = [
            replace(table, position_sigma=math.hypot(table.position_sigma, size / math.sqrt(12.0)))
            for table in tables
        ]
        loglik, sigmas = np.zeros(len(parts)), np.zeros(len(parts))
        for number in reversed(range(len(photos))):  # what is told of headings is the first one's
            sigma = looked_for[number]
            steps = np.linspace(-turn, turn, 2 * TURNS_A_SIDE + 1) if sigma > 0 else np.zeros(1)
            turns = turned[number][:, None] + steps
            chances = np.zeros(turns.shape)
            if sigma > 0:
                chances = turn_logs(turns, steps[1] - steps[0], sigma)
            by_turn = chances + photo_loglik(
                asked[number],
                views,
                wide,
                weights,
                turns=turns,
                log_prior=chances + prior[:, None],
                # A place that does not fit one photo may fit the others.
                whole=len(photos) == 1,
            )
            own = np.logaddexp.reduce(by_turn, axis=1)
            shares = np.exp(by_turn - own[:, None])
            turned[number] = (shares * turns).sum(axis=1)
            sigmas = np.sqrt((shares * (turns - turned[number][:, None]) ** 2).sum(axis=1))
            loglik += own
        total = loglik + prior
        divided = np.zeros(len(parts), np.bool_)
        if level + 1 < len(TURNS):
            best = np.argsort(-total, kind="stable")[: KEPT[level + 1]]
            divided[best] = total[best] > total[best[0]] + math.log(LEAST_CHANCE)
        columns = parts, np.full(len(parts), size), loglik, prior, turned[0], sigmas
        finished.append(tuple(column[~divided] for column in columns))
        parts, prior, turned = parts[divided], prior[divided], turned[:, divided]
    places, sizes, loglik, prior, first, sigmas = map(np.concatenate, zip(*finished, strict=True))
    weight = loglik + prior + 2.0 * np.log(sizes)
    chances = np.exp(weight - weight.max())
    return Refinement(
        places=places,
        sizes=sizes,
        loglik=loglik,
        headings=signed_degrees(first),
        heading_sigmas=sigmas,
        chances=chances / chances.sum(),
        near=NEAR,
    )
