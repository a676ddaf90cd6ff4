"""Tables that can be read by box: rows in a spatial order, with their bounds in a column.

This is the bounding-box covering of GeoParquet 1.1, which geopandas and GDAL read by too.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    Bounds = NDArray[np.float64]

__all__ = [
    "BBOX",
    "COVERING",
    "GROUP_ROWS",
    "NOWHERE",
    "bounds_column",
    "each_bounds",
    "groups_meeting",
    "hilbert_order",
    "rows_meeting",
]

BBOX = "bbox"
SIDES = ("xmin", "ymin", "xmax", "ymax")
BOUNDS = pa.struct([(side, pa.float32()) for side in SIDES])
COVERING = {"bbox": {side: [BBOX, side] for side in SIDES}}
"""What the ``geo`` metadata of a file says of the column `BBOX`."""
NOWHERE = (math.inf, math.inf, -math.inf, -math.inf)
"""Meets nothing: of a file, only what it says of itself is read."""
GROUP_ROWS = 8192
"""Rows that are read together: the street objects of about two square kilometres of Paris."""


def hilbert_order(geometries: NDArray[np.object_] | gpd.array.GeometryArray) -> NDArray[np.int64]:
    """Return the permutation along a Hilbert curve, so that neighbours mostly are rows nearby.

    No geometry is missing or empty; equals keep their order.
    """
    if len(geometries) == 0:
        return np.empty(0, np.int64)
    along = gpd.GeoSeries(geometries).hilbert_distance().to_numpy()
    return np.argsort(along, kind="stable")


def bounds_column(bounds: ArrayLike) -> pa.StructArray:
    """Return the column by which readers choose the rows within a box.

    ``xmin, ymin, xmax, ymax`` of every row, shape (n, 4), become float32, rounded outwards: half
    the bytes, and no row is missed.
    """
    exact = np.asarray(bounds, dtype=np.float64).reshape(-1, len(SIDES))
    rounded = exact.astype(np.float32)
    outwards = np.array([-np.inf, -np.inf, np.inf, np.inf], np.float32)
    short = np.where(outwards < 0, rounded > exact, rounded < exact)
    sides = np.where(short, np.nextafter(rounded, outwards), rounded)
    return pa.StructArray.from_arrays([pa.array(side) for side in sides.T], names=list(SIDES))


def groups_meeting(file: pq.ParquetFile, box: Sequence[float]) -> list[int]:
    """Return the numbers of the row groups that may meet the box ``xmin, ymin, xmax, ymax``.

    Without a column of bounds, all of them may.
    """
    return [
        group
        for group in range(file.num_row_groups)
        if _may_meet(_extremes(file.metadata.row_group(group)), box)
    ]


def _extremes(group: Any) -> dict[str, Any]:  # noqa: ANN401 - pyarrow has no types
    """Return the statistics of the bounds of a row group, by side."""
    found = {}
    for number in range(group.num_columns):
        name, _, side = group.column(number).path_in_schema.rpartition(".")
        statistics = group.column(number).statistics
        if name == BBOX and statistics is not None and statistics.has_min_max:
            found[side] = statistics
    return found


def _may_meet(sides: dict[str, Any], box: Sequence[float]) -> bool:
    if not sides.keys() >= set(SIDES):
        return True
    return bool(
        sides["xmin"].min <= box[2]
        and sides["ymin"].min <= box[3]
        and sides["xmax"].max >= box[0]
        and sides["ymax"].max >= box[1]
    )


def rows_meeting(table: pa.Table, box: Sequence[float]) -> pa.Table:
    """Return the rows of a table that meet the box ``xmin, ymin, xmax, ymax``.

    Some may miss the box by less than a metre. Without a column of bounds, all rows are returned.
    """
    if BBOX not in table.column_names or table.schema.field(BBOX).type != BOUNDS:
        return table
    west, south, east, north = _sides(table[BBOX])
    meets = (west <= box[2]) & (south <= box[3]) & (east >= box[0]) & (north >= box[1])
    return table.filter(pa.array(meets))


def _sides(column: pa.ChunkedArray) -> list[NDArray[np.float32]]:
    fields = column.combine_chunks().flatten()
    return [side.to_numpy(zero_copy_only=False) for side in fields]


def each_bounds(path: str | Path) -> Iterator[Bounds]:
    """Yield ``xmin, ymin, xmax, ymax`` of a Parquet file's rows, shape (n, 4), group by group.

    Nothing else is read; nothing is yielded where the file has no column of bounds.
    """
    with pq.ParquetFile(path) as file:
        if BBOX not in file.schema_arrow.names or file.schema_arrow.field(BBOX).type != BOUNDS:
            return
        for group in range(file.num_row_groups):
            column = file.read_row_group(group, [BBOX])[BBOX]
            yield np.stack(_sides(column), axis=1).astype(np.float64)
