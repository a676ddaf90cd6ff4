"""Records in JSON, wrapped in all the ways of portals and programs."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
from sentences import refused

from semsig_gis.core import SourceError
from semsig_gis.sources import ServiceRecord, open_table

if TYPE_CHECKING:
    from pathlib import Path

ROWS: list[dict[str, Any]] = [
    {"id": 1, "lat": 45.76, "lon": 4.84},
    {"id": 2, "lat": 45.7, "lon": 5},
]
META = {"view": {"columns": [{"name": name, "fieldName": f":{name}"} for name in ROWS[0]]}}


@pytest.mark.parametrize(
    "content",
    [
        ROWS,
        {"data": ROWS},
        {"last_updated": 1, "ttl": 60, "data": {"stations": ROWS}},
        {"response": {"meta": {"count": 2, "tags": [{}]}, "items": ROWS}},
        {name: [row[name] for row in ROWS] for name in ROWS[0]},
        {"columns": [*ROWS[0]], "index": [0, 1], "data": [[*row.values()] for row in ROWS]},
        {"meta": META, "data": [[*row.values()] for row in ROWS]},
        {
            "head": {"vars": [*ROWS[0]]},
            "results": {
                "bindings": [
                    {name: {"type": "literal", "value": value} for name, value in row.items()}
                    for row in ROWS
                ]
            },
        },
    ],
)
def test_records_are_found(content: object, tmp_path: Path) -> None:
    file = tmp_path / "lamps.json"
    file.write_text(json.dumps(content))
    table = open_table(file)
    assert table.fields == ("id", "lat", "lon")
    records = list(table.records(table.fields))
    assert [record.values for record in records if isinstance(record, ServiceRecord)] == ROWS


def test_keys_of_records_are_kept(tmp_path: Path) -> None:
    file = tmp_path / "lamps.json"
    file.write_text(json.dumps({"A7": ROWS[0], "B9": ROWS[1]}))
    records = list(open_table(file).records(()))
    assert [record.values["key"] for record in records if isinstance(record, ServiceRecord)] == [
        "A7",
        "B9",
    ]


@pytest.mark.parametrize(
    ("others", "notes"), [([{"id": "a"}] * 5, ()), (ROWS[:1], ("1 records in other lists",))]
)
def test_other_lists_are_noted(others: list[Any], notes: tuple[str, ...], tmp_path: Path) -> None:
    file = tmp_path / "lamps.json"
    file.write_text(json.dumps({"others": others, "lamps": {"all": ROWS}}))
    table = open_table(file)
    assert len(list(table.records(()))) == 2
    assert len(table.notes) == len(notes)
    assert all(words in note for words, note in zip(notes, table.notes, strict=True))


@pytest.mark.parametrize("content", [{}, {"a": 1}, {"a": {"b": 1}}, {"a": [1, 2]}])
def test_json_without_records_is_refused(content: object, tmp_path: Path) -> None:
    file = tmp_path / "lamps.json"
    file.write_text(json.dumps(content))
    with refused(SourceError, "lamps.json", "lat"):
        open_table(file)
