from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.core.errors import InputError
from semsig_gis.database.sequences import SequenceTable
from semsig_gis.matching.metrics.edit import BLOCK, bit_planes
from semsig_gis.matching.nearest import nearest

if TYPE_CHECKING:
    from numpy.typing import NDArray

ONE = st.lists(st.integers(0, 2), max_size=6)


def table_of(rows: list[list[int]]) -> SequenceTable:
    flat = np.array([value for row in rows for value in row], np.uint8)
    return SequenceTable.from_csr(flat, np.cumsum([0, *map(len, rows)]))


def random_table(seed: int, rows: int, longest: int) -> SequenceTable:
    rng = np.random.default_rng(seed)
    lengths = rng.integers(0, longest, rows)
    flat = rng.choice([1, 2, 3], lengths.sum(), p=[0.7, 0.2, 0.1]).astype(np.uint8)
    return SequenceTable.from_csr(flat, np.cumsum([0, *lengths]))


def check(
    query: NDArray[np.uint8],
    table: SequenceTable,
    top: int,
    *,
    normalized: bool,
    among: NDArray[np.bool_] | None = None,
) -> int:
    """Compare a search with a full scan; return how many rows were skipped."""
    found = nearest(query, table, top, among=among, normalized=normalized, wildcard=3)
    (distances,) = bit_planes(table).edit_distances([query], normalized=normalized, wildcard=3)
    if among is not None:
        distances = np.where(among, distances, np.float32(np.inf))
    scores = distances[table.inverse]
    order = np.lexsort((np.arange(len(scores)), scores))
    order = order[np.isfinite(scores[order])]
    cut = scores[order[min(top, len(order)) - 1]] if len(order) else 0
    order = order[scores[order] <= cut]
    np.testing.assert_array_equal(found.rows, order)
    np.testing.assert_array_equal(found.distances, scores[order])
    assert found.distances.dtype == np.float32
    return found.skipped


@given(
    query=ONE,
    rows=st.lists(ONE, max_size=30),
    top=st.integers(1, 40),
    normalized=st.booleans(),
    data=st.data(),
)
def test_equals_a_full_scan_ties_included(
    *, query: list[int], rows: list[list[int]], top: int, normalized: bool, data: st.DataObject
) -> None:
    table = table_of(rows)
    among = data.draw(st.none() | st.lists(st.booleans(), min_size=len(table), max_size=len(table)))
    mask = None if among is None else np.array(among, np.bool_)
    check(np.array(query, np.uint8), table, top, normalized=normalized, among=mask)


@pytest.mark.parametrize("normalized", [True, False])
def test_skips_what_is_too_short_or_too_long(*, normalized: bool) -> None:
    table = random_table(1, 8 * BLOCK, 60)
    rng = np.random.default_rng(2)
    skipped = [
        check(table[int(place)], table, top, normalized=normalized)
        for place in rng.integers(0, len(table), 8)
        for top in (1, 100, 20_000)
    ]
    assert max(skipped) > len(table.inverse) / 2
    assert min(skipped) >= 0


def test_searches_on_where_no_sequence_of_like_length_may_be_found() -> None:
    table = random_table(3, 4 * BLOCK, 60)
    query = np.full(30, 1, np.uint8)
    among = (table.lengths < 5) | (table.lengths > 55)
    check(query, table, 10, normalized=True, among=among)
    nothing = np.zeros(len(table), np.bool_)
    assert len(nearest(query, table, 10, among=nothing).rows) == 0


def test_input_that_cannot_be_searched_for() -> None:
    table = table_of([[1]])
    with pytest.raises(InputError, match="give a whole number from 1"):
        nearest(np.array([1], np.uint8), table, 0)
    with pytest.raises(InputError, match="one-dimensional uint8 array"):
        nearest(np.array([1]), table, 1)
