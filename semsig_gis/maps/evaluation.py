"""Maps to look at in a browser: where localization works, and where a query may be from."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core.colours import CANDIDATE_RAMP, ERROR_RAMP, FAILED, SUCCESSFUL
from semsig_gis.database.database import rows_of_result
from semsig_gis.evaluation.result import SUCCESS_METRES
from semsig_gis.maps.board import mercator
from semsig_gis.maps.legend import evaluation_legend
from semsig_gis.maps.packing import packed
from semsig_gis.maps.parts import (
    Drawing,
    Legend,
    add_city,
    cell_signature,
    class_titles,
    finished_map,
    free_name,
    popup_signature,
    prepared_map,
    query_signature,
    to_latlon,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    import folium
    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.evaluation.result import Evaluation
    from semsig_gis.matching.result import Localization


_QUERY_FIELDS = (
    "True cell sees",
    "Query",
    "Expected error",
    f"P(error ≤ {SUCCESS_METRES} m)",
    "True rank",
    "True cell",
    "Best cell",
    "Next best cells",
    "Best cell sees",
)


_CANDIDATE_FIELDS = ("Query", "Signature", "Rank", "Distance", "Cell", "Position")


_MANY = 2000


_KILOMETRE = 1000


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
        Online background of a new map, by a name that folium knows, such as
        ``"OpenStreetMap"``; none by default, so that the map needs no network.

    Returns
    -------
    folium.Map
        The map, with these layers: the cells as an image (darker where more objects are seen), a
        heatmap of the expected errors (at every zoom, the mean of the queries around a pixel), the
        failed and the successful queries with popups, and lines from the true to the estimated
        places (hidden at first).

    Raises
    ------
    InputError
        If the evaluation was made with another database, `tiles` is not known to folium, or
        both `tiles` and `map_` are given.

    Notes
    -----
    A query is successful when its error is at most 50 m with probability 0.5 or more. In the
    heatmap an error counts with at most that of a guess: the root mean square distance of two
    random cells.

    Examples
    --------
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.database.build import build_database
    >>> from semsig_gis.evaluation.evaluate import evaluate
    >>> from semsig_gis.objects.clean import build_objects
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> evaluation_map(evaluate(database, queries=5), database).options["maxZoom"]
    20
    """
    queries = evaluation.queries
    successful = evaluation.successful
    xy = np.stack([queries.geometry.x, queries.geometry.y], axis=1)
    places = to_latlon(xy, database.crs)
    found = to_latlon(queries[["best_x", "best_y"]].to_numpy(np.float64), database.crs)
    records = _query_records(evaluation, database, places, found)
    low, high = database.xy.min(axis=0), database.xy.max(axis=0)
    view = to_latlon(np.stack([low, high]), database.crs)
    # How far two random cells lie apart (root mean square).
    guess = math.sqrt(2.0 * float(database.xy.var(axis=0).sum())) or database.grid.step
    chosen = prepared_map(map_, tiles, title="Localization errors")
    add_city(chosen, database)
    errors = np.minimum(queries["error_m"].to_numpy(np.float64) / guess, 1.0)
    Drawing(free_name(chosen, "Expected errors"), "heat", *_heat(xy, errors, database)).add_to(
        chosen
    )
    groups = (("Failed", ~successful, FAILED), ("Successful", successful, SUCCESSFUL))
    located = np.isfinite(found).all(axis=1)
    Drawing(
        free_name(chosen, "Lines from true to estimated places"),
        "lines",
        [
            [{"color": colour}, np.stack([places, found], axis=1)[which & located].tolist()]
            for _, which, colour in groups
        ],
        show=False,
    ).add_to(chosen)
    for name, which, _ in groups:
        Drawing(
            free_name(chosen, f"{name} queries ({int(which.sum()):,})"),
            "points",
            _QUERY_FIELDS,
            class_titles(database),
            list(itertools.compress(records, which)),
        ).add_to(chosen)
    legend = evaluation_legend(evaluation, error_limit=_metres(guess), licenses=database.licenses)
    Legend(legend, view if map_ is None else None).add_to(chosen)
    return finished_map(chosen, database)


