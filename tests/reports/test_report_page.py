"""Pages of a report: in a real browser, and with text that tries to do harm."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from typing import TYPE_CHECKING

import pytest
from map_pages import HOSTILE, assert_quiet
from reports import HARM, LONG, hostile_report, ordinary_report, report
from selenium.webdriver.common.by import By

from semsig_gis.core.text import one_line
from semsig_gis.reports.page import html_page, markdown_page, write_report
from semsig_gis.reports.parts import Number, Section
from semsig_gis.reports.plots import Picture

if TYPE_CHECKING:
    from pathlib import Path

    from selenium.webdriver import Chrome

    from semsig_gis.reports.parts import Report

VOID = {"br", "img", "link", "meta"}


class Page(HTMLParser):
    """Elements of a page, whose nesting must be right, and what they would load."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: set[str] = set()
        self.loaded: list[str] = []
        self.text = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        assert not any(name.startswith("on") for name, _ in attrs)
        self.loaded += [
            value or ""
            for name, value in attrs
            if name in {"src", "srcset", "data", "poster"} or (tag == "link" and name == "href")
        ]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def pictures(given: Report) -> dict[str, Picture]:
    parts = [part for section in given.sections for part in section.drawn]
    return {part.name: Picture(b"<svg/>", b"", f"what {part.title} shows") for part in parts}


def test_a_page_holds_everything() -> None:
    given = ordinary_report()
    page = Page(html_page(given, pictures(given)))
    for text in ("Report", "What it is.", "city.parquet", "Range", "0.2100", "0.1793", "infinite"):
        assert text in page.text
    assert sum(one.startswith("data:image/svg+xml;base64,") for one in page.loaded) == 3


@pytest.mark.parametrize("given", [ordinary_report(), hostile_report(), hostile_report(LONG)])
def test_a_page_loads_nothing_and_runs_nothing(given: Report) -> None:
    text = html_page(given, pictures(given))
    page = Page(text)
    assert all(one.startswith("data:") for one in page.loaded)
    assert page.tags.isdisjoint({"script", "iframe", "object", "svg", "base", "form"})
    assert not re.search(r"url\(|@import", text.partition("</style>")[0])
    assert "default-src 'none'" in text
    assert "\u202e" not in text


def test_text_is_shown_as_it_is() -> None:
    text = 'a < b & "c" {{ 7 * 7 }} {% raw %} it\'s'
    given = report(Section(name="a", title=text), title=text)
    assert Page(html_page(given, {})).text.count(text) == 4  # title, heading, contents, section


def test_wide_and_long_tables() -> None:
    wide = [
        Number(row=row, column=f"column {column}", ours=0.5, low=0.4, high=0.6, paper=0.5)
        for column in range(5)
        for row in map(str, range(10))
    ]
    text = html_page(report(Section(name="a", title="A", numbers=tuple(wide))), {})
    Page(text)
    assert text.count('rowspan="5"') == 10
    assert 'class="numbers long"' in text


def test_markdown_holds_everything() -> None:
    given = ordinary_report()
    text = markdown_page(given, pictures(given))
    assert text.startswith("# Report\n\nWhat it is.\n\n| Setting | Value |\n")
    assert "| R = 20 m | 0.2100 (0.2000 to 0.2200) | 0.1793 | **+0.0307** |" in text
    assert "![what Errors shows](figures/errors.svg)" in text
    assert "![what A place shows](figures/other.svg)" in text


@pytest.mark.parametrize("harm", [HARM, LONG])
def test_markdown_keeps_its_shape(harm: str) -> None:
    given = hostile_report(harm)
    text = markdown_page(given, pictures(given))
    # No mark of the data's own is left: not of HTML, images, code, emphasis, tables or formulas.
    assert "<" not in text
    bare = re.sub(r"\\.", "", text.replace("![", "").replace("](figures/", ""))
    assert not set(bare) & set("`[]{}~$_\0\r\u202e")
    rows = [re.sub(r"\\.", "", line).count("|") for line in text.splitlines() if line[0:1] == "|"]
    assert rows == [3] * 3 + [rows[3]] * 5
    assert len(text.splitlines()) == len([*text.split("\n")]) - 1
    headings = [line for line in text.splitlines() if line.startswith("#")]
    assert len(headings) == 2


