"""Pages and files of a report: in a real browser, and with text that tries to do harm."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
import re
import tempfile
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from map_pages import HOSTILE, assert_quiet
from reports import HARM, LONG, hostile_report, ordinary_report, plot, report, scene
from selenium.webdriver.common.by import By
from sentences import refused

from semsig_gis.core.errors import InputError
from semsig_gis.core.text import one_line
from semsig_gis.reports.page import html_page, markdown_page, write_report
from semsig_gis.reports.parts import Number, Section
from semsig_gis.reports.plots import Picture

if TYPE_CHECKING:
    from collections.abc import Iterator

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


@contextlib.contextmanager
def screen(browser: Chrome, width: int, media: str = "") -> Iterator[None]:
    """Let a browser have a screen or a sheet of some width."""
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": media})
    try:
        yield
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


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
        Number(row, f"column {column}", 0.5, low=0.4, high=0.6, paper=0.5)
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
    with screen(browser, width):
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


@pytest.mark.parametrize(("width", "media"), [(900, "screen"), (680, "print")])  # A4 has 680
def test_tables_fit_a_screen_and_a_sheet(
    browser: Chrome, tmp_path: Path, width: int, media: str
) -> None:
    times = [
        Number(f"{row} distance", column, 61.2, paper=1850.0, unit="ms", decimals=1)
        for row in ("Jaccard", "Histogram", "Edit")
        for column in ("type", "angle", "type + angle, 5 %")
    ]
    many = [
        Number("edit + edit (0.5, 0.5), 5 %", f"P(error <= {metres} m)", 0.5) for metres in range(6)
    ]
    tables = [
        Section(name=name, title=name, numbers=tuple(numbers))
        for name, numbers in (("times", times), ("many", many))
    ]
    file = tmp_path / "report.html"
    file.write_text(html_page(report(*tables), {}), encoding="utf-8")
    with screen(browser, width, media):
        browser.get(file.as_uri())
        assert len(browser.find_elements(By.CSS_SELECTOR, "tbody tr")) == 4
        for table in browser.find_elements(By.CSS_SELECTOR, ".wide table"):
            room = browser.execute_script("return arguments[0].parentNode.clientWidth", table)
            assert table.size["width"] <= room


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


FLOATS = st.none() | st.floats()
TEXTS = st.text(max_size=20) | st.sampled_from(["=1+1", "\t@a", "+", "-2", "a,b", 'a"b', "a\nb"])


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder).as_posix()): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def rows(text: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text.decode("utf-8"), newline="")))


def strict(text: bytes) -> Any:  # noqa: ANN401
    """Read JSON without the words that only some readers know."""

    def refuse(word: str) -> None:
        pytest.fail(f"{word} is not JSON")

    return json.loads(text, parse_constant=refuse)


def test_what_is_written(tmp_path: Path) -> None:
    write_report(ordinary_report(), tmp_path / "new" / "folder")
    files = contents(tmp_path / "new" / "folder")
    figures = [
        f"figures/{name}.{kind}" for name in ("errors", "place", "other") for kind in ("png", "svg")
    ]
    assert set(files) == {
        "figures/errors.csv",
        "numbers.csv",
        "report.html",
        "report.json",
        "report.md",
        *figures,
    }
    for name in figures:
        assert name.encode() in files["report.html"]
        if name.endswith("svg"):
            assert f"]({name})".encode() in files["report.md"]
    told = strict(files["report.json"])
    assert told["title"] == "Report"
    assert told["settings"] == [{"name": "Database", "value": "city.parquet"}]
    assert told["facts"] == {"versions": {"numpy": "2"}, "share": None}
    assert told["classes"][0]["name"] == "alignment_tree"
    assert told["sections"][1]["scenes"][1]["answer"] == [9.0, 2.0]


def test_the_same_report_is_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_report(ordinary_report(), tmp_path / name)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_points_of_a_plot(tmp_path: Path) -> None:
    drawn = plot(paper=((5.0, 0.5, "Table 5"),))
    write_report(report(Section(name="a", title="A", plots=(drawn,))), tmp_path)
    found = rows(contents(tmp_path)["figures/errors.csv"])
    points = [
        (curve.label, *map(repr, point))
        for curve in drawn.curves
        for point in zip(curve.x, curve.y, curve.low, curve.high, strict=True)
    ]
    assert [(row["label"], row["x"], row["y"], row["low"], row["high"]) for row in found] == [
        *points,
        ("Table 5", "5.0", "0.5", "", ""),
    ]
    assert [row["source"] for row in found] == ["ours"] * 60 + ["paper"]


@settings(max_examples=40)
@given(
    st.lists(
        st.builds(
            Number,
            row=TEXTS,
            column=TEXTS,
            ours=FLOATS,
            low=FLOATS,
            high=FLOATS,
            paper=FLOATS,
            unit=TEXTS,
            decimals=st.integers(0, 6),
        ),
        max_size=6,
    )
)
def test_every_number_is_written(numbers: list[Number]) -> None:
    given = report(Section(name="a", title="A", numbers=tuple(numbers)))
    with tempfile.TemporaryDirectory() as folder:
        write_report(given, folder)
        files = contents(Path(folder))
    table, told = rows(files["numbers.csv"]), strict(files["report.json"])["sections"][0]["numbers"]
    assert len(table) == len(told) == len(numbers)
    for number, row, plain in zip(numbers, table, told, strict=True):
        for name in ("ours", "low", "high", "paper", "difference"):
            value = getattr(number, name)
            assert row[name] == ("" if value is None else repr(value))
            finite = value is not None and math.isfinite(value)
            assert plain[name] == (value if finite else None)
        for name in ("row", "column", "unit"):
            text = getattr(number, name)
            assert plain[name] == text
            assert row[name].removeprefix("'") == one_line(text).removeprefix("'")
            assert not row[name].startswith(("=", "+", "-", "@"))


@pytest.mark.parametrize(
    "given", [hostile_report(), hostile_report(LONG), hostile_report("\ud83d")]
)
def test_text_from_data_breaks_nothing(given: Report, tmp_path: Path) -> None:
    write_report(given, tmp_path)
    files = contents(tmp_path)
    assert strict(files["report.json"])["title"] == given.title
    assert len(rows(files["numbers.csv"])) == 3
    for name, content in files.items():
        if name.endswith(".csv"):
            cells = [cell for line in csv.reader(io.StringIO(content.decode())) for cell in line]
            assert not any(cell.startswith("=") for cell in cells)


def test_other_files_of_the_folder_are_left_alone(tmp_path: Path) -> None:
    for name in ("mine.txt", "report.md"):
        (tmp_path / name).write_text("mine")
    write_report(report(), tmp_path)
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert (tmp_path / "report.md").read_text() != "mine"
    assert (tmp_path / "numbers.csv").read_bytes().count(b"\n") == 1
    assert not list(tmp_path.rglob(".semsig-*"))


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with refused(InputError, "file"):
        write_report(ordinary_report(), tmp_path / "file")


@pytest.mark.parametrize("name", ["", "../up", "a b", "a.b", "a/b", "é", "a\n"])
def test_names_that_no_file_can_have(name: str, tmp_path: Path) -> None:
    for one in (
        report(Section(name="a", title="A", plots=(plot(name),))),
        report(Section(name="a", title="A", scenes=(scene(name),))),
        report(Section(name=name, title="A")),
    ):
        with refused(InputError, "name"):
            write_report(one, tmp_path / "out")
    assert contents(tmp_path) == {}


def test_names_that_stand_twice(tmp_path: Path) -> None:
    section = Section(name="a", title="A", plots=(plot("one"),), scenes=(scene("One"),))
    for one in (
        report(section),
        report(Section(name="b", title="B"), Section(name="B", title="B")),
    ):
        with refused(InputError, "twice"):
            write_report(one, tmp_path / "out")
