"""Layers of CSV files: the columns of positions, and the rows."""

from __future__ import annotations

import contextlib
import itertools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from semsig_gis.core import SourceError
from semsig_gis.sources.csv_file import open_csv
from semsig_gis.sources.positions import (
    SAMPLE_ROWS,
    PlaceReader,
    find_positions,
    no_positions,
    stated_fields,
    uncertain_positions,
)
from semsig_gis.sources.rows import BadFeatureError, LayerBuilder

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from typing import IO

    from semsig_gis.sources.csv_file import CsvFile
    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import LayerSpec
    from semsig_gis.sources.rows import Position

    Row = Mapping[str, str | None]

NO_GEOMETRY = "None"  # the geometry type of GDAL for a table without geometry


@dataclass(frozen=True, slots=True)
class CsvTable:
    """A CSV file, its separator, and the reader of its positions, if it has some."""

    file: CsvFile
    separator: str
    places: PlaceReader | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return self.file.layouts[self.separator]

    def survey(self) -> tuple[int, str]:
        """Read all rows; return their number and their geometry type in the terms of GDAL."""
        number, kinds = 0, set()
        for row in self.rows():
            number += 1
            if isinstance(row, str) or self.places is None or self.places.fields.field is None:
                continue
            with contextlib.suppress(BadFeatureError):
                position = self.places.read(row)
                kinds |= set() if position is None else {getattr(position, "geom_type", "Point")}
        if self.places is None:
            return number, NO_GEOMETRY
        if self.places.fields.field is None:
            return number, "Point"
        return number, min(kinds) if len(kinds) == 1 else "Unknown"

    def rows(self) -> Iterator[Row | str]:
        """Yield every row as values by column name, or the text of its error."""
        return self.file.rows(self.separator)


def csv_table(
    open_: Callable[[], IO[bytes]], spec: LayerSpec | None, *, what: str, where: str
) -> CsvTable:
    """Find the columns of positions in a CSV file.

    SourceError if `spec` is given and there are none.
    """
    file = open_csv(open_, what, encoding=spec.encoding if spec else None)
    if spec is not None:
        stated = (spec.x_field, spec.y_field, spec.geometry_field)
        own = {name for name in stated if name}
        fitting = (mark for mark, names in file.layouts.items() if own <= {*names})
        separator = next(fitting, file.separator)
        if (fields := stated_fields(spec, file.layouts[separator], where=where)) is not None:
            fields = replace(fields, english=separator == ",")
            return CsvTable(file, separator, PlaceReader(fields, what))
    for separator, names in file.layouts.items():
        readable = (row for row in file.rows(separator) if not isinstance(row, str))
        place_fields = find_positions(
            names,
            [*itertools.islice(readable, SAMPLE_ROWS)],
            subject=Path(what).stem,
            english=separator == ",",
        )
        if place_fields is not None:
            if spec is not None and not place_fields.sure:
                raise SourceError(f"{where} {uncertain_positions(place_fields)}.")
            return CsvTable(file, separator, PlaceReader(place_fields, what))
    if spec is None:
        return CsvTable(file, file.separator)
    raise SourceError(f"{where} {no_positions(file.layouts[file.separator])}.")


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
            place: Position | str = table.places.read(row) if table.places else None
        except BadFeatureError as error:
            place = str(error)
        builder.rows.add(row, str(builder.rows.read + 1), place)
    own = table.places.crs if table.places else None
    questions = table.places.fields.questions if table.places else ()
    return builder.layer(own, requested=crs, notes=(*table.file.notes, *questions))
