"""Maps of cells: which look the same, where a query can be placed, and what has changed."""

from __future__ import annotations

import dataclasses
import re
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
import pytest
import shapely
from folium.raster_layers import ImageOverlay
from map_pages import IMAGES, LEGEND, titles
from small_city import chances_of
from worlds import CODES, TAXONOMY, many_classes, objects_of, random_town

from semsig_gis.core import OBJECT_COLOURS, SAME_LEVELS, SAME_TYPES
from semsig_gis.database import build_database, compare_cells
from semsig_gis.objects import compare_objects
from semsig_gis.output import (
    ambiguity_map,
    drift_map,
    identifiability_map,
    layers_of,
    objects_map,
    to_latlon,
)

if TYPE_CHECKING:
    from map_pages import MapPage

    from semsig_gis.objects import StreetObjects

CITY = random_town().database
CHANCES = chances_of(CITY)


def group(cell: int, *, angles: bool = False) -> list[int]:
    """Return the cells with the same types (and angle levels), by comparing all cells."""
    looks = [
        (CITY.types(index), CITY.levels[part].tolist() if angles else None)
        for index, part in enumerate(map(slice, CITY.offsets[:-1], CITY.offsets[1:]))
    ]
    return [index for index, look in enumerate(looks) if look == looks[cell]]


LARGEST = int(CITY.type_group_sizes.argmax())
SAME_TYPES_CELLS = group(LARGEST)


def test_click_describes_a_cell_and_counts_those_that_look_the_same(page: MapPage) -> None:
    page.open(ambiguity_map(CITY))
    assert page.browser.title == "Cells that look the same"
    assert len(page.all(IMAGES)) == 1
    page.ask("map.setZoom(19, {animate: false})")
    sample = np.random.default_rng(3).choice(len(CITY), 6, replace=False).tolist()
    for cell in (LARGEST, int(CITY.lengths.argmax()), *sample):
        facts = page.click(CITY, cell)
        assert facts["title"] == "Cells that look the same"
        assert page.classes("It sees") == titles(CITY, CITY.types(cell))
        assert facts["Cell"] == str(CITY.cell_ids[cell])
        text = " ".join(page.jumps())
        for label, angles in (("Same types", False), ("Types and angle levels", True)):
            members = group(cell, angles=angles)
            if len(members) == 1:
                assert facts.get(label, "no other cell") == "no other cell"
                assert f"{label}:" not in text
            else:
                at = members.index(cell) + 1
                assert f"{label}: {at} of {len(members)}" in text
        # The wheel has the exact bearings and distances.
        part = slice(*CITY.offsets[cell : cell + 2])
        wheel = page.one(".semsig-wheels svg").get_attribute("aria-label")
        entries = re.findall(r"([^,:]+) (\d+)° (\d+) m", str(wheel))
        assert [entry[0].strip() for entry in entries] == titles(CITY, CITY.types(cell))
        off = [float(entry[1]) for entry in entries] - CITY.bearings[part]
        assert np.abs((off + 180.0) % 360.0 - 180.0).max() <= 1.5
        metres = [float(entry[2]) for entry in entries]
        assert metres == pytest.approx(CITY.distances[part], abs=1.1)


def test_buttons_step_through_the_group(page: MapPage) -> None:
    page.open(ambiguity_map(CITY))
    cells = SAME_TYPES_CELLS
    assert len(cells) > 4
    facts = page.click(CITY, cells[0])
    visited = [cells[0]]
    for _ in range(3):
        facts = page.press("next")
        visited.append(int(np.searchsorted(CITY.cell_ids, int(facts["Cell"]))))
    assert visited == cells[:4]
    assert page.ask("return document.activeElement.title").startswith("next")
    # After the first comes the last, and the other way round.
    page.click(CITY, cells[0])
    ids = CITY.cell_ids[cells].tolist()
    assert [int(page.press(where)["Cell"]) for where in ("previous", "next")] == [ids[-1], ids[0]]
    page.click(CITY, cells[-1])
    away = np.hypot(*(CITY.xy[cells] - CITY.xy[cells[-1]]).T)
    farthest = next(at for at, line in enumerate(choices(page)) if "the farthest" in line)
    same = group(cells[-1], angles="angle levels" in choices(page)[farthest])
    page.all(".semsig-go")[farthest].click()
    cell = int(np.searchsorted(CITY.cell_ids, int(page.facts()["Cell"])))
    assert cell in same
    away = np.hypot(*(CITY.xy[same] - CITY.xy[cells[-1]]).T)
    assert away[same.index(cell)] == pytest.approx(away.max())


