"""Tables of text, written as Markdown."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from semsig_gis.core.text import escaped

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

LARGEST_COUNT = 10**9  # larger whole numbers are identifiers


@dataclass(frozen=True, slots=True)
class Table:
    """A table of text for a report.

    Parameters
    ----------
    title : str
        Title of the table.
    columns : tuple of str
        Headings, with units.
    rows : tuple of tuple of str
        Cells as text, one for each column; empty for a missing value.
    note : str, default ""
        Explanation below the table.
    labels : int, default 1
        Number of text columns at the left; the others are numbers.
    groups : tuple of (str, tuple of str), optional
        Headings of the number columns in two rows: each group with its columns.
    bold : frozenset of (int, int), optional
        Row and column of the cells in bold.
    intervals : mapping of (int, int) to str, optional
        Intervals of the numbers in cells, by row and column.
    minor : tuple of str, optional
        Columns that a narrow terminal leaves out first.

    Examples
    --------
    >>> print(Table("Sizes", ("What", "m"), (("step", "10"),)).markdown(), end="")
    ### Sizes
    <BLANKLINE>
    | What | m |
    | --- | ---: |
    | step | 10 |
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    labels: int = 1
    groups: tuple[tuple[str, tuple[str, ...]], ...] = ()
    bold: frozenset[tuple[int, int]] = frozenset()
    intervals: Mapping[tuple[int, int], str] = field(default_factory=dict)
    minor: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        title: str,
        columns: Iterable[str],
        rows: Iterable[Iterable[object]],
        *,
        minor: tuple[str, ...] = (),
    ) -> Table:
        """Return a table of values; whole numbers get thousands separators, identifiers do not."""
        texts = (
            tuple(
                f"{cell:,}" if isinstance(cell, int) and abs(cell) < LARGEST_COUNT else str(cell)
                for cell in row
            )
            for row in rows
        )
        return cls(title, tuple(columns), tuple(texts), minor=minor)

    @classmethod
    def of_columns(
        cls,
        title: str,
        columns: Mapping[str, Iterable[str]],
        note: str = "",
        *,
        minor: tuple[str, ...] = (),
    ) -> Table:
        """Return a table from columns by heading."""
        rows = tuple(zip(*columns.values(), strict=True))
        return cls(title, tuple(columns), rows, note, minor=minor)

    @property
    def group_starts(self) -> frozenset[int]:
        """Indices of the columns where a group begins."""
        widths = [len(columns) for _, columns in self.groups[:-1]]
        return frozenset(itertools.accumulate(widths, initial=self.labels) if self.groups else ())

    @property
    def spans(self) -> tuple[int, ...]:
        """Number of rows that share the first label, by row; 0 if it repeats the row above."""
        runs = (len(list(rows)) for _, rows in itertools.groupby(row[0] for row in self.rows))
        return tuple(span for run in runs for span in (run, *[0] * (run - 1)))

    def _repr_markdown_(self) -> str:
        """Show the table in a notebook."""
        return self.markdown()

    def markdown(self) -> str:
        """Return the table as a Markdown section: heading, rows and note."""
        note = f"\n{escaped(self.note)}\n" if self.note else ""
        return f"### {escaped(self.title)}\n\n{markdown_rows(self, escaped)}\n{note}"


def markdown_rows(table: Table, escape: Callable[[str], str]) -> str:
    """Return the headings and rows of a table as Markdown; `escape` is applied to each text."""

    def cell(row: int, column: int) -> str:
        text = escape(table.rows[row][column])
        bold = f"**{text}**" if (row, column) in table.bold else text
        ends = table.intervals.get((row, column))
        return f"{bold} ({escape(ends)})" if ends else bold

    columns = range(len(table.columns))
    lines = [
        [escape(heading) for heading in table.columns],
        ["---" if column < table.labels else "---:" for column in columns],
        *([cell(row, column) for column in columns] for row in range(len(table.rows))),
    ]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def figure(value: float | None, form: str = ".4f") -> str:
    """Return a number as text, empty where it is None or NaN."""
    if value is None or math.isnan(value):
        return ""
    return "infinite" if math.isinf(value) else format(value, form)


def interval(low: float, high: float, form: str = ".4f") -> str:
    """Return the ends of an interval as text, empty where they are NaN."""
    return "" if math.isnan(low) else f"{figure(low, form)} to {figure(high, form)}"
