"""Tables of distinct sequences, so that each sequence is measured only once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pyarrow as pa

from semsig_gis.core import InputError
from semsig_gis.storage import whole_numbers

if TYPE_CHECKING:
    from numpy.typing import NDArray

    _Array = TypeVar("_Array", bound="NDArray[Any]")

WORD_BITS = 64
HISTOGRAM_BLOCK = 1 << 22  # counters in one step of the histogram: 32 MB of temporaries


@dataclass(frozen=True, eq=False)
class SequenceTable:
    """The d distinct sequences of a list of n sequences, made by `from_csr`.

    They are ordered by length, then by first appearance. Distinct sequence ``i`` is
    ``values[offsets[i]:offsets[i + 1]]`` and may be empty. `inverse`, shape (n,), is the number of
    the distinct sequence of each row of the list; `counts`, shape (d,), the number of rows of each
    distinct sequence (the sizes of the signature groups). All arrays are read-only.
    """

    values: NDArray[np.uint8]
    offsets: NDArray[np.int64]
    inverse: NDArray[np.int64]
    counts: NDArray[np.int64]

    @classmethod
    def from_csr(cls, values: NDArray[np.uint8], offsets: NDArray[np.int64]) -> SequenceTable:
        """Find the distinct sequences of a list of sequences, in flat values and offsets.

        Row ``i`` is ``values[offsets[i]:offsets[i + 1]]``; the arrays are copied. Raise InputError
        if the values are not bytes, or the offsets do not divide them.
        """
        from pyarrow.compute import binary_length  # noqa: PLC0415 - slow, and rarely needed

        flat = np.ascontiguousarray(checked_sequence(values))
        ends = np.ascontiguousarray(offsets, dtype=np.int64)
        complete = ends.ndim == 1 and len(ends) > 0 and ends[0] == 0 and ends[-1] == len(flat)
        # Arrow does not check the offsets: decreasing ones would read outside the values.
        if not complete or bool((np.diff(ends) < 0).any()):
            raise InputError(
                f"the offsets of the sequences do not divide their {len(flat)} values; give one "
                "offset more than there are sequences, from 0 up to the number of values, none "
                "smaller than the one before."
            )
        rows = pa.LargeBinaryArray.from_buffers(
            pa.large_binary(), len(ends) - 1, [None, pa.py_buffer(ends), pa.py_buffer(flat)]
        )
        # Arrow numbers the sequences by first appearance; here the short ones come first.
        encoded = rows.dictionary_encode()
        distinct = len(encoded.dictionary)
        lengths = whole_numbers(binary_length(encoded.dictionary))
        order = np.argsort(lengths, kind="stable")
        rank = np.empty(distinct, np.int64)
        rank[order] = np.arange(distinct)
        distinct_offsets = np.append(0, np.cumsum(lengths[order]))
        # `pa.array` would load pandas.
        indices = pa.Array.from_buffers(pa.int64(), distinct, [None, pa.py_buffer(order)])
        # An Arrow array without values may have no buffers.
        buffer = encoded.dictionary.take(indices).buffers()[2] or b""
        distinct_values = np.frombuffer(buffer, np.uint8)[: distinct_offsets[-1]].copy()
        # NumPy uses int64 indices without converting them at every query.
        inverse = rank[whole_numbers(encoded.indices)]
        counts = np.bincount(inverse, minlength=distinct).astype(np.int64, copy=False)
        return cls(*map(read_only, (distinct_values, distinct_offsets, inverse, counts)))

    def __len__(self) -> int:
        """Return the number of distinct sequences."""
        return len(self.counts)

    def __getitem__(self, index: int) -> NDArray[np.uint8]:
        """Return one distinct sequence."""
        return self.values[self.offsets[index] : self.offsets[index + 1]]

    @cached_property
    def lengths(self) -> NDArray[np.int64]:
        """Length of each distinct sequence, shape (d,)."""
        return read_only(np.diff(self.offsets))

    @cached_property
    def strings(self) -> list[str]:
        """Each distinct sequence as text: a character for each value, with that code point."""
        text = self.values.tobytes().decode("latin-1")
        bounds = self.offsets.tolist()
        return [text[low:high] for low, high in pairwise(bounds)]

    @cached_property
    def histogram(self) -> NDArray[np.uint16 | np.uint32]:
        """Count of each value in each distinct sequence, shape (d, largest value + 1).

        A column is contiguous in memory, because the metrics read it value by value.
        """
        size = int(self.values.max()) + 1 if len(self.values) else 0
        longest = int(self.lengths.max()) if len(self) else 0
        kind = np.uint16 if longest <= np.iinfo(np.uint16).max else np.uint32
        counts: NDArray[np.uint16 | np.uint32] = np.zeros((len(self), size), kind, order="F")
        # A block of sequences is counted at once: bin `row * size + value`.
        step = max(1, HISTOGRAM_BLOCK // max(1, size))
        for low in range(0, len(self), step):
            high = min(low + step, len(self))
            rows = np.repeat(np.arange(high - low), self.lengths[low:high])
            values = self.values[self.offsets[low] : self.offsets[high]]
            bins = np.bincount(rows * size + values, minlength=(high - low) * size)
            counts[low:high] = bins.reshape(high - low, size)
        return read_only(counts)

    @cached_property
    def value_sets(self) -> NDArray[np.uint64]:
        """The set of values of each distinct sequence as bits, shape (d, ceil(k / 64))."""
        present = self.histogram > 0
        words = -(-present.shape[1] // WORD_BITS)
        sets = np.zeros((len(self), words), np.uint64)
        for value in range(present.shape[1]):
            word, bit = divmod(value, WORD_BITS)
            sets[:, word] |= present[:, value].astype(np.uint64) << np.uint64(bit)
        return read_only(sets)

    @cached_property
    def value_set_sizes(self) -> NDArray[np.int16]:
        """Number of different values in each distinct sequence, shape (d,)."""
        return read_only(np.bitwise_count(self.value_sets).sum(axis=1, dtype=np.int16))

    def overlap(
        self, query: NDArray[np.uint8], *, only: NDArray[np.int64] | None = None
    ) -> tuple[NDArray[np.int16], NDArray[np.int16]]:
        """Count the different values of a query and of each distinct sequence.

        Return the number of values in both and the number in at least one of them, for the distinct
        sequences `only`, or for all.
        """
        sets = self.value_sets if only is None else self.value_sets[only]
        values = np.unique(query)
        # The set of the query as bits, in the layout of `value_sets`.
        words = [0] * sets.shape[1]
        for value in values.tolist():
            word, bit = divmod(value, WORD_BITS)
            if word < len(words):  # a value past the last word is in no sequence of the table
                words[word] |= 1 << bit
        both = np.zeros(len(sets), np.int16)
        for word, bits in enumerate(words):
            both += np.bitwise_count(sets[:, word] & np.uint64(bits))
        sizes = self.value_set_sizes if only is None else self.value_set_sizes[only]
        return both, sizes + np.int16(len(values)) - both


def checked_sequence(values: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a sequence unchanged; raise InputError if it is not a one-dimensional uint8 array."""
    array = np.asarray(values)
    if array.dtype != np.uint8 or array.ndim != 1:
        raise InputError(
            f"a sequence contains {array.dtype} values in {array.ndim} dimensions; give its "
            "class codes or angle levels (0 to 255) as a one-dimensional uint8 array."
        )
    return array


def read_only(array: _Array) -> _Array:
    """Return the array, made read-only."""
    array.setflags(write=False)
    return array
