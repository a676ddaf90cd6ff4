"""Fit a noise model to detections: one round of expectation-maximisation.

The E step works out the chances of all one-to-one associations under the present model, the M step
takes the model that the expected counts speak for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.association import associate_pairs, near_pairs, pair_weights
from semsig_gis.errors import InputError
from semsig_gis.noise_table import NoiseTable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.association import Pairs
    from semsig_gis.signatures import Signature
    from semsig_gis.taxonomy import Taxonomy
    from semsig_gis.views import Views

__all__ = [
    "PRIOR_SAMPLES",
    "Counts",
    "Evidence",
    "drawn_rates",
    "expected_counts",
    "gather_evidence",
    "model_change",
    "next_model",
    "starting_model",
]

PRIOR_SAMPLES = 8.0
"""Samples that the overall value counts for, against those of a class."""
REACH = 75.0  # degrees beyond which a detection is never taken for an object
LEAST, MOST = 1e-3, 1.0 - 1e-3
LEAST_SIGMA, MOST_SIGMA = 0.05, 60.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Evidence:
    """What was there and what was detected, over all samples (signatures).

    `names` and `codes` list the k classes that occur. Each object has a class (`kinds`, its number
    among the k), a sample (`owners`) and a distance in metres; each detection a class (`given`) and
    a sample (`givers`). `pairs` are objects and detections that may be one thing.
    """

    names: list[str]
    codes: NDArray[np.uint8]
    samples: int
    kinds: NDArray[np.int64]
    owners: NDArray[np.int64]
    distances: NDArray[np.float64]
    given: NDArray[np.int64]
    givers: NDArray[np.int64]
    pairs: Pairs

    @property
    def present(self) -> NDArray[np.float64]:
        """Number of objects by class, shape (k,)."""
        return np.bincount(self.kinds, minlength=len(self.codes)).astype(np.float64)


@dataclass(frozen=True, eq=False, kw_only=True)
class Counts:
    """The expected counts, given the detections and a model.

    By pair, `chances` that it is one thing and `squares` of the bearing noise if it is, in square
    degrees; `false`, the chance that each detection is clutter; `named`, shape (k, k), detected
    objects by true and given class; `log_likelihood` of all detections.
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
    seen = np.concatenate([np.asarray(one.bearings, dtype=np.float64) for one in detected])
    if len(views.codes) == 0 or len(codes) == 0:
        msg = (
            f"the {len(detected)} samples have {len(views.codes)} objects to see and {len(codes)} "
            "detections; give samples with some of both."
        )
        raise InputError(msg)
    known = np.union1d(views.codes, codes)
    starts = np.concatenate([[0], np.cumsum([len(one) for one in detected])])
    return Evidence(
        names=[taxonomy.by_code(int(code)).name for code in known],
        codes=known,
        samples=len(detected),
        kinds=np.searchsorted(known, views.codes),
        owners=np.repeat(np.arange(len(detected)), views.lengths),
        distances=views.distances,
        given=np.searchsorted(known, codes),
        givers=np.repeat(np.arange(len(detected)), np.diff(starts)),
        pairs=near_pairs(views.offsets, views.bearings, starts, seen, reach=REACH),
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
        position_sigma=position_sigma,
    )


def expected_counts(evidence: Evidence, model: NoiseTable) -> Counts:
    """Return the expected counts under a model: the E step.

    The model must be the same for signatures of all lengths.
    """
    pairs, size = evidence.pairs, len(evidence.codes)
    weights = pair_weights(
        model,
        pairs,
        kinds=evidence.kinds,
        distances=evidence.distances,
        lengths=np.zeros(len(evidence.kinds), np.int64),
        names=evidence.given,
    )
    found = associate_pairs(pairs, weights)
    kind = evidence.kinds[pairs.objects]
    # Of a difference, the place and the bearing noise have their shares by their variances.
    place = np.degrees(model.position_sigma / np.maximum(evidence.distances[pairs.objects], 1e-3))
    own = model.sigma[kind] ** 2
    share = own / (own + place**2)
    true = np.bincount(pairs.detections, found.chances, len(evidence.given))
    named = np.zeros((size, size))
    np.add.at(named, (kind, evidence.given[pairs.detections]), found.chances)
    log_likelihood = (
        found.log_sums.sum()
        + np.log(model.missed[0, evidence.kinds]).sum()
        + np.log(model.density[evidence.given]).sum()
        - evidence.samples * model.clutter.sum()
    )
    return Counts(
        chances=found.chances,
        squares=(pairs.away * share) ** 2 + place**2 * share,
        false=np.clip(1.0 - true, 0.0, 1.0),
        named=named,
        log_likelihood=float(log_likelihood),
    )


def next_model(evidence: Evidence, counts: Counts, model: NoiseTable) -> NoiseTable:
    """Return the model that the counts speak for, classes drawn to the whole: the M step."""
    size = len(evidence.codes)
    detected = counts.named.sum(axis=1)
    wrong = counts.named * (1.0 - np.eye(size))
    misnamed = np.clip(drawn_rates(wrong.sum(axis=1), detected), LEAST, MOST)
    spread = wrong + PRIOR_SAMPLES * misnamed[:, None] * _others(size)
    kind = evidence.kinds[evidence.pairs.objects]
    squares = np.zeros(size)
    np.add.at(squares, kind, counts.chances * counts.squares)
    false = np.bincount(evidence.given, counts.false, size)
    shares = (false + PRIOR_SAMPLES / size) / (false.sum() + PRIOR_SAMPLES)
    return replace(
        model,
        missed=1.0 - np.clip(drawn_rates(detected, evidence.present), LEAST, MOST)[None],
        misnamed=misnamed[None] if size > 1 else np.zeros((1, 1)),
        others=spread / np.maximum(spread.sum(axis=1, keepdims=True), 1e-12),
        clutter=np.maximum(false.sum() / evidence.samples * shares, LEAST / size),
        sigma=np.clip(np.sqrt(drawn_rates(squares, detected)), LEAST_SIGMA, MOST_SIGMA),
    )


def drawn_rates(hits: NDArray[np.float64], trials: NDArray[np.float64]) -> NDArray[np.float64]:
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
