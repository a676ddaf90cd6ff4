"""The likelihood method: its queries, its index, and a process that starts cold."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.comparison import Comparison, compare
from semsig_gis.database.city import City
from semsig_gis.database.file import save_database
from semsig_gis.likelihood.association import rerank
from semsig_gis.likelihood.index import build_index, open_index, save_index
from semsig_gis.likelihood.locate import locate
from semsig_gis.likelihood.noise.model import named_noise

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from semsig_gis.core.signature import Signature
    from semsig_gis.database.database import SignatureDatabase

    _Peer = Callable[[int], object]

__all__ = ["growth_of_likelihood", "likelihood_rows"]

_NOISE = named_noise("generic")
_PEER = "rapidfuzz.process.cdist([query], cells), edit distance of types"
_FASTER = 20.0
_THREADS = 2
_HELD = 20  # scores of so many queries are held at once
_IMPORTS = "import numba, numpy, pandas, geopandas, pyarrow.parquet, typer, rich"
_MOST_COLD_MS, _MOST_HELP_MS = 2500.0, 500.0


def likelihood_rows(
    database: SignatureDatabase,
    queries: Sequence[Signature],
    *,
    one: _Peer,
    many: _Peer,
    repeats: int,
) -> Iterator[Comparison]:
    """Measure the index of a database, queries, and a process that answers one from cold.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    queries : sequence of Signature
        At least as many as `repeats`.
    one, many : callable
        The peer's work for one query, the number of which it is given, and for all of them.
    repeats : int
        How often single queries are timed.

    Yields
    ------
    Comparison
        One result after the other.
    """
    cells = f"{len(database):,} cells"
    with tempfile.TemporaryDirectory() as folder:
        city = Path(folder) / "city.parquet"
        save_database(database, city)
        yield from _index_rows(database, city)
        index = open_index(database, _NOISE, City(city).index_path(_NOISE))

        def batch(threads: int, _: int) -> None:
            with ThreadPoolExecutor(threads) as pool:
                for low in range(0, len(queries), _HELD):
                    deque(pool.map(index.scores, queries[low : low + _HELD]), maxlen=0)

        yield compare(
            f"{len(queries):,} likelihood queries, {cells}",
            partial(batch, 1),
            many,
            peer_name="rapidfuzz.process.cdist(queries, cells), edit distance of types",
            repeats=1,
        )
        yield compare(
            f"{len(queries):,} likelihood queries by {_THREADS} threads, {cells}",
            partial(batch, _THREADS),
            partial(batch, 1),
            peer_name="by 1 thread",
            repeats=1,
        )
        # The columns are in memory from here on, like the peer's texts; for the first touch see the
        # cold process.

        def scored(repeat: int) -> None:
            index.scores(queries[repeat])

        def reranked(repeat: int) -> None:
            rerank(index, queries[repeat], index.scores(queries[repeat]))

        def answered(repeat: int) -> None:
            locate(index, queries[repeat])

        for what, ours, bar in (
            ("", scored, _FASTER),
            (" with re-ranking", reranked, None),
            (" with re-ranking, chances and answer", answered, None),
        ):
            name = f"one likelihood query{what}, {cells}"
            yield compare(name, ours, one, peer_name=_PEER, repeats=repeats, bar=bar)

        yield from _cold_rows(city, database, queries[0], max(1, repeats // 3))


def growth_of_likelihood(database: SignatureDatabase, one: _Peer, *, repeats: int) -> Comparison:
    """Measure a query against a database of another size, its index in memory.

    Parameters
    ----------
    database : SignatureDatabase
        The cells; queries are the first ones.
    one : callable
        The peer's work for one query, the number of which it is given.
    repeats : int
        How often it is timed.

    Returns
    -------
    Comparison
        The result.
    """
    index = build_index(database, _NOISE, threads=os.cpu_count() or 1)
    return compare(
        f"growth: a likelihood query, {len(database):,} cells",
        lambda repeat: index.scores(database.signature(repeat)),
        one,
        peer_name=_PEER,
        repeats=repeats,
    )


def _index_rows(database: SignatureDatabase, city: Path) -> Iterator[Comparison]:
    """Measure how long the index takes to build, beside the bare writing, and its size."""
    path = City(city).index_path(_NOISE)
    save_index(database, _NOISE, path)  # kernels are loaded
    size = path.stat().st_size
    zeros, copy = np.zeros(size, np.uint8), path.with_suffix(".copy")
    yield compare(
        f"building and saving the likelihood index of {len(database):,} cells",
        lambda _: save_index(database, _NOISE, path),
        lambda _: zeros.tofile(copy),
        peer_name="numpy.ndarray.tofile of as many bytes",
        repeats=1,
    )
    copy.unlink()
    yield Comparison(
        name=f"likelihood index of {len(database):,} cells",
        unit="MB",
        ours=size / 1e6,
        peer=city.stat().st_size / 1e6,
        peer_name="the database file",
        bar=None,
    )


def _cold_rows(
    city: Path, database: SignatureDatabase, query: Signature, repeats: int
) -> Iterator[Comparison]:
    """Measure whole processes of the command, beside Python with the same packages."""
    asked = query.to_dict(database.taxonomy)
    bearings = ",".join(map(str, asked["bearings"]))
    options = ["--types", asked["types"], "--bearings", bearings, "--method", "likelihood"]
    localize = ["-m", "semsig_gis.cli", "localize", str(city), *options]

    def process(arguments: Sequence[str], _: int) -> None:
        command = [sys.executable, *arguments]
        subprocess.run(command, check=True, capture_output=True)  # noqa: S603

    yield compare(
        f"cold: semsig localize by likelihood, {len(database):,} cells, index built",
        partial(process, localize),
        partial(process, ["-c", _IMPORTS]),
        peer_name="python that imports numba, pandas, geopandas, pyarrow, typer and rich",
        repeats=repeats,
    ).at_most(_MOST_COLD_MS)
    yield compare(
        "cold: semsig --help",
        partial(process, ["-m", "semsig_gis.cli", "--help"]),
        partial(process, ["-c", "import typer, rich"]),
        peer_name="python that imports typer and rich",
        repeats=repeats,
    ).at_most(_MOST_HELP_MS)
