"""The map of a location in a real browser."""

from __future__ import annotations

import dataclasses
import math
import time
from typing import TYPE_CHECKING

import folium
import numpy as np
import pytest
from map_pages import HOSTILE, asked, assert_quiet, hostile_database, opened, switch
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from sentences import assert_sentence
from worlds import random_town

from semsig_gis.core.colours import FAILED, SUCCESSFUL, VERDICTS
from semsig_gis.core.errors import InputError
from semsig_gis.core.signature import Signature
from semsig_gis.database.store import ObjectStore
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.locate import locate
from semsig_gis.likelihood.noise.model import cell_noise, named_noise
from semsig_gis.maps.location import location_map

if TYPE_CHECKING:
    from pathlib import Path

    from selenium.webdriver import Chrome

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.likelihood.locate import Location

WORLD = random_town()
CITY = WORLD.database
STORE = ObjectStore.of(WORLD.street_objects)
LONGEST = int(CITY.lengths.argmax())


def found(
    database: SignatureDatabase = CITY,
    *,
    spoilt: bool = True,
    store: ObjectStore | None = STORE,
    north_sigma: float = math.inf,
) -> Location:
    """Return where the richest cell was seen, with an error of each kind."""
    query = database.signature(LONGEST)
    assert query.codes is not None
    assert query.bearings is not None
    if spoilt:
        seen = query.codes.copy()
        seen[1] = next(code for code in database.present_codes if code != seen[1])
        gap = (query.bearings[-1] + 360.0 + query.bearings[0]) / 2.0 % 360.0
        codes = np.append(np.delete(seen, 3), seen[0])
        bearings = np.append(np.delete(query.bearings, 3), gap)
        query = Signature(codes, bearings)
    index = build_index(database, cell_noise(named_noise("medium"), 10.0))
    options = {"store": store, "refined": store is not None, "north_sigma": north_sigma}
    return locate(index, query, explained=2, top=5, **options)  # type: ignore[arg-type]


