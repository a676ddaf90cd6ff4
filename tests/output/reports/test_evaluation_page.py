"""The report of an evaluation: its headline, its sections, and the page in a browser."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from axe_core_python.selenium import Axe
from html_pages import HtmlPage
from map_pages import MapPage, assert_quiet
from sentences import refused
from worlds import random_town

from semsig_gis.core import InputError
from semsig_gis.evaluation import evaluate, parse_chain
from semsig_gis.localization import Method, build_index, named_noise
from semsig_gis.output import (
    evaluation_headline,
    evaluation_page,
    paris_points,
    write_page,
    write_report,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from selenium.webdriver import Chrome

    from semsig_gis.evaluation import Evaluation
    from semsig_gis.output import Section

CITY = random_town().database


@functools.cache
def by_distance() -> Evaluation:
    return evaluate(CITY, queries=60, method=Method.parse("edit+edit:5%"))


@functools.cache
def by_likelihood() -> Evaluation:
    return evaluate(CITY, queries=60, method=build_index(CITY, named_noise("generic")))


def sections(evaluation: object) -> dict[str, Section]:
    page = evaluation_page(evaluation, CITY, name="town")  # type: ignore[arg-type]
    return {section.name: section for section in page.sections}


@pytest.mark.parametrize(
    ("near", "chance", "top", "text"),
    [
        (0.824, None, 1, "Of 60 views, 82 % were placed within 50 m (95 %: 71 to 90 %)."),
        (0.083, None, 1, "Of 60 views, 8.3 % were placed within 50 m (95 %: 3.6 to 18 %)."),
        (1.0, None, 5, "Of 60 views, 100 % were placed within 50 m by the best of 5 candidates "),
        (
            0.5,
            0.95,
            1,
            "; the method answers 100 % of them, and when it answers, it is right in 75 %.",
        ),
        (0.5, 0.1, 1, "; the method was not sure enough to answer any of them."),
    ],
)
def test_headline_of_an_evaluation(near: float, chance: float | None, top: int, text: str) -> None:
    columns = {"chance": np.nan if chance is None else chance, "right": 0.75}
    queries = by_distance().queries.assign(p50=near, **columns)
    assert text in evaluation_headline(replace(by_distance(), queries=queries, top=top))


@pytest.mark.parametrize("run", [by_distance, by_likelihood])
def test_curves_and_numbers_agree_with_the_evaluation(run: Callable[[], Evaluation]) -> None:
    evaluation = run()
    page = sections(evaluation)
    errors, groups = page["errors"], page["groups"]
    (curve,) = errors.plots[0].curves
    assert errors.plots[0].log
    shares = dict(zip(curve.x, curve.y, strict=True))
    assert shares[50.0] == pytest.approx(evaluation.cdf([50])[0])
    bands = zip(curve.low, curve.y, curve.high, strict=True)
    assert all(low <= y <= high for low, y, high in bands)
    shown = {number.row: number for number in errors.numbers}
    means = evaluation.means()
    assert shown["Placed within 50 m"].ours == means["value"]["p50"]
    assert shown["True cell in the best 10 %"].high == means["high"]["recall10"]
    counts = [number.ours or 0 for number in groups.numbers if number.column == "queries"]
    assert sum(counts) == 2 * 60  # by objects seen, and by equal cells
    for plot, table in zip(
        groups.plots, (evaluation.by_length(), evaluation.by_ambiguity()), strict=True
    ):
        assert [name for _, name in plot.ticks] == table.iloc[:, 0].tolist()
        successes = table["p50"].dropna()
        assert plot.curves[0].x == tuple(map(float, successes.index))
        assert plot.curves[0].y == tuple(successes)
    assert errors.maps[0].successful.sum() == evaluation.successful.sum()
    assert [len(pair.scenes) for pair in page["failures"].pairs] == [2] * 6


def test_figures_of_the_paper_are_shown_for_the_same_settings() -> None:
    (plot,) = sections(by_distance())["errors"].plots
    assert [point[:2] for point in plot.paper] == [(50.0, 0.3733)]
    shown = {number.row: number.paper for number in sections(by_distance())["errors"].numbers}
    assert (shown["Placed within 50 m"], shown["True cell in the best 10 %"]) == (0.3733, 0.6462)
    assert sections(by_likelihood())["errors"].plots[0].paper == ()


@pytest.mark.parametrize(
    ("distortions", "point"),
    [
        ("light:resort=false", [(10.0, 0.70)]),
        ("strong:false_class=frequency", [(10.0, 0.25)]),
        ("strong:bearing_sigma=1", []),
        ("light, view:90", []),
    ],
)
def test_points_of_the_paper_need_its_distortion(
    distortions: str, point: list[tuple[float, float]]
) -> None:
    spec = replace(by_distance().asked, distortions=parse_chain(distortions))
    points = paris_points(replace(by_distance(), asked=spec))
    assert [(x, y) for x, y, _ in points] == point


def test_section_of_chances_needs_a_method_with_chances() -> None:
    assert "chances" not in sections(by_distance())
    chances = sections(by_likelihood())["chances"]
    calibration, coverage = chances.plots
    assert calibration.diagonal
    bins = by_likelihood().calibration().dropna(subset="true")
    assert calibration.curves[0].y == tuple(bins["true"])
    answered, right = coverage.curves
    assert answered.y[0] == pytest.approx(by_likelihood().queries["chance"].notna().mean())
    assert len(right.y) == len(answered.y)


def test_report_of_empty_queries_has_no_failures() -> None:
    queries = by_likelihood().queries.assign(
        query_length=0, error_m=np.inf, chance=np.nan, right=np.nan, best_cell_id=None
    )
    page = evaluation_page(replace(by_likelihood(), queries=queries), CITY, name="town")
    assert "Of 60 the distortion left nothing" in page.sections[0].text[0]
    assert "failures" not in [section.name for section in page.sections]


def test_report_with_another_database_is_refused() -> None:
    with refused(InputError, "searched", "give the database"):
        evaluation_page(by_distance(), CITY.select(slice(5)), name="town")


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the HTML file of the report of an evaluation."""
    page = evaluation_page(by_likelihood(), CITY, name="town <1>", command="semsig evaluate 'a b'")
    file = tmp_path_factory.mktemp("page") / "report.html"
    write_page(page, file)
    return file


