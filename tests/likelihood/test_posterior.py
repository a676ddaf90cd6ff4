from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import random_database

from semsig_gis.likelihood.posterior import posterior

DATABASE = random_database(3, cells=120)
LOGLIKS = st.integers(0, 10_000).map(
    lambda seed: np.random.default_rng(seed).choice([-40.0, -3.0, -2.0, 0.0], len(DATABASE))
)


@given(LOGLIKS, st.floats(-1e4, 1e4))
def test_chances_are_proportional_to_the_likelihood(
    loglik: np.ndarray[tuple[int], np.dtype[np.float64]], shift: float
) -> None:
    found = posterior(DATABASE, loglik + shift).chances
    weights = [math.exp(value) for value in loglik]
    assert found == pytest.approx(np.array(weights) / sum(weights), rel=1e-6)
    prior = np.log(np.arange(1.0, len(DATABASE) + 1))
    weights = [math.exp(value) * place for place, value in enumerate(loglik, start=1)]
    found = posterior(DATABASE, loglik, log_prior=prior).chances
    assert found == pytest.approx(np.array(weights) / sum(weights), rel=1e-6)


@given(LOGLIKS, st.sampled_from([0.0, 9.0, 10.0, 25.0, 50.0, 14.2]))
def test_the_mass_within_a_radius_is_a_sum_over_the_cells_in_it(
    loglik: np.ndarray[tuple[int], np.dtype[np.float64]], radius: float
) -> None:
    found = posterior(DATABASE, loglik)
    away = np.hypot(*(DATABASE.xy[:, None] - DATABASE.xy[None]).transpose(2, 0, 1))
    expected = (away <= radius + 1e-6) @ found.chances
    assert found.mass_within(radius) == pytest.approx(expected)
    some = np.array([5, 2, 77])
    assert found.mass_within(radius, some) == pytest.approx(expected[some])
    cell, mass = found.best_place(radius)
    assert mass == pytest.approx(expected.max(), abs=2e-9)
    assert expected[cell] == pytest.approx(expected.max(), abs=2e-9)


@given(LOGLIKS, st.floats(0.01, 1.0))
def test_a_credible_region_is_the_smallest_that_holds_its_share(
    loglik: np.ndarray[tuple[int], np.dtype[np.float64]], share: float
) -> None:
    found = posterior(DATABASE, loglik)
    cells = found.credible_cells(share)
    held = found.chances[cells]
    assert (np.diff(held) <= 0).all()
    assert held.sum() >= share * (1 - 1e-9)
    assert held[:-1].sum() < share
    assert held[-1] >= np.delete(found.chances, cells).max(initial=0.0)


def test_entropy_counts_in_bits() -> None:
    loglik = np.full(len(DATABASE), -np.inf)
    loglik[3] = -700.0
    assert posterior(DATABASE, loglik).entropy == 0.0
    loglik[[4, 5, 6]] = -700.0
    assert posterior(DATABASE, loglik).entropy == pytest.approx(2.0)
    assert posterior(DATABASE, loglik).credible_cells(1.0).tolist() == [3, 4, 5, 6]
