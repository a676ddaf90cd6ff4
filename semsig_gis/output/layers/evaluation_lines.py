"""The layer of the lines from the true places of queries to their best places."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

from semsig_gis.output.layers import LAYERS
from semsig_gis.output.layers.columns import form_of
from semsig_gis.output.layers.evaluation import (
    GROUP,
    QUERY_NAME,
    evaluation_facts,
    queries_with_outcome,
)
from semsig_gis.output.layers.model import Display, table_layer
from semsig_gis.output.layers.styles import by_outcome

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation
    from semsig_gis.output.layers.model import Layer


FORM = form_of("""
[Query]
number = ["Query", "Its number, from 0."]
outcome = ["Outcome", "Successful: within 50 m of the true place with a probability of 0.5 or more."]
off_m = ["Length", "From the true to the best place.", "m", 1]
error_m = ["Error", "Expected, where cells tie.", "m", 1]
cell_id = ["True cell", "Number of the cell in the grid."]
best_cell_id = ["Best cell", "Number of the cell in the grid."]
seed = ["Seed", "Of the random numbers of the query."]
""")  # noqa: E501


@LAYERS.register
def evaluation_lines_layer(evaluation: Evaluation, database: SignatureDatabase) -> Layer:
    """Return the layer of lines from the true place of each query to a different best place."""
    queries = queries_with_outcome(evaluation)
    placed = queries[queries["best_x"].notna().to_numpy()]
    truth = shapely.get_coordinates(placed.geometry.array)
    best = placed[["best_x", "best_y"]].to_numpy(np.float64)
    lines = placed[["seed", "number", "cell_id", "best_cell_id", "outcome", "error_m"]].assign(
        off_m=np.hypot(*(best - truth).T)
    )
    segments = shapely.linestrings(np.stack([truth, best], axis=1))
    lines = lines.set_geometry(segments, crs=queries.crs)
    return table_layer(
        lines[lines["off_m"] > 0],
        name="evaluation_lines",
        title="From the true to the best place",
        description="Each query's true place, joined to the best place that was found for it.",
        geometry="line",
        form=FORM,
        display=Display(level=4, group=GROUP, name=QUERY_NAME, tip=("off_m",), hidden=True),
        styles=(by_outcome(geometry="line"),),
        **evaluation_facts(evaluation, database),
    )
