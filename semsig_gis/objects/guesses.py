"""Guesses of what a file holds: the class and the position of its rows, by fields and values."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from shapely.geometry.base import BaseGeometry

from semsig_gis.core import SourceError
from semsig_gis.sources import (
    FORMATS,
    LATITUDE_LIMIT,
    LONGITUDE_LIMIT,
    NO_GEOMETRY,
    POINT,
    SHAPE,
    LayerInfo,
    ServiceRecord,
    decimal,
    first_rows,
    fold,
    keywords,
    open_table,
    words_of,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

VECTOR = "vector_file"
# Files that may be a plain table of records, which GDAL takes for nothing or for rows of text.
TABLE_SUFFIXES = frozenset({".csv", ".gml", ".json", ".parquet"})
SAMPLE_ROWS = 100_000
ROLE_GEOMETRY = {"buildings": "polygon", "streets": "line"}
# A field with no more values is one to filter by, unless most of them are seen only once.
FEW_VALUES = 12
# A field that tells the class may have more.
MOST_CLASS_VALUES = 50
LONGEST_VALUE = 60
LEAST_SHARE = 0.1
# A class must be named by the values of at least this share of the rows.
MOST_ROWS = 0.5
DATE = re.compile(r"\d{4}-\d\d-\d\d|\d\d[-/.]\d\d[-/.]\d{4}")
LAT_LON = re.compile(r"\s*-?\d{1,2}\.\d+\s*,\s*-?\d{1,3}\.\d+\s*")


@dataclass(frozen=True, slots=True)
class Sample:
    """One layer, the name of its reader, and all fields of its first rows.

    `placed` says whether the reader finds the positions by itself; `coordinates` are the two fields
    in which it finds them, where they are two.
    """

    reader: str
    info: LayerInfo
    rows: tuple[Mapping[str, Any], ...]
    placed: bool = True
    coordinates: tuple[str, ...] = ()


def samples_of(path: Path) -> tuple[Sample, ...]:
    """Return the layers of a file that may hold positions; SourceError for one not to describe."""
    suffix = path.suffix.lower()
    if path.name.lower().endswith(tuple(FORMATS)):
        raise SourceError(
            f"{path} is OpenStreetMap data; load it with the built-in catalogue 'openstreetmap'."
        )
    layers: tuple[Sample, ...] = ()
    try:
        if suffix != ".parquet":
            layers = tuple(
                Sample(VECTOR, info, rows, coordinates=coordinates)
                for info, rows, coordinates in first_rows(path, limit=SAMPLE_ROWS)
            )
    except SourceError:
        if suffix not in TABLE_SUFFIXES:
            raise
    if suffix in TABLE_SUFFIXES and all(item.info.geometry == NO_GEOMETRY for item in layers):
        return (_table(path),)
    return layers


def _table(path: Path) -> Sample:
    table = open_table(path)
    records = (item for item in table.records(table.fields) if isinstance(item, ServiceRecord))
    first = tuple(itertools.islice(records, SAMPLE_ROWS))
    rows = tuple(record.values for record in first)
    shapes = {
        record.geometry.geom_type.removeprefix("Multi")
        for record in first
        if isinstance(record.geometry, BaseGeometry)  # as of GML
    }
    info = LayerInfo(
        name=path.stem,
        geometry=" or ".join(sorted(shapes)) or "Point",
        crs="EPSG:4326" if table.crs is None else table.crs.to_string(),
        rows=len(rows) + sum(1 for _ in records),
        fields=tuple(table.fields),
    )
    named = {fold(field) for field in table.fields} & {fold(SHAPE), fold(POINT)}
    kind = "wfs" if path.suffix.lower() == ".gml" else "opendatasoft"
    return Sample(kind, info, rows, placed=table.has_geometry or bool(named))


@dataclass(frozen=True, slots=True)
class Column:
    """A field and its values in a sample.

    `counts` has the rows of every value that is not blank, in the order of their first row;
    `missing` is the number of rows without a value.
    """

    name: str
    counts: Counter[Any]
    missing: int

    @property
    def unique(self) -> bool:
        """Whether every row has a value of its own."""
        return not self.missing and max(self.counts.values(), default=2) == 1

    @property
    def few(self) -> bool:
        """Whether the values are few, name something, and most rows or many have one."""
        return self.at_most(FEW_VALUES)

    def at_most(self, values: int) -> bool:
        """Tell as `few` does, where few are so many."""
        rows = self.counts.total()
        return (
            2 <= len(self.counts) <= values  # noqa: PLR2004 - one value tells nothing apart
            and 2 * len(self.counts) <= rows
            and rows >= LEAST_SHARE * (rows + self.missing)
            and all(_names_something(value) for value in self.counts)
        )

    def meant_for(self, purpose: str) -> bool:
        """Tell whether the name is typical of a filter, identifier, row_number, x or y."""
        return any(match.name == purpose for match in keywords("fields").find(self.name))

    @property
    def numeric(self) -> bool:
        """Whether a value is a number, as a column of coordinates has them."""
        return any(map(_number, self.counts))

    def within(self, limit: float) -> bool:
        """Tell whether all of its numbers are from ``-limit`` to ``limit``."""
        return all(abs(_value_of(value)) <= limit for value in self.counts if _number(value))


def _names_something(value: object) -> bool:
    if not isinstance(value, str):
        return isinstance(value, bool)
    return len(value) <= LONGEST_VALUE and not _number(value) and not DATE.search(value)


def _number(value: object) -> bool:
    try:
        _value_of(value)
    except (TypeError, ValueError):
        return False
    return True


def _value_of(value: object) -> float:
    """Return a number, or one that is written as text."""
    return decimal(value) if isinstance(value, str) else float(value)  # type: ignore[arg-type] # what cannot be one raises


def columns_of(sample: Sample) -> tuple[Column, ...]:
    """Return the fields of a sample in their order, without those of lists, mappings or bytes."""
    columns = []
    for name in sample.info.fields:
        values = [row.get(name) for row in sample.rows]
        there = [value for value in values if value is not None and value != ""]
        if all(isinstance(value, str | int | float) for value in there):
            columns.append(Column(name, Counter(there), len(values) - len(there)))
    return tuple(columns)


@dataclass(frozen=True, slots=True)
class ClassGuess:
    """What a layer seems to hold: a class, or a role if `is_role`; empty if nothing points to one.

    `others` are further classes that the name could mean; `sure`, that it means nothing else.
    """

    name: str = ""
    is_role: bool = False
    reason: str = ""
    others: tuple[str, ...] = ()
    sure: bool = False


def guess_class(
    names: str, columns: Sequence[Column], *, geometry: str | None, rows: int
) -> ClassGuess:
    """Guess the class of a layer, or its role where it holds no objects.

    `names` are those of the file and of the layer; `geometry` is None where it is of several kinds;
    `rows` is the size of the sample. The name decides; else values that most rows have; else a
    field that only one class has.
    """
    classes = keywords("classes").find(names)
    for role in keywords("roles").find(names):
        longer = any(match.letters > role.letters for match in classes)
        if ROLE_GEOMETRY[role.name] == geometry and not longer:
            reason = f'from the name: "{role.words}"'
            return ClassGuess(role.name, is_role=True, reason=reason, sure=True)
    if classes:
        first, *others = classes
        reason = f'from the name: "{first.words}"'
        also = tuple(match.name for match in others)
        return ClassGuess(first.name, reason=reason, others=also, sure=not also)
    if geometry not in {"point", None}:
        return ClassGuess()
    return next(_by_content(columns, rows), ClassGuess())


def _by_content(columns: Sequence[Column], rows: int) -> Iterator[ClassGuess]:
    for column in columns:
        seen: Counter[str] = Counter()
        example: dict[str, str] = {}
        for value, number in column.counts.items() if len(column.counts) <= FEW_VALUES else ():
            for match in keywords("classes").find(str(value))[:1]:
                seen[match.name] += number
                example.setdefault(match.name, str(value))
        for name, number in seen.most_common(1):
            if number >= MOST_ROWS * rows:
                yield ClassGuess(name, reason=f"from {column.name} = {example[name]}")
    for column in columns:
        for match in keywords("class_fields").find(column.name):
            yield ClassGuess(match.name, reason=f"from the field {column.name}")


def guess_class_by(columns: Sequence[Column], class_name: str) -> tuple[str, dict[str, str]] | None:
    """Return the field with most values that name other classes than the layer's, and which."""
    fields = [
        (
            column.name,
            {
                value: match.name
                for value in column.counts
                if isinstance(value, str)
                for match in keywords("classes").find(value)[:1]
                if match.name != class_name
            },
        )
        for column in columns
        if column.at_most(MOST_CLASS_VALUES)
    ]
    best = max(fields, key=lambda field: len(field[1]), default=None)
    return best if best and best[1] else None


def guess_position(sample: Sample, columns: Sequence[Column]) -> tuple[str, ...]:
    """Return the field of a table that holds ``lat, lon``, or those of x and y, or nothing."""
    for name in sample.info.fields:
        values = [row[name] for row in sample.rows if row.get(name) not in {None, ""}]
        points = sum(isinstance(value, str) and bool(LAT_LON.fullmatch(value)) for value in values)
        if values and 2 * points >= len(values):
            return (name,)
    numbers = [column for column in columns if column.numeric]
    pairs = [
        (x, y)
        for x in numbers
        for y in numbers
        if x is not y and x.meant_for("x") and y.meant_for("y")
    ]
    best = max(pairs, key=_likeness, default=())
    return tuple(column.name for column in best)


def _likeness(pair: tuple[Column, Column]) -> tuple[bool, bool]:
    """Tell whether two coordinates are named alike, and are degrees rather than a plane's."""
    x, y = pair
    first, second = (words_of(column.name) for column in pair)
    differing = sum(one != other for one, other in zip(first, second, strict=False))
    alike = len(first) == len(second) and differing == 1
    return alike, x.within(LONGITUDE_LIMIT) and y.within(LATITUDE_LIMIT)
