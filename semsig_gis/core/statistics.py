"""Confidence intervals, and a logistic regression of shares."""

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
    """Return the Wilson score interval of a probability.

    Parameters
    ----------
    share : float
        Share of successful trials, 0 to 1.
    trials : float
        Number of trials, 0 or more, not necessarily whole.
    percent : float, default 95
        Confidence level in percent, above 0 and below 100.

    Returns
    -------
    low, high : float
        The interval; 0 and 1 without trials.

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
    """Return the score interval of a Poisson rate, in events per trial.

    The number of trials may have decimals; without trials, the interval is 0 to infinity.
    """
    z = _deviations(percent)
    if trials <= 0:
        return 0.0, math.inf
    middle = rate + z * z / (2.0 * trials)
    half = z * math.sqrt(rate / trials + (z / (2.0 * trials)) ** 2)
    return max(middle - half, 0.0), middle + half


def log_interval(value: float, deviation: float, *, percent: float = 95.0) -> tuple[float, float]:
    """Return a confidence interval of a value above 0 that is symmetric in its logarithm.

    `deviation` is the standard deviation of the natural logarithm.
    """
    factor = math.exp(min(_deviations(percent) * deviation, 700.0))
    return value / factor, value * factor


def quantile_ranks(size: int, share: float, *, percent: float = 95.0) -> tuple[int, int]:
    """Return the ranks (from 1) of the two sorted values that bound a quantile's interval.

    For small samples these are the first and the last rank. For any distribution, the number of
    values below the quantile is binomial; its normal approximation is used.
    """
    half = _deviations(percent) * math.sqrt(size * share * (1.0 - share))
    low = math.floor(size * share - half)
    high = math.ceil(size * share + half) + 1
    return min(max(low, 1), size), max(min(high, size), 1)


def binomial_tail(hits: int, trials: int, chance: float) -> float:
    """Return the probability of at most `hits` successes in `trials`; 0 < `chance` < 1."""
    probabilities = (
        math.exp(
            math.lgamma(trials + 1)
            - math.lgamma(hit + 1)
            - math.lgamma(trials - hit + 1)
            + hit * math.log(chance)
            + (trials - hit) * math.log1p(-chance)
        )
        for hit in range(hits + 1)
    )
    return min(math.fsum(probabilities), 1.0)


def log_sum(logs: NDArray[np.floating]) -> float:
    """Return the logarithm of the sum of numbers, given their logarithms; -inf for none."""
    top = float(logs.max(initial=-math.inf))
    if math.isinf(top):
        return top
    shares = logs - top
    np.exp(shares, out=shares)
    return top + math.log(float(shares.sum()))


def _deviations(percent: float) -> float:
    """Return half the width of an interval, in standard deviations."""
    if not 0.0 < percent < 100.0:  # noqa: PLR2004
        raise InputError(
            f"an interval of {percent} % was asked for; give a number between 0 and 100."
        )
    return NormalDist().inv_cdf(0.5 + percent / 200.0)


DEGREE = 3
RIDGE = 1e-3  # keeps the weights of uninformative terms small
MAX_STEPS = 100
TOLERANCE = 1e-9
MAX_LOGIT = 30.0  # avoids overflow; the probability is 0 or 1 to 13 digits


@dataclass(frozen=True, eq=False, kw_only=True)
class ShareFit:
    """Result of `fit_shares`, with p polynomial terms of f features.

    `low` and `high`, shape (f,), are the range of each feature in the examples; features are
    clipped to it. `middle` and `spread`, shape (f,), are their means and standard deviations.
    `powers`, shape (p, f), are the powers of the features in each term, `weights`, shape (p,),
    their coefficients.
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    middle: NDArray[np.float64]
    spread: NDArray[np.float64]
    powers: NDArray[np.int64]
    weights: NDArray[np.float64]

    def predict(self, features: ArrayLike) -> NDArray[np.float64]:
        """Return the expected shares, shape (n,), for features, shape (n, f)."""
        inside = np.clip(np.asarray(features, dtype=np.float64), self.low, self.high)
        terms = _terms((inside - self.middle) / self.spread, self.powers)
        return _logistic(terms @ self.weights)


