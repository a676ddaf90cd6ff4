"""Weighted edit distance (Levenshtein) between sequences; the home of RapidFuzz."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from rapidfuzz.distance import Levenshtein
from rapidfuzz.process import cdist

from semsig_gis.errors import InputError
from semsig_gis.sequences import checked_sequence

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.sequences import SequenceTable

__all__ = ["EditWeights", "distances"]

_LARGEST_WEIGHT = 100  # costs of any real signature stay exact in float32


@dataclass(frozen=True, slots=True)
class EditWeights:
    """Costs of the three operations that turn a query into a cell's sequence.

    Parameters
    ----------
    insert : int
        Cost of an object of the cell that the query missed, 1 to 100.
    delete : int
        Cost of an object of the query that the cell does not have, a false detection, 1 to 100.
    substitute : int
        Cost of an object of the query that has another value in the cell, 1 to 100.

    Raises
    ------
    InputError
        If a weight is not a whole number from 1 to 100.

    Examples
    --------
    >>> EditWeights(insert=2)
    EditWeights(insert=2, delete=1, substitute=1)
    """

    insert: int = 1
    delete: int = 1
    substitute: int = 1

    def __post_init__(self) -> None:  # noqa: D105
        for field in fields(self):
            weight = getattr(self, field.name)
            whole = isinstance(weight, int) and not isinstance(weight, bool)
            if not whole or not 1 <= weight <= _LARGEST_WEIGHT:
                msg = (
                    f"edit weight {field.name!r} is {weight!r}; "
                    f"give a whole number from 1 to {_LARGEST_WEIGHT}."
                )
                raise InputError(msg)

    def as_tuple(self) -> tuple[int, int, int]:
        """Return the weights as (insert, delete, substitute)."""
        return self.insert, self.delete, self.substitute


def distances(
    queries: Sequence[NDArray[np.uint8]],
    table: SequenceTable,
    *,
    normalized: bool = True,
    weights: EditWeights | None = None,
    only: NDArray[np.int64] | None = None,
) -> NDArray[np.float32]:
    """Measure the cheapest way to turn each query into each distinct sequence.

    Parameters
    ----------
    queries : sequence of ndarray of uint8
        Class codes or angle levels of each query.
    table : SequenceTable
        The distinct sequences to compare with.
    normalized : bool
        True to divide the cost by the largest that two sequences of these lengths can have;
        False for the cost itself.
    weights : EditWeights, optional
        Costs of the operations, from the query to the cell's sequence; 1 each by default.
    only : ndarray of int64, optional
        The distinct sequences to measure; all by default.

    Returns
    -------
    ndarray of float32, shape (queries, d) or (queries, len(only))
        Distances, 0 for equal sequences. Normalised: on [0, 1], and 1 when just one of the two
        is empty.

    Raises
    ------
    InputError
        If a query is not an array of bytes.

    Notes
    -----
    Levenshtein's distance with weights (paper, section "Signature comparison"). The largest cost
    is the longer length when all weights are 1. In general it is the cheaper of two ways that
    always work: delete everything and insert everything; or substitute along the shorter length,
    then insert or delete the rest.

    Examples
    --------
    A query that missed one object of the first cell:

    >>> import numpy as np
    >>> from semsig_gis.sequences import SequenceTable
    >>> table = SequenceTable.from_csr(np.array([4, 4, 2, 1, 9], np.uint8), np.array([0, 4, 5]))
    >>> query = np.array([4, 2, 1], np.uint8)
    >>> distances([query], table).tolist()
    [[0.25, 1.0]]
    >>> distances([query], table, normalized=False, weights=EditWeights(insert=3)).tolist()
    [[3.0, 3.0]]
    """
    choices = table.strings if only is None else list(map(table.strings.__getitem__, only.tolist()))
    result: NDArray[np.float32] = cdist(
        [checked_sequence(query).tobytes().decode("latin-1") for query in queries],
        choices,
        scorer=Levenshtein.normalized_distance if normalized else Levenshtein.distance,
        scorer_kwargs={"weights": (weights or EditWeights()).as_tuple()},
        dtype=np.float32,
    )
    return result
