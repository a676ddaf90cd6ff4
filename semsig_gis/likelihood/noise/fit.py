"""Fit a noise model to detections: one round of expectation-maximisation.

The E step works out the chances of all one-to-one associations under the present model, the M step
takes the model that the expected counts speak for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from semsig_gis.core.errors import InputError
from semsig_gis.core.signature import DISTANCE_UNITS
from semsig_gis.core.statistics import log_interval, poisson_interval, wilson_interval
from semsig_gis.likelihood.association import associate, near_pairs
from semsig_gis.likelihood.noise.table import NoiseTable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.core.signature import Signature
    from semsig_gis.core.taxonomy import Taxonomy
    from semsig_gis.database.views import Views
    from semsig_gis.likelihood.association import Pairs


ALL = "all"
"""What stands for all classes together."""
PRIOR_SAMPLES = 8.0  # that the overall value counts for, against those of a class
REACH = 75.0  # degrees beyond which a detection is never taken for an object
LEAST, MOST = 1e-3, 1.0 - 1e-3
LEAST_SIGMA, MOST_SIGMA = 0.05, 60.0
LEAST_INFORMATION = 0.05
PERCENTS = (90, 95)  # of the intervals


@dataclass(frozen=True, eq=False, kw_only=True)
class Evidence:
    """What was there and what was detected, over all samples (signatures).

    `names` and `codes` list the k classes that occur. Each object has a class (`kinds`, its number
    among the k), a sample (`owners`) and a distance in metres; each detection a class (`labels`)
    and a sample (`givers`). `pairs` are objects and detections that may be one thing.
    """

    names: list[str]
    codes: NDArray[np.uint8]
    samples: int
    kinds: NDArray[np.int64]
    owners: NDArray[np.int64]
    distances: NDArray[np.float64]
    labels: NDArray[np.int64]
    givers: NDArray[np.int64]
    pairs: Pairs

    @property
    def present(self) -> NDArray[np.float64]:
        """Number of objects by class, shape (k,)."""
        return np.bincount(self.kinds, minlength=len(self.codes)).astype(np.float64)

    @property
    def pair_kinds(self) -> NDArray[np.int64]:
        """The class of the object of each pair."""
        return self.kinds[self.pairs.objects]

    @property
    def pair_labels(self) -> NDArray[np.int64]:
        """The class of the detection of each pair."""
        return self.labels[self.pairs.detections]


@dataclass(frozen=True, eq=False, kw_only=True)
class Counts:
    """The expected counts, given the detections and a model.

    By pair, `chances` that it is one thing and `squares` of the bearing noise if it is, in square
    degrees; `false`, the chance that each detection is clutter; `named`, shape (k, k), detected
    objects by class and label; `log_likelihood` of all detections.
    """

    chances: NDArray[np.float64]
    squares: NDArray[np.float64]
    false: NDArray[np.float64]
    named: NDArray[np.float64]
    log_likelihood: float


def gather_evidence(views: Views, detected: Sequence[Signature], *, taxonomy: Taxonomy) -> Evidence:
    """Join what there was to see in each sample with what was detected, with types and bearings.

    Raises `InputError` if there was nothing to see at all, or nothing was detected.
    """
    codes = np.concatenate([np.asarray(one.codes, dtype=np.uint8) for one in detected])
    bearings = np.concatenate([np.asarray(one.bearings, dtype=np.float64) for one in detected])
    if len(views.codes) == 0 or len(codes) == 0:
        msg = (
            f"the {len(detected)} samples have {len(views.codes)} objects to see and {len(codes)} "
            "detections; give samples with some of both."
        )
        raise InputError(msg)
    classes = np.union1d(views.codes, codes)
    starts = np.concatenate([[0], np.cumsum([len(one) for one in detected])])
    return Evidence(
        names=[taxonomy.by_code(int(code)).name for code in classes],
        codes=classes,
        samples=len(detected),
        kinds=np.searchsorted(classes, views.codes),
        owners=np.repeat(np.arange(len(detected)), views.lengths),
        distances=views.distances,
        labels=np.searchsorted(classes, codes),
        givers=np.repeat(np.arange(len(detected)), np.diff(starts)),
        pairs=near_pairs(views.offsets, views.bearings, starts, bearings, reach=REACH),
    )


def starting_model(evidence: Evidence, *, position_sigma: float) -> NoiseTable:
    """Return a usual detector as the first model, with the known deviation of places in metres."""
    count = len(evidence.codes)
    return NoiseTable(
        codes=evidence.codes,
        missed=np.full((1, count), 0.25),
        misnamed=np.full((1, count), 0.1 if count > 1 else 0.0),
        others=_others(count),
        clutter=np.full(count, 1.0 / count),
        sigma=np.full(count, 8.0),
        range_sigma=np.full(count, 0.25),
        position_sigma=position_sigma,
        ranges=np.full(count, math.inf),
        fading=np.ones((count, DISTANCE_UNITS + 1)),
        reach=math.inf,
    )


def expected_counts(evidence: Evidence, model: NoiseTable) -> Counts:
    """Return the expected counts under a model: the E step.

    The model must be the same for signatures of all lengths.
    """
    pairs, size = evidence.pairs, len(evidence.codes)
    chances, loglik = associate(
        model,
        pairs,
        kinds=evidence.kinds,
        distances=evidence.distances,
        lengths=np.zeros(len(evidence.kinds), np.int64),
        names=evidence.labels,
    )
    kind = evidence.pair_kinds
    # Of a difference, the place and the bearing noise have their shares by their variances.
    place = np.degrees(model.position_sigma / np.maximum(evidence.distances[pairs.objects], 1e-3))
    own = model.sigma[kind] ** 2
    share = own / (own + place**2)
    true = np.bincount(pairs.detections, chances, len(evidence.labels))
    named = np.zeros((size, size))
    np.add.at(named, (kind, evidence.pair_labels), chances)
    return Counts(
        chances=chances,
        squares=(pairs.away * share) ** 2 + place**2 * share,
        false=np.clip(1.0 - true, 0.0, 1.0),
        named=named,
        log_likelihood=loglik,
    )


def next_model(evidence: Evidence, counts: Counts, model: NoiseTable) -> NoiseTable:
    """Return the model that the counts speak for, classes drawn to the whole: the M step."""
    size = len(evidence.codes)
    detected = counts.named.sum(axis=1)
    wrong = counts.named * (1.0 - np.eye(size))
    misnamed = np.clip(drawn_rates(wrong.sum(axis=1), detected), LEAST, MOST)
    spread = wrong + PRIOR_SAMPLES * misnamed[:, None] * _others(size)
    squares = np.bincount(evidence.pair_kinds, counts.chances * counts.squares, size)
    false = np.bincount(evidence.labels, counts.false, size)
    shares = (false + PRIOR_SAMPLES / size) / (false.sum() + PRIOR_SAMPLES)
    return replace(
        model,
        missed=1.0 - np.clip(drawn_rates(detected, evidence.present), LEAST, MOST)[None],
        misnamed=misnamed[None] if size > 1 else np.zeros((1, 1)),
        others=spread / np.maximum(spread.sum(axis=1, keepdims=True), 1e-12),
        clutter=np.maximum(false.sum() / evidence.samples * shares, LEAST / size),
        sigma=np.clip(np.sqrt(drawn_rates(squares, detected)), LEAST_SIGMA, MOST_SIGMA),
    )


def drawn_rates(hits: NDArray[np.number], trials: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rate of each class; the overall rate counts for `PRIOR_SAMPLES` trials of each."""
    overall = hits.sum() / max(trials.sum(), 1e-9)
    return np.asarray((hits + PRIOR_SAMPLES * overall) / (trials + PRIOR_SAMPLES))


