from __future__ import annotations

import json
import shutil
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
from sentences import assert_sentence, refused
from worlds import World, assert_same, random_town

from semsig_gis.core.errors import DatabaseError
from semsig_gis.core.signature import SignatureSpec
from semsig_gis.database.file import (
    MANIFEST,
    Manifest,
    digest,
    open_database,
    open_dataset,
    read_manifest,
    save_database,
)
from semsig_gis.database.tiles import TileSpec, build_tiles, describe
from semsig_gis.objects.table import save_objects

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.database.file import Part

TOWN = random_town()


def town_in_tiles(folder: Path, **options: object) -> Path:
    save_objects(TOWN.street_objects, folder / "objects.parquet")
    build_tiles(folder / "objects.parquet", folder / "town", tile=TileSpec(80.0), **options)  # type: ignore[arg-type]
    return folder / "town"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return town_in_tiles(tmp_path_factory.mktemp("built"))


@pytest.fixture
def town(built: Path, tmp_path: Path) -> Path:
    """Return a copy that a test may spoil."""
    shutil.copytree(built, tmp_path / "town")
    return tmp_path / "town"


def rewrite(folder: Path, parts: tuple[Part, ...]) -> None:
    Manifest(read_manifest(folder).recipe, parts).write(folder)


# --- What is in the folder --------------------------------------------------------------------


def test_the_parts_are_opened_like_one_file(town: Path) -> None:
    assert_same(open_database(town), TOWN.database)
    assert_same(open_database(str(town)), TOWN.database)
    assert len(open_dataset(town)) == len(TOWN.database)


def test_the_parts_are_opened_one_after_the_other(town: Path) -> None:
    whole = TOWN.database
    seen = [part.cell_ids for part in open_dataset(town).parts()]
    assert len(seen) > 8
    assert sorted(np.concatenate(seen).tolist()) == whole.cell_ids.tolist()
    some = whole.cell_ids[[0, 17, 5, len(whole) - 1]]
    assert open_dataset(town).row_numbers(some).tolist() == [0, 17, 5, len(whole) - 1]


def test_geopandas_reads_the_folder(town: Path) -> None:
    table = gpd.read_parquet(town)
    assert sorted(table["cell_id"]) == TOWN.database.cell_ids.tolist()
    assert table.crs == TOWN.database.crs


def test_the_manifest_tells_what_is_there_and_how_it_was_built(town: Path) -> None:
    content = json.loads((town / MANIFEST).read_text(encoding="utf-8"))
    assert content["recipe"]["grid"] == {"step": 10.0, "origin": [0.0, 0.0]}
    assert content["recipe"]["tile"] == {"cells": 8}
    assert list(content["recipe"]["inputs"]) == ["objects"]
    manifest = read_manifest(town)
    assert {part.file for part in manifest.parts} | {MANIFEST} == {p.name for p in town.iterdir()}
    assert manifest.cells == len(TOWN.database)
    assert manifest.entries == len(TOWN.database.codes)
    for part in manifest.parts:
        path = town / part.file
        assert part == describe(part.tile, open_database(path), path)


# --- What is wrong with a folder --------------------------------------------------------------


@pytest.mark.parametrize("opened", [open_database, open_dataset])
def test_a_folder_that_is_not_whole_is_named(town: Path, opened: object) -> None:
    def refusal() -> DatabaseError:
        with pytest.raises(DatabaseError) as caught:
            opened(town)  # type: ignore[operator]
        return caught.value

    parts = read_manifest(town).parts
    path = town / parts[2].file
    content = path.read_bytes()
    path.unlink()
    assert_sentence(refusal(), parts[2].file, "missing")
    path.write_bytes(content[:-1])
    assert_sentence(refusal(), parts[2].file, "not the part that was built")
    middle = len(content) // 2
    path.write_bytes(content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :])
    assert_sentence(refusal(), parts[2].file, "not the part that was built")
    path.write_bytes((town / parts[3].file).read_bytes())  # another part under its name
    assert_sentence(refusal(), parts[2].file, "not the part that was built")
    path.write_bytes(content)
    shutil.copy(path, town / "tile_0_0.parquet")
    assert_sentence(refusal(), "tile_0_0.parquet", "is no part of the database")
    (town / "tile_0_0.parquet").unlink()
    opened(town)  # type: ignore[operator]
    rewrite(town, ())
    for part in parts:
        (town / part.file).unlink()
    assert_sentence(refusal(), "lists no parts")


def test_parts_of_different_specs_in_one_folder_are_refused(town: Path) -> None:
    parts = read_manifest(town).parts
    path = town / parts[1].file
    database = open_database(path)
    narrow = World(TOWN.objects, radius=20.0).database
    save_database(narrow.select(np.isin(narrow.cell_ids, database.cell_ids)), path)
    rewrite(town, (parts[0], describe(parts[1].tile, open_database(path), path), *parts[2:]))
    for tried in (lambda: open_database(town), lambda: list(open_dataset(town).parts())):
        with refused(DatabaseError, "differ", "range"):
            tried()
    assert database.spec == SignatureSpec()


def test_a_cell_in_two_parts_is_refused(town: Path) -> None:
    parts = read_manifest(town).parts
    path = town / parts[1].file
    shutil.copy(town / parts[0].file, path)
    rewrite(town, (parts[0], describe(parts[1].tile, open_database(path), path), *parts[2:]))
    with refused(DatabaseError, "the same cell"):
        open_database(town)


@pytest.mark.parametrize(
    "content",
    ["", "{", "[]", "{}", '{"kind": 3}', '{"kind": "signature database in parts", "parts": [{}]}'],
)
def test_a_damaged_manifest_is_named(town: Path, content: str) -> None:
    (town / MANIFEST).write_text(content, encoding="utf-8")
    with refused(DatabaseError, MANIFEST, "damaged"):
        open_database(town)


def test_a_manifest_of_another_kind_is_named(town: Path) -> None:
    content = json.loads((town / MANIFEST).read_text(encoding="utf-8"))
    (town / MANIFEST).write_text(json.dumps({**content, "kind": "album"}), encoding="utf-8")
    with refused(DatabaseError, MANIFEST, "another kind"):
        open_database(town)


def test_a_folder_without_a_manifest_is_not_a_database(tmp_path: Path) -> None:
    for opened in (open_database, open_dataset):
        with refused(DatabaseError, str(tmp_path), "not a signature database in parts"):
            opened(tmp_path)


def test_a_digest_is_that_of_the_content(tmp_path: Path) -> None:
    one, other = tmp_path / "a", tmp_path / "b"
    one.write_bytes(b"street")
    other.write_bytes(b"")
    assert digest(one) == digest(one, other) != digest(other)
    assert digest(other) == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
