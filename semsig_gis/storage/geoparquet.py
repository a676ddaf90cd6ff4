"""Read and write GeoParquet files with metadata of the package ("specs"), also by box.

Rows are in spatial order with their bounds in a column, the bounding-box covering of GeoParquet
1.1, which geopandas and GDAL use, too.
"""

from __future__ import annotations

import functools
import itertools
import json
import math
import os
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal

import lazy_loader
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core import DatabaseError, raise_if_short
from semsig_gis.storage.text import parse_json
from semsig_gis.storage.whole import reason, whole_file

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

    import shapely
    from numpy.typing import ArrayLike, NDArray
else:
    shapely = lazy_loader.load("shapely")


BBOX = "bbox"
SIDES = ("xmin", "ymin", "xmax", "ymax")
BOUNDS = pa.struct([(side, pa.float32()) for side in SIDES])
COVERING = {"bbox": {side: [BBOX, side] for side in SIDES}}
"""Description of the column `BBOX` in the ``geo`` metadata of a file."""

EMPTY_BOX = (math.inf, math.inf, -math.inf, -math.inf)
"""Intersects nothing: only the metadata of a file is read."""

GROUP_ROWS = 8192
"""Rows of a row group: the street objects of about two square kilometres of Paris."""

CURVE_SIDE = 2**16 - 1
"""Steps of the Hilbert curve on each side."""

BATCH_ROWS = 1 << 15
"""Rows that are decompressed at once if the whole file is read."""


