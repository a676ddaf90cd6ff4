"""Layers of a vector file through pyogrio: what they are, and all their rows at once."""

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

KINDS = dict(enumerate(("Point", "LineString", "Polygon", "MultiPoint", "MultiLineString",
                        "MultiPolygon"), start=1))  # fmt: skip
"""The kinds of geometry by their numbers in well-known binary."""
POINT = 1
RING = 4  # coordinates of the shortest ring
DIMENSIONS = 0xE0000000  # the bits that say of a third and a fourth
LARGEST_STEP = 65_536
LATIN = "ISO-8859-1"
# A reader that fails so often without a good row between does not move on, and each of these
# opens the file anew.
FAILURES_IN_A_ROW = 20
CRS_SEARCH = "USE_OSR_FIND_MATCHES"
# In FlatGeobuf, GDAL's faster way leaves it to chance where a missing geometry begins and ends.
pyogrio.set_gdal_config_options({"OGR_FLATGEOBUF_STREAM_BASE_IMPL": True})


@dataclass(frozen=True, slots=True)
class LayerDescription:
    """What GDAL says of a layer: kind of geometry, fields, CRS (empty if none), rows, bounds.

    `bounds` are west, south, east, north in the unit of the CRS, None where nothing has a geometry.
    """

    geometry: str
    fields: tuple[str, ...]
    crs: str
    rows: int
    bounds: tuple[float, ...] | None


_lock = threading.RLock()


@contextlib.contextmanager
def _listening(*, crs: bool = False) -> Iterator[list[warnings.WarningMessage]]:
    """Collect the warnings of GDAL in the block, one thread at a time: Python has one list.

    Only if `crs`, GDAL looks for the CRS of a shapefile in all of PROJ's, which takes 50 ms.
    """
    with _lock, warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        before = pyogrio.get_gdal_config_option(CRS_SEARCH)
        pyogrio.set_gdal_config_options({CRS_SEARCH: before if crs else False})
        try:
            yield heard
        finally:
            pyogrio.set_gdal_config_options({CRS_SEARCH: before})


def describe(member: Member) -> LayerDescription:
    """Describe a layer of a file; SourceError if it cannot be opened, or is of another kind."""
    member.require_sound()
    try:
        with _listening(crs=True):
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
        with _listening():
            names = [str(name) for name, _ in pyogrio.list_layers(member.address)]
    except Exception as error:
        raise unreadable(member, error) from error
    if not names:
        raise SourceError(f"{member} contains no layer; download it again.")
    return names


