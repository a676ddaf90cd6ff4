"""All that is known of a city on one map."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from semsig_gis.core import InputError
from semsig_gis.maps.answer import answer_map
from semsig_gis.maps.cells import ambiguity_map, identifiability_map
from semsig_gis.maps.drift import drift_map
from semsig_gis.maps.evaluation import evaluation_map
from semsig_gis.maps.location import posterior_map
from semsig_gis.maps.objects import objects_map
from semsig_gis.maps.page_elements import cell_colours

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    import folium

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation, Identifiability
    from semsig_gis.localization import Posterior
    from semsig_gis.objects import StreetObjects


def city_map(
    database: SignatureDatabase,
    *,
    evaluation: Evaluation | None = None,
    smooth: float | None = None,
    identifiability: Identifiability | None = None,
    ambiguity: bool = False,
    newer: SignatureDatabase | None = None,
    objects_before: StreetObjects | None = None,
    objects_after: StreetObjects | None = None,
    posterior: Posterior | None = None,
    answer: str | Path | None = None,
    objects: StreetObjects | None = None,
    tiles: str | None = None,
) -> folium.Map:
    """Show what is known of a city on one map, as far as it is given.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    evaluation : Evaluation, optional
        Queries, as `evaluation_map` shows them.
    smooth : float, optional
        How far away a query counts in their field, in metres.
    identifiability : Identifiability, optional
        Where a query can be placed, as `identifiability_map` shows it.
    ambiguity : bool, default False
        Whether to show the cells that look the same, as `ambiguity_map` does.
    newer, objects_before, objects_after : optional
        The database at a later date, and the street objects of both, as `drift_map` shows them.
    posterior : Posterior, optional
        The chances of an answer, as `posterior_map` shows them.
    answer : str or Path, optional
        File of an answer that has no chances of cells: regions to search and, in most formats,
        candidates (see `export_answer`).
    objects : StreetObjects, optional
        The street objects, as `objects_map` shows them.
    tiles : str, optional
        As in `evaluation_map`.

    Returns
    -------
    folium.Map
        The map. Its layers are in groups: the cells are coloured by one thing at a time, at first
        by the first of those above, whose legend is open, and a click tells of it.

    Raises
    ------
    InputError
        If there is nothing to show, or as in the functions above.

    Notes
    -----
    Each of the functions above draws on a map that another has made, too, where it is given as
    ``map_``.

    Examples
    --------
    >>> from semsig_gis import evaluate
    >>> evaluation = evaluate(demo_database, queries=5)
    >>> city_map(demo_database, evaluation=evaluation, ambiguity=True).options["maxZoom"]
    20
    """
    parts: list[Callable[..., folium.Map]] = []
    if evaluation is not None:
        parts.append(partial(evaluation_map, evaluation, database, smooth=smooth))
    if identifiability is not None:
        parts.append(partial(identifiability_map, identifiability))
    if ambiguity:
        parts.append(partial(ambiguity_map, database))
    if newer is not None:
        dates = partial(drift_map, objects_before=objects_before, objects_after=objects_after)
        parts.append(partial(dates, database, newer))
    if posterior is not None:
        parts.append(partial(posterior_map, posterior))
    if answer is not None:
        parts.append(partial(answer_map, answer, database))
    if objects is not None:
        cells = None if parts else database
        parts.append(partial(objects_map, objects, database=cells))
    if not parts:
        raise InputError(
            "there is nothing to show of the city; give an evaluation, or ambiguity=True."
        )
    drawn = parts[0](tiles=tiles)
    _keep_colour(drawn, parts[1:])
    return drawn


def _keep_colour(drawn: folium.Map, parts: Sequence[Callable[..., folium.Map]]) -> None:
    """Draw more on a map, whose cells keep the colours that they have, if any."""
    first = [colour for colour in cell_colours(drawn) if colour.show]
    for part in parts:
        part(map_=drawn)
    for colour in cell_colours(drawn) if first else ():
        colour.show = colour in first
