"""GeoParquet: geopandas and pyarrow read what the database holds, all of it or a box."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pyarrow.parquet as pq
from sentences import refused
from small_city import chances_of, small_city

from semsig_gis.core.errors import DatabaseError
from semsig_gis.database.file import open_database
from semsig_gis.exports import export_database

if TYPE_CHECKING:
    from pathlib import Path


def test_cells_read_back_as_they_are(tmp_path: Path) -> None:
    database, _ = small_city()
    told, file = chances_of(database), tmp_path / "cells.parquet"
    steps: list[tuple[int, int]] = []
    export_database(
        database,
        file,
        identifiability=told,
        progress=lambda done, rows: steps.append((done, rows)),
    )
    cells = gpd.read_parquet(file)
    assert cells.crs == database.crs
    assert cells["cell_id"].tolist() == database.cell_ids.tolist()
    assert cells["types"].tolist() == [database.types(cell) for cell in range(len(database))]
    assert cells["chance_found"].tolist() == told.found.tolist()
    assert np.array_equal(cells.geometry.area, np.full(len(database), 100.0))
    assert steps[0] == (100, len(database))
    assert steps[-1] == (len(database), len(database))


def test_the_metadata_says_what_it_is(tmp_path: Path) -> None:
    database, objects = small_city()
    file = tmp_path / "objects.parquet"
    export_database(database, file, layers=["objects"], objects=objects)
    metadata = pq.read_schema(file).metadata
    geo = json.loads(metadata[b"geo"])
    column = geo["columns"]["geometry"]
    assert geo["version"] == "1.1.0"
    assert column["covering"]["bbox"]["xmin"] == ["bbox", "xmin"]
    assert column["geometry_types"] == ["Point"]
    assert np.allclose(column["bbox"], gpd.read_parquet(file).total_bounds)
    specs = json.loads(metadata[b"semsig"])
    assert specs["licenses"] == list(map(str, objects.licenses))
    assert specs["taxonomy"] == objects.taxonomy.to_list()


def test_a_box_is_read_by_its_bounds(tmp_path: Path) -> None:
    database, _ = small_city()
    file = tmp_path / "cells.parquet"
    export_database(database, file)
    west, south = database.xy.mean(axis=0)
    box = (west, south, west + 35, south + 35)
    some, everything = gpd.read_parquet(file, bbox=box), gpd.read_parquet(file)
    # The bounds are rounded outwards to float32: a neighbour that is a hair away may come along.
    wanted = everything.cx[box[0] : box[2], box[1] : box[3]]
    assert set(wanted["cell_id"]) <= set(some["cell_id"])
    assert 9 <= len(some) < len(everything) / 4


def test_it_is_not_taken_for_a_database(tmp_path: Path) -> None:
    file = tmp_path / "cells.parquet"
    export_database(small_city()[0], file)
    with refused(DatabaseError, "signature cells export", "signature database"):
        open_database(file)
