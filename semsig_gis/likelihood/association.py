"""Which detection is which object: chances and sums over all one-to-one associations.

A detection is one of the objects or clutter, an object is detected once or missed. Each pair has a
weight, how much likelier the two are one thing than a miss and clutter. The likelihood sums over
all associations A; in the notation of `likelihood.index`,

    L = prod_i (1 - p_i) * prod_j lambda(t_j)
        * sum_A prod_(i,j in A) o_i C(i, t_j) N(a_j - theta_i) / lambda(t_j)

The index adds up over the detections one by one, so that one lamp may explain three; its best cells
are ranked again by this sum. An alignment that keeps the order would lose one query in twenty, as
bearing noise swaps neighbours.

The sum is the Bethe approximation that belief propagation settles on (Williams and Lau,
"Approximate evaluation of marginal association probabilities with belief propagation", 2014): exact
if the pairs form no loop, otherwise a little too small.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.core.geometry import signed_degrees
from semsig_gis.core.view import View
from semsig_gis.database.database import views_in
from semsig_gis.likelihood.index import CellScores, own_sigma
from semsig_gis.likelihood.noise.table import database_tables
from semsig_gis.likelihood.photo import PhotoTable, photo_loglik

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.core.signature import Signature
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.likelihood.index import LikelihoodIndex
    from semsig_gis.likelihood.noise.model import Noise
    from semsig_gis.likelihood.noise.table import NoiseTable


WIDE = 45.0  # degrees of deviation from which on the tails meet behind the observer
LAPS = 360.0 * np.arange(-3, 4)


def turn_logs(turns: NDArray[np.float64], step: float, north_sigma: float) -> NDArray[np.float64]:
    """Return the logarithm of the chance of each turn, one step wide, all in degrees."""
    if math.isinf(north_sigma):
        return np.full(turns.shape, math.log(step / 360.0))
    scale = math.log(step / (north_sigma * math.sqrt(2.0 * math.pi)))
    return np.asarray(scale - 0.5 * (signed_degrees(turns) / north_sigma) ** 2)


@dataclass(frozen=True, eq=False, kw_only=True)
class Pairs:
    """The pairs of an object and a detection that may be one thing, for several problems.

    The pairs of problem i are ``starts[i]:starts[i + 1]``. `objects` and `detections` are row
    numbers that run on over all problems. `away` is the bearing of the detection less that of the
    object, in degrees in [-180, 180).
    """

    starts: NDArray[np.int64]
    objects: NDArray[np.int64]
    detections: NDArray[np.int64]
    away: NDArray[np.float64]


def near_pairs(
    object_starts: NDArray[np.int64],
    object_bearings: NDArray[np.float64],
    detection_starts: NDArray[np.int64],
    detection_bearings: NDArray[np.float64],
    *,
    reach: float = 180.0,
) -> Pairs:
    """Return the pairs of each problem whose bearings differ by at most `reach` degrees.

    Problem i has the objects ``object_starts[i]:object_starts[i + 1]``, and detections likewise.
    Pairs are ordered by problem and object.
    """
    here, there = np.diff(object_starts), np.diff(detection_starts)
    problem = np.repeat(np.arange(len(here)), here * there)
    inside = np.arange(len(problem)) - (np.cumsum(here * there) - here * there)[problem]
    row, column = np.divmod(inside, there[problem])
    objects = object_starts[problem] + row
    detections = detection_starts[problem] + column
    away = signed_degrees(detection_bearings[detections] - object_bearings[objects])
    near = np.abs(away) <= reach
    starts = np.concatenate([[0], np.cumsum(np.bincount(problem[near], minlength=len(here)))])
    return Pairs(starts=starts, objects=objects[near], detections=detections[near], away=away[near])


def associate(
    table: NoiseTable,
    pairs: Pairs,
    *,
    kinds: NDArray[np.int64],
    distances: NDArray[np.float64],
    lengths: NDArray[np.int64],
    names: NDArray[np.int64],
) -> tuple[NDArray[np.float64], float]:
    """Return the chance that each pair is one thing, and the log-likelihood of all detections.

    By object, `kinds` is the row of its class in the table, `distances` its distance in metres and
    `lengths` how many objects are seen together with it, itself included. `names` is the class row
    of each detection, k if it is unknown.
    """
    rows = table.length_rows(lengths)
    kind, length = kinds[pairs.objects], rows[pairs.objects]
    turned = np.degrees(table.position_sigma / np.maximum(distances[pairs.objects], 1e-3))
    spread = np.minimum(np.hypot(table.sigma[kind], turned), 180.0)
    density = np.exp(-0.5 * (pairs.away / spread) ** 2)
    wide = spread > WIDE
    laps = (pairs.away[wide, None] + LAPS) / spread[wide, None]
    density[wide] = np.exp(-0.5 * laps**2).sum(axis=1)
    density /= spread * np.sqrt(2.0 * np.pi)
    naming = table.naming[length, kind, names[pairs.detections]]
    chances, log_sums = associate_pairs(pairs, table.odds[length, kind] * naming * density)
    loglik = (
        log_sums.sum()
        + np.log(table.missed[rows, kinds]).sum()
        + np.log(table.density[names]).sum()
        - len(log_sums) * table.clutter.sum()
    )
    return chances, float(loglik)


def associate_pairs(
    pairs: Pairs, weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sum over the one-to-one associations of each problem, given weights of 0 or more.

    Returns the chance that each pair is one thing, and the logarithm of the sum of each problem.
    """
    from semsig_gis.likelihood.kernels import associate  # noqa: PLC0415 - numba loads slowly

    chances = np.empty(len(weights))
    log_sums = np.empty(len(pairs.starts) - 1)
    associate(
        pairs.starts,
        pairs.objects,
        pairs.detections,
        np.ascontiguousarray(weights, dtype=np.float64),
        np.ones(pairs.objects.max(initial=-1) + 1),
        np.ones(pairs.detections.max(initial=-1) + 1),
        chances,
        log_sums,
    )
    return chances, log_sums


