"""The map of an evaluation in a real browser."""

from __future__ import annotations

import dataclasses
import re
from collections import Counter
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
from map_pages import IMAGES, LEGEND
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from sentences import refused
from small_city import small_city, small_evaluation

from semsig_gis.core import FAILURES, OUTCOMES, InputError
from semsig_gis.evaluation import evaluate
from semsig_gis.localization import Method
from semsig_gis.output import OUTLINES, evaluation_map, page_of_map

if TYPE_CHECKING:
    from map_pages import MapPage

    from semsig_gis.evaluation import Evaluation

SUCCESSFUL, FAILED = (mark.colour for mark in OUTCOMES.values())
# The sum of the pixel values of the lines.
LINES = """
const canvas = document.querySelector("canvas.semsig-lines");
if (canvas === null) return null;
const {data} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
return data.reduce((sum, part) => sum + part, 0);
"""
CITY, EVALUATION = small_city()[0], small_evaluation("medium")


def test_evaluation_map_has_layers_of_outcomes(evaluation_page: MapPage) -> None:
    successes = int(EVALUATION.successful.sum())
    assert 0 < successes < len(EVALUATION.queries)
    assert evaluation_page.browser.title == "Localization errors"
    assert evaluation_page.circles("successful") == successes
    assert evaluation_page.circles("failed") == len(EVALUATION.queries) - successes
    image = evaluation_page.one(IMAGES)
    assert evaluation_page.ask("return arguments[0].naturalWidth", image) > 100
    assert f"{len(EVALUATION.queries)} queries" in evaluation_page.one(LEGEND).text
    for name, colour in (("Successful", SUCCESSFUL), ("Failed", FAILED)):
        before = evaluation_page.drawn(colour)
        assert before > 0
        evaluation_page.switch(name)
        assert evaluation_page.drawn(colour) == 0
        evaluation_page.switch(name)
        assert evaluation_page.drawn(colour) >= before * 0.9
    assert len(evaluation_page.all("canvas.semsig-field")) == 1
    evaluation_page.ask("map.setZoom(20, {animate: false})")
    assert evaluation_page.all("input:disabled") == []
    evaluation_page.switch("Objects seen")
    assert evaluation_page.all("canvas.semsig-field") == []
    assert evaluation_page.all(IMAGES) == [image]
    evaluation_page.switch("Nothing")
    assert evaluation_page.all(IMAGES) == []
    assert evaluation_page.ask(LINES) is None
    evaluation_page.switch("Lines")
    assert evaluation_page.drawn(FAILED) >= 0  # after the next frame
    assert evaluation_page.ask(LINES) > 0


def spread_evaluation() -> Evaluation:
    """Return an evaluation over three kilometres, with more failures in the east."""
    rng = np.random.default_rng(0)
    queries = EVALUATION.queries.iloc[np.arange(800) % len(EVALUATION.queries)]
    east, north = rng.uniform(0.0, 3000.0, (2, len(queries)))
    places = gpd.points_from_xy(CITY.xy[0, 0] + east, CITY.xy[0, 1] + north, crs=CITY.crs)
    chances = (rng.uniform(0.0, 3000.0, len(queries)) > east).astype(np.float64)
    queries = queries.reset_index(drop=True).assign(p50=chances).set_geometry(places)
    return dataclasses.replace(EVALUATION, queries=queries)


def test_field_is_equal_at_every_zoom(page: MapPage) -> None:
    """The oracle computes the weighted share of failures from all queries for each place."""
    spread, radius = spread_evaluation(), 400.0
    page.open(evaluation_map(spread, CITY, smooth=radius))
    xy = np.stack([spread.queries.geometry.x, spread.queries.geometry.y], axis=1)
    inner = (np.abs(xy - xy.mean(axis=0)) < 1200.0).all(axis=1)
    places = spread.queries.geometry[inner][:12]
    here = np.stack([places.x, places.y], axis=1)
    away = ((here[:, None] - xy) ** 2).sum(axis=2)
    weights = np.maximum(0.0, 1.0 - away / radius**2) ** 2
    failed = (weights @ ~spread.successful) / weights.sum(axis=1)
    least = np.array(list(FAILURES))
    expected = np.digitize(failed, least) - 1
    assert len(set(expected.tolist())) >= 4
    unsure = np.abs(failed[:, None] - least[1:]).min(axis=1) < 0.03
    degrees = places.to_crs("EPSG:4326")
    latlon = np.stack([degrees.y, degrees.x], axis=1).tolist()
    colours = [list(bytes.fromhex(colour[1:])) for colour in FAILURES.values()]
    for zoom in (12, 15, 18):
        with page.screen(300, 200, mobile=False):  # small, so that each place is drawn quickly
            colours_at = page.ask_later("fieldAt(...arguments)", latlon, zoom)
        levels = np.array([colours.index(colour) for colour in colours_at])
        assert np.abs(levels - expected).max() <= 1
        assert (levels == expected)[~unsure].all() or zoom == 12


