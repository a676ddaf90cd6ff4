from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sentences import refused
from worlds import CODES, World, assert_same, brute_force, worlds

from semsig_gis.core import DatabaseError
from semsig_gis.database import (
    INPUTS,
    MANIFEST,
    Manifest,
    PartFile,
    describe_part,
    open_database,
    open_dataset,
    read_manifest,
    save_database,
)
from semsig_gis.storage import digest

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.database import SignatureDatabase


@given(world=worlds())
@example(world=World(((0.0, 5999.99, 3), (0.0, 0.0, 1)), step=1000.0, radius=6000.0))
@settings(max_examples=25)
def test_a_saved_database_is_read_unchanged(
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


def test_geopandas_reads_the_columns(database: SignatureDatabase, path: Path) -> None:
    frame = gpd.read_parquet(path)
    assert " ".join(frame.columns) == "cell_id types bearings distances length geometry"
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


def test_truncated_files_are_refused(path: Path) -> None:
    content = path.read_bytes()
    for size in np.linspace(0, len(content) - 1, 80).astype(int).tolist():
        path.write_bytes(content[:size])
        with refused(DatabaseError, str(path), "signature database"):
            open_database(path)


def rewrite(path: Path, table: pa.Table, **specs: Any) -> None:  # noqa: ANN401
    """Replace a file by a table with the same metadata, except some of the specs."""
    metadata = dict(pq.read_metadata(path).metadata)
    changed = json.loads(metadata[b"semsig"])
    for key, value in specs.items():
        changed[key] = value
        if value is None:
            del changed[key]
    new = {b"geo": metadata[b"geo"], b"semsig": json.dumps(changed).encode()}
    pq.write_table(table.replace_schema_metadata(new), path)


def swap(table: pa.Table, first: str, second: str) -> pa.Table:
    names = {first: second, second: first}
    return table.rename_columns([names.get(name, name) for name in table.column_names])


def put(table: pa.Table, name: str, values: pa.Array) -> pa.Table:
    return table.set_column(table.column_names.index(name), name, values)


def first(table: pa.Table, **values: object) -> pa.Table:
    """Put other values into the first row."""
    for name, value in values.items():
        row = [value, *table[name].to_pylist()[1:]]
        table = put(table, name, pa.array(row, table[name].type))
    return table


DAMAGE = {
    "bearings and distances swapped": lambda t: swap(t, "bearings", "distances"),
    "types and bearings swapped": lambda t: swap(t, "types", "bearings"),
    "a missing column": lambda t: t.drop_columns(["bearings"]),
    "another type of column": lambda t: swap(t, "types", "length"),
    "large strings": lambda t: put(t, "types", t["types"].cast(pa.large_string())),
    "cells as floats": lambda t: put(t, "cell_id", t["cell_id"].cast(pa.float64())),
    "a missing cell": lambda t: first(t, cell_id=None),
    "cells out of order": lambda t: t.take(list(range(len(t)))[::-1]),
    "a cell twice": lambda t: pa.concat_tables([t, t]),
    "no cells": lambda t: t.slice(0, 0),
    "a missing value": lambda t: first(t, bearings=None),
    "an unknown symbol": lambda t: first(t, types="?" * t["length"][0].as_py()),
    "one object too many": lambda t: first(t, types=t["types"][0].as_py() + "D"),
    "an empty signature": lambda t: first(t, types="", bearings=[], distances=[]),
    "a missing number": lambda t: first(t, distances=[None] * t["length"][0].as_py()),
    "numbers of another size": lambda t: put(
        t, "bearings", t["bearings"].cast(pa.list_(pa.int32()))
    ),
    "bytes for numbers": lambda t: put(
        t, "distances", pa.array(map(bytes, t["distances"].to_pylist()))
    ),
    "a bearing of 360": lambda t: first(t, bearings=[7200] * t["length"][0].as_py()),
    "bearings in another order": lambda t: put(
        t, "bearings", pa.array([b[::-1] for b in t["bearings"].to_pylist()], t["bearings"].type)
    ),
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_inconsistent_columns_are_refused(
    database: SignatureDatabase, path: Path, damage: Callable[[pa.Table], pa.Table]
) -> None:
    table = pq.read_table(path)
    rewrite(path, table)
    assert_same(open_database(path), database)  # the rewriting itself does no harm
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
        *({"format": number} for number in (None, 1, 99)),
    ],
)
def test_invalid_specs_are_refused(path: Path, specs: dict[str, Any]) -> None:
    rewrite(path, pq.read_table(path), **specs)
    words = "another version" if "format" in specs else "is damaged"
    with refused(DatabaseError, str(path), words, "build the database again"):
        open_database(path)


def test_a_file_of_street_objects_is_refused_by_its_kind(objects_file: Path) -> None:
    with refused(DatabaseError, str(objects_file), "street objects", "signature database"):
        open_database(objects_file)


def test_row_groups_and_other_columns_are_accepted(database: SignatureDatabase, path: Path) -> None:
    table = pq.read_table(path)
    pq.write_table(table, path, row_group_size=7)
    assert_same(open_database(path), database)
    reordered = table.select(["geometry", "distances", "length", "bearings", "types", "cell_id"])
    rewrite(path, reordered.append_column("note", [["x"] * len(table)]))
    assert_same(open_database(path), database)


def test_parts_are_opened_together_or_one_by_one(database: SignatureDatabase, parts: Path) -> None:
    assert_same(open_database(str(parts)), database)
    dataset = open_dataset(parts)
    assert len(dataset) == len(database)
    assert dataset.taxonomy == database.taxonomy
    ids = [part.cell_ids for part in dataset.parts()]
    assert len(ids) > 8
    assert sorted(np.concatenate(ids).tolist()) == database.cell_ids.tolist()
    rows = [0, 17, 5, len(database) - 1]
    assert dataset.row_numbers(database.cell_ids[rows]).tolist() == rows
    table = gpd.read_parquet(parts)
    assert sorted(table["cell_id"]) == database.cell_ids.tolist()
    assert table.crs == database.crs


