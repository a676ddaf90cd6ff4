from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import METHODS, NOTHING, asked, database_of, random_cells

from semsig_gis.core import InputError, Signature
from semsig_gis.localization import DistanceMemo, Method, metric, score_cells
from semsig_gis.localization.distance.scores import _MANY_QUERIES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.database import SignatureDatabase


CITY = database_of(random_cells(400))
FUSIONS = [one for one in METHODS if "+" in one]


def slow_scores(database: SignatureDatabase, query: Signature, method: Method) -> np.ndarray:
    """Score cell by cell, one pair of sequences at a time, a query that has both parts."""
    assert query.codes is not None
    parts = {
        "types": (query.codes, database.type_sequences),
        "angles": (query.levels(database.spec.levels), database.angle_sequences),
    }
    found = {}
    for part, name in method.measures.items():
        sequence, table = parts[part]
        measure = metric(name, weights=method.weights)
        measured = [
            measure([sequence], table, normalized=method.normalized, only=row).item()
            for row in np.arange(len(table))[:, None]
        ]
        found[part] = np.array(measured)[table.inverse]
    if len(found) == 1:
        return next(iter(found.values()))
    fused = method.alpha * found["types"] + (1 - method.alpha) * found["angles"]
    if method.keep is None:
        return fused
    first = np.rint(found["types"] * 2**16) / 2**16
    cut = np.sort(first)[math.ceil(Fraction(str(method.keep)) * len(first) / 100) - 1]
    worst = fused[first <= cut].max()
    return np.where(first <= cut, fused, worst + first - cut)


@pytest.mark.parametrize("text", METHODS + [f"{one}:10%" for one in FUSIONS])
def test_scores_equal_those_of_one_cell_at_a_time(text: str) -> None:
    method = Method.parse(text)
    queries = [CITY.signature(cell) for cell in (3, 50)]
    queries.append(asked("DKDBDDD", [1, 2, 100, 200, 201, 202, 359]))
    for query, scores in zip(queries, score_cells(CITY, queries, method), strict=True):
        assert scores.dtype == np.float32
        np.testing.assert_allclose(scores, slow_scores(CITY, query, method), atol=2**-16)


def test_sums_that_are_equal_are_equal_scores() -> None:
    # In float32, 1/7 + 2/7 and 3/7 + 0 differ, and so would cells that deserve the same rank.
    seven = [10.0, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0]

    moved = [seven, *([one + 22.5 for one in seven[:to]] + seven[to:] for to in (1, 2, 3))]
    cells = list(zip(["BBBDDDD", "BBDDDDD", "BDDDDDD", "DDDDDDD"], moved, strict=True))
    query = asked("DDDDDDD", seven)
    (scores,) = score_cells(database_of(cells), [query], Method.parse("edit+edit:alpha=0.5"))
    assert len(set(scores.tolist())) == 1


def assert_scored_as_alone(queries: Sequence[Signature], method: Method) -> None:
    for query, scores in zip(queries, score_cells(CITY, queries, method), strict=True):
        (alone,) = score_cells(CITY, [query], method)
        np.testing.assert_array_equal(scores, alone)
        assert scores.dtype == alone.dtype


def test_queries_that_know_different_parts_may_be_mixed() -> None:
    whole = [CITY.signature(cell) for cell in range(6)]
    queries = [
        *whole[:2],
        *(Signature(one.codes, None) for one in whole[2:4]),
        *(Signature(None, one.bearings) for one in whole[4:]),
    ]
    assert_scored_as_alone([queries[place] for place in (2, 0, 4, 1, 5, 3)], Method())


@pytest.mark.parametrize("keep", [None, 5.0])
def test_batches_do_not_change_scores(keep: float | None, monkeypatch: pytest.MonkeyPatch) -> None:
    queries = [CITY.signature(cell) for cell in range(10)]
    together = np.array(list(score_cells(CITY, queries, Method(keep=keep))))
    monkeypatch.setattr("semsig_gis.localization.distance.scores._BATCH_BYTES", 1)
    alone = np.array(list(score_cells(CITY, queries, Method(keep=keep))))
    np.testing.assert_array_equal(alone, together)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("raw", ["", ":raw"])
def test_many_queries_are_scored_as_one(seed: int, raw: str) -> None:
    rng = np.random.default_rng(seed)
    queries = [CITY.signature(int(cell)) for cell in rng.integers(0, len(CITY), _MANY_QUERIES)]
    for text in ("edit+edit", "edit+edit:alpha=0.3", "edit+edit:5%", "histogram+jaccard:33%"):
        assert_scored_as_alone(queries, Method.parse(text + raw))


