"""Landmarks seen from far away: bearings to a few of them are a resection."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from worlds import objects_of

from semsig_gis.core import GridSpec, ObjectClass, SignatureSpec
from semsig_gis.database import ObjectStore, build_database
from semsig_gis.localization import (
    NoiseSpec,
    PhotoTable,
    build_index,
    cell_noise,
    database_tables,
    locate,
)
from semsig_gis.observation import View
from semsig_gis.sources import paper_taxonomy

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.objects import StreetObjects

TOWER = ObjectClass(232, "T", "tower", "Tower", range_m=2000.0, tall=True)
# Cells are within 100 m of an object; these are too small to be seen from most of them.
STONE = ObjectClass(233, "S", "stone", "Stone", range_m=1.0)
STONES = [(x, y) for x in range(0, 1401, 140) for y in range(0, 1201, 140)]
TOWERS = np.array([[0.0, 0.0], [1400.0, 100.0], [500.0, 1200.0]])
NOISE = NoiseSpec(detection=0.9, misnamed=0.02, clutter=0.1, bearing_sigma=1.5)


@pytest.fixture(scope="module")
def towers() -> StreetObjects:
    things = [(x, y, TOWER.code, "map", str(row)) for row, (x, y) in enumerate(TOWERS.tolist())]
    things += [(x, y, STONE.code, "map", f"{x} {y}") for x, y in STONES]
    taxonomy = paper_taxonomy().extended([TOWER, STONE])
    return objects_of(*things, licenses=(), taxonomy=taxonomy)


@pytest.fixture(scope="module")
def far_city(towers: StreetObjects) -> SignatureDatabase:
    return build_database(towers, grid=GridSpec(step=25.0), spec=SignatureSpec(radius=30.0))


def view_from(place: np.ndarray, rng: np.random.Generator) -> View:
    away = TOWERS - place
    bearings = np.degrees(np.arctan2(away[:, 0], away[:, 1])) + rng.normal(0.0, 1.0, len(away))
    order = np.argsort(bearings % 360.0)
    return View(np.full(len(away), TOWER.code, np.uint8), (bearings % 360.0)[order])


def test_bearings_of_only_three_landmarks_give_the_place(
    towers: StreetObjects, far_city: SignatureDatabase
) -> None:
    rng = np.random.default_rng(36)
    index = build_index(far_city, cell_noise(NOISE, far_city.grid.step))
    for place in rng.uniform([200.0, 100.0], [1200.0, 1000.0], (6, 2)):
        view = view_from(place, rng)
        store = ObjectStore.of(towers)
        for refined in (False, True):
            location = locate(index, view, surely_here=True, store=store, refined=refined)
            assert math.dist(place, location.xy) < 100.0


def test_landmarks_at_the_edge_of_their_range_are_seen(far_city: SignatureDatabase) -> None:
    (table,), _ = database_tables(far_city, cell_noise(NOISE, far_city.grid.step))
    row = int(table.row_of[TOWER.code])
    # All but some metres of the last unit of 42 m are in range.
    assert table.inside[row, 254] > 0.999
    assert 0.7 < table.inside[row, 255] < 1.0


def test_a_false_object_is_within_the_range_of_its_class(far_city: SignatureDatabase) -> None:
    (table,), _ = database_tables(far_city, NOISE)
    view = View(np.array([TOWER.code], np.uint8), np.zeros(1), ranges=np.array([500.0]))
    assert PhotoTable.of(view, table).disc == pytest.approx(2.0 * (500.0 / 2000.0) ** 2)
