"""Streets and buildings below a map, where there are no tiles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from semsig_gis._map_board import mercator
from semsig_gis._map_packing import steps
from semsig_gis._map_parts import Drawing, Legend, finished_map, free_name, prepared_map, to_latlon
from semsig_gis.boxes import hilbert_order
from semsig_gis.errors import CrsError, EmptyResultError
from semsig_gis.surroundings import licenses_of

if TYPE_CHECKING:
    import folium
    import geopandas as gpd
    from numpy.typing import NDArray
    from pyproj import CRS

__all__ = ["ground_map"]

STREET_M = 6.0
DETAIL_M = 0.6  # what is smaller is not drawn
POLYGONAL = 2


def ground_map(
    *,
    buildings: gpd.GeoDataFrame | None = None,
    streets: gpd.GeoDataFrame | None = None,
    box: tuple[float, float, float, float] | None = None,
    map_: folium.Map | None = None,
) -> folium.Map:
    """Show plain streets and buildings, for other things to be seen among.

    Parameters
    ----------
    buildings : GeoDataFrame, optional
        Polygons in a metric CRS.
    streets : GeoDataFrame, optional
        Centre lines in the same CRS.
    box : tuple of float, optional
        ``xmin, ymin, xmax, ymax`` in that CRS: only what meets it. Everything by default.
    map_ : folium.Map, optional
        Map to add the layer to, on the images of cells and below all else; a new one by default.

    Returns
    -------
    folium.Map
        The map, which names whom to name for them (see `semsig_gis.surroundings.licenses_of`). It
        needs no network.

    Raises
    ------
    CrsError
        If a table has no CRS, or the two differ.
    EmptyResultError
        If there is nothing to show.

    Notes
    -----
    Details of less than 0.6 m are left out and coordinates rounded to 0.25 m of Web Mercator, so
    that 60,000 buildings take about a megabyte.

    Examples
    --------
    >>> import geopandas as gpd
    >>> house = gpd.GeoDataFrame(geometry=[shapely.box(0, 0, 9, 9)], crs="EPSG:32631")
    >>> ground_map(buildings=house).options["maxZoom"]
    20
    """
    given = {
        kind: table
        for kind, table in (("buildings", buildings), ("streets", streets))
        if table is not None
    }
    systems = [table.crs for table in given.values()]
    if None in systems or len(set(systems)) > 1:
        named = " and ".join("no CRS" if one is None else one.name for one in systems)
        msg = f"the streets and buildings have {named}; give both in one CRS."
        raise CrsError(msg)
    shapes = {kind: _simple(table, box) for kind, table in given.items()}
    shapes = {kind: parts for kind, parts in shapes.items() if len(parts)}
    if not shapes:
        msg = "there are no streets or buildings to show; give some that are in the city."
        raise EmptyResultError(msg)
    chosen = prepared_map(map_, None, title="Streets and buildings")
    name = free_name(chosen, "Streets and buildings")
    Drawing(name, "ground", *_drawn(shapes, systems[0])).add_to(chosen)
    if map_ is None:
        bounds = shapely.total_bounds(np.concatenate(list(shapes.values()))).reshape(2, 2)
        text = "<summary>Streets and buildings</summary>"
        Legend(text, to_latlon(bounds, systems[0])).add_to(chosen)
    return finished_map(chosen, None, licenses=licenses_of(buildings, streets))


def _simple(
    table: gpd.GeoDataFrame, box: tuple[float, float, float, float] | None
) -> NDArray[np.object_]:
    """Return the lines or polygons of a table without small details, neighbours together."""
    shapes = table.geometry.to_numpy()
    if box is not None:
        shapes = shapes[shapely.intersects(shapes, shapely.box(*box))]
    parts = shapely.get_parts(shapes[~(shapely.is_missing(shapes) | shapely.is_empty(shapes))])
    parts = shapely.simplify(parts, DETAIL_M, preserve_topology=False)
    parts = parts[~shapely.is_empty(parts)]
    # Outlines one way round and courtyards the other, as a canvas wants them.
    parts = shapely.normalize(shapely.get_parts(parts))
    return parts[hilbert_order(parts)] if len(parts) else parts


def _drawn(
    shapes: dict[str, NDArray[np.object_]], crs: CRS
) -> tuple[dict[str, dict[str, list[str]]], dict[str, Any]]:
    """Return the shapes for the script: points, where rings end, and where shapes do."""
    rings = {
        kind: shapely.get_rings(parts, return_index=True)
        if shapely.get_dimensions(parts[0]) == POLYGONAL
        else (parts, np.arange(len(parts)))
        for kind, parts in shapes.items()
    }
    points = {kind: shapely.get_coordinates(lines) for kind, (lines, _) in rings.items()}
    places, about = mercator(np.concatenate(list(points.values())), crs)
    told = {}
    start = 0
    for kind, (lines, owner) in rings.items():
        part = places[start : start + len(points[kind])]
        start += len(part)
        numbers: dict[str, NDArray[Any]] = {
            "x": part[:, 0],
            "y": part[:, 1],
            "ends": np.cumsum(shapely.get_num_coordinates(lines)),
            "rings": np.cumsum(np.bincount(owner, minlength=len(shapes[kind]))),
        }
        told[kind] = {name: steps(values.astype(np.int32)) for name, values in numbers.items()}
    middle = np.concatenate(list(points.values())).mean(axis=0, keepdims=True)
    latitude = float(to_latlon(middle, crs)[0, 0])
    return told, about | {"width": STREET_M / float(np.cos(np.radians(latitude)))}