def _query_records(
    evaluation: Evaluation,
    database: SignatureDatabase,
    places: NDArray[np.float64],
    found: NDArray[np.float64],
) -> list[list[Any]]:
    """Return what the script draws of each query: place, look, best places, heading, details."""
    cells, total = len(database), len(evaluation.queries)
    successful = evaluation.successful.tolist()
    rows = evaluation.rows_in(database)
    following, offs = _following(evaluation, database)
    best_rows = np.searchsorted(
        database.cell_ids, evaluation.queries["best_cell_id"].fillna(0).to_numpy(np.int64)
    )
    radius = 5 if total <= _MANY else 3
    records = []
    for number, query in enumerate(evaluation.queries.itertuples(index=False)):
        asked = [float(one) for one in query.query_bearings.split(",") if one]
        located = query.tied > 0
        details = [
            cell_signature(database, int(rows[number])) if rows[number] >= 0 else "no such cell",
            popup_signature(query.query_types, asked)
            if query.query_length
            else "nothing left of it",
            _metres(query.error_m),
            f"{getattr(query, f'p{SUCCESS_METRES}'):.2f}",
            f"{_ranks(query.rank_low, query.rank_high)} of {cells:,}",
            str(query.cell_id),
            f"{query.best_cell_id}, distance {query.distance:.3f}{_tie(query.tied)}"
            if located
            else "none",
            ", ".join(f"{_metres(off)} off" for off in offs[number]) or None,
            cell_signature(database, int(best_rows[number])) if located else None,
        ]
        outcome = "successful" if successful[number] else "failed"
        records.append(
            [
                places[number].tolist(),
                SUCCESSFUL if successful[number] else FAILED,
                radius,
                [found[number].tolist(), *following[number]] if located else None,
                f"Query {number + 1:,}: {outcome}",
                details,
            ]
        )
    return records


def _following(
    evaluation: Evaluation, database: SignatureDatabase
) -> tuple[list[list[list[float]]], list[list[float]]]:
    """Return the places of the cells after the best of each query, and how far off they are."""
    queries = evaluation.queries
    named = [text.split(",") if text else [] for text in queries["next_cell_ids"]]
    ids = np.array(list(itertools.chain.from_iterable(named)), np.int64)
    xy = database.xy[np.searchsorted(database.cell_ids, ids)]
    true = np.stack([queries.geometry.x, queries.geometry.y], axis=1)
    counts = [len(some) for some in named]
    off = np.sqrt(((xy - np.repeat(true, counts, axis=0)) ** 2).sum(axis=1))
    ends = np.cumsum(counts)[:-1]
    return (
        [part.tolist() for part in np.split(to_latlon(xy, database.crs), ends)],
        [part.tolist() for part in np.split(off, ends)],
    )


def _candidate_records(
    localization: Localization, database: SignatureDatabase, places: NDArray[np.float64]
) -> list[list[Any]]:
    """Return what the script draws of each candidate, best first."""
    candidates = localization.candidates
    rows = rows_of_result(database, candidates["cell_id"], candidates["types"], what="localization")
    distances = candidates["distance"].to_numpy(np.float64)
    spread = np.ptp(distances) or 1.0
    colours = _ramp((distances - distances.min()) / spread, CANDIDATE_RAMP)
    asked = query_signature(localization.query, database.taxonomy)
    records = []
    for number, candidate in enumerate(candidates.to_dict("records")):
        rank = _ranks(candidate["rank_low"], candidate["rank_high"])
        latitude, longitude = places[number].tolist()
        details = [
            asked,
            cell_signature(database, int(rows[number])),
            f"{rank} of {len(database):,}{_tie(candidate['tied'])}",
            f"{candidate['distance']:.4f}",
            str(candidate["cell_id"]),
            f"{latitude:.6f}, {longitude:.6f}",
        ]
        best = candidate["rank_low"] == 1
        records.append(
            [
                [latitude, longitude],
                colours[number],
                9 if best else 6,
                None,
                f"Rank {rank}",
                details,
            ]
        )
    return records


def _metres(error: float) -> str:
    if math.isinf(error):
        return "infinite, not localized"
    return f"{error:,.0f} m" if error < _KILOMETRE else f"{error / 1000:,.2f} km"


def _ranks(low: int, high: int) -> str:
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"


def _tie(tied: int) -> str:
    return f", {tied:,} tied" if tied > 1 else ""


def _ramp(values: NDArray[np.float64], colours: Sequence[str]) -> list[str]:
    """Return the colour of each value in [0, 1] between the given ones."""
    anchors = np.array([list(bytes.fromhex(colour[1:])) for colour in colours])
    stops = np.linspace(0.0, 1.0, len(colours))
    mixed = np.stack([np.interp(values, stops, part) for part in anchors.T], axis=1)
    return [f"#{bytes(row).hex()}" for row in np.rint(mixed).astype(np.uint8)]


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
    return arrays, {**about, "colours": _ramp(np.linspace(0.0, 1.0, 256), ERROR_RAMP)}
