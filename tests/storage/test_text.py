"""Text files: limits of reading them, JSON, values as TOML, and rows of CSV and JSON lines.

Wrong TOML files are tested with catalogues.
"""

from __future__ import annotations

import json
import os
import sys
import tomllib
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core import InputError
from semsig_gis.storage import (
    MAX_TEXT_BYTES,
    parse_json,
    parse_rows,
    read_rows,
    read_text,
    read_whole,
    toml_text,
)

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.skipif(sys.platform == "win32", reason="no such files")
def test_pipe_and_device_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", "/dev/zero"):
        with pytest.raises(OSError, match="it is a pipe or a device, not a file"):
            read_whole(path)


def test_too_large_file_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "long.json").open("wb") as file:
        file.truncate(MAX_TEXT_BYTES + 1)  # sparse: takes no space on the disk
    with pytest.raises(OSError, match=r"it has 268,435,457 bytes, and at most 268,435,456 "):
        read_whole(tmp_path / "long.json")


def test_byte_order_mark_is_removed(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_bytes("\ufeffé".encode())
    assert read_text(tmp_path / "a.toml") == "é"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[" * 200_000, "nested too deeply"),
        ('{"a": ' * 200_000, "nested too deeply"),
        ('{"a": NaN}', "NaN is not a finite number"),
        ("[-Infinity]", "-Infinity is not a finite number"),
        ("[1e999]", "1e999 is not a finite number"),
        (f"[{10**40}]", "10000000000000000000 is beyond 64 bits"),
        ("[" + "1" * 10_000 + "]", "digits"),
    ],
)
def test_finite_json_refuses_deep_nesting_and_unusable_numbers(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        parse_json(text, finite=True)


def test_other_json_may_contain_any_number() -> None:
    assert parse_json("[1e999, 1.5, 7]")[1:] == [1.5, 7]
    assert parse_json("[1.5, -7]", finite=True) == [1.5, -7]


# --- TOML -------------------------------------------------------------------------------------

WORDS = st.text(st.characters(codec="utf-8", exclude_categories=["Cs"]), max_size=8)
PLAIN = st.one_of(st.booleans(), st.integers(-(10**9), 10**9), st.floats(-1e9, 1e9), WORDS)
VALUES: st.SearchStrategy[Any] = st.recursive(
    st.one_of(PLAIN, st.lists(PLAIN, max_size=3)),
    lambda inner: st.one_of(
        st.dictionaries(WORDS, inner, min_size=1, max_size=3),
        st.lists(st.dictionaries(WORDS, PLAIN, max_size=2), max_size=2),
    ),
    max_leaves=8,
)


@given(st.dictionaries(WORDS, VALUES, max_size=4))
def test_toml_text_is_parsed_to_the_same_values(table: dict[str, Any]) -> None:
    assert tomllib.loads(toml_text(table)) == table


def test_values_after_tables_belong_to_the_right_section() -> None:
    table = {"noises": {"mine": {"clutter": 2.0, "by_class": {"bench": 0.5}}}, "queries": 3}
    text = toml_text({**table, "parts": {}})  # an empty table is omitted
    assert text.startswith("queries = 3\n\n[noises.mine]\nclutter = 2.0\n")
    assert tomllib.loads(text) == table


# --- Rows -------------------------------------------------------------------------------------

CELLS = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=6)


@given(st.lists(st.fixed_dictionaries({"a": CELLS, "b": CELLS}), min_size=1, max_size=4))
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
    ("name", "text", "words"),
    [
        ("x.jsonl", "", ["no rows", "one thing"]),
        ("x.csv", "a,b\n", ["no rows"]),
        ("x.jsonl", "{", ["line 1", "not JSON"]),
        ("x.jsonl", "\n[1]", ["line 2", "names and values"]),
        ("x.jsonl", "[" * 100_000, ["line 1"]),
        ("x.csv", "types\n" + "D" * 200_000, ["not CSV"]),
    ],
)
def test_error_names_the_unusable_row(
    tmp_path: Path, name: str, text: str, words: list[str]
) -> None:
    (tmp_path / name).write_text(text)
    with refused(InputError, name, *words):
        read_rows(tmp_path / name, dict, what="thing")
