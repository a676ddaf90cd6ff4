from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import database_of, noisy_town, parts_of, random_database, turned_query
from sentences import assert_sentence
from worlds import CODES, CORNER, World, random_town

from semsig_gis.core import InputError, ObjectIndex, Signature
from semsig_gis.database import ObjectStore, visible_objects_at
from semsig_gis.localization import (
    AnswerRule,
    NoiseSpec,
    PlaceEstimate,
    Posterior,
    Refinement,
    build_index,
    cell_estimate,
    cell_noise,
    locate,
    locate_route,
    locate_versions,
    named_noise,
    place_noise,
    position_prior,
    posterior,
    refine,
    refined_estimate,
)
from semsig_gis.observation import Leg, Photo, View

if TYPE_CHECKING:
    from semsig_gis.objects import StreetObjects

WORLD = random_town()
CITY = WORLD.database
STORE = ObjectStore.of(WORLD.street_objects)
GENERIC = named_noise("generic")
INDEX = build_index(CITY, GENERIC)
WIDE = build_index(CITY, cell_noise(named_noise("generic"), 10.0))
LONG = np.argsort(-CITY.lengths, kind="stable")[:20].tolist()
CELLS = random_database(3)
SHARP = NoiseSpec(detection=0.95, misnamed=0.02, clutter=0.5, bearing_sigma=3.0)
PLACE = CORNER + np.array([103.0, 97.0])
FROM_ELSEWHERE = "The view may not be from this area: chance 35 %"
OF_VIEWS = "of 1,000 simulated views from there."


def seen_from(xy: np.ndarray, *, objects: StreetObjects = STORE.objects) -> Signature:
    """Return the objects visible from a place, without errors."""
    view = visible_objects_at(objects, xy[None], index=ObjectIndex(objects.xy), radius=30.0)
    return Signature(view.codes, view.bearings)


def test_omissions_of_a_person_hardly_count_against_a_place() -> None:
    marked = CELLS.taxonomy.encode("DBH"), np.array([20.0, 140.0, 260.0])
    street = "DDDDBDDDDHDD", [*range(20, 81, 20), *range(140, 281, 20)]
    crossing = "DBH", [33.0, 127.0, 273.0]
    database = database_of([street, crossing])
    chances = {
        name: locate(build_index(database, named_noise(name)), Signature(*marked)).chances[0]
        for name in ("by-hand", "generic", "medium")
    }
    assert chances["by-hand"] > 0.9
    assert max(chances["generic"], chances["medium"]) < 0.5


def test_long_signatures_are_located() -> None:
    right = 0
    for cell in LONG:
        location = locate(INDEX, CITY.signature(cell), top=5)
        right += int(np.hypot(*(CITY.xy[cell] - [location.answer.x, location.answer.y])) <= 50)
        chances = location.candidates["chance"].to_numpy()
        assert (np.diff(chances) <= 1e-9).all()
        assert 0 < chances.sum() <= 1 + 1e-9
        assert location.candidates["rank"].tolist() == [1, 2, 3, 4, 5]
    assert right >= len(LONG) - 1


def test_a_view_from_elsewhere_lowers_the_chances_of_all_places() -> None:
    location = locate(INDEX, CITY.signature(LONG[0]), surely_here=True)
    assert location.answer.given
    assert (location.elsewhere, location.doubt) == (0.0, "")
    doubted = location.doubted(0.6, 0.002)
    assert not doubted.answer.given
    assert doubted.answer.mass == pytest.approx(0.4 * location.answer.mass)
    for name in ("chance", "cell_chance"):
        assert doubted.columns[name] == pytest.approx(0.4 * location.columns[name])
    assert doubted.candidates["chance"].sum() <= 0.4 + 1e-9
    # Chances of cells and the region are those of a view from here.
    assert np.array_equal(doubted.chances, location.chances)
    assert doubted.region_text == "90 % region, if it is from this area: 1 cell, 100 m², in 1 place"
    plain = json.loads(json.dumps(doubted.to_dict(), allow_nan=False))
    assert [plain[name] for name in ("answered", "elsewhere", "fit")] == [False, 0.6, 0.002]
    assert plain["place"]["chance"] == doubted.answer.mass
    assert plain["doubt"] == doubted.doubt
    assert plain["doubt_parts"] == {"elsewhere": 0.6, "worse_than": 998}
    assert "doubt The view may not be from this area" in repr(doubted)
    assert location.doubted(0.05).answer.given


