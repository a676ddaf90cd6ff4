from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from sentences import assert_sentence, refused
from worlds import random_town

from semsig_gis.core.errors import InputError
from semsig_gis.database.file import MANIFEST, open_database, part_name, save_database
from semsig_gis.database.tiles import (
    RUN,
    begin,
    describe,
    finished_tiles,
    mark_empty,
    publish,
)

if TYPE_CHECKING:
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.database.file import Part

SPECS = {"grid": {"step": 10.0, "origin": (0.0, 0.0)}, "inputs": {"objects": "abc"}}
DATABASE = random_town().database


def build(folder: Path, database: SignatureDatabase = DATABASE) -> Part:
    path = folder / part_name((0, 0))
    save_database(database, path)
    mark_empty(folder, (0, 1))
    return describe((0, 0), database, path)


def test_a_run_is_taken_up_by_the_same_recipe(tmp_path: Path) -> None:
    folder = begin(tmp_path / "new" / "city", SPECS)
    assert folder == tmp_path / "new" / "city.partial"
    assert not (tmp_path / "new" / "city").exists()
    assert finished_tiles(folder, [(0, 0), (0, 1)]) == {}
    part = build(folder)
    (folder / ".semsig-x").mkdir()  # a killed worker leaves such a folder
    assert begin(tmp_path / "new" / "city", SPECS) == folder
    assert not (folder / ".semsig-x").exists()
    assert finished_tiles(folder, [(0, 0), (0, 1), (7, 7)]) == {(0, 0): part, (0, 1): None}


def test_another_recipe_is_refused_and_named_where_a_tile_is_done(tmp_path: Path) -> None:
    folder = begin(tmp_path / "city", SPECS)
    build(folder)
    for other, what in (
        ({**SPECS, "grid": {"step": 5.0, "origin": (0.0, 0.0)}}, "grid, step"),
        ({**SPECS, "inputs": {"objects": "abd"}}, "inputs, objects"),
        ({**SPECS, "inputs": {"objects": "abc", "buildings": "x"}}, "inputs, buildings"),
        ({**SPECS, "version": "9"}, "version"),
        ({"grid": SPECS["grid"]}, "inputs"),
    ):
        with refused(InputError, str(folder), what, "delete that folder"):
            begin(tmp_path / "city", other)
    assert begin(tmp_path / "city", SPECS) == folder


def test_another_recipe_replaces_a_run_that_has_done_nothing(tmp_path: Path) -> None:
    folder = begin(tmp_path / "city", SPECS)
    assert begin(tmp_path / "city", {**SPECS, "version": "9"}) == folder
    build(folder)
    assert begin(tmp_path / "city", {**SPECS, "version": "9"}) == folder


def test_a_run_is_given_up_only_while_no_tile_is_done(tmp_path: Path) -> None:
    folder = begin(tmp_path / "city", SPECS)
    assert RUN.abandon(folder)
    assert not folder.exists()
    folder = begin(tmp_path / "city", SPECS)
    mark_empty(folder, (0, 0))
    assert not RUN.abandon(folder)
    assert folder.exists()


def test_a_part_that_is_damaged_is_built_again(tmp_path: Path) -> None:
    folder = begin(tmp_path / "city", SPECS)
    build(folder)
    path = folder / part_name((0, 0))
    path.write_bytes(path.read_bytes()[:-20])
    assert finished_tiles(folder, [(0, 0), (0, 1)]) == {(0, 1): None}
    assert not path.exists()


def test_a_database_appears_whole_and_replaces_the_one_before(tmp_path: Path) -> None:
    target = tmp_path / "city"
    for database in (DATABASE, DATABASE.select(slice(20))):
        folder = begin(target, SPECS)
        parts = [build(folder, database)]
        (folder / "_inputs").mkdir()
        (folder / "_inputs" / "buildings.parquet").touch()
        assert publish(folder, parts).cells == len(database)
        assert {path.name for path in target.iterdir()} == {MANIFEST, part_name((0, 0))}
        assert len(open_database(target)) == len(database)
        assert [path.name for path in tmp_path.iterdir()] == ["city"]


def test_a_file_that_was_there_is_replaced(tmp_path: Path) -> None:
    target = tmp_path / "city.parquet"
    save_database(DATABASE, target)
    folder = begin(target, SPECS)
    publish(folder, [build(folder)])
    assert target.is_dir()
    assert [path.name for path in tmp_path.iterdir()] == ["city.parquet"]


def test_a_link_stays_and_the_folder_that_it_names_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "latest").symlink_to(tmp_path / "real")
    folder = begin(tmp_path / "latest", SPECS)
    publish(folder, [build(folder)])
    assert (tmp_path / "latest").is_symlink()
    assert (tmp_path / "real" / MANIFEST).is_file()


def test_a_folder_with_other_things_is_never_replaced(tmp_path: Path) -> None:
    target = tmp_path / "home"
    target.mkdir()
    (target / "letter.txt").touch()
    with refused(InputError, "'letter.txt'", "no part of a signature database"):
        begin(target, SPECS)
    (target / "letter.txt").unlink()
    folder = begin(target, SPECS)
    publish(folder, [build(folder)])
    (target / "notes.txt").touch()  # beside the parts
    with refused(InputError, "'notes.txt'", "move that elsewhere"):
        begin(target, SPECS)
    assert {path.name for path in target.iterdir()} == {MANIFEST, part_name((0, 0)), "notes.txt"}


def test_what_is_not_a_run_is_not_taken_for_one(tmp_path: Path) -> None:
    folder = tmp_path / "city.partial"
    folder.mkdir()
    (folder / "letter.txt").touch()
    with refused(InputError, str(folder), "'letter.txt'", "no unfinished run"):
        begin(tmp_path / "city", SPECS)
    folder = tmp_path / "a" / "city.partial"
    folder.parent.write_text("a file")
    with refused(InputError, str(folder), "Not a directory", "choose a folder"):
        begin(tmp_path / "a" / "city", SPECS)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_a_pipe_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with refused(InputError, "is a device or a pipe"):
        begin(tmp_path / "pipe", SPECS)


@pytest.mark.parametrize("fails", [1, 2])
def test_a_rename_that_fails_leaves_one_whole_database_and_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: int
) -> None:
    target = tmp_path / "city"
    folder = begin(target, SPECS)
    publish(folder, [build(folder)])
    folder = begin(target, SPECS)
    part = build(folder, DATABASE.select(slice(20)))
    rename, calls = Path.rename, []

    def refuse(self: Path, to: Path) -> Path:
        calls.append(to)
        if len(calls) == fails:
            raise PermissionError(13, "Permission denied", str(self))
        return rename(self, to)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", refuse)
        with pytest.raises(InputError) as caught:
            publish(folder, [part])
    assert_sentence(caught.value, str(target), "Permission denied", "run the same command again")
    assert len(open_database(target)) == len(DATABASE)
    # As the same command does.
    folder = begin(target, SPECS)
    assert finished_tiles(folder, [(0, 0)]) == {(0, 0): part}
    publish(folder, [part])
    assert len(open_database(target)) == 20
    assert [path.name for path in tmp_path.iterdir()] == ["city"]
