"""From the rows that a reader collects to a `RawLayer`: geometries built and checked at once."""

from __future__ import annotations

import functools
import math
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import geopandas as gpd
import numpy as np
import pandas as pd
import shapely

from semsig_gis.core.crs import CLASS_NAME, HALF_WIDTH, SOURCE_ID
from semsig_gis.core.errors import CatalogError, CrsError, nearest_name
from semsig_gis.sources import RawLayer
from semsig_gis.sources.crs import crs_label, fits_the_globe, off_the_globe
from semsig_gis.sources.layers import MAX_WIDTH_M, MIN_WIDTH_M

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.sources.layers import LayerSpec, Value


KINDS = {
    "point": ("Point", "MultiPoint"),
    "line": ("LineString", "LinearRing", "MultiLineString"),
    "polygon": ("Polygon", "MultiPolygon"),
}


ERRORS_KEPT = 10


# Rows of one id farther apart than this are told of: about a metre, by unit of the CRS.
APART_DEGREES, APART_METRES = 1e-5, 1.0


# A point as its two coordinates, so that all points are built at once; else a built geometry.
Position = tuple[float, float] | shapely.Geometry | None


class Row(NamedTuple):
    """A row that is wanted and, so far, good."""

    number: int  # from 1, in the order of the file
    class_name: str
    source_id: str
    position: Position
    half_width: float = math.nan  # metres; of streets


@dataclass(slots=True)
class Rows:
    """What a reader has seen so far of a layer: how many rows, and those that are wanted.

    `filtered` counts rows that the filter leaves out; `errors` says what is wrong with others.
    """

    read: int = 0
    filtered: int = 0
    kept: list[Row] = field(default_factory=list)
    errors: dict[int, str] = field(default_factory=dict)  # by number of the row

    def refuse(self, bad: Mapping[int, str]) -> None:
        """Move rows from the kept ones to the errors."""
        self.errors.update(bad)
        self.kept = [row for row in self.kept if row.number not in bad]


def raw_layer(
    rows: Rows,
    spec: LayerSpec,
    crs: CRS,
    *,
    by_file: bool,
    where: str,
    notes: tuple[str, ...] = (),
) -> RawLayer:
    """Build the geometries of a layer and check them against its CRS and its specification.

    Rows with impossible coordinates are refused in place. `by_file` says whether the file itself
    states the CRS. CrsError if that is in degrees and most coordinates cannot be.
    """
    geometry = _geometries(rows)
    geometry = _on_globe(rows, geometry, crs, where=where, by_file=by_file)
    duplicates = 0
    if spec.unique_id:
        apart = APART_DEGREES if crs.is_geographic else APART_METRES
        geometry, duplicates, more = _one_of_each_id(rows, geometry, apart=apart)
        notes += more
    if crs.is_projected and not by_file and fits_the_globe(shapely.get_coordinates(geometry)):
        notes += (f"the coordinates look like degrees, yet {crs_label(crs)} is stated",)
    columns: dict[str, pd.Series[Any]] = {
        CLASS_NAME: pd.Series([row.class_name for row in rows.kept], dtype="str"),
        SOURCE_ID: pd.Series([row.source_id for row in rows.kept], dtype="str"),
    }
    if spec.has_width:
        columns[HALF_WIDTH] = pd.Series([row.half_width for row in rows.kept], dtype="float64")
    first_errors = sorted(rows.errors.items())[:ERRORS_KEPT]
    return RawLayer(
        spec=spec,
        table=gpd.GeoDataFrame(columns, geometry=geometry, crs=crs),
        read=rows.read,
        filtered=rows.filtered,
        errors=tuple(f"row {number}: {message}" for number, message in first_errors),
        error_count=len(rows.errors),
        notes=(*notes, *_surprises(rows, geometry, spec)),
        duplicates=duplicates,
    )


def _geometries(rows: Rows) -> NDArray[np.object_]:
    """Build the geometries of the kept rows; those that are not finite are refused."""
    geometry = np.empty(len(rows.kept), dtype=object)
    points = []
    for index, row in enumerate(rows.kept):
        if isinstance(row.position, tuple):
            points.append(index)
        else:
            geometry[index] = row.position
    if points:
        geometry[points] = shapely.points(np.array([rows.kept[index].position for index in points]))
    xy, owner = shapely.get_coordinates(geometry, return_index=True)
    wrong = ~np.isfinite(xy).all(axis=1)
    return _without(rows, geometry, owner[wrong], xy[wrong], "are not finite")


