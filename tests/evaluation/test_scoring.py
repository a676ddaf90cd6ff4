from __future__ import annotations

import functools
import itertools
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from noisy_cells import database_of, random_database
from sentences import refused
from worlds import random_town

from semsig_gis.core import InputError, SemsigError
from semsig_gis.database import ObjectStore
from semsig_gis.evaluation import (
    DISTORTIONS,
    Distortion,
    QuerySpec,
    SimulatedDetector,
    changed_successes,
    common_cases,
    compare_evaluations,
    draw_queries,
    evaluate,
)
from semsig_gis.localization import (
    NEAR_PLACES,
    THRESHOLDS,
    LikelihoodMethod,
    Method,
    NoiseSpec,
    build_index,
    cell_noise,
    locate,
    make_locator,
    named_noise,
    parse_method,
    score_cells,
)
from semsig_gis.reports import evaluation_tables

if TYPE_CHECKING:
    from collections.abc import Callable

    from semsig_gis.evaluation import Evaluation


ALL_MISSED = Distortion(occurrences=1, bearing_sigma=0.0)
DATABASE = random_database(5, cells=150)
QUERIES = 60
INDEX = build_index(DATABASE, named_noise("generic"))
OTHER = build_index(random_database(6), named_noise("light"))
ASKED = [
    query.asked.signature for query in draw_queries(DATABASE, QuerySpec(number=QUERIES, seeds=(2,)))
]
FOUR_ALIKE = database_of([("DD", [10, 200])] * 4 + [("B", [300])], height=5)


@functools.cache
def by_distance() -> Evaluation:
    return evaluate(DATABASE, queries=100, method=Method(keep=20), distortion=ALL_MISSED, seed=3)


@functools.cache
def by_likelihood() -> Evaluation:
    return evaluate(DATABASE, queries=QUERIES, method=INDEX, distortion="medium", seed=2)


def test_hand_computed_rows_curve_and_recall_of_equal_cells() -> None:
    result = evaluate(FOUR_ALIKE, queries=5, method=Method(), distortion="none")
    table = result.queries.set_index("cell").sort_index()
    expected: dict[str, Any] = {
        "error_m": [15, 10, 10, 15, 0],
        "p0": [0.25] * 4 + [1],
        "p10": [0.5, 0.75, 0.75, 0.5, 1],
        "p20": [0.75, 1, 1, 0.75, 1],
        "rank_low": [1] * 5,
        "distance": [0] * 5,
    }
    groups = ("rank_high", "tied", "type_group", "angle_group")
    expected |= dict.fromkeys(groups, [4] * 4 + [1])
    expected["query_types"] = table["types"].to_list()
    assert table[list(expected)].to_dict("list") == expected
    ids = [str(one) for one in FOUR_ALIKE.cell_ids]
    for cell, row in table.iterrows():
        best = str(row["best_cell_id"])
        alike = [one for one in ids[:4] if one != best]
        assert row["next_cell_ids"].split(",") == (alike + ids[4:] if cell != 4 else ids[:4])
    assert result.cdf([0, 10, 20, 25, 30]) == pytest.approx([0.4, 0.7, 0.9, 0.9, 1])
    # 20 % is one cell, 39 % still one, 40 % two, 60 % three, 100 % all.
    recalls = [result.recall(percent) for percent in (19, 20, 39, 40, 60, 80, 100)]
    assert recalls == pytest.approx([0, 0.4, 0.4, 0.6, 0.8, 1, 1])
    assert result.successful.all()
    two = evaluate(FOUR_ALIKE, queries=5, method=Method(), distortion="none", top=2)
    # Two of the four tied cells are drawn: (0 x 3 + 10 x 2 + 20) / 6 for a cell at the end.
    errors = two.queries.set_index("cell").sort_index()["error_m"]
    assert errors.to_list() == pytest.approx([40 / 6, 30 / 6, 30 / 6, 40 / 6, 0])


def test_diagonal_distances_are_exact() -> None:
    # Cells (0, 0) and (3, 4) are alike: 50 m apart, whatever the origin of the grid.
    cells = [("B", [0])] * 25
    cells[0] = cells[19] = ("DDD", [10, 100, 300])
    city = database_of(cells, height=5)
    result = evaluate(city, queries=25, method=Method(), distortion="none").queries
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


