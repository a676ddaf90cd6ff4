"""Cities: a database and what lies beside it, and columns put in whole or not at all."""

from __future__ import annotations

import dataclasses
import shutil
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from sentences import assert_sentence, refused
from worlds import assert_same

from semsig_gis.core.errors import DatabaseError, InputError
from semsig_gis.database.city import (
    City,
    ObjectStore,
    built_digest,
    open_city,
    open_store,
    save_with_store,
)
from semsig_gis.database.file import (
    PartitionedDatabase,
    digest,
    open_database,
    part_files,
    read_manifest,
    save_database,
)

if TYPE_CHECKING:
    from pathlib import Path

    from worlds import World

    from semsig_gis.database.database import SignatureDatabase


@pytest.fixture(params=["path", "parts"])
def city(request: pytest.FixtureRequest) -> City:
    """Return a database in one file, or in parts."""
    return City(request.getfixturevalue(request.param))


def test_a_city_is_the_database_and_what_lies_beside_it(
    town: World, database: SignatureDatabase, stored: Path
) -> None:
    city = open_city(str(stored))
    assert_same(city.database, database)
    assert city.dataset is city.database
    assert city.licenses == database.licenses
    assert city.files == (stored,)
    assert (city.bytes, city.digest) == (stored.stat().st_size, digest(stored))
    assert city.has_store
    assert city.store is city.store
    assert city.object_counts == town.street_objects.class_counts
    shutil.rmtree(city.store_path)
    city = open_city(stored)
    assert not city.has_store
    assert city.objects is None
    assert city.object_counts is None
    with refused(DatabaseError, "has no object store"):
        _ = city.store


def test_a_city_is_opened_whole_or_in_parts(city: City, database: SignatureDatabase) -> None:
    assert_same(city.database, database)
    assert isinstance(city.dataset, PartitionedDatabase) == city.path.is_dir()
    assert len(city.dataset) == len(database)
    if city.path.is_dir():
        assert city.files == part_files(city.path)
        assert city.bytes == sum(file.stat().st_size for file in city.path.iterdir())
        assert city.digest == digest(*city.files)


def test_what_is_no_database_is_told(tmp_path: Path) -> None:
    nowhere = City(tmp_path / "nowhere.parquet")
    for act in (
        lambda: open_city(nowhere.path),
        lambda: nowhere.database,
        lambda: nowhere.digest,
        lambda: nowhere.has_columns,
        lambda: nowhere.columns("numbers"),
    ):
        with refused(DatabaseError, "nowhere.parquet does not exist"):
            act()
    text = tmp_path / "text.parquet"
    text.write_text("no database")
    assert built_digest(text) == digest(text)


def columns(size: int, *, times: float = 1.0) -> pa.Table:
    numbers = np.arange(size) * times
    return pa.table({"number": numbers, "maybe": pa.array(numbers.astype(int), mask=numbers < 9)})


def put(city: City, table: pa.Table, *, name: str = "numbers", **facts: Any) -> None:  # noqa: ANN401
    city.put_columns(name, table, cell_ids=city.database.cell_ids[: len(table)], facts=facts)


def columns_of(city: City, name: str = "numbers") -> tuple[pa.Table, dict[str, Any]]:
    stored = city.columns(name)
    assert stored is not None
    return stored


def test_columns_come_back_beside_signatures_that_stay(
    city: City, database: SignatureDatabase
) -> None:
    assert city.columns("numbers") is None
    assert not city.has_columns
    put(city, columns(len(database)), made="up")
    table, facts = columns_of(city)
    assert facts == {"made": "up"}
    assert table["cell_id"].to_numpy().tolist() == database.cell_ids.tolist()
    expected = columns(len(database)).combine_chunks()
    assert table.drop_columns(["cell_id"]).combine_chunks().equals(expected)
    assert city.has_columns
    assert_same(open_database(city.path), database)
    assert city.columns("others") is None
    for file in city.files:  # which other programs read, too
        seen = gpd.read_parquet(file)
        rows = np.searchsorted(database.cell_ids, seen["cell_id"])
        assert seen["number"].tolist() == rows.tolist()
        assert seen.columns[-1] == "geometry"
        assert seen.crs == database.crs


