from __future__ import annotations

import math
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sentences import refused
from worlds import (
    CODES,
    CORNER,
    World,
    assert_same,
    check_against_brute_force,
    lamps,
    surroundings,
    worlds,
)

from semsig_gis.core import (
    CrsError,
    EmptyResultError,
    GridSpec,
    InputError,
    SignatureSpec,
    cells_near,
    resources,
    wrap_degrees,
)
from semsig_gis.database import (
    SightingPairs,
    ViewpointSpec,
    bearings,
    build_database,
    cells,
    sightings_by_block,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray


# Cells of 2 m with their centres at whole numbers.
GRID = GridSpec(2.0, (-1.0, -1.0))


def look(
    numbers: list[tuple[int, int]] | NDArray[np.int64],
    places: object,
    ranges: float | NDArray[np.float64] = 30.0,
    grid: GridSpec = GRID,
) -> SightingPairs:
    """Return all sightings, ordered by cell and object."""
    objects = np.asarray(places, dtype=float)
    columns, rows = np.asarray(numbers).reshape(-1, 2).T
    reach = np.broadcast_to(np.float64(ranges), len(objects))
    end, parts = 0, [SightingPairs(*(np.empty(0, kind) for kind in (int, int, float, float)))]
    for block, pairs in sightings_by_block(columns, rows, objects, grid=grid, ranges=reach):
        assert block.start == end
        end = block.stop
        size = block.stop - block.start
        assert ((pairs.viewpoint >= 0) & (pairs.viewpoint < size)).all()
        assert len(pairs.object) <= cells.PAIRS_PER_BLOCK or size == 1
        viewpoint = pairs.viewpoint + block.start
        parts.append(SightingPairs(viewpoint, pairs.object, pairs.bearing, pairs.distance))
    assert end == len(columns)
    names = ("viewpoint", "object", "bearing", "distance")
    whole = SightingPairs(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))
    return whole.take(np.lexsort((whole.object, whole.viewpoint)))


def slow_look(
    cells: NDArray[np.int64],
    objects: NDArray[np.float64],
    ranges: NDArray[np.float64],
    grid: GridSpec,
) -> SightingPairs:
    """Return the sightings by measuring every pair."""
    delta = objects[None] - grid.viewpoints(*cells.T)[:, None]
    distance = np.hypot(delta[..., 0], delta[..., 1])
    bearing = wrap_degrees(np.round(bearings(delta[..., 0], delta[..., 1]), 9))
    viewpoint, item = np.nonzero(distance <= ranges)
    return SightingPairs(viewpoint, item, bearing[viewpoint, item], distance[viewpoint, item])


def assert_equal(first: SightingPairs, second: SightingPairs) -> None:
    for name in ("viewpoint", "object", "bearing", "distance"):
        assert getattr(first, name).tolist() == getattr(second, name).tolist(), name


def test_tiny_offsets_from_north_have_bearing_zero() -> None:
    pairs = look([(0, 0)], [[-1e-13, 20], [1e-13, 20], [-1e-300, 20], [-5e-7, 20]])
    assert pairs.bearing[:3].tolist() == [0.0, 0.0, 0.0]
    assert 359.9999 < pairs.bearing[3] < 360.0


@given(st.integers(-30, 30), st.integers(-30, 30), st.integers(1, 12))
def test_objects_in_one_direction_have_one_bearing(dx: int, dy: int, times: int) -> None:
    # The last digits of an arctangent depend on the processor; ties must not.
    pairs = look([(0, 0)], [[dx, dy], [dx * times, dy * times]], 600.0)
    assert pairs.bearing[0] == pairs.bearing[1]