def _on_globe(
    rows: Rows, geometry: NDArray[np.object_], crs: CRS, *, where: str, by_file: bool
) -> NDArray[np.object_]:
    """Refuse rows that cannot be longitudes and latitudes where they must be.

    A few are bad rows; if they are most of the layer, then it is the CRS that is wrong.
    """
    xy, owner = shapely.get_coordinates(geometry, return_index=True)
    wrong = off_the_globe(xy, crs)
    if 2 * wrong.sum() > len(xy):
        x, y = xy[wrong][0]
        remedy = "correct the file" if by_file else "state the crs they are in, such as 'EPSG:2154'"
        msg = (
            f"{where} has coordinates such as ({x:.12g}, {y:.12g}), which are not the degrees that "
            f"{crs_label(crs)} means; {remedy}."
        )
        raise CrsError(msg)
    return _without(rows, geometry, owner[wrong], xy[wrong], f"are not in {crs_label(crs)}")


def _without(
    rows: Rows,
    geometry: NDArray[np.object_],
    indices: NDArray[np.intp],
    xy: NDArray[np.float64],
    what: str,
) -> NDArray[np.object_]:
    """Refuse the rows of these indices, for the coordinates beside them."""
    bad = {
        rows.kept[index].number: f"its coordinates ({x:.12g}, {y:.12g}) {what}"
        for index, (x, y) in zip(indices[::-1], xy[::-1], strict=True)  # the first one stays
    }
    if not bad:
        return geometry
    rows.refuse(bad)
    return np.delete(geometry, indices)


def _one_of_each_id(
    rows: Rows, geometry: NDArray[np.object_], *, apart: float
) -> tuple[NDArray[np.object_], int, tuple[str, ...]]:
    """Keep the first row of every id, but one that has a position rather than one that has none."""
    ids = pd.Series([row.source_id for row in rows.kept], dtype="str")
    nowhere = shapely.is_missing(geometry) | shapely.is_empty(geometry)
    ranked = ids.iloc[np.argsort(nowhere, kind="stable")]
    firsts = ranked[ranked != ""].drop_duplicates()
    repeated = ranked.index[ranked.duplicated() & (ranked != "")].to_numpy(np.intp)
    if not len(repeated):
        return geometry, 0, ()
    first_of = pd.Series(firsts.index, index=firsts).loc[ids[repeated]].to_numpy(np.intp)
    distances = shapely.distance(geometry[repeated], geometry[first_of])
    far = int((distances > apart).sum())  # NaN where there is no position
    rows.kept = [rows.kept[index] for index in np.delete(np.arange(len(ids)), repeated)]
    note = f"{far} rows have the id of a row that stands elsewhere; the first one's place is used"
    return np.delete(geometry, repeated), len(repeated), (note,) if far else ()


def _surprises(rows: Rows, geometry: NDArray[np.object_], spec: LayerSpec) -> tuple[str, ...]:
    """Return where a layer is not what its specification expects."""
    notes = []
    if rows.read == 0:
        notes.append("the layer has no rows")
    elif spec.rows is not None and not spec.rows[0] <= rows.read <= spec.rows[1]:
        least, most = spec.rows
        notes.append(f"the layer has {rows.read} rows, and {least} to {most} were expected")
    types = pd.Series([item.geom_type for item in geometry if item is not None], dtype="str")
    others = types[~types.isin(KINDS[spec.geometry])]
    if len(others):
        names = ", ".join(sorted(others.unique()))
        notes.append(f"{len(others)} of {rows.read} rows are {names}, not {spec.geometry}")
    unknown = sum(math.isnan(row.half_width) for row in rows.kept) if spec.has_width else 0
    if unknown:
        notes.append(f"{unknown} of {len(rows.kept)} streets have no known width")
    return tuple(notes)


WHOLE_FLOAT = re.compile(r"(-?\d+)\.0+")


# A value that a catalogue writes between slashes is a pattern.
BETWEEN_SLASHES = re.compile(r"/(.+)/")


class BadFeatureError(ValueError):
    """A feature cannot be used; readers catch it and report the message."""


