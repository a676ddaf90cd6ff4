from __future__ import annotations

import json
from typing import TYPE_CHECKING

from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.likelihood.route import Leg
from semsig_gis.queries.file import parse_queries, parse_route, read_queries, read_route
from semsig_gis.sources.catalog import paper_taxonomy

if TYPE_CHECKING:
    from pathlib import Path

    import pytest

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
