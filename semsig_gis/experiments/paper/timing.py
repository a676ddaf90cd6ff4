"""How long one query takes, as the paper measures it."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.matching.scores import score_cells

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.matching.method import Method


def time_queries(
    database: SignatureDatabase,
    methods: Mapping[str, Method],
    *,
    length: int = 14,
    repetitions: int = 100,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, float]:
    """Return the mean seconds that each method takes to compare one query with all cells.

    Paper, table of retrieval times: the mean of 100 repetitions with a query of mean length, asked
    one at a time, on one thread. The queries are cells with ``length`` objects, or of the nearest
    length; what is worked out once for a database does not count. ``progress`` is called with the
    methods done and in all.
    """
    if repetitions < 1:
        msg = f"{repetitions} repetitions were asked for; give a whole number from 1."
        raise InputError(msg)
    away = np.abs(database.lengths - length)
    like = np.flatnonzero(away == away.min())
    cells = np.random.default_rng(seed).choice(like, repetitions)
    queries = [database.signature(int(cell)) for cell in cells]
    found = {}
    for done, (name, method) in enumerate(methods.items(), start=1):
        for _ in range(2):  # the second time, kernels for many queries are loaded
            next(iter(score_cells(database, queries[:1], method)))
        seconds = []
        for query in queries:
            start = time.perf_counter()
            next(iter(score_cells(database, [query], method)))
            seconds.append(time.perf_counter() - start)
        found[name] = float(np.mean(seconds))
        if progress is not None:
            progress(done, len(methods))
    return found
