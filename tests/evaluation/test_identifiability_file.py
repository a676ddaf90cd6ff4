"""Identifiability that is kept in its database comes back, or is told not to fit."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pytest
from cells_told import told_of
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import mixtures, random_database
from sentences import assert_sentence

from semsig_gis.core.errors import DatabaseError
from semsig_gis.database.city import City
from semsig_gis.database.file import open_database, save_database
from semsig_gis.evaluation.identify import result as identifiability_file
from semsig_gis.evaluation.identify.result import open_identifiability, save_identifiability

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.likelihood.noise.model import Noise

DATABASE = random_database(3, cells=40, classes=3)
ARRAYS = ("itself", "near", "found", "bits", "lookalikes", "lookalike_chances", "gains")


@pytest.fixture
def city(tmp_path: Path) -> Path:
    save_database(DATABASE, tmp_path / "city.parquet")
    return tmp_path / "city.parquet"


@settings(max_examples=20)
@given(st.integers(0, 100), mixtures(), st.floats(0, 1e6))
def test_all_comes_back(
    tmp_path_factory: pytest.TempPathFactory, seed: int, noise: Noise, radius: float
) -> None:
    path = tmp_path_factory.mktemp("all") / "city.parquet"
    database = random_database(seed, cells=30, classes=3)
    save_database(database, path)
    assert open_identifiability(database, path) is None
    told = dataclasses.replace(told_of(database, seed=seed), noise=noise, radius=radius)
    save_identifiability(told, path)
    opened = open_database(path)
    found = open_identifiability(opened, path)
    assert found is not None
    for name in ARRAYS:
        assert getattr(found, name).tolist() == getattr(told, name).tolist()
    for name in ("noise", "radius", "classes", "trials", "seed"):
        assert getattr(found, name) == getattr(told, name)
    assert found.database is opened
    assert found.table().equals(told.table())


def test_other_signatures_are_told(city: Path) -> None:
    save_identifiability(told_of(DATABASE), city)
    units = DATABASE.distance_units.copy()
    units[7] ^= 1
    other = dataclasses.replace(DATABASE, distance_units=units)
    with pytest.raises(DatabaseError) as caught:
        open_identifiability(other, city)
    assert_sentence(caught.value, "that of other signatures", "run semsig identify again")


def test_another_format_is_told(city: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_identifiability(told_of(DATABASE), city)
    monkeypatch.setattr(identifiability_file, "FORMAT", identifiability_file.FORMAT + 1)
    with pytest.raises(DatabaseError) as caught:
        open_identifiability(DATABASE, city)
    assert_sentence(caught.value, "another version of semsig")


@pytest.mark.parametrize("facts", [{}, {"noise": 3}, {"noise": {"name": "x", "detection": 7.0}}])
def test_damage_is_told(city: Path, facts: dict[str, object]) -> None:
    columns = pa.table({"chance_itself": np.zeros(len(DATABASE))})
    City(city).put_columns(
        identifiability_file.NAME, columns, cell_ids=DATABASE.cell_ids, facts=facts
    )
    with pytest.raises(DatabaseError) as caught:
        open_identifiability(DATABASE, city)
    assert_sentence(caught.value, "is damaged", "run semsig identify again")