@pytest.mark.parametrize(
    ("elsewhere", "fit", "sentence"),
    [
        (0.0, None, ""),
        (0.0999, 0.01, ""),
        (0.1, None, "The view may not be from this area: chance 10 %."),
        (0.998, 0.5, "The view may not be from this area: chance over 99 %."),
        (0.0, 0.0, f"The view fits the best place badly: worse than 1,000 {OF_VIEWS}"),
        (0.35, 0.002, f"{FROM_ELSEWHERE}; it fits the best place worse than 998 {OF_VIEWS}"),
    ],
)
def test_a_sentence_states_the_doubts(elsewhere: float, fit: float | None, sentence: str) -> None:
    assert locate(INDEX, CITY.signature(LONG[0])).doubted(elsewhere, fit).doubt == sentence


def test_the_region_is_counted_in_distinct_places() -> None:
    # A line of equal cells 10 m apart; a place has at most eleven of them.
    street, long_street = (
        locate(build_index(database, GENERIC), database.signature(0), surely_here=True)
        for database in (database_of([("D", [20.0])] * cells) for cells in (330, 1200))
    )
    assert street.region_places == 0.9 * 330 / 11
    assert street.region_text == "90 % region: 297 cells, 29,700 m², in 27 places"
    assert long_street.region_places is None
    assert long_street.region_text == "90 % region: 1,080 cells, 0.108 km², in many places"
    sure = locate(INDEX, CITY.signature(LONG[0]))
    assert sure.region_places == 1
    assert sure.region_text.endswith(", in 1 place")


def test_the_answer_depends_on_prior_and_rule() -> None:
    cell = LONG[0]
    query = Signature(parts_of(CITY.signature(cell))[0][:1], None)
    anywhere = locate(INDEX, query)
    assert not anywhere.answer.given
    near = position_prior(CITY, tuple(CITY.xy[cell].tolist()), sigma=10.0)
    rule = AnswerRule(threshold=0.5)
    there = locate(INDEX, query, log_prior=near, rule=rule, surely_here=True)
    assert there.answer.given
    assert there.posterior.entropy < anywhere.posterior.entropy
    assert not locate(INDEX, query, log_prior=near, rule=AnswerRule(threshold=1.5)).answer.given


def test_a_prior_that_contradicts_the_view_gives_a_note() -> None:
    cell = LONG[0]
    farthest = int(np.hypot(*(CITY.xy - CITY.xy[cell]).T).argmax())
    query, places = CITY.signature(cell), CITY.xy[[cell, farthest]]
    right, wrong = (position_prior(CITY, (x, y), sigma=10.0) for x, y in places.tolist())
    facts = {"near": "the lamp"}
    location, misled = (
        locate(WIDE, query, log_prior=prior, known=facts) for prior in (right, wrong)
    )
    assert location.prior_ratio is not None
    assert location.prior_ratio > 1
    assert not location.notes
    assert location.to_dict()["prior"] == {"near": "the lamp", "ratio": location.prior_ratio}
    assert misled.prior_ratio is not None
    assert misled.prior_ratio < 0.01
    assert "the prior and the view disagree: the view is" in misled.notes[0]
    assert locate(WIDE, query).to_dict()["prior"] is None
    # A route is one view of the place that it begins at.
    views = locate_route(WIDE, [query], [], log_prior=wrong)
    assert views[0].prior_ratio == pytest.approx(misled.prior_ratio, rel=1e-6)


