"""PMTiles: vector tiles of the cells, single cells at high zooms, squares of cells at low."""

from __future__ import annotations

import contextlib
import html
import math
import sqlite3
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import shapely
from pmtiles.tile import Compression, TileType, zxy_to_tileid
from pmtiles.writer import Writer
from pyogrio.errors import DataSourceError
from pyproj import Transformer

from semsig_gis.core import GEOMETRY, InputError, to_degrees
from semsig_gis.output.features import write_errors, write_features
from semsig_gis.output.files import writer
from semsig_gis.storage import whole_file

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from semsig_gis.output.layers.model import Layer, Progress


OMITTED_COLUMNS = {"x", "y", "bearings", "levels", "distances"}
"""Columns of cells that tiles omit, because coordinates in tiles are rounded."""

TILE_PIXELS = 512
EQUATOR = 40_075_016.685578  # metres
CELL_PIXELS, CITY_PIXELS = 4, 64  # smallest width of a cell and of a city on the screen
LARGEST_ZOOM = 22
# No tile is truncated for its size; neighbours overlap by two pixels, so that no seam is visible.
OPTIONS = {"MAX_SIZE": "100000000", "MAX_FEATURES": "10000000", "BUFFER": "16"}


@writer(layers=("cells",), cells=None)
def write_pmtiles(cells: Layer, path: str | Path, *, progress: Progress = None) -> None:
    """Write the cells as one PMTiles 3 file of vector tiles, atomically.

    From the zoom at which a cell is 4 pixels wide, the layer ``cells`` holds every cell. At lower
    zooms, the layer ``squares`` holds squares of 2 by 2 cells, 4 by 4 and so on. The metadata hold
    the specs, the classes and the licences.
    """
    if cells.squares is None:
        raise InputError(
            f"{path} can contain only layers of cells, not {cells.name!r}; give another suffix."
        )
    bounds = to_degrees(cells.crs).transform_bounds(*cells.bounds)
    zooms = _zooms(cells, latitude=(bounds[1] + bounds[3]) / 2)
    fields: dict[str, dict[str, Any]] = {}
    west, south, east, north = (round(side * 1e7) for side in bounds)
    with whole_file(path) as partial, write_errors(path), _tile_writer(partial) as writer:
        for zoom in zooms:
            side = 1 << (zooms[-1] - zoom)  # of a square, in cells
            layer = cells if side == 1 else cells.squares(side)
            about = fields.setdefault(layer.name, {"id": layer.name, "minzoom": zoom})
            about |= {"maxzoom": zoom, "description": layer.description}
            for tile, content in _tiles(layer, zoom, partial.with_name("zoom.mbtiles")):
                writer.write_tile(tile, content)
            about["fields"] = {
                field.name: "String" if pa.types.is_string(field.type) else "Number"
                for field in layer.read(slice(0, 1)).schema
                if field.name not in {GEOMETRY, *OMITTED_COLUMNS}
            }
            if progress is not None:
                progress(zoom - zooms[0] + 1, len(zooms))
        writer.finalize(
            {
                "tile_type": TileType.MVT,
                "tile_compression": Compression.GZIP,
                "min_lon_e7": west,
                "min_lat_e7": south,
                "max_lon_e7": east,
                "max_lat_e7": north,
                "center_lon_e7": (west + east) // 2,
                "center_lat_e7": (south + north) // 2,
                "center_zoom": zooms[0],
            },
            {
                "name": cells.title,
                "description": cells.description,
                # Map libraries show the attribution as HTML.
                "attribution": "<br>".join(map(html.escape, cells.licenses)),
                "type": "overlay",
                "vector_layers": list(fields.values()),
                "semsig": cells.metadata,
            },
        )


@contextlib.contextmanager
def _tile_writer(path: Path) -> Iterator[Writer]:
    """Yield a writer of tiles, then close its temporary file, which the library leaves open."""
    with path.open("wb") as file:
        writer = Writer(file)
        try:
            yield writer
        finally:
            with contextlib.suppress(OSError):  # the block has already raised the error
                writer.tile_f.close()


def _zooms(cells: Layer, *, latitude: float) -> range:
    """Return the zooms from the first that shows the city to the first that shows each cell."""
    metres = EQUATOR * math.cos(math.radians(latitude)) / TILE_PIXELS  # of a pixel at zoom 0
    west, south, east, north = cells.bounds
    last = math.ceil(math.log2(metres * CELL_PIXELS / cells.cell_size))
    first = math.floor(math.log2(metres * CITY_PIXELS / max(east - west, north - south)))
    last = min(max(last, 0), LARGEST_ZOOM)
    return range(min(max(first, 0), last), last + 1)


def _tiles(layer: Layer, zoom: int, scratch: Path) -> Iterator[tuple[int, bytes]]:
    """Yield the id and the content of each tile of a zoom, in order of the ids."""
    options = {**OPTIONS, "MINZOOM": str(zoom), "MAXZOOM": str(zoom)}
    write_features(layer, scratch, "MBTiles", without=OMITTED_COLUMNS, dataset_options=options)
    with contextlib.closing(sqlite3.connect(scratch)) as tiles:
        # MBTiles count rows from the south, PMTiles from the north.
        north, query = (1 << zoom) - 1, "SELECT tile_column, tile_row FROM tiles"
        places = {zxy_to_tileid(zoom, x, north - y): (x, y) for x, y in tiles.execute(query)}
        # GDAL reports no error if the disk is full while it writes them.
        if not _expected(layer, zoom) <= places.keys():
            raise DataSourceError("some tiles are not in the file")
        query = "SELECT tile_data FROM tiles WHERE tile_column = ? AND tile_row = ?"
        for number, place in sorted(places.items()):
            yield number, tiles.execute(query, place).fetchone()[0]
    scratch.unlink()


def _expected(layer: Layer, zoom: int) -> set[int]:
    """Return the ids of the tiles that have the centre of a row."""
    to_map, side = Transformer.from_crs(layer.crs, "EPSG:3857", always_xy=True), 1 << zoom
    ids: set[int] = set()
    for block in layer.blocks():
        centres = shapely.get_coordinates(shapely.centroid(shapely.from_wkb(block[GEOMETRY])))
        x, y = to_map.transform(*centres.T)
        columns, rows = (np.array([x, -y]) / EQUATOR + 0.5) * side
        tiles = np.unique(np.floor(np.stack([columns, rows], axis=1)).astype(np.int64), axis=0)
        ids.update(zxy_to_tileid(zoom, *tile) for tile in tiles.tolist())
    return ids
