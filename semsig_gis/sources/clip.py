"""Parse the area that a user gives, and clip layers to it."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import shapely

from semsig_gis.core import (
    FULL_TURN,
    HALF_TURN,
    CrsError,
    EmptyResultError,
    InputError,
)
from semsig_gis.sources.area import (
    CITY_DEGREES,
    WIDE_DEGREES,
    Area,
    advice,
    elsewhere_error,
    join_areas,
    other_orders,
    sides_of,
)
from semsig_gis.sources.area_file import NUMBERS, read_polygons
from semsig_gis.sources.layer import transformed
from semsig_gis.sources.rows import LATITUDE_LIMIT, LONGITUDE_LIMIT, WGS84

if TYPE_CHECKING:
    from collections.abc import Sequence

    import geopandas as gpd
    from numpy.typing import NDArray

    from semsig_gis.sources.layer import RawLayer

T = TypeVar("T", shapely.Polygon | shapely.MultiPolygon, "NDArray[np.object_]")
# The text by which a user requests the bounding box that a file states.
BOX = "box"
NO_CLIP = "none"
# Distance between points along the edges of an area, which are curves in another CRS.
EDGE_DEGREES = 0.01
METRES_A_DEGREE = 111_195.0  # of latitude
POLYGONAL = {"Polygon", "MultiPolygon"}


def parse_area(text: str | gpd.GeoDataFrame) -> Area:
    """Return the area of ``"west,south,east,north"`` in degrees, of polygons, or of a file."""
    if not isinstance(text, str):
        return _area_of(text.geometry, "the table", name="table", kind="table")
    if not NUMBERS.fullmatch(text):
        path = Path(text)
        return _area_of(read_polygons(path), str(path), name=path.stem, kind="file")
    try:
        numbers = tuple(float(number) for number in text.strip("[]() \t").replace(",", " ").split())
        west, south, east, north = numbers
    except ValueError as error:
        raise InputError(
            f"bounding box {text!r} is not four numbers; write west,south,east,north in degrees."
        ) from error
    others = list(other_orders(numbers))
    # A box that crosses 180 degrees and is wider than half of the Earth is taken for an error.
    across = east < west and east + FULL_TURN - west < HALF_TURN
    on_earth = max(abs(west), abs(east)) <= LONGITUDE_LIMIT
    if not (on_earth and (west < east or across)) or not (
        -LATITUDE_LIMIT <= south < north <= LATITUDE_LIMIT
    ):
        raise InputError(
            f"bounding box {text!r} is not an area; write west,south,east,north in degrees, with "
            "west below east within -180 to 180, or above it across 180 degrees, and south below "
            f"north within -90 to 90{advice(others)}."
        )
    cities = [item for item in others if max(sides_of(item[1])) < CITY_DEGREES]
    if cities and min(sides_of((west, south, east, north))) > WIDE_DEGREES:
        raise InputError(
            f"bounding box {text!r} is {east - west:.3g} by {north - south:.3g} degrees, so it is "
            f"not west,south,east,north{advice(cities)}."
        )
    spans = [(west, HALF_TURN), (-HALF_TURN, east)] if across else [(west, east)]
    boxes = [shapely.box(start, south, end, north) for start, end in spans if start < end]
    polygon = boxes[0] if len(boxes) == 1 else shapely.MultiPolygon(boxes)
    return Area(polygon, text, numbers)


def clip_layers(layers: Sequence[RawLayer], text: str | gpd.GeoDataFrame) -> tuple[RawLayer, ...]:
    """Remove the rows outside an area.

    Parameters
    ----------
    layers : sequence of RawLayer
        The layers.
    text : str or GeoDataFrame
        ``west,south,east,north`` in degrees, the path of a file with polygons, a table of them, or
        ``"box"`` for the bounding boxes that OpenStreetMap files state.

    Returns
    -------
    tuple of RawLayer
        The layers; their counts include the rows outside. InputError if the area is not valid or
        contains no object, or no file states its box.

    Examples
    --------
    >>> from semsig_gis import CitySpec, synthetic_city
    >>> from semsig_gis.sources import clip_layers
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> trees, *_ = clip_layers(layers, "2.9,48.7,3.0,48.8")
    >>> trees.counts.outside > 0
    True
    """
    if not isinstance(text, str) or text != BOX:
        area = parse_area(text)
    else:
        boxes = [layer.extent.polygon for layer in layers if layer.extent is not None]
        polygon = join_areas(np.array(boxes, dtype=object))
        if polygon is None:
            raise InputError(
                f"none of the files states the area that it covers, so there is no {BOX!r} to clip "
                "to; write west,south,east,north in degrees, or the path of a file with polygons."
            )
        area = Area(polygon, BOX)
    clipped = tuple(clip_layer(layer, area) for layer in layers)
    deciding = [layer for layer in layers if layer.spec.role == "objects"] or layers
    places = [layer for layer in deciding if not shapely.is_missing(layer.geometry).all()]
    if places and not any(_meets(layer, area) for layer in places):
        raise elsewhere_error(
            area,
            lambda other: any(_meets(layer, other) for layer in places),
            _centre(places),
        )
    return clipped


def _meets(layer: RawLayer, area: Area) -> bool:
    """Whether a row of a layer is in an area."""
    outside, _ = _outside(layer, area)
    return bool((~outside & ~shapely.is_missing(layer.geometry)).any())


def _centre(layers: Sequence[RawLayer]) -> tuple[float, float]:
    """Return the median longitude and latitude of the rows of layers."""
    shapes = [transformed(layer.geometry, layer.known_crs, WGS84) for layer in layers]
    x, y = np.nanmedian(shapely.get_coordinates(np.concatenate(shapes)), axis=0)
    return float(x), float(y)


def clip_to_extents(layers: Sequence[RawLayer]) -> tuple[tuple[RawLayer, ...], str]:
    """Remove the rows outside the bounding box that the source of each layer states.

    Layers of sources without one are returned unchanged. The text says how many rows were removed;
    it is empty if none was.
    """
    clipped = tuple(
        layer if layer.extent is None else clip_layer(layer, layer.extent) for layer in layers
    )
    outside = sum(len(layer) for layer in layers) - sum(len(layer) for layer in clipped)
    if outside and not sum(len(layer) for layer in clipped if layer.spec.role == "objects"):
        boxes = {layer.extent.polygon.bounds: None for layer in layers if layer.extent is not None}
        texts = [",".join(f"{side:.7g}" for side in box) for box in boxes]
        raise EmptyResultError(
            f"no object is in the box that OpenStreetMap files state ({' and '.join(texts)}); give "
            f"--clip {NO_CLIP} to keep what is beyond it, or a box."
        )
    note = (
        f"clipped to the box that OpenStreetMap files state: {outside:,} row"
        f"{'' if outside == 1 else 's'} beyond it left out (--clip {NO_CLIP} keeps them)"
    )
    return clipped, note if outside else ""


def clip_layer(layer: RawLayer, area: Area) -> RawLayer:
    """Remove the rows of a layer that are outside an area.

    An object is kept if its centroid is in the area, a building or street if it touches the area,
    and a row without a position always. Of lines and outlines of extended things, the parts in the
    area are kept.
    """
    layer = _cut(layer, area) if layer.spec.extended else layer
    outside, _ = _outside(layer, area)
    counts = dataclasses.replace(layer.counts, outside=layer.counts.outside + int(outside.sum()))
    # Rows beyond the box of the file are still noted; surroundings end where the area does.
    extent = layer.extent if layer.spec.role == "objects" else area
    return layer.select(~outside, counts=counts, extent=extent)


def _cut(layer: RawLayer, area: Area) -> RawLayer:
    """Return a layer of extended things that are cut where an area ends."""
    edge = shapely.segmentize(area.polygon, EDGE_DEGREES)
    (polygon,) = transformed(np.array([edge], object), WGS84, layer.known_crs)
    shapely.prepare(polygon)
    geometry = layer.geometry.copy()
    dimensions = shapely.get_dimensions(geometry)
    across = (
        (dimensions > 0)
        & shapely.intersects(polygon, geometry)
        & ~shapely.covers(polygon, geometry)
    )
    areas = across & (dimensions == 2)  # noqa: PLR2004
    geometry[areas] = shapely.boundary(geometry[areas])
    inside = shapely.intersection(geometry[across], polygon)
    # What only surrounds the area, or touches it, stays as it was and is outside.
    geometry[across] = np.where(shapely.is_empty(inside), geometry[across], inside)
    return dataclasses.replace(layer, geometry=geometry)


def note_outside(layer: RawLayer) -> RawLayer:
    """Add a note on rows outside the bounding box that the source states; they may be errors."""
    if layer.extent is None:
        return layer
    outside, places = _outside(layer, layer.extent)
    if not outside.any():
        return layer
    metres = shapely.distance(places, _narrowed(layer.extent.polygon, layer.extent))
    note = (
        f"{outside.sum():,} of {len(outside):,} rows are outside the box that the file says it "
        f"covers, by up to {metres.max() * METRES_A_DEGREE:,.0f} m"
    )
    return dataclasses.replace(layer, notes=(*layer.notes, note))


def _outside(layer: RawLayer, area: Area) -> tuple[NDArray[np.bool_], NDArray[np.object_]]:
    """Return which rows are outside an area, and their geometries as of `_narrowed`."""
    geometry = transformed(layer.geometry, layer.known_crs, WGS84)
    shapely.prepare(area.polygon)
    outside = ~(shapely.is_missing(geometry) | shapely.is_empty(geometry))
    outside &= ~shapely.covers(area.polygon, geometry)
    places = _narrowed(geometry[outside], area)
    if layer.spec.role == "objects" and not layer.spec.extended:
        places = shapely.centroid(places)
    narrowed = _narrowed(area.polygon, area)
    shapely.prepare(narrowed)
    # All these rows are not covered by the area; of these, keep the ones that do not touch it.
    disjoint = ~shapely.intersects(narrowed, places)
    outside[outside] = disjoint
    return outside, places[disjoint]


def _narrowed(geometry: T, area: Area) -> T:
    """Return geometries with longitudes scaled to the length of a degree of latitude."""
    # One scale for the whole area: that of its middle latitude.
    _, south, _, north = area.bounds
    scale = np.array([math.cos(math.radians((south + north) / 2)), 1.0])
    narrowed: T = shapely.transform(geometry, lambda xy: xy * scale)
    return narrowed


def _area_of(shapes: gpd.GeoSeries, where: str, *, name: str, kind: str) -> Area:
    """Return the area of polygons; InputError if there are other geometries, or no area."""
    if shapes.crs is None:
        raise CrsError(f"{where} has no coordinate reference system; state it with set_crs.")
    geometry = shapes.dropna()
    others = sorted(set(geometry.geom_type) - POLYGONAL)
    polygon = None if others else join_areas(geometry.to_crs(WGS84).to_numpy())
    if polygon is None:
        kinds = ", ".join(others) or "nothing"
        what = "encloses no area" if len(geometry) and not others else f"contains {kinds}"
        raise InputError(f"{where} {what}; give a {kind} of polygons.")
    return Area(polygon, name)