@pytest.mark.usefixtures("carried")
def test_a_location_in_a_browser(browser: Chrome, tmp_path: Path) -> None:
    location = found()
    assert location.answer.given
    opened(browser, location_map(location), tmp_path)
    assert browser.title == "Where it was seen"
    images = browser.find_elements(By.CSS_SELECTOR, "img.leaflet-image-layer")
    assert len(images) == 2
    numbers = browser.find_elements(By.CSS_SELECTOR, ".semsig-number")
    texts = [browser.execute_script("return arguments[0].textContent", one) for one in numbers]
    assert sorted(texts) == ["1", "2", "3", "4", "5"]
    legend = browser.find_element(By.CSS_SELECTOR, ".semsig-legend").text
    assert "The answer: within 50 m" in legend
    assert "90% in" in legend
    assert "matched: a street object" in legend
    assert asked(browser, "return circles(arguments[0]).length", SUCCESSFUL) == 1
    counts = location.explanations[0].counts
    assert min(counts["matched"], counts["false"]) > 0
    for verdict in ("matched", "misnamed", "false"):
        many = asked(browser, "return circles(arguments[0]).length", VERDICTS[verdict])
        assert many == counts[verdict]
    ellipse = """
    const rings = [];
    map.eachLayer((one) => {
      if (one.options.color === arguments[0] && one.getLatLngs) rings.push(one.getLatLngs()[0]);
    });
    return [rings.length, map.distance(rings[0][0], rings[0][36]), rings[0].length];
    """
    rings, across, corners = asked(browser, ellipse, SUCCESSFUL)
    assert (rings, corners) == (1, 73)
    assert across == pytest.approx(2.0 * location.estimate.ellipse()[0], abs=0.4)
    switch(browser, "Objects from rank 1")
    assert asked(browser, "return circles(arguments[0]).length", VERDICTS["matched"]) == 0
    switch(browser, "Objects from rank 2")
    other = location.explanations[1].counts["matched"]
    assert asked(browser, "return circles(arguments[0]).length", VERDICTS["matched"]) == other
    switch(browser, "Chance of a cell")
    assert len(browser.find_elements(By.CSS_SELECTOR, "img.leaflet-image-layer")) == 1
    switch(browser, "Regions of 50, 90 and 99 %")
    assert len(browser.find_elements(By.CSS_SELECTOR, "img.leaflet-image-layer")) == 2
    switch(browser, "Candidates")
    time.sleep(0.5)  # numbers fade away
    assert browser.find_elements(By.CSS_SELECTOR, ".semsig-number") == []
    switch(browser, "Best place")
    assert asked(browser, "return circles(arguments[0]).length", SUCCESSFUL) == 0
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_clicks_tell_of_places_and_objects(browser: Chrome, tmp_path: Path) -> None:
    location = found()
    opened(browser, location_map(location), tmp_path)
    at = """
    const spot = map.latLngToContainerPoint(circles(arguments[0])[0].getLatLng());
    return [spot.x, spot.y];
    """
    size = browser.find_element(By.TAG_NAME, "body").size
    x, y = asked(browser, at, SUCCESSFUL)
    body = browser.find_element(By.TAG_NAME, "body")
    where = round(x - size["width"] / 2), round(y - size["height"] / 2)
    ActionChains(browser).move_to_element_with_offset(body, *where).click().perform()
    # The one before fades away, and a new one does not show at once.
    last = "return [...document.querySelectorAll('.semsig-details')].pop().innerText"
    popup = browser.execute_script(last)
    assert popup.startswith("The answer")
    assert f"{location.answer.mass:.1%} within 50 m" in popup
    assert f"± {location.estimate.heading_sigma:.1f}°" in popup
    asked(browser, "circles(arguments[0])[0].openPopup()", VERDICTS["matched"])
    popup = browser.execute_script(last)
    rows = location.explanations[0].to_dict()["rows"]
    matched = next(row for row in rows if row["verdict"] == "matched")
    title = CITY.taxonomy.by_name(matched["object_class"]).title
    for said in ("Matched", title, matched["source_id"], f"{matched['distance']:.1f} m"):
        assert said in popup
    asked(browser, "circles('#ffffff').find((one) => one.getTooltip()).openPopup()")
    popup = browser.execute_script(last)
    assert popup.startswith("Rank 5 of")
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_what_cannot_be_told_is_shown_from_afar(browser: Chrome, tmp_path: Path) -> None:
    query = Signature(CITY.signature(LONGEST).codes[:1], None)  # type: ignore[index]
    index = build_index(CITY, named_noise("strong"))
    location = locate(index, query, top=7)
    assert not location.answer.given
    opened(browser, location_map(location), tmp_path)
    legend = browser.find_element(By.CSS_SELECTOR, ".semsig-legend").text
    assert "Cannot tell; the best place" in legend
    assert "matched" not in legend
    assert asked(browser, "return circles(arguments[0]).length", FAILED) == 1
    boxes = browser.find_elements(By.CSS_SELECTOR, ".leaflet-control-layers-overlays label")
    on = [one.text for one in boxes if one.find_element(By.TAG_NAME, "input").is_selected()]
    assert [name.strip() for name in on if "Chance" in name] == ["Chance within 50 m"]
    inside = "return circles('#ffffff').every((one) => map.getBounds().contains(one.getLatLng()))"
    assert asked(browser, inside)
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_hostile_data_is_shown_and_never_run(browser: Chrome, tmp_path: Path) -> None:
    harmful = hostile_database(CITY)
    table = STORE.objects.table.assign(source=HOSTILE, source_id=HOSTILE)
    objects = dataclasses.replace(STORE.objects, table=table, taxonomy=harmful.taxonomy)
    location = found(harmful, store=ObjectStore.of(objects))
    location = dataclasses.replace(location, noise=HOSTILE)
    opened(browser, location_map(location), tmp_path)  # an alert would fail the next command
    legend = browser.find_element(By.CSS_SELECTOR, ".semsig-legend")
    text = browser.execute_script("return arguments[0].textContent", legend)
    assert text.count(HOSTILE) == 3  # the noise, and a licence of two parts
    asked(browser, "circles(arguments[0])[0].openPopup()", VERDICTS["matched"])
    popup = browser.execute_script("return document.querySelector('.semsig-details').textContent")
    assert popup.count(HOSTILE) == 4  # both classes, source and identifier
    for element in ("script", "img"):
        inside = f".semsig-legend {element}, .semsig-details {element}"
        assert browser.find_elements(By.CSS_SELECTOR, inside) == []
    assert_quiet(browser)


def test_maps_of_ones_own_and_without_a_store() -> None:
    location = found(store=None, north_sigma=0.0)
    own = folium.Map([43.0, 3.0], zoom_start=12, tiles=None)
    assert location_map(location, map_=own) is own
    assert location_map(location, map_=own) is own
    names = [getattr(child, "layer_name", "") for child in own._children.values()]
    assert names.count("Objects seen from a cell") == 1
    assert {"Best place", "Best place, 2", "Chance of a cell, 2", "Candidates (5), 2"} <= set(names)
    assert "NaN" not in own.get_root().render().partition("</head>")[2]
    with pytest.raises(InputError) as caught:
        location_map(location, map_=own, tiles="OpenStreetMap")
    assert_sentence(caught.value, "OpenStreetMap")