@given(
    seed=st.integers(0, 2**32 - 1),
    step=st.sampled_from([0.5, 3.0, 7.3, 10.0, 12.5, 40.0, 1000.0]),
    radius=st.sampled_from([0.25, 5.0, 12.5, 30.0, 61.7]),
    corner=st.sampled_from([(0.0, 0.0), (765_200.0, 6_275_000.0), (-3e6, 1e7)]),
    mixed=st.sampled_from([0.0, 0.5]),
    share=st.sampled_from([1.0, 0.5, 0.02]),
    exact=st.booleans(),
    blocks=st.sampled_from([(1 << 14, 1 << 20), (7, 1 << 20), (100, 1), (1 << 14, 60)]),
)
@settings(deadline=None)
def test_sightings_equal_measuring_every_pair(
    *,
    seed: int,
    step: float,
    radius: float,
    corner: tuple[float, float],
    mixed: float,
    share: float,
    exact: bool,
    blocks: tuple[int, int],
) -> None:
    rng = np.random.default_rng(seed)
    grid = GridSpec(step, tuple(rng.uniform(-50, 50, 2)))
    size = max(2.0 * radius, step)
    objects = rng.uniform(-size, size, (12, 2)) + corner
    if exact:  # in quarters of a metre, so that objects lie exactly on circles and edges
        grid, objects = GridSpec(step, (0.25, -4.5)), np.round(objects * 4) / 4
    ranges = np.where(rng.random(12) < mixed, radius / 5, radius)
    near = np.stack(cells_near(objects, grid=grid, radius=radius), axis=-1)
    rows = np.flatnonzero(rng.random(len(near)) < max(share, 5 / len(near)))[:3000]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cells, "CELLS_PER_BLOCK", blocks[0])
        patch.setattr(cells, "PAIRS_PER_BLOCK", blocks[1])
        result = look(near[rows], objects, ranges, grid)
    assert_equal(result, slow_look(near[rows], objects, ranges, grid))


@given(worlds())
@example(World(((0.0, 0.0, 3),), step=100.0, radius=10.0))  # no cell sees an object
@example(World(((0.0, 5999.99, 3), (0.0, 0.0, 1)), step=1000.0, radius=6000.0))
# The last object is out of range of a cell by one bit; objects in one direction tie.
@example(
    World(((35.0, 5.0, 3), (5.0, -25.0, 3), (23.0, 29.0, 3), (math.nextafter(35, 99), 5.0, 3)))
)
@example(World(((14.0, 26.0, 1), (8.0, 12.0, 9), (11.0, 19.0, 5), (8.0, 12.0, 2))))
@settings(max_examples=75)
def test_a_database_equals_a_plain_loop(world: World) -> None:
    check_against_brute_force(world)


@pytest.mark.parametrize("levels", [8, 16, 24, 32])
def test_objects_on_the_edge_of_a_level_belong_to_the_next(levels: int) -> None:
    ring = [math.radians(360 * level / levels) for level in range(levels)]
    objects = tuple((5 + 20 * math.sin(a), 5 + 20 * math.cos(a), 3) for a in ring)
    database = World(objects, levels=levels).database
    cell = database.cell_ids.tolist().index(0)
    part = slice(*database.offsets[cell : cell + 2])
    assert database.levels[part].tolist() == list(range(levels))
    assert database.signature(cell).levels(levels).tolist() == list(range(levels))


