"""Maps of street objects, and of the streets and buildings below them."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
import shapely

from semsig_gis.core import (
    COUNT,
    MERGED,
    NAME,
    SOURCE,
    SOURCE_ID,
    TEXTS,
    CrsError,
    EmptyResultError,
    class_signs,
    codes_by_family,
    family_named,
)
from semsig_gis.objects import licenses_of
from semsig_gis.output.html.image import mercator, packed, steps
from semsig_gis.output.html.page_elements import (
    Call,
    add_city,
    add_layer,
    corners_of,
    credits_part,
    escaped_text,
    family_svg,
    finish_map,
    folded_part,
    layers_of,
    sign_look,
    sign_svg,
    start_map,
    to_latlon,
)
from semsig_gis.storage import hilbert_order

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import folium
    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.objects import StreetObjects


STREET_WIDTH_M = 6.0
DETAIL_M = 0.6  # smaller details are not drawn
POLYGONAL = 2
FIELDS = ("Class", "Source", "Identifier", "Represents", "Also", "Latitude, longitude")
TEXT_TITLES = dict(
    zip(TEXTS, ("Name", "Brand", "Operator", "Number on it", "House number", "Street"), strict=True)
)


def ground_map(
    *,
    buildings: gpd.GeoDataFrame | None = None,
    streets: gpd.GeoDataFrame | None = None,
    box: tuple[float, float, float, float] | None = None,
    map_: folium.Map | None = None,
) -> folium.Map:
    """Show plain streets and buildings as a background of other layers.

    Parameters
    ----------
    buildings : GeoDataFrame, optional
        Polygons in a metric CRS.
    streets : GeoDataFrame, optional
        Centre lines in the same CRS; those with a ``name`` can be searched.
    box : tuple of float, optional
        ``xmin, ymin, xmax, ymax`` in that CRS; only shapes that intersect it are drawn. All shapes
        by default.
    map_ : folium.Map, optional
        Map to add the layer to, above the images of cells and below all other layers; a new one by
        default.

    Returns
    -------
    folium.Map
        The map, which credits their sources (see `objects.load.licenses_of`).

    Raises
    ------
    CrsError
        If a table has no CRS, or the two differ.
    EmptyResultError
        If there is no shape to show.

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
    arguments = {"buildings": buildings, "streets": streets}
    tables = {kind: table for kind, table in arguments.items() if table is not None}
    systems = [table.crs for table in tables.values()]
    if None in systems or len(set(systems)) > 1:
        names = " and ".join("no CRS" if crs is None else crs.name for crs in systems)
        raise CrsError(f"the streets and buildings have {names}; give both in one CRS.")
    arrays, about, bounds = packed_ground(tables, box)
    page = start_map(map_, None, title="Streets and buildings")
    add_layer(page, "Streets and buildings", "ground", arrays, about, group="ground")
    legend, view = "", None
    if map_ is None:
        legend = "<summary>Streets and buildings</summary>"
        view = to_latlon(bounds, systems[0])
    licenses = licenses_of(buildings, streets)
    return finish_map(page, None, legend=legend, view=view, licenses=licenses)


def packed_ground(
    tables: Mapping[str, gpd.GeoDataFrame], box: tuple[float, float, float, float] | None = None
) -> tuple[dict[str, dict[str, list[str]]], dict[str, Any], NDArray[np.float64]]:
    """Return streets and buildings of one CRS for the script: arrays, settings and bounds.

    EmptyResultError if no shape intersects the box.
    """
    if "streets" in tables and NAME in tables["streets"]:
        tables = {**tables, "streets": _joined(tables["streets"])}
    simple = {kind: _simple(table, box) for kind, table in tables.items()}
    shapes = {kind: parts for kind, (parts, _) in simple.items() if len(parts)}
    if not shapes:
        raise EmptyResultError(
            "there are no streets or buildings to show; give some that are in the city."
        )
    arrays, about = _ground(shapes, next(iter(tables.values())).crs)
    if "streets" in shapes and NAME in tables["streets"]:
        # Each name once, and for each line the number of its name or -1.
        names = tables["streets"][NAME].iloc[simple["streets"][1]]
        numbers, titles = pd.factorize(names.where(names.notna() & (names != "")), sort=True)
        arrays["streets"]["names"] = packed(titles.astype(str).tolist())
        arrays["streets"]["called"] = steps(numbers.astype(np.int32))
    bounds = shapely.total_bounds(np.concatenate(list(shapes.values()))).reshape(2, 2)
    return arrays, about, bounds


