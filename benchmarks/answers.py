"""Time of complete answers in a city like Paris, and of predicting how good they will be.

Answers are warm, in a batch, and from a new process.
"""

from __future__ import annotations

import functools
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rapidfuzz.distance import Levenshtein
from rapidfuzz.process import cdist

from benchmarks._cities import made_up, made_up_streets
from benchmarks.comparison import Comparison, compare
from semsig_gis.database import ObjectStore, save_database
from semsig_gis.evaluation import identify
from semsig_gis.evaluation.identifiability.analysis import CLASS_TRIALS, TRIALS
from semsig_gis.localization import build_index, cell_noise, locate, named_noise
from semsig_gis.sources import PARIS_LIKE, CitySpec

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase

__all__ = ["comparisons"]

# The city, the number of queries of a batch, and of single queries that are timed.
_SIZES = {"full": (PARIS_LIKE, 1000, 15), "small": (CitySpec(size=300.0), 5, 2)}
_SEED = 20
# Bars: ratios to edit distances, for answers from anywhere in a cell, refined and explained ones,
# and on the grid; of north unknown to north known; and of many queries to edit distances.
_ANYWHERE, _REFINED, _ON_GRID = 1.0, 0.5, 2.0
_NORTH_UNKNOWN, _BATCH = 1 / 3, 1 / 4
_COLD_MS, _MEMORY_MB = 700.0, 300.0
_LOADING = 1 / 0.7
_MOST_HELP_MS = 500.0
_MOST_IDENTIFY_MS = 60_000.0
# The number of trials to predict how well queries are located, and of those without each class.
_TRIALS = {"full": (TRIALS, CLASS_TRIALS), "small": (30, 5)}
_EXPLAINED = 3
_IMPORTS = "import numba, pandas, geopandas, pyarrow, typer, rich"
_DISTANCE = ("--method", "edit+edit")
# The command; it prints at its end the seconds of the answer and its peak memory in MB.
_TIMED_COMMAND = """
import sys, time
from benchmarks.memory import own_peak
from semsig_gis.cli import main
from semsig_gis.commands.localize import Localize
seconds = 0.0
def timed(*arguments):
    global seconds
    start = time.perf_counter()
    result = answer(*arguments)
    seconds = time.perf_counter() - start
    return result
answer, Localize._answer = Localize._answer, timed
try:
    main()
finally:
    print(seconds, own_peak(), file=sys.stderr)
"""


