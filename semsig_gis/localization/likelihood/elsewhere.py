"""The chance that a view is not from the area of a database.

The chances of the cells assume that the view is from one of them. Two explanations of the view are
compared: a cell of the database, and some street elsewhere. The likelihood of the first is the mean
over the cells (`Posterior.log_evidence`). A street elsewhere shows a number n of objects with
chance ``(1 - q) * q**n``, of mean `MEAN_OBJECTS`, in any direction with equal chance. Their classes
come in clumps: with c objects of a class among the first m, the next is of this class with chance
``(c + CLUMPING * share) / (m + CLUMPING)``. The `share` is half that of the class in the database
and half that of all classes in equal parts.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import BEARING_UNITS, FULL_TURN, signed_degrees
from semsig_gis.localization.likelihood.photo import PhotoTable
from semsig_gis.observation import View

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.core import Signature
    from semsig_gis.localization.likelihood.index import LikelihoodIndex

PRIOR = 0.5
"""Chance that a view is from elsewhere before its objects are compared."""
MEAN_OBJECTS = 10.0
CLUMPING = 4.0
LARGEST_LOG = 700.0  # its exponential is finite
SIMULATED = 1000
"""Simulated views of a goodness of fit."""
ROUNDING = 1e-9


def elsewhere_chance(
    index: LikelihoodIndex, views: Sequence[Signature], log_evidence: float
) -> float:
    """Return the chance that some views, all of one area, are not from the area of a database.

    `log_evidence` is the logarithm of their likelihood in the database (`Posterior.log_evidence`).
    Views without objects leave the chance before, `PRIOR`.
    """
    if not any(map(len, views)):
        return PRIOR
    ratio = log_evidence - sum(background_loglik(index, view) for view in views)
    odds = math.exp(min(max(ratio, -LARGEST_LOG), LARGEST_LOG)) * (1.0 - PRIOR) / PRIOR
    return 1.0 / (1.0 + odds)


def background_loglik(index: LikelihoodIndex, query: Signature) -> float:
    """Return the log-likelihood of a view in some street elsewhere (see the module).

    It is in the units of `LikelihoodIndex.scores`. The classes are those that the database sees.
    """
    view, table = View.of(query), index.table
    if view.bearings is None:
        counts = np.bincount(table.query_rows(view))
        known = len(view) - int(counts[len(table.codes) :].sum())
        # The likelihood is that of numbers by class, not of one object after the other.
        total = _number_log(len(view), 1.0) - sum(map(_log_factorial, counts.tolist()))
        total += sum(
            number * math.log(number / len(view)) for number in (known, len(view) - known) if number
        )
        view = View(view.codes, np.zeros(len(view)))
        photos = [PhotoTable.of(view, table)]
    else:
        photos = [PhotoTable.of(photo, table) for photo in view.split()]
        total = 0.0
        for photo in photos:
            total += _number_log(len(photo.bearings), photo.width)
            total += float(np.log(photo.disc / (FULL_TURN * photo.width)).sum())
    occurrences = index.database.occurrences[table.codes]
    weights = CLUMPING * 0.5 * (occurrences / occurrences.sum() + 1.0 / len(table.codes))
    for scores in np.concatenate([photo.scores for photo in photos], axis=1).T:
        likely = weights * scores
        total += math.log(likely.sum() / weights.sum())
        weights = weights + likely / likely.sum()
    return total


def _number_log(number: int, width: float) -> float:
    """Return the log of the chance of a number of objects on a share of the turn, times n!."""
    mean = MEAN_OBJECTS * width
    return number * math.log(mean / (1.0 + mean)) - math.log1p(mean) + _log_factorial(number)


def _log_factorial(number: int) -> float:
    return math.lgamma(number + 1.0)


def goodness_of_fit(
    index: LikelihoodIndex, query: Signature, cell: int, headings: Sequence[float]
) -> float | None:
    """Return the share of simulated views from a cell that fit it worse than a view, or equally.

    They have as many objects in each photo, are `SIMULATED` in number, and are drawn from the mean
    noise model. `headings` are the degrees to add to the bearings of each photo. Types and bearings
    are compared, each object for itself. None without objects or bearings.
    """
    view, table, database = View.of(query), index.table, index.database
    if view.bearings is None or not len(view):
        return None
    part = slice(database.offsets[cell], database.offsets[cell + 1])
    kinds = table.row_of[database.codes[part]]
    units = database.distance_units[part]
    length = min(len(kinds), len(table.detected) - 1)
    near = table.detected[length, kinds]
    expected = near * table.remaining[kinds, units]
    # Density by direction and name: of the objects, of others that come into range, and of clutter.
    bins = np.arange(FULL_TURN) + 0.5
    away = signed_degrees(bins - database.bearing_units[part, None] * (FULL_TURN / BEARING_UNITS))
    spread = table.sigmas[kinds, units][:, None]
    peaks = np.exp(-0.5 * (away / spread) ** 2)
    peaks *= (expected / peaks.sum(axis=1))[:, None]
    names = table.named[length, kinds]
    floor = table.clutter + (near * table.leaving[kinds, units]) @ names
    density = names.T @ peaks + floor[:, None] / len(bins)
    total, simulated = 0.0, np.zeros(SIMULATED)
    random = np.random.default_rng(0)
    for photo, heading in zip(view.split(), headings, strict=True):
        detections = PhotoTable.of(photo, table)
        (look,) = photo.photos
        seen = np.flatnonzero(look.turned(heading).sees(bins)) if look.sectors else slice(None)
        rows = ((detections.bearings + heading) % FULL_TURN).astype(np.int64)
        for row, scores in zip(rows.tolist(), detections.scores.T, strict=True):
            # Of an object of unknown class, only the direction is compared.
            named = density if not scores.all() else density.sum(axis=0, keepdims=True)
            total += math.log(scores @ density[:, row])
            logs = np.log(named[:, seen].ravel())
            chances = np.cumsum(np.exp(logs))
            simulated += logs[np.searchsorted(chances, random.random(SIMULATED) * chances[-1])]
    return float(np.mean(simulated <= total + ROUNDING))
