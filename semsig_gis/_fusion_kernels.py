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
    """Add to ``found[i]`` the number of cells whose score is i steps.

    `first` holds the scores, whole steps, of d distinct sequences and `counts` their cells.
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
    """Fill `scores`, shape (n,), with the sum of the type and angle distances of every cell.

    `left` and `right` hold what each distinct sequence adds, in steps; `types` and `angles`, shape
    (n,), say which sequences a cell has.
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
    """Fill `scores` with `fused`, and rank the cells that the first stage drops behind the rest.

    `cut` is the worst score of the first stage that is kept, `worst` the worst fused score of a
    kept cell, and `least` the best score that a dropped cell may have. Arrays have shape (n,).
    """
    for cell in range(len(first)):
        behind = max(worst + (first[cell] - cut), least)
        scores[cell] = fused[cell] if first[cell] <= cut else behind
