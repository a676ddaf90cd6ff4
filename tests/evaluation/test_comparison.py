from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from noisy_cells import random_database
from sentences import assert_sentence

from semsig_gis.core.errors import InputError
from semsig_gis.evaluation.compare import common_cases, compare_evaluations
from semsig_gis.evaluation.evaluate import evaluate
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.noise.model import named_noise
from semsig_gis.matching.method import Method

if TYPE_CHECKING:
    from semsig_gis.evaluation.result import Evaluation

DATABASE = random_database(5, cells=150)


def answered(method: str, queries: int = 100) -> Evaluation:
    options = {"method": Method.parse(method), "distortion": "errors:2"}
    return evaluate(DATABASE, queries=queries, **options)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def pair() -> tuple[Evaluation, Evaluation]:
    return answered("types:histogram"), answered("edit+edit")


def test_figures_and_differences_are_those_of_the_evaluations(
    pair: tuple[Evaluation, Evaluation],
) -> None:
    found = compare_evaluations(*pair).set_index("figure")
    for number, evaluation in zip(("first", "second"), pair, strict=True):
        means = evaluation.means()["value"]
        for name in ("p5", "p50", "near20", "recall10"):
            assert found[number][name] == pytest.approx(means[name])
        median = evaluation.summary()["results"]["median_error_m"]
        assert found[number]["error_median"] == median
    assert (found["difference"] == found["second"] - found["first"]).all()
    assert (found["low"] <= found["difference"]).all()
    assert (found["difference"] <= found["high"]).all()
    assert "coverage" not in found.index


def test_an_evaluation_does_not_differ_from_itself(pair: tuple[Evaluation, Evaluation]) -> None:
    found = compare_evaluations(pair[0], pair[0])
    assert (found[["difference", "low", "high"]] == 0).all(axis=None)


def test_turned_round_the_differences_change_their_sign(
    pair: tuple[Evaluation, Evaluation],
) -> None:
    there, back = compare_evaluations(*pair), compare_evaluations(*pair[::-1])
    assert there["difference"].tolist() == (-back["difference"]).tolist()
    assert there["low"].tolist() == pytest.approx((-back["high"]).tolist(), abs=1e-9)


def test_the_interval_is_that_of_pairs(pair: tuple[Evaluation, Evaluation]) -> None:
    found = compare_evaluations(*pair).set_index("figure")
    first, second = (one.queries["p50"].to_numpy() for one in pair)
    # By theory, of means of many: the deviation of the differences, not that of both by itself.
    half = 1.96 * (second - first).std() / math.sqrt(len(first))
    low, high = found["low"]["p50"], found["high"]["p50"]
    assert (high - low) / 2 == pytest.approx(half, rel=0.12)
    assert (high + low) / 2 == pytest.approx((second - first).mean(), abs=0.1 * half)


def test_a_seed_repeats_the_draws(pair: tuple[Evaluation, Evaluation]) -> None:
    once, again, other = (
        compare_evaluations(*pair, resamples=120, seed=seed) for seed in (1, 1, 2)
    )
    assert once.equals(again)
    assert not once.equals(other)


def test_infinite_errors_have_no_difference(pair: tuple[Evaluation, Evaluation]) -> None:
    lost = pair[0].queries.assign(error_m=np.inf)
    found = compare_evaluations(replace(pair[0], queries=lost), replace(pair[1], queries=lost))
    (row,) = found[found["figure"] == "error_median"].to_dict("records")
    assert row["first"] == row["second"] == math.inf
    assert all(math.isnan(row[name]) for name in ("difference", "low", "high"))


def test_of_the_likelihood_method_its_answers_are_compared() -> None:
    light, strong = (
        evaluate(DATABASE, queries=60, method=build_index(DATABASE, named_noise(name)))
        for name in ("light", "strong")
    )
    found = compare_evaluations(light, strong, resamples=200).set_index("figure")
    for name in ("coverage", "precision", "in_region"):
        assert found["first"][name] == pytest.approx(light.answers()[name])
        assert found["low"][name] <= found["high"][name]


def test_queries_from_other_places_are_refused(pair: tuple[Evaluation, Evaluation]) -> None:
    moved = pair[1].queries.set_geometry(pair[1].queries.geometry.translate(1.0))
    for other in (answered("edit+edit", queries=99), replace(pair[1], queries=moved)):
        with pytest.raises(InputError) as caught:
            compare_evaluations(pair[0], other)
        assert_sentence(caught.value, "other queries", "same places")


def test_cases_in_common(pair: tuple[Evaluation, Evaluation]) -> None:
    one, other = pair
    assert common_cases({"": one}, {"a/b": other}) == {"a/b": (one, other)}
    assert common_cases({"": one}, {"": other}) == {"": (one, other)}
    both = common_cases({"a": one, "b": one}, {"b": other, "c": other})
    assert both == {"b": (one, other)}
    with pytest.raises(InputError) as caught:
        common_cases({"a": one, "b": one}, {"c": other, "": other})
    assert_sentence(caught.value, "a, b", "c, a single evaluation")
