"""Tests of the chance that a view is from elsewhere, and of how well it fits its best place."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from noisy_cells import NOTHING, random_database
from worlds import CODES, random_town

from semsig_gis.core import WILDCARD, Signature
from semsig_gis.evaluation import QuerySpec, SimulatedDetector, draw_queries
from semsig_gis.localization import (
    LikelihoodLocator,
    NoiseSpec,
    background_loglik,
    build_index,
    evidence_ratio,
    goodness_of_fit,
    locate,
    locate_in_areas,
    locate_route,
    named_noise,
    posterior,
    route_posteriors,
    weight_prior,
)
from semsig_gis.observation import Leg, Photo, View

CITY = random_town().database
NOISE = named_noise("by-hand")
INDEX = build_index(CITY, NOISE)
LONGEST = int(CITY.lengths.argmax())
FEW = build_index(random_database(1, classes=3), named_noise("light"))
KINDS = FEW.database.present_codes.tolist()


def view_of(codes: list[int], bearings: list[float] | None = None) -> Signature:
    return Signature(
        np.array(codes, np.uint8), None if bearings is None else np.array(bearings, np.float64)
    )


def test_the_chances_of_all_places_and_of_elsewhere_add_up_to_one() -> None:
    rng = np.random.default_rng(0)
    for cell in rng.choice(len(CITY), 5).tolist():
        location = locate(INDEX, CITY.signature(cell), top=len(CITY))
        assert 0 < location.elsewhere < 1
        total = location.candidates["chance"].sum() + location.elsewhere
        assert total == pytest.approx(1.0, abs=1e-6)
    assert locate(INDEX, CITY.signature(0), surely_here=True).elsewhere == 0.0


def test_the_evidence_is_the_mean_likelihood() -> None:
    rng = np.random.default_rng(1)
    loglik, other = rng.normal(-40.0, 3.0, (2, len(CITY)))
    prior = weight_prior(CITY, rng.random(len(CITY))) + 3.0
    here = posterior(CITY, loglik)
    assert here.log_evidence == pytest.approx(math.log(np.exp(loglik).mean()))
    weights = np.exp(prior) / np.exp(prior).sum()
    evidence = posterior(CITY, loglik, log_prior=prior).log_evidence
    assert evidence == pytest.approx(math.log(weights @ np.exp(loglik)))
    # Two views from one place.
    stay = Leg(dx=0.0, dy=0.0, sigma=0.0)
    for view in route_posteriors(CITY, [loglik, other], [stay], log_prior=prior):
        both = weights @ np.exp(loglik + other)
        assert view.log_evidence == pytest.approx(math.log(both), abs=1e-3)


def test_a_street_elsewhere_shows_some_number_of_each_class() -> None:
    # The chances of all numbers by class of n objects add up to that of n objects.
    for size in range(1, 5):
        total = 0.0
        for codes in itertools.combinations_with_replacement(KINDS, size):
            counted = background_loglik(FEW, view_of(list(codes)))
            total += math.exp(counted)
            # The density of the bearings, over all ways to number the objects.
            bearings = np.linspace(0.0, 300.0, size).tolist()
            repeats = sum(math.lgamma(codes.count(code) + 1) for code in KINDS)
            density = background_loglik(FEW, view_of(list(codes), bearings))
            assert density + size * math.log(360.0) - repeats == pytest.approx(counted)
        assert total == pytest.approx((10 / 11) ** size / 11)
        unknown = background_loglik(FEW, view_of([WILDCARD] * size))
        assert math.exp(unknown) == pytest.approx(total)


def test_views_with_sectors_and_ranges_have_a_likelihood_elsewhere() -> None:
    view = View.of(view_of([KINDS[0], WILDCARD], [10.0, 50.0]))
    whole = background_loglik(FEW, view)
    part = replace(view, photos=(Photo(sectors=((0.0, 90.0),)),))
    # Two objects in a quarter of the turn: of mean 2.5 objects there.
    numbers = [2 * math.log(mean / (1 + mean)) - math.log(1 + mean) for mean in (10.0, 2.5)]
    expected = whole + numbers[1] - numbers[0] + 2 * math.log(4.0)
    assert background_loglik(FEW, part) == pytest.approx(expected)
    ranged = replace(view, ranges=np.array([FEW.table.scale.reach, math.nan]))
    assert background_loglik(FEW, ranged) == pytest.approx(whole + math.log(2.0))


def test_rough_bearings_fit_where_exact_ones_do_not() -> None:
    view = View.of(INDEX.database.signature(0)).turned(25.0)
    rough = replace(view, bearing_errors=np.full(len(view), 26.0))
    exact_fit, rough_fit = (goodness_of_fit(INDEX, each, 0, [0.0]) for each in (view, rough))
    assert exact_fit is not None
    assert rough_fit is not None
    assert exact_fit < 0.2 < rough_fit
    assert INDEX.scores(rough).loglik[0] > INDEX.scores(view).loglik[0]


def test_views_without_objects_say_nothing() -> None:
    for views in ([NOTHING], [NOTHING, NOTHING]):
        assert evidence_ratio(INDEX, views, -3.0) == 0.0
    assert locate(INDEX, NOTHING).elsewhere == 0.5
    # Nor does a view of nothing but classes that the map lacks.
    poor = build_index(random_town(codes=CODES[1:]).database, NOISE)
    assert locate(poor, view_of(CODES[:1], [20.0])).elsewhere == 0.5


@pytest.mark.parametrize("north_sigma", [0.0, math.inf])
def test_views_of_another_city_are_recognized(north_sigma: float) -> None:
    city, other = (random_town(seed, count=150).database for seed in (1, 2))
    noise = NoiseSpec(detection=0.9, misnamed=0.02, clutter=0.3, bearing_sigma=3.0)
    locator = LikelihoodLocator(index=build_index(city, noise), north_sigma=north_sigma)
    spec = QuerySpec(number=60, distortions=(SimulatedDetector(noise=noise),))
    chances = []
    for observed_city in (city, other):
        queries = [query.asked for query in draw_queries(city, spec, city=observed_city)]
        views = [sight.signature for sight in queries if len(sight) > 7]
        chances.append(np.array([locator.locate(view).elsewhere for view in views]))
        assert len(views) > 15
    own, foreign = chances
    assert (own[:, None] < foreign).mean() > 0.9
    assert np.median(own) < 0.05
    assert np.median(foreign) > 0.5


@pytest.mark.parametrize("surely_here", [False, True])
def test_a_view_is_located_in_several_cities(surely_here: bool) -> None:  # noqa: FBT001
    cities = [random_town(seed, count=150).database for seed in (1, 2, 3)]
    locators = [LikelihoodLocator(index=build_index(city, NOISE), top=5000) for city in cities]
    query = cities[1].signature(int(cities[1].lengths.argmax()))
    locations, elsewhere = locate_in_areas(locators, [query] * 3, surely_here=surely_here)
    total = sum(location.candidates["chance"].sum() for location in locations)
    assert total + elsewhere == pytest.approx(1.0, abs=1e-6)
    assert (elsewhere == 0.0) == surely_here
    assert [location.answer.given for location in locations] == [False, True, False]
    # In one city, the answer is that of the locator.
    (single,), elsewhere = locate_in_areas(locators[1:2], [query])
    assert elsewhere == pytest.approx(single.elsewhere)
    assert single.elsewhere == pytest.approx(locators[1].locate(query).elsewhere)
    # Without objects, cities share the chance of a view from any of them.
    locations, elsewhere = locate_in_areas(locators, [NOTHING] * 3)
    assert elsewhere == pytest.approx(0.5)
    assert [location.elsewhere for location in locations] == pytest.approx([5 / 6] * 3)


def test_a_route_is_from_one_area() -> None:
    views = [CITY.signature(LONGEST)] * 2
    stay = Leg(dx=0.0, dy=0.0, sigma=1.0)
    single = locate(INDEX, views[0]).elsewhere
    first, last = locate_route(INDEX, views, [stay])
    assert first.elsewhere == last.elsewhere < single
    first, last = locate_route(INDEX, views, [stay], surely_here=True)
    assert first.elsewhere == last.elsewhere == 0.0


def test_simulated_views_fit_their_place_evenly() -> None:
    spec = QuerySpec(number=150, distortions=(SimulatedDetector(noise=NOISE),))
    queries = [query for query in draw_queries(CITY, spec) if len(query.asked) > 2]
    fits = np.array(
        [goodness_of_fit(INDEX, query.asked.signature, query.cell, [0.0]) for query in queries],
        np.float64,
    )
    assert 0.35 < fits.mean() < 0.65
    assert (fits < 0.01).mean() < 0.06
    assert (fits > 0.9).mean() < 0.25


def test_a_view_fits_its_own_place_and_no_other() -> None:
    view = CITY.signature(LONGEST)
    fit = goodness_of_fit(INDEX, view, LONGEST, [0.0])
    assert fit is not None
    assert fit > 0.3
    shortest = int(CITY.lengths.argmin())
    assert goodness_of_fit(INDEX, view, shortest, [0.0]) == 0.0
    # A turned view fits with its heading.
    turned = View.of(view).turned(40.0)
    assert goodness_of_fit(INDEX, turned, LONGEST, [0.0]) != pytest.approx(fit, abs=0.05)
    assert goodness_of_fit(INDEX, turned, LONGEST, [-40.0]) == pytest.approx(fit, abs=0.05)
    # Objects in a sector are compared with that sector.
    half = View.of(view).select(np.asarray(view.bearings) < 180.0)
    half = replace(half, photos=(Photo(sectors=((0.0, 180.0),)),))
    assert (goodness_of_fit(INDEX, half, LONGEST, [0.0]) or 0.0) > 0.1
    unknown = replace(View.of(view), codes=None)
    assert (goodness_of_fit(INDEX, unknown, LONGEST, [0.0]) or 0.0) > 0.1


def test_a_view_without_bearings_or_objects_has_no_fit() -> None:
    for view in (NOTHING, view_of(KINDS)):
        assert goodness_of_fit(INDEX, view, 0, [0.0]) is None
    assert locate(INDEX, NOTHING).fit is None
