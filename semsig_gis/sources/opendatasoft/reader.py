"""Opendatasoft portals, such as Open Data Paris: their files, and their Explore API v2.1."""

from __future__ import annotations

import dataclasses
import unicodedata
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np
import shapely
import shapely.geometry
from shapely.errors import ShapelyError

from semsig_gis.core.errors import CatalogError, SourceError
from semsig_gis.sources import vector as vector_file
from semsig_gis.sources.decimals import decimal
from semsig_gis.sources.http.fetch import DEFAULT_HTTP, HttpError, fetch
from semsig_gis.sources.opendatasoft.table import open_table
from semsig_gis.sources.raw_layer import (
    WGS84,
    BadFeatureError,
    RowRules,
    Rows,
    raw_layer,
    require_field,
    settle_crs,
)
from semsig_gis.storage.text import parse_json

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from shapely.geometry.base import BaseGeometry

    from semsig_gis.sources import RawLayer
    from semsig_gis.sources.area import Area
    from semsig_gis.sources.catalog import LayerSpec
    from semsig_gis.sources.http.cache import Cache, Fetched
    from semsig_gis.sources.http.fetch import HttpSpec
    from semsig_gis.sources.opendatasoft.table import Record, Table
    from semsig_gis.sources.raw_layer import Position


def fold(name: str) -> str:
    """Return what the styles of a name share: `TYPE EMPLACEMENT` is `typeemplacement`."""
    plain = unicodedata.normalize("NFKD", name).casefold()
    return "".join(letter for letter in plain if letter.isalnum())


def find_field(name: str, spec: LayerSpec, fields: Sequence[str]) -> str | None:
    """Return the field of that name, of an alias, or of one that differs in style, or None."""
    names = (name, *dict(spec.aliases).get(name, ()))
    folded = {fold(field): field for field in reversed(fields) if fold(field)}
    exact = (candidate for candidate in names if candidate in fields)
    alike = (folded[fold(candidate)] for candidate in names if fold(candidate) in folded)
    return next(exact, None) or next(alike, None)


def settle_fields(spec: LayerSpec, fields: Sequence[str]) -> LayerSpec:
    """Return a specification that calls every field as the file does."""

    def own(name: str) -> str:
        return find_field(name, spec, fields) or name  # which an error names if it is absent

    class_by, width_by = spec.class_by, spec.width_by
    return dataclasses.replace(
        spec,
        id_field=spec.id_field and own(spec.id_field),
        width_field=spec.width_field and own(spec.width_field),
        name_field=spec.name_field and own(spec.name_field),
        width_by=width_by and dataclasses.replace(width_by, field=own(width_by.field)),
        where=tuple((own(field), accepted) for field, accepted in spec.where),
        exclusions=tuple((own(field), accepted) for field, accepted in spec.exclusions),
        class_by=class_by and dataclasses.replace(class_by, field=own(class_by.field)),
        select=tuple(own(field) for field in spec.select),
    )


# What portals call the two by default; a catalogue lists other names as their aliases.
SHAPE = "geo_shape"
POINT = "geo_point_2d"


class Positions:
    """Finds the position of the records of a table; SourceError if it has no field for one.

    The shape goes first, because it says which coordinate is which; then the point, which is ``lat,
    lon``, and then two fields with a coordinate each.
    """

    def __init__(self, spec: LayerSpec, table: Table, *, where: str) -> None:
        def own(name: str | None) -> str | None:
            return name and find_field(name, spec, table.fields)

        self._shape, self._point = own(SHAPE), own(POINT)
        self._x, self._y = own(spec.x_field), own(spec.y_field)
        columns = (self._shape, self._point, self._x, self._y)
        self.fields = tuple(field for field in columns if field is not None)
        coordinates = self._x and self._y
        positioned = self._shape or self._point or coordinates or table.has_geometry
        if not (positioned or table.empty):
            msg = (
                f"{where} has no position: none of its fields {', '.join(table.fields)} is "
                f"{SHAPE} or {POINT}; name the one that is, as an alias in the catalogue."
            )
            raise SourceError(msg)

    def of(self, record: Record) -> Position:
        """Return the position of a record, or None where it has none."""
        values = record.values
        if self._shape is not None:
            shape = _shape(values.get(self._shape))
            if shape is not None:
                return shape
        if record.geometry is not None:
            return _shape(record.geometry)
        if self._point is not None:
            point = _point(values.get(self._point))
            if point is not None:
                return point
        if self._x is not None and self._y is not None:
            return _coordinates(values, self._x, self._y)
        return None


