"""What the methods make of queries, and how far off they are."""

from __future__ import annotations

import math
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from queue import SimpleQueue
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from semsig_gis.database import ObjectStore
from semsig_gis.localization import (
    DIVIDED_PARTS,
    expected_best,
    posterior,
    rank_range,
    refine,
    rerank,
    route_posteriors,
    score_cells,
    top_candidates,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from benchmarks._accuracy_queries import City, Query, Walk
    from semsig_gis.localization import LikelihoodIndex, Method, Noise, Posterior

__all__ = [
    "NEAR",
    "Outcome",
    "Way",
    "ask_likelihood",
    "ask_paper",
    "ask_refined",
    "ask_routes",
]

NEAR = (5.0, 25.0, 50.0)
"""Metres that count as near."""
REGION = 0.9

_T = TypeVar("_T")
_R = TypeVar("_R")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of one query.

    Parameters
    ----------
    length : int
        How many objects are really seen from the place.
    within : tuple of float
        Chance that the answer is within each distance of `NEAR`; below 1 only among ties.
    ranks : tuple of int
        First and last rank that ties allow for the true cell, from 1.
    seconds : float
        Time of the processor.
    mass : float or None
        Chance that the answer is right, by the method's own account.
    in_region : bool or None
        Whether the true cell is in the region of 90 %; None where there is no region.
    region_mass : float or None
        Chance of that region by the method's own account: of whole cells, so often above 90 %.
    in_exact_region : float or None
        The same where the least likely cells of the region, all alike, belong to it only with
        the chance that makes it one of just 90 %.
    """

    length: int
    within: tuple[float, ...]
    ranks: tuple[int, int]
    seconds: float = 0.0
    mass: float | None = None
    in_region: bool | None = None
    region_mass: float | None = None
    in_exact_region: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """How the likelihood method is used.

    Parameters
    ----------
    reranked : bool
        Whether the best cells are re-ranked by one-to-one alignments.
    north_sigma : float
        Standard deviation of north in degrees.
    radius : float
        The answer has most of the chance within so many metres.
    """

    reranked: bool = True
    north_sigma: float = 0.0
    radius: float = 50.0


def ask_paper(city: City, queries: Sequence[Query], method: Method, *, kept: bool) -> list[Outcome]:
    """Rank by one of the paper's methods; `kept` is the order that the objects have on the map."""
    database = city.database
    asked = [query.kept if kept else query.seen for query in queries]
    some = [one for one in asked if len(one)]
    next(iter(score_cells(database, some[:1], method)))  # what is worked out once is not timed
    rows = iter(score_cells(database, some, method))
    outcomes = []
    for query, one in zip(queries, asked, strict=True):
        if not len(one):
            outcomes.append(_lost(city, query))
            continue
        start = time.process_time()
        scores = next(rows)
        seconds = time.process_time() - start
        better, tied = top_candidates(scores, 1)
        errors = [_errors(city, query, cells) for cells in (better, tied)]
        _, within = expected_best(*errors, slots=1, thresholds=NEAR)
        outcomes.append(
            Outcome(
                length=query.length,
                within=tuple(within.tolist()),
                ranks=rank_range(scores, query.cell),
                seconds=seconds,
            )
        )
    return outcomes


def ask_likelihood(
    city: City, queries: Sequence[Query], index: LikelihoodIndex, way: Way, *, threads: int
) -> list[Outcome]:
    """Answer by the likelihood method."""

    def ask(query: Query) -> Outcome:
        if not len(query.seen):
            return _lost(city, query)
        start = time.thread_time()
        loglik = _loglik(index, query, way)
        found = posterior(city.database, loglik)
        cell, mass = found.best_place(way.radius)
        seconds = time.thread_time() - start
        return _told(city, query, found, loglik, (cell, mass, seconds))

    return _each(ask, queries, threads)


def ask_refined(
    city: City, queries: Sequence[Query], index: LikelihoodIndex, noise: Noise, *, threads: int
) -> list[Outcome]:
    """Answer with a place off the grid; the index is that of `cell_noise`."""
    stores: SimpleQueue[ObjectStore] = SimpleQueue()  # an R-tree serves one thread at a time
    for _ in range(threads):
        store = ObjectStore.of(city.objects)
        _ = store.index
        stores.put(store)

    def ask(query: Query) -> Outcome:
        if not len(query.seen):
            return _lost(city, query)
        store = stores.get()
        start = time.thread_time()
        loglik = _loglik(index, query, Way())
        count = min(DIVIDED_PARTS[0], len(loglik))
        likely = np.argpartition(-loglik, count - 1)[:count]
        likely = likely[np.argsort(-loglik[likely], kind="stable")]
        found = refine(
            query.seen,
            city.database.xy[likely],
            noise,
            store=store,
            step=city.database.grid.step,
            radius=city.database.spec.radius,
        )
        error = math.dist(found.xy, query.xy)
        seconds = time.thread_time() - start
        stores.put(store)
        return Outcome(
            length=query.length,
            within=tuple(float(error <= limit) for limit in NEAR),
            ranks=rank_range(-loglik.astype(np.float32), query.cell),
            seconds=seconds,
            mass=found.mass,
        )

    return _each(ask, queries, threads)


def ask_routes(
    city: City,
    routes: Sequence[Walk],
    index: LikelihoodIndex,
    cases: Sequence[tuple[int, float]],
    *,
    threads: int,
) -> list[list[Outcome]]:
    """Answer where the last panorama was taken; a case is their number and the legs' sigma."""
    way = Way()

    def ask(walk: Walk) -> list[Outcome]:
        logliks, spent = [], []
        for query in walk.queries:
            start = time.thread_time()
            logliks.append(_loglik(index, query, way))
            spent.append(time.thread_time() - start)
        outcomes = []
        for count, sigma in cases:
            legs = walk.legs[sigma][: count - 1]
            start = time.thread_time()
            found = route_posteriors(city.database, logliks[:count], legs)[-1]
            cell, mass = found.best_place(way.radius)
            seconds = time.thread_time() - start + sum(spent[:count])
            with np.errstate(divide="ignore"):
                logs = np.log(found.chances)
            told = (cell, mass, seconds)
            outcomes.append(_told(city, walk.queries[count - 1], found, logs, told))
        return outcomes

    return [list(outcomes) for outcomes in zip(*_each(ask, routes, threads), strict=True)]


def _loglik(index: LikelihoodIndex, query: Query, way: Way) -> NDArray[np.floating]:
    scores = index.scores(query.seen, north_sigma=way.north_sigma)
    if way.reranked:
        scores = rerank(index, query.seen, scores, north_sigma=way.north_sigma)
    return scores.loglik


def _told(
    city: City,
    query: Query,
    found: Posterior,
    loglik: NDArray[np.floating],
    told: tuple[int, float, float],
) -> Outcome:
    """Return what came of an answer: its cell, its chance, and the seconds it took."""
    cell, mass, seconds = told
    (error,) = _errors(city, query, np.array([cell]))
    chances, region = found.chances, found.credible_cells(REGION)
    least, true = chances[region[-1]], chances[query.cell]
    part = (REGION - chances[chances > least].sum()) / chances[chances == least].sum()
    return Outcome(
        length=query.length,
        within=tuple(float(error <= limit) for limit in NEAR),
        ranks=rank_range(-loglik.astype(np.float32), query.cell),
        seconds=seconds,
        mass=mass,
        in_region=bool((region == query.cell).any()),
        region_mass=float(chances[region].sum()),
        in_exact_region=float(part if true == least else true > least),
    )


def _lost(city: City, query: Query) -> Outcome:
    """Return the outcome of a query that has no objects."""
    cells = len(city.database)
    return Outcome(length=query.length, within=(0.0,) * len(NEAR), ranks=(cells, cells))


def _errors(city: City, query: Query, cells: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return how far the viewpoints of cells are from where a query was seen, in metres."""
    away = city.database.xy[cells] - np.array(query.xy)
    # So that a cell 50 m away is not a rounding beyond 50 m.
    return np.asarray(np.round(np.hypot(away[:, 0], away[:, 1]), 6))


def _each(work: Callable[[_T], _R], items: Sequence[_T], threads: int) -> list[_R]:
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, items))