def test_markdown_begins_no_list_by_chance() -> None:
    given = report(text=("- not a list", "1. nor this", "# nor a heading", "+1", "0.5 m"))
    lines = markdown_page(given, {}).splitlines()[2::2]
    assert lines == ["\\- not a list", "1\\. nor this", "\\# nor a heading", "\\+1", "0\\.5 m"]


@pytest.mark.parametrize("width", [1400, 400])
def test_a_page_in_a_browser(browser: Chrome, tmp_path: Path, width: int) -> None:
    write_report(ordinary_report(), tmp_path)
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        browser.get((tmp_path / "report.html").as_uri())
        assert browser.title == "Report"
        images = browser.find_elements(By.CSS_SELECTOR, "figure img")
        assert len(images) == 3
        for image in images:
            assert browser.execute_script("return arguments[0].naturalWidth", image) > 100
            assert image.size["width"] <= width
        overflow = "return document.documentElement.scrollWidth - window.innerWidth"
        assert browser.execute_script(overflow) <= 0
        assert_asked_for_pictures_only(browser)
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


@pytest.mark.parametrize(("width", "media"), [(900, "screen"), (680, "print")])  # A4 has 680
def test_tables_fit_a_screen_and_a_sheet(
    browser: Chrome, tmp_path: Path, width: int, media: str
) -> None:
    times = [
        Number(row=f"{row} distance", column=column, ours=61.2, paper=1850.0, unit="ms", decimals=1)
        for row in ("Jaccard", "Histogram", "Edit")
        for column in ("type", "angle", "type + angle, 5 %")
    ]
    many = [
        Number(row="edit + edit (0.5, 0.5), 5 %", column=f"P(error <= {metres} m)", ours=0.5)
        for metres in range(6)
    ]
    tables = [
        Section(name=name, title=name, numbers=tuple(numbers))
        for name, numbers in (("times", times), ("many", many))
    ]
    file = tmp_path / "report.html"
    file.write_text(html_page(report(*tables), {}), encoding="utf-8")
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": media})
    try:
        browser.get(file.as_uri())
        assert len(browser.find_elements(By.CSS_SELECTOR, "tbody tr")) == 4
        for table in browser.find_elements(By.CSS_SELECTOR, ".wide table"):
            room = browser.execute_script("return arguments[0].parentNode.clientWidth", table)
            assert table.size["width"] <= room
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


@pytest.mark.parametrize("harm", [HARM, LONG])
def test_harm_in_a_browser(browser: Chrome, tmp_path: Path, harm: str) -> None:
    write_report(hostile_report(harm), tmp_path)
    browser.get((tmp_path / "report.html").as_uri())
    assert browser.find_elements(By.CSS_SELECTOR, "script") == []
    assert one_line(HOSTILE) in browser.execute_script("return document.body.textContent")
    for image in browser.find_elements(By.CSS_SELECTOR, "img"):
        assert browser.execute_script("return arguments[0].naturalWidth", image) > 100
    assert_asked_for_pictures_only(browser)
    browser.get((tmp_path / "figures" / "errors.svg").as_uri())
    assert browser.find_elements(By.CSS_SELECTOR, "script") == []


def assert_asked_for_pictures_only(browser: Chrome) -> None:
    """Check that the page reported no error and asked the network for nothing."""
    names = browser.execute_script(
        "return performance.getEntriesByType('resource').map((entry) => entry.name)"
    )
    assert [name for name in names if not name.startswith("data:")] == []
    browser.execute_script("performance.clearResourceTimings()")
    assert_quiet(browser)
