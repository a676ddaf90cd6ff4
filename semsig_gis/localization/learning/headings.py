"""Photos of uncertain north among the samples of a noise model.

The likelihood of such a photo is an integral over the angles by which its north may be off. It is
approximated by a weighted sum over some angles (importance sampling), chosen from a first model.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import HALF_TURN
from semsig_gis.localization.learning.fit import PAIR_DEGREES
from semsig_gis.localization.likelihood.association import Detections, near_pairs
from semsig_gis.localization.likelihood.photo import PhotoTable, photo_loglik
from semsig_gis.localization.likelihood.turns import turn_logs
from semsig_gis.observation import View

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import VisibleObjects
    from semsig_gis.localization.learning.fit import Evidence
    from semsig_gis.localization.noise.table import NoiseTable

ANGLES = 16  # of a photo of uncertain north
FARTHEST = 4.0  # deviations of north
LEAST_STEP, MOST_STEP = 0.25, 3.0  # degrees


def turned_evidence(
    evidence: Evidence, detected: Sequence[Signature], model: NoiseTable, *, north_sigma: float
) -> Evidence:
    """Return the evidence with each photo of uncertain north at the angles likely under a model.

    The evidence and the detections are as in `gather_evidence`; `north_sigma`, in degrees, is that
    of photos without one of their own.
    """
    parts = [part for view in detected for part in View.of(view).split()]
    step = float(np.clip(np.median(model.sigma) / 2.0, LEAST_STEP, MOST_STEP))
    turns, logs = [], []
    for row, part in enumerate(parts):
        own = part.photos[0].north_sigma
        sigma = north_sigma if own is None else own
        if sigma == 0:
            turns.append(np.zeros(1))
            logs.append(np.zeros(1))
            continue
        edges = np.linspace(-1.0, 1.0, 2 * math.ceil(min(HALF_TURN, FARTHEST * sigma) / step) + 1)
        edges *= min(HALF_TURN, FARTHEST * sigma)
        middles = (edges[1:] + edges[:-1]) / 2.0
        prior = turn_logs(middles, 1.0, sigma)[None]
        photo, place = PhotoTable.of(part, model), _views_of(evidence.views, np.array([row]))
        scores = prior + photo_loglik(
            photo, place, [model], np.ones(1), turns=middles[None], log_prior=prior
        )
        chances = np.exp(scores[0] - np.logaddexp.reduce(scores[0]))
        ends = np.cumsum(chances)
        # One angle for each equal part of the chance; its weight undoes how it was chosen.
        quantiles = (np.arange(ANGLES) + 0.5) / ANGLES * ends[-1]
        turns.append(np.interp(quantiles, np.append(0.0, ends), edges))
        picked = chances[np.searchsorted(ends, quantiles)] / (edges[1] - edges[0])
        logs.append(turn_logs(turns[-1], 1.0, sigma) - np.log(picked * ANGLES))
    photos = np.repeat(np.arange(len(parts)), [len(angles) for angles in turns])
    views = _views_of(evidence.views, photos)
    looks = zip(photos.tolist(), np.concatenate(turns).tolist(), strict=True)
    detections = Detections.of([parts[row].turned(turn) for row, turn in looks], model)
    starts, bearings = detections.starts, detections.bearings
    return replace(
        evidence,
        views=views,
        detections=detections,
        pairs=near_pairs(views.offsets, views.bearings, starts, bearings, reach=PAIR_DEGREES),
        photos=photos,
        log_weights=np.concatenate(logs),
    )


def _views_of(views: VisibleObjects, rows: NDArray[np.int64]) -> VisibleObjects:
    """Return the visible objects of some places, which may occur several times."""
    lengths = views.lengths[rows]
    ends = np.cumsum(lengths)
    entries = np.repeat(views.offsets[rows] - ends + lengths, lengths) + np.arange(ends[-1])
    return replace(
        views,
        offsets=np.append(0, ends),
        objects=views.objects[entries],
        codes=views.codes[entries],
        bearings=views.bearings[entries],
        distances=views.distances[entries],
    )
