"""Names of fields: one dataset of a portal has labels, field names and older names for the same."""

from __future__ import annotations

import dataclasses
import json
import unicodedata
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
import shapely.geometry
from shapely.errors import ShapelyError

from semsig_gis.core.errors import SourceError
from semsig_gis.sources.layers import ClassBy
from semsig_gis.sources.raw_layer import BadFeatureError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from semsig_gis.sources.layers import LayerSpec
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
    """Return a specification that calls every field as the file does.

    A field that the file lacks keeps its name, for the error that names it.
    """

    def own(name: str) -> str:
        return find_field(name, spec, fields) or name

    class_by, width_by = spec.class_by, spec.width_by
    return dataclasses.replace(
        spec,
        id_field=spec.id_field and own(spec.id_field),
        width_field=spec.width_field and own(spec.width_field),
        width_by=width_by and dataclasses.replace(width_by, field=own(width_by.field)),
        where=tuple((own(field), accepted) for field, accepted in spec.where),
        class_by=class_by and ClassBy(own(class_by.field), class_by.classes),
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
        """Return the position of a record, or None where it has none.

        BadFeatureError if it cannot be understood.
        """
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
        geometry = json.loads(value) if isinstance(value, str) else value
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
        return float(both[0]), float(both[1])  # type: ignore[arg-type] # what is not one, raises
    except (TypeError, ValueError) as error:
        msg = f"its {x} {both[0]!r} and {y} {both[1]!r} are not two numbers"
        raise BadFeatureError(msg) from error


def _shown(value: object) -> str:
    text = value if isinstance(value, str) else repr(value)
    return repr(text if len(text) <= 60 else f"{text[:60]}...")  # noqa: PLR2004 - fits a line
