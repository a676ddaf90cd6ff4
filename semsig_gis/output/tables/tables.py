"""Texts and tables that several reports share, and the table of the numbers of a section."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from semsig_gis.core import LIKELIHOOD, Table, one_line
from semsig_gis.localization import LikelihoodMethod

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from semsig_gis.localization import AnyMethod
    from semsig_gis.output.report_model import Number


def distortion_rows(facts: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Return rows about the distortion of the map projection (`Distortion.to_dict`)."""
    if facts["stretch"] is None:
        return (("Grid north", "unknown"), ("Lengths", "unknown"))
    # Adding 0 changes -0 to 0.
    angles = " to ".join(dict.fromkeys(f"{round(x, 2) + 0.0:.2f}°" for x in facts["convergence"]))
    return (
        ("Grid north", f"at most {facts['angle']:.2f}° off true north ({angles} clockwise)"),
        ("Lengths", f"at most {100 * facts['stretch']:.2g} % off"),
    )


def note_tables(notes: Sequence[str]) -> tuple[Table, ...]:
    """Return a table of the notes, or no table if there are none."""
    rows = tuple((note,) for note in brief_notes(notes))
    return (Table("Notes", ("note",), rows),) if rows else ()


# A note about one row, with or without the name of its layer.
_ROW_NOTE = re.compile(r"([^:]*: )?row \d+: ")


def brief_notes(notes: Iterable[str]) -> Iterator[str]:
    """Yield the notes; successive notes about rows of a layer become the first and a number."""

    def layer(note: str) -> str | None:
        match = _ROW_NOTE.match(note)
        return match and (match[1] or "")

    for name, group in itertools.groupby(notes, key=layer):
        first, *others = group
        if name is None:
            yield from (first, *others)
        else:
            yield f"{first}; and {len(others)} more (--json)" if others else first


def method_words(method: AnyMethod) -> str:
    """Return a method for people: ``likelihood, noise: generic, from the centres of cells``."""
    if not isinstance(method, LikelihoodMethod):
        return str(method)
    sigma = method.north_sigma
    settings = {
        "searched between the centres of cells": method.refined,
        "from the centres of cells": method.on_grid,
        "surely from this area": method.surely_here,
        f"north ± {sigma:g}°": 0.0 < sigma < math.inf,
        "north unknown": sigma == math.inf,
    }
    names = (name for name, applies in settings.items() if applies)
    return ", ".join([LIKELIHOOD, f"noise: {method.noise.name}", *names])


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
SHORT_HEADINGS = {DIFFERENCE: "diff."}
NO_NUMBER = "\u2013"
# Widths in letters: of a table on A4 paper or 900 pixels, of labels until they wrap, and between
# columns.
WIDEST = 102
NARROWEST_LABEL, WIDEST_LABEL, GAP = 14, 28, 3
OUTSIDE = "Bold: the paper's figure is outside our interval of 95 %."


class _Cell(NamedTuple):
    text: str
    interval: str = ""
    bold: bool = False


def number_table(numbers: Sequence[Number]) -> Table:
    """Return a table of at least one number; rows and columns are in order of first occurrence.

    If that is too wide for a sheet of paper, each number is in a separate row.
    """
    # A column whose numbers have different units shows the unit with each number.
    units: Units = {}
    for number in numbers:
        unit = units.setdefault(number.column, number.unit)
        units[number.column] = unit if unit == number.unit else None
    names = {number.column: one_line(number.column) for number in numbers}
    for column, name in names.items():
        heading = (name, one_line(units[column] or ""))
        names[column] = ", ".join(part for part in heading if part)
    table = _wide_table(numbers, names, units)
    if table is None or _width(table) > WIDEST:
        table = _long_table(numbers, names, units)
    return replace(table, note=OUTSIDE if any(map(_is_outside, numbers)) else "")


Units = dict[str, str | None]


