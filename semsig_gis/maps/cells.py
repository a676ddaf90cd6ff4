"""Maps of cells: how many look the same, and where a query can be placed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.colours import FOUND_RAMP, GROUP_COLOURS
from semsig_gis.maps.cell_layer import CellFacts, add_cells, city_view, packed_signatures
from semsig_gis.maps.image import level_image
from semsig_gis.maps.legend import (
    SAME_LEVELS,
    SAME_TYPES,
    ambiguity_legend,
    identifiability_legend,
)
from semsig_gis.maps.packing import packed
from semsig_gis.maps.parts import add_image, finished_map, prepared_map

if TYPE_CHECKING:
    import folium
    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.evaluation.identify.result import Identifiability

DOTS = 200  # cells of a group that are drawn, from all over the city
NEAR = 20  # of the nearest ones all are drawn
CHANCES = 100  # steps of a chance in a byte
LEAST = 0.01  # chance of a place that is named; the others are many, and make a page large
BITS = 8  # steps of a bit
HELPERS = 2  # classes that are named


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
    >>> ambiguity_map(demo_database).options["maxZoom"]
    20
    """
    view = city_view(database)
    if identifiability is not None:
        identifiability.require_cells_of(database)
    page = prepared_map(map_, tiles, title="Cells that look the same")
    types, angles = database.type_sequences, database.angle_sequences
    pairs = types.inverse * len(angles) + angles.inverse
    _, pair, counts = np.unique(pairs, return_inverse=True, return_counts=True)
    sizes = {"Same types": database.type_group_sizes, "Same types and angle levels": counts[pair]}
    for name, size in sizes.items():
        levels = np.digitize(size, list(GROUP_COLOURS)).astype(np.uint8)
        image = level_image(database, levels, list(GROUP_COLOURS.values()))
        add_image(page, *image, name=name, dark="lift", show=name == "Same types")
    facts = [_group_facts(database)]
    if identifiability is not None:
        facts.append(_lookalike_facts(identifiability))
    add_cells(page, database, facts)
    legend = ambiguity_legend(sizes, licenses=database.licenses)
    return finished_map(page, database, legend=legend, view=view if map_ is None else None)


def identifiability_map(
    identifiability: Identifiability, *, map_: folium.Map | None = None, tiles: str | None = None
) -> folium.Map:
    """Show how well a query from each cell will be placed, and what it may be taken for.

    Parameters
    ----------
    identifiability : Identifiability
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
    >>> from semsig_gis import build_index, identify, named_noise
    >>> index = build_index(demo_database, named_noise("light"))
    >>> identifiability = identify(index, trials=20, class_trials=5)
    >>> identifiability_map(identifiability).options["maxZoom"]
    20
    """
    database = identifiability.database
    view = city_view(database)
    page = prepared_map(map_, tiles, title="Where a query can be placed")
    steps = len(FOUND_RAMP)
    levels = np.minimum(np.floor(identifiability.found * steps), steps - 1).astype(np.uint8)
    image = level_image(database, levels + np.uint8(1), FOUND_RAMP)
    add_image(page, *image, name="Chance to be found", dark="lift")
    add_cells(page, database, [_group_facts(database), _lookalike_facts(identifiability)])
    legend = identifiability_legend(identifiability)
    return finished_map(page, database, legend=legend, view=view if map_ is None else None)


def _group_facts(database: SignatureDatabase) -> CellFacts:
    """Return the signatures of the cells, by which those that look the same are found."""
    return CellFacts(
        name="groups",
        arrays=packed_signatures("now", database, database.offsets[1:]),
        settings={"dots": DOTS, "near": NEAR, "colours": [SAME_TYPES, SAME_LEVELS]},
    )


def _lookalike_facts(identifiability: Identifiability) -> CellFacts:
    """Return what is known of a query from each cell, beside the signatures of the cells."""
    # The classes that a cell gains most by, best first.
    gains, lookalikes = identifiability.gains, identifiability.lookalikes
    count = min(HELPERS, gains.shape[1])
    helpers = np.argsort(-gains, axis=1, kind="stable")[:, :count]
    titles = {item.code: item.title for item in identifiability.database.taxonomy.classes}
    chances = identifiability.lookalike_chances
    likely = chances >= LEAST
    return CellFacts(
        name="lookalikes",
        arrays={
            "found": _chance_bytes(identifiability.found),
            "near": _chance_bytes(identifiability.near),
            "itself": _chance_bytes(identifiability.itself),
            "bits": packed(np.rint(identifiability.bits * BITS).clip(0, 255).astype(np.uint8)),
            "lookalikes": packed(np.where(likely, lookalikes, -1).astype(np.int32)),
            "lookalikeChances": _chance_bytes(np.where(likely, chances, 0.0)),
            "helpers": packed(helpers.astype(np.uint8)),
            "gains": _chance_bytes(np.take_along_axis(gains, helpers, axis=1)),
        },
        settings={
            "radius": identifiability.radius,
            "places": lookalikes.shape[1],
            "helpers": count,
            "chances": CHANCES,
            "bits": BITS,
            "classes": [titles[item.code] for item in identifiability.classes],
        },
    )


def _chance_bytes(chances: NDArray[np.float64]) -> list[str]:
    return packed(np.rint(chances * CHANCES).clip(0, CHANCES).astype(np.uint8))
