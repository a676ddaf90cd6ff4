from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from geopandas.testing import assert_geodataframe_equal
from noisy_cells import database_of

from semsig_gis.core.errors import InputError, UnknownNameError
from semsig_gis.evaluation.evaluate import evaluate
from semsig_gis.matching.method import Method
from semsig_gis.matching.scores import score_cells
from semsig_gis.matching.ties import NEAR_PLACES, THRESHOLDS
from semsig_gis.queries.paper_errors import DISTORTIONS, Distortion

if TYPE_CHECKING:
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.evaluation.result import Evaluation

ALL_MISSED = Distortion(occurrences=1, bearing_sigma=0.0)


def random_city(cells: int = 120, longest: int = 9) -> SignatureDatabase:
    rng = np.random.default_rng(8)
    lengths = rng.integers(1, longest + 1, cells)
    return database_of(
        [
            ("".join(rng.choice(list("DDBL"), length)), sorted(rng.uniform(0, 360, length)))
            for length in lengths
        ],
        height=10,
    )


@pytest.fixture(scope="module")
def city() -> SignatureDatabase:
    return random_city()


@pytest.fixture(scope="module")
def evaluation(city: SignatureDatabase) -> Evaluation:
    return evaluate(city, queries=100, method=Method(keep=20), distortion=ALL_MISSED, seed=3)


def test_hand_computed_row_of_equal_cells() -> None:
    four = database_of([("DD", [10, 200])] * 4 + [("B", [300])], height=5)
    table = evaluate(four, queries=5, distortion="none").queries.set_index("cell").sort_index()
    assert table["error_m"].to_list() == [15, 10, 10, 15, 0]
    assert table["p0"].to_list() == [0.25] * 4 + [1]
    assert table["p10"].to_list() == [0.5, 0.75, 0.75, 0.5, 1]
    assert table["p20"].to_list() == [0.75, 1, 1, 0.75, 1]
    assert table["rank_low"].to_list() == [1] * 5
    assert table["rank_high"].to_list() == [4] * 4 + [1]
    assert table["tied"].to_list() == [4] * 4 + [1]
    assert table["type_group"].to_list() == [4] * 4 + [1]
    assert table["angle_group"].to_list() == [4] * 4 + [1]
    assert table["distance"].to_list() == [0] * 5
    ids = [str(one) for one in four.cell_ids]
    for cell, row in table.iterrows():
        best = str(row["best_cell_id"])
        alike = [one for one in ids[:4] if one != best]
        assert row["next_cell_ids"].split(",") == (alike + ids[4:] if cell != 4 else ids[:4])


def test_hand_computed_curve_and_recall() -> None:
    four = database_of([("DD", [10, 200])] * 4 + [("B", [300])], height=5)
    result = evaluate(four, queries=5, distortion="none")
    assert result.cdf([0, 10, 20, 25, 30]) == pytest.approx([0.4, 0.7, 0.9, 0.9, 1])
    # 20 % is one cell, 39 % still one, 40 % two, 60 % three, 100 % all.
    recalls = [result.recall(percent) for percent in (19, 20, 39, 40, 60, 80, 100)]
    assert recalls == pytest.approx([0, 0.4, 0.4, 0.6, 0.8, 1, 1])
    assert result.successful.all()
    two = evaluate(four, queries=5, distortion="none", top=2)
    # Two of the four tied cells are drawn: (0 x 3 + 10 x 2 + 20) / 6 for a cell at the end.
    errors = two.queries.set_index("cell").sort_index()["error_m"]
    assert errors.to_list() == pytest.approx([40 / 6, 30 / 6, 30 / 6, 40 / 6, 0])


def test_diagonal_distances_are_exact() -> None:
    # Cells (0, 0) and (3, 4) are alike: 50 m apart, whatever the origin of the grid.
    cells = [("B", [0])] * 25
    cells[0] = cells[19] = ("DDD", [10, 100, 300])
    result = evaluate(database_of(cells, height=5), queries=25, distortion="none").queries
    twins = result[result["types"] == "DDD"]
    assert twins["p40"].to_list() == [0.5, 0.5]
    assert twins["p50"].to_list() == [1, 1]


