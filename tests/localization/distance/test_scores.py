from __future__ import annotations

import math
import time
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import METHODS, asked, database_of, random_cells

from semsig_gis.core import InputError, Signature
from semsig_gis.localization import DistanceMemo, Method, metric, score_cells
from semsig_gis.localization.distance.scores import _MANY_QUERIES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase


CITY = database_of(random_cells(400))
FUSIONS = [text for text in METHODS if "+" in text]


def slow_scores(database: SignatureDatabase, query: Signature, method: Method) -> np.ndarray:
    """Score cell by cell, one pair of sequences at a time, a query that has both parts."""
    assert query.codes is not None
    parts = {
        "types": (query.codes, database.type_sequences),
        "angles": (query.levels(database.spec.levels), database.angle_sequences),
    }
    distances = {}
    for part, name in method.measures.items():
        sequence, table = parts[part]
        measure = metric(name, weights=method.weights)
        measured = [
            measure([sequence], table, normalized=method.normalized, only=row).item()
            for row in np.arange(len(table))[:, None]
        ]
        distances[part] = np.array(measured)[table.inverse]
    if len(distances) == 1:
        return next(iter(distances.values()))
    fused = method.alpha * distances["types"] + (1 - method.alpha) * distances["angles"]
    if method.keep is None:
        return fused
    first = np.rint(distances["types"] * 2**16) / 2**16
    cut = np.sort(first)[math.ceil(Fraction(str(method.keep)) * len(first) / 100) - 1]
    worst = fused[first <= cut].max()
    return np.where(first <= cut, fused, worst + first - cut)


@pytest.mark.parametrize("text", METHODS + [f"{fusion}:10%" for fusion in FUSIONS])
def test_scores_equal_slow_scores(text: str) -> None:
    method = Method.parse(text)
    queries = [CITY.signature(cell) for cell in (3, 50)]
    queries.append(asked("DKDBDDD", [1, 2, 100, 200, 201, 202, 359]))
    for query, scores in zip(queries, score_cells(CITY, queries, method), strict=True):
        assert scores.dtype == np.float32
        np.testing.assert_allclose(scores, slow_scores(CITY, query, method), atol=2**-16)


def test_equal_sums_are_equal_scores() -> None:
    # In float32, 1/7 + 2/7 and 3/7 + 0 differ; the scores must not.
    seven = [10.0, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0]

    shifted = [
        seven,
        *([angle + 22.5 for angle in seven[:count]] + seven[count:] for count in (1, 2, 3)),
    ]
    cells = list(zip(["BBBDDDD", "BBDDDDD", "BDDDDDD", "DDDDDDD"], shifted, strict=True))
    query = asked("DDDDDDD", seven)
    (scores,) = score_cells(database_of(cells), [query], Method.parse("edit+edit:alpha=0.5"))
    assert len(set(scores.tolist())) == 1


def assert_scores_equal_single_scores(queries: Sequence[Signature], method: Method) -> None:
    for query, scores in zip(queries, score_cells(CITY, queries, method), strict=True):
        (single,) = score_cells(CITY, [query], method)
        np.testing.assert_array_equal(scores, single)
        assert scores.dtype == single.dtype


def test_queries_with_different_parts_may_be_mixed() -> None:
    whole = [CITY.signature(cell) for cell in range(6)]
    queries = [
        *whole[:2],
        *(Signature(query.codes, None) for query in whole[2:4]),
        *(Signature(None, query.bearings) for query in whole[4:]),
    ]
    assert_scores_equal_single_scores([queries[place] for place in (2, 0, 4, 1, 5, 3)], Method())
    assert list(score_cells(CITY, [])) == []


@pytest.mark.parametrize("keep", [None, 5.0])
def test_batches_do_not_change_scores(keep: float | None, monkeypatch: pytest.MonkeyPatch) -> None:
    queries = [CITY.signature(cell) for cell in range(10)]
    together = np.array(list(score_cells(CITY, queries, Method(keep=keep))))
    monkeypatch.setattr("semsig_gis.localization.distance.scores._BATCH_BYTES", 1)
    separate = np.array(list(score_cells(CITY, queries, Method(keep=keep))))
    np.testing.assert_array_equal(separate, together)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("raw", ["", ":raw"])
def test_many_queries_have_scores_of_single_queries(seed: int, raw: str) -> None:
    rng = np.random.default_rng(seed)
    queries = [CITY.signature(int(cell)) for cell in rng.integers(0, len(CITY), _MANY_QUERIES)]
    for text in ("edit+edit", "edit+edit:alpha=0.3", "edit+edit:5%", "histogram+jaccard:33%"):
        assert_scores_equal_single_scores(queries, Method.parse(text + raw))


@pytest.mark.parametrize("seed", range(4))
def test_memo_does_not_change_scores(seed: int) -> None:
    rng = np.random.default_rng(seed)
    queries = [CITY.signature(int(cell)) for cell in rng.integers(0, len(CITY), 9)]
    texts = [
        *("types:edit", "angles:edit", "edit+edit", "edit+edit:5%", "edit+edit:alpha=0.3"),
        *("edit+edit:raw", "edit+edit:5%:raw", "edit+edit:weights=2/1/1", "edit+jaccard:20%"),
        *("types:jaccard", "jaccard+histogram"),
    ]
    memo = DistanceMemo()
    for text in rng.permutation([*texts, *texts]).tolist():
        method = Method.parse(text)
        expected = list(score_cells(CITY, queries, method))
        shared = list(score_cells(CITY, queries, method, memo=memo))
        np.testing.assert_array_equal(shared, expected)
    assert memo.spared > 0