def test_columns_tell_the_truth() -> None:
    table = by_distance().queries
    cells = table["cell"].to_numpy()
    assert len(set(cells)) == len(table) == 100
    assert table.crs == DATABASE.crs
    assert (table["cell_id"] == DATABASE.cell_ids[cells]).all()
    assert np.array_equal(np.column_stack([table.geometry.x, table.geometry.y]), DATABASE.xy[cells])
    assert table["types"].to_list() == [DATABASE.types(cell) for cell in cells]
    assert (table["length"] == table["types"].str.len()).all()
    assert (table["query_length"] == table["query_types"].str.len()).all()
    counts = [len(text.split(",")) if text else 0 for text in table["query_bearings"]]
    assert (table["query_length"] == counts).all()
    assert (by_distance().successful == (table["p50"] >= 0.5)).all()
    assert (table[["query_ranges", "query_sectors"]] == "").all(axis=None)


def test_columns_tell_the_view() -> None:
    asked = evaluate(DATABASE, queries=20, distortion="compass:9, ranges:25, view:100").queries
    for row in asked.to_dict("records"):
        start, end = map(float, row["query_sectors"].split("-"))
        assert (end - start) % 360.0 == pytest.approx(100.0, abs=0.11)
        bearings = [float(one) for one in row["query_bearings"].split(",") if one]
        assert all((one - start + 0.1) % 360.0 <= 100.2 for one in bearings)
        assert len([float(one) for one in row["query_ranges"].split(",") if one]) == len(bearings)


def test_methods_on_sequences_take_types_and_bearings_alone() -> None:
    told, untold = (
        evaluate(DATABASE, queries=20, method=Method(), distortion=distortion).queries
        for distortion in ("light, ranges:25, view:100", "light, view:100:told=false")
    )
    columns = ["best_cell_id", "distance", "error_m", "rank_low", "rank_high"]
    assert told[columns].equals(untold[columns])


def test_a_query_of_which_nothing_is_left() -> None:
    empty = by_distance().queries[by_distance().queries["query_length"] == 0]
    assert len(empty) == by_distance().unlocalized > 0
    zeros = ["tied", *(f"p{x}" for x in THRESHOLDS), *(f"near{x}" for x in NEAR_PLACES)]
    for columns, value in (
        (zeros, 0),
        (["error_m", "distance"], math.inf),
        (["rank_low", "rank_high"], 150),
    ):
        assert (empty[columns] == value).all(axis=None)
    assert empty["best_cell_id"].isna().all()
    assert by_distance().recall(99.9) < by_distance().recall(100) == 1
    assert by_distance().cdf()[-1] == pytest.approx(1 - len(empty) / 100)


def test_nothing_left_of_any_query() -> None:
    lamps = database_of([("D", [10])] * 3)
    result = evaluate(lamps, queries=3, distortion="missing:street_light")
    summary = result.summary()["results"]
    assert (summary["unlocalized"], summary["median_error_m"]) == (3, None)
    assert result.seconds_per_query == 0
    assert not result.successful.any()


def test_false_objects_have_classes_of_the_database() -> None:
    rare = Distortion(occurrences=9, false_class="frequency")
    for distortion in (DISTORTIONS["strong"], rare):
        asked = evaluate(DATABASE, queries=60, distortion=distortion).queries["query_types"]
        assert set("".join(asked)) == set(DATABASE.taxonomy.decode([1, 2, 3, 4]))


def test_by_length() -> None:
    table = by_distance().by_length()
    assert table["length"].to_list() == ["1-4", "5-9", "10-19", "20+"]
    lengths = by_distance().queries["length"]
    more = (lengths >= 10).sum()
    assert table["n"].to_list() == [(lengths < 5).sum(), (lengths >= 5).sum() - more, more, 0]
    assert table.loc[0, "p50"] == pytest.approx(by_distance().queries["p50"][lengths < 5].mean())
    assert table.loc[3, "p10":].isna().all()


def test_progress_counts_every_query_and_the_time_is_that_of_the_matching() -> None:
    seen: list[tuple[int, int]] = []
    evaluate(DATABASE, queries=9, progress=lambda done, total: seen.append((done, total)))
    assert seen == [(done, 9) for done in range(1, 10)]
    assert 0 < by_distance().seconds_per_query < 1