def comparisons(size: str) -> Iterator[Comparison]:
    """Measure complete answers, warm and cold, and the time and memory of a process."""
    spec, batch, repeats = _SIZES[size]
    objects = made_up(spec)
    database = made_up_streets(spec, objects)
    picked = np.random.default_rng(_SEED).integers(0, len(database), batch).tolist()
    queries = [database.signature(cell) for cell in picked]
    yield from _warm_rows(database, ObjectStore.of(objects), queries[:repeats])
    yield _identify_row(database, queries[:repeats], *_TRIALS[size])
    with tempfile.TemporaryDirectory() as folder:
        city = Path(folder) / "city.parquet"
        save_database(database, city)
        timed = functools.partial(compare, warm_up=size == "full")
        yield _batch_row(timed, city, database, queries)
        yield from _cold_rows(timed, city, database, queries[0], max(1, repeats // 3))


def _texts(database: SignatureDatabase) -> list[str]:
    return list(map(database.types, range(len(database))))


def _warm_rows(
    database: SignatureDatabase, store: ObjectStore, queries: Sequence[Signature]
) -> Iterator[Comparison]:
    """Measure answers to single queries, with the database and the index in memory."""
    noise = cell_noise(named_noise("generic"), database.grid.step)  # as the command does
    index = build_index(database, noise)
    texts = _texts(database)
    types = [database.taxonomy.decode(query.codes) for query in queries if query.codes is not None]

    def peer(repeat: int) -> None:
        cdist([types[repeat]], texts, scorer=Levenshtein.distance, dtype=np.uint8)

    on_grid = build_index(database, named_noise("generic"))

    def answered(repeat: int) -> None:
        locate(index, queries[repeat])

    def refined(repeat: int) -> None:
        locate(index, queries[repeat], store=store, refined=True, explained=_EXPLAINED)

    def answered_on_grid(repeat: int) -> None:
        locate(on_grid, queries[repeat])

    def turned(repeat: int) -> None:
        locate(index, queries[repeat], north_sigma=math.inf)

    for what, ours, bar in (
        ("", answered, _ANYWHERE),
        (" with refinement and explanations", refined, _REFINED),
        (" on the grid", answered_on_grid, _ON_GRID),
    ):
        yield compare(
            f"the whole answer by likelihood{what}, {len(database):,} cells",
            ours,
            peer,
            peer_name="rapidfuzz.process.cdist([query], cells), edit distance of types",
            repeats=len(queries),
            bar=bar,
        )
    yield compare(
        f"the whole answer by likelihood, north unknown, {len(database):,} cells",
        turned,
        answered,
        peer_name="the same with north known",
        repeats=len(queries),
        bar=_NORTH_UNKNOWN,
    )


def _identify_row(
    database: SignatureDatabase, queries: Sequence[Signature], trials: int, class_trials: int
) -> Comparison:
    """Measure the prediction of how well a query from each cell is located."""
    noise = cell_noise(named_noise("generic"), database.grid.step)  # as the command does
    index = build_index(database, noise)
    return compare(
        f"identifying the cells, {len(database):,} cells",
        lambda _: identify(
            index, trials=trials, class_trials=class_trials, threads=os.cpu_count() or 1
        ),
        lambda _: [locate(index, query) for query in queries],
        peer_name=f"{len(queries)} answers by likelihood",
        repeats=1,
        warm_up=False,
    ).at_most(_MOST_IDENTIFY_MS)


def _batch_row(
    timed: Callable[..., Comparison],
    city: Path,
    database: SignatureDatabase,
    queries: Sequence[Signature],
) -> Comparison:
    """Measure a process that answers a file of queries."""
    file = city.with_name("queries.jsonl")
    lines = [json.dumps(query.to_dict(database.taxonomy)) for query in queries]
    file.write_text("\n".join(lines), encoding="utf-8")
    texts = _texts(database)
    types = [json.loads(line)["types"] for line in lines]
    return timed(
        f"a process that answers {len(queries):,} queries by likelihood, {len(database):,} cells",
        lambda _: _process(*_localize(city), "--queries", str(file)),
        lambda _: cdist(types, texts, scorer=Levenshtein.distance, dtype=np.uint8),
        peer_name="rapidfuzz.process.cdist(queries, cells), edit distance of types",
        repeats=1,
        bar=_BATCH,
    )


def _cold_rows(
    timed: Callable[..., Comparison],
    city: Path,
    database: SignatureDatabase,
    query: Signature,
    repeats: int,
) -> Iterator[Comparison]:
    """Measure new processes of the command."""
    view: Mapping[str, Any] = query.to_dict(database.taxonomy)
    options = "--types", view["types"], "--bearings", ",".join(map(str, view["bearings"]))
    cells = f"{len(database):,} cells"
    plain = *_localize(city), *options
    before = sorted(city.parent.iterdir())
    yield timed(
        f"cold: semsig localize by likelihood, {cells}",
        lambda _: _process(*plain),
        lambda _: _process(*plain, *_DISTANCE),
        peer_name="semsig localize by edit+edit",
        repeats=repeats,
    ).at_most(_COLD_MS)
    runs = [
        [_timed_command(*plain[2:], *method) for _ in range(repeats)] for method in ((), _DISTANCE)
    ]
    by_likelihood, by_distance = (statistics.median(peak for _, peak in part) for part in runs)
    yield Comparison(
        name=f"peak memory of semsig localize by likelihood, {cells}",
        unit="MB",
        ours=by_likelihood,
        peer=by_distance,
        peer_name="semsig localize by edit+edit",
        bar=None,
    ).at_most(_MEMORY_MB)
    yield Comparison(
        name=f"files beside a database after queries by likelihood, {cells}",
        unit="files",
        ours=len(list(city.parent.iterdir())),
        peer=len(before),
        peer_name="before",
        bar=1.0,
    )
    whole = timed(
        f"cold: semsig localize by edit+edit but for answering, {cells}",
        lambda _: _process(*plain, *_DISTANCE),
        lambda _: _process("-c", _IMPORTS),
        peer_name="python that imports numba, pandas, geopandas, pyarrow, typer and rich",
        repeats=repeats,
    )
    answering = 1e3 * statistics.median(seconds for seconds, _ in runs[1])
    yield replace(whole, ours=whole.ours - answering, bar=_LOADING)
    yield timed(
        "cold: semsig --help",
        lambda _: _process("-m", "semsig_gis.cli", "--help"),
        lambda _: _process("-c", "import typer, rich"),
        peer_name="python that imports typer and rich",
        repeats=repeats,
    ).at_most(_MOST_HELP_MS)


def _localize(city: Path) -> tuple[str, ...]:
    return "-m", "semsig_gis.cli", "localize", str(city)


def _process(*arguments: str) -> str:
    """Run Python, and return its standard error."""
    command = [sys.executable, *arguments]
    run = subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603
    return run.stderr


def _timed_command(*arguments: str) -> tuple[float, float]:
    """Return the seconds of the answer of a command, and its peak memory in MB."""
    seconds, peak = _process("-c", _TIMED_COMMAND, *arguments).splitlines()[-1].split()
    return float(seconds), float(peak)
