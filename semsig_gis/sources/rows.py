"""Rows of all sources, column by column, and the rules that make a `RawLayer` of them."""

from __future__ import annotations

import contextlib
import dataclasses
import datetime as dt
import functools
import math
import re
from collections import Counter
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import shapely
from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core import (
    CLASS_NAME,
    GROUP,
    HALF_WIDTH,
    HEIGHT,
    MAX_HEIGHT_M,
    NAME,
    SOURCE_ID,
    CatalogError,
    CrsError,
    crs_label,
    epsg_code,
    nearest_name,
    shortened,
)
from semsig_gis.sources.filters import Condition, as_text, matches, pattern_of
from semsig_gis.sources.layer import RawLayer, RowCounts
from semsig_gis.sources.layer_spec import MAX_WIDTH_M, MIN_WIDTH_M
from semsig_gis.sources.numbers import decimal

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import AnyCrs
    from semsig_gis.sources.filters import Value
    from semsig_gis.sources.layer_spec import LayerSpec


WGS84 = CRS.from_epsg(4326)
# 180 and 90 degrees, with a tolerance for the rounding of the last decimal.
LONGITUDE_LIMIT = 180.0 + 1e-6
LATITUDE_LIMIT = 90.0 + 1e-6


def parse_crs(text: AnyCrs) -> CRS:
    """Parse the CRS that a user gives; CrsError if it is unknown, geocentric or vertical.

    Of a compound CRS, only the horizontal part counts.
    """
    advice = "write a code such as 'EPSG:2154' or 'EPSG:4326'"
    try:
        crs = CRS.from_user_input(text)
    except CRSError as error:
        raise CrsError(f"CRS {text!r} is unknown; {advice}.") from error
    if crs.is_compound:
        crs = crs.to_2d()
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
    Of a compound CRS, only the horizontal part counts.
    """
    if not text.strip():
        return None
    try:
        crs = CRS.from_user_input(text)
    except CRSError:
        return None
    if crs.is_compound:
        crs = crs.to_2d()
    geodetic = crs.geodetic_crs
    if geodetic is None or not (crs.is_geographic or crs.is_projected):
        return None  # an engineering CRS: a plane of its own
    if not geodetic.name or crs.name.lower().startswith("undefined"):
        return None  # without a named datum, a transformation is off by up to hundreds of metres
    code = epsg_code(crs)
    return crs if code is None else CRS.from_epsg(code)


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
STOREY_M = 3.0
# Number and length of the values in a note on values that class_by does not list.
MOST_UNLISTED, MOST_VALUE_CHARACTERS = 8, 40
# Rows with the same id get a note if they are farther apart: about a metre, by unit of the CRS.
APART_DEGREES, APART_METRES = 1e-5, 1.0
# Numbers in the error of an incomplete OpenStreetMap element.
SHARE = re.compile(r"\d+ of its \d+")
# What stands in a field of identifiers where there is none: words, or repeated numbers.
NO_IDENTIFIER = re.compile(
    r"[<(\[]?(?:null|none|nil|nan|#?n/?a|unknown|undefined|missing|unbekannt|inconnue?|"
    r"sconosciuto|desconocido|onbekend)[>)\]]?|[-?.]*",
    re.IGNORECASE,
)
PLACEHOLDER = re.compile(r"-?[{(]?[-0.]+[)}]?|-1|-9{2,}")
WHOLE_FLOAT = re.compile(r"(-?\d+)\.0+")

T = TypeVar("T")
# A point is a pair of coordinates, so that all points are built at once; others are geometries.
Position = tuple[float, float] | shapely.Geometry | None


class BadFeatureError(ValueError):
    """A feature cannot be used; readers catch it and report the message."""


@dataclasses.dataclass(slots=True)
class Rows:
    """Rows of a layer as a reader collects them, by column.

    `columns` has the values of each field, as an Arrow column or a list. The lists `numbers` (from
    1, in the order of the file), `names` (the identifiers that do not come from a field) and
    `positions` are as long; a text instead of a position is the error of the row. `read` counts all
    rows, `filtered` the rows that the reader leaves out, `closed` the rows with rings that were
    closed, `repeated` the rows with the identifier of an earlier one, which the reader leaves out.
    `errors` has the error by row number of rows without values.
    """

    columns: dict[str, Any]
    read: int = 0
    filtered: int = 0
    closed: int = 0
    repeated: int = 0
    errors: dict[int, str] = dataclasses.field(default_factory=dict)
    numbers: list[int] = dataclasses.field(default_factory=list)
    names: list[str] = dataclasses.field(default_factory=list)
    positions: list[Position | str] = dataclasses.field(default_factory=list)

    @classmethod
    def of(cls, fields: Iterable[str]) -> Self:
        """Return no rows of these fields."""
        return cls({field: [] for field in fields})

    def add(self, values: Mapping[str, Any], name: str, position: Position | str) -> None:
        """Add the next row; a field without a value is missing."""
        row = len(self.numbers)
        self.read += 1
        self.numbers.append(self.read)
        self.names.append(name)
        self.positions.append(position)
        # A column ends at its last value: most elements of OpenStreetMap have few of the tags.
        for field in self.columns.keys() & values.keys():
            column = self.columns[field]
            column += [None] * (row - len(column))
            column.append(values[field])

    def column(self, field: str) -> Sequence[Any] | pa.Array:
        """Return the value of every row in a field, None where it is missing."""
        column = self.columns[field]
        if isinstance(column, list):
            column += [None] * (len(self.numbers) - len(column))
        return column

    def skip(self, error: str | None = None) -> None:
        """Count the next row as filtered, or with an error as unreadable."""
        self.read += 1
        if error is None:
            self.filtered += 1
        else:
            self.errors[self.read] = error

    def mark_unreadable(self, count: int, reason: str) -> None:
        """Count the rows from the next one up to number `count` as unreadable."""
        self.errors.update(dict.fromkeys(range(self.read + 1, count + 1), reason))
        self.read = max(self.read, count)


class LayerBuilder:
    """A layer while its rows are read: its rules and the rows."""

    def __init__(
        self, spec: LayerSpec, fields: Sequence[str], *, filters: bool, where: str
    ) -> None:
        self.spec = spec
        self.rules = RowRules(spec, fields, filters=filters, where=where)
        self.rows = Rows.of(self.rules.fields)

    def layer(
        self,
        own: CRS | None,
        *,
        requested: str | None,
        implicit: bool = False,
        notes: tuple[str, ...] = (),
    ) -> RawLayer:
        """Return the layer of all rows; its CRS is chosen by `choose_crs`."""
        crs, more = choose_crs(
            own,
            implicit=implicit,
            expected=self.spec.crs,
            requested=requested,
            where=self.rules.file,
        )
        by_file = own is not None and not implicit
        return raw_layer(self.rows, self.rules, crs, by_file=by_file, notes=(*notes, *more))


def raw_layer(
    rows: Rows, rules: RowRules, crs: CRS, *, by_file: bool, notes: tuple[str, ...] = ()
) -> RawLayer:
    """Filter and classify rows, build their geometries and check them against the CRS.

    `by_file` is whether the file states the CRS. CrsError if the CRS is in degrees and most
    coordinates are not.
    """
    spec = rules.spec
    passed = rules.apply(rows)
    columns, numbers = passed.columns, passed.numbers
    positions = [rows.positions[row] for row in passed.rows.tolist()]
    # A position that is a text is an error; build the geometries of the others.
    readable = np.array([not isinstance(position, str) for position in positions], bool)
    errors: dict[int, str] = {**rows.errors}
    errors.update(
        (int(numbers[row]), str(positions[row])) for row in np.flatnonzero(~readable).tolist()
    )
    geometry = built_geometries(position for position in positions if not isinstance(position, str))
    columns, numbers = columns.filter(pa.array(readable)), numbers[readable]
    # Rows with coordinates that are not usable are errors, too.
    bad = _coordinate_errors(geometry, numbers, crs, by_file=by_file, file=rules.file)
    errors |= bad
    keep = ~np.isin(numbers, list(bad))
    repeated = rows.repeated
    if spec.unique_id:
        tolerance = APART_DEGREES if crs.is_geographic else APART_METRES
        first, more = _first_of_ids(columns[SOURCE_ID].to_pylist(), geometry, keep, tolerance)
        repeated += int(keep.sum() - first.sum())
        keep = first
        notes += more
    columns, geometry = columns.filter(pa.array(keep)), geometry[keep]
    if crs.is_projected and not by_file and fits_the_globe(shapely.get_coordinates(geometry)):
        notes += (f"the coordinates look like degrees, yet {crs_label(crs)} is stated",)
    notes += tuple(_deviations(rows.read, columns, geometry, spec))
    if rows.closed:
        notes += (f"{rows.closed} of {rows.read} rows have rings that are not closed; closed here",)
    if spec.tags and errors:  # elements of OpenStreetMap; count the causes
        causes = Counter(SHARE.sub("some of its", e.partition(" ")[2]) for e in errors.values())
        listed = ", ".join(f"{cause} ({number:,})" for cause, number in causes.most_common())
        notes += (f"unreadable: {listed}",)
    size = len(geometry)
    if spec.role == "objects":
        columns, geometry, more = _separate_points(columns, geometry)
        notes += more
    return RawLayer(
        spec=spec,
        columns=columns,
        geometry=geometry,
        crs=crs,
        counts=RowCounts(
            read=rows.read + len(geometry) - size,
            unreadable=len(errors),
            filtered=rows.filtered + passed.filtered,
            excluded=passed.excluded,
            duplicates=repeated,
        ),
        errors=tuple(
            f"row {row}: {shortened(text)}" for row, text in sorted(errors.items())[:MOST_ERRORS]
        ),
        notes=(*passed.notes, *notes),
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
    geometry: NDArray[np.object_],
    numbers: NDArray[np.int64],
    crs: CRS,
    *,
    by_file: bool,
    file: str,
) -> dict[int, str]:
    """Return the errors of rows with coordinates that are not finite, or out of range in degrees.

    CrsError if most of the finite coordinates are out of range.
    """
    xy, owner = shapely.get_coordinates(geometry, return_index=True)
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
        for number, (x, y) in zip(numbers[owner[rows]].tolist(), xy[rows], strict=True):
            errors.setdefault(number, f"its coordinates ({x:.12g}, {y:.12g}) {what}")
    return errors


def _first_of_ids(
    ids: Sequence[str],
    geometry: NDArray[np.object_],
    keep: NDArray[np.bool_],
    tolerance: float,
) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Return which rows of `keep` are the first of their id, and a note on distant ones.

    The first row with a position comes before rows without one.
    """
    nowhere = shapely.is_missing(geometry) | shapely.is_empty(geometry)
    first_rows: dict[str, int] = {}
    firsts, repeats = [], []
    for row in np.flatnonzero(keep)[np.argsort(nowhere[keep], kind="stable")].tolist():
        first = first_rows.setdefault(ids[row], row)
        if ids[row] and first != row:
            firsts.append(first)
            repeats.append(row)
    result = keep.copy()
    result[repeats] = False
    metres = shapely.distance(geometry[firsts], geometry[repeats])  # NaN if there is no position
    far = int((metres > tolerance).sum())
    note = f"{far} rows have the id of a row at another place; the place of the first row is used"
    return result, (note,) if far else ()


