from __future__ import annotations

import gc
import json
import math
import tempfile
import weakref
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import CRS, Transformer
from sentences import assert_sentence
from worlds import random_town

from semsig_gis.core.errors import EmptyResultError, InputError
from semsig_gis.core.grid import GridSpec
from semsig_gis.core.signature import Signature, SignatureSpec
from semsig_gis.database.answer import DistanceMemo
from semsig_gis.database.database import BEARING_UNITS, SignatureDatabase
from semsig_gis.database.file import PartitionedDatabase, open_database, save_database
from semsig_gis.database.requirement import PatternIndex, Requirement
from semsig_gis.matching.method import Method
from semsig_gis.matching.metrics import METRICS
from semsig_gis.matching.scores import _MANY_QUERIES, score_cells
from semsig_gis.matching.search import localize
from semsig_gis.sources.catalog import paper_taxonomy

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.matching.search import Localization


TAXONOMY = paper_taxonomy()
METHODS = [
    "edit+edit",
    "edit+jaccard:alpha=0.3",
    "histogram+edit:raw",
    "jaccard+histogram:alpha=0.9:raw",
    "edit+edit:weights=3/1/2",
    "types:edit",
    "angles:histogram",
]


def database_of(cells: Sequence[tuple[str, Sequence[float]]]) -> SignatureDatabase:
    """Make a database of given types and bearings, one cell a column of the grid."""
    lengths = [len(types) for types, _ in cells]
    bearings = np.array([one for _, given in cells for one in given])
    return SignatureDatabase(
        columns=np.arange(len(cells), dtype=np.int32),
        rows=np.zeros(len(cells), np.int32),
        offsets=np.cumsum([0, *lengths]),
        codes=np.concatenate([TAXONOMY.encode(types) for types, _ in cells]),
        bearing_units=np.floor(bearings * (BEARING_UNITS / 360)).astype(np.uint16),
        distance_units=np.zeros(sum(lengths), np.uint8),
        grid=GridSpec(origin=(770_000.0, 6_280_000.0)),
        spec=SignatureSpec(),
        taxonomy=TAXONOMY,
        crs=CRS("EPSG:2154"),
        licenses=("trees: the city (CC0)",),
    )


def random_cells(count: int, *, seed: int = 0) -> list[tuple[str, list[float]]]:
    """Return short signatures of few classes, so that many are equal or tie."""
    rng = np.random.default_rng(seed)
    return [
        ("".join(rng.choice(list("DDDBG"), length)), np.sort(rng.uniform(0, 360, length)).tolist())
        for length in rng.integers(1, 6, count)
    ]


CITY = database_of(random_cells(400))
NOTHING = Signature(np.empty(0, np.uint8), np.empty(0))


def asked(types: str | None, bearings: Sequence[float] | None = None) -> Signature:
    return Signature.parse(types, bearings, taxonomy=TAXONOMY)


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


# --- Scores -----------------------------------------------------------------------------------


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


# --- Localization -----------------------------------------------------------------------------


@pytest.mark.parametrize("top", [1, 2, 7, 100, 400, 1000])
def test_candidates_are_the_best_cells_with_their_ranks(top: int) -> None:
    query = CITY.signature(11)
    found = localize(CITY, query, top=top)
    (scores,) = score_cells(CITY, [query])
    ranked = sorted(range(len(CITY)), key=lambda cell: (scores[cell], cell))[:top]
    table = found.candidates
    assert table["cell"].tolist() == ranked
    for row in table.to_dict(orient="records"):
        cell, distance = row["cell"], row["distance"]
        assert distance == scores[cell]
        assert row["rank_low"] == 1 + (scores < distance).sum()
        assert row["rank_high"] == (scores <= distance).sum()
        assert row["tied"] == (scores == distance).sum()
        assert row["cell_id"] == CITY.cell_ids[cell]
        assert [row["x"], row["y"]] == CITY.xy[cell].tolist()
        assert row["types"] == CITY.types(cell)
        assert row["length"] == CITY.lengths[cell]
    assert found.cells == len(CITY)
    last = table["distance"].iloc[-1]
    assert found.tied_beyond == (scores == last).sum() - (table["distance"] == last).sum()


def test_ties_that_are_not_listed_are_told() -> None:
    database = database_of([("B", [0.0]), *[("D", [0.0])] * 5])
    found = localize(database, asked("D"), top=2)
    assert found.candidates["cell"].tolist() == [1, 2]
    assert found.candidates["rank_low"].tolist() == [1, 1]
    assert found.candidates["rank_high"].tolist() == [5, 5]
    assert found.candidates["tied"].tolist() == [5, 5]
    assert found.tied_beyond == 3


