from __future__ import annotations

import functools
import itertools
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from noisy_cells import database_of, random_database
from pyproj import CRS
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
    foreign_answers,
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
from semsig_gis.output import evaluation_tables

if TYPE_CHECKING:
    from collections.abc import Callable

    from semsig_gis.evaluation import Evaluation


ALL_MISSED = Distortion(occurrences=1, bearing_sigma=0.0)
DATABASE = random_database(5, cells=150)
QUERIES = 60
INDEX = build_index(DATABASE, named_noise("generic"))
OTHER = build_index(random_database(6), named_noise("light"))
SIGNATURES = [
    query.asked.signature for query in draw_queries(DATABASE, QuerySpec(number=QUERIES, seeds=(2,)))
]
FOUR_EQUAL = database_of([("DD", [10, 200])] * 4 + [("B", [300])], height=5)


@functools.cache
def by_distance() -> Evaluation:
    return evaluate(DATABASE, queries=100, method=Method(keep=20), distortion=ALL_MISSED, seed=3)


@functools.cache
def by_likelihood() -> Evaluation:
    return evaluate(DATABASE, queries=QUERIES, method=INDEX, distortion="medium", seed=2)


def test_queries_curve_and_recall_of_equal_cells_by_hand() -> None:
    result = evaluate(FOUR_EQUAL, queries=5, method=Method(), distortion="none")
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
    ids = [str(cell_id) for cell_id in FOUR_EQUAL.cell_ids]
    for cell, row in table.iterrows():
        best = str(row["best_cell_id"])
        equal = [cell_id for cell_id in ids[:4] if cell_id != best]
        assert row["next_cell_ids"].split(",") == (equal + ids[4:] if cell != 4 else ids[:4])
    assert result.cdf([0, 10, 20, 25, 30]) == pytest.approx([0.4, 0.7, 0.9, 0.9, 1])
    # 20 % is one cell, 39 % still one, 40 % two, 60 % three, 100 % all.
    recalls = [result.recall(percent) for percent in (19, 20, 39, 40, 60, 80, 100)]
    assert recalls == pytest.approx([0, 0.4, 0.4, 0.6, 0.8, 1, 1])
    assert result.successful.all()
    two = evaluate(FOUR_EQUAL, queries=5, method=Method(), distortion="none", top=2)
    # Two of the four tied cells are drawn: (0 x 3 + 10 x 2 + 20) / 6 for a cell at the end.
    errors = two.queries.set_index("cell").sort_index()["error_m"]
    assert errors.to_list() == pytest.approx([40 / 6, 30 / 6, 30 / 6, 40 / 6, 0])


def test_diagonal_distances_are_exact() -> None:
    # Cells (0, 0) and (3, 4) have equal signatures and are exactly 50 m apart.
    cells = [("B", [0])] * 25
    cells[0] = cells[19] = ("DDD", [10, 100, 300])
    city = database_of(cells, height=5)
    result = evaluate(city, queries=25, method=Method(), distortion="none").queries
    twins = result[result["types"] == "DDD"]
    assert twins["p40"].to_list() == [0.5, 0.5]
    assert twins["p50"].to_list() == [1, 1]


@pytest.mark.parametrize("top", [1, 2, 3, 6])
def test_ties_are_scored_as_the_mean_of_all_orders(top: int) -> None:
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


def test_best_candidate_is_drawn_from_the_tied_cells() -> None:
    database = database_of([("D", [10])] * 40, height=40)
    queries = evaluate(database, queries=40, distortion="none").queries
    assert queries["best_cell_id"].nunique() > 15
    row = database.cell_ids.tolist().index(queries["best_cell_id"].iloc[0])
    assert queries[["best_x", "best_y"]].iloc[0].to_list() == database.xy[row].tolist()


def test_columns_describe_the_true_cells() -> None:
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


def test_columns_have_sectors_and_ranges_of_the_query() -> None:
    queries = evaluate(DATABASE, queries=20, distortion="compass:9, ranges:25, view:100").queries
    for row in queries.to_dict("records"):
        start, end = map(float, row["query_sectors"].split("-"))
        assert (end - start) % 360.0 == pytest.approx(100.0, abs=0.11)
        bearings = [float(text) for text in row["query_bearings"].split(",") if text]
        assert all((bearing - start + 0.1) % 360.0 <= 100.2 for bearing in bearings)
        ranges = [float(text) for text in row["query_ranges"].split(",") if text]
        assert len(ranges) == len(bearings)


def test_distance_methods_use_only_types_and_bearings() -> None:
    with_view, without_view = (
        evaluate(DATABASE, queries=20, method=Method(), distortion=distortion).queries
        for distortion in ("light, ranges:25, view:100", "light, view:100:told=false")
    )
    columns = ["best_cell_id", "distance", "error_m", "rank_low", "rank_high"]
    assert with_view[columns].equals(without_view[columns])


