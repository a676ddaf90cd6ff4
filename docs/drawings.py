"""The figures of the site, drawn by the build from the results of the benchmarks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import semsig_gis as sg
from semsig_gis.output import COLOURS, Scene, SceneObject, blank_figure, draw_scenes, saved

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from semsig_gis.output import Picture

RESULTS = Path(__file__).resolve().parents[1] / "benchmarks"
FOUND, RECALL = "P(error ≤ 50 m)", "recall@10 %"
SHORT = {"types": "types", "angles": "angles", "types and angles, 5 %": "both"}
INPUTS = "told"  # key of the inputs of the method
FEWEST = 25  # queries for which a share is drawn
LEVELS = ("light", "medium", "strong")
RIVALS = {
    "the paper's best method": "edit+edit:5%, order kept",
    "likelihood": "likelihood, noise generic, re-ranked",
}


def drawings() -> Iterable[sg.Plot]:
    """Yield the plots; their names are the names of their files."""
    rows = _results("reproduction.json")
    ranges = {f"R = {metres} m": metres for metres in (20, 30, 40)}
    scales = {f"Q = {levels}": levels for levels in (8, 16, 24, 32)}
    for name, section, places, title, x_label in (
        ("ranges", "ranges", ranges, "Visibility range", "visibility range (m)"),
        ("scales", "scales", scales, "Angle levels", "angle levels"),
    ):
        yield _paper_plot(rows, name, section=section, places=places, title=title, x_label=x_label)
    for city in ("Paris-like", "Montpellier"):
        yield _rivals(_results("accuracy.json"), city)
    yield _chances(_results("chances.json"))
    yield _photographs(_results("real_photographs.json"))


def _results(name: str) -> Any:  # noqa: ANN401 - rows, or tables by name
    return json.loads((RESULTS / name).read_text(encoding="utf-8"))


def _paper_plot(
    rows: Sequence[dict[str, Any]],
    name: str,
    *,
    section: str,
    places: dict[str, int],
    title: str,
    x_label: str,
) -> sg.Plot:
    """Plot the share of queries placed by the paper's best method, in our run and in the paper."""
    row_of = {
        row["row"]: row for row in rows if row["section"] == section and row["column"] == FOUND
    }
    points = [(places[key], row_of[key]) for key in places]
    return sg.Plot(
        name=name,
        title=f"{title}: queries placed within 50 m",
        x_label=x_label,
        y_label="share within 50 m",
        curves=(_curve("ours", points, "ours", "low", "high"),),
        paper=tuple((x, row["paper"], f"{row['paper']:.4f}") for x, row in points),
        y_range=(0.0, 0.6),
    )


def times() -> Picture:
    """Draw the milliseconds of a query by method, ours and the paper's, as bars."""
    rows = [row for row in _results("reproduction.json") if row["section"] == "times"]
    names = [f"{row['row']}, {SHORT[row['column']]}" for row in rows]
    places = np.arange(len(rows))[::-1]
    title = "Time of one query among about 312,000 cells"
    with blank_figure(6.6, 4.4) as figure:
        axes = figure.add_axes((0.4, 0.17, 0.55, 0.74))
        for column, shift, colour in (("paper", 0.2, COLOURS[1]), ("ours", -0.2, COLOURS[0])):
            widths = [row[column] for row in rows]
            axes.barh(places + shift, widths, height=0.38, color=colour, label=column)
            for place, width in zip(places, widths, strict=True):
                axes.text(1.1 * width, place + shift, f"{width:,.1f}", va="center", size=7.5)
        axes.set(xscale="log", xlim=(0.5, 6000), xlabel="milliseconds", yticks=places)
        axes.set_yticklabels(names)
        axes.set_xticks(ticks := [1, 10, 100, 1000], [f"{tick:,}" for tick in ticks])
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, frameon=False)
        figure.text(0.02, 0.95, title, weight="bold", size=10.5)
        pairs = zip(names, rows, strict=True)
        values = (f"{name}: {row['ours']:.1f}, the paper {row['paper']:g}" for name, row in pairs)
        return saved(figure, title=title, description=f"{title}, in ms. {'; '.join(values)}.")


def _rivals(rows: Sequence[dict[str, Any]], city: str) -> sg.Plot:
    """Plot the share of queries that two methods place, by the number of errors in a query."""
    setting = "north known; on the grid"
    row_of = {
        (row["method"], row["distortion"]): row
        for row in rows
        if row["city"] == city and row["setting"] == setting and row["coverage"] is None
    }
    curves = tuple(
        _curve(
            label,
            [(place, row_of[method, level]) for place, level in enumerate(LEVELS, 1)],
            *("p50", "p50_low", "p50_high"),
        )
        for label, method in RIVALS.items()
    )
    errors = ("1 error", "7 errors", "13 errors")
    return sg.Plot(
        name=f"rivals-{city.lower()}",
        title=f"{city}: queries placed within 50 m, by errors of the detector",
        x_label="errors of the detector in one query",
        y_label="share within 50 m",
        curves=curves,
        ticks=tuple(enumerate(errors, 1)),
    )


