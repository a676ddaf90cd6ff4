from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core.errors import InputError
from semsig_gis.core.grid import GridSpec, cell_ids, cells_near, split_ids

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
def test_no_cell_in_range_is_left_out(
    origin: tuple[float, float], step: float, points: list[tuple[float, float]], reach: float
) -> None:
    grid, radius = GridSpec(step, origin), reach * step
    columns, rows = cells_near(np.array(points), grid=grid, radius=radius)
    cells = list(zip(columns.tolist(), rows.tolist(), strict=True))
    assert cells == sorted(set(cells))
    for x, y in points:
        column = math.floor((x - origin[0]) / step)
        row = math.floor((y - origin[1]) / step)
        for i in range(column - 6, column + 7):
            for j in range(row - 6, row + 7):
                centre = origin[0] + (i + 0.5) * step, origin[1] + (j + 0.5) * step
                assert math.dist((x, y), centre) > radius or (i, j) in cells
    assert len(cells) <= len(points) * (2 * math.ceil(reach + 0.5) + 1) ** 2


@given(st.integers(-20, 20), st.integers(-20, 20), st.sampled_from([5.0, 15.0, 25.0, 10.0, 20.0]))
def test_a_centre_at_exactly_the_radius_is_not_left_out(x: int, y: int, radius: float) -> None:
    # Points on edges and at centres of cells, where rounding would show.
    columns, rows = cells_near(np.array([[5.0 * x, 5.0 * y]]), grid=GridSpec(), radius=radius)
    cells = set(zip(columns.tolist(), rows.tolist(), strict=True))
    for i in range(-15, 16):
        for j in range(-15, 16):
            if (10 * i + 5 - 5 * x) ** 2 + (10 * j + 5 - 5 * y) ** 2 <= radius**2:
                assert (i, j) in cells


@given(POINTS, POINTS)
def test_cells_keep_their_numbers_when_the_area_grows(
    points: list[tuple[float, float]], more: list[tuple[float, float]]
) -> None:
    grid = GridSpec(step=7.0)
    before = cell_ids(*cells_near(np.array(points), grid=grid, radius=20.0))
    after = cell_ids(*cells_near(np.array(points + more), grid=grid, radius=20.0))
    assert set(before.tolist()) <= set(after.tolist())
    assert (np.diff(after) > 0).all()


def test_a_shift_by_whole_steps_only_renumbers() -> None:
    points = np.array([[3.0, 4.0], [55.0, -20.0]])
    here = cells_near(points, grid=GridSpec(10.0, (2.0, 3.0)), radius=30.0)
    there = cells_near(points, grid=GridSpec(10.0, (-98.0, 53.0)), radius=30.0)
    np.testing.assert_array_equal(there, (here[0] + 10, here[1] - 5))


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


def test_a_grid_is_a_value() -> None:
    assert GridSpec() == GridSpec(10.0, (0.0, 0.0))
    assert hash(GridSpec(5.0)) == hash(GridSpec(step=5.0))
    with pytest.raises(dataclasses.FrozenInstanceError):
        GridSpec().step = 5.0  # type: ignore[misc]
