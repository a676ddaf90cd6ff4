"""What each thing that a detector may tell adds to the log-likelihood of every cell.

A column holds, for a class t and a step of bearings, ``log(1 + sum_i (o_i N + g_i / 360) C(i, t) /
lambda(t))``: what a detection there adds, less ``log(lambda(t))``, which is the same for all cells.
Of object i, o are the odds of detection, N is the mean density over the step, and g the chance that
another of its class is detected in its stead, as it is out of range (`likelihood.photo`).
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import BEARING_UNITS, FULL_TURN
from semsig_gis.localization import query_bearings
from semsig_gis.observation import FULL_VIEW

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import LikelihoodIndex, NoiseTable
    from semsig_gis.observation import Photo

BINS = 72
"""Bearing steps of five degrees."""
BIN_DEGREES = 360.0 / BINS
BIN_UNITS = BEARING_UNITS // BINS

LEVELS = 128  # of bearing noise, where it depends on the distance
LINES_A_TASK = 64


@dataclass(frozen=True, eq=False, kw_only=True)
class SymbolColumns:
    """What each symbol, a class in a step of bearings, adds to the score of each of n cells.

    `values`, shape (blocks, k * 72, cells a block), are in steps of `step`: the rows of a class of
    the `table` are together, the cells of both halves of a block in turn. By the d `looks`, photos
    in several directions or one full turn, `constants` (d, n) is what each cell adds to whatever is
    seen, `missed` (d, k, n) what the objects of a class have in that, none of which is detected,
    and `counts` (d, k, n) tells how many of them there are.
    """

    database: SignatureDatabase
    table: NoiseTable
    values: NDArray[np.uint8]
    step: float
    constants: NDArray[np.float32]
    looks: tuple[Photo, ...]
    missed: NDArray[np.float32]
    counts: NDArray[np.int32]

    @cached_property
    def kinds(self) -> NDArray[np.int64]:
        """The class row of every entry of the database."""
        return self.table.row_of[self.database.codes]

    @cached_property
    def symbols(self) -> NDArray[np.int64]:
        """The row of the values of every entry of the database."""
        return self.kinds * BINS + self.database.bearing_units // BIN_UNITS

    @cached_property
    def inside(self) -> NDArray[np.bool_]:
        """Which bearings are seen by look, shape (d, units)."""
        middles = (np.arange(BEARING_UNITS) + 0.5) * (FULL_TURN / BEARING_UNITS)
        return np.stack([look.sees(middles) for look in self.looks])

    def scores(
        self, query: Signature, look: int, *, left_out: int | None = None
    ) -> NDArray[np.float32]:
        """Return the first sum of the log-likelihood of a query of a look in every cell.

        Without a class row that is `left_out`, objects of it are nowhere; that the detector may
        have given them another name is neglected. The query has bearings and known types.
        """
        from semsig_gis.evaluation.identifiability.kernels import score_cells  # noqa: PLC0415

        rows = self.table.query_rows(query)
        base = np.log(self.table.density[rows]).sum()
        constants = self.constants[look] + np.float32(base)
        if left_out is not None:
            constants -= self.missed[look, left_out]
        scores = np.empty(len(constants), np.float32)
        bins = np.floor(query_bearings(query) / BIN_DEGREES).astype(np.int64) % BINS
        score_cells(rows * BINS + bins, self.values, constants, self.step, scores)
        return scores

    def loglik(self, cell: int, look: int, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the log-likelihood of what a look from a cell shows, in some, up to a constant."""
        entries = np.arange(*self.database.offsets[cell : cell + 2].tolist())
        seen = entries[self.inside[look, self.database.bearing_units[entries]]]
        half = self.values.shape[2] // 2
        block, inside = np.divmod(cells, 2 * half)
        place = 2 * (inside % half) + inside // half
        added = self.values[block[:, None], self.symbols[seen], place[:, None]].sum(axis=1)
        return np.asarray(self.constants[look, cells] + self.step * added.astype(np.float64))

    def of(self, cells: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Return what each symbol adds to some of the cells, shape (k * 72, c)."""
        half = self.values.shape[2] // 2
        block, inside = np.divmod(cells, 2 * half)
        return self.values[block, :, 2 * (inside % half) + inside // half].T


def symbol_columns(
    index: LikelihoodIndex, *, looks: tuple[Photo, ...] = (FULL_VIEW,), threads: int = 1
) -> SymbolColumns:
    """Work out the columns of the cells and the mean noise model of an index, for some looks."""
    from semsig_gis.evaluation.identifiability.kernels import BLOCK  # noqa: PLC0415 - numba loads slowly

    database, table = index.database, index.table
    cells, classes = len(database), len(table.codes)
    owners = np.repeat(np.arange(cells), database.lengths)
    kinds, far = table.row_of[database.codes], database.distance_units
    sure = table.detected[table.length_rows(database.lengths)[owners], kinds]
    chances, leaving = sure * table.seen[kinds, far], sure * table.left[kinds, far]
    spread_of, spread = _spreads(database, table)
    bins, units = np.divmod(database.bearing_units, BIN_UNITS)

    def by_class(values: NDArray[Any]) -> NDArray[np.float64]:
        sums = np.bincount(kinds * cells + owners, values, classes * cells)
        return np.asarray(sums.reshape(classes, cells), dtype=np.float64)

    missed = np.empty((len(looks), classes, cells), np.float32)
    counts = np.empty((len(looks), classes, cells), np.int32)
    for number, look in enumerate(looks):
        inside = _masses(spread, look)[spread_of, units, bins] if look.sectors else 1.0
        missed[number] = by_class(np.log1p(-chances * inside) - leaving * (look.width / FULL_TURN))
        counts[number] = by_class(look.sees(database.bearings))
    clutter = table.clutter.sum() * np.array([look.width / FULL_TURN for look in looks])
    values = np.zeros((-(-cells // BLOCK), classes, BINS, BLOCK), np.uint8)
    step = _write_columns(
        database,
        table,
        (spread_of, spread),
        chances / (1.0 - chances),
        leaving / FULL_TURN,
        values,
        threads,
    )
    return SymbolColumns(
        database=database,
        table=table,
        values=values.reshape(len(values), -1, BLOCK),
        step=step,
        looks=looks,
        constants=(missed.sum(axis=1, dtype=np.float64) - clutter[:, None]).astype(np.float32),
        missed=missed,
        counts=counts,
    )


def _masses(spread: NDArray[np.float32], look: Photo) -> NDArray[np.float32]:
    """Return the chance that an object comes out in a look, by level, unit and bin of it."""
    inside = (np.arange(BEARING_UNITS) + 0.5) * (FULL_TURN / BEARING_UNITS)
    shares = look.sees(inside).reshape(BINS, -1).mean(axis=1) * BIN_DEGREES
    # An object of a bin has its spread so many bins on.
    turned = np.stack([np.roll(shares, -place) for place in range(BINS)], axis=1)
    return np.asarray(np.clip(spread @ turned, 0.0, 1.0), dtype=np.float32)


def _write_columns(  # noqa: PLR0917 - a private helper of one caller
    database: SignatureDatabase,
    table: NoiseTable,
    spreads: tuple[NDArray[np.uint8], NDArray[np.float32]],
    odds: NDArray[np.float64],
    leaving: NDArray[np.float64],
    columns: NDArray[np.uint8],
    threads: int,
) -> float:
    """Fill `columns`, shape (blocks, k, 72, BLOCK), and return the size of their steps."""
    from semsig_gis.evaluation.identifiability.kernels import LINE, fill_columns  # noqa: PLC0415

    spread_of, spread = spreads
    # 255 steps reach what four objects in one direction add.
    peak = float(spread.max() * (table.odds[:, :, None] * table.naming).max())
    step = math.log1p(4.0 * peak) / 255.0
    arguments = (
        database.offsets,
        table.row_of.astype(np.uint8)[database.codes],
        database.bearing_units,
        spread_of,
        spread,
        odds.astype(np.float32),
        leaving.astype(np.float32),
        table.naming.astype(np.float32),
        _logs(step),
        columns,
    )
    lines = -(-len(database) // LINE)
    parts = [
        np.array([low, min(low + LINES_A_TASK, lines)]) for low in range(0, lines, LINES_A_TASK)
    ]
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(lambda part: fill_columns(part, *arguments), parts))
    return step


def _spreads(
    database: SignatureDatabase, table: NoiseTable
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Return which bearing noise each entry has, and the density of each in every bin."""
    sigma = table.sigmas
    if table.position_sigma == 0:
        levels, level = np.unique(sigma, return_inverse=True)
    else:
        levels = np.geomspace(sigma.min(), sigma.max(), LEVELS)
        middle = np.sqrt(levels[1:] * levels[:-1])
        level = np.searchsorted(middle, sigma)
    level_of = np.zeros((256, 256), np.uint8)
    level_of[table.codes] = level.reshape(sigma.shape)
    spread_of = level_of[database.codes, database.distance_units]
    inside = (np.arange(BIN_UNITS) + 0.5) * (BIN_DEGREES / BIN_UNITS)
    edges = np.arange(BINS + 1) * BIN_DEGREES
    away = edges[None, None, :] - inside[None, :, None]
    below = np.zeros((len(levels), BIN_UNITS, BINS + 1))
    erf = np.vectorize(math.erf, otypes=[np.float64])
    for turn in range(-3, 4):  # 180 degrees of deviation reach three turns
        deviations = (away + 360.0 * turn) / levels[:, None, None]
        below += 0.5 * (1.0 + erf(deviations / math.sqrt(2.0)))
    return spread_of, (np.diff(below, axis=2) / BIN_DEGREES).astype(np.float32)


def _logs(step: float) -> NDArray[np.uint8]:
    """Return the logarithm in steps, by the leading bits of a float32 from 1 up."""
    from semsig_gis.evaluation.identifiability.kernels import MANTISSA_BITS  # noqa: PLC0415

    octaves = math.ceil(255 * step / math.log(2.0))
    octave, part = np.divmod(np.arange(octaves << MANTISSA_BITS), 1 << MANTISSA_BITS)
    value = np.log((1.0 + (part + 0.5) / (1 << MANTISSA_BITS)) * 2.0**octave)
    value[0] = 0.0  # where nothing is near, exactly nothing is added
    return np.minimum(np.rint(value / step), 255).astype(np.uint8)