def choices(page: MapPage) -> list[str]:
    """Return the lines of cells that the panel offers for comparison."""
    return page.texts(".semsig-choices li > button:first-child")


def test_three_lookalikes_are_listed_with_places(page: MapPage) -> None:
    page.open(ambiguity_map(CITY))
    for cell in (LARGEST, *np.flatnonzero(CITY.type_group_sizes == 1)[:3].tolist()):
        page.click(CITY, cell)
        lines = choices(page)
        assert len(lines) == 3
        # The numbers of the previous cell fade out.
        page.until(lambda: len(page.all(".semsig-number")) == 3)
        for line in lines:
            latlon = [float(number) for number in line.split("; ")[-1].split(", ")]
            away = np.hypot(*(to_latlon(CITY.xy, CITY.crs) - latlon).T)
            other = int(away.argmin())
            assert away[other] < 2e-5
            metres = np.hypot(*(CITY.xy[other] - CITY.xy[cell]))
            assert f"{metres:.0f} m to the " in line
            count = sum(
                abs(CITY.types(other).count(symbol) - CITY.types(cell).count(symbol))
                for symbol in {*CITY.types(other), *CITY.types(cell)}
            )
            assert ("more or less" in line) == (count > 0)
            assert count == 0 or f"{count} object" in line


def test_click_on_a_sign_goes_to_its_cell(page: MapPage) -> None:
    page.open(ambiguity_map(CITY))
    page.click(CITY, LARGEST)
    others = [cell for cell in SAME_TYPES_CELLS if cell != LARGEST]
    twins = len(group(LARGEST, angles=True)) - 1
    assert page.circles(SAME_TYPES) == len(others)
    assert page.circles(SAME_LEVELS) == twins
    page.ask("circles(arguments[0])[0].fire('click')", SAME_TYPES)
    other = int(np.searchsorted(CITY.cell_ids, int(page.facts()["Cell"])))
    away = np.hypot(*(CITY.xy[others] - CITY.xy[LARGEST]).T)
    assert other in np.array(others)[np.isclose(away, away.max())]  # the nearest lie on top
    types = page.one(IMAGES).get_attribute("src")
    page.switch("Same types and angle levels")
    assert [image.get_attribute("src") == types for image in page.all(IMAGES)] == [False]
    page.switch("Nothing")
    assert page.all(IMAGES) == []
    page.switch("Describe a cell when clicked")
    page.rest()
    assert page.circles(SAME_TYPES) == 0
    page.ask("map.fire('click', {latlng: map.getCenter()})")
    assert page.facts()["title"] == "A place on the map"


def test_ambiguity_map_shows_chances_of_queries(page: MapPage) -> None:
    same_cells = dataclasses.replace(CHANCES, database=dataclasses.replace(CITY))
    page.open(ambiguity_map(CITY, identifiability=same_cells))
    facts = page.click(CITY, LARGEST)
    assert {"It sees", "Found within 30 m", "Cell"} <= set(facts)
    confusions = [line for line in choices(page) if "mistaken for it" in line]
    likely = int((CHANCES.lookalike_chances[LARGEST] >= 0.01).sum())
    assert len(confusions) == likely
    assert confusions == choices(page)[:likely]
    assert any(line.startswith("Same types: ") for line in page.jumps())
    numbers = page.all(".semsig-number")
    assert len(numbers) == 3


def whole_percent(chance: float) -> str:
    percent = round(chance * 100)
    if percent < 1:
        return "under 1 %"
    return "over 99 %" if percent > 99 else f"{percent} %"


