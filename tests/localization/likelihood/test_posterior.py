"""Chances of the cells: posteriors, priors, routes and answer rules."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
import rasterio
import shapely
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import random_database
from pyproj import CRS
from sentences import refused

from semsig_gis.core import CrsError, InputError
from semsig_gis.localization import (
    LOST,
    AnswerRule,
    KnownPosition,
    area_prior,
    calibrate,
    moved_chances,
    open_rule,
    position_prior,
    posterior,
    prior_ratio,
    raster_prior,
    route_posteriors,
    save_rule,
    weight_prior,
)
from semsig_gis.observation import Leg

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase

DATABASE = random_database(3, cells=120)
FLAT = np.zeros(len(DATABASE))
TINY_CHANCES = [0.0, 5e-324, 1e-310, 2.0**-1022, 1e-200, 1e-20, 0.25, 0.5]
LOGLIKS = st.integers(0, 10_000).map(
    lambda seed: np.random.default_rng(seed).choice([-40.0, -3.0, -2.0, 0.0], len(DATABASE))
)


@given(LOGLIKS, st.floats(-1e4, 1e4))
def test_chances_are_proportional_to_likelihood_times_prior(
    loglik: np.ndarray, shift: float
) -> None:
    prior = np.arange(1.0, len(DATABASE) + 1)
    weights = np.exp(loglik)
    chances = posterior(DATABASE, loglik + shift).chances
    assert chances == pytest.approx(weights / weights.sum(), rel=1e-6)
    both = posterior(DATABASE, loglik, log_prior=np.log(prior)).chances
    assert both == pytest.approx(weights * prior / (weights @ prior), rel=1e-6)


@given(LOGLIKS, st.sampled_from([0.0, 9.0, 10.0, 25.0, 50.0, 14.2]))
def test_the_mass_within_a_radius_is_a_sum_over_the_cells_in_it(
    loglik: np.ndarray, radius: float
) -> None:
    result = posterior(DATABASE, loglik)
    away = np.hypot(*(DATABASE.xy[:, None] - DATABASE.xy[None]).transpose(2, 0, 1))
    expected = (away <= radius + 1e-6) @ result.chances
    assert result.mass_within(radius) == pytest.approx(expected)
    some = np.array([5, 2, 77])
    assert result.mass_within(radius, some) == pytest.approx(expected[some])
    cell, mass = result.best_place(radius)
    assert [mass, expected[cell]] == pytest.approx([expected.max()] * 2, abs=2e-9)


@given(LOGLIKS, st.sampled_from([0.0, 10.0, 14.2, 25.0, 1e6]), st.integers(1, 200))
def test_places_are_circles_without_the_cells_of_earlier_ones(
    loglik: np.ndarray, radius: float, count: int
) -> None:
    result = posterior(DATABASE, loglik)
    places = result.places(count, radius=radius)
    away = np.hypot(*(DATABASE.xy[:, None] - DATABASE.xy[None]).transpose(2, 0, 1))
    left = result.chances.copy()
    for centre, cell, chance in zip(*(part.tolist() for part in places), strict=True):
        assert left[centre] > 0
        sums = (away <= radius + 1e-6) @ left
        assert [chance, sums[centre]] == pytest.approx([sums[left > 0].max()] * 2, abs=2e-9)
        own = away[centre] <= radius + 1e-6
        assert left[cell] == left[own].max()
        left[own] = 0.0
    assert places.chances.sum() <= 1.0 + 1e-9
    assert len(places.chances) == count or left.sum() == 0.0


@given(LOGLIKS, st.floats(0.01, 1.0))
def test_a_credible_region_is_the_smallest_with_its_share(loglik: np.ndarray, share: float) -> None:
    result = posterior(DATABASE, loglik)
    cells = result.credible_cells(share)
    chances = result.chances[cells]
    assert (np.diff(chances) <= 0).all()
    assert chances.sum() >= share * (1 - 1e-9)
    assert chances[:-1].sum() < share
    assert chances[-1] >= np.delete(result.chances, cells).max(initial=0.0)


def test_entropy_is_in_bits() -> None:
    loglik = np.full(len(DATABASE), -np.inf)
    loglik[3] = -700.0
    assert posterior(DATABASE, loglik).entropy == 0.0
    loglik[[4, 5, 6]] = -700.0
    assert posterior(DATABASE, loglik).entropy == pytest.approx(2.0)
    assert posterior(DATABASE, loglik).credible_cells(1.0).tolist() == [3, 4, 5, 6]


# --- Priors -----------------------------------------------------------------------------------

BOX = shapely.box(0.0, 0.0, 100.0, 100.0)
INSIDE = (DATABASE.xy <= 100.0).all(axis=1)


def test_an_area_prior_excludes_cells_outside() -> None:
    prior = area_prior(DATABASE, BOX)
    assert INSIDE.any()
    assert np.array_equal(np.isfinite(prior), INSIDE)
    assert len(np.unique(prior[INSIDE])) == 1
    degrees = gpd.GeoSeries([BOX], crs=DATABASE.crs).to_crs("EPSG:4326").iloc[0]
    assert np.array_equal(area_prior(DATABASE, degrees, crs="EPSG:4326"), prior)
    with refused(CrsError, "'EPSG:0' of the area"):
        area_prior(DATABASE, BOX, crs="EPSG:0")
    unsure = np.exp(area_prior(DATABASE, BOX, outside=0.2))
    assert (unsure[INSIDE].sum(), unsure[~INSIDE].sum()) == pytest.approx((0.8, 0.2))


def test_a_position_is_a_normal_density() -> None:
    chances = np.exp(position_prior(DATABASE, (50.0, 70.0), sigma=20.0))
    away = np.hypot(*(DATABASE.xy - [50.0, 70.0]).T)
    slow = np.exp(-0.5 * (away / 20.0) ** 2)
    assert chances == pytest.approx(slow / slow.sum())
    # As far as it may be, it excludes nothing by rounding.
    far = position_prior(DATABASE, (5.0, -3e4), sigma=1e4)
    assert np.isfinite(far).all()


DIAGONAL = replace(DATABASE, crs=CRS("+proj=tmerc +lat_0=45 +lon_0=45 +datum=WGS84"))
PARIS = replace(
    DATABASE,
    crs=CRS("+proj=tmerc +lat_0=48.9 +lon_0=2.3 +x_0=5e5 +y_0=5e5 +datum=WGS84"),
    grid=replace(DATABASE.grid, origin=(5e5, 5e5)),
)


@pytest.mark.parametrize(
    ("database", "text", "form"),
    [
        (PARIS, "500100,500050.5,20", "X,Y"),
        (PARIS, "500100 m, 500050.5 m, 20 m", "X,Y"),
        (PARIS, "48.9005,2.3005,20", "LAT,LON"),
        (PARIS, "2.3005, 48.9005, 20", "LON,LAT"),
        (PARIS, "48.9005°N,2.3005°E,20", "LAT,LON"),
        (PARIS, "2.3005e,48.9005n,20", "LON,LAT"),
        (DIAGONAL, "45.0005N,45.0005E,20", "LAT,LON"),
        (DIAGONAL, "45m,45m,20", "X,Y"),
    ],
)
def test_a_position_is_read_as_the_form_that_is_in_the_city(
    database: SignatureDatabase, text: str, form: str
) -> None:
    position = KnownPosition.parse(text, database)
    assert (position.read_as, position.sigma) == (form, 20.0)
    assert (database.xy.min(axis=0) <= [position.x, position.y]).all()
    assert (database.xy.max(axis=0) >= [position.x, position.y]).all()
    lat, lon = (45.0, 45.0) if database is DIAGONAL else (48.9, 2.3)
    assert (position.lat, position.lon) == pytest.approx((lat, lon), abs=3e-3)


@pytest.mark.parametrize(
    ("database", "text", "words"),
    [
        (DIAGONAL, "45.0005,45.0005,20", "as X,Y and LAT,LON and LON,LAT; write which"),
        (PARIS, "48.9005m,2.3005m,20", "neither as X,Y nor"),
        (PARIS, "48.9,-2.3,20", "neither as X,Y nor"),
        (PARIS, "48.9005S,2.3005E,20", "neither as X,Y nor"),
        (PARIS, "1e9,1e9,20", "neither as X,Y nor"),
        (PARIS, "48.9005N,2.3005,20", "LAT,LON,SIGMA in degrees or X,Y,SIGMA"),
        (PARIS, "48.9005N,2.3005S,20", "LAT,LON,SIGMA in degrees"),
        (PARIS, "48.9,2.3", "LAT,LON,SIGMA in degrees"),
        (PARIS, "48,9,2,3,20", "LAT,LON,SIGMA in degrees"),
        (PARIS, "4.8.9,2.3,20", "LAT,LON,SIGMA in degrees"),
        (PARIS, "48.9,2.3,far", "LAT,LON,SIGMA in degrees"),
        (PARIS, "nan,2.3,20", "LAT,LON,SIGMA in degrees"),
        (PARIS, "48.9,2.3,nan", "is nan; give a number from 0.01"),
    ],
)
def test_a_position_without_exactly_one_reading_in_the_city_is_refused(
    database: SignatureDatabase, text: str, words: str
) -> None:
    with refused(InputError, words):
        KnownPosition.parse(text, database)


@given(LOGLIKS, LOGLIKS)
def test_prior_ratio_equals_its_formula(
    loglik: NDArray[np.float64], log_prior: NDArray[np.float64]
) -> None:
    prior = np.exp(log_prior) / np.exp(log_prior).sum()
    expected = (prior * np.exp(loglik)).sum() / np.exp(loglik).mean()
    assert prior_ratio(loglik, log_prior) == pytest.approx(expected)
    assert prior_ratio(loglik, FLAT) == pytest.approx(1.0)
    nowhere = np.where(loglik == loglik.max(), -math.inf, 0.0)
    if np.isfinite(nowhere).any():
        assert 0 < prior_ratio(loglik * 1e4, nowhere) < 1e-300


def test_weights_and_priors_add_up() -> None:
    weights = np.arange(len(DATABASE), dtype=float)
    both = weight_prior(DATABASE, weights) + area_prior(DATABASE, BOX)
    chances = posterior(DATABASE, FLAT, log_prior=both).chances
    assert chances == pytest.approx(weights * INSIDE / (weights @ INSIDE))


def raster(folder: Path, values: object, *, west: float = 0.0, nodata: float | None = None) -> Path:
    """Write a raster of pixels of 100 m from the corner of the grid; the first row is southern."""
    bands = np.asarray(values, dtype=np.float64)[None, ::-1]
    path = folder / "raster.tif"
    options = {"driver": "GTiff", "count": 1, "dtype": "float64", "crs": "EPSG:2154"}
    shape = {"height": bands.shape[1], "width": bands.shape[2], "nodata": nodata}
    place = rasterio.Affine(100, 0, west, 0, -100, 100 * bands.shape[1])
    with rasterio.open(path, "w", transform=place, **options, **shape) as file:
        file.write(bands)
    return path


@pytest.mark.parametrize(
    ("values", "nodata", "weights"),
    [
        ([[1.0, 4.0], [0.0, 2.5]], None, [[1.0, 4.0], [0.0, 2.5]]),
        # Cells without data or beyond the edge get the least weight.
        ([[3.0, -1.0], [0.0, 8.0]], -1.0, [[3.0, 3.0], [0.0, 8.0]]),
        ([[6.0], [2.0]], None, [[6.0, 2.0], [2.0, 2.0]]),
    ],
)
def test_raster_values_are_weights_of_cells(
    tmp_path: Path, values: list[list[float]], nodata: float | None, weights: list[list[float]]
) -> None:
    chances = np.exp(raster_prior(DATABASE, raster(tmp_path, values, nodata=nodata)))
    column, row = (DATABASE.xy // 100).astype(int).T
    expected = np.array(weights)[row, column]
    assert chances == pytest.approx(expected / expected.sum())


@pytest.mark.parametrize(
    ("values", "west", "fault"),
    [
        ([[1.0]], 1e5, "has no data at any cell"),
        (np.zeros((2, 2)), 0.0, "excludes every cell"),
        ([[1.0, -2.0]], 0.0, "contains values from -2 to 1; give finite values, 0 or more"),
        ([[1.0, np.inf]], 0.0, "give finite values, 0 or more"),
        ([[0.0]], 0.0, "excludes every cell"),
    ],
)
def test_a_raster_without_usable_values_is_refused(
    tmp_path: Path, values: object, west: float, fault: str
) -> None:
    path = raster(tmp_path, values, west=west)
    with refused(InputError, fault):
        raster_prior(DATABASE, path)


# --- Routes -----------------------------------------------------------------------------------

legs = st.builds(
    Leg, dx=st.floats(-40, 40), dy=st.floats(-40, 40), sigma=st.sampled_from([0.0, 0.5, 4.0, 15.0])
)


def share(way: float, cells: int, sigma: float) -> float:
    """Integrate the chance to move by a number of cells of 10 m, as a sum of many steps."""
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
    for to, of in np.ndindex(30, 30):
        across = share(leg.dx, columns[to] - columns[of], leg.sigma)
        slow[to] += across * share(leg.dy, rows[to] - rows[of], leg.sigma) * chances[of]
    assert moved_chances(database, chances, leg) == pytest.approx(slow, abs=2e-4)


@given(st.integers(0, 99), st.lists(legs, min_size=0, max_size=3))
def test_smoothing_is_the_sum_over_all_routes(seed: int, ways: list[Leg]) -> None:
    database = random_database(seed, cells=6)
    logliks = np.random.default_rng(seed).normal(0, 3, (len(ways) + 1, 6))
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
        slow[range(len(route)), route] += weight
    posteriors = route_posteriors(database, list(logliks), ways)
    for result, expected in zip(posteriors, slow, strict=True):
        # The shares that are left out of a blur make a small difference.
        assert result.chances == pytest.approx(expected / expected.sum(), abs=2e-3)


def test_routes_of_one_view_and_out_of_the_city() -> None:
    loglik = np.random.default_rng(0).normal(0, 1, len(DATABASE))
    (result,) = route_posteriors(DATABASE, [loglik], [], log_prior=-loglik)
    assert result.chances == pytest.approx(1 / len(DATABASE))
    leg = Leg.towards(180.0, 1e6, sigma=1.0)
    assert (leg.dx, leg.dy, leg.sigma) == pytest.approx((0.0, -1e6, 1.0), abs=1e-6)
    away = route_posteriors(DATABASE, [FLAT, FLAT], [leg])
    assert all(view.chances.sum() == pytest.approx(1.0) for view in away)


# --- Whether to answer ------------------------------------------------------------------------


def queries(seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return chances and outcomes of an over-confident model."""
    rng = np.random.default_rng(seed)
    masses = np.where(rng.random(count) < 0.5, rng.beta(1, 5, count), rng.beta(20, 1, count))
    return masses, rng.random(count) < masses**1.3


