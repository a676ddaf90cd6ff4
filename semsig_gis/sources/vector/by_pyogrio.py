"""Describe layers of vector files with pyogrio, and read all their rows at once, in Arrow."""

from __future__ import annotations

import contextlib
import math
import struct
import threading
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyogrio
import shapely
from pyogrio.raw import open_arrow, read
from shapely.geometry.base import BaseGeometry

from semsig_gis.core import SourceError
from semsig_gis.sources.csv_layer import NO_GEOMETRY
from semsig_gis.sources.rows import Rows, plain, usable_crs
from semsig_gis.sources.vector.formats import DXF, GEOJSON, GEOPACKAGE, GPX, SHAPEFILE, SQLITE
from semsig_gis.sources.vector.geojson import parse_geojson
from semsig_gis.sources.vector.member import (
    NOT_UTF8,
    OUT_OF_REACH,
    UNKNOWN,
    LayerDescription,
    unreadable,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from semsig_gis.sources.rows import Position
    from semsig_gis.sources.vector.member import Member

GEOMETRY_TYPES = dict(enumerate(("Point", "LineString", "Polygon", "MultiPoint", "MultiLineString",
                        "MultiPolygon"), start=1))  # fmt: skip
"""Geometry types by their codes in well-known binary."""
SHORTEST_RING = 4  # coordinates
DIMENSION_BITS = 0xE0000000  # the flags of Z, M and SRID
MOST_STEP_ROWS = 65_536
LATIN = "ISO-8859-1"
# After this number of failures in succession, the reader does not advance any more. Each attempt
# opens the file again.
MOST_FAILURES = 20
# Layers without objects: the strokes of symbols, and ways that somebody has gone or will go.
NO_DATA = {
    DXF: {"blocks"},
    GPX: {"routes", "tracks", "route_points", "track_points"},
}
CRS_SEARCH = "USE_OSR_FIND_MATCHES"
# GDAL's faster reader of FlatGeobuf returns random offsets for missing geometries.
# The place of a symbol in a drawing is its point of insertion, not the middle of its strokes.
pyogrio.set_gdal_config_options(
    {"OGR_FLATGEOBUF_STREAM_BASE_IMPL": True, "DXF_INLINE_BLOCKS": False}
)


_lock = threading.RLock()
# The CRS that GDAL finds in the database of PROJ for the text of a shapefile, which takes 50 ms.
_matches: dict[str, str] = {}


@contextlib.contextmanager
def _captured_warnings(*, crs: bool = False) -> Iterator[list[warnings.WarningMessage]]:
    """Collect the warnings of GDAL in the block, for one thread at a time.

    With `crs`, GDAL compares the CRS of a shapefile with the database of PROJ.
    """
    with _lock, warnings.catch_warnings(record=True) as captured:
        warnings.simplefilter("always")
        before = pyogrio.get_gdal_config_option(CRS_SEARCH)
        pyogrio.set_gdal_config_options({CRS_SEARCH: before if crs else False})
        try:
            yield captured
        finally:
            pyogrio.set_gdal_config_options({CRS_SEARCH: before})


def describe(member: Member, *, bounds: bool = False) -> LayerDescription:
    """Describe a layer of a file; SourceError if it cannot be opened, or is of another kind.

    For the `bounds` of GeoJSON, GDAL parses the file as well. With them, the geometries of a layer
    without a type are read to find it.
    """
    member.require_sound()
    if member.driver == GEOJSON:
        geojson, complete = parse_geojson(member)
        if complete and not bounds:
            return geojson
    info = _info(member)
    if info["driver"] != member.driver and not {info["driver"], member.driver} <= SQLITE:
        raise SourceError(
            f"{member} is not the kind of file that its name says; download it again."
        )
    text = info["crs"] or ""
    if member.driver == SHAPEFILE and text:
        if text not in _matches:
            _matches[text] = _info(member, crs=True)["crs"] or ""
        text = _matches[text]
    geometry = info["geometry_type"] or NO_GEOMETRY
    if bounds and geometry == UNKNOWN and member.driver != GEOJSON:
        geometry = _common_type(member, info["features"])
    layer = LayerDescription(
        geometry=geometry,
        fields=tuple(info["fields"]),
        crs=usable_crs(text),
        rows=info["features"],
        bounds=info["total_bounds"],
    )
    if member.driver != GEOJSON:
        return layer
    # Rows cannot be assigned if GDAL counts differently.
    same = geojson.rows == layer.rows
    empty = geojson.empty if same else frozenset(range(1, layer.rows + 1))
    return replace(layer, crs=geojson.crs, implicit=geojson.implicit, empty=empty)


def _info(member: Member, *, crs: bool = False) -> dict[str, Any]:
    try:
        with _captured_warnings(crs=crs):
            info: dict[str, Any] = pyogrio.read_info(
                member.address,
                layer=member.layer,
                encoding=member.gdal_encoding,
                force_feature_count=True,
                force_total_bounds=member.driver == GEOJSON,
            )
    except Exception as error:
        raise unreadable(member, error) from error
    return info


def _common_type(member: Member, count: int) -> str:
    """Return the geometry type of all rows of a layer that does not state one."""
    rows = read_whole(member, (), count)
    places = rows.positions if rows else []
    kinds = {place.geom_type for place in places if isinstance(place, BaseGeometry)}
    return kinds.pop() if len(kinds) == 1 else UNKNOWN


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
    return [name for name in names if name not in NO_DATA.get(member.driver, ())]


def read_whole(member: Member, fields: Sequence[str], count: int) -> Rows | None:
    """Return the rows of a layer of `count` rows, or None if a row may be damaged.

    GDAL returns a missing geometry also for a damaged one, without a distinction.
    """
    if count == 0:
        return Rows.of(fields)
    try:
        with _captured_warnings() as captured:
            names, columns, shapes = _read(member, fields, 0, count)
        geometry, nowhere = _geometries(shapes.to_numpy(zero_copy_only=False))
    except Exception:  # noqa: BLE001 - any error; the rows are read one by one then
        return None
    # A warning, a missing geometry or a point of NaN may be damage.
    if captured or (member.driver != GEOJSON and shapes.null_count):
        return None
    if member.driver != GEOPACKAGE and nowhere:
        return None
    return Rows(
        columns,
        read=count,
        numbers=list(range(1, count + 1)),
        names=names,
        positions=geometry.tolist(),
    )


def read_each(member: Member, fields: Sequence[str], count: int) -> tuple[Rows, tuple[str, ...]]:
    """Return the rows of a layer of `count` rows with errors of bad rows, and notes.

    Rows are read in blocks. A block that fails is divided until a single row fails.
    """
    rows = Rows.of(fields)
    undecoded: list[str] = []
    null_rows: set[int] | None = None  # of a shapefile, which states them
    if member.driver == SHAPEFILE:
        shx = member.sibling(".shx") or member
        with member.open() as stream, shx.open() as index:
            content, starts = stream.read(), np.frombuffer(index.read()[100:], dtype=">i4")[::2]
        # The geometry type follows the 8 bytes of the header of a record; 0 is null.
        kinds = ((row, content[8 + 2 * at : 12 + 2 * at]) for row, at in enumerate(starts, 1))
        null_rows = {row for row, kind in kinds if kind == bytes(4)}
    step, failures = count, 0
    while rows.read < count:
        step = min(step, count - rows.read)
        try:
            with _captured_warnings():
                names, columns, shapes = _read(member, fields, rows.read, step, undecoded=undecoded)
        except Exception as error:  # noqa: BLE001 - any error; the other rows are read
            if step > 1:
                step = max(1, step // 8)
                continue
            rows.skip(str(error).rstrip("."))
            failures += 1
            if failures == MOST_FAILURES:
                rows.mark_unreadable(count, OUT_OF_REACH)
            continue
        lists = {field: column.to_pylist() for field, column in columns.items()}
        for row, (name, shape) in enumerate(zip(names, shapes.to_pylist(), strict=True)):
            values = {field: column[row] for field, column in lists.items()}
            null = null_rows is None or rows.read + 1 in null_rows
            place = _place(rows, shape, null=null, keep=member.driver != GEOPACKAGE)
            rows.add(values, name, place)
        # After a success, try larger blocks again.
        step, failures = min(8 * step, MOST_STEP_ROWS), 0
    return rows, (NOT_UTF8,) if undecoded else ()


def first_rows_of(member: Member, fields: Sequence[str], count: int) -> Iterator[dict[str, Any]]:
    """Yield the values of the first readable rows of a layer."""
    try:
        with _captured_warnings():
            arrays = _read(member, fields, 0, count)[1]
        columns = {field: column.to_pylist() for field, column in arrays.items()}
    except Exception:  # noqa: BLE001 - any error; the readable rows are enough here
        rows = read_each(member, fields, count)[0]
        columns = {field: rows.column(field) for field in fields}
    for values in zip(*columns.values(), strict=True):
        yield {field: plain(value) for field, value in zip(fields, values, strict=True)}


def _read(
    member: Member,
    fields: Sequence[str],
    start: int,
    size: int,
    *,
    undecoded: list[str] | None = None,
    encoding: str | None = None,
) -> tuple[list[str], dict[str, pa.Array], pa.Array]:
    """Return names, values and well-known binary of `size` rows; raise if a row cannot be read.

    Text that is not UTF-8 raises; with a list `undecoded` it becomes None and its field is added to
    the list. A shapefile that does not state its encoding and is not UTF-8 is read as Latin-1.
    """
    encoding = encoding or member.gdal_encoding
    options: dict[str, Any] = {"layer": member.layer, "columns": list(fields), "encoding": encoding}
    options |= {"skip_features": start}
    with open_arrow(
        member.address, return_fids=True, batch_size=size, use_pyarrow=True, **options
    ) as (meta, reader):
        batch: Any = next(reader, ())
    if len(batch) != size:  # Arrow stops without a message; the other reader raises the error
        read(member.address, max_features=size, **options)
        raise ValueError("cannot be read")
    if meta["encoding"] == LATIN and not encoding:  # GDAL assumes it without a stated encoding
        try:
            for column in batch.columns:  # raises as well if a name is not UTF-8
                column.validate(full=True)
        except (pa.ArrowInvalid, UnicodeDecodeError):
            return _read(member, fields, start, size, undecoded=undecoded, encoding=LATIN)
    # By number, because the column of row numbers, the first one, may have the name of a field. The
    # last one is the geometry; in a table without geometry nobody uses it.
    arrays = dict(zip(meta["fields"].tolist(), batch.columns[1:], strict=False))
    columns = {field: _labels(arrays[field]) for field in fields}
    for field, column in columns.items():
        try:
            column.validate(full=True)
        except pa.ArrowInvalid:
            if undecoded is None:
                raise
            undecoded.append(field)
            texts = [_decoded(value) for value in column.cast("binary").to_pylist()]
            columns[field] = pa.array(texts, pa.string())
    # Where geoarrow is imported, geometry has a type of its own, which is stored as binary.
    geometry = getattr(batch.columns[-1], "storage", batch.columns[-1])
    return list(map(str, batch.column(0).to_pylist())), columns, geometry


def _labels(column: pa.Array) -> pa.Array:
    """Return the labels of a field with a coded domain, and codes without a label as text."""
    if not pa.types.is_dictionary(column.type):
        return column
    codes, labels = column.indices, column.dictionary
    codes_in_domain = pc.if_else(pc.less(codes, len(labels)), codes, None)
    return pc.coalesce(labels.take(codes_in_domain), codes.cast(pa.string()))


def _decoded(value: bytes | None) -> str | None:
    try:
        return None if value is None else value.decode()
    except UnicodeDecodeError:
        return None


def _geometries(shapes: Sequence[bytes]) -> tuple[NDArray[np.object_], list[int]]:
    """Return the geometries of well-known binary, and the rows of points with two NaN.

    A point with two NaN becomes empty. GEOSException if a geometry is not valid.
    """
    with np.errstate(invalid="ignore"):  # NaN is checked later for all geometries at once
        built = shapely.force_2d(np.array(shapely.from_wkb(shapes), dtype=object))
    nowhere = []
    # Shapely returns a point with x = NaN as empty.
    is_point = shapely.get_type_id(built) == shapely.GeometryType.POINT
    for row in np.flatnonzero(is_point & shapely.is_empty(built)).tolist():
        x, y = struct.unpack_from("<2d" if shapes[row][0] else ">2d", shapes[row], 5)
        built[row] = shapely.points(x, y)
        if math.isnan(x) and math.isnan(y):
            built[row] = shapely.Point()
            nowhere.append(row)
    return built, nowhere


def _place(rows: Rows, shape: bytes, *, null: bool, keep: bool) -> Position | str:
    """Return the position of a row, or the text of its error; with `keep`, a point may be NaN."""
    if not shape:
        return None if null else "its geometry is damaged"
    try:
        (geometry,), nowhere = _geometries([shape])
    except shapely.errors.GEOSException as error:
        with np.errstate(invalid="ignore"):
            closed = shapely.from_wkb(shape, on_invalid="fix")
        rings = shapely.get_rings(shapely.get_parts(closed))
        if not len(rings) or (shapely.get_num_coordinates(rings) < SHORTEST_RING).any():
            (code,) = struct.unpack_from("<I" if shape[0] else ">I", shape, 1)
            kind = GEOMETRY_TYPES.get(int(code & ~DIMENSION_BITS) % 1000, "geometry")
            return f"its {kind} is not valid ({error})"
        rows.closed += 1
        return shapely.force_2d(closed)
    return (math.nan, math.nan) if nowhere and keep else geometry
