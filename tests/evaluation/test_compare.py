from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from noisy_cells import random_database
from sentences import refused

from semsig_gis.core.errors import InputError
from semsig_gis.evaluation.compare import common_cases, compare_evaluations
from semsig_gis.evaluation.evaluate import evaluate
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.noise.model import named_noise
from semsig_gis.matching.method import Method
from semsig_gis.queries.distortions import Distortion

DATABASE = random_database(5, cells=150)
ERRORS = Distortion(occurrences=2)
FIRST, SECOND = PAIR = tuple(
    evaluate(DATABASE, queries=100, method=Method.parse(method), distortion=ERRORS)
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
        with refused(InputError, "other queries", f"(100 and {len(queries)})", "same places"):
            compare_evaluations(FIRST, replace(SECOND, queries=queries))


def test_cases_in_common() -> None:
    assert common_cases({"": FIRST}, {"a/b": SECOND}) == {"a/b": PAIR}
    assert common_cases({"": FIRST}, {"": SECOND}) == {"": PAIR}
    both = common_cases({"a": FIRST, "b": FIRST}, {"b": SECOND, "c": SECOND})
    assert both == {"b": PAIR}
    with refused(InputError, "a, b", "c, a single evaluation"):
        common_cases({"a": FIRST, "b": FIRST}, {"c": SECOND, "": SECOND})
