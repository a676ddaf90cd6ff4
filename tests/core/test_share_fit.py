"""Curves through shares."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sentences import assert_sentence

from semsig_gis.core.errors import InputError
from semsig_gis.core.statistics import fit_shares


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 3), st.integers(1, 60))
def test_a_curve_has_the_mean_of_the_examples(seed: int, kinds: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    features = rng.normal(0.0, rng.uniform(0.1, 50.0), (count, kinds)) + rng.normal(0, 100)
    shares = rng.choice([0.0, 1.0, rng.random()], count)
    curve = fit_shares(features, shares)
    found = curve.predict(features)
    assert ((found >= 0) & (found <= 1)).all()
    assert abs(found.mean() - shares.mean()) < 1e-3
    far = features + rng.choice([-1e6, 1e6], features.shape)
    ends = np.where(far > 0, features.max(axis=0), features.min(axis=0))
    assert np.allclose(curve.predict(far), curve.predict(ends))


def test_a_known_curve_is_found() -> None:
    rng = np.random.default_rng(3)
    features = rng.normal(size=(4000, 2))
    chances = 1.0 / (1.0 + np.exp(-(0.5 + 2.0 * features[:, 0] - features[:, 1])))
    curve = fit_shares(features, rng.random(4000) < chances)
    inside = (np.abs(features) < 2.0).all(axis=1)
    assert np.abs(curve.predict(features) - chances)[inside].max() < 0.12


@pytest.mark.parametrize("share", [0.0, 1.0, 0.3])
def test_equal_shares_make_a_level_curve(share: float) -> None:
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
def test_what_cannot_be_fitted(
    features: np.ndarray, shares: np.ndarray, words: tuple[str, ...]
) -> None:
    with pytest.raises(InputError) as caught:
        fit_shares(features, shares)
    assert_sentence(caught.value, *words)
