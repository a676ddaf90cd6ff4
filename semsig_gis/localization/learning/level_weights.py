"""The levels at which a detector worked in the photos of some samples."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.localization.likelihood.association import associate
from semsig_gis.localization.noise.levels import MOST_DETECTION, Level

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.localization.learning.fit import Evidence
    from semsig_gis.localization.noise.table import NoiseTable

DETECTIONS = (0.45, 1.0, 1.9)
REACHES = (0.65, 1.0, 1.5)
LEAST_WEIGHT = 0.06
ROUNDS = 200
LEAST_GAIN = 0.02
"""Gain in the log-likelihood of a photo for which levels are worth their time."""


def detection_levels(evidence: Evidence, model: NoiseTable, *, fading: bool) -> tuple[Level, ...]:
    """Return the levels of detection with their weights, by expectation-maximisation.

    The levels are a grid of factors of the chance of detection and, if it falls with distance, of
    the reach; those of small weight are left out. The result is the plain level if the others
    explain the samples hardly better.
    """
    grid = list(product(DETECTIONS, REACHES if fading else (1.0,)))
    lengths = np.zeros(len(evidence.views), np.int64)
    logs = np.full((len(grid), len(evidence.exposures)), -np.inf)
    for row, factors in enumerate(grid):
        association = associate(
            _at_level(model, *factors),
            evidence.views,
            evidence.detections,
            evidence.pairs,
            lengths=lengths,
        )
        np.logaddexp.at(logs[row], evidence.photos, association.loglik + evidence.log_weights)
    weights = np.full(len(grid), 1.0 / len(grid))
    for _ in range(ROUNDS):
        joint = logs + np.log(weights)[:, None]
        sums = np.logaddexp.reduce(joint, axis=0)
        weights = np.maximum(np.exp(joint - sums).mean(axis=1), 1e-12)
    plain = logs[grid.index((1.0, 1.0))]
    if (sums - plain).mean() < LEAST_GAIN:
        return (Level(weight=1.0),)
    return tuple(
        Level(weight=weight, detection=detection, reach=reach)
        for (detection, reach), weight in zip(grid, weights.tolist(), strict=True)
        if weight >= LEAST_WEIGHT
    )


def _at_level(model: NoiseTable, detection: float, reach: float) -> NoiseTable:
    """Return the table of a level, as `level_mixture` makes it from a specification."""
    steps = model.scale.steps
    near = 1.0 - model.missed
    fading: NDArray[np.float64] = np.stack(
        [np.interp(steps / reach, steps, row) for row in model.fading]
    )
    return replace(
        model,
        missed=1.0 - np.minimum(near * detection, np.maximum(near, MOST_DETECTION)),
        clutter=model.clutter * detection,
        fading=fading,
    )
