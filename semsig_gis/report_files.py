"""A report as files: a page, Markdown, figures, and all numbers as CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis import __version__
from semsig_gis.errors import InputError
from semsig_gis.plots import draw_plot
from semsig_gis.report_page import html_page, markdown_page
from semsig_gis.scene_plots import draw_scene
from semsig_gis.storage import whole_file
from semsig_gis.tables import one_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from semsig_gis.pictures import Picture
    from semsig_gis.report_parts import Number, Plot, Report

__all__ = ["write_report"]

FIGURES = "figures"
NUMBER_COLUMNS = (
    "section",
    "row",
    "column",
    "unit",
    "ours",
    "low",
    "high",
    "paper",
    "difference",
)
POINT_COLUMNS = ("source", "label", "x", "y", "low", "high")


def write_report(report: Report, folder: str | Path) -> None:
    """Write a report into a folder, which is made if need be; files of the same names are replaced.

    ``report.html`` is one page that asks the network for nothing, ``report.md`` is the same as
    Markdown. ``figures`` holds each plot and scene as SVG and PNG, and the points of each plot as
    CSV. ``numbers.csv`` holds every number of the tables, and ``report.json`` all there is, with
    null for what is infinite or not a number. A text in a CSV file that a spreadsheet would run as
    a formula begins with an apostrophe.

    Raises `InputError` if a name in the report cannot be that of a file or stands twice, or the
    folder cannot be written to.
    """
    _require_names([section.name for section in report.sections])
    _require_names([part.name for section in report.sections for part in section.drawn])
    place = Path(folder)
    pictures: dict[str, Picture] = {}
    for section in report.sections:
        for plot in section.plots:
            pictures[plot.name] = draw_plot(plot)
            _write(place / FIGURES / f"{plot.name}.csv", _csv(POINT_COLUMNS, _points(plot)))
        for scene in section.scenes:
            pictures[scene.name] = draw_scene(scene, report.taxonomy)
    for name, picture in pictures.items():
        _write(place / FIGURES / f"{name}.svg", picture.svg)
        _write(place / FIGURES / f"{name}.png", picture.png)
    _write(place / "numbers.csv", _csv(NUMBER_COLUMNS, _numbers(report)))
    _write(place / "report.json", _json(report))
    _write(place / "report.md", markdown_page(report, pictures))
    _write(place / "report.html", html_page(report, pictures))


def _require_names(names: Sequence[str]) -> None:
    """Refuse what cannot be the name of a file, on any system."""
    seen = set()
    for name in names:
        if not re.fullmatch(r"[A-Za-z0-9-]+", name):
            msg = f"{name!r} cannot be a name in a report; write letters, digits and hyphens."
            raise InputError(msg)
        if name.lower() in seen:
            msg = f"{name!r} is in the report twice; give each part a name of its own."
            raise InputError(msg)
        seen.add(name.lower())


def _write(path: Path, content: str | bytes) -> None:
    with whole_file(path) as half:
        half.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


# --- CSV ----------------------------------------------------------------------------------------


def _csv(columns: Iterable[str], rows: Iterable[Sequence[str | float | None]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        writer.writerow([_defused(cell) if isinstance(cell, str) else cell for cell in row])
    return text.getvalue()


def _defused(text: str) -> str:
    """Return text that no spreadsheet takes for a formula."""
    plain = one_line(text)
    return f"'{plain}" if plain.startswith(("=", "+", "-", "@")) else plain


def _numbers(report: Report) -> Iterator[tuple[str | float | None, ...]]:
    for section in report.sections:
        for number in section.numbers:
            values = (number.ours, number.low, number.high, number.paper, number.difference)
            yield (section.name, number.row, number.column, number.unit, *values)


def _points(plot: Plot) -> Iterator[tuple[str | float | None, ...]]:
    for curve in plot.curves:
        nothing = (None,) * len(curve.x)
        ends = (curve.low or nothing, curve.high or nothing)
        for x, y, low, high in zip(curve.x, curve.y, *ends, strict=True):
            yield ("ours", curve.label, x, y, low, high)
    for x, y, label in plot.paper:
        yield ("paper", label, x, y, None, None)


# --- JSON ---------------------------------------------------------------------------------------


def _json(report: Report) -> str:
    content = {
        "title": report.title,
        "text": report.text,
        "settings": [{"name": name, "value": value} for name, value in report.settings],
        "sections": [
            {**asdict(section), "numbers": [_number(number) for number in section.numbers]}
            for section in report.sections
        ],
        "classes": report.taxonomy.to_list(),
        "facts": report.facts,
        "version": __version__,
    }
    return json.dumps(_finite(content), indent=1, allow_nan=False) + "\n"


def _number(number: Number) -> dict[str, Any]:
    return {**asdict(number), "difference": number.difference}


def _finite(value: Any) -> Any:  # noqa: ANN401 - whatever JSON holds
    """Return a value without what JSON has no word for."""
    if isinstance(value, Mapping):
        return {name: _finite(one) for name, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