def test_page_has_all_texts_and_loads_no_files(page_file: Path) -> None:
    page = HtmlPage(page_file.read_text("utf-8"))
    assert all(address.startswith("data:") for address in page.loaded)
    headline = evaluation_headline(by_likelihood())
    for text in ("town <1>", headline, "semsig evaluate 'a b'", "processors"):
        assert text in page.text


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (390, 844)])
def test_page_fits_the_screen_of_a_browser(
    browser: Chrome, page_file: Path, width: int, height: int
) -> None:
    shown = MapPage(browser, page_file.parent)
    with shown.screen(width, height, mobile=width < 500):
        browser.get(page_file.as_uri())
        images = shown.all("img")
        assert len(images) == 1 + 1 + 2 + 2 + 12
        assert all(image.get_attribute("alt") for image in images)
        first = browser.execute_script(
            "return document.querySelector('.headline').getBoundingClientRect().bottom"
        )
        assert first < height
        overflow = "return document.documentElement.scrollWidth - window.innerWidth"
        assert browser.execute_script(overflow) <= 0
        names = "return performance.getEntriesByType('resource').map((entry) => entry.name)"
        assert all(name.startswith("data:") for name in browser.execute_script(names))
        assert_quiet(browser)
        assert Axe().run(browser)["violations"] == []


def test_every_form_of_the_report_names_the_sources_of_the_data(tmp_path: Path) -> None:
    report = evaluation_page(by_distance(), CITY, name="town")
    assert CITY.licenses == ("World (CC0): world",)
    write_report(report, tmp_path)
    for name in ("report.html", "report.md", "report.json"):
        assert "World (CC0): world" in (tmp_path / name).read_text("utf-8")
    assert "Sources of the data" in (tmp_path / "report.html").read_text("utf-8")
