"""A map of where a query can be placed at all, before there is one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis._map_cells import CellLayer, city_view
from semsig_gis._map_groups import group_facts
from semsig_gis._map_lookalikes import lookalike_facts
from semsig_gis._map_parts import (
    Legend,
    add_image,
    finished_map,
    free_name,
    prepared_map,
)
from semsig_gis.map_image import level_image
from semsig_gis.map_legend import FOUND_RAMP, identifiability_legend

if TYPE_CHECKING:
    import folium

    from semsig_gis.identifiability import Identifiability

__all__ = ["identifiability_map"]


def identifiability_map(
    told: Identifiability, *, map_: folium.Map | None = None, tiles: str | None = None
) -> folium.Map:
    """Show how well a query from each cell will be placed, and what it may be taken for.

    Parameters
    ----------
    told : Identifiability
        What to show.
    map_ : folium.Map, optional
        Map to add the layers to; a new one by default.
    tiles : str, optional
        Online background of a new map, by a name that folium knows; none by default.

    Returns
    -------
    folium.Map
        The map, with these layers: the chance to be found of all cells as an image, and a layer
        without signs of its own; while it is on, a click tells of the cell, and draws the places
        that it is most often taken for.

    Raises
    ------
    InputError
        If `tiles` is not known to folium, or both `tiles` and `map_` are given.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.identifying import identify
    >>> from semsig_gis.likelihood import build_index
    >>> from semsig_gis.noise import named_noise
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=200.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> index = build_index(build_database(objects), named_noise("light"))
    >>> told = identify(index, trials=20, class_trials=5)
    >>> identifiability_map(told).options["maxZoom"]
    20
    """
    database = told.database
    view = city_view(database)
    chosen = prepared_map(map_, tiles, title="Where a query can be placed")
    steps = len(FOUND_RAMP)
    levels = np.minimum(np.floor(told.found * steps), steps - 1).astype(np.uint8) + np.uint8(1)
    image = level_image(database, levels, FOUND_RAMP)
    add_image(chosen, *image, name="Chance to be found", dark="lift")
    facts = (group_facts(database), lookalike_facts(told))
    CellLayer(free_name(chosen, "Tell of a cell when clicked"), database, facts).add_to(chosen)
    Legend(identifiability_legend(told), view if map_ is None else None).add_to(chosen)
    return finished_map(chosen, database)
