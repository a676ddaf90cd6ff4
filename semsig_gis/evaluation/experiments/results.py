"""Folder of the results of an experiment."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core import DatabaseError
from semsig_gis.evaluation.experiments.tables import experiment_figures, experiment_markdown
from semsig_gis.evaluation.file import open_evaluation, save_evaluation
from semsig_gis.evaluation.spec import parse_experiment
from semsig_gis.storage import (
    RunKind,
    read_json,
    read_text,
    toml_text,
    write_json,
    write_whole,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    import geopandas as gpd

    from semsig_gis.evaluation.result import Evaluation
    from semsig_gis.evaluation.spec import ExperimentSpec

BATCHES = "_parts"  # folder of the answers in an unfinished run
SPEC = "experiment.toml"
INPUTS = "inputs.json"
FIGURES = "figures.csv"
REPORT = "report.md"
DISTRICTS = "districts.csv"


def _read_settings(folder: Path) -> dict[str, Any]:
    """Return the experiment as plain values, with ``inputs`` and ``versions``."""
    text = read_text(folder / SPEC)
    spec = parse_experiment(text, where=str(folder / SPEC))
    # If the process was killed between the two files, there are no inputs, and no results.
    inputs = read_json(folder / INPUTS) if (folder / INPUTS).exists() else {}
    return {**spec.to_dict(), **inputs}


def _write_settings(folder: Path, settings: dict[str, Any]) -> None:
    inputs = {name: settings[name] for name in ("inputs", "versions")}
    spec = {name: value for name, value in settings.items() if name not in inputs}
    write_whole(folder / SPEC, toml_text(spec))
    write_json(folder / INPUTS, inputs)


RUN = RunKind(
    content="results of an experiment",
    another=(
        "{folder} contains the results of another experiment, which differs in {difference}; "
        "choose another folder, or delete that one."
    ),
    read=_read_settings,
    write=_write_settings,
    names={SPEC, INPUTS, BATCHES},
    results=f"{BATCHES}/*",
)


def write_results(
    folder: Path,
    spec: ExperimentSpec,
    results: Mapping[str, Evaluation],
    *,
    districts: gpd.GeoDataFrame | None = None,
) -> None:
    """Write the evaluations, by the names of their cases, and the tables to a folder."""
    for name, evaluation in results.items():
        save_evaluation(evaluation, folder / name)
        if districts is not None and spec.districts is not None:
            by_district = evaluation.by_district(districts, spec.districts.name)
            write_whole(folder / name / DISTRICTS, by_district.to_csv(index=False))
    write_whole(folder / FIGURES, experiment_figures(results).to_csv(index=False))
    write_whole(folder / REPORT, experiment_markdown(spec, results))


def open_results(folder: str | Path) -> dict[str, Evaluation]:
    """Open the results of an experiment, or a single evaluation.

    Parameters
    ----------
    folder : str or Path
        Folder of `run_experiment` or of `save_evaluation`.

    Returns
    -------
    dict of str to Evaluation
        The evaluations by the names of their cases; a single evaluation has the name ``""``.

    Raises
    ------
    DatabaseError
        If the folder contains neither, or an evaluation is missing or damaged.

    Examples
    --------
    >>> open_results("nowhere")
    Traceback (most recent call last):
    ...
    semsig_gis.core.errors.DatabaseError: nowhere contains no results;
    give a folder that `semsig evaluate`
    wrote.
    """
    root = Path(folder)
    if (root / "queries.parquet").is_file():
        return {"": open_evaluation(root)}
    try:
        text = read_text(root / SPEC)
    except OSError as error:
        raise DatabaseError(
            f"{root} contains no results; give a folder that `semsig evaluate` wrote."
        ) from error
    spec = parse_experiment(text, where=str(root / SPEC))
    return {case.name: open_evaluation(root / case.name) for case in spec.cases}
