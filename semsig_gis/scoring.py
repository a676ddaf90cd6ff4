"""Score a ranking in which cells tie: expectations over all orders of the tied, exactly.

Equal scores are common (a street with three lamps looks like thousands of others), so neither an
error nor a rank may depend on the order in which an array happens to hold the cells.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "NEAR_METRES",
    "NEAR_PLACES",
    "THRESHOLDS",
    "best_cells",
    "chance_within",
    "expected_best",
    "expected_recall",
    "rank_range",
    "top_candidates",
]

THRESHOLDS = (
    *(0, 5, 10, 15, 20, 25, 30, 40, 50, 60, 70, 80, 90, 100),
    *(150, 200, 300, 400, 500, 1000, 2000, 5000),
)
"""Errors in metres whose probability is kept for every query, in the columns ``p0``, ``p5``..."""

NEAR_PLACES = (1, 5, 10, 20)
"""Numbers N of best places of which one may be near, in the columns ``near1``, ``near5``..."""

NEAR_METRES = 25
"""How near, in metres, as recall@N is told in visual place recognition."""

BLOCK = 256  # cells of which only the best is looked at first, far from each other
FEW = 4  # times as many blocks: then it pays to look at some of them alone


def best_cells(scores: NDArray[np.float32], count: int) -> NDArray[np.intp]:
    """Return the best cells, and all that tie with the last of them.

    Parameters
    ----------
    scores : ndarray of float32, shape (n,)
        Distance of every cell to the query, lower is better.
    count : int
        How many best cells are wanted, 1 to n.

    Returns
    -------
    ndarray of int, shape (b,)
        Row numbers, ascending; b >= `count`.

    Notes
    -----
    The best of each block of cells are looked at first. As many cells as are wanted are at most
    as bad as the last of the best blocks, so that few others need to be ordered.

    Examples
    --------
    >>> best_cells(np.float32([3, 1, 2, 2, 2]), 2).tolist()
    [1, 2, 3, 4]
    """
    blocks = len(scores) // BLOCK
    if blocks < count:
        some = np.arange(len(scores))
    else:
        least = scores[: blocks * BLOCK].reshape(BLOCK, blocks).min(axis=0)
        enough = np.partition(least, count - 1)[count - 1]
        chosen = np.flatnonzero(least <= enough)
        if FEW * len(chosen) < blocks:
            inside = (chosen + np.arange(BLOCK)[:, None] * blocks).ravel()
            some = np.concatenate([inside, np.arange(blocks * BLOCK, len(scores))])
            some = some[scores[some] <= enough]
        else:
            some = np.flatnonzero(scores <= enough)
    cut = np.partition(scores[some], count - 1)[count - 1]
    return np.asarray(some[scores[some] <= cut])


def top_candidates(
    scores: NDArray[np.float32], top: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the cells that are surely among the best, and those that tie for what is left.

    Parameters
    ----------
    scores : ndarray of float32, shape (n,)
        Distance of every cell to the query, lower is better.
    top : int
        How many best cells are wanted, 1 to n.

    Returns
    -------
    better : ndarray of int, shape (b,)
        Cells before the cut, b < `top`, in array order.
    tied : ndarray of int, shape (g,)
        Cells with the score at the cut, g >= `top` - b, in array order.

    Examples
    --------
    >>> better, tied = top_candidates(np.float32([3, 1, 2, 2, 2]), 2)
    >>> better.tolist(), tied.tolist()
    ([1], [2, 3, 4])
    """
    cut = scores.min() if top == 1 else np.partition(scores, top - 1)[top - 1]
    return np.flatnonzero(scores < cut), np.flatnonzero(scores == cut)


