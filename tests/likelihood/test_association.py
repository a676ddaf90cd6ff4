from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import (
    every_association,
    mixtures,
    noise_specs,
    noisy_town,
    random_database,
    random_query,
)

from semsig_gis.core.rtree import ObjectIndex
from semsig_gis.core.signature import Signature
from semsig_gis.database.visibility import views_at, views_in
from semsig_gis.likelihood.association import (
    Pairs,
    align_cells,
    associate_pairs,
    near_pairs,
    pair_weights,
)
from semsig_gis.likelihood.noise.table import database_tables, place_loglik, query_bearings

if TYPE_CHECKING:
    from semsig_gis.likelihood.noise.model import Noise, NoiseSpec


def pairs_of(weights: np.ndarray) -> tuple[Pairs, np.ndarray]:
    one, other = np.nonzero(weights)
    starts, away = np.array([0, len(one)]), np.zeros(len(one))
    pairs = Pairs(starts=starts, objects=one, detections=other, away=away)
    return pairs, weights[one, other]


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
    pairs, flat = pairs_of(weights)
    near, sums = associate_pairs(pairs, flat)
    assert sums[0] == pytest.approx(total, abs=1e-3)
    assert near == pytest.approx(chances[pairs.objects, pairs.detections], abs=2e-3)


@given(st.integers(0, 10_000))
def test_belief_propagation_is_near_the_sum_over_everything(seed: int) -> None:
    rng = np.random.default_rng(seed)
    weights = np.exp(rng.normal(0.0, 2.0, (4, 4)))
    total, chances = every_association(weights)
    pairs, flat = pairs_of(weights)
    near, sums = associate_pairs(pairs, flat)
    assert sums[0] == pytest.approx(total, abs=0.35)
    assert sums[0] <= total + 1e-3  # the Bethe approximation is a lower bound
    assert np.abs(near.reshape(4, 4) - chances).max() < 0.2
    assert (near.reshape(4, 4).sum(axis=0) <= 1 + 1e-3).all()


def test_problems_do_not_touch_each_other() -> None:
    rng = np.random.default_rng(1)
    starts = np.array([0, 3, 3, 8]), np.array([0, 2, 4, 9])
    bearings = rng.uniform(0, 360, 8), rng.uniform(0, 360, 9)
    pairs = near_pairs(starts[0], bearings[0], starts[1], bearings[1], reach=120.0)
    weights = rng.uniform(0, 3, len(pairs.away))
    chances, sums = associate_pairs(pairs, weights)
    for row in range(3):
        here = [slice(*part[row : row + 2]) for part in starts]
        alone = near_pairs(
            np.array([0, here[0].stop - here[0].start]),
            bearings[0][here[0]],
            np.array([0, here[1].stop - here[1].start]),
            bearings[1][here[1]],
            reach=120.0,
        )
        part = slice(*pairs.starts[row : row + 2])
        assert pairs.objects[part].tolist() == (alone.objects + here[0].start).tolist()
        own_chances, own_sums = associate_pairs(alone, weights[part])
        assert own_chances == pytest.approx(chances[part])
        assert own_sums[0] == pytest.approx(sums[row])
    assert sums[1] == 0.0


@given(st.integers(0, 1000), st.integers(1, 12), noise_specs())
def test_the_sums_are_those_of_the_re_ranking(seed: int, size: int, noise: NoiseSpec) -> None:
    database = random_database(seed)
    query = random_query(database, seed, size=size)
    (table,), _ = database_tables(database, noise)
    cells = np.arange(len(database))
    views = views_in(database, cells)
    starts = np.arange(len(database) + 1) * size
    pairs = near_pairs(
        views.offsets, views.bearings, starts, np.tile(query_bearings(query), len(cells))
    )
    names = table.query_rows(query)
    kinds = table.row_of[views.codes]
    weights = pair_weights(
        table,
        pairs,
        kinds=kinds,
        distances=views.distances,
        lengths=np.repeat(views.lengths, views.lengths),
        names=np.tile(names, len(cells)),
    )
    # The re-ranking cuts the tails.
    weights[np.abs(pairs.away) > 4.5 * table.sigma[kinds][pairs.objects]] = 0.0
    _, sums = associate_pairs(pairs, weights)
    unseen = table.nothing_seen(database.offsets, kinds)
    expected = align_cells(database, query, noise, cells)
    assert sums + unseen + np.log(table.density[names]).sum() == pytest.approx(expected, abs=0.05)


@given(st.integers(0, 50), mixtures())
def test_at_the_viewpoints_places_have_the_likelihood_of_the_cells(seed: int, noise: Noise) -> None:
    world = noisy_town(seed)
    database, objects = world.database, world.street_objects
    rng = np.random.default_rng(seed)
    cells = rng.choice(len(database), 5, replace=False)
    query = Signature(rng.choice(database.present_codes, 6), rng.uniform(0, 360, 6))
    turns = rng.uniform(-180, 180, (5, 2))
    models = database_tables(database, noise)
    views = views_at(objects, database.xy[cells], index=ObjectIndex(objects.xy), radius=30.0)
    loglik = place_loglik(query, views, *models, turns=turns, reach=30.0)
    assert loglik == pytest.approx(
        align_cells(database, query, noise, cells, turns=turns), abs=1e-6
    )
