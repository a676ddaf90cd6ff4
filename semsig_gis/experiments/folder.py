"""The folder of an experiment: begun, taken up, filled, opened, and never mixed with another.

An unfinished run is in ``OUT.partial``. The experiment, what its inputs are and the versions are
written there first; what is there later must be of the same.
"""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core.errors import DatabaseError, InputError
from semsig_gis.evaluation.result import Evaluation
from semsig_gis.evaluation.spec import parse_experiment
from semsig_gis.reports.experiment import experiment_figures, experiment_markdown
from semsig_gis.storage.whole import whole_file

if TYPE_CHECKING:
    from collections.abc import Mapping

    import geopandas as gpd

    from semsig_gis.evaluation.spec import ExperimentSpec

PARTS = "_parts"
"""Folder of what is answered, in a run that is not finished."""

SPEC = "experiment.toml"
INPUTS = "inputs.json"
FIGURES = "figures.csv"
REPORT = "report.md"
DISTRICTS = "districts.csv"
# Files that were being written when a run was killed (see semsig_gis.storage.geoparquet).
HALF_WRITTEN = ".semsig-"


def finished_run(out: str | Path, identity: Mapping[str, Any]) -> bool:
    """Tell whether the results of an experiment are there; False if there is no such folder.

    ``identity`` is what the experiment is, as plain values: ``experiment``, ``inputs``,
    ``versions``. Raises `InputError` if the folder holds the results of another experiment, or
    something else.
    """
    target = Path(os.path.realpath(out))
    if not target.exists():
        return False
    _require_same(target, identity)
    shutil.rmtree(target / PARTS, ignore_errors=True)  # of a run that was killed at the very end
    return True


def begin_run(out: str | Path, spec: ExperimentSpec, identity: Mapping[str, Any]) -> Path:
    """Begin a run, or take up an unfinished one, and return the folder to work in.

    Raises `InputError` if that holds an unfinished run of another ``identity`` (see
    `finished_run`), or something else.
    """
    target = Path(os.path.realpath(out))
    partial = target.with_name(f"{target.name}.partial")
    if partial.exists() and not any((partial / PARTS).glob("*")):
        _require_ours(partial)
        shutil.rmtree(partial)  # it has not come to anything
    if partial.exists():
        _require_same(partial, identity)
        for left in [*partial.rglob(f"{HALF_WRITTEN}*")]:
            shutil.rmtree(left, ignore_errors=True)
        return partial
    rest = {name: value for name, value in identity.items() if name != "experiment"}
    _write_text(partial / INPUTS, json.dumps(rest, indent=2) + "\n")
    _write_text(partial / SPEC, spec.to_toml())
    return partial


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
            _write_text(partial / name / DISTRICTS, by_district.to_csv(index=False))
    _write_text(partial / FIGURES, experiment_figures(results).to_csv(index=False))
    _write_text(partial / REPORT, experiment_markdown(spec, results))


def finish_run(partial: Path) -> None:
    """Put the results of a run in their place, by renaming the folder to work in."""
    target = partial.with_name(partial.name.removesuffix(".partial"))
    try:
        partial.rename(target)
    except OSError as error:
        msg = (
            f"{target} could not be put in its place ({os.strerror(error.errno or 0)}); the "
            f"results are in {partial}, so run the same command again."
        )
        raise InputError(msg) from error
    shutil.rmtree(target / PARTS)


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


def _require_ours(folder: Path) -> None:
    """Refuse a folder with anything in it that no run wrote."""
    ours = {SPEC, INPUTS, PARTS}
    others = [
        path.name
        for path in folder.iterdir()
        if path.name not in ours and not path.name.startswith(HALF_WRITTEN)
    ]
    if others:
        msg = f"{folder} holds {min(others)!r}, which no experiment wrote; choose another folder."
        raise InputError(msg)


def _require_same(folder: Path, wanted: Mapping[str, Any]) -> None:
    """Refuse a folder with the results of another experiment, or of none."""
    try:
        text = (folder / SPEC).read_text(encoding="utf-8")
        found = json.loads((folder / INPUTS).read_text(encoding="utf-8"))
        found["experiment"] = parse_experiment(text, where=str(folder / SPEC)).to_dict()
    except (OSError, TypeError, ValueError) as error:
        msg = f"{folder} is not the results of an experiment; choose another folder."
        raise InputError(msg) from error
    for what, values in wanted.items():
        if found.get(what) != values:
            name = _difference(found.get(what), values)
            told = name if what == "experiment" else f"{what}, {name}"
            msg = (
                f"{folder} holds the results of another experiment, which differs in {told}; "
                "choose another folder, or delete that one."
            )
            raise InputError(msg)


def _difference(found: Any, wanted: dict[str, Any]) -> str:  # noqa: ANN401 - whatever JSON holds
    """Return the name of the first thing in which two tables differ."""
    others = found if isinstance(found, dict) else {}
    return str(next(name for name in {**wanted, **others} if others.get(name) != wanted.get(name)))


def _write_text(path: Path, text: str) -> None:
    with whole_file(path) as half:
        half.write_text(text, encoding="utf-8")
