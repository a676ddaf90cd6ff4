"""Histogram distance: compares how often each value occurs, in any order."""

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
    """Return the differences between the value counts of queries and of distinct sequences.

    The paper (section "Signature comparison") sums over the values ``c`` present in either
    sequence: ``S = sum of min(x_c, y_c) / max(x_c, y_c)``. Normalised, the distance is ``1 - S /
    (number of these values)``: 0 for equal counts, also for two empty sequences, and 1 if no value
    is shared. Otherwise it is ``-S``, which has no lower bound.
    """
    from semsig_gis.localization.distance.kernels import add_quotients  # noqa: PLC0415 - numba, 0.25 s

    histogram = table.histogram if only is None else table.histogram[only]
    result = np.empty((len(queries), len(histogram)), np.float32)
    most = int(histogram.max(initial=0))
    numbers = np.arange(most + 1)
    for row, query in zip(result, queries, strict=True):
        values, counts = np.unique(checked_sequence(query), return_counts=True)
        total = np.zeros(len(histogram))
        # A value that the query lacks adds 0 to the sum.
        for value, count in zip(values.tolist(), counts.tolist(), strict=True):
            if value < histogram.shape[1]:
                # Look up the quotients by count: there are few different counts.
                quotients = np.minimum(numbers, count) / np.maximum(numbers, count)
                add_quotients(histogram[:, value], quotients, total)
        if normalized:
            _, either = table.overlap(query, only=only)
            # Two empty sequences are equal: 1 - 1, not 1 - 0 / 0.
            total[either == 0] = 1
            np.subtract(1, total / np.maximum(either, 1), out=row, casting="same_kind")
        else:
            np.subtract(0, total, out=row, casting="same_kind")
    return result
