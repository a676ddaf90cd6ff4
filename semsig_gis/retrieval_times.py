"""How long one query takes, as the paper measures it."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.errors import InputError
from semsig_gis.matching import score_cells

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.method import Method

__all__ = ["time_queries"]


def time_queries(
    database: SignatureDatabase,
    methods: Mapping[str, Method],
    *,
    length: int = 14,
    repetitions: int = 100,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, float]:
    """Measure how long methods take to compare one query with all cells.

    Parameters
    ----------
    database : SignatureDatabase
        What is searched.
    methods : mapping of str to Method
        Methods by name.
    length : int, default 14
        How many objects a query has; cells of the nearest length are taken, if none has just this.
    repetitions : int, default 100
        How many queries to ask one by one.
    seed : int, default 0
        Seed of the choice of the cells that are asked for.
    progress : callable, optional
        Called with the number of methods done and in all.

    Returns
    -------
    dict of str to float
        Mean seconds of a query by the name of the method; what is worked out once for a database
        does not count.

    Raises
    ------
    InputError
        If there are fewer than one repetitions.

    Notes
    -----
    Paper, table of retrieval times: the mean of 100 repetitions with a query of mean length. The
    queries are asked one at a time, on one thread.

    Examples
    --------
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.method import Method
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> times = time_queries(build_database(objects), {"paper": Method()}, repetitions=3)
    >>> 0 < times["paper"] < 1
    True
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