@pytest.mark.parametrize("top", [1, 2, 3, 6])
def test_equals_every_order_of_the_ties(top: int) -> None:
    six = database_of(
        [("DD", [10, 99]), ("DD", [10, 99]), ("D", [10]), ("DD", [9, 98]), ("B", [10]), ("D", [9])],
        height=3,
    )
    method = Method(types="edit", angles=None)
    table = evaluate(six, queries=6, method=method, top=top, distortion="none").queries
    for row in table.to_dict("records"):
        cell = row["cell"]
        (scores,) = score_cells(six, [six.signature(cell)], method)
        errors = np.hypot(*(six.xy - six.xy[cell]).T)
        best, ranks = [], []
        for order in itertools.permutations(range(6)):
            ranked = sorted(order, key=scores.__getitem__)
            best.append(round(min(errors[ranked[:top]]), 6))
            ranks.append(ranked.index(cell) + 1)
        assert row["error_m"] == pytest.approx(np.mean(best))
        assert row["p10"] == pytest.approx(np.mean(np.array(best) <= 10))
        assert (row["rank_low"], row["rank_high"]) == (min(ranks), max(ranks))
        assert row["distance"] == scores.min()
        assert row["tied"] == (scores == scores.min()).sum()
        assert row["best_cell_id"] in six.cell_ids[scores == scores.min()]


def test_the_best_candidate_is_drawn_from_the_ties() -> None:
    alike = database_of([("D", [10])] * 40, height=40)
    shown = evaluate(alike, queries=40, distortion="none").queries
    assert shown["best_cell_id"].nunique() > 15
    one = alike.cell_ids.tolist().index(shown["best_cell_id"].iloc[0])
    assert shown[["best_x", "best_y"]].iloc[0].to_list() == alike.xy[one].tolist()


def test_columns_tell_the_truth(city: SignatureDatabase, evaluation: Evaluation) -> None:
    table = evaluation.queries
    cells = table["cell"].to_numpy()
    assert len(set(cells)) == len(table) == 100
    assert table.crs == city.crs
    assert (table["cell_id"] == city.cell_ids[cells]).all()
    assert np.array_equal(np.column_stack([table.geometry.x, table.geometry.y]), city.xy[cells])
    assert table["types"].to_list() == [city.types(cell) for cell in cells]
    assert (table["length"] == table["types"].str.len()).all()
    assert (table["query_length"] == table["query_types"].str.len()).all()
    counts = [len(text.split(",")) if text else 0 for text in table["query_bearings"]]
    assert (table["query_length"] == counts).all()
    assert (table["rank_low"] <= table["rank_high"]).all()


def test_a_query_of_which_nothing_is_left(evaluation: Evaluation) -> None:
    empty = evaluation.queries[evaluation.queries["query_length"] == 0]
    assert len(empty) == evaluation.unlocalized > 0
    assert (empty["error_m"] == math.inf).all()
    assert (empty["distance"] == math.inf).all()
    assert (empty[["rank_low", "rank_high"]] == 120).all(axis=None)
    assert (empty[[f"p{x}" for x in THRESHOLDS]] == 0).all(axis=None)
    assert empty["best_cell_id"].isna().all()
    assert (empty["tied"] == 0).all()
    assert evaluation.recall(100) == 1
    assert evaluation.recall(99.9) < 1
    assert evaluation.cdf()[-1] == pytest.approx(1 - len(empty) / 100)
    assert (empty[[f"near{x}" for x in NEAR_PLACES]] == 0).all(axis=None)


def test_nothing_left_of_any_query() -> None:
    lamps = database_of([("D", [10])] * 3, height=3)
    for seed in range(200):
        result = evaluate(lamps, queries=1, distortion=ALL_MISSED, seed=seed)
        if result.unlocalized:
            break
    summary = result.summary()["results"]
    assert summary["unlocalized"] == 1
    assert summary["median_error_m"] is None
    assert result.seconds_per_query == 0
    assert not result.successful.any()


