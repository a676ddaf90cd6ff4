"""The loop over all sequences behind `semsig_gis.metrics.histogram`, compiled."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.compiling import compiled

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["add_quotients"]


@compiled  # pragma: no cover - coverage does not see machine code
def add_quotients(
    counts: NDArray[np.uint16 | np.uint32],
    quotients: NDArray[np.float64],
    total: NDArray[np.float64],
) -> None:
    """Add ``quotients[counts]`` to `total`, without an array for the quotients in between."""
    for row in range(len(counts)):
        total[row] += quotients[counts[row]]
