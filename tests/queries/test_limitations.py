from __future__ import annotations

from math import inf, nan, sqrt
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sentences import assert_sentence
from sights import CITY, all_round, assert_rate, away, many, rows, seeds, sights

from semsig_gis.core.errors import InputError, UnknownNameError
from semsig_gis.queries.distortions import CompassBias, FieldOfView, MissingClasses

if TYPE_CHECKING:
    from semsig_gis.queries.sight import Sight

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


@pytest.mark.parametrize("sigma", [-1.0, nan, inf])
def test_a_compass_that_is_none(sigma: float) -> None:
    with pytest.raises(InputError) as caught:
        CompassBias(sigma=sigma)
    assert_sentence(caught.value, str(sigma), "0 or more")


@pytest.mark.parametrize("degrees", [0.0, -5.0, 360.5, nan])
def test_a_view_that_is_none(degrees: float) -> None:
    with pytest.raises(InputError) as caught:
        FieldOfView(degrees=degrees)
    assert_sentence(caught.value, str(degrees), "at most 360")


def test_a_class_that_the_city_does_not_have() -> None:
    with pytest.raises(UnknownNameError) as caught:
        MissingClasses(classes=("bench", "street_lihgt")).ready(CITY)
    assert_sentence(caught.value, "'street_lihgt'", "nearest is 'street_light'")
