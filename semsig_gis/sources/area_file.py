"""Read the polygons of an area from a file of any vector format, or of Osmosis (``.poly``)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import shapely

from semsig_gis.core import CrsError, InputError, listed
from semsig_gis.sources import vector
from semsig_gis.sources.layer_spec import LayerSpec
from semsig_gis.sources.parquet import SUFFIXES, read_parquet
from semsig_gis.sources.paths import FILE_SUFFIXES, require_file
from semsig_gis.sources.rows import WGS84, fits_the_globe

if TYPE_CHECKING:
    import geopandas as gpd

NUMBERS = re.compile(r"[\s\[(]*[\s\d.,;eE+-]*\d[\s\d.,;eE+-]*[\])\s]*")
POLY = ".poly"
LEAST_CORNERS = 3


def names_place(text: str) -> bool:
    """Whether a text is the name of a place, not numbers and not a path, existing or missing."""
    path = Path(text)
    is_file = path.suffix.lower() in FILE_SUFFIXES or path.is_file()
    return not is_file and not NUMBERS.fullmatch(text)


def read_polygons(path: Path) -> gpd.GeoSeries:
    """Return the geometries of a file with its CRS; degrees if it states none and they can be.

    InputError if a feature cannot be read, SourceError if the file cannot, CrsError if it states no
    CRS and has other numbers than degrees.
    """
    suffix = path.suffix.lower()
    if names_place(str(path)):
        raise InputError(
            f"area {str(path)!r} is neither a bounding box nor a file; write west,south,east,north "
            "in degrees, or the path of a file with polygons."
        )
    if suffix in SUFFIXES:
        return read_parquet(path, kind="polygons").geometry
    if suffix == POLY:
        import geopandas as gpd  # noqa: PLC0415 - 0.7 s

        return gpd.GeoSeries([_read_poly(path)], crs=WGS84)
    spec = LayerSpec(name="area", class_name="", geometry="polygon", layer=_layer_name(path))
    try:
        layer = vector.read_layer(path, spec)
    except CrsError:
        try:
            layer = vector.read_layer(path, spec, crs="EPSG:4326")
        except CrsError as error:
            raise CrsError(
                f"the coordinates of {path} are not degrees, longitude first, and it states no "
                "other coordinate reference system; write it with one, or in degrees, such as by "
                f"`ogr2ogr -s_srs EPSG:2154 -t_srs EPSG:4326 area.gpkg {path.name}`, where "
                "EPSG:2154 is that of its coordinates."
            ) from error
    if layer.errors:
        raise InputError(
            f"{path} has {layer.counts.unreadable} polygons that cannot be read "
            f"({layer.errors[0]}); correct the file."
        )
    shapes = layer.table.geometry
    # The outline of an area may be a line that ends where it begins.
    closed = (shapes.geom_type == "LineString") & shapes.is_closed
    shapes[closed] = [shapely.Polygon(line.coords) for line in shapes[closed]]
    return shapes


def _layer_name(path: Path) -> str | None:
    """Return the name of the only layer of polygons of a file with several layers."""
    layers = vector.list_layers(path)
    if len(layers) < 2:  # noqa: PLR2004
        return None
    names = [layer.name for layer in layers if "Polygon" in layer.geometry]
    if len(names) == 1:
        return names[0]
    raise InputError(
        f"{path} has {len(names) or 'no'} layers of polygons ({listed([i.name for i in layers])}); "
        f"write one to a file of its own, such as by `ogr2ogr area.gpkg {path.name} "
        f"{(names or ['LAYER'])[0]}`."
    )


def _read_poly(path: Path) -> shapely.Geometry:
    """Return the area of a file of Osmosis: rings that are added, or with ``!`` taken away."""
    require_file(path, "a .poly file")
    lines = enumerate(path.read_text("utf-8", errors="replace").splitlines(), start=1)
    # The first line is the name of the area.
    _, *rest = [(number, line.strip()) for number, line in lines if line.strip()] or [(0, "")]
    area: shapely.Geometry = shapely.Polygon()
    ring: list[tuple[float, float]] | None = None
    hole = False
    for number, line in [*rest, (0, "END")]:
        if ring is None:  # the name of a ring, or the end of the file
            if line != "END":
                ring, hole = [], line.startswith("!")
        elif line != "END":
            try:
                x, y = map(float, line.split())
            except ValueError as error:
                raise InputError(
                    f"line {number} of {path} is not a longitude and a latitude; a .poly file has "
                    "a name, and for each ring a number, its corners and END."
                ) from error
            ring.append((x, y))
        else:
            if len(ring) < LEAST_CORNERS:
                raise InputError(
                    f"{path} has a ring of {len(ring)} corners; a .poly file has a name, and for "
                    "each ring a number, at least three corners and END."
                )
            if not fits_the_globe(np.array(ring)):
                raise CrsError(
                    f"{path} has corners such as ({ring[0][0]:.10g}, {ring[0][1]:.10g}), which are "
                    "not degrees, longitude first; a .poly file is in degrees."
                )
            polygon = shapely.make_valid(shapely.Polygon(ring))
            area = shapely.difference(area, polygon) if hole else shapely.union(area, polygon)
            ring = None
    return area
