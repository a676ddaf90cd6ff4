from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import CRS
from sentences import refused
from worlds import ARRAYS, CODES, TAXONOMY, assert_same, random_town

import semsig_gis
from semsig_gis.core.errors import DatabaseError
from semsig_gis.core.grid import GridSpec
from semsig_gis.core.signature import SignatureSpec
from semsig_gis.database.database import join_databases
from semsig_gis.database.file import open_database, save_database
from semsig_gis.database.viewpoints import ViewpointSpec

if TYPE_CHECKING:
    from pathlib import Path

    from worlds import (
        World,
    )


@pytest.fixture(scope="module")
def town() -> World:
    return random_town()


def test_cells_are_ordered_and_numbered(town: World) -> None:
    database = town.database
    assert (np.diff(database.cell_ids) > 0).all()
    assert len(database) == len(database.columns) == len(database.offsets) - 1
    assert (database.lengths > 0).all()
    assert (
        database.xy.tolist() == database.grid.viewpoints(database.columns, database.rows).tolist()
    )
    assert database.crs == CRS("EPSG:2154")
    assert database.licenses == ("World (CC0): world",)
    assert database.version == semsig_gis.__version__
    assert database.present_codes.tolist() == sorted(set(database.codes.tolist()))
    assert set(database.present_codes) <= set(CODES)


def test_places_are_in_their_cells(town: World) -> None:
    cells = np.arange(len(town.database))
    aside = np.random.default_rng(1).uniform(-4.9, 4.9, (len(cells), 2))
    assert (town.database.cells_at(town.database.xy + aside) == cells).all()
    far = town.database.xy.min(axis=0) - 1000.0
    assert town.database.cells_at([far, town.database.xy[2]]).tolist() == [-1, 2]


def test_a_signature_is_a_part_of_the_arrays(town: World) -> None:
    database = town.database
    for cell in range(0, len(database), 37):
        part = slice(database.offsets[cell], database.offsets[cell + 1])
        signature = database.signature(cell)
        assert signature.codes is not None
        assert signature.bearings is not None
        assert signature.codes.tolist() == database.codes[part].tolist()
        assert signature.bearings.tolist() == database.bearings[part].tolist()
        assert database.types(cell) == TAXONOMY.decode(database.codes[part])
        for levels in (7, 8, 16, 24, 32):
            again = dataclasses.replace(database, spec=SignatureSpec(levels=levels))
            assert signature.levels(levels).tolist() == again.levels[part].tolist()
    assert ((database.bearings >= 0) & (database.bearings < 360)).all()


def test_a_database_cannot_be_changed_by_accident(town: World, tmp_path: Path) -> None:
    built = town.database
    save_database(built, tmp_path / "a.parquet")
    for database in (built, open_database(tmp_path / "a.parquet")):
        for name in (*ARRAYS, "xy", "lengths", "levels", "present_codes"):
            with pytest.raises(ValueError, match="read-only"):
                getattr(database, name)[0] = 0
        signature = database.signature(0)
        assert signature.codes is not None
        with pytest.raises(ValueError, match="read-only"):
            signature.codes[0] = 0
        with pytest.raises(dataclasses.FrozenInstanceError):
            database.spec = SignatureSpec()  # type: ignore[misc]


@given(st.lists(st.integers(0, 3), min_size=1))
def test_parts_join_into_the_whole(town: World, owners: list[int]) -> None:
    whole = town.database
    owner = np.resize(owners, len(whole))
    parts = [whole.select(owner == number) for number in range(4)]
    joined = join_databases(parts[::-1])
    assert_same(joined, whole)
    assert joined.licenses == whole.licenses


def test_selected_cells_keep_their_signatures(town: World) -> None:
    whole = town.database
    some = whole.select(np.array([5, 2, 9]))
    assert [some.types(i) for i in range(3)] == [whole.types(i) for i in (5, 2, 9)]
    assert some.cell_ids.tolist() == whole.cell_ids[[5, 2, 9]].tolist()
    assert len(whole.select(slice(0, 0))) == 0


def test_databases_that_do_not_fit_are_not_joined(town: World) -> None:
    whole = town.database
    half = whole.select(slice(10))
    for change, word in (
        ({"grid": GridSpec(20.0)}, "grid"),
        ({"spec": SignatureSpec(25.0)}, "range"),
        ({"crs": CRS("EPSG:32631")}, "coordinate"),
        ({"viewpoints": ViewpointSpec(mode="outdoor")}, "viewpoints"),
        ({"occlusion": 0.5}, "occlusion"),
    ):
        with refused(DatabaseError, word, "build both in the same way"):
            join_databases([half, dataclasses.replace(whole, **change)])
    with refused(DatabaseError, "same cell"):
        join_databases([half, whole])
    with refused(DatabaseError, "no database"):
        join_databases([])
