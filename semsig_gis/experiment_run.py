"""Run experiments: part by part, so that an interrupted run goes on where it was.

Each method answers the queries a hundred at a time, and each hundred is kept. When all are there,
the evaluations are put together. But for ``timing.json``, every file is the same however often the
run was interrupted.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import geopandas as gpd
import pandas as pd
import pyarrow as pa

from semsig_gis.answering import Answerer
from semsig_gis.database_file import open_database
from semsig_gis.errors import DatabaseError, SourceError
from semsig_gis.evaluation import check_count, make_evaluation, score_queries, versions
from semsig_gis.evaluation_figures import district_labels
from semsig_gis.experiment_folder import (
    PARTS,
    begin_run,
    finish_run,
    finished_run,
    open_results,
    write_results,
)
from semsig_gis.likelihood_file import index_path, ready_index
from semsig_gis.manifest import digest, part_files
from semsig_gis.method import LikelihoodMethod
from semsig_gis.queries import draw_queries
from semsig_gis.refinement import cell_noise
from semsig_gis.storage import whole_file
from semsig_gis.store import open_store, store_path

if TYPE_CHECKING:
    from collections.abc import Callable

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation_result import Evaluation
    from semsig_gis.experiment import Case, ExperimentSpec
    from semsig_gis.likelihood import LikelihoodIndex
    from semsig_gis.queries import Query
    from semsig_gis.store import ObjectStore

__all__ = ["run_experiment"]

QUERIES_A_PART = 100


def run_experiment(
    spec: ExperimentSpec,
    out: str | Path,
    *,
    folder: str | Path = ".",
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
        asks for more than the database has.
    SemsigError
        If a file cannot be read, or something does not fit the database.

    Notes
    -----
    The folder gets ``experiment.toml``, ``inputs.json`` (digests of the files, and versions),
    ``figures.csv`` and ``report.md`` for people, and for each case a folder with what
    `Evaluation.save` writes.

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
    work = _Work(spec, Path(folder), note)
    identity = {"experiment": spec.to_dict(), "inputs": work.digests(), "versions": versions()}
    if finished_run(out, identity):
        return open_results(out)
    partial = begin_run(out, spec, identity)
    work.check()
    _answer_all(work, partial / PARTS, progress)
    found = {case.name: work.evaluation(case, partial / PARTS) for case in spec.cases}
    write_results(partial, spec, found, districts=work.districts)
    finish_run(partial)
    return found


@dataclass(frozen=True)
class _Work:
    """An experiment with the files that it names."""

    spec: ExperimentSpec
    folder: Path
    note: Callable[[str], None] | None
    _drawn: dict[str, list[Query]] = field(default_factory=dict)
    _stored: dict[str, ObjectStore] = field(default_factory=dict)
    _indexes: dict[Path, LikelihoodIndex] = field(default_factory=dict)

    def digests(self) -> dict[str, str]:
        """Return what stands for the content of the files that are looked at."""
        found = {}
        for name in dict.fromkeys([self.spec.database, self.spec.city or self.spec.database]):
            found[name] = digest(*_files(self.folder / name))
        for name in self._stores():
            store = store_path(self.folder / name)
            if store.is_dir():
                found[str(Path(name).with_suffix(store.suffix))] = digest(
                    *sorted(store.glob("*.parquet"))
                )
        if self.spec.districts is not None:
            file = self.folder / self.spec.districts.file
            if not file.is_file():
                msg = f"districts {file} do not exist; give a file of polygons."
                raise SourceError(msg)
            found[self.spec.districts.file] = digest(file)
        return found

    def _stores(self) -> list[str]:
        """Return the databases of which the street objects are looked at."""
        some = []
        if self.spec.seen_from == "anywhere":
            some.append(self.spec.city or self.spec.database)
        if any(
            isinstance(method, LikelihoodMethod) and method.refined
            for method in self.spec.methods.values()
        ):
            some.append(self.spec.database)
        return list(dict.fromkeys(some))

    def check(self) -> None:
        """Refuse what does not fit the database before the first query is answered."""
        for top in self.spec.top:
            check_count("candidates", top, len(self.database))
        if self.districts is not None and self.spec.districts is not None:
            nowhere = gpd.GeoDataFrame(geometry=[], crs=self.database.crs)
            district_labels(nowhere, self.districts, self.spec.districts.name)
        for distortion in self.spec.distortions:
            self.queries(distortion)

    @cached_property
    def database(self) -> SignatureDatabase:
        """What is searched."""
        return open_database(self.folder / self.spec.database)

    @cached_property
    def city(self) -> SignatureDatabase | None:
        """What is looked at, if it is something else."""
        return None if self.spec.city is None else open_database(self.folder / self.spec.city)

    @cached_property
    def districts(self) -> gpd.GeoDataFrame | None:
        """The polygons by which figures are told, if any."""
        if self.spec.districts is None:
            return None
        file = self.folder / self.spec.districts.file
        try:
            return gpd.read_file(file)
        except Exception as error:  # whatever the many readers raise
            msg = f"districts {file} cannot be read ({error}); give a file of polygons."
            raise SourceError(msg) from error

    def queries(self, distortion: str) -> list[Query]:
        """Return the queries after a distortion."""
        if distortion not in self._drawn:
            store = None
            if self.spec.seen_from == "anywhere":
                store = self._store(self.spec.city or self.spec.database)
            self._drawn[distortion] = draw_queries(
                self.database, self.spec.asked(distortion), store=store, city=self.city
            )
        return self._drawn[distortion]

    def answerer(self, name: str) -> Answerer:
        """Return a method with all that it needs."""
        method = self.spec.methods[name]
        if not isinstance(method, LikelihoodMethod):
            return Answerer(database=self.database, method=method)
        return Answerer(
            database=self.database,
            method=method,
            index=self._index(method),
            store=self._store(self.spec.database) if method.refined else None,
        )

    def evaluation(self, case: Case, parts: Path) -> Evaluation:
        """Return an evaluation from its parts."""
        numbers = range(len(self.slices(case.distortion)))
        files = [_part(parts, case.distortion, case.method, number) for number in numbers]
        scored = pd.concat([pd.read_parquet(file) for file in files], ignore_index=True)
        chosen = scored[scored.pop("top") == case.top].reset_index(drop=True)
        return make_evaluation(
            self.database,
            self.spec.methods[case.method],
            self.spec.asked(case.distortion),
            chosen,
            top=case.top,
            city=self.spec.city,
            file_bytes=sum(
                file.stat().st_size for file in _files(self.folder / self.spec.database)
            ),
        )

    def slices(self, distortion: str) -> list[slice]:
        """Return the parts of the queries that are answered together."""
        count = len(self.queries(distortion))
        return [
            slice(start, min(start + QUERIES_A_PART, count))
            for start in range(0, count, QUERIES_A_PART)
        ]

    def _store(self, name: str) -> ObjectStore:
        if name not in self._stored:
            self._stored[name] = open_store(self.folder / name)
            for sentence in self._stored[name].notes:
                self._say(sentence)
        return self._stored[name]

    def _index(self, method: LikelihoodMethod) -> LikelihoodIndex:
        step = self.database.grid.step
        noise = method.noise if method.on_grid else cell_noise(method.noise, step)
        path = index_path(self.folder / self.spec.database, noise)
        if path not in self._indexes:
            self._indexes[path] = ready_index(self.database, noise, path, note=self.note)
        return self._indexes[path]

    def _say(self, sentence: str) -> None:
        if self.note is not None:
            self.note(sentence)


def _files(database: Path) -> tuple[Path, ...]:
    """Return the files of a database."""
    if database.is_dir():
        return part_files(database)
    if not database.is_file():
        msg = f"{database} does not exist; give a signature database file."
        raise DatabaseError(msg)
    return (database,)


def _part(parts: Path, distortion: str, method: str, number: int) -> Path:
    return parts / f"{distortion}.{method}.{number:05d}.parquet"


def _answer_all(work: _Work, parts: Path, progress: Callable[[int, int], None] | None) -> None:
    """Let every method answer all queries that it has not answered before."""
    spec = work.spec
    total = len(spec.methods) * sum(len(work.queries(name)) for name in spec.distortions)
    done = 0
    for method, distortion in product(spec.methods, spec.distortions):
        answerer: Answerer | None = None
        for number, part in enumerate(work.slices(distortion)):
            queries = work.queries(distortion)[part]
            file = _part(parts, distortion, method, number)
            if not _is_whole(file, rows=len(queries) * len(spec.top)):
                answerer = answerer or work.answerer(method)
                scored = score_queries(answerer, queries, tops=spec.top)
                with whole_file(file) as half:
                    pd.concat([table.assign(top=top) for top, table in scored.items()]).to_parquet(
                        half
                    )
            done += len(queries)
            if progress is not None:
                progress(done, total)


def _is_whole(file: Path, *, rows: int) -> bool:
    """Tell whether a part is there and can be read."""
    if not file.is_file():
        return False
    try:
        return len(pd.read_parquet(file)) == rows
    except (OSError, ValueError, pa.ArrowException):
        return False
