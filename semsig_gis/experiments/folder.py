"""The folder of an experiment: its recipe, and its results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core.errors import DatabaseError
from semsig_gis.evaluation.file import open_evaluation, save_evaluation
from semsig_gis.evaluation.spec import parse_experiment
from semsig_gis.reports.experiment import experiment_figures, experiment_markdown
from semsig_gis.storage.runs import RunKind, read_json, write_json
from semsig_gis.storage.toml import toml_text
from semsig_gis.storage.whole import write_whole

if TYPE_CHECKING:
    from collections.abc import Mapping

    import geopandas as gpd

    from semsig_gis.evaluation.result import Evaluation
    from semsig_gis.evaluation.spec import ExperimentSpec

PARTS = "_parts"
"""Folder of the answers in a run that is not finished."""

SPEC = "experiment.toml"
INPUTS = "inputs.json"
FIGURES = "figures.csv"
REPORT = "report.md"
DISTRICTS = "districts.csv"


def _read_recipe(folder: Path) -> dict[str, Any]:
    """Return the experiment as plain values, with ``inputs`` and ``versions``."""
    text = (folder / SPEC).read_text(encoding="utf-8")
    spec = parse_experiment(text, where=str(folder / SPEC))
    # A process that was killed between the two files has left no inputs, and no results.
    inputs = read_json(folder / INPUTS) if (folder / INPUTS).exists() else {}
    return {**spec.to_dict(), **inputs}


def _write_recipe(folder: Path, recipe: dict[str, Any]) -> None:
    inputs = {name: recipe[name] for name in ("inputs", "versions")}
    spec = {name: value for name, value in recipe.items() if name not in inputs}
    write_whole(folder / SPEC, toml_text(spec))
    write_json(folder / INPUTS, inputs)


RUN = RunKind(
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


def write_results(
    folder: Path,
    spec: ExperimentSpec,
    results: Mapping[str, Evaluation],
    *,
    districts: gpd.GeoDataFrame | None = None,
) -> None:
    """Write the results, given by the names of their cases, into the folder of a run."""
    for name, evaluation in results.items():
        save_evaluation(evaluation, folder / name)
        if districts is not None and spec.districts is not None:
            by_district = evaluation.by_district(districts, spec.districts.name)
            write_whole(folder / name / DISTRICTS, by_district.to_csv(index=False))
    write_whole(folder / FIGURES, experiment_figures(results).to_csv(index=False))
    write_whole(folder / REPORT, experiment_markdown(spec, results))


def open_results(folder: str | Path) -> dict[str, Evaluation]:
    """Open the results of an experiment, or of one evaluation.

    Parameters
    ----------
    folder : str or Path
        What `run_experiment` or `save_evaluation` wrote.

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
        return {"": open_evaluation(place)}
    try:
        text = (place / SPEC).read_text(encoding="utf-8")
    except OSError as error:
        msg = f"{place} holds no results; give a folder that `semsig evaluate` wrote."
        raise DatabaseError(msg) from error
    spec = parse_experiment(text, where=str(place / SPEC))
    return {case.name: open_evaluation(place / case.name) for case in spec.cases}
