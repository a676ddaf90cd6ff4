"""The layer of the queries of an evaluation, at their true places."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import OUTCOMES
from semsig_gis.output.layers import LAYERS
from semsig_gis.output.layers.columns import form_of
from semsig_gis.output.layers.model import Display, table_layer
from semsig_gis.output.layers.styles import by_outcome

if TYPE_CHECKING:
    import geopandas as gpd

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation
    from semsig_gis.output.layers.model import Layer


# Columns of queries that a GeoPackage moves to a separate table, because there are many of them.
FIGURE = re.compile(r"(p|near)\d+")
QUERY_FORM = form_of("""
[Result]
number = ["Query", "Its number, from 0."]
outcome = ["Outcome", "Successful: within 50 m of the true place with a probability of 0.5 or more."]
error_m = ["Error", "From the true place; expected, where cells tie. None: nothing was left to ask.", "m", 1]
rank_low = ["Rank of the true cell from", "First rank that ties allow; 1 is the best."]
rank_high = ["Rank of the true cell to", "Last rank that ties allow."]
chance = ["Chance given", "By the method itself, of its answer being right, from 0 to 1.", "1", 3]
right = ["Answer right", "Probability that the answer was within 50 m, from 0 to 1.", "1", 3]
in_region = ["True cell in the region", "Probability that the region of 90 % held the true cell.", "1", 3]
heading_error = ["Error of the heading", "By how much the heading was off.", "°", 1]
["What was asked"]
query_length = ["Objects asked for", "How many objects the query has; 0: the distortion left none."]
query_types = ["Types asked for", "Symbols of the objects of the query, clockwise."]
query_bearings = ["Bearings asked for", "Of the same objects.", "°"]
query_ranges = ["Distances asked for", "Rough distances of the same objects; empty: none.", "m"]
query_sectors = ["Sectors seen", "Where the view looked; empty: all round.", "°"]
heading = ["Heading", "What is added to the bearings to have them from true north.", "°", 1]
seed = ["Seed", "Of the random numbers of the query."]
["True place"]
cell_id = ["True cell", "Number of the cell in the grid."]
types = ["Types there", "Symbols of what the database says is seen there, clockwise from north."]
length = ["Objects there", "How many objects are really seen there."]
type_group = ["Cells with the same types", "1: no other cell."]
angle_group = ["Cells with the same bearings", "By angle level; 1: no other cell."]
cell = ["Row of the true cell", "Number of the row in the database, from 0; -1: it has none."]
["Best place"]
best_cell_id = ["Best cell", "Number of the cell in the grid."]
best_x = ["Best cell, east", "In the coordinate system of the layer.", "m", 2]
best_y = ["Best cell, north", "In the coordinate system of the layer.", "m", 2]
distance = ["Distance of signatures", "Of the best cell, or its negative log-likelihood; the lower the better.", "", 3]
tied = ["Tied cells", "How many cells share the best score."]
next_cell_ids = ["Next best cells", "Numbers of the four best of the other cells."]
""")  # noqa: E501
FIGURE_FORM = form_of("""
[Error]
"p#" = ["Error at most {} m", "Probability, from 0 to 1.", "1", 3]
["Places near the true one"]
"near#" = ["Among the best: {}", "Probability that one of this number of best cells is within 25 m, from 0 to 1.", "1", 3]
[Query]
number = ["Query", "Its number, from 0."]
seed = ["Seed", "Of the random numbers of the query."]
""")  # noqa: E501
GROUP = "Evaluation"
QUERY_NAME = """'query ' || "number" || ', ' || "outcome" """


@LAYERS.register
def evaluation_layer(evaluation: Evaluation, database: SignatureDatabase) -> Layer:
    """Return the layer of the queries at their true places."""
    queries = table_layer(
        queries_with_outcome(evaluation),
        name="evaluation",
        title="Queries",
        description=(
            f"{len(evaluation.queries)} queries at their true places; successful: the best place "
            f"is within {evaluation.success_metres} m with a probability of "
            f"{evaluation.success_probability:g} or more."
        ),
        geometry="point",
        form=QUERY_FORM,
        display=Display(
            level=5,
            group=GROUP,
            name=QUERY_NAME,
            signature=("query_types", "query_bearings", "query_ranges", ","),
            tip=("error_m", "rank_low"),
        ),
        styles=(by_outcome(geometry="point"),),
        **evaluation_facts(evaluation, database),
    )
    return replace(queries, parts=_split_figures(queries))


def queries_with_outcome(evaluation: Evaluation) -> gpd.GeoDataFrame:
    """Return the queries with the column ``outcome``."""
    successful, failed = OUTCOMES
    outcomes = np.where(evaluation.successful, successful, failed)
    return evaluation.queries.assign(outcome=outcomes)


def evaluation_facts(evaluation: Evaluation, database: SignatureDatabase) -> dict[str, Any]:
    """Return what the layers of an evaluation have in common."""
    summary = evaluation.summary()
    return {
        "licenses": database.licenses,
        "facts": {name: summary[name] for name in ("settings", "database", "versions")},
        "taxonomy": database.taxonomy,
        "reach": database.near_reach,
    }


def _split_figures(queries: Layer) -> tuple[Layer, Layer]:
    """Split the layer of queries: its other columns, and a table of figures by seed and number."""
    names = queries.read(slice(0, 0)).column_names
    figures = [name for name in names if FIGURE.fullmatch(name)]
    return (
        replace(queries, read=lambda rows: queries.read(rows).drop_columns(figures)),
        replace(
            queries,
            name="evaluation_figures",
            title="Figures of the queries",
            description="The chances of each query, of errors up to a number of metres, and more.",
            geometry="none",
            form=FIGURE_FORM,
            display=Display(
                level=3,
                group=GROUP,
                name="""'query ' || "number" """,
                joins=("evaluation", ("seed", "number")),
            ),
            styles=(),
            read=lambda rows: queries.read(rows).select(["seed", "number", *figures]),
        ),
    )
