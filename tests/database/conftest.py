"""Fixtures of the tests of databases: a town of sixty objects, in memory and in files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from worlds import random_town

from semsig_gis.database import ObjectStore, TileSpec, build_tiles, save_database, save_with_store
from semsig_gis.objects import save_objects

if TYPE_CHECKING:
    from pathlib import Path

    from worlds import World

    from semsig_gis.database import SignatureDatabase


@pytest.fixture(scope="session")
def town() -> World:
    return random_town()


@pytest.fixture(scope="session")
def database(town: World) -> SignatureDatabase:
    return town.database


@pytest.fixture
def path(database: SignatureDatabase, tmp_path: Path) -> Path:
    """Return the file of the database."""
    save_database(database, tmp_path / "city.parquet")
    return tmp_path / "city.parquet"


@pytest.fixture
def stored(town: World, database: SignatureDatabase, tmp_path: Path) -> Path:
    """Return the file of the database, saved with its object store."""
    save_with_store(database, ObjectStore.of(town.street_objects), tmp_path / "city.parquet")
    return tmp_path / "city.parquet"


@pytest.fixture
def objects_file(town: World, tmp_path: Path) -> Path:
    save_objects(town.street_objects, tmp_path / "objects.parquet")
    return tmp_path / "objects.parquet"


@pytest.fixture
def parts(objects_file: Path) -> Path:
    """Return the folder of the database in parts."""
    build_tiles(objects_file, objects_file.with_name("town"), tile=TileSpec(80.0))
    return objects_file.with_name("town")
