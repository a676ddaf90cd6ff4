"""Map of an exported answer: the regions to search and the candidates of a vector file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import pandas as pd
import pyogrio
import shapely

from semsig_gis.core import CHANCES, InputError, percent
from semsig_gis.database import require_same_place
from semsig_gis.output.html.location import CANDIDATE
from semsig_gis.output.html.page_elements import (
    add_city,
    add_layer,
    corners_of,
    credits_part,
    exact_latlon,
    finish_map,
    shades_part,
    start_map,
    swatch,
)

if TYPE_CHECKING:
    import folium

    from semsig_gis.database import SignatureDatabase

RASTER_SUFFIXES = frozenset({".tif", ".tiff"})
"""Suffixes of files with the chance of every cell, which `open_posterior` reads instead."""

POLYGONAL = 2
FIELDS = ("Chance", "Cells", "Square kilometres", "Sees", "Cell")
COLUMNS = ("chance", "cells", "km2", "types", "cell_id")
REGION = {"color": CHANCES[0.9], "weight": 3, "opacity": 0.9, "fill": True, "fillOpacity": 0.25}


def answer_map(
    path: str | Path,
    database: SignatureDatabase,
    *,
    map_: folium.Map | None = None,
    tiles: str | None = None,
) -> folium.Map:
    """Show the regions to search and the candidates of an exported answer.

    `path` is a file of `export_answer` in any of its formats except a raster; `map_` and `tiles`
    are as in `evaluation_map`. InputError if it contains no answer from this database.
    """
    shapes = _shapes(Path(path), database)
    polygons = shapely.get_dimensions(shapes.geometry.array) == POLYGONAL
    page = start_map(map_, tiles, title="Where it was seen")
    add_city(page, database)
    regions, candidates = shapes[polygons], shapes[~polygons]
    regions = regions.assign(cell_id=regions["best_cell_id"])
    rings = shapely.get_rings(regions.geometry.array)
    lines = [exact_latlon(shapely.get_coordinates(ring), database.crs) for ring in rings]
    middles = regions.geometry.representative_point()
    parts = [["lines", [[REGION, lines]]], _points("Region", regions, middles, CHANCES[0.9])]
    add_layer(page, f"Regions to search ({len(regions):,})", "drawings", parts, group="answer")
    if len(candidates):
        points = _points("Candidate", candidates, candidates.geometry, CANDIDATE)
        name = f"Candidates ({len(candidates):,})"
        add_layer(page, name, "drawings", [points], group="answer")
    legend = (
        "<summary>Where it was seen</summary>"
        f"<p>{swatch(CHANCES[0.9])}Regions to search: {len(regions):,}"
        f"<br>{swatch(CANDIDATE)}Candidates by rank: {len(candidates):,}</p>"
        f"{shades_part()}{credits_part(database.licenses)}"
    )
    view = corners_of(database) if map_ is None else None
    return finish_map(page, database, legend=legend, view=view)


def _shapes(path: Path, database: SignatureDatabase) -> gpd.GeoDataFrame:
    """Return the rows of a file that have a rank, in the coordinate system of the database."""
    try:
        if path.suffix.lower() == ".parquet":
            tables = [gpd.read_parquet(path)]
        else:
            layers = [name for name, kind in pyogrio.list_layers(path) if kind is not None]
            tables = [pyogrio.read_dataframe(path, layer=name) for name in layers]
    except (OSError, ValueError, pyogrio.errors.DataSourceError) as error:
        raise InputError(
            f"{path} cannot be read ({error}); give a file that semsig localize --out wrote."
        ) from error
    ranked = [table for table in tables if "rank" in table]
    if not any("best_cell_id" in table for table in ranked):
        raise InputError(
            f"{path} contains no answer; give a file that semsig localize --out wrote."
        )
    projected = [
        table.set_crs(database.crs) if table.crs is None else table.to_crs(database.crs)
        for table in ranked
    ]
    shapes = pd.concat(projected, ignore_index=True)
    shapes = shapes[shapes["rank"].notna()].sort_values("rank", kind="stable")
    places = shapely.get_coordinates(shapes.geometry.array)
    require_same_place(database, places, "corners and places of the answer")
    return shapes


def _points(name: str, rows: gpd.GeoDataFrame, places: gpd.GeoSeries, colour: str) -> list[Any]:
    """Return the drawing of rows as numbered signs, the best last so that it lies on top."""
    latlon = exact_latlon(shapely.get_coordinates(places.array), rows.crs)
    records = []
    for place, row in zip(latlon, rows.to_dict("records"), strict=True):
        rank = int(row["rank"])
        details = [_text(column, row.get(column)) for column in COLUMNS]
        records.append([place, colour, 8, f"{name} {rank:,}", details, str(rank)])
    return ["points", FIELDS, {}, records[::-1]]


def _text(column: str, value: Any) -> str | None:  # noqa: ANN401 - any type of a file column
    if pd.isna(value) or value == "":
        return None
    if column == "types":
        return str(value)
    number = float(value)  # KML and CSV contain texts
    texts = {"chance": percent(number), "km2": f"{number:.4g}"}
    return texts.get(column, f"{number:.0f}")
