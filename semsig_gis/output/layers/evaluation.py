"""The layers of an evaluation."""

from __future__ import annotations

import functools
import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from semsig_gis.core import (
    OUTCOMES,
)
from semsig_gis.output.layers.model import Layer, table_layer
from semsig_gis.output.styles import (
    by_outcome,
)

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation
    from semsig_gis.output.layers.model import Layer


# Columns of queries that a GeoPackage moves to a separate table, because there are many of them.
FIGURE = re.compile(r"(p|near)\d+")


def evaluation_layers(evaluation: Evaluation, database: SignatureDatabase) -> list[Layer]:
    """Return two layers: queries at their true places, and lines to their best places."""
    successful, failed = OUTCOMES
    outcomes = np.where(evaluation.successful, successful, failed)
    queries = evaluation.queries.assign(outcome=outcomes)
    # Lines need a best place that differs from the true place.
    placed = queries[queries["best_x"].notna().to_numpy()]
    truth = shapely.get_coordinates(placed.geometry.array)
    best = placed[["best_x", "best_y"]].to_numpy(np.float64)
    lines = placed[["seed", "number", "cell_id", "best_cell_id", "outcome", "error_m"]].assign(
        off_m=np.hypot(*(best - truth).T)
    )
    segments = shapely.linestrings(np.stack([truth, best], axis=1))
    lines = lines.set_geometry(segments, crs=queries.crs)
    lines = lines[lines["off_m"] > 0]
    summary = evaluation.summary()
    facts = {name: summary[name] for name in ("settings", "database", "versions")}
    layer = functools.partial(
        table_layer,
        licenses=database.licenses,
        facts=facts,
        taxonomy=database.taxonomy,
        reach=database.reach,
    )
    return [
        layer(
            queries,
            name="evaluation",
            title="Queries",
            description=(
                f"{len(queries)} queries at their true places; successful: the best place is "
                f"within {evaluation.success_metres} m with a probability of "
                f"{evaluation.success_probability:g} or more."
            ),
            geometry="point",
            styles=(by_outcome(geometry="point"),),
        ),
        layer(
            lines,
            name="evaluation_lines",
            title="From the true to the best place",
            description="Each query's true place, joined to the best place that was found for it.",
            geometry="line",
            styles=(by_outcome(geometry="line"),),
        ),
    ]


def split_figures(queries: Layer) -> list[Layer]:
    """Split the layer of queries: its other columns, and a table of figures by seed and number."""
    names = queries.read(slice(0, 0)).column_names
    figures = [name for name in names if FIGURE.fullmatch(name)]
    return [
        replace(queries, read=lambda rows: queries.read(rows).drop_columns(figures)),
        replace(
            queries,
            name="evaluation_figures",
            title="Figures of the queries",
            description="The chances of each query, of errors up to so many metres, and more.",
            geometry="none",
            styles=(),
            read=lambda rows: queries.read(rows).select(["seed", "number", *figures]),
        ),
    ]