def test_calibrated_rules_keep_their_precision() -> None:
    masses, correct = queries(99, 200_000)
    broken = 0
    for seed in range(150):
        rule = calibrate(*queries(seed, 1500), precision=0.95)
        answered = masses >= rule.threshold
        broken += bool(answered.any() and correct[answered].mean() < 0.95)
    assert broken / 150 <= 0.05 + 0.03
    assert rule.coverage > 0.2


def test_calibration_counts_match_the_threshold() -> None:
    masses, correct = queries(0, 2000)
    rule = calibrate(masses, correct, precision=0.9, radius=25.0)
    answered = masses >= rule.threshold
    counts = (2000, answered.sum(), (~correct[answered]).sum())
    assert (rule.queries, rule.answered, rule.wrong) == counts
    assert (rule.radius, rule.coverage) == (25.0, answered.mean())


def test_too_few_queries_give_no_threshold() -> None:
    rule = calibrate(np.ones(100), np.ones(100, bool))
    assert (rule.threshold, rule.answered, rule.answers(1.0)) == (math.inf, 0, False)
    assert calibrate(np.ones(217), np.ones(217, bool)).threshold == 1.0
    assert calibrate([], []).threshold == math.inf
    assert calibrate(np.ones(500), np.zeros(500, bool)).threshold == math.inf
    # Equal chances are answered together.
    assert calibrate(np.full(1000, 0.9), np.arange(1000) < 600).threshold == math.inf


