"""CSV: what is read back is what was there, and no spreadsheet runs any of it."""

from __future__ import annotations

import csv
import dataclasses
import io
import re
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from small_city import small_city, small_evaluation

from semsig_gis.exports import export_database
from semsig_gis.exports.files import as_written, formula_safe
from semsig_gis.objects.table import StreetObjects

if TYPE_CHECKING:
    from pathlib import Path

FORMULAS = [
    "=cmd|' /C calc'!A0",
    "+1;=2",
    "-1",
    "@SUM(A1)",
    "\t=1",
    "\r=1",
    "a\n=1",
    'a"=1',
    'a;"=HYPERLINK(1)"',
    "\uff1d1",
    "'=1",
    "''",
    "",
]
TEXTS = st.text() | st.text(alphabet="=+-@'\t\r\n;,|\"a") | st.sampled_from(FORMULAS)


@given(TEXTS)
@example("=1")
def test_text_is_safe_and_comes_back(text: str) -> None:
    safe = formula_safe(text)
    assert as_written(safe) == text
    assert not re.search('(^|[;,|"\t\r\n])[=+@\uff1d\uff0b\uff0d\uff20-]', safe)


@pytest.mark.parametrize("separator", [",", ";", "\t", "|"])
def test_no_spreadsheet_of_any_country_finds_a_formula(separator: str) -> None:
    for text in FORMULAS:
        quoted = formula_safe(text).replace('"', '""')
        line = f'12,"{quoted}",3\n'
        for row in csv.reader(io.StringIO(line, newline=""), delimiter=separator):
            assert not any(cell.startswith(tuple("=+-@\t\r")) for cell in row), (text, row)


def test_cells_read_back_as_they_are(tmp_path: Path) -> None:
    database, _ = small_city()
    file = tmp_path / "cells.csv"
    export_database(database, file)
    cells = pd.read_csv(file, dtype={"types": str, "x": str, "y": str})
    assert cells["cell_id"].tolist() == database.cell_ids.tolist()
    assert np.array_equal(cells[["x", "y"]].astype(float).to_numpy(), database.xy)
    assert cells["types"].tolist() == [database.types(cell) for cell in range(len(database))]
    assert cells["type_group_size"].tolist() == database.type_group_sizes.tolist()
    assert "WKT" not in cells.columns
    export_database(database, file, geometry="polygon")
    assert pd.read_csv(file)["WKT"].str.startswith("POLYGON").all()


def test_hostile_objects_come_back(tmp_path: Path) -> None:
    database, objects = small_city()
    table = objects.table.copy()
    texts = [*FORMULAS, "é" * 10_000, "\u202eright", "<script>"]
    table["source_id"] = [texts[number % len(texts)] for number in range(len(table))]
    hostile = StreetObjects(table, objects.taxonomy, objects.licenses)
    file = tmp_path / "objects.csv"
    export_database(database, file, layers=["objects"], objects=hostile)
    with file.open(encoding="utf-8", newline="") as opened:
        rows = list(csv.DictReader(opened))
    assert [as_written(row["source_id"]) for row in rows] == table["source_id"].tolist()
    assert not any(row["source_id"].startswith(tuple("=+-@\t\r\n")) for row in rows)
    assert [float(row["x"]) for row in rows] == objects.xy[:, 0].tolist()


def test_texts_of_queries_are_safe_too(tmp_path: Path) -> None:
    results = small_evaluation()
    queries = results.queries.assign(next_cell_ids="-5,-4;=cmd")
    hostile = dataclasses.replace(results, queries=queries)
    export_database(small_city()[0], tmp_path / "a.csv", layers="evaluation", evaluation=hostile)
    texts = pd.read_csv(tmp_path / "a.csv")["next_cell_ids"]
    assert set(texts) == {formula_safe("-5,-4;=cmd")}
    assert texts[0].startswith("'-5")