def _separate_points(
    columns: pa.Table, geometry: NDArray[np.object_]
) -> tuple[pa.Table, NDArray[np.object_], tuple[str, ...]]:
    """Return a row for each point of rows of several points, with ids such as ``12/3``, and a note.

    Each point is a row of the layer, also in its counts.
    """
    sizes = shapely.get_num_coordinates(geometry)
    several = (shapely.get_dimensions(geometry) == 0) & (sizes > 1)
    if not several.any():
        return columns, geometry, ()
    counts = np.where(several, sizes, 1)
    rows = np.repeat(np.arange(len(geometry)), counts)
    numbers = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts) + 1
    points = geometry[rows]
    points[several[rows]] = shapely.points(shapely.get_coordinates(geometry[several]))
    columns = columns.take(pa.array(rows))
    ids = [
        f"{name}/{number}" if part and name else name
        for name, number, part in zip(
            columns[SOURCE_ID].to_pylist(), numbers.tolist(), several[rows].tolist(), strict=True
        )
    ]
    place = columns.column_names.index(SOURCE_ID)
    columns = columns.set_column(place, SOURCE_ID, pa.array(ids, pa.string()))
    note = (
        f"{several.sum():,} rows are MultiPoints; each of their {sizes[several].sum():,} points is "
        "an object, counted as a row"
    )
    return columns, points, (note,)


