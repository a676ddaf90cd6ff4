from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import (
    distorted,
    every_association,
    mixtures,
    parts_of,
    random_database,
    random_query,
    turned_query,
)

from semsig_gis.core.signature import Signature
from semsig_gis.likelihood.association import align_cells, rerank
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.noise.model import NoiseSpec, named_noise
from semsig_gis.likelihood.noise.table import database_tables, query_bearings

if TYPE_CHECKING:
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.likelihood.noise.model import Noise
    from semsig_gis.likelihood.noise.table import NoiseTable

SEEDS = st.integers(0, 10_000)


def pair_weights(
    table: NoiseTable, database: SignatureDatabase, query: Signature, cell: int
) -> np.ndarray:
    """Return what each pair of an object and a detection adds."""
    part = slice(database.offsets[cell], database.offsets[cell + 1])
    kinds = table.row_of[database.codes[part]]
    sigmas = table.sigmas(database.reach)[kinds, database.distance_units[part]]
    names, length = table.query_rows(query), len(kinds)
    weights = np.zeros((length, len(query)))
    for one, other in np.ndindex(weights.shape):
        bearing = database.bearings[part][one] + 0.025
        away = (query_bearings(query)[other] - bearing + 180.0) % 360.0 - 180.0
        if abs(away) <= 4.5 * sigmas[one]:
            laps = away + 360.0 * np.arange(-4, 5)
            weights[one, other] = (
                table.odds[length, kinds[one]]
                * table.naming[length, kinds[one], names[other]]
                * np.exp(-0.5 * (laps / sigmas[one]) ** 2).sum()
                / (sigmas[one] * math.sqrt(2 * math.pi))
            )
    return weights


def slow_loglik(database: SignatureDatabase, query: Signature, noise: Noise, cell: int) -> float:
    """Return the likelihood by going through all associations."""
    total = 0.0
    for table, share in zip(*database_tables(database, noise), strict=True):
        unseen = table.nothing_seen(database.offsets, table.row_of[database.codes])[cell]
        clutter = np.log(table.density[table.query_rows(query)]).sum()
        pairs, _ = every_association(pair_weights(table, database, query, cell))
        total += share * math.exp(unseen + clutter + pairs)
    return math.log(total)


@settings(max_examples=40)
@given(SEEDS, mixtures(), st.integers(1, 5))
def test_the_sum_over_associations_is_close_and_never_too_large(
    seed: int, noise: Noise, size: int
) -> None:
    database = random_database(seed, cells=6, longest=5)
    query = random_query(database, seed, size=size)
    cells = np.arange(len(database))
    found = align_cells(database, query, noise, cells)
    for cell in cells.tolist():
        exact = slow_loglik(database, query, noise, cell)
        assert found[cell] <= exact + 1e-3
        # Half the logarithm of two for each object is the most that loops can cost.
        loops = min(len(query), int(database.lengths[cell]))
        assert found[cell] >= exact - 0.35 * loops - 1e-3


@settings(max_examples=30)
@given(SEEDS, st.floats(0.0, 20.0))
def test_it_is_exact_where_pairs_form_no_loop(seed: int, away: float) -> None:
    # Objects far apart: no detection can be two of them, though two may be one.
    rng = np.random.default_rng(seed)
    database = random_database(seed, cells=1, longest=1).select(np.zeros(6, np.int64))
    units = np.arange(6) * 1200
    database = replace(
        database,
        columns=np.zeros(1, np.int32),
        rows=np.zeros(1, np.int32),
        offsets=np.array([0, 6]),
        codes=rng.integers(1, 4, 6).astype(np.uint8),
        bearing_units=units.astype(np.uint16),
    )
    noise = NoiseSpec(bearing_sigma=5.0)
    bearings = (np.repeat(units / 20.0, 2)[:5] + np.array([0.0, 1.0, -2.0, 3.0, away])) % 360.0
    query = Signature(rng.choice(database.present_codes, 5), bearings)
    found = align_cells(database, query, noise, np.zeros(1, np.int64))[0]
    assert found == pytest.approx(slow_loglik(database, query, noise, 0), abs=1e-3)


