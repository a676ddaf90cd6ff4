"""PMTiles: the cells as vector tiles, each at high zooms and squares of them at low ones."""

from __future__ import annotations

import contextlib
import html
import math
import sqlite3
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyogrio
import shapely
from pmtiles.tile import Compression, TileType, zxy_to_tileid
from pmtiles.writer import Writer

from semsig_gis.core import GEOMETRY, to_degrees
from semsig_gis.exports.files import feature_stream, whole_by_gdal
from semsig_gis.exports.hexagons import summary
from semsig_gis.exports.layers import cells_layer, table_layer
from semsig_gis.storage import whole_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Identifiability
    from semsig_gis.exports.layers import Layer


CELLS, SQUARES = "cells", "squares"
LEFT_OUT = {"x", "y", "bearings", "levels", "distances"}
"""What a tile, whose places are rounded, does not tell of a cell."""

TILE_PIXELS = 512
EQUATOR = 40_075_016.7  # metres
CELL_PIXELS, CITY_PIXELS = 4, 64  # the least that a cell and a city are drawn with
FINEST = 22
# Tiles are whole however much is in them; neighbours overlap by two pixels, lest a seam shows.
OPTIONS = {"MAX_SIZE": "100000000", "MAX_FEATURES": "10000000", "BUFFER": "16"}


def write_pmtiles(
    database: SignatureDatabase,
    path: str | Path,
    *,
    identifiability: Identifiability | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write the cells as one PMTiles 3 of vector tiles, which appears whole, by rename.

    From the zoom at which a cell is 4 pixels wide, the layer ``cells`` holds each; farther out, the
    layer ``squares`` holds those of 2 by 2 cells, 4 by 4 and so on (see `areas.summary`). The
    metadata hold the specs, the classes and the licences.
    """
    cells = cells_layer(database, identifiability=identifiability)
    bounds = to_degrees(cells.crs).transform_bounds(*cells.bounds)
    zooms = _zooms(cells, database.grid.step, latitude=(bounds[1] + bounds[3]) / 2)
    fields: dict[str, dict[str, Any]] = {}
    with whole_file(path) as partial, whole_by_gdal(path), _writer(partial) as writer:
        for zoom in zooms:
            wide = 1 << (zooms[-1] - zoom)
            layer = cells if wide == 1 else _squares(database, wide, identifiability)
            known = fields.setdefault(layer.name, {"id": layer.name, "minzoom": zoom})
            known |= {"maxzoom": zoom, "description": layer.description}
            for tile, content in _tiles(layer, zoom, partial.with_name("zoom.mbtiles")):
                writer.write_tile(tile, content)
            known["fields"] = _fields(layer)
            if progress is not None:
                progress(zoom - zooms[0] + 1, len(zooms))
        writer.finalize(
            _header(bounds, zooms[0]),
            {
                "name": cells.title,
                "description": cells.description,
                # Pages show it as HTML.
                "attribution": "<br>".join(map(html.escape, cells.licenses)),
                "type": "overlay",
                "vector_layers": list(fields.values()),
                "semsig": {**cells.facts, **cells.credits},
            },
        )


@contextlib.contextmanager
def _writer(path: Path) -> Iterator[Writer]:
    """Give what writes tiles to a file, and close its temporary file, which it leaves open."""
    with path.open("wb") as file:
        writer = Writer(file)
        try:
            yield writer
        finally:
            with contextlib.suppress(OSError):  # which was raised by what came before
                writer.tile_f.close()


def _zooms(cells: Layer, step: float, *, latitude: float) -> range:
    """Return the zooms from which the city is seen to that at which each of its cells is."""
    metres = EQUATOR * math.cos(math.radians(latitude)) / TILE_PIXELS  # of a pixel at zoom 0
    west, south, east, north = cells.bounds
    last = math.ceil(math.log2(metres * CELL_PIXELS / step))
    first = math.floor(math.log2(metres * CITY_PIXELS / max(east - west, north - south)))
    last = min(max(last, 0), FINEST)
    return range(min(max(first, 0), last), last + 1)


def _squares(
    database: SignatureDatabase, wide: int, identifiability: Identifiability | None
) -> Layer:
    """Return the squares of so many cells a side that hold a cell."""
    at, areas = np.unique(
        np.stack([database.columns // wide, database.rows // wide], axis=1),
        axis=0,
        return_inverse=True,
    )
    low = database.grid.origin + at * (database.grid.step * wide)
    high = low + database.grid.step * wide
    columns = summary(database, areas.ravel(), len(at), identifiability=identifiability)
    return table_layer(
        gpd.GeoDataFrame(columns, geometry=shapely.box(*low.T, *high.T), crs=database.crs),
        name=SQUARES,
        title="Squares of cells",
        description="The cells in each square, together.",
        geometry="polygon",
        licenses=(),
        facts={},
        styles=(),
    )


def _tiles(layer: Layer, zoom: int, scratch: Path) -> Iterator[tuple[int, bytes]]:
    """Yield the number and the content of each tile of a zoom, by number."""
    pyogrio.write_arrow(
        feature_stream(layer, without=LEFT_OUT),
        scratch,
        layer=layer.name,
        driver="MBTiles",
        geometry_name=GEOMETRY,
        geometry_type="Polygon",
        crs=layer.crs.to_wkt(),
        dataset_options={**OPTIONS, "MINZOOM": str(zoom), "MAXZOOM": str(zoom)},
    )
    with contextlib.closing(sqlite3.connect(scratch)) as tiles:
        # From the south, in these files alone.
        north, query = (1 << zoom) - 1, "SELECT tile_column, tile_row FROM tiles"
        places = {zxy_to_tileid(zoom, x, north - y): (x, y) for x, y in tiles.execute(query)}
        query = "SELECT tile_data FROM tiles WHERE tile_column = ? AND tile_row = ?"
        for number, place in sorted(places.items()):
            yield number, tiles.execute(query, place).fetchone()[0]
    scratch.unlink()


def _fields(layer: Layer) -> dict[str, str]:
    """Return the kind of each column in the tiles of a layer."""
    schema = layer.read(slice(0, 1)).schema
    names = [name for name in schema.names if name not in {GEOMETRY, *LEFT_OUT}]
    return {
        name: "String" if pa.types.is_string(schema.field(name).type) else "Number"
        for name in names
    }


def _header(bounds: tuple[float, float, float, float], zoom: int) -> dict[str, Any]:
    """Return where the tiles are, and where to look first."""
    west, south, east, north = (round(side * 1e7) for side in bounds)
    return {
        "tile_type": TileType.MVT,
        "tile_compression": Compression.GZIP,
        "min_lon_e7": west,
        "min_lat_e7": south,
        "max_lon_e7": east,
        "max_lat_e7": north,
        "center_lon_e7": (west + east) // 2,
        "center_lat_e7": (south + north) // 2,
        "center_zoom": zoom,
    }