def _deviations(
    read: int, columns: pa.Table, geometry: NDArray[np.object_], spec: LayerSpec
) -> Iterable[str]:
    """Yield the differences between a layer and its specification."""
    if read == 0:
        yield "the layer has no rows"
    elif spec.rows is not None and not spec.rows[0] <= read <= spec.rows[1]:
        least, most = spec.rows
        yield f"the layer has {read} rows, and {least} to {most} were expected"
    kinds, samples, counts = np.unique(
        shapely.get_type_id(geometry), return_index=True, return_counts=True
    )
    others = {
        geometry[row].geom_type: int(count)
        for kind, row, count in zip(kinds, samples, counts, strict=True)
        if kind >= 0 and geometry[row].geom_type not in GEOMETRY_TYPES[spec.geometry]
    }
    if others and not spec.tags:  # each element of OpenStreetMap states its own type
        listed = ", ".join(sorted(others))
        yield f"{sum(others.values())} of {read} rows are {listed}, not {spec.geometry}"
    unknown = int(np.isnan(columns[HALF_WIDTH].to_numpy()).sum()) if spec.has_width else 0
    if unknown:
        yield f"{unknown} of {len(columns)} streets have no known width"


class _CodedColumn:
    """The distinct values of a field, and the index of the value of every row.

    What a rule says about a value is computed once for each distinct value.
    """

    def __init__(self, values: Sequence[Any] | pa.Array) -> None:
        if not isinstance(values, pa.Array):
            with contextlib.suppress(pa.ArrowInvalid, pa.ArrowTypeError, UnicodeError):
                values = pa.array(values, pa.string())
        if isinstance(values, pa.Array):
            try:
                coded = values.dictionary_encode("encode")
            except pa.ArrowNotImplementedError:  # lists and structures
                values = values.to_pylist()
            else:
                self.values = [plain(value) for value in coded.dictionary.to_pylist()]
                self.codes = coded.indices.to_numpy()
                return
        # Values of JSON have any types; 1, 1.0 and true are equal, but not as texts.
        codes: dict[object, int] = {}
        keys = ((type(v), v if v.__hash__ else id(v)) for v in values)
        self.codes = np.array([codes.setdefault(key, len(codes)) for key in keys], np.int64)
        _, first = np.unique(self.codes, return_index=True)
        self.values = [plain(values[row]) for row in first.tolist()]

    def map(self, rule: Callable[[Any], Any], kind: type) -> NDArray[Any]:
        """Return the result of a rule for the value of every row, as an array of this type."""
        results: NDArray[Any] = np.array([rule(v) for v in self.values], kind)[self.codes]
        return results

    def texts(self, rule: Callable[[Any], str | None]) -> pa.Array:
        """Return the text that a rule gives for the value of every row, as an Arrow column."""
        return pa.array(map(rule, self.values), pa.string()).take(pa.array(self.codes))


