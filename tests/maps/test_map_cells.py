"""The maps of cells: which look the same, where a query can be placed, and what has changed."""

from __future__ import annotations

import dataclasses
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
import shapely
from folium.raster_layers import ImageOverlay
from machine import PATIENCE_S
from map_pages import IMAGES, LEGEND
from selenium.webdriver.support.wait import WebDriverWait
from small_city import chances_of
from worlds import CODES, TAXONOMY, random_town

from semsig_gis.core import OBJECT_COLOURS, SAME_LEVELS, SAME_TYPES
from semsig_gis.database import build_database, compare_cells
from semsig_gis.maps import (
    ambiguity_map,
    drift_map,
    identifiability_map,
    layers_of,
    objects_map,
    to_latlon,
)
from semsig_gis.objects import compare_objects

if TYPE_CHECKING:
    from map_pages import MapPage

    from semsig_gis.objects import StreetObjects

CITY = random_town().database
TOLD = chances_of(CITY)


def group(cell: int, *, angles: bool = False) -> list[int]:
    """Return the cells with the same types, and angle levels, by comparing one after the other."""
    seen = [
        (CITY.types(one), CITY.levels[part].tolist() if angles else None)
        for one, part in enumerate(map(slice, CITY.offsets[:-1], CITY.offsets[1:]))
    ]
    return [one for one, look in enumerate(seen) if look == seen[cell]]


LARGEST = int(CITY.type_group_sizes.argmax())
ALIKE = group(LARGEST)


def test_a_click_tells_of_the_cells_that_look_the_same(page: MapPage) -> None:
    page.open(ambiguity_map(CITY))
    assert page.browser.title == "Cells that look the same"
    assert len(page.all(IMAGES)) == 1
    page.ask("map.setZoom(19, {animate: false})")
    chosen = np.random.default_rng(3).choice(len(CITY), 6, replace=False).tolist()
    for cell in (LARGEST, *chosen):
        said = page.click(CITY, cell)
        assert said["title"] == "Cells that look the same"
        assert said["It sees"].startswith(CITY.types(cell))
        assert said["Cell"] == str(CITY.cell_ids[cell])
        text = " ".join(page.jumps())
        for label, angles in (("Same types", False), ("Types and angle levels", True)):
            alike = group(cell, angles=angles)
            if len(alike) == 1:
                assert said.get(label, "no other cell") == "no other cell"
                assert f"{label}:" not in text
            else:
                at = alike.index(cell) + 1
                assert f"{label}: {at} of {len(alike)}" in text


def test_buttons_go_through_the_group_and_to_its_ends(page: MapPage) -> None:
    page.open(ambiguity_map(CITY))
    alike = ALIKE
    assert len(alike) > 4
    said = page.click(CITY, alike[0])
    seen = [alike[0]]
    for _ in range(3):
        said = page.press("next")
        seen.append(int(np.searchsorted(CITY.cell_ids, int(said["Cell"]))))
    assert seen == alike[:4]
    assert page.ask("return document.activeElement.title").startswith("next")
    # After the first comes the last, and the other way round.
    page.click(CITY, alike[0])
    ids = CITY.cell_ids[alike].tolist()
    assert [int(page.press(where)["Cell"]) for where in ("previous", "next")] == [ids[-1], ids[0]]
    page.click(CITY, alike[-1])
    away = np.hypot(*(CITY.xy[alike] - CITY.xy[alike[-1]]).T)
    farthest = next(at for at, line in enumerate(choices(page)) if "the farthest" in line)
    same = group(alike[-1], angles="angle levels" in choices(page)[farthest])
    page.all(".semsig-go")[farthest].click()
    cell = int(np.searchsorted(CITY.cell_ids, int(page.told()["Cell"])))
    assert cell in same
    away = np.hypot(*(CITY.xy[same] - CITY.xy[alike[-1]]).T)
    assert away[same.index(cell)] == pytest.approx(away.max())


def choices(page: MapPage) -> list[str]:
    """Return the cells that the panel offers to compare with."""
    return page.texts(".semsig-choices li > button:first-child")


def test_three_lookalikes_are_told_of_with_their_places(page: MapPage) -> None:
    page.open(ambiguity_map(CITY))
    for cell in (LARGEST, *np.flatnonzero(CITY.type_group_sizes == 1)[:3].tolist()):
        page.click(CITY, cell)
        told = choices(page)
        assert len(told) == 3
        wait = WebDriverWait(page.browser, PATIENCE_S)  # the numbers of the cell before fade away
        wait.until(lambda _: len(page.all(".semsig-number")) == 3)
        for line in told:
            latlon = [float(one) for one in line.split("; ")[-1].split(", ")]
            away = np.hypot(*(to_latlon(CITY.xy, CITY.crs) - latlon).T)
            other = int(away.argmin())
            assert away[other] < 2e-5
            metres = np.hypot(*(CITY.xy[other] - CITY.xy[cell]))
            assert f"{metres:.0f} m to the " in line
            count = sum(
                abs(CITY.types(other).count(one) - CITY.types(cell).count(one))
                for one in {*CITY.types(other), *CITY.types(cell)}
            )
            assert ("more or less" in line) == (count > 0)
            assert count == 0 or f"{count} object" in line