def _joined(streets: gpd.GeoDataFrame) -> gpd.GeoDataFrame:
    """Return streets with the lines of each name joined, so that there is room for the name."""
    has_name = (streets[NAME].notna() & (streets[NAME] != "")).to_numpy()
    lines = (
        streets.geometry[has_name]
        .groupby(streets[NAME][has_name])
        .agg(lambda group: shapely.line_merge(shapely.multilinestrings(shapely.get_parts(group))))
    )
    others = streets.geometry[~has_name]
    return gpd.GeoDataFrame(
        {NAME: [*lines.index, *[None] * len(others)]},
        geometry=[*lines, *others],
        crs=streets.crs,
    )


def _simple(
    table: gpd.GeoDataFrame, box: tuple[float, float, float, float] | None
) -> tuple[NDArray[np.object_], NDArray[np.int64]]:
    """Return simplified lines or polygons of a table along a Hilbert curve, and their rows."""
    shapes = table.geometry.to_numpy()
    selected = ~(shapely.is_missing(shapes) | shapely.is_empty(shapes))
    if box is not None:
        selected &= shapely.intersects(shapes, shapely.box(*box))
    rows = np.flatnonzero(selected)
    parts, owner = shapely.get_parts(shapes[rows], return_index=True)
    parts = shapely.simplify(parts, DETAIL_M, preserve_topology=False)
    # Simplifying may empty a part or split it.
    solid = ~shapely.is_empty(parts)
    rows = rows[owner][solid]
    parts, owner = shapely.get_parts(parts[solid], return_index=True)
    # Outlines and courtyards in opposite directions, which the fill rule of a canvas needs.
    rows, parts = rows[owner], shapely.normalize(parts)
    order = hilbert_order(shapely.bounds(parts))
    return parts[order], rows[order]


def _ground(
    shapes: dict[str, NDArray[np.object_]], crs: CRS
) -> tuple[dict[str, dict[str, list[str]]], dict[str, Any]]:
    """Return the shapes for the script: points, ends of rings by point, ends of shapes by ring."""
    rings = {
        kind: shapely.get_rings(parts, return_index=True)
        if shapely.get_dimensions(parts[0]) == POLYGONAL
        else (parts, np.arange(len(parts)))
        for kind, parts in shapes.items()
    }
    points = {kind: shapely.get_coordinates(lines) for kind, (lines, _) in rings.items()}
    places, about = mercator(np.concatenate(list(points.values())), crs)
    # Streets and buildings share one origin, so all points are converted at once.
    arrays = {}
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
        arrays[kind] = {name: steps(values.astype(np.int32)) for name, values in numbers.items()}
    # Web Mercator stretches lengths by 1 / cos(latitude).
    middle = np.concatenate(list(points.values())).mean(axis=0, keepdims=True)
    latitude = float(to_latlon(middle, crs)[0, 0])
    return arrays, about | {"width": STREET_WIDTH_M / float(np.cos(np.radians(latitude)))}


