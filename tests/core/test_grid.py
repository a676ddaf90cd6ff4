from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core.errors import InputError
from semsig_gis.core.geometry import GridSpec, cell_ids, cells_near, split_ids

CELLS = st.integers(-40_000_000, 40_000_000)
ORIGINS = st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
STEPS = st.floats(0.5, 200.0)
METRES = st.floats(-500.0, 500.0)
POINTS = st.lists(st.tuples(METRES, METRES), min_size=1, max_size=5)


@given(st.lists(st.tuples(CELLS, CELLS), min_size=1, unique=True))
def test_a_cell_number_tells_its_column_and_row(cells: list[tuple[int, int]]) -> None:
    columns, rows = zip(*cells, strict=True)
    numbers = cell_ids(columns, rows)
    assert numbers.dtype == np.int64
    back = zip(*(part.tolist() for part in split_ids(numbers)), strict=True)
    assert list(back) == cells
    assert cell_ids(*zip(*sorted(cells), strict=True)).tolist() == sorted(numbers.tolist())


def test_a_cell_number_can_be_read() -> None:
    assert cell_ids([76520, 0, -1], [627500, 3, -2]).tolist() == [7652000627500, 3, -100000002]


@given(ORIGINS, STEPS, st.lists(st.tuples(st.integers(-9999, 9999), st.integers(-9999, 9999))))
def test_the_centre_of_a_cell_lies_in_it(
    origin: tuple[float, float], step: float, cells: list[tuple[int, int]]
) -> None:
    grid = GridSpec(step, origin)
    columns, rows = np.reshape(cells, (-1, 2)).T
    centres = grid.viewpoints(columns, rows)
    assert centres.shape == (len(cells), 2)
    np.testing.assert_array_equal(grid.cells_at(centres), (columns, rows))


@given(ORIGINS, STEPS, POINTS)
def test_a_point_lies_in_its_cell(
    origin: tuple[float, float], step: float, points: list[tuple[float, float]]
) -> None:
    grid = GridSpec(step, origin)
    centres = grid.viewpoints(*grid.cells_at(points))
    assert (np.abs(centres - points) <= step / 2 + 1e-6).all()


def test_a_point_on_an_edge_belongs_east_and_north() -> None:
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
def test_a_centre_at_exactly_the_radius_is_not_left_out(x: int, y: int, radius: float) -> None:
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
        *(("step", value, "above 0") for value in (0.0, -10.0, math.nan, math.inf)),
        *(
            ("origin", value, "two finite coordinates")
            for value in ((math.nan, 0.0), (0.0, math.inf), (0.0,), (0.0, 0.0, 0.0), 5.0)
        ),
    ],
)
def test_a_grid_has_a_step_in_metres_and_a_finite_origin(
    name: str, value: object, words: str
) -> None:
    with refused(InputError, f"{name} is {value}", words):
        GridSpec(**{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("xy", "grid"),
    [
        ((765_205.0, 6_275_005.0), GridSpec(step=0.1)),
        ((6e8, 0.0), GridSpec()),
        ((0.0, 0.0), GridSpec(origin=(0.0, -1e12))),
        ((0.0, 0.0), GridSpec(step=1e-5)),
        ((math.nan, 0.0), GridSpec()),
    ],
)
def test_a_cell_that_cannot_be_numbered_is_an_error(
    xy: tuple[float, float], grid: GridSpec
) -> None:
    with refused(InputError, f"({grid.step:g} m)", "larger"):
        cells_near(np.array([[900.0, 0.0], xy]), grid=grid, radius=grid.step)


def test_a_step_far_below_the_range_is_an_error() -> None:
    for step in (1e-300, 0.03):
        with refused(InputError, f"step of {step:g} m", "range of 30 m", "at least 0.03"):
            cells_near(np.zeros((1, 2)), grid=GridSpec(step), radius=30.0)
    columns, _ = cells_near(np.zeros((1, 2)), grid=GridSpec(0.5), radius=30.0)
    assert columns.min() == -61