def hilbert_order(bounds: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the permutation that sorts bounds, shape (n, 4), along a Hilbert curve.

    Equal ones keep their order. The curve is that of geopandas, which takes 0.7 s to import.
    """
    middle = (bounds[:, :2] + bounds[:, 2:]) / 2
    if not len(middle):
        return np.empty(0, np.int64)
    span = np.ptp(middle, axis=0)
    steps = (middle - middle.min(axis=0)) * np.divide(
        CURVE_SIDE, span, where=span > 0, out=0 * span
    )
    x, y = np.clip(steps, 0, CURVE_SIDE).astype(np.int64).T
    distance = np.zeros(len(x), np.int64)
    side = (CURVE_SIDE + 1) // 2
    while side:
        east, north = (x & side) > 0, (y & side) > 0
        distance += side * side * ((3 * east) ^ north)
        # Turn the quarter as the curve runs through it.
        turned = ~north
        x, y = np.where(turned & east, ~x, x), np.where(turned & east, ~y, y)
        x, y = np.where(turned, y, x), np.where(turned, x, y)
        side //= 2
    return np.argsort(distance, kind="stable")


def bounds_column(bounds: ArrayLike) -> pa.StructArray:
    """Return the column of bounds, shape (n, 4), for reading by box.

    Bounds are float32, which needs half the bytes, and rounded outwards, so that no row is missed.
    """
    exact = np.asarray(bounds, dtype=np.float64).reshape(-1, len(SIDES))
    rounded = exact.astype(np.float32)
    outwards = np.array([-np.inf, -np.inf, np.inf, np.inf], np.float32)
    too_small = np.where(outwards < 0, rounded > exact, rounded < exact)
    sides = np.where(too_small, np.nextafter(rounded, outwards), rounded)
    return pa.StructArray.from_arrays([pa.array(side) for side in sides.T], names=list(SIDES))


def groups_meeting(file: pq.ParquetFile, *boxes: Sequence[float]) -> list[int]:
    """Return the indices of row groups that may intersect a box; all without a bounds column."""
    groups = []
    for number in range(file.num_row_groups):
        group = file.metadata.row_group(number)
        statistics: dict[str, Any] = {
            column.path_in_schema: column.statistics
            for column in map(group.column, range(group.num_columns))
            if column.statistics is not None and column.statistics.has_min_max
        }
        sides = [statistics[side] for name in SIDES if (side := f"{BBOX}.{name}") in statistics]
        extent = [*(side.min for side in sides[:2]), *(side.max for side in sides[2:])]
        if len(extent) < len(SIDES) or _meeting(extent, boxes):
            groups.append(number)
    return groups


def rows_meeting(table: pa.Table, *boxes: Sequence[float]) -> pa.Table:
    """Return the rows with bounds that intersect a box ``xmin, ymin, xmax, ymax``.

    Bounds are rounded outwards, so there may be some more rows. Without a column of bounds, all
    rows are returned.
    """
    sides = _sides(table[BBOX]) if BBOX in table.column_names else None
    return table if sides is None else table.filter(pa.array(_meeting(sides, boxes)))


def _meeting(sides: Sequence[Any], boxes: Iterable[Sequence[float]]) -> Any:  # noqa: ANN401
    """Whether bounds, numbers or arrays in the order of `SIDES`, may intersect one of some boxes.

    Unknown bounds, which are NaN, may.
    """
    west, south, east, north = sides
    apart = [
        (west > xmax) | (south > ymax) | (east < xmin) | (north < ymin)
        for xmin, ymin, xmax, ymax in boxes
    ]
    return ~np.logical_and.reduce(apart)


def _sides(column: pa.ChunkedArray) -> list[NDArray[Any]] | None:
    """Return the sides of bounds in the order of `SIDES`; None for another column."""
    if not pa.types.is_struct(column.type):
        return None
    parts = zip(column.type, column.combine_chunks().flatten(), strict=True)
    arrays = {field.name: part.to_numpy(zero_copy_only=False) for field, part in parts}
    return [arrays[side] for side in SIDES] if arrays.keys() >= {*SIDES} else None


def bounds_by_group(path: str | Path) -> Iterator[NDArray[np.float64]]:
    """Yield the bounds of the rows of each row group, shape (n, 4); none without such a column."""
    with pq.ParquetFile(path, **VERIFY_CHECKSUMS) as file:
        if BBOX not in file.schema_arrow.names:
            return
        for group in range(file.num_row_groups):
            sides = _sides(file.read_row_group(group, [BBOX])[BBOX])
            if sides is not None:
                yield np.stack(sides, axis=1).astype(np.float64)


UNREADABLE = (
    *(pa.ArrowException, OSError, ValueError, LookupError, TypeError, AttributeError),
    CRSError,
)
"""Errors of geopandas for a damaged file, where the geometries can be read."""

ColumnKind = Literal["whole", "number", "text"]
"""What a column of a file contains; whole numbers are numbers as well."""

_IS_KIND: dict[ColumnKind, Callable[[pa.DataType], bool]] = {
    "whole": pa.types.is_integer,
    "number": lambda kind: pa.types.is_integer(kind) or pa.types.is_floating(kind),
    "text": lambda kind: pa.types.is_string(kind) or pa.types.is_large_string(kind),
}


def require_kinds(
    table: pa.Table, kinds: Mapping[str, ColumnKind], *, may_lack: Collection[str] = ()
) -> None:
    """Check the columns of a file; those in `may_lack` may have nulls.

    KeyError for a missing column, TypeError for one of another kind, ValueError for nulls.
    """
    for name, kind in kinds.items():
        column = table[name]
        if not _IS_KIND[kind](column.type):
            raise TypeError(f"its column {name} contains {column.type}")
        if column.null_count and name not in may_lack:
            raise ValueError(f"its column {name} has {column.null_count:,} rows without a value")


def texts_of(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return a column of texts with an empty text for every null; other columns as they are."""
    if pa.types.is_null(column.type):
        column = column.cast(pa.string())
    if not column.null_count or not _IS_KIND["text"](column.type):
        return column  # without `fill_null`, which loads pandas
    from pyarrow.compute import fill_null  # noqa: PLC0415 - slow, and rarely needed

    return fill_null(column, "")


SPEC_KEY = b"semsig"
COMPRESSION = 3
BYTE_TYPES = {pa.string(), pa.large_string(), pa.binary()}
# Well-known binary of a point: 1 for little-endian, 1 for a point, and its coordinates.
WKB_POINT = np.dtype([("order", "u1"), ("type", "<u4"), ("x", "<f8"), ("y", "<f8")])


def geo_metadata(
    crs: CRS, *, geometry_types: Sequence[str], bounds: Sequence[float]
) -> dict[str, Any]:
    """Return the ``geo`` metadata of a GeoParquet 1.1 file with WKB in the column ``geometry``.

    Bounds are ``xmin, ymin, xmax, ymax`` in `crs`; a geometry type is a name such as ``"Point"``.
    """
    column = {
        "encoding": "WKB",
        "geometry_types": list(geometry_types),
        "crs": crs.to_json_dict(),
        "bbox": [float(value) for value in bounds],
    }
    return {"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": column}}


def points_to_wkb(xy: NDArray[np.float64]) -> pa.Array:
    """Return points, shape (n, 2), as an Arrow column of well-known binary, 21 bytes per point."""
    points = np.ones(len(xy), WKB_POINT)
    points["x"], points["y"] = xy.T
    fixed = pa.binary(WKB_POINT.itemsize)
    column = pa.Array.from_buffers(fixed, len(xy), [None, pa.py_buffer(points)])
    return column.cast(pa.binary())