def objects_map(
    objects: StreetObjects,
    *,
    database: SignatureDatabase | None = None,
    map_: folium.Map | None = None,
    tiles: str | None = None,
) -> folium.Map:
    """Show the street objects and their attributes.

    Parameters
    ----------
    objects : StreetObjects
        What to show.
    database : SignatureDatabase, optional
        The cells from which they are seen: a layer that is hidden at first. The search finds cells
        by number.
    map_, tiles : optional
        As in `evaluation_map`; on a map of your own the layers are hidden at first.

    Returns
    -------
    folium.Map
        The map, with a layer for each class, named with its sign and number of objects; a click
        shows class, source, identifier and place of an object. One canvas draws them all, so that
        hundreds of thousands of objects stay smooth.

    Raises
    ------
    EmptyResultError
        If there is no object.
    InputError
        As in `evaluation_map`.

    Examples
    --------
    >>> objects_map(demo_objects).options["maxZoom"]
    20
    """
    if len(objects) == 0:
        raise EmptyResultError("there is no street object to show; look at what was loaded.")
    page = start_map(map_, tiles, title="Street objects")
    if database is not None:
        add_city(page, database, show=False)
    key = f"objects{len(layers_of(page))}"
    Call("streetObjects", key, *_packed_objects(objects)).add_to(page)
    signs, counts = class_signs(objects.taxonomy), objects.class_counts
    families = codes_by_family(objects.taxonomy, counts)
    group_of = {
        code: f"objects:{family}" if len(families) > 1 else "objects"
        for family, codes in families.items()
        for code in codes
    }
    for number, (code, count) in enumerate(counts.items()):
        title = escaped_text(signs[code].title)
        # The layer control shows the name as HTML; folium would render a brace as a template.
        name = f"{sign_svg(signs[code])} {title} ({count:,})".replace("{", "&#123;")
        group = group_of[code]
        add_layer(page, name, "classLayer", key, number, group=group, show=map_ is None)
    return finish_map(
        page,
        objects if database is None else database,
        legend=objects_legend(objects),
        view=corners_of(objects) if map_ is None else None,
        licenses=tuple(map(str, objects.licenses)),
    )


def _packed_objects(objects: StreetObjects) -> tuple[dict[str, list[str]], dict[str, Any]]:
    """Return the objects for the script, by class and along a Hilbert curve, and settings."""
    # Neighbours have small differences of coordinates, which compress well.
    near = hilbert_order(np.column_stack([objects.xy, objects.xy]))
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
    if objects.groups is not None:
        arrays["part"] = _parts(objects.groups[order])
    texts = [name for name in TEXTS if name in table]
    arrays |= {f"text.{name}": table[name].astype(str).tolist() for name in texts}
    signs, counts = class_signs(objects.taxonomy), objects.class_counts
    ends = np.cumsum(list(counts.values())).tolist()
    classes = [
        {**sign_look(signs[code]), "start": end - count, "end": end}
        for (code, count), end in zip(counts.items(), ends, strict=True)
    ]
    about |= {
        "classes": classes,
        "sources": sources.tolist(),
        "fields": FIELDS,
        "texts": {f"text.{name}": TEXT_TITLES[name] for name in texts},
        # Rare classes last, so that they lie on top.
        "order": np.argsort([-count for count in counts.values()], kind="stable").tolist(),
    }
    columns = {name: packed(values) for name, values in arrays.items()}
    columns |= {name: steps(part) for name, part in zip("xy", places.T, strict=True)}
    return columns, about


def _parts(groups: NDArray[np.int32]) -> NDArray[np.uint8]:
    """Return 1 for the points of extended things, but for one in the middle of each: its sign."""
    sizes = np.bincount(groups[groups >= 0])
    within = pd.Series(groups).groupby(groups).cumcount().to_numpy()
    middle = np.where(groups < 0, 0, sizes[groups] // 2)
    parts: NDArray[np.uint8] = ((groups >= 0) & (within != middle)).astype(np.uint8)
    return parts


def objects_legend(objects: StreetObjects) -> str:
    """Return the legend of `objects_map` as HTML with data escaped."""
    signs, counts = class_signs(objects.taxonomy), objects.class_counts

    def table(codes: Iterable[int]) -> str:
        rows = "".join(
            f"<tr><td>{sign_svg(signs[code])}</td>"
            f"<td class='title'>{escaped_text(signs[code].title)}</td>"
            f"<td><small>{escape(signs[code].symbol)}</small></td>"
            f'<td class="count">{counts[code]:,}</td></tr>'
            for code in codes
        )
        return f"<table>{rows}</table>"

    families = codes_by_family(objects.taxonomy, counts)
    parts = [
        folded_part(
            f"{family_svg(family)} {escape(family_named(family).title)}"
            f" ({sum(counts[code] for code in codes):,})",
            table(codes),
        )
        for family, codes in families.items()
        if len(families) > 1
    ]
    return (
        "<summary>Street objects</summary>"
        f"<p><b>{len(objects):,}</b> objects of {len(counts)} classes<br>"
        f"Click one for details</p>{''.join(parts) or table(counts)}"
        f"{credits_part(map(str, objects.licenses))}"
    )
