"""The folder of an experiment: begun, taken up, filled, opened, and never mixed with another.

An unfinished run is in ``OUT.partial``. The experiment, what its inputs are and the versions are
written there first; what is there later must be of the same.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core.errors import DatabaseError
from semsig_gis.evaluation.result import Evaluation
from semsig_gis.evaluation.spec import parse_experiment
from semsig_gis.reports.experiment import experiment_figures, experiment_markdown
from semsig_gis.storage.runs import RunKind, finish, partial_folder, read_json, write_json
from semsig_gis.storage.toml import toml_text
from semsig_gis.storage.whole import write_whole

if TYPE_CHECKING:
    from collections.abc import Mapping

    import geopandas as gpd

    from semsig_gis.evaluation.spec import ExperimentSpec

PARTS = "_parts"
"""Folder of the answers in a run that is not finished."""

SPEC = "experiment.toml"
INPUTS = "inputs.json"
FIGURES = "figures.csv"
REPORT = "report.md"
DISTRICTS = "districts.csv"


def _read_recipe(folder: Path) -> dict[str, Any]:
    text = (folder / SPEC).read_text(encoding="utf-8")
    spec = parse_experiment(text, where=str(folder / SPEC))
    return {**spec.to_dict(), **read_json(folder / INPUTS)}


def _write_recipe(folder: Path, recipe: dict[str, Any]) -> None:
    inputs = {name: recipe[name] for name in ("inputs", "versions")}
    write_json(folder / INPUTS, inputs)
    spec = {name: value for name, value in recipe.items() if name not in inputs}
    write_whole(folder / SPEC, toml_text(spec))


EXPERIMENT_RUN = RunKind(
    content="results of an experiment",
    another=(
        "{folder} holds the results of another experiment, which differs in {difference}; choose "
        "another folder, or delete that one."
    ),
    read=_read_recipe,
    write=_write_recipe,
    names={SPEC, INPUTS, PARTS},
    results=f"{PARTS}/*",
)


def finished_run(out: str | Path, recipe: dict[str, Any]) -> bool:
    """Return whether `out` holds the results of an experiment; False if it does not exist.

    The `recipe` is `ExperimentSpec.to_dict` with ``inputs`` and ``versions``. Raise InputError if
    the folder holds anything else.
    """
    target = Path(os.path.realpath(out))
    if not target.exists():
        return False
    EXPERIMENT_RUN.require_same(target, recipe)
    shutil.rmtree(target / PARTS, ignore_errors=True)  # of a run that was killed at the very end
    return True


def begin_run(out: str | Path, recipe: dict[str, Any]) -> Path:
    """Begin a run, or take up an unfinished one, and return the folder to work in.

    Raise InputError if that holds an unfinished run of another recipe (see `finished_run`) or
    something else.
    """
    folder = partial_folder(out)
    EXPERIMENT_RUN.begin(folder, recipe)
    return folder


def write_results(
    partial: Path,
    spec: ExperimentSpec,
    results: Mapping[str, Evaluation],
    *,
    districts: gpd.GeoDataFrame | None = None,
) -> None:
    """Write all results of a run, given by the names of their cases, into the folder to work in."""
    for name, evaluation in results.items():
        evaluation.save(partial / name)
        if districts is not None and spec.districts is not None:
            by_district = evaluation.by_district(districts, spec.districts.name)
            write_whole(partial / name / DISTRICTS, by_district.to_csv(index=False))
    write_whole(partial / FIGURES, experiment_figures(results).to_csv(index=False))
    write_whole(partial / REPORT, experiment_markdown(spec, results))


def finish_run(partial: Path) -> None:
    """Put the results of a run in their place, by renaming the folder to work in."""
    shutil.rmtree(finish(partial) / PARTS)


def open_results(folder: str | Path) -> dict[str, Evaluation]:
    """Open the results of an experiment, or of one evaluation.

    Parameters
    ----------
    folder : str or Path
        What `run_experiment` or `Evaluation.save` wrote.

    Returns
    -------
    dict of str to Evaluation
        The evaluations by the names of their cases; that of one evaluation is ``""``.

    Raises
    ------
    DatabaseError
        If the folder holds neither, or an evaluation is missing or damaged.

    Examples
    --------
    >>> open_results("nowhere")
    Traceback (most recent call last):
    ...
    semsig_gis.core.errors.DatabaseError: nowhere holds no results;
    give a folder that `semsig evaluate`
    wrote.
    """
    place = Path(folder)
    if (place / "queries.parquet").is_file():
        return {"": Evaluation.load(place)}
    try:
        text = (place / SPEC).read_text(encoding="utf-8")
    except OSError as error:
        msg = f"{place} holds no results; give a folder that `semsig evaluate` wrote."
        raise DatabaseError(msg) from error
    spec = parse_experiment(text, where=str(place / SPEC))
    return {case.name: Evaluation.load(place / case.name) for case in spec.cases}