def test_refinement_finds_places_between_the_viewpoints() -> None:
    errors = np.empty((12, 2))
    for trial, xy in enumerate(CORNER + np.random.default_rng(1).uniform(40, 160, (12, 2))):
        for refined in (False, True):
            location = locate(WIDE, seen_from(xy), store=STORE, refined=refined, explained=1)
            errors[trial, int(refined)] = math.dist(xy, (location.estimate.x, location.estimate.y))
            assert location.estimate.refined == refined
            assert location.posterior.chances.sum() == pytest.approx(1.0)
            assert (np.diff(location.candidates["chance"]) <= 1e-9).all()
    plain, close = np.median(errors, axis=0)
    assert close < 1.0 < plain < 8.0


@settings(max_examples=15, deadline=None)
@given(st.sampled_from(LONG), st.tuples(st.floats(-5, 5), st.floats(-5, 5)), st.integers(2, 20))
def test_the_likeliest_cells_are_divided_as_if_all_were(
    cell: int, away: tuple[float, float], most: int
) -> None:
    query = seen_from(CITY.xy[cell] + np.array(away))
    query = query.select(np.arange(min(most, len(query))))
    if not len(query):
        return
    plain = locate(WIDE, query, surely_here=True)
    location = locate(WIDE, query, store=STORE, refined=True, surely_here=True)
    cells = plain.posterior.likeliest(len(CITY))
    parts = refine(
        query,
        CITY.xy[cells],
        place_noise(WIDE.noise, CITY.grid.step),
        store=STORE,
        step=CITY.grid.step,
        radius=CITY.spec.radius,
        log_prior=np.log(plain.chances[cells]) - plain.loglik[cells],
    )
    # At most a thousand cells are divided; the others keep their chances.
    chances = plain.chances.copy()
    divided = np.unique(cells[parts.cells])
    sums = np.bincount(cells[parts.cells], parts.chances, len(CITY))
    chances[divided] = sums[divided] * chances[divided].sum()
    assert location.chances == pytest.approx(chances, abs=0.01)
    oracle = Posterior(database=CITY, chances=chances).best_place()
    assert location.chance == pytest.approx(oracle[1], abs=0.01)


def test_explanations_name_the_street_objects() -> None:
    query = seen_from(PLACE)
    for refined in (False, True):
        location = locate(WIDE, query, store=STORE, refined=refined, explained=3)
        assert len(location.explanations) == 3
        best, first = location.explanations[0], location.candidates.iloc[0]
        assert math.dist(best.xy, first[["x", "y"]]) <= 5.0 * math.sqrt(2.0)
        assert best.counts["matched"] == len(query)
        rows = best.table[best.table["verdict"] == "matched"]
        ids = rows["source_id"].astype(int).to_numpy()
        assert (STORE.objects.codes[ids] == query.codes).all()
    explanation = locate(WIDE, query, explained=1).explanations[0]
    assert explanation.table["source_id"].isna().all()
    assert explanation.counts["matched"] > len(query) // 2


@pytest.mark.parametrize("north_sigma", [0.0, math.inf])
def test_a_class_that_no_cell_sees_is_not_used(north_sigma: float) -> None:
    absent = CODES[0]
    sees_none = np.add.reduceat(CITY.codes == absent, CITY.offsets[:-1]) == 0
    city = CITY.select(sees_none)
    index = build_index(city, named_noise("generic"))
    plain = city.signature(int(city.lengths.argmax()))
    far = Signature(np.array([absent], np.uint8), np.array([33.0]))
    codes, bearings = parts_of(plain)
    query = Signature(np.append(codes, absent), np.append(bearings, 33.0))
    options: Any = {"north_sigma": north_sigma, "explained": 1}
    location, expected = (locate(index, view, **options) for view in (query, plain))
    assert np.array_equal(location.chances, expected.chances)
    assert location.query is query
    (note,) = location.notes
    assert note.startswith("the map has no ")
    assert note.endswith(", so this object was not used.")
    assert location.explanations[0].to_dict() == expected.explanations[0].to_dict()
    assert not expected.notes
    # In a route and between the viewpoints as well.
    for views in zip(
        *(locate_route(index, [view, view], [Leg(dx=0.0, dy=0.0)]) for view in (query, plain)),
        strict=True,
    ):
        assert np.array_equal(*(view.chances for view in views))
    nothing = Signature(np.empty(0, np.uint8), np.empty(0))
    empty_location, far_location = (locate(index, view, **options) for view in (nothing, far))
    assert np.array_equal(empty_location.chances, far_location.chances)
    assert not empty_location.answer.given
    assert empty_location.explanations == ()
    json.dumps(
        [location.to_dict(), empty_location.to_dict(), far_location.to_dict()], allow_nan=False
    )


