"""One layer a file: GeoParquet 1.1, and CSV that is safe to open in a spreadsheet.

Spreadsheets run a cell that begins with ``=``, ``+``, ``-``, ``@``, a tab or a line end as a
formula. A text from open data may begin so, or have such a part after a sign that the spreadsheet
of another country takes for the end of a cell. An apostrophe before it keeps it text.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.compute as pc
import shapely
from pyarrow import csv

from semsig_gis.core.geometry import GEOMETRY
from semsig_gis.exports.layers import GEOMETRY_TYPES
from semsig_gis.storage.geoparquet import (
    BBOX,
    COVERING,
    bounds_column,
    geo_metadata,
    write_geoparquet_blocks,
)
from semsig_gis.storage.whole import whole_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from semsig_gis.exports.layers import Layer


# What may end a cell, and what may begin a formula; the wide signs of Chinese and Japanese
# keyboards count in some spreadsheets.
_END = '[;,|"\t\r\n]'
_BEGIN = "[=+\\-@'\t\r\n\uff1d\uff0b\uff0d\uff20]"
_RISK = re.compile(f"(?:^|(?<={_END}))(?={_BEGIN})")
_MARK = re.compile(f"(?:^|(?<={_END}))'")


def formula_safe(text: str) -> str:
    """Return text that no spreadsheet takes for a formula, by apostrophes before risky parts.

    An apostrophe that stands at such a place already gets another one, so that `as_written` can
    undo it.
    """
    return _RISK.sub("'", text)


def as_written(text: str) -> str:
    """Return the text that `formula_safe` made safe, without its apostrophes."""
    return _MARK.sub("", text)


def write_csv(
    layer: Layer, path: str | Path, *, progress: Callable[[int, int], None] | None = None
) -> None:
    """Write a layer as one CSV file, which appears whole, by rename.

    UTF-8 with commas; texts stand in quotes and are `formula_safe`, what is missing is empty.
    Numbers have all their digits. A point is ``x`` and ``y``, another geometry ``WKT``, in the CRS
    of the layer.
    """
    with whole_file(path) as partial, partial.open("wb") as file:
        writer = None
        for block in layer.blocks(progress):
            table = _plain(block, layer.geometry)
            writer = writer or csv.CSVWriter(file, table.schema)
            writer.write_table(table)
        if writer is not None:
            writer.close()


def _plain(block: pa.Table, geometry: str) -> pa.Table:
    """Return a block without what CSV cannot hold."""
    shapes = shapely.from_wkb(block[GEOMETRY].to_numpy(zero_copy_only=False))
    columns = {
        name: _safe(block[name]) if pa.types.is_string(block[name].type) else block[name]
        for name in block.column_names
        if name != GEOMETRY
    }
    if geometry == "point":
        x, y = shapely.get_coordinates(shapes).T
        columns |= {"x": pa.array(x), "y": pa.array(y)}
    else:
        columns["WKT"] = pa.array(shapely.to_wkt(shapes, rounding_precision=-1), pa.string())
    return pa.table(columns)


def _safe(texts: pa.ChunkedArray) -> pa.ChunkedArray:
    if not pc.any(pc.match_substring_regex(texts, f"(^|{_END}){_BEGIN}")).as_py():
        return texts
    safe = [None if text is None else formula_safe(text) for text in texts.to_pylist()]
    return pa.chunked_array([pa.array(safe, pa.string())])


def write_geoparquet(
    layer: Layer, path: str | Path, *, progress: Callable[[int, int], None] | None = None
) -> None:
    """Write a layer as one GeoParquet 1.1 file, which appears whole, by rename.

    The column ``bbox`` holds the bounds of every row as float32, rounded outwards, the covering of
    ``geometry``. The metadata key ``semsig`` holds the specs, the classes and the licences as JSON.
    The rows are in the order of the database, column by column.
    """
    geo = geo_metadata(
        layer.crs, geometry_types=[GEOMETRY_TYPES[layer.geometry]], bounds=layer.bounds
    )
    geo["columns"][GEOMETRY]["covering"] = COVERING
    if not layer.rows:
        del geo["columns"][GEOMETRY]["bbox"]
    specs = {**layer.facts, "kind": f"{layer.title} export".lower(), **layer.credits}

    def blocks() -> Iterator[pa.Table]:
        for block in layer.blocks(progress):
            shapes = shapely.from_wkb(block[GEOMETRY].to_numpy(zero_copy_only=False))
            yield block.append_column(BBOX, bounds_column(shapely.bounds(shapes)))

    write_geoparquet_blocks(blocks(), path, geo=geo, specs=specs)
