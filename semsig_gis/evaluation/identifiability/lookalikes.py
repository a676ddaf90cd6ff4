"""Compare every cell with all others, to find the cells that look similar.

Here, the query is the signature of each cell: a likelihood ratio measures how similar another cell
looks to a detector. Real queries have errors, which bring the ratios nearer to one. So ratios are
raised to a power, the *temperature*, before they are summed.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import MOST_METRES, InputError, cell_ids, require_number
from semsig_gis.evaluation.identifiability.kernels import (
    BaseScores,
    CellColumns,
    CellPlaces,
    CellSample,
    Comparisons,
    Entries,
    compare_cells,
)
from semsig_gis.evaluation.identifiability.symbol_tables import paired

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation.identifiability.symbol_tables import SymbolColumns

CELLS_A_TASK = 2048
LEAST_SUM = 1e-30  # of ratios, so that it has a logarithm
LIKELY_CELLS = 300  # approximate number of cells compared one by one with each cell
SAMPLE_CELLS = 4096  # sample of all other cells
BASE_LEVELS = 20_000  # range of base scores in steps, if sums have 16 bits
MOST_OCTAVES = 100.0  # ratios are clipped at 2**100


@dataclass(frozen=True, eq=False, kw_only=True)
class Lookalikes:
    """Similarity of other cells to each of c looks from cells.

    `near` (c,) is the sum of the tempered likelihood ratios over the circle around each cell, `far`
    (c,) the sum over all other cells. `cells` (c, k) are row numbers of the most similar cells
    outside the circle, with circles that do not overlap, by falling sum; -1 if there are no more.
    `sums` (c, k) is the sum over the circle of each, without the circle of the compared cell.
    `rise` (c, classes) is the increase of the logarithm of `far` without each class, that is
    without its objects and without detections of it. Misclassified objects are neglected.
    """

    near: NDArray[np.float64]
    far: NDArray[np.float64]
    cells: NDArray[np.int64]
    sums: NDArray[np.float64]
    rise: NDArray[np.float64]


def cell_circle(radius: float, step: float) -> NDArray[np.int64]:
    """Return the cells of side `step` within a radius (both in metres) of a cell, shape (a, 2).

    For each column of cells: the first and the last cell id, minus the id of the middle cell.
    """
    reach = radius / step + 1e-9
    across = np.arange(-math.floor(reach), math.floor(reach) + 1)
    up = np.floor(np.sqrt(reach**2 - across**2)).astype(np.int64)
    return np.stack([cell_ids(across, -up), cell_ids(across, up)], axis=1)


def city_extent(database: SignatureDatabase) -> float:
    """Return the diagonal of the city in metres; a larger radius only costs time."""
    sides = np.ptp(database.columns), np.ptp(database.rows)
    return database.grid.step * math.ceil(math.hypot(*sides))


def find_lookalikes(
    columns: SymbolColumns,
    *,
    temperature: float,
    radius: float = 50.0,
    looks: NDArray[np.int64] | None = None,
    places: int = 3,
    seed: int = 0,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Lookalikes:
    """Compare looks from cells with all other cells, and return the `places` most similar ones.

    With d looks of the columns, look l from cell c has the number ``c * d + l``; all by default.
    `temperature` (above 0) is 1 for queries without errors and less for queries with errors;
    `radius` is the distance that counts as near, in metres; InputError if one is out of range.
    Ratios are clipped at 2**100 and 2**-100. About 300 likely cells are compared one by one; the
    sum over the others is estimated from a sample, which is drawn with `seed`.
    """
    if not 0 < temperature < math.inf:
        raise InputError(f"a temperature of {temperature} was given; give a power above 0.")
    check_radius(radius)
    database = columns.database
    directions = len(columns.looks)
    if looks is None:
        looks = np.arange(len(database) * directions)
    rows = np.asarray(looks, dtype=np.int64)
    viewpoints = rows // directions
    radius = min(radius, city_extent(database))
    cell_columns = CellColumns(
        values=columns.values,
        order=columns.order,
        slots=columns.slots,
        peaks=columns.peaks,
        constants=np.ascontiguousarray(columns.constants[:, columns.order]),
        step=columns.step,
        powers=_powers(columns, temperature),
    )
    # Sums of 16 bits are twice as fast, but overflow for cells with very many objects.
    wide = database.lengths * 255 + BASE_LEVELS >= 2**16
    wide |= (columns.constants < columns.constants.max() - BASE_LEVELS * columns.step).any(axis=0)
    widths = {*wide[viewpoints].tolist()}
    bases = {is_wide: _bases(columns, temperature, wide=is_wide) for is_wide in widths}
    samples = {is_wide: _sample(columns, bases[is_wide], seed) for is_wide in widths}
    places_of_cells = CellPlaces(
        ids=database.cell_ids,
        at=np.stack([database.columns, database.rows], axis=1)[columns.order].astype(np.int64),
        circle=cell_circle(radius, database.grid.step),
        limit=math.floor((radius / database.grid.step + 1e-9) ** 2),
    )
    entries = Entries(
        offsets=database.offsets,
        symbols=columns.symbols,
        kinds=columns.kinds,
        bearing_units=database.bearing_units,
    )
    lookalikes = Lookalikes(
        near=np.empty(len(rows)),
        far=np.empty(len(rows)),
        cells=np.empty((len(rows), places), np.int64),
        sums=np.zeros((len(rows), places)),
        rise=np.empty((len(rows), len(columns.table.codes))),
    )

    def compare(part: slice) -> None:
        is_wide = bool(wide[viewpoints[part]].any())
        compare_cells(
            rows[part],
            entries,
            columns.inside,
            cell_columns,
            bases[is_wide],
            samples[is_wide],
            places_of_cells,
            Comparisons(
                near=lookalikes.near[part],
                far=lookalikes.far[part],
                like=lookalikes.cells[part],
                share=lookalikes.sums[part],
                rest=lookalikes.rise[part],
            ),
        )

    _run_in_parts(compare, len(rows), threads, progress)
    order = np.argsort(-lookalikes.sums, axis=1, kind="stable")
    # The kernel filled `rise` with the sums without each class.
    logs = np.log(np.maximum(lookalikes.rise, LEAST_SUM))
    return replace(
        lookalikes,
        cells=np.take_along_axis(lookalikes.cells, order, axis=1),
        sums=np.take_along_axis(lookalikes.sums, order, axis=1),
        rise=logs - np.log(np.maximum(lookalikes.far, LEAST_SUM))[:, None],
    )


def _bases(columns: SymbolColumns, temperature: float, *, wide: bool) -> BaseScores:
    """Return the scores of all cells before the columns of a query are added."""
    constants = columns.constants[:, columns.order].astype(np.float64) - columns.constants.max()
    lowest = 1.0 - np.rint(constants.min() / columns.step) if wide else BASE_LEVELS
    levels = np.maximum(np.rint(constants / columns.step) + lowest, 1.0)
    trims = np.exp(temperature * (constants - columns.step * (levels - lowest)))
    missed = columns.missed[:, :, columns.order].transpose(0, 2, 1)
    lifts = -temperature * missed.astype(np.float64)
    # Blocks are whole: the last one has slots without a cell, with level 0.
    blocks, _, size = columns.values.shape
    padding = blocks * size - len(columns.database)
    levels = np.pad(levels, [(0, 0), (0, padding)]).astype(np.uint32 if wide else np.uint16)
    peaks = levels.reshape(len(levels), blocks, size).max(axis=2)
    return BaseScores(
        levels=levels,
        peaks=np.pad(peaks, [(0, 0), (0, blocks % 2)]),
        trims=np.maximum(trims, LEAST_SUM).astype(np.float32),
        lifts=np.exp(np.minimum(lifts, MOST_OCTAVES * math.log(2.0))).astype(np.float32),
    )


def _powers(columns: SymbolColumns, temperature: float) -> NDArray[np.float32]:
    """Return the tempered likelihood ratio of each number of steps, from negative to positive."""
    nats = MOST_OCTAVES * math.log(2.0)
    steps = math.ceil(nats / (temperature * columns.step))
    exponents = temperature * columns.step * np.arange(-steps, steps + 1)
    return np.asarray(np.exp(np.clip(exponents, -nats, nats)), dtype=np.float32)


def _sample(columns: SymbolColumns, bases: BaseScores, seed: int) -> CellSample:
    """Draw the cells that represent those that are not likely; none in a small city."""
    count = len(columns.database)
    size = SAMPLE_CELLS if count > SAMPLE_CELLS else 0
    cells = np.sort(np.random.default_rng([seed, 1]).permutation(count)[:size])
    slots = columns.slots[cells]
    lifts = np.ascontiguousarray(bases.lifts[:, slots].transpose(0, 2, 1))
    kind, seeing = np.nonzero((lifts != 1.0).any(axis=0))
    return CellSample(
        cells=cells,
        ids=columns.database.cell_ids[cells],
        pairs=paired(columns.of(cells)),
        bases=BaseScores(
            levels=np.ascontiguousarray(bases.levels[:, slots]),
            peaks=bases.peaks[:, :0],
            trims=np.ascontiguousarray(bases.trims[:, slots]),
            lifts=lifts,
        ),
        starts=np.searchsorted(kind, np.arange(lifts.shape[1] + 1)),
        seeing=seeing,
        rank=math.ceil(LIKELY_CELLS * size / count),
        weight=count / max(size, 1),
    )


def _run_in_parts(
    work: Callable[[slice], None],
    count: int,
    threads: int,
    progress: Callable[[int, int], None] | None,
) -> None:
    """Call `work` for all parts of a range, in several threads."""
    parts = [slice(low, min(low + CELLS_A_TASK, count)) for low in range(0, count, CELLS_A_TASK)]
    with ThreadPoolExecutor(threads) as pool:
        for part, _ in zip(parts, pool.map(work, parts), strict=True):
            if progress is not None:
                progress(part.stop, count)


def check_radius(radius: float) -> None:
    """Raise InputError unless a radius is from 0 to 1,000,000 metres."""
    require_number("radius", radius, least=0, most=MOST_METRES, unit="metres")