@pytest.mark.parametrize("top", [1, 2, 20, 150])
def test_the_answer_comes_first_and_the_likeliest_cells_follow(top: int) -> None:
    found = evaluate(DATABASE, queries=QUERIES, method=INDEX, top=top, seed=2).queries
    for query, row in zip(ASKED, found.to_dict("records"), strict=True):
        if row["query_length"] == 0:
            assert all(math.isnan(row[name]) for name in ("chance", "right", "in_region"))
            assert (row["error_m"], row["rank_low"]) == (math.inf, 150)
            continue
        told = locate(INDEX, query, top=len(DATABASE))
        answer = told.answer.cell
        loglik = told.candidates.set_index("cell")["loglik"].sort_index().to_numpy()
        scores = -loglik.astype(np.float32)
        assert row["tied"] == 1
        assert row["best_cell_id"] == DATABASE.cell_ids[answer]
        assert row["distance"] == pytest.approx(-loglik[answer])
        assert row["chance"] == told.answer.mass
        scores[answer] = -np.inf
        errors = np.hypot(*(DATABASE.xy - DATABASE.xy[row["cell"]]).T).round(6)
        assert row["right"] == float(errors[answer] <= 50)
        # Cells may tie behind the answer: one order is the luckiest, one the unluckiest.
        best, worst = (
            errors[np.lexsort((sign * errors, scores))[:top]].min() for sign in (1.0, -1.0)
        )
        assert best - 1e-6 <= row["error_m"] <= worst + 1e-6
        for limit in THRESHOLDS:
            assert float(worst <= limit) <= row[f"p{limit}"] <= float(best <= limit)
        own = scores[row["cell"]]
        assert row["rank_low"] == (scores < own).sum() + 1
        assert row["rank_high"] == (scores <= own).sum()
        if (told.posterior.chances == told.posterior.chances[row["cell"]]).sum() == 1:
            assert row["in_region"] == float(row["cell"] in told.region)


@pytest.mark.parametrize("text", ["likelihood:light", "likelihood:light:refined:heading=20"])
def test_the_likelihood_method_answers_as_it_locates(text: str) -> None:
    method = parse_method(text)
    assert isinstance(method, LikelihoodMethod)
    town = random_town()
    database, store = town.database, ObjectStore.of(town.street_objects)
    index = build_index(database, cell_noise(method.noise, database.grid.step))
    locator = make_locator(database, method, store=store if method.refined else None)
    spec = QuerySpec(number=6, seen_from="anywhere")
    drawn = [query.asked.signature for query in draw_queries(database, spec, store=store)]
    queries = [query for query in drawn if len(query)]
    for query, answer in zip(queries, locator.rankings(queries), strict=True):
        found = locate(
            index, query, north_sigma=method.north_sigma, store=store, refined=method.refined
        )
        assert answer.scores.argmin() == found.answer.cell
        others = np.arange(len(database)) != found.answer.cell
        assert answer.scores[others] == pytest.approx(-found.loglik[others], rel=1e-6)
        assert answer.best_score == pytest.approx(-found.loglik[found.answer.cell])
        assert answer.chance == found.answer.mass
        np.testing.assert_array_equal(answer.chances, found.chances)
        np.testing.assert_array_equal(answer.region, found.region)
        if method.refined:
            assert answer.place == (found.estimate.x, found.estimate.y)
            assert answer.heading == found.estimate.heading
        else:
            assert (answer.place, answer.heading) == (None, None)
    assert list(locator.rankings([])) == []


def test_places_that_tie_are_scored_by_expectation() -> None:
    # Every signature is there twice, far apart, so that nothing tells the two places apart.
    twice = random_database(8, cells=30).select(np.tile(np.arange(30), 2))
    apart = np.repeat(np.array([0, 100], np.int32), 30)
    twice = replace(twice, columns=twice.columns + apart)
    index = build_index(twice, named_noise("light"))
    found = evaluate(twice, queries=60, method=index, distortion="none")
    table = found.queries
    assert (table["tied"] == 2).all()
    assert set(table["right"]) <= {0.0, 0.5}
    assert (table["right"] == table["p50"]).all()
    assert (table["rank_high"] > table["rank_low"]).all()
    assert set(table["in_region"]) <= {0.0, 0.5, 1.0}
    assert (table["chance"] <= 0.5 + 1e-9).all()
    assert found.answers()["coverage"] == 0
    assert math.isnan(found.answers()["precision"])


