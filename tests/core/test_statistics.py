from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core import (
    InputError,
    binomial_tail,
    fit_shares,
    log_interval,
    poisson_interval,
    quantile_ranks,
    wilson_interval,
)

# --- Intervals --------------------------------------------------------------------------------


@given(st.integers(1, 60), st.floats(0.01, 0.99), st.data())
def test_tail_is_a_sum_of_probabilities(trials: int, chance: float, data: st.DataObject) -> None:
    hits = data.draw(st.integers(0, trials))
    slow = sum(
        math.comb(trials, hit) * chance**hit * (1 - chance) ** (trials - hit)
        for hit in range(hits + 1)
    )
    assert binomial_tail(hits, trials, chance) == pytest.approx(slow, rel=1e-9)


@given(size=st.integers(1, 3000), share=st.floats(0.01, 0.99))
def test_quantile_ranks_are_valid_ranks(size: int, share: float) -> None:
    low, high = quantile_ranks(size, share)
    assert 1 <= low <= high <= size


@pytest.mark.parametrize("share", [0.5, 0.9])
@pytest.mark.parametrize("size", [60, 400])
def test_quantile_ranks_have_the_stated_coverage(size: int, share: float) -> None:
    low, high = quantile_ranks(size, share)
    # The quantile is between the ranks if this number of values is below it.
    inside = binomial_tail(high - 1, size, share) - binomial_tail(low - 1, size, share)
    assert 0.945 < inside < 0.99


@pytest.mark.parametrize("chance", [0.05, 0.3, 0.9])
def test_wilson_interval_has_the_stated_coverage(chance: float) -> None:
    hits = np.random.default_rng(0).binomial(80, chance, 4000)
    inside = [low <= chance <= high for low, high in (wilson_interval(h / 80, 80) for h in hits)]
    assert 0.93 < np.mean(inside) < 0.985


@pytest.mark.parametrize("rate", [0.2, 2.0])
def test_poisson_interval_has_the_stated_coverage(rate: float) -> None:
    events = np.random.default_rng(0).poisson(rate * 80, 4000)
    inside = [low <= rate <= high for low, high in (poisson_interval(e / 80, 80) for e in events)]
    assert 0.93 < np.mean(inside) < 0.985


def test_interval_without_trials_is_unlimited() -> None:
    assert wilson_interval(0.5, 0) == (0.0, 1.0)
    assert poisson_interval(0.5, 0) == (0.0, math.inf)
    low, high = log_interval(2.0, math.inf)
    assert low < 1e-200
    assert high > 1e200


@given(st.floats(0, 1), st.floats(0.1, 1e6), st.floats(50, 99.9))
def test_log_interval_contains_the_value(share: float, trials: float, percent: float) -> None:
    low, high = wilson_interval(share, trials, percent=percent)
    assert 0 <= low <= share + 1e-12
    assert share - 1e-12 <= high <= 1


def test_invalid_percent_is_refused() -> None:
    with refused(InputError, "100", "between"):
        wilson_interval(0.5, 10, percent=100)


# --- Curves through shares --------------------------------------------------------------------


@given(st.integers(0, 10_000), st.integers(1, 3), st.integers(1, 60))
def test_mean_prediction_is_the_mean_of_the_examples(seed: int, kinds: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    features = rng.normal(0.0, rng.uniform(0.1, 50.0), (count, kinds)) + rng.normal(0, 100)
    shares = rng.choice([0.0, 1.0, rng.random()], count)
    curve = fit_shares(features, shares)
    fitted = curve.predict(features)
    assert ((fitted >= 0) & (fitted <= 1)).all()
    assert abs(fitted.mean() - shares.mean()) < 1e-3
    far = features + rng.choice([-1e6, 1e6], features.shape)
    ends = np.where(far > 0, features.max(axis=0), features.min(axis=0))
    assert np.allclose(curve.predict(far), curve.predict(ends))


def test_known_curve_is_recovered() -> None:
    rng = np.random.default_rng(3)
    features = rng.normal(size=(4000, 2))
    chances = 1.0 / (1.0 + np.exp(-(0.5 + 2.0 * features[:, 0] - features[:, 1])))
    curve = fit_shares(features, rng.random(4000) < chances)
    inside = (np.abs(features) < 2.0).all(axis=1)
    assert np.abs(curve.predict(features) - chances)[inside].max() < 0.12


@pytest.mark.parametrize("share", [0.0, 1.0, 0.3])
def test_equal_shares_give_a_constant_prediction(share: float) -> None:
    curve = fit_shares(np.arange(10.0)[:, None], np.full(10, share))
    assert np.allclose(curve.predict([[-5.0], [4.5], [99.0]]), share, atol=1e-4)


@pytest.mark.parametrize(
    ("features", "shares", "words"),
    [
        (np.zeros((2, 1)), np.zeros(3), ("a row for each",)),
        (np.zeros(3), np.zeros(3), ("a row for each",)),
        (np.zeros((0, 1)), np.zeros(0), ("a row for each",)),
        (np.array([[np.nan]]), np.zeros(1), ("not finite", "leave")),
        (np.zeros((1, 1)), np.array([1.5]), ("from 0 to 1", "leave")),
    ],
)
def test_invalid_examples_are_refused(
    features: np.ndarray, shares: np.ndarray, words: tuple[str, ...]
) -> None:
    with refused(InputError, *words):
        fit_shares(features, shares)