@pytest.mark.parametrize("size", [1, 7, 100, 10**6])
def test_block_size_does_not_change_the_database(
    town: World, size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = town.database
    calls: list[tuple[int, int]] = []
    monkeypatch.setattr(cells, "CELLS_PER_BLOCK", size)
    parts = build_database(town.street_objects, progress=lambda *call: calls.append(call))
    assert_same(parts, whole)
    total = calls[-1][1]
    assert calls == [(min(end, total), total) for end in range(size, total + size, size)]


def test_objects_behind_buildings_are_not_visible() -> None:
    objects, house = lamps(), shapely.box(*(CORNER + 22), *(CORNER + 71))
    open_air = build_database(objects)
    hindered = build_database(objects, footprints=surroundings(house))
    assert hindered.occlusion == 0.5
    assert open_air.occlusion is None
    metric_house = surroundings(house).to_crs("EPSG:2154").geometry[0]
    expected = {}
    for cell, viewpoint in zip(open_air.cell_ids, open_air.xy, strict=True):
        pairs = [
            (xy, shapely.LineString([viewpoint, xy]))
            for xy in objects.xy
            if np.hypot(*(xy - viewpoint)) <= 30
        ]
        deep = metric_house.buffer(-0.5)
        free = deep.intersects(shapely.Point(viewpoint))
        expected[cell] = sum(free or not line.intersects(deep) for _, line in pairs)
    visible = dict(zip(hindered.cell_ids.tolist(), hindered.lengths.tolist(), strict=True))
    assert visible == {cell: size for cell, size in expected.items() if size}
    assert hindered.lengths.sum() < open_air.lengths.sum()


def test_only_viewpoints_become_cells() -> None:
    objects, house = lamps(), shapely.box(*(CORNER + 22), *(CORNER + 71))
    full = build_database(objects)
    street = shapely.LineString([CORNER, CORNER + np.array([100, 0])])
    area = shapely.box(*CORNER, *(CORNER + 50))
    outdoor = build_database(
        objects, viewpoints=ViewpointSpec(mode="outdoor"), footprints=surroundings(house)
    )
    assert not shapely.contains_xy(house.buffer(-0.1), *outdoor.xy.T).any()
    spec = ViewpointSpec(mode="streets", width=12.0, area=area)
    along = build_database(objects, viewpoints=spec, streets=surroundings(street))
    near = shapely.distance(street, shapely.points(full.xy)) <= 12.0
    near &= shapely.intersects_xy(area, *full.xy.T)
    assert along.cell_ids.tolist() == full.cell_ids[near].tolist()
    assert along.lengths.tolist() == full.lengths[near].tolist()
    streets = surroundings(street, half_width=[25.0])
    assert len(build_database(objects, viewpoints=spec, streets=streets)) > len(along)


def test_empty_results_and_missing_crs_are_refused() -> None:
    with refused(EmptyResultError, "no cell sees", "area"):
        build_database(lamps(), viewpoints=ViewpointSpec(area=shapely.box(0, 0, 10, 10)))
    bare = gpd.GeoDataFrame(geometry=[shapely.box(0, 0, 10, 10)])
    with refused(CrsError, "no coordinate reference system"):
        build_database(lamps(), footprints=bare)
    with refused(InputError, "no building footprint"):
        build_database(lamps(), footprints=bare.set_crs("EPSG:2154")[:0])
    # The lamp is deep in a building, and every viewpoint in range is outside.
    world = World(((0.0, 0.0, CODES[0]),), radius=12.0)
    house = gpd.GeoDataFrame(geometry=[shapely.box(-2, -2, 2, 2)], crs="EPSG:2154")
    with refused(EmptyResultError, "1 objects", "check", "buildings"):
        build_database(world.street_objects, spec=SignatureSpec(12.0), footprints=house)


@pytest.mark.parametrize(("radius", "step"), [(30.0, 10.0), (200.0, 20.0), (15.0, 3.0)])
def test_expected_number_of_pairs_is_near_the_actual_one(
    town: World, radius: float, step: float
) -> None:
    objects, grid = town.street_objects, GridSpec(step)
    database = build_database(objects, grid=grid, spec=SignatureSpec(radius))
    ranges = objects.taxonomy.ranges(radius)[objects.codes]
    expected = cells.expected_pairs(ranges, grid=grid, cells=10**9)
    assert expected == pytest.approx(len(database.codes), rel=0.05)
    assert cells.expected_pairs(ranges, grid=grid, cells=3) == 3 * len(objects)


def test_a_build_that_exceeds_memory_is_refused(
    town: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(resources, "free_memory", lambda: 120_000_000)
    build_database(town.street_objects)
    with refused(InputError, "sightings", "0.1 GB are free", "smaller tiles"):
        build_database(town.street_objects, spec=SignatureSpec(3000.0))
    with refused(InputError, "cells of 6.5 m within 6000 m", "free"):
        build_database(town.street_objects, grid=GridSpec(6.5), spec=SignatureSpec(6000.0))
    with refused(InputError, "more than the 2,147,483,647 that one file can contain"):
        cells.require_room(3e9, cells=10, objects=10**6)
