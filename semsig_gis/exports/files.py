"""One layer a file: GeoParquet, GeoTIFF, GeoJSON, KML, and CSV that is safe in a spreadsheet.

Spreadsheets run a cell that begins with ``=``, ``+``, ``-``, ``@``, a tab or a line end as a
formula. A text from open data may begin so, or have such a part after a sign that the spreadsheet
of another country takes for the end of a cell. An apostrophe before it keeps it text.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import shapely
from pyarrow import csv

from semsig_gis.core.errors import InputError
from semsig_gis.core.geometry import GEOMETRY
from semsig_gis.exports.layers import GEOMETRY_TYPES
from semsig_gis.exports.styles import by_failures
from semsig_gis.storage.geoparquet import (
    BBOX,
    COVERING,
    bounds_column,
    geo_metadata,
    write_geoparquet_blocks,
)
from semsig_gis.storage.raster import write_cells
from semsig_gis.storage.whole import whole_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    import geopandas as gpd
    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.evaluation.field import ErrorField
    from semsig_gis.evaluation.result import Evaluation
    from semsig_gis.exports.layers import Layer


# What may end a cell, and what may begin a formula; the wide signs of Chinese and Japanese
# keyboards count in some spreadsheets.
_END = '[;,|"\t\r\n]'
_BEGIN = "[=+\\-@'\t\r\n\uff1d\uff0b\uff0d\uff20]"
_RISK = re.compile(f"(?:^|(?<={_END}))(?={_BEGIN})")
_MARK = re.compile(f"(?:^|(?<={_END}))'")


def formula_safe(text: str) -> str:
    """Return text that no spreadsheet takes for a formula; `as_written` undoes it.

    An apostrophe is put before risky parts, and before apostrophes that stand at such places.
    """
    return _RISK.sub("'", text)


def as_written(text: str) -> str:
    """Return the text that `formula_safe` made safe, without its apostrophes."""
    return _MARK.sub("", text)


def write_csv(
    layer: Layer, path: str | Path, *, progress: Callable[[int, int], None] | None = None
) -> None:
    """Write a layer as one CSV file, which appears whole, by rename.

    UTF-8 with commas; texts stand in quotes and are `formula_safe`, what is missing is empty. A
    point is ``x`` and ``y``, another geometry ``WKT``, in the CRS of the layer.
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

    The column ``bbox`` holds the bounds of every row as float32, rounded outwards. The metadata key
    ``semsig`` holds the specs, the classes and the licences as JSON.
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


def write_degrees(tables: Mapping[str, gpd.GeoDataFrame], path: str | Path) -> None:
    """Write the rows of several tables, which have a rank first, as one GeoJSON or KML file.

    Coordinates are longitude and latitude (WGS 84); ``layer`` names the table of a row, and
    ``Name`` says it with the rank. The file appears whole, by rename.
    """
    parts = [
        table.assign(Name=[f"{name} {rank}" for rank in table.iloc[:, 0]], layer=name)
        for name, table in tables.items()
    ]
    joined = pd.concat([part.to_crs("EPSG:4326") for part in parts], ignore_index=True)
    driver = "KML" if str(path).lower().endswith(".kml") else "GeoJSON"
    options = {} if driver == "KML" else {"RFC7946": "YES"}
    with whole_file(path) as partial:
        joined.to_file(partial, driver=driver, engine="pyogrio", **options)


def export_geotiff(
    database: SignatureDatabase,
    values: ArrayLike,
    path: str | Path,
    *,
    name: str,
    unit: str = "",
    facts: Mapping[str, Any] | None = None,
) -> None:
    """Write one number a cell as a Cloud-Optimised GeoTIFF.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    values : array_like of float, shape (n,)
        Numbers such as ``database.type_group_sizes`` or ``identifiability.found``; NaN where there
        is none.
    path : str or Path
        File to write; it appears whole, by rename.
    name : str
        What the numbers are.
    unit : str, optional
        Their unit.
    facts : mapping of str, optional
        Plain values on the numbers, which go to the tags of the file as JSON.

    Raises
    ------
    InputError
        If there is not one number a cell, the cells span too wide an area, or the file cannot be
        written.

    Notes
    -----
    A pixel is a cell of the grid of the database, in its CRS, as float32; NaN is no data. The
    overviews hold means, so that it is read fast from afar.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/objects.tif"
    ...     export_geotiff(demo_database, demo_database.lengths, path, name="objects seen")
    """
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.shape != (len(database),):
        msg = f"{numbers.size} numbers were given for {len(database)} cells; give one a cell."
        raise InputError(msg)
    write_cells(
        path,
        {name: (numbers, unit)},
        grid=database.grid,
        columns=database.columns,
        rows=database.rows,
        crs=database.crs,
        notes=_notes(database, facts or {}),
    )


def _notes(database: SignatureDatabase, facts: Mapping[str, Any]) -> dict[str, str]:
    return {
        "licenses": "\n".join(database.licenses),
        "semsig_version": database.version,
        **{key: json.dumps(value) for key, value in facts.items()},
    }


def export_field(field: ErrorField, database: SignatureDatabase, path: str | Path) -> None:
    """Write an error field as a GeoTIFF of three bands; NaN where no query is near.

    ``failed`` is the share of the queries around a pixel that failed, ``error`` their mean error in
    metres, and ``queries`` how many speak; the radius is in the tags. A file beside it, ``.qml``,
    has QGIS draw it as on the map.
    """
    columns, rows = np.nonzero(np.isfinite(field.failed.T))
    unit = {"failed": "", "error": "m", "queries": "queries"}
    bands = zip(unit, (field.failed, field.errors, field.speaking), strict=True)
    write_cells(
        path,
        {name: (values[rows, columns], unit[name]) for name, values in bands},
        grid=field.grid,
        columns=columns.astype(np.int32),
        rows=rows.astype(np.int32),
        crs=database.crs,
        notes=_notes(database, {"radius_m": field.radius}),
    )
    with whole_file(Path(path).with_suffix(".qml")) as partial:
        partial.write_text(by_failures(), encoding="utf-8")


def cell_errors(evaluation: Evaluation, database: SignatureDatabase) -> NDArray[np.float64]:
    """Return the mean expected error in metres of the queries from each cell (float64, n).

    NaN where no query is from; queries of which the distortion left nothing do not count. Raises
    `InputError` if another database was searched.
    """
    errors = evaluation.queries["error_m"].to_numpy(np.float64)
    rows = evaluation.rows_in(database)
    kept = np.isfinite(errors) & (rows >= 0)
    counts = np.bincount(rows[kept], minlength=len(database))
    sums = np.bincount(rows[kept], errors[kept], minlength=len(database))
    means = np.full(len(database), np.nan)
    np.divide(sums, counts, out=means, where=counts > 0)
    return means
