"""Files of queries and of routes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import parts_of
from sentences import assert_sentence, refused
from worlds import TAXONOMY

from semsig_gis.core import InputError, Signature
from semsig_gis.observation import Leg, North, parse_queries, parse_route, read_queries, read_route

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.observation import QueryLine

ROWS = st.lists(
    st.lists(st.tuples(st.sampled_from("BCDEG?"), st.integers(0, 359)), min_size=1, max_size=6),
    min_size=1,
    max_size=5,
)


def signature_of(line: QueryLine) -> Signature:
    assert isinstance(line.query, Signature)
    return line.query


@given(ROWS)
def test_json_lines_and_csv_give_same_queries(
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
    first, second = (list(read_queries(path, taxonomy=TAXONOMY)) for path in (lines, table))
    for lines_read in (first, second):
        assert [line.name for line in lines_read] == [q["id"] for q in plain]
    for line, same, row in zip(first, second, rows, strict=True):
        codes, bearings = parts_of(signature_of(line))
        assert np.array_equal(parts_of(signature_of(same)), (codes, bearings))
        assert bearings.tolist() == sorted(b for _, b in row)


def test_sentences_with_unplaced_and_absent_objects() -> None:
    lines = [
        json.dumps({"see": text})
        for text in ("bench at 40, bus stop, lamp at 80", "no tree", "lamp, bench", "no lamb")
    ]
    mixed, none, plain, slip = parse_queries(lines, "x", taxonomy=TAXONOMY)
    assert parts_of(signature_of(mixed))[1].tolist() == [40.0, 80.0]
    bus_stop, tree = (TAXONOMY.encode(symbol).tolist() for symbol in "MB")
    assert ([*mixed.unplaced], mixed.absent) == (bus_stop, ())
    assert (len(signature_of(none)), none.unplaced, [*none.absent]) == (0, (), tree)
    assert (signature_of(plain).bearings, plain.unplaced) == (None, ())
    assert isinstance(slip.query, InputError)


def test_missing_parts_and_names_from_line_numbers() -> None:
    lines = ["", '{"types": "DB"}', '{"bearings": [5, 6]}', '{"types": ""}', '{"bearings": []}']
    result = list(parse_queries(lines, "x", taxonomy=TAXONOMY))
    assert [line.name for line in result] == [2, 3, 4, 5]
    assert signature_of(result[0]).bearings is None
    assert signature_of(result[1]).codes is None
    assert [len(signature_of(line)) for line in result] == [2, 2, 0, 0]


def test_queries_are_read_lazily() -> None:
    lines = iter([b'{"types": "D"}', b"{"])
    result = parse_queries(lines, "x", taxonomy=TAXONOMY)
    assert next(result).line == 1
    assert next(lines) == b"{"


BAD_LINES: list[tuple[str | bytes, str]] = [
    ("{", "not JSON"),
    (b"\xff", "not JSON"),
    ("[" * 100_000, "not JSON"),
    ("[1]", "no query"),
    ('{"types": "Z"}', "'Z'"),
    ('{"types": "DB", "bearings": [1]}', "2 types and 1 bearings"),
    ('{"types": "D", "bearings": [NaN]}', "nan"),
    ('{"bearings": ["north"]}', "not all numbers"),
    ('{"other": 1}', "types, bearings or both"),
]


def test_invalid_line_does_not_affect_others() -> None:
    lines: list[str | bytes] = []
    for text, _ in BAD_LINES:
        lines += [text, '{"types": "D"}']
    result = list(parse_queries(lines, "these lines", taxonomy=TAXONOMY))
    assert [line.line for line in result] == list(range(1, len(lines) + 1))
    for number, (line, (_, message)) in enumerate(zip(result[::2], BAD_LINES, strict=True)):
        assert isinstance(line.query, InputError)
        assert_sentence(line.query, f"line {2 * number + 1} of these lines", message)
    assert all(len(signature_of(line)) == 1 for line in result[1::2])


def test_invalid_row_of_table_does_not_affect_others(tmp_path: Path) -> None:
    rows = ["id,types", "a,D", f"b,{'D' * 200_000}", "c,Z", "d,", "e"]
    (tmp_path / "q.csv").write_text("\n".join(rows))
    result = list(read_queries(tmp_path / "q.csv", taxonomy=TAXONOMY))
    assert [line.line for line in result] == [2, 3, 4, 5, 6]
    assert [line.name for line in result] == ["a", 3, "c", "d", "e"]
    assert [line.line for line in result if isinstance(line.query, InputError)] == [3, 4, 6]


def test_route_has_legs_between_views(tmp_path: Path) -> None:
    lines = """
{"id": "start", "types": "DB", "bearings": [10, 200]}
{"dx": 3, "dy": -4, "sigma": 2}
{"types": "D", "bearings": "90", "distance": 20, "bearing": 90}
"""
    views, legs = parse_route(lines.split("\n"), "these lines", taxonomy=TAXONOMY)
    assert [name for name, _ in views] == ["start", 3, 4]
    assert [len(view) for _, view in views] == [2, 0, 1]
    assert legs == [Leg(dx=3.0, dy=-4.0, sigma=2.0), Leg.towards(90.0, 20.0, sigma=0.0)]
    north = North(name="true", turn=10.0)
    rows = ['{"types": "D"}', '{"types": "D", "bearing": 80, "distance": 20}']
    (leg,) = parse_route(rows, "x", taxonomy=TAXONOMY, north=north)[1]
    assert (leg.dx, leg.dy) == pytest.approx((20.0, 0.0))
    (tmp_path / "route.csv").write_text("types,dx,dy\nDB,,\nD,0,5.5\n")
    views, legs = read_route(tmp_path / "route.csv", taxonomy=TAXONOMY)
    assert [name for name, _ in views] == [2, 3]
    assert legs == [Leg(dx=0.0, dy=5.5)]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["no rows"]),
        ("{", ["line 1", "not JSON"]),
        ('{"types": "Z"}', ["line 1", "'Z'"]),
        ('{"types": "DB", "bearings": [1]}', ["2 types and 1 bear"]),
        ('{"bearings": ["north"]}', ["line 1", "not all numbers"]),
        ("[1]", ["line 1", "no view"]),
        ('{"types": "D", "dx": 1, "dy": 2}', ["line 1", "gives a step", "the first"]),
        ('{"types": "D"}\n{"types": "B"}', ["line 2", "does not give the step"]),
        ('{"dx": 5}', ["line 1", "dx and dy, or distance and bearing"]),
        ('{"dx": 1, "dy": 2, "bearing": 3}', ["dx and dy, or distance and bearing"]),
        ('{"types": "D"}\n{"dx": "far", "dy": 2}', ["line 2", "far"]),
        ('{"types": "D"}\n{"dx": Infinity, "dy": 2}', ["line 2", "leg is inf"]),
        ('{"types": "D"}\n{"dx": 1, "dy": 2, "sigma": -1.0}', ["line 2", "-1.0"]),
    ],
)
def test_invalid_lines_of_route_are_refused(text: str, words: list[str]) -> None:
    with refused(InputError, "these lines", *words):
        parse_route(text.split("\n"), "these lines", taxonomy=TAXONOMY)


@pytest.mark.parametrize("read", [read_queries, read_route])
def test_unreadable_files_are_refused(tmp_path: Path, read: Callable[..., object]) -> None:
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    for name in ("a.csv", "b.csv"):
        with refused(InputError, name, "cannot be read"):
            read(tmp_path / name, taxonomy=TAXONOMY)
