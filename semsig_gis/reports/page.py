"""A report as a page of HTML or Markdown, in which text from data is only ever text."""

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
from semsig_gis.reports.outcomes import draw_map
from semsig_gis.reports.plots import draw_plot, in_the_dark
from semsig_gis.reports.scenes import draw_scene
from semsig_gis.reports.tables import number_table
from semsig_gis.storage import write_whole

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from semsig_gis.reports.plots import Picture
    from semsig_gis.reports.report_model import OutcomeMap, Plot, Report, Scene


# What has a meaning to Markdown anywhere, besides what `escaped` knows, and at the beginning.
MARKS = re.compile(r"([\\`*_\[\]{}~$])")
RUN = "What was run"
FIRST_MARKS = re.compile(r"^(\d*)([-+=>#.)])")


def html_page(report: Report, pictures: Mapping[str, Picture], *, alone: bool = False) -> str:
    """Return a report as one page of HTML with its pictures in it, which loads nothing.

    Unless it stands `alone`, it names the files beside it.
    """
    environment = Environment(
        loader=PackageLoader("semsig_gis"),
        autoescape=True,
        finalize=_finalized,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template("report.html").render(
        report=report,
        tables=_tables(report),
        images={name: _encoded(one) for name, one in pictures.items()},
        alts={name: picture.description for name, picture in pictures.items()},
        alone=alone,
        run=RUN,
        version=__version__,
    )


def _encoded(picture: Picture) -> str:
    return base64.b64encode(in_the_dark(picture.svg)).decode("ascii")


def markdown_page(report: Report, pictures: Mapping[str, Picture]) -> str:
    """Return a report as Markdown, with its pictures shown from the folder ``figures``."""
    blocks = [f"# {_inline(report.title)}"]
    blocks += [f"**{_inline(report.headline)}**"] if report.headline else []
    blocks += map(_paragraph, report.text)
    tables = _tables(report)

    def shown(part: Plot | OutcomeMap | Scene) -> str:
        return f"![{_inline(pictures[part.name].description)}](figures/{part.name}.svg)"

    for section in report.sections:
        blocks += [f"## {_inline(section.title)}", *map(_paragraph, section.text)]
        drawn: tuple[Plot | OutcomeMap | Scene, ...]
        drawn = (*section.plots, *section.maps, *section.scenes)
        blocks += map(shown, drawn)
        for pair in section.pairs:
            blocks += [f"### {_inline(pair.title)}", _paragraph(pair.text)]
            blocks += map(shown, pair.scenes)
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
    return "\n\n".join(blocks) + "\n"


def _finalized(value: Any) -> Any:  # noqa: ANN401 - whatever a template shows
    return one_line(value) if type(value) is str else value


def _tables(report: Report) -> dict[str, Table]:
    return {
        section.name: number_table(section.numbers)
        for section in report.sections
        if section.numbers
    }


def _inline(text: str) -> str:
    """Return text that Markdown shows as it is."""
    return escaped(MARKS.sub(r"\\\1", one_line(text)))


def _paragraph(text: str) -> str:
    return FIRST_MARKS.sub(r"\1\\\2", _inline(text))


FIGURES = "figures"
NUMBER_COLUMNS = ("section", "row", "column", "unit", "ours", "low", "high", "paper", "difference")
POINT_COLUMNS = ("source", "label", "x", "y", "low", "high")


def write_page(report: Report, file: str | Path) -> None:
    """Write a report as one page of HTML with its pictures in it.

    Parameters
    ----------
    report : Report
        What to write.
    file : str or Path
        File to write; it loads nothing when it is opened.

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
    write_whole(file, html_page(report, _drawn(report), alone=True))


def write_report(report: Report, folder: str | Path) -> None:
    """Write a report into a folder, which is made if need be; files of the same names are replaced.

    ``report.html`` is one page, ``report.md`` the same as Markdown; ``figures`` holds plots and
    scenes as SVG and PNG, and points of plots as CSV; ``numbers.csv`` holds every number, and
    ``report.json`` all there is. Raises `InputError` if a name cannot be that of a file or stands
    twice, or the folder cannot be written to.
    """
    _require_names([section.name for section in report.sections])
    _require_names([part.name for section in report.sections for part in section.drawn])
    place, pictures = Path(folder), _drawn(report)
    for plot in (plot for section in report.sections for plot in section.plots):
        write_whole(place / FIGURES / f"{plot.name}.csv", _csv(POINT_COLUMNS, _points(plot)))
    for name, picture in pictures.items():
        write_whole(place / FIGURES / f"{name}.svg", picture.svg)
        write_whole(place / FIGURES / f"{name}.png", picture.png)
    write_whole(place / "numbers.csv", _csv(NUMBER_COLUMNS, _numbers(report)))
    write_whole(place / "report.json", _json(report))
    write_whole(place / "report.md", markdown_page(report, pictures))
    write_whole(place / "report.html", html_page(report, pictures))


def _drawn(report: Report) -> dict[str, Picture]:
    """Return all pictures of a report by name."""
    pictures: dict[str, Picture] = {}
    for section in report.sections:
        pictures |= {plot.name: draw_plot(plot) for plot in section.plots}
        pictures |= {one.name: draw_map(one) for one in section.maps}
        paired = (scene for pair in section.pairs for scene in pair.scenes)
        for scene in (*section.scenes, *paired):
            pictures[scene.name] = draw_scene(scene)
    return pictures


def _require_names(names: Sequence[str]) -> None:
    """Refuse what cannot be the name of a file, on any system."""
    seen = set()
    for name in names:
        if not re.fullmatch(r"[A-Za-z0-9-]+", name):
            raise InputError(
                f"{name!r} cannot be a name in a report; write letters, digits and hyphens."
            )
        if name.lower() in seen:
            raise InputError(f"{name!r} is in the report twice; give each part a name of its own.")
        seen.add(name.lower())


def _csv(columns: Iterable[str], rows: Iterable[Sequence[str | float | None]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        writer.writerow([_defused(cell) if isinstance(cell, str) else cell for cell in row])
    return text.getvalue()


def _defused(text: str) -> str:
    """Return text that no spreadsheet takes for a formula, by an apostrophe before it."""
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


def _json(report: Report) -> str:
    content = {
        "title": report.title,
        "headline": report.headline,
        "text": report.text,
        "settings": [{"name": name, "value": value} for name, value in report.settings],
        "command": report.command,
        "sections": [
            {
                **asdict(section, dict_factory=_without_classes),
                "numbers": [
                    {**asdict(number), "difference": number.difference}
                    for number in section.numbers
                ],
            }
            for section in report.sections
        ],
        "classes": report.taxonomy.to_list(),
        "facts": report.facts,
        "version": __version__,
    }
    return json.dumps(_finite(content), indent=1, allow_nan=False) + "\n"


def _without_classes(items: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a part of a report without the classes of its scenes, which stand beside the parts."""
    return {name: value for name, value in items if name != "taxonomy"}


def _finite(value: Any) -> Any:  # noqa: ANN401 - whatever JSON holds
    """Return a value without what JSON has no word for."""
    if isinstance(value, np.ndarray):
        return _finite(value.tolist())
    if isinstance(value, Mapping):
        return {name: _finite(one) for name, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
