"""CSV: one layer a file, safe to open in a spreadsheet.

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

from semsig_gis.schema import GEOMETRY
from semsig_gis.storage import whole_file

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.exports._layers import Layer

__all__ = ["as_written", "formula_safe", "write_layer"]

# What may end a cell, and what may begin a formula; the wide signs of Chinese and Japanese
# keyboards count in some spreadsheets.
_END = '[;,|"\t\r\n]'
_BEGIN = "[=+\\-@'\t\r\n\uff1d\uff0b\uff0d\uff20]"
_RISK = re.compile(f"(?:^|(?<={_END}))(?={_BEGIN})")
_MARK = re.compile(f"(?:^|(?<={_END}))'")


def formula_safe(text: str) -> str:
    r"""Return text that no spreadsheet takes for a formula.

    Parameters
    ----------
    text : str
        Anything.

    Returns
    -------
    str
        The text with an apostrophe before each part that may be taken for a formula, and before
        each apostrophe at such a place; `as_written` takes them away.

    Examples
    --------
    >>> formula_safe("=cmd|'/C calc'!A0")
    "'=cmd|''/C calc'!A0"
    >>> formula_safe("Lime tree")
    'Lime tree'
    """
    return _RISK.sub("'", text)


def as_written(text: str) -> str:
    r"""Return the text that `formula_safe` made safe.

    Parameters
    ----------
    text : str
        What stands in a file.

    Returns
    -------
    str
        The text without the apostrophes at its beginning and after ``;``, ``,``, ``|``, ``"``,
        tabs and line ends.

    Examples
    --------
    >>> as_written(formula_safe("=1;'2"))
    "=1;'2"
    """
    return _MARK.sub("", text)


def write_layer(
    layer: Layer, path: str | Path, *, progress: Callable[[int, int], None] | None = None
) -> None:
    """Write a layer as one CSV file.

    Parameters
    ----------
    layer : Layer
        What to write.
    path : str or Path
        File to write; it appears whole, by rename.
    progress : callable, optional
        Called with the number of rows written and in all.

    Raises
    ------
    InputError
        If it cannot be written.

    Notes
    -----
    UTF-8 with commas; texts stand in quotes and are `formula_safe`, what is missing is empty.
    Numbers have all their digits. A point is ``x`` and ``y``, another geometry ``WKT``, in the
    CRS of the layer.
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
