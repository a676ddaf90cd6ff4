"""A report as a page of HTML or Markdown, in which text from data is only ever text."""

from __future__ import annotations

import base64
import re
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from semsig_gis import __version__
from semsig_gis.report_tables import number_table
from semsig_gis.tables import escaped, one_line

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from semsig_gis.pictures import Picture
    from semsig_gis.report_parts import Report, Section
    from semsig_gis.report_tables import NumberCell, NumberTable

__all__ = ["html_page", "markdown_page"]

# What has a meaning to Markdown anywhere, besides what `escaped` knows, and at the beginning.
MARKS = re.compile(r"([\\`*_\[\]{}~$])")
FIRST_MARKS = re.compile(r"^(\d*)([-+=>#.)])")


def html_page(report: Report, pictures: Mapping[str, Picture]) -> str:
    """Return a report as one page of HTML with its pictures in it, which loads nothing."""
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
        images={
            name: base64.b64encode(picture.svg).decode("ascii")
            for name, picture in pictures.items()
        },
        alts={name: picture.description for name, picture in pictures.items()},
        version=__version__,
    )


def markdown_page(report: Report, pictures: Mapping[str, Picture]) -> str:
    """Return a report as Markdown, with its pictures shown from the folder ``figures``."""
    blocks = [f"# {_inline(report.title)}", *map(_paragraph, report.text)]
    if report.settings:
        rows = [(_inline(name), _inline(value)) for name, value in report.settings]
        blocks.append(_table(("Setting", "Value"), rows, texts=2))
    tables = _tables(report)
    for section in report.sections:
        blocks += [f"## {_inline(section.title)}", *map(_paragraph, section.text)]
        if section.name in tables:
            blocks += _number_blocks(tables[section.name])
        blocks += _picture_blocks(section, pictures)
    return "\n\n".join(blocks) + "\n"


def _finalized(value: Any) -> Any:  # noqa: ANN401 - whatever a template shows
    return one_line(value) if type(value) is str else value


def _tables(report: Report) -> dict[str, NumberTable]:
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


def _number_blocks(table: NumberTable) -> Iterator[str]:
    rows = [(*map(_inline, row.labels), *map(_markdown_cell, row.cells)) for row in table.rows]
    headings = [*[""] * table.labels, *map(_inline, table.headings)]
    yield _table(headings, rows, texts=table.labels)
    if table.note:
        yield _paragraph(table.note)


def _markdown_cell(cell: NumberCell) -> str:
    text = f"**{_inline(cell.text)}**" if cell.strong else _inline(cell.text)
    return f"{text} ({_inline(cell.interval)})" if cell.interval else text


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]], *, texts: int) -> str:
    rules = ["---"] * texts + ["---:"] * (len(headings) - texts)
    return "\n".join(f"| {' | '.join(line)} |" for line in (headings, rules, *rows))


def _picture_blocks(section: Section, pictures: Mapping[str, Picture]) -> Iterator[str]:
    for part in section.drawn:
        yield f"![{_inline(pictures[part.name].description)}](figures/{part.name}.svg)"