RERANKED = 1000
"""How many cells are re-ranked unless said otherwise."""
FIRST = 100  # cells that are re-ranked whatever comes out
HOPELESS = 20.0  # nats below the best of them, at which the others are not looked at
# Turns around the likeliest one of the scan, which knows it to less than six degrees.
TURNS = np.arange(-7.5, 7.6, 1.5)


def align_cells(
    database: SignatureDatabase,
    photo: Signature,
    noise: Noise,
    cells: NDArray[np.int64],
    *,
    turns: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return the log-likelihood of a photo in some cells, summed over one-to-one associations.

    As `photo_loglik`: the shape is (c,), or (c, r) if `turns`, the degrees to turn the photo by for
    each cell, are given.
    """
    tables, weights = database_tables(database, noise)
    ways = np.zeros((len(cells), 1)) if turns is None else turns
    asked = PhotoTable.of(View.of(photo), tables[0])
    loglik = photo_loglik(asked, views_in(database, cells), tables, weights, turns=ways)
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
    result. Without bearings the scores are returned as they are.
    """
    from semsig_gis.likelihood.kernels import promising_cells  # noqa: PLC0415 - numba loads slowly

    if count < 1:
        msg = f"{count} cells were to be re-ranked; give a whole number from 1."
        raise InputError(msg)
    view = View.of(query)
    if view.bearings is None:
        return scores
    old = scores.loglik.astype(np.float64)
    total = old if log_prior is None else old + log_prior
    count = min(count, len(old))
    cells = promising_cells(total.astype(np.float32), count)
    cells = cells[np.argsort(-total[cells], kind="stable")][:count]
    cells = cells[total[cells] > -np.inf]
    first, rest = cells[:FIRST], cells[FIRST:]
    new, turns = _aligned(index, view, first, scores, north_sigma)
    if len(rest):
        # At best, the others change by as much as any of these did.
        hope = (new - old[first]).max()
        best = (new - old[first] + total[first]).max()
        rest = rest[total[rest] + hope > best - HOPELESS]
        more, more_turns = _aligned(index, view, rest, scores, north_sigma)
        new = np.append(new, more)
        turns = [np.append(*both) for both in zip(turns, more_turns, strict=True)]
    cells = np.append(first, rest)
    worse = slice(len(cells) // 2, None)
    moved = np.logaddexp.reduce(new[worse]) - np.logaddexp.reduce(old[cells[worse]])
    loglik = old + moved if len(cells) else old
    loglik[cells] = new
    headings = []
    for before, turn in zip(scores.headings, turns, strict=True):
        heading = before
        if before is not None:
            heading = before.copy()
            heading[cells] = signed_degrees(turn)
        headings.append(heading)
    return CellScores(loglik=loglik, headings=tuple(headings))


def _aligned(
    index: LikelihoodIndex,
    view: View,
    cells: NDArray[np.int64],
    scores: CellScores,
    north_sigma: float,
) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """Return the log-likelihood in some cells, and the likeliest turns of the photos in each."""
    views = views_in(index.database, cells)
    total, likeliest = np.zeros(len(cells)), []
    for photo, heading in zip(view.split(), scores.headings, strict=True):
        turns = np.zeros((len(cells), 1)) if heading is None else heading[cells, None] + TURNS
        asked = PhotoTable.of(photo, index.table)
        logliks = photo_loglik(asked, views, *index.models, turns=turns)
        if heading is not None:
            logliks += turn_logs(turns, TURNS[1] - TURNS[0], own_sigma(photo, north_sigma))
        likeliest.append(turns[np.arange(len(cells)), logliks.argmax(axis=1)])
        total += np.logaddexp.reduce(logliks, axis=1)
    return total, likeliest
