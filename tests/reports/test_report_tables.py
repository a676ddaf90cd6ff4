"""Tests of semsig_gis.reports.tables."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.reports.parts import Number
from semsig_gis.reports.tables import WIDEST, NumberCell, NumberGroup, _width, number_table

if TYPE_CHECKING:
    from semsig_gis.reports.tables import NumberTable

FIGURES = st.none() | st.floats(-1e6, 1e6)
NUMBERS = st.lists(
    st.builds(
        Number,
        row=st.sampled_from(["Jaccard", "edit", "a label that goes on and on " * 3]),
        column=st.sampled_from(["type", "angle", "both", ""]),
        ours=FIGURES,
        low=FIGURES,
        high=FIGURES,
        paper=FIGURES,
        unit=st.sampled_from(["", "m", "ms"]),
        decimals=st.integers(0, 4),
    ),
    min_size=1,
    max_size=12,
)


def cells(table: NumberTable) -> list[list[str]]:
    return [[*row.labels, *(cell.text for cell in row.cells)] for row in table.rows]


def test_one_column_has_its_interval_in_a_column() -> None:
    numbers = [
        Number(row="R = 20 m", column="P", ours=0.21, low=0.2, high=0.22, paper=0.1793),
        Number(row="R = 30 m", column="P", ours=0.37, low=0.36, high=0.38, paper=0.3733),
        Number(row="R = 50 m", column="P", ours=0.55),
    ]
    table = number_table(numbers)
    assert table.groups == (NumberGroup("P", ("ours", "95 %", "paper", "difference")),)
    assert cells(table) == [
        ["R = 20 m", "0.2100", "0.2000 to 0.2200", "0.1793", "+0.0307"],
        ["R = 30 m", "0.3700", "0.3600 to 0.3800", "0.3733", "-0.0033"],
        ["R = 50 m", "0.5500", "", "", ""],
    ]
    assert [row.cells[3].strong for row in table.rows] == [True, False, False]
    assert table.note.startswith("Bold: ")


def test_several_columns_stand_side_by_side() -> None:
    numbers = [
        Number(row="Edit", column="type", ours=9.1, paper=277, unit="ms", decimals=1),
        Number(row="Edit", column="angle", ours=61.2, low=60, high=62, unit="ms", decimals=1),
        Number(row="Jaccard", column="angle", ours=30, unit="ms", decimals=1),
    ]
    table = number_table(numbers)
    assert table.headings == (
        "type, ms: ours",
        "type, ms: paper",
        "type, ms: diff.",
        "angle, ms",
    )
    assert table.firsts == {0, 3}
    assert table.rows[0].cells[3] == NumberCell("61.2", "60.0 to 62.0")
    assert cells(table)[1] == ["Jaccard", "", "", "", "30.0"]
    assert table.note == ""


def test_what_is_too_wide_has_a_row_for_each_number() -> None:
    numbers = [
        Number(row=row, column=f"column {column}", ours=0.5, paper=0.5)
        for column in range(5)
        for row in ("a", "b")
    ]
    table = number_table(numbers)
    assert table.labels == 2
    assert [row.labels for row in table.rows[4:6]] == [("a", "column 4"), ("b", "column 0")]
    assert [row.span for row in table.rows] == [5, 0, 0, 0, 0] * 2
    assert table.headings == ("ours", "paper", "difference")
    assert table.firsts == frozenset()


def test_a_place_with_two_numbers_shows_both() -> None:
    twice = [Number(row="a", column="b", ours=value, decimals=0) for value in (1.0, 2.0)]
    assert cells(number_table(twice)) == [["a", "b", "1"], ["a", "b", "2"]]


def test_units_that_differ_stand_in_the_cells() -> None:
    numbers = [
        Number(
            row="Range", column="City", ours=30, low=29, high=31, paper=30, unit="m", decimals=0
        ),
        Number(row="Cells", column="City", ours=312_806, paper=312_134, decimals=0),
    ]
    assert cells(number_table(numbers)) == [
        ["Range", "30 m", "29 to 31 m", "30 m", "0 m"],
        ["Cells", "312,806", "", "312,134", "+672"],
    ]


@pytest.mark.parametrize(
    ("value", "shown"),
    [(None, "\u2013"), (math.nan, "\u2013"), (math.inf, "infinite"), (-1e-9, "0.0000")],
)
def test_odd_values(value: float | None, shown: str) -> None:
    table = number_table([Number(row="a", column="b", ours=value)])
    assert cells(table) == [["a", shown]]
    assert table.headings == ("b",)


@given(NUMBERS)
def test_every_number_is_shown_once_and_no_table_is_too_wide(numbers: list[Number]) -> None:
    table = number_table(numbers)
    columns = len(table.headings)
    assert all(len(row.cells) == columns for row in table.rows)
    shown = [
        row.cells[at].text
        for row in table.rows
        for at, heading in enumerate(table.headings)
        if row.cells[at].text and not heading.endswith(("paper", "difference", "diff.", "95 %"))
    ]
    assert len(shown) == len(numbers)
    assert table.labels == 2 or _width((table.groups, table.rows)) <= WIDEST
    assert sum(row.span for row in table.rows) == len(table.rows)
    rows = [row.labels[0] for row in table.rows]
    assert list(dict.fromkeys(rows)) == list(
        dict.fromkeys(" ".join(number.row.split()) for number in numbers)
    )
