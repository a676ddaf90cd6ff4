"""Reports for tests: an ordinary one, and one with hostile texts."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
from map_pages import HOSTILE, hostile_taxonomy

from semsig_gis.output import (
    Curve,
    Number,
    OutcomeMap,
    Pair,
    Plot,
    Report,
    Scene,
    SceneObject,
    Section,
)
from semsig_gis.sources import paper_taxonomy

FORMULA = '=cmd|"/C calc"!A0'
HARM = f"{FORMULA} $\\frac{{}}$ _x_ ![a](http://example.org/a.png)\0\r\n# | {HOSTILE}"
LONG = f"{HARM} {'long ' * 2000}{'M' * 10_000}"


def texts(svg: bytes) -> list[str]:
    """Return the texts of a drawing."""
    namespace = "{http://www.w3.org/2000/svg}"
    return [element.text or "" for element in ET.fromstring(svg).iter(f"{namespace}text")]  # noqa: S314


def plot(name: str = "errors", *, curves: int = 2, points: int = 30, **options: Any) -> Plot:  # noqa: ANN401
    """Return a plot of rising curves."""
    lines = []
    for number in range(curves):
        rise = [(step / points) ** (1 + number) for step in range(points)]
        low, high = (tuple(y * share for y in rise) for share in (0.9, 1.1))
        x = tuple(map(float, range(points)))
        lines.append(Curve(label=f"curve {number}", x=x, y=tuple(rise), low=low, high=high))
    settings = {"title": "Errors", "x_label": "error (m)", "y_label": "share", **options}
    return Plot(name=name, curves=tuple(lines), **settings)


def scene(name: str = "place", *, objects: int = 3, **options: Any) -> Scene:  # noqa: ANN401
    """Return a scene with objects of the classes of the paper on all sides."""
    visible = tuple(
        SceneObject(code=1 + number % 11, east=-20.0 + number % 40, north=number / 3)
        for number in range(objects)
    )
    others = (SceneObject(code=3, east=-30.0, north=20.0),)
    types = paper_taxonomy().decode([item.code for item in visible])
    settings: dict[str, Any] = {"title": "A place", "error_m": 12.0, "types": types}
    place = {"lon": 2.3, "lat": 48.8, "radius": 30.0, "taxonomy": paper_taxonomy()}
    return Scene(name=name, objects=visible, others=others, **{**settings, **place, **options})


def outcome_map(name: str = "where", *, places: int = 5, **options: Any) -> OutcomeMap:  # noqa: ANN401
    """Return a map of places of queries on a strip of cells, every second one successful."""
    settings: dict[str, Any] = {
        "title": "Places",
        "step": 10.0,
        "ground": np.ones((2, 3), np.bool_),
        "places": np.linspace((1.0, 1.0), (29.0, 19.0), places),
        "successful": np.arange(places) % 2 == 0,
    }
    return OutcomeMap(name=name, **{**settings, **options})


def report(*sections: Section, **options: Any) -> Report:  # noqa: ANN401
    settings = {"title": "Report", "taxonomy": paper_taxonomy(), "sections": sections}
    return Report(**{**settings, **options})


def ordinary_report() -> Report:
    """Return a report with all kinds of content."""
    numbers = (
        Number("R = 20 m", "P", 0.21, low=0.2, high=0.22, paper=0.1793),
        Number("R = 20 m", "recall", 0.5, paper=0.511),
        Number("R = 30 m", "P", None, paper=0.3733),
        Number("R = 30 m", "median", float("inf"), unit="m", decimals=1),
    )
    errors_plot = plot(points=3, paper=((2.0, 0.5, "Table 5"),))
    return report(
        Section(
            name="range", title="Range", text=("Words.",), numbers=numbers, plots=(errors_plot,)
        ),
        Section(name="places", title="Places", scenes=(scene(), scene("other", answer=(9.0, 2.0)))),
        Section(
            name="lost",
            title="Lost",
            maps=(outcome_map(),),
            pairs=(Pair(title="One", text="Two lamps.", scenes=(scene("true"), scene("taken"))),),
        ),
        headline="Half of it.",
        command="semsig evaluate city.parquet",
        text=("What it is.",),
        settings=(("Database", "city.parquet"),),
        facts={"versions": {"numpy": "2"}, "share": float("nan")},
    )


def hostile_report(harm: str = HARM) -> Report:
    """Return a report in which all texts that can come from data are hostile."""
    curve = Curve(label=harm, x=(0.0, 1.0), y=(0.5, float("nan")))
    taxonomy = hostile_taxonomy(paper_taxonomy(), harm)
    hostile_plot = plot(title=harm, x_label=harm, y_label=harm)
    section = Section(
        name="all",
        title=harm,
        text=(harm, f"- {harm}", f"1. {harm}"),
        numbers=(
            Number(harm, harm, 1.0, paper=2.0, unit=harm),
            Number(harm, "b", 1.0, paper=2.0, unit="m"),
            Number("b", "b", 1.0, paper=2.0, unit=harm),
        ),
        plots=(dataclasses.replace(hostile_plot, curves=(curve,), paper=((0.5, 0.5, harm),)),),
        maps=(outcome_map(title=harm),),
        scenes=(
            scene(title=harm, types=harm, objects=11, taxonomy=taxonomy, error_m=float("inf")),
        ),
        pairs=(Pair(title=harm, text=harm, scenes=(scene("a", title=harm), scene("b"))),),
    )
    return report(
        section,
        title=harm,
        headline=harm,
        command=harm,
        text=(harm,),
        settings=((harm, harm),),
        taxonomy=taxonomy,
        facts={"path": harm},
    )