def test_a_turned_query_is_located_with_its_heading() -> None:
    query = turned_query(seen_from(PLACE), -70.0)
    options: Any = {"north_sigma": math.inf, "store": STORE, "explained": 1}
    location = locate(WIDE, query, **options)
    assert location.candidates["heading"][0] == pytest.approx(70.0, abs=5.0)
    location = locate(WIDE, query, **options, refined=True)
    place = location.estimate
    assert math.dist((place.x, place.y), PLACE) < 2.0
    assert place.heading == pytest.approx(70.0, abs=3.0 * place.heading_sigma)
    headings = [location.candidates["heading"][0], location.explanations[0].heading]
    assert headings == pytest.approx([70.0, 70.0], abs=10.0)


def test_buildings_hide_objects_behind_them() -> None:
    east, north = PLACE.tolist()
    wall = shapely.box(east + 4.0, north - 40.0, east + 8.0, north + 40.0)
    houses = gpd.GeoDataFrame(geometry=[wall], crs="EPSG:2154")
    built_with = build_index(replace(CITY, occlusion=0.5), cell_noise(named_noise("generic"), 10.0))
    store = ObjectStore.of(WORLD.street_objects, footprints=houses)
    free, picture, walled = (
        locate(index, seen_from(PLACE), store=store, refined=True, explained=1).explanations[0]
        for index, store in ((WIDE, STORE), (WIDE, store), (built_with, store))
    )
    assert (picture.xy, picture.loglik) == (
        free.xy,
        free.loglik,
    )  # of a database without buildings, they are only drawn
    assert math.dist(free.xy, PLACE) < 1.0
    assert math.dist(walled.xy, PLACE) > 3.0  # half of the query would be hidden here
    assert walled.loglik < free.loglik - 3.0


def test_a_route_is_more_certain_than_one_view() -> None:
    start, way = LONG[0], np.array([20.0, 0.0])
    (after,) = np.flatnonzero((CITY.xy == CITY.xy[start] + way).all(axis=1)).tolist()
    poor = Signature(*(part[:2] for part in parts_of(CITY.signature(start))))
    legs = [Leg(dx=20.0, dy=0.0, sigma=1.0)] * 2
    nothing = Signature(np.empty(0, np.uint8), np.empty(0))
    views = [poor, CITY.signature(after), nothing]
    for refined in (False, True):
        options: Any = {"store": STORE, "refined": refined, "explained": 1}
        single = locate(WIDE, poor, **options)
        first, _, last = locate_route(WIDE, views, legs, **options)
        assert first.posterior.chances[start] > single.posterior.chances[start]
        assert math.dist((first.estimate.x, first.estimate.y), CITY.xy[start]) < 12.0
        assert math.dist((last.estimate.x, last.estimate.y), CITY.xy[start] + 2 * way) < 15.0
        assert [len(location.explanations) for location in (first, last)] == [1, 0]
        assert not last.estimate.refined


def test_a_database_of_one_cell_is_answered() -> None:
    database = CITY.select(slice(0, 1))
    index = build_index(database, cell_noise(named_noise("generic"), 10.0))
    for refined in (False, True):
        options: dict[str, Any] = {"store": STORE, "refined": refined, "surely_here": True}
        location = locate(index, database.signature(0), explained=3, **options)
        assert location.answer.given
        assert location.posterior.chances == pytest.approx([1.0])
        assert math.dist((location.estimate.x, location.estimate.y), database.xy[0]) < 8.0
        assert location.region.tolist() == [0]


