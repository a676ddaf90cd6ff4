"""Re-rank the best cells by a likelihood in which no object explains two detections.

The index adds up over the detections one by one, so that one lamp may explain three. Here the
likelihood sums over all one-to-one associations A of detections with objects, each detection being
an object of the cell or clutter, each object detected once or missed:

    L = prod_i (1 - p_i) * prod_j lambda(t_j)
        * sum_A prod_(i,j in A) o_i C(i, t_j) N(a_j - theta_i) / lambda(t_j)

Belief propagation approximates the sum closely, whatever the order of the objects (see
`likelihood.association`). An alignment that keeps the order loses one query in twenty, as bearing
noise swaps neighbours.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.core.geometry import signed_degrees
from semsig_gis.database.visibility import views_in
from semsig_gis.likelihood.association import place_loglik, turn_logs
from semsig_gis.likelihood.index import CellScores
from semsig_gis.likelihood.noise.table import database_tables

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.core.signature import Signature
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.likelihood.index import LikelihoodIndex
    from semsig_gis.likelihood.noise.model import Noise

RERANKED = 1000
"""How many cells are re-ranked unless said otherwise."""
FIRST = 100  # cells that are re-ranked whatever comes out
HOPELESS = 20.0  # nats below the best of them, at which the others are not looked at
# Turns around the likeliest one of the index, which knows it to five degrees.
TURNS = np.arange(-7.5, 7.6, 1.5)


def align_cells(
    database: SignatureDatabase,
    query: Signature,
    noise: Noise,
    cells: NDArray[np.int64],
    *,
    turns: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return the log-likelihood of a query in some cells, summed over one-to-one associations.

    As `association.place_loglik`: the shape is (c,), or (c, r) if `turns`, the degrees to turn the
    query by for each cell, are given.
    """
    models = database_tables(database, noise)
    ways = np.zeros((len(cells), 1)) if turns is None else np.asarray(turns, dtype=np.float64)
    views = views_in(database, cells)
    loglik = place_loglik(query, views, *models, turns=ways, reach=database.reach)
    return loglik[:, 0] if turns is None else loglik


def rerank(
    index: LikelihoodIndex,
    query: Signature,
    scores: CellScores,
    *,
    north_sigma: float = 0.0,
    log_prior: NDArray[np.float64] | None = None,
    count: int = RERANKED,
) -> CellScores:
    """Replace the scores of the best cells by their one-to-one likelihoods.

    Up to `count` cells are re-ranked; after the first hundred, only those that may still matter.
    The others are moved by as much as the likelihood of the worse half of these moved, so that the
    masses of both fit each other. `log_prior` helps to choose the cells and is not part of the
    result. `north_sigma` is in degrees, as for the scores. Without bearings the scores are returned
    as they are.
    """
    if count < 1:
        msg = f"{count} cells were to be re-ranked; give a whole number from 1."
        raise InputError(msg)
    if query.bearings is None:
        return scores
    old = scores.loglik.astype(np.float64)
    total = old if log_prior is None else old + log_prior
    cells = _best(total, min(count, len(old)))
    first, rest = cells[:FIRST], cells[FIRST:]
    new, turn = _aligned(index, query, first, scores.heading, north_sigma)
    if len(rest):
        # At best, the others change by as much as any of these did.
        hope = (new - old[first]).max()
        best = (new - old[first] + total[first]).max()
        rest = rest[total[rest] + hope > best - HOPELESS]
    more, more_turn = _aligned(index, query, rest, scores.heading, north_sigma)
    cells, new = np.append(first, rest), np.append(new, more)
    worse = slice(len(cells) // 2, None)
    moved = np.logaddexp.reduce(new[worse]) - np.logaddexp.reduce(old[cells[worse]])
    loglik = old + moved if len(cells) else old
    loglik[cells] = new
    if scores.heading is None:
        return CellScores(loglik=loglik)
    heading = scores.heading.copy()
    heading[cells] = signed_degrees(np.append(turn, more_turn))
    return CellScores(loglik=loglik, heading=heading)


def _aligned(
    index: LikelihoodIndex,
    query: Signature,
    cells: NDArray[np.int64],
    heading: NDArray[np.float32] | None,
    north_sigma: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the log-likelihood in some cells, and the turn that is likeliest in each."""
    turns = np.zeros((len(cells), 1)) if heading is None else heading[cells, None] + TURNS
    database = index.database
    views = views_in(database, cells)
    logliks = place_loglik(query, views, *index.models, turns=turns, reach=database.reach)
    if heading is not None:
        logliks += turn_logs(turns, TURNS[1] - TURNS[0], north_sigma)
    likeliest = turns[np.arange(len(cells)), logliks.argmax(axis=1)]
    return np.logaddexp.reduce(logliks, axis=1), likeliest


def _best(scores: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Return the cells of the highest scores, best first; impossible ones are left out."""
    from semsig_gis.likelihood.kernels import promising_cells  # noqa: PLC0415

    cells = promising_cells(scores.astype(np.float32), count)
    cells = cells[np.argsort(-scores[cells], kind="stable")][:count]
    possible: NDArray[np.int64] = cells[scores[cells] > -np.inf]
    return possible
