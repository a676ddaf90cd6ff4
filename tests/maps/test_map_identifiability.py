"""The map of where a query can be placed, in a real browser."""

from __future__ import annotations

import dataclasses
import time
from typing import TYPE_CHECKING, Any

import folium
import numpy as np
import pytest
from cell_clicks import POPUP, click, popup
from cells_told import told_of
from map_pages import HOSTILE, asked, assert_quiet, hostile_database, opened, switch
from selenium.webdriver.common.by import By
from sentences import assert_sentence
from worlds import random_town

from semsig_gis.core.errors import InputError
from semsig_gis.likelihood.noise.model import named_noise
from semsig_gis.maps.cells import identifiability_map

if TYPE_CHECKING:
    from pathlib import Path

    from selenium.webdriver import Chrome

    from semsig_gis.evaluation.identify.result import Identifiability

CITY = random_town().database
TOLD = told_of(CITY)


def cell_id(told: Identifiability, cell: int) -> str:
    return str(int(told.database.cell_ids[cell]))


def whole_percent(chance: float) -> str:
    percent = round(chance * 100)
    if percent < 1:
        return "below 1 %"
    return "above 99 %" if percent > 99 else f"{percent} %"


@pytest.mark.usefixtures("carried")
def test_a_click_on_any_cell_tells_of_it(browser: Chrome, tmp_path: Path) -> None:
    opened(browser, identifiability_map(TOLD), tmp_path)
    assert browser.title == "Where a query can be placed"
    assert len(browser.find_elements(By.CSS_SELECTOR, "img.leaflet-image-layer")) == 1
    asked(browser, "map.setZoom(19, {animate: false})")
    for cell in np.random.default_rng(2).choice(len(CITY), 12, replace=False).tolist():
        said = click(browser, CITY, cell)
        assert said["title"] == "A query from here"
        assert said["It sees"].startswith(CITY.types(cell))
        assert said["Cell"] == cell_id(TOLD, cell)
        assert said["Found within 30 m"] == whole_percent(TOLD.found[cell])
        assert said["Chance given"].startswith(whole_percent(TOLD.itself[cell]))
        named = [name for name in said if name.startswith("Taken for")]
        assert len(named) == int((TOLD.lookalike_chances[cell] >= 0.01).sum())
    said = click(browser, CITY, int(TOLD.bits.argmin()))
    assert said["Looks like"] == "about 1 cell (0.0 bits are left)"
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_a_lookalike_is_a_jump_away(browser: Chrome, tmp_path: Path) -> None:
    opened(browser, identifiability_map(TOLD), tmp_path)
    cell = int(np.flatnonzero((TOLD.lookalike_chances > 0.1).all(axis=1))[0])
    assert click(browser, CITY, cell)["Cell"] == cell_id(TOLD, cell)
    jump = """
    const numbers = [];
    map.eachLayer((layer) => { if (layer.getTooltip && layer.getTooltip()) numbers.push(layer); });
    numbers[1].fire("click");
    """
    asked(browser, jump)
    other = int(TOLD.lookalikes[cell, 1])
    assert popup(browser)["Cell"] == cell_id(TOLD, other)
    shown = asked(browser, "return map.getBounds().contains(map._popup.getLatLng())")
    assert shown
    switch(browser, "Tell of a cell when clicked")
    time.sleep(0.5)
    assert browser.find_elements(By.CSS_SELECTOR, ".semsig-number") == []
    script = "map.fire('click', {latlng: map.getCenter()});"
    asked(browser, script)
    time.sleep(0.3)
    assert browser.execute_script(POPUP) is None
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_hostile_data_is_shown_and_never_run(browser: Chrome, tmp_path: Path) -> None:
    noise = dataclasses.replace(named_noise("medium"), name=HOSTILE)
    told = dataclasses.replace(TOLD, database=hostile_database(CITY), noise=noise)
    opened(browser, identifiability_map(told), tmp_path)  # an alert would fail the next command
    legend = browser.find_element(By.CSS_SELECTOR, ".semsig-legend")
    text = browser.execute_script("return arguments[0].textContent", legend)
    assert HOSTILE in text
    helped = np.flatnonzero((told.gains > 0.1).any(axis=1))
    click(browser, told.database, int(helped[0]))
    details = browser.execute_script("return document.querySelector('.semsig-details').textContent")
    assert HOSTILE in details
    for element in ("script", "img"):
        inside = f".semsig-legend {element}, .semsig-details {element}"
        assert browser.find_elements(By.CSS_SELECTOR, inside) == []
    assert_quiet(browser)


def test_maps_of_ones_own() -> None:
    own = folium.Map([43.0, 3.0], zoom_start=12, tiles=None)
    assert identifiability_map(TOLD, map_=own) is own
    assert identifiability_map(TOLD, map_=own) is own
    names: list[Any] = [getattr(child, "layer_name", "") for child in own._children.values()]
    assert {"Chance to be found", "Chance to be found, 2", "Tell of a cell when clicked, 2"} <= set(
        names
    )
    with pytest.raises(InputError) as caught:
        identifiability_map(TOLD, map_=own, tiles="OpenStreetMap")
    assert_sentence(caught.value, "OpenStreetMap")
