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

from semsig_gis.core.errors import InputError
from semsig_gis.core.geometry import cell_ids
from semsig_gis.core.ranges import MOST_METRES, require_number

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.evaluation.identify.columns import SymbolColumns

CELLS_A_TASK = 256
LEAST_SUM = 1e-30  # of ratios, so that it has a logarithm
SAMPLE = 16_384  # cells with which each is compared where classes are left out


@dataclass(frozen=True, eq=False, kw_only=True)
class Lookalikes:
    """How like other cells are to each of c cells.

    `near` (c,) is the sum of the tempered ratios of likelihood over the circle around each cell,
    `far` (c,) that over all other cells. `cells` (c, k) are row numbers of the likest cells outside
    the circle whose own circles do not overlap, by falling sum, -1 where there are no more; `sums`
    (c, k) is the sum over the circle of each, without what is in the circle of the compared cell.
    """

    near: NDArray[np.float64]
    far: NDArray[np.float64]
    cells: NDArray[np.int64]
    sums: NDArray[np.float64]


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
    cells: NDArray[np.int64] | None = None,
    places: int = 3,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Lookalikes:
    """Compare cells (row numbers, all by default) with all others, and name the likest `places`.

    `temperature` (above 0) is 1 for a query that is just the signature of the cell, less for one
    that is spoiled; `radius` is what counts as near, in metres; InputError if one is out of range.
    A ratio beyond 2 to the power of 100, or below its inverse, counts as that.
    """
    from semsig_gis.evaluation.identify.kernels import compare_signatures  # noqa: PLC0415 - numba loads slowly

    database = columns.database
    _check(temperature, radius)
    rows = np.arange(len(database)) if cells is None else np.asarray(cells, dtype=np.int64)
    step = database.grid.step
    radius = min(radius, city_extent(database))
    where = np.stack([database.columns, database.rows], axis=1).astype(np.int64)
    ids, symbols = database.cell_ids, columns.symbols
    circle = cell_circle(radius, step)
    like = Lookalikes(
        near=np.empty(len(rows)),
        far=np.empty(len(rows)),
        cells=np.empty((len(rows), places), np.int64),
        sums=np.zeros((len(rows), places)),
    )

    def compare(part: slice) -> None:
        compare_signatures(
            rows[part],
            database.offsets,
            symbols,
            columns.values,
            columns.constants,
            columns.step,
            temperature,
            ids,
            where,
            circle,
            math.floor((radius / step + 1e-9) ** 2),
            like.near[part],
            like.far[part],
            like.cells[part],
            like.sums[part],
        )

    _in_parts(compare, len(rows), threads, progress)
    order = np.argsort(-like.sums, axis=1, kind="stable")
    return replace(
        like,
        cells=np.take_along_axis(like.cells, order, axis=1),
        sums=np.take_along_axis(like.sums, order, axis=1),
    )


def compare_without_classes(
    columns: SymbolColumns,
    *,
    temperature: float,
    radius: float = 50.0,
    cells: NDArray[np.int64] | None = None,
    seed: int = 0,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> NDArray[np.float64]:
    """Compare cells with a sample of the others as if a class were not published.

    As `find_lookalikes`; `seed` draws the sample. The result (c, k) is by how much the logarithm of
    `Lookalikes.far` would rise without each class of ``columns.table.codes``: without its objects
    and the detections of its name. That some objects are detected under another name is neglected.
    """
    from semsig_gis.evaluation.identify.kernels import compare_without  # noqa: PLC0415

    database = columns.database
    _check(temperature, radius)
    rows = np.arange(len(database)) if cells is None else np.asarray(cells, dtype=np.int64)
    symbols, kinds = columns.symbols, columns.kinds
    count, classes = len(database), len(columns.table.codes)
    rng = np.random.default_rng([seed, 1])
    sample = np.sort(rng.permutation(count)[:SAMPLE])
    owner = np.repeat(np.arange(count), database.lengths)
    lengths = np.minimum(database.lengths, len(columns.table.missed) - 1)[owner]
    missed = np.log(columns.table.missed)[lengths, kinds]
    by_class = np.bincount(kinds * count + owner, missed, classes * count).reshape(classes, count)
    constants = columns.constants - np.concatenate([np.zeros((1, count)), by_class])
    constants = constants.astype(np.float32)
    sampled = np.ascontiguousarray(columns.values[:, sample])
    ids = database.cell_ids
    circle = cell_circle(min(radius, city_extent(database)), database.grid.step)
    far = np.empty((len(rows), classes + 1))

    def compare(part: slice) -> None:
        compare_without(
            rows[part],
            database.offsets,
            symbols,
            kinds,
            columns.values,
            constants,
            columns.step,
            temperature,
            ids,
            circle,
            sample,
            sampled,
            far[part],
        )

    _in_parts(compare, len(rows), threads, progress)
    logs = np.log(np.maximum(far, LEAST_SUM))
    return logs[:, 1:] - logs[:, :1]


def _check(temperature: float, radius: float) -> None:
    if not 0 < temperature < math.inf:
        msg = f"a temperature of {temperature} was given; give a power above 0."
        raise InputError(msg)
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
