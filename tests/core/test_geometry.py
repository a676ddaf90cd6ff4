from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import CRS, Proj
from sentences import refused

from semsig_gis.core import (
    CrsError,
    GridSpec,
    InputError,
    angular_distance,
    cell_ids,
    cells_near,
    grid_convergence,
    require_metric_crs,
    split_ids,
    wrap_degrees,
)

# --- Coordinate reference systems -------------------------------------------------------------

METRIC = {
    "Lambert-93": 2154,
    "as text": "EPSG:2154",
    "UTM": "EPSG:32631",
    "UTM south": "EPSG:32733",
    "a PROJ string": "+proj=utm +zone=31 +ellps=GRS80 +type=crs",
    "a Transverse Mercator of one's own": "+proj=tmerc +lat_0=43 +lon_0=3.8 +type=crs",
    "with a datum shift": "+proj=tmerc +lon_0=3 +ellps=GRS80 +towgs84=1,2,3 +type=crs",
    "British grid": "EPSG:27700",
    "Belgian Lambert": "EPSG:31370",
    "Dutch stereographic": "EPSG:28992",
    "northing first": "EPSG:31467",
    "Swiss grid, an oblique Mercator": "EPSG:2056",
    "Hungarian grid, an oblique Mercator": "EPSG:23700",
    "Malaysian grid, an oblique Mercator": "EPSG:3375",
    "with a height": "EPSG:2154+5773",
    "three-dimensional": "EPSG:9895",
    "a .prj file of ESRI": CRS("EPSG:2154").to_wkt("WKT1_ESRI"),
    "the American metre": CRS("EPSG:32631").to_wkt("WKT1_GDAL").replace('"metre"', '"meter"'),
}
REFUSED = {
    "WGS 84": ("EPSG:4326", "WGS 84 is in degrees"),
    "RGF93": ("EPSG:4171", "in degrees"),
    "degrees with a height": ("EPSG:4979", "in degrees"),
    "degrees and a height system": ("EPSG:4326+5773", "in degrees"),
    "Web Mercator": ("EPSG:3857", "Mercator"),
    "Web Mercator with a height": ("EPSG:3857+5773", "Mercator"),
    "Web Mercator by ESRI": ("ESRI:102100", "Mercator"),
    "World Mercator": ("EPSG:3395", "Mercator"),
    "World Mercator by ESRI": ("ESRI:54004", "Mercator"),
    "Mercator with a datum shift": ("+proj=merc +ellps=GRS80 +towgs84=0,0,0 +type=crs", "Mercator"),
    "plate carree": ("EPSG:4087", "cylindrical"),
    "equal-area cylinder": ("EPSG:6933", "cylindrical"),
    "feet": ("EPSG:2263", "not in metres"),
    "kilometres": ("+proj=utm +zone=31 +units=km +type=crs", "not in metres"),
    "geocentric": ("EPSG:4978", "is geocentric, not projected"),
    "local": ('LOCAL_CS["site",UNIT["metre",1]]', "is engineering, not projected"),
    "vertical": ("EPSG:5773", "is vertical, not projected"),
    "south-orientated": ("EPSG:2048", "east and north"),
    "Krovak, south and west": ("EPSG:5513", "east and north"),
    "polar": ("EPSG:3031", "east and north"),
    "nothing": (None, "no coordinate reference system was given"),
    "empty": ("", "unknown"),
    "nonsense": ("Lambert", "'Lambert' is unknown"),
    "a code that is not": ("EPSG:999999", "'EPSG:999999' is unknown"),
    "a number that is no code": (0, "unknown"),
}


@pytest.mark.parametrize("crs", METRIC.values(), ids=METRIC)
def test_metric_crs_is_accepted(crs: str | int) -> None:
    system = require_metric_crs(crs)
    assert system.is_projected
    assert len(system.axis_info) == 2
    assert require_metric_crs(system) == system


@pytest.mark.parametrize(("crs", "words"), REFUSED.values(), ids=REFUSED)
def test_other_crs_is_refused(crs: str | int | None, words: str) -> None:
    with refused(CrsError, words, "give a projected CRS in metres"):
        require_metric_crs(crs)


@pytest.mark.parametrize("crs", ["EPSG:2154", "EPSG:32631", "EPSG:31467", "EPSG:2056"])
def test_metre_in_an_accepted_crs_is_a_metre_on_the_ground(crs: str) -> None:
    area = require_metric_crs(crs).area_of_use
    assert area is not None
    middle = (area.west + area.east) / 2, (area.south + area.north) / 2
    factors = Proj(crs).get_factors(*middle)
    assert factors.meridional_scale == pytest.approx(1.0, rel=2e-3)
    assert factors.parallel_scale == pytest.approx(1.0, rel=2e-3)