def test_one_object_explains_one_detection_only() -> None:
    database = random_database(1, cells=30, longest=6)
    noise = named_noise("light")
    query = database.signature(0)
    doubled = Signature(*(np.repeat(part, 2) for part in parts_of(query)))
    (together,) = align_cells(database, doubled, noise, np.zeros(1, np.int64))
    apart = build_index(database, noise).scores(doubled).loglik[0]
    assert apart - together > 2.0 * len(query)


def test_turns_are_those_of_a_turned_query() -> None:
    database = random_database(4)
    query = random_query(database, 4, size=7)
    noise = named_noise("generic")
    cells = np.array([3, 8, 0])
    turns = np.array([[0.0, 30.0], [-200.0, 400.0], [7.0, 8.0]])
    found = align_cells(database, query, noise, cells, turns=turns)
    for place, way in np.ndindex(turns.shape):
        turned = turned_query(query, float(turns[place, way]))
        alone = align_cells(database, turned, noise, cells[[place]])
        assert found[place, way] == pytest.approx(alone[0], abs=1e-3)


def test_re_ranking_replaces_the_best_and_moves_the_rest_together() -> None:
    database = random_database(2, cells=300)
    noise = named_noise("generic")
    index = build_index(database, noise)
    query = random_query(database, 2, size=8)
    scores = index.scores(query)
    found = rerank(index, query, scores, count=40)
    best = np.argsort(-scores.loglik, kind="stable")
    inside, outside = best[:40], best[40:]
    assert found.loglik[inside] == pytest.approx(align_cells(database, query, noise, inside))
    moved = found.loglik[outside] - scores.loglik[outside]
    assert np.ptp(moved) < 1e-9
    worse = best[20:40]
    assert moved[0] == pytest.approx(
        np.logaddexp.reduce(found.loglik[worse]) - np.logaddexp.reduce(scores.loglik[worse]),
        abs=1e-4,
    )
    everything = rerank(index, query, scores, count=10_000).loglik
    assert everything == pytest.approx(align_cells(database, query, noise, np.arange(300)))


def test_a_prior_chooses_what_is_re_ranked() -> None:
    database = random_database(2, cells=300)
    index = build_index(database, named_noise("medium"))
    query = random_query(database, 2, size=8)
    scores = index.scores(query)
    prior = np.full(300, -np.inf)
    prior[:5] = 0.0
    found = rerank(index, query, scores, count=40, log_prior=prior)
    expected = align_cells(database, query, index.noise, np.arange(5))
    assert found.loglik[:5] == pytest.approx(expected)


@pytest.mark.parametrize("north_sigma", [10.0, math.inf])
def test_the_heading_is_found_finer_than_the_index_has_it(north_sigma: float) -> None:
    database = random_database(3, cells=100, longest=20)
    cell = int(database.lengths.argmax())
    query = turned_query(database.signature(cell), -7.0)
    index = build_index(database, named_noise("light"))
    scores = index.scores(query, north_sigma=north_sigma)
    found = rerank(index, query, scores, north_sigma=north_sigma)
    assert int(found.loglik.argmax()) == cell
    assert found.heading is not None
    assert abs(found.heading[cell] - 7.0) <= 1.5


def test_it_finds_more_than_the_index_alone() -> None:
    database = random_database(7, cells=400, longest=10, classes=2)
    index = build_index(database, named_noise("generic"))
    right = {"index": 0, "re-ranked": 0}
    for cell in range(60):
        rng = np.random.default_rng([cell, 5])
        query = distorted(database, cell, rng)
        if len(query) == 0:
            continue
        scores = index.scores(query)
        right["index"] += int(scores.loglik.argmax()) == cell
        right["re-ranked"] += int(rerank(index, query, scores).loglik.argmax()) == cell
    assert right["re-ranked"] > right["index"]


def test_a_query_without_bearings_keeps_its_scores() -> None:
    index = build_index(random_database(2), named_noise("medium"))
    types = Signature(np.array([1, 2], np.uint8), None)
    scores = index.scores(types)
    assert rerank(index, types, scores) is scores
