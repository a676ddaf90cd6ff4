"""A map of an evaluation: where localization works, where it fails, and by how much."""

from __future__ import annotations

import itertools
import math
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core.signs import ERROR_RAMP, FAILED, SUCCESSFUL, mixed
from semsig_gis.database.observation import parse_view
from semsig_gis.evaluation.result import Evaluation
from semsig_gis.maps.image import mercator, packed
from semsig_gis.maps.parts import (
    Drawing,
    add_city,
    cell_signature,
    class_titles,
    colour_cells,
    corners_of,
    draw,
    finished_map,
    isolated,
    popup_signature,
    prepared_map,
    query_signature,
    ramp_bar,
    ranks_text,
    shades,
    sources,
    swatch,
    ties_text,
    to_latlon,
)
from semsig_gis.queries.chain import chain_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    import folium
    from numpy.typing import NDArray

    from semsig_gis.core.view import View
    from semsig_gis.database.database import SignatureDatabase

QUERY_FIELDS = (
    *(
        "True cell sees",
        "Query",
        "Expected error",
        f"P(error ≤ {Evaluation.success_metres} m)",
        "True rank",
    ),
    *("True cell", "Best cell", "Next best cells", "Best cell sees"),
)
MANY = 2000  # queries, whose circles are smaller
KILOMETRE = 1000
THRESHOLDS = (10, 25, 50, 100)  # metres of error that the legend tells of


