"""The map of one ranking by distance."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core.signs import CANDIDATE_RAMP, mixed
from semsig_gis.database.database import rows_of_result
from semsig_gis.maps.legend import query_text, ramp_bar, shades, sources
from semsig_gis.maps.parts import (
    add_city,
    cell_signature,
    class_titles,
    draw,
    finished_map,
    prepared_map,
    query_signature,
    ranks_text,
    ties_text,
    to_latlon,
)

if TYPE_CHECKING:
    import folium
    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.matching.search import Localization

CANDIDATE_FIELDS = ("Query", "Signature", "Rank", "Distance", "Cell", "Position")


def localization_map(
    localization: Localization,
    database: SignatureDatabase,
    *,
    map_: folium.Map | None = None,
    tiles: str | None = None,
) -> folium.Map:
    """Show the places where a query may have been taken, the best ones first.

    Parameters
    ----------
    localization : Localization
        What to show.
    database : SignatureDatabase
        The database that was searched.
    map_ : folium.Map, optional
        Map to add the layers to; a new one by default.
    tiles : str, optional
        Online background of a new map, by a name that folium knows; none by default.

    Returns
    -------
    folium.Map
        The map: the cells as an image, and the candidates, coloured by their distance to the
        query, with popups. The best candidates are larger.

    Raises
    ------
    InputError
        If another database was searched, `tiles` is not known to folium, or both `tiles` and
        `map_` are given.

    Examples
    --------
    >>> from semsig_gis import localize
    >>> localization = localize(demo_database, demo_database.signature(0), top=5)
    >>> localization_map(localization, demo_database).options["maxZoom"]
    20
    """
    xy = localization.candidates[["x", "y"]].to_numpy(np.float64)
    places = to_latlon(xy, database.crs)
    records = _candidate_records(localization, database, places)
    page = prepared_map(map_, tiles, title="Candidate places")
    add_city(page, database)
    name = f"Candidates ({len(records):,})"
    # The best last, so that they lie on top.
    draw(page, name, "points", CANDIDATE_FIELDS, class_titles(database), records[::-1])
    legend = localization_legend(localization)
    return finished_map(page, database, legend=legend, view=places if map_ is None else None)


def _candidate_records(
    localization: Localization, database: SignatureDatabase, places: NDArray[np.float64]
) -> list[list[Any]]:
    """Return what the script draws of each candidate, best first."""
    candidates = localization.candidates
    rows = rows_of_result(database, candidates["cell_id"], candidates["types"], what="localization")
    distances = candidates["distance"].to_numpy(np.float64)
    spread = np.ptp(distances) or 1.0
    colours = mixed((distances - distances.min()) / spread, CANDIDATE_RAMP)
    query = query_signature(localization.query, database.taxonomy)
    records = []
    for number, candidate in enumerate(candidates.to_dict("records")):
        rank = ranks_text(candidate["rank_low"], candidate["rank_high"])
        latitude, longitude = places[number].tolist()
        details = [
            query,
            cell_signature(database, int(rows[number])),
            f"{rank} of {len(database):,}{ties_text(candidate['tied'])}",
            f"{candidate['distance']:.4f}",
            str(candidate["cell_id"]),
            f"{latitude:.6f}, {longitude:.6f}",
        ]
        radius = 9 if candidate["rank_low"] == 1 else 6
        place = [latitude, longitude]
        records.append([place, colours[number], radius, None, f"Rank {rank}", details])
    return records


def localization_legend(localization: Localization) -> str:
    """Return the legend of a map of candidates, as HTML with data escaped."""
    candidates = localization.candidates
    more = localization.tied_beyond
    cells = "1 more cell is" if more == 1 else f"{more:,} more cells are"
    beyond = f"<br>{cells} as good as the last one" if more else ""
    distances = candidates["distance"]
    return (
        "<summary>Candidate places</summary>"
        f"<p>{query_text(localization.query, localization.taxonomy)}"
        f"Method: {escape(str(localization.method))}, by {escape(localization.used)}</p>"
        f"<p>The best {len(candidates):,} of {localization.cells:,} cells{beyond}</p>"
        "<p>Distance to the query (large sign: rank 1)"
        f"{ramp_bar(CANDIDATE_RAMP, f'{distances.min():.3f}', f'{distances.max():.3f}')}</p>"
        f"{shades()}{sources(localization.licenses)}"
    )
