"""Write a layer with a driver of GDAL, block by block."""

from __future__ import annotations

import contextlib
import itertools
import json
import sqlite3
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyogrio
from pyogrio._err import CPLE_BaseError  # of GDAL, where pyogrio passes it on
from pyogrio.errors import DataLayerError, DataSourceError, FeatureError

from semsig_gis.core import GEOMETRY, InputError, epsg_code
from semsig_gis.output.layers.model import GEOMETRY_TYPES
from semsig_gis.storage import whole_file

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping
    from pathlib import Path

    from semsig_gis.output.layers.model import Layer, Progress


def write_file(
    layer: Layer,
    path: str | Path,
    driver: str,
    progress: Progress,
    **options: Any,  # noqa: ANN401 - as pyogrio has
) -> None:
    """Write a layer as one file, atomically, with a driver of GDAL."""
    with whole_file(path) as partial, write_errors(path):
        write_features(layer, partial, driver, progress, **options)
        if pyogrio.read_info(partial, force_feature_count=True)["features"] != layer.rows:
            raise DataSourceError("some features are not in the file")


def write_features(
    layer: Layer,
    path: Path,
    driver: str,
    progress: Progress = None,
    *,
    without: Collection[str] = (),
    **options: Any,  # noqa: ANN401 - as pyogrio has
) -> None:
    """Write the rows of a layer with a driver of GDAL, without the columns in `without`."""
    blocks = (
        block.drop_columns([name for name in block.column_names if name in without])
        for block in layer.blocks(progress)
    )
    first = next(blocks)
    errors: list[BaseException] = []

    def batches() -> Iterator[pa.RecordBatch]:
        try:
            for block in itertools.chain([first], blocks):
                yield from block.to_batches()
        except BaseException as error:
            errors.append(error)
            raise

    code = epsg_code(layer.crs)
    geometry = {
        "geometry_name": GEOMETRY,
        "geometry_type": GEOMETRY_TYPES.get(layer.geometry),
        "crs": layer.crs.to_wkt() if code is None else f"EPSG:{code}",
    }
    try:
        pyogrio.write_arrow(
            pa.RecordBatchReader.from_batches(first.schema, batches()),
            path,
            layer=layer.name,
            driver=driver,
            **(geometry if layer.geometry in GEOMETRY_TYPES else {}),
            **options,
        )
    except (RuntimeError, CPLE_BaseError) as error:
        # pyogrio raises this in place of an error of the stream, such as an interruption.
        if errors:
            raise errors[0] from None
        raise DataSourceError(str(error)) from error


def geojson_options(description: str, metadata: Mapping[str, Any]) -> dict[str, str]:
    """Return options of GDAL for GeoJSON of RFC 7946 with metadata in the member ``semsig``."""
    native = {"type": "FeatureCollection", "semsig": metadata}
    return {
        "RFC7946": "YES",
        "DESCRIPTION": description,
        "NATIVE_DATA": json.dumps(native, allow_nan=False),
        "NATIVE_MEDIA_TYPE": "application/vnd.geo+json",
    }


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
