"""A map of what has changed in a city between two dates."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd

from semsig_gis.core import DRIFT_COLOURS, OBJECT_COLOURS, SOURCE, SOURCE_ID, CrsError, percent
from semsig_gis.database import compare_cells, join_databases, require_same_place
from semsig_gis.maps.cells import CellFacts, Cells, city_view, packed_signatures
from semsig_gis.maps.image import level_image, packed
from semsig_gis.maps.page_elements import (
    FLIPPING,
    LIFTING,
    NAMED_CLASSES,
    cell_image,
    colour_cells,
    draw,
    finished_map,
    folded,
    isolated,
    part_of,
    prepared_map,
    sources,
    swatch,
    to_latlon,
)
from semsig_gis.objects import compare_objects, joined_taxonomy

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
    """Show what has changed in a city: the cells that see something else, and why.

    Parameters
    ----------
    before, after : SignatureDatabase
        Databases of one city at two dates, made in the same way.
    objects_before, objects_after : StreetObjects, optional
        The street objects that they were built from, in the same CRS; give both or neither.
    map_, tiles : optional
        As in `evaluation_map`.

    Returns
    -------
    folium.Map
        The map, with these layers: the cells that are the same, and those that have changed,
        appeared or vanished, as images; a layer without signs of its own that tells of a cell by a
        click; and, where the objects are given, those that were removed, added, moved, or are of
        another class, told of by a click.

    Raises
    ------
    DatabaseError
        If the databases were not made in the same way.
    CrsError
        If the objects are in another CRS than the databases.
    InputError
        If they are of different places or use a class code for different classes, or as in
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
    old, new = (replace(one, taxonomy=taxonomy) for one in (before, after))
    # All cells of both dates.
    city = join_databases([new, old.select(cells.vanished)])
    view = city_view(city)
    if len(old) and len(new):
        require_same_place(old, new.xy, "cells of the newer database")
    kinds = _kinds(city, old, new, cells)
    page = prepared_map(map_, tiles, title="What has changed")
    colours, same = list(DRIFT_COLOURS.values()), kinds == 1
    looks: tuple[tuple[NDArray[np.bool_], Literal["flip", "lift"]], ...]
    looks = (same, "flip"), (~same, "lift")
    images = [
        cell_image(page, *level_image(city.select(some), kinds[some], colours), dark=dark)
        for some, dark in looks
        if some.any()
    ]
    differing = new.select(np.sort(np.concatenate([cells.changed[:, 1], cells.appeared])))
    arrays = {
        "kind": packed(kinds),
        **_signatures("before", old, city),  # as a map of the cells before has them, too
        **_signatures("now", differing, city),
    }
    facts = CellFacts(name="change", arrays=arrays, settings={"kinds": list(DRIFT_COLOURS)})
    cells_now = Cells(None, city, [facts])
    cells_now.add_to(page)
    colour_cells(page, "What has changed", *images, cells_now)
    objects = None
    if objects_before is not None and objects_after is not None:
        for some in (objects_before, objects_after):
            if some.crs != city.crs:
                raise CrsError(
                    f"the objects are in {some.crs.to_string()} and the database is in "
                    f"{city.crs.to_string()}; give the objects that it was built from."
                )
        objects = compare_objects(objects_before, objects_after)
        for name, drawings in _object_drawings(objects_before, objects_after, objects):
            draw(page, name, "drawings", drawings, group="objects")
    legend = drift_legend(cells, objects, taxonomy=taxonomy, licenses=city.licenses)
    return finished_map(page, city, legend=legend, view=view if map_ is None else None)


def _kinds(
    city: SignatureDatabase, old: SignatureDatabase, new: SignatureDatabase, cells: CellChanges
) -> NDArray[np.uint8]:
    """Return of each cell of the city the number of its colour, from 1."""
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
    """Return the signatures of those cells of the city that the database has."""
    lengths = np.zeros(len(city), np.int32)
    lengths[np.searchsorted(city.cell_ids, database.cell_ids)] = database.lengths
    return packed_signatures(name, database, np.cumsum(lengths))


def _object_drawings(
    old: StreetObjects, new: StreetObjects, changes: ObjectChanges
) -> Iterator[tuple[str, list[list[Any]]]]:
    """Yield name and drawings of a layer of each kind of change that there is."""
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
    """Return what there is to say of some objects."""
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
    """Return the legend of a map of changes between two dates, as HTML with data escaped."""
    kinds = {
        "same": (cells.same, "see what they saw"),
        "changed": (cells.changed, "see something else"),
        "appeared": (cells.appeared, "saw nothing before"),
        "vanished": (cells.vanished, "see nothing now"),
    }
    total = sum(len(rows) for rows, _ in kinds.values())
    lines = "".join(
        f"<tr><td>{swatch(colour, FLIPPING if kind == 'same' else LIFTING)}{kinds[kind][1]}</td>"
        f"<td>{len(kinds[kind][0]):,}</td><td>{percent(len(kinds[kind][0]) / total)}</td></tr>"
        for kind, colour in DRIFT_COLOURS.items()
    )
    changed = 1.0 - len(cells.same) / total
    return (
        "<summary>What has changed</summary>"
        f"<p><b>{percent(changed)}</b> of {total:,} cells see something else<br>"
        "Click a cell to see what it saw before</p>"
        f"{part_of('What has changed', f'<table>{lines}</table>')}"
        f"{'' if objects is None else _object_changes(objects, taxonomy)}"
        f"{sources(licenses)}"
    )


def _object_changes(objects: ObjectChanges, taxonomy: Taxonomy) -> str:
    """Return how many objects have changed, and of which classes most."""
    kinds = {
        "added": objects.added,
        "removed": objects.removed,
        "moved": objects.moved,
        "of another class": objects.changed,
    }
    counts = "".join(
        part_of(f"Objects {kind}", f"{swatch(OBJECT_COLOURS[kind])}{len(rows):,} {kind}")
        for kind, rows in kinds.items()
        if len(rows)
    )
    changes = {
        item: item.added + item.removed + item.moved + item.gained + item.lost
        for item in objects.classes
    }
    most = sorted((item for item in changes if changes[item]), key=lambda one: -changes[one])
    rows = "".join(
        f"<tr><td class='title'>{isolated(taxonomy.by_name(item.class_name).title)}</td>"
        f"<td>{item.added:,}</td><td>{item.removed:,}</td><td>{item.moved:,}</td></tr>"
        for item in most[:NAMED_CLASSES]
    )
    head = "".join(f"<td><small>{name}</small></td>" for name in ("added", "removed", "moved"))
    table = f"<table><tr><td></td>{head}</tr>{rows}</table>" if most else ""
    return f"<p>Street objects</p>{counts}{folded('By class', table) if table else ''}"
