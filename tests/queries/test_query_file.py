from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import assert_sentence

from semsig_gis.core.errors import InputError
from semsig_gis.queries.file import parse_queries, read_queries
from semsig_gis.sources.catalog import paper_taxonomy

if TYPE_CHECKING:
    from pathlib import Path

TAXONOMY = paper_taxonomy()
ROWS = st.lists(
    st.lists(st.tuples(st.sampled_from("BCDEG?"), st.integers(0, 359)), min_size=1, max_size=6),
    min_size=1,
    max_size=5,
)


@given(ROWS)
def test_json_lines_and_csv_say_the_same(
    tmp_path_factory: pytest.TempPathFactory, rows: list[list[tuple[str, int]]]
) -> None:
    folder = tmp_path_factory.mktemp("queries")
    plain = [
        {"id": f"q{number}", "types": "".join(t for t, _ in row), "bearings": [b for _, b in row]}
        for number, row in enumerate(rows)
    ]
    lines = folder / "queries.jsonl"
    lines.write_text("\n".join(map(json.dumps, plain)) + "\n\n")
    table = folder / "queries.csv"
    text = [f"{q['id']},{q['types']},{' '.join(map(str, q['bearings']))}" for q in plain]
    table.write_text("\ufeffid,types,bearings\n" + "\n".join(text))
    one, other = (read_queries(path, taxonomy=TAXONOMY) for path in (lines, table))
    assert [name for name, _ in one] == [name for name, _ in other] == [q["id"] for q in plain]
    for (_, query), (_, same), row in zip(one, other, rows, strict=True):
        assert query.codes is not None
        assert query.bearings is not None
        assert same.codes is not None
        assert same.bearings is not None
        assert query.codes.tolist() == same.codes.tolist()
        assert query.bearings.tolist() == same.bearings.tolist() == sorted(b for _, b in row)


def test_a_part_may_be_missing_and_lines_are_numbered() -> None:
    found = parse_queries('\n{"types": "DB"}\n{"bearings": [5, 6]}', "x", taxonomy=TAXONOMY)
    assert [name for name, _ in found] == [2, 3]
    assert found[0][1].bearings is None
    assert found[1][1].codes is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ("no rows",)),
        ("{", ("line 1", "not JSON")),
        ("[1]", ("line 1", "no query")),
        ('{"types": "Z"}', ("line 1", "'Z'")),
        ('{"types": "DB", "bearings": [1]}', ("line 1", "2 types and 1 bearings")),
        ('{"types": "D"}\n{"other": 1}', ("line 2", "needs types, bearings or both")),
        ('{"types": "D", "bearings": ["north"]}', ("line 1", "not all numbers")),
    ],
)
def test_what_is_no_query_is_named(text: str, words: tuple[str, ...]) -> None:
    with pytest.raises(InputError) as caught:
        parse_queries(text, "these lines", taxonomy=TAXONOMY)
    assert_sentence(caught.value, "these lines", *words)


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    for name in ("a.csv", "b.csv"):
        with pytest.raises(InputError) as caught:
            read_queries(tmp_path / name, taxonomy=TAXONOMY)
        assert_sentence(caught.value, name, "cannot be read")
