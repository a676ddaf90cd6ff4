"""The layers of an answer."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd

from semsig_gis.database import CellTable
from semsig_gis.output.layers.model import Layer, table_layer
from semsig_gis.output.styles import (
    by_answer,
    by_rank,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import Answer, SearchRegions
    from semsig_gis.output.layers.model import Layer


def answer_layers(
    answer: Answer, database: SignatureDatabase, regions: SearchRegions
) -> list[Layer]:
    """Return layers of the regions to search, the candidates and, if estimated, the place."""
    candidates = answer.to_geodataframe()
    cells = CellTable(database.select(candidates["cell"].to_numpy()))
    columns = cells.columns(slice(0, len(candidates)))
    candidates = candidates.assign(bearings=columns["bearings"], distances=columns["distances"])
    values: Mapping[str, Any] = answer.to_dict()
    licenses, place = tuple(values["licenses"]), values.get("place")
    facts = {name: values[name] for name in values if name not in {"candidates", "crs", "licenses"}}
    facts["searched"] = regions.to_dict()
    layer = functools.partial(
        table_layer,
        licenses=licenses,
        facts=facts,
        taxonomy=answer.taxonomy,
        reach=database.reach,
    )
    layers = [
        layer(
            regions.table,
            name="regions",
            title="Regions to search",
            description="Where the query may have been seen from, the best first.",
            geometry="polygon",
            styles=(by_rank("rank", geometry="polygon"),),
        ),
        layer(
            candidates,
            name="candidates",
            title="Candidates",
            description="The best places or cells for the query.",
            geometry="point",
            styles=(by_rank(str(answer.candidates.columns[0]), geometry="point"),),
        ),
    ]
    if place is None:
        return layers
    row: dict[str, Any] = {"answer": "given" if facts["answered"] else "withheld"}
    row |= {name: value for name, value in place.items() if isinstance(value, (bool, int, float))}
    row |= {name: np.nan if facts[name] is None else facts[name] for name in ("elsewhere", "fit")}
    points = gpd.points_from_xy([place["x"]], [place["y"]])
    estimate = layer(
        gpd.GeoDataFrame(pd.DataFrame([row]), geometry=points, crs=answer.crs),
        name="place",
        title="Place",
        description="Where the query was most probably seen from, and how sure that is.",
        geometry="point",
        styles=(by_answer(),),
    )
    return [*layers, estimate]
