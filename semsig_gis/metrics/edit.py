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
    """Costs, each 1 to 100, of the operations that turn a query into a cell's sequence.

    An object is inserted that the query missed, deleted if it is a false detection, and substituted
    if it has another value in the cell.
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

    Levenshtein's distance with weights (paper, section "Signature comparison"). `normalized`
    divides by the largest cost that two sequences of these lengths can have, so that the distance
    is 1 if just one of them is empty. That cost is the cheaper of two ways that always work: delete
    everything and insert everything; or substitute along the shorter length, then insert or delete
    the rest. With weights of 1 it is the longer length.

    A `wildcard` in a query, for an object of unknown class, equals every value; it needs weights of
    1. Threads share the sequences, which does not pay for a single query. The shape is (queries,
    d), or (queries, len(only)) if only some sequences are measured.
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
