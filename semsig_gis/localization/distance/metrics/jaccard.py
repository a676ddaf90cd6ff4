"""Jaccard distance: compares the sets of values, without their order and number."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.database import checked_sequence
from semsig_gis.localization.distance.metrics import METRICS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.database import SequenceTable


@METRICS.register
def distances(
    queries: Sequence[NDArray[np.uint8]],
    table: SequenceTable,
    *,
    normalized: bool = True,
    only: NDArray[np.int64] | None = None,
) -> NDArray[np.float32]:
    """Return the differences between the value sets of queries and of distinct sequences.

    The distance is ``1 - |X & Y| / |X | Y|``, 0 for two empty sequences. The paper (section
    "Signature comparison") calls the quotient itself a distance, although it grows with similarity.
    `normalized` has no effect: the distance is in [0, 1].
    """
    del normalized
    rows = len(table) if only is None else len(only)
    result = np.empty((len(queries), rows), np.float32)
    for row, query in zip(result, queries, strict=True):
        both, either = table.overlap(checked_sequence(query), only=only)
        # Two empty sequences are equal: 0 / 1, not 0 / 0.
        np.divide(either - both, np.maximum(either, 1), out=row, dtype=np.float32)
    return result