def evaluation_map(
    evaluation: Evaluation,
    database: SignatureDatabase,
    *,
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
    map_ : folium.Map, optional
        Map to add the layers to; a new one by default.
    tiles : str, optional
        Online background of a new map: a provider of xyzservices that needs no key, such as
        ``"OpenStreetMap.Mapnik"``; none by default.

    Returns
    -------
    folium.Map
        The map, with these layers: the cells as an image (darker where more objects are seen), a
        heatmap of the expected errors (at every zoom, the mean of the queries around a pixel), the
        failed and the successful queries, of which a click tells, and lines from the true to the
        estimated places (hidden at first).

    Raises
    ------
    InputError
        If the evaluation was made with another database, `tiles` is not known or needs a key, or
        both `tiles` and `map_` are given.

    Notes
    -----
    A query is successful when its error is at most 50 m with probability 0.5 or more. In the
    heatmap an error counts with at most that of a guess: the root mean square distance of two
    random cells.

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
    records = _query_records(evaluation, database, places, best_places)
    # How far two random cells lie apart (root mean square).
    guess = math.sqrt(2.0 * float(database.xy.var(axis=0).sum())) or database.grid.step
    page = prepared_map(map_, tiles, title="Localization errors")
    city = add_city(page, database)
    errors = np.minimum(queries["error_m"].to_numpy(np.float64) / guess, 1.0)
    field = Drawing(None, "heat", *_heat(xy, errors, database), group="cells")
    field.add_to(page)
    colour_cells(page, "Expected errors", city, field)
    outcomes = {
        "Failed": (~evaluation.successful, FAILED),
        "Successful": (evaluation.successful, SUCCESSFUL),
    }
    pairs = np.stack([places, best_places], axis=1)
    located = np.isfinite(best_places).all(axis=1)
    lines = [
        [{"color": colour}, pairs[some & located].tolist()] for some, colour in outcomes.values()
    ]
    draw(page, "Lines from true to estimated places", "lines", lines, group="queries", show=False)
    for outcome, (some, _) in outcomes.items():
        name = f"{outcome} queries ({int(some.sum()):,})"
        points = list(itertools.compress(records, some))
        draw(page, name, "points", QUERY_FIELDS, class_titles(database), points, group="queries")
    legend = evaluation_legend(evaluation, error_limit=_metres(guess), licenses=database.licenses)
    view = corners_of(database) if map_ is None else None
    return finished_map(page, database, legend=legend, view=view)


def _query_records(
    evaluation: Evaluation,
    database: SignatureDatabase,
    places: NDArray[np.float64],
    best_places: NDArray[np.float64],
) -> list[list[Any]]:
    """Return what the script draws of each query: place, look, best places, heading, details."""
    queries = evaluation.queries
    radius = 5 if len(queries) <= MANY else 3
    rows = evaluation.rows_in(database).tolist()
    best_ids = queries["best_cell_id"].fillna(0).to_numpy(np.int64)
    best_rows = np.searchsorted(database.cell_ids, best_ids).tolist()
    next_places, next_errors = _next_cells(evaluation, database)
    bearings, successful = evaluation.query_bearings, evaluation.successful.tolist()
    records = []
    for number, query in enumerate(queries.itertuples(index=False)):
        located = query.tied > 0
        view = _view(query, database) if query.query_ranges or query.query_sectors else None
        plain = popup_signature(query.query_types, bearings[number])
        radius_m = database.spec.radius
        asked = plain if view is None else query_signature(view, database.taxonomy, radius=radius_m)
        details = [
            cell_signature(database, rows[number], view, query.heading)
            if rows[number] >= 0
            else "no such cell",
            asked if query.query_length else "nothing left of it",
            _metres(query.error_m),
            f"{getattr(query, f'p{Evaluation.success_metres}'):.2f}",
            f"{ranks_text(query.rank_low, query.rank_high)} of {len(database):,}",
            str(query.cell_id),
            f"{query.best_cell_id}, distance {query.distance:.3f}{ties_text(query.tied)}"
            if located
            else "none",
            ", ".join(f"{_metres(error)} off" for error in next_errors[number]) or None,
            cell_signature(database, best_rows[number]) if located else None,
        ]
        outcome, colour = ("successful", SUCCESSFUL) if successful[number] else ("failed", FAILED)
        best = [best_places[number].tolist(), *next_places[number]] if located else None
        name = f"Query {number + 1:,}: {outcome}"
        records.append([places[number].tolist(), colour, radius, best, name, details])
    return records


def _view(query: Any, database: SignatureDatabase) -> View:  # noqa: ANN401 - a named row
    """Return what was asked and told of ranges and sectors."""
    names = ("types", "bearings", "ranges", "sectors")
    told = {name: getattr(query, f"query_{name}") for name in names}
    return parse_view(told, taxonomy=database.taxonomy)


def _next_cells(
    evaluation: Evaluation, database: SignatureDatabase
) -> tuple[list[list[list[float]]], list[list[float]]]:
    """Return the places of the cells after the best of each query, and how far off they are."""
    queries, next_ids = evaluation.queries, evaluation.next_cell_ids
    counts = [len(ids) for ids in next_ids]
    ids = np.array(list(itertools.chain.from_iterable(next_ids)), np.int64)
    xy = database.xy[np.searchsorted(database.cell_ids, ids)]
    true = np.stack([queries.geometry.x, queries.geometry.y], axis=1)
    errors = np.sqrt(((xy - np.repeat(true, counts, axis=0)) ** 2).sum(axis=1))
    ends = np.cumsum(counts)[:-1]
    return (
        [part.tolist() for part in np.split(to_latlon(xy, database.crs), ends)],
        [part.tolist() for part in np.split(errors, ends)],
    )


def _metres(error: float) -> str:
    if math.isinf(error):
        return "infinite, not localized"
    return f"{error:,.0f} m" if error < KILOMETRE else f"{error / 1000:,.2f} km"


def _heat(
    xy: NDArray[np.float64], errors: NDArray[np.float64], database: SignatureDatabase
) -> tuple[dict[str, list[str]], dict[str, Any]]:
    """Return the places and errors, as shares of a guess's, for the script."""
    places, about = mercator(xy, database.crs)
    arrays = {
        "x": packed(np.ascontiguousarray(places[:, 0])),
        "y": packed(np.ascontiguousarray(places[:, 1])),
        "error": packed(np.rint(255.0 * errors).astype(np.uint8)),
    }
    return arrays, {**about, "colours": mixed(np.linspace(0.0, 1.0, 256), ERROR_RAMP)}


def evaluation_legend(evaluation: Evaluation, *, error_limit: str, licenses: Sequence[str]) -> str:
    """Return the legend of a map of errors, of which the ramp ends at a limit, as escaped HTML."""
    count, distortions = len(evaluation.queries), chain_text(evaluation.asked.distortions)
    successes = int(evaluation.successful.sum())
    best = "the best candidate" if evaluation.top == 1 else f"the best of {evaluation.top:,}"
    shares = "".join(
        f"<tr><td>P(error ≤ {threshold} m)</td><td>{share:.1%}</td></tr>"
        for threshold, share in zip(THRESHOLDS, evaluation.cdf(THRESHOLDS), strict=True)
    )
    return (
        "<summary>Localization errors</summary>"
        f"<p>{count:,} queries among {evaluation.database['cells']:,} cells<br>"
        f"Method: {escape(str(evaluation.method))}, {best}<br>"
        f"Distortion: {isolated(distortions or 'none')}</p>"
        f"<table>{shares}</table>"
        f"<p>{swatch(SUCCESSFUL)}{successes:,} successful: within {Evaluation.success_metres} m "
        f"with probability {Evaluation.success_probability:g} or more<br>"
        f"{swatch(FAILED)}{count - successes:,} failed</p>"
        "<p>Mean expected error nearby"
        f"{ramp_bar(ERROR_RAMP, '0 m', f'{error_limit}, as bad as a guess', sign='ramp heat')}</p>"
        f"{shades()}{sources(licenses)}"
    )