@pytest.mark.parametrize("seed", range(4))
def test_methods_that_share_a_memo_score_as_alone(seed: int) -> None:
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
        alone = list(score_cells(CITY, queries, method))
        shared = list(score_cells(CITY, queries, method, memo=memo))
        np.testing.assert_array_equal(shared, alone)
    assert memo.spared > 0


@pytest.mark.parametrize(
    ("query", "text", "words"),
    [
        (asked("D"), "angles:edit", r"compares bearings, but the query has only types; .*types:ed"),
        (asked(None, [1.0]), "types:edit", "compares types, but the query has only bearings"),
    ],
)
def test_a_query_without_the_part_is_refused_at_once(
    query: Signature, text: str, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        score_cells(CITY, [query], Method.parse(text))


def test_nothing_is_as_far_as_can_be_from_every_cell() -> None:
    (scores,) = score_cells(CITY, [NOTHING])
    assert scores.tolist() == [1] * len(CITY)
    assert list(score_cells(CITY, [])) == []


# --- Two-stage fusion -------------------------------------------------------------------------


@pytest.mark.parametrize("keep", [0.1, 1, 5, 30, 99, 100])
@pytest.mark.parametrize("method", ["edit+edit", "histogram+edit:raw:weights=100/100/100"])
def test_the_rest_follows_in_the_order_of_the_first_stage(method: str, keep: float) -> None:
    parsed = Method.parse(f"{method}:{keep}%")
    types_alone = Method(types=parsed.types, angles=None, normalized=parsed.normalized)
    query = CITY.signature(7)
    (first,) = score_cells(CITY, [query], types_alone)
    (scores,) = score_cells(CITY, [query], parsed)
    (fused,) = score_cells(CITY, [query], Method.parse(method))
    cut = np.sort(first)[math.ceil(len(CITY) * keep / 100) - 1]
    kept, rest = first <= cut, first > cut
    np.testing.assert_array_equal(scores[kept], fused[kept])
    assert scores[rest].min(initial=np.inf) > scores[kept].max()
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
def test_what_is_kept_is_what_sorting_all_cells_keeps(seed: int, text: str, keep: float) -> None:
    database = database_of(random_cells(80, seed=seed))
    method = Method.parse(f"{text}:{keep}%")
    query = database.signature(seed % 80)
    (scores,) = score_cells(database, [query], method)
    np.testing.assert_allclose(scores, slow_scores(database, query, method), atol=2**-15)


def test_the_rest_stays_behind_where_the_gap_is_lost_in_rounding() -> None:
    # By type the cells are 1/180 - 1/181 apart, less than float32 tells at the worst kept score.
    cells = [("D" * count, np.linspace(1, 359, count).tolist()) for count in (180, 181)]
    method = Method.parse("histogram+edit:10%:raw:alpha=0.01:weights=100/100/100")
    (scores,) = score_cells(database_of(cells), [asked("D", [180.0])], method)
    assert scores[0] > 10_000
    assert scores[1] > scores[0]


@pytest.mark.parametrize(("keep", "kept"), [(7, 7), (1.5, 2), (28.999, 29), (29.001, 30), (99, 99)])
def test_how_many_are_kept_is_exact(keep: float, kept: int) -> None:
    # Taken naively, 7 % of 100 cells are 0.07 * 100, a little more than 7, and so 8.
    types = ["D" + "B" * place for place in range(100)]  # one cell after the other by type
    shifts = [180.0 if place < kept else 0.0 for place in range(100)]  # the rest better by angle
    cells = [(one, [shift] * len(one)) for one, shift in zip(types, shifts, strict=True)]
    database, query = database_of(cells), asked("D", [0.0])
    (scores,) = score_cells(database, [query], Method(keep=keep))
    (fused,) = score_cells(database, [query], Method())
    assert fused[kept] < fused[kept - 1]
    assert scores[:kept].tolist() == fused[:kept].tolist()
    assert (np.diff(scores[kept - 1 :]) > 0).all()


@given(st.permutations(range(60)), st.sampled_from([None, 2.0, 10.0]))
def test_the_order_of_the_cells_does_not_matter(order: list[int], keep: float | None) -> None:
    cells = random_cells(60, seed=3)
    mixed = database_of([cells[place] for place in order])
    query = asked("DBD", [20.0, 80.0, 300.0])
    (straight,) = score_cells(database_of(cells), [query], Method(keep=keep))
    (permuted,) = score_cells(mixed, [query], Method(keep=keep))
    np.testing.assert_array_equal(straight[order], permuted)
