"""Filters of queries by outcome, error, objects seen, class and chance; and downloads."""

from __future__ import annotations

import dataclasses
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys
from small_city import small_city, small_evaluation

from semsig_gis.evaluation import evaluate
from semsig_gis.localization import build_index, named_noise
from semsig_gis.output import evaluation_map

if TYPE_CHECKING:
    from collections.abc import Sequence

    from map_pages import MapPage
    from numpy.typing import NDArray

CITY, EVALUATION = small_city()[0], small_evaluation()
QUERIES, FAILED = EVALUATION.queries, ~EVALUATION.successful
SELECTION = "return semsig.layerSets.queries.selection()"
FILE = """
const set = semsig.layerSets.queries;
return semsig.files[arguments[0]](semsig.queryColumns(set), set.selection());
"""
STATE = "return new URLSearchParams(location.hash.slice(1)).get('queries')"


@pytest.fixture
def filters_page(page: MapPage) -> MapPage:
    page.open(evaluation_map(EVALUATION, CITY))
    return page


def slide(page: MapPage, label: str, value: int) -> None:
    """Move a slider like a mouse."""
    slider = page.one(f".semsig-filters input[aria-label='{label}']")
    page.ask(
        "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'))",
        slider,
        value,
    )


def assert_selected(page: MapPage, expected: NDArray[np.bool_]) -> None:
    """Check which queries are drawn, and the text with their number."""
    assert page.ask(SELECTION) == np.flatnonzero(expected).tolist()
    count, failed = int(expected.sum()), int((expected & FAILED).sum())
    of = "" if count == len(expected) else f"{count} of "
    summary = f"{of}{len(expected)} queries, {failed} failed"
    assert page.text(".semsig-filters summary") == summary


def test_filters_select_queries(filters_page: MapPage) -> None:
    everything = np.ones(len(QUERIES), np.bool_)
    assert_selected(filters_page, everything)
    lengths, types = QUERIES["length"].to_numpy(), QUERIES["types"]
    slide(filters_page, "Objects seen, least", 6)
    slide(filters_page, "Objects seen, most", 12)
    few = (lengths >= 6) & (lengths <= 12)
    assert 0 < few.sum() < len(few)
    assert_selected(filters_page, few)
    assert "Objects seen: 6 to 12" in filters_page.one(".semsig-filters").text
    symbol = types[few].iloc[0][0]
    title = CITY.taxonomy.by_symbol(symbol).title
    filters_page.one(".semsig-filters select").send_keys(title)
    with_class = few & types.str.contains(symbol, regex=False).to_numpy()
    assert_selected(filters_page, with_class)
    slide(filters_page, "P(error ≤ 50 m), most", 9)
    unsure = with_class & (QUERIES["p50"].to_numpy() <= 0.455)
    assert_selected(filters_page, unsure)
    (outcome,) = (
        element for element in filters_page.all(".semsig-filters label") if "failed" in element.text
    )
    outcome.click()
    assert_selected(filters_page, unsure & ~FAILED)
    filters_page.one(".semsig-download button").click()  # all
    assert_selected(filters_page, everything)
    filters_page.switch("Successful")
    assert_selected(filters_page, FAILED)


def test_legend_and_list_of_layers_count_what_is_selected(filters_page: MapPage) -> None:
    def numbers() -> list[str]:
        return filters_page.texts(".semsig-legend [data-outcome]")

    totals = np.bincount(FAILED, minlength=2)
    assert numbers() == [str(total) for total in totals]
    assert not filters_page.one(".semsig-selected").is_displayed()
    slide(filters_page, "Objects seen, least", 6)
    enough = QUERIES["length"].to_numpy() >= 6
    counts = [f"{count} of {total}" for count, total in
              zip(np.bincount(FAILED[enough], minlength=2), totals, strict=True)]  # fmt: skip
    assert numbers() == counts
    labels = [label for label in filters_page.layers() if "queries (" in label]
    assert labels[:2] == [f"Successful queries ({counts[0]})", f"Failed queries ({counts[1]})"]
    text = filters_page.text(".semsig-selected")
    assert f"Selected: {enough.sum()} of {len(enough)} queries" in text
    assert "objects seen: 6 to" in text
    filters_page.switch("Failed")
    assert "not failed" in filters_page.text(".semsig-selected")
    assert filters_page.layers()[filters_page.layers().index(labels[0])] == labels[0]


def test_histogram_and_sliders_select_errors(filters_page: MapPage) -> None:
    errors = QUERIES["error_m"].to_numpy()
    assert np.isinf(errors).any()
    edges = filters_page.ask(
        "return semsig.errorEdges([...arguments[0], Infinity])",
        errors[np.isfinite(errors)].tolist(),
    )
    assert edges[-1] is None  # infinity
    assert {0, 10, 50, 100} <= set(edges)
    assert edges[-3] <= errors[np.isfinite(errors)].max() <= edges[-2]
    low, high = edges.index(50), edges.index(200)
    drawing = filters_page.one(".semsig-histogram")
    step = drawing.size["width"] / (len(edges) - 1)
    start = round((low + 0.5) * step - drawing.size["width"] / 2)
    brush = ActionChains(filters_page.browser).move_to_element_with_offset(drawing, start, 0)
    brush.click_and_hold().move_by_offset(round((high - low - 1) * step), 0).release().perform()
    assert_selected(filters_page, (errors > 50) & (errors <= 200))
    assert "Expected error: 50 m to 200 m" in filters_page.one(".semsig-filters").text
    least = filters_page.one("input[aria-label='Expected error, least']")
    least.send_keys(Keys.ARROW_LEFT)
    assert_selected(filters_page, (errors > edges[low - 1]) & (errors <= 200))
    least.send_keys(Keys.END)  # it moves the other handle too
    assert_selected(filters_page, np.zeros(len(errors), np.bool_))
    most = filters_page.one("input[aria-label='Expected error, most']")
    assert most.get_attribute("aria-valuetext") == "not localized"
    least.send_keys(Keys.ARROW_LEFT)
    assert_selected(filters_page, np.isinf(errors))


