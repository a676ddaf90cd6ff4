"""What there is to say of the cells of an area together: hexagons of H3, and squares of cells."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import geopandas as gpd
import h3
import numpy as np
import shapely
from pyproj import Transformer

from semsig_gis.core import InputError
from semsig_gis.database import database_specs
from semsig_gis.exports.layers import table_layer
from semsig_gis.exports.styles import AMBIGUITY, IDENTIFIABILITY, by_amount

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation, Identifiability
    from semsig_gis.exports.layers import Layer
    from semsig_gis.objects import StreetObjects


FINEST = 15


def hexagons_layer(
    database: SignatureDatabase,
    resolution: int,
    *,
    objects: StreetObjects | None = None,
    identifiability: Identifiability | None = None,
    evaluation: Evaluation | None = None,
) -> Layer:
    """Return the hexagons of H3 with a cell, an object or a query in them, in the database's CRS.

    ``h3`` is the index; beside the columns of `summary`, ``objects`` counts the street objects,
    ``queries`` those of the evaluation and ``found`` is the share of these that succeeded.
    """
    if not 0 <= resolution <= FINEST:
        raise InputError(
            f"resolution {resolution} was given for hexagons; give 0 to {FINEST} (finest)."
        )
    to_degrees = Transformer.from_crs(database.crs, "EPSG:4326")

    def hexagons(xy: NDArray[np.float64]) -> NDArray[np.uint64]:
        places = zip(*(part.tolist() for part in to_degrees.transform(*xy.T)), strict=True)
        listed = (h3.str_to_int(h3.latlng_to_cell(*place, resolution)) for place in places)
        return np.fromiter(listed, np.uint64, len(xy))

    places = [database.xy]
    places += [] if objects is None else [objects.xy]
    places += [] if evaluation is None else [_places(evaluation)]
    ids, numbers = np.unique(np.concatenate([*map(hexagons, places)]), return_inverse=True)
    of_cells, *others = np.split(numbers, np.cumsum([len(xy) for xy in places])[:-1])
    names = [*map(h3.int_to_str, ids.tolist())]
    columns: dict[str, Any] = {"h3": names}
    columns |= summary(database, of_cells, len(ids), identifiability=identifiability)
    draw = [("Ambiguity", "type_group_size", AMBIGUITY)]
    if identifiability is not None:
        draw.insert(0, ("Identifiability", "chance_found", IDENTIFIABILITY))
    if objects is not None:
        columns["objects"] = np.bincount(others.pop(0), minlength=len(ids))
    if evaluation is not None:
        (of_queries,) = others
        columns["queries"] = np.bincount(of_queries, minlength=len(ids))
        columns["found"] = _means(of_queries, evaluation.successful, len(ids))
        draw.insert(0, ("Queries found", "found", IDENTIFIABILITY))
    rings = [h3.cell_to_boundary(name) for name in names]
    latitudes, longitudes = np.concatenate([np.asarray(ring) for ring in rings]).T
    xy = np.stack(to_degrees.transform(latitudes, longitudes, direction="INVERSE"), axis=1)
    of_corner = np.repeat(np.arange(len(rings)), [*map(len, rings)])
    shapes = shapely.polygons(shapely.linearrings(xy, indices=of_corner))
    return table_layer(
        gpd.GeoDataFrame(columns, geometry=shapes, crs=database.crs),
        name="hexagons",
        title="Hexagons",
        description=f"The cells in each hexagon of H3 of resolution {resolution}, together.",
        geometry="polygon",
        licenses=database.licenses,
        facts={**database_specs(database), "h3_resolution": resolution},
        styles=tuple(by_amount(*each, geometry="polygon", size=0.0) for each in draw),
    )


def summary(
    database: SignatureDatabase,
    areas: NDArray[np.int64],
    count: int,
    *,
    identifiability: Identifiability | None = None,
) -> dict[str, NDArray[Any]]:
    """Return what there is to say of the cells of each area, by the number of each cell's area.

    ``cells`` counts them, ``mean_length`` is the mean number of objects that they see, and
    ``ambiguous`` the share of them that look like another cell, by types; ``type_group_size`` is
    the median, and ``chance_found`` the mean chance that a query from there is found. NaN where
    there is no cell.
    """
    cells, sizes = np.bincount(areas, minlength=count), database.type_group_sizes
    in_order = sizes[np.lexsort((sizes, areas))]
    middles = np.cumsum(cells) - cells + (cells - 1) // 2
    medians = np.where(cells > 0, in_order[np.minimum(middles, len(in_order) - 1)], np.nan)
    columns = {
        "cells": cells,
        "mean_length": _means(areas, database.lengths, count),
        "ambiguous": _means(areas, sizes > 1, count),
        "type_group_size": medians,
    }
    if identifiability is not None:
        columns["chance_found"] = _means(areas, identifiability.found, count)
    return columns


def _means(areas: NDArray[np.int64], values: NDArray[Any], count: int) -> NDArray[np.float64]:
    """Return the mean of the values in each area, NaN where there are none."""
    numbers = np.bincount(areas, minlength=count)
    means = np.full(count, np.nan)
    np.divide(np.bincount(areas, values, count), numbers, out=means, where=numbers > 0)
    return means


def _places(evaluation: Evaluation) -> NDArray[np.float64]:
    return np.asarray(shapely.get_coordinates(evaluation.queries.geometry.array))
