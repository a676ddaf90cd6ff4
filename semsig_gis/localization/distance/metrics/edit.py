"""Weighted edit distance (Levenshtein) between sequences; the home of RapidFuzz.

Unit weights have a kernel of their own, about fifty times as fast a value as RapidFuzz on one
query. Both give the same distances.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary, WeakSet

import numpy as np
from rapidfuzz.distance import Levenshtein
from rapidfuzz.process import cdist

from semsig_gis.core import InputError
from semsig_gis.database import checked_sequence

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.database.sequences import SequenceTable

STRIPE = 64  # words in a plane: enough work for a loop, little enough for the nearest cache
BLOCK = 64 * STRIPE
"""Sequences in a block."""
_VALUES = 256

_LARGEST_WEIGHT = 100  # costs of any real signature stay exact in float32
# Loading the compiled kernel takes as long as RapidFuzz takes for this many values (0.7 s).
_LOADING = 100_000_000
# A table with as many values, asked again, is likely to be asked often.
_LARGE = 50_000
_FEWER = 50  # times: RapidFuzz on so many fewer sequences is as fast as the kernel on all


@dataclass(frozen=True, eq=False)
class BitPlanes:
    """Sequences of small integers, turned so that the same position of many lies together.

    For every block and position, from the longest sequence back to front, `planes`, shape (p, 64),
    tells which sequences reach that far and then, for each first and each second digit of a value,
    which have it there. All sequences end at the last position. Block ``b`` owns the rows
    ``bounds[b]:bounds[b + 1]``. `digits`, shape (256, 2), gives the two planes that are both set
    where a value stands; never both for a value that no sequence has. Two digits, of about the
    square root of the number of values each, need fewer planes than one plane a value.

    Hyyrö (2004) gives the steps with bits along one sequence; here they lie across sequences. With
    the steps ``v`` down the left side of an entry and ``h`` along its top, and ``e`` set where the
    two values are equal, the diagonal step is 0 where ``d = e | (v < 0) | (h < 0)``. Then the right
    side is +1 where ``(h < 0) | ~(d | (h > 0))`` and -1 where ``(h > 0) & d``, and the bottom is
    the same of ``v``. Where a sequence does not reach, steps of 0 along the top leave its column as
    it was.
    """

    planes: NDArray[np.uint64]
    bounds: NDArray[np.int64]
    digits: NDArray[np.int64]
    lengths: NDArray[np.int64]

    @classmethod
    def build(cls, values: NDArray[np.uint8], offsets: NDArray[np.int64]) -> BitPlanes:
        """Turn sequences given as flat values and offsets, shape (d + 1,).

        Any order gives the same distances, but sequences ordered by length waste no memory and no
        time.
        """
        from semsig_gis.localization.distance.kernels import pack  # noqa: PLC0415 - loads a compiler

        present = np.flatnonzero(np.bincount(values, minlength=_VALUES))
        # At least two, so that two digits of one kind make the value that no sequence has.
        first = max(2, int(np.ceil(np.sqrt(len(present)))))
        second = max(1, -(-len(present) // first))
        digits = np.tile(np.array([1, 2]), (_VALUES, 1))
        digits[present, 0] = 1 + np.arange(len(present)) % first
        digits[present, 1] = 1 + first + np.arange(len(present)) // first
        lengths = np.diff(offsets)
        starts = np.arange(0, len(lengths), BLOCK)
        longest = np.maximum.reduceat(lengths, starts) if len(lengths) else lengths
        bounds = np.concatenate([[0], np.cumsum(longest * (1 + first + second))])
        planes = np.zeros((bounds[-1], STRIPE), np.uint64)
        pack(values, offsets, digits, bounds, 1 + first + second, planes)
        for array in (planes, bounds, digits):
            array.setflags(write=False)
        return cls(planes, bounds, digits, lengths)

    def edit_distances(
        self,
        queries: Sequence[NDArray[np.uint8]],
        *,
        normalized: bool = True,
        wildcard: int | None = None,
    ) -> NDArray[np.float32]:
        """Measure the fewest changes that turn each query into each sequence, shape (queries, d).

        `normalized` divides by the longer of the two lengths, and a `wildcard` in a query equals
        every value.
        """
        from semsig_gis.localization.distance.kernels import scan  # noqa: PLC0415 - loads a compiler

        digits = self.digits
        if wildcard is not None:
            digits = digits.copy()
            digits[wildcard] = 0
        ends = np.cumsum([0, *map(len, queries)])
        query_digits = digits[np.concatenate([*queries, np.empty(0, np.uint8)])]
        result = np.empty((len(queries), len(self.lengths)), np.float32)
        per_position = int(self.digits.max()) + 1
        planes, bounds, lengths = self.planes, self.bounds, self.lengths
        scan(planes, bounds, per_position, lengths, query_digits, ends, normalized, result)
        return result


_planes: WeakKeyDictionary[SequenceTable, BitPlanes] = WeakKeyDictionary()
_tables_seen: WeakSet[SequenceTable] = WeakSet()


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
                raise InputError(
                    f"edit weight {field.name!r} is {weight!r}; "
                    f"give a whole number from 1 to {_LARGEST_WEIGHT}."
                )


def distances(
    queries: Sequence[NDArray[np.uint8]],
    table: SequenceTable,
    *,
    normalized: bool = True,
    weights: EditWeights | None = None,
    only: NDArray[np.int64] | None = None,
    wildcard: int | None = None,
) -> NDArray[np.float32]:
    """Measure the cheapest way to turn each query into each distinct sequence.

    Levenshtein's distance with weights (paper, section "Signature comparison"). `normalized`
    divides by the largest cost that two sequences of these lengths can have: that of deleting
    everything and inserting everything, or, if cheaper, of substituting along the shorter length
    and inserting or deleting the rest. With weights of 1 it is the longer length.

    A `wildcard` in a query, for an object of unknown class, equals any value; it needs weights of
    1.
    """
    sequences = [checked_sequence(query) for query in queries]
    costs = weights or EditWeights()
    if wildcard is not None and costs != EditWeights():
        raise InputError(
            f"a wildcard was given with edit weights {'/'.join(map(str, astuple(costs)))}; "
            "wildcards are compared with weights of 1 only."
        )
    few = only is not None and len(only) * _FEWER < len(table)
    if wildcard is not None or (
        costs == EditWeights() and not few and _pays(len(sequences), table)
    ):
        if table not in _planes:
            _planes[table] = BitPlanes.build(table.values, table.offsets)
        planes = _planes[table]
        everything = planes.edit_distances(sequences, normalized=normalized, wildcard=wildcard)
        return everything if only is None else everything[:, only]
    choices = table.strings if only is None else list(map(table.strings.__getitem__, only.tolist()))
    result: NDArray[np.float32] = cdist(
        [sequence.tobytes().decode("latin-1") for sequence in sequences],
        choices,
        scorer=Levenshtein.normalized_distance if normalized else Levenshtein.distance,
        scorer_kwargs={"weights": astuple(costs)},
        dtype=np.float32,
    )
    return result


def _pays(queries: int, table: SequenceTable) -> bool:
    """Tell whether to load the kernel; one query of a short-lived process is not worth it."""
    again = table in _tables_seen
    _tables_seen.add(table)
    values = len(table.values)
    return queries * values >= _LOADING or (again and values >= _LARGE)
