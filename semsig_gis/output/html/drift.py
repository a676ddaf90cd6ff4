"""Map of the changes in a city between two dates."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd

from semsig_gis.core import DRIFT_COLOURS, OBJECT_COLOURS, SOURCE, SOURCE_ID, CrsError, percent
from semsig_gis.database import compare_cells, join_databases, require_same_place
from semsig_gis.objects import compare_objects, joined_taxonomy
from semsig_gis.output.html.cells import CellFacts, Cells, city_view, packed_signatures
from semsig_gis.output.html.image import level_image, packed
from semsig_gis.output.html.page_elements import (
    FLIPPING,
    LIFTING,
    NAMED_CLASSES,
    add_layer,
    cell_image,
    colour_cells,
    credits_part,
    escaped_text,
    finish_map,
    folded_part,
    layer_part,
    start_map,
    swatch,
    to_latlon,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import folium
    from numpy.typing import NDArray

    from semsig_gis.core import Taxonomy
    from semsig_gis.database import CellChanges, SignatureDatabase
    from semsig_gis.objects import ObjectChanges, StreetObjects

OBJECT_FIELDS = ("Class", "Class before", "Moved by", "Source", "Identifier")
POPUP = ["title", "was", "by", SOURCE, SOURCE_ID]
PLACE = ["latitude", "longitude"]


def drift_map(
    before: SignatureDatabase,
    after: SignatureDatabase,
    *,
    objects_before: StreetObjects | None = None,
    objects_after: StreetObjects | None = None,
    map_: folium.Map | None = None,
    tiles: str | None = None,
) -> folium.Map:
    """Show what has changed in a city: cells with another signature, and the changed objects.

    Parameters
    ----------
    before, after : SignatureDatabase
        Databases of one city at two dates, built with the same settings.
    objects_before, objects_after : StreetObjects, optional
        The street objects that they were built from, in the same CRS; both or neither.
    map_, tiles : optional
        As in `evaluation_map`.

    Returns
    -------
    folium.Map
        The map, with these layers: an image of the cells that are the same, and one of the cells
        that have changed, appeared or vanished, where a click describes a cell; and, where the
        objects are given, one layer each of the removed, added, moved and reclassified objects,
        described by a click.

    Raises
    ------
    DatabaseError
        If the databases were built with different settings.
    CrsError
        If the objects are in another CRS than the databases.
    InputError
        If they cover different places or use a class code for different classes, or as in
        `evaluation_map`.

    Examples
    --------
    >>> from semsig_gis import build_database
    >>> from semsig_gis.objects.table import StreetObjects
    >>> table = demo_objects.table[5:]
    >>> fewer = StreetObjects(table, demo_objects.taxonomy, demo_objects.licenses)
    >>> drift_map(demo_database, build_database(fewer)).options["maxZoom"]
    20
    """
    cells = compare_cells(before, after)
    taxonomy = joined_taxonomy(before.taxonomy, after.taxonomy)
    old, new = (replace(database, taxonomy=taxonomy) for database in (before, after))
    # All cells of both dates, with signatures of the newer date where there are two.
    city = join_databases([new, old.select(cells.vanished)])
    view = city_view(city)
    if len(old) and len(new):
        require_same_place(old, new.xy, "cells of the newer database")
    kinds = _kinds(city, old, new, cells)
    page = start_map(map_, tiles, title="What has changed")
    colours, same = list(DRIFT_COLOURS.values()), kinds == 1
    # Two images, because unchanged cells have a light colour and changed cells a dark one.
    halves: tuple[tuple[NDArray[np.bool_], Literal["flip", "lift"]], ...]
    halves = (same, "flip"), (~same, "lift")
    images = [
        cell_image(page, *level_image(city.select(rows), kinds[rows], colours), dark=dark)
        for rows, dark in halves
        if rows.any()
    ]
    # The signatures of unchanged cells are those before, so only the others are packed again.
    differing = new.select(np.sort(np.concatenate([cells.changed[:, 1], cells.appeared])))
    arrays = {
        "kind": packed(kinds),
        **_signatures("before", old, city),  # shared with another map of the older database
        **_signatures("now", differing, city),
    }
    facts = CellFacts(name="change", arrays=arrays, settings={"kinds": list(DRIFT_COLOURS)})
    cells_now = Cells(None, city, [facts])
    cells_now.add_to(page)
    colour_cells(page, "What has changed", *images, cells_now)
    objects = None
    if objects_before is not None and objects_after is not None:
        for objects_then in (objects_before, objects_after):
            if objects_then.crs != city.crs:
                raise CrsError(
                    f"the objects are in {objects_then.crs.to_string()} and the database is in "
                    f"{city.crs.to_string()}; give the objects that it was built from."
                )
        objects = compare_objects(objects_before, objects_after)
        for name, drawings in _object_drawings(objects_before, objects_after, objects):
            add_layer(page, name, "drawings", drawings, group="objects")
    legend = drift_legend(cells, objects, taxonomy=taxonomy, licenses=city.licenses)
    return finish_map(page, city, legend=legend, view=view if map_ is None else None)


def _kinds(
    city: SignatureDatabase, old: SignatureDatabase, new: SignatureDatabase, cells: CellChanges
) -> NDArray[np.uint8]:
    """Return the kind of change of each cell: its position in `DRIFT_COLOURS`, from 1."""
    ids = {
        "same": new.cell_ids[cells.same[:, 1]],
        "changed": new.cell_ids[cells.changed[:, 1]],
        "appeared": new.cell_ids[cells.appeared],
        "vanished": old.cell_ids[cells.vanished],
    }
    kinds = np.empty(len(city), np.uint8)
    for number, kind in enumerate(DRIFT_COLOURS, start=1):
        kinds[np.searchsorted(city.cell_ids, ids[kind])] = number
    return kinds


def _signatures(
    name: str, database: SignatureDatabase, city: SignatureDatabase
) -> dict[str, list[Any]]:
    """Return the signatures of the cells of the city, empty for cells not in the database."""
    lengths = np.zeros(len(city), np.int32)
    lengths[np.searchsorted(city.cell_ids, database.cell_ids)] = database.lengths
    return packed_signatures(name, database, np.cumsum(lengths))


def _object_drawings(
    old: StreetObjects, new: StreetObjects, changes: ObjectChanges
) -> Iterator[tuple[str, list[list[Any]]]]:
    """Yield the name and the drawings of a layer for each kind of change that occurs."""
    kinds = {
        "removed": (_facts(old, changes.removed), None),
        "added": (_facts(new, changes.added), None),
        "moved": (_facts(new, changes.moved[:, 1]), _facts(old, changes.moved[:, 0])),
        "of another class": (
            _facts(new, changes.changed[:, 1]),
            _facts(old, changes.changed[:, 0]),
        ),
    }
    for kind, (facts, before) in kinds.items():
        if facts.empty:
            continue
        drawings: list[list[Any]] = []
        # A line from the old place to the new one.
        if before is not None:
            moves = np.hypot(facts["x"] - before["x"], facts["y"] - before["y"])
            facts["by"] = [f"{metres:.1f} m" for metres in moves]
            facts["was"] = before["title"]
            lines = np.stack([before[PLACE], facts[PLACE]], axis=1).tolist()
            drawings = [["lines", [[{"color": "#808080", "weight": 2, "opacity": 0.9}, lines]]]]
        places, details = (facts[columns].to_numpy().tolist() for columns in (PLACE, POPUP))
        records = [
            [place, OBJECT_COLOURS[kind], 5, f"Object {kind}", values]
            for place, values in zip(places, details, strict=True)
        ]
        drawings.append(["points", OBJECT_FIELDS, {}, records])
        yield f"Objects {kind} ({len(facts):,})", drawings


def _facts(objects: StreetObjects, rows: NDArray[np.int64]) -> pd.DataFrame:
    """Return source, class and place of some objects, with empty columns ``was`` and ``by``."""
    titles = {item.code: item.title for item in objects.taxonomy.classes}
    facts = pd.DataFrame(objects.table[[SOURCE, SOURCE_ID]]).iloc[rows].reset_index(drop=True)
    facts[["was", "by"]] = None
    facts["title"] = [titles[code] for code in objects.codes[rows].tolist()]
    facts[["x", "y"]] = objects.xy[rows]
    facts[PLACE] = to_latlon(objects.xy[rows], objects.crs)
    return facts


def drift_legend(
    cells: CellChanges,
    objects: ObjectChanges | None,
    *,
    taxonomy: Taxonomy,
    licenses: Sequence[str],
) -> str:
    """Return the legend of `drift_map` as HTML with data escaped."""
    kinds = {
        "same": (cells.same, "see what they saw"),
        "changed": (cells.changed, "see something else"),
        "appeared": (cells.appeared, "saw nothing before"),
        "vanished": (cells.vanished, "see nothing now"),
    }
    total = sum(len(rows) for rows, _ in kinds.values())
    lines = "".join(
        f"<tr><td>{swatch(colour, FLIPPING if kind == 'same' else LIFTING)}{kinds[kind][1]}</td>"
        f"<td>{len(kinds[kind][0]):,}</td><td>{percent(len(kinds[kind][0]) / total, 1)}</td></tr>"
        for kind, colour in DRIFT_COLOURS.items()
    )
    changed = 1.0 - len(cells.same) / total
    return (
        "<summary>What has changed</summary>"
        f"<p><b>{percent(changed, 1)}</b> of {total:,} cells see something else<br>"
        "Click a cell to see what it saw before</p>"
        f"{layer_part('What has changed', f'<table>{lines}</table>')}"
        f"{'' if objects is None else _object_changes(objects, taxonomy)}"
        f"{credits_part(licenses)}"
    )


def _object_changes(objects: ObjectChanges, taxonomy: Taxonomy) -> str:
    """Return the number of changed objects by kind, and of the most changed classes, as HTML."""
    kinds = {
        "added": objects.added,
        "removed": objects.removed,
        "moved": objects.moved,
        "of another class": objects.changed,
    }
    counts = "".join(
        layer_part(f"Objects {kind}", f"{swatch(OBJECT_COLOURS[kind])}{len(rows):,} {kind}")
        for kind, rows in kinds.items()
        if len(rows)
    )
    changes = {
        item: item.added + item.removed + item.moved + item.gained + item.lost
        for item in objects.classes
    }
    most = sorted((item for item in changes if changes[item]), key=lambda item: -changes[item])
    rows = "".join(
        f"<tr><td class='title'>{escaped_text(taxonomy.by_name(item.class_name).title)}</td>"
        f"<td>{item.added:,}</td><td>{item.removed:,}</td><td>{item.moved:,}</td></tr>"
        for item in most[:NAMED_CLASSES]
    )
    head = "".join(f"<td><small>{name}</small></td>" for name in ("added", "removed", "moved"))
    table = f"<table><tr><td></td>{head}</tr>{rows}</table>" if most else ""
    return f"<p>Street objects</p>{counts}{folded_part('By class', table) if table else ''}"