@pytest.mark.parametrize(("count", "least", "most"), [(3, 0.3, 0.7), (60, 0.95, 1.0)])
def test_field_is_hatched_where_queries_are_few(
    page: MapPage, count: int, least: float, most: float
) -> None:
    some = dataclasses.replace(EVALUATION, queries=EVALUATION.queries[:count])
    page.open(evaluation_map(some, CITY, smooth=60.0))
    row = some.queries.to_crs("EPSG:4326").geometry.iloc[0]
    page.ask("map.setView([...arguments], 19, {animate: false})", row.y, row.x)
    assert least <= page.ask_later("fieldCover(...arguments)", 40) <= most
    assert "fewer than 5 queries" in page.text(LEGEND)
    page.switch("Nothing")
    page.switch("Share of queries")
    page.ask("map.setView([0, 0], 12, {animate: false})")  # where there is nothing to draw
    assert page.ask_later("fieldCover(...arguments)", 40) == 0.0


def test_outcomes_have_different_shapes(evaluation_page: MapPage) -> None:
    page = page_of_map(evaluation_map(EVALUATION, CITY), self_contained=False)
    signs = evaluation_page.all(f"{LEGEND} .semsig-sign path")
    assert [(sign.get_attribute("d"), sign.get_attribute("fill")) for sign in signs] == [
        (OUTLINES[mark.shape], mark.colour) for mark in OUTCOMES.values()
    ]
    assert all(f'"{OUTLINES[mark.shape]}"' in page for mark in OUTCOMES.values())
    # A triangle covers half of its box.
    counts = [evaluation_page.ask("return signArea(arguments[0])", outcome) for outcome in OUTCOMES]
    assert counts[0] == pytest.approx(np.pi / 4, abs=0.1)
    assert counts[1] == pytest.approx(0.5, abs=0.1)


def test_click_shows_signatures_and_best_place(evaluation_page: MapPage) -> None:
    row = EVALUATION.queries.iloc[-1]
    assert evaluation_page.all(".semsig-details") == []
    last = "failed" if not EVALUATION.successful[-1] else "successful"
    evaluation_page.point_at("signs(arguments[0]).at(-1)", last)
    canvas = ".leaflet-marker-pane canvas"
    for mark in OUTCOMES.values():  # on light and on dark
        assert mark.edge in {"#000000", "#ffffff"}
    assert evaluation_page.drawn(OUTCOMES[last].edge, canvas) > 0
    text = evaluation_page.panel().replace("\u00a0", " ")
    title = f"{CITY.taxonomy.by_symbol(row['types'][0]).title} "
    for words in (row["types"], row["query_types"], title, str(row["cell_id"])):
        assert words in text
    assert f"of {len(CITY):,}" in text
    following = np.searchsorted(CITY.cell_ids, EVALUATION.next_cell_ids[-1])
    off = np.hypot(*(CITY.xy[following] - [row.geometry.x, row.geometry.y]).T)
    assert ", ".join(f"{metres:,.0f} m off" for metres in off) in text
    dashed = "return lines(({options}) => options.dashArray === '5 5').length"
    assert evaluation_page.ask(dashed) == 1  # to the best place
    empty = "return shown((layer) => layer instanceof L.CircleMarker && !layer.options.fill).length"
    assert evaluation_page.ask(empty) == 2 + len(EVALUATION.next_cell_ids[-1])  # and the query
    evaluation_page.ask("semsig.hide(map)")
    assert evaluation_page.ask(dashed) == 0


