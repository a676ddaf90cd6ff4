from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from sentences import refused
from worlds import CODES, TOWN, World, worlds

from semsig_gis.core import (
    EmptyResultError,
    GridSpec,
    InputError,
    ObjectIndex,
    cell_ids,
    wrap_degrees,
)
from semsig_gis.database import (
    Footprints,
    ViewpointSpec,
    bearings,
    choose_viewpoints,
    viewpoints,
    visible_objects_at,
    visible_objects_in,
)
from semsig_gis.localization import visible_objects_off_centre

if TYPE_CHECKING:
    from semsig_gis.database import ViewpointMode


# --- Viewpoints -------------------------------------------------------------------------------

GRID = GridSpec(step=10.0)
CELLS = tuple(part.ravel() for part in np.meshgrid(np.arange(10), np.arange(10), indexing="ij"))
LINE = shapely.LineString([(0, 5), (100, 5)])
CENTRES = [shapely.Point(xy) for xy in GRID.viewpoints(*CELLS)]


def choose(spec: ViewpointSpec, **surroundings: Any) -> list[bool]:  # noqa: ANN401
    mask: list[bool] = choose_viewpoints(*CELLS, grid=GRID, spec=spec, **surroundings).tolist()
    return mask


def test_modes_and_areas_choose_viewpoints() -> None:
    yard = shapely.box(0, 0, 70, 70) - shapely.box(21, 21, 49, 49)
    area = shapely.Polygon([(0, 0), (100, 0), (0, 100)])
    footprints = Footprints([yard])
    assert all(choose(ViewpointSpec(), footprints=footprints))
    mask = choose(ViewpointSpec(mode="outdoor"), footprints=footprints)
    assert mask == [not yard.intersects(centre) for centre in CENTRES]
    assert choose(ViewpointSpec(area=area)) == [area.intersects(centre) for centre in CENTRES]
    mask = choose(ViewpointSpec(mode="streets", area=shapely.box(0, 0, 30, 30)), streets=[LINE])
    assert [index for index, is_viewpoint in enumerate(mask) if is_viewpoint] == [0, 10, 20]


def test_centres_in_buildings_along_a_street_are_no_viewpoints() -> None:
    arcade = shapely.box(30, 0, 55, 10)  # contains two centres, and a third is on its outline
    spec, footprints = ViewpointSpec(mode="streets", width=1.0), Footprints([arcade])
    assert sum(choose(spec, streets=[LINE])) == 10
    mask = choose(spec, streets=[LINE], footprints=footprints)
    assert [number // 10 for number, is_viewpoint in enumerate(mask) if is_viewpoint] == [
        0,
        1,
        2,
        6,
        7,
        8,
        9,
    ]


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.sampled_from([7, 1 << 18]))
def test_viewpoints_along_streets_equal_a_plain_loop(seed: int, block: int) -> None:
    rng = np.random.default_rng(seed)
    lines = [shapely.LineString(rng.uniform(0, 100, (3, 2))) for _ in range(6)]
    widths = rng.uniform(1, 20, 6)
    widths[0] = np.nan
    reaches = np.where(np.isnan(widths), 8.0, widths)
    spec = ViewpointSpec(mode="streets")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(viewpoints, "PLACES_PER_BLOCK", block)
        equal = choose(spec, streets=[*lines, None, shapely.LineString()])
        own = choose(spec, streets=lines, widths=widths)
    assert equal == [min(line.distance(centre) for line in lines) <= 8 for centre in CENTRES]
    assert own == [
        any(line.distance(centre) <= reach for line, reach in zip(lines, reaches, strict=True))
        for centre in CENTRES
    ]


@pytest.mark.parametrize(
    ("mode", "surroundings", "words"),
    [
        ("outdoor", {}, ["outdoor", "footprints"]),
        ("streets", {}, ["streets", "centre lines"]),
        ("streets", {"streets": [shapely.Point(0, 0)]}, ["Point", "centre lines"]),
        ("streets", {"streets": [None]}, ["no street", "centre lines"]),
        ("streets", {"streets": [LINE], "widths": [0.0]}, ["half-widths", "above 0"]),
    ],
)
def test_missing_or_invalid_surroundings_are_refused(
    mode: ViewpointMode, surroundings: dict[str, Any], words: list[str]
) -> None:
    with refused(InputError, *words):
        choose(ViewpointSpec(mode=mode), **surroundings)


def test_invalid_viewpoint_specs_are_refused() -> None:
    with refused(InputError, "'street'", "nearest is 'streets'"):
        ViewpointSpec(mode="street")  # type: ignore[arg-type]
    for width in (0.0, -1.0, np.nan):
        with refused(InputError, "half-width", "from 0.05"):
            ViewpointSpec(width=width)
    for area in (shapely.Point(0, 0), shapely.Polygon()):
        with refused(InputError, area.geom_type, "give a polygon"):
            ViewpointSpec(area=area)  # type: ignore[arg-type]


def test_a_viewpoint_spec_survives_json() -> None:
    area = shapely.Polygon(np.random.default_rng(0).uniform(6e6, 7e6, (3, 2)))
    for spec in (ViewpointSpec(), ViewpointSpec(mode="streets", width=5.5, area=area)):
        assert ViewpointSpec.from_dict(json.loads(json.dumps(spec.to_dict()))) == spec
    with refused(InputError, "WKT"):
        ViewpointSpec.from_dict({"mode": "all", "width": 8.0, "area": "POLYGON (("})


# --- Visible objects --------------------------------------------------------------------------


