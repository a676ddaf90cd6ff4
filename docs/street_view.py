"""Draw the view from a place of a made-up town, as a photo of its street would show it.

There is no photo of a made-up town. The pictures of the site that begin with a photo begin with
this drawing of its buildings and street objects.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from PIL import Image, ImageDraw, ImageFilter

if TYPE_CHECKING:
    from collections.abc import Iterator

    import geopandas as gpd
    from numpy.typing import NDArray

    import semsig_gis as sg

EYE_M, HOUSE_M, STOREY_M, NEAREST_M = 1.6, 13.0, 3.0, 0.8
HOUSES_TO_M, OBJECTS_TO_M, MARKED_TO_M = 250.0, 120.0, 28.0
SCALE = 2  # drawn larger and then reduced, for smooth edges
WALLS = ("#d9cdb8", "#c9b79c", "#dcc7b0", "#bfb3a3", "#cfc4c0", "#d8d2c4")
WINDOW = "#5b6b78"
SKY, HORIZON, ROAD = (120, 166, 208), (222, 233, 240), (128, 126, 124)
METAL, BARK, KIOSK = "#3e4448", "#5d4a37", "#8c3b3b"

# Rectangles (left, low, right, high, colour), then discs (across, up, radius, colour), in metres
# from the foot of the object.
Box = tuple[float, float, float, float, str]
Disc = tuple[float, float, float, str]
SHAPES: dict[str, tuple[tuple[Box, ...], tuple[Disc, ...]]] = {
    "alignment_tree": (
        ((-0.16, 0, 0.16, 4, BARK),),
        (
            (0, 5.4, 1.7, "#3d6b35"),
            (-0.7, 4.7, 1.1, "#356030"),
            (0.8, 5.0, 1.2, "#467a3c"),
            (0.1, 6.3, 1.2, "#4f8544"),
        ),
    ),
    "street_light": (
        ((-0.08, 0, 0.08, 6.8, METAL), (0, 6.6, 1.2, 6.8, METAL)),
        ((1.1, 6.5, 0.3, "#fff3c4"),),
    ),
    "traffic_light": (
        ((-0.07, 0, 0.07, 2.6, METAL), (-0.25, 2.3, 0.25, 3.5, "#202426")),
        ((0, 3.2, 0.15, "#e0372c"), (0, 2.9, 0.15, "#5a4a1c"), (0, 2.6, 0.15, "#1d4a2b")),
    ),
    "bench": (
        (
            (-0.9, 0.38, 0.9, 0.5, "#7a5230"),
            (-0.9, 0.62, 0.9, 0.92, "#8a6038"),
            (-0.8, 0, -0.7, 0.4, METAL),
            (0.7, 0, 0.8, 0.4, METAL),
        ),
        (),
    ),
    "bus_stop": (
        (
            (-1.6, 2.4, 1.6, 2.6, "#36505f"),
            (-1.5, 0.3, 1.1, 2.4, "#a9c3cf"),
            (-1.6, 0, -1.5, 2.6, "#36505f"),
            (1.5, 0, 1.6, 2.6, "#36505f"),
            (1.15, 1.5, 1.5, 2.3, "#f2c230"),
        ),
        (),
    ),
    "water_fountain": (((-0.3, 0, 0.3, 1.2, "#2f5d46"),), ((0, 1.3, 0.3, "#2f5d46"),)),
    "indicator": (
        (
            (-0.1, 0, 0.1, 1.0, METAL),
            (-0.65, 0.9, 0.65, 2.8, "#2b4f86"),
            (-0.5, 1.2, 0.5, 2.6, "#e8ebee"),
        ),
        (),
    ),
}
OTHER: tuple[tuple[Box, ...], tuple[Disc, ...]] = (  # stations and toilets: a kiosk
    ((-1.0, 0, 1.0, 2.3, KIOSK), (-0.8, 1.2, 0.8, 2.0, "#e5e0d8")),
    (),
)


@dataclass(frozen=True)
class Mark:
    """An object of a drawing: its class name, and its box in pixels, left, top, right, bottom."""

    name: str
    box: tuple[float, float, float, float]


@dataclass(frozen=True)
class Wall:
    """A part of the wall of a building, in metres across and ahead, with the building's number."""

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    number: int

    @property
    def distance(self) -> float:
        """Distance of the middle in metres."""
        return float(np.hypot(*(self.start + self.end) / 2))


