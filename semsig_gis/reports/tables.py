"""Tables as rows of text, for a terminal or for Markdown."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from semsig_gis.core.text import escaped, one_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from semsig_gis.reports.parts import Number


@dataclass(frozen=True, slots=True)
class Table:
    """A table to print.

    Parameters
    ----------
    title : str
        What it shows.
    columns : tuple of str
        Headings; the first column is text, the others are numbers with their units.
    rows : tuple of tuple of str
        Cells as text, one for each column; empty where there is nothing to say.
    note : str, default ""
        What a reader must know to read it rightly.

    Examples
    --------
    >>> Table("Sizes", ("What", "m"), (("step", "10"),)).note
    ''
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    def _repr_markdown_(self) -> str:
        """Show the table in a notebook."""
        return self.markdown()

    def markdown(self) -> str:
        """Return the table as a Markdown section.

        Returns
        -------
        str
            A heading of the third level, the table and the note, ending in a newline.

        Examples
        --------
        >>> print(Table("Sizes", ("What", "m"), (("step", "10"),)).markdown(), end="")
        ### Sizes
        <BLANKLINE>
        | What | m |
        | --- | ---: |
        | step | 10 |
        """
        rules = ["---", *["---:"] * (len(self.columns) - 1)]
        lines = [self.columns, tuple(rules), *self.rows]
        table = "\n".join(f"| {' | '.join(escaped(cell) for cell in line)} |" for line in lines)
        note = f"\n{escaped(self.note)}\n" if self.note else ""
        return f"### {escaped(self.title)}\n\n{table}\n{note}"


def percent(share: float) -> str:
    """Return a share from 0 to 1 as percent with one decimal: ``41.8 %``."""
    return f"{100 * share:.1f} %"


OURS, INTERVAL, PAPER, DIFFERENCE = "ours", "95 %", "paper", "difference"


NARROW = {DIFFERENCE: "diff."}


NOTHING = "\u2013"


# In letters: what fits on A4 paper and on 900 pixels; labels take so much before they wrap.
WIDEST = 102


NARROWEST_LABEL, WIDEST_LABEL, GAP = 14, 28, 3


OUTSIDE = "Bold: the paper's figure is outside our interval of 95 %."


@dataclass(frozen=True, slots=True)
class NumberCell:
    """A cell: the figure as it is shown, and its interval where that has no column of its own.

    It is strong where the paper's figure is outside our interval.
    """

    text: str
    interval: str = ""
    strong: bool = False


@dataclass(frozen=True, slots=True)
class NumberGroup:
    """Columns that belong together.

    They are some of ``ours``, ``95 %``, ``paper`` and ``difference`` (or ``diff.``).
    """

    name: str
    columns: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class NumberRow:
    """A row with one cell for each column of each group.

    ``span`` is how many rows from here on share the first label; 0 where the row above has it.
    """

    labels: tuple[str, ...]
    cells: tuple[NumberCell, ...]
    span: int = 1


@dataclass(frozen=True, slots=True)
class NumberTable:
    """A table of numbers, laid out, with a note that a reader needs to read it rightly."""

    groups: tuple[NumberGroup, ...]
    rows: tuple[NumberRow, ...]
    note: str = ""

    @property
    def labels(self) -> int:
        """How many labels a row has."""
        return len(self.rows[0].labels)

    @property
    def grouped(self) -> bool:
        """Whether a group has more than one column."""
        return any(len(group.columns) > 1 for group in self.groups)

    @property
    def firsts(self) -> frozenset[int]:
        """At which columns a group begins, where groups have names."""
        if not self.grouped or not any(group.name for group in self.groups):
            return frozenset()
        widths = [len(group.columns) for group in self.groups]
        return frozenset(itertools.accumulate(widths[:-1], initial=0))

    @property
    def headings(self) -> tuple[str, ...]:
        """One heading a column, for where groups cannot be shown."""
        return tuple(
            group.name
            if group.name and len(group.columns) == 1
            else ": ".join(part for part in (group.name, column) if part)
            for group in self.groups
            for column in group.columns
        )


def number_table(numbers: Sequence[Number]) -> NumberTable:
    """Lay out at least one number, rows and columns in the order in which they first come.

    Where the columns side by side would be too wide for a sheet of paper, each number has a row of
    its own.
    """
    units = _units(numbers)
    names = {number.column: one_line(number.column) for number in numbers}
    for column, name in names.items():
        unit = one_line(units[column] or "")
        names[column] = ", ".join(part for part in (name, unit) if part)
    note = OUTSIDE if any(_is_outside(number) for number in numbers) else ""
    table = _side_by_side(numbers, names, units)
    if table is None or _width(table) > WIDEST:
        table = _one_a_row(numbers, names, units)
    return NumberTable(*table, note)


Parts = tuple[tuple[NumberGroup, ...], tuple[NumberRow, ...]]


