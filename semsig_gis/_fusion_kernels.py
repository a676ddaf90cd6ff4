"""The loops over all cells behind the fusions of `semsig_gis.matching`, compiled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.compiling import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["count_steps", "fuse", "put_behind"]


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
    left: NDArray[np.float64],
    types: NDArray[np.int64],
    right: NDArray[np.float32],
    angles: NDArray[np.int64],
    step: float,
    scores: NDArray[np.float32],
) -> None:
    """Add up two distances of every cell.

    Parameters
    ----------
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
        To be filled.
    """
    for cell in range(len(types)):
        scores[cell] = np.rint(left[types[cell]] + right[angles[cell]]) * step


@compiled  # pragma: no cover - coverage does not see machine code
def put_behind(  # noqa: PLR0917
    first: NDArray[np.float32],
    cut: np.float32,
    fused: NDArray[np.float32],
    worst: np.float32,
    least: np.float32,
    scores: NDArray[np.float32],
) -> None:
    """Rank the cells that the first stage does not keep behind those that it keeps.

    Parameters
    ----------
    first : ndarray of float32, shape (n,)
        Scores of the first stage.
    cut : float32
        The worst of them that is kept.
    fused : ndarray of float32, shape (n,)
        Scores of the second stage.
    worst : float32
        The worst of them of a cell that is kept.
    least : float32
        The best score of a cell that is not.
    scores : ndarray of float32, shape (n,)
        To be filled.
    """
    for cell in range(len(first)):
        behind = max(worst + (first[cell] - cut), least)
        scores[cell] = fused[cell] if first[cell] <= cut else behind
