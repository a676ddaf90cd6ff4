from __future__ import annotations

from collections import Counter
from dataclasses import replace
from math import erfc, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sights import CITY, REACH, seeds, sights

from semsig_gis.core.errors import InputError, UnknownNameError
from semsig_gis.core.signature import Signature
from semsig_gis.queries.paper_errors import DISTORTIONS, Distortion, distort, named_distortion

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.queries.paper_errors import FalseClass
    from semsig_gis.queries.sight import Sight

CLASSES = [1, 3, 5, 10]
QUIET = Distortion(occurrences=0, bearing_sigma=0.0)


def signature(codes: list[int], bearings: list[float] | None = None) -> Signature:
    places = np.linspace(0, 350, len(codes)) if bearings is None else np.array(bearings, float)
    return Signature(codes=np.array(codes, np.uint8), bearings=places)


def parts(one: Signature) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    assert one.codes is not None
    assert one.bearings is not None
    return one.codes, one.bearings


Signatures = st.lists(st.tuples(st.sampled_from(CLASSES), st.floats(0, 359.99)), max_size=12).map(
    lambda seen: signature(
        [code for code, _ in sorted(seen, key=lambda one: one[1])],
        sorted(bearing for _, bearing in seen),
    )
)
Distortions = st.builds(
    Distortion,
    occurrences=st.integers(0, 20),
    bearing_sigma=st.floats(0, 90),
    bearing_clip=st.floats(0, 200),
    resort=st.booleans(),
    false_class=st.sampled_from(["uniform", "frequency"]),
)


def test_the_levels_of_the_paper() -> None:
    assert {name: one.occurrences for name, one in DISTORTIONS.items()} == {
        "none": 0,
        "light": 1,
        "medium": 7,
        "strong": 13,
    }
    for name, one in DISTORTIONS.items():
        noise = (one.bearing_sigma, one.bearing_clip)
        assert noise == ((0.0, 30.0) if name == "none" else (5.0, 30.0))
    assert named_distortion("light") is DISTORTIONS["light"]


@given(one=Signatures, seed=st.integers(0, 2**32))
def test_none_changes_nothing(one: Signature, seed: int) -> None:
    rng = np.random.default_rng(seed)
    codes, bearings = parts(distort(one, DISTORTIONS["none"], classes=CLASSES, rng=rng))
    assert codes.tolist() == parts(one)[0].tolist()
    assert bearings.tolist() == parts(one)[1].tolist()


@given(one=Signatures, how=Distortions, seed=st.integers(0, 2**32))
def test_invariants(one: Signature, how: Distortion, seed: int) -> None:
    before = [part.tolist() for part in parts(one)]
    options: dict[str, Any] = {"classes": CLASSES, "weights": [4, 3, 2, 1]}
    result = distort(one, how, **options, rng=np.random.default_rng(seed))
    codes, bearings = parts(result)
    assert abs(len(codes) - len(one)) <= how.occurrences
    assert codes.dtype == np.uint8
    assert set(codes.tolist()) <= set(CLASSES)
    assert ((bearings >= 0) & (bearings < 360)).all()
    if how.resort:
        assert (np.diff(bearings) >= 0).all()
    again = distort(one, how, **options, rng=np.random.default_rng(seed))
    assert [part.tolist() for part in parts(again)] == [codes.tolist(), bearings.tolist()]
    assert [part.tolist() for part in parts(one)] == before


@given(one=Signatures, seed=st.integers(0, 2**32))
def test_order_kept_or_sorted_again_hold_the_same_objects(one: Signature, seed: int) -> None:
    kept, again = (
        parts(
            distort(
                one,
                replace(DISTORTIONS["strong"], resort=resort),
                classes=CLASSES,
                rng=np.random.default_rng(seed),
            )
        )
        for resort in (False, True)
    )
    assert sorted(zip(*kept, strict=True)) == sorted(zip(*again, strict=True))


@given(one=sights, how=Distortions, seed=seeds)
def test_objects_keep_their_distances(one: Sight, how: Distortion, seed: int) -> None:
    seen = how.ready(CITY)(one, np.random.default_rng(seed))
    frequencies = CITY.frequencies.tolist()
    options: dict[str, Any] = {"classes": CLASSES, "weights": frequencies}
    plain = distort(one.signature, how, **options, rng=np.random.default_rng(seed))
    assert seen.codes.tolist() == parts(plain)[0].tolist()
    assert seen.bearings.tolist() == parts(plain)[1].tolist()
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
        codes, _ = parts(distort(one, noise, classes=CLASSES, rng=np.random.default_rng(seed)))
        assert codes.tolist() == [1, 3, 5, 10]


def test_a_false_object_stands_where_its_bearing_belongs() -> None:
    one = signature([1, 1, 1], [10, 120, 240])
    false_only = replace(QUIET, occurrences=6, resort=False)
    for seed in range(50):
        _, bearings = parts(
            distort(one, false_only, classes=CLASSES, rng=np.random.default_rng(seed))
        )
        assert (np.diff(bearings) >= 0).all()


def test_ties_keep_their_order_when_sorted_again() -> None:
    one = signature([3, 1, 3, 5], [7, 7, 7, 7])
    codes, _ = parts(distort(one, QUIET, classes=CLASSES, rng=np.random.default_rng(0)))
    assert codes.tolist() == [3, 1, 3, 5]


