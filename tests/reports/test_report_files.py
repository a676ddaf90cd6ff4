"""Tests of semsig_gis.reports.page."""

from __future__ import annotations

import csv
import io
import json
import math
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reports import LONG, hostile_report, ordinary_report, plot, report, scene
from sentences import assert_sentence

from semsig_gis.core.errors import InputError
from semsig_gis.core.text import one_line
from semsig_gis.reports.page import write_report
from semsig_gis.reports.parts import Number, Section

if TYPE_CHECKING:
    from semsig_gis.reports.parts import Report

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


def test_a_report_of_nothing(tmp_path: Path) -> None:
    write_report(report(), tmp_path)
    assert contents(tmp_path)["numbers.csv"].count(b"\n") == 1


def test_other_files_of_the_folder_are_left_alone(tmp_path: Path) -> None:
    for name in ("mine.txt", "report.md"):
        (tmp_path / name).write_text("mine")
    write_report(ordinary_report(), tmp_path)
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert (tmp_path / "report.md").read_text() != "mine"
    assert not list(tmp_path.rglob(".semsig-*"))


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError) as caught:
        write_report(ordinary_report(), tmp_path / "file")
    assert_sentence(caught.value, "file")


@pytest.mark.parametrize("name", ["", "../up", "a b", "a.b", "a/b", "é", "a\n"])
def test_names_that_no_file_can_have(name: str, tmp_path: Path) -> None:
    for one in (
        report(Section(name="a", title="A", plots=(plot(name),))),
        report(Section(name="a", title="A", scenes=(scene(name),))),
        report(Section(name=name, title="A")),
    ):
        with pytest.raises(InputError) as caught:
            write_report(one, tmp_path / "out")
        assert_sentence(caught.value, "name")
    assert contents(tmp_path) == {}


def test_names_that_stand_twice(tmp_path: Path) -> None:
    section = Section(name="a", title="A", plots=(plot("one"),), scenes=(scene("One"),))
    for one in (
        report(section),
        report(Section(name="b", title="B"), Section(name="B", title="B")),
    ):
        with pytest.raises(InputError) as caught:
            write_report(one, tmp_path / "out")
        assert_sentence(caught.value, "twice")
