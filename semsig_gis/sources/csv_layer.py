"""Layers of CSV files: the columns of positions, and the rows."""

from __future__ import annotations

import contextlib
import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core import CatalogError, SourceError
from semsig_gis.sources.csv_file import open_csv
from semsig_gis.sources.numbers import decimal
from semsig_gis.sources.rows import (
    BadFeatureError,
    LayerBuilder,
    require_field,
    usable_crs,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from typing import IO

    from semsig_gis.sources.csv_file import CsvFile
    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import LayerSpec
    from semsig_gis.sources.rows import Position

    Row = Mapping[str, str | None]

# In order of priority: degrees, coordinates in a plane, and then columns of geometries.
KNOWN_NAMES = (
    (("lon", "longitude"), ("lat", "latitude")),
    (("x",), ("y",)),
    (("long", "lng"), ("lat", "latitude")),
)
SHAPE_NAMES = ("wkt", "geom", "geometry", "the_geom")
# Well-known text with or without the code of its CRS, and well-known binary as hexadecimal.
WELL_KNOWN = re.compile(r"\s*(?:SRID\s*=\s*(\d+)\s*;)?\s*([A-Za-z].*)", re.DOTALL | re.IGNORECASE)
HEXADECIMAL = re.compile(r"\s*((?:[0-9A-Fa-f]{2}){5,})\s*")
MOST_SHOWN_CHARACTERS = 40
NO_GEOMETRY = "None"  # the geometry type of GDAL for a table without geometry


@dataclass(slots=True)
class CsvTable:
    """A CSV file, its separator, and the columns of its positions.

    These are coordinates `x` (easting or longitude) and `y`, or `shape`, a geometry in well-known
    text. `srid` is the EPSG code that the geometries state, known after one has been read.
    """

    file: CsvFile
    separator: str
    x: str | None = None
    y: str | None = None
    shape: str | None = None
    srid: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return self.file.layouts[self.separator]

    @property
    def has_positions(self) -> bool:
        """Whether the file has columns of positions."""
        return bool((self.x and self.y) or self.shape)

    @property
    def crs(self) -> CRS | None:
        """The CRS that the geometries state, or None; SourceError if it is unknown."""
        if not self.srid:
            return None
        try:
            return usable_crs(CRS.from_epsg(self.srid).to_wkt())
        except CRSError as error:
            raise SourceError(
                f"{self.file.what} states SRID={self.srid}, which is unknown; correct it."
            ) from error

    def survey(self) -> tuple[int, str]:
        """Read all rows; return their number and their geometry type in the terms of GDAL."""
        number, kinds = 0, set()
        for row in self.rows():
            number += 1
            with contextlib.suppress(BadFeatureError):
                position = None if isinstance(row, str) or not self.shape else self.position(row)
                kinds |= set() if position is None else {getattr(position, "geom_type", "Point")}
        if not self.shape:
            return number, "Point" if self.has_positions else NO_GEOMETRY
        return number, min(kinds) if len(kinds) == 1 else "Unknown"

    def rows(self) -> Iterator[Row | str]:
        """Yield every row as values by column name, or the text of its error."""
        return self.file.rows(self.separator)

    def position(self, row: Row) -> Position:
        """Return the position of a row, or None if it is blank."""
        texts = [(name, (row[name] or "").strip()) for name in (self.x, self.y, self.shape) if name]
        if not any(text for _, text in texts):
            return None
        if not self.shape:
            numbers = []
            for name, text in texts:
                try:
                    value = decimal(text, english=self.separator == ",")
                except ValueError:
                    value = math.nan
                if not math.isfinite(value):
                    raise BadFeatureError(f"{name} {text!r} is not a number")
                numbers.append(value)
            return numbers[0], numbers[1]
        text = texts[0][1]
        try:
            with np.errstate(invalid="ignore"):  # NaN is checked later for all geometries at once
                if code := HEXADECIMAL.fullmatch(text):
                    shape = shapely.from_wkb(code[1])
                    srid = int(shapely.get_srid(shape))
                else:
                    stated, plain = WELL_KNOWN.fullmatch(text).groups()  # type: ignore[union-attr]
                    shape, srid = shapely.from_wkt(plain), int(stated or 0)
        except (AttributeError, shapely.errors.ShapelyError) as error:
            raise BadFeatureError(
                f"{self.shape} {text[:MOST_SHOWN_CHARACTERS]!r} is not well-known text"
            ) from error
        self.srid = self.srid or srid
        if srid not in {0, self.srid}:
            raise BadFeatureError(
                f"{self.shape} has SRID={srid}, and rows before it have {self.srid}"
            )
        if isinstance(shape, shapely.Point) and not shape.is_empty:
            return shape.x, shape.y
        return shape


def csv_table(
    open_: Callable[[], IO[bytes]], spec: LayerSpec | None, *, what: str, where: str
) -> CsvTable:
    """Find the columns of positions in a CSV file.

    SourceError if `spec` is given and there are none.
    """
    file = open_csv(open_, what)
    if spec is not None and (spec.x_field or spec.y_field):
        return _stated_table(file, spec.x_field, spec.y_field, where=where)
    for separator, names in file.layouts.items():
        x, y = known_coordinates(names)
        if x and y:
            return CsvTable(file, separator, x, y)
    # Geometries contain semicolons and commas but no tabs, so try the tab first.
    for separator, names in reversed(list(file.layouts.items())):
        if shape := known_field(SHAPE_NAMES, names):
            return CsvTable(file, separator, shape=shape)
    if spec is None:
        return CsvTable(file, file.separator)
    raise SourceError(
        f"{where} has no coordinate columns lon and lat, or x and y; name them in x_field and "
        f"y_field; its columns are {', '.join(file.layouts[file.separator])}."
    )


def _stated_table(file: CsvFile, x: str | None, y: str | None, *, where: str) -> CsvTable:
    """Return the table with the columns of coordinates that the catalogue names."""
    if not (x and y):
        raise CatalogError(
            f"{where} has only one of x_field and y_field in the catalogue; state both."
        )
    for separator, names in file.layouts.items():
        if x in names and y in names:
            return CsvTable(file, separator, x, y)
    names = file.layouts[file.separator]
    require_field(x, names, where=where, key="x_field")
    require_field(y, names, where=where, key="y_field")
    return CsvTable(file, file.separator, x, y)


def known_field(names: Sequence[str], fields: Sequence[str]) -> str | None:
    """Return the first field with one of the names, which are in lower case."""
    return next((field for field in fields if field.lower() in names), None)


def known_coordinates(fields: Sequence[str]) -> tuple[str | None, str | None]:
    """Return the first common pair of names for x and y among the fields, or two None."""
    for xs, ys in KNOWN_NAMES:
        x, y = known_field(xs, fields), known_field(ys, fields)
        if x and y:
            return x, y
    return None, None


def read_csv_layer(
    table: CsvTable, spec: LayerSpec, *, filters: bool, crs: str | None, where: str
) -> RawLayer:
    """Read the layer of a CSV file."""
    builder = LayerBuilder(spec, table.names, filters=filters, where=where)
    for row in table.rows():
        if isinstance(row, str):
            builder.rows.skip(row)
            continue
        try:
            place: Position | str = table.position(row)
        except BadFeatureError as error:
            place = str(error)
        builder.rows.add(row, str(builder.rows.read + 1), place)
    return builder.layer(table.crs, requested=crs, notes=table.file.notes)
