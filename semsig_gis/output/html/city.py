"""Several results for a city on one map."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from semsig_gis.core import InputError
from semsig_gis.output.html.answer import answer_map, posterior_map
from semsig_gis.output.html.cells import ambiguity_map, identifiability_map
from semsig_gis.output.html.drift import drift_map
from semsig_gis.output.html.evaluation import evaluation_map
from semsig_gis.output.html.objects import objects_map
from semsig_gis.output.html.page_elements import cell_colours

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
    """Show several results for a city on one map.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    evaluation : Evaluation, optional
        Queries, as `evaluation_map` shows them.
    smooth : float, optional
        Radius in metres within which a query counts in the field of errors.
    identifiability : Identifiability, optional
        Where a query can be localized, as `identifiability_map` shows it.
    ambiguity : bool, default False
        Whether to show the cells that look the same, as `ambiguity_map` does.
    newer, objects_before, objects_after : optional
        The database at a later date, and the street objects of both, as `drift_map` shows them.
    posterior : Posterior, optional
        The chances of an answer, as `posterior_map` shows them.
    answer : str or Path, optional
        File of an answer without the chances of cells: regions to search and, in most formats,
        candidates (see `export_answer`).
    objects : StreetObjects, optional
        The street objects, as `objects_map` shows them.
    tiles : str, optional
        As in `evaluation_map`.

    Returns
    -------
    folium.Map
        The map. Its layers are in groups. One layer colours the cells at a time; the first result
        in the order above is shown first, with its legend open, and a click describes it.

    Raises
    ------
    InputError
        If no result is given, or as in the functions above.

    Notes
    -----
    Each of the functions above can also add its layers to the map of another one, given as
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
    map_ = parts[0](tiles=tiles)
    _add_parts(map_, parts[1:])
    return map_


def _add_parts(map_: folium.Map, parts: Sequence[Callable[..., folium.Map]]) -> None:
    """Add more results to a map; its cells keep their colours, if they have any."""
    first_colours = [layer for layer in cell_colours(map_) if layer.show]
    for part in parts:
        part(map_=map_)
    for layer in cell_colours(map_) if first_colours else ():
        layer.show = layer in first_colours
