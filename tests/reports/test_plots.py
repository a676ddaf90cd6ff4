"""Tests of semsig_gis.reports.plots."""

from __future__ import annotations

import dataclasses

import matplotlib as mpl
import pytest
from reports import HARM, LONG, plot, texts

from semsig_gis.reports.parts import Curve, Plot
from semsig_gis.reports.plots import WHITE, _draw_curve, _look, blank_figure, draw_plot


@pytest.mark.parametrize("points", [1, 2, 12, 13, 300])
@pytest.mark.parametrize("curves", [0, 1, 9])
def test_a_plot_names_all_its_curves(curves: int, points: int) -> None:
    given = plot(curves=curves, points=points)
    made = draw_plot(given)
    shown = texts(made.svg)
    assert {curve.label for curve in given.curves} <= set(shown)
    assert {"Errors", "error (m)", "share"} <= set(shown)
    assert ("interval of 95 %" in shown) == (curves > 0)
    assert all(curve.label in made.description.lower() for curve in given.curves)


def test_the_same_plot_is_the_same_bytes() -> None:
    given = plot(curves=9, paper=((3.0, 0.5, "a"), (5.0, 0.7, "b")), diagonal=True)
    assert draw_plot(given) == draw_plot(given)


def test_no_two_curves_look_alike() -> None:
    looks = [_look(number) for number in range(100)]
    without_colour = [(str(one["linestyle"]), one["marker"]) for one in looks[:28]]
    assert len(set(without_colour)) == 28
    assert len({(str(one["color"]), str(one["linestyle"]), one["marker"]) for one in looks}) == 100
    assert WHITE not in {one["color"] for one in looks}


def test_points_of_the_paper_are_numbered_where_there_are_several() -> None:
    one = texts(draw_plot(plot(paper=((5.0, 0.5, "Table 5"),))).svg)
    assert "paper: Table 5" in one
    two = texts(draw_plot(plot(paper=((5.0, 0.5, "Table 5"), (29.0, 0.7, "Table 6")))).svg)
    assert {"1", "2", "paper 1: Table 5", "paper 2: Table 6"} <= set(two)


def test_intervals_are_drawn_where_they_are() -> None:
    few = Curve(label="few", x=(1.0, 2.0), y=(0.5, 0.6), low=(0.4, 0.5), high=(0.6, 0.7))
    many = plot(curves=1).curves[0]
    for curve, kind in ((few, "LineCollection"), (many, "FillBetweenPolyCollection")):
        with blank_figure(3, 3) as figure:
            axes = figure.add_subplot()
            _draw_curve(axes, curve, 0, 1)
            drawn = axes.collections[0]
            assert type(drawn).__name__ in {kind, "PolyCollection"}
            corners = drawn.get_datalim(axes.transData)
            assert corners.y0 == pytest.approx(min(curve.low))
            assert corners.y1 == pytest.approx(max(curve.high))


def test_ticks_are_the_values_where_they_are_few() -> None:
    curve = Curve(label="P", x=(8.0, 16.0, 24.0, 32.0), y=(0.3, 0.4, 0.4, 0.4))
    shown = texts(draw_plot(dataclasses.replace(plot(), curves=(curve,))).svg)
    assert {"8", "16", "24", "32"} <= set(shown)
    assert "20" not in shown


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_values_that_are_no_numbers(value: float) -> None:
    for x, y in (((0.0, value), (0.5, 1.0)), ((0.0, 1.0), (value, 1.0)), ((value,), (value,))):
        curve = Curve(label="odd", x=x, y=y)
        many = Curve(label="many", x=tuple(map(float, range(40))), y=(value,) * 40)
        draw_plot(dataclasses.replace(plot(), curves=(curve, many)))


@pytest.mark.parametrize("text", [HARM, LONG, "_", "$", ""])
def test_text_from_data_breaks_nothing(text: str) -> None:
    curve = Curve(label=text, x=(0.0, 1.0), y=(0.5, 0.6))
    given = Plot(
        name="a",
        title=text,
        x_label=text,
        y_label=text,
        curves=(curve,) * 9,
        paper=((0.5, 0.5, text),),
    )
    made = draw_plot(given)
    assert b"<script>" not in made.svg
    assert max(map(len, texts(made.svg))) < 80


def test_drawing_leaves_no_state_behind() -> None:
    before = dict(mpl.rcParams)
    draw_plot(plot())
    assert dict(mpl.rcParams) == before
