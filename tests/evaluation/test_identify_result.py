"""What is known of the cells: as columns, in sum, and kept in their database."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import mixtures, random_database
from sentences import refused
from small_city import chances_of

from semsig_gis.core.errors import DatabaseError
from semsig_gis.database.city import City
from semsig_gis.database.file import open_database, save_database
from semsig_gis.evaluation.identify import result as identifiability_file
from semsig_gis.evaluation.identify.result import open_identifiability, save_identifiability

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.likelihood.noise.model import Noise

DATABASE = random_database(3, cells=40, classes=3)
TOLD = chances_of(DATABASE)
NAMES = ["alignment_tree", "water_fountain", "street_light"]


@pytest.fixture
def city(tmp_path: Path) -> Path:
    save_database(DATABASE, tmp_path / "city.parquet")
    return tmp_path / "city.parquet"


@pytest.mark.parametrize("rows", [slice(None), slice(3, 11), slice(0, 0)])
def test_columns_hold_what_is_known_cell_by_cell(rows: slice) -> None:
    told, table = TOLD, TOLD.table(rows)
    cells = np.arange(len(DATABASE))[rows]
    ids = DATABASE.cell_ids
    for line, cell in zip(table.to_pylist(), cells.tolist(), strict=True):
        assert line["chance_itself"] == told.itself[cell]
        assert line["chance_near"] == told.near[cell]
        assert line["chance_found"] == told.found[cell]
        assert line["bits_left"] == told.bits[cell]
        for place, other in enumerate(told.lookalikes[cell].tolist()):
            assert line[f"lookalike_{place + 1}"] == (ids[other] if other >= 0 else None)
            assert line[f"lookalike_{place + 1}_chance"] == told.lookalike_chances[cell, place]
        assert [line[f"gain_{name}"] for name in NAMES] == told.gains[cell].tolist()


def test_the_summary_adds_up() -> None:
    told = TOLD
    facts = told.summary(object_counts={1: 50, 2: 10})
    assert sum(band["cells"] for band in facts["bands"]) == facts["cells"] == 40
    assert sum(band["share"] for band in facts["bands"]) == pytest.approx(1.0)
    for band in facts["bands"]:
        top = np.inf if band["to"] == 1 else band["to"]
        inside = (told.found >= band["from"]) & (told.found < top)
        assert band["cells"] == int(inside.sum())
    assert facts["noise"] == "medium"
    assert facts["chance_found"] == pytest.approx(told.found.mean())
    gains = [item["chance_near"] for item in facts["classes"]]
    assert gains == sorted(gains, reverse=True)
    by_code = {item["code"]: item for item in facts["classes"]}
    assert by_code[1]["chance_near_per_1000"] == 20.0 * by_code[1]["chance_near"]
    assert by_code[3]["objects"] == 0
    assert by_code[3]["chance_near_per_1000"] is None
    assert told.summary()["classes"][0]["objects"] is None


@settings(max_examples=20)
@given(st.integers(0, 100), mixtures(), st.floats(0, 1e6))
def test_all_comes_back(
    tmp_path_factory: pytest.TempPathFactory, seed: int, noise: Noise, radius: float
) -> None:
    path = tmp_path_factory.mktemp("all") / "city.parquet"
    database = random_database(seed, cells=30, classes=3)
    save_database(database, path)
    assert open_identifiability(database, path) is None
    told = dataclasses.replace(chances_of(database, seed=seed), noise=noise, radius=radius)
    save_identifiability(told, path)
    opened = open_database(path)
    found = open_identifiability(opened, path)
    assert found is not None
    for name in ("noise", "radius", "classes", "trials", "seed"):
        assert getattr(found, name) == getattr(told, name)
    assert found.database is opened
    assert found.table().equals(told.table())


def test_other_signatures_and_formats_are_told(city: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_identifiability(TOLD, city)
    units = DATABASE.distance_units.copy()
    units[7] ^= 1
    other = dataclasses.replace(DATABASE, distance_units=units)
    with refused(DatabaseError, "that of other signatures", "run semsig identify again"):
        open_identifiability(other, city)
    monkeypatch.setattr(identifiability_file, "FORMAT", identifiability_file.FORMAT + 1)
    with refused(DatabaseError, "another version of semsig"):
        open_identifiability(DATABASE, city)


@pytest.mark.parametrize("facts", [{}, {"noise": 3}, {"noise": {"name": "x", "detection": 7.0}}])
def test_damage_is_told(city: Path, facts: dict[str, object]) -> None:
    columns = pa.table({"chance_itself": np.zeros(len(DATABASE))})
    City(city).put_columns(
        identifiability_file.NAME, columns, cell_ids=DATABASE.cell_ids, facts=facts
    )
    with refused(DatabaseError, "is damaged", "run semsig identify again"):
        open_identifiability(DATABASE, city)