@pytest.mark.parametrize(
    ("query", "text", "words"),
    [
        (asked("D"), "angles:edit", r"compares bearings, but the query has only types; .*types:ed"),
        (asked(None, [1.0]), "types:edit", "compares types, but the query has only bearings"),
    ],
)
def test_query_without_compared_part_is_refused_before_iteration(
    query: Signature, text: str, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        score_cells(CITY, [query], Method.parse(text))


def test_memo_computes_distances_once_and_counts_saved_time() -> None:
    names: list[str] = []

    def measure(name: str) -> NDArray[np.float32]:
        names.append(name)
        time.sleep(0.01)
        return np.array([len(names)], np.float32)

    memo = DistanceMemo()
    distances = [float(memo.get(name, partial(measure, name))[0]) for name in "abaab"]
    assert distances == [1.0, 2.0, 1.0, 1.0, 2.0]
    assert names == ["a", "b"]
    # Three of the distances, which take 0.01 s each, were computed before.
    assert memo.spared >= 0.03


# --- Two-stage fusion -------------------------------------------------------------------------


@pytest.mark.parametrize("keep", [0.1, 1, 5, 30, 99, 100])
@pytest.mark.parametrize("method", ["edit+edit", "histogram+edit:raw:weights=100/100/100"])
def test_other_cells_follow_in_order_of_first_stage(method: str, keep: float) -> None:
    parsed = Method.parse(f"{method}:{keep}%")
    only_types = Method(types=parsed.types, angles=None, normalized=parsed.normalized)
    query = CITY.signature(7)
    (first,) = score_cells(CITY, [query], only_types)
    (scores,) = score_cells(CITY, [query], parsed)
    (fused,) = score_cells(CITY, [query], Method.parse(method))
    cut = np.sort(first)[math.ceil(len(CITY) * keep / 100) - 1]
    passing, rest = first <= cut, first > cut
    np.testing.assert_array_equal(scores[passing], fused[passing])
    assert scores[rest].min(initial=np.inf) > scores[passing].max()
    # The same order, with the same ties.
    np.testing.assert_array_equal(
        np.unique(scores[rest], return_inverse=True)[1],
        np.unique(first[rest], return_inverse=True)[1],
    )


@settings(max_examples=40)
@given(
    st.integers(0, 1000),
    st.sampled_from(["edit+edit", "histogram+jaccard", "jaccard+edit:raw", "histogram+edit:raw"]),
    st.floats(0.01, 100),
)
def test_two_stage_scores_equal_slow_scores(seed: int, text: str, keep: float) -> None:
    database = database_of(random_cells(80, seed=seed))
    method = Method.parse(f"{text}:{keep}%")
    query = database.signature(seed % 80)
    (scores,) = score_cells(database, [query], method)
    np.testing.assert_allclose(scores, slow_scores(database, query, method), atol=2**-15)


def test_other_cells_stay_behind_when_the_difference_is_rounded_to_zero() -> None:
    # By type the cells are 1/180 - 1/181 apart, less than the float32 step at the worst score.
    cells = [("D" * count, np.linspace(1, 359, count).tolist()) for count in (180, 181)]
    method = Method.parse("histogram+edit:10%:raw:alpha=0.01:weights=100/100/100")
    (scores,) = score_cells(database_of(cells), [asked("D", [180.0])], method)
    assert scores[0] > 10_000
    assert scores[1] > scores[0]


@pytest.mark.parametrize(
    ("keep", "count"), [(7, 7), (1.5, 2), (28.999, 29), (29.001, 30), (99, 99)]
)
def test_number_of_passing_cells_is_exact(keep: float, count: int) -> None:
    # In floating point, 7 % of 100 cells are 0.07 * 100, a little more than 7, and so 8.
    types = ["D" + "B" * place for place in range(100)]  # one cell after the other by type
    shifts = [180.0 if place < count else 0.0 for place in range(100)]  # the rest better by angle
    cells = [
        (symbols, [shift] * len(symbols)) for symbols, shift in zip(types, shifts, strict=True)
    ]
    database, query = database_of(cells), asked("D", [0.0])
    (scores,) = score_cells(database, [query], Method(keep=keep))
    (fused,) = score_cells(database, [query], Method())
    assert fused[count] < fused[count - 1]
    assert scores[:count].tolist() == fused[:count].tolist()
    assert (np.diff(scores[count - 1 :]) > 0).all()


@given(st.permutations(range(60)), st.sampled_from([None, 2.0, 10.0]))
def test_order_of_cells_does_not_change_scores(order: list[int], keep: float | None) -> None:
    cells = random_cells(60, seed=3)
    mixed = database_of([cells[place] for place in order])
    query = asked("DBD", [20.0, 80.0, 300.0])
    (straight,) = score_cells(database_of(cells), [query], Method(keep=keep))
    (permuted,) = score_cells(mixed, [query], Method(keep=keep))
    np.testing.assert_array_equal(straight[order], permuted)
