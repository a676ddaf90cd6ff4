from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rapidfuzz.distance import Levenshtein
from rapidfuzz.process import cdist

from semsig_gis.matching.metrics.edit import BLOCK, BitPlanes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Bytes = NDArray[np.uint8]


def textbook(query: Sequence[int], row: Sequence[int], wildcard: int | None = None) -> int:
    """Fill the whole table of costs, one column an object of the row."""
    column = list(range(len(query) + 1))
    for value in row:
        before, column = column, [column[0] + 1]
        for i, own in enumerate(query):
            same = own in {value, wildcard}
            column.append(min(before[i] + (not same), before[i + 1] + 1, column[i] + 1))
    return column[-1]


def turned(rows: Sequence[Sequence[int]]) -> BitPlanes:
    flat = np.array([value for row in rows for value in row], np.uint8)
    return BitPlanes.build(flat, np.cumsum([0, *map(len, rows)]))


def by_rapidfuzz(queries: Sequence[Bytes], rows: Sequence[Bytes], *, normalized: bool) -> Bytes:
    texts = [[one.tobytes().decode("latin-1") for one in some] for some in (queries, rows)]
    scorer = Levenshtein.normalized_distance if normalized else Levenshtein.distance
    found: Bytes = cdist(*texts, scorer=scorer, dtype=np.float32)
    return found


def random_rows(seed: int, count: int, longest: int, values: int) -> list[Bytes]:
    """Return rows over some of the values, the lengths in no order, some equal."""
    rng = np.random.default_rng(seed)
    known = rng.permutation(256)[:values]
    rows = [
        rng.choice(known, length).astype(np.uint8) for length in rng.integers(0, longest, count)
    ]
    return rows + rows[: count // 10]


SHORT = st.lists(st.sampled_from([0, 1, 2, 255]), max_size=9)


@given(query=SHORT, rows=st.lists(SHORT, max_size=6), wildcard=st.sampled_from([None, 0, 2, 77]))
def test_equals_the_textbook(query: list[int], rows: list[list[int]], wildcard: int | None) -> None:
    found = turned(rows).edit_distances(
        [np.array(query, np.uint8)], normalized=False, wildcard=wildcard
    )
    assert found.tolist() == [[textbook(query, row, wildcard) for row in rows]]


@settings(deadline=None)  # the first call compiles
@pytest.mark.parametrize("normalized", [True, False])
@given(
    seed=st.integers(0, 2**32 - 1),
    longest=st.sampled_from([1, 20, 200]),
    values=st.sampled_from([1, 2, 11, 16, 255, 256]),
)
def test_equals_rapidfuzz(*, normalized: bool, seed: int, longest: int, values: int) -> None:
    rows = random_rows(seed, 40, longest, values)
    queries = [*rows[:3], *random_rows(seed + 1, 3, longest, values)]
    flat = np.concatenate(rows)
    planes = BitPlanes.build(flat, np.cumsum([0, *map(len, rows)]))
    found = planes.edit_distances(queries, normalized=normalized)
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, by_rapidfuzz(queries, rows, normalized=normalized))


@pytest.mark.parametrize("normalized", [True, False])
def test_several_blocks_and_a_thousand_objects(*, normalized: bool) -> None:
    rows = sorted(random_rows(3, 2 * BLOCK, 30, 11), key=len)
    rows += random_rows(4, 3, 1000, 255)
    queries = [rows[0], rows[BLOCK], rows[-1], np.tile(rows[-2], 3)[:1000], rows[5][:0]]
    planes = turned([row.tolist() for row in rows])
    found = planes.edit_distances(queries, normalized=normalized)
    np.testing.assert_array_equal(found, by_rapidfuzz(queries, rows, normalized=normalized))
    for query, expected in zip(queries, found, strict=True):
        alone = planes.edit_distances([query], normalized=normalized)
        np.testing.assert_array_equal(alone[0], expected)
    for threads in (2, 3, 7):
        shared = planes.edit_distances(queries, normalized=normalized, threads=threads)
        np.testing.assert_array_equal(shared, found)


def test_a_wildcard_in_a_long_query() -> None:
    rng = np.random.default_rng(0)
    rows = [rng.integers(0, 5, length).tolist() for length in (0, 1, 80, 150)]
    query = rng.integers(0, 5, 150).tolist()
    found = turned(rows).edit_distances([np.array(query, np.uint8)], normalized=False, wildcard=3)
    assert found.tolist() == [[textbook(query, row, 3) for row in rows]]


def test_neither_sequences_nor_queries() -> None:
    query = np.array([1], np.uint8)
    assert turned([]).edit_distances([query]).shape == (1, 0)
    assert turned([[1]]).edit_distances([]).shape == (0, 1)
    assert turned([[], []]).edit_distances([query, query[:0]]).tolist() == [[1, 1], [0, 0]]


@pytest.mark.parametrize(("values", "bits"), [(11, 8), (16, 9), (256, 33)])
def test_planes_need_few_bits_an_object(values: int, bits: int) -> None:
    rows = np.resize(np.arange(values), 20 * BLOCK).astype(np.uint8)
    planes = BitPlanes.build(rows, np.arange(0, len(rows) + 1, 20))
    assert planes.planes.nbytes * 8 == bits * len(rows)
    assert not planes.planes.flags.writeable
