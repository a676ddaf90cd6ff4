"""Run all experiments of the source paper on a city, and gather what they find.

The city is one that was built before, or one that is made up to be like the paper's Paris. What is
finished stays in the folder of the results, so that an interrupted run goes on where it was.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from semsig_gis.core.errors import DatabaseError, InputError
from semsig_gis.core.parallel import check_workers
from semsig_gis.database.build import build_database
from semsig_gis.database.city import City
from semsig_gis.database.file import open_database, save_database
from semsig_gis.database.properties import database_summary
from semsig_gis.database.store import ObjectStore, save_with_store
from semsig_gis.database.viewpoints import ViewpointSpec
from semsig_gis.evaluation.evaluate import check_count, versions
from semsig_gis.experiments.paper.experiments import QUERIES, RANGES, SCALES, paper_experiments
from semsig_gis.experiments.paper.timing import time_queries
from semsig_gis.experiments.run import run_experiments
from semsig_gis.matching.method import Method
from semsig_gis.objects.clean import build_objects
from semsig_gis.queries.draw import QuerySpec
from semsig_gis.reports import paris
from semsig_gis.sources.catalog import paper_taxonomy
from semsig_gis.sources.synthetic.city import (
    PARIS_LIKE,
    CitySpec,
    synthetic_city,
    synthetic_surroundings,
)
from semsig_gis.storage.runs import RunKind, read_json, write_json

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.evaluation.result import Evaluation

    Progress = Callable[[str], Callable[[int, int], None] | None]

Size = Literal["full", "small"]

SMALL_QUERIES = 300
CITIES = {"full": PARIS_LIKE, "small": CitySpec(size=2000.0)}
SETTINGS = "settings.json"
TIMES = "times.json"
CITY = Path("city") / "city.parquet"
VARIANTS = Path("variants")
EXPERIMENTS = Path("experiments")
NO_RANGES = (
    "Other visibility ranges need the street objects of the database, which `semsig build` puts "
    "beside it; they are not there."
)


def _read_settings(folder: Path) -> dict[str, Any]:
    settings = read_json(folder / SETTINGS)
    if settings.keys() != {"size", "database", "queries", "seed", "versions"}:
        msg = f"{SETTINGS} was written by another program"
        raise ValueError(msg)
    return settings


RUN = RunKind(
    content="results of `semsig reproduce`",
    another=(
        "{folder} holds results of other settings, which differ in {difference}; choose another "
        "folder, or delete that one."
    ),
    read=_read_settings,
    write=lambda folder, settings: write_json(folder / SETTINGS, settings),
    names={SETTINGS, CITY.parent.name, VARIANTS.name},
    results=EXPERIMENTS.name,
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Reproduction:
    """What the experiments of the paper find on a city.

    Parameters
    ----------
    database : SignatureDatabase
        The city.
    summary : mapping
        Its properties (see `database.properties.database_summary`).
    variants : mapping of float to mapping
        Properties of the databases of other visibility ranges, by the range in metres.
    experiments : mapping of str to mapping
        By the names of `experiments.paper.experiments.paper_experiments`, their evaluations by the
        names of their cases.
    seconds : mapping of str to float
        Mean seconds of one query by the texts of methods.
    settings : mapping
        What was run, as plain values: ``size``, ``database`` (a name), ``queries``, ``seed``.
    missing : tuple of str
        What could not be run, and why: whole sentences.
    """

    database: SignatureDatabase
    summary: Mapping[str, Any]
    variants: Mapping[float, Mapping[str, Any]]
    experiments: Mapping[str, Mapping[str, Evaluation]]
    seconds: Mapping[str, float]
    settings: Mapping[str, Any]
    missing: tuple[str, ...] = ()


def reproduce(
    out: str | Path,
    *,
    database: str | Path | None = None,
    size: Size = "full",
    queries: int | None = None,
    seed: int = 0,
    workers: int = 0,
    note: Callable[[str], None] | None = None,
    progress: Progress | None = None,
) -> Reproduction:
    """Run all experiments of the paper, or what is left of them.

    Parameters
    ----------
    out : str or Path
        Folder for the results; made if it is not there.
    database : str or Path, optional
        File of a signature database; a city like the paper's Paris is made up by default.
    size : {"full", "small"}, default "full"
        As many queries as the paper asks, and a city of its size; or few of a small one.
    queries : int, optional
        How many queries; by default 10,000 or, if small, 300, but not more than there are cells.
    seed : int, default 0
        Seed of all chances.
    workers : int, default 0
        How many processes answer; 0 answers here.
    note : callable, optional
        Called with a sentence about what is being done.
    progress : callable, optional
        Called with a label, it gives what is to be called with how much is done and in all.

    Returns
    -------
    Reproduction
        What was found.

    Raises
    ------
    InputError
        If a setting cannot be used, or the folder holds results of other settings.
    DatabaseError
        If the database cannot be read.

    Notes
    -----
    Other visibility ranges need the street objects of the database, which `semsig build` puts
    beside it; without them, that part is left out.

    Examples
    --------
    >>> reproduce("results", size="tiny")
    Traceback (most recent call last):
    ...
    semsig_gis.core.errors.InputError: the size is 'tiny'; give full or small.
    """
    if size not in get_args(Size):
        msg = f"the size is {size!r}; give full or small."
        raise InputError(msg)
    folder = Path(out)
    begun = _Begun(folder, note or _quiet, progress or _unseen)
    given = None if database is None else Path(database)
    if given is not None and not given.is_file():
        msg = f"{given} is not a file; give a signature database in one file."
        raise DatabaseError(msg)
    settings = {
        "size": size,
        "database": None if given is None else City(given).digest,
        "queries": queries,
        "seed": seed,
        "versions": versions(),
    }
    QuerySpec(seeds=(seed,))  # looks at the seed
    check_workers(workers, None)
    city = None if given is None else City(given)
    if city is not None:
        _check_queries(queries, city.database)
    RUN.begin(folder, settings)
    if city is None:
        city = City(begun.city(CITIES[size]))
        _check_queries(queries, city.database)
    opened = city.database
    count = queries or min(QUERIES if size == "full" else SMALL_QUERIES, len(opened))
    ranges = begun.ranges(city)
    scales = begun.scales(opened)
    found = _experiments(
        begun, city.path, ranges, scales, queries=count, seed=seed, workers=workers
    )
    counts = city.store.objects.class_counts if city.has_store else None
    return Reproduction(
        database=opened,
        summary=database_summary(opened, file_bytes=city.bytes, object_counts=counts),
        variants={r: database_summary(open_database(path)) for r, path in ranges.items()},
        experiments=found,
        seconds=begun.times(opened),
        settings={
            "size": size,
            "database": "a made-up city" if given is None else given.name,
            "queries": count,
            "seed": seed,
        },
        missing=() if ranges else (NO_RANGES,),
    )


def _check_queries(queries: int | None, city: SignatureDatabase) -> None:
    if queries is not None:
        check_count("queries", queries, len(city))


def _experiments(
    begun: _Begun,
    file: Path,
    ranges: Mapping[float, Path],
    scales: Mapping[int, Path],
    *,
    queries: int,
    seed: int,
    workers: int,
) -> dict[str, dict[str, Evaluation]]:
    """Run the experiments in one go."""
    base = begun.folder / VARIANTS
    base.mkdir(parents=True, exist_ok=True)

    def named(path: Path) -> str:
        return os.path.relpath(path, base)

    specs = paper_experiments(
        named(file),
        ranges={r: named(path) for r, path in ranges.items()},
        scales={q: named(path) for q, path in scales.items()},
        queries=queries,
        seed=seed,
    )
    found = run_experiments(
        {begun.folder / EXPERIMENTS / name: spec for name, spec in specs.items()},
        folder=base,
        workers=workers,
        note=begun.note,
        progress=begun.progress("answering queries"),
    )
    return {place.name: results for place, results in found.items()}


class _Begun:
    """A run in a folder: makes what is not there."""

    def __init__(self, folder: Path, note: Callable[[str], None], progress: Progress) -> None:
        self.folder, self.note, self.progress = folder, note, progress

    def city(self, spec: CitySpec) -> Path:
        """Return a city that is made up."""
        file = self.folder / CITY
        if not file.is_file():
            layers = synthetic_city(spec)
            objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs=layers[0].table.crs)
            _, streets = synthetic_surroundings(spec)
            self.note(f"made up a city of {len(objects):,} street objects")
            database = build_database(
                objects,
                viewpoints=ViewpointSpec(mode="streets"),
                streets=streets.table,
                progress=self.progress("building the database"),
            )
            save_with_store(database, ObjectStore.of(objects, streets=streets.table), file)
        return file

    def ranges(self, city: City) -> dict[float, Path]:
        """Return databases of the other visibility ranges."""
        spec = city.database.spec
        wanted = [radius for radius in RANGES if radius != spec.radius]
        if not city.has_store:
            return {}
        found = {radius: self.folder / VARIANTS / f"range-{radius:g}.parquet" for radius in wanted}
        left = {radius: path for radius, path in found.items() if not path.is_file()}
        if not left:
            return found
        store = city.store
        for radius, path in left.items():
            database = build_database(
                store.objects,
                grid=city.database.grid,
                spec=replace(spec, radius=radius),
                viewpoints=city.database.viewpoints,
                footprints=store.footprints,
                streets=store.streets,
                progress=self.progress(f"building for a visibility range of {radius:g} m"),
            )
            save_database(database, path)
        return found

    def scales(self, city: SignatureDatabase) -> dict[int, Path]:
        """Return databases of the other numbers of angle levels."""
        wanted = [levels for levels in SCALES if levels != city.spec.levels]
        found = {levels: self.folder / VARIANTS / f"levels-{levels}.parquet" for levels in wanted}
        for levels, path in found.items():
            if not path.is_file():
                save_database(replace(city, spec=replace(city.spec, levels=levels)), path)
        return found

    def times(self, city: SignatureDatabase) -> dict[str, float]:
        """Return the times of the paper's table."""
        file = self.folder / TIMES
        if not file.is_file():
            found = time_queries(
                city,
                {text: Method.parse(text) for text in paris.QUERY_MS},
                progress=self.progress("measuring times"),
            )
            write_json(file, found)
        return read_json(file)


def _quiet(_: str) -> None:
    """Say nothing."""


def _unseen(_: str) -> None:
    """Show nothing."""
