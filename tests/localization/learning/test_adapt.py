"""Noise models that are adapted to views of unknown places."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from sentences import refused
from worlds import random_town

from semsig_gis.core import InputError
from semsig_gis.database import ObjectStore
from semsig_gis.localization import NoiseSpec, adapt_noise
from semsig_gis.observation import View

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase

    Town = tuple[SignatureDatabase, ObjectStore, list[View]]

VIEWS = 40
SEEN = 0.6
SIGMA = 1.0
START = NoiseSpec(detection=0.9, misnamed=0.02, clutter=0.5, bearing_sigma=8.0)


@pytest.fixture(scope="module")
def town() -> Town:
    """Return a town, its objects, and views of a detector that sees six of ten objects."""
    world = random_town(5)
    database, store = world.database, ObjectStore.of(world.street_objects)
    dice = np.random.default_rng(1)
    views = []
    for cell in dice.permutation(len(database)):
        signature = database.signature(int(cell))
        mask = dice.random(len(signature)) < SEEN
        if mask.sum() >= 4:
            detected = signature.select(np.flatnonzero(mask))
            bearings = (detected.bearings + dice.normal(0.0, SIGMA, mask.sum())) % 360.0
            views.append(View(detected.codes, bearings))
        if len(views) == VIEWS:
            break
    return database, store, views


def test_noise_moves_to_the_detector(town: Town) -> None:
    database, store, views = town
    adaptation = adapt_noise(views, database, START, store=store)
    assert adaptation.adapted
    assert adaptation.gain > adaptation.gain_sigma > 0
    assert adaptation.views == VIEWS
    *learnt, start = adaptation.noise.specs
    assert start == START
    assert adaptation.noise.weights[-1] == pytest.approx(0.2)
    for spec in learnt:
        assert spec.bearing_sigma < START.bearing_sigma
    assert f"adapted to {VIEWS} views" in adaptation.sentence


def test_noise_stays_where_views_show_no_better(town: Town) -> None:
    database, store, views = town
    truth = NoiseSpec(detection=SEEN, misnamed=1e-3, clutter=1e-3, bearing_sigma=SIGMA)
    adaptation = adapt_noise(views[:20], database, truth, store=store)
    assert not adaptation.adapted
    assert adaptation.noise == truth
    assert "do not show" in adaptation.sentence


def test_too_few_views_are_refused(town: Town) -> None:
    database, store, views = town
    with refused(InputError, "19 views", "at least 20"):
        adapt_noise(views[:19], database, START, store=store)
