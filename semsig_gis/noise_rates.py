"""The rates of a noise model that was learnt, with intervals of confidence."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from semsig_gis.intervals import log_interval, poisson_interval, wilson_interval

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.noise_fit import Counts, Evidence
    from semsig_gis.noise_table import NoiseTable

__all__ = ["ALL", "estimated_rates"]

ALL = "all"
"""What stands for all classes together."""
LEVELS = (90, 95)
LEAST_INFORMATION = 0.05


def estimated_rates(evidence: Evidence, counts: Counts, model: NoiseTable) -> pd.DataFrame:
    """Return the rates by class and overall with their intervals, as in `NoiseEstimate.rates`.

    Intervals are Wilson's for chances, the equivalent for Poisson rates, and symmetric in the
    logarithm for deviations. They allow for uncertain association: the effective number of samples
    follows from the information matrix, the sum over the samples of the outer products of the
    scores (derivatives of the log-likelihood of one sample, by Fisher's identity the expected
    scores given the detections). Where many objects stand close together, the chances of the
    associations are approximate, and the clutter comes out some per cent too large.
    """
    size = len(evidence.codes)
    detected = counts.named.sum(axis=1)
    wrong = detected - np.diag(counts.named)
    kind = evidence.kinds[evidence.pairs.objects]
    sums = {  # what is counted, of how many, and what the model has
        "detection": (detected, evidence.present, 1.0 - model.missed[0]),
        "misnamed": (wrong, detected, model.misnamed[0]),
        "clutter": (
            np.bincount(evidence.given, counts.false, size),
            np.full(size, float(evidence.samples)),
            model.clutter,
        ),
        "bearing_sigma": (
            np.bincount(kind, counts.chances * counts.squares, size),
            detected,
            model.sigma,
        ),
    }
    scores = _scores(evidence, counts, {name: part[2] for name, part in sums.items()})
    single = _deviations(scores.reshape(evidence.samples, -1)).reshape(len(sums), size)
    pooled = _deviations(scores.sum(axis=2))
    rows = []
    for number, (quantity, (hits, trials, values)) in enumerate(sums.items()):
        total = float(trials[0] if quantity == "clutter" else trials.sum())
        own = float(hits.sum()) / max(total, 1e-9)
        overall = math.sqrt(own) if quantity == "bearing_sigma" else own
        rows.append(_row(quantity, ALL, overall, own, total, float(pooled[number])))
        for kind_row, kind_name in enumerate(evidence.names):
            tried = float(trials[kind_row])
            own = float(hits[kind_row]) / tried if tried > 0 else 0.0
            rows.append(
                _row(
                    quantity,
                    kind_name,
                    float(values[kind_row]),
                    own,
                    tried,
                    float(single[number, kind_row]),
                )
            )
    return pd.DataFrame(rows)


def _row(  # noqa: PLR0917 - one row of a table, in its order
    quantity: str, kind: str, value: float, own: float, trials: float, deviation: float
) -> dict[str, Any]:
    """Return one row of the table: `deviation` is that of a log-odds or logarithm."""
    row: dict[str, Any] = {"quantity": quantity, "class": kind, "value": value}
    row["own"] = (
        math.sqrt(own)
        if quantity == "bearing_sigma"
        else min(own, 1.0)
        if quantity != "clutter"
        else own
    )
    for percent in LEVELS:
        if quantity == "bearing_sigma":
            floor = 1.0 / math.sqrt(2.0 * trials) if trials > 0 else math.inf
            ends = log_interval(max(row["own"], 1e-6), max(deviation, floor), percent=percent)
        elif quantity == "clutter":
            worth = min(trials, 1.0 / max(own * deviation**2, 1e-12))
            ends = poisson_interval(own, worth, percent=percent)
        else:
            share = row["own"]
            worth = min(trials, 1.0 / max(share * (1.0 - share) * deviation**2, 1e-12))
            ends = wilson_interval(share, worth, percent=percent)
        row[f"low_{percent}"], row[f"high_{percent}"] = ends
    row["samples"] = trials
    return row


def _scores(
    evidence: Evidence, counts: Counts, values: dict[str, NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Return the score of each sample by quantity and class, shape (samples, 4, k).

    Chances are taken as log-odds, rates and deviations as logarithms.
    """
    size, pairs = len(evidence.codes), evidence.pairs
    kind = evidence.kinds[pairs.objects]
    sample = evidence.owners[pairs.objects]

    def by_sample(
        owner: NDArray[np.int64], group: NDArray[np.int64], amount: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        counted = np.bincount(owner * size + group, amount, evidence.samples * size)
        return np.asarray(counted.reshape(evidence.samples, size))

    chances = counts.chances
    detected = by_sample(sample, kind, chances)
    wrong = by_sample(sample, kind, chances * (kind != evidence.given[pairs.detections]))
    present = by_sample(evidence.owners, evidence.kinds, np.ones(len(evidence.kinds)))
    false = by_sample(evidence.givers, evidence.given, counts.false)
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
