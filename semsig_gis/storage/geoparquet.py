"""GeoParquet: tables with their specs, read by box.

Rows stand in a spatial order with their bounds in a column: the bounding-box covering of GeoParquet
1.1, which geopandas and GDAL read by too.
"""

from __future__ import annotations

import functools
import itertools
import json
import math
import os
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core.errors import DatabaseError
from semsig_gis.core.resources import raise_if_short
from semsig_gis.storage.text import parse_json
from semsig_gis.storage.whole import reason, whole_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    import geopandas as gpd
    from numpy.typing import ArrayLike, NDArray


BBOX = "bbox"
SIDES = ("xmin", "ymin", "xmax", "ymax")
BOUNDS = pa.struct([(side, pa.float32()) for side in SIDES])
COVERING = {"bbox": {side: [BBOX, side] for side in SIDES}}
"""What the ``geo`` metadata of a file says of the column `BBOX`."""

NOWHERE = (math.inf, math.inf, -math.inf, -math.inf)
"""Meets nothing: of a file, only what it says of itself is read."""

GROUP_ROWS = 8192
"""Rows that are read together: the street objects of about two square kilometres of Paris."""

BATCH_ROWS = 1 << 15
"""Rows of a whole file that are unpacked at once."""


def hilbert_order(geometries: NDArray[np.object_] | gpd.array.GeometryArray) -> NDArray[np.int64]:
    """Return the permutation along a Hilbert curve, so that neighbours mostly are rows nearby.

    No geometry is missing or empty; equals keep their order.
    """
    if len(geometries) == 0:
        return np.empty(0, np.int64)
    import geopandas as gpd  # noqa: PLC0415 - it loads slowly

    along = gpd.GeoSeries(geometries).hilbert_distance().to_numpy()
    return np.argsort(along, kind="stable")


def bounds_column(bounds: ArrayLike) -> pa.StructArray:
    """Return the column by which readers choose the rows within a box.

    Bounds, shape (n, 4), become float32, rounded outwards: half the bytes, and no row is missed.
    """
    exact = np.asarray(bounds, dtype=np.float64).reshape(-1, len(SIDES))
    rounded = exact.astype(np.float32)
    outwards = np.array([-np.inf, -np.inf, np.inf, np.inf], np.float32)
    short = np.where(outwards < 0, rounded > exact, rounded < exact)
    sides = np.where(short, np.nextafter(rounded, outwards), rounded)
    return pa.StructArray.from_arrays([pa.array(side) for side in sides.T], names=list(SIDES))


def groups_meeting(file: pq.ParquetFile, box: Sequence[float]) -> list[int]:
    """Return the numbers of the row groups that may meet a box; all without a column of bounds."""
    west, south, east, north = box
    groups = []
    for number in range(file.num_row_groups):
        sides = _extremes(file.metadata.row_group(number))
        if not sides.keys() >= set(SIDES) or (
            sides["xmin"].min <= east
            and sides["ymin"].min <= north
            and sides["xmax"].max >= west
            and sides["ymax"].max >= south
        ):
            groups.append(number)
    return groups


def _extremes(group: Any) -> dict[str, Any]:  # noqa: ANN401 - pyarrow has no types
    """Return the statistics of the bounds of a row group, by side."""
    extremes = {}
    for number in range(group.num_columns):
        name, _, side = group.column(number).path_in_schema.rpartition(".")
        statistics = group.column(number).statistics
        if name == BBOX and statistics is not None and statistics.has_min_max:
            extremes[side] = statistics
    return extremes


def rows_meeting(table: pa.Table, box: Sequence[float]) -> pa.Table:
    """Return the rows of a table that meet the box ``xmin, ymin, xmax, ymax``, or nearly so.

    Without a column of bounds, all rows are returned.
    """
    if BBOX not in table.column_names or table.schema.field(BBOX).type != BOUNDS:
        return table
    west, south, east, north = _sides(table[BBOX])
    meets = (west <= box[2]) & (south <= box[3]) & (east >= box[0]) & (north >= box[1])
    return table.filter(pa.array(meets))


def _sides(column: pa.ChunkedArray) -> list[NDArray[np.float32]]:
    fields = column.combine_chunks().flatten()
    return [side.to_numpy(zero_copy_only=False) for side in fields]


def each_bounds(path: str | Path) -> Iterator[NDArray[np.float64]]:
    """Yield bounds of a Parquet file's rows, shape (n, 4), by group; none without such a column."""
    with pq.ParquetFile(path, **CHECKING_PAGES) as file:
        if BBOX not in file.schema_arrow.names or file.schema_arrow.field(BBOX).type != BOUNDS:
            return
        for group in range(file.num_row_groups):
            column = file.read_row_group(group, [BBOX])[BBOX]
            yield np.stack(_sides(column), axis=1).astype(np.float64)


UNREADABLE = (
    *(pa.ArrowException, OSError, ValueError, LookupError, TypeError),
    CRSError,
)
"""What geopandas raises for a damaged file whose shapes can be read."""

