"""Streets and buildings below a map, where there are no tiles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import shapely

from semsig_gis.core.crs import COUNT, MERGED, SOURCE, SOURCE_ID
from semsig_gis.core.errors import CrsError, EmptyResultError
from semsig_gis.core.signs import class_signs
from semsig_gis.maps.board import mercator
from semsig_gis.maps.legend import OUTLINES, objects_legend, sign_svg
from semsig_gis.maps.packing import packed, steps
from semsig_gis.maps.parts import (
    Drawing,
    Legend,
    Script,
    add_city,
    finished_map,
    free_name,
    layer_text,
    layers_of,
    prepared_map,
    to_latlon,
)
from semsig_gis.objects.surroundings import licenses_of
from semsig_gis.storage.geoparquet import hilbert_order

if TYPE_CHECKING:
    import folium
    import geopandas as gpd
    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.objects.table import StreetObjects


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
        The map, which names whom to name for them (see `objects.surroundings.licenses_of`). It
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
    Drawing(name, "ground", *_drawn_ground(shapes, systems[0])).add_to(chosen)
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


def _drawn_ground(
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


FIELDS = ("Class", "Source", "Identifier", "Stands for", "Also", "Place")


def objects_map(
    objects: StreetObjects,
    *,
    database: SignatureDatabase | None = None,
    map_: folium.Map | None = None,
    tiles: str | None = None,
) -> folium.Map:
    """Show where the street objects are, and what is known of each.

    Parameters
    ----------
    objects : StreetObjects
        What to show.
    database : SignatureDatabase, optional
        The cells from which they are seen: a layer that is hidden at first, and to be found by
        number.
    map_ : folium.Map, optional
        Map to add the layers to, where they are hidden at first; a new one by default.
    tiles : str, optional
        Online background of a new map, by a name that folium knows; none by default.

    Returns
    -------
    folium.Map
        The map, with a layer for each class, named with its sign and number; a click on an object
        tells its class, source, identifier and place. All are drawn on one canvas, so that
        hundreds of thousands stay smooth.

    Raises
    ------
    EmptyResultError
        If there is no object.
    InputError
        If `tiles` is not known to folium, or both `tiles` and `map_` are given.

    Examples
    --------
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.objects.clean import build_objects
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> objects_map(objects).options["maxZoom"]
    20
    """
    if len(objects) == 0:
        msg = "there is no street object to show; look at what was loaded."
        raise EmptyResultError(msg)
    chosen = prepared_map(map_, tiles, title="Street objects")
    if database is not None:
        add_city(chosen, database, show=False)
    key = f"objects{len(layers_of(chosen))}"
    Script("streetObjects", key, *_drawn(objects)).add_to(chosen)
    signs, counts = class_signs(objects.taxonomy), objects.class_counts
    for number, (code, count) in enumerate(counts.items()):
        title = layer_text(signs[code].title)
        name = free_name(chosen, f"{sign_svg(signs[code])} {title} ({count:,})")
        Drawing(name, "classLayer", key, number, show=map_ is None).add_to(chosen)
    corners = np.stack([objects.xy.min(axis=0), objects.xy.max(axis=0)])
    view = to_latlon(corners, objects.crs) if map_ is None else None
    Legend(objects_legend(objects), view).add_to(chosen)
    source = objects if database is None else database
    return finished_map(chosen, source, licenses=tuple(map(str, objects.licenses)))


def _drawn(objects: StreetObjects) -> tuple[dict[str, list[str]], dict[str, Any]]:
    """Return the objects for the script: class by class, neighbours together; and what they are."""
    near = hilbert_order(objects.table.geometry.array)
    order = near[np.argsort(objects.codes[near], kind="stable")]
    table = objects.table.iloc[order]
    places, about = mercator(objects.xy[order], objects.crs)
    source, sources = pd.factorize(table[SOURCE], sort=True)
    arrays: dict[str, NDArray[Any] | list[str]] = {
        "ids": table[SOURCE_ID].astype(str).tolist(),
        "source": source.astype(np.uint16),
        "count": table[COUNT].to_numpy(np.int32),
        "merged": table[MERGED].astype(str).tolist() if MERGED in table else [],
    }
    signs, counts = class_signs(objects.taxonomy), objects.class_counts
    ends = np.cumsum(list(counts.values())).tolist()
    classes = [
        {
            "title": signs[code].title,
            "symbol": signs[code].symbol,
            "colour": signs[code].colour,
            "ink": signs[code].ink,
            "outline": OUTLINES[signs[code].shape],
            "drop": signs[code].drop,
            "start": end - count,
            "end": end,
        }
        for (code, count), end in zip(counts.items(), ends, strict=True)
    ]
    about |= {
        "classes": classes,
        "sources": sources.tolist(),
        "fields": FIELDS,
        # The rare ones last, so that they lie on top.
        "order": np.argsort([-count for count in counts.values()], kind="stable").tolist(),
    }
    told = {name: packed(values) for name, values in arrays.items()}
    told |= {name: steps(part) for name, part in zip("xy", places.T, strict=True)}
    return told, about
