"""Maps in a real browser: they work without a network, and data cannot harm them."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import folium
import geopandas as gpd
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from map_pages import (
    ASK,
    HOSTILE,
    asked,
    assert_quiet,
    drawn,
    hostile_database,
    opened,
    popup_text,
    searched,
    switch,
)
from pyproj import CRS, Transformer
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait
from sentences import assert_sentence

from semsig_gis.core.colours import CANDIDATE_RAMP, ERROR_RAMP, FAILED, SUCCESSFUL
from semsig_gis.core.errors import InputError
from semsig_gis.core.signature import Signature
from semsig_gis.database.build import build_database
from semsig_gis.evaluation.evaluate import evaluate
from semsig_gis.maps import page as map_assets
from semsig_gis.maps import parts as _map_parts
from semsig_gis.maps.evaluation import evaluation_map
from semsig_gis.maps.localization import localization_map
from semsig_gis.maps.page import save_map
from semsig_gis.matching.search import localize
from semsig_gis.objects.clean import build_objects
from semsig_gis.objects.table import StreetObjects
from semsig_gis.queries.distortions import MissingClasses
from semsig_gis.queries.draw import QuerySpec
from semsig_gis.sources.catalog import paper_taxonomy
from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city

if TYPE_CHECKING:
    from pathlib import Path

    from selenium.webdriver import Chrome

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.evaluation.result import Evaluation

QUERIES = 60


@pytest.fixture(scope="module")
def database() -> SignatureDatabase:
    layers = synthetic_city(CitySpec(size=600.0))
    objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    return build_database(objects)


@pytest.fixture(scope="module")
def evaluation(database: SignatureDatabase) -> Evaluation:
    return evaluate(database, queries=QUERIES, distortion="medium", seed=1)


@pytest.mark.usefixtures("carried")
def test_an_evaluation_in_a_browser(
    browser: Chrome, evaluation: Evaluation, database: SignatureDatabase, tmp_path: Path
) -> None:
    opened(browser, evaluation_map(evaluation, database), tmp_path)
    successes = int(evaluation.successful.sum())
    assert 0 < successes < QUERIES
    assert browser.title == "Localization errors"
    assert asked(browser, "return circles(arguments[0]).length", SUCCESSFUL) == successes
    assert asked(browser, "return circles(arguments[0]).length", FAILED) == QUERIES - successes
    image = browser.find_element(By.CSS_SELECTOR, "img.leaflet-image-layer")
    assert browser.execute_script("return arguments[0].naturalWidth", image) > 100
    assert f"{QUERIES} queries" in browser.find_element(By.CSS_SELECTOR, ".semsig-legend").text
    for name, colour in (("Successful", SUCCESSFUL), ("Failed", FAILED)):
        before = drawn(browser, colour)
        assert before > 0
        switch(browser, name)
        assert drawn(browser, colour) == 0
        switch(browser, name)
        assert drawn(browser, colour) >= before * 0.9
    assert len(browser.find_elements(By.CSS_SELECTOR, "canvas.semsig-heat")) == 1
    asked(browser, "map.setZoom(20, {animate: false})")
    assert browser.find_elements(By.CSS_SELECTOR, "input:disabled") == []
    switch(browser, "Expected errors")
    assert browser.find_elements(By.CSS_SELECTOR, "canvas.semsig-heat") == []
    switch(browser, "Objects seen")
    assert browser.find_elements(By.CSS_SELECTOR, "img.leaflet-image-layer") == []
    switch(browser, "Lines")
    lines = """
    let count = 0;
    map.eachLayer((one) => { count += one.getLatLngs ? one.getLatLngs().length : 0; });
    return count;
    """
    assert asked(browser, lines) == int((evaluation.queries["tied"] > 0).sum())
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_the_heatmap_shows_mean_errors_at_every_zoom(
    browser: Chrome, evaluation: Evaluation, database: SignatureDatabase, tmp_path: Path
) -> None:
    """The oracle weighs every query for every place, in pixels of the screen."""
    opened(browser, evaluation_map(evaluation, database), tmp_path)
    guess = np.sqrt(2.0 * database.xy.var(axis=0).sum())
    errors = np.minimum(evaluation.queries["error_m"].to_numpy() / guess, 1.0)
    degrees = evaluation.queries.to_crs("EPSG:4326").geometry
    places = np.stack([degrees.y, degrees.x], axis=1).tolist()
    stops = np.linspace(0.0, 1.0, len(ERROR_RAMP))
    ramp = np.array([list(bytes.fromhex(colour[1:])) for colour in ERROR_RAMP])
    # The colours at the queries, mixed from the four pixels of the field around each.
    script = """
    const [places, zoom, done] = arguments;
    map.setZoom(map.getZoom() + zoom, {animate: false});
    requestAnimationFrame(() => requestAnimationFrame(() => {
      const canvas = document.querySelector("canvas.semsig-heat");
      const copy = document.createElement("canvas");
      [copy.width, copy.height] = [canvas.width, canvas.height];
      const context = copy.getContext("2d", {willReadFrequently: true});
      context.drawImage(canvas, 0, 0);
      const box = canvas.getBoundingClientRect();
      const shape = map.getContainer().getBoundingClientRect();
      done(places.map((place) => {
        const {x, y} = map.latLngToContainerPoint(place);
        const [left, top] = [x + shape.left - box.left, y + shape.top - box.top];
        return [x, y, ...context.getImageData(Math.round(left), Math.round(top), 1, 1).data];
      }));
    }));
    """
    for zoom in (0, -1, 2):
        told = np.array(browser.execute_async_script(ASK + script, places, zoom))
        away = np.hypot(*(told[:, None, :2] - told[None, :, :2]).T)
        weights = np.maximum(0.0, 1.0 - (away / 28.0) ** 2) ** 2
        means = (weights * errors[:, None]).sum(axis=0) / weights.sum(axis=0)
        seen = told[:, 5] > 250  # what lies outside the canvas is clear
        assert seen.sum() > 10
        for part in range(3):
            expected = np.interp(means, stops, ramp[:, part])
            assert np.abs(told[seen, 2 + part] - expected[seen]).max() < 16
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_a_click_shows_the_signature_and_the_place_found(
    browser: Chrome, evaluation: Evaluation, database: SignatureDatabase, tmp_path: Path
) -> None:
    opened(browser, evaluation_map(evaluation, database), tmp_path)
    row = evaluation.queries.iloc[-1]
    # Close to, so that no other circle lies on it.
    centre = """
    const name = arguments[0];
    const marker = [...circles(arguments[1]), ...circles(arguments[2])].find(
      (one) => one.getPopup().getContent()(one).firstChild.textContent.startsWith(name));
    map.setView(marker.getLatLng(), 20, {animate: false});
    const point = map.latLngToContainerPoint(marker.getLatLng());
    return [point.x, point.y];
    """
    x, y = asked(browser, centre, f"Query {QUERIES}:", SUCCESSFUL, FAILED)
    assert browser.find_elements(By.CSS_SELECTOR, ".semsig-details") == []
    mouse = ActionBuilder(browser)
    mouse.pointer_action.move_to_location(round(x), round(y)).click()
    mouse.perform()
    outline = "return circles(arguments[0])[0].options.color"
    assert asked(browser, outline, SUCCESSFUL) == "#222"
    browser.find_element(By.CSS_SELECTOR, ".semsig-colours").click()
    assert asked(browser, outline, SUCCESSFUL) == "#e9e9e6"  # light on dark
    browser.execute_script("localStorage.clear()")
    # Not `text`, which is empty while the popup fades in.
    box = browser.find_element(By.CSS_SELECTOR, ".semsig-details")
    popup = str(box.get_property("innerText")).replace("\u00a0", " ")
    bearings = database.signature(int(row["cell"])).bearings
    assert bearings is not None
    first = f"{row['types'][0]} {round(float(bearings[0])) % 360}°"
    legend = f"{row['types'][0]} {database.taxonomy.by_symbol(row['types'][0]).title}"
    for said in (row["types"], row["query_types"], first, legend, str(row["cell_id"])):
        assert said in popup
    assert f"of {len(database):,}" in popup
    hint = """
    let to = null;
    map.eachLayer((one) => {
      if (one.options.dashArray && one.getLatLngs) to = one.getLatLngs()[1];
    });
    return to && [to.lat, to.lng];
    """
    assert asked(browser, hint) is not None
    circles = """
    let count = 0;
    map.eachLayer((one) => {
      if (one instanceof L.CircleMarker && !one.options.fill) count += 1;
    });
    return count;
    """
    assert asked(browser, circles) == 1 + len(row["next_cell_ids"].split(","))
    asked(browser, "map.closePopup()")
    assert asked(browser, hint) is None
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_a_localization_in_a_browser(
    browser: Chrome, database: SignatureDatabase, tmp_path: Path
) -> None:
    cell = int(np.argmax(database.lengths))
    localization = localize(database, database.signature(cell), top=50)
    opened(browser, localization_map(localization, database), tmp_path)
    popups = asked(
        browser,
        """
        const texts = [];
        map.eachLayer((one) => {
          if (!(one instanceof L.CircleMarker)) return;
          texts.push(one.getPopup().getContent()(one).textContent);
        });
        return texts;
        """,
    )
    assert len(popups) == 50
    best = popups[-1]  # drawn last, on top
    assert best.startswith("Rank 1")
    assert "Rank1 of " in best
    # The query and what the cell sees, side by side.
    captions = asked(
        browser,
        "circles(arguments[0])[0].openPopup();"
        "return [...document.querySelectorAll('figcaption')].map((one) => one.textContent)",
        CANDIDATE_RAMP[0],
    )
    assert captions == ["Query", "Signature"]
    asked(browser, "map.closePopup()")
    assert str(database.cell_ids[cell]) in best
    assert database.types(cell) in best
    legend = browser.find_element(By.CSS_SELECTOR, ".semsig-legend").text
    assert f"Types: {database.types(cell)}" in legend
    switch(browser, "Candidates")
    assert (
        asked(browser, "let n = 0; map.eachLayer((one) => { n += !!one.getRadius; }); return n")
        == 0
    )
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_hostile_data_is_shown_word_for_word_and_never_run(
    browser: Chrome, evaluation: Evaluation, database: SignatureDatabase, tmp_path: Path
) -> None:
    harmful = hostile_database(database)
    spec = QuerySpec(distortions=(MissingClasses(classes=(HOSTILE,)),))
    distorted = dataclasses.replace(evaluation, asked=spec)
    map_ = evaluation_map(distorted, harmful)
    query = Signature(harmful.signature(0).codes, None)
    localization_map(localize(harmful, query, top=3), harmful, map_=map_)
    opened(browser, map_, tmp_path)  # an alert would make the next command fail
    legends = browser.find_elements(By.CSS_SELECTOR, ".semsig-legend")
    assert len(legends) == 2
    texts = [browser.execute_script("return arguments[0].textContent", one) for one in legends]
    assert sorted(text.count(HOSTILE) for text in texts) == [2, 3]
    asked(browser, "circles(arguments[0])[0].openPopup()", FAILED)
    popup = browser.execute_script("return document.querySelector('.semsig-details').textContent")
    symbol = next(symbol for symbol in evaluation.queries["types"][~evaluation.successful].iloc[0])
    assert f"{symbol} {symbol} {HOSTILE}" in popup
    for element in ("script", "img"):
        inside = f".semsig-legend {element}, .semsig-details {element}"
        assert browser.find_elements(By.CSS_SELECTOR, inside) == []
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
@pytest.mark.parametrize("screen", [(390, 800), (844, 390), (720, 600)])
def test_a_small_screen_is_not_covered(
    browser: Chrome,
    evaluation: Evaluation,
    database: SignatureDatabase,
    tmp_path: Path,
    screen: tuple[int, int],
) -> None:
    width, height = screen
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        map_ = evaluation_map(evaluation, database)
        localization_map(localize(database, database.signature(0), top=3), database, map_=map_)
        opened(browser, map_, tmp_path)
        legends = browser.find_elements(By.CSS_SELECTOR, ".semsig-legend")
        assert max(legend.size["height"] for legend in legends) < 60
        assert browser.find_elements(By.CSS_SELECTOR, ".leaflet-control-layers-expanded") == []
        top = browser.find_element(By.CSS_SELECTOR, ".leaflet-top.leaflet-left").rect
        for legend in legends:
            legend.find_element(By.TAG_NAME, "summary").click()
            assert legend.size["height"] > 100
            assert legend.size["width"] <= width - 20
            # One is open at a time, and both are below the buttons.
            assert len(browser.find_elements(By.CSS_SELECTOR, ".semsig-legend[open]")) == 1
            assert min(one.rect["y"] for one in legends) >= top["y"] + top["height"]
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


@pytest.mark.usefixtures("carried")
def test_boxes_fold_when_the_window_becomes_small(
    browser: Chrome, evaluation: Evaluation, database: SignatureDatabase, tmp_path: Path
) -> None:
    opened(browser, evaluation_map(evaluation, database), tmp_path)
    boxes = ".semsig-legend[open], .leaflet-control-layers-expanded"
    assert len(browser.find_elements(By.CSS_SELECTOR, boxes)) == 2
    size = {"width": 500, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        wait = WebDriverWait(browser, 10.0)
        wait.until(lambda one: one.find_elements(By.CSS_SELECTOR, boxes) == [])
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    wait.until(lambda one: len(one.find_elements(By.CSS_SELECTOR, boxes)) == 1)
    switch(browser, "Failed")  # the layers are there again
    assert asked(browser, "return circles(arguments[0]).length", FAILED) == 0
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_nothing_lies_below_the_boxes(
    browser: Chrome, evaluation: Evaluation, database: SignatureDatabase, tmp_path: Path
) -> None:
    opened(browser, evaluation_map(evaluation, database), tmp_path)
    legend = browser.find_element(By.CSS_SELECTOR, ".semsig-legend").rect
    layers = browser.find_element(By.CSS_SELECTOR, ".leaflet-control-layers").rect
    left, right = legend["x"] + legend["width"], layers["x"]
    places = """
    return [...circles(arguments[0]), ...circles(arguments[1])].map(
      (one) => map.latLngToContainerPoint(one.getLatLng()).x);
    """
    across = asked(browser, places, SUCCESSFUL, FAILED)
    assert left <= min(across) <= max(across) <= right
    opening = """
    const pan = map.panBy;
    map.panBy = (offset) => pan.call(map, offset, {animate: false});
    const [marker] = circles(arguments[0]);
    map.setView(marker.getLatLng(), 18, {animate: false});
    pan.call(map, [arguments[1] * map.getSize().x / 2, 0], {animate: false});
    marker.openPopup();
    """
    for side in (-0.95, 0.95):
        asked(browser, opening, FAILED, side)
        box = browser.find_element(By.CSS_SELECTOR, ".leaflet-popup-content-wrapper").rect
        assert left <= box["x"]
        assert box["x"] + box["width"] <= right
        said = browser.find_element(By.CSS_SELECTOR, ".semsig-details").get_property("innerText")
        assert [line.split("\t")[0] for line in str(said).splitlines()[1:4]] == [
            "Expected error", "P(error ≤ 50 m)", "True rank"
        ]  # fmt: skip
        asked(browser, "map.closePopup()")
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_the_search_offers_the_best_match_first(
    browser: Chrome, evaluation: Evaluation, database: SignatureDatabase, tmp_path: Path
) -> None:
    opened(browser, evaluation_map(evaluation, database), tmp_path)
    for number in (1, 2, 5, 12, QUERIES):  # of both layers
        for text in (f"Query {number}", f"query {number}:", str(number)):
            assert searched(browser, text)[0].startswith(f"Query {number}: ")
    # By its number it is as well called as what is called so on another map.
    exact = "return semsig.finders.flatMap((one) => one('12', 9)).map((one) => one.rank)"
    assert asked(browser, exact).count(0) == 1
    assert searched(browser, "query")[0].startswith("Query")
    assert searched(browser, f"of {QUERIES}") == []
    searched(browser, "Query 3", Keys.ENTER)
    assert popup_text(browser).startswith("Query 3: ")
    browser.switch_to.active_element.send_keys(Keys.ESCAPE)
    assert asked(browser, "return map._popup.isOpen()") is False
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_maps_are_drawn_one_over_the_other(
    browser: Chrome, evaluation: Evaluation, database: SignatureDatabase, tmp_path: Path
) -> None:
    map_ = folium.Map([43.0, 3.0], zoom_start=12, tiles=None)
    assert evaluation_map(evaluation, database, map_=map_) is map_
    localization = localize(database, database.signature(0), top=4)
    for _ in range(2):
        assert localization_map(localization, database, map_=map_) is map_
    opened(browser, map_, tmp_path)
    labels = browser.find_elements(By.CSS_SELECTOR, ".leaflet-control-layers-overlays label")
    names = [label.text.strip() for label in labels]
    assert names[-2:] == ["Candidates (4)", "Candidates (4), 2"]
    assert names.count("Objects seen from a cell") == 1
    assert len(names) == 7
    assert asked(browser, "return map.getZoom()") == 12  # the view is the caller's
    switch(browser, "Candidates (4), 2")
    assert_quiet(browser)


@pytest.mark.usefixtures("carried")
def test_a_popup_draws_signatures_as_wheels(
    browser: Chrome, evaluation: Evaluation, database: SignatureDatabase, tmp_path: Path
) -> None:
    opened(browser, evaluation_map(evaluation, database), tmp_path)
    lengths = evaluation.queries["query_length"]
    letters = """
    return [...document.querySelectorAll(".semsig-wheels text")].map((one) =>
      one.getAttribute("font-size") * one.ownerSVGElement.getBoundingClientRect().width / 116);
    """
    for query in (int(lengths.argmin()), int(lengths.argmax())):
        name = f"Query {query + 1:,}: "
        assert searched(browser, name, Keys.ENTER)[0].startswith(name)
        assert popup_text(browser).startswith(name)
        assert min(browser.execute_script(letters)) >= 9.0
    wheels = browser.find_elements(By.CSS_SELECTOR, ".semsig-wheels figure")
    row = evaluation.queries.iloc[query]
    seen = (
        ("True cell sees", row["types"], database.signature(int(row["cell"])).bearings),
        ("Query", row["query_types"], [float(one) for one in row["query_bearings"].split(",")]),
    )
    assert wheels[0].rect["y"] == wheels[1].rect["y"]  # side by side
    for wheel, (label, types, bearings) in zip(wheels, seen, strict=False):
        assert bearings is not None
        assert wheel.find_element(By.TAG_NAME, "figcaption").get_property("innerText") == label
        degrees = [f"{symbol} {round(float(one)) % 360}°"
                   for symbol, one in zip(types, bearings, strict=True)]  # fmt: skip
        told = wheel.find_element(By.TAG_NAME, "svg").get_attribute("aria-label")
        assert told == f"{label}, clockwise from north: {', '.join(degrees)}"
        signs = wheel.find_elements(By.TAG_NAME, "text")
        assert len(signs) == len(types)
        for sign, one in zip(signs, bearings, strict=True):
            x, y = (float(str(sign.get_attribute(part))) for part in "xy")
            turn = (np.degrees(np.arctan2(x, -y)) - one + 180.0) % 360.0 - 180.0
            assert abs(turn) <= 0.51  # north up, clockwise, whole degrees
            assert np.hypot(x, y) < 54.0
    assert_quiet(browser)


@settings(max_examples=20)
@given(
    st.sampled_from(["EPSG:2154", "EPSG:32631", "EPSG:3879", "EPSG:2039", "EPSG:28992"]),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
    st.floats(10.0, 40_000.0),
)
def test_the_search_places_x_and_y_to_the_centimetre(
    crs: str, across: float, along: float, size: float
) -> None:
    system = CRS(crs)
    assert system.area_of_use is not None
    west, south, east, north = system.area_of_use.bounds
    middle = Transformer.from_crs("EPSG:4326", system, always_xy=True).transform(
        (west + east) / 2, (south + north) / 2
    )
    corners = np.array(middle) + size * np.array([[-0.5, -0.5], [0.5, 0.5]])
    table = gpd.GeoDataFrame(
        {"class_code": np.array([1, 1], np.uint8)}, geometry=shapely.points(corners), crs=system
    )
    area = _map_parts._area(StreetObjects(table, paper_taxonomy(), ()))
    place = corners[0] + size * np.array([across, along])
    u, v = (place - area["middle"]) / area["half"]
    found = sum(u**i * v**j * np.array(weights) for i, j, *weights in area["terms"])
    expected = _map_parts.to_latlon(place[None], system, digits=12)[0]
    metres = (found - expected) * 111_320.0 * [1.0, np.cos(np.radians(expected[0]))]
    assert np.hypot(*metres) < 0.01


def test_queries_of_which_nothing_is_left(database: SignatureDatabase, tmp_path: Path) -> None:
    short = int(np.argmin(database.lengths))
    few = evaluate(database, queries=len(database), distortion="strong")
    lost = few.queries["tied"] == 0
    assert lost.any(), f"cell {short} sees {database.lengths[short]}"
    only = dataclasses.replace(few, queries=few.queries[lost].reset_index(drop=True))
    save_map(evaluation_map(only, database), tmp_path / "map.html", self_contained=False)
    page = (tmp_path / "map.html").read_text(encoding="utf-8")
    assert page.count("nothing left of it") == int(lost.sum())
    assert "infinite, not localized" in page
    assert "NaN" not in page.partition("</head>")[2]


def test_queries_from_cells_that_the_database_has_not(
    evaluation: Evaluation, database: SignatureDatabase, tmp_path: Path
) -> None:
    queries = evaluation.queries.copy()
    queries.loc[:2, ["cell", "cell_id"]] = -1, -7
    queries.loc[:2, "types"] = ""
    elsewhere = dataclasses.replace(evaluation, queries=queries)
    assert (elsewhere.rows_in(database)[:3] == -1).all()
    save_map(evaluation_map(elsewhere, database), tmp_path / "map.html", self_contained=False)
    assert (tmp_path / "map.html").read_text(encoding="utf-8").count("no such cell") == 3
    queries.loc[5, "types"] = "?"
    with pytest.raises(InputError) as caught:
        evaluation_map(dataclasses.replace(evaluation, queries=queries), database)
    assert_sentence(caught.value, "evaluation was not made with this database")


def test_ten_thousand_queries_stay_small(
    evaluation: Evaluation, database: SignatureDatabase, tmp_path: Path
) -> None:
    sizes = {}
    for number in (500, 10_000):
        rows = np.arange(number) % QUERIES
        many = dataclasses.replace(
            evaluation, queries=evaluation.queries.iloc[rows].reset_index(drop=True)
        )
        file = tmp_path / f"{number}.html"
        save_map(evaluation_map(many, database), file, self_contained=False)
        sizes[number] = file.stat().st_size
    assert sizes[500] < 500_000
    assert sizes[10_000] < 8_000_000


def test_a_map_says_whether_it_makes_requests(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain, tiled = folium.Map(tiles=None), folium.Map()
    file = tmp_path / "map.html"
    assert not save_map(plain, file, self_contained=False)
    assert "https://" in file.read_text(encoding="utf-8")
    monkeypatch.setattr(map_assets, "available", lambda: True)
    monkeypatch.setattr(map_assets, "inline_assets", lambda _: "<head></head>")
    assert save_map(plain, file)
    assert file.read_text(encoding="utf-8") == "<head></head>"
    assert not save_map(tiled, file)


def test_a_map_that_cannot_be_self_contained(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(page: str) -> str:
        raise InputError(page[:0] + "This installation carries no Leaflet.")

    monkeypatch.setattr(map_assets, "available", lambda: True)
    monkeypatch.setattr(map_assets, "inline_assets", refuse)
    file = tmp_path / "map.html"
    assert not save_map(folium.Map(tiles=None), file)
    before = file.read_bytes()
    with pytest.raises(InputError, match="carries no Leaflet"):
        save_map(folium.Map(tiles=None), file, self_contained=True)
    assert file.read_bytes() == before
    monkeypatch.setattr(map_assets, "available", lambda: False)
    assert not save_map(folium.Map(tiles=None), file)


def test_a_file_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here")
    with pytest.raises(InputError) as caught:
        save_map(folium.Map(tiles=None), tmp_path / "file" / "map.html", self_contained=False)
    assert_sentence(caught.value, "map.html")
    assert (tmp_path / "file").read_text() == "here"


def test_tiles(evaluation: Evaluation, database: SignatureDatabase) -> None:
    page: str = evaluation_map(evaluation, database, tiles="OpenStreetMap").get_root().render()
    assert "tile.openstreetmap.org" in page
    with pytest.raises(InputError) as caught:
        evaluation_map(evaluation, database, tiles="Openstreetmop")
    assert_sentence(caught.value, "Openstreetmop", "OpenStreetMap")
    localization = localize(database, database.signature(0), top=1)
    with pytest.raises(InputError) as caught:
        localization_map(localization, database, tiles="OpenStreetMap", map_=folium.Map(tiles=None))
    assert_sentence(caught.value, "OpenStreetMap")


def test_what_was_made_with_another_database(
    evaluation: Evaluation, database: SignatureDatabase
) -> None:
    layers = synthetic_city(CitySpec(size=600.0, seed=1))
    objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    other = build_database(objects)
    with pytest.raises(InputError) as caught:
        evaluation_map(evaluation, other)
    assert_sentence(caught.value, "evaluation", "database")
    localization = localize(database, database.signature(0), top=5)
    with pytest.raises(InputError) as caught:
        localization_map(localization, other)
    assert_sentence(caught.value, "localization", "database")
    # The same cells, but what they see has changed.
    changed = dataclasses.replace(database, codes=database.codes[::-1].copy())
    with pytest.raises(InputError):
        localization_map(localization, changed)
