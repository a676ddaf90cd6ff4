"""Distinct sequences of small integers: what the metrics compare.

Many cells of a city share their signature. Every measure therefore looks at each distinct
sequence once, and `SequenceTable.inverse` spreads the results over the cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from semsig_gis.core.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

_Array = TypeVar("_Array", bound="NDArray[Any]")

_WORD_BITS = 64
_HISTOGRAM_BLOCK = 1 << 22  # counters in one step of the histogram: 32 MB of temporaries
_UINT16_MAX = 65_535


@dataclass(frozen=True, eq=False)
class SequenceTable:
    """The distinct sequences of a list of n sequences, short ones first; made by `from_csr`.

    Sequences of one length stand in order of first appearance. Of the d distinct sequences, number
    ``i`` is ``values[offsets[i]:offsets[i + 1]]``, which may be empty. `inverse`, shape (n,), tells
    which one each row of the list holds; `counts`, shape (d,), how many rows hold each one (the
    sizes of the signature groups). All arrays are read-only.
    """

    values: NDArray[np.uint8]
    offsets: NDArray[np.int64]
    inverse: NDArray[np.int64]
    counts: NDArray[np.int64]

    @classmethod
    def from_csr(cls, values: NDArray[np.uint8], offsets: NDArray[np.int64]) -> SequenceTable:
        """Find the distinct sequences of a list given as flat values and offsets.

        Row ``i`` is ``values[offsets[i]:offsets[i + 1]]``; the arrays are copied. Raise InputError
        if the values are not bytes, or the offsets do not divide them.
        """
        flat, ends = _checked_csr(values, offsets)
        rows = pa.LargeBinaryArray.from_buffers(
            pa.large_binary(), len(ends) - 1, [None, pa.py_buffer(ends), pa.py_buffer(flat)]
        )
        encoded = rows.dictionary_encode()
        distinct = len(encoded.dictionary)
        order = np.argsort(pc.binary_length(encoded.dictionary).to_numpy(), kind="stable")
        rank = np.empty(distinct, np.int64)
        rank[order] = np.arange(distinct)
        _, offset_buffer, value_buffer = encoded.dictionary.take(order).buffers()
        # An Arrow array without values may come without buffers.
        distinct_offsets = (
            np.frombuffer(offset_buffer, np.int64)[: distinct + 1].copy()
            if distinct
            else np.zeros(1, np.int64)
        )
        size = int(distinct_offsets[-1])
        distinct_values = (
            np.frombuffer(value_buffer, np.uint8)[:size].copy() if size else np.empty(0, np.uint8)
        )
        # int64: NumPy gathers with a native index without converting it at every query.
        inverse = rank[encoded.indices.to_numpy()]
        counts = np.bincount(inverse, minlength=distinct).astype(np.int64, copy=False)
        return cls(*map(frozen, (distinct_values, distinct_offsets, inverse, counts)))

    def __len__(self) -> int:
        """Return the number of distinct sequences."""
        return len(self.counts)

    def __getitem__(self, index: int) -> NDArray[np.uint8]:
        """Return one distinct sequence."""
        return self.values[self.offsets[index] : self.offsets[index + 1]]

    @cached_property
    def lengths(self) -> NDArray[np.int64]:
        """Length of each distinct sequence, shape (d,)."""
        return frozen(np.diff(self.offsets))

    @cached_property
    def strings(self) -> list[str]:
        """Each distinct sequence as text, one character of that code point a value."""
        text = self.values.tobytes().decode("latin-1")
        bounds = self.offsets.tolist()
        return [text[low:high] for low, high in pairwise(bounds)]

    @cached_property
    def histogram(self) -> NDArray[np.uint16 | np.uint32]:
        """How often each value occurs in each distinct sequence, shape (d, largest value + 1).

        A column is contiguous in memory, because the measures read it value by value.
        """
        size = int(self.values.max()) + 1 if len(self.values) else 0
        longest = int(self.lengths.max()) if len(self) else 0
        kind = np.uint16 if longest <= _UINT16_MAX else np.uint32
        counts: NDArray[np.uint16 | np.uint32] = np.zeros((len(self), size), kind, order="F")
        step = max(1, _HISTOGRAM_BLOCK // max(1, size))
        for low in range(0, len(self), step):
            high = min(low + step, len(self))
            rows = np.repeat(np.arange(high - low), self.lengths[low:high])
            values = self.values[self.offsets[low] : self.offsets[high]]
            bins = np.bincount(rows * size + values, minlength=(high - low) * size)
            counts[low:high] = bins.reshape(high - low, size)
        return frozen(counts)

    @cached_property
    def value_sets(self) -> NDArray[np.uint64]:
        """The set of values of each distinct sequence as bits, shape (d, ceil(k / 64))."""
        present = self.histogram > 0
        words = -(-present.shape[1] // _WORD_BITS)
        sets = np.zeros((len(self), words), np.uint64)
        for value in range(present.shape[1]):
            word, bit = divmod(value, _WORD_BITS)
            sets[:, word] |= present[:, value].astype(np.uint64) << np.uint64(bit)
        return frozen(sets)

    @cached_property
    def value_set_sizes(self) -> NDArray[np.int16]:
        """How many different values each distinct sequence has, shape (d,)."""
        return frozen(np.bitwise_count(self.value_sets).sum(axis=1, dtype=np.int16))

    def overlap(
        self, query: NDArray[np.uint8], *, only: NDArray[np.int64] | None = None
    ) -> tuple[NDArray[np.int16], NDArray[np.int16]]:
        """Count the different values that a query and each distinct sequence share, in any order.

        Return how many are in both and how many in at least one of them, for the distinct sequences
        `only`, or for all.
        """
        sets = self.value_sets if only is None else self.value_sets[only]
        values = np.unique(query)
        wanted = [0] * sets.shape[1]
        for value in values.tolist():
            word, bit = divmod(value, _WORD_BITS)
            if word < len(wanted):  # a value past the last word is in no sequence of the table
                wanted[word] |= 1 << bit
        both = np.zeros(len(sets), np.int16)
        for word, bits in enumerate(wanted):
            both += np.bitwise_count(sets[:, word] & np.uint64(bits))
        sizes = self.value_set_sizes if only is None else self.value_set_sizes[only]
        return both, sizes + np.int16(len(values)) - both


def checked_sequence(values: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a sequence as it is, or raise InputError if it is not a flat uint8 array."""
    array = np.asarray(values)
    if array.dtype != np.uint8 or array.ndim != 1:
        msg = (
            f"a sequence holds {array.dtype} values in {array.ndim} dimensions; give its "
            "class codes or angle levels (0 to 255) as a one-dimensional uint8 array."
        )
        raise InputError(msg)
    return array


def _checked_csr(
    values: NDArray[np.uint8], offsets: NDArray[np.int64]
) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Return values and offsets as contiguous arrays that Arrow can read in place."""
    flat = np.ascontiguousarray(checked_sequence(values))
    ends = np.ascontiguousarray(offsets, dtype=np.int64)
    whole = ends.ndim == 1 and len(ends) > 0 and ends[0] == 0 and ends[-1] == len(flat)
    # Arrow trusts the offsets: decreasing ones would read outside the values.
    if not whole or bool((np.diff(ends) < 0).any()):
        msg = (
            f"the offsets of the sequences do not divide their {len(flat)} values; give one "
            "offset more than there are sequences, from 0 up to the number of values, none "
            "smaller than the one before."
        )
        raise InputError(msg)
    return flat, ends


def consecutive(first: NDArray[np.int64], size: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the whole numbers of some ranges, one range after the other."""
    ends = np.cumsum(size)
    return np.repeat(first - ends + size, size) + np.arange(size.sum())


def frozen(array: _Array) -> _Array:
    """Return the array, made read-only."""
    array.setflags(write=False)
    return array
