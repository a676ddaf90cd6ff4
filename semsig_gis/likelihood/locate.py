"""Where a query was seen from: chances, a place with its region, or "cannot tell".

The steps of the likelihood method in one call: score every cell by the index, re-rank the best
by one-to-one associations, turn the scores into chances, decide whether to answer, and, where the
street objects are at hand, look for the place between the viewpoints and say what speaks for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from semsig_gis.core.errors import InputError
from semsig_gis.core.grid import cell_ids
from semsig_gis.likelihood.answer_rule import AnswerRule
from semsig_gis.likelihood.estimate import cell_estimate, refined_estimate
from semsig_gis.likelihood.explain import explain, explain_cell
from semsig_gis.likelihood.index import CellScores
from semsig_gis.likelihood.posterior import Posterior, posterior
from semsig_gis.likelihood.refine import KEPT, cell_noise, place_noise, refine
from semsig_gis.likelihood.rerank import rerank
from semsig_gis.likelihood.result import REGION_SHARE, Location
from semsig_gis.likelihood.route import route_posteriors

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.core.signature import Signature
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.database.store import ObjectStore
    from semsig_gis.likelihood.explain import Explanation
    from semsig_gis.likelihood.index import LikelihoodIndex
    from semsig_gis.likelihood.refine import Refinement
    from semsig_gis.likelihood.route import Leg

DEFAULT_RULE: AnswerRule = AnswerRule(threshold=0.9)
"""Answer where the place is within 50 m of the best one with a chance of 0.9 by the model."""


def locate(
    index: LikelihoodIndex,
    query: Signature,
    *,
    north_sigma: float = 0.0,
    log_prior: NDArray[np.float64] | None = None,
    rule: AnswerRule = DEFAULT_RULE,
    top: int = 10,
    store: ObjectStore | None = None,
    refined: bool = False,
    explained: int = 0,
) -> Location:
    """Find where a query was seen from, by likelihood.

    Parameters
    ----------
    index : LikelihoodIndex
        The cells and the noise model. For queries from anywhere, not from the middles of cells
        alone, that is ``cell_noise(noise, step)`` (see `likelihood.refine`).
    query : Signature
        At least one object; types or bearings may be unknown.
    north_sigma : float, default 0
        Standard deviation in degrees of the north of the query: 0 where it is known, infinite
        where it is not known at all.
    log_prior : ndarray of float64, shape (n,), optional
        What else is known of the place (see `likelihood.priors`).
    rule : AnswerRule, optional
        When to answer; from a chance of 0.9 by default.
    top : int, default 10
        How many cells to list, at least 1.
    store : ObjectStore, optional
        The street objects behind the cells; what is refined or explained looks at them.
    refined : bool, default False
        Look for the place between the viewpoints, too, with the street objects of `store`; the
        chances of the cells are then those of their parts together.
    explained : int, default 0
        How many of the candidates to explain; without a store from the cells alone, which do not
        know the identifiers of what they see.

    Returns
    -------
    Location
        The answer.

    Raises
    ------
    InputError
        If the query is empty or has a class that no cell sees, a number is out of its range, or
        what is asked for needs bearings, a store, or another index.

    Examples
    --------
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.database.build import build_database
    >>> from semsig_gis.likelihood.index import build_index
    >>> from semsig_gis.likelihood.noise.model import named_noise
    >>> from semsig_gis.objects.clean import build_objects
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
    >>> from semsig_gis.database.store import ObjectStore
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> index = build_index(database, cell_noise(named_noise("generic"), 10.0))
    >>> longest = int(database.lengths.argmax())
    >>> query = database.signature(longest)
    >>> found = locate(index, query, top=3)
    >>> int(found.candidates["cell"][0]) == longest, len(found.candidates)
    (True, 3)
    >>> store = ObjectStore.of(objects)
    >>> found = locate(index, query, store=store, refined=True, explained=1)
    >>> bool(np.hypot(*(database.xy[longest] - [found.estimate.x, found.estimate.y])) < 2.0)
    True
    >>> found.explanations[0].counts["matched"] == len(query)
    True
    """
    task = _Task(index, north_sigma, rule, top, store, refined, explained)
    if not len(query):
        msg = "the query has no objects; give at least one type or bearing."
        raise InputError(msg)
    scores = _scores(index, query, north_sigma, log_prior)
    found = posterior(index.database, scores.loglik, log_prior=log_prior)
    return task.location(query, scores, found)


def locate_route(
    index: LikelihoodIndex,
    queries: Sequence[Signature],
    legs: Sequence[Leg],
    *,
    north_sigma: float = 0.0,
    log_prior: NDArray[np.float64] | None = None,
    rule: AnswerRule = DEFAULT_RULE,
    top: int = 10,
    store: ObjectStore | None = None,
    refined: bool = False,
    explained: int = 0,
) -> tuple[Location, ...]:
    """Find where the views of a route were seen from, each given all of them.

    Parameters
    ----------
    index : LikelihoodIndex
        The cells and the noise model.
    queries : sequence of Signature
        The views. One may have no objects: that nothing was detected tells something, too.
    legs : sequence of Leg
        The ways between them, one fewer.
    north_sigma : float, default 0
        Standard deviation in degrees of the north of each view.
    log_prior : ndarray of float64, shape (n,), optional
        What else is known of the place of the first view.
    rule : AnswerRule, optional
        When to answer.
    top : int, default 10
        How many cells to list for each view.
    store : ObjectStore, optional
        The street objects behind the cells.
    refined : bool, default False
        Look for each place between the viewpoints, too; see `locate`.
    explained : int, default 0
        How many of the candidates of each view to explain.

    Returns
    -------
    tuple of Location
        One for each view.

    Raises
    ------
    InputError
        As `locate`, and if the numbers of views and legs do not fit.

    Examples
    --------
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.database.build import build_database
    >>> from semsig_gis.likelihood.index import build_index
    >>> from semsig_gis.likelihood.noise.model import named_noise
    >>> from semsig_gis.objects.clean import build_objects
    >>> from semsig_gis.likelihood.route import Leg
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> index = build_index(database, named_noise("light"))
    >>> way = database.xy[200] - database.xy[0]
    >>> views = [database.signature(0), database.signature(200)]
    >>> first, last = locate_route(index, views, [Leg(dx=way[0], dy=way[1])])
    >>> int(first.candidates["cell"][0]), int(last.candidates["cell"][0])
    (0, 200)
    """
    task = _Task(index, north_sigma, rule, top, store, refined, explained)
    scores = [
        _scores(index, query, north_sigma, None if row else log_prior)
        for row, query in enumerate(queries)
    ]
    logliks = [one.loglik for one in scores]
    found = route_posteriors(index.database, logliks, legs, log_prior=log_prior)
    return tuple(map(task.location, queries, scores, found))


def _scores(
    index: LikelihoodIndex,
    query: Signature,
    north_sigma: float,
    log_prior: NDArray[np.float64] | None,
) -> CellScores:
    """Return the scores of all cells, the best ones by one-to-one associations."""
    if not len(query):
        return CellScores(loglik=index.constants)
    scores = index.scores(query, north_sigma=north_sigma)
    return rerank(index, query, scores, north_sigma=north_sigma, log_prior=log_prior)


@dataclass(frozen=True, slots=True)
class _Task:
    """How queries are to be answered."""

    index: LikelihoodIndex
    north_sigma: float
    rule: AnswerRule
    top: int
    store: ObjectStore | None
    refined: bool
    explained: int

    def __post_init__(self) -> None:
        if self.top < 1:
            msg = f"{self.top} candidates were asked for; give a whole number from 1."
            raise InputError(msg)
        if self.refined and self.store is None:
            msg = "a place between the viewpoints was asked for; give the store of the database."
            raise InputError(msg)

    def location(self, query: Signature, scores: CellScores, found: Posterior) -> Location:
        """Return the answer to a query, from the chances of the cells."""
        parts = None
        if self.refined and self.store is not None and len(query):
            parts = self._parts(query, scores, found, self.store)
            scores, found = _with_parts(parts, scores, found)
        answer = self.rule.decide(found)
        around = {"radius": self.rule.radius}
        estimate = None
        if parts is not None:
            turned = self.north_sigma > 0
            estimate = refined_estimate(parts, (answer.x, answer.y), turned=turned, **around)
        if estimate is None:
            north = {"north_sigma": self.north_sigma}
            noise = self.index.noise
            estimate = cell_estimate(query, noise, found, answer.cell, **around, **north)
        candidates = self._candidates(scores, found)
        first = candidates["cell"].to_list()[: self.explained if len(query) else 0]
        return Location(
            query=query,
            noise=self.index.noise.name,
            candidates=candidates,
            answer=answer,
            estimate=estimate,
            rule=self.rule,
            region=found.credible_cells(REGION_SHARE),
            posterior=found,
            loglik=scores.loglik,
            explanations=tuple(self._explanation(query, cell, scores, parts) for cell in first),
        )

    def _candidates(self, scores: CellScores, found: Posterior) -> pd.DataFrame:
        database, count = found.database, min(self.top, len(found.database))
        likely = np.argpartition(-found.chances, count - 1)[:count]
        listed = likely[np.lexsort((likely, -found.chances[likely]))]
        xy = database.xy[listed]
        columns = {
            "rank": np.arange(1, count + 1),
            "cell": listed,
            "cell_id": database.cell_ids[listed],
            "x": xy[:, 0],
            "y": xy[:, 1],
            "types": [database.types(cell) for cell in listed.tolist()],
            "length": database.lengths[listed],
            "loglik": scores.loglik[listed].astype(np.float64),
            "chance": found.chances[listed],
        }
        if scores.heading is not None:
            columns["heading"] = scores.heading[listed].astype(np.float64)
        return pd.DataFrame(columns)

    def _parts(
        self, query: Signature, scores: CellScores, found: Posterior, store: ObjectStore
    ) -> Refinement:
        """Return the chances of the parts of the likeliest cells."""
        database = found.database
        count = min(KEPT[0], len(database))
        cells = np.argpartition(-found.chances, count - 1)[:count]
        cells = cells[found.chances[cells] > 0]
        cells = cells[np.argsort(-found.chances[cells], kind="stable")]
        return refine(
            query,
            database.xy[cells],
            place_noise(self.index.noise, database.grid.step),
            objects=store.objects,
            index=store.index,
            step=database.grid.step,
            radius=database.spec.radius,
            north_sigma=self.north_sigma,
            headings=None if scores.heading is None else scores.heading[cells],
            # All that is known of the cells but for what this query tells.
            log_prior=np.log(found.chances[cells]) - scores.loglik[cells],
            footprints=store.buildings_around(
                database.xy[cells], distance=database.reach + database.grid.step
            ),
        )

    def _explanation(
        self, query: Signature, cell: int, scores: CellScores, parts: Refinement | None
    ) -> Explanation:
        """Return what speaks for a cell: at the likeliest part of it, or at its middle."""
        database, noise = self.index.database, self.index.noise
        heading = 0.0 if scores.heading is None else float(scores.heading[cell])
        if self.store is None:
            return explain_cell(query, cell, noise, database=database, heading=heading)
        x, y = database.xy[cell].tolist()
        if parts is not None and len(inside := np.flatnonzero(_owners(parts, database) == cell)):
            best = inside[parts.loglik[inside].argmax()]
            x, y = parts.places[best].tolist()
            heading = float(parts.headings[best])
            noise = cell_noise(place_noise(noise, database.grid.step), float(parts.sizes[best]))
        return explain(
            query,
            (x, y),
            noise,
            objects=self.store.objects,
            index=self.store.index,
            radius=database.spec.radius,
            heading=heading,
            footprints=self.store.buildings_around(np.array([[x, y]]), distance=database.reach),
        )


def _with_parts(
    parts: Refinement, scores: CellScores, found: Posterior
) -> tuple[CellScores, Posterior]:
    """Return the scores and chances of the cells, those of the parts in the place of older ones."""
    database = found.database
    owners = _owners(parts, database)
    cells, rows = np.unique(owners, return_inverse=True)
    shares = np.bincount(rows, parts.chances)
    chances = found.chances.copy()
    chances[cells] = shares * found.chances[cells].sum()
    means = np.full(len(cells), -np.inf)
    np.logaddexp.at(means, rows, parts.loglik + 2.0 * np.log(parts.sizes / database.grid.step))
    loglik = scores.loglik.astype(np.float64)
    loglik[cells] = means
    heading = scores.heading
    if heading is not None:
        heading = heading.copy()
        order = np.argsort(parts.chances, kind="stable")  # the likeliest part comes last
        heading[owners[order]] = parts.headings[order]
    return CellScores(loglik=loglik, heading=heading), Posterior(database=database, chances=chances)


def _owners(parts: Refinement, database: SignatureDatabase) -> NDArray[np.int64]:
    """Return the row of the cell that each part lies in."""
    ids = cell_ids(*database.grid.cells_at(parts.places))
    return np.asarray(np.searchsorted(database.cell_ids, ids))