def _wide_table(numbers: Sequence[Number], names: dict[str, str], units: Units) -> Table | None:
    """Return a table with a group of columns for each column of `numbers`.

    None if a row has two numbers in one column.
    """
    by_place = {(number.row, number.column): number for number in numbers}
    if len(by_place) < len(numbers):
        return None
    single = len(names) == 1  # then the interval is a separate column
    kinds = {
        column: [
            kind
            for kind in _kinds(number for number in numbers if number.column == column)
            if single or kind != INTERVAL
        ]
        for column in names
    }
    rows = []
    for row in dict.fromkeys(number.row for number in numbers):
        cells = [_Cell(one_line(row))]
        for column, shown in kinds.items():
            number, with_unit = by_place.get((row, column)), units[column] is None
            cells += _cells(number, shown, with_unit=with_unit, interval_column=single)
        rows.append(cells)
    headings = {} if single else SHORT_HEADINGS
    groups = tuple(
        (names[column], tuple(headings.get(kind, kind) for kind in shown))
        for column, shown in kinds.items()
    )
    columns = [
        name if name and len(shown) == 1 else ": ".join(part for part in (name, kind) if part)
        for name, shown in groups
        for kind in shown
    ]
    in_two_rows = any(name for name, _ in groups) and any(len(shown) > 1 for _, shown in groups)
    return _table(1, columns, rows, groups if in_two_rows else ())


def _long_table(numbers: Sequence[Number], names: dict[str, str], units: Units) -> Table:
    """Return a table with a separate row for each number, grouped by the rows of `numbers`."""
    kinds = _kinds(numbers)
    rows = [
        [
            _Cell(one_line(row)),
            _Cell(names[number.column]),
            *_cells(number, kinds, with_unit=units[number.column] is None, interval_column=True),
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
    """Return the kinds of columns that at least one of the numbers fills."""
    filled = {OURS}
    for number in numbers:
        if number.low is not None or number.high is not None:
            filled.add(INTERVAL)
        if number.paper is not None:
            filled |= {PAPER, DIFFERENCE}
    return [kind for kind in (OURS, INTERVAL, PAPER, DIFFERENCE) if kind in filled]


def _cells(
    number: Number | None, kinds: Iterable[str], *, with_unit: bool, interval_column: bool
) -> list[_Cell]:
    if number is None:
        return [_Cell("") for _ in kinds]
    unit = f" {one_line(number.unit)}" if with_unit and number.unit else ""

    def text(value: float | None, sign: str = "") -> str:
        return "" if value is None else _number_text(value, number.decimals, sign) + unit

    ours = math.nan if number.ours is None else number.ours
    ends = ""
    if number.low is not None and number.high is not None:
        ends = f"{_number_text(number.low, number.decimals)} to {text(number.high)}"
    cells = {
        OURS: _Cell(text(ours), "" if interval_column else ends),
        INTERVAL: _Cell(ends),
        PAPER: _Cell(text(number.paper)),
        DIFFERENCE: _Cell(text(number.difference, "+"), bold=_is_outside(number)),
    }
    return [cells[kind] for kind in kinds]


def _number_text(value: float, decimals: int, sign: str = "") -> str:
    if math.isnan(value):
        return NO_NUMBER
    if math.isinf(value):
        return "infinite" if value > 0 else "-infinite"
    rounded = round(value, decimals) + 0.0  # no -0
    return f"{rounded:{sign if rounded else ''},.{decimals}f}"


def _is_outside(number: Number) -> bool:
    if number.ours is None or number.low is None or number.high is None or number.paper is None:
        return False
    return not number.low <= number.paper <= number.high


def _width(table: Table) -> int:
    """Return the approximate width in letters of a table with one column of labels."""
    longest = max(len(row[0]) for row in table.rows)
    total = min(max(longest, NARROWEST_LABEL), WIDEST_LABEL)
    groups = table.groups or [(column, (column,)) for column in table.columns[1:]]
    headings = [
        column if len(columns) > 1 else max(name.split(), key=len, default=column)
        for name, columns in groups
        for column in columns
    ]
    small = 0.8  # relative size of the letters of an interval below its figure
    for at, heading in enumerate(headings, start=1):
        letters = (
            max(len(line[at]), round(small * len(table.intervals.get((row, at), ""))))
            for row, line in enumerate(table.rows)
        )
        total += GAP + max(len(heading), *letters)
    return total
