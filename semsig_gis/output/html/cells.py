"""Maps of cells: which look the same, and where a query can be placed."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pandas as pd
from folium.template import Template

from semsig_gis.core import (
    BEARING_UNITS,
    FULL_TURN,
    MAX_CODE,
    SAME_LEVELS,
    SAME_TYPES,
    InputError,
    percent,
)
from semsig_gis.output.html.image import (
    QUANTUM_M,
    CellPixels,
    level_image,
    packed,
    place_lattices,
    script_json,
    steps,
)
from semsig_gis.output.html.page_elements import (
    NAMED_CLASSES,
    PAGE_FILES,
    ScriptLayer,
    cell_image,
    colour_cells,
    corners_of,
    credits_part,
    escaped_text,
    finish_map,
    folded_part,
    layer_part,
    layers_of,
    panel_signs,
    ramp_bar,
    start_map,
    swatch,
    unique_layer_name,
)
from semsig_gis.output.layers.styles import AMBIGUITY, IDENTIFIABILITY

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import folium
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Identifiability


FINE_M, COARSE_M = 1.0, 2.0  # objects so near to each other are one, by the scale of distances
CLICK_TOLERANCE_M = 50.0  # distance from a click to the nearest cell that is described


@dataclass(frozen=True, eq=False, kw_only=True)
class CellFacts:
    """Facts about cells that the panel shows after a click, with their data and script.

    The file ``NAME.js`` defines the function ``semsig.cellFacts.NAME(city, cell)``. It returns any
    of ``title``; ``rows``: pairs of label and value; ``jumps``: a label with buttons, each with a
    text, a cell and a hint; ``lookalikes``: cells to compare with, the likeliest first, and the
    reason; ``kind``: the kind of this comparison; ``dots``: cells and colours. ``arrays`` are
    packed arrays of the cells; ``settings`` are added to ``city.grid``.
    """

    name: str
    arrays: Mapping[str, list[str]]
    settings: Mapping[str, Any]


class Cells(ScriptLayer):
    """An invisible layer that describes a cell when it is clicked.

    A packed array that several such layers of a map share is written only once.
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
        """Return the packed arrays for the script."""
        # References to the arrays of earlier layers of this map, by content.
        references: dict[tuple[str, ...], str] = {}
        for layer in layers_of(cast("folium.Map", self._parent)).values():
            if layer is self:
                break
            if isinstance(layer, Cells):
                for name, array in layer.arrays.items():
                    place = f"{layer.get_name()}_arrays[{script_json(name)}]"
                    references.setdefault(tuple(array), place)
        entries = (
            f"{script_json(name)}: {references.get(tuple(array)) or script_json(array)}"
            for name, array in self.arrays.items()
        )
        return f"{{{', '.join(entries)}}}"


def add_cells(map_: folium.Map, database: SignatureDatabase, facts: Sequence[CellFacts]) -> None:
    """Add a layer that describes a clicked cell, or add the facts to that layer of the map."""
    name = "Describe a cell when clicked"
    children = layers_of(map_)
    for key, child in list(children.items()):
        if not isinstance(child, Cells) or child.layer_name != name:
            continue
        if np.array_equal(child.database.cell_ids, database.cell_ids):
            del children[key]
            facts = list({part.name: part for part in (*child.facts, *facts)}.values())
    Cells(unique_layer_name(map_, name), database, facts).add_to(map_)


def city_view(database: SignatureDatabase) -> NDArray[np.float64]:
    """Return latitudes and longitudes of the corners of the box around all cells."""
    if len(database) == 0:
        raise InputError("the database has no cells to show; give one with at least one cell.")
    return corners_of(database)


