from __future__ import annotations

from math import atan, degrees, exp, pi, sqrt
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import mixtures, noise_specs
from scipy.stats import poisson
from sights import CITY, CLASSES, REACH, all_round, assert_rate, away, many, rows, seeds, sights

from semsig_gis.core.geometry import angular_distance
from semsig_gis.likelihood.noise.model import NoiseMixture, NoiseSpec, named_noise
from semsig_gis.likelihood.noise.table import LONGEST_TABLE, noise_tables
from semsig_gis.queries.distortions import (
    BlockedSectors,
    CompassBias,
    Detector,
    FieldOfView,
    HiddenBehind,
    MissingClasses,
    Obstacles,
)
from semsig_gis.queries.sight import Sight

if TYPE_CHECKING:
    from semsig_gis.likelihood.noise.model import Noise
    from semsig_gis.likelihood.noise.table import NoiseTable

RNG = np.random.default_rng(0)
TRIALS = 4000
PERFECT = NoiseSpec(detection=1.0, misnamed=0.0, clutter=0.0, bearing_sigma=1e-9)
NAMES = {1: "alignment_tree", 3: "street_light", 5: "traffic_light", 10: "bench"}


@given(one=sights, seed=seeds)
def test_a_compass_turns_all_objects_alike(one: Sight, seed: int) -> None:
    there = CompassBias(sigma=30.0).ready(CITY)(one, np.random.default_rng(seed))
    assert sorted(there.distances.tolist()) == sorted(one.distances.tolist())
    back = there.turned(there.heading)
    found = sorted(zip(back.distances, back.codes, strict=True))
    assert found == sorted(zip(one.distances, one.codes, strict=True))
    assert np.allclose(
        np.sort(np.cos(np.radians(back.bearings))), np.sort(np.cos(np.radians(one.bearings)))
    )


@settings(max_examples=30)
@given(sigma=st.floats(0.5, 40.0), seed=seeds)
def test_moments_of_a_compass(sigma: float, seed: int) -> None:
    spoil = CompassBias(sigma=sigma).ready(CITY)
    rng = np.random.default_rng(seed)
    off = np.array([away(spoil(many(2), rng).bearings, 90.0) for _ in range(1500)])
    assert (off[:, 0] == off[:, 1]).all()  # the same for all objects of a query
    if sigma < 30.0:  # else some are turned by more than half a turn
        assert abs(off[:, 0].mean()) < 6 * sigma / sqrt(1500)
        assert abs(off[:, 0].std() / sigma - 1.0) < 6 / sqrt(2 * 1500)


@given(one=sights, names=st.sets(st.sampled_from(sorted(NAMES.values()))), seed=seeds)
def test_missing_and_known_share_the_objects_out(one: Sight, names: set[str], seed: int) -> None:
    rng = np.random.default_rng(seed)
    missing = MissingClasses(classes=tuple(names)).ready(CITY)(one, rng)
    known = MissingClasses(classes=tuple(names), others=True).ready(CITY)(one, rng)
    assert rows(missing) == [row for row in rows(one) if NAMES[row[0]] not in names]
    assert rows(known) == [row for row in rows(one) if NAMES[row[0]] in names]


@given(degrees=st.floats(1.0, 360.0), one=sights, seed=seeds)
def test_a_view_holds_what_fits_in_its_angle(degrees: float, one: Sight, seed: int) -> None:
    there = FieldOfView(degrees=degrees).ready(CITY)(one, np.random.default_rng(seed))
    kept = rows(there)
    assert kept == [row for row in rows(one) if row in kept]
    if len(kept) > 1:
        gaps = np.diff([*there.bearings, there.bearings[0] + 360.0])
        assert gaps.max() >= 360.0 - degrees - 1e-6  # the part of the turn that is out of view
    if degrees == 360.0:
        assert kept == rows(one)


@settings(max_examples=30)
@given(degrees=st.floats(5.0, 360.0), seed=seeds)
def test_each_object_is_in_view_as_often_as_the_view_is_wide(degrees: float, seed: int) -> None:
    spoil = FieldOfView(degrees=degrees).ready(CITY)
    rng = np.random.default_rng(seed)
    shown = sum(len(spoil(many(1, bearing=200.0), rng)) for _ in range(1000))
    assert_rate(shown, 1000, degrees / 360.0)
    # Of objects all round, just the width of the view is shown every time.
    assert abs(len(spoil(all_round(3600), rng)) - 10.0 * degrees) <= 1.5


@given(one=sights, width=st.floats(0.0, 5.0))
def test_hidden_behind_nearer_objects(one: Sight, width: float) -> None:
    seen = HiddenBehind(width=width).ready(CITY)(one, RNG)
    expected = [
        (code, bearing, distance)
        for code, bearing, distance in rows(one)
        if not any(
            near < distance
            and angular_distance(bearing, other) < degrees(atan(width / 2 / max(near, 0.01)))
            for _, other, near in rows(one)
        )
    ]
    assert rows(seen) == expected


