from __future__ import annotations

from math import degrees, inf, nan, sqrt
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import mixtures, noise_specs
from scipy.stats import poisson
from sentences import assert_sentence
from sights import CITY, CLASSES, REACH, assert_rate, away, many, rows, seeds, sights

from semsig_gis.core.errors import InputError, UnknownNameError
from semsig_gis.likelihood.noise.model import NoiseMixture, NoiseSpec, named_noise
from semsig_gis.likelihood.noise.table import LONGEST_TABLE, noise_tables
from semsig_gis.queries.distortions import Detector

if TYPE_CHECKING:
    from semsig_gis.likelihood.noise.model import Noise
    from semsig_gis.likelihood.noise.table import NoiseTable
    from semsig_gis.queries.sight import Sight

TRIALS = 4000
PERFECT = NoiseSpec(detection=1.0, misnamed=0.0, clutter=0.0, bearing_sigma=1e-9)
NAMES = {1: "alignment_tree", 3: "street_light", 4: "indicator", 5: "traffic_light", 10: "bench"}


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


def test_half_of_the_objects_are_left_at_half() -> None:
    spoil = Detector(noise=PERFECT, half=20.0).ready(CITY)
    rng = np.random.default_rng(4)
    shares = [len(spoil(many(TRIALS, distance=d), rng)) / TRIALS for d in (0.0, 20.0, 30.0)]
    assert shares == pytest.approx([1.0, 0.5, 0.21], abs=0.03)


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


@pytest.mark.parametrize("half", [0.0, -3.0, nan])
def test_distances_that_are_refused(half: float) -> None:
    with pytest.raises(InputError) as caught:
        Detector(noise=PERFECT, half=half)
    assert_sentence(caught.value, str(half), "above 0")
    assert Detector(noise=PERFECT).half == inf


def test_a_model_that_names_a_class_of_another_city() -> None:
    with pytest.raises((InputError, UnknownNameError)) as caught:
        Detector(noise=NoiseSpec(detection_by_class={"bnech": 0.5})).ready(CITY)
    assert_sentence(caught.value, "'bnech'", "nearest is 'bench'")
