"""Layers from files of services, fetched or downloaded by hand."""

from __future__ import annotations

import dataclasses
import math
import unicodedata
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
import shapely.geometry
from shapely.errors import ShapelyError

from semsig_gis.core import SourceError
from semsig_gis.sources.csv_layer import SHAPE_NAMES, known_coordinates, known_field
from semsig_gis.sources.numbers import decimal
from semsig_gis.sources.rows import WGS84, BadFeatureError, LayerBuilder
from semsig_gis.sources.services.table import open_table
from semsig_gis.sources.vector import file as vector_file
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from semsig_gis.sources.area import Area
    from semsig_gis.sources.http.cache import Fetched
    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import LayerSpec
    from semsig_gis.sources.rows import Position
    from semsig_gis.sources.services.table import ServiceRecord, ServiceTable


def fold(name: str) -> str:
    """Return a name in lower case without accents and signs: `TYPE (cm)` becomes `typecm`."""
    plain = unicodedata.normalize("NFKD", name).casefold()
    return "".join(letter for letter in plain if letter.isalnum())


def find_field(name: str, spec: LayerSpec, fields: Sequence[str]) -> str | None:
    """Return the field with a name or one of its aliases, exact or folded, or None."""
    names = (name, *dict(spec.aliases).get(name, ()))
    by_folded_name = {fold(field): field for field in reversed(fields) if fold(field)}
    exact = (candidate for candidate in names if candidate in fields)
    similar = (by_folded_name.get(fold(candidate)) for candidate in names)
    return next(exact, None) or next(filter(None, similar), None)


def settle_fields(spec: LayerSpec, fields: Sequence[str]) -> LayerSpec:
    """Return a specification with the names of the fields in the file."""

    def own(name: str) -> str:
        return find_field(name, spec, fields) or name  # an absent field is an error later

    class_by, width_by = spec.class_by, spec.width_by
    return dataclasses.replace(
        spec,
        id_field=spec.id_field and own(spec.id_field),
        width_field=spec.width_field and own(spec.width_field),
        name_field=spec.name_field and own(spec.name_field),
        group_field=spec.group_field and own(spec.group_field),
        height_field=spec.height_field and own(spec.height_field),
        levels_field=spec.levels_field and own(spec.levels_field),
        texts=tuple((column, own(field)) for column, field in spec.texts),
        width_by=width_by and dataclasses.replace(width_by, field=own(width_by.field)),
        where=tuple((own(field), accepted) for field, accepted in spec.where),
        exclusions=tuple((own(field), accepted) for field, accepted in spec.exclusions),
        class_by=class_by and dataclasses.replace(class_by, field=own(class_by.field)),
        select=tuple(own(field) for field in spec.select),
    )


# Default names of the geometry fields on portals; a catalogue lists other names as aliases.
SHAPE = "geo_shape"
POINT = "geo_point_2d"


class PositionReader:
    """Reads the positions of the records of a table; SourceError if it has no field for them.

    The field of the shape goes first, because its axis order is certain; then the geometry outside
    the fields, the field of the point, which is ``lat, lon``, and two fields of coordinates.
    """

    def __init__(self, spec: LayerSpec, table: ServiceTable, *, where: str) -> None:
        def own(name: str | None) -> str | None:
            return name and find_field(name, spec, table.fields)

        self._shape, self._point = own(SHAPE), own(POINT)
        self._x, self._y = own(spec.x_field), own(spec.y_field)
        if not (spec.x_field or self._shape or self._point or table.has_geometry):
            # The catalogue names no field of the file: try common names.
            self._x, self._y = known_coordinates(table.fields)
            self._shape = None if self._x else known_field(SHAPE_NAMES, table.fields)
        columns = (self._shape, self._point, self._x, self._y)
        self.fields = tuple(field for field in columns if field is not None)
        coordinates = self._x and self._y
        if not (self._shape or self._point or coordinates or table.has_geometry or table.empty):
            raise SourceError(
                f"{where} has no position: none of its fields {', '.join(table.fields)} is "
                f"{SHAPE} or {POINT}; name the one that is, as an alias in the catalogue."
            )

    def position(self, record: ServiceRecord) -> Position:
        """Return the position of a record, or None; BadFeatureError if it is invalid."""
        values = record.values
        if isinstance(record.geometry, BadFeatureError):
            raise record.geometry
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
        if self._x is None or self._y is None:
            return None
        both = (values.get(self._x), values.get(self._y))
        if all(value is None or value == "" for value in both):
            return None
        try:
            x, y = (decimal(v) if isinstance(v, str) else float(v) for v in both)  # type: ignore[arg-type]
        except (TypeError, ValueError) as error:
            raise BadFeatureError(
                f"its {self._x} {both[0]!r} and {self._y} {both[1]!r} are not two numbers"
            ) from error
        return x, y