def test_query_without_objects_is_unlocalized() -> None:
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
    with refused(SemsigError, "error of 12 m", "choose from 0, 5"):
        by_distance().cdf([10, 12])


def test_summary_if_all_queries_are_unlocalized() -> None:
    lamps = database_of([("D", [10])] * 3)
    result = evaluate(lamps, queries=3, distortion="missing:street_light")
    summary = result.summary()["results"]
    assert (summary["unlocalized"], summary["median_error_m"]) == (3, None)
    assert result.seconds_per_query == 0
    assert not result.successful.any()


def test_false_objects_have_classes_of_the_database() -> None:
    rare = Distortion(occurrences=9, false_class="frequency")
    for distortion in (DISTORTIONS["strong"], rare):
        types = evaluate(DATABASE, queries=60, distortion=distortion).queries["query_types"]
        assert set("".join(types)) == set(DATABASE.taxonomy.decode([1, 2, 3, 4]))


def test_progress_counts_queries_and_time_is_measured() -> None:
    steps: list[tuple[int, int]] = []
    evaluate(DATABASE, queries=9, progress=lambda *step: steps.append(step))
    assert steps == [(count, 9) for count in range(1, 10)]
    assert 0 < by_distance().seconds_per_query < 1


@pytest.mark.parametrize("top", [1, 2, 20, 150])
def test_likelihood_ranks_the_answer_first_then_cells_by_likelihood(top: int) -> None:
    outcomes = evaluate(DATABASE, queries=QUERIES, method=INDEX, top=top, seed=2).queries
    for query, row in zip(SIGNATURES, outcomes.to_dict("records"), strict=True):
        if row["query_length"] == 0:
            assert all(math.isnan(row[name]) for name in ("chance", "right", "in_region"))
            assert (row["error_m"], row["rank_low"]) == (math.inf, 150)
            continue
        location = locate(INDEX, query)
        answer, loglik = location.answer.cell, location.loglik.astype(np.float64)
        scores = -loglik.astype(np.float32)
        assert row["tied"] == 1
        assert row["best_cell_id"] == DATABASE.cell_ids[answer]
        assert row["distance"] == pytest.approx(-loglik[answer])
        assert row["chance"] == location.answer.mass
        scores[answer] = -np.inf
        errors = np.hypot(*(DATABASE.xy - DATABASE.xy[row["cell"]]).T).round(6)
        assert row["right"] == float(errors[answer] <= 50)
        # Cells after the answer may tie: take the best and the worst order.
        best, worst = (
            errors[np.lexsort((sign * errors, scores))[:top]].min() for sign in (1.0, -1.0)
        )
        assert best - 1e-6 <= row["error_m"] <= worst + 1e-6
        for limit in THRESHOLDS:
            assert float(worst <= limit) <= row[f"p{limit}"] <= float(best <= limit)
        own = scores[row["cell"]]
        assert row["rank_low"] == (scores < own).sum() + 1
        assert row["rank_high"] == (scores <= own).sum()
        chances = location.posterior.chances
        if (chances == chances[row["cell"]]).sum() == 1:
            assert row["in_region"] == float(row["cell"] in location.region)


@pytest.mark.parametrize("text", ["likelihood:light", "likelihood:light:refined:heading=20"])
def test_rankings_of_the_likelihood_method_equal_locate(text: str) -> None:
    method = parse_method(text)
    assert isinstance(method, LikelihoodMethod)
    town = random_town()
    database, store = town.database, ObjectStore.of(town.street_objects)
    index = build_index(database, cell_noise(method.noise, database.grid.step))
    locator = make_locator(database, method, store=store if method.refined else None)
    spec = QuerySpec(number=6, seen_from="anywhere")
    signatures = [query.asked.signature for query in draw_queries(database, spec, store=store)]
    queries = [signature for signature in signatures if len(signature)]
    for query, answer in zip(queries, locator.rankings(queries), strict=True):
        location = locate(
            index, query, north_sigma=method.north_sigma, store=store, refined=method.refined
        )
        assert answer.scores.argmin() == location.answer.cell
        others = np.arange(len(database)) != location.answer.cell
        assert answer.scores[others] == pytest.approx(-location.loglik[others], rel=1e-6)
        assert answer.best_score == pytest.approx(-location.loglik[location.answer.cell])
        assert answer.chance == location.answer.mass
        np.testing.assert_array_equal(answer.chances, location.chances)
        np.testing.assert_array_equal(answer.region, location.region)
        if method.refined:
            assert answer.place == (location.estimate.x, location.estimate.y)
            assert answer.heading == location.estimate.heading
        else:
            assert (answer.place, answer.heading) == (None, None)
    assert list(locator.rankings([])) == []


