"""Run experiments, in this process or in several, and resume interrupted runs."""

from __future__ import annotations

import os
import shutil
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from semsig_gis.core import DatabaseError, announce, check_workers, finish_tasks
from semsig_gis.evaluation.experiments.batches import OpenExperiment
from semsig_gis.evaluation.experiments.results import BATCHES, RUN, open_results, write_results
from semsig_gis.evaluation.scoring import QUERY_CELL_S, QUERY_S, versions
from semsig_gis.evaluation.spec import parse_experiment
from semsig_gis.storage import finish, partial_folder

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from semsig_gis.evaluation.experiments.batches import QueryBatch
    from semsig_gis.evaluation.result import Evaluation
    from semsig_gis.evaluation.spec import ExperimentSpec

    # Each experiment and its unfinished folder, by the folder for the results.
    Unfinished = Mapping[Path, tuple[OpenExperiment, Path]]
    Task = tuple[Path, QueryBatch]


def run_experiment(
    spec: ExperimentSpec,
    out: str | Path,
    *,
    folder: str | Path = ".",
    workers: int = 0,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Evaluation]:
    """Run an experiment, or resume it.

    Parameters
    ----------
    spec : ExperimentSpec
        The experiment.
    out : str or Path
        Folder for the results; it is written under another name and renamed when complete. If it
        contains the results of the same experiment, these are returned.
    folder : str or Path, default "."
        Folder of the files that the experiment names.
    workers : int, default 0
        Number of processes on this machine; 0 uses only this process, without dask.
    scheduler : str, optional
        Address of a dask scheduler, such as ``tcp://10.0.0.5:8786``. Its workers must see the same
        files under the same paths; `workers` must be 0.
    progress : callable, optional
        Called with the number of finished answers and the number of answers.

    Returns
    -------
    dict of str to Evaluation
        The evaluations by the names of their cases.

    Raises
    ------
    InputError
        If `out` or its unfinished run belongs to another experiment or is no experiment, the
        experiment needs more cells than the database has, or the workers cannot be reached.
    SemsigError
        If a file cannot be read, or a method or distortion does not fit the database.

    Notes
    -----
    The folder gets ``experiment.toml``, ``inputs.json`` (digests of the files, and versions),
    ``figures.csv``, ``report.md`` and a folder for each case. A script that uses `workers` needs
    the guard ``if __name__ == "__main__":``, because the workers import it.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import save_database
    >>> from semsig_gis.evaluation.spec import parse_experiment
    >>> spec = parse_experiment('''
    ... database = "city.parquet"
    ... queries = 10
    ... methods.paper = "edit+edit:5%"
    ... distortions.phone = "medium, view:90"
    ... ''')
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_database(demo_database, f"{folder}/city.parquet")
    ...     results = run_experiment(spec, f"{folder}/results", folder=folder)
    >>> list(results), len(results["phone/paper-top1"].queries)
    (['phone/paper-top1'], 10)
    """
    place = Path(out)
    return run_experiments(
        {place: spec},
        folder=folder,
        workers=workers,
        scheduler=scheduler,
        progress=progress,
    )[place]


