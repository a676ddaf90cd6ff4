"""The loops over all cells behind the fusions of `semsig_gis.matching`, compiled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.compiling import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["count_steps", "fill_rest", "fuse"]


@compiled  # pragma: no cover - coverage does not see machine code
def count_steps(
    first: NDArray[np.float32], counts: NDArray[np.int64], step: float, found: NDArray[np.int64]
) -> None:
    """Count the cells at each score.

    Parameters
    ----------
    first : ndarray of float32, shape (d,)
        Scores of distinct sequences, whole steps.
    counts : ndarray of int64, shape (d,)
        How many cells each sequence has.
    step : float
        The step.
    found : ndarray of int64
        Zeros, to be added to; place i is of the score i steps.
    """
    for place in range(len(first)):
        found[int(np.rint(first[place] / step))] += counts[place]


@compiled  # pragma: no cover - coverage does not see machine code
def fuse(  # noqa: PLR0917
    first: NDArray[np.float32],
    cut: float,
    left: NDArray[np.float64],
    types: NDArray[np.int64],
    right: NDArray[np.float32],
    angles: NDArray[np.int64],
    step: float,
    scores: NDArray[np.float32],
) -> float:
    """Add up two distances of the cells that the first stage keeps.

    Parameters
    ----------
    first : ndarray of float32, shape (d,)
        Scores of the first stage of the distinct type sequences.
    cut : float
        The worst of them that is kept.
    left : ndarray of float64, shape (d,)
        What each type sequence adds, in steps.
    types : ndarray of int64, shape (n,)
        Type sequence of each cell.
    right : ndarray of float32, shape (e,)
        What each angle sequence adds, in steps.
    angles : ndarray of int64, shape (n,)
        Angle sequence of each cell.
    step : float
        The step.
    scores : ndarray of float32, shape (n,)
        To be filled where cells are kept.

    Returns
    -------
    float
        The worst of these scores.
    """
    worst = -np.inf
    for cell in range(len(types)):
        kind = types[cell]
        if first[kind] <= cut:
            score = np.rint(left[kind] + right[angles[cell]]) * step
            worst = max(worst, score)
            scores[cell] = score
    return worst


@compiled  # pragma: no cover - coverage does not see machine code
def fill_rest(
    first: NDArray[np.float32],
    cut: float,
    rest: NDArray[np.float32],
    types: NDArray[np.int64],
    scores: NDArray[np.float32],
) -> None:
    """Fill in the scores of the cells that the first stage does not keep.

    Parameters
    ----------
    first : ndarray of float32, shape (d,)
        Scores of the first stage of the distinct type sequences.
    cut : float
        The worst of them that is kept.
    rest : ndarray of float32, shape (d,)
        Score of each type sequence that is not kept.
    types : ndarray of int64, shape (n,)
        Type sequence of each cell.
    scores : ndarray of float32, shape (n,)
        To be filled.
    """
    for cell in range(len(types)):
        kind = types[cell]
        if first[kind] > cut:
            scores[cell] = rest[kind]