@pytest.mark.parametrize(
    ("types", "bearings", "text", "used"),
    [
        ("DB", [10.0, 20.0], "edit+edit:5%", "types+angles"),
        ("DB", None, "edit+edit:5%", "types"),
        (None, [10.0, 20.0], "edit+edit:5%", "angles"),
        ("DB", [10.0, 20.0], "types:jaccard", "types"),
        ("DB", [10.0, 20.0], "angles:jaccard", "angles"),
    ],
)
def test_a_fusion_falls_back_to_what_the_query_has(
    types: str | None, bearings: list[float] | None, text: str, used: str
) -> None:
    query, method = asked(types, bearings), Method.parse(text)
    found = localize(CITY, query, method=method)
    assert found.used == used
    if used != "types+angles":
        alone = localize(CITY, query, method=Method.parse(f"{used}:{method.measures[used]}"))
        assert found.candidates.equals(alone.candidates)


def test_an_empty_query_is_refused() -> None:
    with pytest.raises(InputError, match="no objects; give at least one type or bearing"):
        localize(CITY, NOTHING)


@pytest.mark.parametrize("top", [0, -1])
def test_at_least_one_candidate_is_asked_for(top: int) -> None:
    with pytest.raises(InputError, match="give a whole number from 1"):
        localize(CITY, asked("D"), top=top)


def test_candidates_as_points_in_the_crs_of_the_database() -> None:
    found = localize(CITY, asked("DD"), top=5)
    points = found.to_geodataframe()
    assert points.crs == CITY.crs
    assert points.geometry.x.tolist() == found.candidates["x"].tolist()
    assert points.geometry.y.tolist() == found.candidates["y"].tolist()
    assert "geometry" not in found.candidates


@pytest.mark.parametrize(("types", "bearings"), [("DB", [10.0, 20.0]), ("DB", None), (None, [5.0])])
def test_everything_fits_into_json(types: str | None, bearings: list[float] | None) -> None:
    found = localize(CITY, asked(types, bearings), method=Method(keep=5), top=3)
    told = found.to_dict()
    assert json.loads(json.dumps(told, allow_nan=False)) == told
    assert told["query"] == {
        "types": types,
        "bearings": bearings,
        "length": len(types or bearings or ""),
    }
    assert told["method"] == "edit+edit:5%"
    assert told["used"] == found.used
    assert told["crs"] == "EPSG:2154"
    assert told["cells"] == 400
    assert told["tied_beyond"] == found.tied_beyond
    assert told["licenses"] == ["trees: the city (CC0)"]
    assert [one["cell"] for one in told["candidates"]] == found.candidates["cell"].tolist()
    back = Transformer.from_crs("EPSG:4326", "EPSG:2154", always_xy=True)
    for one in told["candidates"]:
        assert back.transform(one["lon"], one["lat"]) == pytest.approx(
            (one["x"], one["y"]), abs=0.02
        )


# --- A database in parts ----------------------------------------------------------------------


def in_parts(database: SignatureDatabase, owner: NDArray[np.int64], folder: str) -> Any:  # noqa: ANN401
    """Save the cells of each owner as a part."""
    files = []
    for number in np.unique(owner).tolist():
        files.append(Path(folder) / f"{number}.parquet")
        save_database(database.select(owner == number), files[-1])
    return PartitionedDatabase(tuple(files), len(database))


def assert_same_answer(one: Localization, other: Localization) -> None:
    pd.testing.assert_frame_equal(one.candidates, other.candidates)
    assert one.to_dict() == other.to_dict()


PARTED_METHODS = [
    *METHODS,
    *(f"{one}:{keep}%" for one in METHODS if "+" in one for keep in (0.5, 5, 40, 100)),
]


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 60),
    parts=st.integers(1, 5),
    text=st.sampled_from(PARTED_METHODS),
    top=st.sampled_from([1, 2, 7, 30, 100]),
    part=st.sampled_from(["both", "types", "angles"]),
)
@settings(max_examples=120)
def test_a_database_in_parts_answers_as_in_one_piece(
    *, seed: int, count: int, parts: int, text: str, top: int, part: str
) -> None:
    rng = np.random.default_rng(seed)
    whole = database_of(random_cells(count, seed=seed))
    # Another one of the cells, or one that a person made up of the classes that there are.
    query = whole.signature(int(rng.integers(count)))
    if rng.random() < 0.5:
        codes = rng.choice(whole.present_codes, int(rng.integers(1, 9)))
        query = Signature(codes, np.sort(rng.uniform(0, 360, len(codes))))
    method = Method.parse(text)
    if part != "both" and part in method.measures:
        query = Signature(
            query.codes if part == "types" else None, query.bearings if part == "angles" else None
        )
    with tempfile.TemporaryDirectory() as folder:
        parted = in_parts(whole, rng.integers(0, parts, count), folder)
        assert_same_answer(
            localize(parted, query, method=method, top=top),
            localize(whole, query, method=method, top=top),
        )


