"""The chance of every cell, and the place between the cells.

The likeliest cells are divided into parts, and the likeliest parts again. A part of side s is
scored with a position uncertainty of ``s / 12 ** 0.5`` in x and y, the deviation of a uniform
distribution, so that its likelihood is about the mean over the part.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from semsig_gis.core import (
    ROW_SPAN,
    Displayed,
    InputError,
    cell_ids,
    log_sum,
    percent,
    signed_degrees,
)
from semsig_gis.database import TOLERANCE_M, visible_objects_at
from semsig_gis.localization.likelihood.index import own_sigma, photo_power
from semsig_gis.localization.likelihood.photo import PhotoTable, photo_loglik
from semsig_gis.localization.likelihood.turns import turn_logs
from semsig_gis.localization.noise.model import cell_noise
from semsig_gis.localization.noise.table import LONGEST_TABLE, noise_tables
from semsig_gis.observation import View, check_north

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import ObjectStore, SignatureDatabase
    from semsig_gis.localization.noise.model import Noise

LEAST_LOG = -700.0  # its exponential is above 0
ROUNDING = 1e-3  # of a sum of chances in a file of float32
NO_CHANCE = 1e-16  # smaller ones add less than 1e-9 bits to the entropy of a large city
LIKELIEST_CELLS = 1000
"""Cells among which the best place is searched."""
MANTISSA_BITS = 52  # of a float64; its exponent is above them
LEAST_CHANCE = float(np.finfo(np.float64).smallest_subnormal)


class Places(NamedTuple):
    """Distinct places, likeliest first, shape (p,) each: no cell is in two of them.

    `centres` are the rows of the cells in their middle, `cells` those of their likeliest cells, and
    `chances` the sums over their cells.
    """

    centres: NDArray[np.int64]
    cells: NDArray[np.int64]
    chances: NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Posterior(Displayed):
    """The chance that a query was seen from each cell of a database.

    Parameters
    ----------
    database, chances : SignatureDatabase, and ndarray of float64, shape (n,)
        The cells, and their chances, which sum to one.
    log_evidence : float, default NaN
        Logarithm of the likelihood of the query in this area: its mean over the prior. That of a
        route is for all its views. NaN if not known.

    Examples
    --------
    >>> flat = posterior(demo_database, np.zeros(len(demo_database)))
    >>> bool(np.isclose(flat.entropy, np.log2(len(demo_database))))
    True
    """

    database: SignatureDatabase
    chances: NDArray[np.float64]
    log_evidence: float = math.nan

    def _facts(self) -> dict[str, object]:
        (best,) = self.likeliest(1).tolist()
        return {
            "cells": len(self.chances),
            "entropy": f"{self.entropy:.1f} bits",
            "likeliest cell": self.database.cell_ids[best],
            "its chance": percent(self.chances[best]),
        }

    @cached_property
    def _by_power(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The number and the chance of possible cells by the binary exponent of their chance."""
        from semsig_gis.localization.likelihood.place_kernels import sum_powers  # noqa: PLC0415 - numba, 0.25 s

        powers = 2 * np.finfo(np.float64).maxexp
        by_power = np.zeros(powers, np.int64), np.zeros(powers)
        chances = np.ascontiguousarray(self.chances, dtype=np.float64)
        sum_powers(chances, chances.view(np.int64) >> MANTISSA_BITS, *by_power)
        return by_power

    def _top(self, amount: float, *, share: bool = False) -> NDArray[np.int64]:
        """Return possible cells that include the likeliest ones up to an amount, in any order.

        The amount is a number of cells or a `share` of the chance. Sorting all takes longer.
        """
        amounts = np.cumsum(self._by_power[int(share)][::-1])
        power = len(amounts) - 1 - int(np.searchsorted(amounts, amount))
        least = np.array([max(power, 0) << MANTISSA_BITS]).view(np.float64)
        return np.flatnonzero(self.chances >= max(float(least[0]), LEAST_CHANCE))

    def likeliest(self, count: int) -> NDArray[np.int64]:
        """Return the row numbers of the `count` likeliest cells, likeliest first."""
        if count == 1:
            return np.array([self.chances.argmax()])
        cells = self._top(count)
        if len(cells) < min(count, len(self.chances)):
            cells = np.arange(len(self.chances))  # impossible cells are the least likely
        if len(cells) > 2 * count:
            some = self.chances[cells]
            # Partition the negatives: many equal zeros at the start take ten times as long.
            least = -np.partition(-some, count - 1)[count - 1]
            above, equal = cells[some > least], cells[some == least]
            cells = np.concatenate([above, equal[: count - len(above)]])
        return _likeliest_first(self.chances, cells)[:count]

    @property
    def entropy(self) -> float:
        """How uncertain the cell is, in bits: 0 for one cell, 1 for two equally likely, ..."""
        chances = self.chances[self.chances > NO_CHANCE]
        return float(-(chances * np.log2(chances)).sum())

    def credible_cells(self, share: float = 0.9) -> NDArray[np.int64]:
        """Return the row numbers of the fewest cells that contain a share of the chance.

        Likeliest first, equal chances in the order of the database, never cells of chance 0. Raises
        `InputError` if the share is not above 0 and at most 1.
        """
        if not 0 < share <= 1:
            raise InputError(
                f"a region of a share of {share} was asked for; give a number above 0, at most 1."
            )
        # A sum of 0.9 - 1e-17 must not add another cell.
        share *= 1.0 - 1e-12
        cells = _likeliest_first(self.chances, self._top(share, share=True))
        return cells[: int(np.searchsorted(np.cumsum(self.chances[cells]), share)) + 1]

    def mass_within(
        self, radius: float, cells: NDArray[np.int64] | None = None
    ) -> NDArray[np.float64]:
        """Return the chance that the place is at most `radius` metres from a cell, shape (c,).

        It is the sum over the viewpoints in the circle, for some cells (row numbers) or all. Raises
        `InputError` if the radius is negative or not finite.
        """
        if not (math.isfinite(radius) and radius >= 0):
            raise InputError(f"a radius of {radius} m was given; give metres, 0 or more.")
        from semsig_gis.localization.likelihood.place_kernels import sum_circles  # noqa: PLC0415 - numba, 0.25 s

        database = self.database
        centres = slice(None) if cells is None else cells
        columns = database.columns[centres].astype(np.int64)
        rows = database.rows[centres].astype(np.int64)
        # The cells are ordered by column and row: in each column, the circle is one slice.
        before, total = np.zeros(len(self.chances) + 1), np.empty(len(columns))
        np.cumsum(self.chances, out=before[1:])
        _, east, north = self._circle(radius)
        ids = cell_ids(columns, rows)
        sum_circles(ids, database.cell_ids, before, ROW_SPAN * east, north, total)
        return np.clip(total, 0.0, 1.0)

    def best_place(self, radius: float = 50.0) -> tuple[int, float]:
        """Return the cell that the place is most probably near, and the chance of that.

        It is the one of the thousand likeliest cells with the most chance within `radius` metres,
        of equals the likeliest.
        """
        place = self.places(1, radius=radius)
        return int(place.centres[0]), round(float(place.chances[0]), 9)

    def places(self, count: int, *, radius: float = 50.0) -> Places:
        """Return at most `count` distinct places that are possible, likeliest first.

        A place is all cells at most `radius` metres from its centre that are in no earlier place.
        Its centre is, of the thousand likeliest cells without those in earlier places, the one with
        the most chance left within the radius, of equals the likeliest.
        """
        from semsig_gis.localization.likelihood.place_kernels import take_places  # noqa: PLC0415 - numba, 0.25 s

        database = self.database
        likely = self.likeliest(LIKELIEST_CELLS)
        order = np.argsort(likely)
        sums = np.empty(len(likely))
        sums[order] = self.mass_within(radius, likely[order])
        most = min(count, len(likely))
        places = Places(np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most))
        number = take_places(
            likely,
            database.columns[likely].astype(np.int64),
            database.rows[likely].astype(np.int64),
            sums,
            database.cell_ids,
            self.chances,
            self._circle(radius),
            ROW_SPAN,
            *places,
        )
        filled: list[Any] = [values[:number] for values in places]
        return Places(*filled)

    def _circle(self, radius: float) -> tuple[float, NDArray[np.int64], NDArray[np.int64]]:
        """Return a radius in cells, the columns in its circle, and the last row in each."""
        # All cells are within the diagonal of the city.
        most = np.hypot(np.ptp(self.database.columns), np.ptp(self.database.rows)) + 1.0
        steps = min(radius / self.database.grid.step + 1e-9, float(most))
        east = np.arange(-math.floor(steps), math.floor(steps) + 1)
        return steps, east, np.floor(np.sqrt(steps**2 - east**2)).astype(np.int64)


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
        The chances, with the precision of the file.

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
    from semsig_gis.storage import raster_at_cells  # noqa: PLC0415 - GDAL, 0.08 s

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
    # One integer per cell, the leading bits of the chance and then the row: integers are sorted ten
    # times faster than pairs.
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
    """Return chances proportional to likelihood times prior, both given as logarithms by cell.

    Both are up to a constant; without `log_prior` (see `likelihood.priors`) the prior is uniform.
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
    total -= top
    chances = np.exp(total, out=total)
    prior = math.log(total.size) if log_prior is None else log_sum(log_prior)
    mass = chances.sum()
    chances /= mass
    return Posterior(
        database=database, chances=chances, log_evidence=float(top + np.log(mass) - prior)
    )


def prior_ratio(loglik: NDArray[np.floating], log_prior: NDArray[np.float64]) -> float:
    """Return the ratio of the likelihoods of a query under a prior and a uniform prior.

    Both are logarithms by cell, shape (n,), up to a constant: with chances p of the prior and
    likelihoods l, it is ``sum(p * l) / mean(l)``. If the prior is right, it is below r for at most
    a share r of the queries, because its inverse has a mean of 1 (Markov's inequality).
    """
    both = log_sum(loglik + log_prior) - log_sum(log_prior)
    uniform = log_sum(loglik.astype(np.float64)) - math.log(len(loglik))
    return math.exp(max(both - uniform, LEAST_LOG))


DIVIDED_PARTS = (1000, 400, 200, 100)
"""The most parts that are divided at each level: cells, their quarters, and so on."""
LEAST_PART_CHANCE = 1e-6  # of a part, relative to the likeliest, to be divided
LEVEL_TURNS = (7.5, 6.0, 4.5, 3.0)  # degrees to each side that are tried, by level
TURNS_A_SIDE = 2
NEAR = 25.0  # metres from the best place that are averaged over
BEST_PARTS = 300  # likeliest parts among which the best place is searched
CORNERS = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])


@dataclass(frozen=True, eq=False, kw_only=True)
class Refinement:
    """Chances of square parts of cells, for a place that is more precise than a cell.

    By square part of a cell: `places`, shape (p, 2), are centres and `sizes` sides in metres;
    `loglik` is the mean over the part; `headings` are the mean degrees to add to the bearings of
    the query (0 if north is known), with `heading_sigmas`; `chances` sum to one. `cells` are the
    rows of the cells. The best place is the mean over `near` metres around it.
    """

    cells: NDArray[np.int64]
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
        """The parts near the part with the most chance around it."""
        order = np.argsort(-self.chances, kind="stable")[:BEST_PARTS]
        away = self.places[order, None] - self.places[None]
        inside = np.hypot(away[..., 0], away[..., 1]) <= self.near
        return np.asarray(inside[np.round(inside @ self.chances, 9).argmax()])


def holding(chances: NDArray[np.float64], rest: float) -> NDArray[np.int64]:
    """Return the fewest numbers that hold all of some chances but a share, likeliest first."""
    order = np.argsort(-chances, kind="stable")
    sums = np.cumsum(chances[order])
    return order[: int(np.searchsorted(sums, (1.0 - rest) * sums[-1])) + 1]


def refine(
    query: Signature,
    cells: NDArray[np.float64],
    noise: Noise,
    *,
    store: ObjectStore,
    step: float = 10.0,
    radius: float = 30.0,
    north_sigma: float = 0.0,
    headings: Sequence[NDArray[np.floating] | None] | None = None,
    log_prior: NDArray[np.float64] | None = None,
    occlusion: float | None = TOLERANCE_M,
) -> Refinement:
    """Search the place of a query within some cells; chances are likelihood times area.

    The query needs bearings; its types may be unknown. `cells`, shape (c, 2), are the centres in
    metres of the likeliest cells, likeliest first; some hundred are enough. `noise` is for a known
    place. `step` and `radius` are in metres; `north_sigma`, in degrees, is for photos without their
    own. If it is not 0, `headings` are required: by photo, the likeliest one in each cell. Those of
    the result are of the first photo, and its cells are rows of `cells`. `log_prior` is the prior
    of the cells. If `occlusion`, that of the database, is None, the buildings of the store hide
    nothing.
    """
    check_north(north_sigma)
    photos = View.of(query).split()
    north_sigmas = [own_sigma(photo, north_sigma) for photo in photos]
    first_headings = (None,) * len(photos) if headings is None else headings
    if len(cells) == 0 or any(
        sigma > 0 and heading is None
        for sigma, heading in zip(north_sigmas, first_headings, strict=True)
    ):
        raise InputError(
            f"{len(cells)} cells and {'no' if headings is None else 'some'} headings were given; "
            "give at least one cell, and headings where north is not known."
        )
    objects = store.objects
    size, most = float(step), DIVIDED_PARTS[0]
    near = objects.taxonomy.near_reach(radius)
    footprints = store.buildings_around(cells, distance=near + size, occlusion=occlusion)
    parts = np.asarray(cells[:most], dtype=np.float64)
    owners = np.arange(len(parts))
    prior = np.zeros(len(parts)) if log_prior is None else np.asarray(log_prior)[:most]
    turned = np.stack(
        [
            np.zeros(len(parts)) if heading is None else np.asarray(heading)[:most]
            for heading in first_headings
        ]
    )
    finished: list[tuple[NDArray[Any], ...]] = []
    for level, turn in enumerate(LEVEL_TURNS):
        # Quarters of the parts, with a place anywhere in them.
        parts = (parts[:, None] + CORNERS * (size / 4.0)).reshape(-1, 2)
        owners, prior = np.repeat(owners, 4), np.repeat(prior, 4)
        turned = np.repeat(turned, 4, axis=1)
        size /= 2.0
        views = visible_objects_at(
            objects, parts, index=store.index, radius=radius, footprints=footprints
        )
        tables, weights = noise_tables(
            cell_noise(noise, size),
            taxonomy=objects.taxonomy,
            codes=objects.present_codes,
            longest=LONGEST_TABLE,
            radius=radius,
        )
        loglik, sigmas = np.zeros(len(parts)), np.zeros(len(parts))
        for number in reversed(range(len(photos))):  # `sigmas` are at last those of the first
            sigma = north_sigmas[number]
            steps = np.linspace(-turn, turn, 2 * TURNS_A_SIDE + 1) if sigma > 0 else np.zeros(1)
            turns = turned[number][:, None] + steps
            chances = turn_logs(turns, steps[1] - steps[0], sigma) if sigma > 0 else 0.0 * turns
            by_turn = chances + photo_loglik(
                PhotoTable.of(photos[number], tables[0]),
                views,
                tables,
                weights,
                turns=turns,
                log_prior=chances + prior[:, None],
                # A place that does not fit one photo may fit the others.
                whole=len(photos) == 1,
            )
            # The sum over the turns, and their mean and deviation.
            own = np.logaddexp.reduce(by_turn, axis=1)
            shares = np.exp(by_turn - own[:, None])
            turned[number] = (shares * turns).sum(axis=1)
            sigmas = np.sqrt((shares * (turns - turned[number][:, None]) ** 2).sum(axis=1))
            loglik += own * photo_power(len(photos), noise)
        # The likeliest parts are divided at the next level; the others are finished.
        total = loglik + prior
        divided = np.zeros(len(parts), np.bool_)
        if level + 1 < len(LEVEL_TURNS):
            best = np.argsort(-total, kind="stable")[: DIVIDED_PARTS[level + 1]]
            divided[best] = total[best] > total[best[0]] + math.log(LEAST_PART_CHANCE)
        sizes = np.full(len(parts), size)
        columns = owners, parts, sizes, loglik, prior, turned[0], sigmas
        finished.append(tuple(column[~divided] for column in columns))
        owners, parts, prior = owners[divided], parts[divided], prior[divided]
        turned = turned[:, divided]
    owners, places, sizes, loglik, prior, first, sigmas = map(
        np.concatenate, zip(*finished, strict=True)
    )
    weight = loglik + prior + 2.0 * np.log(sizes)
    chances = np.exp(weight - weight.max())
    return Refinement(
        cells=owners,
        places=places,
        sizes=sizes,
        loglik=loglik,
        headings=signed_degrees(first),
        heading_sigmas=sigmas,
        chances=chances / chances.sum(),
        near=NEAR,
    )
