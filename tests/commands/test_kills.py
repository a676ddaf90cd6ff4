"""Killed commands: the old files stay, or the new files are complete.

The next command works, and removes the temporary files of the killed one. Only some moments and
commands are tested here, many more by `make soak`.
"""

from __future__ import annotations

import dataclasses
import itertools
import shutil
import signal
from typing import TYPE_CHECKING, NamedTuple

import pytest
from kills import killed_at
from worlds import assert_index_fits, random_town

from semsig_gis.database import ObjectStore, build_database, open_city, save_with_store
from semsig_gis.objects import save_objects

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from conftest import Run
    from semsig_gis.objects import StreetObjects

BEFORE = random_town().street_objects
AFTER = dataclasses.replace(BEFORE, table=BEFORE.table[7:].reset_index(drop=True))
CELLS = {len(build_database(objects)): len(objects) for objects in (BEFORE, AFTER)}


def save_city(objects: StreetObjects, path: Path) -> None:
    save_with_store(build_database(objects), ObjectStore.of(objects), path)


class Place(NamedTuple):
    """The folder of a killed command, and the change to files that it was about to make."""

    folder: Path
    change: str


@pytest.fixture
def prepared(tmp_path: Path) -> Path:
    """Return a folder with two cities and changed objects."""
    folder = tmp_path / "prepared"
    (folder / "temporary").mkdir(parents=True)
    save_objects(BEFORE, folder / "before.parquet")
    save_objects(AFTER, folder / "objects.parquet")
    save_city(BEFORE, folder / "city.parquet")
    save_city(AFTER, folder / "other.parquet")
    return folder


def kills(prepared: Path, line: str, *, every: int = 1) -> Iterator[Place]:
    """Run a command in copies of a folder, and kill it at a later change each time."""
    for number in itertools.count(1, every):
        folder = prepared.with_name("killed")
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(prepared, folder)
        env = {"TMPDIR": str(folder / "temporary")}
        outcome = killed_at(number, line, cwd=folder, env=env)
        if outcome.code != -signal.SIGKILL:
            assert outcome.code == 0, outcome.err
            assert names_in(folder) >= names_in(prepared)
            return
        yield Place(folder, outcome.changes[-1])


def names_in(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


def assert_one_city(path: Path) -> int:
    """Check that a database and its store match, and return their number of objects."""
    city = open_city(path)
    assert len(city.store.objects) == CELLS[len(city.database)]
    assert_index_fits(city.store)
    return len(city.store.objects)


UPDATE = "--objects objects.parquet --json"


@pytest.mark.parametrize(
    ("line", "every"),
    [
        (f"update city.parquet {UPDATE}", 8),
        (f"update other.parquet {UPDATE} --out city.parquet", 9),
    ],
)
def test_killed_update_leaves_the_old_or_the_new_city(
    prepared: Path, line: str, every: int, monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    outcomes = set()
    for folder, change in kills(prepared, line, every=every):
        assert (folder / "city.objects").is_dir(), change
        outcomes.add(assert_one_city(folder / "city.parquet"))
        monkeypatch.chdir(folder)
        code, _, err = run(line)
        assert code == 0, (change, err)
        assert assert_one_city(folder / "city.parquet") == len(AFTER)
        assert names_in(folder) == names_in(prepared), change
    assert len(BEFORE) in outcomes


TILES = "build objects.parquet --out city --tile 100"


def test_killed_build_leaves_the_old_or_the_new_tiles(
    prepared: Path, monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    monkeypatch.chdir(prepared)
    code, _, err = run("build before.parquet --out city --tile 100")
    assert code == 0, err
    names, outcomes = names_in(prepared), set()
    for folder, change in kills(prepared, TILES, every=26):
        outcomes.add(CELLS[len(open_city(folder / "city").database)])
        monkeypatch.chdir(folder)
        code, _, err = run(TILES)
        assert code == 0, (change, err)
        assert CELLS[len(open_city(folder / "city").database)] == len(AFTER)
        assert names_in(folder) == names, change
    assert outcomes == {len(BEFORE), len(AFTER)}


def test_killed_export_leaves_the_old_or_the_new_file(prepared: Path) -> None:
    (prepared / "cells.gpkg").write_text("old")
    line = "export city.parquet --out cells.gpkg"
    sizes = [(folder / "cells.gpkg").stat().st_size for folder, _ in kills(prepared, line)]
    assert sizes[0] == 3
    assert {*sizes} == {3, sizes[-1]}