def packed_signatures(
    name: str, database: SignatureDatabase, ends: NDArray[np.int64]
) -> dict[str, list[str]]:
    """Return signatures (types and angle levels) and the end of each cell, packed for the script.

    The visible objects are added, from which the script finds exact bearings and distances. Those
    of tall classes are seen from too far away for that: their entries have both.
    """
    tall = [item.code for item in database.taxonomy.classes if item.tall]
    far = np.isin(database.codes, tall)
    places, codes = _visible_objects(database, ~far)
    landmarks = {
        f"{name}.farBearings": packed(np.where(far, database.bearing_units, 0).astype(np.uint16)),
        f"{name}.farUnits": packed(np.where(far, database.distance_units, 0).astype(np.uint8)),
    }
    widths = database.extents
    whole = None if widths is None else np.rint(widths).astype(np.uint16)
    extents = {} if whole is None else {f"{name}.extents": packed(whole)}
    return {
        f"{name}.types": packed(database.codes),
        f"{name}.ends": steps(ends.astype(np.int32)),
        f"{name}.levels": packed(database.levels),
        f"{name}.x": steps(places[:, 0]),
        f"{name}.y": steps(places[:, 1]),
        f"{name}.classes": packed(codes),
        **(landmarks if far.any() else {}),
        **extents,
    }


def _visible_objects(
    database: SignatureDatabase, near: NDArray[np.bool_]
) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
    """Return places, in steps of `QUANTUM_M` from the origin, and class codes of visible objects.

    They are computed from the bearings and distances of the entries that are `near`, so a few
    objects occur twice, half a metre apart.
    """
    # Nearest first: the position of an object is most exact from the nearest cell.
    rows = np.flatnonzero(near)
    rows = rows[np.argsort(database.distance_units[rows], kind="stable")]
    angles = np.radians(database.bearings[rows] + 0.5 * FULL_TURN / BEARING_UNITS)
    viewpoints = np.repeat(database.xy, database.lengths, axis=0)[rows]
    away = database.distances[rows, None] * np.stack([np.sin(angles), np.cos(angles)], axis=1)
    xy, codes = viewpoints + away - np.array(database.grid.origin), database.codes[rows]
    # Keep the first occurrence of each object: key of column, row and class.
    low = xy.min(axis=0, initial=np.inf)
    grain = COARSE_M if database.scale.logarithmic else FINE_M
    columns, lines = (np.rint(part / grain).astype(np.int64) for part in (xy - low).T)
    keys = (columns << 32 | lines) << 8 | codes
    # Takes half the time of a sort of all keys.
    first = np.flatnonzero(~pd.Series(keys).duplicated())
    first = first[np.argsort(keys[first])]
    return np.rint(xy[first] / QUANTUM_M).astype(np.int32), codes[first]


def _cells(database: SignatureDatabase) -> tuple[dict[str, list[str]], dict[str, Any]]:
    """Return the positions of the cells, packed for the page, and the grid to unpack them."""
    lattices, columns = place_lattices(database), database.columns - database.columns[0]
    arrays = {
        "rows": steps(database.rows),
        "columnEnds": steps(np.cumsum(np.bincount(columns)).astype(np.int32)),
        "metres": packed(lattices.metres),
        "degrees": packed(lattices.degrees),
    }
    grid = {
        "levels": database.spec.levels,
        "symbols": database.taxonomy.decode(np.arange(MAX_CODE + 1)),
        "step": database.grid.step,
        "tolerance": CLICK_TOLERANCE_M,
        "reach": database.near_reach,
        "distances": np.rint(database.scale.metres).astype(int).tolist(),
        "quantum": QUANTUM_M,
        "origin": list(database.grid.origin),
        "firstColumn": int(database.columns[0]),
        "mercatorBox": lattices.mercator_box,
        "box": lattices.metric_box,
    }
    return arrays, grid


DOTS = 200  # largest number of cells of a group that are drawn
NEAREST_DOTS = 20  # nearest cells of a group that are always drawn
CHANCE_STEPS = 100  # steps of a chance in a byte
LEAST_LOOKALIKE_CHANCE = 0.01  # smallest chance of a lookalike in the page, to keep the page small
BIT_STEPS = 8  # steps of a bit in a byte
HELPERS = 2  # classes per cell that are named as helpful