PLACES = {  # a metric system, longitude and latitude
    "Brest": ("EPSG:2154", -4.49, 48.39),
    "Helsinki": ("EPSG:3067", 24.94, 60.17),
    "Paris by a meridian of its own": ("EPSG:27572", 2.35, 48.86),
    "Munich, northing first": ("EPSG:31468", 11.58, 48.14),
    "Suva": ("EPSG:32760", 178.44, -18.14),
    "east of the antimeridian": ("EPSG:32760", -179.9, -16.8),
    "Buenos Aires": ("EPSG:32721", -58.38, -34.6),
    "a plane of one's own": ("+proj=tmerc +lon_0=3 +ellps=GRS80 +towgs84=1,2,3 +type=crs", 9, 50),
}


@pytest.mark.parametrize(("code", "longitude", "latitude"), PLACES.values(), ids=PLACES)
def test_convergence_is_the_angle_to_true_north(
    code: str, longitude: float, latitude: float
) -> None:
    crs = require_metric_crs(code)
    plane, ellipsoid = Proj(crs), crs.get_geod()
    assert ellipsoid is not None
    xy = np.array(plane(longitude, latitude))
    (angle,) = grid_convergence(crs, [xy])
    for bearing in (0.0, 77.0, 230.0):  # as the grid has it, against the geodesic
        turn = math.radians(bearing)
        x, y = xy + 30.0 * np.array([math.sin(turn), math.cos(turn)])
        azimuth, _, _ = ellipsoid.inv(longitude, latitude, *plane(x, y, inverse=True))
        assert apart(azimuth, bearing + angle) < 1e-4


def test_convergence_off_the_earth_is_nan() -> None:
    crs = require_metric_crs("EPSG:32631")
    assert np.isnan(grid_convergence(crs, [(math.inf, 0.0), (math.nan, 1.0)])).all()
    assert grid_convergence(crs, np.empty((0, 2))).shape == (0,)


# --- Directions -------------------------------------------------------------------------------

ANGLES = st.floats(-1e6, 1e6)


def apart(a: float, b: float) -> float:
    """Return the angle between two directions, by the complex plane."""
    turn = complex(math.cos(math.radians(a - b)), math.sin(math.radians(a - b)))
    return abs(math.degrees(math.atan2(turn.imag, turn.real)))


@given(ANGLES)
def test_wrapped_angles_are_on_one_turn(angle: float) -> None:
    once = wrap_degrees(angle)
    assert 0.0 <= once < 360.0
    assert wrap_degrees(once) == once
    assert apart(float(once), angle) < 1e-6


def test_full_turns_do_not_change_a_direction() -> None:
    assert wrap_degrees(np.arange(-720, 1080)).tolist() == [*range(360)] * 5
    # A tiny negative angle does not become a whole turn.
    assert wrap_degrees([-1e-20, -5e-324, -0.0, 360.0, 720.0]).tolist() == [0.0] * 5


@given(ANGLES, ANGLES)
def test_angular_distance_is_the_smaller_angle(a: float, b: float) -> None:
    distance = float(angular_distance(a, b))
    assert 0.0 <= distance <= 180.0
    assert distance == pytest.approx(apart(a, b), abs=1e-6)
    assert angular_distance(a, a) == 0.0


def test_arrays_keep_their_shape() -> None:
    grid = np.arange(-6.0, 6.0).reshape(3, 4)
    for angles in (wrap_degrees(grid), angular_distance(grid, 10.0)):
        assert angles.shape == (3, 4)
    assert wrap_degrees(np.arange(3, dtype=np.uint8)).dtype == np.float64


# --- The grid ---------------------------------------------------------------------------------

CELLS = st.integers(-40_000_000, 40_000_000)
ORIGINS = st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
STEPS = st.floats(0.5, 200.0)
METRES = st.floats(-500.0, 500.0)
POINTS = st.lists(st.tuples(METRES, METRES), min_size=1, max_size=5)


@given(st.lists(st.tuples(CELLS, CELLS), min_size=1, unique=True))
def test_cell_number_is_split_into_column_and_row(cells: list[tuple[int, int]]) -> None:
    columns, rows = zip(*cells, strict=True)
    numbers = cell_ids(columns, rows)
    assert numbers.dtype == np.int64
    back = zip(*(part.tolist() for part in split_ids(numbers)), strict=True)
    assert list(back) == cells
    assert cell_ids(*zip(*sorted(cells), strict=True)).tolist() == sorted(numbers.tolist())