def test_a_seed_repeats_everything(city: SignatureDatabase) -> None:
    options: dict[str, Any] = {"queries": 30, "distortion": "medium", "top": 2}
    first, again = (evaluate(city, seed=4, **options) for _ in range(2))
    assert_geodataframe_equal(first.queries, again.queries)
    other = evaluate(city, seed=5, **options)
    assert first.queries["cell"].to_list() != other.queries["cell"].to_list()


def test_a_query_does_not_depend_on_the_others(city: SignatureDatabase) -> None:
    many = evaluate(city, queries=90, distortion="strong").queries
    few = evaluate(city, queries=7, distortion="strong").queries
    assert_geodataframe_equal(many.head(7), few)


def test_more_candidates_never_hurt(city: SignatureDatabase) -> None:
    one, five = (evaluate(city, queries=60, top=top) for top in (1, 5))
    assert (five.queries["error_m"] <= one.queries["error_m"] + 1e-9).all()
    assert (five.cdf() >= one.cdf() - 1e-12).all()
    assert (five.queries["rank_low"] == one.queries["rank_low"]).all()


def test_no_distortion_ranks_the_true_cell_first(city: SignatureDatabase) -> None:
    result = evaluate(city, queries=120, distortion="none")
    assert (result.queries["rank_low"] == 1).all()
    assert result.queries["query_types"].equals(result.queries["types"])
    assert result.recall(100) == 1


def test_false_objects_have_classes_of_the_database(city: SignatureDatabase) -> None:
    rare = Distortion(occurrences=9, false_class="frequency")
    for distortion in (DISTORTIONS["strong"], rare):
        asked = evaluate(city, queries=60, distortion=distortion).queries["query_types"]
        assert set("".join(asked)) == set("BDL")


def test_the_curve_rises_to_the_share_localized(evaluation: Evaluation) -> None:
    curve = evaluation.cdf()
    assert (np.diff(curve) >= 0).all()
    table = evaluation.queries
    assert evaluation.cdf([50, 0]) == pytest.approx([table["p50"].mean(), table["p0"].mean()])
    assert (evaluation.successful == (table["p50"] >= 0.5)).all()


def test_by_length(evaluation: Evaluation) -> None:
    table = evaluation.by_length()
    assert table["length"].to_list() == ["1-4", "5-9", "10-19", "20+"]
    lengths = evaluation.queries["length"]
    assert table["n"].to_list() == [(lengths < 5).sum(), (lengths >= 5).sum(), 0, 0]
    short = evaluation.queries[lengths < 5]
    assert table.loc[0, "p50"] == pytest.approx(short["p50"].mean())
    assert table.loc[2:, "p10":].isna().all(axis=None)
    whole = (table["n"] * table["recall10"]).sum() / table["n"].sum()
    assert whole == pytest.approx(evaluation.recall(10))


def test_progress_counts_every_query(city: SignatureDatabase) -> None:
    seen: list[tuple[int, int]] = []
    evaluate(city, queries=9, progress=lambda done, total: seen.append((done, total)))
    assert seen == [(done, 9) for done in range(1, 10)]


def test_the_time_is_that_of_the_matching(evaluation: Evaluation) -> None:
    assert 0 < evaluation.seconds_per_query < 1


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"queries": 121}, "121 queries were asked for; give a number from 1 to 120"),
        ({"queries": 0}, "0 queries were asked for"),
        ({"queries": 5, "top": 121}, "121 candidates were asked for"),
        ({"queries": 5, "top": 0}, "0 candidates were asked for"),
        ({"queries": 5, "seed": -1}, "a seed of -1 was given"),
    ],
)
def test_numbers_out_of_range_are_refused(
    city: SignatureDatabase, options: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        evaluate(city, **options)


def test_an_unknown_distortion_is_refused(city: SignatureDatabase) -> None:
    with pytest.raises(UnknownNameError, match="nearest is 'strong'"):
        evaluate(city, queries=5, distortion="strng")


def test_a_threshold_that_was_not_kept_is_refused(evaluation: Evaluation) -> None:
    with pytest.raises(InputError, match="No probability is kept for an error of 12 m"):
        evaluation.cdf([10, 12])