def ambiguity_map(
    database: SignatureDatabase,
    *,
    identifiability: Identifiability | None = None,
    map_: folium.Map | None = None,
    tiles: str | None = None,
) -> folium.Map:
    """Show which cells have the same signature, and how many.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    identifiability : Identifiability, optional
        Results for queries from these cells, which a click shows as well.
    map_, tiles : optional
        As in `evaluation_map`.

    Returns
    -------
    folium.Map
        The map, with these layers: images of how many cells have the same types, and the same
        types and angle levels (hidden at first), and an invisible layer; while it is on, a click
        on a cell describes it, draws the cells that look the same, and offers jumps to them.

    Raises
    ------
    InputError
        If there is no cell, `identifiability` belongs to another database, or as in
        `evaluation_map`.

    Examples
    --------
    >>> ambiguity_map(demo_database).options["maxZoom"]
    20
    """
    view = city_view(database)
    if identifiability is not None:
        identifiability.require_cells_of(database)
    page = start_map(map_, tiles, title="Cells that look the same")
    types, angles = database.type_sequences, database.angle_sequences
    # Number the pairs of a type sequence and an angle sequence, and count the cells of each.
    pairs = types.inverse * len(angles) + angles.inverse
    _, pair, counts = np.unique(pairs, return_inverse=True, return_counts=True)
    sizes = {"Same types": database.type_group_sizes, "Same types and angle levels": counts[pair]}
    pixels = CellPixels.of(database)
    for name, size in sizes.items():
        image = pixels.image(pixels.levels(AMBIGUITY.levels(size)), AMBIGUITY.colours)
        show = name == "Same types"
        colour_cells(page, name, cell_image(page, *image, dark="keep"), show=show)
    more = [] if identifiability is None else [_lookalike_facts(identifiability)]
    add_cells(page, database, [_group_facts(database), *more])
    legend = ambiguity_legend(sizes, licenses=database.licenses)
    return finish_map(page, database, legend=legend, view=view if map_ is None else None)


