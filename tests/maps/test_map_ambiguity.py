"""The map of cells that look the same, in a real browser."""

from __future__ import annotations

import dataclasses
import time
from typing import TYPE_CHECKING

import folium
import numpy as np
import pytest
from cell_clicks import POPUP, click, jumps, popup, press
from cells_told import told_of
from map_pages import HOSTILE, asked, assert_quiet, hostile_database, opened, switch
from selenium.webdriver.common.by import By
from sentences import assert_sentence
from worlds import random_town

from semsig_gis.core.errors import InputError
from semsig_gis.maps.cells import ambiguity_map

if TYPE_CHECKING:
    from pathlib import Path

    from selenium.webdriver import Chrome

CITY = random_town().database
IMAGES = "img.leaflet-image-layer"


def group(cell: int, *, angles: bool = False) -> list[int]:
    """Return the cells with the same types, and angle levels, by comparing one after the other."""

    def look(one: int) -> tuple[str, list[int] | None]:
        part = slice(CITY.offsets[one], CITY.offsets[one + 1])
        return CITY.types(one), CITY.levels[part].tolist() if angles else None

    return [one for one in range(len(CITY)) if look(one) == look(cell)]


GROUPS = {cell: group(cell) for cell in range(len(CITY))}
LARGEST = max(GROUPS, key=lambda cell: len(GROUPS[cell]))