@given(one=sights, seed=seeds)
def test_obstacles_only_take_away(one: Sight, seed: int) -> None:
    rng = np.random.default_rng(seed)
    seen = rows(Obstacles(count=3.0).ready(CITY)(one, rng))
    assert seen == [row for row in rows(one) if row in seen]
    assert rows(Obstacles(count=0.0).ready(CITY)(one, rng)) == rows(one)
    assert rows(Obstacles(count=9.0, width=0.0).ready(CITY)(one, rng)) == rows(one)


@settings(max_examples=30)
@given(
    count=st.floats(0.2, 5.0), width=st.floats(0.5, 8.0), distance=st.floats(5.0, 30.0), seed=seeds
)
def test_how_often_obstacles_hide(count: float, width: float, distance: float, seed: int) -> None:
    # The chance of one obstacle, over its distance r with density 2 r / R^2: atan(w / 2r) / pi.
    middles = (np.arange(20_000) + 0.5) * (distance / 20_000)
    one = (np.arctan(width / 2 / middles) / pi * 2 * middles / REACH**2).mean() * distance
    spoil = Obstacles(count=count, width=width).ready(CITY)
    rng = np.random.default_rng(seed)
    shown = sum(len(spoil(many(1, distance=distance), rng)) for _ in range(1500))
    assert_rate(shown, 1500, exp(-count * one))


@settings(max_examples=30)
@given(count=st.integers(0, 6), width=st.floats(1.0, 359.0), seed=seeds)
def test_how_often_sectors_are_blocked(count: int, width: float, seed: int) -> None:
    spoil = BlockedSectors(count=count, degrees=width).ready(CITY)
    rng = np.random.default_rng(seed)
    shown = sum(len(spoil(many(1), rng)) for _ in range(1200))
    assert_rate(shown, 1200, (1.0 - width / 360.0) ** count)
    left = len(spoil(all_round(3600), rng)) / 10.0
    assert left >= 360.0 - count * width - 1.0 * count - 0.2
    if count == 1:
        assert left == pytest.approx(360.0 - width, abs=0.2)


@given(one=sights, seed=seeds)
def test_distance_does_not_matter_to_a_sector(one: Sight, seed: int) -> None:
    spoil = BlockedSectors(count=2, degrees=60.0).ready(CITY)
    seen = spoil(one, np.random.default_rng(seed))
    flat = Sight(codes=one.codes, bearings=one.bearings, distances=np.zeros(len(one)))
    assert spoil(flat, np.random.default_rng(seed)).bearings.tolist() == seen.bearings.tolist()


def table_of(noise: Noise) -> NoiseTable:
    (table, *_), _ = noise_tables(
        noise, taxonomy=CITY.taxonomy, codes=CITY.codes, longest=LONGEST_TABLE
    )
    return table


@given(one=sights, noise=mixtures(), half=st.floats(1.0, 100.0), seed=seeds)
def test_invariants(one: Sight, noise: Noise, half: float, seed: int) -> None:
    before = rows(one)
    spoil = Detector(noise=noise, half=half).ready(CITY)
    seen = spoil(one, np.random.default_rng(seed))
    assert set(seen.codes.tolist()) <= set(CLASSES)
    assert ((seen.bearings >= 0) & (seen.bearings < 360)).all()
    assert (np.diff(seen.bearings) >= 0).all()
    assert (seen.distances >= 0).all()
    assert seen.heading == one.heading
    assert rows(spoil(one, np.random.default_rng(seed))) == rows(seen)
    assert rows(one) == before


@given(noise=noise_specs(), code=st.sampled_from(CLASSES), seed=seeds)
def test_detection_naming_and_bearings_are_those_of_the_model(
    noise: NoiseSpec, code: int, seed: int
) -> None:
    table = table_of(noise)
    kind = int(table.row_of[code])
    seen = Detector(noise=noise).ready(CITY)(
        many(TRIALS, code=code, distance=17.0), np.random.default_rng(seed)
    )
    true = seen.only(seen.distances == 17.0)  # false objects seem to be anywhere else
    assert_rate(len(true), TRIALS, 1.0 - table.missed[LONGEST_TABLE, kind])
    for name, chance in zip(table.codes, table.named[LONGEST_TABLE, kind], strict=True):
        assert_rate(int((true.codes == name).sum()), len(true), float(min(chance, 1.0)))
    sigma = float(table.sigma[kind])
    off = np.exp(1j * np.radians(true.bearings - 90.0)).mean() if len(true) else 1.0
    # The mean direction of a wrapped normal is exp(-sigma^2 / 2) long.
    expected = np.exp(-(np.radians(sigma) ** 2) / 2.0)
    assert abs(off - expected) < 6.0 / sqrt(max(len(true), 1))