@pytest.mark.parametrize("cell", [LARGEST, int(CITY.lengths.argmax())])
def test_the_script_finds_what_a_cell_sees_and_where(page: MapPage, cell: int) -> None:
    page.open(ambiguity_map(CITY))
    page.click(CITY, cell)
    part = slice(*CITY.offsets[cell : cell + 2])
    wheel = page.one(".semsig-wheels svg").get_attribute("aria-label")
    seen = re.findall(r"(\w) (\d+)° (\d+) m", str(wheel))
    assert [one[0] for one in seen] == list(CITY.types(cell))
    off = [float(one[1]) for one in seen] - CITY.bearings[part]
    assert np.abs((off + 180.0) % 360.0 - 180.0).max() <= 1.5
    assert [float(one[2]) for one in seen] == pytest.approx(CITY.distances[part], abs=1.1)


def test_a_sign_is_a_jump_away_and_layers_are_switched(page: MapPage) -> None:
    page.open(ambiguity_map(CITY))
    page.click(CITY, LARGEST)
    others = [cell for cell in ALIKE if cell != LARGEST]
    twins = len(group(LARGEST, angles=True)) - 1
    assert page.circles(SAME_TYPES) == len(others)
    assert page.circles(SAME_LEVELS) == twins
    page.ask("circles(arguments[0])[0].fire('click')", SAME_TYPES)
    other = int(np.searchsorted(CITY.cell_ids, int(page.told()["Cell"])))
    away = np.hypot(*(CITY.xy[others] - CITY.xy[LARGEST]).T)
    assert other in np.array(others)[np.isclose(away, away.max())]  # the nearest lie on top
    types = page.one(IMAGES).get_attribute("src")
    page.switch("Same types and angle levels")
    assert [one.get_attribute("src") == types for one in page.all(IMAGES)] == [False]
    page.switch("Nothing")
    assert page.all(IMAGES) == []
    page.switch("Describe a cell when clicked")
    page.rest()
    assert page.circles(SAME_TYPES) == 0
    page.ask("map.fire('click', {latlng: map.getCenter()})")
    assert page.told()["title"] == "A place on the map"


def test_what_is_known_of_queries_is_told_too(page: MapPage) -> None:
    same_cells = dataclasses.replace(TOLD, database=dataclasses.replace(CITY))
    page.open(ambiguity_map(CITY, identifiability=same_cells))
    said = page.click(CITY, LARGEST)
    assert {"It sees", "Found within 30 m", "Cell"} <= set(said)
    taken = [line for line in choices(page) if "taken for it" in line]
    likely = int((TOLD.lookalike_chances[LARGEST] >= 0.01).sum())
    assert len(taken) == likely
    assert taken == choices(page)[:likely]
    assert any(line.startswith("Same types: ") for line in page.jumps())
    numbers = page.all(".semsig-number")
    assert len(numbers) == 3


def whole_percent(chance: float) -> str:
    percent = round(chance * 100)
    if percent < 1:
        return "below 1 %"
    return "above 99 %" if percent > 99 else f"{percent} %"


def test_a_click_on_any_cell_tells_of_it(page: MapPage) -> None:
    page.open(identifiability_map(TOLD))
    assert page.browser.title == "Where a query can be placed"
    assert len(page.all(IMAGES)) == 1
    page.ask("map.setZoom(19, {animate: false})")
    for cell in np.random.default_rng(2).choice(len(CITY), 12, replace=False).tolist():
        said = page.click(CITY, cell)
        assert said["title"] == "A query from here"
        assert said["It sees"].startswith(CITY.types(cell))
        assert said["Cell"] == str(CITY.cell_ids[cell])
        assert said["Found within 30 m"] == whole_percent(TOLD.found[cell])
        assert said["Chance given"].startswith(whole_percent(TOLD.itself[cell]))
        named = [line for line in choices(page) if "taken for it" in line]
        assert len(named) == int((TOLD.lookalike_chances[cell] >= 0.01).sum())
    said = page.click(CITY, int(TOLD.bits.argmin()))
    assert said["Looks like"] == "about 1 cell (0.0 bits are left)"


def test_a_lookalike_is_a_jump_away(page: MapPage) -> None:
    page.open(identifiability_map(TOLD))
    cell = int(np.flatnonzero((TOLD.lookalike_chances > 0.1).all(axis=1))[0])
    assert page.click(CITY, cell)["Cell"] == str(CITY.cell_ids[cell])
    page.ask("shown((one) => one.getTooltip && one.getTooltip())[1].fire('click')")
    other = int(TOLD.lookalikes[cell, 1])
    assert page.told()["Cell"] == str(CITY.cell_ids[other])
    assert page.ask("return map.getBounds().contains(toldPlace())")
    page.switch("Describe a cell when clicked")
    page.until_gone(".semsig-number")


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
        (OLD, gone, "A cell that no longer sees anything", OLD.types(gone), "nothing"),
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
    page.ask("semsig.hide(map)")
    for kind, count in {"removed": 3, "added": 1, "moved": 1, "of another class": 1}.items():
        colour = OBJECT_COLOURS[kind]
        assert page.circles(colour) == count
        said = page.panel_of(colour)
        assert said.startswith(f"Object {kind}")
        assert ("5.0 m" in said) == (kind == "moved")
        assert ("Class before" in said) == (kind in {"moved", "of another class"})
        former = TAXONOMY.by_code(int(BEFORE.codes[4])).title
        assert kind != "of another class" or former in said
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
    for map_ in (same, other):
        images = [one for one in layers_of(map_).values() if isinstance(one, ImageOverlay)]
        assert len(images) == 1
        names = [getattr(child, "layer_name", "") for child in layers_of(map_).values()]
        assert not any(name.startswith("Objects") for name in names)
