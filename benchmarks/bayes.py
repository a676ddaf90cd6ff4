"""Measure what no method can pass: ``python -m benchmarks.bayes``.

In a made-up city of some thousand cells, the likelihood of every cell is summed exactly over all
one-to-one associations of what is seen with what is there, by the noise that spoils the queries.
Its chances are those that Bayes' rule gives, and the best place by them is right as often as any
can be. Beside it stands what the likelihood method finds, for the same queries of a full turn, of
120 and of 70 degrees, without and with rough distances. Results go to ``benchmarks/bayes.json``.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import norm

from benchmarks._cities import MADE_UP, made_up, made_up_streets
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
MOST = 14  # detections of a query: the sums over their subsets are kept
NEGLIGIBLE = 30.0  # nats below the best cell, from which on a cell is left out
LAPS = 360.0 * np.arange(-2, 3)


def main() -> None:
    """Read the options, measure, print and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bayes", description=__doc__)
    parser.add_argument("--size", choices=["full", "small"], default="full")
    parser.add_argument("--queries", type=int, metavar="N", help="of each line (default: 1,000)")
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name("bayes.json"))
    options = parser.parse_args()
    small = options.size == "small"
    spec = CitySpec(size=250.0 if small else 700.0)
    database = made_up_streets(spec, made_up(spec))
    wanted = options.queries or (5 if small else 1000)
    rows = []
    for degrees, ranges in itertools.product(reversed(DEGREES), (False, True)):
        rows.append(_row(database, degrees, wanted, ranges=ranges))
        print(_text(rows[-1]), flush=True)
    options.out.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")


def association_sum(weights: NDArray[np.float64]) -> float:
    """Return the logarithm of the sum over all one-to-one associations, exactly.

    Parameters
    ----------
    weights : ndarray, shape (objects, detections)
        How much likelier each pair is one thing than a miss and a false detection.

    Returns
    -------
    float
        The logarithm; the empty association counts as one.
    """
    # By subset of the detections: the sum over all ways in which the objects so far are just these.
    sums = np.zeros(2 ** weights.shape[1])
    sums[0] = 1.0
    for row in weights:
        before = sums.copy()
        for one in np.flatnonzero(row).tolist():
            with_it, without = (part.reshape(-1, 2, 2**one) for part in (sums, before))
            with_it[:, 1] += row[one] * without[:, 0]
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
        """Which cells are within 50 m of which, shape (n, n)."""
        xy = self.database.xy
        away = np.hypot(*(xy[:, None, axis] - xy[None, :, axis] for axis in (0, 1)))
        return np.asarray(away <= NEAR_M, np.float32)

    def loglik(self, query: Signature) -> NDArray[np.float64]:
        """Return the log-likelihood of each cell, exact where it may matter, otherwise -inf."""
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
        # Where one object may be several detections, the sum is a product, and never smaller.
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
        """Return how likely the bearing of each object comes out in the sectors."""
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
        """Return the density of each object being each detection, 0 far beyond the noise."""
        table = self._table
        if view.bearings is None:
            raise ValueError("a query without bearings has no exact likelihood here")
        sigma = table.sigma[kinds][:, None]
        away = signed_degrees(view.bearings - self._views.bearings[:, None])
        near = np.abs(away) < 8.0 * sigma
        hits = np.where(near, norm.pdf(away / sigma) / sigma, 0.0)
        hits *= table.detected[0, kinds][:, None] * table.named[0][kinds][:, table.query_rows(view)]
        if view.ranges is not None:
            distances = np.maximum(self._views.distances, table.distances[0])[:, None]
            hits *= norm.pdf(np.log(view.ranges / distances) / RANGE_ERROR) / RANGE_ERROR
        return hits


def _row(database: SignatureDatabase, degrees: int, wanted: int, *, ranges: bool) -> dict[str, Any]:
    """Ask for photos of so many degrees, and return what came of them."""
    exact = ExactPosterior(database)
    locator = LikelihoodLocator(index=build_index(database, NOISE), top=1)
    right, limit, stated, lengths = [], [], [], []
    for query in itertools.islice(_queries(database, degrees, ranges=ranges), wanted):
        asked = query.asked.signature
        loglik = exact.loglik(asked)
        chances = np.exp(loglik - np.logaddexp.reduce(loglik))
        masses = exact.near @ chances
        found = locator.locate(asked)
        places = database.xy[int(masses.argmax())], (found.answer.x, found.answer.y)
        right.append([math.dist(place, query.xy) <= NEAR_M + 1e-6 for place in places])
        limit.append(float(masses.max()))
        stated.append(found.answer.mass)
        lengths.append(len(asked))
    (bayes, ours), count = np.mean(right, axis=0).tolist(), len(right)
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
    """Yield queries from cells that are seen by the noise and have one to fourteen detections."""
    told = f"ranges:{100 * RANGE_ERROR:g}, " if ranges else ""
    chain = parse_chain(f"detector:views, {told}view:{degrees}", noises={NOISE.name: NOISE})
    for seed in itertools.count():
        spec = QuerySpec(number=len(database), seeds=(seed,), distortions=chain)
        for query in draw_queries(database, spec):
            if 0 < len(query.asked.signature) <= MOST:
                yield query


def _text(row: dict[str, Any]) -> str:
    """Return a line for people."""
    return (
        f"{row['degrees']} degrees{', ranges' * row['ranges']} (n={row['queries']}): at most "
        f"{row['limit']:.3f} +- {row['limit_error']:.3f}, by Bayes {row['bayes']:.3f}, ours "
        f"{row['ours']:.3f} ({row['low']:.3f}-{row['high']:.3f}), stated {row['stated']:.3f}"
    )


if __name__ == "__main__":
    main()
