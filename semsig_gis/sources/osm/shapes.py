"""From the nodes of OpenStreetMap ways and multipolygons to what a layer wants of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import shapely

from semsig_gis.sources.raw_layer import BadFeatureError

if TYPE_CHECKING:
    from collections.abc import Iterable

    import numpy as np
    from numpy.typing import NDArray
    from shapely.geometry.base import BaseGeometry

    from semsig_gis.sources.layers import Role
    from semsig_gis.sources.raw_layer import Position

RING_NODES = 4  # of the smallest, a triangle: the first node comes again at its end


def way_shape(xy: NDArray[np.float64], role: Role) -> Position:
    """Return what a way stands for: a centroid for objects, a polygon for buildings, or a line.

    Nodes are longitude and latitude, shape (n, 2). A closed way is the outline of an area, but for
    a street. BadFeatureError for less than two nodes, and for a building that encloses nothing.
    """
    if len(xy) < 2:  # noqa: PLR2004
        msg = "has less than two nodes"
        raise BadFeatureError(msg)
    if role == "streets":
        return shapely.LineString(xy)
    if not _is_ring(xy):
        if role == "buildings":
            msg = "is not closed, as the outline of a building is"
            raise BadFeatureError(msg)
        return _centroid(shapely.LineString(xy))
    area = _areas(shapely.Polygon(xy))
    if role == "buildings":
        return _require_area(area)
    return _centroid(shapely.LineString(xy) if area.is_empty else area)


def relation_shape(
    outer: Iterable[NDArray[np.float64]], inner: Iterable[NDArray[np.float64]], role: Role
) -> Position:
    """Return what a multipolygon stands for: a centroid for objects, or the area of a building.

    Its ways come in any order and direction. BadFeatureError if they do not join to rings, or
    enclose nothing.
    """
    area: BaseGeometry = shapely.Polygon()
    for ring in (*_rings(outer), *_rings(inner)):
        # Parity, so that an island in a hole is inside again.
        area = shapely.symmetric_difference(area, ring)
    area = _require_area(_areas(area))
    return area if role == "buildings" else _centroid(area)


def _is_ring(xy: NDArray[np.float64]) -> bool:
    return len(xy) >= RING_NODES and bool((xy[0] == xy[-1]).all())


def _rings(ways: Iterable[NDArray[np.float64]]) -> list[BaseGeometry]:
    """Return the areas inside the rings that ways are or join to."""
    ways = list(ways)
    closed = [shapely.Polygon(xy) for xy in ways if _is_ring(xy)]
    lines = [shapely.LineString(xy) for xy in ways if not _is_ring(xy) and len(xy) > 1]
    joined, cuts, dangles, broken = shapely.polygonize_full(lines)
    if not all(part.is_empty for part in (cuts, dangles, broken)):
        msg = "has ways that do not join to rings"
        raise BadFeatureError(msg)
    outlines = shapely.get_exterior_ring(shapely.get_parts(joined))
    filled = [shapely.Polygon(outline) for outline in outlines]
    return [_areas(ring) for ring in (*closed, *filled)]


def _areas(geometry: BaseGeometry) -> BaseGeometry:
    """Return the areas in a geometry, in valid form."""
    parts = shapely.get_parts(shapely.make_valid(geometry))
    return shapely.union_all(parts[shapely.get_dimensions(parts) == 2])  # noqa: PLR2004


def _require_area(area: BaseGeometry) -> BaseGeometry:
    if area.is_empty:
        msg = "encloses no area"
        raise BadFeatureError(msg)
    return area


def _centroid(geometry: BaseGeometry) -> tuple[float, float]:
    # In degrees: a street object is small, so that the shrinking of longitudes cancels out.
    point = shapely.centroid(geometry)
    return point.x, point.y