def expected_best(
    better: ArrayLike, tied: ArrayLike, *, slots: int, thresholds: Sequence[float] = THRESHOLDS
) -> tuple[float, NDArray[np.float64]]:
    """Return what to expect of the smallest error when a cut falls among tied candidates.

    Parameters
    ----------
    better : array_like of float, shape (b,)
        Errors in metres of the candidates that are in for sure.
    tied : array_like of float, shape (g,)
        Errors of the tied candidates, of which `slots` are drawn without replacement.
    slots : int
        How many are drawn, 1 to g.
    thresholds : sequence of float, optional
        Errors to give the probability of, in metres.

    Returns
    -------
    expected : float
        Expected smallest error among the candidates that are in.
    within : ndarray of float64, shape (len(thresholds),)
        Probability that the smallest error is at most each threshold.

    Notes
    -----
    With h of the g tied errors at most x, all draws are beyond x with probability
    C(g - h, slots) / C(g, slots). As h grows by one, that is multiplied by
    (g - h - slots) / (g - h), which gives the whole distribution of the smallest draw.

    Examples
    --------
    One of four is drawn; two of them are within 50 m.

    >>> expected, within = expected_best([], [0, 40, 60, 100], slots=1, thresholds=[10, 50])
    >>> expected, within.tolist()
    (50.0, [0.25, 0.5])
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
        expected = float(np.dot(beyond[:-1] - beyond[1:], np.minimum(ordered, nearest)))
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
    """Return the chance that the smallest error is small when a cut falls among tied candidates.

    Parameters
    ----------
    better : array_like of float, shape (b,)
        Errors in metres of the candidates that are in for sure.
    tied : array_like of float, shape (g,)
        Errors of the tied candidates, of which `slots` are drawn without replacement.
    slots : int
        How many are drawn, 1 to g.
    metres : float
        What is small.

    Returns
    -------
    float
        The probability that `expected_best` gives for this threshold, sooner for few draws.

    Examples
    --------
    Two of four are drawn; two of them are within 50 m.

    >>> round(chance_within([], [0, 40, 60, 100], slots=2, metres=50), 6)
    0.833333
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
    """Return the first and the last rank that a cell can have among those it ties with.

    Parameters
    ----------
    scores : ndarray of float32, shape (n,)
        Distance of every cell to the query, lower is better.
    cell : int
        Which cell.

    Returns
    -------
    low, high : int
        Ranks from 1 to n.

    Examples
    --------
    >>> rank_range(np.float32([3, 1, 2, 2, 2]), 3)
    (2, 4)
    """
    own = scores[cell]
    return int(np.count_nonzero(scores < own)) + 1, int(np.count_nonzero(scores <= own))


def expected_recall(
    rank_low: ArrayLike, rank_high: ArrayLike, *, cells: int, percent: float
) -> NDArray[np.float64]:
    """Return the chance that each true cell ranks in the top so many per cent of the cells.

    Parameters
    ----------
    rank_low, rank_high : array_like of int, shape (q,)
        First and last rank that ties allow, from 1.
    cells : int
        How many cells were ranked.
    percent : float
        Share of them that is kept, above 0 and at most 100; the number is rounded down.

    Returns
    -------
    ndarray of float64, shape (q,)
        Chances in [0, 1]: a rank is uniform between its bounds.

    Raises
    ------
    InputError
        If the percentage is out of range.

    Examples
    --------
    The top 10 % of 30 cells are three; the second true cell ranks 2nd to 5th.

    >>> expected_recall([1, 2, 4], [1, 5, 9], cells=30, percent=10).tolist()
    [1.0, 0.5, 0.0]
    """
    if not 0 < percent <= 100:  # noqa: PLR2004
        msg = f"A recall at {percent} % was asked for; give a percentage above 0, at most 100."
        raise InputError(msg)
    # The small term keeps 0.07 * 100, which is just below 7, from being rounded down to 6.
    kept = math.floor(percent * cells / 100 + 1e-9)
    low = np.asarray(rank_low, dtype=np.float64)
    high = np.asarray(rank_high, dtype=np.float64)
    return np.asarray(np.clip((kept - (low - 1)) / (high - low + 1), 0.0, 1.0))
