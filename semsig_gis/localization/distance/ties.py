"""Score a ranking in which cells tie: expectations over all orders of the tied, exactly.

Equal scores are common (a street with three lamps looks like thousands of others), so neither an
error nor a rank may depend on the order in which an array happens to hold the cells.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

THRESHOLDS: tuple[float, ...] = (
    *(0, 5, 10, 15, 20, 25, 30, 40, 50, 60, 70, 80, 90, 100),
    *(150, 200, 300, 400, 500, 1000, 2000, 5000),
)
"""Errors in metres whose probability is kept for every query, in the columns ``p0``, ``p5``..."""

NEAR_PLACES: tuple[int, ...] = (1, 5, 10, 20)
"""Numbers N of best places of which one may be near, in the columns ``near1``, ``near5``..."""

NEAR_METRES = 25
"""How near, in metres, as recall@N is told in visual place recognition."""

BLOCK = 256  # cells of which only the best is looked at first, far from each other
FEW = 4  # times as many blocks: then it pays to look at some of them alone


def best_cells(scores: NDArray[np.float32], count: int) -> NDArray[np.intp]:
    """Return the rows of the `count` best cells and of all that tie with the last, ascending.

    Lower scores are better. The best of each block of cells are looked at first: at least `count`
    cells are no worse than the last of the best blocks, so few others need to be ordered.
    """
    blocks = len(scores) // BLOCK
    if blocks < count:
        some = np.arange(len(scores))
    else:
        least = scores[: blocks * BLOCK].reshape(BLOCK, blocks).min(axis=0)
        enough = np.partition(least, count - 1)[count - 1]
        best = np.flatnonzero(least <= enough)
        if FEW * len(best) < blocks:
            inside = (best + np.arange(BLOCK)[:, None] * blocks).ravel()
            some = np.concatenate([inside, np.arange(blocks * BLOCK, len(scores))])
            some = some[scores[some] <= enough]
        else:
            some = np.flatnonzero(scores <= enough)
    cut = np.partition(scores[some], count - 1)[count - 1]
    return np.asarray(some[scores[some] <= cut])


def top_candidates(
    scores: NDArray[np.float32], top: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the cells that are surely among the `top` best, and those that tie for what is left.

    Lower scores are better. Both are row numbers in array order; fewer than `top` cells are sure.
    """
    cut = scores.min() if top == 1 else np.partition(scores, top - 1)[top - 1]
    return np.flatnonzero(scores < cut), np.flatnonzero(scores == cut)


def expected_best(
    better: ArrayLike, tied: ArrayLike, *, slots: int, thresholds: Sequence[float] = THRESHOLDS
) -> tuple[float, NDArray[np.float64]]:
    """Return the expected smallest error, and the chance that it is within each threshold.

    All `better` candidates count, and `slots` (1 to g) of the g `tied` ones, drawn without
    replacement. Errors and thresholds are in metres.

    With h of the g tied errors at most x, all draws are beyond x with probability C(g - h, slots) /
    C(g, slots). As h grows by one, that is multiplied by (g - h - slots) / (g - h), which gives the
    whole distribution of the smallest draw.
    """
    nearest = _nearest(better)
    errors = np.asarray(tied, dtype=np.float64)
    limits = np.asarray(thresholds, dtype=np.float64)
    if slots == errors.size:  # all are in
        expected = min(nearest, float(errors.min()))
        drawn = (limits >= expected).astype(np.float64)
    elif slots == 1:
        expected = float(np.minimum(errors, nearest).mean())
        drawn = _count_within(errors, limits) / errors.size
    else:
        ordered = np.sort(errors)
        left = np.arange(ordered.size, 0, -1, dtype=np.float64)
        steps = np.maximum(left - slots, 0.0) / left
        beyond = np.concatenate([[1.0], np.cumprod(steps)])  # by the number of errors at most x
        chances = beyond[:-1] - beyond[1:]
        expected = float((chances * np.minimum(ordered, nearest)).sum())
        drawn = 1.0 - beyond[np.searchsorted(ordered, limits, side="right")]
    return expected, np.where(limits >= nearest, 1.0, drawn)


def _count_within(errors: NDArray[np.float64], limits: NDArray[np.float64]) -> NDArray[np.int64]:
    """Count the errors that are at most each limit; there are many errors and few limits."""
    order = np.argsort(limits)
    places = np.searchsorted(limits[order], errors)
    counts = np.empty(len(limits), np.int64)
    counts[order] = np.bincount(places, minlength=len(limits) + 1).cumsum()[:-1]
    return counts


def chance_within(better: ArrayLike, tied: ArrayLike, *, slots: int, metres: float) -> float:
    """Return the chance that the smallest error is at most `metres` when candidates tie at the cut.

    The value of `expected_best` for one threshold; faster if `slots` is small.
    """
    if _nearest(better) <= metres:
        return 1.0
    errors = np.asarray(tied, dtype=np.float64)
    outside = int(np.count_nonzero(errors > metres))
    if outside < slots:
        return 1.0
    draws = np.arange(slots)
    return 1.0 - float(np.prod((outside - draws) / (errors.size - draws)))


def _nearest(errors: ArrayLike) -> float:
    values = np.asarray(errors, dtype=np.float64)
    return float(values.min()) if values.size else math.inf


def rank_range(scores: NDArray[np.float32], cell: int) -> tuple[int, int]:
    """Return the first and the last rank, from 1, that a cell can have among those it ties with."""
    own = scores[cell]
    return int(np.count_nonzero(scores < own)) + 1, int(np.count_nonzero(scores <= own))


def expected_recall(
    rank_low: ArrayLike, rank_high: ArrayLike, *, cells: int, percent: float
) -> NDArray[np.float64]:
    """Return the chance that each true cell ranks in the top `percent` of the cells, shape (q,).

    A rank is uniform between its bounds, which count from 1. `percent` is above 0 and at most 100,
    and the number of cells that it stands for is rounded down.
    """
    if not 0 < percent <= 100:  # noqa: PLR2004
        raise InputError(
            f"A recall at {percent} % was requested; give a percentage above 0 and at most 100."
        )
    # The small term keeps 0.07 * 100, which is just below 7, from being rounded down to 6.
    count = math.floor(percent * cells / 100 + 1e-9)
    low = np.asarray(rank_low, dtype=np.float64)
    high = np.asarray(rank_high, dtype=np.float64)
    return np.asarray(np.clip((count - (low - 1)) / (high - low + 1), 0.0, 1.0))
