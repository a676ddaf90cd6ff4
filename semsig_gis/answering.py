"""What a method answers to queries: a score for every cell, a place, and how sure it is."""

from __future__ import annotations

import functools
import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.errors import InputError
from semsig_gis.locating import locate
from semsig_gis.matching import score_cells
from semsig_gis.method import LikelihoodMethod, Method

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.likelihood import LikelihoodIndex
    from semsig_gis.location import Location
    from semsig_gis.posterior import Posterior
    from semsig_gis.signatures import Signature
    from semsig_gis.store import ObjectStore

__all__ = ["Answerer", "RankedAnswer"]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class RankedAnswer:
    """What a method answers to one query.

    Parameters
    ----------
    scores : ndarray of float32, shape (n,)
        Score of every cell, lower is better: distances; or, of the likelihood method, negative
        log-likelihoods, with the cells of its answer before all others.
    best_score : float
        The distance or negative log-likelihood of the answer.
    place : tuple of float or None
        Where in its cell the answer lies, in metres, where that was looked for.
    heading : float or None
        Degrees to add to the bearings of the query, where that was looked for.
    chance : float
        By the method's own account, that the answer is within 50 m; NaN where it tells none.
    posterior : Posterior or None
        The chances of the cells, where the method tells them.
    seconds : float
        How long it took.
    """

    scores: NDArray[np.float32]
    best_score: float
    place: tuple[float, float] | None = None
    heading: float | None = None
    chance: float = math.nan
    posterior: Posterior | None = None
    seconds: float


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Answerer:
    """A method with all that it needs to answer.

    Parameters
    ----------
    database : SignatureDatabase
        What is searched.
    method : Method or LikelihoodMethod
        How.
    index : LikelihoodIndex, optional
        The index of this database for the noise of a likelihood method; spread over a cell,
        unless the method is for queries on the grid.
    store : ObjectStore, optional
        The street objects of this database, for places that are refined.

    Raises
    ------
    InputError
        If the index or the objects are missing, or the index is that of another database.

    Examples
    --------
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> answerer = Answerer(database=database, method=Method())
    >>> [float(one.best_score) for one in answerer.answers([database.signature(7)])]
    [0.0]
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

    def answers(self, queries: Sequence[Signature]) -> Iterator[RankedAnswer]:
        """Yield the answers to some queries.

        Parameters
        ----------
        queries : sequence of Signature
            Each with at least one object.

        Yields
        ------
        RankedAnswer
            One for each, in their order.
        """
        if not queries:
            return
        if isinstance(self.method, Method):
            yield from self._by_distance(queries, self.method)
        elif self.index is not None:
            yield from self._by_likelihood(queries, self.method, self.index)

    def _by_distance(self, queries: Sequence[Signature], method: Method) -> Iterator[RankedAnswer]:
        # What the database works out once and keeps is no part of the time of a query.
        next(iter(score_cells(self.database, queries[:1], method)))
        rows = iter(score_cells(self.database, queries, method))
        for _ in queries:
            start = time.perf_counter()
            scores = next(rows)
            seconds = time.perf_counter() - start
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
