"""Intervals of confidence for chances, rates and deviations."""

from __future__ import annotations

import math
from statistics import NormalDist

from semsig_gis.errors import InputError

__all__ = [
    "binomial_tail",
    "log_interval",
    "poisson_interval",
    "quantile_ranks",
    "wilson_interval",
]


def wilson_interval(share: float, trials: float, *, percent: float = 95.0) -> tuple[float, float]:
    """Return Wilson's interval for a chance.

    Parameters
    ----------
    share : float
        Share of the trials that went well, 0 to 1.
    trials : float
        Number of trials, 0 or more, not necessarily whole.
    percent : float, default 95
        How often the interval shall hold the true chance, above 0 and below 100.

    Returns
    -------
    low, high : float
        The interval; all of 0 to 1 where there was no trial.

    Examples
    --------
    >>> [round(end, 3) for end in wilson_interval(0.9, 100)]
    [0.826, 0.945]
    """
    z = _deviations(percent)
    if trials <= 0:
        return 0.0, 1.0
    scale = 1.0 + z * z / trials
    middle = (share + z * z / (2.0 * trials)) / scale
    half = z * math.sqrt(share * (1.0 - share) / trials + (z / (2.0 * trials)) ** 2) / scale
    return max(middle - half, 0.0), min(middle + half, 1.0)


def poisson_interval(rate: float, trials: float, *, percent: float = 95.0) -> tuple[float, float]:
    """Return the score interval for a Poisson rate, in events a trial.

    The number of trials need not be whole; without any, the interval goes up to infinity.
    """
    z = _deviations(percent)
    if trials <= 0:
        return 0.0, math.inf
    middle = rate + z * z / (2.0 * trials)
    half = z * math.sqrt(rate / trials + (z / (2.0 * trials)) ** 2)
    return max(middle - half, 0.0), middle + half


def log_interval(value: float, deviation: float, *, percent: float = 95.0) -> tuple[float, float]:
    """Return an interval around a value above 0 that is even in the logarithm.

    `deviation` is the standard deviation of the natural logarithm.
    """
    factor = math.exp(min(_deviations(percent) * deviation, 700.0))
    return value / factor, value * factor


def quantile_ranks(size: int, share: float, *, percent: float = 95.0) -> tuple[int, int]:
    """Return the ranks, from 1, of the ordered values between which a quantile lies.

    They are the least and the largest where the sample is too small to say more. Whatever the
    distribution, the number of values below the quantile is binomial; here it is taken as normal.
    """
    half = _deviations(percent) * math.sqrt(size * share * (1.0 - share))
    low = math.floor(size * share - half)
    high = math.ceil(size * share + half) + 1
    return min(max(low, 1), size), max(min(high, size), 1)


def binomial_tail(hits: int, trials: int, chance: float) -> float:
    """Return the chance of so many hits or fewer; that of one hit is above 0 and below 1."""
    parts = (
        math.exp(
            math.lgamma(trials + 1)
            - math.lgamma(hit + 1)
            - math.lgamma(trials - hit + 1)
            + hit * math.log(chance)
            + (trials - hit) * math.log1p(-chance)
        )
        for hit in range(hits + 1)
    )
    return min(math.fsum(parts), 1.0)


def _deviations(percent: float) -> float:
    """Return how many standard deviations an interval reaches each way."""
    if not 0.0 < percent < 100.0:  # noqa: PLR2004
        msg = f"an interval of {percent} % was asked for; give a number between 0 and 100."
        raise InputError(msg)
    return NormalDist().inv_cdf(0.5 + percent / 200.0)
