"""Companions of a database, and which of them are removed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from sentences import refused
from small_city import small_city

from semsig_gis.core import LOCK_FILE, MACHINE_PREFIX, DatabaseError, InputError, temporary_folder
from semsig_gis.database import (
    ObjectStore,
    companions,
    open_database,
    open_store,
    remove_companions,
    save_with_store,
)

if TYPE_CHECKING:
    from pathlib import Path

DATABASE, OBJECTS = small_city()


@pytest.fixture
def city(tmp_path: Path) -> Path:
    """Return a database with its store, and with files of older versions and killed runs."""
    path = tmp_path / "city.parquet"
    save_with_store(DATABASE, ObjectStore.of(OBJECTS), path)
    (tmp_path / "city.parquet.generic-8d47.likelihood").write_bytes(b"1234")
    (tmp_path / "other.parquet.generic-8d47.likelihood").write_bytes(b"1234")
    killed = tmp_path / f"{MACHINE_PREFIX}killed"
    killed.mkdir()
    (killed / LOCK_FILE).touch()
    (killed / "half").write_bytes(b"12")
    (tmp_path / "city.objects.next").mkdir()
    (tmp_path / "city.objects.next" / "manifest.json").write_bytes(b"123")
    return path


def facts(path: Path) -> dict[str, tuple[int, bool]]:
    return {item.path.name: (item.bytes, item.needed) for item in companions(path)}


def names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


def test_companions_are_listed_with_size_and_need(city: Path) -> None:
    store = sum(file.stat().st_size for file in city.with_name("city.objects").iterdir())
    assert facts(city) == {
        "city.objects": (store, True),
        "city.objects.next": (3, False),
        "city.parquet.generic-8d47.likelihood": (4, False),
        f"{MACHINE_PREFIX}killed": (2, False),
    }


def test_unneeded_companions_are_removed(city: Path) -> None:
    before = names(city.parent)
    planned = remove_companions(city, dry_run=True)
    assert names(city.parent) == before
    assert remove_companions(city) == planned
    assert sum(item.bytes for item in planned) == 9
    needed = ["city.objects", "city.parquet", "other.parquet.generic-8d47.likelihood"]
    assert names(city.parent) == needed
    assert len(open_store(city).objects) == len(OBJECTS)
    assert remove_companions(city) == ()


def test_street_objects_are_removed_on_request(city: Path) -> None:
    assert "street objects" in [item.what for item in remove_companions(city, objects=True)]
    assert facts(city) == {}
    assert len(open_database(city)) == len(DATABASE)


def test_files_of_a_running_program_are_kept(city: Path) -> None:
    with temporary_folder(city.parent) as folder:
        assert facts(city)[folder.name] == (0, True)
        remove_companions(city)
        assert folder.is_dir()


def test_a_waiting_store_is_kept(city: Path) -> None:
    waiting = city.with_name("city.objects.next")
    remove_companions(city)
    city.with_name("city.objects").rename(waiting)
    assert facts(city).keys() == {"city.objects"}
    assert len(open_store(city).objects) == len(OBJECTS)


def test_indexes_of_a_link_and_of_its_database_are_removed(city: Path, tmp_path: Path) -> None:
    link = tmp_path / "links" / "here.parquet"
    link.parent.mkdir()
    link.symlink_to(city)
    index = link.with_name("here.parquet.light-0000.likelihood")
    index.symlink_to(city)
    removed = [item.path for item in remove_companions(link)]
    assert {index, city.with_name("city.parquet.generic-8d47.likelihood")} <= {*removed}
    assert city.exists()
    assert not index.is_symlink()


def test_a_failed_removal_is_reported(city: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def denied(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.unlink", denied)
    with refused(InputError, "likelihood cannot be removed (Permission denied)", "ask its owner"):
        remove_companions(city)


def test_companions_of_a_missing_database_are_refused(tmp_path: Path) -> None:
    with refused(DatabaseError, "does not exist"):
        companions(tmp_path / "city.parquet")