def _shape(value: Any) -> Position:  # noqa: ANN401 - whatever is in the file
    """Return a geometry from GeoJSON, Esri's JSON (also as text), WKT, WKB or a geometry."""
    if value is None or value == "" or isinstance(value, shapely.Geometry):
        return value or None
    try:
        return _parse_shape(value)
    except (AttributeError, LookupError, TypeError, ValueError, ShapelyError) as error:
        raise BadFeatureError(f"its shape {_shown(value)} is not a geometry") from error


def _parse_shape(value: Any) -> Position:  # noqa: ANN401 - whatever is in the file
    if isinstance(value, bytes):
        return shapely.from_wkb(value)
    if isinstance(value, str) and value.lstrip()[:1].isalpha():
        return shapely.from_wkt(value)
    geometry = parse_json(value) if isinstance(value, str) else value
    if "type" not in geometry:
        return _point(geometry) if "latitude" in geometry else esri_shape(geometry)
    if geometry["type"] == "Feature":
        geometry = geometry["geometry"]
    if geometry is None:
        return None
    if geometry["type"] == "Point" and geometry["coordinates"]:
        x, y = geometry["coordinates"][:2]
        return float(x), float(y)
    with np.errstate(invalid="ignore"):  # all geometries are checked for NaN later
        return shapely.geometry.shape(geometry)


def esri_shape(geometry: Mapping[str, Any]) -> Position:
    """Return a geometry from JSON of the ArcGIS REST API; a ring inside another is a hole."""
    if "x" in geometry:
        x, y = (math.nan if value is None else float(value) for value in map(geometry.get, "xy"))
        return None if math.isnan(x) and math.isnan(y) else (x, y)
    if "points" in geometry:
        return shapely.MultiPoint([point[:2] for point in geometry["points"]])
    parts = geometry["paths"] if "paths" in geometry else geometry["rings"]
    lines = shapely.MultiLineString([[point[:2] for point in part] for part in parts])
    return lines if "paths" in geometry else shapely.build_area(lines) or None


def _point(value: Any) -> Position:  # noqa: ANN401 - whatever is in the file
    """Return a point from text ``lat, lon``, a list of both, a dict, GeoJSON or WKB."""
    if value is None or (isinstance(value, str) and not value.strip()):
        return None
    if isinstance(value, bytes) or (isinstance(value, dict) and "type" in value):
        return _shape(value)
    try:
        if isinstance(value, dict):
            if "longitude" in value:
                value = {"lon": value["longitude"], "lat": value["latitude"]}
            if value["lon"] is None and value["lat"] is None:
                return None
            return float(value["lon"]), float(value["lat"])
        lat, lon = value.strip().strip("()").split(",") if isinstance(value, str) else value
        return float(lon), float(lat)
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        raise BadFeatureError(
            f"its point {_shown(value)} is not a latitude and a longitude"
        ) from error


def _shown(value: object) -> str:
    text = value if isinstance(value, str) else repr(value)
    return repr(text if len(text) <= 60 else f"{text[:60]}...")  # noqa: PLR2004 - fits a line


