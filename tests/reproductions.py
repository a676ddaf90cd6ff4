"""Runs of experiments: a town for those of the paper, and the files that a run leaves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from worlds import random_town

from semsig_gis.database.city import ObjectStore, save_with_store

if TYPE_CHECKING:
    from pathlib import Path

    from worlds import World

TOWN = random_town()
QUERIES = 30


def save_town(folder: Path, town: World = TOWN, name: str = "city.parquet") -> Path:
    """Save a town with its street objects, and return its file."""
    save_with_store(town.database, ObjectStore.of(town.street_objects), folder / name)
    return folder / name


def contents(folder: Path) -> dict[str, bytes]:
    """Return all files in a folder, but for those that tell times."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in {"timing.json", "times.json"}
    }
