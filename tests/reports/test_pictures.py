"""Tests of semsig_gis.reports.plots."""

from __future__ import annotations

import struct
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING

import matplotlib as mpl
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from matplotlib.lines import Line2D
from reports import texts

from semsig_gis.reports.plots import COLOURS, blank_figure, draw_legend, label, saved

if TYPE_CHECKING:
    from semsig_gis.reports.plots import Picture


def picture(text: str, *, title: str = "A title") -> Picture:
    with blank_figure(3, 2) as figure:
        figure.text(0.1, 0.5, label(text, 40))
        return saved(figure, title=title, description="what is seen")


def test_a_picture_says_what_it_shows() -> None:
    made = picture("words", title="A < B\n& C")
    root = ET.fromstring(made.svg)  # noqa: S314
    assert root.attrib["role"] == "img"
    assert [child.text for child in root[:2]] == ["A < B & C", "what is seen"]
    assert texts(made.svg) == ["words"]
    assert made.description == "what is seen"
    assert made._repr_svg_().encode() == made.svg  # what a notebook shows
    assert struct.unpack(">II", made.png[16:24]) == (600, 400)


def test_a_picture_names_no_program_no_date_and_no_address() -> None:
    made = picture("words")
    assert b"atplotlib" not in made.svg + made.png
    assert b"DOCTYPE" not in made.svg
    namespaces = {b"http://www.w3.org/2000/svg", b"http://www.w3.org/1999/xlink"}
    found = {part.partition(b'"')[0] for part in made.svg.split(b'"')[1::2] if b"://" in part}
    assert found <= namespaces


def test_settings_of_a_user_are_neither_used_nor_changed() -> None:
    before = picture("words")
    with mpl.rc_context({"font.size": 30, "svg.fonttype": "path", "savefig.facecolor": "red"}):
        mine = dict(mpl.rcParams)
        assert picture("words") == before
        assert dict(mpl.rcParams) == mine


@pytest.mark.parametrize(
    "text", ["$\\frac{", "a$b$c", "\u4e2d\u6587", "\U0001f333", "<script>&amp;", "\\", "{x}", "%s"]
)
def test_text_is_drawn_as_it_is(text: str) -> None:
    assert texts(picture(text).svg) == [text]


@given(st.text(max_size=30), st.integers(1, 20))
@example("0 \x1b\r0", 4)
def test_a_label_fits(text: str, length: int) -> None:
    cut = label(text, length)
    assert len(cut) <= length
    assert cut == label(cut, length)
    assert cut == label(text, 1000) or cut.endswith("…")


def test_wide_letters_count_twice() -> None:
    assert label("\u4e2d\u6587\u6a39", 6) == "\u4e2d\u6587\u6a39"
    assert label("\u4e2d\u6587\u6a39", 5) == "\u4e2d\u6587…"
    assert label("\u4e2d\u6587\u6a39", 4) == "\u4e2d…"


def test_a_legend_shows_every_key_in_columns() -> None:
    keys = [(Line2D([], [], color=colour), f"_{colour}") for colour in COLOURS]
    with blank_figure(6, 2) as figure:
        draw_legend(figure, keys, place=(0, 1, 1), columns=4, size=8, sign_width=2)
        shown = [
            [text.get_text().strip() for text in legend.get_texts()] for legend in figure.legends
        ]
    assert sum(shown, []) == [text for _, text in keys]  # noqa: RUF017 - a few
    assert [len(column) for column in shown] == [3, 3, 3]


def test_colours_differ() -> None:
    assert len(set(COLOURS)) == len(COLOURS)
