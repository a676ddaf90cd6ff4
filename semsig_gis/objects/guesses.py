"""Guess the class and the position of the rows of a file from its fields and values."""

from __future__ import annotations

import contextlib
import itertools
import re
import shlex
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from shapely.geometry.base import BaseGeometry

from semsig_gis.core import SourceError, crs_label
from semsig_gis.sources import (
    FORMATS,
    NO_GEOMETRY,
    POINT,
    SHAPE,
    SUFFIXES,
    LayerInfo,
    ServiceRecord,
    decimal,
    file_reader,
    find_positions,
    first_rows,
    fold,
    keywords,
    open_table,
    probe_file,
    tagged_class,
    words_of,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from semsig_gis.sources import Match, PositionFields

VECTOR = "vector_file"
# Files that may be a plain table of records, which GDAL cannot read or reads as text.
TABLE_SUFFIXES = SUFFIXES | {".csv", ".geojson", ".gml", ".json"}
SAMPLE_ROWS = 100_000
ROLE_GEOMETRY = {"buildings": "polygon", "streets": "line"}
# Maximum number of distinct values of a field that is offered as a filter.
FEW_VALUES = 12
# Maximum number of distinct values of a field with the class of a row.
MAX_CLASS_VALUES = 50
MAX_VALUE_LENGTH = 60
MIN_FILLED_SHARE = 0.1
# Minimum share of rows with a value that names the guessed class.
MIN_CLASS_SHARE = 0.5
DATE = re.compile(r"\d{4}-\d\d-\d\d|\d\d[-/.]\d\d[-/.]\d{4}")
VALUE_END = re.compile(r"\s*[,;:(|]|\s+-\s")


@dataclass(frozen=True, slots=True)
class LayerSample:
    """A layer with the name of its reader and its first rows.

    `placed` is whether the rows have positions outside the fields, or in fields that the reader
    knows; `positions` are the fields of the positions of others, if they have some.
    """

    reader: str
    info: LayerInfo
    rows: tuple[Mapping[str, Any], ...]
    placed: bool = True
    positions: PositionFields | None = None


def sample_layers(path: Path) -> tuple[LayerSample, ...]:
    """Return samples of the layers of a file; SourceError if no catalogue can be made of it."""
    suffix = path.suffix.lower()
    is_osm, is_gbfs = path.name.lower().endswith(tuple(FORMATS)), False
    with contextlib.suppress(SourceError):  # a table of a portal
        is_osm = is_osm or file_reader(path) in {"osm_file", "overpass"}
        is_gbfs = probe_file(path).format == "gbfs"
    if is_osm or is_gbfs:
        what, name = ("OpenStreetMap data", "openstreetmap") if is_osm else ("a GBFS feed", "gbfs")
        raise SourceError(
            f"{path} is {what}, and no catalogue is needed: `semsig load "
            f"{shlex.quote(str(path))}` reads it with the built-in one, {name!r}."
        )
    layers: tuple[LayerSample, ...] = ()
    try:
        if suffix not in SUFFIXES:
            layers = tuple(
                LayerSample(VECTOR, info, rows, info.geometry != NO_GEOMETRY, positions)
                for info, rows, positions in first_rows(path, limit=SAMPLE_ROWS)
            )
    except SourceError:
        if suffix not in TABLE_SUFFIXES:
            raise
    placed = any(item.placed or item.positions for item in layers)
    if suffix in TABLE_SUFFIXES and not placed:
        return (_table_sample(path),)
    return layers


def _table_sample(path: Path) -> LayerSample:
    table = open_table(path)
    records = (item for item in table.records(table.fields) if isinstance(item, ServiceRecord))
    first = tuple(itertools.islice(records, SAMPLE_ROWS))
    rows = tuple(record.values for record in first)
    shapes = {
        record.geometry.geom_type.removeprefix("Multi")
        for record in first
        if isinstance(record.geometry, BaseGeometry)  # for example in GML
    }
    info = LayerInfo(
        name=path.stem,
        geometry=" or ".join(sorted(shapes)) or "Point",
        crs=None if table.crs is None else crs_label(table.crs.to_2d()),
        rows=len(rows) + sum(1 for _ in records),
        fields=tuple(table.fields),
    )
    position_fields = {fold(field) for field in table.fields} & {fold(SHAPE), fold(POINT)}
    kind = "wfs" if path.suffix.lower() == ".gml" else "opendatasoft"
    placed = any(record.geometry for record in first) or bool(position_fields)
    positions = None if placed else find_positions(table.fields, rows, subject=path.stem)
    return LayerSample(kind, info, rows, placed, positions)


@dataclass(frozen=True, slots=True)
class Column:
    """A field with the counts of its values in a sample.

    `counts` is the number of rows of each value that is not blank, in the order of first rows;
    `missing` is the number of rows without a value.
    """

    name: str
    counts: Counter[Any]
    missing: int

    @property
    def unique(self) -> bool:
        """Whether every row has a different value."""
        return not self.missing and max(self.counts.values(), default=2) == 1

    @property
    def few(self) -> bool:
        """Whether the column is categorical with at most `FEW_VALUES` distinct values."""
        return self.is_categorical(FEW_VALUES)

    def is_categorical(self, limit: int) -> bool:
        """Whether the column has 2 to `limit` distinct names, repeated, in enough rows."""
        rows = self.counts.total()
        return (
            2 <= len(self.counts) <= limit  # noqa: PLR2004 - a single value distinguishes nothing
            and 2 * len(self.counts) <= rows
            and rows >= MIN_FILLED_SHARE * (rows + self.missing)
            and all(_is_name(value) for value in self.counts)
        )

    def meant_for(self, purpose: str) -> bool:
        """Whether the field name is typical of a filter, identifier or row_number."""
        return any(match.name == purpose for match in keywords("fields").find(self.name))


def _is_name(value: object) -> bool:
    """Whether a value is a truth value, or a text that is no number, date or long text."""
    if not isinstance(value, str):
        return isinstance(value, bool)
    short = len(value) <= MAX_VALUE_LENGTH
    return short and _number(value) is None and not DATE.search(value)


def _number(value: object) -> float | None:
    """Return a number, also from its text; None for other values."""
    try:
        return decimal(value) if isinstance(value, str) else float(value)  # type: ignore[arg-type] # raises
    except (TypeError, ValueError):
        return None


def columns_of(sample: LayerSample) -> tuple[Column, ...]:
    """Return the fields of a sample in their order, without fields of lists, mappings or bytes."""
    columns = []
    for name in sample.info.fields:
        values = [row.get(name) for row in sample.rows]
        filled = [value for value in values if value is not None and value != ""]
        if all(isinstance(value, str | int | float) for value in filled):
            columns.append(Column(name, Counter(filled), len(values) - len(filled)))
    return tuple(columns)


@dataclass(frozen=True, slots=True)
class ClassGuess:
    """Guessed class of a layer, or its role if `is_role`; the name is empty without a guess.

    `others` are further possible classes; `sure` is whether the guess is certain, and `by_values`
    whether it is from values of a field, which may have others.
    """

    name: str = ""
    is_role: bool = False
    reason: str = ""
    others: tuple[str, ...] = ()
    sure: bool = False
    by_values: bool = False


def guess_class(
    names: str, columns: Sequence[Column], *, geometry: str | None, rows: int
) -> ClassGuess:
    """Guess the class of a layer, or its role (buildings or streets).

    `names` are the names of the file and the layer; `geometry` is None for several kinds; `rows` is
    the size of the sample. The guess is from the name, or else from values in most rows, or else
    from a field that is typical of a class.
    """
    classes = keywords("classes").find(names)
    for role in keywords("roles").find(names):
        longer = any(match.letters > role.letters for match in classes)
        if ROLE_GEOMETRY[role.name] == geometry and not longer:
            return ClassGuess(role.name, is_role=True, reason=_reason(role), sure=not role.doubt)
    if classes:
        first, *others = classes
        # What describes another thing is no rival of it: signals in "signal cabinets".
        rivals = [match for match in others if first.doubt or not match.doubt]
        other_names = tuple(match.name for match in rivals)
        sure = not (first.doubt or other_names)
        return ClassGuess(first.name, reason=_reason(first), others=other_names, sure=sure)
    if matches := keywords("class_names").find(names):
        first, *others = matches
        return ClassGuess(
            first.name, reason=_reason(first), others=tuple(match.name for match in others)
        )
    if geometry not in {"point", None}:
        return ClassGuess()
    return next(_guesses_by_content(columns, rows), ClassGuess())


def _reason(match: Match) -> str:
    reason = f'from the name: "{match.words}"'
    is_other = match.doubt not in {"", *match.words.split()}  # not the end of a compound
    return f'{reason}, but what is "{match.doubt}"?' if is_other else reason


def _guesses_by_content(columns: Sequence[Column], rows: int) -> Iterator[ClassGuess]:
    """Yield guesses from values, then from field names."""
    for column in columns:
        row_counts: Counter[str] = Counter()
        example: dict[str, str] = {}
        for value, number in column.counts.items() if len(column.counts) <= FEW_VALUES else ():
            for match in keywords("classes").find(str(value))[:1]:
                row_counts[match.name] += number
                example.setdefault(match.name, str(value))
        for name, number in row_counts.most_common(1):
            if number >= MIN_CLASS_SHARE * rows:
                reason = f"from {column.name} = {example[name]}"
                yield ClassGuess(name, reason=reason, by_values=True)
    for column in columns:
        for match in keywords("class_fields").find(column.name):
            yield ClassGuess(match.name, reason=f"from the field {column.name}")


def guess_class_by(
    columns: Sequence[Column], class_name: str, *, sure: bool = True
) -> tuple[str, dict[str, str]] | None:
    """Return the field with most values that name other classes, and the class of each value.

    If the class of the layer is `sure`, values need the words by which layers are recognised;
    without that, tags of OpenStreetMap and names of classes count, too.
    """
    fields = [
        (column.name, _classes_of_values(column, sure=sure))
        for column in columns
        if column.is_categorical(MAX_CLASS_VALUES)
    ]

    def others(field: tuple[str, dict[str, str]]) -> int:
        return sum(name != class_name for name in field[1].values())

    best = max(fields, key=others, default=None)
    return best if best and others(best) else None


def _classes_of_values(column: Column, *, sure: bool) -> dict[str, str]:
    """Return the class of each value of a field that names one."""
    classes = {}
    for value in column.counts:
        if not isinstance(value, str):
            continue
        names = [] if sure else [tagged_class(column.name, value)]
        # What stands before a comma or parenthesis is the thing, as in "Street light (LED)".
        for text in dict.fromkeys([value, VALUE_END.split(value)[0]]):
            names += [match.name for match in keywords("classes").find(text)[:1] if not match.doubt]
            exact = [] if sure else keywords("class_names").find(text)[:1]
            names += [match.name for match in exact if match.words == " ".join(words_of(text))]
        if name := next(filter(None, names), None):
            classes[value] = name
    return classes
