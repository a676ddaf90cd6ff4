"""GeoParquet files."""

from __future__ import annotations

import errno
import json
import random
from typing import TYPE_CHECKING, Any
from unittest.mock import Mock

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pyproj import CRS
from sentences import assert_sentence, refused

from semsig_gis.core import DatabaseError
from semsig_gis.storage import (
    bounds_by_group,
    bounds_column,
    geo_metadata,
    groups_meeting,
    hilbert_order,
    points_to_wkb,
    read_geoparquet,
    rows_meeting,
    write_geoparquet,
)

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

NUMBERS = list(range(0, 900, 3))
TEXTS = [f"café {number}" for number in NUMBERS]
LISTS = [[number % 7, 7_199] * (number % 4) for number in NUMBERS]
SPECS = {"kind": "sample"}
LAMBERT = CRS(2154).to_json_dict()
POINTS = [shapely.Point(700_000 + number, 6_600_000 - number) for number in NUMBERS]


def write_example(path: Path, *, specs: Any = SPECS, crs: Any = LAMBERT) -> Path:  # noqa: ANN401
    table = pa.table(
        {
            "number": pa.array(NUMBERS, pa.int32()),
            "text": TEXTS,
            "list": pa.array(LISTS, pa.list_(pa.uint16())),
            "geometry": pa.array(shapely.to_wkb(POINTS), pa.binary()),
        }
    )
    bounds = shapely.total_bounds(POINTS).tolist()
    geo = geo_metadata(CRS(2154), geometry_types=["Point"], bounds=bounds)
    geo["columns"]["geometry"]["crs"] = crs
    write_geoparquet(table, path, geo=geo, specs=specs)
    return path


@pytest.fixture
def example(tmp_path: Path) -> Path:
    return write_example(tmp_path / "example.parquet")


@given(st.lists(st.tuples(*[st.floats(allow_nan=False)] * 2)))
def test_points_have_the_same_bytes_as_in_shapely(places: list[tuple[float, float]]) -> None:
    xy = np.array(places).reshape(-1, 2)
    column = points_to_wkb(xy)
    assert column.type == pa.binary()
    points = np.asarray(shapely.points(xy))
    assert column.to_pylist() == [shapely.to_wkb(point, byte_order=1) for point in points]


def test_table_specs_and_crs_are_read_back(example: Path) -> None:
    table, specs, crs = read_geoparquet(example, kind="sample")
    assert table["number"].to_pylist() == NUMBERS
    assert table["text"].to_pylist() == TEXTS
    assert table["list"].to_pylist() == LISTS
    assert (specs, crs) == (SPECS, CRS(2154))
    subset, _, _ = read_geoparquet(example, kind="sample", columns=["text"])
    assert subset.column_names == ["text"]


def test_other_programs_read_the_file(example: Path) -> None:
    frame = gpd.read_parquet(example)
    assert frame.crs == CRS(2154)
    assert frame.geometry.tolist() == POINTS
    assert frame["number"].tolist() == NUMBERS
    assert frame["text"].tolist() == TEXTS
    assert [row.tolist() for row in frame["list"]] == LISTS
    assert pq.read_table(example, columns=["number"])["number"].to_pylist() == NUMBERS
    metadata = json.loads(pq.read_metadata(example).metadata[b"geo"])
    column = metadata["columns"]["geometry"]
    assert (metadata["version"], metadata["primary_column"]) == ("1.1.0", "geometry")
    assert (column["encoding"], column["geometry_types"]) == ("WKB", ["Point"])
    assert column["bbox"] == list(shapely.total_bounds(POINTS))


def test_truncated_file_is_refused(example: Path) -> None:
    content = example.read_bytes()
    for size in range(0, len(content), 10):
        example.write_bytes(content[:size])
        with refused(DatabaseError, str(example), "make the sample file again"):
            read_geoparquet(example, kind="sample")