@pytest.mark.parametrize("north_sigma", [0.0, math.inf])
def test_a_query_longer_than_any_signature_is_scored(north_sigma: float) -> None:
    rng = np.random.default_rng(0)
    query = Signature(rng.choice(CITY.present_codes, 200), np.sort(rng.uniform(0, 360, 200)))
    location = locate(WIDE, query, north_sigma=north_sigma, store=STORE, refined=True, explained=1)
    assert np.isfinite(location.candidates["loglik"]).all()
    assert location.explanations[0].counts["false"] > 150


def test_a_location_converts_to_plain_values_and_points() -> None:
    location = locate(INDEX, CITY.signature(LONG[0]), top=4, explained=2)
    plain = json.loads(json.dumps(location.to_dict(), allow_nan=False))
    assert plain["cells"] == len(CITY)
    assert plain["answered"] == location.answer.given
    assert len(plain["candidates"]) == 4
    table = location.candidates
    assert location.loglik[table["cell"]].tolist() == table["loglik"].to_list()
    explained = ["explanation" in candidate for candidate in plain["candidates"]]
    assert explained == [True, True, False, False]
    place = plain["place"]
    assert place["within_m"] == 50.0
    assert [place["x"], place["y"]] == [location.estimate.x, location.estimate.y]
    assert place["chance"] == location.answer.mass
    assert place["heading"] is None
    assert np.shape(place["covariance"]) == (2, 2)
    assert place["lon"] == pytest.approx(3.8, abs=1.0)
    assert location.to_geodataframe().crs == CITY.crs
    assert location.region_km2 == pytest.approx(len(location.region) * 1e-4)
    assert location.posterior.chances[location.region].sum() >= 0.9 - 1e-9
    assert plain["elsewhere"] == location.elsewhere < 1e-9
    assert plain["fit"] == location.fit
    assert not plain["doubt"]
    assert plain["region"]["text"] == location.region_text
    # A rule without answers has plain values as well.
    location = locate(INDEX, CITY.signature(LONG[0]), rule=AnswerRule(threshold=math.inf))
    plain = json.loads(json.dumps(location.to_dict(), allow_nan=False))
    assert (plain["threshold"], plain["answered"]) == (None, False)


@given(st.integers(0, 99), st.integers(0, 39), st.sampled_from([10.0, 30.0, 500.0]))
def test_the_estimate_is_the_mean_over_the_cells(seed: int, cell: int, radius: float) -> None:
    chances = np.random.default_rng(seed).dirichlet(np.full(len(CELLS), 0.3))
    distribution = Posterior(database=CELLS, chances=chances)
    blind = Signature(CELLS.signature(0).codes, None)  # without information on north
    place = cell_estimate(blind, SHARP, distribution, cell, radius=radius, north_sigma=math.inf)
    inside = np.hypot(*(CELLS.xy - CELLS.xy[cell]).T) <= radius + 1e-9
    weights = chances[inside] / chances[inside].sum()
    mean = weights @ CELLS.xy[inside]
    assert (place.x, place.y) == pytest.approx(tuple(mean), abs=1e-6)
    away = CELLS.xy[inside] - mean
    spread = (weights[:, None] * away).T @ away + np.eye(2) * 100.0 / 12.0
    assert place.covariance[:2, :2] == pytest.approx(spread, abs=1e-6)
    assert place.heading is None
    assert place.covariance[2].tolist() == [0.0, 0.0, 0.0]