def fit_shares(features: ArrayLike, shares: ArrayLike) -> ShareFit:
    """Fit shares (0 to 1, or outcomes 0 and 1), shape (m,), to features, shape (m, f).

    Logistic regression on a polynomial of the third degree, by Newton's method, with a small ridge
    penalty on all weights except the constant. So the mean of the predictions for the examples
    equals the mean of the shares.
    """
    examples = np.asarray(features, dtype=np.float64)
    targets = np.asarray(shares, dtype=np.float64)
    if examples.ndim != 2 or len(examples) != len(targets) or not len(targets):  # noqa: PLR2004
        raise InputError(
            f"{examples.shape} features and {targets.shape} shares were given; give a row for each."
        )
    if not (np.isfinite(examples).all() and ((targets >= 0) & (targets <= 1)).all()):
        raise InputError(
            "a feature is not finite or a share is not from 0 to 1; leave such examples out."
        )
    exponents = itertools.product(range(DEGREE + 1), repeat=examples.shape[1])
    powers = np.array([term for term in exponents if sum(term) <= DEGREE])
    middle, spread = examples.mean(axis=0), examples.std(axis=0)
    spread = np.where(spread > 0, spread, 1.0)
    terms = _terms((examples - middle) / spread, powers)
    return ShareFit(
        low=examples.min(axis=0),
        high=examples.max(axis=0),
        middle=middle,
        spread=spread,
        powers=powers,
        weights=_newton(terms, targets),
    )


def _newton(terms: NDArray[np.float64], shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fit a logistic regression of `shares` on `terms` by Newton's method; return the weights.

    The first term is constant and has no penalty.
    """
    penalty = np.full(terms.shape[1], RIDGE * len(shares))
    penalty[0] = 0.0
    weights = np.zeros(terms.shape[1])
    # Start at the mean; clipped, because the constant is infinite if all shares are 0, or all 1.
    mean = np.clip(shares.mean(), *_logistic(np.array([-MAX_LOGIT, MAX_LOGIT]) / 2))
    weights[0] = np.log(mean / (1.0 - mean))
    loss = _loss(terms, shares, weights, penalty)
    for _ in range(MAX_STEPS):
        expected = _logistic(terms @ weights)
        gradient = terms.T @ (shares - expected) - penalty * weights
        hessian = (terms * (expected * (1.0 - expected))[:, None]).T @ terms + np.diag(penalty)
        step = np.linalg.solve(hessian + 1e-9 * np.eye(len(hessian)), gradient)
        # Halve the step until the loss decreases.
        size = 1.0
        while (
            new_loss := _loss(terms, shares, weights + size * step, penalty)
        ) > loss and size > TOLERANCE:
            size /= 2.0
        if loss - new_loss < TOLERANCE * len(shares):
            break
        weights, loss = weights + size * step, new_loss
    return weights


def _loss(
    terms: NDArray[np.float64],
    shares: NDArray[np.float64],
    weights: NDArray[np.float64],
    penalty: NDArray[np.float64],
) -> float:
    """Return the penalized cross-entropy."""
    logits = terms @ weights
    entropy = np.logaddexp(0.0, logits) - shares * logits
    return float(entropy.sum() + 0.5 * (penalty * weights**2).sum())


def _terms(scaled: NDArray[np.float64], powers: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the products of powers of the features, shape (n, p)."""
    columns = np.ascontiguousarray(scaled.T)
    features_to_power = np.cumprod([np.ones_like(columns), *[columns] * DEGREE], axis=0)
    terms = np.ones((len(powers), len(scaled)))
    for term, feature in np.argwhere(powers):
        terms[term] *= features_to_power[powers[term, feature], feature]
    return terms.T


def _logistic(logits: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(logits, -MAX_LOGIT, MAX_LOGIT))))