def test_identifiability_map_describes_cells_and_goes_to_lookalikes(page: MapPage) -> None:
    page.open(identifiability_map(CHANCES))
    assert page.browser.title == "Where a query can be placed"
    assert len(page.all(IMAGES)) == 1
    page.ask("map.setZoom(19, {animate: false})")
    for cell in np.random.default_rng(2).choice(len(CITY), 12, replace=False).tolist():
        facts = page.click(CITY, cell)
        assert facts["title"] == "A query from here"
        assert page.classes("It sees") == titles(CITY, CITY.types(cell))
        assert facts["Cell"] == str(CITY.cell_ids[cell])
        assert facts["Found within 30 m"] == whole_percent(CHANCES.found[cell])
        assert facts["Chance given"].startswith(whole_percent(CHANCES.itself[cell]))
        confusions = [line for line in choices(page) if "mistaken for it" in line]
        assert len(confusions) == int((CHANCES.lookalike_chances[cell] >= 0.01).sum())
    facts = page.click(CITY, int(CHANCES.bits.argmin()))
    assert facts["Looks like"] == "about 1 cell (0.0 bits are left)"
    # A click on a lookalike goes to its cell.
    cell = int(np.flatnonzero((CHANCES.lookalike_chances > 0.1).all(axis=1))[0])
    page.click(CITY, cell)
    page.ask("shown((layer) => layer.getTooltip && layer.getTooltip())[1].fire('click')")
    other = int(CHANCES.lookalikes[cell, 1])
    assert page.facts()["Cell"] == str(CITY.cell_ids[other])
    assert page.ask("return map.getBounds().contains(panelPlace())")
    page.switch("Describe a cell when clicked")
    page.until_gone(".semsig-number")


BEFORE = random_town().street_objects


def later() -> StreetObjects:
    """Return the town with three objects removed, and one added, moved and reclassified."""
    table = BEFORE.table[3:].reset_index(drop=True)
    places = shapely.get_coordinates(table.geometry)
    places[0] += (4.0, 3.0)
    table.loc[1, "class_code"] = next(code for code in CODES if code != table["class_code"][1])
    new = table[2:3].assign(source_id="new")
    places = np.concatenate([places, places.min(axis=0, keepdims=True) - 15.0])
    table = type(table)(
        [*table.to_dict("records"), *new.to_dict("records")], crs=BEFORE.crs
    ).astype(BEFORE.table.drop(columns="geometry").dtypes.to_dict())
    return dataclasses.replace(BEFORE, table=table.set_geometry(shapely.points(places)))


AFTER = later()
OLD, NEW = build_database(BEFORE), build_database(AFTER)
CELLS = compare_cells(OLD, NEW)


def test_drift_map_compares_cells(page: MapPage) -> None:
    page.open(drift_map(OLD, NEW))
    assert page.browser.title == "What has changed"
    assert len(page.all(IMAGES)) == 2
    page.ask("map.setZoom(19, {animate: false})")
    assert min(map(len, (CELLS.same, CELLS.changed, CELLS.appeared, CELLS.vanished))) > 0
    (_, same), (before, now) = CELLS.same[0].tolist(), CELLS.changed[0].tolist()
    appeared, vanished = int(CELLS.appeared[0]), int(CELLS.vanished[0])
    facts = page.click(NEW, same)
    assert facts["title"] == "A cell that sees what it saw"
    assert page.classes("It sees") == titles(NEW, NEW.types(same))
    assert "Before" not in facts
    for city, cell, title, first, then in (
        (OLD, before, "A cell that sees something else", OLD.types(before), NEW.types(now)),
        (NEW, appeared, "A new cell: it saw nothing", "", NEW.types(appeared)),
        (OLD, vanished, "A cell that no longer sees anything", OLD.types(vanished), ""),
    ):
        facts = page.click(city, cell)
        assert (facts["title"], facts["Cell"]) == (title, str(city.cell_ids[cell]))
        assert page.classes("Before") == (titles(OLD, first) or ["nothing"])
        assert page.classes("Now") == (titles(OLD, then) or ["nothing"])
    parts = facts["Difference"].split(", ")
    difference = {tuple(part[1:].split("\u00a0", 1)) for part in parts}
    losses = Counter(title.lower() for title in titles(OLD, OLD.types(vanished)))
    assert difference == {(str(count), title) for title, count in losses.items()}
    legend = page.one(LEGEND).text
    for rows, title in (
        (CELLS.same, "see what they saw"),
        (CELLS.changed, "see something else"),
        (CELLS.appeared, "saw nothing before"),
        (CELLS.vanished, "see nothing now"),
    ):
        assert f"{title} {len(rows):,}" in legend
    assert "Street objects" not in legend


