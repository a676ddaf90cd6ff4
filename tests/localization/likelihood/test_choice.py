"""The cells to re-rank: first scores by some detections, and quick one-to-one sums."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import random_database, random_query

from semsig_gis.localization import (
    NoiseSpec,
    build_index,
    named_noise,
    quick_scorer,
    rerank,
    score_associations,
)
from semsig_gis.observation import Photo, View

if TYPE_CHECKING:
    from semsig_gis.localization import Noise

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
    whole = View.of(random_query(database, seed, size=size))
    view, noise = whole, NOISE
    if size > FIRST:
        share = FIRST / size
        noise = replace(NOISE, detection=NOISE.detection * share, clutter=NOISE.clutter * share)
        view = whole.select(np.linspace(0, size - 1, FIRST).round().astype(int))
    expected = build_index(database, noise).first_scores(view).loglik
    first = build_index(database, NOISE).first_scores(whole).loglik
    assert first == pytest.approx(expected, abs=0.5)


@pytest.mark.parametrize("photo", [Photo(), Photo(sectors=((20.0, 140.0),))])
@pytest.mark.parametrize("noise", [NOISE, named_noise("generic")], ids=["noise", "by length"])
@settings(max_examples=20)
@given(seed=SEEDS, size=st.integers(1, FIRST), longest=st.integers(1, 12), ranged=st.booleans())
def test_first_scores_have_the_largest_term_of_each_sum(
    noise: Noise, photo: Photo, *, seed: int, size: int, longest: int, ranged: bool
) -> None:
    database = random_database(seed, cells=40, longest=longest)
    query = View.of(random_query(database, seed, size=size))
    ranges = np.full(size, 12.0) if ranged else None
    view = replace(query, photos=(photo,), ranges=ranges)
    index = build_index(database, noise)
    # Sums over a single object are its term; others are at most as many times as large.
    more = index.scores(view).loglik - index.first_scores(view).loglik
    most = size * np.log(np.maximum(database.lengths, 1))
    # Steps are wide in the tails of bearings, and more so in those of ranges.
    error = 0.5 + (2.5 if ranged else 0.8) * size
    assert (more > -error).all()
    assert (more < most + error).all()
    assert np.median(more) > -0.1 - 0.15 * size
    assert np.median(more) < np.median(most) + 0.1 + 0.15 * size


@settings(max_examples=20)
@given(SEEDS, st.integers(1, 12), st.sampled_from([30.0, math.inf]))
def test_profiles_give_about_the_sum_over_turns(seed: int, size: int, sigma: float) -> None:
    database = random_database(seed, cells=40, longest=20)
    # Bearings are rounded to steps of 11 degrees, and wrong names have the likeliest chance.
    index = build_index(database, replace(NOISE, bearing_sigma=20.0))
    view = View.of(random_query(database, seed, size=size))
    quick, exact = (
        index.first_scores(view, north_sigma=sigma),
        index.scores(view, north_sigma=sigma),
    )
    assert quick.loglik == pytest.approx(exact.loglik, abs=0.2 + 0.4 * size)
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
    scores, _ = score(cells, np.full(len(cells), -np.inf))
    exact = score_associations(database, view, NOISE, cells)
    # Against steps of bearings and distances, and few rounds of messages.
    errors = np.abs(scores - exact)
    assert np.median(errors) < 0.2 + 0.05 * size
    least = scores.max() - margin
    bounded, _ = score(cells, np.full(len(cells), least))
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
