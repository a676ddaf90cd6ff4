"""A map of how many cells look the same: where a signature says little of the place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.colours import FOUND_RAMP, GROUP_COLOURS
from semsig_gis.maps.cell_layer import CellLayer, city_view
from semsig_gis.maps.groups import group_facts
from semsig_gis.maps.image import level_image
from semsig_gis.maps.legend import ambiguity_legend, identifiability_legend
from semsig_gis.maps.lookalikes import lookalike_facts
from semsig_gis.maps.parts import Legend, add_image, finished_map, free_name, prepared_map

if TYPE_CHECKING:
    import folium

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.evaluation.identify.result import Identifiability


def ambiguity_map(
    database: SignatureDatabase,
    *,
    identifiability: Identifiability | None = None,
    map_: folium.Map | None = None,
    tiles: str | None = None,
) -> folium.Map:
    """Show how many cells have the same signature, and which.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    identifiability : Identifiability, optional
        What is known of queries from these cells, to be told by a click as well.
    map_ : folium.Map, optional
        Map to add the layers to; a new one by default.
    tiles : str, optional
        Online background of a new map, by a name that folium knows; none by default.

    Returns
    -------
    folium.Map
        The map, with these layers: images of how many cells have the same types, and the same
        types and angle levels (hidden at first), and a layer without signs of its own; while it
        is on, a click tells of the cell, draws those that look the same, and jumps to them.

    Raises
    ------
    InputError
        If there is no cell, `identifiability` is of another database, `tiles` is not known to
        folium, or both `tiles` and `map_` are given.

    Examples
    --------
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.database.build import build_database
    >>> from semsig_gis.objects.clean import build_objects
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=200.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> ambiguity_map(build_database(objects)).options["maxZoom"]
    20
    """
    view = city_view(database)
    if identifiability is not None:
        identifiability.require_cells_of(database)
    chosen = prepared_map(map_, tiles, title="Cells that look the same")
    types, angles = database.type_sequences, database.angle_sequences
    pairs = types.inverse * len(angles) + angles.inverse
    _, pair, counts = np.unique(pairs, return_inverse=True, return_counts=True)
    sizes = {"Same types": database.type_group_sizes, "Same types and angle levels": counts[pair]}
    for name, size in sizes.items():
        levels = np.digitize(size, list(GROUP_COLOURS)).astype(np.uint8)
        image = level_image(database, levels, list(GROUP_COLOURS.values()))
        add_image(chosen, *image, name=name, dark="lift", show=name == "Same types")
    facts = [group_facts(database)]
    if identifiability is not None:
        facts.append(lookalike_facts(identifiability))
    CellLayer(free_name(chosen, "Tell of a cell when clicked"), database, facts).add_to(chosen)
    Legend(
        ambiguity_legend(sizes, licenses=database.licenses), view if map_ is None else None
    ).add_to(chosen)
    return finished_map(chosen, database)


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
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.database.build import build_database
    >>> from semsig_gis.evaluation.identify.identify import identify
    >>> from semsig_gis.likelihood.index import build_index
    >>> from semsig_gis.likelihood.noise.model import named_noise
    >>> from semsig_gis.objects.clean import build_objects
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
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
