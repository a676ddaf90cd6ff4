"""Exact expectations of errors and ranks over all orders of tied cells.

Ties are common (a street with three lamps looks like thousands of others), so errors and ranks must
not depend on the order of the cells in an array.
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
"""Errors in metres; the columns ``p0``, ``p5``... of a query are their probabilities."""

NEAR_PLACES: tuple[int, ...] = (1, 5, 10, 20)
"""Numbers N of best places; the columns ``near1``, ``near5``... say whether one is near."""

NEAR_METRES = 25
"""Distance in metres that counts as near; recall@N in visual place recognition uses it."""

_STRIDE_CELLS = 256  # a first pass reduces groups of this many cells, far from each other
_MOST_GROUP_SHARE = 4  # above 1 / 4 of the groups, reading single groups is not faster


def best_cells(scores: NDArray[np.float32], count: int) -> NDArray[np.intp]:
    """Return the rows of the `count` best cells and of all that tie with the last, ascending.

    Lower scores are better. The minima of groups of cells give an upper limit for the score of the
    last one, so that only few cells are sorted.
    """
    groups = len(scores) // _STRIDE_CELLS
    if groups < count:
        rows = np.arange(len(scores))
    else:
        # At least `count` cells have no higher score than the minimum of the `count`-th best group.
        minima = scores[: groups * _STRIDE_CELLS].reshape(_STRIDE_CELLS, groups).min(axis=0)
        limit = np.partition(minima, count - 1)[count - 1]
        best = np.flatnonzero(minima <= limit)
        if _MOST_GROUP_SHARE * len(best) < groups:
            inside = (best + np.arange(_STRIDE_CELLS)[:, None] * groups).ravel()
            rows = np.concatenate([inside, np.arange(groups * _STRIDE_CELLS, len(scores))])
            rows = rows[scores[rows] <= limit]
        else:
            rows = np.flatnonzero(scores <= limit)
    cut = np.partition(scores[rows], count - 1)[count - 1]
    return np.asarray(rows[scores[rows] <= cut])


def top_candidates(
    scores: NDArray[np.float32], top: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the cells certainly among the `top` best, and the cells that tie for the other ranks.

    Lower scores are better. Both are row numbers in array order; the first are fewer than `top`.
    """
    cut = scores.min() if top == 1 else np.partition(scores, top - 1)[top - 1]
    return np.flatnonzero(scores < cut), np.flatnonzero(scores == cut)


def expected_best(
    better: ArrayLike, tied: ArrayLike, *, slots: int, thresholds: Sequence[float] = THRESHOLDS
) -> tuple[float, NDArray[np.float64]]:
    """Return the expected smallest error, and the probability of at most each threshold.

    The candidates are all `better` ones and `slots` (1 to g) of the g `tied` ones, drawn without
    replacement. Errors and thresholds are in metres.

    With h of the g tied errors at most x, all draws are beyond x with probability C(g - h, slots) /
    C(g, slots). From h to h + 1, this is multiplied by (g - h - slots) / (g - h); the products are
    the distribution of the smallest draw.
    """
    nearest = _smallest(better)
    errors = np.asarray(tied, dtype=np.float64)
    limits = np.asarray(thresholds, dtype=np.float64)
    if slots == errors.size:  # all are candidates
        expected = min(nearest, float(errors.min()))
        within = (limits >= expected).astype(np.float64)
    elif slots == 1:
        expected = float(np.minimum(errors, nearest).mean())
        # Count the errors up to each limit in bins: there are many errors and few limits.
        order = np.argsort(limits)
        bins = np.searchsorted(limits[order], errors)
        within = np.empty(len(limits))
        counts = np.bincount(bins, minlength=len(limits) + 1)
        within[order] = counts.cumsum()[:-1] / errors.size
    else:
        ordered = np.sort(errors)
        others = np.arange(ordered.size, 0, -1, dtype=np.float64)  # g - h
        steps = np.maximum(others - slots, 0.0) / others
        beyond = np.concatenate([[1.0], np.cumprod(steps)])  # index: h
        chances = beyond[:-1] - beyond[1:]
        expected = float((chances * np.minimum(ordered, nearest)).sum())
        within = 1.0 - beyond[np.searchsorted(ordered, limits, side="right")]
    return expected, np.where(limits >= nearest, 1.0, within)


def chance_within(better: ArrayLike, tied: ArrayLike, *, slots: int, metres: float) -> float:
    """Return the probability that the nearest candidate is at most `metres` from the true place.

    It is the value of `expected_best` for one threshold; faster if `slots` is small.
    """
    if _smallest(better) <= metres:
        return 1.0
    errors = np.asarray(tied, dtype=np.float64)
    outside = int(np.count_nonzero(errors > metres))
    if outside < slots:
        return 1.0
    draws = np.arange(slots)
    return 1.0 - float(np.prod((outside - draws) / (errors.size - draws)))


def _smallest(errors: ArrayLike) -> float:
    values = np.asarray(errors, dtype=np.float64)
    return float(values.min()) if values.size else math.inf


def rank_range(scores: NDArray[np.float32], cell: int) -> tuple[int, int]:
    """Return the first and the last possible rank, from 1, of a cell among its ties."""
    own = scores[cell]
    return int(np.count_nonzero(scores < own)) + 1, int(np.count_nonzero(scores <= own))


def expected_recall(
    rank_low: ArrayLike, rank_high: ArrayLike, *, cells: int, percent: float
) -> NDArray[np.float64]:
    """Return the probability that each true cell ranks in the top `percent` of cells, shape (q,).

    A rank is uniform between its bounds, which count from 1. `percent` is above 0 and at most 100;
    the number of cells is rounded down.
    """
    if not 0 < percent <= 100:  # noqa: PLR2004
        raise InputError(
            f"A recall at {percent} % was requested; give a percentage above 0 and at most 100."
        )
    # The small term prevents that 0.07 * 100, slightly below 7, is rounded down to 6.
    count = math.floor(percent * cells / 100 + 1e-9)
    low = np.asarray(rank_low, dtype=np.float64)
    high = np.asarray(rank_high, dtype=np.float64)
    return np.asarray(np.clip((count - (low - 1)) / (high - low + 1), 0.0, 1.0))