def whole_numbers(column: pa.Array | pa.ChunkedArray) -> NDArray[Any]:
    """Return an Arrow column of integers as a numpy array, without loading pandas.

    ValueError if the column contains missing values or another type.
    """
    array = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    if array.null_count or not pa.types.is_integer(array.type):
        raise ValueError(f"a column contains {array.type}, {array.null_count} missing")
    kind = np.dtype(str(array.type))
    content = array.buffers()[1] if len(array) else b""
    return np.frombuffer(content, kind, count=len(array), offset=array.offset * kind.itemsize)


def wkb_to_points(column: pa.ChunkedArray) -> NDArray[np.float64]:
    """Return the coordinates of points in well-known binary, shape (n, 2).

    Rows that are missing, empty or no point are omitted; ValueError if the binary cannot be read.
    """
    binary = column.combine_chunks()
    # Fast path: if all rows have the size of a point, the bytes are an array of `WKB_POINT`.
    if binary.type == pa.binary() and not binary.null_count:
        _, ends, flat = binary.buffers()
        offsets = np.frombuffer(ends, np.int32)[binary.offset : binary.offset + len(binary) + 1]
        if (np.diff(offsets) == WKB_POINT.itemsize).all():
            content = np.frombuffer(flat, np.uint8)[offsets[0] : offsets[-1]]
            points = content.view(WKB_POINT)
            if (points["order"] == 1).all() and (points["type"] == 1).all():
                return np.stack([points["x"], points["y"]], axis=1)
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
    """Write an Arrow table as a GeoParquet file with specs in its metadata, atomically.

    The column ``geometry`` contains WKB, which `geo` describes (see `geo_metadata`). Specs are
    plain JSON values. `group_rows` is the size of a row group, for files that are read by box.
    """
    with whole_file(path) as partial:
        pq.write_table(
            table.replace_schema_metadata(_metadata(geo, specs)),
            partial,
            row_group_size=group_rows,
            **_encoding(table.schema),
        )
        add_footer_checksum(partial)


def write_geoparquet_blocks(
    blocks: Iterable[pa.Table], path: str | Path, *, geo: dict[str, Any], specs: dict[str, Any]
) -> None:
    """Write one or more Arrow tables with the same columns to one file, like `write_geoparquet`."""
    blocks = iter(blocks)
    with whole_file(path) as partial:
        block = next(blocks)
        schema = block.schema.with_metadata(_metadata(geo, specs))
        with pq.ParquetWriter(partial, schema, **_encoding(schema)) as writer:
            for table in itertools.chain([block], blocks):
                writer.write_table(table.replace_schema_metadata(schema.metadata), GROUP_ROWS)
        add_footer_checksum(partial)


def _metadata(geo: dict[str, Any], specs: dict[str, Any]) -> dict[bytes, bytes]:
    return {b"geo": json.dumps(geo).encode(), SPEC_KEY: json.dumps(specs).encode()}


def _encoding(schema: pa.Schema) -> dict[str, Any]:
    """Return the options for encoding and compression of the columns of a file."""
    # Numbers in lists and rounded numbers have few distinct values: a dictionary is smallest.
    repeated = [f"{field.name}.list.element" for field in schema if pa.types.is_list(field.type)]
    repeated += [field.name for field in schema if pa.types.is_floating(field.type)]
    # Differences of integers, and lengths stored separately from bytes, are smaller for short rows.
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
        "use_dictionary": repeated,
        "column_encoding": encodings,
        **WRITE_CHECKSUMS,
    }


WRITE_CHECKSUMS = {"write_page_checksum": True}
"""Option for writing Parquet: a checksum of every page."""
VERIFY_CHECKSUMS = {"page_checksum_verification": True}
"""Option for reading Parquet: verify these checksums."""

# Stored between the pages and the footer, where no reader looks: this and the footer's checksum.
CHECKSUM_MARK = b"semsig"
CHECKSUM_BYTES = 4
FOOTER_END = 8  # bytes: the length of the footer and the end mark of Parquet files


def add_footer_checksum(path: Path) -> None:
    """Add a checksum of the footer to a Parquet file; page checksums do not cover the footer.

    All readers ignore it; another program that writes the file again drops it.
    """
    with path.open("r+b") as file:
        start, footer = _footer(file)
        file.seek(start)
        file.write(CHECKSUM_MARK + _checksum(footer) + footer)


