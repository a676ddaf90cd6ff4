"""Map of an evaluation: where localization works, where it fails, and by how much."""

from __future__ import annotations

import itertools
import math
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from semsig_gis.core import ERROR_BREAKS, OUTCOMES, percent
from semsig_gis.evaluation import ENOUGH_QUERIES, Evaluation, chain_text, error_field
from semsig_gis.observation import parse_view
from semsig_gis.output.html.image import mercator_places, packed
from semsig_gis.output.html.page_elements import (
    OUTLINES,
    PAGE_FILES,
    Call,
    ScriptLayer,
    add_city,
    add_layer,
    cell_signature,
    class_bar,
    colour_cells,
    corners_of,
    credits_part,
    escaped_text,
    finish_map,
    folded_part,
    layer_part,
    layers_of,
    mark_svg,
    panel_signature,
    panel_signs,
    query_signature,
    ranks_text,
    shades_part,
    start_map,
    ties_text,
    to_latlon,
)
from semsig_gis.output.layers.styles import FAILED
from semsig_gis.output.tables.tables import method_words

if TYPE_CHECKING:
    from collections.abc import Sequence

    import folium
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import ErrorField

QUERY_FIELDS = (
    *("Query", "True cell sees", "Expected error"),
    *(f"P(error ≤ {Evaluation.success_metres} m)", "True rank", "True cell"),
    *("Best cell", "Next best cells", "Best cell sees"),
)
FIELD_NAME = "Share of queries found"
KILOMETRE = 1000
SHARE_STEPS = 250  # steps of a share in a byte, after 0 for no value
WEIGHT_STEPS = 10  # steps of the weight of one query in a byte


def evaluation_map(
    evaluation: Evaluation,
    database: SignatureDatabase,
    *,
    smooth: float | None = None,
    map_: folium.Map | None = None,
    tiles: str | None = None,
) -> folium.Map:
    """Show where queries were localized, where they failed, and by how much.

    Parameters
    ----------
    evaluation : Evaluation
        What to show.
    database : SignatureDatabase
        The database that was evaluated.
    smooth : float, optional
        Radius in metres within which a query counts in the field (see
        `evaluation.error_field.error_field`).
    map_ : folium.Map, optional
        Map to add the layers to; a new one by default.
    tiles : str, optional
        Online background of a new map: a provider of xyzservices that needs no key, such as
        ``"OpenStreetMap.Mapnik"``; none by default.

    Returns
    -------
    folium.Map
        The map, with these layers: an image of the cells (darker where more objects are seen), the
        share of failed queries around every place (hatched where there are few queries), the
        failed and the successful queries, described by a click, and lines from the true to the
        estimated places (hidden at first).

    Raises
    ------
    InputError
        If the evaluation was made with another database, `smooth` is out of range, `tiles` is
        unknown or needs a key, or both `tiles` and `map_` are given.

    Notes
    -----
    A query is successful when its error is at most 50 m with probability 0.5 or more.

    Examples
    --------
    >>> from semsig_gis import evaluate
    >>> evaluation = evaluate(demo_database, queries=5)
    >>> evaluation_map(evaluation, demo_database).options["maxZoom"]
    20
    """
    queries = evaluation.queries
    xy = np.stack([queries.geometry.x, queries.geometry.y], axis=1)
    places = to_latlon(xy, database.crs)
    best_places = to_latlon(queries[["best_x", "best_y"]].to_numpy(np.float64), database.crs)
    field = error_field(evaluation, database, radius=smooth)
    page = start_map(map_, tiles, title="Localization errors")
    city = add_city(page, database)
    field_layer = ScriptLayer(None, "field", *_packed_field(field, database), group="cells")
    field_layer.add_to(page)
    colour_cells(page, FIELD_NAME, city, field_layer)
    key = _add_queries(page, evaluation, database, places, best_places)
    legend = evaluation_legend(evaluation, radius=field.radius, licenses=database.licenses, key=key)
    view = corners_of(database) if map_ is None else None
    return finish_map(page, database, legend=legend, view=view)