def _chances(rows: Sequence[dict[str, Any]]) -> sg.Plot:
    """Plot how often stated chances come true, for maps that are not old."""
    curves = tuple(
        _curve(
            row["city"],
            [(part["stated"], part) for part in row["bins"] if part["n"] >= FEWEST],
            *("true", "low", "high"),
        )
        for row in rows
        if row["map"] == "of the day"
    )
    return sg.Plot(
        name="chances",
        title="Stated chances, and how often they come true",
        x_label="chance stated to be within 50 m (mean of a tenth)",
        y_label="share within 50 m",
        curves=curves,
        diagonal=True,
    )


def _photographs(result: Mapping[str, Any]) -> sg.Plot:
    """Plot how often stated chances come true for single photographs, by method."""
    parts = [row for row in result["calibration"] if row["set"] == "single" and row["n"]]
    curves = tuple(
        _curve(
            method,
            [(row["stated"], row) for row in parts if row["method"] == method],
            *("true", "low", "high"),
        )
        for method in dict.fromkeys(row["method"] for row in parts)
    )
    return sg.Plot(
        name="photographs",
        title="Real photographs: stated chances, and how often they come true",
        x_label="chance stated to be within 50 m (mean of a tenth)",
        y_label="share within 50 m",
        curves=curves,
        diagonal=True,
    )


def failures() -> dict[str, Picture]:
    """Draw the wrong answers with the largest chances: the true and the answered place of each."""
    result = _results("real_photographs.json")
    taxonomy = sg.Taxonomy.from_list(result["classes"])
    pictures = {}
    for number, failure in enumerate(result["failures"]["views"], start=1):
        scenes = []
        for name, title in (("true", "Where it was"), ("answered", "What it was mistaken for")):
            place = failure[name]
            detections = [row for row in place["rows"] if row["query_class"]]
            there = [row for row in place["rows"] if row["object_class"]]
            there.sort(key=lambda row: row["object_bearing"])
            codes = [taxonomy.by_name(row["object_class"]).code for row in there]
            angles = np.radians([row["object_bearing"] for row in there])
            scenes.append(
                Scene(
                    name=f"failure-{number}-{name}",
                    title=title,
                    lon=place["lon"],
                    lat=place["lat"],
                    radius=result["radius"],
                    types=taxonomy.decode(codes),
                    taxonomy=taxonomy,
                    objects=tuple(
                        SceneObject(
                            code=code,
                            east=row["distance"] * np.sin(angle),
                            north=row["distance"] * np.cos(angle),
                        )
                        for code, row, angle in zip(codes, there, angles, strict=True)
                    ),
                    asked=tuple(
                        (taxonomy.by_name(row["query_class"]).code, row["query_bearing"])
                        for row in detections
                    ),
                    error_m=failure["error_m"] if name == "answered" else None,
                )
            )
        pictures[f"photograph-failure-{number}"] = draw_scenes(scenes)
    return pictures


def ages() -> Picture:
    """Draw the share of sure answers that are right on old maps, with and without their age."""
    rows = [
        row
        for row in _results("chances.json")
        if row["map"] != "of the day" and row["city"] != "made up"
    ]
    rows.sort(key=lambda row: (row["city"], row[INPUTS]))
    names = [f"{row['city']}: {row[INPUTS] or row['map'] + ', age not given'}" for row in rows]
    places = np.arange(len(rows))[::-1]
    shares = np.array([row["right"] / row["answered"] for row in rows])
    ends = np.array([[row["low"], row["high"]] for row in rows]).T
    title = "Answers with a chance of 0.9 or more, on old maps"
    with blank_figure(6.6, 3.4) as figure:
        axes = figure.add_axes((0.5, 0.17, 0.46, 0.71))
        axes.axvline(0.9, color=COLOURS[1], linewidth=1, linestyle="--")
        axes.errorbar(
            shares, places, xerr=abs(ends - shares), fmt="o", color=COLOURS[0], elinewidth=1.5
        )
        axes.set(xlim=(0.65, 1.01), xlabel="share within 50 m", yticks=places)
        axes.set_yticklabels(names)
        axes.spines[["top", "right"]].set_visible(False)
        figure.text(0.02, 0.94, title, weight="bold", size=10.5)
        pairs = zip(names, shares, strict=True)
        values = "; ".join(f"{name}: {share:.3f}" for name, share in pairs)
        return saved(figure, title=title, description=f"{title}: share within 50 m. {values}.")


def _curve(
    label: str, rows: Iterable[tuple[float, dict[str, Any]]], y: str, low: str, high: str
) -> sg.Curve:
    xs, points = zip(*rows, strict=True)
    values = ([row[key] for row in points] for key in (y, low, high))
    ys, lows, highs = (tuple(column) for column in values)
    return sg.Curve(label=label, x=tuple(xs), y=ys, low=lows, high=highs)


def write_drawings(folder: Path) -> None:
    """Draw all figures into a folder; files with the same contents are not written again."""
    folder.mkdir(exist_ok=True)
    pictures = {plot.name: sg.draw_plot(plot) for plot in drawings()} | {
        "times": times(),
        "ages": ages(),
        **failures(),
    }
    for name, picture in pictures.items():
        path, svg = folder / f"{name}.svg", picture.svg
        if not path.is_file() or path.read_bytes() != svg:
            path.write_bytes(svg)