@pytest.mark.usefixtures("carried")
def test_a_click_tells_of_the_cells_that_look_the_same(browser: Chrome, tmp_path: Path) -> None:
    opened(browser, ambiguity_map(CITY), tmp_path)
    assert browser.title == "Cells that look the same"
    assert len(browser.find_elements(By.CSS_SELECTOR, IMAGES)) == 1
    asked(browser, "map.setZoom(19, {animate: false})")
    chosen = np.random.default_rng(3).choice(len(CITY), 6, replace=False).tolist()
    for cell in (LARGEST, *chosen):
        said = click(browser, CITY, cell)
        assert said["title"] == "Cells that look the same"
        assert said["It sees"].startswith(CITY.types(cell))
        assert said["Cell"] == str(CITY.cell_ids[cell])
        text = " ".join(jumps(browser))
        for label, angles in (("Same types", False), ("Types and angle levels", True)):
            alike = group(cell, angles=angles)
            if len(alike) == 1:
                assert said.get(label, "no other cell") == "no other cell"
                assert f"{label}:" not in text
            else:
                at = alike.index(cell) + 1
                assert f"{label}: {at} of {len(alike)}" in text
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_buttons_go_through_the_group_and_to_its_ends(browser: Chrome, tmp_path: Path) -> None:
    opened(browser, ambiguity_map(CITY), tmp_path)
    alike = GROUPS[LARGEST]
    assert len(alike) > 4
    said = click(browser, CITY, alike[0])
    bearings = CITY.levels[CITY.offsets[alike[0]] : CITY.offsets[alike[0] + 1]]
    for level in bearings.tolist():
        assert f"{int((level + 0.5) * 22.5)}°" in said["text"]
    where = asked(browser, "return map.latLngToContainerPoint(map._popup.getLatLng())")
    seen = [alike[0]]
    for _ in range(3):
        said = press(browser, "next")
        seen.append(int(np.searchsorted(CITY.cell_ids, int(said["Cell"]))))
    assert seen == alike[:4]
    # The button stays under the pointer.
    after = asked(browser, "return map.latLngToContainerPoint(map._popup.getLatLng())")
    assert abs(after["x"] - where["x"]) <= 2
    assert browser.execute_script("return document.activeElement.title").startswith("next")
    # After the first comes the last, and the other way round.
    click(browser, CITY, alike[0])
    assert press(browser, "previous")["Cell"] == str(CITY.cell_ids[alike[-1]])
    assert press(browser, "next")["Cell"] == str(CITY.cell_ids[alike[0]])
    click(browser, CITY, alike[-1])
    away = np.hypot(*(CITY.xy[alike] - CITY.xy[alike[-1]]).T)
    nearest = press(browser, f"{np.sort(away)[1]:.0f} m")["Cell"]
    cell = alike[[str(one) for one in CITY.cell_ids[alike]].index(nearest)]
    assert np.hypot(*(CITY.xy[cell] - CITY.xy[alike[-1]])) == pytest.approx(np.sort(away)[1])
    away = np.hypot(*(CITY.xy[alike] - CITY.xy[cell]).T)
    farthest = press(browser, "farthest")["Cell"]
    ids = [str(one) for one in CITY.cell_ids[alike]]
    assert away[ids.index(farthest)] == pytest.approx(away.max())
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_a_sign_is_a_jump_away_and_layers_are_switched(browser: Chrome, tmp_path: Path) -> None:
    opened(browser, ambiguity_map(CITY), tmp_path)
    click(browser, CITY, LARGEST)
    others = [cell for cell in GROUPS[LARGEST] if cell != LARGEST]
    twins = len(group(LARGEST, angles=True)) - 1
    assert asked(browser, "return circles('#ffffff').length") == len(others)
    assert asked(browser, "return circles('#e69f00').length") == twins
    asked(browser, "circles('#ffffff')[0].fire('click')")
    other = int(np.searchsorted(CITY.cell_ids, int(popup(browser)["Cell"])))
    away = np.hypot(*(CITY.xy[others] - CITY.xy[LARGEST]).T)
    assert other in np.array(others)[np.isclose(away, away.max())]  # the nearest lie on top
    switch(browser, "Same types and angle levels")
    assert len(browser.find_elements(By.CSS_SELECTOR, IMAGES)) == 2
    switch(browser, "Same types")
    assert len(browser.find_elements(By.CSS_SELECTOR, IMAGES)) == 1
    switch(browser, "Tell of a cell when clicked")
    time.sleep(0.5)
    assert asked(browser, "return circles('#ffffff').length") == 0
    asked(browser, "map.fire('click', {latlng: map.getCenter()});")
    time.sleep(0.3)
    assert browser.execute_script(POPUP) is None
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_what_is_known_of_queries_is_told_too(browser: Chrome, tmp_path: Path) -> None:
    told = told_of(CITY)
    opened(browser, ambiguity_map(CITY, identifiability=told), tmp_path)
    said = click(browser, CITY, LARGEST)
    assert {"It sees", "Found within 30 m", "Taken for 1", "Cell"} <= set(said)
    assert any(line.startswith("Same types: ") for line in jumps(browser))
    numbers = browser.find_elements(By.CSS_SELECTOR, ".semsig-number")
    assert len(numbers) == int((told.lookalike_chances[LARGEST] >= 0.01).sum())
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_hostile_data_is_shown_and_never_run(browser: Chrome, tmp_path: Path) -> None:
    harmful = hostile_database(CITY)
    opened(browser, ambiguity_map(harmful), tmp_path)  # an alert would fail the next command
    legend = browser.find_element(By.CSS_SELECTOR, ".semsig-legend")
    assert HOSTILE in browser.execute_script("return arguments[0].textContent", legend)
    click(browser, harmful, LARGEST)
    details = browser.execute_script("return document.querySelector('.semsig-details').textContent")
    assert HOSTILE in details
    for element in ("script", "img"):
        inside = f".semsig-legend {element}, .semsig-details {element}"
        assert browser.find_elements(By.CSS_SELECTOR, inside) == []
    assert_quiet(browser)


def test_maps_of_ones_own_and_what_does_not_fit() -> None:
    own = folium.Map([43.0, 3.0], zoom_start=12, tiles=None)
    assert ambiguity_map(CITY, map_=own) is own
    names = [getattr(child, "layer_name", "") for child in own._children.values()]
    assert {"Same types", "Same types and angle levels", "Tell of a cell when clicked"} <= set(
        names
    )
    with pytest.raises(InputError) as caught:
        ambiguity_map(CITY.select(slice(0)))
    assert_sentence(caught.value, "no cells")
    ambiguity_map(CITY, identifiability=told_of(dataclasses.replace(CITY)))  # the same cells
    other = told_of(CITY.select(slice(1, None)))
    with pytest.raises(InputError) as caught:
        ambiguity_map(CITY, identifiability=other)
    assert_sentence(caught.value, "other cells")