@dataclass(frozen=True)
class Thing:
    """A street object, in metres across and ahead."""

    name: str
    at: NDArray[np.float64]

    @property
    def distance(self) -> float:
        """Distance in metres."""
        return float(np.hypot(*self.at))


class _Camera:
    """A pinhole with a horizontal axis, which turns places into pixels of a picture."""

    def __init__(
        self, place: NDArray[np.float64], heading: float, fov: float, size: tuple[int, int]
    ) -> None:
        angle = math.radians(heading)
        self.place = place
        self.axes = np.array(
            [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
        )
        self.size = size
        self.focal = size[0] / 2 / math.tan(math.radians(fov) / 2)
        self.horizon = size[1] * 0.56

    def local(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return metres to the right and ahead of places, shape (n, 2)."""
        metres: NDArray[np.float64] = (xy - self.place) @ self.axes.T
        return metres

    def pixel(self, at: NDArray[np.float64], up: float) -> tuple[float, float]:
        """Return the pixel of a point `up` metres above the ground."""
        scale = self.focal / at[1]
        return float(self.size[0] / 2 + at[0] * scale), float(self.horizon - (up - EYE_M) * scale)


def draw_view(
    objects: sg.StreetObjects,
    buildings: gpd.GeoDataFrame,
    place: NDArray[np.float64],
    *,
    heading: float,
    fov: float,
    size: tuple[int, int] = (1280, 800),
) -> tuple[Image.Image, list[Mark]]:
    """Return a drawing of a view, and its near objects that are completely in it, left to right."""
    camera = _Camera(place, heading, fov, (size[0] * SCALE, size[1] * SCALE))
    picture = _ground(camera)
    draw, marks = ImageDraw.Draw(picture), []
    parts: list[Wall | Thing] = [*_walls(camera, buildings), *_things(camera, objects, buildings)]
    for part in sorted(parts, key=lambda part: -part.distance):
        haze = min(0.75, part.distance / HOUSES_TO_M)
        if isinstance(part, Wall):
            _draw_wall(draw, camera, part, haze)
            continue
        box = _draw_thing(draw, camera, part, haze)
        if part.distance <= MARKED_TO_M and box[0] > 0 and box[2] < size[0]:
            marks.append(Mark(part.name, box))
    picture = picture.filter(ImageFilter.GaussianBlur(0.6 * SCALE))
    picture = picture.resize(size, Image.Resampling.LANCZOS)
    return picture, sorted(marks, key=lambda mark: mark.box[0])


def _ground(camera: _Camera) -> Image.Image:
    """Return a sky and a road."""
    width, height = camera.size
    rows = np.arange(height)[:, None, None]
    down = np.clip(rows / camera.horizon, 0, 1)
    near = np.clip((rows - camera.horizon) / (height - camera.horizon), 0, 1)
    sky = (1 - down) * np.array(SKY) + down * np.array(HORIZON)
    colours = np.where(rows < camera.horizon, sky, np.array(ROAD) * (1.12 - 0.3 * near))
    grain = np.random.default_rng(0).normal(0, 5, (height, width, 1))
    return Image.fromarray(np.clip(colours + grain, 0, 255).astype(np.uint8))


def _walls(camera: _Camera, buildings: gpd.GeoDataFrame) -> Iterator[Wall]:
    """Yield the parts of walls in front of the camera."""
    near = buildings.distance(shapely.Point(camera.place)) < HOUSES_TO_M
    for number, polygon in enumerate(shapely.get_parts(buildings.geometry[near].to_numpy())):
        edges = camera.local(shapely.get_coordinates(shapely.segmentize(polygon.exterior, 6.0)))
        for start, end in itertools.pairwise(edges):
            if max(start[1], end[1]) > NEAREST_M:
                yield Wall(_in_front(start, end), _in_front(end, start), number)


def _in_front(point: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a point, moved towards another one until it is in front of the camera."""
    if point[1] >= NEAREST_M:
        return point
    share = float((NEAREST_M - point[1]) / (other[1] - point[1]))
    return point + share * (other - point)


def _draw_wall(draw: ImageDraw.ImageDraw, camera: _Camera, wall: Wall, haze: float) -> None:
    along = wall.end - wall.start
    storeys = round(HOUSE_M / STOREY_M) + wall.number % 3
    light = 1.0 - 0.22 * abs(along[1]) / max(1e-6, float(np.hypot(*along)))

    def rectangle(left: float, low: float, right: float, high: float) -> list[tuple[float, float]]:
        ends = wall.start + left * along, wall.start + right * along
        corners = (ends[0], low), (ends[0], high), (ends[1], high), (ends[1], low)
        return [camera.pixel(at, up) for at, up in corners]

    outline = rectangle(0, 0, 1, storeys * STOREY_M + 1)
    draw.polygon(outline, fill=_mixed(WALLS[wall.number % len(WALLS)], haze, light))
    for floor, middle in itertools.product(range(storeys), (0.3, 0.7)):
        foot = floor * STOREY_M
        window = rectangle(middle - 0.12, foot + 0.9, middle + 0.12, foot + 2.3)
        if abs(window[0][0] - window[2][0]) > SCALE:
            draw.polygon(window, fill=_mixed(WINDOW, haze))


def _things(
    camera: _Camera, objects: sg.StreetObjects, buildings: gpd.GeoDataFrame
) -> Iterator[Thing]:
    """Yield the objects in front of the camera that no building hides."""
    names = {item.code: item.name for item in objects.taxonomy.classes}
    places = camera.local(objects.xy)
    walls = shapely.union_all(buildings.geometry.to_numpy())
    near = (places[:, 1] > NEAREST_M) & (np.hypot(*places.T) < OBJECTS_TO_M)
    for row in np.flatnonzero(near):
        if not walls.crosses(shapely.LineString([camera.place, objects.xy[row]])):
            yield Thing(names[int(objects.codes[row])], places[row])


def _draw_thing(
    draw: ImageDraw.ImageDraw, camera: _Camera, thing: Thing, haze: float
) -> tuple[float, float, float, float]:
    """Draw an object; return its box in pixels of the final picture."""
    boxes, discs = SHAPES.get(thing.name, OTHER)
    x, y = camera.pixel(thing.at, 0.0)
    scale = camera.focal / thing.at[1]

    def around(left: float, low: float, right: float, high: float) -> tuple[float, ...]:
        return x + left * scale, y - high * scale, x + right * scale, y - low * scale

    corners = [around(*box[:4]) for box in boxes]
    for corner, box in zip(corners, boxes, strict=True):
        draw.rectangle(corner, fill=_mixed(box[4], haze))
    for across, up, radius, colour in discs:
        corner = around(across - radius, up - radius, across + radius, up + radius)
        draw.ellipse(corner, fill=_mixed(colour, haze))
        corners.append(corner)
    edges = np.array(corners) / SCALE
    left, top = edges[:, :2].min(axis=0).tolist()
    right, bottom = edges[:, 2:].max(axis=0).tolist()
    return left, top, right, bottom


def _mixed(colour: str, haze: float, light: float = 1.0) -> tuple[int, ...]:
    """Return a colour, darkened, and mixed with that of the horizon."""
    plain = np.array(list(bytes.fromhex(colour[1:]))) * light
    mixed = plain + haze * (np.array(HORIZON) - plain)
    return tuple(np.rint(mixed).astype(int).tolist())