def rows_of(page: MapPage, kind: str) -> tuple[str, list[dict[str, Any]]]:
    """Return the type of a file of the selection, and its rows."""
    kind_of_file, text = page.ask(FILE, kind)
    if kind == "csv":
        head, *lines = str(text).removesuffix("\r\n").split("\r\n")
        columns = head.split(",")
        return kind_of_file, [dict(zip(columns, line.split(","), strict=True)) for line in lines]
    rows = []
    for feature in json.loads(text)["features"]:
        longitude, latitude = feature["geometry"]["coordinates"]
        rows.append({**feature["properties"], "longitude": longitude, "latitude": latitude})
    return kind_of_file, rows


def test_selection_is_downloaded_as_files(filters_page: MapPage) -> None:
    slide(filters_page, "Objects seen, most", 4)
    expected = QUERIES[QUERIES["length"] <= 4].to_crs("EPSG:4326")
    assert len(expected)
    for kind, media in (("geojson", "application/geo+json"), ("csv", "text/csv")):
        media_type, rows = rows_of(filters_page, kind)
        assert media_type == media
        assert [int(row["query"]) for row in rows] == (expected.index + 1).tolist()
        places = [[float(row["longitude"]), float(row["latitude"])] for row in rows]
        points = np.stack([expected.geometry.x, expected.geometry.y], axis=1)
        assert np.abs(np.array(places) - points).max() < 1e-6
        for row, (_, query) in zip(rows, expected.iterrows(), strict=True):
            missing = row["error_m"] in {"", None}
            assert (np.inf if missing else float(row["error_m"])) == query["error_m"]
            values = [str(row[name]).strip('"') for name in ("cell_id", "types", "outcome")]
            outcome = "failed" if query["p50"] < 0.5 else "successful"
            assert values == [str(query["cell_id"]), query["types"], outcome]
    # Texts that look like formulas are quoted.
    formula = "return semsig.files.csv({types: () => arguments[0]}, [0])[1]"
    assert filters_page.ask(formula, '=1+"2"') == 'types\r\n"\'=1+""2"""\r\n'
    saved = """
    const click = HTMLAnchorElement.prototype.click;
    const names = [];
    HTMLAnchorElement.prototype.click = function () { names.push(this.download); };
    document.querySelectorAll(".semsig-download button").forEach((button) => button.click());
    HTMLAnchorElement.prototype.click = click;
    setTimeout(() => arguments[0](names), 1100);
    """
    assert filters_page.ask_later(saved) == ["queries.geojson", "queries.csv"]


def test_filters_are_stored_in_the_address(filters_page: MapPage) -> None:
    slide(filters_page, "Objects seen, least", 6)
    slide(filters_page, "Expected error, most", 8)
    filters_page.one(".semsig-filters select").send_keys(CITY.taxonomy.by_symbol("D").title)
    selection = filters_page.ask(SELECTION)
    edge = filters_page.ask("return semsig.errorEdges([...semsig.layerSets.queries.data.error])[8]")
    filters_page.until(lambda: filters_page.ask(STATE) == f"error:~{edge},seen:6~,class:D")
    filters_page.follow(f"{filters_page.browser.current_url}&told=query:1")
    assert filters_page.facts()["title"].startswith("Query 1")
    assert filters_page.ask(SELECTION) == selection
    assert filters_page.one(".semsig-filters select").get_attribute("value") == "D"
    filters_page.ask("map.semsigParts.get('queries').write('class:%23,seen:x~,error:3~4')")
    assert len(filters_page.ask(SELECTION)) == len(QUERIES)
    assert filters_page.all("canvas.semsig-board")
    for box in filters_page.all("[data-group=queries] input:checked"):
        box.click()
    assert not filters_page.all(".leaflet-marker-pane canvas.semsig-board")


def test_two_evaluations_have_separate_filters(page: MapPage) -> None:
    stated = evaluate(CITY, queries=30, method=build_index(CITY, named_noise("medium")))
    map_ = evaluation_map(stated, CITY)
    evaluation_map(dataclasses.replace(EVALUATION, queries=QUERIES), CITY, map_=map_)
    page.open(map_)
    slide(page, "Chance given, least", 18)
    chances = stated.queries["chance"].fillna(0.0).to_numpy()
    assert page.ask(SELECTION) == np.flatnonzero(np.rint(100 * chances) >= 90).tolist()
    assert [element.text for element in page.all(".semsig-filters[open]")] != []
    assert len(page.all(".semsig-filters")) == 2
    both = "return Object.values(semsig.layerSets).map(({data}) => data.outcome.length)"
    counts: Sequence[int] = page.ask(both)
    assert counts == [30, len(QUERIES)]