@given(st.floats(0.1, 30.0), st.floats(0.1, 30.0), st.floats(0.0, 179.0))
def test_the_ellipse_contains_its_share(first: float, second: float, bearing: float) -> None:
    angle = math.radians(bearing)
    along = np.array([math.sin(angle), math.cos(angle)])
    across = np.array([along[1], -along[0]])
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = first**2 * np.outer(along, along) + second**2 * np.outer(across, across)
    place = PlaceEstimate(x=0.0, y=0.0, heading=None, covariance=covariance, refined=True)
    longer, shorter, turned = place.ellipse(0.9)
    scale = math.sqrt(4.605170186)
    assert longer == pytest.approx(scale * max(first, second))
    assert shorter == pytest.approx(scale * min(first, second), rel=1e-5)
    if first > 1.01 * second:
        assert abs((turned - bearing + 90.0) % 180.0 - 90.0) < 1e-3
    assert place.sigma == pytest.approx(math.hypot(first, second) / math.sqrt(2.0))


@pytest.mark.parametrize("turn", [-170.0, 0.0, 63.0, 179.0])
def test_the_heading_is_estimated_with_its_uncertainty(turn: float) -> None:
    cell = int(CELLS.lengths.argmax())
    query = turned_query(CELLS.signature(cell), -turn)
    sure = posterior(CELLS, np.where(np.arange(len(CELLS)) == cell, 0.0, -200.0))
    place = cell_estimate(query, SHARP, sure, cell, radius=50.0, north_sigma=math.inf)
    assert place.heading is not None
    away = (place.heading - turn + 180.0) % 360.0 - 180.0
    expected = math.hypot(SHARP.bearing_sigma / math.sqrt(len(query)), 2.0 / math.sqrt(12.0))
    assert abs(away) < 2.0
    assert place.heading_sigma == pytest.approx(expected, rel=0.3)
    plain = place.to_dict()
    assert len(plain["covariance"]) == 3
    assert plain["heading_sigma"] == place.heading_sigma


# --- Between the viewpoints -------------------------------------------------------------------


def parts(places: np.ndarray, headings: list[float], chances: list[float]) -> Refinement:
    """Return parts of two metres with headings that are exact to one degree."""
    count = len(places)
    return Refinement(
        cells=np.arange(count),
        places=places,
        sizes=np.full(count, 2.0),
        loglik=np.zeros(count),
        headings=np.array(headings),
        heading_sigmas=np.ones(count),
        chances=np.array(chances),
        near=25.0,
    )


def test_only_parts_around_the_answer_are_averaged() -> None:
    places = np.array([[0.0, 0.0], [4.0, 0.0], [90.0, 0.0]])
    refinement = parts(places, [10.0, 14.0, 0.0], [0.1, 0.1, 0.8])
    place = refined_estimate(refinement, (5.0, 5.0), radius=50.0, turned=True)
    assert place is not None
    assert (place.x, place.y, place.heading) == pytest.approx((2.0, 0.0, 12.0))
    assert place.covariance[0] == pytest.approx([4.0 + 4.0 / 12.0, 0.0, 4.0], abs=1e-3)
    assert place.heading_sigma == pytest.approx(math.sqrt(5.0), abs=1e-3)
    assert refined_estimate(refinement, (500.0, 0.0), radius=50.0, turned=True) is None


def test_headings_are_averaged_over_north() -> None:
    refinement = parts(np.zeros((2, 2)), [-179.0, 179.0], [0.5, 0.5])
    assert abs(refinement.heading) == pytest.approx(180.0)
    assert refinement.covariance[2, 2] == pytest.approx(2.0)


def detected(world: World, xy: np.ndarray, seed: int) -> Signature:
    """Return the detections of a good detector at a place."""
    codes, bearings = parts_of(seen_from(xy, objects=world.street_objects))
    rng = np.random.default_rng(seed)
    noise = rng.normal(0.0, SHARP.bearing_sigma, len(codes))
    hits = rng.random(len(codes)) < SHARP.detection
    return Signature(codes[hits], ((bearings + noise) % 360.0)[hits])


def refined(query: Signature, world: World, **options: Any) -> Refinement:  # noqa: ANN401
    store = ObjectStore.of(world.street_objects, footprints=options.pop("footprints", None))
    cells = options.pop("cells", world.database.xy)
    return refine(query, cells, SHARP, store=store, **options)


