"""Pages and files of a report, also in a browser and with hostile texts."""

from __future__ import annotations

import csv
import functools
import io
import json
import math
import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from html_pages import HtmlPage
from hypothesis import given, settings
from hypothesis import strategies as st
from map_pages import HOSTILE, MapPage, assert_quiet
from PIL import Image
from reports import HARM, LONG, hostile_report, ordinary_report, plot, report, scene
from sentences import refused

from semsig_gis import __version__
from semsig_gis.core import InputError, one_line
from semsig_gis.output import Number, Section, html_page, markdown_page, write_page, write_report

if TYPE_CHECKING:
    from collections.abc import Callable

    from selenium.webdriver import Chrome


FLOATS = st.none() | st.floats()
TEXTS = st.text(max_size=20) | st.sampled_from(["=1+1", "\t@a", "+", "-2", "a,b", 'a"b', "a\nb"])


@pytest.fixture(scope="module")
def report_folder(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return a function for the folder of a report with a hostile text, or with none if empty."""

    @functools.cache
    def folder(harm: str) -> Path:
        path = tmp_path_factory.mktemp("report")
        write_report(hostile_report(harm) if harm else ordinary_report(), path)
        return path

    return folder


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def rows(text: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text.decode("utf-8"), newline="")))


def strict(text: bytes) -> Any:  # noqa: ANN401
    """Read JSON without NaN and Infinity, which only some readers accept."""

    def refuse(constant: str) -> None:
        pytest.fail(f"{constant} is not JSON")

    return json.loads(text, parse_constant=refuse)


def harmless_page(text: str) -> HtmlPage:
    """Return a page, which must load no files and run no scripts."""
    page = HtmlPage(text)
    assert all(address.startswith("data:") for address in page.loaded)
    assert page.tags.isdisjoint({"script", "iframe", "object", "svg", "base", "form"})
    assert not re.search(r"url\(|@import", text.partition("</style>")[0])
    assert "default-src 'none'" in text
    assert "\u202e" not in text
    return page


def test_files_of_a_report_match_their_snapshots(
    report_folder: Callable[[str], Path], tmp_path: Path, snapshot: Callable[[str, str], None]
) -> None:
    write_report(ordinary_report(), tmp_path / "new" / "folder")
    files = contents(tmp_path / "new" / "folder")
    assert files == contents(report_folder(""))
    texts = {"numbers.csv", "figures/errors.csv", "report.json", "report.md"}
    for name in texts:
        text = files[name].decode().replace(__version__, "VERSION")
        snapshot(f"ordinary-{Path(name).name}", text)
    names = ("errors", "place", "other", "where", "true", "taken")
    figures = {f"figures/{name}.{kind}" for name in names for kind in ("png", "svg")}
    assert set(files) == texts | figures | {"report.html"}
    page = harmless_page(files["report.html"].decode())
    for text in ("Report", "What it is.", "city.parquet", "Range", "0.2100", "0.1793", "infinite",
                 "Half of it.", "Two lamps.", "semsig evaluate city.parquet"):  # fmt: skip
        assert text in page.text
    svgs = [address.startswith("data:image/svg+xml;base64,") for address in page.loaded]
    assert sum(svgs) == len(names)
    assert all(name.encode() in files["report.html"] for name in figures)


@pytest.mark.parametrize("harm", [HARM, LONG, "\ud83d"])
def test_files_with_hostile_texts_are_harmless(
    harm: str, report_folder: Callable[[str], Path]
) -> None:
    files = contents(report_folder(harm))
    harmless_page(files["report.html"].decode())
    assert strict(files["report.json"])["title"] == harm
    assert len(rows(files["numbers.csv"])) == 3
    for name, content in files.items():
        if name.endswith(".csv"):
            cells = [cell for line in csv.reader(io.StringIO(content.decode())) for cell in line]
            assert not any(cell.startswith("=") for cell in cells)


def test_single_page_has_no_links_to_files(tmp_path: Path) -> None:
    write_page(ordinary_report(), tmp_path / "page.html")
    assert list(contents(tmp_path)) == ["page.html"]
    text = (tmp_path / "page.html").read_text("utf-8")
    assert 'href="figures' not in text
    assert "numbers.csv" not in text
    assert "0.1793" in harmless_page(text).text


def test_special_characters_are_shown_unchanged() -> None:
    text = 'a < b & "c" {{ 7 * 7 }} {% raw %} it\'s'
    page = html_page(report(Section(name="a", title=text), title=text), {})
    assert HtmlPage(page).text.count(text) == 4  # title, heading, contents, section


def test_too_wide_table_has_joined_rows() -> None:
    wide = [
        Number(row, f"column {column}", 0.5, low=0.4, high=0.6, paper=0.5)
        for column in range(5)
        for row in map(str, range(10))
    ]
    text = html_page(report(Section(name="a", title="A", numbers=tuple(wide))), {})
    HtmlPage(text)
    assert text.count('rowspan="5"') == 10
    assert 'class="numbers long"' in text


@pytest.mark.parametrize("harm", [HARM, LONG])
def test_markdown_escapes_hostile_texts(harm: str, report_folder: Callable[[str], Path]) -> None:
    text = (report_folder(harm) / "report.md").read_bytes().decode()
    # No markup of the data remains: no HTML, images, code, emphasis, tables or formulas.
    assert "<" not in text
    bare = re.sub(r"\\.", "", text.replace("![", "").replace("](figures/", ""))
    assert not set(bare) & set("`[]{}~$_\0\r\u202e")
    lines = [re.sub(r"\\.", "", line).count("|") for line in text.splitlines() if line[0:1] == "|"]
    assert lines == [lines[0]] * 5 + [3] * 3
    assert len(text.splitlines()) == len([*text.split("\n")]) - 1
    headings = [line for line in text.splitlines() if line.startswith("#")]
    assert len(headings) == 4


def test_markdown_escapes_the_start_of_a_paragraph() -> None:
    paragraphs = ("- not a list", "1. nor this", "# nor a heading", "+1", "0.5 m")
    lines = markdown_page(report(text=paragraphs), {}).splitlines()[2::2]
    assert lines == ["\\- not a list", "1\\. nor this", "\\# nor a heading", "\\+1", "0\\.5 m"]


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
def test_csv_and_json_have_every_number(numbers: list[Number]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        write_report(report(Section(name="a", title="A", numbers=tuple(numbers))), folder)
        files = contents(Path(folder))
    table = rows(files["numbers.csv"])
    members = strict(files["report.json"])["sections"][0]["numbers"]
    for number, row, plain in zip(numbers, table, members, strict=True):
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


def test_other_files_of_the_folder_are_unchanged(tmp_path: Path) -> None:
    for name in ("mine.txt", "report.md"):
        (tmp_path / name).write_text("mine")
    write_report(report(), tmp_path)
    files = contents(tmp_path)
    assert files["mine.txt"] == b"mine" != files["report.md"]
    assert files["numbers.csv"].count(b"\n") == 1
    assert not list(tmp_path.rglob(".semsig-*"))
    with refused(InputError, "mine.txt"):
        write_report(report(), tmp_path / "mine.txt")


BAD_NAMES = ["", "../up", "a b", "a.b", "a/b", "é", "a\n"]


@pytest.mark.parametrize(
    ("sections", "word"),
    [
        *(([Section(name=name, title="A")], "name") for name in BAD_NAMES),
        *(([Section(name="a", title="A", plots=(plot(name),))], "name") for name in BAD_NAMES),
        *(([Section(name="a", title="A", scenes=(scene(name),))], "name") for name in BAD_NAMES),
        ([Section(name="a", title="A", plots=(plot("one"),), scenes=(scene("One"),))], "twice"),
        ([Section(name="b", title="B"), Section(name="B", title="B")], "twice"),
    ],
)
def test_invalid_and_repeated_names_are_refused(
    sections: list[Section], word: str, tmp_path: Path
) -> None:
    with refused(InputError, word):
        write_report(report(*sections), tmp_path / "out")
    assert contents(tmp_path) == {}


@pytest.fixture
def page(browser: Chrome, tmp_path: Path) -> MapPage:
    """Return the page of a browser."""
    return MapPage(browser, tmp_path)


def assert_shows_pictures(page: MapPage, count: int) -> None:
    """Check that a page shows its pictures, reports no error and uses no network."""
    browser = page.browser
    images = page.all("img")
    assert len(images) == count
    for image in images:
        assert browser.execute_script("return arguments[0].naturalWidth", image) > 100
    names = browser.execute_script(
        "return performance.getEntriesByType('resource').map((entry) => entry.name)"
    )
    assert [name for name in names if not name.startswith("data:")] == []
    browser.execute_script("performance.clearResourceTimings()")
    assert_quiet(browser)


@pytest.mark.parametrize("width", [1400, 400])
def test_page_fits_the_screen_of_a_browser(
    page: MapPage, width: int, report_folder: Callable[[str], Path]
) -> None:
    with page.screen(width, 900, mobile=width < 500):
        page.browser.get((report_folder("") / "report.html").as_uri())
        assert page.browser.title == "Report"
        assert max(image.size["width"] for image in page.all("figure img")) <= width
        overflow = "return document.documentElement.scrollWidth - window.innerWidth"
        assert page.browser.execute_script(overflow) <= 0
        assert_shows_pictures(page, 6)


def test_page_follows_the_preferred_colour_scheme(
    page: MapPage, report_folder: Callable[[str], Path]
) -> None:
    for mode, most in (("light", 256), ("dark", 90)):
        preference = {"features": [{"name": "prefers-color-scheme", "value": mode}]}
        page.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", preference)
        page.browser.get((report_folder("") / "report.html").as_uri())
        for image in page.all("img"):
            pixels = np.asarray(Image.open(io.BytesIO(image.screenshot_as_png)).convert("L"))
            assert most - 90 < np.median(pixels) < most
    page.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


@pytest.mark.parametrize(("width", "media"), [(900, "screen"), (680, "print")])  # width of A4
def test_tables_fit_a_screen_and_a_sheet(page: MapPage, width: int, media: str) -> None:
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
    file = page.folder / "report.html"
    file.write_text(html_page(report(*tables), {}), encoding="utf-8")
    with page.screen(width, 900, mobile=False, media=media):
        page.browser.get(file.as_uri())
        assert len(page.all("tbody tr")) == 4
        for table in page.all(".wide table"):
            room = page.browser.execute_script("return arguments[0].parentNode.clientWidth", table)
            assert table.size["width"] <= room


@pytest.mark.parametrize("harm", [HARM, LONG])
def test_browser_runs_no_hostile_texts(
    page: MapPage, harm: str, report_folder: Callable[[str], Path]
) -> None:
    page.browser.get((report_folder(harm) / "report.html").as_uri())
    assert page.all("script") == []
    assert one_line(HOSTILE) in page.browser.execute_script("return document.body.textContent")
    assert_shows_pictures(page, 5)
    page.browser.get((report_folder(harm) / "figures" / "errors.svg").as_uri())
    assert page.all("script") == []