Units = dict[str, str | None]


def _units(numbers: Iterable[Number]) -> Units:
    """Return the unit of each column; None where its numbers have several."""
    found: Units = {}
    for number in numbers:
        unit = found.setdefault(number.column, number.unit)
        found[number.column] = unit if unit == number.unit else None
    return found


def _side_by_side(numbers: Sequence[Number], names: dict[str, str], units: Units) -> Parts | None:
    """Return a group of columns for each column; None where a place has two numbers."""
    placed = {(number.row, number.column): number for number in numbers}
    if len(placed) < len(numbers):
        return None
    kinds = {
        column: _kinds([number for number in numbers if number.column == column])
        for column in names
    }
    own = len(names) == 1  # then the interval has a column of its own
    if not own:
        kinds = {
            column: tuple(kind for kind in shown if kind != INTERVAL)
            for column, shown in kinds.items()
        }
    rows = []
    for row in dict.fromkeys(number.row for number in numbers):
        cells: list[NumberCell] = []
        for column, shown in kinds.items():
            number = placed.get((row, column))
            cells += _cells(number, shown, with_unit=units[column] is None, own=own)
        rows.append(NumberRow((one_line(row),), tuple(cells)))
    groups = tuple(
        NumberGroup(
            names[column], shown if own else tuple(NARROW.get(kind, kind) for kind in shown)
        )
        for column, shown in kinds.items()
    )
    return groups, tuple(rows)


def _one_a_row(numbers: Sequence[Number], names: dict[str, str], units: Units) -> Parts:
    shown = _kinds(numbers)
    rows = []
    for row in dict.fromkeys(number.row for number in numbers):
        same = [number for number in numbers if number.row == row]
        for at, number in enumerate(same):
            labels = (one_line(row), names[number.column])
            cells = _cells(number, shown, with_unit=units[number.column] is None, own=True)
            rows.append(NumberRow(labels, tuple(cells), len(same) if at == 0 else 0))
    return (NumberGroup("", shown),), tuple(rows)


def _kinds(numbers: Iterable[Number]) -> tuple[str, ...]:
    """Return the columns that some of the numbers fill."""
    told = {OURS}
    for number in numbers:
        if number.low is not None or number.high is not None:
            told.add(INTERVAL)
        if number.paper is not None:
            told |= {PAPER, DIFFERENCE}
    return tuple(kind for kind in (OURS, INTERVAL, PAPER, DIFFERENCE) if kind in told)


def _cells(
    number: Number | None, kinds: Iterable[str], *, with_unit: bool, own: bool
) -> list[NumberCell]:
    if number is None:
        return [NumberCell("") for _ in kinds]
    unit = f" {one_line(number.unit)}" if with_unit and number.unit else ""
    interval = _interval(number)
    interval = f"{interval}{unit}" if interval else ""
    difference = number.difference
    cells = {
        OURS: NumberCell(_shown(number.ours, number.decimals) + unit, "" if own else interval),
        INTERVAL: NumberCell(interval),
        PAPER: NumberCell("" if number.paper is None else _shown(number.paper, number.decimals)),
        DIFFERENCE: NumberCell(
            "" if difference is None else _shown(difference, number.decimals, "+"),
            strong=_is_outside(number),
        ),
    }
    for kind in (PAPER, DIFFERENCE):
        if cells[kind].text:
            cells[kind] = NumberCell(cells[kind].text + unit, strong=cells[kind].strong)
    return [cells[kind] for kind in kinds]


def _interval(number: Number) -> str:
    if number.low is None or number.high is None:
        return ""
    return " to ".join(_shown(end, number.decimals) for end in (number.low, number.high))


def _shown(value: float | None, decimals: int, sign: str = "") -> str:
    if value is None or math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "infinite" if value > 0 else "-infinite"
    rounded = round(value, decimals) + 0.0  # no -0
    return f"{rounded:{sign if rounded else ''},.{decimals}f}"


def _is_outside(number: Number) -> bool:
    if number.ours is None or number.low is None or number.high is None or number.paper is None:
        return False
    return not number.low <= number.paper <= number.high


def _width(table: Parts) -> int:
    """Return about how many letters wide a table is."""
    groups, rows = table
    longest = max(len(label) for row in rows for label in row.labels)
    total = min(max(longest, NARROWEST_LABEL), WIDEST_LABEL)
    headings = [
        column if len(group.columns) > 1 else max(group.name.split(), key=len, default=column)
        for group in groups
        for column in group.columns
    ]
    for at, heading in enumerate(headings):
        total += GAP + max(len(heading), *(_letters(row.cells[at]) for row in rows))
    return total


def _letters(cell: NumberCell) -> int:
    small = 0.8  # an interval below its figure is in small letters
    return max(len(cell.text), round(small * len(cell.interval)))
