"""Areas of the Earth, and the tiles in which they are requested."""

from __future__ import annotations

import collections
import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import shapely
from pyproj import Geod

from semsig_gis.core import HALF_TURN, InputError, nearest_town

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from semsig_gis.core import Bounds

MOST_TILES = 10_000
QUARTER_TURN = 90.0  # degrees of latitude
# The longest side of a box of a city; numbers in another order make one that is wide both ways.
CITY_DEGREES, WIDE_DEGREES = 2.0, 10.0
SIMILAR = 4.0  # ratio of areas of boxes that may both be meant
EXCHANGED = "with latitude and longitude exchanged"


@dataclass(frozen=True, eq=False)
class Area:
    """An area of the Earth: its outline in EPSG:4326, longitude first, and a name to show.

    `numbers` are the four that a user gave, if any.
    """

    polygon: shapely.Polygon | shapely.MultiPolygon
    name: str
    numbers: tuple[float, ...] = ()

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """West, south, east and north in degrees."""
        west, south, east, north = self.polygon.bounds
        return west, south, east, north

    @property
    def others(self) -> Iterator[tuple[str, Area]]:
        """What else the user may have meant, with the words for it."""
        if self.numbers:
            for words, box in other_orders(self.numbers):
                if words == EXCHANGED or max(sides_of(box)) < WIDE_DEGREES:
                    yield words, Area(shapely.box(*box), self.name)
            return
        polygon = shapely.transform(self.polygon, lambda xy: xy[:, ::-1])
        _, south, _, north = polygon.bounds
        if max(-south, north) <= QUARTER_TURN:
            yield EXCHANGED, Area(polygon, self.name)

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


def other_orders(numbers: Sequence[float]) -> Iterator[tuple[str, Bounds]]:
    """Yield the boxes that four numbers are in other orders than west, south, east, north.

    Each is west, south, east and north, with words for the order. The two corners may be any.
    """
    a, b, c, d = numbers
    boxes = {(a, b, c, d)}
    for words, xs, ys in (
        (EXCHANGED, (b, d), (a, c)),
        ("with its sides in order", (a, c), (b, d)),
        ("read as south,north,west,east", (c, d), (a, b)),
        ("read as west,east,south,north", (a, b), (c, d)),
    ):
        box = (min(xs), min(ys), max(xs), max(ys))
        west, south, east, north = box
        on_earth = max(-west, east) <= HALF_TURN and max(-south, north) <= QUARTER_TURN
        if on_earth and west < east and south < north and box not in boxes:
            boxes.add(box)
            yield words, box


def sides_of(box: Bounds) -> tuple[float, float]:
    """Return the width and the height of a box."""
    west, south, east, north = box
    return east - west, north - south


def advice(orders: Iterable[tuple[str, Bounds]]) -> str:
    """Return the boxes that a user may have meant, the smallest ones, nearest to a town first."""
    boxes = [(words, box) for words, box in orders if max(sides_of(box)) < WIDE_DEGREES]
    least = min((math.prod(sides_of(box)) for _, box in boxes), default=0.0)
    readings = []
    for words, (west, south, east, north) in boxes:
        if (east - west) * (north - south) <= SIMILAR * least:
            town = nearest_town((west + east) / 2, (south + north) / 2)
            box = box_text((west, south, east, north))
            readings.append((town.distance_km, f"{words} it is {box} ({town})"))
    texts = ", ".join(text for _, text in sorted(readings))
    return f"; {texts}" if texts else ""


def box_text(bounds: Iterable[float]) -> str:
    """Return bounds in degrees as ``west,south,east,north``."""
    return ",".join(f"{side:.10g}" for side in bounds)


def elsewhere_error(
    area: Area, meets: Callable[[Area], bool], centre: tuple[float, float]
) -> InputError:
    """Return the error for an area that does not meet the objects.

    It says what would meet them, by `meets`, such as the area with latitude and longitude
    exchanged; else where the area and the `centre` of the objects, in degrees, are.
    """
    for words, other in area.others:
        if meets(other):
            return InputError(
                f"the area {area.name} is somewhere else, but it would be right {words}; write "
                f"west,south,east,north, which is {box_text(other.bounds)}."
            )
    point = area.polygon.representative_point()
    *_, metres = Geod(ellps="WGS84").inv(point.x, point.y, *centre)
    town, own = nearest_town(*centre), nearest_town(point.x, point.y)
    return InputError(
        f"the area {area.name} lies elsewhere: it is {own}, and the objects are {town}, "
        f"{metres / 1e3:,.0f} km away; give an area that they are in."
    )


def join_areas(geometry: NDArray[np.object_]) -> shapely.Polygon | shapely.MultiPolygon | None:
    """Return the valid union of the areas of geometries, or None if they have no area."""
    parts = shapely.get_parts(shapely.make_valid(geometry))
    polygons = shapely.get_parts(parts[shapely.get_dimensions(parts) == 2])  # noqa: PLR2004
    joined = shapely.union_all(polygons)
    return joined if isinstance(joined, shapely.Polygon | shapely.MultiPolygon) else None
