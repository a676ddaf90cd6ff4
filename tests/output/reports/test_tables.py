from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.core import Table, figure, interval, percent
from semsig_gis.output import (
    WIDEST,
    Number,
    brief_notes,
    distortion_rows,
    note_tables,
    number_table,
)
from semsig_gis.output.tables.tables import _width

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


def test_a_table_is_markdown() -> None:
    table = Table("A|B", ("What", "m"), (("a|b", "<1"), ("x", "")), note="see\n|")
    assert table.markdown() == (
        "### A\\|B\n\n| What | m |\n| --- | ---: |\n| a\\|b | &lt;1 |\n| x |  |\n\nsee \\|\n"
    )
    assert table._repr_markdown_() == table.markdown()  # what a notebook shows


def test_numbers_as_text() -> None:
    assert percent(1.0, 1) == "100.0 %"
    values = (None, math.nan, math.inf, 1234.56)
    assert [figure(value, ",.1f") for value in values] == ["", "", "infinite", "1,234.6"]
    assert interval(math.nan, math.nan) == ""
    assert interval(0.5, math.inf) == "0.5000 to infinite"


@pytest.mark.parametrize(
    ("ours", "paper", "difference"),
    [(0.5, 0.3733, 0.1267), (None, 0.3733, None), (0.5, None, None)],
)
def test_difference_needs_both_numbers(
    ours: float | None, paper: float | None, difference: float | None
) -> None:
    assert Number("R", "P", ours, paper=paper).difference == difference


def test_interval_of_a_single_column_is_a_separate_column() -> None:
    numbers = [
        Number("R = 20 m", "P", 0.21, low=0.2, high=0.22, paper=0.1793),
        Number("R = 30 m", "P", 0.37, low=0.36, high=0.38, paper=0.3733),
        Number("R = 50 m", "P", 0.55),
    ]
    table = number_table(numbers)
    assert table.groups == (("P", ("ours", "95 %", "paper", "difference")),)
    assert table.rows == (
        ("R = 20 m", "0.2100", "0.2000 to 0.2200", "0.1793", "+0.0307"),
        ("R = 30 m", "0.3700", "0.3600 to 0.3800", "0.3733", "-0.0033"),
        ("R = 50 m", "0.5500", "", "", ""),
    )
    assert table.bold == {(0, 4)}
    assert table.intervals == {}
    assert table.note.startswith("Bold: ")


def test_several_columns_have_intervals_below_their_figures() -> None:
    numbers = [
        Number("Edit", "type", 9.1, paper=277, unit="ms", decimals=1),
        Number("Edit", "angle", 61.2, low=60, high=62, unit="ms", decimals=1),
        Number("Jaccard", "angle", 30, unit="ms", decimals=1),
    ]
    table = number_table(numbers)
    assert table.columns == (
        "",
        "type, ms: ours",
        "type, ms: paper",
        "type, ms: diff.",
        "angle, ms",
    )
    assert table.group_starts == {1, 4}
    assert table.rows == (
        ("Edit", "9.1", "277.0", "-267.9", "61.2"),
        ("Jaccard", "", "", "", "30.0"),
    )
    assert table.intervals == {(0, 4): "60.0 to 62.0"}
    assert (table.bold, table.note) == (frozenset(), "")


def test_too_wide_table_has_a_row_for_each_number() -> None:
    numbers = [
        Number(row, f"column {column}", 0.5, paper=0.5) for column in range(5) for row in ("a", "b")
    ]
    table = number_table(numbers)
    assert table.labels == 2
    assert [row[:2] for row in table.rows[4:6]] == [("a", "column 4"), ("b", "column 0")]
    assert table.spans == (5, 0, 0, 0, 0) * 2
    assert table.columns == ("", "", "ours", "paper", "difference")
    assert (table.groups, table.group_starts) == ((), frozenset())


def test_two_numbers_of_a_row_and_column_are_both_shown() -> None:
    twice = [Number("a", "b", value, decimals=0) for value in (1.0, 2.0)]
    assert number_table(twice).rows == (("a", "b", "1"), ("a", "b", "2"))


def test_different_units_of_a_column_are_in_the_cells() -> None:
    numbers = [
        Number("Range", "City", 30, low=29, high=31, paper=30, unit="m", decimals=0),
        Number("Cells", "City", 312_806, paper=312_134, decimals=0),
    ]
    assert number_table(numbers).rows == (
        ("Range", "30 m", "29 to 31 m", "30 m", "0 m"),
        ("Cells", "312,806", "", "312,134", "+672"),
    )


@pytest.mark.parametrize(
    ("value", "shown"),
    [(None, "\u2013"), (math.nan, "\u2013"), (math.inf, "infinite"), (-1e-9, "0.0000")],
)
def test_texts_of_missing_infinite_and_tiny_numbers(value: float | None, shown: str) -> None:
    table = number_table([Number("a", "b", value)])
    assert (table.columns, table.rows) == (("", "b"), (("a", shown),))


@given(NUMBERS)
def test_table_shows_every_number_once_and_is_not_too_wide(numbers: list[Number]) -> None:
    table = number_table(numbers)
    assert all(len(row) == len(table.columns) for row in table.rows)
    ours = [
        at
        for at, heading in enumerate(table.columns)
        if at >= table.labels and not heading.endswith(("paper", "difference", "diff.", "95 %"))
    ]
    shown = [row[at] for row in table.rows for at in ours if row[at]]
    assert len(shown) == len(numbers)
    assert table.labels == 2 or _width(table) <= WIDEST
    assert sum(table.spans) == len(table.rows)
    assert list(dict.fromkeys(row[0] for row in table.rows)) == list(
        dict.fromkeys(" ".join(number.row.split()) for number in numbers)
    )


def test_notes_about_rows_of_a_layer_are_shortened() -> None:
    notes = (
        "odd",
        "a: old",
        "a: row 9: broken",
        "a: row 12: no ring",
        "b: row 1: broken",
        "b: few",
    )
    shown = ["odd", "a: old", "a: row 9: broken; and 1 more (--json)", "b: row 1: broken", "b: few"]
    assert list(brief_notes(notes)) == shown
    (table,) = note_tables(notes)
    assert [note for (note,) in table.rows] == shown
    assert list(brief_notes(["row 1: x", "row 2: x", "row 3: y"])) == [
        "row 1: x; and 2 more (--json)"
    ]
    assert note_tables(()) == ()


def test_grid_north_has_no_minus_before_zero() -> None:
    facts = {"convergence": (-0.0038, 0.0038), "angle": 0.0038, "stretch": 0.0004}
    (_, text), _ = distortion_rows(facts)
    assert text == "at most 0.00° off true north (0.00° clockwise)"
