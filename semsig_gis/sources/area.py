"""The area that a user wants: a bounding box, or the polygons of a file."""

from __future__ import annotations

import dataclasses
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import shapely

from semsig_gis.core.errors import InputError
from semsig_gis.sources import FILE_SUFFIXES
from semsig_gis.sources import vector as vector_file
from semsig_gis.sources.catalog import LayerSpec
from semsig_gis.sources.raw_layer import LATITUDE_LIMIT, LONGITUDE_LIMIT, WGS84

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.sources import RawLayer

NUMBERS = re.compile(r"[\s\d.,;eE+-]*\d[\s\d.,;eE+-]*")
POLYGONAL = {"Polygon", "MultiPolygon"}


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


def parse_area(text: str) -> Area:
    """Return the area of ``"west,south,east,north"`` in degrees, or of a vector file's polygons."""
    if NUMBERS.fullmatch(text):
        return _box(text)
    if names_place(text):
        msg = (
            f"area {text!r} is neither a bounding box nor a file; write west,south,east,north in "
            "degrees, or the path of a file with polygons."
        )
        raise InputError(msg)
    return _outline(Path(text))


def names_place(text: str) -> bool:
    """Tell whether a text names a place: it is neither numbers nor a file, even a missing one."""
    path = Path(text)
    is_file = path.suffix.lower() in FILE_SUFFIXES or path.is_file()
    return not is_file and not NUMBERS.fullmatch(text)


def clip_layer(layer: RawLayer, area: Area) -> RawLayer:
    """Leave out the rows of a layer that are outside an area; they count as filtered.

    Objects stay where their centroid is in the area, buildings and streets where they touch it. A
    row without a position stays.
    """
    geometry = layer.table.geometry.to_crs(WGS84).to_numpy()
    nowhere = shapely.is_missing(geometry) | shapely.is_empty(geometry)
    shapely.prepare(area.polygon)
    if layer.spec.role == "objects":
        inside = shapely.covers(area.polygon, _centroids(geometry, area))
    else:
        inside = shapely.intersects(area.polygon, geometry)
    kept = layer.table[nowhere | inside].reset_index(drop=True)
    filtered = layer.counts.filtered + len(layer.table) - len(kept)
    counts = dataclasses.replace(layer.counts, filtered=filtered)
    return dataclasses.replace(layer, table=kept, counts=counts)


def _centroids(geometry: NDArray[np.object_], area: Area) -> NDArray[np.object_]:
    """Return centroids in degrees, those of lines by lengths in metres around an area."""
    centroids: NDArray[np.object_] = shapely.centroid(geometry)
    lines = shapely.get_dimensions(geometry) == 1
    _, south, _, north = area.bounds
    width = np.array([math.cos(math.radians((south + north) / 2)), 1.0])  # of a degree
    narrowed = shapely.centroid(shapely.transform(geometry[lines], lambda xy: xy * width))
    centroids[lines] = shapely.transform(narrowed, lambda xy: xy / width)
    return centroids


def _box(text: str) -> Area:
    try:
        west, south, east, north = (float(number) for number in text.split(","))
    except ValueError as error:
        msg = f"bounding box {text!r} is not four numbers; write west,south,east,north in degrees."
        raise InputError(msg) from error
    if not (-LONGITUDE_LIMIT <= west < east <= LONGITUDE_LIMIT) or not (
        -LATITUDE_LIMIT <= south < north <= LATITUDE_LIMIT
    ):
        msg = (
            f"bounding box {text!r} is no area; write west,south,east,north in degrees, with west "
            "below east within -180 to 180 and south below north within -90 to 90."
        )
        raise InputError(msg)
    return Area(shapely.box(west, south, east, north), text)


def _outline(path: Path) -> Area:
    polygons = LayerSpec(name="area", class_name="", geometry="polygon")
    layer = vector_file.read_layer(path, polygons)
    if layer.errors:
        msg = f"{path} has polygons that cannot be read ({layer.errors[0]}); correct the file."
        raise InputError(msg)
    geometry = layer.table.geometry.dropna()
    others = sorted(set(geometry.geom_type) - POLYGONAL)
    polygon = None if others else join_areas(geometry.to_crs(WGS84).to_numpy())
    if polygon is None:
        kinds = ", ".join(others) or "nothing"
        what = "encloses no area" if len(geometry) and not others else f"holds {kinds}"
        msg = f"{path} {what}; give a file of polygons."
        raise InputError(msg)
    return Area(polygon, path.stem)


def join_areas(geometry: NDArray[np.object_]) -> shapely.Polygon | shapely.MultiPolygon | None:
    """Return the union of what geometries enclose, in valid form; None where that is nothing."""
    parts = shapely.get_parts(shapely.make_valid(geometry))
    polygons = shapely.get_parts(parts[shapely.get_dimensions(parts) == 2])  # noqa: PLR2004
    joined = shapely.union_all(polygons)
    return joined if isinstance(joined, shapely.Polygon | shapely.MultiPolygon) else None
