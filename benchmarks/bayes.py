"""Measure the upper bound for all methods: ``python -m benchmarks.bayes``.

In a made-up city of some thousand cells, the likelihood of every cell is summed exactly over all
one-to-one associations of detections and objects, with the noise model that distorts the queries.
Its chances follow from Bayes' rule, so no method is right more often than its best place. The
likelihood method is measured for the same queries of a full turn, of 120 and of 70 degrees, with
and without rough distances. Results are written to ``benchmarks/bayes.json``.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import norm

from benchmarks._cities import MADE_UP, made_up, made_up_streets
from benchmarks._measuring import option_parser, write_rows
from benchmarks.views import DEGREES, NOISE
from semsig_gis.core import FULL_TURN, signed_degrees, wilson_interval
from semsig_gis.database import visible_objects_in
from semsig_gis.evaluation import QuerySpec, draw_queries, parse_chain
from semsig_gis.localization import LikelihoodLocator, build_index, database_tables
from semsig_gis.observation import View
from semsig_gis.sources import CitySpec

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase, VisibleObjects
    from semsig_gis.evaluation import SimulatedQuery
    from semsig_gis.localization import NoiseTable
    from semsig_gis.observation import Photo

__all__ = ["ExactPosterior", "association_sum", "main"]

NEAR_M = 50.0
RANGE_ERROR = 0.25
MOST = 14  # detections of a query: memory is needed for every subset of them
NEGLIGIBLE = 30.0  # a cell that is more nats below the best cell is left out
LAPS = 360.0 * np.arange(-2, 3)


def main() -> None:
    """Measure, print and write."""
    parser = option_parser("bayes", __doc__)
    parser.add_argument("--queries", type=int, metavar="N", help="of each line (default: 1,000)")
    options = parser.parse_args()
    small = options.size == "small"
    spec = CitySpec(size=250.0 if small else 700.0)
    database = made_up_streets(spec, made_up(spec))
    count = options.queries or (5 if small else 1000)
    rows = []
    for degrees, ranges in itertools.product(reversed(DEGREES), (False, True)):
        rows.append(_row(database, degrees, count, ranges=ranges))
        print(_text(rows[-1]), flush=True)
    write_rows(options.out, rows)


def association_sum(weights: NDArray[np.float64]) -> float:
    """Return the logarithm of the sum over all one-to-one associations, exactly.

    Parameters
    ----------
    weights : ndarray, shape (objects, detections)
        Ratio of the likelihoods of each pair as a match, and as a miss and a false detection.

    Returns
    -------
    float
        The logarithm; the empty association counts as one.
    """
    # sums[subset]: sum over all associations of the first objects with exactly these detections.
    sums = np.zeros(2 ** weights.shape[1])
    sums[0] = 1.0
    for row in weights:
        before = sums.copy()
        for detection in np.flatnonzero(row).tolist():
            with_it, without = (part.reshape(-1, 2, 2**detection) for part in (sums, before))
            with_it[:, 1] += row[detection] * without[:, 0]
    return math.log(sums.sum())


@dataclass(frozen=True, eq=False)
class ExactPosterior:
    """The chances of all cells by Bayes' rule, for one noise model.

    Parameters
    ----------
    database : SignatureDatabase
        The cells, all equally likely before a query.
    """

    database: SignatureDatabase

    @cached_property
    def _views(self) -> VisibleObjects:
        return visible_objects_in(self.database, np.arange(len(self.database)))

    @cached_property
    def _table(self) -> NoiseTable:
        (table,), _ = database_tables(self.database, NOISE)
        return table

    @cached_property
    def near(self) -> NDArray[np.float32]:
        """Whether two cells are within 50 m of each other, 0 or 1, shape (n, n)."""
        xy = self.database.xy
        distances = np.hypot(*(xy[:, None, axis] - xy[None, :, axis] for axis in (0, 1)))
        return np.asarray(distances <= NEAR_M, np.float32)

    def loglik(self, query: Signature) -> NDArray[np.float64]:
        """Return the log-likelihood of each cell, exact, or -inf if the cell is negligible."""
        view = View.of(query)
        (photo,) = view.photos
        offsets, table = self._views.offsets, self._table
        kinds = table.row_of[self._views.codes]
        missed = 1.0 - table.detected[0, kinds] * self._inside(photo, table.sigma[kinds])
        hits = self._hits(view, kinds) / missed[:, None]
        false = table.clutter[table.query_rows(view)] / FULL_TURN
        if view.ranges is not None:
            false = false * 2.0 * (view.ranges / self.database.reach) ** 2
        weights = hits / false
        empty = np.add.reduceat(np.log(missed), offsets[:-1]) + np.log(false).sum()
        empty -= table.clutter.sum() * photo.width / FULL_TURN
        # If one object could be several detections, the sum would be this product: an upper bound.
        most = empty + np.log1p(np.add.reduceat(weights, offsets[:-1], axis=0)).sum(axis=1)
        loglik = np.full(len(most), -np.inf)
        best = -math.inf
        for cell in np.argsort(-most).tolist():
            if most[cell] < best - NEGLIGIBLE:
                break
            own = weights[offsets[cell] : offsets[cell + 1]]
            loglik[cell] = empty[cell] + association_sum(own)
            best = max(best, float(loglik[cell]))
        return loglik

    def _inside(self, photo: Photo, sigma: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the chance that the measured bearing of each object is in the sectors."""
        if not photo.sectors:
            return np.ones(len(sigma))
        inside = np.zeros(len(sigma))
        for edges in photo.sectors:
            low, high = (
                (edge - self._views.bearings[:, None] + LAPS) / sigma[:, None] for edge in edges
            )
            inside += (norm.cdf(high) - norm.cdf(low)).sum(axis=1)
        return inside

    def _hits(self, view: View, kinds: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the density of each detection for each object, 0 beyond 8 standard deviations."""
        table = self._table
        if view.bearings is None:
            raise ValueError("a query without bearings has no exact likelihood here")
        sigma = table.sigma[kinds][:, None]
        errors = signed_degrees(view.bearings - self._views.bearings[:, None])
        near = np.abs(errors) < 8.0 * sigma
        hits = np.where(near, norm.pdf(errors / sigma) / sigma, 0.0)
        hits *= table.detected[0, kinds][:, None] * table.named(0)[kinds][:, table.query_rows(view)]
        if view.ranges is not None:
            distances = np.maximum(self._views.distances, table.distances[0])[:, None]
            hits *= norm.pdf(np.log(view.ranges / distances) / RANGE_ERROR) / RANGE_ERROR
        return hits


def _row(database: SignatureDatabase, degrees: int, count: int, *, ranges: bool) -> dict[str, Any]:
    """Localize photos of a field of view in degrees, and return their figures."""
    exact = ExactPosterior(database)
    locator = LikelihoodLocator(index=build_index(database, NOISE), top=1)
    right, limit, stated, lengths = [], [], [], []
    for query in itertools.islice(_queries(database, degrees, ranges=ranges), count):
        signature = query.asked.signature
        loglik = exact.loglik(signature)
        chances = np.exp(loglik - np.logaddexp.reduce(loglik))
        masses = exact.near @ chances
        answer = locator.locate(signature).answer
        places = database.xy[int(masses.argmax())], (answer.x, answer.y)
        right.append([math.dist(place, query.xy) <= NEAR_M + 1e-6 for place in places])
        limit.append(float(masses.max()))
        stated.append(answer.mass)
        lengths.append(len(signature))
    bayes, ours = np.mean(right, axis=0).tolist()
    spread = float(np.std(limit) / math.sqrt(count))
    low, high = wilson_interval(ours, count)
    return {
        "city": MADE_UP,
        "cells": len(database),
        "degrees": degrees,
        "ranges": ranges,
        "queries": count,
        "detections": float(np.mean(lengths)),
        "limit": float(np.mean(limit)),
        "limit_error": spread,
        "bayes": bayes,
        "ours": ours,
        "low": low,
        "high": high,
        "stated": float(np.mean(stated)),
    }


def _queries(
    database: SignatureDatabase, degrees: int, *, ranges: bool
) -> Iterator[SimulatedQuery]:
    """Yield queries of cells, distorted by the noise model, with one to fourteen detections."""
    distances = f"ranges:{100 * RANGE_ERROR:g}, " if ranges else ""
    chain = parse_chain(f"detector:views, {distances}view:{degrees}", noises={NOISE.name: NOISE})
    for seed in itertools.count():
        spec = QuerySpec(number=len(database), seeds=(seed,), distortions=chain)
        for query in draw_queries(database, spec):
            if 0 < len(query.asked.signature) <= MOST:
                yield query


def _text(row: dict[str, Any]) -> str:
    """Return a row as text."""
    return (
        f"{row['degrees']} degrees{', ranges' * row['ranges']} (n={row['queries']}): at most "
        f"{row['limit']:.3f} +- {row['limit_error']:.3f}, by Bayes {row['bayes']:.3f}, ours "
        f"{row['ours']:.3f} ({row['low']:.3f}-{row['high']:.3f}), stated {row['stated']:.3f}"
    )


if __name__ == "__main__":
    main()
