from __future__ import annotations

from collections import Counter
from dataclasses import replace
from math import erfc, sqrt
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from sights import CITY, CLASSES, REACH, paper_errors, seeds, sights

from semsig_gis.core.signature import Signature
from semsig_gis.queries.distortions import DISTORTIONS, Distortion, distort, named_distortion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.queries.distortions import FalseClass
    from semsig_gis.queries.sight import Sight

QUIET = Distortion(occurrences=0, bearing_sigma=0.0)
WEIGHTS = [4, 3, 2, 1]


def signature(codes: list[int], bearings: Sequence[float] | None = None) -> Signature:
    places = np.linspace(0, 350, len(codes)) if bearings is None else np.array(bearings, float)
    return Signature(codes=np.array(codes, np.uint8), bearings=places)


def parts(one: Signature) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    assert one.codes is not None
    assert one.bearings is not None
    return one.codes, one.bearings


def distorted(
    one: Signature,
    how: Distortion,
    seed: int | np.random.Generator = 0,
    *,
    classes: Sequence[int] = CLASSES,
    weights: Sequence[float] | None = WEIGHTS,
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Return codes and bearings after a distortion."""
    rng = np.random.default_rng(seed)
    return parts(distort(one, how, classes=classes, weights=weights, rng=rng))


def test_the_levels_of_the_paper() -> None:
    levels = {"none": 0, "light": 1, "medium": 7, "strong": 13}
    assert {name: one.occurrences for name, one in DISTORTIONS.items()} == levels
    for name, one in DISTORTIONS.items():
        noise = (one.bearing_sigma, one.bearing_clip)
        assert noise == ((0.0, 30.0) if name == "none" else (5.0, 30.0))
    assert named_distortion("light") is DISTORTIONS["light"]


@given(one=sights, how=paper_errors, seed=seeds)
def test_invariants(one: Sight, how: Distortion, seed: int) -> None:
    before = [part.tolist() for part in parts(one.signature)]
    codes, bearings = distorted(one.signature, how, seed)
    assert abs(len(codes) - len(one)) <= how.occurrences
    assert codes.dtype == np.uint8
    assert set(codes.tolist()) <= set(CLASSES)
    assert ((bearings >= 0) & (bearings < 360)).all()
    if how.resort:
        assert (np.diff(bearings) >= 0).all()
    again = distorted(one.signature, how, seed)
    assert [part.tolist() for part in again] == [codes.tolist(), bearings.tolist()]
    assert [part.tolist() for part in parts(one.signature)] == before
    none = distorted(one.signature, DISTORTIONS["none"], seed)
    assert [part.tolist() for part in none] == before


@given(one=sights, seed=seeds)
def test_order_kept_or_sorted_again_hold_the_same_objects(one: Sight, seed: int) -> None:
    kept, again = (
        distorted(one.signature, replace(DISTORTIONS["strong"], resort=resort), seed)
        for resort in (False, True)
    )
    assert sorted(zip(*kept, strict=True)) == sorted(zip(*again, strict=True))


@given(one=sights, how=paper_errors, seed=seeds)
def test_objects_keep_their_distances(one: Sight, how: Distortion, seed: int) -> None:
    seen = how.ready(CITY)(one, np.random.default_rng(seed))
    codes, bearings = distorted(one.signature, how, seed, weights=CITY.frequencies.tolist())
    assert seen.codes.tolist() == codes.tolist()
    assert seen.bearings.tolist() == bearings.tolist()
    assert ((seen.distances >= 0) & (seen.distances <= REACH)).all()
    lost = Counter(one.distances.tolist()) - Counter(seen.distances.tolist())
    false = Counter(seen.distances.tolist()) - Counter(one.distances.tolist())
    assert lost.total() + false.total() <= how.occurrences
    if how.occurrences == 0:
        assert sorted(seen.distances.tolist()) == sorted(one.distances.tolist())


def test_kept_order_is_that_before_the_noise() -> None:
    one = signature([1, 3, 5, 10], [10, 11, 12, 359])
    noise = replace(QUIET, bearing_sigma=40.0, resort=False)
    for seed in range(20):
        assert distorted(one, noise, seed)[0].tolist() == [1, 3, 5, 10]


def test_a_false_object_stands_where_its_bearing_belongs() -> None:
    false_only = replace(QUIET, occurrences=6, resort=False)
    for seed in range(50):
        _, bearings = distorted(signature([1, 1, 1], [10, 120, 240]), false_only, seed)
        assert (np.diff(bearings) >= 0).all()


def test_ties_keep_their_order_when_sorted_again() -> None:
    assert distorted(signature([3, 1, 3, 5], [7, 7, 7, 7]), QUIET)[0].tolist() == [3, 1, 3, 5]


def test_the_three_operations_are_equally_likely() -> None:
    one = signature([1, 3, 1, 3, 5])
    rng = np.random.default_rng(5)
    once = replace(QUIET, occurrences=1)
    trials = 6000
    counts = {-1: 0, 0: 0, 1: 0}
    changed_places = np.zeros(len(one))
    for _ in range(trials):
        codes, bearings = distorted(one, once, rng)
        difference = len(codes) - len(one)
        counts[difference] += 1
        if difference == 0:
            assert bearings.tolist() == parts(one)[1].tolist()
            changed = codes != parts(one)[0]
            assert changed.sum() == 1  # a false classification always changes the class
            changed_places += changed
    spread = sqrt(trials * 2 / 9)
    assert all(abs(count - trials / 3) < 4 * spread for count in counts.values())
    share = counts[0] / len(one)
    assert (np.abs(changed_places - share) < 4 * sqrt(share)).all()


@pytest.mark.parametrize(
    ("false_class", "shares"),
    [("uniform", [0.25, 0.25, 0.25, 0.25]), ("frequency", [0.4, 0.3, 0.2, 0.1])],
)
def test_classes_and_bearings_of_false_objects(
    false_class: FalseClass, shares: list[float]
) -> None:
    # Operations that find no object are idle, so the signature grows and shrinks; count what
    # one occurrence on nothing invents.
    once = replace(QUIET, occurrences=1, false_class=false_class)
    rng = np.random.default_rng(11)
    drawn = [distorted(signature([]), once, rng) for _ in range(9000)]
    invented = np.concatenate([codes for codes, _ in drawn])
    bearings = np.concatenate([angles for _, angles in drawn])
    assert abs(len(invented) - 3000) < 4 * sqrt(9000 * 2 / 9)
    for code, share in zip(CLASSES, shares, strict=True):
        mean = len(invented) * share
        assert abs((invented == code).sum() - mean) < 4 * sqrt(mean * (1 - share))
    quadrants = np.bincount((bearings // 90).astype(int), minlength=4) / len(bearings)
    assert np.abs(quadrants - 0.25).max() < 4 * sqrt(0.25 * 0.75 / len(bearings))


def test_false_classes_by_frequency_leave_the_true_one_out() -> None:
    how = replace(QUIET, occurrences=1, false_class="frequency")
    rng = np.random.default_rng(2)
    drawn = [
        distorted(signature([1]), how, rng, classes=[1, 3, 5], weights=[98, 1.5, 0.5])[0]
        for _ in range(3000)
    ]
    renamed = np.array([codes[0] for codes in drawn if len(codes) == 1])
    assert set(renamed.tolist()) == {3, 5}
    assert abs((renamed == 3).mean() - 0.75) < 4 * sqrt(0.75 * 0.25 / len(renamed))


def test_without_another_class_a_false_classification_changes_nothing() -> None:
    how = replace(QUIET, occurrences=5)
    alone, _ = distorted(signature([3, 3, 3]), how, 1, classes=[3], weights=None)
    by_frequency = replace(how, false_class="frequency")
    unseen, _ = distorted(signature([3, 3, 3]), by_frequency, 1, classes=[3, 5], weights=[1, 0])
    assert set(alone.tolist()) | set(unseen.tolist()) <= {3}


def noise_of(how: Distortion, bearing: float, seed: int) -> NDArray[np.float64]:
    """Return what is added to 40,000 equal bearings."""
    one = Signature(codes=np.ones(40_000, np.uint8), bearings=np.full(40_000, bearing))
    return (distorted(one, replace(how, resort=False), seed)[1] - bearing + 180) % 360 - 180


def test_moments_of_the_noise() -> None:
    noise = noise_of(replace(QUIET, bearing_sigma=5.0), 1.0, 3)  # wrapped below north, too
    assert abs(noise.mean()) < 4 * 5 / sqrt(len(noise))
    assert noise.std() == pytest.approx(5.0, rel=0.02)


def test_clipping_of_the_noise() -> None:
    noise = np.abs(noise_of(replace(QUIET, bearing_sigma=20.0), 180.0, 4))
    assert noise.max() == 30.0
    expected = erfc(1.5 / sqrt(2))  # both tails beyond 1.5 sigma
    assert (noise == 30.0).mean() == pytest.approx(expected, rel=0.05)