def _shape(value: Any) -> Position:  # noqa: ANN401 - whatever is in the file
    """Return a shape that is GeoJSON, such JSON as text, or WKB."""
    if value is None or value == "":
        return None
    try:
        if isinstance(value, bytes):
            return shapely.from_wkb(value)
        geometry = parse_json(value) if isinstance(value, str) else value
        if geometry.get("type") == "Feature":
            geometry = geometry["geometry"]
        if geometry is None:
            return None
        if geometry["type"] == "Point" and geometry["coordinates"]:
            x, y = geometry["coordinates"][:2]
            return float(x), float(y)
        with np.errstate(invalid="ignore"):  # NaN is looked for in all geometries at once
            return shapely.geometry.shape(geometry)
    except (AttributeError, LookupError, TypeError, ValueError, ShapelyError) as error:
        msg = f"its shape {_shown(value)} is not a GeoJSON geometry"
        raise BadFeatureError(msg) from error


def _point(value: Any) -> Position:  # noqa: ANN401 - whatever is in the file
    """Return a point written ``lat, lon``, as a list of the two, by name, as GeoJSON or WKB."""
    if value is None or (isinstance(value, str) and not value.strip()):
        return None
    if isinstance(value, bytes) or (isinstance(value, dict) and "type" in value):
        return _shape(value)
    try:
        if isinstance(value, dict):
            return float(value["lon"]), float(value["lat"])
        lat, lon = value.split(",") if isinstance(value, str) else value
        return float(lon), float(lat)
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        msg = f"its point {_shown(value)} is not a latitude and a longitude"
        raise BadFeatureError(msg) from error


def _coordinates(values: Mapping[str, Any], x: str, y: str) -> tuple[float, float] | None:
    both = (values.get(x), values.get(y))
    if all(value is None or value == "" for value in both):
        return None
    try:
        # What is no number, raises.
        return tuple(decimal(v) if isinstance(v, str) else float(v) for v in both)  # type: ignore[arg-type, return-value]
    except (TypeError, ValueError) as error:
        msg = f"its {x} {both[0]!r} and {y} {both[1]!r} are not two numbers"
        raise BadFeatureError(msg) from error


def _shown(value: object) -> str:
    text = value if isinstance(value, str) else repr(value)
    return repr(text if len(text) <= 60 else f"{text[:60]}...")  # noqa: PLR2004 - fits a line


# What people make of a portal's data with other programs, and leave beside its own files.
VECTOR_SUFFIXES = frozenset({".fgb", ".gpkg", ".shp", ".zip"})
# Longer addresses are refused by some servers.
LONGEST_OUTLINE = 2_000
GEOJSON = ("application/geo+json", "application/vnd.geo+json", "application/json")


def read_layers(
    path: str | Path, specs: Sequence[LayerSpec], *, filters: bool = True, crs: str | None = None
) -> tuple[RawLayer, ...]:
    """Read layers, in one pass, from a file that a portal exports, as it is.

    JSON of version 1, 2.0 or 2.1 of the API, GeoJSON, CSV and Parquet are told apart by what is in
    the file; a vector file or archive made of such a file will do too. What portals publish is in
    WGS 84; `crs` is for a file that states none.
    """
    path = Path(path)
    if path.suffix.lower() in VECTOR_SUFFIXES:
        return tuple(_read_vector(path, spec, filters=filters, crs=crs) for spec in specs)
    table = open_table(path)
    layers = [_TableLayer(spec, table, path, filters=filters, crs=crs) for spec in specs]
    for record in table.records([field for layer in layers for field in layer.fields]):
        for layer in layers:
            layer.add(record)
    return tuple(layer.raw() for layer in layers)


