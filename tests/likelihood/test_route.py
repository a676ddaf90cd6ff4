from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import random_database

from semsig_gis.likelihood.posterior import posterior
from semsig_gis.likelihood.route import LOST, Leg, moved_chances, route_posteriors

legs = st.builds(
    Leg, dx=st.floats(-40, 40), dy=st.floats(-40, 40), sigma=st.sampled_from([0.0, 0.5, 4.0, 15.0])
)


def share(way: float, cells: int, sigma: float) -> float:
    """Integrate the chance to move by so many cells of 10 m, by the sum of many steps."""
    noise = np.linspace(-6, 6, 1201) if sigma else np.zeros(1)
    weights = np.exp(-0.5 * noise**2)
    triangle = np.maximum(1 - np.abs((way + sigma * noise) / 10.0 - cells), 0.0)
    return float((weights @ triangle) / weights.sum())


@given(st.integers(0, 99), legs)
def test_chances_move_as_a_sum_over_all_pairs_of_cells(seed: int, leg: Leg) -> None:
    database = random_database(seed, cells=30)
    chances = np.random.default_rng(seed).dirichlet(np.ones(30))
    columns, rows = database.columns.tolist(), database.rows.tolist()
    slow = np.zeros(30)
    for to in range(30):
        for of in range(30):
            aside = share(leg.dx, columns[to] - columns[of], leg.sigma)
            up = share(leg.dy, rows[to] - rows[of], leg.sigma)
            slow[to] += aside * up * chances[of]
    assert moved_chances(database, chances, leg) == pytest.approx(slow, abs=2e-4)


@given(st.integers(0, 99), st.lists(legs, min_size=0, max_size=3))
def test_smoothing_is_the_sum_over_all_routes(seed: int, ways: list[Leg]) -> None:
    database = random_database(seed, cells=6)
    rng = np.random.default_rng(seed)
    logliks = rng.normal(0, 3, (len(ways) + 1, 6))
    steps = [
        (1 - LOST) * np.stack([moved_chances(database, np.eye(6)[cell], leg) for cell in range(6)])
        + LOST / 6
        for leg in ways
    ]
    slow = np.zeros((len(ways) + 1, 6))
    for route in np.ndindex(*[6] * (len(ways) + 1)):
        weight = math.prod(
            [math.exp(logliks[view, cell]) for view, cell in enumerate(route)]
            + [steps[view][route[view], route[view + 1]] for view in range(len(ways))]
        )
        for view, cell in enumerate(route):
            slow[view, cell] += weight
    found = route_posteriors(database, list(logliks), ways)
    for one, expected in zip(found, slow, strict=True):
        # The shares that are left out of a blur make a small difference.
        assert one.chances == pytest.approx(expected / expected.sum(), abs=2e-3)


def test_one_view_is_a_posterior() -> None:
    database = random_database(0)
    loglik = np.random.default_rng(0).normal(0, 1, len(database))
    (found,) = route_posteriors(database, [loglik], [], log_prior=-loglik)
    assert found.chances == pytest.approx(1 / len(database))
    (found,) = route_posteriors(database, [loglik], [])
    assert found.chances.tolist() == posterior(database, loglik).chances.tolist()


def test_a_route_that_leaves_the_city_still_has_chances() -> None:
    database = random_database(0)
    flat = np.zeros(len(database))
    found = route_posteriors(database, [flat, flat], [Leg(dx=1e6, dy=0.0)])
    assert all(one.chances.sum() == pytest.approx(1.0) for one in found)


def test_directions() -> None:
    leg = Leg.towards(180.0, 20.0, sigma=1.0)
    assert (leg.dx, leg.dy, leg.sigma) == pytest.approx((0.0, -20.0, 1.0))