def plain(value: object) -> object:
    """Return dates and times as text in ISO 8601 without a time zone, others unchanged."""
    if isinstance(value, dt.datetime):
        return value.replace(tzinfo=None).isoformat()
    return value.isoformat() if isinstance(value, dt.date | dt.time) else value


@dataclasses.dataclass(frozen=True, eq=False, slots=True)
class FilteredRows:
    """Rows that pass the rules of a layer, and the numbers of rows left out.

    `rows` are the indices of the rows that pass, `numbers` their row numbers, `columns` what
    `RawLayer` has of them. Rows are `filtered` by ``where`` or ``class_by``, and `excluded` by
    ``not``.
    """

    columns: pa.Table
    rows: NDArray[np.int64]
    numbers: NDArray[np.int64]
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
        facts = {"texts", "height_field", "levels_field"}
        self._rule_fields = {column for key, column in uses if key not in facts}

    def apply(self, rows: Rows) -> FilteredRows:
        """Return the columns of a `RawLayer` for the rows that pass.

        A row without an id has its
        number as identifier, or an empty one where ids are unique, because the number could be the
        id of another row.
        """
        spec, size = self.spec, len(rows.numbers)
        # Most layers of OpenStreetMap have no values in most of the fields.
        fields = [field for field in self.fields if self._matters(field, rows)]
        columns = {field: _CodedColumn(rows.column(field)) for field in fields}
        passed = np.ones(size, bool)
        for field, condition in self._where:
            passed &= columns[field].map(condition.accepts, bool)
        filtered = size - int(passed.sum())
        excluded: dict[str, int] = {}
        for field, condition in self._not:
            out = passed & columns[field].map(
                functools.partial(condition.accepts, every=True), bool
            )
            excluded[field] = int(out.sum())
            passed &= ~out
        notes = []
        if any(excluded.values()):
            listed = (f"{field} {number}" for field, number in excluded.items() if number)
            notes.append(f"left out by the catalogue's not: {', '.join(listed)}")
        by, name = spec.class_by, spec.class_name
        classes = pa.repeat(pa.scalar(name), size)
        if by is not None and spec.role == "objects":
            default = name if by.otherwise else None
            classes = columns[by.field].texts(
                lambda value: _first(by.classes, value, default) or None
            )
            unlisted = passed & classes.is_null().to_numpy(zero_copy_only=False)
            if unlisted.any():
                notes.append(_unlisted(columns[by.field], unlisted, by.field, name))
                filtered += int(unlisted.sum())
                passed &= ~unlisted
        result = {CLASS_NAME: classes, SOURCE_ID: _ids(columns, spec.id_field, size)}
        if not spec.unique_id:
            no_id = pc.equal(result[SOURCE_ID], "")
            result[SOURCE_ID] = pc.if_else(
                no_id, pa.array(rows.names, pa.string()), result[SOURCE_ID]
            )
        result |= self._facts(columns, size)
        return FilteredRows(
            pa.table(result).filter(pa.array(passed)),
            np.flatnonzero(passed),
            np.array(rows.numbers, np.int64)[passed],
            filtered=filtered,
            excluded=sum(excluded.values()),
            notes=tuple(notes),
        )

    def _matters(self, field: str, rows: Rows) -> bool:
        """Whether a field has a value in any row, or is not only one of texts or heights."""
        values = rows.columns[field]
        return not isinstance(values, list) or bool(values) or field in self._rule_fields

    def _facts(self, columns: Mapping[str, _CodedColumn], size: int) -> dict[str, pa.Array]:
        """Return the columns other than class and identifier."""
        spec, result = self.spec, {}
        if spec.has_width:
            result[HALF_WIDTH] = pa.array(self._half_widths(columns, size))
        if spec.name_field is not None:
            result[NAME] = _texts(columns, spec.name_field, size)
        for column, field in spec.texts:
            if field not in columns:
                continue
            texts = _texts(columns, field, size)
            if pc.any(pc.not_equal(texts, "")).as_py():
                result[column] = texts
        if spec.group_field is not None:
            result[GROUP] = _texts(columns, spec.group_field, size)
        if spec.has_height:
            heights = self._heights(columns, size)
            if not np.isnan(heights).all():
                result[HEIGHT] = pa.array(heights)
        return result

    def _half_widths(self, columns: Mapping[str, _CodedColumn], size: int) -> NDArray[np.float64]:
        by, own = self.spec.width_by, self.spec.width_field
        widths = np.full(size, math.nan)
        if own is not None:
            widths = columns[own].map(_width, float)
        if by is not None:
            default = math.nan if by.default is None else by.default
            typical = columns[by.field].map(lambda value: _first(by.widths, value, default), float)
            widths = np.where(np.isnan(widths), typical, widths)
        return widths / 2

    def _heights(self, columns: Mapping[str, _CodedColumn], size: int) -> NDArray[np.float32]:
        """Return the heights in metres, from the storeys where only these are known, or NaN."""
        own, levels = self.spec.height_field, self.spec.levels_field
        heights = np.full(size, math.nan)
        if levels is not None and levels in columns:
            heights = STOREY_M * columns[levels].map(_metres, float)
        if own is not None and own in columns:
            stated = columns[own].map(_metres, float)
            heights = np.where(np.isnan(stated), heights, stated)
        return _plausible(heights).astype(np.float32)


