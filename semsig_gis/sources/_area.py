"""The area that a user wants: a bounding box, or the polygons of a file."""

from __future__ import annotations

import dataclasses
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import shapely

from semsig_gis.errors import InputError
from semsig_gis.layer_spec import LayerSpec
from semsig_gis.sources import FILE_SUFFIXES, vector_file
from semsig_gis.sources._crs import LATITUDE_LIMIT, LONGITUDE_LIMIT, WGS84

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from semsig_gis.sources import RawLayer

__all__ = ["Area", "clip_layer", "names_place", "parse_area"]

NUMBERS = re.compile(r"[\s\d.,;eE+-]*\d[\s\d.,;eE+-]*")
POLYGONAL = {"Polygon", "MultiPolygon"}


@dataclass(frozen=True, eq=False)
class Area:
    """An area of the Earth.

    Parameters
    ----------
    polygon : shapely.Polygon or shapely.MultiPolygon
        Its outline in EPSG:4326, longitude first.
    name : str
        Its name to show to people.

    Examples
    --------
    >>> Area(shapely.box(2.3, 48.8, 2.4, 48.9), "a part of Paris").bounds
    (2.3, 48.8, 2.4, 48.9)
    """

    polygon: shapely.Polygon | shapely.MultiPolygon
    name: str

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """West, south, east and north in degrees."""
        west, south, east, north = self.polygon.bounds
        return west, south, east, north


def parse_area(text: str) -> Area:
    """Return the area that a user wrote.

    Parameters
    ----------
    text : str
        ``"west,south,east,north"`` in degrees, or the path of a vector file, all polygons of which
        together are the area.

    Returns
    -------
    Area
        The area.

    Raises
    ------
    InputError
        If it is neither, or is no area.
    SourceError
        If the file cannot be read.
    CrsError
        If the file does not say its CRS.

    Examples
    --------
    >>> parse_area("2.3,48.8,2.4,48.9").bounds
    (2.3, 48.8, 2.4, 48.9)
    """
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
    """Tell whether a text is the name of a place rather than what `parse_area` takes.

    Parameters
    ----------
    text : str
        What a user wrote.

    Returns
    -------
    bool
        Whether it is neither numbers nor a file, be it one that does not exist.

    Examples
    --------
    >>> names_place("Helsinki"), names_place("helsinki.geojson"), names_place("1,2,3,4")
    (True, False, False)
    """
    path = Path(text)
    is_file = path.suffix.lower() in FILE_SUFFIXES or path.is_file()
    return not is_file and not NUMBERS.fullmatch(text)


def clip_layer(layer: RawLayer, area: Area) -> RawLayer:
    """Leave out the rows of a layer that are outside an area.

    Parameters
    ----------
    layer : RawLayer
        The layer, in any CRS.
    area : Area
        The area.

    Returns
    -------
    RawLayer
        The rows whose centroid is in the area; of buildings and streets, those that touch it.
        The others count as filtered. A row without a position stays, to be counted as such.

    Examples
    --------
    >>> import geopandas as gpd
    >>> from semsig_gis.sources import RawLayer
    >>> table = gpd.GeoDataFrame(
    ...     {"class_name": ["bench"] * 2, "source_id": ["1", "2"]},
    ...     geometry=gpd.points_from_xy([2.35, 3.0], [48.85, 48.85]),
    ...     crs="EPSG:4326",
    ... )
    >>> layer = RawLayer(spec=LayerSpec(name="b", class_name="bench"), table=table, read=2)
    >>> clipped = clip_layer(layer, parse_area("2.3,48.8,2.4,48.9"))
    >>> clipped.table.source_id.tolist(), clipped.filtered
    (['1'], 1)
    """
    geometry = layer.table.geometry.to_crs(WGS84).to_numpy()
    nowhere = shapely.is_missing(geometry) | shapely.is_empty(geometry)
    shapely.prepare(area.polygon)
    if layer.spec.role == "objects":
        inside = shapely.covers(area.polygon, shapely.centroid(geometry))
    else:
        inside = shapely.intersects(area.polygon, geometry)
    kept = layer.table[nowhere | inside].reset_index(drop=True)
    dropped = len(layer.table) - len(kept)
    return dataclasses.replace(layer, table=kept, filtered=layer.filtered + dropped)


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
    wanted = LayerSpec(name="area", class_name="", geometry="polygon")
    layer = vector_file.read_layer(path, wanted)
    if layer.error_count:
        msg = f"{path} has polygons that cannot be read ({layer.errors[0]}); correct the file."
        raise InputError(msg)
    geometry = layer.table.geometry.dropna()
    others = set(geometry.geom_type) - POLYGONAL
    if others or geometry.empty:
        found = f"holds {', '.join(sorted(others))}" if others else "holds nothing"
        msg = f"{path} {found}; give a file of polygons."
        raise InputError(msg)
    polygon = join_areas(geometry.to_crs(WGS84).to_numpy())
    if polygon is None:
        msg = f"{path} encloses no area; give a file of polygons."
        raise InputError(msg)
    return Area(polygon, path.stem)


def join_areas(
    geometry: NDArray[np.object_],
) -> shapely.Polygon | shapely.MultiPolygon | None:
    """Return the union of what geometries enclose, in valid form; None where that is nothing."""
    parts = shapely.get_parts(shapely.make_valid(geometry))
    polygons = shapely.get_parts(parts[shapely.get_dimensions(parts) == 2])  # noqa: PLR2004
    joined = shapely.union_all(polygons)
    return joined if isinstance(joined, shapely.Polygon | shapely.MultiPolygon) else None
