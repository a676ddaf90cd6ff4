"""GeoParquet 1.1: one layer a file, with a column of bounds by which readers choose rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import shapely

from semsig_gis.core.crs import GEOMETRY
from semsig_gis.exports.layers import GEOMETRY_TYPES
from semsig_gis.storage.geoparquet import (
    BBOX,
    COVERING,
    bounds_column,
    geo_metadata,
    write_geoparquet_blocks,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    import pyarrow as pa

    from semsig_gis.exports.layers import Layer


def write_layer(
    layer: Layer, path: str | Path, *, progress: Callable[[int, int], None] | None = None
) -> None:
    """Write a layer as one GeoParquet 1.1 file, which appears whole, by rename.

    The column ``bbox`` holds the bounds of every row as float32, rounded outwards, and the metadata
    names it as the covering of ``geometry``. The metadata key ``semsig`` holds the specs, the
    classes and the licences as JSON. The rows are in groups of `GROUP_ROWS` and in
    the order of the database, column by column. ``progress`` is called with the rows written and in
    all.
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
