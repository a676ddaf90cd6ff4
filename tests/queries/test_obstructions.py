from __future__ import annotations

from math import atan, degrees, exp, inf, nan, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sentences import assert_sentence
from sights import CITY, REACH, all_round, assert_rate, many, rows, seeds, sight, sights

from semsig_gis.core.errors import InputError
from semsig_gis.core.geometry import angular_distance
from semsig_gis.queries.distortions import BlockedSectors, HiddenBehind, Obstacles
from semsig_gis.queries.sight import Sight

RNG = np.random.default_rng(0)


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


@given(one=sights, width=st.floats(0.0, 5.0))
def test_what_is_not_hidden_hides_nothing_more(one: Sight, width: float) -> None:
    spoil = HiddenBehind(width=width).ready(CITY)
    once = spoil(one, RNG)
    assert rows(spoil(once, RNG)) == rows(once)
    wider = HiddenBehind(width=2.0 * width + 0.1).ready(CITY)(one, RNG)
    assert set(rows(wider)) <= set(rows(once))
    if len(one):
        assert one.distances.min() in once.distances  # nothing hides the nearest
    if width == 0.0:
        assert rows(once) == rows(one)


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


def test_an_obstacle_hides_the_far_side_alone() -> None:
    ring = sight([(3, float(b), d) for b in range(0, 360, 2) for d in (1.0, 29.0)])
    spoil = Obstacles(count=4.0, width=6.0).ready(CITY)
    lost_far = lost_near = 0
    for seed in range(60):
        seen = spoil(ring, np.random.default_rng(seed))
        near = {row[1] for row in rows(seen) if row[2] == 1.0}
        far = {row[1] for row in rows(seen) if row[2] == 29.0}
        assert far <= near  # whatever hides the near one hides what is behind it
        lost_near += 180 - len(near)
        lost_far += 180 - len(far)
    assert lost_far > 20 * lost_near


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


@pytest.mark.parametrize("wrong", [-1.0, nan, inf])
def test_numbers_that_are_refused(wrong: float) -> None:
    for make in (
        lambda: HiddenBehind(width=wrong),
        lambda: Obstacles(count=wrong),
        lambda: Obstacles(width=wrong),
        lambda: BlockedSectors(degrees=wrong),
    ):
        with pytest.raises(InputError) as caught:
            make()
        assert_sentence(caught.value, str(wrong))
    with pytest.raises(InputError, match="-1 sectors"):
        BlockedSectors(count=-1)
