from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from semsig_gis.storage.geoparquet import (
    bounds_column,
    each_bounds,
    groups_meeting,
    hilbert_order,
    rows_meeting,
)

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

BOUNDS = arrays(np.float64, st.tuples(st.integers(0, 9), st.just(4)), elements=st.floats(-1e8, 1e8))


@given(bounds=BOUNDS)
def test_bounds_are_rounded_outwards_by_less_than_they_are_long(
    bounds: NDArray[np.float64],
) -> None:
    column = bounds_column(bounds)
    found = np.stack([side.to_numpy() for side in column.flatten()], axis=1).astype(float)
    assert found.shape == bounds.shape
    assert (found[:, :2] <= bounds[:, :2]).all()
    assert (found[:, 2:] >= bounds[:, 2:]).all()
    assert (np.abs(found - bounds) <= np.spacing(np.abs(bounds).astype(np.float32))).all()


def test_neighbours_in_the_order_are_neighbours_in_the_plane() -> None:
    points = np.asarray(shapely.points(np.random.default_rng(0).uniform(0, 100, (2_000, 2))))
    order = hilbert_order(points)
    assert sorted(order.tolist()) == list(range(2_000))
    steps = shapely.distance(points[order][1:], points[order][:-1])
    assert np.median(steps) < 3
    assert np.median(shapely.distance(points[1:], points[:-1])) > 40


def test_equal_places_and_none_at_all_have_an_order() -> None:
    assert hilbert_order(np.asarray(shapely.points([[3.0, 4.0]] * 5))).tolist() == [0, 1, 2, 3, 4]
    assert hilbert_order(np.asarray(shapely.points(np.empty((0, 2))))).tolist() == []


def test_groups_and_rows_that_may_meet_a_box_are_found(tmp_path: Path) -> None:
    places = np.arange(12.0)[:, None] * [[10.0, 0.0, 10.0, 0.0]] + [[0, 0, 4, 4]]
    table = pa.table({"bbox": bounds_column(places), "row": np.arange(12)})
    pq.write_table(table, tmp_path / "a.parquet", row_group_size=3)
    with pq.ParquetFile(tmp_path / "a.parquet") as file:
        assert groups_meeting(file, (-9, -9, 999, 999)) == [0, 1, 2, 3]
        assert groups_meeting(file, (31, 1, 32, 2)) == [1]
        assert groups_meeting(file, (24, 4, 30, 9)) == [0, 1]  # at a corner and an edge
        assert groups_meeting(file, (25, 1, 29, 2)) == []
        assert groups_meeting(file, (31, 5, 32, 9)) == []
    assert rows_meeting(table, (24, 4, 30, 9))["row"].to_pylist() == [2, 3]
    assert np.concatenate(list(each_bounds(tmp_path / "a.parquet"))).tolist() == places.tolist()


def test_a_file_without_bounds_may_meet_any_box(tmp_path: Path) -> None:
    for column in (pa.array([1, 2]), pa.array([{"xmin": "a"}, None])):
        table = pa.table({"bbox": column})
        pq.write_table(table, tmp_path / "a.parquet")
        with pq.ParquetFile(tmp_path / "a.parquet") as file:
            assert groups_meeting(file, (0, 0, 1, 1)) == [0]
        assert list(each_bounds(tmp_path / "a.parquet")) == []
        assert rows_meeting(table, (0, 0, 1, 1)) == table
