"""Run experiments: part by part, so that an interrupted run goes on where it was.

When all parts of an experiment are answered, here or by the workers of dask, its evaluations are
put together. But for ``timing.json``, every file is the same however often the run was
interrupted, and whoever did the work.
"""

from __future__ import annotations

import contextlib
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from semsig_gis.errors import DatabaseError
from semsig_gis.evaluation import versions
from semsig_gis.experiment import parse_experiment
from semsig_gis.experiment_folder import (
    PARTS,
    begin_run,
    finish_run,
    finished_run,
    open_results,
    write_results,
)
from semsig_gis.experiment_work import ExperimentWork
from semsig_gis.workers import check_workers, run_tasks

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from semsig_gis.evaluation_result import Evaluation
    from semsig_gis.experiment import ExperimentSpec
    from semsig_gis.experiment_work import Part

__all__ = ["run_experiment", "run_experiments"]

# When so many parts have failed, the rest would too.
MOST_FAILED = 10


def run_experiment(
    spec: ExperimentSpec,
    out: str | Path,
    *,
    folder: str | Path = ".",
    workers: int = 0,
    scheduler: str | None = None,
    note: Callable[[str], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Evaluation]:
    """Run an experiment, or what is left of it.

    Parameters
    ----------
    spec : ExperimentSpec
        The experiment.
    out : str or Path
        Folder for the results; it appears whole, by rename. If it holds the results of the same
        experiment, these are returned.
    folder : str or Path, default "."
        Where the files that the experiment names are looked for.
    workers : int, default 0
        How many processes of this machine answer; 0 answers here, without dask.
    scheduler : str, optional
        Address of a dask scheduler, such as ``tcp://10.0.0.5:8786``, whose workers see the same
        files under the same paths; then `workers` stays 0.
    note : callable, optional
        Called with a sentence where an index is built.
    progress : callable, optional
        Called with the number of answers done and in all.

    Returns
    -------
    dict of str to Evaluation
        The evaluations by the names of their cases.

    Raises
    ------
    InputError
        If `out` or its unfinished run belongs to another experiment or to none, or the experiment
        asks for more than the database has, or the workers cannot be reached.
    SemsigError
        If a file cannot be read, or something does not fit the database.

    Notes
    -----
    The folder gets ``experiment.toml``, ``inputs.json`` (digests of the files, and versions),
    ``figures.csv`` and ``report.md`` for people, and for each case a folder with what
    `Evaluation.save` writes. A script that gives `workers` needs the guard
    ``if __name__ == "__main__":``, because the workers import it.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.database_file import save_database
    >>> from semsig_gis.experiment import parse_experiment
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> spec = parse_experiment('''
    ... database = "city.parquet"
    ... queries = 10
    ... methods.paper = "edit+edit:5%"
    ... distortions.phone = "medium, view:90"
    ... ''')
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_database(build_database(objects), f"{folder}/city.parquet")
    ...     found = run_experiment(spec, f"{folder}/results", folder=folder)
    >>> list(found), len(found["phone/paper-top1"].queries)
    (['phone/paper-top1'], 10)
    """
    (found,) = run_experiments(
        {Path(out): spec},
        folder=folder,
        workers=workers,
        scheduler=scheduler,
        note=note,
        progress=progress,
    ).values()
    return found


def run_experiments(
    specs: Mapping[Path, ExperimentSpec],
    *,
    folder: str | Path = ".",
    workers: int = 0,
    scheduler: str | None = None,
    note: Callable[[str], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[Path, dict[str, Evaluation]]:
    """Run several experiments at once, or what is left of them.

    Parameters
    ----------
    specs : mapping of Path to ExperimentSpec
        The experiments by the folders for their results.
    folder : str or Path, default "."
        Where the files that the experiments name are looked for.
    workers : int, default 0
        How many processes of this machine answer; 0 answers here, without dask.
    scheduler : str, optional
        Address of a dask scheduler; then `workers` stays 0.
    note : callable, optional
        Called with a sentence where an index is built.
    progress : callable, optional
        Called with the number of answers done and in all, of all experiments.

    Returns
    -------
    dict of Path to dict
        What `run_experiment` gives, by folder.

    Raises
    ------
    InputError, SemsigError
        As in `run_experiment`. Nothing is answered if one of the experiments is refused.
    """
    check_workers(workers, scheduler)
    running: dict[Path, _Running] = {}
    for out, spec in specs.items():
        work = ExperimentWork(spec, Path(folder), note)
        identity = {"experiment": spec.to_dict(), "inputs": work.digests(), "versions": versions()}
        if not finished_run(out, identity):
            running[out] = _Running(work, begin_run(out, spec, identity))
    for work, _ in running.values():
        work.prepare()
    _answer(running, workers=workers, scheduler=scheduler, progress=progress)
    found = {}
    for out in specs:
        if out in running:
            work, partial_ = running[out]
            found[out] = work.evaluations(partial_ / PARTS)
            write_results(partial_, work.spec, found[out], districts=work.districts)
            finish_run(partial_)
        else:
            found[out] = open_results(out)
    return found


class _Running(NamedTuple):
    """An experiment that is not finished, and the folder where its parts are put."""

    work: ExperimentWork
    partial: Path


class _Task(NamedTuple):
    """A part of one of the experiments."""

    out: Path
    part: Part


def _answer(
    running: Mapping[Path, _Running],
    *,
    workers: int,
    scheduler: str | None,
    progress: Callable[[int, int], None] | None,
) -> None:
    """Answer all parts of all experiments."""
    sizes = {
        _Task(out, part): work.queries_in(part) * len(work.spec.methods)
        for out, (work, _) in running.items()
        for part in work.parts
    }
    if workers or scheduler is not None:
        given = {
            out: (work.spec.to_toml(), work.folder.resolve(), place.resolve() / PARTS)
            for out, (work, place) in running.items()
        }
        answer = partial(_answer_apart, given)
    else:
        answer = partial(_answer_here, running)
    outcomes = run_tasks(
        answer,
        list(sizes),
        workers=workers,
        scheduler=scheduler,
        files=[work.folder.resolve() / work.spec.database for work, _ in running.values()],
    )
    done, total, failed = 0, sum(sizes.values()), []
    with contextlib.closing(outcomes):
        for outcome in outcomes:
            if outcome.reason is not None:
                failed.append(outcome)
                if len(failed) == MOST_FAILED:
                    break
                continue
            done += sizes[outcome.task]
            if progress is not None:
                progress(done, total)
    if failed:
        out, reason = failed[0].task.out, failed[0].reason
        msg = (
            f"{len(failed)} of the {len(sizes)} parts of the work failed ({reason}); what is done "
            f"is kept in {running[out].partial}, so mend that and run the same command again."
        )
        raise DatabaseError(msg)


def _answer_here(running: Mapping[Path, _Running], task: _Task) -> None:
    work, place = running[task.out]
    work.answer(place / PARTS, task.part)


def _answer_apart(given: Mapping[Path, tuple[str, Path, Path]], task: _Task) -> None:
    spec, folder, place = given[task.out]
    _opened(spec, folder).answer(place, task.part)


@lru_cache(maxsize=2)
def _opened(spec: str, folder: Path) -> ExperimentWork:
    """Return an experiment with its files, which a worker opens once."""
    return ExperimentWork(parse_experiment(spec), folder)
