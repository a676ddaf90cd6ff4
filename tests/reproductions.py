"""A town on which the experiments of the paper are run, for the tests of that."""

from __future__ import annotations

from typing import TYPE_CHECKING

from worlds import random_town

from semsig_gis.database.store import ObjectStore, save_with_store

if TYPE_CHECKING:
    from pathlib import Path

TOWN = random_town()
QUERIES = 30


def save_town(folder: Path) -> Path:
    """Save the town with its street objects, and return its file."""
    file = folder / "city.parquet"
    save_with_store(TOWN.database, ObjectStore.of(TOWN.street_objects), file)
    return file
