"""Describe and read layers of vector files with pyogrio, all rows at once."""

from __future__ import annotations

import contextlib
import datetime as dt
import math
import struct
import threading
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyogrio
import shapely
from pyogrio.raw import open_arrow, read

from semsig_gis.core import SourceError
from semsig_gis.sources.csv_layer import NO_GEOMETRY
from semsig_gis.sources.rows import Rows
from semsig_gis.sources.vector.member import (
    CONTAINER,
    GEOJSON,
    NOT_UTF8,
    OUT_OF_REACH,
    SHAPEFILE,
    not_of_its_kind,
    unreadable,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from semsig_gis.sources.rows import Position
    from semsig_gis.sources.vector.member import Member

GEOMETRY_TYPES = dict(enumerate(("Point", "LineString", "Polygon", "MultiPoint", "MultiLineString",
                        "MultiPolygon"), start=1))  # fmt: skip
"""Geometry types by their codes in well-known binary."""
POINT = 1
SHORTEST_RING = 4  # coordinates
DIMENSION_BITS = 0xE0000000  # the flags of Z, M and SRID
MOST_STEP_ROWS = 65_536
LATIN = "ISO-8859-1"
# After this number of failures in succession, the reader does not advance any more. Each attempt
# opens the file again.
MOST_FAILURES = 20
CRS_SEARCH = "USE_OSR_FIND_MATCHES"
# GDAL's faster reader of FlatGeobuf returns random offsets for missing geometries.
pyogrio.set_gdal_config_options({"OGR_FLATGEOBUF_STREAM_BASE_IMPL": True})


@dataclass(frozen=True, slots=True)
class LayerDescription:
    """Description of a layer by GDAL: geometry type, fields, CRS (empty if none), rows, bounds.

    `bounds` are west, south, east, north in the unit of the CRS, None without a geometry.
    """

    geometry: str
    fields: tuple[str, ...]
    crs: str
    rows: int
    bounds: tuple[float, ...] | None


_lock = threading.RLock()


@contextlib.contextmanager
def _captured_warnings(*, crs: bool = False) -> Iterator[list[warnings.WarningMessage]]:
    """Collect the warnings of GDAL in the block, for one thread at a time.

    With `crs`, GDAL compares the CRS of a shapefile with the database of PROJ, which takes 50 ms.
    """
    with _lock, warnings.catch_warnings(record=True) as captured:
        warnings.simplefilter("always")
        before = pyogrio.get_gdal_config_option(CRS_SEARCH)
        pyogrio.set_gdal_config_options({CRS_SEARCH: before if crs else False})
        try:
            yield captured
        finally:
            pyogrio.set_gdal_config_options({CRS_SEARCH: before})


def describe(member: Member) -> LayerDescription:
    """Describe a layer of a file; SourceError if it cannot be opened, or is of another kind."""
    member.require_sound()
    try:
        with _captured_warnings(crs=True):
            info = pyogrio.read_info(
                member.address,
                layer=member.layer,
                force_feature_count=True,
                force_total_bounds=member.driver == GEOJSON,
            )
    except Exception as error:
        raise unreadable(member, error) from error
    if info["driver"] != member.driver:
        raise not_of_its_kind(member)
    return LayerDescription(
        geometry=info["geometry_type"] or NO_GEOMETRY,
        fields=tuple(info["fields"]),
        crs=info["crs"] or "",
        rows=info["features"],
        bounds=info["total_bounds"],
    )


def layer_names(member: Member) -> list[str]:
    """Return the names of the layers of a file."""
    member.require_sound()
    try:
        with _captured_warnings():
            names = [str(name) for name, _ in pyogrio.list_layers(member.address)]
    except Exception as error:
        raise unreadable(member, error) from error
    if not names:
        raise SourceError(f"{member} contains no layer; download it again.")
    return names


def read_whole(member: Member, fields: Sequence[str], count: int) -> Rows | None:
    """Return the rows of a layer of `count` rows, or None if a row may be damaged.

    GDAL returns a missing geometry also for a damaged one, without a distinction.
    """
    if count == 0:
        return Rows()
    try:
        with _captured_warnings() as captured:
            names, values, shapes = _read(member, fields, 0, count)
        positions = _positions(shapes)
    except Exception:  # noqa: BLE001 - any error; the rows are read one by one then
        return None
    # A warning, a missing geometry or a point of NaN may be damage.
    if captured or (member.driver != GEOJSON and not all(shapes)):
        return None
    if member.driver != CONTAINER and any(map(_is_nowhere, positions)):
        return None
    return Rows(
        read=count,
        numbers=list(range(1, count + 1)),
        names=names,
        values=values,
        positions=[shapely.Point() if _is_nowhere(place) else place for place in positions],
    )


def read_each(member: Member, fields: Sequence[str], count: int) -> tuple[Rows, tuple[str, ...]]:
    """Return the rows of a layer of `count` rows with errors of bad rows, and notes.

    Rows are read in blocks. A block that fails is divided until a single row fails.
    """
    rows = Rows()
    undecoded: list[str] = []
    null_rows: set[int] | None = None  # of a shapefile, which states them
    if member.driver == SHAPEFILE:
        with member.open() as stream, member.sibling(".shx").open() as index:
            content, starts = stream.read(), np.frombuffer(index.read()[100:], dtype=">i4")[::2]
        # The geometry type follows the 8 bytes of the header of a record; 0 is null.
        kinds = ((row, content[8 + 2 * at : 12 + 2 * at]) for row, at in enumerate(starts, 1))
        null_rows = {row for row, kind in kinds if kind == bytes(4)}
    step, failures = count, 0
    while rows.read < count:
        step = min(step, count - rows.read)
        try:
            with _captured_warnings():
                names, values, shapes = _read(member, fields, rows.read, step, undecoded=undecoded)
        except Exception as error:  # noqa: BLE001 - any error; the other rows are read
            if step > 1:
                step = max(1, step // 8)
                continue
            rows.read += 1
            rows.errors[rows.read] = str(error).rstrip(".")
            failures += 1
            if failures == MOST_FAILURES:
                rows.mark_unreadable(count, OUT_OF_REACH)
            continue
        for name, row, shape in zip(names, values, shapes, strict=True):
            rows.read += 1
            place = _place(rows, shape, null=null_rows is None or rows.read in null_rows)
            empty = member.driver == CONTAINER and _is_nowhere(place)
            rows.add(row, name, shapely.Point() if empty else place)
        # After a success, try larger blocks again.
        step, failures = min(8 * step, MOST_STEP_ROWS), 0
    return rows, (NOT_UTF8,) if undecoded else ()


def first_rows_of(member: Member, fields: Sequence[str], count: int) -> Iterator[dict[str, Any]]:
    """Yield the values of the first readable rows of a layer."""
    try:
        with _captured_warnings():
            values = _read(member, fields, 0, count)[1]
    except Exception:  # noqa: BLE001 - any error; the readable rows are enough here
        values = read_each(member, fields, count)[0].values
    for value in values:
        yield dict(zip(fields, value, strict=True))


def _read(
    member: Member,
    fields: Sequence[str],
    start: int,
    size: int,
    *,
    undecoded: list[str] | None = None,
    encoding: str | None = None,
) -> tuple[list[str], list[Sequence[Any]], list[bytes]]:
    """Return names, values and well-known binary of `size` rows; raise if a row cannot be read.

    Text that is not UTF-8 raises; with a list `undecoded` it becomes None and its field is added to
    the list. A shapefile without a stated encoding is read as Latin-1 then, as fiona does.
    """
    options: dict[str, Any] = {"layer": member.layer, "columns": list(fields), "encoding": encoding}
    options |= {"skip_features": start}
    with open_arrow(
        member.address, return_fids=True, batch_size=size, use_pyarrow=True, **options
    ) as (_, reader):
        table: Any = next(reader, ())
    if len(table) != size:  # Arrow stops without a message; the other reader raises the error
        read(member.address, max_features=size, **options)
        raise ValueError("cannot be read")
    columns = []
    for field in fields:
        try:
            column = table.column(field)
            columns.append([_plain(value) for value in column.to_pylist()])
        except (KeyError, UnicodeDecodeError) as error:
            info = {} if encoding else pyogrio.read_info(member.address, layer=member.layer)
            if info.get("encoding") == LATIN:
                return _read(member, fields, start, size, encoding=LATIN)
            if undecoded is None or isinstance(error, KeyError):
                raise
            undecoded.append(field)
            columns.append([_decoded(value) for value in column.cast("binary").to_pylist()])
    names = [str(number) for number in table.column(0).to_pylist()]
    rows: list[Sequence[Any]] = [*zip(*columns, strict=True)] if columns else [()] * size
    # The last column is the geometry; in a table without geometry nobody uses it.
    return names, rows, table.column(table.num_columns - 1).to_pylist()


def _plain(value: object) -> object:
    """Return dates and times as text in ISO 8601 without a time zone, others unchanged."""
    if isinstance(value, dt.datetime):
        return value.replace(tzinfo=None).isoformat()
    return value.isoformat() if isinstance(value, dt.date | dt.time) else value


def _decoded(value: bytes | None) -> str | None:
    try:
        return None if value is None else value.decode()
    except UnicodeDecodeError:
        return None


def _positions(shapes: Sequence[bytes]) -> list[Position]:
    """Return the positions of well-known binary; GEOSException if a geometry is not valid."""
    positions: list[Position] = [_point(shape) for shape in shapes]
    others = [row for row, shape in enumerate(shapes) if shape and positions[row] is None]
    with np.errstate(invalid="ignore"):  # NaN is checked later for all geometries at once
        built = shapely.force_2d(shapely.from_wkb([shapes[row] for row in others]))
    for row, geometry in zip(others, built, strict=True):
        positions[row] = geometry
    return positions


def _point(shape: bytes) -> Position:
    """Return the coordinates of a point, else None.

    Shapely is not used, because it returns a point with x = NaN as empty.
    """
    if not shape or _kind(shape) != POINT:
        return None
    x, y = struct.unpack_from("<2d" if shape[0] else ">2d", shape, 5)
    return x, y


def _is_nowhere(position: Position | str) -> bool:
    """Whether a point has NaN coordinates: in a GeoPackage it is empty, else damaged."""
    return isinstance(position, tuple) and math.isnan(position[0]) and math.isnan(position[1])


def _kind(shape: bytes) -> int:
    (code,) = struct.unpack_from("<I" if shape[0] else ">I", shape, 1)
    return int(code & ~DIMENSION_BITS) % 1000


def _place(rows: Rows, shape: bytes, *, null: bool) -> Position | str:
    """Return the position of a row, or the text of its error."""
    if not shape:
        return None if null else "its geometry is damaged"
    try:
        return _positions([shape])[0]
    except shapely.errors.GEOSException as error:
        with np.errstate(invalid="ignore"):
            closed = shapely.from_wkb(shape, on_invalid="fix")
        rings = shapely.get_rings(shapely.get_parts(closed))
        if not len(rings) or (shapely.get_num_coordinates(rings) < SHORTEST_RING).any():
            return f"its {GEOMETRY_TYPES.get(_kind(shape), 'geometry')} is not valid ({error})"
        rows.closed += 1
        return shapely.force_2d(closed)
