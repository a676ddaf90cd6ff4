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
    """Return the score interval for a Poisson rate.

    Parameters
    ----------
    rate : float
        Events a trial, 0 or more.
    trials : float
        Number of trials, 0 or more, not necessarily whole.
    percent : float, default 95
        How often the interval shall hold the true rate.

    Returns
    -------
    low, high : float
        The interval; up to infinity where there was no trial.

    Examples
    --------
    >>> [round(end, 3) for end in poisson_interval(2.0, 100)]
    [1.741, 2.297]
    """
    z = _deviations(percent)
    if trials <= 0:
        return 0.0, math.inf
    middle = rate + z * z / (2.0 * trials)
    half = z * math.sqrt(rate / trials + (z / (2.0 * trials)) ** 2)
    return max(middle - half, 0.0), middle + half


def log_interval(value: float, deviation: float, *, percent: float = 95.0) -> tuple[float, float]:
    """Return an interval that is even in the logarithm.

    Parameters
    ----------
    value : float
        Above 0.
    deviation : float
        Standard deviation of its logarithm.
    percent : float, default 95
        How often the interval shall hold the true value.

    Returns
    -------
    low, high : float
        The interval.

    Examples
    --------
    >>> [round(end, 3) for end in log_interval(5.0, 0.1)]
    [4.11, 6.083]
    """
    factor = math.exp(min(_deviations(percent) * deviation, 700.0))
    return value / factor, value * factor


def quantile_ranks(size: int, share: float, *, percent: float = 95.0) -> tuple[int, int]:
    """Return between which values of an ordered sample a quantile lies.

    Parameters
    ----------
    size : int
        How many values there are, at least 1.
    share : float
        Share of all values that are below the quantile, above 0 and below 1.
    percent : float, default 95
        How often the interval shall hold the true quantile.

    Returns
    -------
    low, high : int
        Ranks from 1; the least and the largest where the sample is too small to say more.

    Notes
    -----
    Whatever the distribution, the number of values below the quantile is binomial; here it is
    taken as normal.

    Examples
    --------
    >>> quantile_ranks(100, 0.5)
    (40, 61)
    """
    half = _deviations(percent) * math.sqrt(size * share * (1.0 - share))
    low = math.floor(size * share - half)
    high = math.ceil(size * share + half) + 1
    return min(max(low, 1), size), max(min(high, size), 1)


def binomial_tail(hits: int, trials: int, chance: float) -> float:
    """Return the chance of so many hits or fewer.

    Parameters
    ----------
    hits : int
        0 to `trials`.
    trials : int
        Number of trials.
    chance : float
        Chance of a hit in each, above 0 and below 1.

    Returns
    -------
    float
        Distribution function of the binomial distribution.

    Examples
    --------
    >>> round(binomial_tail(1, 3, 0.5), 6)
    0.5
    """
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
