"""Groups of what pairs connect."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray


def connected(size: int, pairs: Iterable[tuple[int, int]]) -> NDArray[np.int64]:
    """Return the first number of the group of each of the numbers from 0; pairs connect them."""
    group = list(range(size))

    def root(number: int) -> int:
        while group[number] != number:
            group[number] = group[group[number]]
            number = group[number]
        return number

    for first, second in pairs:
        low, high = sorted((root(first), root(second)))
        group[high] = low
    return np.array([root(number) for number in range(size)], np.int64)