SPEC_KEY = b"semsig"
COMPRESSION = 3
BYTE_TYPES = {pa.string(), pa.large_string(), pa.binary()}
# Well-known binary of a point: 1 for little-endian, 1 for a point, and where it is.
WKB_POINT = np.dtype([("order", "u1"), ("type", "<u4"), ("x", "<f8"), ("y", "<f8")])


def geo_metadata(
    crs: CRS, *, geometry_types: Sequence[str], bounds: Sequence[float]
) -> dict[str, Any]:
    """Return the ``geo`` metadata of a GeoParquet 1.1 file with WKB in the column ``geometry``.

    Bounds are ``xmin, ymin, xmax, ymax`` in `crs`; geometry types are such as ``"Point"``.
    """
    column = {
        "encoding": "WKB",
        "geometry_types": list(geometry_types),
        "crs": crs.to_json_dict(),
        "bbox": [float(value) for value in bounds],
    }
    return {"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": column}}


def points_to_wkb(xy: NDArray[np.float64]) -> pa.Array:
    """Return points, shape (n, 2), as an Arrow column of well-known binary, 21 bytes a point."""
    points = np.ones(len(xy), WKB_POINT)
    points["x"], points["y"] = xy.T
    fixed = pa.binary(WKB_POINT.itemsize)
    column = pa.Array.from_buffers(fixed, len(xy), [None, pa.py_buffer(points)])
    return column.cast(pa.binary())


def whole_numbers(column: pa.Array | pa.ChunkedArray) -> NDArray[Any]:
    """Return an Arrow column of whole numbers, none missing, without loading pandas for it.

    ValueError if it holds something else.
    """
    array = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    if array.null_count or not pa.types.is_integer(array.type):
        raise ValueError(f"a column contains {array.type}, {array.null_count} missing")
    kind = np.dtype(str(array.type))
    content = array.buffers()[1] if len(array) else b""
    return np.frombuffer(content, kind, count=len(array), offset=array.offset * kind.itemsize)


def wkb_to_points(column: pa.ChunkedArray) -> NDArray[np.float64]:
    """Return the places of points in well-known binary, shape (n, 2).

    They are fewer where one is missing, empty or no point; ValueError if it cannot be read.
    """
    binary = column.combine_chunks()
    if binary.type == pa.binary() and not binary.null_count:
        _, ends, flat = binary.buffers()
        offsets = np.frombuffer(ends, np.int32)[binary.offset : binary.offset + len(binary) + 1]
        if (np.diff(offsets) == WKB_POINT.itemsize).all():
            content = np.frombuffer(flat, np.uint8)[offsets[0] : offsets[-1]]
            points = content.view(WKB_POINT)
            if (points["order"] == 1).all() and (points["type"] == 1).all():
                return np.stack([points["x"], points["y"]], axis=1)
    import shapely  # noqa: PLC0415 - it loads slowly

    try:
        shapes = shapely.from_wkb(column.to_numpy(zero_copy_only=False))
    except shapely.errors.ShapelyError as error:
        raise ValueError(str(error)) from error
    are_points = shapely.get_type_id(shapes) == shapely.GeometryType.POINT
    return shapely.get_coordinates(shapes[are_points])


def write_geoparquet(
    table: pa.Table,
    path: str | Path,
    *,
    geo: dict[str, Any],
    specs: dict[str, Any],
    group_rows: int | None = None,
) -> None:
    """Write an Arrow table as one whole GeoParquet file with specs in its metadata.

    The column ``geometry`` holds WKB, which `geo` describes (see `geo_metadata`). Specs are plain
    JSON values. `group_rows` is how many rows are read together, in a file that is read by box.
    """
    with whole_file(path) as partial:
        pq.write_table(
            table.replace_schema_metadata(_metadata(geo, specs)),
            partial,
            row_group_size=group_rows,
            **_encoding(table.schema),
        )
        seal(partial)


def write_geoparquet_blocks(
    blocks: Iterable[pa.Table], path: str | Path, *, geo: dict[str, Any], specs: dict[str, Any]
) -> None:
    """Write Arrow tables of the same columns, at least one, as `write_geoparquet` writes one."""
    blocks = iter(blocks)
    with whole_file(path) as partial:
        block = next(blocks)
        schema = block.schema.with_metadata(_metadata(geo, specs))
        with pq.ParquetWriter(partial, schema, **_encoding(schema)) as writer:
            for part in itertools.chain([block], blocks):
                writer.write_table(part.replace_schema_metadata(schema.metadata), GROUP_ROWS)
        seal(partial)


def _metadata(geo: dict[str, Any], specs: dict[str, Any]) -> dict[bytes, bytes]:
    return {b"geo": json.dumps(geo).encode(), SPEC_KEY: json.dumps(specs).encode()}


