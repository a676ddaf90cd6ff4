"""Which cells look like which: every cell compared with all others.

The signature of each cell is the query here: the ratio of two likelihoods tells how far another
cell is from looking the same to a detector. A real query is spoiled, which brings the ratios nearer
to one: they are raised to a power, the *temperature*, before they are added up.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import MOST_METRES, InputError, cell_ids, require_number

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation.identifiability.kernels import Bases, Sample
    from semsig_gis.evaluation.identifiability.symbol_tables import SymbolColumns

CELLS_A_TASK = 1024
LEAST_SUM = 1e-30  # of ratios, so that it has a logarithm
LIKELY = 300  # cells that are compared one by one with each, about
SAMPLE = 4096  # cells that stand for the others
LEVELS = 20_000  # steps between cells before anything is added
MOST_OCTAVES = 100.0  # powers of two beyond this are not told from it


@dataclass(frozen=True, eq=False, kw_only=True)
class Lookalikes:
    """How like other cells are to each of c looks from cells.

    `near` (c,) is the sum of the tempered ratios of likelihood over the circle around each cell,
    `far` (c,) that over all other cells. `cells` (c, k) are row numbers of the likest cells outside
    the circle whose own circles do not overlap, by falling sum, -1 where there are no more; `sums`
    (c, k) is the sum over the circle of each, without what is in the circle of the compared cell.
    `rise` (c, classes) is by how much the logarithm of `far` would rise without each class: without
    its objects and the detections of its name. That some are detected under another is neglected.
    """

    near: NDArray[np.float64]
    far: NDArray[np.float64]
    cells: NDArray[np.int64]
    sums: NDArray[np.float64]
    rise: NDArray[np.float64]


def cell_circle(radius: float, step: float) -> NDArray[np.int64]:
    """Return which cells of side `step` are within a radius (both in metres) of a cell, (a, 2).

    For each column of cells, the first and the last cell number less that of the cell.
    """
    reach = radius / step + 1e-9
    across = np.arange(-math.floor(reach), math.floor(reach) + 1)
    up = np.floor(np.sqrt(reach**2 - across**2)).astype(np.int64)
    return np.stack([cell_ids(across, -up), cell_ids(across, up)], axis=1)


def city_extent(database: SignatureDatabase) -> float:
    """Return metres within which all cells are from each other; a larger radius only costs time."""
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
    """Compare looks from cells with all other cells, and name the likest `places`.

    Of d looks of the columns, number l from cell c has the number ``c * d + l``; all by default.
    `temperature` (above 0) is 1 for a query that is just the signature of the cell, less for one
    that is spoiled; `radius` is what counts as near, in metres; InputError if one is out of range.
    A ratio beyond 2 to the power of 100, or below its inverse, counts as that. Of the cells that
    are not among the likeliest three hundred or so, a sample is added up, which `seed` draws.
    """
    from semsig_gis.evaluation.identifiability.kernels import (  # noqa: PLC0415 - numba loads slowly
        BLOCK,
        Entries,
        Places,
        compare_cells,
    )

    database = columns.database
    _check(temperature, radius)
    directions = len(columns.looks)
    if looks is None:
        looks = np.arange(len(database) * directions)
    rows = np.asarray(looks, dtype=np.int64)
    seen_from = rows // directions
    radius = min(radius, city_extent(database))
    powers = _powers(columns, temperature)
    # Sums within 16 bits are added up twice as fast, but hold no cells with very many objects.
    wide = database.lengths * 255 + LEVELS >= 2**16
    wide |= (columns.constants < columns.constants.max() - LEVELS * columns.step).any(axis=0)
    all_bases = {
        much: _bases(columns, temperature, wide=much) for much in {*wide[seen_from].tolist()}
    }
    samples = {much: _sample(columns, bases, seed) for much, bases in all_bases.items()}
    around = Places(
        ids=database.cell_ids,
        at=np.stack([database.columns, database.rows], axis=1).astype(np.int64),
        circle=cell_circle(radius, database.grid.step),
        limit=math.floor((radius / database.grid.step + 1e-9) ** 2),
    )
    entries = Entries(
        offsets=database.offsets,
        symbols=columns.symbols,
        kinds=columns.kinds,
        bearing_units=database.bearing_units,
    )
    like = Lookalikes(
        near=np.empty(len(rows)),
        far=np.empty(len(rows)),
        cells=np.empty((len(rows), places), np.int64),
        sums=np.zeros((len(rows), places)),
        rise=np.empty((len(rows), len(columns.table.codes))),
    )

    def compare(part: slice) -> None:
        much = bool(wide[seen_from[part]].any())
        sample = samples[much]
        compare_cells(
            rows[part],
            entries,
            columns.inside,
            columns.values,
            columns.constants,
            columns.step,
            all_bases[much],
            powers,
            sample,
            around,
            np.empty((2, max(BLOCK, len(sample.cells))), np.uint32 if much else np.uint16),
            like.near[part],
            like.far[part],
            like.cells[part],
            like.sums[part],
            like.rise[part],
        )

    _in_parts(compare, len(rows), threads, progress)
    order = np.argsort(-like.sums, axis=1, kind="stable")
    logs = np.log(np.maximum(like.rise, LEAST_SUM))
    return replace(
        like,
        cells=np.take_along_axis(like.cells, order, axis=1),
        sums=np.take_along_axis(like.sums, order, axis=1),
        rise=logs - np.log(np.maximum(like.far, LEAST_SUM))[:, None],
    )


def _bases(columns: SymbolColumns, temperature: float, *, wide: bool) -> Bases:
    """Return what cells have before anything is added to it."""
    from semsig_gis.evaluation.identifiability.kernels import Bases  # noqa: PLC0415

    constants = columns.constants.astype(np.float64) - columns.constants.max()
    lowest = 1.0 - np.rint(constants.min() / columns.step) if wide else LEVELS
    levels = np.maximum(np.rint(constants / columns.step) + lowest, 1.0)
    trims = np.exp(temperature * (constants - columns.step * (levels - lowest)))
    lifted = -temperature * columns.missed.transpose(0, 2, 1).astype(np.float64)
    more = columns.values.shape[0] * columns.values.shape[2] - len(columns.database)
    return Bases(
        levels=np.pad(levels, [(0, 0), (0, more)]).astype(np.uint32 if wide else np.uint16),
        trims=np.maximum(trims, LEAST_SUM).astype(np.float32),
        lifts=np.exp(np.minimum(lifted, MOST_OCTAVES * math.log(2.0))).astype(np.float32),
    )


def _powers(columns: SymbolColumns, temperature: float) -> NDArray[np.float32]:
    """Return the ratios of likelihood that whole steps make, the same number down and up."""
    nats = MOST_OCTAVES * math.log(2.0)
    steps = math.ceil(nats / (temperature * columns.step))
    exponents = temperature * columns.step * np.arange(-steps, steps + 1)
    return np.asarray(np.exp(np.clip(exponents, -nats, nats)), dtype=np.float32)


def _sample(columns: SymbolColumns, bases: Bases, seed: int) -> Sample:
    """Draw the cells that stand for those that are not likely."""
    from semsig_gis.evaluation.identifiability.kernels import Bases, Sample  # noqa: PLC0415

    count = len(columns.database)
    size = SAMPLE if count > SAMPLE else 0
    cells = np.sort(np.random.default_rng([seed, 1]).permutation(count)[:size])
    turns = np.stack([cells[: size // 2], cells[size // 2 :]], axis=1).ravel()
    lifts = np.ascontiguousarray(bases.lifts[:, cells].transpose(0, 2, 1))
    kind, seeing = np.nonzero((lifts != 1.0).any(axis=0))
    return Sample(
        cells=cells,
        ids=columns.database.cell_ids[cells],
        pairs=np.ascontiguousarray(columns.of(turns)).view(np.uint16),
        bases=Bases(
            levels=np.ascontiguousarray(bases.levels[:, cells]),
            trims=np.ascontiguousarray(bases.trims[:, cells]),
            lifts=lifts,
        ),
        starts=np.searchsorted(kind, np.arange(lifts.shape[1] + 1)),
        seeing=seeing,
        rank=math.ceil(LIKELY * size / count),
        weight=count / max(size, 1),
    )


def _check(temperature: float, radius: float) -> None:
    if not 0 < temperature < math.inf:
        raise InputError(f"a temperature of {temperature} was given; give a power above 0.")
    check_radius(radius)


def check_radius(radius: float) -> None:
    """Raise InputError unless a radius is a number of metres from 0 to a million."""
    require_number("radius", radius, least=0, most=MOST_METRES, unit="metres")


def _in_parts(
    work: Callable[[slice], None],
    count: int,
    threads: int,
    progress: Callable[[int, int], None] | None,
) -> None:
    """Do work in parts, several at once."""
    parts = [slice(low, min(low + CELLS_A_TASK, count)) for low in range(0, count, CELLS_A_TASK)]
    with ThreadPoolExecutor(threads) as pool:
        for part, _ in zip(parts, pool.map(work, parts), strict=True):
            if progress is not None:
                progress(part.stop, count)
