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
from semsig_gis.localization.likelihood.index import photo_power
from semsig_gis.localization.likelihood.photo import PhotoTable
from semsig_gis.localization.noise.table import WIDEST_SIGMA, extent_sigma
from semsig_gis.observation import View

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization.likelihood.index import LikelihoodIndex
    from semsig_gis.localization.noise.table import NoiseTable

PRIOR = 0.5
"""Chance that a view is from elsewhere before its objects are compared."""
MEAN_OBJECTS = 10.0
CLUMPING = 4.0
LOG_SECTORS = 3.0
"""Logarithm by which a view of sectors is likelier from the area than `PRIOR` says.

Photographs have too few objects to decide between the area and elsewhere. With it, photographs of
eight places of the Flatlandia data set that were asked of the other places were answered in 1 %,
and the answers to photographs of the area fell from 20 % to 19 %.
"""
LOG_PRIOR = math.log(PRIOR)
SIMULATED = 1000
"""Simulated views of a goodness of fit."""
ROUNDING = 1e-9
BINS = np.arange(FULL_TURN) + 0.5  # middles of degrees


def area_chances(log_ratios: Sequence[float]) -> NDArray[np.float64]:
    """Return the chance that a view is from each of some areas, and at last from elsewhere.

    `log_ratios` are those of `evidence_ratio`. Before the objects are compared, the areas together
    have the chance that `PRIOR` leaves, in equal parts.
    """
    logs = np.append(np.asarray(log_ratios) + math.log((1.0 - PRIOR) / len(log_ratios)), LOG_PRIOR)
    chances = np.exp(logs - logs.max())
    return np.asarray(chances / chances.sum())


def evidence_ratio(
    index: LikelihoodIndex, views: Sequence[Signature], log_evidence: float
) -> float:
    """Return the log of the likelihood of some views in the area of a database over elsewhere.

    `log_evidence` is that of all of them in the area (`Posterior.log_evidence`). Views without
    objects give 0.
    """
    if not any(map(len, views)):
        return 0.0
    sectors = any(photo.sectors for view in views for photo in View.of(view).photos)
    background = sum(background_loglik(index, view) for view in views)
    return log_evidence - background + (LOG_SECTORS if sectors else 0.0)


def background_loglik(index: LikelihoodIndex, query: Signature) -> float:
    """Return the log-likelihood of a view in some street elsewhere (see the module).

    It is in the units of `LikelihoodIndex.scores`. The classes are those that the database sees.
    """
    view, table = View.of(query), index.table
    if view.bearings is None:
        counts = np.bincount(table.query_rows(view))
        unknown = int(counts[len(table.codes) :].sum())
        # The likelihood is that of numbers by class, not of one object after the other.
        total = _number_log(len(view), 1.0) - sum(map(_log_factorial, counts.tolist()))
        parts = (unknown, len(view) - unknown)
        total += sum(part * math.log(part / len(view)) for part in parts if part)
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
    return total * photo_power(len(photos), index.noise)


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

    They have as many objects in each photo, and are `SIMULATED` in number. `headings` are the
    degrees to add to the bearings of each photo. Types and bearings are compared, each object for
    itself. None without objects or bearings.
    """
    view = View.of(query)
    if view.bearings is None or not len(view):
        return None
    models, weights = index.models
    densities = [_density(index.database, table, cell) for table in models]
    mean = np.tensordot(weights, densities, axes=1)
    counts = np.diff(np.rint(SIMULATED * np.cumsum([0.0, *weights])).astype(np.int64))
    total, simulated = 0.0, np.zeros(SIMULATED)
    random = np.random.default_rng(0)
    for photo, heading in zip(view.split(), headings, strict=True):
        detections = PhotoTable.of(photo, index.table)
        look = photo.photos[0].turned(heading)
        inside = look.sees(BINS) if look.sectors else np.ones(len(BINS), np.bool_)
        if not inside.any():  # the sectors are narrower than a degree
            inside[int(sum(look.sectors[0]) / 2.0) % len(BINS)] = True
        rows = ((detections.bearings + heading) % FULL_TURN).astype(np.int64)
        errors = detections.bearing_errors.tolist()
        means, sums, logs_of = {}, {}, {}  # by error
        for error in {*errors}:
            means[error], *parts = (_blurred(values, error) for values in (mean, *densities))
            sums[error] = [np.cumsum(part[:, inside]) for part in parts]
            logs_of[error] = np.log(means[error])
        for row, error, scores in zip(rows.tolist(), errors, detections.scores.T, strict=True):
            blurred_mean, logs = means[error], logs_of[error]
            # Of an unknown class, or any of some, only the direction is compared.
            choices = scores > 0.0
            same = (scores[choices] == scores[choices][0]).all()
            share = scores[choices][0] if same else 1.0
            total += math.log(scores @ blurred_mean[:, row] / share)
            bins = []
            for chances, count in zip(sums[error], counts.tolist(), strict=True):
                bins.append(np.searchsorted(chances, random.random(count) * chances[-1]))
            if (same and choices.sum() > 1) or choices.all():
                any_of_them = np.log(blurred_mean[choices].sum(axis=0))
                logs = np.where(choices[:, None], any_of_them, logs)
            simulated += logs[:, inside].ravel()[np.concatenate(bins)]
    return float(np.mean(simulated <= total + ROUNDING))


def _blurred(density: NDArray[np.float64], error: float) -> NDArray[np.float64]:
    """Return a density by degree of a turn with an error of bearings in degrees added."""
    if error == 0.0:
        return density
    harmonics = np.arange(len(BINS) // 2 + 1)
    less = np.exp(-0.5 * (harmonics * math.radians(error)) ** 2)
    blurred = np.fft.irfft(np.fft.rfft(density) * less, len(BINS))
    return np.asarray(np.maximum(blurred, density.min(axis=-1, keepdims=True)))


def _density(database: SignatureDatabase, table: NoiseTable, cell: int) -> NDArray[np.float64]:
    """Return the expected detections in a cell, by name and degree, of a full turn."""
    part = slice(database.offsets[cell], database.offsets[cell + 1])
    kinds, units = table.row_of[database.codes[part]], database.distance_units[part]
    length = min(len(kinds), len(table.detected) - 1)
    near, names = table.detected[length, kinds], table.named(length)[kinds]
    bearings = database.bearing_units[part, None] * (FULL_TURN / BEARING_UNITS)
    sigmas = table.sigmas[kinds, units]
    if database.extents is not None:
        sigmas = np.minimum(np.hypot(sigmas, extent_sigma(database.extents[part])), WIDEST_SIGMA)
    away = signed_degrees(BINS - bearings) / sigmas[:, None]
    peaks = np.exp(-0.5 * away**2)
    peaks *= (near * table.remaining[kinds, units] / peaks.sum(axis=1))[:, None]
    # Clutter, and objects that come into range in any direction.
    others = table.clutter + (near * table.leaving[kinds, units]) @ names
    return np.asarray(names.T @ peaks + others[:, None] / len(BINS))
