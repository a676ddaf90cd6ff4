"""Jaccard distance: which values occur in two sequences, whatever their order and number."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.sequences import checked_sequence

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.sequences import SequenceTable

__all__ = ["distances"]


def distances(
    queries: Sequence[NDArray[np.uint8]],
    table: SequenceTable,
    *,
    normalized: bool = True,
    only: NDArray[np.int64] | None = None,
) -> NDArray[np.float32]:
    """Measure how much the sets of values of queries and of distinct sequences differ.

    Parameters
    ----------
    queries : sequence of ndarray of uint8
        Class codes or angle levels of each query.
    table : SequenceTable
        The distinct sequences to compare with.
    normalized : bool
        Without effect, since the measure lies on [0, 1] by itself; every measure takes it.
    only : ndarray of int64, optional
        The distinct sequences to measure; all by default.

    Returns
    -------
    ndarray of float32, shape (queries, d) or (queries, len(only))
        Distances on [0, 1]; 0 for equal sets, also for two empty ones.

    Raises
    ------
    InputError
        If a query is not an array of bytes.

    Notes
    -----
    ``1 - |X & Y| / |X | Y|``. The paper (section "Signature comparison") names the
    quotient a distance; it grows with likeness, so the distance is one minus it.

    Examples
    --------
    >>> import numpy as np
    >>> from semsig_gis.sequences import SequenceTable
    >>> table = SequenceTable.from_csr(np.array([3, 1, 1, 2], np.uint8), np.array([0, 1, 4]))
    >>> distances([np.array([2, 1], np.uint8), np.array([2], np.uint8)], table).tolist()
    [[1.0, 0.0], [1.0, 0.5]]
    """
    del normalized
    rows = len(table) if only is None else len(only)
    result = np.empty((len(queries), rows), np.float32)
    for row, query in zip(result, queries, strict=True):
        both, either = table.overlap(checked_sequence(query), only=only)
        # Two empty sequences share all they have: 0 / 1, not 0 / 0.
        np.divide(either - both, np.maximum(either, 1), out=row, dtype=np.float32)
    return result