def _encoding(schema: pa.Schema) -> dict[str, Any]:
    """Return how the columns of a file are packed."""
    # Lengths apart from the bytes, and numbers by their differences: smaller for short rows. The
    # numbers in lists are few different ones, and so are rounded ones: a dictionary packs them
    # tighter.
    few = [f"{field.name}.list.element" for field in schema if pa.types.is_list(field.type)]
    few += [field.name for field in schema if pa.types.is_floating(field.type)]
    encodings = {
        field.name: "DELTA_BINARY_PACKED"
        if pa.types.is_integer(field.type)
        else "DELTA_LENGTH_BYTE_ARRAY"
        for field in schema
        if pa.types.is_integer(field.type) or field.type in BYTE_TYPES
    }
    return {
        "compression": "zstd",
        "compression_level": COMPRESSION,
        "use_dictionary": few,
        "column_encoding": encodings,
        **CHECKED_PAGES,
    }


CHECKED_PAGES = {"write_page_checksum": True}
"""For whatever writes Parquet: a sum of every page, which `CHECKING_PAGES` has looked at."""
CHECKING_PAGES = {"page_checksum_verification": True}
"""For whatever reads it."""

# Between the pages and the footer, where no reader looks: this and the sum of the footer.
SEAL = b"semsig"
SUM_BYTES = 4
FOOTER_END = 8  # its length and what Parquet files end with


def seal(path: Path) -> None:
    """Put a sum of its footer into a Parquet file, as the sums of pages leave that out.

    All readers take it as it was; whoever writes it anew loses the sum.
    """
    with path.open("r+b") as file:
        start, footer = _footer(file)
        file.seek(start)
        file.write(SEAL + _sum(footer) + footer)


def require_intact(path: Path) -> None:
    """Raise ValueError if the footer of a Parquet file is not the one that was sealed, if any."""
    with path.open("rb") as file:
        start, footer = _footer(file)
        file.seek(max(start - len(SEAL) - SUM_BYTES, 0))
        if file.read(len(SEAL)) == SEAL and file.read(SUM_BYTES) != _sum(footer):
            raise ValueError("the checksum of its footer does not match")


def _footer(file: BinaryIO) -> tuple[int, bytes]:
    """Return where the footer of an open Parquet file begins, and all from there on."""
    size = file.seek(0, os.SEEK_END)
    file.seek(max(size - FOOTER_END, 0))
    length = int.from_bytes(file.read(FOOTER_END // 2), "little") + FOOTER_END
    start = file.seek(max(size - length, 0))
    return start, file.read()


def _sum(footer: bytes) -> bytes:
    return zlib.crc32(footer).to_bytes(SUM_BYTES, "little")


def read_geoparquet(
    path: str | Path,
    *,
    kind: str,
    columns: list[str] | None = None,
    box: Sequence[float] | None = None,
) -> tuple[pa.Table, dict[str, Any], CRS]:
    """Return the table, the specs and the CRS of a file that `write_geoparquet` wrote.

    DatabaseError if it is missing, damaged, or not of that kind (``specs["kind"]``). Rows that do
    not meet the box ``xmin, ymin, xmax, ymax`` may be left out.
    """
    file = Path(path)
    if not os.path.isfile(file):  # noqa: PTH113 - it answers where Path.is_file raises
        what = "is a folder" if os.path.isdir(file) else "does not exist"  # noqa: PTH112
        raise DatabaseError(f"{file} {what}; give a {kind} file.")
    try:
        require_intact(file)
        parquet = pq.ParquetFile(file, memory_map=True, **CHECKING_PAGES)
        metadata = parquet.schema_arrow.metadata or {}
    except PermissionError as error:
        raise DatabaseError(
            f"{file} cannot be read ({reason(error)}); ask its owner for access."
        ) from error
    except (pa.ArrowException, OSError, ValueError) as error:
        raise_if_short(error)
        raise DatabaseError(
            f"{file} is damaged or is not a Parquet file; give another, or make the {kind} file "
            "again."
        ) from error
    try:
        specs = parse_json(metadata[SPEC_KEY], finite=True)
        crs = _crs_of(json.dumps(parse_json(metadata[b"geo"])["columns"]["geometry"]["crs"]))
        stored = specs["kind"]
    except (KeyError, TypeError, ValueError, CRSError) as error:
        raise DatabaseError(f"{file} was not written by semsig; give a {kind} file.") from error
    if stored != kind:
        raise DatabaseError(f"{file} is a {stored} file; give a {kind} file.")
    try:
        if box is None:
            # Not in one piece: the memory of a batch serves the next one, too.
            batches = list(parquet.iter_batches(BATCH_ROWS, columns=columns))
            table = pa.Table.from_batches(batches) if batches else parquet.read(columns)
        else:
            table = parquet.read_row_groups(groups_meeting(parquet, box), columns)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise_if_short(error)
        raise DatabaseError(f"{file} is damaged; make the {kind} file again.") from error
    missing = set(columns or ()) - set(table.column_names)
    if missing:
        raise DatabaseError(
            f"{file} lacks the column {min(missing)!r}; make the {kind} file again."
        )
    return table, specs, crs


@functools.lru_cache(maxsize=16)
def _crs_of(text: str) -> CRS:
    """Return the CRS that JSON describes; that of one file in many is made once."""
    return CRS.from_user_input(json.loads(text))
