"""Weighted edit distance (Levenshtein) between sequences; the only module that imports RapidFuzz.

For weights of 1 there is a kernel, which is about fifty times as fast per value as RapidFuzz on one
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
from semsig_gis.localization.distance.metrics import METRICS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.database import SequenceTable

PLANE_WORDS = 64  # enough work for a loop, and a plane still fits the first-level cache
BLOCK_SEQUENCES = 64 * PLANE_WORDS
_VALUES = 256

_LARGEST_WEIGHT = 100  # costs of any real signature stay exact in float32
# RapidFuzz compares this many values in the time that the compiled kernel takes to load (0.7 s).
_VALUES_OF_LOADING = 100_000_000
# A second search of a table with this many values makes further searches likely.
_LARGE_TABLE_VALUES = 50_000
_KERNEL_SPEEDUP = 50  # RapidFuzz on 1/50 of the sequences is as fast as the kernel on all


@dataclass(frozen=True, eq=False)
class BitPlanes:
    """Sequences of small integers as bit planes: one bit per sequence for each position and digit.

    Sequences are aligned at their ends. For each block and each position, from the start of its
    longest sequence, `planes`, shape (p, 64), has one row that marks the sequences with an entry at
    this position, then one row for each first digit and each second digit of a value. `digits`,
    shape (256, 2), has the two rows that are both set for a value; never both for a value that no
    sequence has. Two digits need fewer planes than one plane per value: about twice the square root
    of the number of values. Block ``b`` owns the rows ``bounds[b]:bounds[b + 1]``.

    The recurrence is that of Hyyrö (2004), with bits across sequences in place of along one. Let
    ``v`` be the step down the left side of an entry, ``h`` the step along its top, and ``e`` set
    where the two values are equal. The diagonal step is 0 where ``d = e | (v < 0) | (h < 0)``. The
    right side is +1 where ``(h < 0) | ~(d | (h > 0))`` and -1 where ``(h > 0) & d``; the bottom is
    the same with ``v``. Before a sequence begins, steps of 0 along the top keep its column.
    """

    planes: NDArray[np.uint64]
    bounds: NDArray[np.int64]
    digits: NDArray[np.int64]
    lengths: NDArray[np.int64]

    @classmethod
    def build(cls, values: NDArray[np.uint8], offsets: NDArray[np.int64]) -> BitPlanes:
        """Build the bit planes of d sequences.

        Sequence i is ``values[offsets[i]:offsets[i + 1]]``.

        The order does not change the distances, but sorting by length saves memory and time.
        """
        from semsig_gis.localization.distance.kernels import pack  # noqa: PLC0415 - numba, 0.25 s

        present = np.flatnonzero(np.bincount(values, minlength=_VALUES))
        # At least two first digits, so that rows 1 and 2 are never both set: an absent value.
        first = max(2, int(np.ceil(np.sqrt(len(present)))))
        second = max(1, -(-len(present) // first))
        digits = np.tile(np.array([1, 2]), (_VALUES, 1))
        digits[present, 0] = 1 + np.arange(len(present)) % first
        digits[present, 1] = 1 + first + np.arange(len(present)) // first
        lengths = np.diff(offsets)
        starts = np.arange(0, len(lengths), BLOCK_SEQUENCES)
        longest = np.maximum.reduceat(lengths, starts) if len(lengths) else lengths
        bounds = np.concatenate([[0], np.cumsum(longest * (1 + first + second))])
        planes = np.zeros((bounds[-1], PLANE_WORDS), np.uint64)
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
        """Return the unit-weight edit distances of queries to all sequences, shape (queries, d).

        `normalized` divides by the longer of the two lengths. A `wildcard` in a query equals every
        value.
        """
        from semsig_gis.localization.distance.kernels import scan  # noqa: PLC0415 - numba, 0.25 s

        digits = self.digits
        if wildcard is not None:
            digits = digits.copy()
            digits[wildcard] = 0  # row 0 is set wherever a sequence has an entry
        ends = np.cumsum([0, *map(len, queries)])
        query_digits = digits[np.concatenate([*queries, np.empty(0, np.uint8)])]
        result = np.empty((len(queries), len(self.lengths)), np.float32)
        per_position = int(self.digits.max()) + 1
        planes, bounds, lengths = self.planes, self.bounds, self.lengths
        scan(planes, bounds, per_position, lengths, query_digits, ends, normalized, result)
        return result


_planes: WeakKeyDictionary[SequenceTable, BitPlanes] = WeakKeyDictionary()
_searched_tables: WeakSet[SequenceTable] = WeakSet()


@dataclass(frozen=True, slots=True)
class EditWeights:
    """Costs, each 1 to 100, of the operations that turn a query into a cell's sequence.

    `insert` is for an object that the query missed, `delete` for a false detection, `substitute`
    for an object that has another value in the cell.
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


@METRICS.register
def distances(
    queries: Sequence[NDArray[np.uint8]],
    table: SequenceTable,
    *,
    normalized: bool = True,
    weights: EditWeights | None = None,
    only: NDArray[np.int64] | None = None,
    wildcard: int | None = None,
) -> NDArray[np.float32]:
    """Return the weighted edit distances of queries to distinct sequences.

    The distance (Levenshtein; paper, section "Signature comparison") is the lowest cost of
    operations that turn the query into the sequence. `normalized` divides by the largest possible
    cost for the two lengths: delete and insert everything, or, if cheaper, substitute along the
    shorter length and insert or delete the rest. With weights of 1 it is the longer length.

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
    few = only is not None and len(only) * _KERNEL_SPEEDUP < len(table)
    unit_weights = costs == EditWeights() and not few
    pays = False
    if unit_weights and wildcard is None:
        # Use the kernel if it saves more time than it takes to load: not for a single query.
        repeated = table in _searched_tables
        _searched_tables.add(table)
        values = len(table.values)
        pays = len(sequences) * values >= _VALUES_OF_LOADING
        pays |= repeated and values >= _LARGE_TABLE_VALUES
    if wildcard is not None or pays:
        if table not in _planes:
            _planes[table] = BitPlanes.build(table.values, table.offsets)
        planes = _planes[table]
        costs_of_all = planes.edit_distances(sequences, normalized=normalized, wildcard=wildcard)
        return costs_of_all if only is None else costs_of_all[:, only]
    choices = table.strings if only is None else list(map(table.strings.__getitem__, only.tolist()))
    result: NDArray[np.float32] = cdist(
        [sequence.tobytes().decode("latin-1") for sequence in sequences],
        choices,
        scorer=Levenshtein.normalized_distance if normalized else Levenshtein.distance,
        scorer_kwargs={"weights": astuple(costs)},
        dtype=np.float32,
    )
    return result