def _add_queries(
    map_: folium.Map,
    evaluation: Evaluation,
    database: SignatureDatabase,
    places: NDArray[np.float64],
    best_places: NDArray[np.float64],
) -> str:
    """Add layers of queries and of lines to their best places, and filters; return their key."""
    queries = evaluation.queries
    failed = ~evaluation.successful
    has_chances = evaluation.method.noise is not None
    chances = queries["chance" if has_chances else f"p{Evaluation.success_metres}"].fillna(0.0)
    next_places, details = _query_details(evaluation, database, places)
    best = queries["best_cell_id"]
    # One array per column; the script unpacks them when the page opens.
    arrays = {
        "places": packed(_microdegrees(places)),
        "best": packed(_microdegrees(best_places)),
        "located": packed(np.isfinite(best_places[:, 0]).astype(np.uint8)),
        "outcome": packed(failed.astype(np.uint8)),
        "error": packed(queries["error_m"].to_numpy(np.float64)),
        "chance": packed(np.rint(100.0 * chances.to_numpy(np.float64)).astype(np.uint8)),
        "length": packed(queries["length"].to_numpy(np.int32)),
        "types": packed(queries["types"].tolist()),
        "asked": packed(queries["query_types"].tolist()),
        "cells": packed(queries["cell_id"].astype(str).tolist()),
        "bestCells": packed([None if cell is pd.NA else str(cell) for cell in best]),
        "next": packed(next_places),
        "details": packed(details),
    }
    metres = Evaluation.success_metres
    about = {
        "count": len(queries),
        "order": np.argsort(-np.bincount(failed, minlength=2), kind="stable").tolist(),
        "outcomes": [
            {
                "name": name,
                "colour": mark.colour,
                "edge": mark.edge,
                "outline": OUTLINES[mark.shape],
            }
            for name, mark in OUTCOMES.items()
        ],
        "fields": QUERY_FIELDS,
        "signs": panel_signs(database),
        "chance": {"column": "chance", "label": "Chance given"}
        if has_chances
        else {"column": f"p{metres}", "label": f"P(error ≤ {metres} m)"},
    }
    # Several evaluations on one map have separate keys, filters and layers.
    others = sum(isinstance(child, _Queries) for child in layers_of(map_).values())
    key = f"queries{others + 1}" if others else "queries"
    _Queries("queries", map_, key, arrays, about).add_to(map_)
    for at, name in enumerate(OUTCOMES):
        title = f"{name.capitalize()} queries ({int((failed == at).sum()):,})"
        add_layer(map_, title, "queryLayer", key, at, group="queries")
    title = "Lines from true to estimated places"
    add_layer(map_, title, "queryLayer", key, len(OUTCOMES), group="queries", show=False)
    return key


class _Queries(Call):
    files = (*PAGE_FILES, "filters.css", "queries.js", "filters.js")


def _microdegrees(places: NDArray[np.float64]) -> NDArray[np.int32]:
    """Return millionths of degrees, the precision of `to_latlon`; 0 where there is no place."""
    return np.rint(1e6 * np.nan_to_num(places)).astype(np.int32)


def _query_details(
    evaluation: Evaluation, database: SignatureDatabase, places: NDArray[np.float64]
) -> tuple[list[list[list[float]]], list[list[Any]]]:
    """Return the places of the next best cells of each query, and its values of `QUERY_FIELDS`."""
    rows = evaluation.rows_in(database).tolist()
    best_ids = evaluation.queries["best_cell_id"].fillna(0).to_numpy(np.int64)
    best_rows = np.searchsorted(database.cell_ids, best_ids).tolist()
    next_places, next_errors = _next_cells(evaluation, database)
    cell_places = to_latlon(database.xy, database.crs).tolist()
    radius_m = database.near_reach
    bearings = evaluation.query_bearings
    details = []
    for number, query in enumerate(evaluation.queries.itertuples(index=False)):
        located = query.tied > 0
        look = {"place": places[number].tolist(), "turn": query.heading}
        # Ranges and sectors are only in the columns of the query, so parse it again.
        view = None
        if query.query_ranges or query.query_sectors:
            names = ("types", "bearings", "ranges", "sectors")
            row = {name: getattr(query, f"query_{name}") for name in names}
            view = parse_view(row, taxonomy=database.taxonomy)
        signature = (
            panel_signature(
                query.query_types, bearings[number], kind="query", reach=radius_m, **look
            )
            if view is None
            else query_signature(view, database.taxonomy, radius=radius_m, **look)
        )
        true_row, best_row = rows[number], best_rows[number]
        values = [
            signature if query.query_length else "nothing left of it",
            cell_signature(database, true_row, view, query.heading, place=cell_places[true_row])
            if true_row >= 0
            else "no such cell",
            _metres(query.error_m),
            f"{getattr(query, f'p{Evaluation.success_metres}'):.2f}",
            f"{ranks_text(query.rank_low, query.rank_high)} of {len(database):,}",
            str(query.cell_id),
            f"{query.best_cell_id}, distance {query.distance:.3f}{ties_text(query.tied)}"
            if located
            else "none",
            ", ".join(f"{_metres(error)} off" for error in next_errors[number]) or None,
            cell_signature(database, best_row, place=cell_places[best_row]) if located else None,
        ]
        details.append(values)
    return next_places, details


