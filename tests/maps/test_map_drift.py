"""The map of what has changed between two dates, in a real browser."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import folium
import numpy as np
import pytest
import shapely
from cell_clicks import click
from map_pages import HOSTILE, asked, assert_quiet, hostile_database, opened, searched, switch
from selenium.webdriver.common.by import By
from sentences import assert_sentence
from worlds import CODES, TAXONOMY, random_town

from semsig_gis.core.colours import OBJECT_COLOURS
from semsig_gis.core.errors import CrsError, DatabaseError, InputError
from semsig_gis.core.signature import SignatureSpec
from semsig_gis.core.taxonomy import Taxonomy
from semsig_gis.database.build import build_database
from semsig_gis.database.update import compare_cells
from semsig_gis.maps.drift import drift_map
from semsig_gis.maps.objects import objects_map
from semsig_gis.objects.changes import compare_objects
from semsig_gis.objects.table import Licence

if TYPE_CHECKING:
    from pathlib import Path

    from selenium.webdriver import Chrome

    from semsig_gis.database.database import SignatureDatabase
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
OTHER = Taxonomy((dataclasses.replace(TAXONOMY.classes[0], name="other"), *TAXONOMY.classes[1:]))
TURNED = dataclasses.replace(AFTER, table=AFTER.table.to_crs("EPSG:32631"))


@pytest.mark.usefixtures("carried")
def test_cells_before_and_now(browser: Chrome, tmp_path: Path) -> None:
    opened(browser, drift_map(OLD, NEW), tmp_path)
    assert browser.title == "What has changed"
    assert len(browser.find_elements(By.CSS_SELECTOR, "img.leaflet-image-layer")) == 2
    asked(browser, "map.setZoom(19, {animate: false})")
    assert min(map(len, (CELLS.same, CELLS.changed, CELLS.appeared, CELLS.vanished))) > 0
    same, changed = CELLS.same[0].tolist(), CELLS.changed[0].tolist()
    said = click(browser, OLD, same[0])
    assert said["title"] == "A cell that sees what it saw"
    assert said["It sees"].startswith(NEW.types(same[1]))
    assert "Before" not in said
    said = click(browser, OLD, changed[0])
    assert said["title"] == "A cell that sees something else"
    assert said["Before"].startswith(OLD.types(changed[0]))
    assert said["Now"].startswith(NEW.types(changed[1]))
    assert said["Cell"] == str(OLD.cell_ids[changed[0]])
    said = click(browser, NEW, int(CELLS.appeared[0]))
    assert said["title"] == "A new cell: it saw nothing"
    assert said["Before"] == "nothing"
    assert said["Now"].startswith(NEW.types(int(CELLS.appeared[0])))
    gone = int(CELLS.vanished[0])
    said = click(browser, OLD, gone)
    assert said["title"] == "A cell that sees nothing any more"
    assert said["Now"] == "nothing"
    difference = {
        (one[-1], int(one[1:].split("\u00a0")[0])) for one in said["Difference"].split(", ")
    }
    assert difference == {(one, OLD.types(gone).count(one)) for one in set(OLD.types(gone))}
    legend = browser.find_element(By.CSS_SELECTOR, ".semsig-legend").text
    for rows, title in (
        (CELLS.same, "see what they saw"),
        (CELLS.changed, "see something else"),
        (CELLS.appeared, "saw nothing before"),
        (CELLS.vanished, "see nothing now"),
    ):
        assert f"{title} {len(rows):,}" in legend
    assert "Street objects" not in legend
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_objects_that_have_changed(browser: Chrome, tmp_path: Path) -> None:
    map_ = drift_map(OLD, NEW, objects_before=BEFORE, objects_after=AFTER)
    opened(browser, map_, tmp_path)
    changes = compare_objects(BEFORE, AFTER)
    counts = {
        "removed": len(changes.removed),
        "added": len(changes.added),
        "moved": len(changes.moved),
        "of another class": len(changes.changed),
    }
    assert counts == {"removed": 3, "added": 1, "moved": 1, "of another class": 1}
    legend = browser.find_element(By.CSS_SELECTOR, ".semsig-legend").text
    assert "3 removed" in legend
    # By kind, by class and by identifier, the best match first.
    (moved,) = changes.moved[:, 1]
    title = TAXONOMY.by_code(int(AFTER.codes[moved])).title
    called = f"Object moved\n{title}, {AFTER.table['source_id'].iloc[moved]}"
    assert searched(browser, "moved")[0] == called
    assert called in searched(browser, title.upper())
    assert searched(browser, "new")[0].startswith("Object added\n")
    asked(browser, "map.closePopup()")
    last = "return [...document.querySelectorAll('.semsig-details')].pop().innerText"
    for kind, count in counts.items():
        colour = OBJECT_COLOURS[kind]
        assert asked(browser, "return circles(arguments[0]).length", colour) == count
        asked(browser, "circles(arguments[0])[0].openPopup()", colour)
        said = browser.execute_script(last)
        assert said.startswith(f"Object {kind}")
        assert ("5.0 m" in said) == (kind == "moved")
        assert ("Class before" in said) == (kind in {"moved", "of another class"})
        switch(browser, f"Objects {kind}")
        assert asked(browser, "return circles(arguments[0]).length", colour) == 0
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_a_class_is_found_before_its_objects(browser: Chrome, tmp_path: Path) -> None:
    map_ = drift_map(OLD, NEW, objects_before=BEFORE, objects_after=AFTER)
    opened(browser, objects_map(AFTER, map_=map_), tmp_path)
    title = TAXONOMY.by_code(int(BEFORE.codes[0])).title
    offered = searched(browser, title)
    assert offered[0].startswith(f"{title}\nall ")
    assert offered[1].startswith("Object removed\n")
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_hostile_data_is_shown_and_never_run(browser: Chrome, tmp_path: Path) -> None:
    taxonomy = hostile_database(NEW).taxonomy
    objects = [
        dataclasses.replace(
            one,
            table=one.table.assign(source=HOSTILE),
            taxonomy=taxonomy,
            licenses=(Licence(HOSTILE),),
        )
        for one in (BEFORE, AFTER)
    ]
    old, new = map(build_database, objects)
    map_ = drift_map(old, new, objects_before=objects[0], objects_after=objects[1])
    opened(browser, map_, tmp_path)  # an alert would fail the next command
    legend = browser.find_element(By.CSS_SELECTOR, ".semsig-legend")
    assert HOSTILE in browser.execute_script("return arguments[0].textContent", legend)
    asked(browser, "circles(arguments[0])[0].openPopup()", OBJECT_COLOURS["removed"])
    details = browser.execute_script("return document.querySelector('.semsig-details').textContent")
    assert details.count(HOSTILE) == 2  # class and source
    click(browser, new, int(CELLS.changed[0, 1]))
    for element in ("script", "img"):
        inside = f".semsig-legend {element}, .semsig-details {element}"
        assert browser.find_elements(By.CSS_SELECTOR, inside) == []
    assert_quiet(browser)


def test_nothing_has_changed_or_everything() -> None:
    page = drift_map(OLD, OLD).get_root().render()
    assert "Objects removed" not in page
    half = len(OLD) // 2
    drift_map(OLD.select(slice(half)), OLD.select(slice(half, None)))
    own = folium.Map([43.0, 3.0], zoom_start=12, tiles=None)
    drawn = drift_map(OLD, OLD, objects_before=BEFORE, objects_after=BEFORE, map_=own)
    assert drawn is own
    names = [getattr(child, "layer_name", "") for child in own._children.values()]
    assert {"Cells that are the same", "Tell of a cell when clicked"} <= set(names)
    assert "Cells that differ" not in names
    assert not any("Objects" in name for name in names)


@pytest.mark.parametrize(
    ("before", "after", "objects", "error", "words"),
    [
        (OLD, build_database(AFTER, spec=SignatureSpec(20.0)), None, DatabaseError, "radius=20.0"),
        (OLD, dataclasses.replace(NEW, taxonomy=OTHER), None, InputError, "'other'"),
        (OLD, NEW, TURNED, CrsError, "EPSG:32631"),
        (OLD.select(slice(0)), NEW.select(slice(0)), None, InputError, "no cells"),
        (OLD, dataclasses.replace(NEW, rows=NEW.rows + 10_000), None, InputError, "same city"),
    ],
)
def test_what_does_not_belong_together(
    before: SignatureDatabase,
    after: SignatureDatabase,
    objects: StreetObjects | None,
    error: type[Exception],
    words: str,
) -> None:
    with pytest.raises(error) as caught:
        drift_map(before, after, objects_before=BEFORE, objects_after=objects)
    assert_sentence(caught.value, words)
