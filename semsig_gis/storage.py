"""Files that appear whole or not at all, and GeoParquet files that carry their specs.

Every output of the package is written beside its final place and renamed into it, so that a
full disk, an error or an interruption leaves the file that was there before.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import json
import os
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.boxes import GROUP_ROWS, groups_meeting
from semsig_gis.errors import DatabaseError, InputError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

__all__ = [
    "geo_metadata",
    "move_folder",
    "points_to_wkb",
    "read_geoparquet",
    "whole_file",
    "whole_folder",
    "write_geoparquet",
    "write_geoparquet_blocks",
]

SPEC_KEY = b"semsig"
COMPRESSION = 3
BYTE_TYPES = {pa.string(), pa.large_string(), pa.binary()}
# Well-known binary of a point: 1 for little-endian, 1 for a point, and where it is.
WKB_POINT = np.dtype([("order", "u1"), ("type", "<u4"), ("x", "<f8"), ("y", "<f8")])


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Give a temporary path that replaces `path` if, and only if, the block succeeds.

    The path ends in the same name, in a folder of its own beside the file; missing folders are
    made. InputError if there is no writing there, or `path` is a folder, a device or a pipe.
    """
    # A link stays, and the file that it names is replaced.
    target = Path(os.path.realpath(path))
    if os.path.isdir(target):  # noqa: PTH112 - it answers where Path.is_dir raises
        msg = f"{path} is a folder; give the name of a file to write."
        raise InputError(msg)
    if os.path.exists(target) and not os.path.isfile(target):  # noqa: PTH110, PTH113
        msg = f"{path} is a device or a pipe; give the name of a file to write."
        raise InputError(msg)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        folder = tempfile.mkdtemp(prefix=".semsig-", dir=target.parent)
    except OSError as error:
        msg = f"{path} cannot be written ({_reason(error)}); choose a folder you can write to."
        raise InputError(msg) from error
    # A folder of its own, because some formats write companions beside the file (-journal, -wal).
    partial = Path(folder) / Path(path).name
    try:
        yield partial
        os.replace(partial, target)  # noqa: PTH105 - the rename is the point
    except OSError as error:
        if error.errno is None or error.filename not in {None, str(partial), str(target)}:
            raise
        msg = (
            f"{path} could not be written ({_reason(error)}); what was there before is unchanged, "
            "so make room or choose another place."
        )
        raise InputError(msg) from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def whole_folder(path: str | Path) -> Iterator[Path]:
    """Give an empty folder that replaces `path` if, and only if, the block succeeds.

    A folder that is there is replaced with all that is in it. InputError if it cannot be written.
    """
    target = Path(os.path.realpath(path))
    with _box(target) as box:
        partial = box / target.name
        partial.mkdir()
        yield partial
        _put(partial, target, aside=box / "old")


def move_folder(new: Path, place: Path) -> None:
    """Rename a folder to its place beside it; what is there is replaced, or stays if that fails."""
    with _box(place) as box:
        _put(new, place, aside=box / "old")


@contextlib.contextmanager
def _box(target: Path) -> Iterator[Path]:
    """Give a temporary folder beside a folder that is being written."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        box = Path(tempfile.mkdtemp(prefix=".semsig-", dir=target.parent))
        try:
            yield box
        finally:
            shutil.rmtree(box, ignore_errors=True)
    except OSError as error:
        msg = (
            f"{target} could not be written ({_reason(error)}); what was there before is "
            "unchanged, so make room or choose another place."
        )
        raise InputError(msg) from error


def _put(new: Path, place: Path, *, aside: Path) -> None:
    """Rename a folder to its place; what is there is put aside, or back if that fails."""
    with contextlib.suppress(FileNotFoundError):
        place.rename(aside)
    try:
        new.rename(place)
    except OSError:
        if aside.exists():
            aside.rename(place)
        raise


def _reason(error: OSError) -> str:
    """Return the system's few words about an error, such as "Permission denied"."""
    return os.strerror(error.errno) if error.errno else str(error)


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
    JSON values, stored under the key ``semsig``. `group_rows` is how many rows are read together,
    in a file that is read by box.
    """
    with whole_file(path) as partial:
        pq.write_table(
            table.replace_schema_metadata(_metadata(geo, specs)),
            partial,
            row_group_size=group_rows,
            **_encoding(table.schema),
        )


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
        "write_page_checksum": True,
    }


def read_geoparquet(
    path: str | Path,
    *,
    kind: str,
    columns: list[str] | None = None,
    box: Sequence[float] | None = None,
) -> tuple[pa.Table, dict[str, Any], CRS]:
    """Return the table, the specs and the CRS of a file that `write_geoparquet` wrote.

    DatabaseError if it is missing, damaged, or not of that kind (``specs["kind"]``). Rows that do
    not meet the box ``xmin, ymin, xmax, ymax`` may be left out (see `semsig_gis.boxes`).
    """
    file = Path(path)
    if not os.path.isfile(file):  # noqa: PTH113 - it answers where Path.is_file raises
        what = "is a folder" if os.path.isdir(file) else "does not exist"  # noqa: PTH112
        msg = f"{file} {what}; give a {kind} file."
        raise DatabaseError(msg)
    try:
        parquet = pq.ParquetFile(file, memory_map=True, page_checksum_verification=True)
        metadata = parquet.schema_arrow.metadata or {}
    except PermissionError as error:
        msg = f"{file} cannot be read ({_reason(error)}); ask its owner for access."
        raise DatabaseError(msg) from error
    except (pa.ArrowException, OSError, ValueError) as error:
        msg = (
            f"{file} is damaged or is not a Parquet file; give another, or make the {kind} file "
            "again."
        )
        raise DatabaseError(msg) from error
    try:
        specs = json.loads(metadata[SPEC_KEY])
        crs = _crs_of(json.dumps(json.loads(metadata[b"geo"])["columns"]["geometry"]["crs"]))
        found = specs["kind"]
    except (KeyError, TypeError, ValueError, CRSError) as error:
        msg = f"{file} was not written by semsig; give a {kind} file."
        raise DatabaseError(msg) from error
    if found != kind:
        msg = f"{file} is a {found} file; give a {kind} file."
        raise DatabaseError(msg)
    try:
        if box is None:
            table = parquet.read(columns)
        else:
            table = parquet.read_row_groups(groups_meeting(parquet, box), columns)
    except (pa.ArrowException, OSError, ValueError) as error:
        msg = f"{file} is damaged; make the {kind} file again."
        raise DatabaseError(msg) from error
    missing = set(columns or ()) - set(table.column_names)
    if missing:
        msg = f"{file} lacks the column {min(missing)!r}; make the {kind} file again."
        raise DatabaseError(msg)
    return table, specs, crs


@functools.lru_cache(maxsize=16)
def _crs_of(text: str) -> CRS:
    """Return the CRS that JSON describes; that of one file in many is made once."""
    return CRS.from_user_input(json.loads(text))