def _read_vector(path: Path, spec: LayerSpec, *, filters: bool, crs: str | None) -> RawLayer:
    layers = {info.name: info for info in vector_file.list_layers(path)}
    named = [layers[spec.layer]] if spec.layer in layers else list(layers.values())
    fields = [field for info in named for field, _ in info.fields]
    layer = vector_file.read_layer(path, settle_fields(spec, fields), filters=filters, crs=crs)
    return dataclasses.replace(layer, spec=spec)


class _TableLayer:
    """One layer that is being read from a table."""

    def __init__(
        self, spec: LayerSpec, table: Table, path: Path, *, filters: bool, crs: str | None
    ) -> None:
        self._spec = spec
        where = f"layer {spec.name!r} ({path})"
        own, implicit = table.crs or WGS84, table.crs is None
        self._crs, self._notes = settle_crs(
            own, implicit=implicit, expected=spec.crs, given=crs, where=where
        )
        self._notes = (*table.notes, *self._notes)
        self._by_file = not implicit
        if table.rest:
            rest = (
                f"the file is one page of a longer answer, which has {table.rest:,} records more; "
                "export the whole dataset instead"
            )
            self._notes += (rest,)
        # A table without rows has no fields to look at.
        fields = [field for _, field in spec.fields] if table.empty else table.fields
        named = settle_fields(spec, fields)
        self._rules = RowRules(named, fields, filters=filters, where=where)
        self._positions = Positions(spec, table, where=where)
        self._rows = Rows()
        self.fields = (*self._rules.fields, *self._positions.fields)

    def add(self, record: Record | str) -> None:
        """Add the next row of the table."""
        self._rows.read += 1
        if isinstance(record, str):
            self._rows.errors[self._rows.read] = record
            return
        try:
            position: Position | str = self._positions.of(record)
        except BadFeatureError as error:
            position = str(error)
        values = [record.values.get(field) for field in self._rules.fields]  # JSON omits nulls
        self._rows.add(values, str(self._rows.read), position)

    def raw(self) -> RawLayer:
        """Return what was read."""
        layer = raw_layer(
            self._rows, self._rules, self._crs, by_file=self._by_file, notes=self._notes
        )
        return dataclasses.replace(layer, spec=self._spec)


# --- Live -------------------------------------------------------------------------------------


def fetch_layers(
    specs: Sequence[LayerSpec],
    *,
    endpoints: Sequence[str],
    area: Area | None = None,
    cache: Cache,
    spec: HttpSpec = DEFAULT_HTTP,
    progress: Callable[[int, int], None] | None = None,
) -> list[tuple[LayerSpec, Fetched]]:
    """Fetch layers from the portal at the first address, as files for `read_layers`.

    Layers without a dataset are left out, because the portal does not have them. For each dataset
    its description is asked for, then one export (Explore API v2.1), whose ``where`` is the layer's
    ``server_where`` and the area; for an outline of very many corners, a somewhat larger one. Where
    a layer selects fields, those that its other keys name are selected too. CatalogError if the
    portal lacks the dataset or a selected field, SourceError if it refuses or sends something else.
    """
    portal = endpoints[0]
    files = []
    for layer in specs:
        if layer.dataset is None:
            continue
        dataset = quote(layer.dataset, safe="")
        address = f"{portal.rstrip('/')}/api/explore/v2.1/catalog/datasets/{dataset}"
        try:
            types = _field_types(address, layer, portal, cache=cache, spec=spec)
            file = fetch(
                f"{address}/exports/geojson",
                params=_query(layer, types, area, where=f"dataset {layer.dataset!r}"),
                cache=cache,
                spec=spec,
                accept=GEOJSON,
                suffix=".geojson",
                check=_require_whole,
                progress=progress,
            )
        except HttpError as error:
            msg = f"layer {layer.name!r}: {error}"
            raise HttpError(msg, error.status) from error
        files.append((layer, file))
    return files


