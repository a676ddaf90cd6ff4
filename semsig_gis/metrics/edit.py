"""Weighted edit distance (Levenshtein) between sequences; the home of RapidFuzz.

Unit weights have a kernel of their own, `semsig_gis.bit_planes`, about fifty times as fast a value
as RapidFuzz on one query. Both give the same distances.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING
from weakref import WeakSet

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

# Loading the compiled kernel takes as long as RapidFuzz takes for this many values (0.7 s).
_LOADING = 100_000_000
# A table with as many values, asked again, is likely to be asked often.
_LARGE = 50_000
_FEWER = 50  # times: RapidFuzz on so many fewer sequences is as fast as the kernel on all
_asked: WeakSet[SequenceTable] = WeakSet()


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
    wildcard: int | None = None,
    threads: int = 1,
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
    wildcard : int, optional
        A value that equals every value where a query has it, for an object of unknown class.
    threads : int
        How many threads share the sequences; a single query is over too soon to gain by it.

    Returns
    -------
    ndarray of float32, shape (queries, d) or (queries, len(only))
        Distances, 0 for equal sequences. Normalised: on [0, 1], and 1 when just one of the two
        is empty.

    Raises
    ------
    InputError
        If a query is not an array of bytes, or a wildcard comes with weights other than 1.

    Notes
    -----
    Levenshtein's distance with weights (paper, section "Signature comparison"). The largest cost
    is the longer length when all weights are 1. In general it is the cheaper of two ways that
    always work: delete everything and insert everything; or substitute along the shorter length,
    then insert or delete the rest.

    Examples
    --------
    A query that missed one object of the second cell:

    >>> import numpy as np
    >>> from semsig_gis.sequences import SequenceTable
    >>> table = SequenceTable.from_csr(np.array([9, 4, 4, 2, 1], np.uint8), np.array([0, 1, 5]))
    >>> query = np.array([4, 2, 1], np.uint8)
    >>> distances([query], table).tolist()
    [[1.0, 0.25]]
    >>> distances([query], table, normalized=False, weights=EditWeights(insert=3)).tolist()
    [[3.0, 3.0]]
    """
    sequences = [checked_sequence(query) for query in queries]
    costs = weights or EditWeights()
    if wildcard is not None and costs != EditWeights():
        msg = (
            f"a wildcard was given with edit weights {'/'.join(map(str, costs.as_tuple()))}; "
            "wildcards are compared with weights of 1 only."
        )
        raise InputError(msg)
    few = only is not None and len(only) * _FEWER < len(table)
    if wildcard is not None or (
        costs == EditWeights() and not few and _pays(len(sequences), table)
    ):
        everything = table.planes.edit_distances(
            sequences, normalized=normalized, wildcard=wildcard, threads=threads
        )
        return everything if only is None else everything[:, only]
    choices = table.strings if only is None else list(map(table.strings.__getitem__, only.tolist()))
    result: NDArray[np.float32] = cdist(
        [sequence.tobytes().decode("latin-1") for sequence in sequences],
        choices,
        scorer=Levenshtein.normalized_distance if normalized else Levenshtein.distance,
        scorer_kwargs={"weights": costs.as_tuple()},
        dtype=np.float32,
        workers=threads,
    )
    return result


def _pays(queries: int, table: SequenceTable) -> bool:
    """Tell whether to load the kernel; one query of a short-lived process is not worth it."""
    again = table in _asked
    _asked.add(table)
    values = len(table.values)
    return queries * values >= _LOADING or (again and values >= _LARGE)
