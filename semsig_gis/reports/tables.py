"""Tables for people: on a terminal, in Markdown and on a page."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from semsig_gis.core import Table, one_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from semsig_gis.reports.report_model import Number


def distortion_rows(facts: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Return what a table says of the plane and the ground (`Distortion.to_dict`)."""
    if facts["stretch"] is None:
        return (("Grid north", "unknown"), ("Lengths", "unknown"))
    # Plus 0 so that there is no minus before a zero.
    turned = " to ".join(dict.fromkeys(f"{round(x, 2) + 0.0:.2f}°" for x in facts["convergence"]))
    return (
        ("Grid north", f"at most {facts['angle']:.2f}° off true north ({turned} clockwise)"),
        ("Lengths", f"at most {100 * facts['stretch']:.2g} % off"),
    )


def note_tables(notes: Sequence[str]) -> tuple[Table, ...]:
    """Return a table of notes; none where there are no notes."""
    rows = tuple((note,) for note in brief_notes(notes))
    return (Table("Notes", ("note",), rows),) if rows else ()


# A note about one row, with the name of its layer or without.
_ROW = re.compile(r"([^:]*: )?row \d+: ")


def brief_notes(notes: Iterable[str]) -> Iterator[str]:
    """Yield notes; of those about single rows of a layer the first, and how many follow it."""

    def layer(note: str) -> str | None:
        found = _ROW.match(note)
        return found and (found[1] or "")

    for name, run in itertools.groupby(notes, key=layer):
        first, *others = run
        if name is None:
            yield from (first, *others)
        else:
            yield f"{first}; and {len(others)} more (--json)" if others else first


KILOMETRE = 1000.0


def short_percent(share: float, *, unit: str = " %") -> str:
    """Return a share from 0 to 1 for a sentence: ``82 %``, ``8.3 %``, ``0.4 %``."""
    return f"{round(100 * share, 0 if 0.0995 <= share <= 0.99 else 1):g}{unit}"  # noqa: PLR2004


def length(metres: float) -> str:
    """Return a length as text: ``2.5 m``, ``340 m``, ``11.2 km``."""
    if metres < 10.0:  # noqa: PLR2004
        return f"{metres:.2g} m"
    return f"{metres:,.0f} m" if metres < KILOMETRE else f"{metres / KILOMETRE:,.3g} km"


OURS, INTERVAL, PAPER, DIFFERENCE = "ours", "95 %", "paper", "difference"
NARROW = {DIFFERENCE: "diff."}
NOTHING = "\u2013"
# In letters: what fits on A4 paper and on 900 pixels; labels take so much before they wrap.
WIDEST = 102
NARROWEST_LABEL, WIDEST_LABEL, GAP = 14, 28, 3
OUTSIDE = "Bold: the paper's figure is outside our interval of 95 %."


class _Cell(NamedTuple):
    text: str
    interval: str = ""
    bold: bool = False


def number_table(numbers: Sequence[Number]) -> Table:
    """Lay out at least one number, rows and columns in the order in which they first come.

    Where that would be too wide for a sheet of paper, each number has a row of its own.
    """
    units = _units(numbers)
    names = {number.column: one_line(number.column) for number in numbers}
    for column, name in names.items():
        unit = one_line(units[column] or "")
        names[column] = ", ".join(part for part in (name, unit) if part)
    table = _side_by_side(numbers, names, units)
    if table is None or _width(table) > WIDEST:
        table = _one_a_row(numbers, names, units)
    return replace(table, note=OUTSIDE if any(map(_is_outside, numbers)) else "")


Units = dict[str, str | None]


def _units(numbers: Iterable[Number]) -> Units:
    """Return the unit of each column; None where its numbers have several."""
    units: Units = {}
    for number in numbers:
        unit = units.setdefault(number.column, number.unit)
        units[number.column] = unit if unit == number.unit else None
    return units


