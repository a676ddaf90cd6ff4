"""Rows of CSV and JSON lines."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core import InputError
from semsig_gis.storage import parse_rows, read_rows

if TYPE_CHECKING:
    from pathlib import Path

WORDS = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=6)


@given(st.lists(st.fixed_dictionaries({"a": WORDS, "b": WORDS}), min_size=1, max_size=4))
def test_rows_of_json_lines_are_read(rows: list[dict[str, str]]) -> None:
    text = "\n".join(json.dumps(row) for row in rows)
    rows_read = parse_rows(text.split("\n"), "x", dict, what="thing")
    assert rows_read == list(enumerate(rows, start=1))


def test_quoted_cells_may_contain_commas_and_line_breaks(tmp_path: Path) -> None:
    path = tmp_path / "rows.CSV"
    path.write_text('\ufeffid,types\n"a, b",D\n\n"c\nd",B\n', encoding="utf-8")
    rows_read = read_rows(path, lambda row: (row["id"], row["types"]), what="thing")
    assert rows_read == [(2, ("a, b", "D")), (5, ("c\nd", "B"))]


@pytest.mark.parametrize(
    ("text", "table", "words"),
    [
        ("", False, ["no rows", "one thing"]),
        ("a,b\n", True, ["no rows"]),
        ("{", False, ["line 1", "not JSON"]),
        ("\n[1]", False, ["line 2", "names and values"]),
        ("[" * 100_000, False, ["line 1"]),
        ("types\n" + "D" * 200_000, True, ["not CSV"]),
    ],
)
def test_error_names_the_unusable_row(
    tmp_path: Path,
    text: str,
    table: bool,  # noqa: FBT001
    words: list[str],
) -> None:
    path = tmp_path / ("x.csv" if table else "x.jsonl")
    path.write_text(text)
    with refused(InputError, path.name, *words):
        read_rows(path, dict, what="thing")
