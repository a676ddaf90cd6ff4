"""Run all experiments of the source paper on a city, and collect their results.

Finished experiments stay in the folder of the results, so that an interrupted run can be resumed.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from semsig_gis.core import DatabaseError, Displayed, InputError, check_workers
from semsig_gis.database import (
    City,
    ObjectStore,
    ViewpointSpec,
    build_database,
    database_summary,
    open_database,
    save_database,
    save_with_store,
)
from semsig_gis.evaluation.experiments.run import run_experiments
from semsig_gis.evaluation.paper import published as paris
from semsig_gis.evaluation.queries.distortion_text import parse_chain
from semsig_gis.evaluation.queries.draw import QuerySpec, check_count
from semsig_gis.evaluation.scoring import versions
from semsig_gis.evaluation.spec import ExperimentSpec
from semsig_gis.localization import Method, parse_method, score_cells
from semsig_gis.objects import build_objects
from semsig_gis.sources import (
    PARIS_LIKE,
    CitySpec,
    paper_taxonomy,
    synthetic_city,
    synthetic_streets,
)
from semsig_gis.storage import RunKind, read_json, write_json

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation.result import Evaluation

    Progress = Callable[[str], Callable[[int, int], None] | None]


MEASURES = ("jaccard", "histogram", "edit")
DISTORTION_LEVELS = ("light", "medium", "strong")
RANGES = (20.0, 30.0, 40.0)  # visibility ranges in metres
SCALES = (8, 16, 24, 32)  # numbers of angle levels
QUERIES = 10_000
MANY = 100  # candidates that count, if the paper does not use only the first one
READING_QUERIES = 1_000  # at most, for each possible reading of the paper
LIKELIHOOD_QUERIES = 500  # at most

# Names of the methods in the experiments: measures of types or angles, fusions of the edit distance
# of types with a measure of angles, fusions of edit distances by the weight of the types, and the
# same in two stages by the percentage of cells that the first stage keeps.
SINGLES: Mapping[str, str] = {
    f"{part}-{measure}": f"{part}:{measure}" for measure in MEASURES for part in ("types", "angles")
}
FUSIONS: Mapping[str, str] = {f"fusion-{measure}": f"edit+{measure}" for measure in MEASURES}
WEIGHTS: Mapping[float, str] = {
    **{share: f"weights-{round(100 * share)}" for share in (0.1, 0.3, 0.5, 0.7, 0.9)},
    0.5: "fusion-edit",
}
PERCENTS: Mapping[int, str] = {
    **{percent: f"stages-{percent}" for percent in (1, 5, 10, 20, 50)},
    100: "fusion-edit",
}
BEST = "stages-5"  # recommended by the paper
FIRST_STAGE = "types-edit"  # only its first stage
OURS = "likelihood"

# Possible readings of the paper's distortion, which it does not describe completely.
READINGS: Mapping[str, str] = {
    "kept-uniform": "order kept, false objects of any class",
    "kept-frequency": "order kept, false objects as frequent as true ones",
    "sorted-uniform": "sorted again, false objects of any class",
    "sorted-frequency": "sorted again, false objects as frequent as true ones",
}


def paper_experiments(
    database: str,
    *,
    ranges: Mapping[float, str],
    scales: Mapping[int, str],
    queries: int = QUERIES,
    seed: int = 0,
) -> dict[str, ExperimentSpec]:
    """Return all experiments of the paper by name: ``"none"``, ``"medium"``, ``"levels"``, ...

    ``ranges`` and ``scales`` are files of databases of the same city by visibility range in metres
    and by number of angle levels. Each adds an experiment: ``"range-20"``, ``"levels-8"``, ...
    """
    stages = {name: f"edit+edit:{k}%" for k, name in PERCENTS.items() if name not in FUSIONS}
    weights = {name: f"edit+edit:alpha={w}" for w, name in WEIGHTS.items() if name not in FUSIONS}
    best = {BEST: stages[BEST]}
    stage_one = {FIRST_STAGE: SINGLES[FIRST_STAGE], **best}

    def spec(
        distortions: Mapping[str, str],
        methods: Mapping[str, str],
        *,
        file: str = database,
        number: int = queries,
        top: tuple[int, ...] = (1,),
    ) -> ExperimentSpec:
        return ExperimentSpec(
            database=file,
            queries=number,
            seeds=(seed,),
            top=top,
            methods={name: parse_method(text) for name, text in methods.items()},
            distortions={name: parse_chain(text) for name, text in distortions.items()},
        )

    # The paper's readings by default: the order of the objects is kept.
    levels = {level: f"{level}:resort=false" for level in DISTORTION_LEVELS}
    medium = {"medium": levels["medium"]}
    both = (1, MANY)
    orders = {"kept": "medium:resort=false", "sorted": "medium"}
    readings = {
        f"{order}-{classes}": text + (":false_class=frequency" if classes == "frequency" else "")
        for order, text in orders.items()
        for classes in ("uniform", "frequency")
    }
    return {
        "none": spec({"none": ""}, {**SINGLES, **FUSIONS, **stages}, top=both),
        "medium": spec(medium, {**SINGLES, **FUSIONS, **weights, **stages}, top=both),
        "levels": spec({level: levels[level] for level in ("light", "strong")}, best),
        "readings": spec(
            readings, {**best, "raw": "edit+edit:5%:raw"}, number=min(queries, READING_QUERIES)
        ),
        "ours": spec(
            levels,
            {OURS: "likelihood:generic:on_grid"},
            number=min(queries, LIKELIHOOD_QUERIES),
        ),
        **{f"range-{r:g}": spec(medium, stage_one, file=file) for r, file in ranges.items()},
        **{f"levels-{q}": spec(medium, best, file=file) for q, file in scales.items()},
    }


Size = Literal["full", "small"]

SMALL_QUERIES = 300
CITIES = {"full": PARIS_LIKE, "small": CitySpec(size=2000.0)}
SETTINGS = "settings.json"
TIMES = "times.json"
CITY = "city/city.parquet"
VARIANTS = "variants"
EXPERIMENTS = "experiments"
NO_RANGES = (
    "Other visibility ranges need the street objects of the database, which `semsig build` writes "
    "next to it; they are missing."
)


def _read_settings(folder: Path) -> dict[str, Any]:
    settings = read_json(folder / SETTINGS)
    if settings.keys() != {"size", "database", "queries", "seed", "versions"}:
        raise ValueError(f"{SETTINGS} was written by another program")
    return settings


RUN = RunKind(
    content="results of `semsig reproduce`",
    another=(
        "{folder} contains results of other settings, which differ in {difference}; choose "
        "another folder, or delete that one."
    ),
    read=_read_settings,
    write=lambda folder, settings: write_json(folder / SETTINGS, settings),
    names={SETTINGS, "city", VARIANTS},
    results=EXPERIMENTS,
)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Reproduction(Displayed):
    """Results of the paper's experiments on a city.

    Parameters
    ----------
    database : SignatureDatabase
        The city.
    summary : mapping
        Its properties (see `database_summary`).
    variants : mapping of float to mapping
        Properties of databases of other visibility ranges, by the range in metres.
    experiments : mapping of str to mapping
        Evaluations by the names of their cases, by the name of the experiment (see
        `paper.reproduction.paper_experiments`).
    seconds : mapping of str to float
        Mean seconds of one query by the text of the method.
    settings : mapping
        The settings as plain values: ``size``, ``database`` (a name), ``queries``, ``seed``.
    missing : tuple of str
        A sentence for each experiment that could not be run, with the reason.

    Examples
    --------
    >>> from semsig_gis.database import database_summary
    >>> facts = database_summary(demo_database)
    >>> rest = {"variants": {}, "experiments": {}, "seconds": {}, "settings": {"queries": 300}}
    >>> Reproduction(database=demo_database, summary=facts, **rest).missing
    ()
    """

    database: SignatureDatabase
    summary: Mapping[str, Any]
    variants: Mapping[float, Mapping[str, Any]]
    experiments: Mapping[str, Mapping[str, Evaluation]]
    seconds: Mapping[str, float]
    settings: Mapping[str, Any]
    missing: tuple[str, ...] = ()

    def _facts(self) -> dict[str, object]:
        return {
            "cells": len(self.database),
            "queries": self.settings["queries"],
            "experiments": ", ".join(self.experiments) or "none",
            "missing": len(self.missing),
        }


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
    """Run all experiments of the paper, or resume them.

    Parameters
    ----------
    out : str or Path
        Folder for the results; created if missing.
    database : str or Path, optional
        File of a signature database; by default, a synthetic city like the paper's Paris is
        generated. Without street objects next to the file, other visibility ranges are omitted.
    size : {"full", "small"}, default "full"
        The number of queries and the size of the city of the paper, or few queries in a small city.
    queries : int, optional
        Number of queries; by default 10,000 or, if small, 300, but at most the number of cells.
    seed : int, default 0
        Random seed.
    workers : int, default 0
        Number of processes that answer queries; 0 uses only this process.
    note : callable, optional
        Called with a sentence about the current step.
    progress : callable, optional
        Called with the label of a step; returns a function that is called with the finished and the
        total work of the step, or None.

    Returns
    -------
    Reproduction
        The results.

    Raises
    ------
    InputError
        If a setting is not valid, or the folder contains results of other settings.
    DatabaseError
        If the database cannot be read.

    Examples
    --------
    >>> reproduce("results", size="tiny")
    Traceback (most recent call last):
    ...
    semsig_gis.core.errors.InputError: the size is 'tiny'; give full or small.
    """
    if size not in get_args(Size):
        raise InputError(f"the size is {size!r}; give full or small.")
    if database is not None and not Path(database).is_file():
        raise DatabaseError(f"{database} is not a file; give a signature database in one file.")
    folder, show = Path(out), progress or (lambda _: None)
    city = City(folder / CITY if database is None else database)
    settings = {
        "size": size,
        "database": None if database is None else city.digest,
        "queries": queries,
        "seed": seed,
        "versions": versions(),
    }
    QuerySpec(seeds=(seed,))  # checks the seed
    check_workers(workers, None)
    if database is not None:
        _check_queries(queries, city)
    RUN.begin(folder, settings)
    if database is None:
        if not city.path.is_file():
            _make_city(CITIES[size], city.path, note, show)
        _check_queries(queries, city)
    count = queries or min(QUERIES if size == "full" else SMALL_QUERIES, len(city.database))
    ranges, scales = _variants(city, folder / VARIANTS, show)
    specs = paper_experiments(
        os.path.relpath(city.path, folder / VARIANTS),
        ranges={radius: path.name for radius, path in ranges.items()},
        scales={levels: path.name for levels, path in scales.items()},
        queries=count,
        seed=seed,
    )
    results = run_experiments(
        {folder / EXPERIMENTS / name: spec for name, spec in specs.items()},
        folder=folder / VARIANTS,
        workers=workers,
        progress=show("answering queries"),
    )
    if not (folder / TIMES).is_file():
        methods = {text: Method.parse(text) for text in paris.QUERY_MS}
        times = time_queries(city.database, methods, progress=show("measuring times"))
        write_json(folder / TIMES, times)
    counts = city.store.objects.class_counts if city.has_store else None
    return Reproduction(
        database=city.database,
        summary=database_summary(city.database, file_bytes=city.bytes, object_counts=counts),
        variants={r: database_summary(open_database(path)) for r, path in ranges.items()},
        experiments={place.name: evaluations for place, evaluations in results.items()},
        seconds=read_json(folder / TIMES),
        settings={
            "size": size,
            "database": "a made-up city" if database is None else city.path.name,
            "queries": count,
            "seed": seed,
        },
        missing=() if ranges else (NO_RANGES,),
    )


def _check_queries(queries: int | None, city: City) -> None:
    if queries is not None:
        check_count("queries", queries, len(city.database))


def _make_city(
    spec: CitySpec, file: Path, note: Callable[[str], None] | None, show: Progress
) -> None:
    layers = synthetic_city(spec)
    objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs=layers[0].table.crs)
    streets = synthetic_streets(spec)
    if note is not None:
        note(f"made up a city of {len(objects):,} street objects")
    database = build_database(
        objects,
        viewpoints=ViewpointSpec(mode="streets"),
        streets=streets.table,
        progress=show("building the database"),
    )
    save_with_store(database, ObjectStore.of(objects, streets=streets.table), file)


def _variants(
    city: City, folder: Path, show: Progress
) -> tuple[dict[float, Path], dict[int, Path]]:
    """Return databases of other visibility ranges and angle levels; build those that are missing.

    Other ranges need the street objects of the city.
    """
    folder.mkdir(parents=True, exist_ok=True)
    database = city.database
    ranges = {radius: folder / f"range-{radius:g}.parquet" for radius in RANGES if city.has_store}
    scales = {levels: folder / f"levels-{levels}.parquet" for levels in SCALES}
    ranges.pop(database.spec.radius, None)
    scales.pop(database.spec.levels, None)
    for radius, path in ranges.items():
        if not path.is_file():
            variant = build_database(
                city.store.objects,
                grid=database.grid,
                spec=replace(database.spec, radius=radius),
                viewpoints=database.viewpoints,
                footprints=None if database.occlusion is None else city.store.footprints,
                streets=city.store.streets,
                progress=show(f"building for a visibility range of {radius:g} m"),
            )
            save_database(variant, path)
    for levels, path in scales.items():
        if not path.is_file():
            save_database(replace(database, spec=replace(database.spec, levels=levels)), path)
    return ranges, scales


def time_queries(
    database: SignatureDatabase,
    methods: Mapping[str, Method],
    *,
    length: int = 14,
    repetitions: int = 100,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, float]:
    """Return the mean seconds of each method to compare one query with all cells.

    As in the paper's table: queries of mean length (cells with `length` objects, or the nearest
    number), one at a time, on one thread. Work that is done once for a database does not count.
    """
    if repetitions < 1:
        raise InputError(f"{repetitions} repetitions were asked for; give a whole number from 1.")
    differences = np.abs(database.lengths - length)
    candidates = np.flatnonzero(differences == differences.min())
    cells = np.random.default_rng(0).choice(candidates, repetitions)
    queries = [database.signature(int(cell)) for cell in cells]
    times = {}
    for count, (name, method) in enumerate(methods.items(), start=1):
        for _ in range(2):  # not timed; the second call loads the kernels for many queries
            next(iter(score_cells(database, queries[:1], method)))
        seconds = []
        for query in queries:
            start = time.perf_counter()
            next(iter(score_cells(database, [query], method)))
            seconds.append(time.perf_counter() - start)
        times[name] = float(np.mean(seconds))
        if progress is not None:
            progress(count, len(methods))
    return times