def test_flipped_bit_is_detected_or_harmless(example: Path) -> None:
    content = example.read_bytes()
    whole, _, _ = read_geoparquet(example, kind="sample")
    rng = random.Random(0)  # noqa: S311
    for _ in range(300):
        broken = bytearray(content)
        broken[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
        example.write_bytes(broken)
        try:
            table, _, _ = read_geoparquet(example, kind="sample", columns=whole.column_names)
        except DatabaseError as error:
            assert_sentence(error, str(example))
        else:
            assert table.equals(whole)


@pytest.mark.parametrize(
    "change",
    [
        *({"specs": specs} for specs in ([], ["kind"], "kind", 3, None, {"name": "x"})),
        *({"crs": crs} for crs in (None, {}, {"type": "x"}, "EPSG:0", 7.5)),
    ],
)
def test_file_with_foreign_specs_or_crs_is_refused(tmp_path: Path, change: dict[str, Any]) -> None:
    path = write_example(tmp_path / "a.parquet", **change)
    with refused(DatabaseError, "was not written by semsig"):
        read_geoparquet(path, kind="sample")


def test_error_says_what_is_wrong_with_the_file(
    example: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with refused(DatabaseError, "is a sample file", "give a signature database file"):
        read_geoparquet(example, kind="signature database")
    with refused(DatabaseError, "lacks the column 'types'"):
        read_geoparquet(example, kind="sample", columns=["number", "types"])
    folder = example.parent
    other = folder / "other.parquet"
    gpd.GeoDataFrame(geometry=POINTS, crs=2154).to_parquet(other)
    denied = PermissionError(errno.EACCES, "Failed to open local file")
    for path, *words in (
        (other, "was not written by semsig", "give a sample file"),
        (folder / "a.parquet", "does not exist"),
        (folder / ("a" * 300), "does not exist"),
        (folder, "is a folder"),
    ):
        with refused(DatabaseError, str(path), *words):
            read_geoparquet(path, kind="sample")
    for content in (b"", b"PAR1", b"name = 'town'\n", b"PK\x03\x04" * 20):
        other.write_bytes(content)
        with refused(DatabaseError, str(other), "is damaged or is not a Parquet file"):
            read_geoparquet(other, kind="sample")
    # A file without read permission is not reported as damaged.
    monkeypatch.setattr(pq, "ParquetFile", Mock(side_effect=denied))
    with refused(DatabaseError, str(example), "cannot be read (Permission denied)"):
        read_geoparquet(example, kind="sample")


def test_open_file_can_be_replaced(example: Path) -> None:
    table, _, _ = read_geoparquet(example, kind="sample")
    write_example(example, specs={"kind": "other"})
    assert table["number"].to_pylist() == NUMBERS
    assert read_geoparquet(example, kind="other")[1] == {"kind": "other"}


BOUNDS = arrays(np.float64, st.tuples(st.integers(0, 9), st.just(4)), elements=st.floats(-1e8, 1e8))


@given(bounds=BOUNDS)
def test_bounds_are_rounded_outwards_to_the_next_float(
    bounds: NDArray[np.float64],
) -> None:
    column = bounds_column(bounds)
    rounded = np.stack([side.to_numpy() for side in column.flatten()], axis=1).astype(float)
    assert rounded.shape == bounds.shape
    assert (rounded[:, :2] <= bounds[:, :2]).all()
    assert (rounded[:, 2:] >= bounds[:, 2:]).all()
    assert (np.abs(rounded - bounds) <= np.spacing(np.abs(bounds).astype(np.float32))).all()


def test_hilbert_order_keeps_neighbours_together() -> None:
    points = np.asarray(shapely.points(np.random.default_rng(0).uniform(0, 100, (2_000, 2))))
    order = hilbert_order(shapely.bounds(points))
    curve = gpd.GeoSeries(points).hilbert_distance()
    assert order.tolist() == np.argsort(curve.to_numpy(), kind="stable").tolist()
    assert sorted(order.tolist()) == list(range(2_000))
    steps = shapely.distance(points[order][1:], points[order][:-1])
    assert np.median(steps) < 3
    assert np.median(shapely.distance(points[1:], points[:-1])) > 40
    for equal in (5, 0):
        assert hilbert_order(shapely.bounds(points[[0] * equal])).tolist() == [*range(equal)]


def test_row_groups_and_rows_are_selected_by_box(tmp_path: Path) -> None:
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
    assert rows_meeting(table, (24, 4, 25, 9), (101, 1, 102, 2))["row"].to_pylist() == [2, 10]
    unknown = pa.table({"bbox": pa.array([None], table["bbox"].type), "row": [12]})
    assert rows_meeting(unknown, (24, 4, 30, 9)).num_rows == 1
    assert np.concatenate(list(bounds_by_group(tmp_path / "a.parquet"))).tolist() == places.tolist()


def test_file_without_bounds_intersects_any_box(tmp_path: Path) -> None:
    for column in (pa.array([1, 2]), pa.array([{"xmin": "a"}, None])):
        table = pa.table({"bbox": column})
        pq.write_table(table, tmp_path / "a.parquet")
        with pq.ParquetFile(tmp_path / "a.parquet") as file:
            assert groups_meeting(file, (0, 0, 1, 1)) == [0]
        assert list(bounds_by_group(tmp_path / "a.parquet")) == []
        assert rows_meeting(table, (0, 0, 1, 1)) == table