def _side_by_side(numbers: Sequence[Number], names: dict[str, str], units: Units) -> Table | None:
    """Return a group of columns for each column; None where a place has two numbers."""
    placed = {(number.row, number.column): number for number in numbers}
    if len(placed) < len(numbers):
        return None
    own = len(names) == 1  # then the interval has a column of its own
    kinds = {
        column: [
            kind
            for kind in _kinds(number for number in numbers if number.column == column)
            if own or kind != INTERVAL
        ]
        for column in names
    }
    rows = [
        [
            _Cell(one_line(row)),
            *(
                cell
                for column, shown in kinds.items()
                for cell in _cells(
                    placed.get((row, column)), shown, with_unit=units[column] is None, own=own
                )
            ),
        ]
        for row in dict.fromkeys(number.row for number in numbers)
    ]
    groups = tuple(
        (names[column], tuple(shown if own else [NARROW.get(kind, kind) for kind in shown]))
        for column, shown in kinds.items()
    )
    columns = [
        name if name and len(shown) == 1 else ": ".join(part for part in (name, kind) if part)
        for name, shown in groups
        for kind in shown
    ]
    in_two_rows = any(name for name, _ in groups) and any(len(shown) > 1 for _, shown in groups)
    return _table(1, columns, rows, groups if in_two_rows else ())


def _one_a_row(numbers: Sequence[Number], names: dict[str, str], units: Units) -> Table:
    kinds = _kinds(numbers)
    rows = [
        [
            _Cell(one_line(row)),
            _Cell(names[number.column]),
            *_cells(number, kinds, with_unit=units[number.column] is None, own=True),
        ]
        for row in dict.fromkeys(number.row for number in numbers)
        for number in numbers
        if number.row == row
    ]
    return _table(2, kinds, rows)


def _table(
    labels: int,
    columns: Iterable[str],
    rows: Sequence[Sequence[_Cell]],
    groups: tuple[tuple[str, tuple[str, ...]], ...] = (),
) -> Table:
    cells = {(row, at): cell for row, line in enumerate(rows) for at, cell in enumerate(line)}
    return Table(
        title="",
        columns=(*[""] * labels, *columns),
        rows=tuple(tuple(cell.text for cell in line) for line in rows),
        labels=labels,
        groups=groups,
        bold=frozenset(place for place, cell in cells.items() if cell.bold),
        intervals={place: cell.interval for place, cell in cells.items() if cell.interval},
    )


def _kinds(numbers: Iterable[Number]) -> list[str]:
    """Return the columns that some of the numbers fill."""
    filled = {OURS}
    for number in numbers:
        if number.low is not None or number.high is not None:
            filled.add(INTERVAL)
        if number.paper is not None:
            filled |= {PAPER, DIFFERENCE}
    return [kind for kind in (OURS, INTERVAL, PAPER, DIFFERENCE) if kind in filled]


def _cells(
    number: Number | None, kinds: Iterable[str], *, with_unit: bool, own: bool
) -> list[_Cell]:
    if number is None:
        return [_Cell("") for _ in kinds]
    unit = f" {one_line(number.unit)}" if with_unit and number.unit else ""

    def shown(value: float | None, sign: str = "") -> str:
        return "" if value is None else _shown(value, number.decimals, sign) + unit

    ours = math.nan if number.ours is None else number.ours
    ends = ""
    if number.low is not None and number.high is not None:
        ends = f"{_shown(number.low, number.decimals)} to {shown(number.high)}"
    cells = {
        OURS: _Cell(shown(ours), "" if own else ends),
        INTERVAL: _Cell(ends),
        PAPER: _Cell(shown(number.paper)),
        DIFFERENCE: _Cell(shown(number.difference, "+"), bold=_is_outside(number)),
    }
    return [cells[kind] for kind in kinds]


def _shown(value: float, decimals: int, sign: str = "") -> str:
    if math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "infinite" if value > 0 else "-infinite"
    rounded = round(value, decimals) + 0.0  # no -0
    return f"{rounded:{sign if rounded else ''},.{decimals}f}"


def _is_outside(number: Number) -> bool:
    if number.ours is None or number.low is None or number.high is None or number.paper is None:
        return False
    return not number.low <= number.paper <= number.high


def _width(table: Table) -> int:
    """Return about how many letters wide a table with one column of labels is."""
    longest = max(len(row[0]) for row in table.rows)
    total = min(max(longest, NARROWEST_LABEL), WIDEST_LABEL)
    groups = table.groups or [(column, (column,)) for column in table.columns[1:]]
    headings = [
        column if len(columns) > 1 else max(name.split(), key=len, default=column)
        for name, columns in groups
        for column in columns
    ]
    small = 0.8  # an interval below its figure is in small letters
    for at, heading in enumerate(headings, start=1):
        letters = (
            max(len(line[at]), round(small * len(table.intervals.get((row, at), ""))))
            for row, line in enumerate(table.rows)
        )
        total += GAP + max(len(heading), *letters)
    return total
