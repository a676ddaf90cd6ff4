"""Localize queries with the methods, and measure their errors."""

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
    "Settings",
    "ask_likelihood",
    "ask_paper",
    "ask_refined",
    "ask_routes",
]

NEAR = (5.0, 25.0, 50.0)
"""Errors in metres for which shares are computed."""
REGION = 0.9

_T = TypeVar("_T")
_R = TypeVar("_R")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """The outcome of one query.

    Parameters
    ----------
    length : int
        Number of objects that are really visible from the place.
    within : tuple of float
        Chance that the error is at most each distance of `NEAR`; between 0 and 1 only for ties.
    ranks : tuple of int
        First and last possible rank of the true cell among its ties, from 1.
    seconds : float
        Time of the processor.
    mass : float or None
        Chance that the answer is right, as stated by the method.
    in_region : bool or None
        Whether the true cell is in the region of 90 %; None without a region.
    region_mass : float or None
        Chance of that region, as stated by the method; often above 90 %, as it has whole cells.
    in_exact_region : float or None
        The same as `in_region` if the cells of the region with the lowest chance, which tie, count
        only with the part that makes the chance of the region exactly 90 %.
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
class Settings:
    """Settings of the likelihood method.

    Parameters
    ----------
    reranked : bool
        Whether the best cells are re-ranked by one-to-one associations.
    north_sigma : float
        Standard deviation of north in degrees.
    radius : float
        Radius in metres; the answer is the place with the most chance within it.
    """

    reranked: bool = True
    north_sigma: float = 0.0
    radius: float = 50.0


def ask_paper(
    city: City, queries: Sequence[Query], method: Method, *, unsorted: bool
) -> list[Outcome]:
    """Localize by a method of the paper, with objects in the order of the map if `unsorted`."""
    database = city.database
    signatures = [query.unsorted if unsorted else query.signature for query in queries]
    not_empty = [signature for signature in signatures if len(signature)]
    next(iter(score_cells(database, not_empty[:1], method)))  # one-time work is not timed
    rows = iter(score_cells(database, not_empty, method))
    outcomes = []
    for query, signature in zip(queries, signatures, strict=True):
        if not len(signature):
            outcomes.append(_unlocalized(city, query))
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
    city: City,
    queries: Sequence[Query],
    index: LikelihoodIndex,
    settings: Settings,
    *,
    threads: int,
) -> list[Outcome]:
    """Localize by the likelihood method."""

    def ask(query: Query) -> Outcome:
        if not len(query.signature):
            return _unlocalized(city, query)
        start = time.thread_time()
        loglik = _loglik(index, query, settings)
        result = posterior(city.database, loglik)
        cell, mass = result.best_place(settings.radius)
        seconds = time.thread_time() - start
        return _outcome(city, query, result, loglik, (cell, mass, seconds))

    return _each(ask, queries, threads)


def ask_refined(
    city: City, queries: Sequence[Query], index: LikelihoodIndex, noise: Noise, *, threads: int
) -> list[Outcome]:
    """Localize with refinement; the index must have the noise model of `cell_noise`."""
    stores: SimpleQueue[ObjectStore] = SimpleQueue()  # only one thread can use an R-tree
    for _ in range(threads):
        store = ObjectStore.of(city.objects)
        _ = store.index  # built now, so that it is not timed
        stores.put(store)

    def ask(query: Query) -> Outcome:
        if not len(query.signature):
            return _unlocalized(city, query)
        store = stores.get()
        start = time.thread_time()
        loglik = _loglik(index, query, Settings())
        count = min(DIVIDED_PARTS[0], len(loglik))
        likely = np.argpartition(-loglik, count - 1)[:count]
        likely = likely[np.argsort(-loglik[likely], kind="stable")]
        result = refine(
            query.signature,
            city.database.xy[likely],
            noise,
            store=store,
            step=city.database.grid.step,
            radius=city.database.spec.radius,
        )
        error = math.dist(result.xy, query.xy)
        seconds = time.thread_time() - start
        stores.put(store)
        return Outcome(
            length=query.length,
            within=tuple(float(error <= limit) for limit in NEAR),
            ranks=rank_range(-loglik.astype(np.float32), query.cell),
            seconds=seconds,
            mass=result.mass,
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
    """Localize the last panorama of routes; a case is their number and the sigma of the legs."""
    settings = Settings()

    def ask(walk: Walk) -> list[Outcome]:
        logliks, times = [], []
        for query in walk.queries:
            start = time.thread_time()
            logliks.append(_loglik(index, query, settings))
            times.append(time.thread_time() - start)
        outcomes = []
        for count, sigma in cases:
            legs = walk.legs[sigma][: count - 1]
            start = time.thread_time()
            result = route_posteriors(city.database, logliks[:count], legs)[-1]
            cell, mass = result.best_place(settings.radius)
            seconds = time.thread_time() - start + sum(times[:count])
            with np.errstate(divide="ignore"):
                logs = np.log(result.chances)
            answer = (cell, mass, seconds)
            outcomes.append(_outcome(city, walk.queries[count - 1], result, logs, answer))
        return outcomes

    return [list(outcomes) for outcomes in zip(*_each(ask, routes, threads), strict=True)]


def _loglik(index: LikelihoodIndex, query: Query, settings: Settings) -> NDArray[np.floating]:
    scores = index.scores(query.signature, north_sigma=settings.north_sigma)
    if settings.reranked:
        scores = rerank(index, query.signature, scores, north_sigma=settings.north_sigma)
    return scores.loglik


def _outcome(
    city: City,
    query: Query,
    result: Posterior,
    loglik: NDArray[np.floating],
    answer: tuple[int, float, float],
) -> Outcome:
    """Return the outcome of a query; `answer` is its cell, its chance and the seconds it took."""
    cell, mass, seconds = answer
    (error,) = _errors(city, query, np.array([cell]))
    chances, region = result.chances, result.credible_cells(REGION)
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


def _unlocalized(city: City, query: Query) -> Outcome:
    """Return the outcome of a query without objects."""
    cells = len(city.database)
    return Outcome(length=query.length, within=(0.0,) * len(NEAR), ranks=(cells, cells))


def _errors(city: City, query: Query, cells: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the distances in metres of the viewpoints of cells from the place of a query."""
    offsets = city.database.xy[cells] - np.array(query.xy)
    # Rounded, or a cell at 50 m could be beyond 50 m by a rounding error.
    return np.asarray(np.round(np.hypot(offsets[:, 0], offsets[:, 1]), 6))


def _each(work: Callable[[_T], _R], items: Sequence[_T], threads: int) -> list[_R]:
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, items))
