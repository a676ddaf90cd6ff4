"""Tests of semsig_gis.experiments.run; whole runs are in test_experiment_run.py."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd
import pytest
from pandas.testing import assert_frame_equal
from worlds import random_town

from semsig_gis.database.file import save_database
from semsig_gis.evaluation.spec import parse_experiment
from semsig_gis.experiments.run import ExperimentWork, Part

if TYPE_CHECKING:
    from pathlib import Path

SPEC = parse_experiment("""
database = "city.parquet"
queries = 130
seeds = [0, 5]
[methods]
fusion = "edit+edit"
stages = "edit+edit:5%"
types = "types:jaccard"
[distortions]
none = []
medium = "medium"
""")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("town")
    save_database(random_town().database, place / "city.parquet")
    return place


def test_the_parts_are_all_the_work(folder: Path) -> None:
    work = ExperimentWork(SPEC, folder)
    assert work.parts == tuple(Part(name, n) for name in ("none", "medium") for n in range(3))
    assert [work.queries_in(part) for part in work.parts] == [100, 100, 60] * 2


def answers(work: ExperimentWork, place: Path) -> dict[str, pd.DataFrame]:
    """Return what the methods answer to a part, without how long it took."""
    place.mkdir()
    work.answer(place, Part("medium", 1))
    return {
        file.name: pd.read_parquet(file).drop(columns="seconds") for file in sorted(place.iterdir())
    }


def test_methods_that_share_distances_answer_as_alone(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    work = ExperimentWork(SPEC, folder)
    together = answers(work, tmp_path / "together")
    assert list(together) == [f"medium.{name}.00001.parquet" for name in sorted(SPEC.methods)]
    assert together["medium.fusion.00001.parquet"]["seed"].value_counts().to_dict() == {
        0: 30,
        5: 70,
    }
    monkeypatch.setattr("semsig_gis.experiments.run.MEMO_BYTES", 1)
    one_by_one = answers(work, tmp_path / "one_by_one")
    for name, table in together.items():
        assert_frame_equal(one_by_one[name], table)
