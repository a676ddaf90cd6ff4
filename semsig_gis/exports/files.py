"""One layer a file: GeoParquet, FlatGeobuf, GeoJSON, GeoTIFF, and CSV safe in a spreadsheet.

Spreadsheets run a cell that begins with ``=``, ``+``, ``-``, ``@``, a tab or a line end as a
formula. A text from open data may begin so, or have such a part after a sign that the spreadsheet
of another country takes for the end of a cell. An apostrophe before it keeps it text.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import re
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.compute as pc
import pyogrio
import shapely
from pyarrow import csv
from pyogrio.errors import DataLayerError, DataSourceError, FeatureError

from semsig_gis.core import GEOMETRY, InputError
from semsig_gis.exports.layers import GEOMETRY_TYPES
from semsig_gis.storage import (
    BBOX,
    COVERING,
    bounds_column,
    geo_metadata,
    whole_file,
    write_geoparquet_blocks,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping
    from pathlib import Path

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


def write_flatgeobuf(
    layer: Layer, path: str | Path, *, progress: Callable[[int, int], None] | None = None
) -> None:
    """Write a layer as one FlatGeobuf with a spatial index, which appears whole, by rename.

    Its metadata hold the specs, the classes and the licences as JSON, by name.
    """
    notes = {
        name: json.dumps(value, allow_nan=False)
        for name, value in {**layer.facts, **layer.credits}.items()
    }
    options = {"TITLE": layer.title, "DESCRIPTION": _described(layer)}
    _write_features(
        layer, path, "FlatGeobuf", progress, layer_metadata=notes, layer_options=options
    )


def write_geojson(
    layer: Layer, path: str | Path, *, progress: Callable[[int, int], None] | None = None
) -> None:
    """Write a layer as one GeoJSON of RFC 7946, which appears whole, by rename.

    Coordinates are longitude and latitude (WGS 84) to a centimetre. The member ``semsig`` holds the
    specs, the classes and the licences.
    """
    options = geojson_options(_described(layer), {**layer.facts, **layer.credits})
    _write_features(layer, path, "GeoJSON", progress, layer_options=options)


def geojson_options(description: str, about: Mapping[str, Any]) -> dict[str, str]:
    """Return with which options GDAL writes GeoJSON of RFC 7946 that tells what it is."""
    native = {"type": "FeatureCollection", "semsig": about}
    return {
        "RFC7946": "YES",
        "DESCRIPTION": description,
        "NATIVE_DATA": json.dumps(native, allow_nan=False),
        "NATIVE_MEDIA_TYPE": "application/vnd.geo+json",
    }


def _described(layer: Layer) -> str:
    return "\n".join([layer.description, *layer.licenses])


def _write_features(
    layer: Layer,
    path: str | Path,
    driver: str,
    progress: Callable[[int, int], None] | None,
    **options: Any,  # noqa: ANN401 - as pyogrio has
) -> None:
    """Write a layer block by block by one of GDAL's drivers, whole."""
    with whole_file(path) as partial, whole_by_gdal(path):
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
    layer: Layer,
    progress: Callable[[int, int], None] | None = None,
    *,
    without: Collection[str] = (),
) -> pa.RecordBatchReader:
    """Return the rows of a layer as a stream, without some of the columns."""
    blocks = (
        block.drop_columns([name for name in block.column_names if name in without])
        for block in layer.blocks(progress)
    )
    first = next(blocks)
    every = itertools.chain([first], blocks)
    batches = (batch for block in every for batch in block.to_batches())
    return pa.RecordBatchReader.from_batches(first.schema, batches)


@contextlib.contextmanager
def whole_by_gdal(path: str | Path) -> Iterator[None]:
    """Tell in one sentence of a file that GDAL could not write; its own words are the cause."""
    try:
        yield
    except (DataSourceError, DataLayerError, FeatureError) as error:
        raise InputError(
            f"{path} could not be written whole, so what was there before is unchanged; free "
            "some space or choose another folder."
        ) from error
