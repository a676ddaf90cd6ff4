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

    from semsig_gis.noise_table import NoiseTable

__all__ = ["Associations", "Pairs", "associate_pairs", "near_pairs", "pair_weights"]

WIDE = 45.0  # degrees of deviation from which on the tails meet behind the observer
LAPS = 360.0 * np.arange(-3, 4)


@dataclass(frozen=True, eq=False, kw_only=True)
class Pairs:
    """The pairs of an object and a detection that may be one thing, for several problems.

    Parameters
    ----------
    starts : ndarray of int64, shape (s + 1,)
        Where the pairs of each problem begin.
    objects, detections : ndarray of int64, shape (e,)
        Rows of the two, counted through over all problems.
    away : ndarray of float64, shape (e,)
        Bearing of the detection less that of the object, in [-180, 180).
    counts : tuple of int
        How many objects and detections there are in all.
    """

    starts: NDArray[np.int64]
    objects: NDArray[np.int64]
    detections: NDArray[np.int64]
    away: NDArray[np.float64]
    counts: tuple[int, int]


@dataclass(frozen=True, eq=False, kw_only=True)
class Associations:
    """The sums over the associations.

    Parameters
    ----------
    chances : ndarray of float64, shape (e,)
        For each pair, the chance that the two are one thing.
    log_sums : ndarray of float64, shape (s,)
        For each problem, the logarithm of the sum of the weights of all associations.
    """

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
    """Return every pair of an object and a detection in about the same direction.

    Parameters
    ----------
    object_starts : ndarray of int64, shape (s + 1,)
        Where the objects of each problem begin.
    object_bearings : ndarray of float64, shape (objects,)
        Degrees.
    detection_starts : ndarray of int64, shape (s + 1,)
        Where the detections of each problem begin.
    detection_bearings : ndarray of float64, shape (detections,)
        Degrees.
    reach : float, default 180
        Largest difference of bearings, in degrees.

    Returns
    -------
    Pairs
        The pairs, ordered by problem and object.

    Examples
    --------
    >>> pairs = near_pairs(
    ...     np.array([0, 2]), np.array([10.0, 90.0]), np.array([0, 1]), np.array([350.0]), reach=30
    ... )
    >>> pairs.objects.tolist(), pairs.detections.tolist(), pairs.away.tolist()
    ([0], [0], [-20.0])
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
    """Return how much likelier each pair is one thing than a miss and clutter.

    Parameters
    ----------
    table : NoiseTable
        The noise model.
    pairs : Pairs
        The pairs.
    kinds : ndarray of int64, shape (objects,)
        Row of the class of each object in the table.
    distances : ndarray of float64, shape (objects,)
        Its distance in metres.
    lengths : ndarray of int64, shape (objects,)
        How many objects are seen together with it, itself among them.
    names : ndarray of int64, shape (detections,)
        Row of the class of each detection; one more than the last class where it is not known.

    Returns
    -------
    ndarray of float64, shape (e,)
        ``p / (1 - p) * C * N / lambda``.
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
    """Sum over the one-to-one associations of each problem.

    Parameters
    ----------
    pairs : Pairs
        The pairs that may be one thing.
    weights : ndarray of float64, shape (e,)
        Weight of each, 0 or more.

    Returns
    -------
    Associations
        Chances and sums.

    Notes
    -----
    Belief propagation (Williams and Lau, "Approximate evaluation of marginal association
    probabilities with belief propagation", 2014): exact where the pairs form no loop.

    Examples
    --------
    >>> both = np.array([0, 1]), np.array([0.0]), np.array([0, 1]), np.array([0.0])
    >>> found = associate_pairs(near_pairs(*both), np.array([3.0]))
    >>> found.chances.tolist(), np.exp(found.log_sums).round(6).tolist()
    ([0.75], [4.0])
    """
    from semsig_gis._association_kernel import associate  # noqa: PLC0415 - numba loads slowly

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