def read_whole(member: Member, fields: Sequence[str], count: int) -> Rows | None:
    """Return the rows of a layer of `count` rows, None if anything in it could be damaged.

    GDAL gives a missing geometry for one that it cannot read, and here does not say which it is.
    """
    if count == 0:
        return Rows()
    try:
        with _listening() as heard:
            names, values, shapes = _read(member, fields, 0, count)
        positions = _positions(shapes)
    except Exception:  # noqa: BLE001 - of many kinds; the rows are read one by one then
        return None
    if heard or (member.driver != GEOJSON and not all(shapes)):
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
    """Return the rows of a layer of `count` rows, what is wrong with bad ones, and notes.

    Rows are read in steps, which shrink where one fails, down to the rows that cannot be read.
    """
    rows = Rows()
    blank: list[str] = []
    meant = _null_shapes(member)
    step, failures = count, 0
    while rows.read < count:
        step = min(step, count - rows.read)
        try:
            with _listening():
                names, values, shapes = _read(member, fields, rows.read, step, undecoded=blank)
        except Exception as error:  # noqa: BLE001 - of many kinds, and one must not stop the rest
            if step > 1:
                step = max(1, step // 8)
                continue
            rows.read += 1
            rows.errors[rows.read] = str(error).rstrip(".")
            failures += 1
            if failures == FAILURES_IN_A_ROW:
                rows.lose(count, OUT_OF_REACH)
            continue
        for name, row, shape in zip(names, values, shapes, strict=True):
            rows.read += 1
            place = _place(rows, shape, null=meant is None or rows.read in meant)
            empty = member.driver == CONTAINER and _is_nowhere(place)
            rows.add(row, name, shapely.Point() if empty else place)
        step, failures = min(8 * step, LARGEST_STEP), 0
    return rows, (NOT_UTF8,) if blank else ()


def first_rows_of(member: Member, fields: Sequence[str], count: int) -> Iterator[dict[str, Any]]:
    """Yield the values of the first rows of a layer, without those that cannot be read."""
    try:
        with _listening():
            values = _read(member, fields, 0, count)[1]
    except Exception:  # noqa: BLE001 - a load reports it; here the other rows will do
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
    """Return names, values and well-known binary of rows, all of them; else an error is raised.

    Text that is not UTF-8 is an error, too, or None with its field added to `undecoded`. That of a
    shapefile which does not state its encoding is Latin-1 then, for fiona as well.
    """
    what: dict[str, Any] = {"layer": member.layer, "columns": list(fields), "encoding": encoding}
    what |= {"skip_features": start}
    with open_arrow(
        member.address, return_fids=True, batch_size=size, use_pyarrow=True, **what
    ) as (_, reader):
        table: Any = next(reader, ())
    if len(table) != size:  # as Arrow's way ends at an error without a word, have it said
        read(member.address, max_features=size, **what)
        raise ValueError("cannot be read")
    columns = []
    for field in fields:
        try:
            column = table.column(field)
            columns.append([_plain(value) for value in column.to_pylist()])
        except (KeyError, UnicodeDecodeError) as error:
            if encoding is None and _encoding(member) == LATIN:
                return _read(member, fields, start, size, encoding=LATIN)
            if undecoded is None or isinstance(error, KeyError):
                raise
            undecoded.append(field)
            columns.append([_text(value) for value in column.cast("binary").to_pylist()])
    names = [str(number) for number in table.column(0).to_pylist()]
    rows: list[Sequence[Any]] = [*zip(*columns, strict=True)] if columns else [()] * size
    # In a table without geometry that is another column, and nobody asks for places.
    return names, rows, table.column(table.num_columns - 1).to_pylist()


def _encoding(member: Member) -> str:
    encoding: str = pyogrio.read_info(member.address, layer=member.layer)["encoding"]
    return encoding


def _plain(value: object) -> object:
    """Return dates and times as ISO 8601 writes them, without a time zone."""
    if isinstance(value, dt.datetime):
        return value.replace(tzinfo=None).isoformat()
    return value.isoformat() if isinstance(value, dt.date | dt.time) else value


def _text(value: bytes | None) -> str | None:
    try:
        return None if value is None else value.decode()
    except UnicodeDecodeError:
        return None


def _positions(shapes: Sequence[bytes]) -> list[Position]:
    """Return what well-known binary says; GEOSException if any of it is not valid."""
    positions: list[Position] = [_point(shape) for shape in shapes]
    others = [row for row, shape in enumerate(shapes) if shape and positions[row] is None]
    with np.errstate(invalid="ignore"):  # NaN is looked for in all geometries at once
        built = shapely.force_2d(shapely.from_wkb([shapes[row] for row in others]))
    for row, geometry in zip(others, built, strict=True):
        positions[row] = geometry
    return positions


def _point(shape: bytes) -> Position:
    """Return the coordinates of a point, of which shapely takes one without x for empty."""
    if not shape or _kind(shape) != POINT:
        return None
    x, y = struct.unpack_from("<2d" if shape[0] else ">2d", shape, 5)
    return x, y


def _is_nowhere(position: Position | str) -> bool:
    """Tell whether GDAL gives a point as one of NaN: in a GeoPackage it is empty, else damaged."""
    return isinstance(position, tuple) and math.isnan(position[0]) and math.isnan(position[1])


def _kind(shape: bytes) -> int:
    (code,) = struct.unpack_from("<I" if shape[0] else ">I", shape, 1)
    return int(code & ~DIMENSIONS) % 1000


def _place(rows: Rows, shape: bytes, *, null: bool) -> Position | str:
    """Return the position of a row, or what is wrong with it."""
    if not shape:
        return None if null else "its geometry is damaged"
    try:
        return _positions([shape])[0]
    except shapely.errors.GEOSException as error:
        with np.errstate(invalid="ignore"):
            closed = shapely.from_wkb(shape, on_invalid="fix")
        rings = shapely.get_rings(shapely.get_parts(closed))
        if not len(rings) or (shapely.get_num_coordinates(rings) < RING).any():
            return f"its {KINDS.get(_kind(shape), 'geometry')} is not valid ({error})"
        rows.closed += 1
        return shapely.force_2d(closed)


def _null_shapes(member: Member) -> set[int] | None:
    """Return the rows of a shapefile whose geometry is null and not damaged; None if not needed."""
    if member.driver != SHAPEFILE:
        return None
    with member.open() as stream, member.beside(".shx").open() as index:
        content, starts = stream.read(), np.frombuffer(index.read()[100:], dtype=">i4")[::2]
    kinds = ((row, content[8 + 2 * start : 12 + 2 * start]) for row, start in enumerate(starts, 1))
    return {row for row, kind in kinds if kind == bytes(4)}