def test_tied_places_are_scored_by_expectation() -> None:
    # Every signature occurs twice, far apart, so that the two places cannot be distinguished.
    twice = random_database(8, cells=30).select(np.tile(np.arange(30), 2))
    apart = np.repeat(np.array([0, 100], np.int32), 30)
    twice = replace(twice, columns=twice.columns + apart)
    index = build_index(twice, named_noise("light"))
    evaluation = evaluate(twice, queries=60, method=index, distortion="none")
    table = evaluation.queries
    assert (table["tied"] == 2).all()
    assert set(table["right"]) <= {0.0, 0.5}
    assert (table["right"] == table["p50"]).all()
    assert (table["rank_high"] > table["rank_low"]).all()
    assert set(table["in_region"]) <= {0.0, 0.5, 1.0}
    assert (table["chance"] <= 0.5 + 1e-9).all()
    assert evaluation.answers()["coverage"] == 0
    assert math.isnan(evaluation.answers()["precision"])


def test_stated_probabilities_are_calibrated_if_the_model_is_right() -> None:
    # Enough cells, so that some of them look similar.
    cells = random_database(11, cells=300, longest=6, classes=2)
    noise = NoiseSpec(detection=0.8, misnamed=0.1, clutter=0.7, bearing_sigma=12.0, name="mine")
    detector = SimulatedDetector(noise=noise)
    method = build_index(cells, noise)
    settings: dict[str, Any] = {"queries": 300, "method": method}
    doubted = evaluate(cells, distortion=detector, **settings)
    evaluation = evaluate(cells, distortion=detector, surely_here=True, **settings)
    answers = evaluation.queries.dropna(subset=["chance"])
    assert (doubted.queries["chance"].dropna() <= answers["chance"] + 1e-9).all()
    spread = math.sqrt(float((answers["chance"] * (1.0 - answers["chance"])).sum()))
    assert abs(float((answers["right"] - answers["chance"]).sum())) < 4.0 * spread
    assert 0.2 < answers["chance"].mean() < 0.95
    assert 0.86 < answers["in_region"].mean() < 0.99
    # If the detector is worse than its noise model, the stated probabilities are too high.
    bad = SimulatedDetector(noise=replace(noise, detection=0.5, clutter=3.0, bearing_sigma=30.0))
    wrong = evaluate(cells, distortion=bad, surely_here=True, **settings).queries
    assert wrong["chance"].mean() > wrong["right"].mean() + 0.1


def test_all_methods_get_the_same_queries() -> None:
    same = ["cell", "query_types", "query_bearings", "query_length", "geometry"]
    other = evaluate(DATABASE, queries=QUERIES, method="edit+edit", seed=2)
    assert other.queries[same].equals(by_likelihood().queries[same])
    assert other.queries[["chance", "right", "in_region"]].isna().all(axis=None)
    assert other.answers() == {}
    assert "coverage" not in other.by_length()
    assert "coverage" not in other.summary()["results"]


def test_answers_are_counted() -> None:
    table = by_likelihood().queries
    answered = table[table["chance"] >= 0.9]
    assert 0 < len(answered) < QUERIES
    answers = by_likelihood().answers()
    assert list(answers) == ["coverage", "precision", "in_region"]
    shares = len(answered) / QUERIES, answered["right"].mean(), table["in_region"].mean()
    assert tuple(answers.values()) == pytest.approx(shares)
    by_length = by_likelihood().by_length()
    share = (by_length["n"] * by_length["coverage"]).sum() / QUERIES
    assert share == pytest.approx(answers["coverage"])
    assert by_likelihood().summary()["results"].items() >= answers.items()
    silent = replace(by_likelihood(), queries=table.assign(chance=0.0))
    assert silent.summary()["results"]["precision"] is None


def test_tables_contain_the_answers(snapshot: Callable[[str, str], None]) -> None:
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
def test_invalid_options_are_refused(options: dict[str, Any], words: list[str]) -> None:
    with refused(SemsigError, *words):
        evaluate(DATABASE, **{"queries": 5, **options})


FIRST, SECOND = PAIR = tuple(
    evaluate(
        DATABASE, queries=100, method=Method.parse(method), distortion=Distortion(occurrences=2)
    )
    for method in ("types:histogram", "edit+edit")
)


def test_comparison_has_figures_and_their_differences() -> None:
    table = compare_evaluations(FIRST, SECOND).set_index("figure")
    for number, evaluation in zip(("first", "second"), PAIR, strict=True):
        means = evaluation.means()["value"]
        for name in ("p5", "p50", "near20", "recall10"):
            assert table[number][name] == pytest.approx(means[name])
        median = evaluation.summary()["results"]["median_error_m"]
        assert table[number]["error_median"] == median
    assert (table["difference"] == table["second"] - table["first"]).all()
    assert table["difference"].between(table["low"], table["high"]).all()
    assert "coverage" not in table.index