def as_text(value: object) -> str:
    """Return a field value as text; a whole number has no decimals."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return str(value)


def matches(value: object, wanted: Value) -> bool:
    """Tell whether a field value is the one a catalogue names.

    Text compares as text and numbers as numbers, so that 3 is found in the text field of a CSV file
    and the key "3" of a TOML table in a numeric field. A text between slashes, such as
    ``"/Taxi.*/"``, is a regular expression, which the whole value must match.
    """
    if value is None:
        return False
    if isinstance(wanted, str):
        pattern = _pattern(wanted)
        text = as_text(value)
        return text == wanted if pattern is None else pattern.fullmatch(text) is not None
    if isinstance(wanted, bool) or isinstance(value, bool):
        return as_text(value) == as_text(wanted)
    try:
        return float(value) == wanted  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return False


@functools.lru_cache
def _pattern(wanted: str) -> re.Pattern[str] | None:
    inner = BETWEEN_SLASHES.fullmatch(wanted)
    return re.compile(inner[1]) if inner else None


class RowRules:
    """The filter, classes, widths and identifier of one layer, checked against its fields.

    `filters` says whether the layer's ``where`` holds. CatalogError if a field that the layer names
    does not exist, or a pattern is wrong.
    """

    def __init__(
        self, spec: LayerSpec, fields: Sequence[str], *, filters: bool, where: str
    ) -> None:
        self._class_name = spec.class_name
        self._where = spec.where if filters else ()
        self._class_by = spec.class_by
        self._id_field = spec.id_field
        self._unique_id = spec.unique_id
        self._width_by = spec.width_by
        self._width_field = spec.width_field
        values = [wanted for _, accepted in self._where for wanted in accepted]
        if spec.class_by is not None:
            values.extend(wanted for wanted, _ in spec.class_by.classes)
        if spec.width_by is not None:
            values.extend(wanted for wanted, _ in spec.width_by.widths)
        _require_patterns(values, where=where)
        uses = [use for use in spec.fields if filters or use[0] != "where"]
        for key, column in uses:
            require_field(column, fields, where=where, key=key)
        self.fields = tuple(dict.fromkeys(column for _, column in uses))

    def keeps(self, row: Mapping[str, Any]) -> bool:
        """Tell whether the row passes every condition of the filter."""
        return all(
            any(matches(row[field], wanted) for wanted in accepted)
            for field, accepted in self._where
        )

    def class_name(self, row: Mapping[str, Any]) -> str:
        """Return the class of the row."""
        if self._class_by is not None:
            value = row[self._class_by.field]
            for wanted, name in self._class_by.classes:
                if matches(value, wanted):
                    return name
        return self._class_name

    def half_width(self, row: Mapping[str, Any]) -> float:
        """Return half the width of a street in metres, NaN where nobody knows it."""
        own = math.nan if self._width_field is None else _metres(row[self._width_field])
        if math.isnan(own) and self._width_by is not None:
            value, by = row[self._width_by.field], self._width_by
            known = (width for wanted, width in by.widths if matches(value, wanted))
            own = next(known, math.nan if by.default is None else by.default)
        return own / 2

    def source_id(self, row: Mapping[str, Any], number: str) -> str:
        """Return the identifier of the row, or the feature's number where it has none.

        Where ids are unique it is empty then, because the number could be another row's id.
        """
        value = None if self._id_field is None else row[self._id_field]
        text = "" if value is None else as_text(value).strip()
        whole = WHOLE_FLOAT.fullmatch(text)
        return (whole[1] if whole else text) or ("" if self._unique_id else number)


def _metres(value: object) -> float:
    """Return a plausible width of a street from a field, or NaN."""
    try:
        width = float(as_text(value).strip().removesuffix("m").replace(",", "."))
    except ValueError:
        return math.nan
    return width if MIN_WIDTH_M <= width <= MAX_WIDTH_M else math.nan


def _require_patterns(values: Iterable[Value], *, where: str) -> None:
    for wanted in values:
        try:
            _pattern(str(wanted))
        except re.error as error:
            msg = f"{where}: pattern {wanted} is not a regular expression ({error}); correct it."
            raise CatalogError(msg) from error


def require_field(field: str, fields: Sequence[str], *, where: str, key: str) -> None:
    """Refuse a field that a file does not have; CatalogError lists the fields and the nearest."""
    if field not in fields:
        msg = (
            f"{where} has no field {field!r}, which the catalogue names in {key}"
            f"{nearest_name(field, fields)}; its fields are {', '.join(fields) or 'none at all'}."
        )
        raise CatalogError(msg)
