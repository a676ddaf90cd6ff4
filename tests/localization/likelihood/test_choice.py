"""The cells to re-rank: first scores by some detections, and quick one-to-one sums."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import random_database, random_query

from semsig_gis.localization import (
    NoiseSpec,
    build_index,
    quick_scorer,
    rerank,
    score_associations,
)
from semsig_gis.observation import Photo, View

SEEDS = st.integers(0, 2**32 - 1)
SIZES = st.integers(1, 20)
FIRST = 8  # detections by which cells are chosen if north is known
NOISE = NoiseSpec(detection=0.8, misnamed=0.1, clutter=1.5, bearing_sigma=8.0)


@settings(max_examples=20)
@given(SEEDS, SIZES)
def test_first_scores_are_those_of_evenly_spaced_detections_with_a_lower_rate(
    seed: int, size: int
) -> None:
    database = random_database(seed, cells=20, longest=20)
    view = View.of(random_query(database, seed, size=size))
    noise = NOISE
    if size > FIRST:
        share = FIRST / size
        noise = replace(NOISE, detection=NOISE.detection * share, clutter=NOISE.clutter * share)
        view = view.select(np.linspace(0, size - 1, FIRST).round().astype(int))
    expected = build_index(database, noise).scores(view).loglik
    whole = View.of(random_query(database, seed, size=size))
    assert build_index(database, NOISE).first_scores(whole).loglik == pytest.approx(
        expected, abs=1e-3
    )


@settings(max_examples=20)
@given(SEEDS, st.integers(1, 12), st.sampled_from([10.0, math.inf]))
def test_profiles_give_about_the_sum_over_turns(seed: int, size: int, sigma: float) -> None:
    database = random_database(seed, cells=40, longest=20)
    # Bearings are rounded to steps of 5.6 degrees, and wrong names have the likeliest chance.
    index = build_index(database, replace(NOISE, bearing_sigma=20.0))
    view = View.of(random_query(database, seed, size=size))
    quick, exact = (
        index.first_scores(view, north_sigma=sigma),
        index.scores(view, north_sigma=sigma),
    )
    assert quick.loglik == pytest.approx(exact.loglik, abs=0.3 * size)
    assert np.median(np.abs(quick.loglik - exact.loglik)) < 0.1 * size
    assert quick.heading is not None
    assert (np.abs(quick.heading) <= 180.0).all()


@pytest.mark.parametrize(
    "photo", [Photo(north_sigma=0.0), Photo(sectors=((20.0, 140.0),), north_sigma=0.0)]
)
@settings(max_examples=20)
@given(SEEDS, SIZES, st.floats(0.0, 30.0))
def test_quick_scores_are_one_to_one_sums_or_bounds_below_the_least(
    photo: Photo, seed: int, size: int, margin: float
) -> None:
    database = random_database(seed, cells=40, longest=25, classes=3)
    index = build_index(database, NOISE)
    view = View.of(random_query(database, seed, size=size), photos=(photo,))
    score = quick_scorer(index, view, index.first_scores(view), north_sigma=0.0)
    cells = np.arange(len(database))
    scores = score(cells, np.full(len(cells), -np.inf))
    exact = score_associations(database, view, NOISE, cells)
    # Against steps of bearings and distances, and few rounds of messages.
    errors = np.abs(scores - exact)
    assert np.median(errors) < 0.2 + 0.05 * size
    least = scores.max() - margin
    bounded = score(cells, np.full(len(cells), least))
    same = np.isclose(bounded, scores, atol=1e-3)
    assert same[scores >= least].all()
    assert (bounded[~same] < least).all()
    assert (bounded[~same] > exact[~same] - 0.2 - 0.05 * size).all()


@pytest.mark.parametrize("sigma", [0.0, 2.0])
@settings(max_examples=15)
@given(SEEDS, st.integers(1, 25))
def test_no_cell_with_a_chance_is_left_out(sigma: float, seed: int, size: int) -> None:
    database = random_database(seed, cells=400, longest=25, classes=3)
    index = build_index(database, NOISE)
    view = View.of(random_query(database, seed, size=size))
    prior = np.random.default_rng(seed).normal(0.0, sigma, len(database))
    exact = score_associations(database, view, NOISE, np.arange(len(database)))
    loglik = rerank(index, view, index.first_scores(view), log_prior=prior, count=100).loglik
    exact, loglik = exact + prior, loglik + prior
    chances, exact_chances = (np.exp(logs - np.logaddexp.reduce(logs)) for logs in (loglik, exact))
    assert loglik.argmax() == exact.argmax() or exact_chances.max() < 0.02
    assert np.abs(chances - exact_chances).max() < 0.02
    # A bound in place of a score is never below it.
    away = loglik < loglik.max() - 20.0
    assert exact_chances[away].max(initial=0.0) < 1e-6