def test_drift_map_shows_changed_objects(page: MapPage) -> None:
    page.open(drift_map(OLD, NEW, objects_before=BEFORE, objects_after=AFTER))
    assert "3 removed" in page.one(LEGEND).text
    # The search finds objects by kind of change, class and identifier, the best match first.
    (row,) = compare_objects(BEFORE, AFTER).moved[:, 1]
    title = TAXONOMY.by_code(int(AFTER.codes[row])).title
    called = f"Object moved\n{title}, {AFTER.table['source_id'].iloc[row]}"
    assert page.search("moved")[0] == called
    assert called in page.search(title.upper())
    assert page.search("new")[0].startswith("Object added\n")
    page.ask("semsig.hide(map)")
    for kind, count in {"removed": 3, "added": 1, "moved": 1, "of another class": 1}.items():
        colour = OBJECT_COLOURS[kind]
        assert page.circles(colour) == count
        facts = page.panel_of(colour)
        assert facts.startswith(f"Object {kind}")
        assert ("5.0 m" in facts) == (kind == "moved")
        assert ("Class before" in facts) == (kind in {"moved", "of another class"})
        former = TAXONOMY.by_code(int(BEFORE.codes[4])).title
        assert kind != "of another class" or former in facts
        page.switch(f"Objects {kind}")
        assert page.circles(colour) == 0


def test_search_lists_a_class_before_its_objects(page: MapPage) -> None:
    map_ = drift_map(OLD, NEW, objects_before=BEFORE, objects_after=AFTER)
    page.open(objects_map(AFTER, map_=map_))
    title = TAXONOMY.by_code(int(BEFORE.codes[0])).title
    offered = page.search(title)
    assert offered[0].startswith(f"{title}\nall ")
    assert offered[1].startswith("Object removed\n")


def test_drift_map_of_no_and_of_all_changes() -> None:
    half = len(OLD) // 2
    same = drift_map(OLD, OLD, objects_before=BEFORE, objects_after=BEFORE)
    other = drift_map(OLD.select(slice(half)), OLD.select(slice(half, None)))
    for map_ in (same, other):
        images = [image for image in layers_of(map_).values() if isinstance(image, ImageOverlay)]
        assert len(images) == 1
        names = [getattr(child, "layer_name", "") for child in layers_of(map_).values()]
        assert not any(name.startswith("Objects") for name in names)


WHEEL = """
const [symbols, bearings, metres, extents] = arguments;
const classes = Object.fromEntries([...symbols].map((symbol) => [symbol, {
  title: symbol, colour: "#888888", ink: "#ffffff", drop: 0, outline: semsig.disc,
  pictogram: semsig.disc}]));
const figure = semsig.wheel("Here", [symbols, bearings, {metres, extents, reach: 100}], {classes});
const at = (sign) => /translate\\(([^,]+),([^)]+)\\) scale\\(([^)]+)/.exec(
  sign.getAttribute("transform")).slice(1).map(Number);
return [
  [...figure.querySelectorAll(".object > g")].map(at),
  [...figure.querySelectorAll(".extent")].length,
  [...figure.querySelectorAll(".object > text")].map(({textContent}) => textContent)];
"""


def test_many_objects_of_a_wheel_do_not_hide_each_other(ambiguity_page: MapPage) -> None:
    count = 40
    rng = np.random.default_rng(2)
    bearings = np.sort(rng.integers(0, 360, count))
    metres = rng.integers(2, 100, count)
    metres[[3, 20]] = 150, 1_240
    extents = np.where(np.arange(count) == 7, 60, 0)
    symbols = "".join(map(chr, range(0x410, 0x410 + count)))
    places, arcs, lengths = ambiguity_page.ask(
        WHEEL, symbols, bearings.tolist(), metres.tolist(), extents.tolist()
    )
    xy, size = np.array(places)[:, :2], places[0][2]
    turned = np.degrees(np.arctan2(xy[:, 0], -xy[:, 1])) % 360.0
    assert np.abs((turned - bearings + 180.0) % 360.0 - 180.0).max() < 0.1
    away = np.hypot(*(xy[:, None] - xy[None]).T) + np.where(np.eye(count), 999.0, 0.0)
    assert np.mean(away.min(axis=0) >= 1.6 * size) > 0.8
    out = np.hypot(*xy.T)
    assert out[[3, 20]].min() > 54.0 > np.delete(out, [3, 20]).max()
    assert (arcs, lengths) == (1, ["150 m", "1.2 km"])


def test_symbols_beyond_ascii_are_read_from_their_codes(page: MapPage) -> None:
    kinds = many_classes(1)
    things = [
        (*xy, item.code, "world", item.name)
        for xy, item in zip(random_town().street_objects.xy.tolist(), kinds.classes, strict=False)
    ]
    licences = random_town().street_objects.licenses
    city = build_database(objects_of(*things, licenses=licences, taxonomy=kinds))
    page.open(ambiguity_map(city))
    cell = int(city.lengths.argmax())
    page.click(city, cell)
    assert page.classes("It sees") == titles(city, city.types(cell))
    assert not city.types(cell).isascii()