def identifiability_map(
    identifiability: Identifiability, *, map_: folium.Map | None = None, tiles: str | None = None
) -> folium.Map:
    """Show where a query can be localized, and which cells it may be confused with.

    Parameters
    ----------
    identifiability : Identifiability
        What to show.
    map_, tiles : optional
        As in `evaluation_map`.

    Returns
    -------
    folium.Map
        The map, with these layers: an image of the chance that a query from each cell is found,
        and an invisible layer; while it is on, a click on a cell describes it and draws the cells
        that it is most often confused with.

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
    page = start_map(map_, tiles, title="Where a query can be placed")
    levels = IDENTIFIABILITY.levels(identifiability.found)
    image = level_image(database, levels, IDENTIFIABILITY.colours)
    colour_cells(page, "Chance to be found", cell_image(page, *image, dark="keep"))
    add_cells(page, database, [_group_facts(database), _lookalike_facts(identifiability)])
    legend = identifiability_legend(identifiability)
    return finish_map(page, database, legend=legend, view=view if map_ is None else None)


def _group_facts(database: SignatureDatabase) -> CellFacts:
    """Return the signatures of the cells, from which the script finds cells that look the same."""
    return CellFacts(
        name="groups",
        arrays=packed_signatures("now", database, database.offsets[1:]),
        settings={"dots": DOTS, "near": NEAREST_DOTS, "colours": [SAME_TYPES, SAME_LEVELS]},
    )


def _lookalike_facts(identifiability: Identifiability) -> CellFacts:
    """Return the results for a query from each cell: chances, lookalikes and helpful classes."""
    # The classes that raise the chance of a cell most, best first.
    gains, lookalikes = identifiability.gains, identifiability.lookalikes
    count = min(HELPERS, gains.shape[1])
    helpers = np.argsort(-gains, axis=1, kind="stable")[:, :count]
    titles = {item.code: item.title for item in identifiability.database.taxonomy.classes}
    chances = identifiability.lookalike_chances
    likely = chances >= LEAST_LOOKALIKE_CHANCE
    return CellFacts(
        name="lookalikes",
        arrays={
            "found": _chance_bytes(identifiability.found),
            "near": _chance_bytes(identifiability.near),
            "itself": _chance_bytes(identifiability.itself),
            "bits": packed(np.rint(identifiability.bits * BIT_STEPS).clip(0, 255).astype(np.uint8)),
            "lookalikes": packed(np.where(likely, lookalikes, -1).astype(np.int32)),
            "lookalikeChances": _chance_bytes(np.where(likely, chances, 0.0)),
            "helpers": packed(helpers.astype(np.uint8)),
            "gains": _chance_bytes(np.take_along_axis(gains, helpers, axis=1)),
        },
        settings={
            "radius": identifiability.radius,
            "places": lookalikes.shape[1],
            "helpers": count,
            "chances": CHANCE_STEPS,
            "bits": BIT_STEPS,
            "classes": [titles[item.code] for item in identifiability.classes],
        },
    )


def _chance_bytes(chances: NDArray[np.float64]) -> list[str]:
    return packed(np.rint(chances * CHANCE_STEPS).clip(0, CHANCE_STEPS).astype(np.uint8))


def ambiguity_legend(sizes: Mapping[str, NDArray[np.int64]], *, licenses: Sequence[str]) -> str:
    """Return the legend of `ambiguity_map` as HTML; `sizes` holds group sizes by layer name."""
    scales = []
    for name, size in sizes.items():
        shares = np.bincount(AMBIGUITY.levels(size), minlength=len(AMBIGUITY.labels) + 1) / len(
            size
        )
        rows = "".join(
            f"<tr><td>{swatch(colour, 'square')}{label}</td>"
            f"<td class='count'>{percent(share, 1)}</td></tr>"
            for (_, _, label, colour), share in zip(AMBIGUITY.ranges, shares[1:], strict=True)
        )
        scale = (
            f"<p><b>{percent(shares[1], 1)}</b> of {len(size):,} cells look like no other<br>"
            f"How many cells have the {escape(name.lower())}</p><table>{rows}</table>"
        )
        scales.append(layer_part(name, scale))
    return (
        f"<summary>Cells that look the same</summary>{''.join(scales)}"
        f"<p>Click a cell to show cells like it: {swatch(SAME_TYPES)}same types "
        f"{swatch(SAME_LEVELS)}same types and angle levels</p>"
        f"{credits_part(licenses)}"
    )


def identifiability_legend(identifiability: Identifiability) -> str:
    """Return the legend of `identifiability_map` as HTML with data escaped."""
    facts = identifiability.summary()
    within, view = f"within {facts['radius_m']:g} m", facts["view_degrees"]
    query = "query" if view == FULL_TURN else f"photo of {view:g} degrees"
    bands = "<br>".join(
        f"{percent(band['from'], 0)} to {percent(band['to'], 0)}: "
        f"{percent(band['share'], 1)} of the cells"
        for band in reversed(facts["bands"])
    )
    classes = "".join(
        f"<tr><td class='title'>{escaped_text(item['title'])}</td>"
        f"<td>{100 * item['chance_near']:+.1f} %</td></tr>"
        for item in facts["classes"][:NAMED_CLASSES]
    )
    bar = ramp_bar(IDENTIFIABILITY.colours, "0 %", "100 %")
    scale = f"<p>Chance to be found{bar}</p>"
    figures = (
        f"<p>{bands}</p><p>What each class adds to the chance {within}</p><table>{classes}</table>"
    )
    return (
        "<summary>Where a query can be placed</summary>"
        f"<p><b>{percent(facts['chance_found'], 1)}</b> chance to answer a {query} {within}<br>"
        f"Mean of {facts['cells']:,} cells, "
        f"{escaped_text(facts['noise'])} noise<br>"
        "Click a cell to see what it is mistaken for</p>"
        f"{layer_part('Chance to be found', scale)}"
        f"{folded_part('Figures', figures)}{credits_part(identifiability.database.licenses)}"
    )