def run_experiments(
    specs: Mapping[Path, ExperimentSpec],
    *,
    folder: str | Path = ".",
    workers: int = 0,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[Path, dict[str, Evaluation]]:
    """Run several experiments together, or resume them.

    Parameters
    ----------
    specs : mapping of Path to ExperimentSpec
        The experiments by the folders for their results.
    folder, workers, scheduler, progress : optional
        As in `run_experiment`.

    Returns
    -------
    dict of Path to dict
        The results of `run_experiment` by folder.

    Raises
    ------
    InputError, SemsigError
        As in `run_experiment`; all experiments are checked before the first query is answered.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import save_database
    >>> from semsig_gis.evaluation import ExperimentSpec
    >>> from semsig_gis.localization import parse_method
    >>> none, paper = {"none": ()}, {"paper": parse_method("edit+edit:5%")}
    >>> spec = ExperimentSpec(database="city.parquet", methods=paper, distortions=none, queries=5)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_database(demo_database, f"{folder}/city.parquet")
    ...     results = run_experiments({Path(folder, "results"): spec}, folder=folder)
    >>> [list(evaluations) for evaluations in results.values()]
    [['none/paper-top1']]
    """
    check_workers(workers, scheduler)
    unfinished: dict[Path, tuple[OpenExperiment, Path]] = {}
    for out, spec in specs.items():
        experiment = OpenExperiment(spec, Path(folder))
        settings = {**spec.to_dict(), "inputs": experiment.digests(), "versions": versions()}
        target, partial_out = Path(os.path.realpath(out)), partial_folder(out)
        if target.exists():
            RUN.require_same(target, settings)
            # Left if a run was killed between the rename and its last deletion.
            shutil.rmtree(target / BATCHES, ignore_errors=True)
        else:
            RUN.begin(partial_out, settings)
            unfinished[out] = experiment, partial_out
    for experiment, _ in unfinished.values():
        experiment.prepare()
    _answer(unfinished, workers=workers, scheduler=scheduler, progress=progress)
    results = {}
    for out in specs:
        if out in unfinished:
            experiment, partial_out = unfinished[out]
            results[out] = experiment.evaluations(partial_out / BATCHES)
            write_results(
                partial_out, experiment.spec, results[out], districts=experiment.districts
            )
            shutil.rmtree(finish(partial_out) / BATCHES)
        else:
            results[out] = open_results(out)
    return results


def _answer(
    unfinished: Unfinished,
    *,
    workers: int,
    scheduler: str | None,
    progress: Callable[[int, int], None] | None,
) -> None:
    """Answer all batches of all experiments."""
    sizes = {
        (out, batch): experiment.batch_size(batch) * len(experiment.spec.methods)
        for out, (experiment, _) in unfinished.items()
        for batch in experiment.batches
    }
    if workers or scheduler is not None:
        # Other processes get text and absolute paths, and open the files themselves.
        sources = {
            out: (
                experiment.spec.to_toml(),
                experiment.folder.resolve(),
                folder.resolve() / BATCHES,
            )
            for out, (experiment, folder) in unfinished.items()
        }
        answer = partial(_answer_in_worker, sources)
    else:
        answer = partial(_answer_here, unfinished)
    finished, total = 0, sum(sizes.values())
    if scheduler is None:
        seconds = sum(
            size * (QUERY_S + QUERY_CELL_S * len(unfinished[out][0].database))
            for (out, _), size in sizes.items()
        )
        announce(seconds / max(workers, 1), "answering")

    def count_answers(task: Task, _value: None) -> None:
        nonlocal finished
        finished += sizes[task]
        if progress is not None:
            progress(finished, total)

    failed = finish_tasks(
        answer,
        list(sizes),
        on_success=count_answers,
        workers=workers,
        scheduler=scheduler,
        files=[item.folder.resolve() / item.spec.database for item, _ in unfinished.values()],
    )
    if failed:
        (out, _), reason = next(iter(failed.items()))
        raise DatabaseError(
            f"{len(failed)} of the {len(sizes)} parts of the work failed ({reason}); what is done "
            f"is kept in {unfinished[out][1]}, so fix the cause and run the same command again."
        )


def _answer_here(unfinished: Unfinished, task: Task) -> None:
    out, batch = task
    experiment, folder = unfinished[out]
    experiment.answer(folder / BATCHES, batch)


def _answer_in_worker(sources: Mapping[Path, tuple[str, Path, Path]], task: Task) -> None:
    out, batch = task
    spec, inputs, answers = sources[out]
    _open_experiment(spec, inputs).answer(answers, batch)


@lru_cache(maxsize=2)
def _open_experiment(spec: str, folder: Path) -> OpenExperiment:
    """Open an experiment and its files; the result is cached in each worker process."""
    return OpenExperiment(parse_experiment(spec), folder)
