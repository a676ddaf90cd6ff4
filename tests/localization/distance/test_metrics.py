"""Properties of all metrics, and the values of each."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rapidfuzz.distance import Levenshtein
from rapidfuzz.process import cdist

from semsig_gis.core import InputError
from semsig_gis.database import SequenceTable
from semsig_gis.localization import BLOCK_SEQUENCES, METRICS, BitPlanes, EditWeights, metric
from semsig_gis.localization.distance.metrics import edit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.localization import Distances

    Bytes = NDArray[np.uint8]

Sequences: TypeAlias = Sequence[Sequence[int]]

KINDS = [0, 1, 2, 3, 70]
VALUES = st.sampled_from(KINDS)
ONE = st.lists(VALUES, max_size=9)
SOME = st.lists(ONE, min_size=1, max_size=5)

each = pytest.mark.parametrize("measure", METRICS.values(), ids=list(METRICS))
scaled = pytest.mark.parametrize("normalized", [True, False])


def flat(rows: Sequences | list[Bytes]) -> tuple[Bytes, NDArray[np.int64]]:
    """Return the values of all rows, and where each row begins and ends."""
    values = np.array([value for row in rows for value in row], np.uint8)
    return values, np.cumsum([0, *map(len, rows)])


def between(
    measure: Distances, queries: Sequences, rows: Sequences, *, normalized: bool = True
) -> np.ndarray:
    """Return the distances of queries to rows that may repeat."""
    table = SequenceTable.from_csr(*flat(rows))
    arrays = [np.array(query, np.uint8) for query in queries]
    return measure(arrays, table, normalized=normalized)[:, table.inverse]


@each
@given(queries=SOME, rows=SOME)
def test_distances_are_symmetric_from_zero_if_equal_to_one_without_common_values(
    measure: Distances, queries: Sequences, rows: Sequences
) -> None:
    result = between(measure, queries, rows)
    assert result.shape == (len(queries), len(rows))
    assert result.dtype == np.float32
    assert ((result >= 0) & (result <= 1)).all()
    assert not np.diagonal(between(measure, rows, rows)).any()
    for normalized in (True, False):
        there = between(measure, queries, rows, normalized=normalized)
        back = between(measure, rows, queries, normalized=normalized)
        np.testing.assert_allclose(there, back.T, rtol=1e-6)
    strangers = [[value + 100 for value in row] for row in rows]
    expected = [[float(len(query) + len(row) > 0) for row in rows] for query in queries]
    assert between(measure, queries, strangers).tolist() == expected


@each
@scaled
def test_distances_do_not_depend_on_other_queries_or_rows(
    measure: Distances, *, normalized: bool
) -> None:
    rng = np.random.default_rng(1)
    rows = [rng.integers(0, 12, length).tolist() for length in rng.integers(0, 40, 300)]
    table = SequenceTable.from_csr(*flat(rows))
    queries = [rng.integers(0, 14, length).astype(np.uint8) for length in range(0, 80, 2)]
    together = measure(queries, table, normalized=normalized)
    only = np.array([5, 3, 250 % len(table)])
    for query, expected in zip(queries, together, strict=True):
        single = measure([query], table, normalized=normalized)
        np.testing.assert_array_equal(single[0], expected)
        some = measure([query], table, normalized=normalized, only=only)
        np.testing.assert_array_equal(some[0], expected[only])


@each
def test_empty_queries_and_rows_are_accepted_and_other_types_refused(measure: Distances) -> None:
    assert between(measure, [[1]], []).shape == (1, 0)
    assert between(measure, [], [[1]]).shape == (0, 1)
    with pytest.raises(InputError, match="int64 values in 1 dimensions"):
        measure([np.array([1])], SequenceTable.from_csr(*flat([[1]])))


@scaled
@given(query=ONE, row=ONE)
def test_jaccard_distance_equals_definition(
    *, normalized: bool, query: Sequence[int], row: Sequence[int]
) -> None:
    either = {*query, *row}
    expected = 1 - len({*query} & {*row}) / len(either) if either else 0
    result = between(METRICS["jaccard"], [query], [row], normalized=normalized)
    assert result[0, 0] == np.float32(expected)


@given(query=ONE, row=ONE)
def test_histogram_distance_equals_definition(query: Sequence[int], row: Sequence[int]) -> None:
    x, y = Counter(query), Counter(row)
    quotients = [min(x[value], y[value]) / max(x[value], y[value]) for value in {*x, *y}]
    raw = between(METRICS["histogram"], [query], [row], normalized=False)
    assert raw[0, 0] == pytest.approx(-sum(quotients), abs=1e-6)
    mean = 1 - np.mean(quotients) if quotients else 0
    result = between(METRICS["histogram"], [query], [row])
    assert result[0, 0] == pytest.approx(mean, abs=1e-6)


# --- The edit distance ------------------------------------------------------------------------

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


@given(ONE, ONE, WEIGHTS | st.just(UNIT))
def test_edit_distance_equals_slow_cost(
    query: list[int], row: list[int], weights: EditWeights
) -> None:
    measure = metric("edit", weights=weights)
    expected = slow_cost(query, row, weights)
    assert between(measure, [query], [row], normalized=False).tolist() == [[expected]]
    # Sequences of these lengths that share nothing.
    largest = slow_cost([8] * len(query), [9] * len(row), weights)
    if weights == UNIT:
        assert largest == max(len(query), len(row))
    share = expected / largest if largest else 0
    assert between(measure, [query], [row])[0, 0] == pytest.approx(share, abs=1e-6)


def test_large_weights_do_not_overflow_and_only_edit_distances_have_weights() -> None:
    heavy = metric("edit", weights=EditWeights(insert=100, delete=100, substitute=100))
    assert between(heavy, [[1] * 300], [[2] * 300], normalized=False).tolist() == [[30_000]]
    assert metric("jaccard", weights=EditWeights(insert=2)) is METRICS["jaccard"]


@pytest.fixture
def table() -> SequenceTable:
    rng = np.random.default_rng(4)
    rows = [rng.integers(0, 5, length).tolist() for length in rng.integers(0, 60, 500)]
    return SequenceTable.from_csr(*flat(rows))


@scaled
def test_kernel_equals_rapidfuzz(
    *, monkeypatch: pytest.MonkeyPatch, table: SequenceTable, normalized: bool
) -> None:
    queries = [table[place] for place in range(0, len(table), 50)]
    some, few = np.arange(0, len(table), 3), np.array([len(table) - 1, 3])
    measure = partial(edit.distances, queries, table, normalized=normalized)
    expected = measure()
    assert table not in edit._planes
    monkeypatch.setattr(edit, "_VALUES_OF_LOADING", 0)
    np.testing.assert_array_equal(measure(only=few), expected[:, few])
    assert table not in edit._planes
    np.testing.assert_array_equal(measure(), expected)
    assert table in edit._planes
    np.testing.assert_array_equal(measure(only=some), expected[:, some])


def test_kernel_is_used_for_second_search_of_large_table(
    monkeypatch: pytest.MonkeyPatch, table: SequenceTable
) -> None:
    monkeypatch.setattr(edit, "_LARGE_TABLE_VALUES", len(table.values))
    first = edit.distances([table[3]], table)
    assert table not in edit._planes
    np.testing.assert_array_equal(edit.distances([table[3]], table), first)
    assert table in edit._planes


@given(st.lists(VALUES, max_size=4), ONE)
def test_wildcard_equals_best_of_all_values(query: list[int], row: list[int]) -> None:
    table = SequenceTable.from_csr(*flat([row]))
    result = edit.distances([np.array(query, np.uint8)], table, normalized=False, wildcard=0)
    candidates = itertools.product(*(KINDS if value == 0 else [value] for value in query))
    assert result.tolist() == [[min(slow_cost(candidate, row) for candidate in candidates)]]


def test_wildcard_with_weights_is_refused(table: SequenceTable) -> None:
    with pytest.raises(InputError, match="wildcard was given with edit weights 2/1/1"):
        edit.distances([table[0]], table, wildcard=0, weights=EditWeights(insert=2))


@pytest.mark.parametrize("weight", [0, -1, 101, 1.5, True, "1", None])
@pytest.mark.parametrize("name", ["insert", "delete", "substitute"])
def test_weights_out_of_range_are_refused(name: str, weight: object) -> None:
    with pytest.raises(InputError, match=f"edit weight '{name}' is .*from 1 to 100"):
        EditWeights(**{name: weight})  # type: ignore[arg-type]


# --- Bit planes -------------------------------------------------------------------------------


def by_rapidfuzz(queries: Sequence[Bytes], rows: Sequence[Bytes], *, normalized: bool) -> Bytes:
    texts = [[row.tobytes().decode("latin-1") for row in part] for part in (queries, rows)]
    scorer = Levenshtein.normalized_distance if normalized else Levenshtein.distance
    result: Bytes = cdist(*texts, scorer=scorer, dtype=np.float32)
    return result


def random_rows(seed: int, count: int, longest: int, values: int) -> list[Bytes]:
    """Return rows over some of the values, the lengths in no order, some equal."""
    rng = np.random.default_rng(seed)
    choices = rng.permutation(256)[:values]
    rows = [
        rng.choice(choices, length).astype(np.uint8) for length in rng.integers(0, longest, count)
    ]
    return rows + rows[: count // 10]


SHORT = st.lists(st.sampled_from([0, 1, 2, 255]), max_size=9)


@given(query=SHORT, rows=st.lists(SHORT, max_size=6), wildcard=st.sampled_from([None, 0, 2, 77]))
def test_bit_planes_equal_slow_cost(
    query: list[int], rows: list[list[int]], wildcard: int | None
) -> None:
    result = BitPlanes.build(*flat(rows)).edit_distances(
        [np.array(query, np.uint8)], normalized=False, wildcard=wildcard
    )
    assert result.tolist() == [[slow_cost(query, row, wildcard=wildcard) for row in rows]]


@settings(deadline=None)  # the first call compiles
@scaled
@given(
    seed=st.integers(0, 2**32 - 1),
    longest=st.sampled_from([1, 20, 200]),
    values=st.sampled_from([1, 2, 11, 16, 255, 256]),
)
def test_bit_planes_equal_rapidfuzz(
    *, normalized: bool, seed: int, longest: int, values: int
) -> None:
    rows = random_rows(seed, 40, longest, values)
    queries = [*rows[:3], *random_rows(seed + 1, 3, longest, values)]
    planes = BitPlanes.build(*flat(rows))
    result = planes.edit_distances(queries, normalized=normalized)
    np.testing.assert_array_equal(result, by_rapidfuzz(queries, rows, normalized=normalized))


@scaled
def test_bit_planes_of_several_blocks_and_long_sequences(*, normalized: bool) -> None:
    rows = sorted(random_rows(3, 2 * BLOCK_SEQUENCES, 30, 11), key=len)
    rows += random_rows(4, 3, 1000, 255)
    queries = [rows[0], rows[BLOCK_SEQUENCES], rows[-1], np.tile(rows[-2], 3)[:1000], rows[5][:0]]
    planes = BitPlanes.build(*flat(rows))
    result = planes.edit_distances(queries, normalized=normalized)
    np.testing.assert_array_equal(result, by_rapidfuzz(queries, rows, normalized=normalized))
    for query, expected in zip(queries, result, strict=True):
        single = planes.edit_distances([query], normalized=normalized)
        np.testing.assert_array_equal(single[0], expected)


def test_bit_planes_with_wildcard_in_long_query() -> None:
    rng = np.random.default_rng(0)
    rows = [rng.integers(0, 5, length).tolist() for length in (0, 1, 80, 150)]
    query = rng.integers(0, 5, 150).tolist()
    planes, queries = BitPlanes.build(*flat(rows)), [np.array(query, np.uint8)]
    result = planes.edit_distances(queries, normalized=False, wildcard=3)
    assert result.tolist() == [[slow_cost(query, row, wildcard=3) for row in rows]]


@pytest.mark.parametrize(("values", "bits"), [(11, 8), (16, 9), (256, 33)])
def test_bit_planes_need_few_bits_per_object_and_accept_empty_input(values: int, bits: int) -> None:
    rows = np.resize(np.arange(values), 20 * BLOCK_SEQUENCES).astype(np.uint8)
    planes = BitPlanes.build(rows, np.arange(0, len(rows) + 1, 20))
    assert planes.planes.nbytes * 8 == bits * len(rows)
    assert not planes.planes.flags.writeable
    assert planes.edit_distances([]).shape == (0, len(rows) // 20)
    assert BitPlanes.build(*flat([])).edit_distances([rows[:1]]).shape == (1, 0)