def test_the_gate_of_the_second_stage_is_that_of_all_parts(tmp_path: Path) -> None:
    # More cells are listed than pass, so that the worst that passes shows in the distances.
    rng = np.random.default_rng(8)
    for seed in range(12):
        whole = database_of(random_cells(60, seed=seed))
        parted = in_parts(whole, rng.integers(0, 4, 60), str(tmp_path))
        for keep in (1, 10, 50):
            query, method = whole.signature(seed), Method(keep=keep)
            assert_same_answer(
                localize(parted, query, method=method, top=60),
                localize(whole, query, method=method, top=60),
            )


@pytest.mark.parametrize("text", ["edit+edit:2%:raw:weights=40/50/60", "histogram+edit:2%:raw"])
def test_on_a_large_raw_scale_parts_rank_the_cells_beyond_the_second_stage_alike(
    text: str, tmp_path: Path
) -> None:
    rng = np.random.default_rng(4)
    cells = [
        ("".join(rng.choice(list("DBG"), length)), np.sort(rng.uniform(0, 360, length)).tolist())
        for length in rng.integers(1, 120, 200)
    ]
    whole = database_of(cells)
    parted = in_parts(whole, rng.integers(0, 3, 200), str(tmp_path))
    for cell in (0, 100):
        query, method = whole.signature(cell), Method.parse(text)
        assert_same_answer(
            localize(parted, query, method=method, top=200),
            localize(whole, query, method=method, top=200),
        )


def test_one_part_at_a_time_is_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parted = in_parts(CITY, np.arange(len(CITY)) % 8, str(tmp_path))
    opened: list[weakref.ref[SignatureDatabase]] = []

    def watched(path: Path) -> SignatureDatabase:
        gc.collect()
        assert sum(one() is not None for one in opened) <= 2  # one is taken while one is let go
        database = open_database(path)
        opened.append(weakref.ref(database))
        return database

    monkeypatch.setattr("semsig_gis.database.file.open_database", watched)
    localize(parted, CITY.signature(3), method=Method(keep=5))
    assert len(opened) == 16  # twice in two stages


def test_a_class_that_no_part_sees_is_refused(tmp_path: Path) -> None:
    parted = in_parts(CITY, np.arange(len(CITY)) % 3, str(tmp_path))
    for method in (Method(), Method(keep=5)):
        with pytest.raises(InputError) as caught:
            localize(parted, asked("DM", [1.0, 2.0]), method=method)
        with pytest.raises(InputError) as whole:
            localize(CITY, asked("DM", [1.0, 2.0]), method=method)
        assert str(caught.value) == str(whole.value)


# --- Requirements and unknown classes ---------------------------------------------------------


@given(st.integers(0, 2**32 - 1), st.sampled_from(["D", "2B", "D>=1,?<=6", "B=0", "?>=3"]))
@settings(max_examples=25)
def test_a_requirement_leaves_cells_out_and_changes_nothing_else(seed: int, text: str) -> None:
    town = random_town().database
    cell = int(np.random.default_rng(seed).integers(len(town)))
    requirement = Requirement.parse(text, town.taxonomy)
    everything = localize(town, town.signature(cell), top=len(town)).candidates
    met = PatternIndex.build(town.type_sequences).meeting(requirement)
    wanted = everything[met[everything["cell"].to_numpy()]]
    if wanted.empty:
        with pytest.raises(EmptyResultError):
            localize(town, town.signature(cell), requirement=requirement)
        return
    found = localize(town, town.signature(cell), requirement=requirement, top=len(town))
    assert found.candidates["cell"].tolist() == wanted["cell"].tolist()
    assert found.candidates["distance"].tolist() == wanted["distance"].tolist()
    assert found.cells == int(met.sum())


def test_an_object_of_unknown_class_may_be_any() -> None:
    town = random_town().database
    cell = int(town.lengths.argmax())
    types = town.types(cell)
    query = Signature.parse("?" + types[1:], None, taxonomy=town.taxonomy)
    best = localize(town, query, method=Method.parse("types:edit"), top=1).candidates
    assert best["distance"].tolist() == [0.0]
    with pytest.raises(InputError) as caught:
        localize(town, query, method=Method.parse("types:jaccard"))
    assert_sentence(caught.value, "unknown class", "jaccard")
