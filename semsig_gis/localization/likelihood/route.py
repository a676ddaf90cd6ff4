"""Several views along a route: each place is a known way from the one before.

The chances of the views are multiplied, so the next view, twenty metres on, can settle what one
view leaves open. A step that is known to some metres blurs the chances before they are multiplied.
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
"""Chance that a leg is quite wrong, and the next place anywhere."""
LEAST_CHANCE = 1e-12  # cells below this, against the likeliest, do not move
LEAST_SHARE = 1e-6  # of the blur that is left out
REACH = 6.0  # standard deviations


def route_posteriors(
    database: SignatureDatabase,
    logliks: Sequence[ArrayLike],
    legs: Sequence[Leg],
    *,
    log_prior: NDArray[np.float64] | None = None,
) -> tuple[Posterior, ...]:
    """Return where each view of a route was taken, given all of them.

    Each view has its log-likelihood in every cell, and there is one leg fewer; `log_prior` is for
    the first view. This is the forward-backward recursion of a hidden Markov model over the cells:
    with likelihoods l and transitions T, ``a_k = l_k * (T_k' a_(k-1))`` and ``b_k = T_(k+1)
    (l_(k+1) * b_(k+1))``; the chances are proportional to ``a_k * b_k``.
    """
    if not logliks or len(legs) != len(logliks) - 1:
        raise InputError(
            f"{len(logliks)} views and {len(legs)} legs were given; give at least one view, and "
            "one leg between each view and the next."
        )
    first = posterior(database, logliks[0], log_prior=log_prior)
    likely = [first.chances, *(posterior(database, part).chances for part in logliks[1:])]
    size = len(database)
    forward = [likely[0]]
    for here, leg in zip(likely[1:], legs, strict=True):
        came = moved_chances(database, forward[-1], leg)
        both = here * ((1.0 - LOST) * came + LOST / size)
        forward.append(both / both.sum())
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
    return tuple(Posterior(database=database, chances=view) for view in reversed(chances))


def moved_chances(
    database: SignatureDatabase, chances: NDArray[np.float64], leg: Leg
) -> NDArray[np.float64]:
    """Return the chances of the cells after a leg; what leaves the cells of the database is lost.

    From anywhere in a cell, a way shorter than a cell leads to the same cell or the next one, each
    in proportion to the length of the way; the normal distribution of the leg blurs this further.
    """
    aside, aside_share = _axis_shares(leg.dx / database.grid.step, leg.sigma / database.grid.step)
    up, up_share = _axis_shares(leg.dy / database.grid.step, leg.sigma / database.grid.step)
    ids = database.cell_ids
    source = np.flatnonzero(chances > LEAST_CHANCE * chances.max(initial=0.0))
    moved = np.zeros(len(chances))
    for column, column_share in zip(aside, aside_share, strict=True):
        for row, row_share in zip(up, up_share, strict=True):
            target = ids[source] + (int(column) * ROW_SPAN + int(row))
            place = np.minimum(np.searchsorted(ids, target), len(ids) - 1)
            there = ids[place] == target
            moved[place[there]] += column_share * row_share * chances[source[there]]
    return moved


def _axis_shares(way: float, sigma: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return by how many cells one moves along an axis, and with which chances."""
    reach = REACH * sigma + 1.0
    cells = np.arange(math.floor(way - reach), math.ceil(way + reach) + 1)
    # The triangle of all differences of places in a cell, smoothed: a second difference.
    ramps = [_ramp(np.asarray(cells + (side - way)), sigma) for side in (-1.0, 0.0, 1.0)]
    shares = ramps[0] - 2.0 * ramps[1] + ramps[2]
    kept = shares > LEAST_SHARE * shares.max()
    return cells[kept].astype(np.int64), shares[kept] / shares[kept].sum()


def _ramp(x: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """Return ``max(x, 0)``, smoothed by a normal distribution."""
    if sigma == 0:
        return np.maximum(x, 0.0)
    below = np.array([0.5 * math.erfc(-value / (sigma * math.sqrt(2.0))) for value in x.tolist()])
    density = np.exp(-0.5 * (x / sigma) ** 2) / math.sqrt(2.0 * math.pi)
    return np.asarray(x * below + sigma * density)
