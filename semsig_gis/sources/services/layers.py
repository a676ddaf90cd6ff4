"""Layers from files of services, fetched or downloaded by hand."""

from __future__ import annotations

import dataclasses
import itertools
import unicodedata
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import shapely

from semsig_gis.core import SourceError
from semsig_gis.sources.position_names import LAT_LON
from semsig_gis.sources.position_values import locate
from semsig_gis.sources.positions import (
    SAMPLE_ROWS,
    PlaceReader,
    PositionFields,
    find_positions,
    no_positions,
    stated_fields,
    uncertain_positions,
)
from semsig_gis.sources.rows import WGS84, BadFeatureError, LayerBuilder
from semsig_gis.sources.services.table import ServiceRecord, open_table
from semsig_gis.sources.vector import file as vector_file
from semsig_gis.sources.vector.formats import ARCHIVES, CSV, DRIVERS, GEOJSON

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pyproj import CRS

    from semsig_gis.sources.area import Area
    from semsig_gis.sources.http.cache import Fetched
    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import LayerSpec
    from semsig_gis.sources.rows import Position
    from semsig_gis.sources.services.table import ServiceTable


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
        geometry_field=spec.geometry_field and own(spec.geometry_field),
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
    the fields, the field of the point, which is ``lat, lon``, and the fields that the catalogue
    names. If it names none that the file has, they are found by names and values.
    """

    def __init__(self, spec: LayerSpec, table: ServiceTable, *, where: str) -> None:
        def own(name: str | None) -> str | None:
            return name and find_field(name, spec, table.fields)

        usual = [
            PositionFields(field=field, order=order)
            for field, order in ((own(SHAPE), None), (own(POINT), LAT_LON))
            if field is not None
        ]
        shape = [fields for fields in usual if fields.field == own(SHAPE)]
        x, y, whole = (own(name) for name in (spec.x_field, spec.y_field, spec.geometry_field))
        stated = None
        # A file may lack the fields that the catalogue names if it has a shape, or no rows.
        if (x and y) or whole or not (usual or table.has_geometry or table.empty):
            own_spec = dataclasses.replace(
                spec,
                x_field=x or spec.x_field,
                y_field=y or spec.y_field,
                geometry_field=whole or spec.geometry_field,
            )
            stated = stated_fields(own_spec, table.fields, where=where)
        self._shape = [PlaceReader(fields, where) for fields in shape]
        self._others = [PlaceReader(fields, where) for fields in usual if fields not in shape]
        self._others += [PlaceReader(stated, where)] if stated else []
        self.notes: tuple[str, ...] = ()
        if not (stated or usual or table.empty):
            place_fields = self._found(table, where)
            self._others += [PlaceReader(place_fields, where)] if place_fields else []
            self.notes = place_fields.questions if place_fields else ()
        readers = (*self._shape, *self._others)
        self.fields = tuple(name for reader in readers for name in reader.fields.names)

    @staticmethod
    def _found(table: ServiceTable, where: str) -> PositionFields | None:
        """Return the fields of positions by a sample; None if geometries are outside the fields."""
        records = (item for item in table.records(table.fields) if isinstance(item, ServiceRecord))
        sample = [*itertools.islice(records, SAMPLE_ROWS)]
        if any(record.geometry for record in sample):
            return None
        place_fields = find_positions(table.fields, [record.values for record in sample])
        if place_fields is None and not table.has_geometry:
            raise SourceError(f"{where} {no_positions(table.fields)}.")
        if place_fields is not None and not place_fields.sure:
            raise SourceError(f"{where} {uncertain_positions(place_fields)}.")
        return place_fields

    @property
    def crs(self) -> CRS | None:
        """The CRS that the positions state, or None."""
        stated = (reader.crs for reader in (*self._shape, *self._others))
        return next((crs for crs in stated if crs is not None), None)

    def position(self, record: ServiceRecord) -> Position:
        """Return the position of a record, or None; BadFeatureError if it is invalid."""
        if isinstance(record.geometry, BadFeatureError):
            raise record.geometry
        for reader in self._shape:
            if (shape := reader.read(record.values)) is not None:
                return shape
        if record.geometry is not None:
            try:
                located = locate(record.geometry)
            except BadFeatureError as error:
                raise BadFeatureError(f"its geometry {error}") from error
            return located and located.position
        places = (reader.read(record.values) for reader in self._others)
        return next((place for place in places if place is not None), None)


# Files that other programs make from the data of a service.
VECTOR_SUFFIXES = ARCHIVES | {
    suffix for suffix, driver in DRIVERS.items() if driver not in {CSV, GEOJSON}
}


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
    encoding = next((spec.encoding for spec in specs if spec.encoding), None)
    table = open_table(path, encoding=encoding)
    return _read_table(table, specs, path, filters=filters, crs=crs)


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
    raw = []
    for builder, positions in layers:
        stated = table.crs or positions.crs
        more = (*notes, *positions.notes)
        implicit = stated is None
        raw.append(builder.layer(stated or WGS84, implicit=implicit, requested=crs, notes=more))
    return tuple(
        dataclasses.replace(layer, spec=spec) for layer, spec in zip(raw, specs, strict=True)
    )


def _read_vector(path: Path, spec: LayerSpec, *, filters: bool, crs: str | None) -> RawLayer:
    layers = {info.name: info for info in vector_file.list_layers(path)}
    infos = [layers[spec.layer]] if spec.layer in layers else list(layers.values())
    fields = [field for info in infos for field in info.fields]
    layer = vector_file.read_layer(path, settle_fields(spec, fields), filters=filters, crs=crs)
    return dataclasses.replace(layer, spec=spec)