def model_change(old: NoiseTable, new: NoiseTable) -> float:
    """Return the largest difference between two models of the same classes.

    Differences are of log-odds of detection, and of logarithms of chances, rates and deviations.
    """
    moves = [
        np.log(new.odds) - np.log(old.odds),
        np.log(new.sigma) - np.log(old.sigma),
        np.log(new.clutter) - np.log(old.clutter),
    ]
    if len(old.codes) > 1:
        moves.append(np.log(new.misnamed) - np.log(old.misnamed))
    return max(float(np.abs(move).max()) for move in moves)


def _others(size: int) -> NDArray[np.float64]:
    """Return rows that give each other class the same chance."""
    return np.asarray((1.0 - np.eye(size)) / max(size - 1, 1))


def estimated_rates(evidence: Evidence, counts: Counts, model: NoiseTable) -> pd.DataFrame:
    """Return the rates by class and overall with their intervals, as in `NoiseEstimate.rates`.

    Intervals are Wilson's for chances, the equivalent for Poisson rates, and symmetric in the
    logarithm for deviations. For uncertain association, the effective number of samples follows
    from the information matrix: the sum over the samples of the outer products of their expected
    scores (Fisher's identity). Where many objects stand close together, the clutter comes out some
    per cent too large.
    """
    size = len(evidence.codes)
    detected = counts.named.sum(axis=1)
    squares = np.bincount(evidence.pair_kinds, counts.chances * counts.squares, size)
    false = np.bincount(evidence.labels, counts.false, size)
    sums = {  # what is counted, of how many by class and in all, and what the model has
        "detection": (detected, evidence.present, 1.0 - model.missed[0]),
        "misnamed": (detected - np.diag(counts.named), detected, model.misnamed[0]),
        "clutter": (false, np.full(size, float(evidence.samples)), model.clutter),
        "bearing_sigma": (squares, detected, model.sigma),
    }
    scores = _scores(evidence, counts, {name: part[2] for name, part in sums.items()})
    single = _deviations(scores.reshape(evidence.samples, -1)).reshape(len(sums), size)
    pooled = _deviations(scores.sum(axis=2))
    rows = []
    for number, (quantity, (hits, trials, values)) in enumerate(sums.items()):
        total = trials[0] if quantity == "clutter" else trials.sum()
        rows.append(_row(quantity, ALL, hits.sum(), total, pooled[number]))
        for kind, name in enumerate(evidence.names):
            own = _row(quantity, name, hits[kind], trials[kind], single[number, kind])
            rows.append({**own, "value": float(values[kind])})
    return pd.DataFrame(rows)


