"""Re-rank the best cells by a likelihood in which no object explains two detections.

The index adds up over the detections one by one, so that one lamp may explain three. Here the
likelihood sums over all one-to-one associations A of detections with objects, each detection being
an object of the cell or clutter, each object detected once or missed:

    L = prod_i (1 - p_i) * prod_j lambda(t_j)
        * sum_A prod_(i,j in A) o_i C(i, t_j) N(a_j - theta_i) / lambda(t_j)

Belief propagation approximates the sum closely, whatever the order of the objects. An alignment
that keeps the order loses one query in twenty, as bearing noise swaps neighbours.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.database.database import BEARING_UNITS
from semsig_gis.likelihood.index import CellScores
from semsig_gis.likelihood.noise.table import database_tables

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.core.signature import Signature
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.likelihood.index import LikelihoodIndex
    from semsig_gis.likelihood.noise.model import Noise
    from semsig_gis.likelihood.noise.table import NoiseTable

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

    The query needs bearings; its types may be unknown. A mixture of noise models counts as the
    weighted sum of their likelihoods. The shape is (c,), or (c, r) if `turns`, the degrees to turn
    the query by for each cell, are given; the scale is that of `likelihood.index`.

    The sum over the associations is the Bethe approximation that belief propagation settles on
    (Williams and Lau, "Approximate evaluation of marginal association probabilities with belief
    propagation", 2014): exact if the possible pairs form no loop, otherwise a little too small.
    """
    tables, weights = database_tables(database, noise)
    ways = np.zeros((len(cells), 1)) if turns is None else np.asarray(turns, dtype=np.float64)
    found = _align(database, query, tables, weights, cells, ways)
    return found[:, 0] if turns is None else found


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
    known = old if log_prior is None else old + log_prior
    cells = _best(known, min(count, len(old)))
    first, rest = cells[:FIRST], cells[FIRST:]
    new, turn = _aligned(index, query, first, scores.heading, north_sigma)
    if len(rest):
        # At best, the others change by as much as any of these did.
        hope = (new - old[first]).max()
        best = (new - old[first] + known[first]).max()
        rest = rest[known[rest] + hope > best - HOPELESS]
    more, more_turn = _aligned(index, query, rest, scores.heading, north_sigma)
    cells, new = np.append(first, rest), np.append(new, more)
    worse = cells[len(cells) // 2 :]
    moved = np.logaddexp.reduce(new[len(cells) // 2 :]) - np.logaddexp.reduce(old[worse])
    loglik = old + moved if len(cells) else old
    loglik[cells] = new
    if scores.heading is None:
        return CellScores(loglik=loglik)
    heading = scores.heading.copy()
    heading[cells] = (np.append(turn, more_turn) + 180.0) % 360.0 - 180.0
    return CellScores(loglik=loglik, heading=heading)


def _aligned(
    index: LikelihoodIndex,
    query: Signature,
    cells: NDArray[np.int64],
    heading: NDArray[np.float32] | None,
    north_sigma: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the log-likelihood in some cells, and the turn that is likeliest in each."""
    parts = index.database, query, index.tables, index.weights, cells
    if heading is None:
        still = np.zeros((len(cells), 1))
        return _align(*parts, still)[:, 0], still[:, 0]
    turns = heading[cells, None] + TURNS
    found = _align(*parts, turns) + _log_chance(turns, north_sigma)
    likeliest = turns[np.arange(len(cells)), found.argmax(axis=1)]
    return np.logaddexp.reduce(found, axis=1), likeliest


def _align(  # noqa: PLR0917 - a long row of parts that always go together
    database: SignatureDatabase,
    query: Signature,
    tables: tuple[NoiseTable, ...],
    weights: NDArray[np.float64],
    cells: NDArray[np.int64],
    turns: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the log-likelihoods of a query with bearings, by cell and turn."""
    from semsig_gis.likelihood.kernels import align  # noqa: PLC0415 - numba loads slowly

    if query.bearings is None:
        msg = "the query has no bearings to align; give them, or rank by the index alone."
        raise InputError(msg)
    kinds = tables[0].query_rows(query)
    found = np.empty((len(tables), *turns.shape))
    align(
        np.asarray(cells, dtype=np.int64),
        database.offsets,
        database.codes,
        database.bearing_units,
        database.distance_units,
        tables[0].row_of,
        360.0 / BEARING_UNITS,
        kinds,
        query.bearings,
        turns,
        np.stack([table.odds for table in tables]),
        np.stack([table.naming for table in tables]),
        np.stack([table.sigmas(database.reach) for table in tables]),
        found,
    )
    for one, (table, weight) in enumerate(zip(tables, weights.tolist(), strict=True)):
        found[one] += table.nothing_seen(database, cells)[:, None]
        found[one] += float(np.log(table.density[kinds]).sum()) + math.log(weight)
    return np.asarray(np.logaddexp.reduce(found, axis=0))


def _best(scores: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Return the cells of the highest scores, best first; impossible ones are left out."""
    from semsig_gis.likelihood.kernels import promising_cells  # noqa: PLC0415

    cells = promising_cells(scores.astype(np.float32), count)
    cells = cells[np.argsort(-scores[cells], kind="stable")][:count]
    possible: NDArray[np.int64] = cells[scores[cells] > -np.inf]
    return possible


def _log_chance(turns: NDArray[np.float64], north_sigma: float) -> NDArray[np.float64]:
    """Return the logarithm of the chance of a turn, one step of `TURNS` wide."""
    step = TURNS[1] - TURNS[0]
    if math.isinf(north_sigma):
        return np.full(turns.shape, math.log(step / 360.0))
    away = (turns + 180.0) % 360.0 - 180.0
    scale = math.log(step / (north_sigma * math.sqrt(2.0 * math.pi)))
    return np.asarray(scale - 0.5 * (away / north_sigma) ** 2)
