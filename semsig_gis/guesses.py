"""What names, fields and first rows tell of a layer; `suggest` writes it down as a draft."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from semsig_gis.keywords import keywords

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from semsig_gis.sources._sample import Sample

__all__ = ["ClassGuess", "Column", "columns_of", "guess_class", "guess_class_by", "guess_position"]

# A field with no more values is one to filter by, unless most of them are seen only once.
FEW_VALUES = 12
LONGEST_VALUE = 60
LEAST_SHARE = 0.1
DATE = re.compile(r"\d{4}-\d\d-\d\d|\d\d[-/.]\d\d[-/.]\d{4}")
# A class must be named by the values of at least this share of the rows.
MOST_ROWS = 0.5
ROLE_GEOMETRY = {"buildings": "polygon", "streets": "line"}
LAT_LON = re.compile(r"\s*-?\d{1,2}\.\d+\s*,\s*-?\d{1,3}\.\d+\s*")


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
        rows = self.counts.total()
        return (
            2 <= len(self.counts) <= FEW_VALUES  # noqa: PLR2004 - one value tells nothing apart
            and 2 * len(self.counts) <= rows
            and rows >= LEAST_SHARE * (rows + self.missing)
            and all(_names_something(value) for value in self.counts)
        )

    def meant_for(self, purpose: str) -> bool:
        """Tell whether the name is typical of fields for a purpose.

        The purposes are ``"filter"``, ``"identifier"``, ``"row_number"``, ``"x"`` and ``"y"``.
        """
        return any(found.name == purpose for found in keywords("fields").find(self.name))

    def within(self, limit: float) -> bool:
        """Tell whether all values are numbers from ``-limit`` to ``limit``."""
        return all(_number(value) and abs(float(value)) <= limit for value in self.counts)


def _names_something(value: object) -> bool:
    if isinstance(value, bool):
        return True
    return (
        isinstance(value, str)
        and len(value) <= LONGEST_VALUE
        and not _number(value)
        and not DATE.search(value)
    )


def _number(value: object) -> bool:
    try:
        float(value)  # type: ignore[arg-type] # what cannot be one raises
    except (TypeError, ValueError):
        return False
    return True


def columns_of(sample: Sample) -> tuple[Column, ...]:
    """Return the fields of a sample in their order, without those of lists, mappings or bytes."""
    columns = []
    for name, _ in sample.info.fields:
        values = [row.get(name) for row in sample.rows]
        there = [value for value in values if value is not None and value != ""]
        if all(isinstance(value, str | int | float) for value in there):
            columns.append(Column(name, Counter(there), len(values) - len(there)))
    return tuple(columns)


@dataclass(frozen=True, slots=True)
class ClassGuess:
    """What a layer seems to hold: a class, or a role if `is_role`; empty if nothing points to one.

    `reason` tells people what it was seen by, `others` are further classes that the name could
    mean, and `sure` says that the name means this and nothing else.
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

    `names` holds those of the file and of the layer; `geometry` is ``"point"``, ``"line"`` or
    ``"polygon"``, or None where it is of several kinds; `rows` is the size of the sample. The name
    decides; else values that most rows have; else a field that only one class has.
    """
    classes = keywords("classes").find(names)
    for role in keywords("roles").find(names):
        longer = any(found.letters > role.letters for found in classes)
        if ROLE_GEOMETRY[role.name] == geometry and not longer:
            return ClassGuess(
                role.name, is_role=True, reason=f'from the name: "{role.words}"', sure=True
            )
    if classes:
        first, *others = classes
        reason = f'from the name: "{first.words}"'
        also = tuple(found.name for found in others)
        return ClassGuess(first.name, reason=reason, others=also, sure=not also)
    if geometry not in {"point", None}:
        return ClassGuess()
    return next(_by_content(columns, rows), ClassGuess())


def _by_content(columns: Sequence[Column], rows: int) -> Iterator[ClassGuess]:
    for column in columns:
        seen: Counter[str] = Counter()
        example: dict[str, str] = {}
        for value, number in column.counts.items() if len(column.counts) <= FEW_VALUES else ():
            for found in keywords("classes").find(str(value))[:1]:
                seen[found.name] += number
                example.setdefault(found.name, str(value))
        for name, number in seen.most_common(1):
            if number >= MOST_ROWS * rows:
                yield ClassGuess(name, reason=f"from {column.name} = {example[name]}")
    for column in columns:
        for found in keywords("class_fields").find(column.name):
            yield ClassGuess(found.name, reason=f"from the field {column.name}")


def guess_class_by(columns: Sequence[Column], class_name: str) -> tuple[str, dict[str, str]] | None:
    """Return the field whose values name other classes than that of the layer, and which.

    The mapping leads from value to class. Of several such fields, the one with most of these values
    is chosen, and the first of equals.
    """
    best: tuple[str, dict[str, str]] | None = None
    for column in columns:
        if not column.few:
            continue
        classes = {
            value: found.name
            for value in column.counts
            if isinstance(value, str)
            for found in keywords("classes").find(value)[:1]
            if found.name != class_name
        }
        if classes and (best is None or len(classes) > len(best[1])):
            best = column.name, classes
    return best


def guess_position(sample: Sample, columns: Sequence[Column]) -> tuple[str, ...]:
    """Return the field of a table that holds ``lat, lon``, or those of x and y, or nothing."""
    for name, _ in sample.info.fields:
        values = [row[name] for row in sample.rows if row.get(name) not in {None, ""}]
        if values and all(isinstance(value, str) and LAT_LON.fullmatch(value) for value in values):
            return (name,)
    numbers = [column for column in columns if column.counts and column.within(float("inf"))]
    x, y = (
        [column.name for column in numbers if column.meant_for(purpose)] for purpose in ("x", "y")
    )
    return (x[0], y[0]) if x and y else ()
