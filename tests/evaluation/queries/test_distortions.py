"""Sights, the errors of the paper, and all other distortions of a query."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from math import atan, degrees, erfc, exp, pi, sqrt
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import column, noise_specs, parts_of, random_database
from scipy.stats import poisson
from sights import (
    CITY,
    CLASSES,
    REACH,
    all_round,
    assert_rate,
    away,
    many,
    paper_errors,
    rows,
    seeds,
    sight,
    sights,
)

from semsig_gis.core import Signature, angular_distance
from semsig_gis.evaluation import (
    DISTORTIONS,
    BlockedSectors,
    CitySights,
    ClassScores,
    CompassBias,
    Distortion,
    FieldOfView,
    HiddenBehind,
    MissingClasses,
    Obstacles,
    RoughRanges,
    SimulatedDetector,
    distort,
    parse_chain,
    prepare_chain,
)
from semsig_gis.localization import (
    LONGEST_TABLE,
    NoiseMixture,
    NoiseSpec,
    named_noise,
    noise_tables,
)
from semsig_gis.observation import FULL_VIEW, View

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.evaluation import FalseClass, QueryDistortion, Sight
    from semsig_gis.localization import Noise, NoiseTable

# --- Sights -----------------------------------------------------------------------------------


@given(original=sights, turn=st.floats(-400, 400))
def test_turning_adds_to_bearings_and_subtracts_from_the_heading(
    original: Sight, turn: float
) -> None:
    result = original.turned(turn)
    assert (np.diff(result.bearings) >= 0).all()
    assert ((result.bearings >= 0) & (result.bearings < 360)).all()
    expected = sorted(((code, distance) for code, _, distance in rows(original)))
    assert sorted((code, distance) for code, _, distance in rows(result)) == expected
    true = (result.bearings + result.heading) % 360.0
    directions = np.sort(np.exp(1j * np.radians(true)))
    assert np.allclose(directions, np.sort(np.exp(1j * np.radians(original.bearings))), atol=1e-6)


def test_objects_of_equal_bearing_stay_in_order() -> None:
    original = sight([(3, 7.0, 1.0), (1, 7.0, 2.0), (5, 2.0, 3.0)])
    assert original.clockwise().codes.tolist() == [5, 3, 1]
    assert parts_of(original.signature)[0].tolist() == [3, 1, 5]


def test_visible_classes_and_frequencies_of_a_database() -> None:
    database = random_database(3)
    city = CitySights.of(database)
    counts = Counter(database.codes.tolist())
    assert list(zip(city.codes, city.frequencies, strict=True)) == sorted(counts.items())
    assert (city.reach, city.taxonomy) == (database.reach, database.taxonomy)


@given(seed=seeds)
def test_false_distances_are_uniform_over_the_circle(seed: int) -> None:
    distances = CITY.false_distances(4000, np.random.default_rng(seed))
    assert ((distances >= 0) & (distances <= REACH)).all()
    # A uniform place in a circle has d^2 / R^2 uniform on [0, 1].
    shares = (distances / REACH) ** 2
    assert abs(shares.mean() - 0.5) < 6 / np.sqrt(12 * 4000)
    assert abs((shares < 0.25).mean() - 0.25) < 6 * np.sqrt(0.25 * 0.75 / 4000)


# --- The errors of the paper ------------------------------------------------------------------

QUIET = Distortion(occurrences=0, bearing_sigma=0.0)
WEIGHTS = [4, 3, 2, 1]


def signature(codes: list[int], bearings: Sequence[float] | None = None) -> Signature:
    places = np.linspace(0, 350, len(codes)) if bearings is None else np.array(bearings, float)
    return Signature(codes=np.array(codes, np.uint8), bearings=places)


def distorted(
    original: Signature,
    how: Distortion,
    seed: int | np.random.Generator = 0,
    *,
    classes: Sequence[int] = CLASSES,
    weights: Sequence[float] | None = WEIGHTS,
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Return codes and bearings after a distortion."""
    rng = np.random.default_rng(seed)
    return parts_of(distort(original, how, classes=classes, weights=weights, rng=rng))