def test_bearings_count_clockwise_from_north() -> None:
    dx, dy = [0, 7, 7, 7, 0, -7, -7], [7, 7, 0, -7, -7, -7, 0]
    assert bearings(dx, dy).tolist() == [0, 45, 90, 135, 180, 225, 270]
    assert bearings([0.0, -0.0, 0.0, -0.0], [0.0, 0.0, -0.0, -0.0])[0] == 0.0
    # A tiny negative angle does not become a whole turn.
    assert bearings([-1e-300, -5e-324], [1.0, 30.0]).tolist() == [0.0, 0.0]
    assert bearings(np.zeros((0, 3)), 0.0).shape == (0, 3)


@given(st.floats(allow_nan=False), st.floats(allow_nan=False))
def test_a_bearing_is_the_wrapped_arctangent(dx: float, dy: float) -> None:
    bearing = bearings(dx, dy)
    assert bearing == wrap_degrees(np.degrees(np.arctan2(dx, dy)))
    assert not np.signbit(bearing)


@given(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4))
def test_a_bearing_points_along_its_displacement(dx: float, dy: float) -> None:
    bearing = float(bearings(dx, dy))
    length = math.hypot(dx, dy)
    assert 0.0 <= bearing < 360.0
    assert math.isclose(length * math.sin(math.radians(bearing)), dx, abs_tol=1e-9)
    assert math.isclose(length * math.cos(math.radians(bearing)), dy, abs_tol=1e-9)


@given(worlds())
def test_visible_objects_of_cells_equal_those_at_their_viewpoints(world: World) -> None:
    objects = world.street_objects
    try:
        database = world.database
    except EmptyResultError:
        return
    cells = np.arange(len(database))[::-1]
    stored = visible_objects_in(database, cells)
    exact = visible_objects_at(
        objects, database.xy[cells], index=ObjectIndex(objects.xy), radius=world.radius
    )
    assert stored.offsets.tolist() == exact.offsets.tolist()
    assert stored.codes.tolist() == exact.codes.tolist() == objects.codes[exact.objects].tolist()
    assert np.abs(stored.bearings - exact.bearings).max(initial=0) <= 0.025 + 1e-9
    assert np.abs(stored.distances - exact.distances).max(initial=0) <= database.reach / 510 + 1e-9
    assert (stored.objects == -1).all()
    assert len(stored) == len(database)


@given(
    worlds(), st.lists(st.tuples(st.floats(-40, 40), st.floats(-40, 40)), min_size=1, max_size=8)
)
def test_visible_objects_are_those_in_range_clockwise(
    world: World, places: list[tuple[float, float]]
) -> None:
    objects = world.street_objects
    index, at = ObjectIndex(objects.xy), np.concatenate([objects.xy[:3], np.array(places)])
    visible = visible_objects_at(objects, at, index=index, radius=world.radius)
    assert len(visible) == len(at)
    ranges = objects.taxonomy.ranges(world.radius)[objects.codes]
    for number, place in enumerate(at):
        away = objects.xy - place
        metres = np.hypot(*away.T)
        degrees = np.round(bearings(*away.T), 9) % 360.0
        order = np.lexsort((objects.codes, metres, degrees))
        order = order[metres[order] <= ranges[order]]
        part = slice(*visible.offsets[number : number + 2])
        # Objects at one place with one class may change places.
        assert visible.codes[part].tolist() == objects.codes[order].tolist()
        assert sorted(visible.objects[part].tolist()) == sorted(order.tolist())
        assert visible.bearings[part] == pytest.approx(degrees[order], abs=2e-9)
        assert visible.distances[part] == pytest.approx(metres[order])


def test_visible_objects_are_not_behind_buildings() -> None:
    world = World(((10.0, 0.0, CODES[0]), (-10.0, 0.0, CODES[0])))
    objects = world.street_objects
    wall = Footprints([shapely.box(4.0, -2.0, 6.0, 2.0)])
    visible = visible_objects_at(
        objects, np.array([[0.0, 0.0]]), index=ObjectIndex(objects.xy), radius=30.0, footprints=wall
    )
    assert visible.objects.tolist() == [1]
    assert visible.bearings.tolist() == [270.0]


def test_objects_off_the_centre_of_a_cell_are_near_the_exact_ones() -> None:
    database, objects = TOWN.database, TOWN.street_objects
    # Cells with all eight neighbours.
    east, north = (part.ravel() for part in np.meshgrid([-1, 0, 1], [-1, 0, 1]))
    ids = cell_ids(database.columns[:, None] + east, database.rows[:, None] + north)
    cells = np.flatnonzero(np.isin(ids, database.cell_ids).all(axis=1))
    assert len(cells) > 20
    index = ObjectIndex(objects.xy)
    places = np.array([[0.0, 0.0], [3.0, 0.0], [-3.0, 2.0], [0.0, -4.0]])
    estimate = visible_objects_off_centre(database, cells, places)
    assert len(estimate) == len(places) * len(cells)
    for number, place in enumerate(places):
        views = np.arange(number, len(estimate), len(places))
        exact = visible_objects_at(objects, database.xy[cells] + place, index=index, radius=30.0)
        # The estimate errs by some decimetres, by which an object may be in range or not.
        same = estimate.lengths[views] == exact.lengths
        assert same.mean() > 0.9
        for cell in np.flatnonzero(same).tolist():
            rows = (estimate, int(views[cell])), (exact, cell)
            parts = [slice(*view.offsets[row : row + 2]) for view, row in rows]
            near, expected = (
                np.lexsort((view.distances[part], view.codes[part]))
                for (view, _), part in zip(rows, parts, strict=True)
            )
            assert (estimate.codes[parts[0]][near] == exact.codes[parts[1]][expected]).all()
            metres = estimate.distances[parts[0]][near] - exact.distances[parts[1]][expected]
            assert np.abs(metres).max() < 0.3
