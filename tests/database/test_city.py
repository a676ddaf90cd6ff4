"""Cities: a database and what lies beside it, and columns put in whole or not at all."""

from __future__ import annotations

import json
import shutil
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from sentences import assert_sentence, refused
from worlds import assert_same, random_town

from semsig_gis.core.errors import DatabaseError, InputError
from semsig_gis.database.city import City, open_city
from semsig_gis.database.file import (
    MANIFEST,
    PartitionedDatabase,
    built_digest,
    digest,
    open_database,
    part_files,
    save_database,
)
from semsig_gis.database.store import ObjectStore, open_store, save_with_store
from semsig_gis.database.tiles import TileSpec, build_tiles
from semsig_gis.objects.table import save_objects

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.database.database import SignatureDatabase

WORLD = random_town()
CITY = WORLD.database


@pytest.fixture(params=["file", "parts"])
def city(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return a database in one file, or in parts."""
    if request.param == "file":
        save_database(CITY, tmp_path / "city.parquet")
        return tmp_path / "city.parquet"
    save_objects(WORLD.street_objects, tmp_path / "objects.parquet")
    build_tiles(tmp_path / "objects.parquet", tmp_path / "city", tile=TileSpec(100.0))
    assert len(part_files(tmp_path / "city")) > 2
    return tmp_path / "city"


# --- What lies beside a database ------------------------------------------------------------------


def test_a_city_is_the_database_and_what_lies_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "city.parquet"
    save_with_store(CITY, ObjectStore.of(WORLD.street_objects), path)
    city = open_city(str(path))
    assert_same(city.database, CITY)
    assert city.dataset is city.database
    assert city.licenses == CITY.licenses
    assert (city.files, city.bytes, city.digest) == ((path,), path.stat().st_size, digest(path))
    assert city.has_store
    assert city.store is city.store
    assert city.object_counts == WORLD.street_objects.class_counts
    shutil.rmtree(city.store_path)
    city = open_city(path)
    assert not city.has_store
    assert city.objects is None
    assert city.object_counts is None
    with pytest.raises(DatabaseError, match="has no object store"):
        _ = city.store


def test_a_city_in_parts_is_opened_whole_or_in_parts(city: Path) -> None:
    opened = open_city(city)
    assert_same(opened.database, CITY)
    assert isinstance(opened.dataset, PartitionedDatabase) == city.is_dir()
    assert len(opened.dataset) == len(CITY)
    if city.is_dir():
        assert opened.files == part_files(city)
        assert opened.bytes == sum(file.stat().st_size for file in city.iterdir())
        assert opened.digest == digest(*opened.files)


# --- Columns that are put into a database ---------------------------------------------------------


def columns(database: SignatureDatabase = CITY, *, times: float = 1.0) -> pa.Table:
    numbers = np.arange(len(database)) * times
    return pa.table({"number": numbers, "maybe": pa.array(numbers.astype(int), mask=numbers < 9)})


def put(path: Path, table: pa.Table, *, name: str = "numbers", facts: Any = None) -> None:  # noqa: ANN401
    City(path).put_columns(name, table, cell_ids=CITY.cell_ids, facts=facts or {"made": "up"})


def columns_of(path: Path, name: str = "numbers") -> tuple[pa.Table, dict[str, Any]]:
    stored = City(path).columns(name)
    assert stored is not None
    return stored


def test_columns_come_back_beside_signatures_that_stay(city: Path) -> None:
    assert City(city).columns("numbers") is None
    assert not City(city).has_columns
    before = open_database(city)
    put(city, columns())
    table, facts = columns_of(city)
    assert facts == {"made": "up"}
    assert table["cell_id"].to_numpy().tolist() == CITY.cell_ids.tolist()
    assert table.drop_columns(["cell_id"]).combine_chunks().equals(columns().combine_chunks())
    assert City(city).has_columns
    assert_same(open_database(city), before)
    assert City(city).columns("others") is None


def test_columns_of_one_name_replace_each_other(city: Path) -> None:
    put(city, columns())
    put(city, pa.table({"other": np.ones(len(CITY))}), name="ones")
    put(city, columns(times=3.0).drop_columns(["maybe"]), facts={"times": 3})
    table, facts = columns_of(city)
    assert table.column_names == ["cell_id", "number"]
    assert table["number"].to_numpy().tolist() == (np.arange(len(CITY)) * 3.0).tolist()
    assert facts == {"times": 3}
    ones, _ = columns_of(city, "ones")
    assert ones["other"].to_numpy().sum() == len(CITY)


def test_other_programs_see_the_columns(city: Path) -> None:
    put(city, columns())
    for file in part_files(city) if city.is_dir() else [city]:
        seen = gpd.read_parquet(file)
        rows = np.searchsorted(CITY.cell_ids, seen["cell_id"])
        assert seen["number"].tolist() == rows.tolist()
        assert seen.columns[-1] == "geometry"
        assert seen.crs == CITY.crs


def test_what_was_not_damaged_before_is_not_after(city: Path) -> None:
    if city.is_dir():
        manifest = json.loads((city / MANIFEST).read_text())
        put(city, columns())
        after = json.loads((city / MANIFEST).read_text())
        assert after["recipe"] == manifest["recipe"]
        assert [part["cells"] for part in after["parts"]] == [
            part["cells"] for part in manifest["parts"]
        ]
        # It names the files as they are now.
        assert len(part_files(city)) == len(manifest["parts"])
        return
    was = digest(city)
    assert built_digest(city) == was
    put(city, columns())
    put(city, columns(times=2.0))
    assert built_digest(city) == was != digest(city)


def test_a_store_still_belongs_to_its_database(tmp_path: Path) -> None:
    path = tmp_path / "city.parquet"
    save_with_store(CITY, ObjectStore.of(WORLD.street_objects), path)
    shutil.copytree(tmp_path / "city.objects", tmp_path / "elsewhere")
    put(path, columns())
    for store in (open_store(path), open_store(path, tmp_path / "elsewhere")):
        assert len(store.objects) == len(WORLD.street_objects)
    # What is built anew has another digest, and no columns.
    save_with_store(CITY, ObjectStore.of(WORLD.street_objects), path)
    assert not City(path).has_columns
    save_database(CITY.select(slice(0, 9)), path)
    with pytest.raises(DatabaseError, match="belongs to another database"):
        open_store(path, tmp_path / "elsewhere")


@pytest.mark.parametrize("stop", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_an_end_on_the_way_leaves_what_was_there(
    city: Path, stop: BaseException, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(city, columns())
    files = sorted(city.iterdir()) if city.is_dir() else [city]
    before = [file.read_bytes() for file in files]
    written, calls = pq.write_table, 0

    def full(*args: object, **options: object) -> None:
        nonlocal calls
        calls += 1
        if calls == (2 if city.is_dir() else 1):
            raise stop
        written(*args, **options)

    with monkeypatch.context() as patch:
        patch.setattr(pq, "write_table", full)
        with pytest.raises((InputError, KeyboardInterrupt)) as caught:
            put(city, columns(times=2.0))
    if isinstance(stop, OSError):
        assert isinstance(caught.value, InputError)
        assert_sentence(caught.value, "No space left on device", "make room")
    assert (sorted(city.iterdir()) if city.is_dir() else [city]) == files
    assert [file.read_bytes() for file in files] == before
    assert not list(city.parent.glob(".semsig-*"))


def test_other_cells_are_refused(city: Path) -> None:
    some = CITY.select(np.arange(5, len(CITY)))
    with refused(DatabaseError, "other cells", "open the database again"):
        City(city).put_columns("numbers", columns(some), cell_ids=some.cell_ids, facts={})
    assert not City(city).has_columns


def test_parts_that_do_not_agree_are_told(tmp_path: Path) -> None:
    save_objects(WORLD.street_objects, tmp_path / "objects.parquet")
    build_tiles(tmp_path / "objects.parquet", tmp_path / "city", tile=TileSpec(100.0))
    put(tmp_path / "city", columns())
    one = part_files(tmp_path / "city")[1]
    part = open_database(one)
    save_database(part, one)
    manifest = json.loads((tmp_path / "city" / MANIFEST).read_text())
    manifest["parts"][1] |= {"bytes": one.stat().st_size, "sha256": digest(one)}
    (tmp_path / "city" / MANIFEST).write_text(json.dumps(manifest))
    with refused(DatabaseError, "do not agree on their numbers"):
        City(tmp_path / "city").columns("numbers")


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
    with pytest.raises(FileNotFoundError):
        built_digest(tmp_path / "nowhere.parquet")
