"""The layer of the cells."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow as pa
import shapely

from semsig_gis.core import GEOMETRY
from semsig_gis.database import CellTable, cells_checksum, database_specs
from semsig_gis.output.layers import LAYERS
from semsig_gis.output.layers.columns import form_of
from semsig_gis.output.layers.model import (
    CHECKSUM,
    EXPORTED,
    Display,
    Layer,
    group_means,
    table_layer,
)
from semsig_gis.output.layers.styles import AMBIGUITY, IDENTIFIABILITY, by_amount

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database import CellGeometry, SignatureDatabase
    from semsig_gis.evaluation import Identifiability

FORM = form_of("""
["What is seen"]
types = ["Types", "Symbols of the street objects that are seen, clockwise from north."]
length = ["Objects seen", "How many street objects are seen from the cell."]
bearings = ["Bearings", "Of the same objects, clockwise from grid north.", "°"]
distances = ["Distances", "Of the same objects, from the viewpoint.", "m"]
extents = ["Extents", "Angles over which extended things are seen; 0 for others.", "°"]
levels = ["Angle levels", "The bearings, in whole sectors of the full turn."]
["Cells like it"]
type_group_size = ["Cells with the same types", "1: no other cell."]
angle_group_size = ["Cells with the same bearings", "By angle level; 1: no other cell."]
chance_found = ["Chance to be found", "That the best place for a query from here is near, from 0 to 1.", "1", 3]
chance_near = ["Chance given to places near", "Expected, of the answer to a query from here, from 0 to 1.", "1", 3]
chance_itself = ["Chance given to the cell", "Expected, of the answer to a query from here, from 0 to 1.", "1", 3]
bits_left = ["Bits left to be known", "Expected entropy of the answer to a query from here.", "", 2]
["What it is mistaken for"]
"lookalike_#" = ["Confused cell {}", "Number of a cell far away that a query from here is mistaken for."]
"lookalike_#_chance" = ["Chance of confused cell {}", "Expected chance given to its surroundings.", "", 4]
["Gain by class"]
"gain_*" = ["Gain by: {}", "By how much the chance of places near rises because such objects are known.", "", 4]
[Place]
cell_id = ["Cell", "Number of the cell in the grid."]
x = ["Viewpoint, east", "In the coordinate system of the layer.", "m", 2]
y = ["Viewpoint, north", "In the coordinate system of the layer.", "m", 2]
""")  # noqa: E501
DISPLAY = Display(
    level=0,
    group="City",
    name="""'cell ' || "cell_id" """,
    signature=("types", "bearings", "distances", " "),
    tip=("type_group_size", "chance_found", "lookalike_1"),
)


@LAYERS.register
def cells_layer(
    database: SignatureDatabase,
    *,
    identifiability: Identifiability | None = None,
    geometry: CellGeometry = "polygon",
) -> Layer:
    """Return the layer of the cells, as squares or as points."""
    cells = CellTable(database, geometry=geometry)
    if identifiability is not None:
        identifiability.require_cells_of(database)

    def read(rows: slice) -> pa.Table:
        columns = cells.columns(rows)
        if identifiability is not None:
            table = identifiability.table(rows)
            columns |= dict(zip(table.column_names, table.columns, strict=True))
        return pa.table({**columns, GEOMETRY: shapely.to_wkb(cells.shapes(rows))})

    step = database.grid.step
    crs = database.crs.to_json_dict()
    facts = {**database_specs(database), "crs": crs, "identifiability": None}
    facts |= {EXPORTED: len(database), CHECKSUM: cells_checksum(database)}
    style = functools.partial(by_amount, geometry=geometry, size=step)
    styles = [style("Ambiguity", "type_group_size", AMBIGUITY, heading="cells like it")]
    if identifiability is not None:
        facts["identifiability"] = identifiability.facts
        styles.insert(0, style("Identifiability", "chance_found", IDENTIFIABILITY))
    corners = [(axis.min(), axis.max()) for axis in (database.columns, database.rows)]
    (west, south), (east, north) = database.grid.viewpoints(*corners).tolist()
    margin = step / 2 if geometry == "polygon" else 0.0
    return Layer(
        name="cells",
        title="Signature cells",
        description=(
            f"Cells of {step:g} m with the street objects that are seen within "
            f"{database.spec.radius:g} m of their centre, clockwise from north."
        ),
        geometry=geometry,
        crs=database.crs,
        rows=len(database),
        bounds=(west - margin, south - margin, east + margin, north + margin),
        read=read,
        licenses=database.licenses,
        facts=facts,
        form=FORM,
        display=DISPLAY,
        styles=tuple(styles),
        taxonomy=database.taxonomy,
        reach=database.near_reach,
        cell_size=step,
        squares=functools.partial(squares_layer, database, identifiability=identifiability),
    )


def squares_layer(
    database: SignatureDatabase, side: int, *, identifiability: Identifiability | None = None
) -> Layer:
    """Return the layer of the squares of `side` by `side` cells that contain a cell."""
    cells = np.stack([database.columns, database.rows], axis=1)
    squares, areas = np.unique(cells // side, axis=0, return_inverse=True)
    low = database.grid.origin + squares * (database.grid.step * side)
    high = low + database.grid.step * side
    number, areas = len(squares), areas.ravel()
    columns = area_statistics(database, areas, number, identifiability=identifiability)
    return table_layer(
        gpd.GeoDataFrame(columns, geometry=shapely.box(*low.T, *high.T), crs=database.crs),
        name="squares",
        title="Squares of cells",
        description="The cells in each square, together.",
        geometry="polygon",
        licenses=(),
        facts={},
    )


def area_statistics(
    database: SignatureDatabase,
    areas: NDArray[np.int64],
    count: int,
    *,
    identifiability: Identifiability | None = None,
) -> dict[str, NDArray[Any]]:
    """Return statistics of the cells in each area; `areas` has the area number of each cell.

    ``cells`` is their number, ``mean_length`` the mean number of objects that they see,
    ``ambiguous`` the share of cells with the types of another cell, ``type_group_size`` the median,
    and ``chance_found`` the mean chance to be found. NaN in an area without cells.
    """
    cells, sizes = np.bincount(areas, minlength=count), database.type_group_sizes
    # Lower median: the middle row of each area, with the rows sorted by area and size.
    ordered = sizes[np.lexsort((sizes, areas))]
    middles = np.cumsum(cells) - cells + (cells - 1) // 2
    medians = np.where(cells > 0, ordered[np.minimum(middles, len(ordered) - 1)], np.nan)
    columns = {
        "cells": cells,
        "mean_length": group_means(areas, database.lengths, count),
        "ambiguous": group_means(areas, sizes > 1, count),
        "type_group_size": medians,
    }
    if identifiability is not None:
        columns["chance_found"] = group_means(areas, identifiability.found, count)
    return columns
