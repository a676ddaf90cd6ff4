"""Intervals of confidence for chances, rates and deviations."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


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
        raise InputError(
            f"an interval of {percent} % was asked for; give a number between 0 and 100."
        )
    return NormalDist().inv_cdf(0.5 + percent / 200.0)


DEGREE = 3
RIDGE = 1e-3  # keeps a power that tells nothing from growing
STEPS = 100
SETTLED = 1e-9
LARGEST = 30.0  # logits beyond it are as good as certain


@dataclass(frozen=True, eq=False, kw_only=True)
class ShareFit:
    """A curve that `fit_shares` found, over f features and with p terms.

    `low` and `high` are the range of each feature in the examples, beyond which the curve stays
    what it is at its ends; `middle` and `spread` are mean and standard deviation of each. `powers`,
    shape (p, f), are the powers of the features in each term.
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    middle: NDArray[np.float64]
    spread: NDArray[np.float64]
    powers: NDArray[np.int64]
    weights: NDArray[np.float64]

    def predict(self, features: ArrayLike) -> NDArray[np.float64]:
        """Return the shares to expect, from 0 to 1, of cases, shape (n, f)."""
        inside = np.clip(np.asarray(features, dtype=np.float64), self.low, self.high)
        terms = _terms((inside - self.middle) / self.spread, self.powers)
        return _logistic(terms @ self.weights)


def fit_shares(features: ArrayLike, shares: ArrayLike) -> ShareFit:
    """Fit a curve to examples: features of shape (m, f), and m shares from 0 to 1, or 0 and 1.

    Logistic regression on the products of the features up to the third degree, by Newton's method
    on the log-likelihood less a small penalty on all weights but the constant. So the mean of the
    curve over the examples is that of the shares.
    """
    given = np.asarray(features, dtype=np.float64)
    targets = np.asarray(shares, dtype=np.float64)
    if given.ndim != 2 or len(given) != len(targets) or not len(targets):  # noqa: PLR2004
        raise InputError(
            f"{given.shape} features and {targets.shape} shares were given; give a row for each."
        )
    if not (np.isfinite(given).all() and ((targets >= 0) & (targets <= 1)).all()):
        raise InputError(
            "a feature is not finite or a share is not from 0 to 1; leave such examples out."
        )
    kinds = given.shape[1]
    powers = np.array(
        [one for one in itertools.product(range(DEGREE + 1), repeat=kinds) if sum(one) <= DEGREE]
    )
    middle, spread = given.mean(axis=0), given.std(axis=0)
    spread = np.where(spread > 0, spread, 1.0)
    terms = _terms((given - middle) / spread, powers)
    return ShareFit(
        low=given.min(axis=0),
        high=given.max(axis=0),
        middle=middle,
        spread=spread,
        powers=powers,
        weights=_newton(terms, targets),
    )


def _newton(terms: NDArray[np.float64], shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weights of the terms, the first of which is constant."""
    penalty = np.full(terms.shape[1], RIDGE * len(shares))
    penalty[0] = 0.0
    weights = np.zeros(terms.shape[1])
    # Where all shares are 0, or all 1, the best constant would be infinite.
    mean = np.clip(shares.mean(), *_logistic(np.array([-LARGEST, LARGEST]) / 2))
    weights[0] = np.log(mean / (1.0 - mean))
    loss = _loss(terms, shares, weights, penalty)
    for _ in range(STEPS):
        expected = _logistic(terms @ weights)
        slope = terms.T @ (shares - expected) - penalty * weights
        bend = (terms * (expected * (1.0 - expected))[:, None]).T @ terms + np.diag(penalty)
        step = np.linalg.solve(bend + 1e-9 * np.eye(len(bend)), slope)
        size = 1.0
        while (
            new := _loss(terms, shares, weights + size * step, penalty)
        ) > loss and size > SETTLED:
            size /= 2.0
        if loss - new < SETTLED * len(shares):
            break
        weights, loss = weights + size * step, new
    return weights


def _loss(
    terms: NDArray[np.float64],
    shares: NDArray[np.float64],
    weights: NDArray[np.float64],
    penalty: NDArray[np.float64],
) -> float:
    logits = terms @ weights
    entropy = np.logaddexp(0.0, logits) - shares * logits
    return float(entropy.sum() + 0.5 * (penalty * weights**2).sum())


def _terms(scaled: NDArray[np.float64], powers: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the products of powers of the features, shape (n, p)."""
    rows = np.ascontiguousarray(scaled.T)
    ladder = np.cumprod([np.ones_like(rows), *[rows] * DEGREE], axis=0)
    terms = np.ones((len(powers), len(scaled)))
    for row, feature in np.argwhere(powers):
        terms[row] *= ladder[powers[row, feature], feature]
    return terms.T


def _logistic(logits: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(logits, -LARGEST, LARGEST))))
