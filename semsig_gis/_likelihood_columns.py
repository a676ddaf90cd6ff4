"""The columns of the likelihood index: what each symbol adds to the score of every cell."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.database import BEARING_UNITS

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.noise_table import NoiseTable

__all__ = ["BINS", "BIN_DEGREES", "index_shape", "write_columns"]

BINS = 72
"""Bearing steps of five degrees."""
BIN_DEGREES = 360.0 / BINS
"""Width of one."""
BIN_UNITS = BEARING_UNITS // BINS
LEVELS = 128  # of bearing noise, where it depends on the distance
LINES_A_TASK = 64


def index_shape(database: SignatureDatabase) -> tuple[int, int, int]:
    """Return the shape of the columns: classes seen and one for unknown, bearing steps, cells."""
    return len(database.present_codes) + 1, BINS, len(database)


def write_columns(
    database: SignatureDatabase,
    table: NoiseTable,
    columns: NDArray[np.uint8],
    *,
    progress: Callable[[int, int], None] | None = None,
    threads: int = 1,
) -> float:
    """Fill `columns`, shape `index_shape`, for a noise model, and return the size of their steps.

    A column holds, for a class t and a step of bearings, ``log(1 + sum_i o_i C(i, t) N /
    lambda(t))``: what a detection there adds, less ``log(lambda(t))``, which is the same for all
    cells. N is the mean density over the step. `columns` may be a mapped file; `progress` is called
    with the number of cells done and in all.
    """
    from semsig_gis._likelihood_kernels import LINE, fill_columns  # noqa: PLC0415

    spread_of, spread = _spreads(database, table)
    step = _step(table, spread)
    arguments = (
        database.offsets,
        table.row_of.astype(np.uint8)[database.codes],
        database.bearing_units,
        spread_of,
        spread,
        table.odds.astype(np.float32),
        table.naming.astype(np.float32),
        _logs(step),
        columns,
    )
    cells = len(database)
    lines = -(-cells // LINE)
    parts = [
        np.array([low, min(low + LINES_A_TASK, lines)]) for low in range(0, lines, LINES_A_TASK)
    ]
    with ThreadPoolExecutor(threads) as pool:
        tasks = [pool.submit(fill_columns, part, *arguments) for part in parts]
        for part, task in zip(parts, tasks, strict=True):
            task.result()
            if progress is not None:
                progress(min(int(part[1]) * LINE, cells), cells)
    return step


def _step(table: NoiseTable, spread: NDArray[np.float32]) -> float:
    """Return the size of a step: 255 of them reach what four objects in one direction add."""
    peak = float(spread.max() * (table.odds[:, :, None] * table.naming).max())
    return math.log1p(4.0 * peak) / 255.0


def _spreads(
    database: SignatureDatabase, table: NoiseTable
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Return which bearing noise each entry has, and the density of each in every bin."""
    sigma = table.sigmas(database.reach)
    if table.position_sigma == 0:
        levels, index = np.unique(sigma, return_inverse=True)
    else:
        levels = np.geomspace(sigma.min(), sigma.max(), LEVELS)
        middle = np.sqrt(levels[1:] * levels[:-1])
        index = np.searchsorted(middle, sigma)
    level_of = np.zeros((256, 256), np.uint8)
    level_of[table.codes] = index.reshape(sigma.shape)
    spread_of = level_of[database.codes, database.distance_units]
    inside = (np.arange(BIN_UNITS) + 0.5) * (BIN_DEGREES / BIN_UNITS)
    edges = np.arange(BINS + 1) * BIN_DEGREES
    away = edges[None, None, :] - inside[None, :, None]
    below = np.zeros((len(levels), BIN_UNITS, BINS + 1))
    for turn in range(-3, 4):  # 180 degrees of deviation reach three turns
        below += _normal_cdf((away + 360.0 * turn) / levels[:, None, None])
    return spread_of, (np.diff(below, axis=2) / BIN_DEGREES).astype(np.float32)


def _normal_cdf(value: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the normal distribution function."""
    erf = np.vectorize(math.erf, otypes=[np.float64])
    return np.asarray(0.5 * (1.0 + erf(value / math.sqrt(2.0))))


def _logs(step: float) -> NDArray[np.uint8]:
    """Return the logarithm in steps, by the leading bits of a float32 from 1 up."""
    from semsig_gis._likelihood_kernels import MANTISSA_BITS  # noqa: PLC0415

    octaves = math.ceil(255 * step / math.log(2.0))
    octave, part = np.divmod(np.arange(octaves << MANTISSA_BITS), 1 << MANTISSA_BITS)
    value = np.log((1.0 + (part + 0.5) / (1 << MANTISSA_BITS)) * 2.0**octave)
    value[0] = 0.0  # where nothing is near, exactly nothing is added
    return np.minimum(np.rint(value / step), 255).astype(np.uint8)