def test_the_three_operations_are_equally_likely() -> None:
    one = signature([1, 3, 1, 3, 5])
    rng = np.random.default_rng(5)
    once = replace(QUIET, occurrences=1)
    trials = 6000
    counts = {-1: 0, 0: 0, 1: 0}
    changed_places = np.zeros(len(one))
    for _ in range(trials):
        codes, bearings = parts(distort(one, once, classes=CLASSES, rng=rng))
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
    how = replace(QUIET, occurrences=9000, false_class=false_class)
    empty = signature([])
    # Operations that find no object are idle, so the signature grows and shrinks; count what
    # one occurrence on nothing invents.
    once = replace(how, occurrences=1)
    rng = np.random.default_rng(11)
    found = [
        parts(distort(empty, once, classes=CLASSES, weights=[4, 3, 2, 1], rng=rng))
        for _ in range(how.occurrences)
    ]
    invented = np.concatenate([codes for codes, _ in found])
    bearings = np.concatenate([angles for _, angles in found])
    assert abs(len(invented) - 3000) < 4 * sqrt(9000 * 2 / 9)
    for code, share in zip(CLASSES, shares, strict=True):
        mean = len(invented) * share
        assert abs((invented == code).sum() - mean) < 4 * sqrt(mean * (1 - share))
    quadrants = np.bincount((bearings // 90).astype(int), minlength=4) / len(bearings)
    assert np.abs(quadrants - 0.25).max() < 4 * sqrt(0.25 * 0.75 / len(bearings))


def test_false_classes_by_frequency_leave_the_true_one_out() -> None:
    how = replace(QUIET, occurrences=1, false_class="frequency")
    options: dict[str, Any] = {"classes": [1, 3, 5], "weights": [98, 1.5, 0.5]}
    rng = np.random.default_rng(2)
    results = [parts(distort(signature([1]), how, **options, rng=rng))[0] for _ in range(3000)]
    renamed = np.array([codes[0] for codes in results if len(codes) == 1])
    assert set(renamed.tolist()) == {3, 5}
    assert abs((renamed == 3).mean() - 0.75) < 4 * sqrt(0.75 * 0.25 / len(renamed))


def test_without_another_class_a_false_classification_changes_nothing() -> None:
    one = signature([3, 3, 3])
    how = replace(QUIET, occurrences=5)
    codes, _ = parts(distort(one, how, classes=[3], rng=np.random.default_rng(1)))
    assert set(codes.tolist()) <= {3}
    by_frequency = replace(how, false_class="frequency")
    codes, _ = parts(
        distort(one, by_frequency, classes=[3, 5], weights=[1, 0], rng=np.random.default_rng(1))
    )
    assert set(codes.tolist()) <= {3}


def test_moments_of_the_noise() -> None:
    n = 40_000
    one = Signature(codes=np.ones(n, np.uint8), bearings=np.full(n, 1.0))
    how = replace(QUIET, bearing_sigma=5.0, resort=False)
    _, bearings = parts(distort(one, how, classes=CLASSES, rng=np.random.default_rng(3)))
    noise = (bearings - 1.0 + 180) % 360 - 180
    assert abs(noise.mean()) < 4 * 5 / sqrt(n)
    assert noise.std() == pytest.approx(5.0, rel=0.02)
    assert (bearings > 300).any()  # wrapped below north


def test_clipping_of_the_noise() -> None:
    n = 40_000
    one = Signature(codes=np.ones(n, np.uint8), bearings=np.full(n, 180.0))
    how = replace(QUIET, bearing_sigma=20.0, resort=False)
    _, bearings = parts(distort(one, how, classes=CLASSES, rng=np.random.default_rng(4)))
    noise = np.abs(bearings - 180.0)
    assert noise.max() == 30.0
    expected = erfc(1.5 / sqrt(2))  # both tails beyond 1.5 sigma
    assert (noise == 30.0).mean() == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"occurrences": -1}, "-1 occurrences of distortion were given; give 0 or more."),
        ({"bearing_sigma": -0.1}, "A bearing sigma of -0.1 was given; give degrees, 0 or more."),
        ({"bearing_clip": float("inf")}, "A bearing clip of inf was given"),
        ({"bearing_sigma": float("nan")}, "A bearing sigma of nan was given"),
    ],
)
def test_numbers_out_of_range_are_refused(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        Distortion(**options)


def test_unknown_names_are_refused_with_the_nearest() -> None:
    wrong: Any = "frequencies"
    with pytest.raises(UnknownNameError, match="nearest is 'frequency'"):
        Distortion(false_class=wrong)
    with pytest.raises(UnknownNameError, match="none, light, medium or strong"):
        named_distortion("heavy")


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"classes": []}, "not a list of distinct codes"),
        ({"classes": [3, 3]}, "not a list of distinct codes"),
        ({"classes": [1, 3]}, "without weights"),
        ({"classes": [1, 3], "weights": [1]}, "1 weights for 2 classes"),
        ({"classes": [1, 3], "weights": [1, -1]}, "0 or more"),
        ({"classes": [1, 3], "weights": [0, 0]}, "all zero"),
    ],
)
def test_classes_that_do_not_serve_are_refused(options: dict[str, Any], sentence: str) -> None:
    how = replace(QUIET, false_class="frequency")
    with pytest.raises(InputError, match=sentence):
        distort(signature([1]), how, **options, rng=np.random.default_rng(0))


def test_a_signature_without_bearings_is_refused() -> None:
    one = Signature(codes=np.array([1], np.uint8), bearings=None)
    with pytest.raises(InputError, match="give one with both"):
        distort(one, QUIET, classes=CLASSES, rng=np.random.default_rng(0))
