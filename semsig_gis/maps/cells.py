"""Maps of cells: how many look the same, and where a query can be placed."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pandas as pd
from folium.template import Template

from semsig_gis.core import (
    BEARING_UNITS,
    FOUND_RAMP,
    FULL_TURN,
    GROUP_COLOURS,
    SAME_LEVELS,
    SAME_TYPES,
    InputError,
    group_labels,
    percent,
)
from semsig_gis.maps.image import (
    QUANTUM_M,
    CellPixels,
    level_image,
    packed,
    place_lattices,
    script_json,
    steps,
)
from semsig_gis.maps.page_elements import (
    LIFTING,
    NAMED_CLASSES,
    PAGE_FILES,
    Drawing,
    cell_image,
    colour_cells,
    corners_of,
    finished_map,
    folded,
    free_name,
    isolated,
    layers_of,
    made_by,
    panel_signs,
    part_of,
    prepared_map,
    ramp_bar,
    sources,
    swatch,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import folium
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Identifiability


BESIDE_M = 50.0  # from a cell, where a click tells of it


@dataclass(frozen=True, eq=False, kw_only=True)
class CellFacts:
    """A part of what a click on a cell tells, with numbers and a JavaScript function of its own.

    The file ``NAME.js`` defines the function ``semsig.cellFacts.NAME(city, cell)``. It returns what
    there is of ``title``; ``rows``: label and value each; ``jumps``: a label and buttons, each with
    a text, a cell and a hint; ``alike``: cells to compare with, the likeliest first, and why;
    ``kind``: of that comparison; ``dots``: cells and colours. ``arrays`` are packed numbers of the
    cells; ``settings`` are in ``city.grid``.
    """

    name: str
    arrays: Mapping[str, list[str]]
    settings: Mapping[str, Any]


class Cells(Drawing):
    """A layer without signs of its own that tells what is known of a cell when clicked.

    Of several on one map, each has only those packed numbers that none before it has.
    """

    _template = Template(
        "{% macro script(this, kwargs) %}var {{ this.get_name() }}_arrays = {{ this.packed() }};"
        "var {{ this.get_name() }} = "
        "semsig.cells({{ this.get_name() }}_arrays, {{ this.arguments }});{% endmacro %}"
    )

    def __init__(
        self, name: str | None, database: SignatureDatabase, facts: Sequence[CellFacts]
    ) -> None:
        arrays, grid = _cells(database)
        for part in facts:
            arrays |= part.arrays
            grid |= part.settings
        parts = [part.name for part in facts]
        super().__init__(name, "cells", grid, panel_signs(database), parts, group="ground")
        self.files = (*PAGE_FILES, "cells.css", "cells.js", *(f"{part}.js" for part in parts))
        self.database, self.facts, self.arrays = database, facts, arrays

    def packed(self) -> str:
        """Return the packed numbers for the script."""
        known: dict[tuple[str, ...], str] = {}
        for layer in layers_of(cast("folium.Map", self._parent)).values():
            if layer is self:
                break
            if isinstance(layer, Cells):
                for name, array in layer.arrays.items():
                    place = f"{layer.get_name()}_arrays[{script_json(name)}]"
                    known.setdefault(tuple(array), place)
        entries = (
            f"{script_json(name)}: {known.get(tuple(array)) or script_json(array)}"
            for name, array in self.arrays.items()
        )
        return f"{{{', '.join(entries)}}}"


def add_cells(map_: folium.Map, database: SignatureDatabase, facts: Sequence[CellFacts]) -> None:
    """Add a layer that tells of a cell when clicked; one that the map has of them tells more."""
    name = "Describe a cell when clicked"
    children = layers_of(map_)
    for key, child in list(children.items()):
        if not isinstance(child, Cells) or child.layer_name != name:
            continue
        if np.array_equal(child.database.cell_ids, database.cell_ids):
            del children[key]
            facts = list({part.name: part for part in (*child.facts, *facts)}.values())
    Cells(free_name(map_, name), database, facts).add_to(map_)


def city_view(database: SignatureDatabase) -> NDArray[np.float64]:
    """Return the latitudes and longitudes of the corners of all cells."""
    if len(database) == 0:
        raise InputError("the database has no cells to show; give one with at least one cell.")
    return corners_of(database)


def packed_signatures(
    name: str, database: SignatureDatabase, ends: NDArray[np.int64]
) -> dict[str, list[str]]:
    """Return signatures, with angle levels for bearings, and where those of each cell end.

    Beside them the objects that the cells see, by which the script tells where each one stands.
    """
    places, codes = _objects_seen(database)
    return {
        f"{name}.types": packed(database.taxonomy.symbol_bytes[database.codes]),
        f"{name}.ends": steps(ends.astype(np.int32)),
        f"{name}.levels": packed(database.levels),
        f"{name}.x": steps(places[:, 0]),
        f"{name}.y": steps(places[:, 1]),
        f"{name}.classes": packed(database.taxonomy.symbol_bytes[codes]),
    }


def _objects_seen(database: SignatureDatabase) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
    """Return places, in steps of `QUANTUM_M` from the origin, and class codes of objects seen.

    They come from bearings and distances, so that a few objects are there twice, half a metre off.
    """
    near = np.argsort(database.distance_units, kind="stable")
    angles = np.radians(database.bearings[near] + 0.5 * FULL_TURN / BEARING_UNITS)
    viewpoints = np.repeat(database.xy, database.lengths, axis=0)[near]
    away = database.distances[near, None] * np.stack([np.sin(angles), np.cos(angles)], axis=1)
    xy, codes = viewpoints + away - np.array(database.grid.origin), database.codes[near]
    # Seen from near they are known best, and come first.
    low = xy.min(axis=0, initial=np.inf)
    columns, rows = (np.rint(part).astype(np.int64) for part in (xy - low).T)
    keys = (columns << 32 | rows) << 8 | codes
    # Half as long as with a sort of all of them.
    first = np.flatnonzero(~pd.Series(keys).duplicated())
    first = first[np.argsort(keys[first])]
    return np.rint(xy[first] / QUANTUM_M).astype(np.int32), codes[first]


def _cells(database: SignatureDatabase) -> tuple[dict[str, list[str]], dict[str, Any]]:
    """Return where the cells are, and how to read it."""
    lattices, columns = place_lattices(database), database.columns - database.columns[0]
    arrays = {
        "rows": steps(database.rows),
        "columnEnds": steps(np.cumsum(np.bincount(columns)).astype(np.int32)),
        "metres": packed(lattices.metres),
        "degrees": packed(lattices.degrees),
    }
    grid = {
        "levels": database.spec.levels,
        "step": database.grid.step,
        "beside": BESIDE_M,
        "sight": database.spec.radius,
        "reach": database.reach,
        "quantum": QUANTUM_M,
        "origin": list(database.grid.origin),
        "firstColumn": int(database.columns[0]),
        "mercatorBox": lattices.mercator_box,
        "box": lattices.metric_box,
    }
    return arrays, grid


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
        What a click tells of queries from these cells, too.
    map_, tiles : optional
        As in `evaluation_map`.

    Returns
    -------
    folium.Map
        The map, with these layers: images of how many cells have the same types, and the same
        types and angle levels (hidden at first), and a layer without signs of its own; while it
        is on, a click tells of the cell, draws those that look the same, and jumps to them.

    Raises
    ------
    InputError
        If there is no cell, `identifiability` is of another database, or as in `evaluation_map`.

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
    pixels = CellPixels.of(database)
    for name, size in sizes.items():
        levels = pixels.levels(np.digitize(size, list(GROUP_COLOURS)).astype(np.uint8))
        image = pixels.image(levels, list(GROUP_COLOURS.values()))
        show = name == "Same types"
        colour_cells(page, name, cell_image(page, *image, dark="lift"), show=show)
    more = [] if identifiability is None else [_lookalike_facts(identifiability)]
    add_cells(page, database, [_group_facts(database), *more])
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
    map_, tiles : optional
        As in `evaluation_map`.

    Returns
    -------
    folium.Map
        The map, with these layers: the chance to be found of all cells as an image, and a layer
        without signs of its own; while it is on, a click tells of the cell, and draws the places
        that it is most often taken for.

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
    colour_cells(page, "Chance to be found", cell_image(page, *image, dark="lift"))
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


def ambiguity_legend(sizes: Mapping[str, NDArray[np.int64]], *, licenses: Sequence[str]) -> str:
    """Return the legend of a map of how many cells look the same, by what is compared, as HTML."""
    starts = list(GROUP_COLOURS)
    shares = [
        np.bincount(np.digitize(size, starts), minlength=len(starts) + 1)[1:] / len(size)
        for size in sizes.values()
    ]
    scales = []
    for (name, size), line in zip(sizes.items(), shares, strict=True):
        rows = "".join(
            f"<tr><td>{swatch(colour, LIFTING)}{label}</td>"
            f"<td class='count'>{percent(share)}</td></tr>"
            for colour, label, share in zip(
                GROUP_COLOURS.values(), group_labels(), line, strict=True
            )
        )
        scale = (
            f"<p><b>{percent(line[0])}</b> of {len(size):,} cells look like no other<br>"
            f"How many cells have the {escape(name.lower())}</p><table>{rows}</table>"
        )
        scales.append(part_of(name, scale))
    return (
        f"<summary>Cells that look the same</summary>{''.join(scales)}"
        f"<p>Click a cell for those like it: {swatch(SAME_TYPES)}same types "
        f"{swatch(SAME_LEVELS)}and angle levels</p>"
        f"{sources(licenses)}"
    )


def identifiability_legend(identifiability: Identifiability) -> str:
    """Return the legend of a map of where a query can be placed, as HTML with data escaped."""
    facts = identifiability.summary()
    within, view = f"within {facts['radius_m']:g} m", facts["view_degrees"]
    asked = "query" if view == FULL_TURN else f"photo of {view:g} degrees"
    bands = "<br>".join(
        f"{percent(band['from'], 0)} to {percent(band['to'], 0)}: "
        f"{percent(band['share'])} of the cells"
        for band in reversed(facts["bands"])
    )
    classes = "".join(
        f"<tr><td class='title'>{isolated(item['title'])}</td>"
        f"<td>{100 * item['chance_near']:+.1f} %</td></tr>"
        for item in facts["classes"][:NAMED_CLASSES]
    )
    scale = (
        f"<p>Chance to be found{ramp_bar(FOUND_RAMP, '0 %', '100 %', sign='ramp semsig-lift')}</p>"
    )
    figures = (
        f"<p>{bands}</p><p>What each class adds to the chance {within}</p><table>{classes}</table>"
    )
    return (
        "<summary>Where a query can be placed</summary>"
        f"<p><b>{percent(facts['chance_found'])}</b> chance to answer a {asked} {within}<br>"
        f"Mean of {facts['cells']:,} cells, "
        f"{made_by(isolated(facts['noise']) + ' noise')}<br>"
        "Click a cell to see what it is mistaken for</p>"
        f"{part_of('Chance to be found', scale)}"
        f"{folded('Figures', figures)}{sources(identifiability.database.licenses)}"
    )
