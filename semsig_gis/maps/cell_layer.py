"""A layer of a map of which a click on any cell tells what is known of it.

Hundreds of thousands of cells have their numbers in the page: packed arrays, which the script
unpacks once. Nothing is drawn of them but what a click asks for; images show the rest. What is
told of a cell comes from parts (`CellFacts`), each with arrays and a function of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.maps.image import place_lattices
from semsig_gis.maps.packing import packed, steps
from semsig_gis.maps.parts import PAGE_FILES, Drawing, class_titles, corners_of, free_name

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import folium
    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase


@dataclass(frozen=True, eq=False, kw_only=True)
class CellFacts:
    """A part of what a click on a cell tells, with numbers and a JavaScript function of its own.

    The file ``NAME.js`` defines the function ``semsig.cellFacts.NAME(city, cell)``, where NAME is
    ``name``. It returns what there is of ``title``; ``rows``: label and value each, as
    `semsig.details` shows them; ``jumps``: a label and buttons, each with a text, a cell and a
    hint; ``marks``: cells to number and to join by lines; ``dots``: cells and colours. ``arrays``
    are packed numbers of the cells (see `maps.packing`); ``settings`` reach the function in
    ``city.grid``.
    """

    name: str
    arrays: Mapping[str, list[str]] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)


def add_cells(map_: folium.Map, database: SignatureDatabase, facts: Sequence[CellFacts]) -> None:
    """Add a layer without signs of its own that tells what is known of a cell when clicked."""
    arrays, grid = _cells(database)
    for part in facts:
        arrays |= part.arrays
        grid |= part.settings
    parts = [part.name for part in facts]
    name = free_name(map_, "Tell of a cell when clicked")
    layer = Drawing(name, "cells", arrays, grid, class_titles(database), parts)
    layer.files = (*PAGE_FILES, "cells.css", "cells.js", *(f"{part}.js" for part in parts))
    layer.add_to(map_)


def city_view(database: SignatureDatabase) -> NDArray[np.float64]:
    """Return the latitudes and longitudes of the corners of all cells."""
    if len(database) == 0:
        msg = "the database has no cells to show; give one with at least one cell."
        raise InputError(msg)
    return corners_of(database)


def packed_signatures(
    name: str, database: SignatureDatabase, ends: NDArray[np.int64]
) -> dict[str, list[str]]:
    """Return signatures, with angle levels for bearings, and where those of each cell end."""
    return {
        f"{name}.types": packed(database.taxonomy.symbol_bytes[database.codes]),
        f"{name}.ends": steps(ends.astype(np.int32)),
        f"{name}.levels": packed(database.levels),
    }


def _cells(database: SignatureDatabase) -> tuple[dict[str, list[str]], dict[str, Any]]:
    """Return where the cells are, and how to read it."""
    lattices = place_lattices(database)
    columns = database.columns - database.columns[0]
    arrays = {
        "rows": steps(database.rows),
        "columnEnds": steps(np.cumsum(np.bincount(columns)).astype(np.int32)),
        "metres": packed(lattices.metres),
        "degrees": packed(lattices.degrees),
    }
    grid = {
        "levels": database.spec.levels,
        "step": database.grid.step,
        "origin": list(database.grid.origin),
        "firstColumn": int(database.columns[0]),
        "mercatorBox": lattices.mercator_box,
        "box": lattices.metric_box,
    }
    return arrays, grid
