from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from noisy_cells import random_database
from six_cells import rows

from semsig_gis.core.errors import InputError
from semsig_gis.evaluation.evaluate import evaluate
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.locate import locate
from semsig_gis.likelihood.noise.model import NoiseSpec, named_noise
from semsig_gis.matching.ties import THRESHOLDS, expected_recall
from semsig_gis.queries.distortions import Detector
from semsig_gis.queries.draw import QuerySpec, draw_queries
from semsig_gis.reports.evaluation import evaluation_tables

if TYPE_CHECKING:
    from semsig_gis.core.signature import Signature
    from semsig_gis.evaluation.result import Evaluation
    from semsig_gis.likelihood.index import LikelihoodIndex

DATABASE = random_database(5, cells=150)
QUERIES = 60


@pytest.fixture(scope="module")
def index() -> LikelihoodIndex:
    return build_index(DATABASE, named_noise("generic"))


@pytest.fixture(scope="module")
def evaluation(index: LikelihoodIndex) -> Evaluation:
    return evaluate(DATABASE, queries=QUERIES, method=index, distortion="medium", seed=2)


def asked(seed: int = 2) -> list[Signature]:
    """Return the queries as an evaluation distorts them."""
    drawn = draw_queries(DATABASE, QuerySpec(number=QUERIES, seeds=(seed,)))
    return [query.asked.signature for query in drawn]


@pytest.mark.parametrize("top", [1, 2, 20, 150])
def test_the_answer_comes_first_and_the_likeliest_cells_follow(
    index: LikelihoodIndex, top: int
) -> None:
    found = evaluate(DATABASE, queries=QUERIES, method=index, top=top, seed=2).queries
    for query, row in zip(asked(), found.to_dict("records"), strict=True):
        if row["query_length"] == 0:
            assert all(math.isnan(row[name]) for name in ("chance", "right", "in_region"))
            assert (row["error_m"], row["rank_low"]) == (math.inf, 150)
            continue
        told = locate(index, query, top=len(DATABASE))
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


def test_places_that_tie_are_scored_by_expectation() -> None:
    # Every signature is there twice, far apart, so that nothing tells the two places apart.
    half = random_database(8, cells=30)
    twice = replace(
        half,
        columns=np.concatenate([half.columns, half.columns + 100]),
        rows=np.tile(half.rows, 2),
        offsets=np.concatenate([half.offsets, half.offsets[1:] + half.offsets[-1]]),
        codes=np.tile(half.codes, 2),
        bearing_units=np.tile(half.bearing_units, 2),
        distance_units=np.tile(half.distance_units, 2),
    )
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
    detector = Detector(noise=noise)
    found = evaluate(cells, queries=300, method=build_index(cells, noise), distortion=detector)
    told = found.queries.dropna(subset=["chance"])
    spread = math.sqrt(float((told["chance"] * (1.0 - told["chance"])).sum()))
    assert abs(float((told["right"] - told["chance"]).sum())) < 4.0 * spread
    assert 0.2 < told["chance"].mean() < 0.95
    assert 0.86 < told["in_region"].mean() < 0.99
    # A detector that is worse than the method believes: its chances are too high.
    bad = Detector(noise=replace(noise, detection=0.5, clutter=3.0, bearing_sigma=30.0))
    wrong = evaluate(cells, queries=300, method=build_index(cells, noise), distortion=bad).queries
    assert wrong["chance"].mean() > wrong["right"].mean() + 0.1


def test_more_candidates_never_hurt(index: LikelihoodIndex) -> None:
    one, five = (
        evaluate(DATABASE, queries=QUERIES, method=index, top=top).queries for top in (1, 5)
    )
    assert (five["error_m"] <= one["error_m"]).all()
    for column in ("rank_low", "rank_high", "chance", "right", "in_region", "best_cell_id"):
        assert five[column].equals(one[column])


def test_the_queries_are_those_of_the_other_methods(evaluation: Evaluation) -> None:
    same = ["cell", "query_types", "query_bearings", "query_length", "geometry"]
    other = evaluate(DATABASE, queries=QUERIES, seed=2)
    assert other.queries[same].equals(evaluation.queries[same])
    assert other.queries[["chance", "right", "in_region"]].isna().all(axis=None)
    assert other.answers() == {}
    assert "coverage" not in other.by_length()
    assert "coverage" not in other.summary()["results"]


def test_how_it_answers_is_counted(evaluation: Evaluation) -> None:
    table = evaluation.queries
    given = table[table["chance"] >= 0.9]
    assert 0 < len(given) < QUERIES
    answers = evaluation.answers()
    assert answers["coverage"] == pytest.approx(len(given) / QUERIES)
    assert answers["precision"] == pytest.approx(given["right"].mean())
    assert answers["in_region"] == pytest.approx(table["in_region"].mean())
    by_length = evaluation.by_length()
    share = (by_length["n"] * by_length["coverage"]).sum() / QUERIES
    assert share == pytest.approx(answers["coverage"])
    results = evaluation.summary()["results"]
    assert {name: results[name] for name in answers} == answers
    ranks = table["rank_low"], table["rank_high"]
    assert evaluation.recall(10) == expected_recall(*ranks, cells=150, percent=10).mean()


def test_the_report_tells_of_the_answers(evaluation: Evaluation) -> None:
    settings, figures, by_length, _, chances, rules = evaluation_tables(evaluation)
    assert rows(settings)["Method"] == ("likelihood:generic:on_grid",)
    told = rows(figures)
    answers = evaluation.answers()
    assert told["Answered, with a chance of 0.9 or more"][0] == f"{answers['coverage']:.4f}"
    assert told["Right answers, of these"][0] == f"{answers['precision']:.4f}"
    assert told["True cell in the region of 90 %"][0] == f"{answers['in_region']:.4f}"
    curve = evaluation.coverage_curve()
    (row,) = curve[curve["threshold"] == 0.9].to_dict("records")
    assert rows(rules)["0.9"][1] == f"{row['coverage']:.4f}"
    assert row["precision"] == answers["precision"]
    stated = evaluation.calibration()
    assert stated["n"].sum() == QUERIES - evaluation.unlocalized
    assert rows(chances)["0.9 to 1"][0] == str(stated["n"].iloc[-1])
    assert by_length.columns[-3:] == ("Answered", "Right", "In region")
    assert all(len(row) == len(by_length.columns) for row in by_length.rows)
    silent = replace(evaluation, queries=evaluation.queries.assign(chance=0.0))
    assert rows(evaluation_tables(silent)[1])["Right answers, of these"] == ("", "")
    assert silent.summary()["results"]["precision"] is None


def test_the_index_of_another_database_is_refused() -> None:
    other = build_index(random_database(6), named_noise("light"))
    with pytest.raises(InputError, match="belongs to another database"):
        evaluate(DATABASE, queries=3, method=other)
