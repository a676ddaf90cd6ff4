"""What a layer's specification says of one row: is it wanted, of what class and width, which id."""

from __future__ import annotations

import functools
import math
import re
from typing import TYPE_CHECKING, Any

from semsig_gis.errors import CatalogError, nearest_name
from semsig_gis.layer_spec import MAX_WIDTH_M, MIN_WIDTH_M

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from semsig_gis.layer_spec import LayerSpec, Value

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
        for key, field in uses:
            require_field(field, fields, where=where, key=key)
        self.fields = tuple(dict.fromkeys(field for _, field in uses))

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
