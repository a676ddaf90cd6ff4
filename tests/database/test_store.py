from __future__ import annotations

import dataclasses
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
import shapely
from sentences import refused
from worlds import CORNER, assert_same, random_town, surroundings

from semsig_gis.core.errors import CrsError, DatabaseError, InputError
from semsig_gis.core.rtree import INDEX_FILES, ObjectIndex
from semsig_gis.database import store as store_module
from semsig_gis.database.build import build_database
from semsig_gis.database.file import open_database, save_database, store_path
from semsig_gis.database.store import ObjectStore, open_store, save_with_store
from semsig_gis.storage.whole import move_folder

if TYPE_CHECKING:
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.objects.table import StreetObjects

TOWN = random_town().street_objects


@pytest.fixture(autouse=True)
def _own_temporary_folder(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Keep what killed runs leave behind out of the system's folder."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path_factory.mktemp("own")))


def fewer(objects: StreetObjects, number: int) -> StreetObjects:
    return dataclasses.replace(objects, table=objects.table[number:].reset_index(drop=True))


def saved(folder: Path, objects: StreetObjects = TOWN) -> Path:
    path = folder / "city.parquet"
    save_with_store(build_database(objects), ObjectStore.of(objects), path)
    return path


def assert_fits(store: ObjectStore, objects: StreetObjects) -> None:
    """Check that a store holds these objects, in any order, and that its R-tree is over them."""
    columns = ["class_code", "source", "source_id", "count"]
    ours, theirs = (
        sorted(zip(*(one.table[name] for name in columns), *one.xy.T, strict=True))
        for one in (store.objects, objects)
    )
    assert ours == theirs
    assert store.objects.taxonomy == objects.taxonomy
    assert store.objects.licenses == objects.licenses
    assert store.objects.crs == objects.crs
    fresh = ObjectIndex(store.objects.xy)
    for radius in (0.0, 25.0):
        found, expected = (
            sorted(zip(*index.pairs_within(objects.xy, radius=radius), strict=True))
            for index in (store.index, fresh)
        )
        assert found == expected


def test_a_store_lies_beside_its_database(tmp_path: Path) -> None:
    path = saved(tmp_path)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["city.objects", "city.parquet"]
    store = open_store(path)
    assert_fits(store, TOWN)
    assert (store.footprints, store.streets, store.notes) == (None, None, ())
    assert_same(open_database(path), build_database(TOWN))
    names = {file.name for file in store_path(path).iterdir()}
    assert names == {"manifest.json", "objects.parquet", *INDEX_FILES}
    # And again, over what is there.
    saved(tmp_path, fewer(TOWN, 5))
    assert_fits(open_store(path), fewer(TOWN, 5))
    assert sorted(file.name for file in tmp_path.iterdir()) == ["city.objects", "city.parquet"]


def test_buildings_and_streets_are_kept_in_the_crs_of_the_objects(tmp_path: Path) -> None:
    houses = surroundings(shapely.box(*CORNER, *(CORNER + 9)), shapely.Polygon())
    houses["name"] = ["town hall", "nothing"]
    streets = surroundings(shapely.LineString([CORNER, CORNER + 50]), half_width=[7.5])
    houses.attrs["licenses"] = ["City (CC0): houses"]
    store = ObjectStore.of(TOWN, footprints=houses, streets=streets)
    save_with_store(build_database(TOWN, footprints=houses), store, tmp_path / "city.parquet")
    again = open_store(tmp_path / "city.parquet")
    assert again.footprints is not None
    assert again.streets is not None
    assert again.footprints.crs == again.streets.crs == TOWN.crs
    # To the last bit, since the sight lines of an update are held against them.
    assert again.footprints.geometry.tolist() == houses.to_crs(TOWN.crs).geometry.tolist()[:1]
    assert again.footprints.columns.tolist() == ["geometry"]
    assert again.footprints.attrs["licenses"] == ["City (CC0): houses"]
    licenses = open_database(tmp_path / "city.parquet").licenses
    assert licenses == (*map(str, TOWN.licenses), "City (CC0): houses")
    assert again.streets["half_width"].tolist() == [7.5]
    bare = gpd.GeoDataFrame(geometry=[shapely.box(0, 0, 1, 1)])
    with refused(CrsError, "no coordinate reference system"):
        ObjectStore.of(TOWN, footprints=bare)


def test_a_database_without_a_store_is_told(tmp_path: Path) -> None:
    path = tmp_path / "city.parquet"
    with refused(DatabaseError, "does not exist"):
        open_store(path)
    with refused(DatabaseError, "is a folder"):
        open_store(tmp_path)
    save_database(build_database(TOWN), path)
    with refused(DatabaseError, "no object store", "city.objects", "build the database again"):
        open_store(path)


def test_the_store_of_another_database_is_told(tmp_path: Path) -> None:
    path = saved(tmp_path)
    save_database(build_database(fewer(TOWN, 1)), path)
    with refused(DatabaseError, "belongs to another database"):
        open_store(path)


def test_a_store_goes_where_its_database_goes(tmp_path: Path) -> None:
    path = saved(tmp_path)
    (tmp_path / "far").mkdir()
    path.rename(tmp_path / "far" / "town.parquet")
    store_path(path).rename(tmp_path / "far" / "town.objects")
    assert_fits(open_store(tmp_path / "far" / "town.parquet"), TOWN)
    (tmp_path / "link.parquet").symlink_to(tmp_path / "far" / "town.parquet")
    assert_fits(open_store(tmp_path / "link.parquet"), TOWN)


def test_a_store_may_lie_elsewhere(tmp_path: Path) -> None:
    path = saved(tmp_path)
    store_path(path).rename(tmp_path / "elsewhere")
    assert_fits(open_store(path, tmp_path / "elsewhere"), TOWN)
    with refused(DatabaseError, "nowhere"):
        open_store(path, tmp_path / "nowhere")


def test_buildings_around_places() -> None:
    north, south = (shapely.box(*(CORNER + low), *(CORNER + low + 8.0)) for low in (50.0, 10.0))
    store = ObjectStore.of(TOWN, footprints=surroundings(north, south))
    near = store.buildings_around(CORNER[None], distance=20.0)
    assert near is not None
    assert len(near) == 1
    assert store.buildings_around(CORNER[None] - 500.0, distance=20.0) is None
    assert ObjectStore.of(TOWN).buildings_around(CORNER[None], distance=20.0) is None


def test_no_database_may_be_called_as_a_store(tmp_path: Path) -> None:
    database = build_database(TOWN)
    with refused(InputError, "another ending"):
        save_with_store(database, ObjectStore.of(TOWN), tmp_path / "city.objects")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", INDEX_FILES)
@pytest.mark.parametrize("how", ["cut", "flipped", "gone"])
def test_a_damaged_r_tree_is_made_again(tmp_path: Path, name: str, how: str) -> None:
    path = saved(tmp_path)
    damage(store_path(path) / name, how)
    store = open_store(path)
    assert_fits(store, TOWN)
    assert len(store.notes) == 1
    assert "R-tree" in store.notes[0]
    assert "made again" in store.notes[0]
    # It is whole again when it is saved.
    save_with_store(open_database(path), store, path)
    assert open_store(path).notes == ()


def damage(file: Path, how: str) -> None:
    if how == "gone":
        file.unlink()
    elif how == "cut":
        os.truncate(file, file.stat().st_size // 2)
    else:
        content = bytearray(file.read_bytes())
        content[len(content) // 2] ^= 255
        file.write_bytes(content)


@pytest.mark.parametrize("name", ["objects.parquet", "footprints.parquet", "streets.parquet"])
@pytest.mark.parametrize("how", ["cut", "flipped", "gone"])
def test_other_damage_is_told(tmp_path: Path, name: str, how: str) -> None:
    path = tmp_path / "city.parquet"
    store = ObjectStore.of(
        TOWN,
        footprints=surroundings(shapely.box(*CORNER, *(CORNER + 9))),
        streets=surroundings(shapely.LineString([CORNER, CORNER + 50])),
    )
    save_with_store(build_database(TOWN), store, path)
    damage(store_path(path) / name, how)
    with refused(DatabaseError, name, "damaged", "build the database again"):
        open_store(path)


@pytest.mark.parametrize(
    "content",
    ["", "{", "[]", "{}", '{"kind": "other"}', '{"kind": "object store", "format": 1}', "null"],
)
def test_a_damaged_manifest_is_told(tmp_path: Path, content: str) -> None:
    path = saved(tmp_path)
    manifest = store_path(path) / "manifest.json"
    manifest.write_text(content)
    with refused(DatabaseError, "manifest.json", "build the database again"):
        open_store(path)
    manifest.unlink()
    with refused(DatabaseError, "manifest.json"):
        open_store(path)


def rewritten(path: Path, **values: object) -> None:
    manifest = store_path(path) / "manifest.json"
    manifest.write_text(json.dumps({**json.loads(manifest.read_text()), **values}))


def test_a_manifest_that_names_too_little_is_told(tmp_path: Path) -> None:
    path = saved(tmp_path)
    rewritten(path, format=99, version="9.9")
    with refused(DatabaseError, "another version of semsig (9.9)"):
        open_store(path)
    rewritten(path, format=1, files={})
    with refused(DatabaseError, "objects.parquet", "damaged"):
        open_store(path)


def test_reading_changes_nothing(tmp_path: Path) -> None:
    path = saved(tmp_path)
    files = [path, *store_path(path).iterdir()]
    before = [(file.read_bytes(), file.stat().st_mtime_ns) for file in files]
    for folder in (store_path(path), tmp_path):
        folder.chmod(0o555)
    try:
        store = open_store(path)
        assert_fits(store, TOWN)
        assert_fits(open_store(path), TOWN)
        del store
    finally:
        for folder in (tmp_path, store_path(path)):
            folder.chmod(0o755)
    assert [(file.read_bytes(), file.stat().st_mtime_ns) for file in files] == before
    assert len(list(tmp_path.iterdir())) == 2


class KilledError(BaseException):
    """What ends a run at some step."""


def steps_until_killed(
    step: int, database: SignatureDatabase, store: ObjectStore, path: Path
) -> bool:
    """Save, and die before the rename of that number; tell whether it came so far."""
    count = 0

    def counted(original: object) -> object:
        def rename(*args: object) -> object:
            nonlocal count
            count += 1
            if count == step:
                raise KilledError
            return original(*args)  # type: ignore[operator]

        return rename

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "replace", counted(os.replace))
        patch.setattr(Path, "rename", counted(Path.rename))
        # A run that is killed does not tidy up.
        tidy = shutil.rmtree
        patch.setattr(shutil, "rmtree", lambda *a, **k: None if count == step else tidy(*a, **k))
        try:
            save_with_store(database, store, path)
        except KilledError:
            return True
    return False


def test_a_run_may_be_killed_at_any_step(tmp_path: Path) -> None:
    """Database and store are both the old ones or both the new ones, whatever happens."""
    before, after = TOWN, fewer(TOWN, 7)
    old, new = build_database(before), build_database(after)
    outcomes = []
    for step in range(1, 99):
        folder = tmp_path / str(step)
        path = saved(folder, before)
        killed = steps_until_killed(step, new, ObjectStore.of(after), path)
        is_new = len(open_database(path)) == len(new)
        assert_same(open_database(path), new if is_new else old)
        assert_fits(open_store(path), after if is_new else before)
        # The next run finds nothing in its way, whether it reads first or not.
        save_with_store(old, ObjectStore.of(before), path)
        assert_fits(open_store(path), before)
        outcomes.append(is_new)
        if not killed:
            break
    assert outcomes == sorted(outcomes)
    assert {True, False} == set(outcomes)
    assert len(outcomes) > 4


def test_killed_twice_in_a_row_the_store_still_fits(tmp_path: Path) -> None:
    """The store that waits is not lost to the next run before its database is replaced."""
    sizes = [TOWN, fewer(TOWN, 7), fewer(TOWN, 12)]
    databases = [build_database(objects) for objects in sizes]
    by_cells = {len(database): objects for database, objects in zip(databases, sizes, strict=True)}
    assert len(by_cells) == 3
    for first in range(1, 9):
        for second in range(1, 9):
            path = saved(tmp_path / f"{first}-{second}")
            steps_until_killed(first, databases[1], ObjectStore.of(sizes[1]), path)
            steps_until_killed(second, databases[2], ObjectStore.of(sizes[2]), path)
            found = by_cells[len(open_database(path))]
            assert len(open_store(path).objects) == len(found), (first, second)


def test_what_waits_is_read_where_nothing_can_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = saved(tmp_path)
    store_path(path).rename(tmp_path / "city.objects.next")

    def read_only(*_: object, **__: object) -> str:
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patch:
        patch.setattr(tempfile, "mkdtemp", read_only)
        # The R-tree needs its copy.
        patch.setattr("semsig_gis.core.rtree.tempfile", shutil)
        patch.setattr(shutil, "mkdtemp", make_folder_in(tmp_path / "own"), raising=False)
        assert_fits(open_store(path), TOWN)
        assert (tmp_path / "city.objects.next").exists()
    assert_fits(open_store(path), TOWN)
    assert not (tmp_path / "city.objects.next").exists()
    assert store_path(path).is_dir()


def test_another_program_may_finish_it_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = saved(tmp_path)
    waiting = tmp_path / "city.objects.next"
    shutil.copytree(store_path(path), waiting)

    def late(new: Path, place: Path) -> None:
        new.rename(tmp_path / "taken")  # which the other has put in its place
        move_folder(new, place)

    monkeypatch.setattr(store_module, "move_folder", late)
    assert_fits(open_store(path), TOWN)
    assert not waiting.exists()
    assert store_path(path).is_dir()


def make_folder_in(parent: Path) -> object:
    def make(**_: object) -> str:
        parent.mkdir()
        return str(parent)

    return make


def test_a_full_disk_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = saved(tmp_path)

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(store_module, "save_objects", full)
    with refused(InputError, "No space left on device", "make room"):
        save_with_store(build_database(fewer(TOWN, 7)), ObjectStore.of(fewer(TOWN, 7)), path)
    assert_fits(open_store(path), TOWN)
    assert_same(open_database(path), build_database(TOWN))
    assert len(list(tmp_path.iterdir())) == 2


def test_a_full_disk_is_told_with_the_name_that_was_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = saved(tmp_path)

    def full(_: object, partial: Path) -> None:
        msg = f"{partial} could not be written (No space left on device); make room."
        raise InputError(msg)

    monkeypatch.setattr(store_module, "save_database", full)
    with pytest.raises(InputError) as caught:
        save_with_store(build_database(fewer(TOWN, 7)), ObjectStore.of(fewer(TOWN, 7)), path)
    assert str(caught.value).startswith(f"{path} could not be written")
    assert_fits(open_store(path), TOWN)


def test_a_process_that_is_killed_leaves_a_pair_that_fits(tmp_path: Path) -> None:
    """Without any tidying up, between the rename of the database and that of the store."""
    path = saved(tmp_path)
    script = (
        "import os\n"
        "from pathlib import Path\n"
        "from semsig_gis.database import store\n"
        "from semsig_gis.database.build import build_database\n"
        "from test_store import TOWN, fewer\n"
        "original = store._settle\n"
        "calls = []\n"
        "def settle(path):\n"
        "    calls.append(path)\n"
        "    if len(calls) == 2:\n"
        "        os._exit(9)\n"
        "    return original(path)\n"
        "store._settle = settle\n"
        "objects = fewer(TOWN, 7)\n"
        f"path = Path({str(path)!r})\n"
        "store.save_with_store(build_database(objects), store.ObjectStore.of(objects), path)\n"
    )
    here = Path(__file__).parents[1]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(here.parent), str(here), str(here / "database")]),
        "TMPDIR": tempfile.gettempdir(),
    }
    done = subprocess.run([sys.executable, "-c", script], env=environment, check=False)
    assert done.returncode == 9
    assert (tmp_path / "city.objects.next").is_dir()
    assert len(open_database(path)) == len(build_database(fewer(TOWN, 7)))
    assert_fits(open_store(path), fewer(TOWN, 7))
    assert sorted(file.name for file in tmp_path.iterdir() if file.name[0] != ".") == [
        "city.objects",
        "city.parquet",
    ]


def test_the_manifest_says_what_is_there(tmp_path: Path) -> None:
    path = saved(tmp_path)
    manifest = json.loads((store_path(path) / "manifest.json").read_text())
    assert manifest["objects"] == len(TOWN)
    assert set(manifest["files"]) == {"objects.parquet", *INDEX_FILES}
    assert np.load(store_path(path) / "rtree.npy").tolist() == list(range(len(TOWN)))
