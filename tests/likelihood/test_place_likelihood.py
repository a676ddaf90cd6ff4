from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import mixtures
from sentences import assert_sentence
from worlds import CODES, CORNER, World

from semsig_gis.core.errors import InputError
from semsig_gis.core.rtree import ObjectIndex
from semsig_gis.core.signature import Signature
from semsig_gis.database.visibility import views_at
from semsig_gis.likelihood.association import place_loglik
from semsig_gis.likelihood.noise.model import NoiseSpec
from semsig_gis.likelihood.noise.table import noise_tables
from semsig_gis.likelihood.rerank import align_cells

if TYPE_CHECKING:
    from semsig_gis.likelihood.noise.model import Noise


def town(seed: int) -> World:
    rng = np.random.default_rng(seed)
    places = rng.uniform(0, 200, (90, 2)) + CORNER
    return World(tuple((x, y, int(rng.choice(CODES[:5]))) for x, y in places.tolist()))


@given(st.integers(0, 50), mixtures())
def test_at_the_viewpoints_it_is_the_likelihood_of_the_re_ranking(seed: int, noise: Noise) -> None:
    world = town(seed)
    database, objects = world.database, world.street_objects
    rng = np.random.default_rng(seed)
    cells = rng.choice(len(database), 5, replace=False)
    query = Signature(rng.choice(database.present_codes, 6), rng.uniform(0, 360, 6))
    turns = rng.uniform(-180, 180, (5, 2))
    tables, weights = noise_tables(
        noise,
        taxonomy=objects.taxonomy,
        codes=database.present_codes,
        longest=int(database.lengths.max()),
    )
    views = views_at(objects, database.xy[cells], index=ObjectIndex(objects.xy), radius=30.0)
    found = place_loglik(query, views, tables, weights, turns=turns, reach=30.0)
    expected = align_cells(database, query, noise, cells, turns=turns)
    assert found == pytest.approx(expected, abs=1e-6)


def test_bearings_are_needed() -> None:
    world = town(0)
    objects = world.street_objects
    tables, weights = noise_tables(
        NoiseSpec(), taxonomy=objects.taxonomy, codes=np.unique(objects.codes), longest=9
    )
    views = views_at(objects, objects.xy[:1], index=ObjectIndex(objects.xy), radius=30.0)
    query = Signature(objects.codes[:1], None)
    with pytest.raises(InputError) as caught:
        place_loglik(query, views, tables, weights, turns=np.zeros((1, 1)), reach=30.0)
    assert_sentence(caught.value, "bearings")
