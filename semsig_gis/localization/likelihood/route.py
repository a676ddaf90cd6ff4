"""Combine the views of a route: the step from each place to the next is known.

The probabilities of the views are multiplied, so a second view, twenty metres further, can decide
between places that look the same. The uncertainty of a step blurs the probabilities before.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import ROW_SPAN, InputError
from semsig_gis.localization.likelihood.posterior import Posterior, posterior
from semsig_gis.observation import Leg

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.database import SignatureDatabase

LOST = 1e-6
"""Probability that a leg is wrong and the next place is anywhere."""
_LEAST_MOVED_CHANCE = 1e-12  # relative to the likeliest cell; cells below are not moved
_LEAST_BLUR_SHARE = 1e-6  # relative to the largest share; shares below are left out
_BLUR_SIGMAS = 6.0  # the blur is cut off at this many standard deviations


def route_posteriors(
    database: SignatureDatabase,
    logliks: Sequence[ArrayLike],
    legs: Sequence[Leg],
    *,
    log_prior: NDArray[np.float64] | None = None,
) -> tuple[Posterior, ...]:
    """Return the posterior of the place of each view of a route, given all views.

    `logliks` has one array per view, by cell; there is one leg fewer. `log_prior` is for the first
    view. This is the forward-backward algorithm of a hidden Markov model over the cells: with
    likelihoods l and transitions T, ``a_k = l_k * (T_k' a_(k-1))`` and ``b_k = T_(k+1) (l_(k+1) *
    b_(k+1))``; the probabilities are proportional to ``a_k * b_k``.
    """
    if not logliks or len(legs) != len(logliks) - 1:
        raise InputError(
            f"{len(logliks)} views and {len(legs)} legs were given; give at least one view, and "
            "one leg between each view and the next."
        )
    first = posterior(database, logliks[0], log_prior=log_prior)
    views = [first, *(posterior(database, part) for part in logliks[1:])]
    likely = [view.chances for view in views]
    size = len(database)
    # Forward: from the first view to the last.
    forward, log_evidence = [likely[0]], first.log_evidence
    for here, leg in zip(views[1:], legs, strict=True):
        came = moved_chances(database, forward[-1], leg)
        both = here.chances * ((1.0 - LOST) * came + LOST / size)
        log_evidence += here.log_evidence + math.log(size * both.sum())
        forward.append(both / both.sum())
    # Backward: from the last view to the first, with reversed legs.
    backward = np.ones(size)
    chances = [forward[-1]]
    for row in range(len(legs) - 1, -1, -1):
        leg = legs[row]
        ahead = likely[row + 1] * backward
        ahead /= ahead.sum()
        back = moved_chances(database, ahead, Leg(dx=-leg.dx, dy=-leg.dy, sigma=leg.sigma))
        backward = (1.0 - LOST) * back + LOST / size
        both = forward[row] * backward
        chances.append(both / both.sum())
    return tuple(
        Posterior(database=database, chances=view, log_evidence=log_evidence)
        for view in reversed(chances)
    )


def moved_chances(
    database: SignatureDatabase, chances: NDArray[np.float64], leg: Leg
) -> NDArray[np.float64]:
    """Return the probabilities of the cells after a leg; those outside the database are lost.

    The place is uniform in its cell, so a leg shorter than a cell ends in the same cell or the next
    one, in proportion to its length. The normal distribution of the leg adds a blur.
    """
    across, across_share = _axis_shares(leg.dx / database.grid.step, leg.sigma / database.grid.step)
    up, up_share = _axis_shares(leg.dy / database.grid.step, leg.sigma / database.grid.step)
    ids = database.cell_ids
    source = np.flatnonzero(chances > _LEAST_MOVED_CHANCE * chances.max(initial=0.0))
    result = np.zeros(len(chances))
    for column, column_share in zip(across, across_share, strict=True):
        for row, row_share in zip(up, up_share, strict=True):
            target = ids[source] + (int(column) * ROW_SPAN + int(row))
            rows = np.minimum(np.searchsorted(ids, target), len(ids) - 1)
            inside = ids[rows] == target
            result[rows[inside]] += column_share * row_share * chances[source[inside]]
    return result


def _axis_shares(length: float, sigma: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the steps along an axis, in cells, and their probabilities, for a leg in cells."""
    reach = _BLUR_SIGMAS * sigma + 1.0
    cells = np.arange(math.floor(length - reach), math.ceil(length + reach) + 1)
    # The smoothed triangular distribution of differences is a second difference of ramps.
    ramps = [_ramp(np.asarray(cells + (side - length)), sigma) for side in (-1.0, 0.0, 1.0)]
    shares = ramps[0] - 2.0 * ramps[1] + ramps[2]
    large = shares > _LEAST_BLUR_SHARE * shares.max()
    return cells[large].astype(np.int64), shares[large] / shares[large].sum()


def _ramp(x: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """Return ``max(x, 0)`` convolved with a normal distribution."""
    if sigma == 0:
        return np.maximum(x, 0.0)
    below = np.array([0.5 * math.erfc(-value / (sigma * math.sqrt(2.0))) for value in x.tolist()])
    density = np.exp(-0.5 * (x / sigma) ** 2) / math.sqrt(2.0 * math.pi)
    return np.asarray(x * below + sigma * density)
