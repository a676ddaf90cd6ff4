"""The map of one ranking by distance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.maps.evaluation import _CANDIDATE_FIELDS, _candidate_records
from semsig_gis.maps.legend import localization_legend
from semsig_gis.maps.parts import (
    Drawing,
    Legend,
    add_city,
    class_titles,
    finished_map,
    free_name,
    prepared_map,
    to_latlon,
)

if TYPE_CHECKING:
    import folium

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.matching.result import Localization


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
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.database.build import build_database
    >>> from semsig_gis.matching.search import localize
    >>> from semsig_gis.objects.clean import build_objects
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> answer = localize(database, database.signature(0), top=5)
    >>> localization_map(answer, database).options["maxZoom"]
    20
    """
    candidates = localization.candidates
    xy = candidates[["x", "y"]].to_numpy(np.float64)
    places = to_latlon(xy, database.crs)
    records = _candidate_records(localization, database, places)
    chosen = prepared_map(map_, tiles, title="Candidate places")
    add_city(chosen, database)
    Drawing(
        free_name(chosen, f"Candidates ({len(records):,})"),
        "points",
        _CANDIDATE_FIELDS,
        class_titles(database),
        records[::-1],  # the best last, so that they lie on top
    ).add_to(chosen)
    Legend(localization_legend(localization), places if map_ is None else None).add_to(chosen)
    return finished_map(chosen, database)
