"""Build a `RawLayer` from the rows that a reader collects, column by column."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
import re
from collections import Counter
from typing import TYPE_CHECKING, Any, TypeVar

import geopandas as gpd
import numpy as np
import pandas as pd
import shapely
from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core import (
    CLASS_NAME,
    GEOMETRY,
    HALF_WIDTH,
    NAME,
    SOURCE_ID,
    CatalogError,
    CrsError,
    crs_label,
    nearest_name,
)
from semsig_gis.sources.filters import Condition, as_text, matches, pattern_of
from semsig_gis.sources.layer import RawLayer, RowCounts
from semsig_gis.sources.layer_spec import MAX_WIDTH_M, MIN_WIDTH_M
from semsig_gis.sources.numbers import decimal

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.sources.filters import Value
    from semsig_gis.sources.layer_spec import LayerSpec


WGS84 = CRS.from_epsg(4326)
# 180 and 90 degrees, with a tolerance for the rounding of the last decimal.
LONGITUDE_LIMIT = 180.0 + 1e-6
LATITUDE_LIMIT = 90.0 + 1e-6


def parse_crs(text: str) -> CRS:
    """Parse the CRS that a user gives; CrsError if it is unknown, geocentric or vertical."""
    advice = "write a code such as 'EPSG:2154' or 'EPSG:4326'"
    try:
        crs = CRS.from_user_input(text)
    except CRSError as error:
        raise CrsError(f"CRS {text!r} is unknown; {advice}.") from error
    if crs.is_geocentric or crs.is_vertical:
        kind = crs.type_name.removesuffix(" CRS").lower()
        raise CrsError(
            f"CRS {text!r} is {kind}, in which two coordinates do not give a place; {advice}."
        )
    return crs


@functools.lru_cache(maxsize=64)  # the search for the code takes 0.2 s
def usable_crs(text: str) -> CRS | None:
    """Return the CRS that a file states, or None if it does not locate coordinates on the Earth.

    A CRS that is equal to an EPSG definition is replaced by it, to avoid a needless transformation.
    """
    if not text.strip():
        return None
    try:
        crs = CRS.from_user_input(text)
    except CRSError:
        return None
    geodetic = crs.geodetic_crs
    if geodetic is None or not (crs.is_geographic or crs.is_projected):
        return None  # an engineering CRS: a plane of its own
    if not geodetic.name or crs.name.lower().startswith("undefined"):
        return None  # without a named datum, a transformation is off by up to hundreds of metres
    code = crs.to_epsg()
    epsg = crs if code is None else CRS.from_epsg(code)
    return epsg if epsg.equals(crs, ignore_axis_order=True) else crs


def choose_crs(
    own: CRS | None,
    *,
    implicit: bool = False,
    expected: str | None,
    requested: str | None,
    where: str,
) -> tuple[CRS, tuple[str, ...]]:
    """Return CRS and notes of a layer: the file's `own` CRS, else `requested` or `expected`.

    `requested` is the CRS of the user, `expected` the CRS of the catalogue. With `implicit`, `own`
    is only the default of the format, which is used last. A note reports a contradiction. CrsError
    if there is no CRS.
    """
    stated = requested or expected
    # A CRS in the file has priority.
    if own is not None and not implicit:
        if stated is None or own.equals(parse_crs(stated), ignore_axis_order=True):
            return own, ()
        note = f"the file is in {crs_label(own)}, not in {stated} as stated; the file's CRS is used"
        return own, (note,)
    if stated is not None:
        return parse_crs(stated), ()
    if own is not None:
        return own, ()
    raise CrsError(
        f"{where} does not say which CRS its coordinates are in; "
        "state its crs, such as 'EPSG:2154' or 'EPSG:4326'."
    )


def off_the_globe(xy: NDArray[np.float64], crs: CRS) -> NDArray[np.bool_]:
    """Return which coordinates are out of the range of degrees, shape (n,).

    In a CRS with another unit, none is.
    """
    units = {axis.unit_name for axis in crs.axis_info}
    if not crs.is_geographic or units != {"degree"}:
        return np.zeros(len(xy), dtype=np.bool_)
    return (np.abs(xy[:, 0]) > LONGITUDE_LIMIT) | (np.abs(xy[:, 1]) > LATITUDE_LIMIT)


def fits_the_globe(xy: NDArray[np.float64]) -> bool:
    """Whether all coordinates are in the range of longitude and latitude in degrees."""
    return len(xy) > 0 and not off_the_globe(xy, WGS84).any()


GEOMETRY_TYPES = {
    "point": ("Point", "MultiPoint"),
    "line": ("LineString", "LinearRing", "MultiLineString"),
    "polygon": ("Polygon", "MultiPolygon"),
}
MOST_ERRORS = 10
# Number and length of the values in a note on values that class_by does not list.
MOST_UNLISTED, MOST_VALUE_CHARACTERS = 8, 40
# Rows with the same id get a note if they are farther apart: about a metre, by unit of the CRS.
APART_DEGREES, APART_METRES = 1e-5, 1.0
# Numbers in the error of an incomplete OpenStreetMap element.
SHARE = re.compile(r"\d+ of its \d+")
WHOLE_FLOAT = re.compile(r"(-?\d+)\.0+")

T = TypeVar("T")
# A point is a pair of coordinates, so that all points are built at once; others are geometries.
Position = tuple[float, float] | shapely.Geometry | None


class BadFeatureError(ValueError):
    """A feature cannot be used; readers catch it and report the message."""


@dataclasses.dataclass(slots=True)
class Rows:
    """Rows of a layer as a reader collects them, in four lists of equal length.

    `numbers` count from 1 in the order of the file; `names` are the identifiers that do not come
    from a field; `values` are the values of `RowRules.fields`; `positions` has a text instead of a
    position for a row that cannot be used. `read` counts all rows, `filtered` the rows that the
    reader leaves out, `closed` the rows with rings that were closed. `errors` has the error by row
    number of rows without values.
    """

    read: int = 0
    filtered: int = 0
    closed: int = 0
    errors: dict[int, str] = dataclasses.field(default_factory=dict)
    numbers: list[int] = dataclasses.field(default_factory=list)
    names: list[str] = dataclasses.field(default_factory=list)
    values: list[Sequence[Any]] = dataclasses.field(default_factory=list)
    positions: list[Position | str] = dataclasses.field(default_factory=list)

    def add(self, values: Sequence[Any], name: str, position: Position | str) -> None:
        """Add the row with the number `read`."""
        self.numbers.append(self.read)
        self.names.append(name)
        self.values.append(values)
        self.positions.append(position)

    def mark_unreadable(self, count: int, reason: str) -> None:
        """Count the rows from the next one up to number `count` as unreadable."""
        self.errors.update(dict.fromkeys(range(self.read + 1, count + 1), reason))
        self.read = max(self.read, count)


def raw_layer(
    rows: Rows, rules: RowRules, crs: CRS, *, by_file: bool, notes: tuple[str, ...] = ()
) -> RawLayer:
    """Filter and classify rows, build their geometries and check them against the CRS.

    `by_file` is whether the file states the CRS. CrsError if the CRS is in degrees and most
    coordinates are not.
    """
    spec = rules.spec
    filtered = rules.apply(rows)
    table = filtered.table
    # A position that is a text is an error; build the geometries of the others.
    broken = table[GEOMETRY][[isinstance(position, str) for position in table[GEOMETRY]]]
    errors: dict[int, str] = {**rows.errors, **dict(zip(broken.index, broken, strict=True))}
    table = table.drop(index=broken.index)
    table[GEOMETRY] = pd.Series(built_geometries(table[GEOMETRY]), table.index, dtype=object)
    # Rows with coordinates that are not usable are errors, too.
    if bad := _coordinate_errors(table, crs, by_file=by_file, file=rules.file):
        errors |= bad
        table = table.drop(index=list(bad))
    repeated = 0
    if spec.unique_id:
        tolerance = APART_DEGREES if crs.is_geographic else APART_METRES
        table, repeated, more = _drop_duplicate_ids(table, tolerance=tolerance)
        notes += more
    geometry = table[GEOMETRY].to_numpy()
    if crs.is_projected and not by_file and fits_the_globe(shapely.get_coordinates(geometry)):
        notes += (f"the coordinates look like degrees, yet {crs_label(crs)} is stated",)
    notes += tuple(_deviations(rows.read, table, spec))
    if rows.closed:
        notes += (f"{rows.closed} of {rows.read} rows have rings that are not closed; closed here",)
    if spec.tags and errors:  # elements of OpenStreetMap; count the causes
        causes = Counter(SHARE.sub("some of its", e.partition(" ")[2]) for e in errors.values())
        listed = ", ".join(f"{cause} ({number:,})" for cause, number in causes.most_common())
        notes += (f"unreadable: {listed}",)
    table = table.drop(columns=GEOMETRY).reset_index(drop=True)
    return RawLayer(
        spec=spec,
        table=gpd.GeoDataFrame(table, geometry=geometry, crs=crs),
        counts=RowCounts(
            read=rows.read,
            unreadable=len(errors),
            filtered=rows.filtered + filtered.filtered,
            excluded=filtered.excluded,
            duplicates=repeated,
        ),
        errors=tuple(f"row {row}: {text}" for row, text in sorted(errors.items())[:MOST_ERRORS]),
        notes=(*filtered.notes, *notes),
    )


def built_geometries(positions: Iterable[Position]) -> NDArray[np.object_]:
    """Return the geometries of positions; all points are built at once."""
    positions = list(positions)
    geometry = np.empty(len(positions), dtype=object)
    geometry[:] = [None if isinstance(position, tuple) else position for position in positions]
    points = [row for row, position in enumerate(positions) if isinstance(position, tuple)]
    if points:
        geometry[points] = shapely.points(np.array([positions[row] for row in points]))
    return geometry


def _coordinate_errors(
    table: pd.DataFrame, crs: CRS, *, by_file: bool, file: str
) -> dict[int, str]:
    """Return the errors of rows with coordinates that are not finite, or out of range in degrees.

    CrsError if most of the finite coordinates are out of range.
    """
    xy, owner = shapely.get_coordinates(table[GEOMETRY].to_numpy(), return_index=True)
    not_finite = ~np.isfinite(xy).all(axis=1)
    usable = ~np.isin(owner, owner[not_finite])
    wrong = off_the_globe(xy, crs) & usable
    if 2 * wrong.sum() > usable.sum():
        x, y = xy[wrong][0]
        remedy = "correct the file" if by_file else "state the crs they are in, such as 'EPSG:2154'"
        if fits_the_globe(xy[usable][:, ::-1]):
            remedy = (
                "with x and y exchanged they would be, so exchange x_field and y_field in the "
                "catalogue, or the axes in the file"
            )
        raise CrsError(
            f"{file} has coordinates such as ({x:.12g}, {y:.12g}), which are not the degrees that "
            f"{crs_label(crs)} means; {remedy}."
        )
    errors: dict[int, str] = {}
    for rows, what in ((not_finite, "are not finite"), (wrong, f"are not in {crs_label(crs)}")):
        for number, (x, y) in zip(table.index[owner[rows]], xy[rows], strict=True):
            errors.setdefault(number, f"its coordinates ({x:.12g}, {y:.12g}) {what}")
    return errors


def _drop_duplicate_ids(
    table: pd.DataFrame, *, tolerance: float
) -> tuple[pd.DataFrame, int, tuple[str, ...]]:
    """Keep the first row of each id, or the first one with a position if there is one."""
    geometry = table[GEOMETRY].to_numpy()
    nowhere = shapely.is_missing(geometry) | shapely.is_empty(geometry)
    # Rows with a position come first.
    ids = table[SOURCE_ID].iloc[np.argsort(nowhere, kind="stable")]
    ids = ids[ids != ""]
    firsts, repeated = ids.drop_duplicates(), ids[ids.duplicated()]
    # Distance of each dropped row from the row that is kept.
    first_of = pd.Series(firsts.index, index=firsts).loc[repeated]
    here, there = table[GEOMETRY].loc[repeated.index], table[GEOMETRY].loc[first_of]
    metres = shapely.distance(here.to_numpy(), there.to_numpy())  # NaN where there is no position
    far = int((metres > tolerance).sum())
    note = f"{far} rows have the id of a row at another place; the place of the first row is used"
    return table.drop(index=repeated.index), len(repeated), (note,) if far else ()


def _deviations(read: int, table: pd.DataFrame, spec: LayerSpec) -> Iterable[str]:
    """Yield the differences between a layer and its specification."""
    if read == 0:
        yield "the layer has no rows"
    elif spec.rows is not None and not spec.rows[0] <= read <= spec.rows[1]:
        least, most = spec.rows
        yield f"the layer has {read} rows, and {least} to {most} were expected"
    types = pd.Series([item.geom_type for item in table[GEOMETRY].dropna()], dtype="str")
    others = types[~types.isin(GEOMETRY_TYPES[spec.geometry])]
    if len(others) and not spec.tags:  # each element of OpenStreetMap states its own type
        names = ", ".join(sorted(others.unique()))
        yield f"{len(others)} of {read} rows are {names}, not {spec.geometry}"
    unknown = table[HALF_WIDTH].isna().sum() if spec.has_width else 0
    if unknown:
        yield f"{unknown} of {len(table)} streets have no known width"


@dataclasses.dataclass(frozen=True, eq=False, slots=True)
class FilteredRows:
    """Rows that pass the rules of a layer, and the numbers of rows left out.

    Rows are `filtered` by ``where`` or ``class_by``, and `excluded` by ``not``.
    """

    table: pd.DataFrame
    filtered: int
    excluded: int
    notes: tuple[str, ...]


class RowRules:
    """Conditions, classes, widths and identifiers of a layer, checked against its fields."""

    def __init__(
        self, spec: LayerSpec, fields: Sequence[str], *, filters: bool, where: str
    ) -> None:
        self.spec = spec
        self.file = where  # for messages
        try:
            self._where, self._not = (
                [(field, Condition.parse(accepted)) for field, accepted in rules if filters]
                for rules in (spec.where, spec.exclusions)
            )
            listed = [
                *(spec.class_by.classes if spec.class_by else ()),
                *(spec.width_by.widths if spec.width_by else ()),
            ]
            for value, _ in listed:
                pattern_of(str(value))
        except CatalogError as error:
            raise CatalogError(f"{where}: {error}") from error
        uses = [use for use in spec.fields if filters or use[0] not in {"where", "not"}]
        for key, column in uses:
            require_field(column, fields, where=where, key=key)
        self.fields = tuple(dict.fromkeys(column for _, column in uses))

    def apply(self, rows: Rows) -> FilteredRows:
        """Return class, identifier, half-width in metres, name and position of rows that pass.

        The index has the row numbers. An unknown half-width is NaN, and an unknown name is empty. A
        row without an id has its number as identifier, or an empty one where ids are unique,
        because the number could be the id of another row.
        """
        spec = self.spec
        size = len(rows.numbers)
        columns = dict(zip(self.fields, zip(*rows.values, strict=True), strict=False))
        passed = np.ones(size, bool)
        for field, condition in self._where if size else ():
            passed &= [condition.accepts(value) for value in columns[field]]
        filtered = size - int(passed.sum())
        excluded: dict[str, int] = {}
        for field, condition in self._not if size else ():
            out = passed & [condition.accepts(value, every=True) for value in columns[field]]
            excluded[field] = int(out.sum())
            passed &= ~out
        classes = self._classes(columns, size)
        unlisted = passed & np.array([name is None for name in classes], bool)
        ids = columns.get(spec.id_field or "", [None] * size)
        names = [""] * size if spec.unique_id else rows.names
        titles = columns.get(spec.name_field or "", [None] * size)
        table = pd.DataFrame(
            {
                CLASS_NAME: pd.Series(classes, dtype="str"),
                SOURCE_ID: pd.Series(map(_identifier, ids, names), dtype="str"),
                HALF_WIDTH: pd.Series(self._half_widths(columns, size), dtype="float64"),
                NAME: pd.Series([_identifier(title, "") for title in titles], dtype="str"),
                GEOMETRY: pd.Series(rows.positions, dtype=object),
            }
        ).set_index(pd.Index(rows.numbers, dtype=int))
        unused = [HALF_WIDTH] * (not spec.has_width) + [NAME] * (spec.name_field is None)
        notes = []
        if any(excluded.values()):
            listed = (f"{field} {number}" for field, number in excluded.items() if number)
            notes.append(f"left out by the catalogue's not: {', '.join(listed)}")
        if unlisted.any():
            notes.append(self._unlisted(columns, unlisted))
        return FilteredRows(
            table[passed & ~unlisted].drop(columns=unused),
            filtered=filtered + int(unlisted.sum()),
            excluded=sum(excluded.values()),
            notes=tuple(notes),
        )

    def _classes(self, columns: Mapping[str, Sequence[Any]], size: int) -> list[str | None]:
        """Return the class of each row, None for a value that `class_by` does not list."""
        by, name = self.spec.class_by, self.spec.class_name
        if by is None or self.spec.role != "objects":
            return [name] * size
        default = name if by.otherwise else None
        values = columns.get(by.field, ())
        return [_first(by.classes, value, default) or None for value in values]

    def _unlisted(self, columns: Mapping[str, Sequence[Any]], rows: NDArray[np.bool_]) -> str:
        """Return a note on the values that `class_by` does not list, the most frequent first."""
        by, name = self.spec.class_by, self.spec.class_name
        if by is None:
            return ""
        values = itertools.compress(columns[by.field], rows)
        counts = Counter(
            "no value" if v is None else repr(as_text(v)[:MOST_VALUE_CHARACTERS]) for v in values
        )
        listed = [f"{value} {number}" for value, number in counts.most_common(MOST_UNLISTED)]
        others = len(counts) - len(listed)
        listed += [f"and {others} others"] if others else []
        remedy = f'; write otherwise = "class" to take them as {name}' if name else ""
        return f"left out, unlisted in class_by {by.field!r}: {', '.join(listed)}{remedy}"

    def _half_widths(self, columns: Mapping[str, Sequence[Any]], size: int) -> NDArray[np.float64]:
        by, own = self.spec.width_by, self.spec.width_field
        widths = np.full(size, math.nan)
        if own is not None and size:
            widths = np.array([_metres(value) for value in columns[own]])
        if by is not None and size:
            default = math.nan if by.default is None else by.default
            typical = [_first(by.widths, value, default) for value in columns[by.field]]
            widths = np.where(np.isnan(widths), typical, widths)
        return widths / 2


def _first(choices: Iterable[tuple[Value, T]], value: object, default: T) -> T:
    """Return the result of the first choice that matches a value, or the default."""
    return next((result for accepted, result in choices if matches(value, accepted)), default)


def _identifier(value: object, name: str) -> str:
    text = "" if value is None else as_text(value).strip()
    whole = WHOLE_FLOAT.fullmatch(text)
    return (whole[1] if whole else text) or name


def _metres(value: object) -> float:
    """Return a plausible width of a street from a field, or NaN."""
    try:
        width = decimal(as_text(value).strip().removesuffix("m"))
    except ValueError:
        return math.nan
    return width if MIN_WIDTH_M <= width <= MAX_WIDTH_M else math.nan


def require_field(field: str, fields: Sequence[str], *, where: str, key: str) -> None:
    """Raise CatalogError if a file does not have a field; the message lists its fields."""
    if field not in fields:
        raise CatalogError(
            f"{where} has no field {field!r}, which the catalogue names in {key}"
            f"{nearest_name(field, fields)}; its fields are {', '.join(fields) or 'none at all'}."
        )
