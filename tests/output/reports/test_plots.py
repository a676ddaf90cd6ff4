from __future__ import annotations

import dataclasses
import re
import struct
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from matplotlib.lines import Line2D
from reports import HARM, LONG, plot, texts

from semsig_gis.output import (
    COLOURS,
    DARK,
    GRID,
    GROUND,
    INK,
    Curve,
    Plot,
    blank_figure,
    draw_curve,
    draw_legend,
    draw_plot,
    in_the_dark,
    label,
    saved,
)
from semsig_gis.output.figures.plots import _line_options

if TYPE_CHECKING:
    from semsig_gis.output import Picture


def picture(text: str, *, title: str = "A title") -> Picture:
    with blank_figure(3, 2) as figure:
        figure.text(0.1, 0.5, label(text, 40))
        return saved(figure, title=title, description="what is seen")


def test_picture_has_title_description_and_text() -> None:
    drawing = picture("words", title="A < B\n& C")
    root = ET.fromstring(drawing.svg)  # noqa: S314
    assert root.attrib["role"] == "img"
    assert [child.text for child in root[:2]] == ["A < B & C", "what is seen"]
    assert texts(drawing.svg) == ["words"]
    assert drawing.description == "what is seen"
    assert drawing._repr_svg_().encode() == drawing.svg  # what a notebook shows
    assert struct.unpack(">II", drawing.png[16:24]) == (600, 400)
    # The files contain no program name, no date and no address.
    assert b"atplotlib" not in drawing.svg + drawing.png
    assert b"DOCTYPE" not in drawing.svg
    namespaces = {b"http://www.w3.org/2000/svg", b"http://www.w3.org/1999/xlink"}
    addresses = {text for text in drawing.svg.split(b'"')[1::2] if b"://" in text}
    assert addresses <= namespaces


def test_plot_does_not_depend_on_settings_of_the_user_and_does_not_change_them() -> None:
    example = plot(curves=9, paper=((3.0, 0.5, "a"), (5.0, 0.7, "b")), diagonal=True)
    expected = draw_plot(example)
    with mpl.rc_context({"font.size": 30, "svg.fonttype": "path", "savefig.facecolor": "red"}):
        settings = dict(mpl.rcParams)
        assert draw_plot(example) == expected
        assert dict(mpl.rcParams) == settings


@pytest.mark.parametrize(
    "text", ["$\\frac{", "a$b$c", "\u4e2d\u6587", "\U0001f333", "<script>&amp;", "\\", "{x}", "%s"]
)
def test_special_characters_are_drawn_unchanged(text: str) -> None:
    assert texts(picture(text).svg) == [text]


@given(st.text(max_size=30), st.integers(1, 20))
@example("0 \x1b\r0", 4)
def test_label_is_truncated_to_its_length(text: str, length: int) -> None:
    cut = label(text, length)
    assert len(cut) <= length
    assert cut == label(cut, length)
    assert cut == label(text, 1000) or cut.endswith("…")


def test_wide_letters_of_a_label_count_twice() -> None:
    assert label("\u4e2d\u6587\u6a39", 6) == "\u4e2d\u6587\u6a39"
    assert label("\u4e2d\u6587\u6a39", 5) == "\u4e2d\u6587…"
    assert label("\u4e2d\u6587\u6a39", 4) == "\u4e2d…"


def test_legend_shows_every_key_in_columns() -> None:
    keys = [(Line2D([], [], color=colour), f"_{colour}") for colour in COLOURS]
    with blank_figure(6, 2) as figure:
        draw_legend(figure, keys, place=(0, 1, 1), columns=4, size=8, sign_width=2)
        shown = [
            [text.get_text().strip() for text in legend.get_texts()] for legend in figure.legends
        ]
    assert sum(shown, []) == [text for _, text in keys]  # noqa: RUF017 - a few
    assert [len(column) for column in shown] == [3, 3, 3]


@pytest.mark.parametrize("points", [1, 2, 12, 13, 300])
@pytest.mark.parametrize("curves", [0, 1, 9])
def test_legend_and_description_have_all_curves(curves: int, points: int) -> None:
    example = plot(curves=curves, points=points)
    drawing = draw_plot(example)
    shown = texts(drawing.svg)
    assert {curve.label for curve in example.curves} <= set(shown)
    assert {"Errors", "error (m)", "share"} <= set(shown)
    assert ("interval of 95 %" in shown) == (curves > 0)
    assert all(curve.label in drawing.description.lower() for curve in example.curves)


def test_all_curves_of_a_plot_look_different() -> None:
    lines = [
        (str(line["linestyle"]), line["marker"], line["color"])
        for line in map(_line_options, range(100))
    ]
    assert len({line[:2] for line in lines[:28]}) == 28  # in black and white
    assert len(set(lines)) == 100
    assert len(set(COLOURS) - {GROUND}) == len(COLOURS)


