"""Which columns of a CSV file hold the coordinates, and what they say."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from semsig_gis.core.errors import CatalogError, SourceError
from semsig_gis.sources.raw_layer import BadFeatureError, require_field

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from semsig_gis.sources.layers import LayerSpec

# Separators and what GDAL calls them.
SEPARATORS = {";": "SEMICOLON", ",": "COMMA", "\t": "TAB"}
# Degrees go before a plane's coordinates where a file has both.
KNOWN_NAMES = ((("lon", "longitude"), ("lat", "latitude")), (("x",), ("y",)))


@dataclass(frozen=True, slots=True)
class CsvColumns:
    """Separator, one character, names, and coordinate columns: x is easting or longitude."""

    separator: str
    names: tuple[str, ...]
    x: str | None
    y: str | None

    @property
    def options(self) -> dict[str, str]:
        """GDAL's open options; its own guess of the separator fails on `id;size (a, b);x;y`."""
        return {"SEPARATOR": SEPARATORS[self.separator], "HEADERS": "YES"}

    def position(self, row: Mapping[str, Any]) -> tuple[float, float] | None:
        """Return the coordinates of a row, or None where both are blank.

        BadFeatureError if they are not two numbers.
        """
        texts = {name: (row[name] or "").strip() for name in (self.x, self.y) if name}
        if not any(texts.values()):
            return None
        x, y = (self._number(name, text) for name, text in texts.items())
        return x, y

    def _number(self, name: str, text: str) -> float:
        # Where the comma does not separate columns it is the decimal sign of half of Europe.
        plain = text if self.separator == "," else text.replace(",", ".")
        try:
            value = float(plain)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            msg = f"{name} {text!r} is not a number"
            raise BadFeatureError(msg)
        return value


def csv_columns(header: str, spec: LayerSpec | None, *, where: str) -> CsvColumns:
    """Find the separator and the coordinate columns from the first line of a file.

    CatalogError if `spec` names only one column, or one that does not exist; SourceError if none is
    recognised, but without `spec`.
    """
    layouts = {sep: next(csv.reader([header], delimiter=sep), []) for sep in SEPARATORS}
    widest = max(layouts, key=lambda separator: len(layouts[separator]))
    if spec is not None and (spec.x_field or spec.y_field):
        x, y = spec.x_field, spec.y_field
        if not (x and y):
            msg = f"{where} has only one of x_field and y_field in the catalogue; state both."
            raise CatalogError(msg)
        for separator, names in layouts.items():
            if x in names and y in names:
                return CsvColumns(separator, tuple(names), x, y)
        require_field(x, layouts[widest], where=where, key="x_field")
        require_field(y, layouts[widest], where=where, key="y_field")
    for separator, names in layouts.items():
        for x_names, y_names in KNOWN_NAMES:
            x, y = _first(names, x_names), _first(names, y_names)
            if x and y:
                return CsvColumns(separator, tuple(names), x, y)
    if spec is None:
        return CsvColumns(widest, tuple(layouts[widest]), None, None)
    msg = (
        f"{where} has no coordinate columns lon and lat, or x and y; name them in x_field and "
        f"y_field; its columns are {', '.join(layouts[widest])}."
    )
    raise SourceError(msg)


def _first(names: Sequence[str], wanted: Sequence[str]) -> str | None:
    return next((name for name in names if name.strip().lower() in wanted), None)
