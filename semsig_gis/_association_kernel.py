"""The loop that associates detections with objects, as machine code.

Its slow, obvious twin is in the tests.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.compiling import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["associate"]

_ROUNDS = 60
_SETTLED = 1e-5  # relative change at which the messages are taken for settled


@compiled
def associate(  # noqa: C901, PLR0917 - a kernel takes no keywords
    starts: NDArray[np.int64],
    left: NDArray[np.int64],
    right: NDArray[np.int64],
    weight: NDArray[np.float64],
    at_left: NDArray[np.float64],
    at_right: NDArray[np.float64],
    chance: NDArray[np.float64],
    total: NDArray[np.float64],
) -> None:
    """Sum over the one-to-one associations of independent problems.

    The pairs of problem i are ``starts[i]:starts[i + 1]``, each an object `left` and a detection
    `right` with a weight of 0 or more; no two problems share one. `at_left` and `at_right` are
    working memory. Fills `chance`, that a pair is one thing, and `total`, the logarithm of the sum
    of each problem, in which the empty association counts as one.
    """
    back = np.ones(len(weight))
    forth = np.empty(len(weight))
    for problem in range(len(starts) - 1):
        low, high = starts[problem], starts[problem + 1]
        for _ in range(_ROUNDS):
            for edge in range(low, high):
                at_left[left[edge]] = 1.0
                at_right[right[edge]] = 1.0
            for edge in range(low, high):
                at_left[left[edge]] += weight[edge] * back[edge]
            for edge in range(low, high):
                rest = at_left[left[edge]] - weight[edge] * back[edge]
                forth[edge] = weight[edge] / max(rest, 1.0)
                at_right[right[edge]] += forth[edge]
            change = 0.0
            for edge in range(low, high):
                new = 1.0 / max(at_right[right[edge]] - forth[edge], 1.0)
                change = max(change, abs(new - back[edge]) / new)
                back[edge] = new
            if change < _SETTLED:
                break
        # Each object and detection counts once, at the first of its pairs.
        for edge in range(low, high):
            at_left[left[edge]] = 1.0
        for edge in range(low, high):
            at_left[left[edge]] += weight[edge] * back[edge]
        sums = 0.0
        for edge in range(low, high):
            pair = forth[edge] * back[edge]
            chance[edge] = pair / (1.0 + pair)
            sums -= math.log1p(pair)
            for once in (at_left[left[edge]], at_right[right[edge]]):
                sums += math.log(once)
            at_left[left[edge]] = 1.0
            at_right[right[edge]] = 1.0
        total[problem] = sums