def test_what_the_model_draws_comes_true_as_often_as_it_says() -> None:
    # In far more cells than a handful, so that some places are hard to tell.
    cells = random_database(11, cells=300, longest=6, classes=2)
    noise = NoiseSpec(detection=0.8, misnamed=0.1, clutter=0.7, bearing_sigma=12.0, name="mine")
    detector = SimulatedDetector(noise=noise)
    found = evaluate(cells, queries=300, method=build_index(cells, noise), distortion=detector)
    told = found.queries.dropna(subset=["chance"])
    spread = math.sqrt(float((told["chance"] * (1.0 - told["chance"])).sum()))
    assert abs(float((told["right"] - told["chance"]).sum())) < 4.0 * spread
    assert 0.2 < told["chance"].mean() < 0.95
    assert 0.86 < told["in_region"].mean() < 0.99
    # A detector that is worse than the method believes: its chances are too high.
    bad = SimulatedDetector(noise=replace(noise, detection=0.5, clutter=3.0, bearing_sigma=30.0))
    wrong = evaluate(cells, queries=300, method=build_index(cells, noise), distortion=bad).queries
    assert wrong["chance"].mean() > wrong["right"].mean() + 0.1


def test_the_queries_are_those_of_the_other_methods() -> None:
    same = ["cell", "query_types", "query_bearings", "query_length", "geometry"]
    other = evaluate(DATABASE, queries=QUERIES, method="edit+edit", seed=2)
    assert other.queries[same].equals(by_likelihood().queries[same])
    assert other.queries[["chance", "right", "in_region"]].isna().all(axis=None)
    assert other.answers() == {}
    assert "coverage" not in other.by_length()
    assert "coverage" not in other.summary()["results"]


def test_how_it_answers_is_counted() -> None:
    table = by_likelihood().queries
    given = table[table["chance"] >= 0.9]
    assert 0 < len(given) < QUERIES
    answers = by_likelihood().answers()
    assert answers == pytest.approx(
        {
            "coverage": len(given) / QUERIES,
            "precision": given["right"].mean(),
            "in_region": table["in_region"].mean(),
        }
    )
    by_length = by_likelihood().by_length()
    share = (by_length["n"] * by_length["coverage"]).sum() / QUERIES
    assert share == pytest.approx(answers["coverage"])
    assert by_likelihood().summary()["results"].items() >= answers.items()
    silent = replace(by_likelihood(), queries=table.assign(chance=0.0))
    assert silent.summary()["results"]["precision"] is None


def test_the_report_tells_of_the_answers(snapshot: Callable[[str, str], None]) -> None:
    tables = evaluation_tables(replace(by_likelihood(), seconds_per_query=0.0125))
    snapshot("likelihood.md", "\n".join(table.markdown() for table in tables))
    silent = replace(by_likelihood(), queries=by_likelihood().queries.assign(chance=0.0))
    assert ("Right answers, of these", "", "") in evaluation_tables(silent)[1].rows


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"queries": 151}, ["151 queries", "from 1 to 150"]),
        ({"queries": 0}, ["0 queries", "from 1"]),
        ({"top": 151}, ["151 candidates", "from 1 to 150"]),
        ({"top": 0}, ["0 candidates", "from 1"]),
        ({"seed": -1}, ["seed is -1", "from 0"]),
        ({"distortion": "strng"}, ["'strng'", "nearest is 'strong'"]),
        ({"method": OTHER}, ["another database"]),
    ],
)
def test_what_is_refused(options: dict[str, Any], words: list[str]) -> None:
    with refused(SemsigError, *words):
        evaluate(DATABASE, **{"queries": 5, **options})


def test_a_threshold_that_was_not_kept_is_refused() -> None:
    with refused(SemsigError, "error of 12 m", "choose from 0, 5"):
        by_distance().cdf([10, 12])


FIRST, SECOND = PAIR = tuple(
    evaluate(
        DATABASE, queries=100, method=Method.parse(method), distortion=Distortion(occurrences=2)
    )
    for method in ("types:histogram", "edit+edit")
)


