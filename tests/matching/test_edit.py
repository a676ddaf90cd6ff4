from __future__ import annotations

import itertools
import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.core.errors import InputError
from semsig_gis.database.sequences import SequenceTable
from semsig_gis.matching.metrics import edit
from semsig_gis.matching.metrics.edit import EditWeights

ONE = st.lists(st.integers(0, 3), max_size=9)
WEIGHTS = st.builds(EditWeights, *[st.integers(1, 7)] * 3)


def slow_cost(query: list[int], row: list[int], weights: EditWeights) -> int:
    """Fill the whole table of the textbook."""
    costs = [[math.inf] * (len(row) + 1) for _ in range(len(query) + 1)]
    for i in range(len(query) + 1):
        for j in range(len(row) + 1):
            if i == j == 0:
                costs[i][j] = 0
            if i:
                costs[i][j] = min(costs[i][j], costs[i - 1][j] + weights.delete)
            if j:
                costs[i][j] = min(costs[i][j], costs[i][j - 1] + weights.insert)
            if i and j:
                change = 0 if query[i - 1] == row[j - 1] else weights.substitute
                costs[i][j] = min(costs[i][j], costs[i - 1][j - 1] + change)
    return int(costs[-1][-1])


def largest_cost(query: list[int], row: list[int], weights: EditWeights) -> int:
    """Return the cost between sequences of these lengths that share nothing."""
    return slow_cost([8] * len(query), [9] * len(row), weights)


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


@given(ONE, ONE, WEIGHTS)
def test_normalized_is_the_share_of_the_largest_cost(
    query: list[int], row: list[int], weights: EditWeights
) -> None:
    largest = largest_cost(query, row, weights)
    expected = slow_cost(query, row, weights) / largest if largest else 0
    found = distance(query, row, normalized=True, weights=weights)
    assert found == pytest.approx(expected, abs=1e-6)


@given(ONE, ONE)
def test_with_unit_weights_it_is_divided_by_the_longer_length(
    query: list[int], row: list[int]
) -> None:
    cost = slow_cost(query, row, EditWeights())
    expected = cost / max(len(query), len(row), 1)
    assert distance(query, row, normalized=True) == pytest.approx(expected, abs=1e-6)


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
    assert found.tolist() == [[min(slow_cost([*one], row, EditWeights()) for one in meant)]]


def test_a_wildcard_has_no_weights(table: SequenceTable) -> None:
    with pytest.raises(InputError, match="wildcard was given with edit weights 2/1/1"):
        edit.distances([table[0]], table, wildcard=0, weights=EditWeights(insert=2))


@pytest.mark.parametrize("weight", [0, -1, 101, 1.5, True, "1", None])
@pytest.mark.parametrize("name", ["insert", "delete", "substitute"])
def test_weights_are_whole_numbers_in_range(name: str, weight: object) -> None:
    with pytest.raises(InputError, match=f"edit weight '{name}' is .*from 1 to 100"):
        EditWeights(**{name: weight})  # type: ignore[arg-type]