def test_cell_number_has_readable_digits() -> None:
    assert cell_ids([76520, 0, -1], [627500, 3, -2]).tolist() == [7652000627500, 3, -100000002]


@given(ORIGINS, STEPS, st.lists(st.tuples(st.integers(-9999, 9999), st.integers(-9999, 9999))))
def test_centre_of_a_cell_is_in_the_cell(
    origin: tuple[float, float], step: float, cells: list[tuple[int, int]]
) -> None:
    grid = GridSpec(step, origin)
    columns, rows = np.reshape(cells, (-1, 2)).T
    centres = grid.viewpoints(columns, rows)
    assert centres.shape == (len(cells), 2)
    np.testing.assert_array_equal(grid.cells_at(centres), (columns, rows))


@given(ORIGINS, STEPS, POINTS)
def test_point_is_in_its_cell(
    origin: tuple[float, float], step: float, points: list[tuple[float, float]]
) -> None:
    grid = GridSpec(step, origin)
    centres = grid.viewpoints(*grid.cells_at(points))
    assert (np.abs(centres - points) <= step / 2 + 1e-6).all()


def test_point_on_an_edge_belongs_to_the_cell_east_or_north() -> None:
    columns, rows = GridSpec(10.0, (5.0, 5.0)).cells_at([(5, 5), (15, 14.9), (4.9, 5), (-5, -5.1)])
    assert (columns.tolist(), rows.tolist()) == ([0, 1, -1, -1], [0, 0, 0, -2])


@given(ORIGINS, STEPS, POINTS, st.floats(0.01, 4.0))
def test_cells_near_points_fill_a_square_around_each(
    origin: tuple[float, float], step: float, points: list[tuple[float, float]], reach: float
) -> None:
    grid, radius = GridSpec(step, origin), reach * step
    columns, rows = cells_near(np.array(points), grid=grid, radius=radius)
    cells_away = math.ceil(radius / step + 0.5)
    around = range(-cells_away, cells_away + 1)
    at = [
        (math.floor((x - origin[0]) / step), math.floor((y - origin[1]) / step)) for x, y in points
    ]
    cells = {(column + i, row + j) for column, row in at for i in around for j in around}
    assert list(zip(columns.tolist(), rows.tolist(), strict=True)) == sorted(cells)


@given(st.integers(-20, 20), st.integers(-20, 20), st.sampled_from([5.0, 15.0, 25.0, 10.0, 20.0]))
def test_cell_with_centre_at_the_radius_is_included(x: int, y: int, radius: float) -> None:
    # Points on edges and at centres of cells, where rounding would show.
    columns, rows = cells_near(np.array([[5.0 * x, 5.0 * y]]), grid=GridSpec(), radius=radius)
    cells = set(zip(columns.tolist(), rows.tolist(), strict=True))
    for i in range(-15, 16):
        for j in range(-15, 16):
            if (10 * i + 5 - 5 * x) ** 2 + (10 * j + 5 - 5 * y) ** 2 <= radius**2:
                assert (i, j) in cells


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        *(("step", value, "from 0.01") for value in (0.0, -10.0, math.nan, math.inf)),
        *(
            ("origin", value, "two finite coordinates")
            for value in ((math.nan, 0.0), (0.0, math.inf), (0.0,), (0.0, 0.0, 0.0), 5.0)
        ),
    ],
)
def test_invalid_step_or_origin_is_refused(name: str, value: object, words: str) -> None:
    with refused(InputError, f"{name} is {value}", words):
        GridSpec(**{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("xy", "grid"),
    [
        ((765_205.0, 6_275_005.0), GridSpec(step=0.1)),
        ((6e8, 0.0), GridSpec()),
        ((0.0, 0.0), GridSpec(origin=(0.0, -1e12))),
        ((0.0, 6e5), GridSpec(step=0.01)),
        ((math.nan, 0.0), GridSpec()),
    ],
)
def test_cell_too_far_from_the_origin_is_refused(xy: tuple[float, float], grid: GridSpec) -> None:
    with refused(InputError, f"({grid.step:g} m)", "larger"):
        cells_near(np.array([[900.0, 0.0], xy]), grid=grid, radius=grid.step)


def test_too_small_step_for_the_range_is_refused() -> None:
    for step in (0.01, 0.03):
        with refused(InputError, f"step of {step:g} m", "range of 30 m", "at least 0.03"):
            cells_near(np.zeros((1, 2)), grid=GridSpec(step), radius=30.0)
    columns, _ = cells_near(np.zeros((1, 2)), grid=GridSpec(0.5), radius=30.0)
    assert columns.min() == -61