def _next_cells(
    evaluation: Evaluation, database: SignatureDatabase
) -> tuple[list[list[list[float]]], list[list[float]]]:
    """Return the places of the cells ranked after the best of each query, and their errors."""
    queries, next_ids = evaluation.queries, evaluation.next_cell_ids
    counts = [len(ids) for ids in next_ids]
    # All queries at once: concatenate their cells, compute, and split again.
    ids = np.array(list(itertools.chain.from_iterable(next_ids)), np.int64)
    xy = database.xy[np.searchsorted(database.cell_ids, ids)]
    true_xy = np.stack([queries.geometry.x, queries.geometry.y], axis=1)
    errors = np.sqrt(((xy - np.repeat(true_xy, counts, axis=0)) ** 2).sum(axis=1))
    ends = np.cumsum(counts)[:-1]
    return (
        [part.tolist() for part in np.split(to_latlon(xy, database.crs), ends)],
        [part.tolist() for part in np.split(errors, ends)],
    )


def _metres(error: float) -> str:
    if math.isinf(error):
        return "infinite, not localized"
    return f"{error:,.0f} m" if error < KILOMETRE else f"{error / 1000:,.2f} km"


def _packed_field(
    field: ErrorField, database: SignatureDatabase
) -> tuple[dict[str, list[str]], dict[str, Any]]:
    """Return the field for the script: shares of failures and weights, on a Mercator grid."""
    height, width = field.failed.shape
    low = np.array(field.grid.origin)
    high = low + field.grid.step * np.array([width, height])
    places, box = mercator_places(database, low, high, (height, width))
    failed, weights = field.at(places)
    values = np.where(np.isfinite(failed), 1.0 + SHARE_STEPS * np.nan_to_num(failed), 0.0)
    arrays = {
        "values": packed(np.rint(values).astype(np.uint8)),
        "weights": packed(np.ceil(WEIGHT_STEPS * weights).clip(0, 255).astype(np.uint8)),
    }
    about = {
        "box": box,
        "width": width,
        "height": height,
        "breaks": [1.0 + SHARE_STEPS * low if low else 0.0 for low in FAILED.breaks[:-1]],
        "colours": FAILED.colours,
        "enough": WEIGHT_STEPS * ENOUGH_QUERIES,
    }
    return arrays, about


def evaluation_legend(
    evaluation: Evaluation, *, radius: float, licenses: Sequence[str], key: str = "queries"
) -> str:
    """Return the legend of `evaluation_map` as escaped HTML; `radius` is that of the field.

    The script changes the numbers of queries as the filters with this `key` are set.
    """
    count, distortions = len(evaluation.queries), chain_text(evaluation.asked.distortions)
    successes = int(evaluation.successful.sum())
    best = "the best candidate" if evaluation.top == 1 else f"the best of {evaluation.top:,}"
    shares = "".join(
        f"<tr><td>within {threshold} m</td><td>{percent(share, 1)}</td></tr>"
        for threshold, share in zip(ERROR_BREAKS, evaluation.cdf(ERROR_BREAKS), strict=True)
    )
    how = (
        f"<p>Method: {escape(method_words(evaluation.method))}, {best}<br>"
        f"Distortion: {escaped_text(distortions or 'none')}</p>"
    )
    # As on the other maps, what is found well stands at the right.
    limits = [percent(1.0 - failed, 0) for failed in FAILED.breaks[-2:0:-1]]
    numbers = [
        f'<span data-queries="{key}" data-outcome="{at}">{number:,}</span>'
        for at, number in enumerate((successes, count - successes))
    ]
    within = f"within {Evaluation.success_metres} m"
    successful = (
        f"{mark_svg(OUTCOMES['successful'])} {numbers[0]} successful: {within} with probability "
        f"{Evaluation.success_probability:g} or more<br>"
    )
    failed = f"{mark_svg(OUTCOMES['failed'])} {numbers[1]} failed"
    field = (
        f"<p>Share of the queries within {radius:,g} m that were found, the nearer counting more"
        f"{class_bar(FAILED.colours[::-1], limits)}"
        f'<i class="hatched"></i>fewer than {ENOUGH_QUERIES:g} queries count</p>'
    )
    share = percent(evaluation.cdf([Evaluation.success_metres])[0], 1)
    return (
        "<summary>Localization errors</summary>"
        f"<p><b>{share}</b> of {count:,} queries "
        f"{within}</p>"
        f'<p class="semsig-selected" data-queries="{key}" hidden></p>'
        f"{layer_part('Successful queries', successful)}"
        f"{layer_part('Failed queries', failed)}"
        f"{layer_part(FIELD_NAME, field)}"
        f"{shades_part()}{folded_part('Figures', f'<table>{shares}</table>{how}')}"
        f"{credits_part(licenses)}"
    )