def test_refined_places_are_within_their_uncertainty() -> None:
    errors, inside, masses = [], [], []
    for seed in range(12):
        world = noisy_town(seed)
        xy = CORNER + np.random.default_rng([seed, 1]).uniform(50, 150, 2)
        refinement = refined(detected(world, xy, seed), world)
        away = np.array(refinement.xy) - xy
        errors.append(float(np.hypot(*away)))
        inside.append(away @ np.linalg.inv(refinement.covariance[:2, :2]) @ away < 9.21)
        masses.append(refinement.mass)
        assert refinement.chances.sum() == pytest.approx(1.0)
        assert refinement.covariance[2, 2] == 0.0
    assert np.median(errors) < 1.5
    assert max(errors) < 5.0
    assert np.mean(inside) > 0.8  # 0.99 but for chance and clipped numbers
    assert min(masses) > 0.9


@pytest.mark.parametrize("north_sigma", [10.0, math.inf])
def test_refined_headings_are_within_their_uncertainty(north_sigma: float) -> None:
    world = noisy_town(3)
    xy = CORNER + np.array([103.0, 98.0])
    query = turned_query(detected(world, xy, 3), -12.0)
    headings = np.full(len(world.database), 10.0)
    refinement = refined(query, world, north_sigma=north_sigma, headings=[headings])
    away = np.array([*(np.array(refinement.xy) - xy), refinement.heading - 12.0])
    assert away @ np.linalg.inv(refinement.covariance) @ away < 16.3  # 99.9 %
    assert refinement.heading == pytest.approx(12.0, abs=6.0)
    assert math.sqrt(np.trace(refinement.covariance[:2, :2])) < 5.0
    assert 0.0 < refinement.covariance[2, 2] < 30.0


def test_refinement_uses_prior_and_buildings() -> None:
    world = World(((0.0, 10.0, CODES[0]), (1000.0, 10.0, CODES[0])))
    query = Signature(np.array([CODES[0]]), np.array([1.0]))
    find = partial(refined, query, world, cells=np.array([[0.0, 0.0], [1000.0, 0.0]]))
    assert find().mass == pytest.approx(0.5, abs=1e-4)
    likely = find(log_prior=np.log([0.1, 0.9]))
    assert likely.mass == pytest.approx(0.9, abs=1e-4)
    assert likely.xy[0] == pytest.approx(1000.0, abs=5.0)
    houses = [shapely.box(-20.0, 6.0, 20.0, 8.0)]
    hidden = find(footprints=gpd.GeoDataFrame(geometry=houses, crs=world.street_objects.crs))
    assert hidden.xy[0] == pytest.approx(1000.0, abs=5.0)
    assert hidden.mass > 0.9


def test_parts_fill_the_cells() -> None:
    world = noisy_town(5)
    cells = world.database.xy[:7]
    refinement = refined(detected(world, CORNER + 100.0, 5), world, cells=cells)
    assert (refinement.sizes**2).sum() == pytest.approx(7 * 100.0)
    assert np.abs(refinement.places[:, None] - cells).max(axis=2).min(axis=1).max() < 5.0


def test_many_detections_almost_without_clutter_do_not_overflow() -> None:
    bearings = np.linspace(0.0, 315.0, 8)
    database = database_of([("DDDDDDDD", bearings.tolist()), ("D", [10.0])])
    noise = NoiseSpec(detection=0.999, clutter=0.0, bearing_sigma=0.5)
    view = View(np.full(8, 3), bearings, ranges=np.full(8, 11.8), range_errors=np.full(8, 0.05))
    loglik = build_index(database, noise).scores(view).loglik
    assert np.isfinite(loglik).all()
    assert loglik[0] > loglik[1] + 90.0