def _texts(columns: Mapping[str, _CodedColumn], field: str | None, size: int) -> pa.Array:
    """Return the names in a field, empty where there is none."""
    if field is None:
        return pa.repeat(pa.scalar(""), size)
    return columns[field].texts(_label)


def _ids(columns: Mapping[str, _CodedColumn], field: str | None, size: int) -> pa.Array:
    """Return the identifiers in a field, empty where there is none or only a placeholder."""
    if field is None:
        return pa.repeat(pa.scalar(""), size)
    column = columns[field]
    counts = np.bincount(column.codes, minlength=len(column.values))
    ids = map(identifier, column.values, (counts > 1).tolist())
    return pa.array(ids, pa.string()).take(pa.array(column.codes))


def _unlisted(column: _CodedColumn, rows: NDArray[np.bool_], field: str, class_name: str) -> str:
    """Return a note on the values that `class_by` does not list, the most frequent first."""
    counts: Counter[str] = Counter()
    codes, first, numbers = np.unique(column.codes[rows], return_index=True, return_counts=True)
    for place in np.argsort(first).tolist():
        value = column.values[codes[place]]
        shown = "no value" if value is None else repr(as_text(value)[:MOST_VALUE_CHARACTERS])
        counts[shown] += int(numbers[place])
    listed = [f"{value} {number}" for value, number in counts.most_common(MOST_UNLISTED)]
    others = len(counts) - len(listed)
    listed += [f"and {others} others"] if others else []
    remedy = f'; write otherwise = "class" to take them as {class_name}' if class_name else ""
    return f"left out, unlisted in class_by {field!r}: {', '.join(listed)}{remedy}"


