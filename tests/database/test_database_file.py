from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from hypothesis import given, settings
from sentences import refused
from worlds import (
    CODES,
    World,
    assert_same,
    brute_force,
    check_against_brute_force,
    random_town,
    worlds,
)

from semsig_gis.core.errors import DatabaseError
from semsig_gis.database.file import open_database, save_database

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="module")
def town() -> World:
    return random_town()


def test_the_largest_range_fits_the_file(tmp_path: Path) -> None:
    world = World(((0.0, 5999.99, 3), (0.0, 0.0, 1)), step=1000.0, radius=6000.0)
    database = world.database
    save_database(database, tmp_path / "a.parquet")
    assert_same(open_database(tmp_path / "a.parquet"), database)
    check_against_brute_force(world)


@given(world=worlds())
@settings(max_examples=25)
def test_a_saved_database_comes_back(
    world: World, tmp_path_factory: pytest.TempPathFactory
) -> None:
    if not brute_force(world):
        return
    path = tmp_path_factory.mktemp("database") / "city.parquet"
    database = world.database
    save_database(database, str(path))
    again = open_database(str(path))
    assert_same(again, database)
    save_database(again, path)
    assert_same(open_database(path), database)


def test_geopandas_reads_the_columns(town: World, tmp_path: Path) -> None:
    database = town.database
    path = tmp_path / "city.parquet"
    save_database(database, path)
    frame = gpd.read_parquet(path)
    assert list(frame.columns) == [
        "cell_id",
        "types",
        "bearings",
        "distances",
        "length",
        "geometry",
    ]
    assert frame.crs == database.crs
    assert frame["cell_id"].tolist() == database.cell_ids.tolist()
    assert frame["types"].tolist() == [database.types(cell) for cell in range(len(database))]
    assert frame["length"].tolist() == database.lengths.tolist()
    assert shapely.get_coordinates(frame.geometry).tolist() == database.xy.tolist()
    assert frame.total_bounds.tolist() == [*database.xy.min(axis=0), *database.xy.max(axis=0)]
    units, distances = (np.concatenate(frame[name]) for name in ("bearings", "distances"))
    assert units.dtype == np.uint16
    assert distances.dtype == np.uint8
    assert units.tolist() == database.bearing_units.tolist()
    assert distances.tolist() == database.distance_units.tolist()
    assert [len(row) for row in frame["bearings"]] == database.lengths.tolist()
    specs = json.loads(pq.read_metadata(path).metadata[b"semsig"])
    assert specs["grid"] == {"step": 10.0, "origin": [0.0, 0.0]}
    assert specs["signature"] == {"radius": 30.0, "levels": 16}
    assert specs["licenses"] == ["World (CC0): world"]
    assert [item["code"] for item in specs["taxonomy"]] == CODES


def test_a_file_in_many_pieces_comes_back(town: World, tmp_path: Path) -> None:
    path = tmp_path / "city.parquet"
    save_database(town.database, path)
    pq.write_table(pq.read_table(path), path, row_group_size=7)
    assert_same(open_database(path), town.database)