# Files that other programs make from the data of a service.
VECTOR_SUFFIXES = frozenset({".fgb", ".gpkg", ".shp", ".zip"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Download:
    """Files of a layer from a service, which are read one after the other as one table.

    `fields` are the fields that the service lists, because rows may lack fields without a value;
    `area` is the requested one.
    """

    spec: LayerSpec
    files: tuple[Fetched, ...]
    fields: tuple[str, ...] = ()
    area: Area | None = None

    def read(self, *, filters: bool = True) -> RawLayer:
        """Return the layer; SourceError if it cannot be read."""
        first, *others = (file.path for file in self.files)
        if first.suffix.lower() in VECTOR_SUFFIXES:
            return _read_vector(first, self.spec, filters=filters, crs=None)
        first_table = open_table(first)

        def records(names: Sequence[str]) -> Iterator[ServiceRecord | str]:
            yield from first_table.records(names)
            for path in others:
                yield from open_table(path).records(names)

        table = dataclasses.replace(first_table, records=records, rest=0)
        if self.fields:
            table = dataclasses.replace(table, fields=self.fields, empty=False)
        (layer,) = _read_table(table, [self.spec], first, filters=filters, crs=None)
        if self.area is None:
            return layer
        # Swap x and y if no row is in the requested area before, and some rows are after it.
        box = shapely.box(*self.area.bounds)
        if layer.crs != WGS84 or shapely.intersects(layer.geometry, box).any():
            return layer
        exchanged = shapely.transform(layer.geometry, lambda xy: xy[:, ::-1])
        if not shapely.intersects(exchanged, box).any():
            return layer
        note = "the service sends latitude as x and longitude as y; exchanged here"
        return dataclasses.replace(layer, geometry=exchanged, notes=(*layer.notes, note))


def read_layers(
    path: str | Path, specs: Sequence[LayerSpec], *, filters: bool = True, crs: str | None = None
) -> tuple[RawLayer, ...]:
    """Read layers, in one pass, from an unchanged file of a service.

    The content of the file shows its format: JSON of Opendatasoft (version 1, 2.0 or 2.1 of its
    API), CKAN, Socrata or ArcGIS, GeoJSON, GML, CSV or Parquet. A vector file or archive made from
    such a file is read too. `crs` is for a file that states none, by default WGS 84.
    """
    path = Path(path)
    if path.suffix.lower() in VECTOR_SUFFIXES:
        return tuple(_read_vector(path, spec, filters=filters, crs=crs) for spec in specs)
    return _read_table(open_table(path), specs, path, filters=filters, crs=crs)


def _read_table(
    table: ServiceTable, specs: Sequence[LayerSpec], path: Path, *, filters: bool, crs: str | None
) -> tuple[RawLayer, ...]:
    layers = []
    for spec in specs:
        where = f"layer {spec.name!r} ({path})"
        # The fields of a table without rows are unknown.
        fields = [field for _, field in spec.fields] if table.empty else table.fields
        own = settle_fields(spec, fields)
        builder = LayerBuilder(own, fields, filters=filters, where=where)
        layers.append((builder, PositionReader(spec, table, where=where)))
    names = [n for builder, positions in layers for n in (*builder.rules.fields, *positions.fields)]
    for number, record in enumerate(table.records(names), start=1):
        for builder, positions in layers:
            if isinstance(record, str):
                builder.rows.skip(record)
                continue
            try:
                position: Position | str = positions.position(record)
            except BadFeatureError as error:
                position = str(error)
            builder.rows.add(record.values, str(number), position)
    notes = table.notes
    if table.rest:
        rest = (
            f"the file is one page of a longer answer, which has {table.rest:,} records more; "
            "export the whole dataset instead"
        )
        notes += (rest,)
    implicit = table.crs is None
    raw = (
        builder.layer(table.crs or WGS84, implicit=implicit, requested=crs, notes=notes)
        for builder, _ in layers
    )
    return tuple(
        dataclasses.replace(layer, spec=spec) for layer, spec in zip(raw, specs, strict=True)
    )


def _read_vector(path: Path, spec: LayerSpec, *, filters: bool, crs: str | None) -> RawLayer:
    layers = {info.name: info for info in vector_file.list_layers(path)}
    infos = [layers[spec.layer]] if spec.layer in layers else list(layers.values())
    fields = [field for info in infos for field in info.fields]
    layer = vector_file.read_layer(path, settle_fields(spec, fields), filters=filters, crs=crs)
    return dataclasses.replace(layer, spec=spec)
