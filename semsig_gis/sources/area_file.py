"""Read the polygons of an area from a file of any vector format, or of Osmosis (``.poly``)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

from semsig_gis.core import CrsError, InputError
from semsig_gis.sources import vector
from semsig_gis.sources.layer_spec import LayerSpec
from semsig_gis.sources.parquet import SUFFIXES, read_parquet
from semsig_gis.sources.paths import require_file
from semsig_gis.sources.rows import WGS84, fits_the_globe

if TYPE_CHECKING:
    from pathlib import Path

    import geopandas as gpd

POLY = ".poly"
LEAST_CORNERS = 3


def read_polygons(path: Path) -> gpd.GeoSeries:
    """Return the geometries of a file with its CRS; degrees if it states none and they can be.

    InputError if a feature cannot be read, SourceError if the file cannot, CrsError if it states no
    CRS and has other numbers than degrees.
    """
    suffix = path.suffix.lower()
    if suffix in SUFFIXES:
        return read_parquet(path, kind="polygons").geometry
    if suffix == POLY:
        import geopandas as gpd  # noqa: PLC0415 - 0.7 s

        return gpd.GeoSeries([_read_poly(path)], crs=WGS84)
    spec = LayerSpec(name="area", class_name="", geometry="polygon")
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
    return layer.table.geometry


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
