"""Write one layer to one file: GeoParquet, FlatGeobuf, GeoJSON, and CSV without formulas.

A spreadsheet executes a cell that begins with ``=``, ``+``, ``-``, ``@``, a tab or a line end as a
formula. A text from open data may begin so, or may contain such a part after a character that is
the column separator in another country. An apostrophe before that part prevents it.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import re
import sqlite3
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.compute as pc
import pyogrio
import shapely
from pyarrow import csv
from pyogrio.errors import DataLayerError, DataSourceError, FeatureError

from semsig_gis.core import GEOMETRY, InputError
from semsig_gis.output.layers.model import GEOMETRY_TYPES
from semsig_gis.storage import (
    BBOX,
    COVERING,
    bounds_column,
    geo_metadata,
    whole_file,
    write_geoparquet_blocks,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping
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


def write_geoparquet(layer: Layer, path: str | Path, *, progress: Progress = None) -> None:
    """Write a layer as one GeoParquet 1.1 file, atomically.

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


def write_flatgeobuf(layer: Layer, path: str | Path, *, progress: Progress = None) -> None:
    """Write a layer as one FlatGeobuf with a spatial index, atomically.

    Its metadata hold the specs, the classes and the licences as JSON, by name.
    """
    options = {"TITLE": layer.title, "DESCRIPTION": layer.abstract}
    metadata = layer.metadata_texts
    _write_features(
        layer, path, "FlatGeobuf", progress, layer_metadata=metadata, layer_options=options
    )


def write_geojson(layer: Layer, path: str | Path, *, progress: Progress = None) -> None:
    """Write a layer as one GeoJSON (RFC 7946), atomically.

    Coordinates are longitude and latitude (WGS 84) to a centimetre. The member ``semsig`` holds the
    specs, the classes and the licences.
    """
    options = geojson_options(layer.abstract, layer.metadata)
    _write_features(layer, path, "GeoJSON", progress, layer_options=options)


def geojson_options(description: str, metadata: Mapping[str, Any]) -> dict[str, str]:
    """Return options of GDAL for GeoJSON of RFC 7946 with metadata in the member ``semsig``."""
    native = {"type": "FeatureCollection", "semsig": metadata}
    return {
        "RFC7946": "YES",
        "DESCRIPTION": description,
        "NATIVE_DATA": json.dumps(native, allow_nan=False),
        "NATIVE_MEDIA_TYPE": "application/vnd.geo+json",
    }


def _write_features(
    layer: Layer,
    path: str | Path,
    driver: str,
    progress: Progress,
    **options: Any,  # noqa: ANN401 - as pyogrio has
) -> None:
    """Write a layer block by block with a driver of GDAL, then check the number of rows."""
    with whole_file(path) as partial, write_errors(path):
        pyogrio.write_arrow(
            feature_stream(layer, progress),
            partial,
            layer=layer.name,
            driver=driver,
            geometry_name=GEOMETRY,
            geometry_type=GEOMETRY_TYPES[layer.geometry],
            crs=layer.crs.to_wkt(),
            **options,
        )
        if pyogrio.read_info(partial, force_feature_count=True)["features"] != layer.rows:
            raise DataSourceError("some features are not in the file")


def feature_stream(
    layer: Layer, progress: Progress = None, *, without: Collection[str] = ()
) -> pa.RecordBatchReader:
    """Return the rows of a layer as a stream, without the columns in `without`."""
    blocks = (
        block.drop_columns([name for name in block.column_names if name in without])
        for block in layer.blocks(progress)
    )
    first = next(blocks)
    batches = (batch for block in itertools.chain([first], blocks) for batch in block.to_batches())
    return pa.RecordBatchReader.from_batches(first.schema, batches)


@contextlib.contextmanager
def write_errors(path: str | Path) -> Iterator[None]:
    """Convert errors of GDAL and SQLite while writing `path` into an `InputError`."""
    try:
        yield
    except (DataSourceError, DataLayerError, FeatureError, sqlite3.Error) as error:
        raise InputError(
            f"{path} could not be written whole, so what was there before is unchanged; free "
            "some space or choose another folder."
        ) from error