def _field_types(
    address: str, layer: LayerSpec, portal: str, *, cache: Cache, spec: HttpSpec
) -> Mapping[str, str]:
    """Return the fields of a dataset and their types, as its description has them."""
    try:
        file = fetch(
            address, cache=cache, spec=spec, accept=("application/json",), check=_described
        )
    except HttpError as error:
        if error.status != 404:  # noqa: PLR2004 - not found
            raise
        msg = (
            f"{portal} has no dataset {layer.dataset!r}, which the catalogue names for layer "
            f"{layer.name!r}; look for it at {portal.rstrip('/')}/explore and correct `dataset` "
            "in the catalogue."
        )
        raise CatalogError(msg) from error
    return _described(file.path)


def _described(path: Path) -> dict[str, str]:
    try:
        content: Any = parse_json(path.read_text(encoding="utf-8"))
        return {field["name"]: field["type"] for field in content["fields"]}
    except (KeyError, TypeError, ValueError) as error:
        msg = (
            "the portal does not describe its dataset as the Explore API v2.1 does; "
            "check that the address is that of an Opendatasoft portal."
        )
        raise SourceError(msg) from error


def _query(
    layer: LayerSpec, types: Mapping[str, str], area: Area | None, *, where: str
) -> dict[str, str | float]:
    """Return the parameters of an export."""
    fields = list(types)
    places = [name for name, kind in types.items() if kind in {POINT, SHAPE}]
    query: dict[str, str | float] = {"limit": -1}
    conditions = [layer.server_where] if layer.server_where else []
    if area is not None:
        points = [name for name in places if types[name] == POINT] or places
        if not points:
            msg = f"{where} of layer {layer.name!r} has no positions to cut an area out of."
            raise CatalogError(msg)
        conditions.append(_inside(area, find_field(POINT, layer, points) or points[0]))
    if conditions:
        query["where"] = " and ".join(f"({condition})" for condition in conditions)
    if layer.select:
        own = settle_fields(layer, fields)
        for field in own.select:
            require_field(field, fields, where=where, key="select")
        rules = RowRules(own, fields, filters=True, where=where)
        query["select"] = ",".join(dict.fromkeys([*own.select, *rules.fields, *places]))
    return query


def _inside(area: Area, field: str) -> str:
    """Return the condition that a position is in an area, in the portal's language (ODSQL)."""
    west, south, east, north = area.bounds
    if area.polygon.equals(shapely.box(west, south, east, north)):
        return f"in_bbox({field}, {south:.7f}, {west:.7f}, {north:.7f}, {east:.7f})"
    return f"intersects({field}, geom'{_outline(area.polygon)}')"


def _outline(polygon: BaseGeometry) -> str:
    """Return an outline as text, short enough for an address and never smaller than it was."""
    text: str = shapely.to_wkt(polygon, rounding_precision=7)
    room = 1e-5  # degrees: about a metre
    while len(text) > LONGEST_OUTLINE:
        # What is cut off is never wider than what was added, whose round corners are cut a little.
        polygon = polygon.buffer(1.1 * room, quad_segs=2).simplify(room)
        text = shapely.to_wkt(polygon, rounding_precision=7)
        room *= 2
    return text


def _require_whole(path: Path) -> None:
    """Refuse a file that does not begin and end as GeoJSON does."""
    with path.open("rb") as stream:
        begin = stream.read(16).lstrip()
        stream.seek(max(0, path.stat().st_size - 16))
        end = stream.read().rstrip()
    if not (begin.startswith(b"{") and end.endswith(b"}")):
        msg = "what the portal sent is not whole geojson; try again later."
        raise SourceError(msg)