def _first(choices: Iterable[tuple[Value, T]], value: object, default: T) -> T:
    """Return the result of the first choice that matches a value, or the default."""
    return next((result for accepted, result in choices if matches(value, accepted)), default)


def _label(value: object) -> str:
    text = "" if value is None else as_text(value).strip()
    whole = WHOLE_FLOAT.fullmatch(text)
    return whole[1] if whole else text


def identifier(value: object, repeated: bool) -> str:  # noqa: FBT001 - of `map`
    """Return the text of an identifier, empty for what stands where there is none.

    Numbers such as 0 and -1 do so if they are `repeated`.
    """
    text = _label(value)
    none = NO_IDENTIFIER.fullmatch(text) or (repeated and PLACEHOLDER.fullmatch(text))
    return "" if none else text


def _width(value: object) -> float:
    """Return a plausible width of a street from a field, or NaN."""
    width = _metres(value)
    return width if MIN_WIDTH_M <= width <= MAX_WIDTH_M else math.nan


def _metres(value: object) -> float:
    """Return a number from a field, which may be followed by m, or NaN."""
    try:
        return decimal(as_text(value).strip().removesuffix("m"))
    except ValueError:
        return math.nan


def heights_in(values: Iterable[object]) -> NDArray[np.float64]:
    """Return the heights in metres that some values state.

    Parameters
    ----------
    values : iterable of object
        Numbers, or texts such as ``12 m``.

    Returns
    -------
    ndarray of float64
        The heights, NaN for all that is not a plausible height.

    Examples
    --------
    >>> heights_in([12, "12,5 m", "three storeys", None, -1]).tolist()
    [12.0, 12.5, nan, nan, nan]
    """
    array = np.asarray(values if isinstance(values, np.ndarray) else list(values))
    if array.dtype.kind not in "fiu":
        array = np.array([_metres(value) for value in values])
    return _plausible(array.astype(np.float64))


def _plausible(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return heights with NaN for what cannot be one."""
    return np.where((heights > 0) & (heights <= MAX_HEIGHT_M), heights, math.nan)


def require_field(field: str, fields: Sequence[str], *, where: str, key: str) -> None:
    """Raise CatalogError if a file does not have a field; the message lists its fields."""
    if field not in fields:
        raise CatalogError(
            f"{where} has no field {field!r}, which the catalogue names in {key}"
            f"{nearest_name(field, fields)}; its fields are {', '.join(fields) or 'none at all'}."
        )