def test_levels_have_the_settings_of_the_paper() -> None:
    levels = {"none": (0, 0.0), "light": (1, 5.0), "medium": (7, 5.0), "strong": (13, 5.0)}
    assert {
        name: Distortion(occurrences=count, bearing_sigma=sigma, bearing_clip=30.0)
        for name, (count, sigma) in levels.items()
    } == DISTORTIONS


@given(original=sights, how=paper_errors, seed=seeds)
def test_at_most_the_given_number_of_objects_changes(
    original: Sight, how: Distortion, seed: int
) -> None:
    codes, bearings = distorted(original.signature, how, seed)
    assert abs(len(codes) - len(original)) <= how.occurrences
    assert codes.dtype == np.uint8
    if how.resort:
        assert (np.diff(bearings) >= 0).all()
    none = distorted(original.signature, DISTORTIONS["none"], seed)
    assert np.array_equal(none, parts_of(original.signature))


@given(original=sights, seed=seeds)
def test_sorting_again_does_not_change_the_objects(original: Sight, seed: int) -> None:
    kept_order, again = (
        distorted(original.signature, replace(DISTORTIONS["strong"], resort=resort), seed)
        for resort in (False, True)
    )
    assert sorted(zip(*kept_order, strict=True)) == sorted(zip(*again, strict=True))


@given(original=sights, how=paper_errors, seed=seeds)
def test_true_distances_stay_with_the_objects(original: Sight, how: Distortion, seed: int) -> None:
    result = how.prepare(CITY)(original, np.random.default_rng(seed))
    assert type(result.signature) is Signature
    codes, bearings = distorted(original.signature, how, seed, weights=CITY.frequencies.tolist())
    assert result.codes.tolist() == codes.tolist()
    assert result.bearings.tolist() == bearings.tolist()
    assert ((result.distances >= 0) & (result.distances <= REACH)).all()
    missed = Counter(original.distances.tolist()) - Counter(result.distances.tolist())
    false = Counter(result.distances.tolist()) - Counter(original.distances.tolist())
    assert missed.total() + false.total() <= how.occurrences
    if how.occurrences == 0:
        assert sorted(result.distances.tolist()) == sorted(original.distances.tolist())


def test_order_before_the_noise_is_kept_without_sorting() -> None:
    assert distorted(signature([3, 1, 3, 5], [7, 7, 7, 7]), QUIET)[0].tolist() == [3, 1, 3, 5]
    noise = replace(QUIET, bearing_sigma=40.0, resort=False)
    false_only = replace(QUIET, occurrences=6, resort=False)
    for seed in range(50):
        # The order is that before the noise, and a false object is inserted by its bearing.
        codes, _ = distorted(signature([1, 3, 5, 10], [10, 11, 12, 359]), noise, seed)
        assert codes.tolist() == [1, 3, 5, 10]
        _, bearings = distorted(signature([1, 1, 1], [10, 120, 240]), false_only, seed)
        assert (np.diff(bearings) >= 0).all()


