"""Tables of the log-likelihood that each possible detection adds to every cell.

A *symbol* is a class in a bin of bearings. The column of the symbol of class t contains for each
cell ``log(1 + sum_i (o_i N + g_i / 360) C(i, t) / lambda(t))``: the addition of such a detection,
without ``log(lambda(t))``, which is the same for all cells. For object i, o is its odds of
detection, N the mean density over the bin, and g the probability that another object of its class
is detected instead, as it is out of range (`likelihood.photo`).
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import BEARING_UNITS, FULL_TURN, HALF_TURN
from semsig_gis.evaluation.identifiability.kernels import (
    BLOCK_CELLS,
    LINE_CELLS,
    MANTISSA_BITS,
    DetectedObjects,
    SlotBases,
    fill_columns,
    score_cells,
)
from semsig_gis.localization import extent_sigma, query_bearings
from semsig_gis.observation import FULL_VIEW

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import LikelihoodIndex, NoiseTable
    from semsig_gis.observation import Photo

BINS = 72
"""Bins of bearings, of five degrees."""
BIN_DEGREES = 360.0 / BINS
BIN_UNITS = BEARING_UNITS // BINS

NOISE_LEVELS = 128  # of bearing noise, if it depends on the distance
LINES_A_TASK = 64
CELLS_A_GROUP = 4096  # cells with similar scores for a query without detections


@dataclass(frozen=True, eq=False, kw_only=True)
class SymbolColumns:
    """Additions of each symbol, a class in a bin of bearings, to the score of each of n cells.

    `values`, shape (blocks, k * 72, cells of a block), are in units of `step`. The symbols of a
    class of the `table` are adjacent; cells of the first and of the second half of a block take
    turns. `order` (n,) is the cell in each slot of the blocks: similar cells are neighbours, so
    that the highest values of a block are not much higher than those of its cells. The d `looks`
    are photos in several directions or one full turn. By look, `constants` (d, n) is the score of
    each cell for a query without detections, `missed` (d, k, n) the part of it from the undetected
    objects of each class, and `counts` (d, k, n) their number.
    """

    database: SignatureDatabase
    table: NoiseTable
    values: NDArray[np.uint8]
    order: NDArray[np.int64]
    step: float
    constants: NDArray[np.float32]
    looks: tuple[Photo, ...]
    missed: NDArray[np.float32]
    counts: NDArray[np.int32]

    @cached_property
    def kinds(self) -> NDArray[np.int64]:
        """Class row of every object in every cell."""
        return self.table.row_of[self.database.codes]

    @cached_property
    def slots(self) -> NDArray[np.int64]:
        """Slot of every cell in the blocks."""
        slots = np.empty_like(self.order)
        slots[self.order] = np.arange(len(slots))
        return slots

    @cached_property
    def symbols(self) -> NDArray[np.int64]:
        """Symbol of every object in every cell: its row in `values`."""
        return self.kinds * BINS + self.database.bearing_units // BIN_UNITS

    @cached_property
    def inside(self) -> NDArray[np.bool_]:
        """Whether each look includes each bearing, shape (d, units)."""
        middles = (np.arange(BEARING_UNITS) + 0.5) * (FULL_TURN / BEARING_UNITS)
        return np.stack([look.sees(middles) for look in self.looks])

    @cached_property
    def peaks(self) -> NDArray[np.uint16]:
        """Highest value of each symbol in each block, as in `CellColumns`."""
        return paired(self.values.max(axis=2).T)

    def bases(self, omitted_class: int | None = None) -> SlotBases:
        """Return the scores of all cells for a query without detections, for `scores`.

        With an `omitted_class` (its row), cells have no objects of it; cells that see no other
        class are impossible.
        """
        scores = self.constants
        if omitted_class is not None:
            others = self.counts.sum(axis=1) > self.counts[:, omitted_class]
            scores = np.where(others, scores - self.missed[:, omitted_class], -np.inf)
        padding = self.values.shape[0] * self.values.shape[2] - len(self.order)
        scores = np.pad(scores[:, self.order], [(0, 0), (0, padding)], constant_values=-np.inf)
        peaks = scores.reshape(len(scores), len(self.values), -1).max(axis=2)
        return SlotBases(scores.astype(np.float32), peaks.astype(np.float32))

    def scores(
        self, query: Signature, look: int, *, bases: SlotBases, margin: float = math.inf
    ) -> NDArray[np.float32]:
        """Return the approximate log-likelihood of a query of a look in every cell.

        Misclassified objects of an omitted class are neglected. Cells that are more than `margin`
        below the best cell may get minus infinity. The query has bearings and known types.
        """
        rows = self.table.query_rows(query)
        scores = np.empty(len(self.order), np.float32)
        bins = np.floor(query_bearings(query) / BIN_DEGREES).astype(np.int64) % BINS
        symbols = rows * BINS + bins
        score_cells(
            symbols, look, self.values, self.peaks, self.order, bases, self.step, margin, scores
        )
        return scores + np.float32(np.log(self.table.density[rows]).sum())

    def loglik(self, cell: int, look: int, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the log-likelihood, up to a constant, of a look from a cell in some `cells`."""
        entries = np.arange(*self.database.offsets[cell : cell + 2].tolist())
        visible = entries[self.inside[look, self.database.bearing_units[entries]]]
        block, place = self._positions(cells)
        sums = self.values[block[:, None], self.symbols[visible], place[:, None]].sum(axis=1)
        return np.asarray(self.constants[look, cells] + self.step * sums.astype(np.float64))

    def of(self, cells: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Return the values of all symbols in some cells, shape (k * 72, c)."""
        block, place = self._positions(cells)
        return self.values[block, :, place].T

    def _positions(self, cells: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the block of each cell and its place in the block."""
        half = self.values.shape[2] // 2
        block, inside = np.divmod(self.slots[cells], 2 * half)
        return block, 2 * (inside % half) + inside // half


def symbol_columns(
    index: LikelihoodIndex, *, looks: tuple[Photo, ...] = (FULL_VIEW,), threads: int = 1
) -> SymbolColumns:
    """Compute the columns of all cells with the mean noise model of an index, for some looks."""
    database, table = index.database, index.table
    cells, classes = len(database), len(table.codes)
    owners = np.repeat(np.arange(cells), database.lengths)
    kinds, distances = table.row_of[database.codes], database.distance_units
    detected = table.detected[table.length_rows(database.lengths)[owners], kinds]
    chances, leaving = (
        detected * table.remaining[kinds, distances],
        detected * table.leaving[kinds, distances],
    )
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
    constants = missed.sum(axis=1, dtype=np.float64)
    order = _similar_cells(constants.mean(axis=0), counts.sum(axis=0))
    clutter = table.clutter.sum() * np.array([look.width / FULL_TURN for look in looks])
    values = np.zeros((-(-cells // BLOCK_CELLS), classes, BINS, BLOCK_CELLS), np.uint8)
    step = _write_columns(
        database,
        table,
        (spread_of, spread),
        chances / (1.0 - chances),
        leaving / FULL_TURN,
        order,
        values,
        threads,
    )
    return SymbolColumns(
        database=database,
        table=table,
        values=values.reshape(len(values), -1, BLOCK_CELLS),
        order=order,
        step=step,
        looks=looks,
        constants=(constants - clutter[:, None]).astype(np.float32),
        missed=missed,
        counts=counts,
    )


def paired(values: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Return pairs of the first and the second half of each row, with a 0 more if it is odd."""
    count = values.shape[1]
    halves = np.pad(values, [(0, 0), (0, count % 2)]).reshape(len(values), 2, -1)
    return np.ascontiguousarray(halves.transpose(0, 2, 1)).reshape(len(values), -1).view(np.uint16)


def _similar_cells(constants: NDArray[np.float64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the order of the cells: first by score for a query without detections, in groups.

    Cells of a group are ordered by the classes that they see, the commonest in half of the cells
    first. `counts`, shape (k, n), are the numbers of objects of each class.
    """
    group = np.empty(len(constants), np.int64)
    group[np.argsort(constants, kind="stable")] = np.arange(len(constants)) // CELLS_A_GROUP
    sees = counts > 0
    dividing = np.argsort(np.abs(sees.mean(axis=1) - 0.5), kind="stable")
    return np.lexsort([*sees[dividing[::-1]], group])


def _masses(spread: NDArray[np.float32], look: Photo) -> NDArray[np.float32]:
    """Return the probability that an object is detected in a look, by noise level, unit and bin."""
    inside = (np.arange(BEARING_UNITS) + 0.5) * (FULL_TURN / BEARING_UNITS)
    shares = look.sees(inside).reshape(BINS, -1).mean(axis=1) * BIN_DEGREES
    # `spread` is that of an object in bin 0, so the look is turned by the bin of the object.
    rolled = np.stack([np.roll(shares, -place) for place in range(BINS)], axis=1)
    return np.asarray(np.clip(spread @ rolled, 0.0, 1.0), dtype=np.float32)


def _write_columns(  # noqa: PLR0917 - a private helper of one caller
    database: SignatureDatabase,
    table: NoiseTable,
    spreads: tuple[NDArray[np.uint8], NDArray[np.float32]],
    odds: NDArray[np.float64],
    leaving: NDArray[np.float64],
    order: NDArray[np.int64],
    columns: NDArray[np.uint8],
    threads: int,
) -> float:
    """Fill `columns`, shape (blocks, k, 72, BLOCK_CELLS), and return the size of their steps."""
    spread_of, spread = spreads
    # The chance of each name, and 1 for an unknown class, over the density of false objects.
    naming = np.empty((*table.misnamed.shape, len(table.density)), np.float32)
    odds_of_name = 0.0
    for length, own in enumerate(naming):
        names = np.append(table.named(length), np.ones((len(own), 1)), axis=1) / table.density
        odds_of_name = max(odds_of_name, float((table.odds[length, :, None] * names).max()))
        own[:] = names
    # 255 steps are enough for four objects in one direction.
    peak = float(spread.max()) * odds_of_name
    step = math.log1p(4.0 * peak) / 255.0
    objects = DetectedObjects(
        offsets=database.offsets,
        rows=table.row_of.astype(np.uint8)[database.codes],
        bearing_units=database.bearing_units,
        spread_of=spread_of,
        odds=odds.astype(np.float32),
        leaving=leaving.astype(np.float32),
    )
    logs = _logs(step)
    lines = -(-len(database) // LINE_CELLS)
    parts = [
        np.array([low, min(low + LINES_A_TASK, lines)]) for low in range(0, lines, LINES_A_TASK)
    ]
    with ThreadPoolExecutor(threads) as pool:
        list(
            pool.map(
                lambda part: fill_columns(part, order, objects, spread, naming, logs, columns),
                parts,
            )
        )
    return step


def _spreads(
    database: SignatureDatabase, table: NoiseTable
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Return the level of bearing noise of each object, and the density of each level in bins.

    The density, shape (levels, units, bins), is that of an object at each unit of bin 0.
    """
    kinds, sigma = table.row_of[database.codes], table.sigmas
    of_entries = np.empty(0)
    if database.extents is not None:
        of_entries = np.hypot(sigma[kinds, database.distance_units], extent_sigma(database.extents))
        of_entries = np.minimum(of_entries, HALF_TURN)
    if table.position_sigma == 0 and not len(of_entries):
        levels, level = np.unique(sigma, return_inverse=True)
    else:
        widest = max(sigma.max(), of_entries.max(initial=0.0))
        levels = np.geomspace(sigma.min(), widest, NOISE_LEVELS)
        middles = np.sqrt(levels[1:] * levels[:-1])
        level = np.searchsorted(middles, sigma)
    spread_of = level.reshape(sigma.shape).astype(np.uint8)[kinds, database.distance_units]
    if len(of_entries):
        spread_of = np.searchsorted(middles, of_entries).astype(np.uint8)
    inside = (np.arange(BIN_UNITS) + 0.5) * (BIN_DEGREES / BIN_UNITS)
    edges = np.arange(BINS + 1) * BIN_DEGREES
    offsets = edges[None, None, :] - inside[None, :, None]
    # The density of a wrapped normal distribution: differences of its cumulative distribution.
    cumulative = np.zeros((len(levels), BIN_UNITS, BINS + 1))
    erf = np.vectorize(math.erf, otypes=[np.float64])
    for turn in range(-3, 4):  # enough for a standard deviation of 180 degrees
        deviations = (offsets + 360.0 * turn) / levels[:, None, None]
        cumulative += 0.5 * (1.0 + erf(deviations / math.sqrt(2.0)))
    return spread_of, (np.diff(cumulative, axis=2) / BIN_DEGREES).astype(np.float32)


def _logs(step: float) -> NDArray[np.uint8]:
    """Return a lookup table of natural logarithms, in units of `step`, for values of 1 or more.

    The index is the leading bits of a float32, counted from those of 1.0.
    """
    octaves = math.ceil(255 * step / math.log(2.0))
    octave, part = np.divmod(np.arange(octaves << MANTISSA_BITS), 1 << MANTISSA_BITS)
    value = np.log((1.0 + (part + 0.5) / (1 << MANTISSA_BITS)) * 2.0**octave)
    value[0] = 0.0  # a cell without objects near the bearing gets exactly 0
    return np.minimum(np.rint(value / step), 255).astype(np.uint8)
