"""Folders of experiments; whole runs are in test_experiment_run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from noisy_cells import random_database
from sentences import assert_sentence

from semsig_gis.core.errors import DatabaseError, InputError
from semsig_gis.evaluation.evaluate import evaluate
from semsig_gis.evaluation.spec import parse_experiment
from semsig_gis.experiments.folder import (
    PARTS,
    begin_run,
    finish_run,
    finished_run,
    open_results,
    write_results,
)

if TYPE_CHECKING:
    from pathlib import Path

SPEC = parse_experiment("""
database = "city.parquet"
queries = 20
methods.fused = "edit+edit"
distortions.medium = "medium"
""")
RECIPE: dict[str, Any] = {
    **SPEC.to_dict(),
    "inputs": {"city.parquet": "ab"},
    "versions": {"numpy": "2"},
}


@pytest.fixture
def partial(tmp_path: Path) -> Path:
    """Return the folder of a run that has answered something."""
    folder = begin_run(tmp_path / "out", RECIPE)
    (folder / PARTS).mkdir()
    (folder / PARTS / "one").touch()
    return folder


def test_from_the_beginning_to_the_end(partial: Path, tmp_path: Path) -> None:
    assert partial == tmp_path / "out.partial"
    assert not finished_run(tmp_path / "out", RECIPE)
    assert begin_run(tmp_path / "out", RECIPE) == partial
    assert (partial / PARTS / "one").exists()
    found = {"medium/fused-top1": evaluate(random_database(5, cells=150), queries=20)}
    write_results(partial, SPEC, found)
    finish_run(partial)
    assert finished_run(tmp_path / "out", RECIPE)
    (loaded,) = open_results(tmp_path / "out").values()
    assert loaded.summary() == found["medium/fused-top1"].summary()
    (alone,) = open_results(tmp_path / "out" / "medium" / "fused-top1").values()
    assert alone.summary() == loaded.summary()
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "experiment.toml",
        "figures.csv",
        "inputs.json",
        "medium",
        "report.md",
    ]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"queries": 21}, ["differs in queries"]),
        ({"city": "b.parquet"}, ["differs in city"]),
        ({"inputs": {"city.parquet": "cd"}}, ["differs in inputs, city.parquet"]),
        ({"versions": {"numpy": "2", "pandas": "3"}}, ["differs in versions, pandas"]),
    ],
)
def test_a_run_of_something_else_is_not_gone_on_with(
    change: dict[str, Any], words: list[str], partial: Path, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as caught:
        begin_run(tmp_path / "out", RECIPE | change)
    assert_sentence(caught.value, str(partial), *words)
    assert (partial / PARTS / "one").exists()
    partial.rename(tmp_path / "out")
    with pytest.raises(InputError) as caught:
        finished_run(tmp_path / "out", RECIPE | change)
    assert_sentence(caught.value, *words)


def test_damaged_papers_are_refused(partial: Path, tmp_path: Path) -> None:
    (partial / "inputs.json").write_text("{", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        begin_run(tmp_path / "out", RECIPE)
    assert_sentence(caught.value, "no results of an experiment")
    (partial / "inputs.json").write_text("[]", encoding="utf-8")
    with pytest.raises(InputError):
        begin_run(tmp_path / "out", RECIPE)


def test_a_place_that_is_taken_meanwhile(partial: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "photo").touch()
    with pytest.raises(InputError) as caught:
        finish_run(partial)
    assert_sentence(caught.value, "out.partial", "run the same command again")
    assert (partial / PARTS / "one").exists()


def test_an_evaluation_that_is_missing(partial: Path) -> None:
    with pytest.raises(DatabaseError) as caught:
        open_results(partial)
    assert_sentence(caught.value, "queries.parquet", "does not exist")