def test_the_manifest_lists_parts_and_recipe(database: SignatureDatabase, parts: Path) -> None:
    manifest = read_manifest(parts)
    assert manifest.recipe["grid"] == {"step": 10.0, "origin": [0.0, 0.0]}
    assert manifest.recipe["tile"] == {"cells": 8}
    assert list(manifest.recipe["inputs"]) == ["objects"]
    files = {part.file for part in manifest.parts} | {MANIFEST, INPUTS}
    assert files == {path.name for path in parts.iterdir()}
    assert manifest.cells == len(database)
    assert manifest.entries == len(database.codes)
    for part in manifest.parts:
        file = parts / part.file
        assert part == describe_part(part.tile, open_database(file), file)


NUMBERS = st.integers(-(10**6), 10**6)
SIZES = st.integers(1, 10**9)
DIGESTS = st.text("0123456789abcdef", min_size=64, max_size=64)
PARTS = st.builds(PartFile, st.tuples(NUMBERS, NUMBERS), SIZES, SIZES, SIZES, DIGESTS)


@given(st.lists(PARTS, unique_by=lambda part: part.tile))
def test_a_manifest_is_read_unchanged(
    tmp_path_factory: pytest.TempPathFactory, parts: list[PartFile]
) -> None:
    folder = tmp_path_factory.mktemp("manifest")
    manifest = Manifest({"grid": {"step": 10.0}}, tuple(sorted(parts)))
    manifest.write(folder)
    assert read_manifest(folder) == manifest
    assert len({part.file for part in parts}) == len(parts)


@pytest.mark.parametrize("opened", [open_database, open_dataset])
def test_an_incomplete_folder_is_refused(
    parts: Path, tmp_path: Path, opened: Callable[[Path], object]
) -> None:
    with refused(DatabaseError, str(tmp_path), "not a signature database in parts"):
        opened(tmp_path)
    manifest = read_manifest(parts)
    names = [part.file for part in manifest.parts]
    path = parts / names[2]
    content = path.read_bytes()
    path.unlink()
    with refused(DatabaseError, names[2], "missing"):
        opened(parts)
    middle = len(content) // 2
    flipped = content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]
    for other in (content[:-1], flipped, (parts / names[3]).read_bytes()):
        path.write_bytes(other)
        with refused(DatabaseError, names[2], "not the part that was built"):
            opened(parts)
    path.write_bytes(content)
    shutil.copy(path, parts / "tile_0_0.parquet")
    with refused(DatabaseError, "tile_0_0.parquet", "is not part of the database"):
        opened(parts)
    (parts / "tile_0_0.parquet").unlink()
    opened(parts)
    Manifest(manifest.recipe, ()).write(parts)
    for name in names:
        (parts / name).unlink()
    with refused(DatabaseError, "lists no parts"):
        opened(parts)


def test_parts_with_other_cells_than_listed_are_refused(parts: Path) -> None:
    manifest = read_manifest(parts)
    first, *others = manifest.parts
    for wrong in (replace(first, cells=first.cells + 1), replace(first, entries=first.entries - 1)):
        Manifest(manifest.recipe, (wrong, *others)).write(parts)
        with refused(DatabaseError, str(parts), "other cells than its manifest lists"):
            open_database(parts)


def test_parts_with_different_settings_or_common_cells_are_refused(
    town: World, parts: Path
) -> None:
    manifest = read_manifest(parts)
    first, second, *others = manifest.parts
    file = parts / second.file
    narrow = World(town.objects, radius=20.0).database
    inside = np.isin(narrow.cell_ids, open_database(file).cell_ids)
    for database, word in (
        (narrow.select(inside), "differ in their range"),
        (open_database(parts / first.file), "the same cell"),
    ):
        save_database(database, file)
        replaced = describe_part(second.tile, database, file)
        Manifest(manifest.recipe, (first, replaced, *others)).write(parts)
        with refused(DatabaseError, word):
            open_database(parts)
        if word != "the same cell":
            with refused(DatabaseError, word):
                list(open_dataset(parts).parts())


@pytest.mark.parametrize(
    ("content", "words"),
    [
        *((text, "damaged") for text in ("", "{", "[]", "{}", '{"kind": 3}', '{"parts": 3}')),
        ('{"kind": "signature database in parts", "recipe": {}, "parts": [{}]}', "damaged"),
        ('{"kind": "album", "recipe": {}, "parts": []}', "does not belong to"),
        *(
            (f'{{"kind": 1, "recipe": {{}}, "parts": [{{"cells": {number}}}]}}', "damaged")
            for number in ("1e999", "Infinity", "NaN", "1" + "0" * 40)
        ),
        ("[" * 100_000, "damaged"),
    ],
)
def test_a_damaged_manifest_is_refused(tmp_path: Path, content: str, words: str) -> None:
    (tmp_path / MANIFEST).write_text(content, encoding="utf-8")
    for opened in (open_database, open_dataset, read_manifest):
        with refused(DatabaseError, MANIFEST, words):
            opened(tmp_path)


def test_a_digest_covers_the_joined_content_of_files(tmp_path: Path) -> None:
    first, second, empty = (tmp_path / name for name in "abc")
    first.write_bytes(b"a" * 3_000_000)
    second.write_bytes(b"b")
    empty.touch()
    assert digest(first, second, empty) == hashlib.sha256(b"a" * 3_000_000 + b"b").hexdigest()
    assert digest(empty) == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