def test_figures_and_differences_are_those_of_the_evaluations() -> None:
    table = compare_evaluations(FIRST, SECOND).set_index("figure")
    for number, evaluation in zip(("first", "second"), PAIR, strict=True):
        means = evaluation.means()["value"]
        for name in ("p5", "p50", "near20", "recall10"):
            assert table[number][name] == pytest.approx(means[name])
        median = evaluation.summary()["results"]["median_error_m"]
        assert table[number]["error_median"] == median
    assert (table["difference"] == table["second"] - table["first"]).all()
    assert (table["low"] <= table["difference"]).all()
    assert (table["difference"] <= table["high"]).all()
    assert "coverage" not in table.index


def test_turned_round_the_differences_change_their_sign() -> None:
    there, back = compare_evaluations(FIRST, SECOND), compare_evaluations(SECOND, FIRST)
    assert there["difference"].tolist() == (-back["difference"]).tolist()
    assert there["low"].tolist() == pytest.approx((-back["high"]).tolist(), abs=1e-9)
    itself = compare_evaluations(FIRST, FIRST)
    assert (itself[["difference", "low", "high"]] == 0).all(axis=None)


def test_queries_that_are_gained_and_lost_are_counted() -> None:
    gained, lost = changed_successes(FIRST, SECOND)
    assert (lost, gained) == changed_successes(SECOND, FIRST)
    assert gained - lost == SECOND.successful.sum() - FIRST.successful.sum()
    assert gained > 0 < lost
    assert changed_successes(FIRST, FIRST) == (0, 0)


def test_the_interval_is_that_of_pairs() -> None:
    table = compare_evaluations(FIRST, SECOND).set_index("figure")
    first, second = (one.queries["p50"].to_numpy() for one in PAIR)
    # By theory, of means of many: the deviation of the differences, not that of both by itself.
    half = 1.96 * (second - first).std() / math.sqrt(len(first))
    low, high = table["low"]["p50"], table["high"]["p50"]
    assert (high - low) / 2 == pytest.approx(half, rel=0.12)
    assert (high + low) / 2 == pytest.approx((second - first).mean(), abs=0.1 * half)


def test_a_seed_repeats_the_draws() -> None:
    once, again, other = (
        compare_evaluations(FIRST, SECOND, resamples=120, seed=seed) for seed in (1, 1, 2)
    )
    assert once.equals(again)
    assert not once.equals(other)


def test_infinite_errors_have_no_difference() -> None:
    lost = FIRST.queries.assign(error_m=np.inf)
    table = compare_evaluations(replace(FIRST, queries=lost), replace(SECOND, queries=lost))
    (row,) = table[table["figure"] == "error_median"].to_dict("records")
    assert row["first"] == row["second"] == math.inf
    assert all(math.isnan(row[name]) for name in ("difference", "low", "high"))


def test_of_the_likelihood_method_its_answers_are_compared() -> None:
    light, strong = (
        evaluate(DATABASE, queries=60, method=build_index(DATABASE, named_noise(name)))
        for name in ("light", "strong")
    )
    table = compare_evaluations(light, strong, resamples=200).set_index("figure")
    for name in ("coverage", "precision", "in_region"):
        assert table["first"][name] == pytest.approx(light.answers()[name])
        assert table["low"][name] <= table["high"][name]


def test_queries_from_other_places_are_refused() -> None:
    moved = SECOND.queries.set_geometry(SECOND.queries.geometry.translate(1.0))
    for queries in (SECOND.queries.head(99), moved):
        with refused(InputError, "different queries", f"(100 and {len(queries)})", "same places"):
            compare_evaluations(FIRST, replace(SECOND, queries=queries))
        with refused(InputError, "different queries"):
            changed_successes(FIRST, replace(SECOND, queries=queries))


def test_cases_in_common() -> None:
    assert common_cases({"": FIRST}, {"a/b": SECOND}) == {"a/b": PAIR}
    assert common_cases({"": FIRST}, {"": SECOND}) == {"": PAIR}
    both = common_cases({"a": FIRST, "b": FIRST}, {"b": SECOND, "c": SECOND})
    assert both == {"b": PAIR}
    with refused(InputError, "a, b", "c, a single evaluation"):
        common_cases({"a": FIRST, "b": FIRST}, {"c": SECOND, "": SECOND})
