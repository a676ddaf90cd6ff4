from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import database_of
from tying_cells import CITY, METHODS, NOTHING, asked, random_cells

from semsig_gis.core.errors import InputError
from semsig_gis.core.signature import Signature
from semsig_gis.database.answer import DistanceMemo
from semsig_gis.matching.method import Method
from semsig_gis.matching.metrics import METRICS
from semsig_gis.matching.scores import _MANY_QUERIES, score_cells

if TYPE_CHECKING:
    from semsig_gis.database.database import SignatureDatabase


def slow_scores(database: SignatureDatabase, query: Signature, method: Method) -> list[float]:
    """Score cell by cell, one pair of sequences at a time."""
    parts = {
        "types": (query.codes, database.type_sequences),
        "angles": (
            None if query.bearings is None else query.levels(database.spec.levels),
            database.angle_sequences,
        ),
    }
    found: dict[str, list[float]] = {}
    for part, name in method.measures.items():
        sequence, table = parts[part]
        if sequence is None:
            continue
        options: dict[str, Any] = {"weights": method.weights} if name == "edit" else {}
        measured = [
            METRICS[name].distances(
                [sequence], table, normalized=method.normalized, only=np.array([row]), **options
            )[0, 0]
            for row in range(len(table))
        ]
        found[part] = [float(measured[row]) for row in table.inverse]
    if len(found) == 1:
        return next(iter(found.values()))
    pairs = zip(found["types"], found["angles"], strict=True)
    fused = [method.alpha * first + (1 - method.alpha) * second for first, second in pairs]
    if method.keep is None:
        return fused
    first_stage = [float(np.rint(value * 2**16)) / 2**16 for value in found["types"]]
    count = math.ceil(Fraction(str(method.keep)) * len(first_stage) / 100)
    cut = sorted(first_stage)[count - 1]
    worst = max(value for value, one in zip(fused, first_stage, strict=True) if one <= cut)
    return [
        value if one <= cut else worst + one - cut
        for value, one in zip(fused, first_stage, strict=True)
    ]


@pytest.mark.parametrize("text", METHODS + [f"{one}:10%" for one in METHODS if "+" in one])
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

    def moved(count: int) -> list[float]:
        return [one + 22.5 if place < count else one for place, one in enumerate(seven)]

    cells = [
        ("BDDDDDD", moved(2)),
        ("BBBDDDD", seven),
        ("BBDDDDD", moved(1)),
        ("DDDDDDD", moved(3)),
    ]
    query = asked("DDDDDDD", seven)
    (scores,) = score_cells(database_of(cells), [query], Method.parse("edit+edit:alpha=0.5"))
    assert len(set(scores.tolist())) == 1


def test_queries_that_know_different_parts_may_be_mixed() -> None:
    whole = [CITY.signature(cell) for cell in range(6)]
    queries = [
        Signature(one.codes if number % 3 else None, one.bearings if number % 2 else None)
        for number, one in enumerate(whole)
        if number % 3 or number % 2
    ]
    together = list(score_cells(CITY, queries))
    for query, scores in zip(queries, together, strict=True):
        (alone,) = score_cells(CITY, [query])
        np.testing.assert_array_equal(scores, alone)


@pytest.mark.parametrize("keep", [None, 5.0])
def test_batches_do_not_change_scores(keep: float | None, monkeypatch: pytest.MonkeyPatch) -> None:
    queries = [CITY.signature(cell) for cell in range(10)]
    together = np.array(list(score_cells(CITY, queries, Method(keep=keep))))
    monkeypatch.setattr("semsig_gis.matching.scores._BATCH_BYTES", 1)
    alone = np.array(list(score_cells(CITY, queries, Method(keep=keep))))
    np.testing.assert_array_equal(alone, together)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("raw", ["", ":raw"])
def test_many_queries_are_scored_as_one(seed: int, raw: str) -> None:
    rng = np.random.default_rng(seed)
    queries = [CITY.signature(int(cell)) for cell in rng.integers(0, len(CITY), _MANY_QUERIES)]
    for text in ("edit+edit", "edit+edit:alpha=0.3", "edit+edit:5%", "histogram+jaccard:33%"):
        method = Method.parse(text + raw)
        together = list(score_cells(CITY, queries, method))
        for query, scores in zip(queries, together, strict=True):
            (alone,) = score_cells(CITY, [query], method)
            np.testing.assert_array_equal(scores, alone)
            assert scores.dtype == alone.dtype


@pytest.mark.parametrize("seed", range(4))
def test_methods_that_share_a_memo_score_as_alone(seed: int) -> None:
    database = CITY
    rng = np.random.default_rng(seed)
    queries = [database.signature(int(cell)) for cell in rng.integers(0, len(database), 9)]
    texts = [
        *("types:edit", "angles:edit", "edit+edit", "edit+edit:5%", "edit+edit:alpha=0.3"),
        *("edit+edit:raw", "edit+edit:5%:raw", "edit+edit:weights=2/1/1", "edit+jaccard:20%"),
        *("types:jaccard", "jaccard+histogram"),
    ]
    memo = DistanceMemo()
    for text in rng.permutation([*texts, *texts]).tolist():
        method = Method.parse(text)
        alone = list(score_cells(database, queries, method))
        shared = list(score_cells(database, queries, method, memo=memo))
        np.testing.assert_array_equal(shared, alone)
    assert memo.spared > 0


def test_a_query_without_the_part_is_refused_at_once() -> None:
    with pytest.raises(
        InputError, match=r"compares bearings, but the query has only types; .*types:edit"
    ):
        score_cells(CITY, [asked("D")], Method.parse("angles:edit"))
    with pytest.raises(InputError, match="compares types, but the query has only bearings"):
        score_cells(CITY, [asked(None, [1.0])], Method.parse("types:edit"))


def test_an_empty_query_is_as_far_as_can_be_from_every_cell() -> None:
    (scores,) = score_cells(CITY, [NOTHING])
    assert scores.tolist() == [1] * len(CITY)


def test_no_queries() -> None:
    assert list(score_cells(CITY, [])) == []


# --- Two-stage fusion -------------------------------------------------------------------------


def test_keeping_all_cells_is_the_fusion() -> None:
    queries = [CITY.signature(cell) for cell in range(20)]
    for text in (one for one in METHODS if "+" in one):
        for fused, kept in zip(
            score_cells(CITY, queries, Method.parse(text)),
            score_cells(CITY, queries, Method.parse(f"{text}:100%")),
            strict=True,
        ):
            np.testing.assert_array_equal(fused, kept)


@pytest.mark.parametrize("keep", [0.1, 1, 5, 30, 99])
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


def test_cells_that_tie_at_the_cut_are_all_kept() -> None:
    cells = [
        ("DD", [10.0, 20.0]),
        ("DD", [10.0, 200.0]),
        ("DD", [100.0, 200.0]),
        ("BB", [10.0, 20.0]),
    ]
    (scores,) = score_cells(database_of(cells), [asked("DD", [10.0, 20.0])], Method(keep=25))
    assert scores.tolist() == [0.0, 0.25, 0.5, 1.5]


@given(st.permutations(range(60)), st.sampled_from([None, 2.0, 10.0]))
def test_the_order_of_the_cells_does_not_matter(order: list[int], keep: float | None) -> None:
    cells = random_cells(60, seed=3)
    mixed = database_of([cells[place] for place in order])
    query = asked("DBD", [20.0, 80.0, 300.0])
    (straight,) = score_cells(database_of(cells), [query], Method(keep=keep))
    (permuted,) = score_cells(mixed, [query], Method(keep=keep))
    np.testing.assert_array_equal(straight[order], permuted)
