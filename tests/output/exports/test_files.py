"""Files of one layer are read back unchanged, and no spreadsheet executes their texts."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import re
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from sentences import refused
from small_city import small_city, small_evaluation

from semsig_gis.core import DatabaseError
from semsig_gis.database import open_database
from semsig_gis.output import as_written, export_database, formula_safe

if TYPE_CHECKING:
    from pathlib import Path

CITY, OBJECTS = small_city()
FORMULAS = [
    *("=cmd|' /C calc'!A0", "+1;=2", "-1", "@SUM(A1)", "\t=1", "\r=1", "a\n=1", 'a"=1'),
    *('a;"=HYPERLINK(1)"', "\uff1d1", "'=1", "''", ""),
]
TEXTS = st.text() | st.text(alphabet="=+-@'\t\r\n;,|\"a") | st.sampled_from(FORMULAS)


@given(TEXTS)
@example("=1")
def test_safe_text_has_no_formula_and_is_reversible(text: str) -> None:
    safe = formula_safe(text)
    assert as_written(safe) == text
    assert not re.search('(^|[;,|"\t\r\n])[=+@\uff1d\uff0b\uff0d\uff20-]', safe)


@pytest.mark.parametrize("separator", [",", ";", "\t", "|"])
def test_safe_text_has_no_formula_with_any_separator(separator: str) -> None:
    for text in FORMULAS:
        quoted = formula_safe(text).replace('"', '""')
        line = f'12,"{quoted}",3\n'
        for row in csv.reader(io.StringIO(line, newline=""), delimiter=separator):
            assert not any(cell.startswith(tuple("=+-@\t\r")) for cell in row), (text, row)


def test_cells_in_csv_have_coordinates_or_a_shape(tmp_path: Path) -> None:
    file = tmp_path / "cells.csv"
    export_database(CITY, file)
    cells = pd.read_csv(file)
    assert np.array_equal(cells[["x", "y"]].to_numpy(), CITY.xy)
    assert "WKT" not in cells.columns
    export_database(CITY, file, geometry="polygon")
    assert pd.read_csv(file)["WKT"].str.startswith("POLYGON").all()


def test_hostile_texts_in_csv_are_safe_and_read_back(tmp_path: Path) -> None:
    texts = [*FORMULAS, "é" * 10_000, "\u202eright", "<script>"]
    ids = [texts[number % len(texts)] for number in range(len(OBJECTS))]
    hostile = dataclasses.replace(OBJECTS, table=OBJECTS.table.assign(source_id=ids))
    file = tmp_path / "objects.csv"
    export_database(CITY, file, layers=["objects"], objects=hostile)
    with file.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [as_written(row["source_id"]) for row in rows] == ids
    assert not any(row["source_id"].startswith(tuple("=+-@\t\r\n")) for row in rows)
    assert [float(row["x"]) for row in rows] == OBJECTS.xy[:, 0].tolist()
    results = small_evaluation()
    queries = results.queries.assign(next_cell_ids="-5,-4;=cmd")
    evaluation = dataclasses.replace(results, queries=queries)
    export_database(CITY, file, layers="evaluation", evaluation=evaluation)
    assert set(pd.read_csv(file)["next_cell_ids"]) == {"'-5,'-4;'=cmd"}


def test_geoparquet_is_read_by_area_and_is_not_a_database(tmp_path: Path) -> None:
    file = tmp_path / "cells.parquet"
    export_database(CITY, file)
    cells = gpd.read_parquet(file)
    west, south = CITY.xy.mean(axis=0)
    box = (west, south, west + 35, south + 35)
    selection = gpd.read_parquet(file, bbox=box)
    # The bounds are rounded outwards to float32, so that the selection may have more neighbours.
    expected = cells.cx[box[0] : box[2], box[1] : box[3]]
    assert set(expected["cell_id"]) <= set(selection["cell_id"])
    assert 9 <= len(selection) < len(cells) / 4
    with refused(DatabaseError, "signature cells export", "signature database"):
        open_database(file)


@pytest.mark.parametrize(("layer", "kind"), [("cells", "Polygon"), ("objects", "Point")])
def test_metadata_of_geoparquet(layer: str, kind: str, tmp_path: Path) -> None:
    file = tmp_path / "a.parquet"
    export_database(CITY, file, layers=layer, objects=OBJECTS if layer == "objects" else None)
    metadata = pq.read_schema(file).metadata
    geo = json.loads(metadata[b"geo"])
    column = geo["columns"]["geometry"]
    assert (geo["version"], column["geometry_types"]) == ("1.1.0", [kind])
    assert column["covering"]["bbox"]["xmin"] == ["bbox", "xmin"]
    assert np.allclose(column["bbox"], gpd.read_parquet(file).total_bounds, rtol=0, atol=1e-6)


def test_flatgeobuf_is_read_by_area(tmp_path: Path) -> None:
    export_database(CITY, tmp_path / "a.fgb")
    around = gpd.read_file(tmp_path / "a.fgb", bbox=(*CITY.xy[0], *CITY.xy[0]))
    assert around["cell_id"].tolist() == [CITY.cell_ids[0]]
    assert gpd.read_file(tmp_path / "a.fgb").area.tolist() == [100.0] * len(CITY)
