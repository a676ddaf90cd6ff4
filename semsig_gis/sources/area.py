"""Areas of the Earth, and the tiles in which they are requested."""

from __future__ import annotations

import collections
import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import shapely

from semsig_gis.core import HALF_TURN, InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

MOST_TILES = 10_000
QUARTER_TURN = 90.0  # degrees of latitude


@dataclass(frozen=True, eq=False)
class Area:
    """An area of the Earth: its outline in EPSG:4326, longitude first, and a name to show."""

    polygon: shapely.Polygon | shapely.MultiPolygon
    name: str

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """West, south, east and north in degrees."""
        west, south, east, north = self.polygon.bounds
        return west, south, east, north

    @property
    def exchanged(self) -> Area | None:
        """The area with latitude and longitude exchanged; None if that is not on the Earth."""
        polygon = shapely.transform(self.polygon, lambda xy: xy[:, ::-1])
        _, south, _, north = polygon.bounds
        return Area(polygon, self.name) if max(-south, north) <= QUARTER_TURN else None

    @property
    def boxes(self) -> tuple[tuple[float, float, float, float], ...]:
        """The bounds, or two boxes for an area that crosses 180 degrees of longitude."""
        west, _, east, _ = self.bounds
        parts = shapely.get_parts(self.polygon)
        eastern = shapely.get_x(shapely.centroid(parts)) > 0
        if east - west <= HALF_TURN or eastern.all() or not eastern.any():
            return (self.bounds,)
        sides = (shapely.total_bounds(parts[side]).tolist() for side in (eastern, ~eastern))
        return tuple((west, south, east, north) for west, south, east, north in sides)


@dataclass(frozen=True, slots=True)
class Tile:
    """A box of an area that is requested in parts, and how often it was split."""

    bounds: tuple[float, float, float, float]
    splits: int = 0

    def parts(self, columns: int, rows: int, *, splits: int) -> Iterator[Tile]:
        """Yield a grid of tiles over this one, from the south-west."""
        west, south, east, north = self.bounds
        xs = [west + (east - west) * i / columns for i in range(columns + 1)]
        ys = [south + (north - south) * i / rows for i in range(rows + 1)]
        for y_min, y_max in itertools.pairwise(ys):
            for x_min, x_max in itertools.pairwise(xs):
                yield Tile((x_min, y_min, x_max, y_max), splits)

    def quarters(self, area: Area) -> list[Tile]:
        """Return the quarters of the tile that touch an area."""
        return _touching(area, self.parts(2, 2, splits=self.splits + 1))


def tiles_of(area: Area, tile_deg: float, *, remedy: str) -> list[Tile]:
    """Return the tiles of at most `tile_deg` degrees that touch an area.

    InputError if there are too many; `remedy` is the advice in its message.
    """
    if not tile_deg > 0:
        raise InputError(f"tile_deg is {tile_deg}; give degrees above 0.")
    shapely.prepare(area.polygon)
    tiles: list[Tile] = []
    for west, south, east, north in area.boxes:
        columns, rows = (math.ceil(side / tile_deg - 1e-9) for side in (east - west, north - south))
        if columns * rows > MOST_TILES:
            raise InputError(
                f"the area takes {columns * rows:,} requests, and at most {MOST_TILES:,} are sent; "
                f"{remedy}."
            )
        grid = Tile((west, south, east, north)).parts(max(1, columns), max(1, rows), splits=0)
        tiles.extend(_touching(area, grid))
    return tiles


def fetch_tiles(
    tiles: Iterable[Tile],
    area: Area,
    fetch_tile: Callable[[Tile], Path | None],
    progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Return the files of tiles; a tile without a file, because it is too large, is split."""
    waiting = collections.deque(tiles)
    paths: list[Path] = []
    while waiting:
        tile = waiting.popleft()
        path = fetch_tile(tile)
        if path is None:
            waiting.extendleft(reversed(tile.quarters(area)))
            continue
        paths.append(path)
        if progress is not None:
            progress(len(paths), len(paths) + len(waiting))
    return paths


def _touching(area: Area, tiles: Iterable[Tile]) -> list[Tile]:
    return [tile for tile in tiles if area.polygon.intersects(shapely.box(*tile.bounds))]


def exchanged_error(area: Area) -> InputError:
    """Return the error for an area that would be right with latitude and longitude exchanged."""
    south, west, north, east = area.bounds
    return InputError(
        f"the area {area.name} is somewhere else, but it would be right with latitude and "
        "longitude exchanged; write west,south,east,north, which is "
        f"{west:.10g},{south:.10g},{east:.10g},{north:.10g}."
    )


def join_areas(geometry: NDArray[np.object_]) -> shapely.Polygon | shapely.MultiPolygon | None:
    """Return the valid union of the areas of geometries, or None if they have no area."""
    parts = shapely.get_parts(shapely.make_valid(geometry))
    polygons = shapely.get_parts(parts[shapely.get_dimensions(parts) == 2])  # noqa: PLR2004
    joined = shapely.union_all(polygons)
    return joined if isinstance(joined, shapely.Polygon | shapely.MultiPolygon) else None