def test_panel_draws_signatures_as_wheels(evaluation_page: MapPage) -> None:
    lengths = EVALUATION.queries["query_length"]
    pictograms = """
    return [...document.querySelectorAll(".semsig-wheels .picture")].map(
      (picture) => 16 * picture.getScreenCTM().a);
    """
    for query in (int(lengths.argmin()), int(lengths.argmax())):
        name = f"Query {query + 1:,}: "
        assert evaluation_page.search(name, Keys.ENTER)[0].startswith(name)
        assert evaluation_page.panel().startswith(name)
        assert min(evaluation_page.ask(pictograms)) >= 9.0
    wheels = evaluation_page.all(".semsig-wheels figure")
    row = EVALUATION.queries.iloc[query]
    expected = (
        ("Query", row["query_types"], EVALUATION.query_bearings[query]),
        ("True cell sees", row["types"], CITY.signature(int(row["cell"])).bearings),
    )
    assert wheels[0].rect["y"] == wheels[1].rect["y"]  # side by side
    for wheel, (label, types, bearings) in zip(wheels, expected, strict=False):
        assert bearings is not None
        assert wheel.find_element(By.TAG_NAME, "figcaption").text.removesuffix(", to 30 m") == label
        degrees = [f"{CITY.taxonomy.by_symbol(symbol).title} {round(float(bearing)) % 360}°"
                   for symbol, bearing in zip(types, bearings, strict=True)]  # fmt: skip
        description = str(wheel.find_element(By.TAG_NAME, "svg").get_attribute("aria-label"))
        objects = f"{label}, clockwise from north: {', '.join(degrees)}"
        assert re.sub(r" \d+ m", "", description) == objects
        places = evaluation_page.ask("return signPlaces(arguments[0])", wheel)
        for (x, y), bearing in zip(places, bearings, strict=True):
            turn = (np.degrees(np.arctan2(x, -y)) - bearing + 180.0) % 360.0 - 180.0
            assert abs(turn) <= 0.51  # north up, clockwise, whole degrees
            assert np.hypot(x, y) < 54.0
    # Every object of both has one verdict, and the key counts them.
    kinds = "[...arguments[0].querySelectorAll('.object')].map(({classList}) => classList[1])"
    query_counts, cell_counts = (
        Counter(evaluation_page.ask(f"return {kinds}", wheel)) for wheel in wheels
    )
    common = Counter(expected[0][1]) & Counter(expected[1][1])
    assert query_counts["matched"] == cell_counts["matched"] <= common.total()
    assert query_counts["misnamed"] == cell_counts["misnamed"]
    assert (query_counts["missed"], cell_counts["false"]) == (0, 0)
    key = evaluation_page.texts(".semsig-key span")
    both = query_counts | {"missed": cell_counts["missed"]}
    words = {verdict: verdict for verdict in ("matched", "misnamed", "missed")} | {"false": "extra"}
    assert key == [f"{both[verdict]} {word}" for verdict, word in words.items() if both[verdict]]
    # The second choice is the best cell.
    evaluation_page.all(".semsig-choices button")[1].click()
    assert evaluation_page.all("figcaption")[1].text.startswith("Best cell sees")


def test_wheels_show_sectors_of_queries(page: MapPage) -> None:
    evaluation = evaluate(CITY, queries=3, distortion="view:120, ranges:25", method=Method())
    longest = int(evaluation.queries["query_length"].argmax())
    page.open(evaluation_map(evaluation, CITY))
    page.search(f"Query {longest + 1:,}: ", Keys.ENTER)
    query, cell = page.all(".semsig-wheels figure")
    pale = []
    for wheel in (cell, query):
        assert len(wheel.find_elements(By.CSS_SELECTOR, "path.looked")) == 1
        pale.append(len(wheel.find_elements(By.CSS_SELECTOR, ".outside")))
    row = evaluation.queries.iloc[longest]
    assert pale == [row["length"] - row["query_length"], 0]
    assert query.text.endswith("Query, to 30 m")


def test_empty_queries_are_described(page: MapPage) -> None:
    strong = small_evaluation()
    empty = strong.queries["tied"] == 0
    assert empty.any()
    only = dataclasses.replace(strong, queries=strong.queries[empty].reset_index(drop=True))
    page.open(evaluation_map(only, CITY))
    page.switch("Lines")
    assert page.ask(LINES) == 0
    text = page.panel_of("failed")
    assert "nothing left of it" in text
    assert "infinite, not localized" in text


def test_queries_from_unknown_cells_are_described(page: MapPage) -> None:
    queries = EVALUATION.queries.copy()
    queries.loc[:2, ["cell", "cell_id"]] = -1, -7
    queries.loc[:2, "types"] = ""
    elsewhere = dataclasses.replace(EVALUATION, queries=queries)
    assert (elsewhere.rows_in(CITY)[:3] == -1).all()
    page.open(evaluation_map(elsewhere, CITY))
    page.search("Query 2:", Keys.ENTER)
    assert "no such cell" in page.panel()
    queries.loc[5, "types"] = "?"
    with refused(InputError, "evaluation was not made with this database"):
        evaluation_map(dataclasses.replace(EVALUATION, queries=queries), CITY)


@pytest.mark.parametrize(("number", "most"), [(500, 400_000), (10_000, 3_000_000)])
def test_page_of_10_000_queries_is_small(number: int, most: int) -> None:
    rows = np.arange(number) % len(EVALUATION.queries)
    queries = EVALUATION.queries.iloc[rows].reset_index(drop=True)
    many = dataclasses.replace(EVALUATION, queries=queries)
    assert len(page_of_map(evaluation_map(many, CITY), self_contained=False)) < most