def test_the_three_errors_are_equally_likely() -> None:
    original = signature([1, 3, 1, 3, 5])
    rng = np.random.default_rng(5)
    once = replace(QUIET, occurrences=1)
    trials = 6000
    counts = Counter[int]()
    changed_places = np.zeros(len(original))
    for _ in range(trials):
        codes, bearings = distorted(original, once, rng)
        difference = len(codes) - len(original)
        counts[difference] += 1
        if difference == 0:
            assert bearings.tolist() == parts_of(original)[1].tolist()
            changed = codes != parts_of(original)[0]
            assert changed.sum() == 1  # a false classification always changes the class
            changed_places += changed
    spread = sqrt(trials * 2 / 9)
    assert counts.keys() == {-1, 0, 1}
    assert all(abs(count - trials / 3) < 4 * spread for count in counts.values())
    share = counts[0] / len(original)
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
    samples = [distorted(signature([]), once, rng) for _ in range(9000)]
    invented = np.concatenate([codes for codes, _ in samples])
    bearings = np.concatenate([angles for _, angles in samples])
    assert abs(len(invented) - 3000) < 4 * sqrt(9000 * 2 / 9)
    for code, share in zip(CLASSES, shares, strict=True):
        mean = len(invented) * share
        assert abs((invented == code).sum() - mean) < 4 * sqrt(mean * (1 - share))
    quadrants = np.bincount((bearings // 90).astype(int), minlength=4) / len(bearings)
    assert np.abs(quadrants - 0.25).max() < 4 * sqrt(0.25 * 0.75 / len(bearings))


def test_misclassified_objects_get_another_class() -> None:
    how = replace(QUIET, occurrences=1, false_class="frequency")
    rng = np.random.default_rng(2)
    samples = [
        distorted(signature([1]), how, rng, classes=[1, 3, 5], weights=[98, 1.5, 0.5])[0]
        for _ in range(3000)
    ]
    renamed = np.array([codes[0] for codes in samples if len(codes) == 1])
    assert set(renamed.tolist()) == {3, 5}
    assert abs((renamed == 3).mean() - 0.75) < 4 * sqrt(0.75 * 0.25 / len(renamed))
    # Without another class, a false classification changes nothing.
    cases: list[tuple[FalseClass, list[int]]] = [("uniform", [3]), ("frequency", [3, 5])]
    for false_class, classes in cases:
        often = replace(how, occurrences=5, false_class=false_class)
        codes, _ = distorted(signature([3] * 3), often, 1, classes=classes, weights=[1, 0])
        assert set(codes.tolist()) <= {3}


def test_bearing_noise_is_normal_and_clipped() -> None:
    original = signature([1] * 40_000, [1.0] * 40_000)  # wrapped below north, too
    little, much = (
        away(distorted(original, replace(QUIET, bearing_sigma=sigma, resort=False))[1], 1.0)
        for sigma in (5.0, 20.0)
    )
    assert abs(little.mean()) < 4 * 5 / sqrt(40_000)
    assert little.std() == pytest.approx(5.0, rel=0.02)
    assert np.abs(much).max() == pytest.approx(30.0)
    clipped = np.isclose(np.abs(much), 30.0).mean()
    assert clipped == pytest.approx(erfc(1.5 / sqrt(2)), rel=0.05)  # both tails beyond 1.5 sigma


# --- Everything else --------------------------------------------------------------------------

TRIALS = 4000
PERFECT = NoiseSpec(detection=1.0, misnamed=0.0, clutter=0.0, bearing_sigma=1e-9)
NAMES = {1: "alignment_tree", 3: "street_light", 5: "traffic_light", 10: "bench"}


def distorted_sight(how: QueryDistortion, original: Sight, seed: int = 0) -> Sight:
    return how.prepare(CITY)(original, np.random.default_rng(seed))


def assert_shown(how: QueryDistortion, seed: int, chance: float, distance: float = 10.0) -> None:
    """Check how often a single object remains."""
    apply, rng = how.prepare(CITY), np.random.default_rng(seed)
    count = sum(len(apply(many(1, distance=distance), rng)) for _ in range(1500))
    assert_rate(count, 1500, chance)


@settings(max_examples=30)
@given(sigma=st.floats(0.5, 40.0), seed=seeds)
def test_compass_bias_is_normal_and_equal_for_all_objects(sigma: float, seed: int) -> None:
    apply = CompassBias(sigma=sigma).prepare(CITY)
    rng = np.random.default_rng(seed)
    off = np.array([away(apply(many(2), rng).bearings, 90.0) for _ in range(1500)])
    assert (off[:, 0] == off[:, 1]).all()  # the same for all objects of a query
    if sigma < 30.0:  # else some are turned by more than half a turn
        assert abs(off[:, 0].mean()) < 6 * sigma / sqrt(1500)
        assert abs(off[:, 0].std() / sigma - 1.0) < 6 / sqrt(2 * 1500)


@given(original=sights, names=st.sets(st.sampled_from(sorted(NAMES.values()))), seed=seeds)
def test_missing_and_known_classes_are_complementary(
    original: Sight, names: set[str], seed: int
) -> None:
    missing = distorted_sight(MissingClasses(classes=tuple(names)), original, seed)
    sight = distorted_sight(MissingClasses(classes=tuple(names), others=True), original, seed)
    assert rows(missing) == [row for row in rows(original) if NAMES[row[0]] not in names]
    assert rows(sight) == [row for row in rows(original) if NAMES[row[0]] in names]


@settings(max_examples=30)
@given(degrees=st.floats(5.0, 360.0), seed=seeds)
def test_probability_of_being_in_view_is_proportional_to_its_width(
    degrees: float, seed: int
) -> None:
    view = FieldOfView(degrees=degrees)
    assert_shown(view, seed, degrees / 360.0)
    # With objects in all directions, the visible share is the width of the view.
    assert abs(len(distorted_sight(view, all_round(3600), seed)) - 10.0 * degrees) <= 1.5


@given(degrees=st.floats(1.0, 360.0), turn=st.floats(-400, 400), original=sights, seed=seeds)
def test_view_states_its_sectors_unless_switched_off(
    degrees: float, turn: float, original: Sight, seed: int
) -> None:
    view_result = distorted_sight(FieldOfView(degrees=degrees), original, seed)
    without_sectors = distorted_sight(FieldOfView(degrees=degrees, told=False), original, seed)
    remaining = rows(view_result)
    assert remaining == [row for row in rows(original) if row in remaining]
    assert view_result.photo.sees(view_result.bearings).all()
    assert degrees < 360.0 or remaining == rows(original)
    assert remaining == rows(without_sectors)
    assert without_sectors.photo == FULL_VIEW
    assert view_result.photo.width == pytest.approx(degrees)
    if view_result.photo.sectors:  # they turn with the objects in them
        turned = view_result.turned(turn)
        middle, new_middle = (
            np.deg2rad(photo.sectors[0]).mean()
            for photo in (view_result.photo.turned(turn), turned.photo)
        )
        assert np.exp(1j * new_middle) == pytest.approx(np.exp(1j * middle), abs=1e-9)
        view = turned.signature
        assert isinstance(view, View)
        assert view.photos == (turned.photo,)


@given(first=st.floats(1.0, 359.0), second=st.floats(1.0, 359.0), seed=seeds)
def test_two_views_state_their_intersection(first: float, second: float, seed: int) -> None:
    chain = (FieldOfView(degrees=first), FieldOfView(degrees=second))
    both = prepare_chain(chain, CITY)(all_round(3600), seed, 0)
    if len(both):
        assert both.photo.width == pytest.approx(len(both) / 10.0, abs=0.3)
        assert both.photo.sees(both.bearings).all()


def test_false_objects_outside_a_stated_view_are_dropped() -> None:
    for text, inside in (("view:40, errors:13", True), ("view:40:told=false, errors:13", False)):
        apply = prepare_chain(parse_chain(text), CITY)
        views = [apply(many(0), 0, number).bearings for number in range(300)]
        gaps = [np.diff([*view, view[0] + 360.0]).max() for view in views if len(view)]
        assert bool(min(gaps) >= 320.0) is inside


@pytest.mark.parametrize("percent", [10.0, 25.0, 80.0])
def test_rough_ranges_have_the_stated_error(percent: float) -> None:
    result = distorted_sight(RoughRanges(percent=percent), many(TRIALS, distance=12.0))
    assert result.ranges is not None
    off = np.log(result.ranges / 12.0) / (percent / 100.0)
    assert abs(off.mean()) < 6.0 / sqrt(TRIALS)
    assert abs(off.std() - 1.0) < 6.0 / sqrt(2 * TRIALS)
    assert (column(result.signature, "range_errors") == percent / 100.0).all()


@pytest.mark.parametrize("text", ["errors:200, ranges:80", "ranges:80, errors:200", "ranges:80, F"])
def test_rough_ranges_of_false_objects_are_uniform_over_the_circle(text: str) -> None:
    noise = replace(PERFECT, clutter=70.0, name="F")
    chain = parse_chain(text.replace("F", "detector:F"), noises={"F": noise})
    result = [prepare_chain(chain, CITY)(many(0), 0, number) for number in range(40)]
    squares = (
        np.concatenate([view.ranges for view in result if view.ranges is not None]) / REACH
    ) ** 2
    assert len(squares) > 300
    assert 0.0 < squares.min() <= squares.max() <= 1.0
    assert abs(squares.mean() - 0.5) < 6.0 / sqrt(12 * len(squares))


@pytest.mark.parametrize("right", [0.55, 0.8, 0.95])
def test_class_scores_are_calibrated(right: float) -> None:
    each = TRIALS * 2
    codes = np.repeat(np.array(CLASSES, np.uint8), each)
    here = sight([(code, 90.0, 10.0) for code in codes.tolist()])
    result = distorted_sight(ClassScores(right=right), here)
    assert result.scores is not None
    assert (result.codes == result.scores.argmax(axis=1)).all()
    own = result.scores[np.arange(len(codes)), codes]
    assert own.mean() == pytest.approx(right, abs=0.02)
    for code in CLASSES:  # the share of objects of a class equals the mean score of the class
        scores = result.scores[:, code]
        for low in np.arange(0.0, 1.0, 0.2):
            some = (scores >= low) & (scores < low + 0.2)
            spread = sqrt(0.25 / max(some.sum(), 1))
            assert abs(scores[some].mean() - (codes[some] == code).mean()) < 4 * spread
    # Objects that are misclassified or added later have a score of 1.
    after = distorted_sight(Distortion(occurrences=40), result.only(np.arange(20)))
    assert after.scores is not None
    sure = after.scores.max(axis=1) == 1.0
    assert 15 < sure.sum() < len(after)
    assert (after.codes[sure] == after.scores[sure].argmax(axis=1)).all()


@given(original=sights, width=st.floats(0.0, 5.0))
def test_objects_behind_nearer_ones_are_hidden(original: Sight, width: float) -> None:
    expected = [
        row
        for row in rows(original)
        if not any(
            near < row[2]
            and angular_distance(row[1], other) < degrees(atan(width / 2 / max(near, 0.01)))
            for _, other, near in rows(original)
        )
    ]
    assert rows(distorted_sight(HiddenBehind(width=width), original)) == expected


@given(original=sights, seed=seeds)
def test_obstacles_only_remove_objects(original: Sight, seed: int) -> None:
    result = rows(distorted_sight(Obstacles(count=3.0), original, seed))
    assert result == [row for row in rows(original) if row in result]
    for harmless in (Obstacles(count=0.0), Obstacles(count=9.0, width=0.0)):
        assert rows(distorted_sight(harmless, original, seed)) == rows(original)


@settings(max_examples=30)
@given(
    count=st.floats(0.2, 5.0), width=st.floats(0.5, 8.0), distance=st.floats(5.0, 30.0), seed=seeds
)
def test_obstacles_hide_with_the_expected_probability(
    count: float, width: float, distance: float, seed: int
) -> None:
    # The chance of one obstacle, over its distance r with density 2 r / R^2: atan(w / 2r) / pi.
    middles = (np.arange(20_000) + 0.5) * (distance / 20_000)
    share = (np.arctan(width / 2 / middles) / pi * 2 * middles / REACH**2).mean() * distance
    assert_shown(Obstacles(count=count, width=width), seed, exp(-count * share), distance)


@settings(max_examples=30)
@given(
    count=st.integers(0, 6), width=st.floats(1.0, 359.0), distance=st.floats(0, REACH), seed=seeds
)
def test_sectors_block_with_the_expected_probability(
    count: int, width: float, distance: float, seed: int
) -> None:
    sectors = BlockedSectors(count=count, degrees=width)
    assert_shown(sectors, seed, (1.0 - width / 360.0) ** count, distance)
    visible = len(distorted_sight(sectors, all_round(3600), seed)) / 10.0
    assert visible >= 360.0 - count * width - 1.0 * count - 0.2
    if count == 1:
        assert visible == pytest.approx(360.0 - width, abs=0.2)


def table_of(noise: Noise) -> NoiseTable:
    (table, *_), _ = noise_tables(
        noise,
        taxonomy=CITY.taxonomy,
        codes=CITY.codes,
        longest=LONGEST_TABLE,
        radius=CITY.reach,
    )
    return table


@given(noise=noise_specs(), code=st.sampled_from(CLASSES), seed=seeds)
def test_detector_has_the_rates_of_the_noise_model(noise: NoiseSpec, code: int, seed: int) -> None:
    noise = replace(noise, bearing_sigma_by_class={"bench": noise.bearing_sigma / 3})
    table = table_of(noise)
    kind = int(table.row_of[code])
    detector, original = SimulatedDetector(noise=noise), many(TRIALS, code=code, distance=17.0)
    result = distorted_sight(detector, original, seed)
    assert (np.diff(result.bearings) >= 0).all()
    assert result.heading == 0.0
    true = result.only(result.distances == 17.0)  # false objects seem to be anywhere else
    assert_rate(len(true), TRIALS, 1.0 - table.missed[LONGEST_TABLE, kind])
    for name, chance in zip(table.codes, table.named(LONGEST_TABLE)[kind], strict=True):
        assert_rate(int((true.codes == name).sum()), len(true), float(min(chance, 1.0)))
    sigma = float(table.sigma[kind])
    off = np.exp(1j * np.radians(true.bearings - 90.0)).mean() if len(true) else 1.0
    # The mean direction of a wrapped normal is exp(-sigma^2 / 2) long.
    expected = np.exp(-(np.radians(sigma) ** 2) / 2.0)
    assert abs(off - expected) < 6.0 / sqrt(max(len(true), 1))


@settings(max_examples=12)
@given(noise=noise_specs(), seed=seeds)
def test_false_objects_have_the_rates_of_the_noise_model(noise: NoiseSpec, seed: int) -> None:
    table = table_of(noise)
    apply = SimulatedDetector(noise=noise).prepare(CITY)
    rng = np.random.default_rng(seed)
    samples = [apply(many(0), rng) for _ in range(600)]
    for code, mean in zip(table.codes, table.clutter, strict=True):
        count = sum(int((sample.codes == code).sum()) for sample in samples)
        # The sum is a Poisson variable, too; neither tail is extremely unlikely.
        assert min(poisson.cdf(count, 600 * mean), poisson.sf(count - 1, 600 * mean)) > 1e-9
    parts = [(sample.bearings, sample.distances) for sample in samples]
    bearings, distances = np.concatenate(parts, axis=1)
    if len(bearings) > 50:
        assert abs(np.exp(1j * np.radians(bearings)).mean()) < 6.0 / sqrt(len(bearings))
        assert abs(((distances / REACH) ** 2).mean() - 0.5) < 6.0 / sqrt(12 * len(distances))


@given(half=st.floats(3.0, 60.0), distance=st.floats(0.0, REACH), seed=seeds)
def test_detection_decreases_with_distance(half: float, distance: float, seed: int) -> None:
    detector = SimulatedDetector(noise=PERFECT, half=half)
    result = distorted_sight(detector, many(TRIALS, distance=distance), seed)
    nearby = 1.0 - float(table_of(PERFECT).missed[LONGEST_TABLE, 1])
    chance = nearby * 0.5 ** ((distance / half) ** 2)
    # False objects are very rare.
    true = int((result.distances == distance).sum())
    assert_rate(true, TRIALS, chance)


def test_moved_observer_changes_bearings_of_near_objects_most() -> None:
    apply = SimulatedDetector(noise=replace(PERFECT, position_sigma=0.5)).prepare(CITY)
    rng = np.random.default_rng(1)
    for distance in (5.0, 25.0):
        results = [apply(many(1, distance=distance), rng) for _ in range(TRIALS)]
        sigma = degrees(0.5 / distance)
        turned = away(np.concatenate([result.bearings for result in results]), 90.0)
        turned = turned[np.abs(turned) < 8.0 * sigma]  # a few objects are false
        assert turned.std() == pytest.approx(sigma, rel=0.08)
        assert abs(turned.mean()) < 6 * sigma / sqrt(TRIALS)


def test_one_model_of_a_mixture_applies_to_a_whole_query() -> None:
    both = NoiseMixture(specs=(replace(PERFECT, detection=0.05), PERFECT), weights=(0.25, 0.75))
    apply = SimulatedDetector(noise=both).prepare(CITY)
    rng = np.random.default_rng(2)
    shares = np.array([len(apply(many(200), rng)) / 200 for _ in range(800)])
    assert ((shares < 0.2) | (shares > 0.9)).all()
    assert_rate(float((shares > 0.9).sum()), 800, 0.75)


def test_noise_model_of_a_level_misses_a_larger_share_of_few_objects() -> None:
    # Seven errors leave a smaller share of few objects than of many.
    apply = SimulatedDetector(noise=named_noise("medium")).prepare(CITY)
    rng = np.random.default_rng(3)
    few_share, many_share = (
        np.mean([(apply(many(n), rng).distances == 10.0).sum() / n for _ in range(600)])
        for n in (4, 40)
    )
    assert few_share == pytest.approx((1 - 1 / 4) ** (7 / 3), abs=0.05)
    assert many_share == pytest.approx((1 - 1 / 40) ** (7 / 3), abs=0.02)
