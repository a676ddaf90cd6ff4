"""Laws that every measure keeps, and what the Jaccard and the histogram distance are."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.core.errors import InputError, UnknownNameError
from semsig_gis.database.database import SequenceTable
from semsig_gis.matching.metrics import METRICS, metric
from semsig_gis.matching.metrics.edit import EditWeights

if TYPE_CHECKING:
    from semsig_gis.matching.metrics import Metric

Sequences: TypeAlias = Sequence[Sequence[int]]

VALUES = st.sampled_from([0, 1, 2, 3, 70])
ONE = st.lists(VALUES, max_size=9)
SOME = st.lists(ONE, min_size=1, max_size=5)

each = pytest.mark.parametrize("measure", METRICS.values(), ids=list(METRICS))


def between(
    measure: Metric, queries: Sequences, rows: Sequences, *, normalized: bool = True
) -> np.ndarray:
    """Return the distances of queries to rows that may repeat."""
    flat = np.array([value for row in rows for value in row], np.uint8)
    table = SequenceTable.from_csr(flat, np.cumsum([0, *map(len, rows)]))
    arrays = [np.array(query, np.uint8) for query in queries]
    return measure.distances(arrays, table, normalized=normalized)[:, table.inverse]


@each
@given(queries=SOME, rows=SOME)
def test_distances_are_float32_on_the_unit_interval(
    measure: Metric, queries: Sequences, rows: Sequences
) -> None:
    found = between(measure, queries, rows)
    assert found.dtype == np.float32
    assert found.shape == (len(queries), len(rows))
    assert ((found >= 0) & (found <= 1)).all()


@each
@given(rows=SOME)
def test_a_sequence_is_at_no_distance_from_itself(measure: Metric, rows: Sequences) -> None:
    assert not np.diagonal(between(measure, rows, rows)).any()


@each
@pytest.mark.parametrize("normalized", [True, False])
@given(left=SOME, right=SOME)
def test_both_directions_agree(
    measure: Metric, *, normalized: bool, left: Sequences, right: Sequences
) -> None:
    there = between(measure, left, right, normalized=normalized)
    back = between(measure, right, left, normalized=normalized)
    np.testing.assert_allclose(there, back.T, rtol=1e-6)


@each
@given(row=st.lists(VALUES, min_size=1, max_size=7))
def test_an_empty_sequence_is_like_an_empty_one_only(measure: Metric, row: Sequence[int]) -> None:
    assert between(measure, [[], row], [[], row]).tolist() == [[0, 1], [1, 0]]


@each
@given(row=st.lists(VALUES, min_size=1, max_size=7))
def test_sequences_without_a_common_value_are_at_the_largest_distance(
    measure: Metric, row: Sequence[int]
) -> None:
    strangers = [value + 100 for value in row]
    assert between(measure, [row], [strangers]).tolist() == [[1]]
    assert between(measure, [strangers], [row]).tolist() == [[1]]


@pytest.mark.parametrize("name", ["jaccard", "histogram"])
@given(data=st.data(), queries=SOME, rows=SOME)
def test_order_does_not_matter(
    name: str, data: st.DataObject, queries: Sequences, rows: Sequences
) -> None:
    mixed = [data.draw(st.permutations(row)) for row in rows]
    straight = between(METRICS[name], queries, rows)
    np.testing.assert_array_equal(straight, between(METRICS[name], queries, mixed))


@each
@pytest.mark.parametrize("normalized", [True, False])
def test_a_query_does_not_depend_on_the_others_or_on_the_rows_asked_for(
    measure: Metric, *, normalized: bool
) -> None:
    rng = np.random.default_rng(1)
    lengths = rng.integers(0, 40, 300)
    flat = rng.integers(0, 12, lengths.sum()).astype(np.uint8)
    table = SequenceTable.from_csr(flat, np.cumsum([0, *lengths]))
    queries = [rng.integers(0, 14, length).astype(np.uint8) for length in range(0, 80, 2)]
    together = measure.distances(queries, table, normalized=normalized)
    only = np.array([5, 3, 250 % len(table)])
    for query, expected in zip(queries, together, strict=True):
        alone = measure.distances([query], table, normalized=normalized)
        np.testing.assert_array_equal(alone[0], expected)
        some = measure.distances([query], table, normalized=normalized, only=only)
        np.testing.assert_array_equal(some[0], expected[only])


@each
def test_no_queries_and_no_rows(measure: Metric) -> None:
    query = np.array([1], np.uint8)
    empty = SequenceTable.from_csr(query[:0], np.array([0]))
    assert measure.distances([query], empty).shape == (1, 0)
    full = SequenceTable.from_csr(query, np.array([0, 1]))
    assert measure.distances([], full).shape == (0, 1)


@each
def test_a_query_that_is_no_array_of_bytes(measure: Metric) -> None:
    query = np.array([1], np.uint8)
    table = SequenceTable.from_csr(query, np.array([0, 1]))
    with pytest.raises(InputError, match="int64 values in 1 dimensions"):
        measure.distances([query.astype(np.int64)], table)


@pytest.mark.parametrize("normalized", [True, False])
@given(query=ONE, row=ONE)
def test_jaccard_is_one_minus_common_over_all(
    *, normalized: bool, query: Sequence[int], row: Sequence[int]
) -> None:
    either = {*query, *row}
    expected = 1 - len({*query} & {*row}) / len(either) if either else 0
    found = between(METRICS["jaccard"], [query], [row], normalized=normalized)
    assert found[0, 0] == np.float32(expected)


@given(query=ONE, row=ONE)
def test_histogram_is_minus_the_sum_or_one_minus_the_mean_of_quotients(
    query: Sequence[int], row: Sequence[int]
) -> None:
    x, y = Counter(query), Counter(row)
    quotients = [min(x[value], y[value]) / max(x[value], y[value]) for value in {*x, *y}]
    raw = between(METRICS["histogram"], [query], [row], normalized=False)
    assert raw[0, 0] == pytest.approx(-sum(quotients), abs=1e-6)
    mean = 1 - np.mean(quotients) if quotients else 0
    found = between(METRICS["histogram"], [query], [row])
    assert found[0, 0] == pytest.approx(mean, abs=1e-6)


def test_an_unknown_name_is_answered_with_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match=r"'jacard' is unknown; the nearest is 'jaccard'"):
        metric("jacard")


def test_weights_reach_the_edit_distance_alone() -> None:
    weights = EditWeights(insert=5)
    table = SequenceTable.from_csr(np.array([1, 2], np.uint8), np.array([0, 2]))
    queries = [np.array([1], np.uint8)]
    weighted = metric("edit", weights=weights).distances(queries, table, normalized=False)
    assert weighted.tolist() == [[5]]
    assert metric("jaccard", weights=weights) is METRICS["jaccard"]
