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
    """Return an order in which neighbours in the plane mostly are neighbours in the file.

    Parameters
    ----------
    geometries : array of shapely geometries, shape (n,)
        None is missing or empty.

    Returns
    -------
    ndarray of int64, shape (n,)
        Permutation along a Hilbert curve; equals keep their order.

    Examples
    --------
    >>> import shapely
    >>> places = np.array([[0, 0], [9, 9], [0, 1], [9, 8]])
    >>> hilbert_order(shapely.points(places)).tolist()
    [0, 2, 1, 3]
    """
    if len(geometries) == 0:
        return np.empty(0, np.int64)
    along = gpd.GeoSeries(geometries).hilbert_distance().to_numpy()
    return np.argsort(along, kind="stable")


def bounds_column(bounds: ArrayLike) -> pa.StructArray:
    """Return the column by which readers choose the rows within a box.

    Parameters
    ----------
    bounds : array_like of float, shape (n, 4)
        ``xmin, ymin, xmax, ymax`` of every row.

    Returns
    -------
    pyarrow.StructArray
        The bounds as float32, rounded outwards: half the bytes, and no row is missed.

    Examples
    --------
    >>> bounds_column([[0.1, 0.2, 0.1, 0.2]])[0]["xmin"].as_py() < 0.1
    True
    """
    exact = np.asarray(bounds, dtype=np.float64).reshape(-1, len(SIDES))
    rounded = exact.astype(np.float32)
    outwards = np.array([-np.inf, -np.inf, np.inf, np.inf], np.float32)
    short = np.where(outwards < 0, rounded > exact, rounded < exact)
    sides = np.where(short, np.nextafter(rounded, outwards), rounded)
    return pa.StructArray.from_arrays([pa.array(side) for side in sides.T], names=list(SIDES))


def groups_meeting(file: pq.ParquetFile, box: Sequence[float]) -> list[int]:
    """Return the row groups of a file that may have a row that meets a box.

    Parameters
    ----------
    file : pyarrow.parquet.ParquetFile
        A file; without a column of bounds, all of it may.
    box : sequence of float
        ``xmin, ymin, xmax, ymax``.

    Returns
    -------
    list of int
        Numbers of row groups.
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
    """Return the rows of a table that meet a box.

    Parameters
    ----------
    table : pyarrow.Table
        A table; without a column of bounds, all of its rows may meet it.
    box : sequence of float
        ``xmin, ymin, xmax, ymax``.

    Returns
    -------
    pyarrow.Table
        Those rows, and perhaps some that miss the box by less than a metre.

    Examples
    --------
    >>> table = pa.table({"bbox": bounds_column([[0, 0, 1, 1], [5, 5, 6, 6]]), "name": ["a", "b"]})
    >>> rows_meeting(table, (1, 1, 4, 4))["name"].to_pylist()
    ['a']
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
    """Yield the bounds of the rows of a file, group by group, without reading anything else.

    Parameters
    ----------
    path : str or Path
        A Parquet file.

    Yields
    ------
    ndarray of float64, shape (n, 4)
        ``xmin, ymin, xmax, ymax`` of some rows; nothing at all is yielded where the file has no
        column of bounds.
    """
    with pq.ParquetFile(path) as file:
        if BBOX not in file.schema_arrow.names or file.schema_arrow.field(BBOX).type != BOUNDS:
            return
        for group in range(file.num_row_groups):
            column = file.read_row_group(group, [BBOX])[BBOX]
            yield np.stack(_sides(column), axis=1).astype(np.float64)