def test_a_rule_decides_on_a_posterior() -> None:
    chances = posterior(DATABASE, np.where(np.arange(len(DATABASE)) == 7, 0.0, -50.0))
    answer = AnswerRule(threshold=0.9).decide(chances)
    assert answer.given
    assert (answer.cell, [answer.x, answer.y]) == (7, DATABASE.xy[7].tolist())
    assert answer.mass == pytest.approx(1.0)
    assert not AnswerRule(threshold=1.1).decide(chances).given


@pytest.mark.parametrize("threshold", [0.75, math.inf])
def test_a_rule_is_saved_and_opened(tmp_path: Path, threshold: float) -> None:
    count = np.int64(10)
    rule = AnswerRule(threshold=threshold, queries=count, answered=5, wrong=1)  # type: ignore[arg-type]
    save_rule(rule, tmp_path / "rule.json")
    assert open_rule(tmp_path / "rule.json") == rule
    assert math.isnan(AnswerRule(threshold=0.5).coverage)


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"threshold": "a"}', '{"threshold": 1, "more": 2}']
)
def test_damaged_rules_are_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "rule.json").write_text(text)
    with refused(InputError, "answer rule", "rule.json"):
        open_rule(tmp_path / "rule.json")
    with refused(InputError, "none.json", "No such file"):
        open_rule(tmp_path / "none.json")


@given(st.integers(0, 10_000), st.integers(1, len(DATABASE)))
def test_the_likeliest_cells_are_those_of_a_sort(seed: int, count: int) -> None:
    chances = np.random.default_rng(seed).choice(TINY_CHANCES, len(DATABASE))
    order = np.argsort(-chances, kind="stable")
    rows = replace(posterior(DATABASE, FLAT), chances=chances).likeliest(count)
    assert chances[rows].tolist() == chances[order[:count]].tolist()
    assert len(set(rows.tolist())) == count
