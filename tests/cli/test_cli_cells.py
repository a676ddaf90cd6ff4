"""Maps of cells as their user meets them: which look the same, and what has changed."""

from __future__ import annotations

import dataclasses
import shutil
from typing import TYPE_CHECKING

import pytest
from sentences import sentence
from worlds import random_town

from semsig_gis.database.build import build_database
from semsig_gis.database.file import store_path
from semsig_gis.database.store import ObjectStore, save_with_store

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Run = Callable[..., tuple[int, str, str]]

OBJECTS = random_town().street_objects
FEWER = dataclasses.replace(OBJECTS, table=OBJECTS.table[4:].reset_index(drop=True))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a city, and the same a year later."""
    place = tmp_path_factory.mktemp("cells")
    for name, objects in (("old", OBJECTS), ("new", FEWER)):
        file = place / f"{name}.parquet"
        save_with_store(build_database(objects), ObjectStore.of(objects), file)
    return place


def test_a_map_of_cells_that_look_the_same(folder: Path, run: Run) -> None:
    out = folder / "same.html"
    code, printed, _ = run("map", folder / "old.parquet", "--ambiguity", "--out", out)
    assert (code, printed) == (0, f"map: {out}\n")
    assert "Cells that look the same" in out.read_text(encoding="utf-8")


def test_a_map_of_what_has_changed(folder: Path, run: Run, tmp_path: Path) -> None:
    out = folder / "drift.html"
    old, new = folder / "old.parquet", folder / "new.parquet"
    code, printed, told = run("map", old, "--drift", new, "--out", out)
    assert (code, printed) == (0, f"map: {out}\n")
    assert "not at hand" not in told
    assert "Objects removed (4)" in out.read_text(encoding="utf-8")
    # Without its store, a database has cells to compare, but no objects.
    lonely = shutil.copy(new, tmp_path / "new.parquet")
    code, _, told = run("map", old, "--drift", lonely, "--out", out)
    assert code == 0
    assert "drawing cells only" in told
    assert "Objects removed" not in out.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--drift", "gone.parquet"), ("gone.parquet does not exist",)),
        (("--drift", "{folder}/old.objects"), ("old.objects",)),
        (("--drift", "{folder}/new.parquet", "--ambiguity"), ("give one of them",)),
        (("--ambiguity", "--identifiability"), ("give one of them",)),
    ],
)
def test_input_that_cannot_be_used(
    options: tuple[str, ...], words: tuple[str, ...], folder: Path, run: Run
) -> None:
    named = (option.format(folder=folder) for option in options)
    out = folder / "never.html"
    sentence(run("map", folder / "old.parquet", *named, "--out", out), *words)
    assert not out.exists()


def test_a_map_is_written_whole_or_not_at_all(folder: Path, run: Run) -> None:
    assert store_path(folder / "old.parquet").is_dir()
    outcome = run("map", folder / "old.parquet", "--ambiguity", "--out", folder)
    sentence(outcome, "folder")