def _row(quantity: str, name: str, hits: float, trials: float, deviation: float) -> dict[str, Any]:
    """Return what the samples say of a rate: `deviation` is that of its log-odds or logarithm."""
    rate = hits / trials if trials > 0 else 0.0
    if quantity == "bearing_sigma":
        own = math.sqrt(rate)
        least = 1.0 / math.sqrt(2.0 * trials) if trials > 0 else math.inf
        interval = partial(log_interval, max(own, 1e-6), max(deviation, least))
    elif quantity == "clutter":
        own = rate
        worth = min(trials, 1.0 / max(own * deviation**2, 1e-12))
        interval = partial(poisson_interval, own, worth)
    else:
        own = min(rate, 1.0)
        worth = min(trials, 1.0 / max(own * (1.0 - own) * deviation**2, 1e-12))
        interval = partial(wilson_interval, own, worth)
    row: dict[str, Any] = {"quantity": quantity, "class": name, "value": own, "own": own}
    for percent in PERCENTS:
        row[f"low_{percent}"], row[f"high_{percent}"] = interval(percent=percent)
    return row | {"samples": trials}


def _scores(
    evidence: Evidence, counts: Counts, values: dict[str, NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Return the score of each sample by quantity and class, shape (samples, 4, k).

    Chances are taken as log-odds, rates and deviations as logarithms.
    """
    size, kind = len(evidence.codes), evidence.pair_kinds
    sample = evidence.owners[evidence.pairs.objects]

    def by_sample(
        owner: NDArray[np.int64], group: NDArray[np.int64], amount: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        counted = np.bincount(owner * size + group, amount, evidence.samples * size)
        return np.asarray(counted.reshape(evidence.samples, size))

    chances = counts.chances
    detected = by_sample(sample, kind, chances)
    wrong = by_sample(sample, kind, chances * (kind != evidence.pair_labels))
    present = by_sample(evidence.owners, evidence.kinds, np.ones(len(evidence.kinds)))
    false = by_sample(evidence.givers, evidence.labels, counts.false)
    squares = by_sample(sample, kind, chances * counts.squares)
    return np.stack(
        [
            detected - present * values["detection"],
            wrong - detected * values["misnamed"],
            false - values["clutter"],
            squares / values["bearing_sigma"] ** 2 - detected,
        ],
        axis=1,
    )


def _deviations(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard deviation of each parameter, shape (p,), from scores (samples, p)."""
    # Shrinking leaves a mean, which is no information; a little more makes it invertible.
    scores = scores - scores.mean(axis=0)
    information = scores.T @ scores
    information[np.diag_indices_from(information)] += LEAST_INFORMATION
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(information))))
