"""Which detection is which object: chances and sums over all one-to-one associations.

A detection is one of the objects or clutter, an object is detected once or missed. Each pair has a
weight, how much likelier the two are one thing than a miss and clutter; the weight of an
association is the product over its pairs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.likelihood.noise.table import NoiseTable

WIDE = 45.0  # degrees of deviation from which on the tails meet behind the observer
LAPS = 360.0 * np.arange(-3, 4)


@dataclass(frozen=True, eq=False, kw_only=True)
class Pairs:
    """The pairs of an object and a detection that may be one thing, for several problems.

    The pairs of problem i are ``starts[i]:starts[i + 1]``. `objects` and `detections` are row
    numbers that run on over all problems, and `counts` says how many of each there are. `away` is
    the bearing of the detection less that of the object, in degrees in [-180, 180).
    """

    starts: NDArray[np.int64]
    objects: NDArray[np.int64]
    detections: NDArray[np.int64]
    away: NDArray[np.float64]
    counts: tuple[int, int]


@dataclass(frozen=True, eq=False, kw_only=True)
class Associations:
    """The chance that each pair is one thing, and the log of the sum of weights of each problem."""

    chances: NDArray[np.float64]
    log_sums: NDArray[np.float64]


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
    away = detection_bearings[detections] - object_bearings[objects]
    away = (away + 180.0) % 360.0 - 180.0
    near = np.abs(away) <= reach
    starts = np.concatenate([[0], np.cumsum(np.bincount(problem[near], minlength=len(here)))])
    return Pairs(
        starts=starts,
        objects=objects[near],
        detections=detections[near],
        away=away[near],
        counts=(len(object_bearings), len(detection_bearings)),
    )


def pair_weights(
    table: NoiseTable,
    pairs: Pairs,
    *,
    kinds: NDArray[np.int64],
    distances: NDArray[np.float64],
    lengths: NDArray[np.int64],
    names: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Return how much likelier each pair is one thing than a miss and clutter, shape (e,).

    The weight is ``p / (1 - p) * C * N / lambda``, in the notation of `likelihood.index`. By
    object, `kinds` is the row of its class in the table, `distances` its distance in metres and
    `lengths` how many objects are seen together with it, itself included. `names` is the class row
    of each detection, k if it is unknown.
    """
    kind = kinds[pairs.objects]
    length = np.minimum(lengths[pairs.objects], len(table.missed) - 1)
    turned = np.degrees(table.position_sigma / np.maximum(distances[pairs.objects], 1e-3))
    spread = np.minimum(np.hypot(table.sigma[kind], turned), 180.0)
    density = np.exp(-0.5 * (pairs.away / spread) ** 2)
    wide = spread > WIDE
    laps = (pairs.away[wide, None] + LAPS) / spread[wide, None]
    density[wide] = np.exp(-0.5 * laps**2).sum(axis=1)
    density /= spread * np.sqrt(2.0 * np.pi)
    naming = table.naming[length, kind, names[pairs.detections]]
    return np.asarray(table.odds[length, kind] * naming * density)


def associate_pairs(pairs: Pairs, weights: NDArray[np.float64]) -> Associations:
    """Sum over the one-to-one associations of each problem, given the weights of the pairs.

    Weights are 0 or more. Belief propagation (Williams and Lau, "Approximate evaluation of marginal
    association probabilities with belief propagation", 2014): exact if the pairs form no loop.
    """
    from semsig_gis.likelihood.kernels import associate  # noqa: PLC0415 - numba loads slowly

    chances = np.empty(len(weights))
    log_sums = np.empty(len(pairs.starts) - 1)
    associate(
        pairs.starts,
        pairs.objects,
        pairs.detections,
        np.ascontiguousarray(weights, dtype=np.float64),
        np.ones(pairs.counts[0]),
        np.ones(pairs.counts[1]),
        chances,
        log_sums,
    )
    return Associations(chances=chances, log_sums=log_sums)
