"""What a method answers to queries: a score for every cell, a place, and how sure it is."""

from __future__ import annotations

import functools
import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.likelihood.locate import locate
from semsig_gis.likelihood.method import LikelihoodMethod
from semsig_gis.matching.method import Method
from semsig_gis.matching.scores import score_cells

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core.signature import Signature
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.database.store import ObjectStore
    from semsig_gis.likelihood.index import LikelihoodIndex
    from semsig_gis.likelihood.posterior import Posterior
    from semsig_gis.likelihood.result import Location
    from semsig_gis.matching.memo import DistanceMemo


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class RankedAnswer:
    """What a method answers to one query.

    `scores` (n,) has one value a cell, lower is better: distances; or, of the likelihood method,
    negative log-likelihoods, with the cells of its answer before all others. `best_score` is the
    distance or negative log-likelihood of the answer. `place` (metres) and `heading` (degrees to
    add to the bearings of the query) are None where they were not looked for. `chance` is the
    method's own probability that the answer is within 50 m, NaN where it tells none; `seconds` is
    how long the answer took.
    """

    scores: NDArray[np.float32]
    best_score: float
    place: tuple[float, float] | None = None
    heading: float | None = None
    chance: float = math.nan
    posterior: Posterior | None = None
    seconds: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Answerer:
    """A method with all that it needs to answer.

    A likelihood method needs the `index` of this very database for the noise of the method, spread
    over a cell unless the method is for queries on the grid; and, where it refines places, the
    `store` of its street objects. Raises InputError if one of these is missing or the index is that
    of another database.
    """

    database: SignatureDatabase
    method: Method | LikelihoodMethod
    index: LikelihoodIndex | None = None
    store: ObjectStore | None = None

    def __post_init__(self) -> None:  # noqa: D105
        if not isinstance(self.method, LikelihoodMethod):
            return
        if self.index is None or (self.method.refined and self.store is None):
            missing = "index" if self.index is None else "street objects"
            msg = f"method {self.method} needs the {missing} of the database; give them."
            raise InputError(msg)
        if self.index.database is not self.database:
            msg = (
                "the likelihood index belongs to another database; build that of the one to search."
            )
            raise InputError(msg)

    def answers(
        self, queries: Sequence[Signature], *, memo: DistanceMemo | None = None
    ) -> Iterator[RankedAnswer]:
        """Yield one answer for each query, in order; each query has at least one object.

        `memo` keeps distances of these queries that other methods have needed; the time it took to
        measure them counts for each method.
        """
        if not queries:
            return
        if isinstance(self.method, Method):
            yield from self._by_distance(queries, self.method, memo)
        elif self.index is not None:
            yield from self._by_likelihood(queries, self.method, self.index)

    @functools.cached_property
    def _ready(self) -> set[str]:
        """The parts of a query that have been compared before."""
        return set()

    def _by_distance(
        self, queries: Sequence[Signature], method: Method, memo: DistanceMemo | None
    ) -> Iterator[RankedAnswer]:
        # What the database works out once and keeps is no part of the time of a query.
        parts = method.used(queries[0])
        if parts not in self._ready:
            next(iter(score_cells(self.database, queries[:1], method)))
            self._ready.add(parts)
        rows = iter(score_cells(self.database, queries, method, memo=memo))
        for _ in queries:
            start, spared = time.perf_counter(), memo.spared if memo else 0.0
            scores = next(rows)
            seconds = time.perf_counter() - start + (memo.spared - spared if memo else 0.0)
            yield RankedAnswer(scores=scores, best_score=float(scores.min()), seconds=seconds)

    def _by_likelihood(
        self, queries: Sequence[Signature], method: LikelihoodMethod, index: LikelihoodIndex
    ) -> Iterator[RankedAnswer]:
        answer_one = functools.partial(
            locate,
            index,
            north_sigma=method.north_sigma,
            top=1,
            store=self.store,
            refined=method.refined,
        )
        answer_one(queries[0])  # kernels are loaded once
        for query in queries:
            start = time.perf_counter()
            found = answer_one(query)
            seconds = time.perf_counter() - start
            answer, estimate = found.answer, found.estimate
            scores = -found.loglik.astype(np.float32)
            first = [answer.cell] if method.refined else _places_like(found)
            scores[first] = scores.min() - 1.0
            yield RankedAnswer(
                scores=scores,
                best_score=-float(found.loglik[answer.cell]),
                place=(estimate.x, estimate.y) if method.refined else None,
                heading=estimate.heading,
                chance=answer.mass,
                posterior=found.posterior,
                seconds=seconds,
            )


def _places_like(found: Location) -> NDArray[np.intp]:
    """Return the cells that might have been the answer as well, and the answer."""
    chances, answer = found.posterior.chances, found.answer
    alike = np.flatnonzero(chances == chances[answer.cell])
    masses = found.posterior.mass_within(found.rule.radius, alike)
    return np.asarray(alike[np.round(masses, 9) == answer.mass])