def test_swapping_the_evaluations_changes_the_sign_and_the_changed_successes() -> None:
    table, swapped = compare_evaluations(FIRST, SECOND), compare_evaluations(SECOND, FIRST)
    assert table["difference"].tolist() == (-swapped["difference"]).tolist()
    assert table["low"].tolist() == pytest.approx((-swapped["high"]).tolist(), abs=1e-9)
    itself = compare_evaluations(FIRST, FIRST)
    assert (itself[["difference", "low", "high"]] == 0).all(axis=None)
    gains, losses = changed_successes(FIRST, SECOND)
    assert (losses, gains) == changed_successes(SECOND, FIRST)
    assert gains - losses == SECOND.successful.sum() - FIRST.successful.sum()
    assert gains > 0 < losses
    assert changed_successes(FIRST, FIRST) == (0, 0)


def test_interval_is_that_of_paired_differences() -> None:
    table = compare_evaluations(FIRST, SECOND).set_index("figure")
    first, second = (evaluation.queries["p50"].to_numpy() for evaluation in PAIR)
    # In theory, its width is that of the differences, not that of two independent samples.
    half = 1.96 * (second - first).std() / math.sqrt(len(first))
    low, high = table["low"]["p50"], table["high"]["p50"]
    assert (high - low) / 2 == pytest.approx(half, rel=0.12)
    assert (high + low) / 2 == pytest.approx((second - first).mean(), abs=0.1 * half)


def test_bootstrap_depends_only_on_the_seed() -> None:
    first, repeated, other = (
        compare_evaluations(FIRST, SECOND, resamples=120, seed=seed) for seed in (1, 1, 2)
    )
    assert first.equals(repeated)
    assert not first.equals(other)


def test_infinite_errors_have_no_difference() -> None:
    unlocalized = replace(FIRST, queries=FIRST.queries.assign(error_m=np.inf))
    table = compare_evaluations(unlocalized, unlocalized)
    (row,) = table[table["figure"] == "error_median"].to_dict("records")
    assert row["first"] == row["second"] == math.inf
    assert all(math.isnan(row[name]) for name in ("difference", "low", "high"))


def test_answers_of_the_likelihood_method_are_compared() -> None:
    light, strong = (
        evaluate(DATABASE, queries=60, method=build_index(DATABASE, named_noise(name)))
        for name in ("light", "strong")
    )
    table = compare_evaluations(light, strong, resamples=200).set_index("figure")
    for name in ("coverage", "precision", "in_region"):
        assert table["first"][name] == pytest.approx(light.answers()[name])
        assert table["low"][name] <= table["high"][name]


def test_comparing_different_queries_is_refused() -> None:
    translated = SECOND.queries.set_geometry(SECOND.queries.geometry.translate(1.0))
    for queries in (SECOND.queries.head(99), translated):
        with refused(InputError, "different queries", f"(100 and {len(queries)})", "same places"):
            compare_evaluations(FIRST, replace(SECOND, queries=queries))
        with refused(InputError, "different queries"):
            changed_successes(FIRST, replace(SECOND, queries=queries))


def test_common_cases_are_paired_by_name() -> None:
    assert common_cases({"": FIRST}, {"a/b": SECOND}) == {"a/b": PAIR}
    assert common_cases({"": FIRST}, {"": SECOND}) == {"": PAIR}
    both = common_cases({"a": FIRST, "b": FIRST}, {"b": SECOND, "c": SECOND})
    assert both == {"b": PAIR}
    with refused(InputError, "a, b", "c, a single evaluation"):
        common_cases({"a": FIRST, "b": FIRST}, {"c": SECOND, "": SECOND})


def test_few_views_of_another_city_are_answered() -> None:
    city, other = (random_town(seed, count=150).database for seed in (1, 2))
    other = replace(other, crs=CRS("EPSG:32631"))
    detector = SimulatedDetector(noise=named_noise("by-hand"))
    index = build_index(city, named_noise("by-hand"))
    for surely_here in (False, True):
        settings: dict[str, Any] = {
            "queries": 80,
            "distortion": detector,
            "surely_here": surely_here,
        }
        table = foreign_answers(evaluate(city, method=index, **settings), city, other)
        assert table["objects"].tolist() == ["1-4", "5-9", "10-19", "20+"]
        assert table["own"].sum() <= 80
        own, foreign = (
            (table[share].fillna(0.0) * table[count]).sum()
            for share, count in (("answered", "own"), ("answered_foreign", "foreign"))
        )
        assert own > 15
        assert (foreign <= 2) != surely_here