def test_a_cut_file_is_an_error(town: World, tmp_path: Path) -> None:
    path = tmp_path / "city.parquet"
    save_database(town.database, path)
    content = path.read_bytes()
    sizes = np.linspace(0, len(content) - 1, 80).astype(int).tolist()
    for size in [*sizes, len(content) // 2]:
        path.write_bytes(content[:size])
        with refused(DatabaseError, str(path), "signature database"):
            open_database(path)


def rewrite(path: Path, table: pa.Table, **specs: Any) -> None:  # noqa: ANN401
    """Write a table in the place of a file, with its metadata but for some of the specs."""
    metadata = dict(pq.read_metadata(path).metadata)
    changed = json.loads(metadata[b"semsig"])
    for key, value in specs.items():
        changed[key] = value
        if value is None:
            del changed[key]
    kept = {b"geo": metadata[b"geo"], b"semsig": json.dumps(changed).encode()}
    pq.write_table(table.replace_schema_metadata(kept), path)


def swap(table: pa.Table, one: str, other: str) -> pa.Table:
    names = {one: other, other: one}
    return table.rename_columns([names.get(name, name) for name in table.column_names])


def with_first(table: pa.Table, column: str, value: object) -> pa.Table:
    values = [value, *table[column].to_pylist()[1:]]
    place = table.column_names.index(column)
    return table.set_column(place, column, pa.array(values, table[column].type))


def turned_over(table: pa.Table) -> pa.Table:
    return table.take(list(range(len(table)))[::-1])


DAMAGE = {
    "bearings and distances swapped": lambda t: swap(t, "bearings", "distances"),
    "types and bearings swapped": lambda t: swap(t, "types", "bearings"),
    "a missing column": lambda t: t.drop_columns(["bearings"]),
    "another type of column": lambda t: swap(t, "types", "length"),
    "large strings": lambda t: t.set_column(1, "types", t["types"].cast(pa.large_string())),
    "cells as floats": lambda t: t.set_column(0, "cell_id", t["cell_id"].cast(pa.float64())),
    "a missing cell": lambda t: with_first(t, "cell_id", None),
    "cells out of order": turned_over,
    "a cell twice": lambda t: pa.concat_tables([t, t]),
    "no cells": lambda t: t.slice(0, 0),
    "a missing value": lambda t: with_first(t, "bearings", None),
    "an unknown symbol": lambda t: with_first(t, "types", "?" * t["length"][0].as_py()),
    "one object too many": lambda t: with_first(t, "types", t["types"][0].as_py() + "D"),
    "an empty signature": lambda t: with_first(
        with_first(with_first(t, "types", ""), "bearings", []), "distances", []
    ),
    "a missing number": lambda t: with_first(t, "distances", [None] * t["length"][0].as_py()),
    "numbers of another size": lambda t: t.set_column(
        2, "bearings", t["bearings"].cast(pa.list_(pa.int32()))
    ),
    "bytes for numbers": lambda t: t.set_column(
        3, "distances", pa.array([bytes(row) for row in t["distances"].to_pylist()])
    ),
    "a bearing of 360": lambda t: with_first(t, "bearings", [7200] * t["length"][0].as_py()),
    "bearings in another order": lambda t: t.set_column(
        2, "bearings", pa.array([b[::-1] for b in t["bearings"].to_pylist()], t["bearings"].type)
    ),
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_columns_that_do_not_fit_are_an_error(town: World, tmp_path: Path, damage: Any) -> None:  # noqa: ANN401
    path = tmp_path / "city.parquet"
    save_database(town.database, path)
    table = pq.read_table(path)
    rewrite(path, table)
    assert_same(open_database(path), town.database)  # the rewriting itself does no harm
    rewrite(path, damage(table))
    with refused(DatabaseError, str(path)):
        open_database(path)


@pytest.mark.parametrize(
    "specs",
    [
        {"grid": None},
        {"grid": {"step": 10.0}},
        {"grid": {"step": 0.0, "origin": [0.0, 0.0]}},
        {"grid": {"step": "ten", "origin": [0.0, 0.0]}},
        {"grid": {"step": 10.0, "origin": None}},
        {"grid": {"step": 10.0, "origin": ["x", "y"]}},
        {"signature": None},
        {"signature": {"radius": -1.0, "levels": 16}},
        {"signature": {"radius": 30.0, "levels": 16, "shape": "round"}},
        {"viewpoints": {"mode": "indoors", "width": 8.0, "area": None}},
        {"viewpoints": None},
        {"occlusion": None},
        {"occlusion": "deep"},
        {"taxonomy": None},
        {"taxonomy": []},
        {"taxonomy": [{"code": 1, "symbol": "BB", "name": "b", "title": "B"}]},
        {"licenses": None},
        {"version": None},
    ],
)
def test_specs_that_do_not_fit_are_an_error(
    town: World, tmp_path: Path, specs: dict[str, Any]
) -> None:
    path = tmp_path / "city.parquet"
    save_database(town.database, path)
    rewrite(path, pq.read_table(path), **specs)
    with refused(DatabaseError, str(path), "is damaged", "build the database again"):
        open_database(path)


def test_a_file_of_street_objects_is_named_as_such(town: World, tmp_path: Path) -> None:
    from semsig_gis.objects.table import save_objects

    path = tmp_path / "objects.parquet"
    save_objects(town.street_objects, path)
    with refused(DatabaseError, str(path), "street objects", "signature database"):
        open_database(path)


def test_columns_of_others_in_the_file_do_no_harm(town: World, tmp_path: Path) -> None:
    path = tmp_path / "city.parquet"
    save_database(town.database, path)
    table = pq.read_table(path).select(
        ["geometry", "distances", "length", "bearings", "types", "cell_id"]
    )
    rewrite(path, table.append_column("note", [["x"] * len(table)]))
    assert_same(open_database(path), town.database)


@pytest.mark.parametrize("number", [None, 1, 99])
def test_a_file_of_another_version_is_named_as_such(
    town: World, tmp_path: Path, number: int | None
) -> None:
    path = tmp_path / "city.parquet"
    save_database(town.database, path)
    rewrite(path, pq.read_table(path), format=number)
    with refused(DatabaseError, str(path), "another version", "build the database again"):
        open_database(path)