def check_footer_checksum(path: Path) -> None:
    """Raise ValueError if a Parquet file has a footer checksum that does not match its footer."""
    with path.open("rb") as file:
        start, footer = _footer(file)
        file.seek(max(start - len(CHECKSUM_MARK) - CHECKSUM_BYTES, 0))
        marked = file.read(len(CHECKSUM_MARK)) == CHECKSUM_MARK
        if marked and file.read(CHECKSUM_BYTES) != _checksum(footer):
            raise ValueError("the checksum of its footer does not match")


def _footer(file: BinaryIO) -> tuple[int, bytes]:
    """Return the offset of the footer of an open Parquet file, and its bytes to the end."""
    size = file.seek(0, os.SEEK_END)
    file.seek(max(size - FOOTER_END, 0))
    length = int.from_bytes(file.read(FOOTER_END // 2), "little") + FOOTER_END
    start = file.seek(max(size - length, 0))
    return start, file.read()


def _checksum(footer: bytes) -> bytes:
    return zlib.crc32(footer).to_bytes(CHECKSUM_BYTES, "little")


def read_geoparquet(
    path: str | Path,
    *,
    kind: str,
    columns: list[str] | None = None,
    optional: Sequence[str] = (),
    box: Sequence[float] | None = None,
) -> tuple[pa.Table, dict[str, Any], CRS]:
    """Return the table, the specs and the CRS of a file written by `write_geoparquet`.

    DatabaseError if it is missing, damaged, or of another kind (``specs["kind"]``). Of the
    `optional` columns, those that the file has are read in addition to `columns`. With a box
    ``xmin, ymin, xmax, ymax``, row groups that do not intersect it are skipped.
    """
    file = Path(path)
    if not os.path.isfile(file):  # noqa: PTH113 - Path.is_file raises for some names
        what = "is a folder" if os.path.isdir(file) else "does not exist"  # noqa: PTH112
        raise DatabaseError(f"{file} {what}; give a {kind} file.")
    try:
        check_footer_checksum(file)
        parquet = pq.ParquetFile(file, memory_map=True, **VERIFY_CHECKSUMS)
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
        use = "" if SPEC_KEY in metadata else file_kind(file)  # else its CRS is wrong
        what = f"holds {use}" if use else "was not written by semsig"
        raise DatabaseError(f"{file} {what}; give a {kind} file.") from error
    if stored != kind:
        raise DatabaseError(f"{file} is a {stored} file; give a {kind} file.")
    try:
        if columns is not None:
            columns = [*columns, *(name for name in optional if name in parquet.schema_arrow.names)]
        if box is None:
            # In batches, because the memory of a batch is used again for the next one.
            batches = list(parquet.iter_batches(BATCH_ROWS, columns=columns))
            table = pa.Table.from_batches(batches) if batches else parquet.read(columns)
        else:
            table = parquet.read_row_groups(groups_meeting(parquet, box), columns)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise_if_short(error)
        raise DatabaseError(f"{file} is damaged; make the {kind} file again.") from error
    missing = [name for name in columns or () if name not in table.column_names]
    if missing:
        raise DatabaseError(f"{file} lacks the column {missing[0]!r}; make the {kind} file again.")
    return table, specs, crs


# The contents of a file without a kind, by the type of its shapes.
SURROUNDINGS = {
    "Polygon": "buildings, for semsig build --buildings",
    "LineString": "streets, for semsig build --streets",
}


def file_kind(path: Path) -> str:
    """Return what a GeoParquet file is: its kind, or else the use of its shapes; empty if unknown.

    Examples
    --------
    >>> file_kind(Path("nowhere.parquet"))
    ''
    """
    try:
        metadata = pq.read_schema(path).metadata or {}
        if SPEC_KEY in metadata:
            return str(parse_json(metadata[SPEC_KEY])["kind"])
        shapes = parse_json(metadata[b"geo"])["columns"]["geometry"]["geometry_types"]
    except (pa.ArrowException, OSError, KeyError, TypeError, ValueError):
        return ""
    kinds = {str(shape).removeprefix("Multi") for shape in shapes}
    return next((use for shape, use in SURROUNDINGS.items() if kinds == {shape}), "")


@functools.lru_cache(maxsize=16)
def _crs_of(text: str) -> CRS:
    """Return the CRS of PROJ JSON; cached, because many files have the same."""
    return CRS.from_user_input(json.loads(text))
