"""GeoParquet: one layer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import shapely

from semsig_gis.core import GEOMETRY
from semsig_gis.output.files import writer
from semsig_gis.output.layers.model import GEOMETRY_TYPES
from semsig_gis.storage import (
    BBOX,
    COVERING,
    bounds_column,
    geo_metadata,
    write_geoparquet_blocks,
)

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import pyarrow as pa

    from semsig_gis.output.layers.model import Layer, Progress


@writer()
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
    specs = {**layer.metadata, "kind": f"{layer.title} export".lower()}

    def blocks() -> Iterator[pa.Table]:
        for block in layer.blocks(progress):
            shapes = shapely.from_wkb(block[GEOMETRY].to_numpy(zero_copy_only=False))
            yield block.append_column(BBOX, bounds_column(shapely.bounds(shapes)))

    write_geoparquet_blocks(blocks(), path, geo=geo, specs=specs)
