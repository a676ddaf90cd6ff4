"""The layer of H3 hexagons, with statistics of the cells in each."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import h3
import numpy as np
import shapely
from pyproj import Transformer

from semsig_gis.core import InputError
from semsig_gis.database import database_specs
from semsig_gis.output.layers import LAYERS
from semsig_gis.output.layers.cells import area_statistics
from semsig_gis.output.layers.columns import form_of
from semsig_gis.output.layers.model import Display, group_means, table_layer
from semsig_gis.output.layers.styles import AMBIGUITY, IDENTIFIABILITY, by_amount

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation, Identifiability
    from semsig_gis.objects import StreetObjects
    from semsig_gis.output.layers.model import Layer


FINEST = 15
FORM = form_of("""
[Hexagon]
h3 = ["Hexagon", "Its index of H3."]
cells = ["Cells", "How many cells it has."]
objects = ["Street objects", "How many street objects it has."]
mean_length = ["Objects seen", "From its mean cell.", "", 1]
type_group_size = ["Cells with the same types", "For the median cell; 1: no other cell.", "", 0]
ambiguous = ["Share that look like another", "Of its cells, by types, from 0 to 1.", "1", 3]
chance_found = ["Chance to be found", "For a query from its mean cell, from 0 to 1.", "1", 3]
queries = ["Queries", "How many queries of the evaluation are from it."]
found = ["Share found", "Of these queries, from 0 to 1.", "1", 3]
""")
DISPLAY = Display(
    level=2,
    group="City",
    name="""'hexagon ' || "h3" """,
    tip=("cells", "objects", "chance_found", "found"),
    farther=25000,
    covers="cells",
)


@LAYERS.register
def hexagons_layer(
    database: SignatureDatabase,
    resolution: int,
    *,
    objects: StreetObjects | None = None,
    identifiability: Identifiability | None = None,
    evaluation: Evaluation | None = None,
) -> Layer:
    """Return the layer of H3 hexagons that contain a cell, object or query, in the database's CRS.

    ``h3`` is the index. In addition to the columns of `area_statistics`, ``objects`` is the number
    of street objects, ``queries`` the number of queries and ``found`` their share of successes.
    """
    if not 0 <= resolution <= FINEST:
        raise InputError(
            f"resolution {resolution} was given for hexagons; give 0 to {FINEST} (finest)."
        )
    to_degrees = Transformer.from_crs(database.crs, "EPSG:4326")

    def hexagon_ids(xy: NDArray[np.float64]) -> NDArray[np.uint64]:
        places = zip(*(axis.tolist() for axis in to_degrees.transform(*xy.T)), strict=True)
        ids = (h3.str_to_int(h3.latlng_to_cell(*place, resolution)) for place in places)
        return np.fromiter(ids, np.uint64, len(xy))

    # Number the hexagons of all places, then split the numbers by cells, objects and queries.
    places = [database.xy]
    places += [] if objects is None else [objects.xy]
    if evaluation is not None:
        places.append(np.asarray(shapely.get_coordinates(evaluation.queries.geometry.array)))
    ids, numbers = np.unique(np.concatenate([*map(hexagon_ids, places)]), return_inverse=True)
    of_cells, *others = np.split(numbers, np.cumsum([len(xy) for xy in places])[:-1])
    names = [*map(h3.int_to_str, ids.tolist())]
    columns: dict[str, Any] = {"h3": names}
    columns |= area_statistics(database, of_cells, len(ids), identifiability=identifiability)
    style = functools.partial(by_amount, geometry="polygon")
    styles = [style("Ambiguity", "type_group_size", AMBIGUITY, heading="cells like it")]
    if identifiability is not None:
        styles.insert(0, style("Identifiability", "chance_found", IDENTIFIABILITY))
    if objects is not None:
        columns["objects"] = np.bincount(others.pop(0), minlength=len(ids))
    if evaluation is not None:
        (of_queries,) = others
        columns["queries"] = np.bincount(of_queries, minlength=len(ids))
        columns["found"] = group_means(of_queries, evaluation.successful, len(ids))
        styles.insert(0, style("Queries found", "found", IDENTIFIABILITY))
    # The corners of all hexagons are projected together.
    rings = [h3.cell_to_boundary(name) for name in names]
    latitudes, longitudes = np.concatenate([np.asarray(ring) for ring in rings]).T
    xy = np.stack(to_degrees.transform(latitudes, longitudes, direction="INVERSE"), axis=1)
    hexagon_numbers = np.repeat(np.arange(len(rings)), [*map(len, rings)])
    shapes = shapely.polygons(shapely.linearrings(xy, indices=hexagon_numbers))
    return table_layer(
        gpd.GeoDataFrame(columns, geometry=shapes, crs=database.crs),
        name="hexagons",
        title="Hexagons",
        description=f"The cells in each hexagon of H3 of resolution {resolution}, together.",
        geometry="polygon",
        licenses=database.licenses,
        facts={**database_specs(database), "h3_resolution": resolution},
        form=FORM,
        display=DISPLAY,
        styles=tuple(styles),
    )
