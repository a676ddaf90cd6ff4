"""Experiments: the files that they name, their queries, and what their methods answer.

Queries are answered a hundred at a time. Each method's answers to a hundred are a file of their
own, so that little is lost when a run is interrupted, and many processes can share the work.
"""

from __future__ import annotations

import math
import os
import shutil
from functools import cached_property, lru_cache, partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import geopandas as gpd
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from semsig_gis.core import DatabaseError, SourceError, announce, check_workers, finish_tasks
from semsig_gis.database import City, digest
from semsig_gis.evaluation.experiments.tables import experiment_figures, experiment_markdown
from semsig_gis.evaluation.figures import district_labels
from semsig_gis.evaluation.file import open_evaluation, save_evaluation
from semsig_gis.evaluation.queries.draw import check_count, draw_queries
from semsig_gis.evaluation.scoring import (
    PAIR_S,
    QUERY_S,
    make_evaluation,
    score_queries,
    scored_tables,
    versions,
)
from semsig_gis.evaluation.spec import Case, parse_experiment
from semsig_gis.localization import DistanceMemo, make_locator
from semsig_gis.storage import (
    VERIFY_CHECKSUMS,
    RunKind,
    add_footer_checksum,
    check_footer_checksum,
    finish,
    partial_folder,
    read_json,
    read_text,
    toml_text,
    whole_file,
    write_json,
    write_whole,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation.queries.draw import Query
    from semsig_gis.evaluation.result import Evaluation
    from semsig_gis.evaluation.spec import ExperimentSpec
    from semsig_gis.localization import Answer, Locator

    # Experiments and the folders where their parts are put, by the folders for their results.
    Running = Mapping[Path, tuple["ExperimentWork", Path]]
    Task = tuple[Path, "Part"]


PARTS = "_parts"  # folder of the answers in a run that is not finished
SPEC = "experiment.toml"
INPUTS = "inputs.json"
FIGURES = "figures.csv"
REPORT = "report.md"
DISTRICTS = "districts.csv"


def _read_recipe(folder: Path) -> dict[str, Any]:
    """Return the experiment as plain values, with ``inputs`` and ``versions``."""
    text = read_text(folder / SPEC)
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
        "{folder} contains the results of another experiment, which differs in {difference}; "
        "choose another folder, or delete that one."
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
        By the names of the cases; that of one evaluation is ``""``.

    Raises
    ------
    DatabaseError
        If the folder holds neither, or an evaluation is missing or damaged.

    Examples
    --------
    >>> open_results("nowhere")
    Traceback (most recent call last):
    ...
    semsig_gis.core.errors.DatabaseError: nowhere contains no results;
    give a folder that `semsig evaluate`
    wrote.
    """
    place = Path(folder)
    if (place / "queries.parquet").is_file():
        return {"": open_evaluation(place)}
    try:
        text = read_text(place / SPEC)
    except OSError as error:
        raise DatabaseError(
            f"{place} contains no results; give a folder that `semsig evaluate` wrote."
        ) from error
    spec = parse_experiment(text, where=str(place / SPEC))
    return {case.name: open_evaluation(place / case.name) for case in spec.cases}


PART_QUERIES = 100
MEMO_BYTES = 256 << 20  # distances that the methods of an experiment share
MEASURES = 3  # each of types and of angles
STAGES = 2


class Part(NamedTuple):
    """A hundred queries of a distortion (its name), counted from 0, for all methods."""

    distortion: str
    number: int


class ExperimentWork:
    """An experiment with the files that it names, which are looked for in a folder."""

    def __init__(self, spec: ExperimentSpec, folder: Path) -> None:
        self.spec, self.folder = spec, folder
        self._cities: dict[str, City] = {}
        self._locators: dict[str, Locator[Answer]] = {}

    def digests(self) -> dict[str, str]:
        """Return a digest of each file by name; SemsigError if one is missing."""
        names = (self.spec.database, self._seen_city)
        digests = {name: self._city(name).digest for name in dict.fromkeys(names)}
        for name in self._stores():
            store = self._city(name).store_path
            if store.is_dir():
                key = f"{name.removesuffix('.parquet')}{store.suffix}"
                digests[key] = digest(*sorted(store.glob("*.parquet")))
        if self.spec.districts is not None:
            file = self.folder / self.spec.districts.file
            if not file.is_file():
                raise SourceError(f"districts {file} do not exist; give a file of polygons.")
            digests[self.spec.districts.file] = digest(file)
        return digests

    def _stores(self) -> dict[str, None]:
        """Return the databases of which the street objects are looked at, each once."""
        anywhere = [self._seen_city] if self.spec.seen_from == "anywhere" else []
        refined = any(method.refined for method in self.spec.methods.values())
        return dict.fromkeys([*anywhere, *([self.spec.database] if refined else [])])

    def prepare(self) -> None:
        """Build the indexes that methods need; SemsigError if something does not fit."""
        for top in self.spec.top:
            check_count("candidates", top, len(self.database))
        if self.districts is not None and self.spec.districts is not None:
            nowhere = gpd.GeoDataFrame(geometry=[], crs=self.database.crs)
            district_labels(nowhere, self.districts, self.spec.districts.name)
        for name in self._stores():
            _ = self._city(name).store
        for distortion in self.spec.distortions:
            self._queries(distortion, slice(1))
        for name in self.spec.methods:
            self._locator(name)

    @property
    def database(self) -> SignatureDatabase:
        """What is searched."""
        return self._city(self.spec.database).database

    @property
    def _seen_city(self) -> str:
        """The city in which queries are drawn."""
        return self.spec.city or self.spec.database

    @cached_property
    def districts(self) -> gpd.GeoDataFrame | None:
        """The polygons by which figures are told, if any."""
        if self.spec.districts is None:
            return None
        file = self.folder / self.spec.districts.file
        try:
            return gpd.read_file(file)
        except Exception as error:  # whatever the many readers raise
            raise SourceError(
                f"districts {file} cannot be read ({error}); give a file of polygons."
            ) from error

    @property
    def parts(self) -> tuple[Part, ...]:
        """All parts of the work."""
        numbers = range(math.ceil(self._number / PART_QUERIES))
        return tuple(Part(name, number) for name in self.spec.distortions for number in numbers)

    def queries_in(self, part: Part) -> int:
        """Return how many queries are in a part: a hundred, or fewer in the last one."""
        return min(PART_QUERIES, self._number - part.number * PART_QUERIES)

    def answer(self, place: Path, part: Part) -> None:
        """Let every method answer the queries of a part, unless its file is in the folder."""
        count = self.queries_in(part) * len(self.spec.top)
        files = {name: _part_file(place, part, name) for name in self.spec.methods}
        missing = {name: file for name, file in files.items() if not _is_whole(file, rows=count)}
        if not missing:
            return
        start = part.number * PART_QUERIES
        queries = self._queries(part.distortion, slice(start, start + PART_QUERIES))
        by_distance = [name for name in missing if self.spec.methods[name].noise is None]
        for names in (by_distance, *([name] for name in missing if name not in by_distance)):
            for name, scored in self._scored(names, queries):
                with whole_file(missing[name]) as half:
                    scored.to_parquet(half, write_page_checksum=True)
                    add_footer_checksum(half)

    def _scored(
        self, names: Sequence[str], queries: Sequence[Query]
    ) -> Iterator[tuple[str, pd.DataFrame]]:
        """Yield the scored answers of some methods that share what they measure."""
        scores: dict[str, dict[int, list[dict[str, Any]]]] = {
            name: {top: [] for top in self.spec.top} for name in names
        }
        step = self._batch if len(names) > 1 else len(queries)
        for start in range(0, len(queries), step):
            memo = DistanceMemo() if len(names) > 1 else None
            for name in names:
                outcomes = score_queries(
                    self.database,
                    self._locator(name),
                    queries[start : start + step],
                    tops=self.spec.top,
                    memo=memo,
                )
                for top, rows in outcomes.items():
                    scores[name][top] += rows
        for name, outcomes in scores.items():
            scored = scored_tables(self.database, queries, outcomes)
            tables = [table.assign(top=top) for top, table in scored.items()]
            yield name, pd.concat(tables, ignore_index=True)

    @property
    def _batch(self) -> int:
        """For how many queries the distances are kept that methods share."""
        distinct = len(self.database.type_sequences) + len(self.database.angle_sequences)
        of_each = 4 * (MEASURES * distinct + STAGES * len(self.database))
        return max(1, min(PART_QUERIES, MEMO_BYTES // max(of_each, 1)))

    def evaluations(self, place: Path) -> dict[str, Evaluation]:
        """Return all evaluations by the names of their cases, once all queries are answered."""
        size = sum(file.stat().st_size for file in self._city(self.spec.database).files)
        evaluations = {}
        for distortion, method in product(self.spec.distortions, self.spec.methods):
            parts = [part for part in self.parts if part.distortion == distortion]
            files = [_part_file(place, part, method) for part in parts]
            tables = [pq.read_table(file, **VERIFY_CHECKSUMS) for file in files]
            scored = pa.concat_tables(tables, promote_options="default").to_pandas()
            for top in self.spec.top:
                case = Case(distortion=distortion, method=method, top=top)
                evaluations[case.name] = make_evaluation(
                    self.database,
                    self.spec.methods[method],
                    self.spec.asked(distortion),
                    scored[scored["top"] == top].reset_index(drop=True),
                    top=top,
                    city=self.spec.city,
                    file_bytes=size,
                )
        return evaluations

    @property
    def _number(self) -> int:
        """How many queries each distortion has."""
        return self.spec.queries * len(self.spec.seeds)

    def _queries(self, distortion: str, part: slice) -> list[Query]:
        """Return some of the queries after a distortion."""
        seen = self._city(self._seen_city)
        return draw_queries(
            self.database,
            self.spec.asked(distortion),
            store=seen.store if self.spec.seen_from == "anywhere" else None,
            city=None if self.spec.city is None else seen.database,
            part=part,
        )

    def _locator(self, name: str) -> Locator[Answer]:
        """Return a method with all that it needs."""
        if name not in self._locators:
            method = self.spec.methods[name]
            store = self._city(self.spec.database).store if method.refined else None
            self._locators[name] = make_locator(self.database, method, store=store)
        return self._locators[name]

    def _city(self, name: str) -> City:
        return self._cities.setdefault(name, City(self.folder / name))


def _part_file(place: Path, part: Part, method: str) -> Path:
    return place / f"{part.distortion}.{method}.{part.number:05d}.parquet"


def _is_whole(file: Path, *, rows: int) -> bool:
    """Tell whether a part is there and can be read."""
    if not file.is_file():
        return False
    try:
        check_footer_checksum(file)
        return bool(pq.read_table(file, **VERIFY_CHECKSUMS).num_rows == rows)
    except (OSError, ValueError, pa.ArrowException):
        return False


def run_experiment(
    spec: ExperimentSpec,
    out: str | Path,
    *,
    folder: str | Path = ".",
    workers: int = 0,
    scheduler: str | None = None,
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
    ``figures.csv``, ``report.md`` and a folder for each case. A script that gives `workers` needs
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
    """Run several experiments at once, or what is left of them.

    Parameters
    ----------
    specs : mapping of Path to ExperimentSpec
        The experiments by the folders for their results.
    folder, workers, scheduler, progress : optional
        As in `run_experiment`.

    Returns
    -------
    dict of Path to dict
        What `run_experiment` gives, by folder.

    Raises
    ------
    InputError, SemsigError
        As in `run_experiment`. Nothing is answered if one of the experiments is refused.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import ExperimentSpec, parse_method, save_database
    >>> none, paper = {"none": ()}, {"paper": parse_method("edit+edit:5%")}
    >>> spec = ExperimentSpec(database="city.parquet", methods=paper, distortions=none, queries=5)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_database(demo_database, f"{folder}/city.parquet")
    ...     results = run_experiments({Path(folder, "results"): spec}, folder=folder)
    >>> [list(evaluations) for evaluations in results.values()]
    [['none/paper-top1']]
    """
    check_workers(workers, scheduler)
    running: dict[Path, tuple[ExperimentWork, Path]] = {}
    for out, spec in specs.items():
        work = ExperimentWork(spec, Path(folder))
        recipe = {**spec.to_dict(), "inputs": work.digests(), "versions": versions()}
        target, partial_out = Path(os.path.realpath(out)), partial_folder(out)
        if target.exists():
            RUN.require_same(target, recipe)
            shutil.rmtree(target / PARTS, ignore_errors=True)  # of a run killed at the very end
        else:
            RUN.begin(partial_out, recipe)
            running[out] = work, partial_out
    for work, _ in running.values():
        work.prepare()
    _answer(running, workers=workers, scheduler=scheduler, progress=progress)
    results = {}
    for out in specs:
        if out in running:
            work, place = running[out]
            results[out] = work.evaluations(place / PARTS)
            write_results(place, work.spec, results[out], districts=work.districts)
            shutil.rmtree(finish(place) / PARTS)
        else:
            results[out] = open_results(out)
    return results


def _answer(
    running: Running,
    *,
    workers: int,
    scheduler: str | None,
    progress: Callable[[int, int], None] | None,
) -> None:
    """Answer all parts of all experiments."""
    sizes = {
        (out, part): work.queries_in(part) * len(work.spec.methods)
        for out, (work, _) in running.items()
        for part in work.parts
    }
    if workers or scheduler is not None:
        places = {
            out: (work.spec.to_toml(), work.folder.resolve(), place.resolve() / PARTS)
            for out, (work, place) in running.items()
        }
        answer = partial(_answer_apart, places)
    else:
        answer = partial(_answer_here, running)
    done, total = 0, sum(sizes.values())
    if scheduler is None:
        seconds = sum(
            size * (QUERY_S + PAIR_S * len(running[out][0].database))
            for (out, _), size in sizes.items()
        )
        announce(seconds / max(workers, 1), "answering")

    def count_answers(task: Task, _value: None) -> None:
        nonlocal done
        done += sizes[task]
        if progress is not None:
            progress(done, total)

    failed = finish_tasks(
        answer,
        list(sizes),
        on_success=count_answers,
        workers=workers,
        scheduler=scheduler,
        files=[work.folder.resolve() / work.spec.database for work, _ in running.values()],
    )
    if failed:
        (out, _), reason = next(iter(failed.items()))
        raise DatabaseError(
            f"{len(failed)} of the {len(sizes)} parts of the work failed ({reason}); what is done "
            f"is kept in {running[out][1]}, so fix the cause and run the same command again."
        )


def _answer_here(running: Running, task: Task) -> None:
    out, part = task
    work, place = running[out]
    work.answer(place / PARTS, part)


def _answer_apart(places: Mapping[Path, tuple[str, Path, Path]], task: Task) -> None:
    out, part = task
    spec, folder, place = places[out]
    _opened(spec, folder).answer(place, part)


@lru_cache(maxsize=2)
def _opened(spec: str, folder: Path) -> ExperimentWork:
    """Return an experiment with its files, which a worker opens once."""
    return ExperimentWork(parse_experiment(spec), folder)