@pytest.mark.parametrize("north_sigma", [0.0, 10.0, math.inf])
def test_hundreds_of_objects_almost_without_misses_do_not_underflow(
    north_sigma: float,
) -> None:
    bearings = np.linspace(0.0, 359.0, 200)
    database = database_of([("D" * 200, bearings.tolist()), ("DB", [10.0, 20.0])])
    noise = NoiseSpec(detection=0.999, clutter=1.0)
    query = database.signature(0).select(np.arange(0, 200, 2))
    loglik = build_index(database, noise).scores(query, north_sigma=north_sigma).loglik
    assert np.isfinite(loglik).all()


def test_versions_are_mixed_by_their_evidence() -> None:
    first, second = CITY.signature(LONG[0]), CITY.signature(LONG[1])
    each = [locate(WIDE, query) for query in (first, second)]
    weights = [0.3, -0.2]
    evidence = np.array([answer.posterior.log_evidence for answer in each]) + weights
    shares = np.exp(evidence - np.logaddexp.reduce(evidence))
    mixed = locate_versions(WIDE, [first, second], log_weights=weights, top=3)
    assert mixed.versions == pytest.approx(shares.tolist())
    expected = shares[0] * each[0].chances + shares[1] * each[1].chances
    assert mixed.chances == pytest.approx(expected)
    assert mixed.query is (first, second)[int(shares.argmax())]
    assert mixed.answer.mass <= max(answer.answer.mass for answer in each)
    # Equal versions are one version.
    same, single = locate_versions(WIDE, [first, first]), locate(WIDE, first)
    assert same.versions == pytest.approx((0.5, 0.5))
    assert same.chances == pytest.approx(single.chances)
    assert same.elsewhere == pytest.approx(single.elsewhere)
    # A prior and refined places go with them.
    prior = position_prior(CITY, tuple(CITY.xy[LONG[0]]), sigma=50.0)
    options: dict[str, Any] = {"store": STORE, "refined": True, "log_prior": prior}
    same = locate_versions(WIDE, [first, first], **options)
    single = locate(WIDE, first, **options)
    assert same.prior_ratio == pytest.approx(single.prior_ratio)
    assert (same.estimate.x, same.estimate.y) == pytest.approx(
        (single.estimate.x, single.estimate.y)
    )


# Numbers of a view that it refuses, and the least and greatest that it takes.
REFUSED = [-math.inf, -3.0, 1e-308, 1e-30, 1e9, math.inf]
BEARING = st.sampled_from([0.0, 10.0, 10.0, 190.0, 359.9])
RANGE = st.sampled_from([math.nan, 0.01, 12.0, 6000.0])
RANGE_ERROR = st.sampled_from([math.nan, 0.001, 3.0])
BEARING_ERROR = st.sampled_from([math.nan, 0.001, 180.0])
SEEN = st.tuples(st.sampled_from([*CODES, 0]), BEARING, RANGE, RANGE_ERROR, BEARING_ERROR)


@settings(max_examples=20)
@given(
    st.lists(SEEN, min_size=1, max_size=4),
    st.none() | st.tuples(st.integers(1, 4), st.sampled_from(REFUSED)),
    st.sampled_from([None, 0.0, 0.001, 360.0, math.inf]),
    st.sampled_from([0.001, 1.0, 90.0, 360.0]),
)
def test_view_of_any_numbers_is_refused_or_answered_with_chances(
    rows: list[tuple[float, ...]],
    bad: tuple[int, float] | None,
    north: float | None,
    width: float,
) -> None:
    columns = np.array(rows).T
    if bad is not None:
        columns[bad[0], 0] = bad[1]
    codes, bearings, ranges, range_errors, bearing_errors = columns
    photo = Photo(sectors=() if width == 360.0 else ((10.0, 10.0 + width),), north_sigma=north)
    try:
        view = View(
            codes.astype(np.uint8),
            bearings,
            ranges=ranges,
            range_errors=range_errors,
            bearing_errors=bearing_errors,
            photos=(photo,),
        )
    except InputError as error:
        assert_sentence(error)
        assert bad is not None
        return
    answer = locate(INDEX, view, refined=False, explained=0)
    assert np.isfinite(answer.chances).all()
    assert json.dumps(answer.to_dict(), allow_nan=False)
