from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.core.errors import InputError
from semsig_gis.database.sequences import SequenceTable, checked_sequence

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Few values make equal sequences likely; 255 and 64 reach the last and the second word of bits.
VALUES = st.sampled_from([0, 1, 2, 63, 64, 255])
ROWS = st.lists(st.lists(VALUES, max_size=5), max_size=12)


def table_of(rows: list[list[int]]) -> SequenceTable:
    values = np.array([value for row in rows for value in row], np.uint8)
    return SequenceTable.from_csr(values, np.cumsum([0, *map(len, rows)]))


def sequence(*values: int) -> NDArray[np.uint8]:
    return np.array(values, np.uint8)


@given(ROWS)
def test_distinct_sequences_by_length_then_first_appearance(rows: list[list[int]]) -> None:
    distinct = sorted(dict.fromkeys(map(tuple, rows)), key=len)
    counts = Counter(map(tuple, rows))
    table = table_of(rows)
    assert len(table) == len(distinct)
    assert [tuple(table[index].tolist()) for index in range(len(table))] == distinct
    assert [distinct[index] for index in table.inverse.tolist()] == list(map(tuple, rows))
    assert table.counts.tolist() == [counts[one] for one in distinct]
    assert table.lengths.tolist() == [len(one) for one in distinct]
    assert table.strings == ["".join(map(chr, one)) for one in distinct]


@given(ROWS)
def test_histogram_counts_every_value(rows: list[list[int]]) -> None:
    table = table_of(rows)
    histogram = table.histogram
    assert histogram.dtype == np.uint16
    assert histogram.shape == (
        len(table),
        max((max(row, default=-1) for row in rows), default=-1) + 1,
    )
    for index in range(len(table)):
        counts = Counter(table[index].tolist())
        assert histogram[index].tolist() == [counts[value] for value in range(histogram.shape[1])]


@given(ROWS, st.lists(VALUES, max_size=5))
def test_overlap_is_that_of_sets(rows: list[list[int]], query: list[int]) -> None:
    table = table_of(rows)
    both, either = table.overlap(sequence(*query))
    sets = [set(table[index].tolist()) for index in range(len(table))]
    assert both.tolist() == [len(one & set(query)) for one in sets]
    assert either.tolist() == [len(one | set(query)) for one in sets]
    some = np.arange(0, len(table), 2)
    assert [part.tolist() for part in table.overlap(sequence(*query), only=some)] == [
        both[some].tolist(),
        either[some].tolist(),
    ]


def test_histogram_in_blocks_equals_one_block(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    rows = [rng.integers(0, 9, length).tolist() for length in rng.integers(0, 9, 50)]
    whole = table_of(rows).histogram
    monkeypatch.setattr("semsig_gis.database.sequences._HISTOGRAM_BLOCK", 30)
    assert np.array_equal(table_of(rows).histogram, whole)


def test_counts_of_a_very_long_sequence_do_not_wrap() -> None:
    table = table_of([[3] * 70_000, [3]])
    assert table.histogram[:, 3].tolist() == [1, 70_000]


@pytest.mark.parametrize("name", ["values", "offsets", "inverse", "counts", "lengths", "histogram"])
def test_arrays_are_read_only(name: str) -> None:
    table = table_of([[1, 2], [1]])
    with pytest.raises(ValueError, match="read-only"):
        getattr(table, name)[...] = 0


def test_table_does_not_follow_its_input() -> None:
    values, offsets = sequence(1, 2, 3), np.array([0, 1, 3])
    table = SequenceTable.from_csr(values, offsets)
    values[:] = 9
    offsets[:] = 0
    assert [table[0].tolist(), table[1].tolist()] == [[1], [2, 3]]


def test_input_may_be_strided_and_of_another_integer_type() -> None:
    values = np.arange(8, dtype=np.uint8)[::2]
    table = SequenceTable.from_csr(values, np.array([0, 2, 4], np.int32))
    assert [table[0].tolist(), table[1].tolist()] == [[0, 2], [4, 6]]


@pytest.mark.parametrize(
    "offsets",
    [[], [0], [1, 3], [0, 2], [0, 4], [0, 3, 2, 3], [[0, 3]]],
    ids=["none", "too few", "late start", "short", "long", "decreasing", "two-dimensional"],
)
def test_offsets_that_do_not_divide_the_values(offsets: list[int]) -> None:
    with pytest.raises(InputError, match="do not divide their 3 values"):
        SequenceTable.from_csr(sequence(1, 2, 3), np.array(offsets, np.int64))


@pytest.mark.parametrize("values", [np.array([1, 300]), np.zeros((2, 2), np.uint8)])
def test_values_that_are_no_sequence(values: NDArray[np.uint8]) -> None:
    with pytest.raises(InputError, match="one-dimensional uint8 array"):
        checked_sequence(values)
    with pytest.raises(InputError, match="one-dimensional uint8 array"):
        SequenceTable.from_csr(values, np.array([0, 2]))
