from __future__ import annotations

import numpy as np
import shapely
from hypothesis import given
from worlds import CODES, World, worlds

from semsig_gis.core.errors import EmptyResultError
from semsig_gis.core.rtree import ObjectIndex
from semsig_gis.database.database import views_in
from semsig_gis.database.occlusion import Footprints
from semsig_gis.database.views import views_at


@given(worlds())
def test_the_viewpoints_of_a_database_see_what_it_says(world: World) -> None:
    objects = world.street_objects
    try:
        database = world.database
    except EmptyResultError:
        return
    cells = np.arange(len(database))[::-1]
    stored = views_in(database, cells)
    exact = views_at(
        objects,
        database.xy[cells],
        index=ObjectIndex(objects.xy),
        radius=world.radius,
    )
    assert stored.offsets.tolist() == exact.offsets.tolist()
    assert stored.codes.tolist() == exact.codes.tolist() == objects.codes[exact.objects].tolist()
    assert np.abs(stored.bearings - exact.bearings).max(initial=0) <= 0.025 + 1e-9
    assert np.abs(stored.distances - exact.distances).max(initial=0) <= database.reach / 510 + 1e-9
    assert (stored.objects == -1).all()
    assert len(stored) == len(database)


def test_buildings_hide() -> None:
    world = World(((10.0, 0.0, CODES[0]), (-10.0, 0.0, CODES[0])))
    objects = world.street_objects
    wall = Footprints([shapely.box(4.0, -2.0, 6.0, 2.0)])
    seen = views_at(
        objects,
        np.array([[0.0, 0.0]]),
        index=ObjectIndex(objects.xy),
        radius=30.0,
        footprints=wall,
    )
    assert seen.objects.tolist() == [1]
    assert seen.bearings.tolist() == [270.0]
