"""The map of what has changed between two dates, in a real browser."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import shapely
from map_pages import IMAGES, LEGEND
from worlds import CODES, TAXONOMY, random_town

from semsig_gis.core.signs import OBJECT_COLOURS
from semsig_gis.database.build import build_database
from semsig_gis.database.update import compare_cells
from semsig_gis.maps.drift import drift_map
from semsig_gis.maps.objects import objects_map
from semsig_gis.maps.parts import layers_of
from semsig_gis.objects.changes import compare_objects

if TYPE_CHECKING:
    from map_pages import MapPage

    from semsig_gis.objects.table import StreetObjects

BEFORE = random_town().street_objects


def later() -> StreetObjects:
    """Return the town with three objects gone, a new one, one moved and one of another class."""
    table = BEFORE.table[3:].reset_index(drop=True)
    places = shapely.get_coordinates(table.geometry)
    places[0] += (4.0, 3.0)
    table.loc[1, "class_code"] = next(one for one in CODES if one != table["class_code"][1])
    new = table[2:3].assign(source_id="new")
    places = np.concatenate([places, places.min(axis=0, keepdims=True) - 15.0])
    table = type(table)(
        [*table.to_dict("records"), *new.to_dict("records")], crs=BEFORE.crs
    ).astype(BEFORE.table.drop(columns="geometry").dtypes.to_dict())
    return dataclasses.replace(BEFORE, table=table.set_geometry(shapely.points(places)))


AFTER = later()
OLD, NEW = build_database(BEFORE), build_database(AFTER)
CELLS = compare_cells(OLD, NEW)


def test_cells_before_and_now(page: MapPage) -> None:
    page.open(drift_map(OLD, NEW))
    assert page.browser.title == "What has changed"
    assert len(page.all(IMAGES)) == 2
    page.ask("map.setZoom(19, {animate: false})")
    assert min(map(len, (CELLS.same, CELLS.changed, CELLS.appeared, CELLS.vanished))) > 0
    (_, same), (before, now) = CELLS.same[0].tolist(), CELLS.changed[0].tolist()
    come, gone = int(CELLS.appeared[0]), int(CELLS.vanished[0])
    said = page.click(NEW, same)
    assert said["title"] == "A cell that sees what it saw"
    assert said["It sees"].startswith(NEW.types(same))
    assert "Before" not in said
    for city, cell, title, first, then in (
        (OLD, before, "A cell that sees something else", OLD.types(before), NEW.types(now)),
        (NEW, come, "A new cell: it saw nothing", "nothing", NEW.types(come)),
        (OLD, gone, "A cell that sees nothing any more", OLD.types(gone), "nothing"),
    ):
        said = page.click(city, cell)
        assert (said["title"], said["Cell"]) == (title, str(city.cell_ids[cell]))
        assert said["Before"].startswith(first)
        assert said["Now"].startswith(then)
    difference = {
        (one[-1], int(one[1:].split("\u00a0")[0])) for one in said["Difference"].split(", ")
    }
    assert difference == {(one, OLD.types(gone).count(one)) for one in set(OLD.types(gone))}
    legend = page.one(LEGEND).text
    for rows, title in (
        (CELLS.same, "see what they saw"),
        (CELLS.changed, "see something else"),
        (CELLS.appeared, "saw nothing before"),
        (CELLS.vanished, "see nothing now"),
    ):
        assert f"{title} {len(rows):,}" in legend
    assert "Street objects" not in legend


def test_objects_that_have_changed(page: MapPage) -> None:
    page.open(drift_map(OLD, NEW, objects_before=BEFORE, objects_after=AFTER))
    assert "3 removed" in page.one(LEGEND).text
    # By kind, by class and by identifier, the best match first.
    (moved,) = compare_objects(BEFORE, AFTER).moved[:, 1]
    title = TAXONOMY.by_code(int(AFTER.codes[moved])).title
    called = f"Object moved\n{title}, {AFTER.table['source_id'].iloc[moved]}"
    assert page.search("moved")[0] == called
    assert called in page.search(title.upper())
    assert page.search("new")[0].startswith("Object added\n")
    page.ask("map.closePopup()")
    for kind, count in {"removed": 3, "added": 1, "moved": 1, "of another class": 1}.items():
        colour = OBJECT_COLOURS[kind]
        assert page.circles(colour) == count
        said = page.popup_of(colour)
        assert said.startswith(f"Object {kind}")
        assert ("5.0 m" in said) == (kind == "moved")
        assert ("Class before" in said) == (kind in {"moved", "of another class"})
        page.switch(f"Objects {kind}")
        assert page.circles(colour) == 0


def test_a_class_is_found_before_its_objects(page: MapPage) -> None:
    map_ = drift_map(OLD, NEW, objects_before=BEFORE, objects_after=AFTER)
    page.open(objects_map(AFTER, map_=map_))
    title = TAXONOMY.by_code(int(BEFORE.codes[0])).title
    offered = page.search(title)
    assert offered[0].startswith(f"{title}\nall ")
    assert offered[1].startswith("Object removed\n")


def test_nothing_has_changed_or_everything() -> None:
    half = len(OLD) // 2
    same = drift_map(OLD, OLD, objects_before=BEFORE, objects_after=BEFORE)
    other = drift_map(OLD.select(slice(half)), OLD.select(slice(half, None)))
    for map_, cells in ((same, "Cells that are the same"), (other, "Cells that differ")):
        names = [getattr(child, "layer_name", "") for child in layers_of(map_).values()]
        assert [name for name in names if name.startswith(("Cells that", "Objects"))] == [cells]