def test_several_points_of_the_paper_are_numbered() -> None:
    first, second = (5.0, 0.5, "Table 5"), (29.0, 0.7, "Table 6")
    assert "paper: Table 5" in texts(draw_plot(plot(paper=(first,))).svg)
    shown = texts(draw_plot(plot(paper=(first, second))).svg)
    assert {"1", "2", "paper 1: Table 5", "paper 2: Table 6"} <= set(shown)


def test_intervals_are_drawn_as_bars_or_bands() -> None:
    few = Curve(label="few", x=(1.0, 2.0), y=(0.5, 0.6), low=(0.4, 0.5), high=(0.6, 0.7))
    many = plot(curves=1).curves[0]
    for curve, kind in ((few, "LineCollection"), (many, "FillBetweenPolyCollection")):
        with blank_figure(3, 3) as figure:
            axes = figure.add_subplot()
            draw_curve(axes, curve, 0, 1)
            artist = axes.collections[0]
            assert type(artist).__name__ in {kind, "PolyCollection"}
            corners = artist.get_datalim(axes.transData)
            assert corners.y0 == pytest.approx(min(curve.low))
            assert corners.y1 == pytest.approx(max(curve.high))


def test_ticks_of_few_values_are_the_values() -> None:
    curve = Curve(label="P", x=(8.0, 16.0, 24.0, 32.0), y=(0.3, 0.4, 0.4, 0.4))
    shown = texts(draw_plot(dataclasses.replace(plot(), curves=(curve,))).svg)
    assert {"8", "16", "24", "32"} <= set(shown)
    assert "20" not in shown


def test_names_of_ticks_are_drawn_and_described() -> None:
    ticks = ((0.0, "few"), (1.0, "some"), (2.0, "many"))
    curve = Curve(label="P", x=(0.0, 2.0), y=(0.3, 0.4))
    drawing = draw_plot(dataclasses.replace(plot(), curves=(curve,), ticks=ticks))
    assert {"few", "some", "many"} <= set(texts(drawing.svg))
    assert "P: 0.3 at few, 0.4 at many." in drawing.description


@pytest.mark.parametrize(
    ("x", "shown", "hidden"),
    [
        ((0.0, 5.0, 50.0, 5000.0), {"0", "5", "100", "5,000"}, {"1"}),
        ((0.01, 1.0, 100.0), {"0.01", "0.1", "1", "10", "100"}, {"0", "50"}),
        ((2.0, 3.0), {"2"}, {"5"}),
        ((7.0,), set(), {"0"}),
        ((0.0,), {"0"}, {"5"}),
    ],
)
def test_ticks_of_a_logarithmic_axis(
    x: tuple[float, ...], shown: set[str], hidden: set[str]
) -> None:
    curve = Curve(label="P", x=x, y=(0.33,) * len(x))
    paper = ((x[-1], 0.33, "one"), (x[0], 0.32, "two"))
    example = dataclasses.replace(plot(), curves=(curve,), log=True, y_range=(0.31, 0.35))
    labels = texts(draw_plot(example).svg)
    assert shown <= set(labels)
    assert hidden.isdisjoint(labels)
    assert {"1", "2"} <= set(texts(draw_plot(dataclasses.replace(example, paper=paper)).svg))


def test_dark_drawing_has_rules_for_all_colours() -> None:
    drawing = draw_plot(plot(curves=9, diagonal=True)).svg
    dark = in_the_dark(drawing).decode()
    ET.fromstring(dark)  # noqa: S314
    style = dark.partition("<style>")[2].partition("</style>")[0]
    assert dark.replace(f"<style>{style}</style>", "") == drawing.decode()
    for light, colour in DARK.items():
        assert f'[style*="fill: {light}"]{{fill:{colour}!important}}' in style
    assert {f"fill: {GROUND}", f"fill: {INK}", f"stroke: {GRID}"} <= set(
        re.findall(r"(?:fill|stroke): #[0-9a-f]{6}", drawing.decode())
    )


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_plots_with_nan_and_infinity_are_drawn(value: float) -> None:
    for x, y in (((0.0, value), (0.5, 1.0)), ((0.0, 1.0), (value, 1.0)), ((value,), (value,))):
        curve = Curve(label="odd", x=x, y=y)
        many = Curve(label="many", x=tuple(map(float, range(40))), y=(value,) * 40)
        draw_plot(dataclasses.replace(plot(), curves=(curve, many)))


@pytest.mark.parametrize("text", [HARM, LONG, "_", "$", ""])
def test_text_from_data_is_escaped_and_truncated(text: str) -> None:
    curve = Curve(label=text, x=(0.0, 1.0), y=(0.5, 0.6))
    labels: dict[str, Any] = {"title": text, "x_label": text, "y_label": text}
    drawing = draw_plot(Plot(name="a", **labels, curves=(curve,) * 9, paper=((0.5, 0.5, text),)))
    assert b"<script>" not in drawing.svg
    assert max(map(len, texts(drawing.svg))) < 80
