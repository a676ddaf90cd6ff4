from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import TAXONOMY, parts_of
from sentences import refused

from semsig_gis.core.errors import InputError
from semsig_gis.likelihood.route import Leg
from semsig_gis.queries.file import parse_queries, parse_route, read_queries, read_route

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

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
        codes, bearings = parts_of(query)
        assert np.array_equal(parts_of(same), (codes, bearings))
        assert bearings.tolist() == sorted(b for _, b in row)


def test_a_part_may_be_missing_and_lines_are_numbered() -> None:
    found = parse_queries('\n{"types": "DB"}\n{"bearings": [5, 6]}', "x", taxonomy=TAXONOMY)
    assert [name for name, _ in found] == [2, 3]
    assert found[0][1].bearings is None
    assert found[1][1].codes is None


def test_a_route_tells_the_way_from_view_to_view() -> None:
    lines = """
{"id": "start", "types": "DB", "bearings": [10, 200]}
{"dx": 3, "dy": -4, "sigma": 2}
{"types": "D", "bearings": "90", "distance": 20, "bearing": 90}
"""
    views, legs = parse_route(lines, "these lines", taxonomy=TAXONOMY)
    assert [name for name, _ in views] == ["start", 3, 4]
    assert [len(view) for _, view in views] == [2, 0, 1]
    assert legs == [Leg(dx=3.0, dy=-4.0, sigma=2.0), Leg.towards(90.0, 20.0, sigma=0.0)]


def test_a_route_in_a_table(tmp_path: Path) -> None:
    (tmp_path / "route.csv").write_text("types,dx,dy\nDB,,\nD,0,5.5\n")
    views, legs = read_route(tmp_path / "route.csv", taxonomy=TAXONOMY)
    assert [name for name, _ in views] == [2, 3]
    assert legs == [Leg(dx=0.0, dy=5.5)]


@pytest.mark.parametrize(
    ("parsers", "text", "words"),
    [
        ([parse_queries, parse_route], "", ["no rows"]),
        ([parse_queries, parse_route], "{", ["line 1", "not JSON"]),
        ([parse_queries, parse_route], '{"types": "Z"}', ["line 1", "'Z'"]),
        ([parse_queries, parse_route], '{"types": "DB", "bearings": [1]}', ["2 types and 1 bear"]),
        ([parse_queries, parse_route], '{"bearings": ["north"]}', ["line 1", "not all numbers"]),
        ([parse_queries], "[1]", ["line 1", "no query"]),
        ([parse_queries], '{"types": "D"}\n{"other": 1}', ["line 2", "types, bearings or both"]),
        ([parse_route], "[1]", ["line 1", "no view"]),
        ([parse_route], '{"types": "D", "dx": 1, "dy": 2}', ["line 1", "tells a way", "the first"]),
        ([parse_route], '{"types": "D"}\n{"types": "B"}', ["line 2", "does not tell the way"]),
        ([parse_route], '{"dx": 5}', ["line 1", "dx and dy, or distance and bearing"]),
    ],
)
def test_lines_of_files(parsers: list[Callable[..., object]], text: str, words: list[str]) -> None:
    for parse in parsers:
        with refused(InputError, "these lines", *words):
            parse(text, "these lines", taxonomy=TAXONOMY)


@pytest.mark.parametrize("read", [read_queries, read_route])
def test_files_that_cannot_be_read(tmp_path: Path, read: Callable[..., object]) -> None:
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    for name in ("a.csv", "b.csv"):
        with refused(InputError, name, "cannot be read"):
            read(tmp_path / name, taxonomy=TAXONOMY)
