"""Cities: a database with its object store, and columns added to its file."""

from __future__ import annotations

import dataclasses
import json
import shutil
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from late_failures import assert_true, failures
from sentences import assert_sentence, refused
from worlds import CORNER, assert_index_fits, assert_same, random_town, surroundings

from semsig_gis.core import CrsError, DatabaseError, GridSpec, InputError
from semsig_gis.database import (
    City,
    ObjectStore,
    PartitionedDatabase,
    ViewpointSpec,
    build,
    build_database,
    built_digest,
    open_city,
    open_database,
    open_store,
    part_files,
    read_manifest,
    save_database,
    save_with_store,
    share_seen,
    store_path,
)
from semsig_gis.database import store as store_module
from semsig_gis.objects import (
    ConflationReport,
    Loaded,
    LoadReport,
    open_objects,
    save_objects,
)
from semsig_gis.storage import digest, whole_file

if TYPE_CHECKING:
    from pathlib import Path

    from worlds import World

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.objects import StreetObjects


# --- Cities and columns -----------------------------------------------------------------------


@pytest.fixture(params=["path", "parts"])
def city(request: pytest.FixtureRequest) -> City:
    """Return a database in one file, or in parts."""
    return City(request.getfixturevalue(request.param))


def test_a_city_has_the_database_and_its_store(
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


def test_a_city_in_parts_has_all_parts(parts: Path, database: SignatureDatabase) -> None:
    city = City(parts)
    assert_same(city.database, database)
    assert isinstance(city.dataset, PartitionedDatabase)
    assert city.files == part_files(parts)
    assert city.bytes == sum(file.stat().st_size for file in parts.iterdir() if file.is_file())
    assert city.digest == digest(*city.files)
    assert city.store_path == parts / "_inputs"
    assert city.object_counts == open_store(parts).objects.class_counts


def test_a_city_is_built_in_one_call(tmp_path: Path) -> None:
    houses = HOUSES.assign(name=["town hall", "nothing"])
    loaded = Loaded(
        objects=TOWN,
        report=LoadReport(()),
        conflation=ConflationReport(()),
        buildings=houses,
        streets=STREETS,
    )
    city = build(loaded)
    outdoor = ViewpointSpec(mode="outdoor")
    expected = build_database(TOWN, viewpoints=outdoor, footprints=houses, streets=STREETS)
    assert_same(city.database, expected)
    assert city.dataset is city.database
    assert city.has_store
    assert city.store.streets is not None
    x, y = STREETS.to_crs(TOWN.crs).geometry.iloc[0].centroid.coords[0]
    assert city.place_name(x, y) == "on Rue É, near town hall"
    assert city.columns("numbers") is None
    assert not city.has_columns
    assert "in memory" in repr(city)
    with refused(DatabaseError, "only in memory", "save_with_store"):
        _ = city.path
    with refused(InputError, "city.gpkg", ".parquet"):
        build(loaded, tmp_path / "city.gpkg")
    with refused(InputError, "str", "load"):
        build("town.osm.pbf")
    # The same in a file, and from the objects only.
    written = build(loaded, tmp_path / "city.parquet")
    again = open_city(written.path)
    assert_same(again.database, expected)
    assert again.place_name(x, y) == "on Rue É, near town hall"
    assert_same(build(TOWN, step=20.0).database, build_database(TOWN, grid=GridSpec(20.0)))
    empty = dataclasses.replace(loaded, buildings=houses.iloc[:0], streets=None)
    assert_same(build(empty).database, build_database(TOWN))


def test_a_city_is_drawn_and_exported_as_its_database(tmp_path: Path) -> None:
    city = build(TOWN)
    assert len(city.to_geodataframe()) == len(city.database)
    city.export(tmp_path / "city.gpkg")
    assert {*gpd.list_layers(tmp_path / "city.gpkg")["name"]} >= {"cells", "objects"}
    city.explore().save(tmp_path / "city.html", title="Our town")
    page = (tmp_path / "city.html").read_text(encoding="utf-8")
    assert "Our town" in page
    houses = HOUSES.assign(name=["town hall", "nothing"])
    vars(city)["store"] = ObjectStore.of(TOWN, footprints=houses, streets=STREETS)
    layer = "Streets and buildings"
    assert city.explore().page.count(layer) > page.count(layer)


def test_a_city_that_was_replaced_is_not_exported_in_part(tmp_path: Path) -> None:
    path = tmp_path / "city.parquet"
    build(TOWN, path, step=10.0)
    city = open_city(path)
    assert len(city.database)
    build(TOWN, path, step=20.0)
    with refused(DatabaseError, "city.parquet"):
        city.export(tmp_path / "city.gpkg")
    assert not (tmp_path / "city.gpkg").exists()


def test_files_that_are_not_databases_are_refused(tmp_path: Path) -> None:
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


def test_added_columns_are_read_and_signatures_unchanged(
    city: City, database: SignatureDatabase
) -> None:
    assert city.columns("numbers") is None
    assert not city.has_columns
    size = len(database)
    put(city, pa.table({"other": np.ones(size)}), name="ones")
    for times in (1.0, 3.0):  # the second table replaces the first
        expected = columns(size, times=times).drop_columns(["maybe"] if times > 1.0 else [])
        put(city, expected, times=times)
        table, facts = city.columns("numbers") or (pa.table({}), {})
        assert facts == {"times": times}
        assert table["cell_id"].to_numpy().tolist() == database.cell_ids.tolist()
        result = table.drop_columns(["cell_id"]).combine_chunks()
        assert result.equals(expected.combine_chunks())
    table, _ = city.columns("ones") or (pa.table({}), {})
    assert table["other"].to_numpy().sum() == size
    assert city.has_columns
    assert city.columns("others") is None
    assert_same(open_database(city.path), database)
    for file in city.files:  # other programs can read them too
        frame = gpd.read_parquet(file)
        rows = np.searchsorted(database.cell_ids, frame["cell_id"])
        assert frame["number"].tolist() == (rows * 3.0).tolist()
        assert frame.columns[-1] == "geometry"
        assert frame.crs == database.crs


def test_added_columns_keep_the_digest_of_a_file_and_the_recipe_of_a_folder(
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
    assert len(part_files(parts)) == len(manifest.parts)  # the manifest has the new digests


def test_added_columns_do_not_separate_a_store_from_its_database(
    town: World, database: SignatureDatabase, stored: Path, tmp_path: Path
) -> None:
    shutil.copytree(tmp_path / "city.objects", tmp_path / "elsewhere")
    put(City(stored), columns(len(database)))
    for store in (open_store(stored), open_store(stored, tmp_path / "elsewhere")):
        assert len(store.objects) == len(town.street_objects)
    # A new build has another digest, and no columns.
    save_with_store(database, ObjectStore.of(town.street_objects), stored)
    assert not City(stored).has_columns
    save_database(database.select(slice(0, 9)), stored)
    with refused(DatabaseError, "belongs to another database"):
        open_store(stored, tmp_path / "elsewhere")


@pytest.mark.parametrize("stop", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_interrupted_column_writes_change_nothing(
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


def test_columns_of_other_cells_are_refused(city: City, database: SignatureDatabase) -> None:
    some = database.select(np.arange(5, len(database)))
    with refused(DatabaseError, "have changed since it was opened", "open the database again"):
        city.put_columns("numbers", columns(len(some)), cell_ids=some.cell_ids, facts={})
    assert not city.has_columns


@pytest.mark.parametrize("number", [0, 1])
def test_parts_with_different_columns_are_refused(
    parts: Path, database: SignatureDatabase, number: int
) -> None:
    put(City(parts), columns(len(database)))
    manifest = read_manifest(parts)
    entries = list(manifest.parts)
    file = parts / entries[number].file
    save_database(open_database(file), file)
    entries[number] = dataclasses.replace(
        entries[number], bytes=file.stat().st_size, sha256=digest(file)
    )
    dataclasses.replace(manifest, parts=tuple(entries)).write(parts)
    assert City(parts).has_columns
    with refused(DatabaseError, "do not agree on their numbers"):
        City(parts).columns("numbers")


# --- Object stores ----------------------------------------------------------------------------


TOWN = random_town().street_objects
HOUSES = surroundings(shapely.box(*CORNER, *(CORNER + 9)), shapely.Polygon())
HOUSES.attrs["licenses"] = ["City (CC0): houses"]
STREETS = surroundings(
    shapely.LineString([CORNER, CORNER + 50]), half_width=[7.5], name=["Rue É"], lanes=[2]
)


def fewer(number: int) -> StreetObjects:
    return dataclasses.replace(TOWN, table=TOWN.table[number:].reset_index(drop=True))


def save(path: Path, objects: StreetObjects = TOWN) -> Path:
    save_with_store(build_database(objects), ObjectStore.of(objects), path)
    return path


def names_in(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


def assert_fits(store: ObjectStore, objects: StreetObjects) -> None:
    """Check that a store has these objects, in any order, and an R-tree over them."""
    columns = ["class_code", "source", "source_id", "count"]
    ours, theirs = (
        sorted(zip(*(rows.table[name] for name in columns), *rows.xy.T, strict=True))
        for rows in (store.objects, objects)
    )
    assert ours == theirs
    for name in ("taxonomy", "licenses", "crs"):
        assert getattr(store.objects, name) == getattr(objects, name)
    assert_index_fits(store)


def test_a_store_is_saved_next_to_its_database(stored: Path) -> None:
    assert names_in(stored.parent) == ["city.objects", "city.parquet"]
    store = open_store(stored)
    assert_fits(store, TOWN)
    assert (store.footprints, store.streets) == (None, None)
    assert_same(open_database(stored), build_database(TOWN))
    assert names_in(store_path(stored)) == ["manifest.json", "objects.parquet"]
    manifest = json.loads((store_path(stored) / "manifest.json").read_text())
    assert manifest["objects"] == len(TOWN)
    assert [*manifest["files"]] == ["objects.parquet"]


def test_buildings_and_streets_are_kept_in_the_crs_of_the_objects(tmp_path: Path) -> None:
    houses = HOUSES.assign(name=["town hall", "nothing"])
    store = ObjectStore.of(TOWN, footprints=houses, streets=STREETS)
    save_with_store(build_database(TOWN, footprints=houses), store, tmp_path / "city.parquet")
    again = open_store(tmp_path / "city.parquet")
    assert again.footprints is not None
    assert again.streets is not None
    assert again.footprints.crs == again.streets.crs == TOWN.crs
    # To the last bit, because updates compute sight lines with them.
    assert again.footprints.geometry.tolist() == houses.to_crs(TOWN.crs).geometry.tolist()[:1]
    assert again.footprints.columns.tolist() == ["name", "geometry"]
    assert again.footprints.attrs["licenses"] == ["City (CC0): houses"]
    licenses = open_database(tmp_path / "city.parquet").licenses
    assert licenses == (*map(str, TOWN.licenses), "City (CC0): houses")
    assert again.streets.drop(columns="geometry").to_dict("list") == {
        "half_width": [7.5],
        "name": ["Rue É"],
    }
    with refused(CrsError, "no coordinate reference system"):
        ObjectStore.of(TOWN, footprints=houses.set_crs(None, allow_override=True))


def test_missing_stores_and_stores_of_other_databases_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "city.parquet"
    with refused(DatabaseError, "does not exist"):
        open_store(path)
    with refused(DatabaseError, "is not a signature database in parts"):
        open_store(tmp_path)
    save_database(build_database(TOWN), path)
    with refused(DatabaseError, "no object store", "city.objects", "build the database again"):
        open_store(path)
    save(path)
    with refused(DatabaseError, "nowhere"):
        open_store(path, tmp_path / "nowhere")
    save_database(build_database(fewer(1)), path)
    with refused(DatabaseError, "belongs to another database"):
        open_store(path)
    with refused(InputError, "another suffix"):
        save(tmp_path / "town.objects")
    assert names_in(tmp_path) == ["city.objects", "city.parquet"]


def test_a_store_can_be_moved_with_its_database(stored: Path, tmp_path: Path) -> None:
    store_path(stored).rename(tmp_path / "elsewhere")
    assert_fits(open_store(stored, tmp_path / "elsewhere"), TOWN)
    (tmp_path / "far").mkdir()
    stored.rename(tmp_path / "far" / "town.parquet")
    (tmp_path / "elsewhere").rename(tmp_path / "far" / "town.objects")
    assert_fits(open_store(tmp_path / "far" / "town.parquet"), TOWN)
    (tmp_path / "link.parquet").symlink_to(tmp_path / "far" / "town.parquet")
    assert_fits(open_store(tmp_path / "link.parquet"), TOWN)


def test_buildings_around_places() -> None:
    north, south = (shapely.box(*(CORNER + low), *(CORNER + low + 8.0)) for low in (50.0, 10.0))
    store = ObjectStore.of(TOWN, footprints=surroundings(north, south))
    near = store.buildings_around(CORNER[None], distance=20.0)
    assert near is not None
    assert len(near) == 1
    assert store.buildings_around(CORNER[None] - 500.0, distance=20.0) is None
    assert ObjectStore.of(TOWN).buildings_around(CORNER[None], distance=20.0) is None


def damage(file: Path, how: str) -> None:
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 255
    file.write_bytes(content if how == "flipped" else content[: len(content) // 2])
    if how == "missing":
        file.unlink()


def test_the_r_tree_of_an_old_store_is_not_read(stored: Path) -> None:
    folder = store_path(stored)
    manifest = json.loads((folder / "manifest.json").read_text())
    for name in ("rtree.dat", "rtree.idx", "rtree.npy"):
        (folder / name).write_bytes(b"an R-tree that would end the program" * 99)
        manifest["files"][name] = digest(folder / name)
    (folder / "manifest.json").write_text(json.dumps(manifest))
    assert_fits(open_store(stored), TOWN)


@pytest.mark.parametrize("name", ["objects.parquet", "footprints.parquet", "streets.parquet"])
@pytest.mark.parametrize("how", ["cut", "flipped", "missing"])
def test_damaged_store_files_are_refused(
    database: SignatureDatabase, tmp_path: Path, name: str, how: str
) -> None:
    path = tmp_path / "city.parquet"
    store = ObjectStore.of(TOWN, footprints=HOUSES, streets=STREETS)
    save_with_store(database, store, path)
    damage(store_path(path) / name, how)
    with refused(DatabaseError, name, "damaged", "build the database again"):
        open_store(path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        *((text, "manifest.json") for text in (None, "", "{", "[]", "{}", "null")),
        ('{"kind": "other"}', "manifest.json"),
        ('{"kind": "object store", "format": 1}', "manifest.json"),
        ({"format": 99, "version": "9.9"}, "another version of semsig (9.9)"),
        ({"files": {}}, "objects.parquet is damaged"),
    ],
)
def test_damaged_store_manifests_are_refused(stored: Path, content: Any, words: str) -> None:  # noqa: ANN401
    manifest = store_path(stored) / "manifest.json"
    if isinstance(content, dict):
        content = json.dumps(json.loads(manifest.read_text()) | content)
    manifest.unlink()
    if content is not None:
        manifest.write_text(content)
    with refused(DatabaseError, words, "build the database again"):
        open_store(stored)


def test_a_store_without_the_ground_of_its_database_is_refused(tmp_path: Path) -> None:
    path, viewpoints = tmp_path / "city.parquet", ViewpointSpec(mode="streets")
    hidden = build_database(TOWN, footprints=HOUSES, streets=STREETS, viewpoints=viewpoints)
    save_with_store(hidden, ObjectStore.of(TOWN, footprints=HOUSES, streets=STREETS), path)
    manifest = store_path(path) / "manifest.json"
    content = json.loads(manifest.read_text())
    names = {"footprints.parquet": "buildings", "streets.parquet": "streets"}
    for name, what in names.items():
        files = {key: value for key, value in content["files"].items() if key != name}
        manifest.write_text(json.dumps(content | {"files": files}))
        with refused(DatabaseError, name, "damaged"):
            open_store(path)
        moved_file = (store_path(path) / name).rename(tmp_path / name)
        with refused(DatabaseError, f"lacks the {what} that the database was built with"):
            open_store(path)
        assert open_city(path).objects is None
        moved_file.rename(store_path(path) / name)
    manifest.write_text(json.dumps(content))
    assert open_store(path).streets is not None


@pytest.mark.parametrize("change", ["replaced", "missing", "added"])
def test_changed_inputs_of_tiles_are_refused(parts: Path, tmp_path: Path, change: str) -> None:
    inputs = parts / "_inputs"
    if change == "replaced":  # by objects of another city in the same place
        save_objects(fewer(7), inputs / "objects.parquet")
    elif change == "added":
        shutil.copy(inputs / "objects.parquet", inputs / "buildings.parquet")
    else:
        (inputs / "objects.parquet").rename(tmp_path / "objects.parquet")
    with refused(DatabaseError, "_inputs", "build the database again"):
        open_store(parts)
    manifest = json.loads((parts / "_manifest.json").read_text())
    assert manifest["inputs"].keys() == {"objects.parquet"}


def test_objects_of_another_city_are_recognized() -> None:
    database = build_database(TOWN)
    assert share_seen(database, TOWN) == 1.0
    assert share_seen(build_database(TOWN, footprints=HOUSES), TOWN) == 1.0
    assert 0.5 < share_seen(database, fewer(len(TOWN) // 5)) < 1.0
    assert share_seen(database, random_town(seed=99).street_objects) < 0.2


def test_reading_changes_nothing(stored: Path) -> None:
    folders = [store_path(stored), stored.parent]
    files = [stored, *folders[0].iterdir()]
    before = [(file.read_bytes(), file.stat().st_mtime_ns) for file in files]
    for folder in folders:
        folder.chmod(0o555)
    try:
        for _ in range(2):
            assert_fits(open_store(stored), TOWN)
    finally:
        for folder in folders:
            folder.chmod(0o755)
    assert [(file.read_bytes(), file.stat().st_mtime_ns) for file in files] == before
    assert len(names_in(stored.parent)) == 2


def test_a_waiting_store_is_moved_to_its_final_folder(
    stored: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    waiting = stored.with_name("city.objects.next")
    store_path(stored).rename(waiting)
    with monkeypatch.context() as patch:  # no lock is available
        patch.setattr(store_module, "place_locked", lambda _: nullcontext(enter_result=False))
        assert_fits(open_store(stored), TOWN)
        assert City(stored).store_path == waiting
    with monkeypatch.context() as patch:
        patch.setattr(store_module, "move_folder", read_only)
        assert_fits(open_store(stored), TOWN)
    assert names_in(stored.parent) == ["city.objects.next", "city.parquet"]
    assert City(stored).has_store
    assert_fits(open_store(stored), TOWN)
    assert names_in(stored.parent) == ["city.objects", "city.parquet"]


def read_only(*_: Path) -> None:
    raise InputError("nothing may be written here.")


def test_a_waiting_store_of_another_database_is_ignored(stored: Path, tmp_path: Path) -> None:
    other = save(tmp_path / "other" / "city.parquet", fewer(7))
    store_path(other).rename(stored.with_name("city.objects.next"))
    assert_fits(open_store(stored), TOWN)
    other.replace(stored)  # as by a run that is killed after this step
    assert_fits(open_store(stored), fewer(7))
    assert names_in(tmp_path) == ["city.objects", "city.parquet", "other"]


def test_database_and_store_are_read_from_one_state(
    stored: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    city, opened = open_city(stored), open_objects

    def overtaken(path: Path) -> StreetObjects:
        with monkeypatch.context() as patch:
            patch.setattr(store_module, "open_objects", opened)
            save(stored, fewer(7))
        monkeypatch.undo()
        return opened(path)

    monkeypatch.setattr(store_module, "open_objects", overtaken)
    assert_fits(open_store(stored), fewer(7))
    assert len(city.database) == len(build_database(fewer(7)))
    save(stored, fewer(12))
    for act in (lambda: city.store, lambda: put(city, columns(len(city.database)))):
        with refused(DatabaseError, "another program has changed", "run the same command again"):
            act()
    assert not City(stored).has_columns


def test_a_full_disk_leaves_database_and_store_unchanged(
    stored: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    def full_partial(_: object, partial: Path) -> None:
        with whole_file(partial):
            full()

    for name, act, file in (
        ("save_objects", full, "city.objects"),
        ("save_database", full_partial, str(stored)),  # the final name
    ):
        with monkeypatch.context() as patch:
            patch.setattr(store_module, name, act)
            with refused(InputError, f"{file} could not be written (No space", "make room"):
                save(stored, fewer(7))
        assert_fits(open_store(stored), TOWN)
        assert_same(open_database(stored), build_database(TOWN))
        assert len(names_in(stored.parent)) == 2


@pytest.mark.parametrize("calls", [1, 1000])
def test_database_and_store_are_old_or_new_as_the_message_says(
    calls: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, new = tmp_path / "city.parquet", fewer(7)
    names = {"city.parquet", "city.objects"}
    saved = build_database(new), ObjectStore.of(new)

    def state() -> str:
        count = len(open_store(path).objects)
        assert len(open_database(path)) == len(build_database(new if count == len(new) else TOWN))
        return "new" if count == len(new) else "old"

    for run in failures(monkeypatch, exchange=True, calls=calls, every=min(calls, 4)):
        save(path, TOWN)
        assert_true(run(lambda: save_with_store(*saved, path)), tmp_path, state, names=names)
    assert state() == "new"
