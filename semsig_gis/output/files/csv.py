"""CSV: one layer, without formulas.

A spreadsheet executes a cell that begins with ``=``, ``+``, ``-``, ``@``, a tab or a line end as a
formula. A text from open data may begin so, or may contain such a part after a character that is
the column separator in another country. An apostrophe before that part prevents it.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.compute as pc
import shapely
from pyarrow import csv

from semsig_gis.core import GEOMETRY
from semsig_gis.output.files import writer
from semsig_gis.storage import whole_file

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.output.layers.model import Layer, Progress


# Characters that may end a cell, and that may begin a formula. Some spreadsheets accept the
# full-width signs of Chinese and Japanese keyboards.
_END = '[;,|"\t\r\n]'
_BEGIN = "[=+\\-@'\t\r\n\uff1d\uff0b\uff0d\uff20]"
_RISK = re.compile(f"(?:^|(?<={_END}))(?={_BEGIN})")
_MARK = re.compile(f"(?:^|(?<={_END}))'")


def formula_safe(text: str) -> str:
    """Return text that no spreadsheet takes for a formula; `as_written` reverses it.

    An apostrophe is inserted before each risky part, and before an apostrophe at such a place.
    """
    return _RISK.sub("'", text)


def as_written(text: str) -> str:
    """Return the original of a text that `formula_safe` returned."""
    return _MARK.sub("", text)


@writer(cells="point")
def write_csv(layer: Layer, path: str | Path, *, progress: Progress = None) -> None:
    """Write a layer as one CSV file, atomically.

    UTF-8 with commas. Texts are quoted and `formula_safe`, null is empty. A point is ``x`` and
    ``y``, another geometry is ``WKT``, in the CRS of the layer.
    """
    with whole_file(path) as partial, partial.open("wb") as file:
        writer = None
        for block in layer.blocks(progress):
            table = _csv_table(block, layer.geometry)
            writer = writer or csv.CSVWriter(file, table.schema)
            writer.write_table(table)
        if writer is not None:
            writer.close()


def _csv_table(block: pa.Table, geometry: str) -> pa.Table:
    """Return a block with safe texts, and coordinates or WKT in place of the geometry."""
    shapes = shapely.from_wkb(block[GEOMETRY].to_numpy(zero_copy_only=False))
    columns = {name: block[name] for name in block.column_names if name != GEOMETRY}
    for name, values in columns.items():
        risky = f"(^|{_END}){_BEGIN}"
        if pa.types.is_string(values.type) and (
            pc.any(pc.match_substring_regex(values, risky)).as_py()
        ):
            texts = [None if text is None else formula_safe(text) for text in values.to_pylist()]
            columns[name] = pa.chunked_array([pa.array(texts, pa.string())])
    if geometry == "point":
        x, y = shapely.get_coordinates(shapes).T
        columns |= {"x": pa.array(x), "y": pa.array(y)}
    else:
        columns["WKT"] = pa.array(shapely.to_wkt(shapes, rounding_precision=-1), pa.string())
    return pa.table(columns)
