from __future__ import annotations

import itertools
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rapidfuzz.distance import Levenshtein
from rapidfuzz.process import cdist

from semsig_gis.core.errors import InputError
from semsig_gis.database.database import SequenceTable
from semsig_gis.matching.metrics import edit
from semsig_gis.matching.metrics.edit import BLOCK, BitPlanes, EditWeights

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Bytes = NDArray[np.uint8]

ONE = st.lists(st.integers(0, 3), max_size=9)
WEIGHTS = st.builds(EditWeights, *[st.integers(1, 7)] * 3)
UNIT = EditWeights()


def slow_cost(
    query: Sequence[int],
    row: Sequence[int],
    weights: EditWeights = UNIT,
    wildcard: int | None = None,
) -> int:
    """Fill the whole table of costs, one column an object of the row."""
    column = [weights.delete * i for i in range(len(query) + 1)]
    for value in row:
        before, column = column, [column[0] + weights.insert]
        for i, own in enumerate(query):
            change = 0 if own in {value, wildcard} else weights.substitute
            steps = before[i] + change, before[i + 1] + weights.insert, column[i] + weights.delete
            column.append(min(steps))
    return column[-1]


def distance(
    query: list[int], row: list[int], *, normalized: bool, weights: EditWeights | None = None
) -> float:
    table = SequenceTable.from_csr(np.array(row, np.uint8), np.array([0, len(row)]))
    queries = [np.array(query, np.uint8)]
    return float(edit.distances(queries, table, normalized=normalized, weights=weights)[0, 0])


@given(ONE, ONE, WEIGHTS)
def test_raw_is_the_cost(query: list[int], row: list[int], weights: EditWeights) -> None:
    expected = slow_cost(query, row, weights)
    assert distance(query, row, normalized=False, weights=weights) == expected


@given(ONE, ONE, WEIGHTS | st.just(UNIT))
def test_normalized_is_the_share_of_the_largest_cost(
    query: list[int], row: list[int], weights: EditWeights
) -> None:
    # Sequences of these lengths that share nothing.
    largest = slow_cost([8] * len(query), [9] * len(row), weights)
    if weights == UNIT:
        assert largest == max(len(query), len(row))
    expected = slow_cost(query, row, weights) / largest if largest else 0
    found = distance(query, row, normalized=True, weights=weights)
    assert found == pytest.approx(expected, abs=1e-6)


@given(ONE, ONE, ONE)
def test_a_way_round_is_never_shorter(
    first: list[int], second: list[int], third: list[int]
) -> None:
    straight = distance(first, third, normalized=False)
    stops = distance(first, second, normalized=False) + distance(second, third, normalized=False)
    assert straight <= stops


def test_insert_is_what_the_query_missed_and_delete_what_it_saw_falsely() -> None:
    weights = EditWeights(insert=2, delete=5, substitute=3)
    costs = [
        distance(query, row, normalized=False, weights=weights)
        for query, row in [([1], [1, 2]), ([1, 2], [1]), ([1], [2])]
    ]
    assert costs == [2, 5, 3]


def test_long_sequences_and_heavy_weights_keep_their_cost() -> None:
    weights = EditWeights(insert=100, delete=100, substitute=100)
    assert distance([1] * 300, [2] * 300, normalized=False, weights=weights) == 30_000


@pytest.fixture
def table() -> SequenceTable:
    rng = np.random.default_rng(4)
    lengths = rng.integers(0, 60, 500)
    flat = rng.integers(0, 5, lengths.sum()).astype(np.uint8)
    return SequenceTable.from_csr(flat, np.cumsum([0, *lengths]))


@pytest.mark.parametrize("normalized", [True, False])
def test_the_kernel_and_rapidfuzz_agree(
    *, monkeypatch: pytest.MonkeyPatch, table: SequenceTable, normalized: bool
) -> None:
    queries = [table[place] for place in range(0, len(table), 50)]
    some, few = np.arange(0, len(table), 3), np.array([len(table) - 1, 3])
    measure = partial(edit.distances, queries, table, normalized=normalized)
    expected = measure()
    assert table not in edit._planes
    np.testing.assert_array_equal(measure(threads=2), expected)
    monkeypatch.setattr(edit, "_LOADING", 0)
    np.testing.assert_array_equal(measure(only=few), expected[:, few])
    assert table not in edit._planes
    np.testing.assert_array_equal(measure(), expected)
    assert table in edit._planes
    np.testing.assert_array_equal(measure(threads=2), expected)
    np.testing.assert_array_equal(measure(only=some), expected[:, some])


def test_a_large_table_gets_the_kernel_when_it_is_asked_again(
    monkeypatch: pytest.MonkeyPatch, table: SequenceTable
) -> None:
    monkeypatch.setattr(edit, "_LARGE", len(table.values))
    first = edit.distances([table[3]], table)
    assert table not in edit._planes
    np.testing.assert_array_equal(edit.distances([table[3]], table), first)
    assert table in edit._planes


@given(st.lists(st.integers(0, 3), max_size=4), ONE)
def test_a_wildcard_is_the_best_of_all_values(query: list[int], row: list[int]) -> None:
    table = SequenceTable.from_csr(np.array(row, np.uint8), np.array([0, len(row)]))
    found = edit.distances([np.array(query, np.uint8)], table, normalized=False, wildcard=0)
    meant = itertools.product(*([0, 1, 2, 3] if value == 0 else [value] for value in query))
    assert found.tolist() == [[min(slow_cost(one, row) for one in meant)]]


def test_a_wildcard_has_no_weights(table: SequenceTable) -> None:
    with pytest.raises(InputError, match="wildcard was given with edit weights 2/1/1"):
        edit.distances([table[0]], table, wildcard=0, weights=EditWeights(insert=2))


@pytest.mark.parametrize("weight", [0, -1, 101, 1.5, True, "1", None])
@pytest.mark.parametrize("name", ["insert", "delete", "substitute"])
def test_weights_are_whole_numbers_in_range(name: str, weight: object) -> None:
    with pytest.raises(InputError, match=f"edit weight '{name}' is .*from 1 to 100"):
        EditWeights(**{name: weight})  # type: ignore[arg-type]


# --- Bit planes -------------------------------------------------------------------------------


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
    assert found.tolist() == [[slow_cost(query, row, wildcard=wildcard) for row in rows]]


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
    assert found.tolist() == [[slow_cost(query, row, wildcard=3) for row in rows]]


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
