from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import random_database

from semsig_gis.core.signature import Signature
from semsig_gis.likelihood.locate import PlaceEstimate, cell_estimate, refined_estimate
from semsig_gis.likelihood.noise.model import NoiseSpec
from semsig_gis.likelihood.posterior import Posterior, posterior
from semsig_gis.likelihood.refine import Refinement

CITY = random_database(3)
SHARP = NoiseSpec(detection=0.95, misnamed=0.02, clutter=0.5, bearing_sigma=3.0)


@given(st.integers(0, 99), st.integers(0, 39), st.sampled_from([10.0, 30.0, 500.0]))
def test_the_mean_is_that_of_drawn_places(seed: int, cell: int, radius: float) -> None:
    chances = np.random.default_rng(seed).dirichlet(np.full(len(CITY), 0.3))
    found = Posterior(database=CITY, chances=chances)
    place = cell_estimate(CITY.signature(0), SHARP, found, cell, radius=radius)
    inside = [
        row for row in range(len(CITY)) if math.dist(CITY.xy[row], CITY.xy[cell]) <= radius + 1e-9
    ]
    weights = chances[inside] / chances[inside].sum()
    mean = weights @ CITY.xy[inside]
    assert (place.x, place.y) == pytest.approx(tuple(mean), abs=1e-6)
    away = CITY.xy[inside] - mean
    spread = (weights[:, None] * away).T @ away + np.eye(2) * 100.0 / 12.0
    assert place.covariance[:2, :2] == pytest.approx(spread, abs=1e-6)
    assert place.heading is None
    assert place.covariance[2].tolist() == [0.0, 0.0, 0.0]


@given(st.floats(0.1, 30.0), st.floats(0.1, 30.0), st.floats(0.0, 179.0))
def test_an_ellipse_holds_its_share(one: float, other: float, bearing: float) -> None:
    angle = math.radians(bearing)
    along = np.array([math.sin(angle), math.cos(angle)])
    across = np.array([along[1], -along[0]])
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = one**2 * np.outer(along, along) + other**2 * np.outer(across, across)
    place = PlaceEstimate(x=0.0, y=0.0, heading=None, covariance=covariance, refined=True)
    longer, shorter, turned = place.ellipse(0.9)
    scale = math.sqrt(4.605170186)
    assert longer == pytest.approx(scale * max(one, other))
    assert shorter == pytest.approx(scale * min(one, other), rel=1e-5)
    if one > 1.01 * other:
        assert abs((turned - bearing + 90.0) % 180.0 - 90.0) < 1e-3
    assert place.sigma == pytest.approx(math.hypot(one, other) / math.sqrt(2.0))


@pytest.mark.parametrize("turn", [-170.0, 0.0, 63.0, 179.0])
def test_the_heading_is_found_with_its_uncertainty(turn: float) -> None:
    cell = int(CITY.lengths.argmax())
    query = CITY.signature(cell)
    assert query.bearings is not None
    seen = Signature(query.codes, (query.bearings - turn) % 360.0)
    sure = posterior(CITY, np.where(np.arange(len(CITY)) == cell, 0.0, -200.0))
    place = cell_estimate(seen, SHARP, sure, cell, radius=50.0, north_sigma=math.inf)
    assert place.heading is not None
    away = (place.heading - turn + 180.0) % 360.0 - 180.0
    expected = math.hypot(SHARP.bearing_sigma / math.sqrt(len(query)), 2.0 / math.sqrt(12.0))
    assert abs(away) < 2.0
    assert place.heading_sigma == pytest.approx(expected, rel=0.3)
    plain = place.to_dict()
    assert len(plain["covariance"]) == 3
    assert plain["heading_sigma"] == place.heading_sigma


def test_without_bearings_north_stays_unknown() -> None:
    blind = Signature(CITY.signature(0).codes, None)
    flat = posterior(CITY, np.zeros(len(CITY)))
    place = cell_estimate(blind, SHARP, flat, 0, radius=50.0, north_sigma=math.inf)
    assert place.heading is None
    assert len(place.to_dict()["covariance"]) == 2


def test_parts_around_the_answer_count() -> None:
    parts = Refinement(
        places=np.array([[0.0, 0.0], [4.0, 0.0], [90.0, 0.0]]),
        sizes=np.array([2.0, 2.0, 10.0]),
        loglik=np.zeros(3),
        headings=np.array([10.0, 14.0, 0.0]),
        heading_sigmas=np.ones(3),
        chances=np.array([0.1, 0.1, 0.8]),
        near=25.0,
    )
    place = refined_estimate(parts, (5.0, 5.0), radius=50.0, turned=True)
    assert place is not None
    assert (place.x, place.y, place.heading) == pytest.approx((2.0, 0.0, 12.0))
    assert place.covariance[0] == pytest.approx([4.0 + 4.0 / 12.0, 0.0, 4.0], abs=1e-3)
    assert place.heading_sigma == pytest.approx(math.sqrt(5.0), abs=1e-3)
    assert refined_estimate(parts, (500.0, 0.0), radius=50.0, turned=True) is None
