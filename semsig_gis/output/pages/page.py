"""Write a report as HTML, Markdown, CSV and JSON; text from data is always escaped."""

from __future__ import annotations

import base64
import csv
import io
import json
import math
import re
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from semsig_gis import __version__
from semsig_gis.core import InputError, Table, escaped, markdown_rows, one_line
from semsig_gis.output.figures.outcomes import draw_map
from semsig_gis.output.figures.plots import draw_plot, in_the_dark
from semsig_gis.output.figures.scenes import draw_scene
from semsig_gis.output.report_model import OutcomeMap, Plot
from semsig_gis.output.tables.tables import number_table
from semsig_gis.storage import write_whole

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from semsig_gis.output.figures.plots import Picture
    from semsig_gis.output.report_model import Report, Scene


# Special characters of Markdown that `escaped` leaves: anywhere, and at the start of a paragraph.
MARKS = re.compile(r"([\\`*_\[\]{}~$])")
FIRST_MARKS = re.compile(r"^(\d*)([-+=>#.)])")
RUN, DATA = "What was run", "Sources of the data"


def html_page(report: Report, pictures: Mapping[str, Picture], *, standalone: bool = False) -> str:
    """Return a report as one HTML page with embedded pictures; it loads no other files.

    Unless it is `standalone`, it has links to the other files of the report.
    """
    environment = Environment(
        loader=PackageLoader("semsig_gis"),
        autoescape=True,
        # Plain strings are texts from data; the template's own markup has another type.
        finalize=lambda value: one_line(value) if type(value) is str else value,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template("report.html").render(
        report=report,
        tables=_tables(report),
        images={
            name: base64.b64encode(in_the_dark(picture.svg)).decode("ascii")
            for name, picture in pictures.items()
        },
        alts={name: picture.description for name, picture in pictures.items()},
        standalone=standalone,
        run=RUN,
        data=DATA,
        version=__version__,
    )


def markdown_page(report: Report, pictures: Mapping[str, Picture]) -> str:
    """Return a report as Markdown that shows the pictures in the folder ``figures``."""
    blocks = [f"# {_inline(report.title)}"]
    blocks += [f"**{_inline(report.headline)}**"] if report.headline else []
    blocks += map(_paragraph, report.text)
    tables = _tables(report)

    def image(drawing: Plot | OutcomeMap | Scene) -> str:
        return f"![{_inline(pictures[drawing.name].description)}](figures/{drawing.name}.svg)"

    for section in report.sections:
        blocks += [f"## {_inline(section.title)}", *map(_paragraph, section.text)]
        for drawings in (section.plots, section.maps, section.scenes):
            blocks += map(image, drawings)
        for pair in section.pairs:
            blocks += [f"### {_inline(pair.title)}", _paragraph(pair.text)]
            blocks += map(image, pair.scenes)
        if section.name in tables:
            table = tables[section.name]
            blocks.append(markdown_rows(table, _inline))
            blocks += [_paragraph(table.note)] if table.note else []
    if report.settings or report.command:
        blocks.append(f"## {RUN}")
    if report.settings:
        settings = Table("", ("Setting", "Value"), report.settings, labels=2)
        blocks.append(markdown_rows(settings, _inline))
    blocks += [_paragraph(report.command)] if report.command else []
    blocks += [f"## {DATA}", *map(_paragraph, report.credits)] if report.credits else []
    return "\n\n".join(blocks) + "\n"


def _tables(report: Report) -> dict[str, Table]:
    return {
        section.name: number_table(section.numbers)
        for section in report.sections
        if section.numbers
    }


def _inline(text: str) -> str:
    """Return text with the special characters of Markdown escaped."""
    return escaped(MARKS.sub(r"\\\1", one_line(text)))


def _paragraph(text: str) -> str:
    return FIRST_MARKS.sub(r"\1\\\2", _inline(text))


FIGURES_FOLDER = "figures"
NUMBER_COLUMNS = ("section", "row", "column", "unit", "ours", "low", "high", "paper", "difference")
POINT_COLUMNS = ("source", "label", "x", "y", "low", "high")


def write_page(report: Report, file: str | Path) -> None:
    """Write a report as one HTML page with embedded pictures.

    Parameters
    ----------
    report : Report
        The report.
    file : str or Path
        File to write; the page loads no other files.

    Raises
    ------
    InputError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from semsig_gis import evaluate, evaluation_page
    >>> page = evaluation_page(evaluate(demo_database, queries=5), demo_database, name="a city")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_page(page, f"{folder}/report.html")
    ...     Path(folder, "report.html").read_text("utf-8")[:15]
    '<!DOCTYPE html>'
    """
    write_whole(file, html_page(report, _pictures(report), standalone=True))


def write_report(report: Report, folder: str | Path) -> None:
    """Write a report into a folder, which is created if necessary; existing files are replaced.

    ``report.html`` is one page, ``report.md`` the same as Markdown; ``figures`` holds plots, maps
    and scenes as SVG and PNG, and points of plots as CSV; ``numbers.csv`` holds every number, and
    ``report.json`` the whole content. Raises `InputError` if a name is no valid file name or occurs
    twice, or the folder cannot be written to.
    """
    drawings = [drawing for section in report.sections for drawing in section.drawings]
    _require_names([section.name for section in report.sections])
    _require_names([drawing.name for drawing in drawings])
    folder, pictures = Path(folder), _pictures(report)
    for drawing in drawings:
        if isinstance(drawing, Plot):
            points = _csv(POINT_COLUMNS, _points(drawing))
            write_whole(folder / FIGURES_FOLDER / f"{drawing.name}.csv", points)
    for name, picture in pictures.items():
        write_whole(folder / FIGURES_FOLDER / f"{name}.svg", picture.svg)
        write_whole(folder / FIGURES_FOLDER / f"{name}.png", picture.png)
    numbers = (
        (
            *(section.name, number.row, number.column, number.unit),
            *(number.ours, number.low, number.high, number.paper, number.difference),
        )
        for section in report.sections
        for number in section.numbers
    )
    write_whole(folder / "numbers.csv", _csv(NUMBER_COLUMNS, numbers))
    write_whole(folder / "report.json", _json(report))
    write_whole(folder / "report.md", markdown_page(report, pictures))
    write_whole(folder / "report.html", html_page(report, pictures))


def _pictures(report: Report) -> dict[str, Picture]:
    """Return all pictures of a report by name."""
    pictures: dict[str, Picture] = {}
    for drawing in (drawing for section in report.sections for drawing in section.drawings):
        if isinstance(drawing, Plot):
            pictures[drawing.name] = draw_plot(drawing)
        elif isinstance(drawing, OutcomeMap):
            pictures[drawing.name] = draw_map(drawing)
        else:
            pictures[drawing.name] = draw_scene(drawing)
    return pictures


def _require_names(names: Sequence[str]) -> None:
    """Raise if a name is not a valid file name on all systems, or occurs twice."""
    used = set()
    for name in names:
        if not re.fullmatch(r"[A-Za-z0-9-]+", name):
            raise InputError(
                f"{name!r} cannot be a name in a report; write letters, digits and hyphens."
            )
        if name.lower() in used:
            raise InputError(f"{name!r} is in the report twice; give each part a name of its own.")
        used.add(name.lower())


def _csv(columns: Iterable[str], rows: Iterable[Sequence[str | float | None]]) -> str:
    """Return CSV; an apostrophe prevents that a spreadsheet takes a text for a formula."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        cells = [one_line(cell) if isinstance(cell, str) else cell for cell in row]
        writer.writerow(
            f"'{cell}" if isinstance(cell, str) and cell.startswith(("=", "+", "-", "@")) else cell
            for cell in cells
        )
    return text.getvalue()


def _points(plot: Plot) -> Iterator[tuple[str | float | None, ...]]:
    """Yield the points of a plot, as rows with `POINT_COLUMNS`."""
    for curve in plot.curves:
        absent = (None,) * len(curve.x)
        ends = (curve.low or absent, curve.high or absent)
        for x, y, low, high in zip(curve.x, curve.y, *ends, strict=True):
            yield ("ours", curve.label, x, y, low, high)
    for x, y, label in plot.paper:
        yield ("paper", label, x, y, None, None)


def _json(report: Report) -> str:
    def without_taxonomy(items: list[tuple[str, Any]]) -> dict[str, Any]:
        return {name: value for name, value in items if name != "taxonomy"}

    content = {
        "title": report.title,
        "headline": report.headline,
        "text": report.text,
        "settings": [{"name": name, "value": value} for name, value in report.settings],
        "command": report.command,
        "sections": [
            {
                **asdict(section, dict_factory=without_taxonomy),  # the report has the taxonomy
                "numbers": [
                    {**asdict(number), "difference": number.difference}
                    for number in section.numbers
                ],
            }
            for section in report.sections
        ],
        "classes": report.taxonomy.to_list(),
        "credits": report.credits,
        "facts": report.facts,
        "version": __version__,
    }
    return json.dumps(_finite(content), indent=1, allow_nan=False) + "\n"


def _finite(value: Any) -> Any:  # noqa: ANN401 - any value of JSON
    """Return a value with None for numbers that are not finite, which JSON cannot represent."""
    if isinstance(value, np.ndarray):
        return _finite(value.tolist())
    if isinstance(value, Mapping):
        return {name: _finite(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
