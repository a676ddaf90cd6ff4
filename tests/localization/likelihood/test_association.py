"""Associations of detections with objects: sums, re-ranked cells and explanations."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import (
    database_of,
    distorted,
    every_association,
    mixtures,
    noise_specs,
    parts_of,
    random_database,
    random_query,
    turned_query,
)
from view_oracle import bearing_density, cell_loglik, random_view
from worlds import CODES, World, random_town

from semsig_gis.core import ObjectIndex, Signature
from semsig_gis.database import visible_objects_in
from semsig_gis.localization import (
    LOST_SHARE,
    Detections,
    NoiseMixture,
    NoiseSpec,
    Pairs,
    PhotoTable,
    associate,
    associate_pairs,
    build_index,
    cell_noise,
    database_tables,
    explain,
    explain_cell,
    named_noise,
    near_pairs,
    photo_loglik,
    query_bearings,
    rerank,
    score_associations,
    visible_objects_off_centre,
)
from semsig_gis.observation import FULL_VIEW, Photo, View

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import Association, Explanation, Noise, NoiseTable

SEEDS = st.integers(0, 10_000)
GENERIC = named_noise("generic")


def associated(weights: np.ndarray) -> tuple[Pairs, np.ndarray, float]:
    """Associate the objects in rows with the detections in columns; 0 is no pair."""
    objects, detections = np.nonzero(weights)
    starts, away = np.array([0, len(objects)]), np.zeros(len(objects))
    pairs = Pairs(starts=starts, objects=objects, detections=detections, away=away)
    chances, (total,) = associate_pairs(pairs, weights[objects, detections])
    return pairs, chances, float(total)


@given(
    st.integers(1, 4),
    st.integers(1, 4),
    st.lists(st.floats(1e-3, 1e3), min_size=16, max_size=16),
    st.booleans(),
)
def test_belief_propagation_is_exact_without_loops(
    objects: int,
    detections: int,
    values: list[float],
    star: bool,  # noqa: FBT001
) -> None:
    weights = np.zeros((objects, detections))
    if star:
        weights[0] = values[:detections]
        weights[:, 0] = values[4 : 4 + objects]
    else:
        for step in range(min(objects, detections)):
            weights[step, step] = values[step]
            if step:
                weights[step, step - 1] = values[step + 4]
    total, chances = every_association(weights)
    pairs, near, result = associated(weights)
    assert result == pytest.approx(total, abs=1e-3)
    assert near == pytest.approx(chances[pairs.objects, pairs.detections], abs=2e-3)


@given(st.integers(0, 10_000))
def test_belief_propagation_is_close_to_the_exact_sum(seed: int) -> None:
    rng = np.random.default_rng(seed)
    weights = np.exp(rng.normal(0.0, 2.0, (4, 4)))
    total, chances = every_association(weights)
    _, near, result = associated(weights)
    # The Bethe approximation is a lower bound; of all these seeds, 1386 is the farthest below.
    assert total - 0.36 <= result <= total + 1e-3
    assert np.abs(near.reshape(4, 4) - chances).max() < 0.2
    assert (near.reshape(4, 4).sum(axis=0) <= 1 + 1e-3).all()


def test_problems_are_independent() -> None:
    rng = np.random.default_rng(1)
    starts = np.array([[0, 3, 3, 8], [0, 2, 4, 9]])
    bearings = rng.uniform(0, 360, (2, 9))
    pairs = near_pairs(starts[0], bearings[0], starts[1], bearings[1], reach=120.0)
    weights = rng.uniform(0, 3, len(pairs.away))
    chances, sums = associate_pairs(pairs, weights)
    for row in range(3):
        first_object, first_detection = starts[:, row]
        own = starts[:, row : row + 2] - starts[:, [row]]
        own_pairs = near_pairs(
            own[0], bearings[0, first_object:], own[1], bearings[1, first_detection:], reach=120.0
        )
        part = slice(*pairs.starts[row : row + 2])
        assert pairs.objects[part].tolist() == (own_pairs.objects + first_object).tolist()
        own_chances, own_sums = associate_pairs(own_pairs, weights[part])
        assert own_chances == pytest.approx(chances[part])
        assert own_sums[0] == pytest.approx(sums[row])
    assert sums[1] == 0.0


def slow_weights(
    table: NoiseTable, database: SignatureDatabase, query: Signature, cell: int
) -> np.ndarray:
    """Return the weight of each pair of an object and a detection."""
    part = slice(database.offsets[cell], database.offsets[cell + 1])
    kinds = table.row_of[database.codes[part]]
    sigmas = table.sigmas[kinds, database.distance_units[part]]
    names, length = table.query_rows(query), len(kinds)
    chances = np.append(table.named(length), np.ones((len(table.codes), 1)), axis=1) / table.density
    weights = np.zeros((length, len(query)))
    for entry, detection in np.ndindex(weights.shape):
        bearing = database.bearings[part][entry] + 0.025
        weights[entry, detection] = (
            table.odds[length, kinds[entry]]
            * chances[kinds[entry], names[detection]]
            * bearing_density(
                float(query_bearings(query)[detection] - bearing), float(sigmas[entry])
            )
        )
    return weights


def empty_loglik(table: NoiseTable, database: SignatureDatabase, cell: int) -> float:
    """Return the log-likelihood of no detections in a cell."""
    kinds = table.row_of[database.codes[database.offsets[cell] : database.offsets[cell + 1]]]
    return float(np.log(table.missed[len(kinds), kinds]).sum() - table.clutter.sum())


# Without tails that meet behind the observer, or with tails that count.
CLEAR_SIGMAS = st.floats(1.0, 20.0) | st.floats(46.0, 60.0)


@given(SEEDS, st.integers(1, 12), noise_specs(), CLEAR_SIGMAS)
def test_weights_of_pairs_equal_a_plain_loop(
    seed: int, size: int, noise: NoiseSpec, sigma: float
) -> None:
    noise = replace(noise, bearing_sigma=sigma, bearing_sigma_by_class={"indicator": 10.0})
    database = random_database(seed)
    query = random_query(database, seed, size=size)
    (table,), _ = database_tables(database, noise)
    views, starts = visible_objects_in(database, np.array([0])), np.array([0, size])
    pairs = near_pairs(views.offsets, views.bearings, starts, query_bearings(query))
    association = associated_views(database, query, noise)
    weights = slow_weights(table, database, query, 0)
    expected, (total,) = associate_pairs(pairs, weights[pairs.objects, pairs.detections])
    assert association.chances == pytest.approx(expected, abs=1e-4)
    names = table.query_rows(query)
    empty = empty_loglik(table, database, 0) + np.log(table.density[names]).sum()
    assert association.loglik.sum() == pytest.approx(total + empty, abs=1e-4)


def associated_views(
    database: SignatureDatabase, query: Signature, noise: NoiseSpec
) -> Association:
    """Associate the detections of a query with the objects that the first cell sees."""
    (table,), _ = database_tables(database, noise)
    detections = Detections.of([query], table)
    views = visible_objects_in(database, np.zeros(len(detections.photos), np.int64))
    return associate(
        table,
        views,
        detections,
        near_pairs(views.offsets, views.bearings, detections.starts, detections.bearings),
        lengths=views.lengths,
    )


PHOTOS = (Photo.looking(heading=15, fov=70), Photo(sectors=((100, 130), (200, 320))), FULL_VIEW)
FADING = {"all": ((5.0, 1.0), (30.0, 0.1)), "street_light": ((10.0, 0.9), (20.0, 0.3))}


@settings(max_examples=60)
@given(SEEDS, noise_specs(), CLEAR_SIGMAS, st.integers(1, 4), st.sampled_from([0.0, 2.5]))
def test_likelihoods_of_views_equal_the_oracle(
    seed: int, noise: NoiseSpec, sigma: float, size: int, position: float
) -> None:
    noise = replace(
        noise,
        bearing_sigma=sigma,
        position_sigma=position,
        fading=FADING,
        range_sigma=0.4,
        range_sigma_by_class={"indicator": 0.2},
    )
    database = random_database(seed, cells=8, longest=4)
    view = random_view(database, np.random.default_rng(seed), size=size, photos=PHOTOS)
    loglik = associated_views(database, view, noise).loglik
    exact = [cell_loglik(database, part, noise, 0) for part in view.split()]
    if size == 1:
        assert loglik == pytest.approx(exact, abs=1e-4)
    assert (loglik <= np.array(exact) + 1e-3).all()
    assert (loglik >= np.array(exact) - 0.35 * size - 1e-3).all()


def test_deviations_inside_a_sector_equal_a_simulation() -> None:
    photos = (Photo(sectors=((350, 10), (30, 33))), FULL_VIEW)
    query = View(np.array([3], np.uint8), np.array([5.0]), photos=photos)
    table = database_tables(random_database(0), NoiseSpec())[0][0]
    detections = Detections.of([query], table)
    bearings, spreads = np.array([0.0, 12.0, 31.0, 180.0, 7.0]), np.array([4.0, 8.0, 3.0, 3.0, 9.0])
    inside, squares = detections.inside(np.array([0, 0, 0, 0, 1]), bearings, spreads)
    rng = np.random.default_rng(0)
    for row, (bearing, spread) in enumerate(zip(bearings[:3], spreads[:3], strict=True)):
        away = rng.normal(0.0, spread, 200_000)
        inside_sector = photos[0].sees(bearing + away)
        assert inside[row] == pytest.approx(inside_sector.mean(), abs=0.005)
        assert squares[row] == pytest.approx(((away[inside_sector] / spread) ** 2).mean(), abs=0.02)
    assert inside[3:].tolist() == [0.0, 1.0]
    assert squares[4] == 1.0


@given(
    st.floats(-200, 400),
    st.floats(1, 359),
    st.floats(0, 360, exclude_max=True),
    st.floats(0.5, 60.0),
)
def test_deviations_inside_a_sector_equal_an_integral(
    start: float, width: float, bearing: float, spread: float
) -> None:
    photo = Photo(sectors=((start, start + width),))
    query = View(np.array([3], np.uint8), np.array([photo.sectors[0][0]]), photos=(photo,))
    detections = Detections.of([query], database_tables(random_database(0), NoiseSpec())[0][0])
    row = np.zeros(1, np.int64), np.array([bearing]), np.array([spread])
    (inside,), (squares,) = detections.inside(*row)
    away = np.linspace(-7.0, 7.0, 200_001)
    density = np.exp(-0.5 * away**2) * photo.sees(bearing + spread * away)
    mass = density.sum() / math.sqrt(2.0 * math.pi) * (away[1] - away[0])
    assert inside == pytest.approx(mass, abs=1e-4)
    if mass > 0.01:
        assert squares == pytest.approx((density * away**2).sum() / density.sum(), abs=0.01)


@settings(max_examples=40)
@given(SEEDS, mixtures(), st.integers(1, 5))
def test_the_sum_over_associations_is_close_and_never_too_large(
    seed: int, noise: Noise, size: int
) -> None:
    database = random_database(seed, cells=6, longest=5)
    query = random_query(database, seed, size=size)
    cells = np.arange(len(database))
    loglik = score_associations(database, query, noise, cells)
    for cell in cells.tolist():
        exact = cell_loglik(database, query, noise, cell, tails=6.0)
        assert loglik[cell] <= exact + 1e-3
        # Half the logarithm of two for each object is the most that loops can cost.
        loops = min(len(query), int(database.lengths[cell]))
        assert loglik[cell] >= exact - 0.35 * loops - 1e-3


@settings(max_examples=15)
@given(SEEDS, st.floats(0.0, 20.0))
def test_the_sum_is_exact_without_loops_of_pairs(seed: int, away: float) -> None:
    # Objects far apart: no detection can be two of them, though two may be one.
    rng = np.random.default_rng(seed)
    places = np.arange(6) * 60.0
    database = database_of([("".join(rng.choice(list("BDG"), 6)), places.tolist())])
    noise = NoiseSpec(bearing_sigma=5.0)
    bearings = (np.repeat(places, 2)[:5] + np.array([0.0, 1.0, -2.0, 3.0, away])) % 360.0
    query = Signature(rng.choice(database.present_codes, 5), bearings)
    loglik = score_associations(database, query, noise, np.zeros(1, np.int64))[0]
    assert loglik == pytest.approx(cell_loglik(database, query, noise, 0), abs=1e-3)


def test_turns_give_the_scores_of_a_turned_query() -> None:
    database = random_database(4)
    query = random_query(database, 4, size=7)
    cells, turns = np.array([3, 8]), np.array([[0.0, 30.0], [-200.0, 400.0]])
    loglik = score_associations(database, query, GENERIC, cells, turns=turns)
    for place, way in np.ndindex(turns.shape):
        turned = turned_query(query, float(turns[place, way]))
        expected = score_associations(database, turned, GENERIC, cells[[place]])
        assert loglik[place, way] == pytest.approx(expected[0], abs=1e-3)


@pytest.mark.parametrize("weights", [(0.8, 0.1, 0.1), (1e-6, 0.5, 0.5)])
def test_bounds_in_place_of_likelihoods_keep_the_sums(weights: tuple[float, float, float]) -> None:
    town, side = random_town().database, 3
    rng = np.random.default_rng(0)
    longest = np.argsort(-town.lengths, kind="stable")
    cells = rng.choice(longest[:80], 40, replace=False)
    along = (np.arange(side) - 1) * town.grid.step / side
    places = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    views = visible_objects_off_centre(town, cells, places)
    query = View.of(town.signature(int(cells[0])))
    sharp = [replace(spec, bearing_sigma=1.5) for spec in GENERIC.specs]
    noise = NoiseMixture(specs=tuple(sharp), weights=weights, name="sharp")
    tables, shares = database_tables(town, cell_noise(noise, town.grid.step / side))
    photo = PhotoTable.of(query, tables[0])
    turns = np.repeat(rng.uniform(-5.0, 5.0, (len(cells), 2)), len(places), axis=0)
    prior = rng.normal(0.0, 3.0, turns.shape)
    some, others = (
        photo_loglik(photo, views, tables, shares, turns=turns, log_prior=prior, **options)
        for options in ({"group": len(places)}, {"whole": True})
    )
    # Each model, place and turn is a call of its own, without bounds.
    each = [
        np.hstack(
            [
                photo_loglik(photo, views, [table], np.array([share]), turns=turn[:, None])
                for turn in turns.T
            ]
        )
        for table, share in zip(tables, shares.tolist(), strict=True)
    ]
    whole = np.logaddexp.reduce(each, axis=0)
    for bounds, many in ((some, len(places)), (others, len(turns))):
        assert (bounds > whole - 1e-3).all()
        assert (bounds > whole + 1e-3).mean() > 0.01  # some are bounds
        sums, expected = (
            np.logaddexp.reduce((logliks + prior).reshape(-1, many * turns.shape[1]), axis=1)
            for logliks in (bounds, whole)
        )
        assert sums == pytest.approx(expected, abs=LOST_SHARE)


def test_re_ranking_replaces_the_best_scores_and_shifts_the_others() -> None:
    database = random_database(2, cells=300)
    index = build_index(database, GENERIC)
    query = random_query(database, 2, size=8)
    exact = score_associations(database, query, GENERIC, np.arange(300))
    scores = index.scores(query)
    loglik = rerank(index, query, scores, count=40).loglik
    likeliest = np.argsort(-exact, kind="stable")[:15]
    assert loglik[likeliest] == pytest.approx(exact[likeliest])
    # The sum of the others is right.
    others = ~np.isclose(loglik, exact, atol=1e-6)
    assert others.sum() > 200
    masses = [np.logaddexp.reduce(logliks[others]) for logliks in (loglik, exact)]
    assert masses[0] == pytest.approx(masses[1], abs=0.3)
    loglik, near = rerank(index, query, scores, count=10_000).loglik, exact > exact.max() - 10.0
    assert loglik[near] == pytest.approx(exact[near])
    # A prior chooses the cells; without bearings, none are re-ranked.
    prior = np.where(np.arange(300) < 5, 0.0, -np.inf)
    loglik = rerank(index, query, scores, count=40, log_prior=prior).loglik
    assert loglik[:5] == pytest.approx(exact[:5])
    types = Signature(parts_of(query)[0], None)
    scores = index.scores(types)
    assert rerank(index, types, scores) is scores


def test_re_ranking_finds_the_best_cell_if_all_first_sums_are_too_high() -> None:
    # With a model almost without failures, many detections resemble a few objects in the first sum.
    noise = NoiseSpec(detection=0.999, misnamed=0.0, clutter=0.01, bearing_sigma=5.0)
    database = random_database(5, cells=400, longest=40, classes=2)
    index = build_index(database, noise)
    hidden = 0
    for cell in np.argsort(-database.lengths)[:12].tolist():
        query = distorted(database, cell, np.random.default_rng([cell, 1]))
        scores = index.scores(query)
        exact = score_associations(database, query, noise, np.arange(400))
        best = int(exact.argmax())
        loglik = rerank(index, query, scores, count=20).loglik
        assert exact[best] < scores.loglik.max() - 30.0
        if loglik[best] == pytest.approx(exact[best]):
            hidden += loglik.argmax() != best
    assert not hidden


@pytest.mark.parametrize("north_sigma", [10.0, math.inf])
def test_re_ranking_refines_the_heading(north_sigma: float) -> None:
    database = random_database(3, cells=100, longest=20)
    cell = int(database.lengths.argmax())
    query = turned_query(database.signature(cell), -7.0)
    index = build_index(database, named_noise("light"))
    scores = index.scores(query, north_sigma=north_sigma)
    result = rerank(index, query, scores, north_sigma=north_sigma)
    assert int(result.loglik.argmax()) == cell
    assert result.heading is not None
    assert abs(result.heading[cell] - 7.0) <= 1.5


def test_re_ranking_finds_more_cells_than_the_scan() -> None:
    database = random_database(7, cells=400, longest=10, classes=2)
    index = build_index(database, GENERIC)
    right = np.zeros(2, int)
    for cell in range(60):
        query = distorted(database, cell, np.random.default_rng([cell, 5]))
        if len(query) > 0:
            scores = index.scores(query)
            both = scores.loglik, rerank(index, query, scores).loglik
            right += [int(loglik.argmax()) == cell for loglik in both]
    assert right[1] > right[0]


# --- Explanations -----------------------------------------------------------------------------

NOISE = NoiseSpec(detection=0.8, misnamed=0.05, clutter=1.0, bearing_sigma=4.0)
TREE, LAMP = CODES[0], CODES[1]
# North, east and south of the place, and one out of range.
WORLD = World(((0.0, 10.0, TREE), (20.0, 0.0, LAMP), (0.0, -15.0, TREE), (0.0, 99.0, TREE)))


def explained(query: Signature, world: World = WORLD, **options: Any) -> Explanation:  # noqa: ANN401
    xy, noise = options.pop("xy", (0.0, 0.0)), options.pop("noise", NOISE)
    objects = world.street_objects
    return explain(query, xy, noise, objects=objects, index=ObjectIndex(objects.xy), **options)


def test_explanations_have_all_verdicts() -> None:
    query = Signature(np.array([TREE, TREE, LAMP]), np.array([357.0, 92.0, 300.0]))
    explanation = explained(query)
    rows = explanation.to_dict()["rows"]
    assert [(row["verdict"], row["object"], row["source_id"], row["query"]) for row in rows] == [
        ("matched", 0, "0", 0),
        ("misnamed", 1, "1", 1),
        ("false", None, None, 2),
        ("missed", 2, "2", None),
    ]
    assert rows[0]["bearing_error"] == pytest.approx(-3.0)
    assert rows[0]["distance"] == pytest.approx(10.0)
    assert rows[1]["object_bearing"] == pytest.approx(90.0)
    assert rows[1]["object_class"] != rows[1]["query_class"]
    assert all(0.5 < row["chance"] <= 1.0 for row in rows)
    assert explanation.counts == {"matched": 1, "misnamed": 1, "missed": 1, "false": 1}
    assert json.loads(json.dumps(explanation.to_dict()))["x"] == 0.0
    assert explanation.table.geometry.isna().tolist() == [False, False, True, False]
    assert explanation.table.crs == WORLD.street_objects.crs


def test_chance_of_a_single_pair() -> None:
    world = World(((0.0, 10.0, TREE), (0.0, -500.0, LAMP)))
    explanation = explained(Signature(np.array([TREE]), np.array([8.0])), world)
    density = np.exp(-0.5 * 4.0) / (4.0 * np.sqrt(2 * np.pi))
    weight = 0.8 / 0.2 * 0.95 * density / (0.5 / 360)
    assert explanation.table["chance"].iloc[0] == pytest.approx(weight / (1 + weight), rel=1e-6)
    expected = np.log(0.2 * (0.5 / 360) * (1 + weight)) - 1.0
    assert explanation.loglik == pytest.approx(expected, rel=1e-6)


def test_no_object_is_matched_twice() -> None:
    lamps = World(((0.0, 10.0, LAMP), (1.0, 10.0, LAMP)))
    query = Signature(np.array([LAMP, LAMP]), np.array([2.0, 3.0]))
    explanation = explained(query, lamps, noise=named_noise("light"))
    assert sorted(explanation.table["object"].tolist()) == [0, 1]
    assert explanation.counts["matched"] == 2


def test_a_turned_query_of_unknown_classes_is_explained() -> None:
    explanation = explained(Signature(None, np.array([350.0, 80.0])), heading=10.0)
    assert explanation.table["verdict"].tolist() == ["matched", "matched", "missed"]
    assert explanation.table["query_class"].tolist()[:2] == ["unknown", "unknown"]
    assert explanation.table["query_bearing"].tolist()[:2] == [0.0, 90.0]
    assert explanation.heading == 10.0


def test_all_detections_are_false_at_a_place_without_objects() -> None:
    explanation = explained(Signature(np.array([TREE]), np.array([0.0])), xy=(500.0, 500.0))
    assert explanation.counts == {"matched": 0, "misnamed": 0, "missed": 0, "false": 1}
    assert explanation.table["chance"].tolist() == [1.0]


def test_a_cell_is_explained_without_the_street_objects() -> None:
    database = WORLD.database
    cell = int(np.flatnonzero((database.xy == [5.0, 5.0]).all(axis=1))[0])
    query = database.signature(cell)
    explanation = explain_cell(query, cell, NOISE, database=database)
    exact = explained(query, xy=(5.0, 5.0))
    assert explanation.counts == exact.counts
    assert explanation.loglik == pytest.approx(exact.loglik, abs=0.1)
    assert explanation.table["object"].isna().all()
    assert explanation.table.geometry.distance(exact.table.geometry).max() < 0.2
    assert explanation.table.crs == WORLD.street_objects.crs


def test_objects_outside_the_photo_are_not_missed_or_counted() -> None:
    east = Photo.looking(heading=100, fov=60)
    query = View(np.array([LAMP]), np.array([92.0]), ranges=np.array([18.0]), photos=(east,))
    explanation = explained(query)
    rows: list[Any] = explanation.to_dict()["rows"]
    verdicts = [(row["verdict"], row["object"]) for row in rows]
    assert verdicts == [("matched", 1), ("outside", 0), ("outside", 2)]
    assert (rows[0]["query_range"], rows[0]["distance"]) == (18.0, pytest.approx(20.0))
    assert rows[0]["photo"] is None
    assert explanation.counts == {"matched": 1, "misnamed": 0, "missed": 0, "false": 0}
    assert all(row["chance"] > 0.99 for row in rows)
    blind = View(np.array([LAMP]), np.array([60.0]), photos=(Photo.looking(heading=30, fov=80),))
    assert explained(blind).counts["missed"] == 1  # the tree in the north


def test_photos_have_their_own_headings() -> None:
    photos = (Photo.looking(heading=10, fov=60), Photo.looking(heading=70, fov=60))
    codes, bearings = np.array([LAMP, TREE]), np.array([70.0, 10.0])
    query = View(codes, bearings, photo=np.array([1, 0]), photos=photos)
    explanation = explained(query, heading=(-10.0, 20.0))
    plain = explanation.to_dict()
    verdicts = [(row["verdict"], row["object"], row["photo"]) for row in plain["rows"]]
    assert verdicts == [("matched", 1, 1), ("matched", 0, 0), ("outside", 2, None)]
    assert (explanation.heading, explanation.headings) == (-10.0, (-10.0, 20.0))
    assert plain["headings"] == [-10.0, 20.0]


def test_ranges_distinguish_objects_in_one_direction() -> None:
    row = World(((0.0, 8.0, LAMP), (0.1, 25.0, LAMP)))
    for metres, entry in ((7.0, 0), (28.0, 1)):
        query = View(np.array([LAMP]), np.array([0.0]), ranges=np.array([metres]))
        (matched, missed) = explained(query, row).rows
        assert (matched["object"], missed["verdict"]) == (entry, "missed")


@pytest.mark.parametrize("seed", range(5))
def test_explanations_have_the_likelihood_of_the_oracle(seed: int) -> None:
    database = random_database(seed, cells=8, longest=4)
    view = random_view(database, np.random.default_rng(seed), size=1, photos=PHOTOS)
    noise = NoiseMixture(
        specs=(NoiseSpec(fading=FADING, position_sigma=2.0), NoiseSpec(detection=0.5)),
        weights=(0.4, 0.6),
    )
    explanation = explain_cell(view, 0, noise, database=database)
    assert explanation.loglik == pytest.approx(cell_loglik(database, view, noise, 0), abs=1e-4)