@settings(max_examples=25)
@given(noise=noise_specs(), seed=seeds)
def test_false_objects_are_those_of_the_model(noise: NoiseSpec, seed: int) -> None:
    table = table_of(noise)
    spoil = Detector(noise=noise).ready(CITY)
    rng = np.random.default_rng(seed)
    found = [spoil(many(0), rng) for _ in range(600)]
    for code, mean in zip(table.codes, table.clutter, strict=True):
        count = sum(int((one.codes == code).sum()) for one in found)
        # Poisson, too, with the mean of all: neither tail is unheard of.
        assert min(poisson.cdf(count, 600 * mean), poisson.sf(count - 1, 600 * mean)) > 1e-9
    bearings = np.concatenate([one.bearings for one in found])
    if len(bearings) > 50:
        assert abs(np.exp(1j * np.radians(bearings)).mean()) < 6.0 / sqrt(len(bearings))


@given(half=st.floats(3.0, 60.0), distance=st.floats(0.0, REACH), seed=seeds)
def test_detection_falls_with_distance(half: float, distance: float, seed: int) -> None:
    spoil = Detector(noise=PERFECT, half=half).ready(CITY)
    seen = spoil(many(TRIALS, distance=distance), np.random.default_rng(seed))
    nearby = 1.0 - float(table_of(PERFECT).missed[LONGEST_TABLE, 1])
    chance = nearby * 0.5 ** ((distance / half) ** 2)
    # Hardly a false object in a thousand signatures.
    true = int((seen.distances == distance).sum())
    assert_rate(true, TRIALS, chance)


def test_a_class_may_be_worse_than_another() -> None:
    noise = NoiseSpec(
        detection=0.9, detection_by_class={"bench": 0.3}, misnamed=0.0, clutter=0.0,
        bearing_sigma_by_class={"bench": 20.0},
    )  # fmt: skip
    spoil = Detector(noise=noise).ready(CITY)
    rng = np.random.default_rng(9)
    benches, lamps = (spoil(many(TRIALS, code=code), rng) for code in (10, 3))
    assert_rate(len(benches), TRIALS, 0.3)
    assert_rate(len(lamps), TRIALS, 0.9)
    assert away(benches.bearings, 90.0).std() == pytest.approx(20.0, rel=0.1)
    assert away(lamps.bearings, 90.0).std() == pytest.approx(5.0, rel=0.1)


def test_a_step_aside_turns_near_objects_most() -> None:
    noise = NoiseSpec(
        detection=1.0, misnamed=0.0, clutter=0.0, bearing_sigma=1e-9, position_sigma=0.5
    )
    spoil = Detector(noise=noise).ready(CITY)
    rng = np.random.default_rng(1)
    for distance in (5.0, 25.0):
        bearings = np.concatenate(
            [spoil(many(1, distance=distance), rng).bearings for _ in range(TRIALS)]
        )
        sigma = degrees(0.5 / distance)
        turned = away(bearings, 90.0)
        turned = turned[np.abs(turned) < 8.0 * sigma]  # a few objects are false
        assert turned.std() == pytest.approx(sigma, rel=0.08)
        assert abs(turned.mean()) < 6 * sigma / sqrt(TRIALS)


def test_of_a_mixture_one_model_makes_a_query() -> None:
    blind = NoiseSpec(detection=0.05, misnamed=0.0, clutter=0.0)
    sharp = NoiseSpec(detection=1.0, misnamed=0.0, clutter=0.0)
    both = NoiseMixture(specs=(blind, sharp), weights=(0.25, 0.75))
    spoil = Detector(noise=both).ready(CITY)
    rng = np.random.default_rng(2)
    shares = np.array([len(spoil(many(200), rng)) / 200 for _ in range(800)])
    assert ((shares < 0.2) | (shares > 0.9)).all()
    assert_rate(float((shares > 0.9).sum()), 800, 0.75)


def test_the_levels_of_the_paper_lose_objects_by_number() -> None:
    # Of few objects, seven errors leave a smaller share than of many.
    spoil = Detector(noise=named_noise("medium")).ready(CITY)
    rng = np.random.default_rng(3)
    few, lots = (
        np.mean([(spoil(many(n), rng).distances == 10.0).sum() / n for _ in range(600)])
        for n in (4, 40)
    )
    assert few == pytest.approx((1 - 1 / 4) ** (7 / 3), abs=0.05)
    assert lots == pytest.approx((1 - 1 / 40) ** (7 / 3), abs=0.02)