def test_columns_of_one_name_replace_each_other(city: City, database: SignatureDatabase) -> None:
    size = len(database)
    put(city, columns(size))
    put(city, pa.table({"other": np.ones(size)}), name="ones")
    put(city, columns(size, times=3.0).drop_columns(["maybe"]), times=3)
    table, facts = columns_of(city)
    assert table.column_names == ["cell_id", "number"]
    assert table["number"].to_numpy().tolist() == (np.arange(size) * 3.0).tolist()
    assert facts == {"times": 3}
    assert columns_of(city, "ones")[0]["other"].to_numpy().sum() == size


def test_a_file_keeps_its_digest_and_a_folder_its_recipe(
    path: Path, parts: Path, database: SignatureDatabase
) -> None:
    before = digest(path)
    for times in (1.0, 2.0):
        put(City(path), columns(len(database), times=times))
    assert City(path).digest == before != digest(path)
    manifest = read_manifest(parts)
    put(City(parts), columns(len(database)))
    after = read_manifest(parts)
    assert after.recipe == manifest.recipe
    assert [part.cells for part in after.parts] == [part.cells for part in manifest.parts]
    assert len(part_files(parts)) == len(manifest.parts)  # it names the files as they are now


def test_a_store_still_belongs_to_its_database(
    town: World, database: SignatureDatabase, stored: Path, tmp_path: Path
) -> None:
    shutil.copytree(tmp_path / "city.objects", tmp_path / "elsewhere")
    put(City(stored), columns(len(database)))
    for store in (open_store(stored), open_store(stored, tmp_path / "elsewhere")):
        assert len(store.objects) == len(town.street_objects)
    # What is built anew has another digest, and no columns.
    save_with_store(database, ObjectStore.of(town.street_objects), stored)
    assert not City(stored).has_columns
    save_database(database.select(slice(0, 9)), stored)
    with refused(DatabaseError, "belongs to another database"):
        open_store(stored, tmp_path / "elsewhere")


@pytest.mark.parametrize("stop", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_an_end_on_the_way_leaves_what_was_there(
    city: City, stop: BaseException, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(city, columns(len(city.database)))
    folder = city.path if city.path.is_dir() else city.path.parent
    before = {file: file.read_bytes() for file in folder.iterdir() if file.is_file()}
    written, calls = pq.write_table, 0

    def full(*args: object, **options: object) -> None:
        nonlocal calls
        calls += 1
        if calls == min(2, len(city.files)):
            raise stop
        written(*args, **options)

    with monkeypatch.context() as patch:
        patch.setattr(pq, "write_table", full)
        with pytest.raises((InputError, KeyboardInterrupt)) as caught:
            put(city, columns(len(city.database), times=2.0))
    if isinstance(stop, OSError):
        assert_sentence(caught.value, "No space left on device", "make room")
    assert {file: file.read_bytes() for file in folder.iterdir() if file.is_file()} == before
    assert not list(city.path.parent.glob(".semsig-*"))


def test_other_cells_are_refused(city: City, database: SignatureDatabase) -> None:
    some = database.select(np.arange(5, len(database)))
    with refused(DatabaseError, "other cells", "open the database again"):
        city.put_columns("numbers", columns(len(some)), cell_ids=some.cell_ids, facts={})
    assert not city.has_columns


def test_parts_that_do_not_agree_are_told(parts: Path, database: SignatureDatabase) -> None:
    put(City(parts), columns(len(database)))
    manifest = read_manifest(parts)
    first, second, *others = manifest.parts
    file = parts / second.file
    save_database(open_database(file), file)
    bare = dataclasses.replace(second, bytes=file.stat().st_size, sha256=digest(file))
    dataclasses.replace(manifest, parts=(first, bare, *others)).write(parts)
    with refused(DatabaseError, "do not agree on their numbers"):
        City(parts).columns("numbers")
