"""Check the probabilities of cells with new simulated queries."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from semsig_gis.core import (
    FULL_TURN,
    MOST_SEED,
    MOST_WORKERS,
    Displayed,
    InputError,
    announce,
    percent,
    require_number,
)
from semsig_gis.evaluation.figures import calibration_bins, finite_or_none
from semsig_gis.evaluation.identifiability.trials import (
    MOST_TRIALS,
    TRIAL_S,
    draw_trials,
    trial_cells,
    try_cells,
)
from semsig_gis.observation import Photo

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from semsig_gis.evaluation.identifiability.result import CheckRecord, Identifiability
    from semsig_gis.localization import LikelihoodIndex


@dataclass(frozen=True, slots=True)
class ChanceBin:
    """Queries from cells with a probability from `low` to `high`.

    `stated` is the mean probability, `true` the share of queries that were found, with Wilson's
    95 % interval from `true_low` to `true_high`.
    """

    low: float
    high: float
    queries: int
    stated: float
    true: float
    true_low: float
    true_high: float


@dataclass(frozen=True, repr=False, slots=True, kw_only=True)
class IdentifiabilityCheck(Displayed):
    """Comparison of the probabilities of cells with the outcomes of queries.

    Parameters
    ----------
    queries, seed : int
        Number of queries, and their random seed.
    found : float
        Share of queries with the best place within the radius.
    correlations : mapping of str to float
        Spearman's rank correlation with success by score of the cell: ``found`` and ``near`` of
        `Identifiability`; for comparison ``length``, the number of objects, and ``type_group``, the
        negative number of cells with the same types. NaN if a score or success is constant.
    attainable : float
        The correlation of ``found`` if it were the true probability of every cell; it is below 1,
        because success is yes or no.
    bins : tuple of ChanceBin
        The tenths of ``found`` that have queries.

    Examples
    --------
    >>> from semsig_gis import build_index, identify, named_noise
    >>> index = build_index(demo_database, named_noise("medium"))
    >>> check = check_identifiability(identify(index, trials=20, class_trials=5), index, queries=50)
    >>> sum(item.queries for item in check.bins)
    50
    """

    queries: int
    seed: int
    found: float
    correlations: Mapping[str, float]
    attainable: float
    bins: tuple[ChanceBin, ...]

    def _facts(self) -> dict[str, object]:
        return {
            "queries": self.queries,
            "found": percent(self.found, 1),
            "correlation": f"{self.correlations['found']:.2f}",
            "attainable": f"{self.attainable:.2f}",
            "seed": self.seed,
        }

    def to_dict(self) -> CheckRecord:
        """Return the fields as plain values for JSON, with None for NaN."""
        return {
            "queries": self.queries,
            "seed": self.seed,
            "found": self.found,
            "correlations": {
                name: finite_or_none(value) for name, value in self.correlations.items()
            },
            "attainable": finite_or_none(self.attainable),
            "bins": [asdict(item) for item in self.bins],
        }


def check_identifiability(
    identifiability: Identifiability,
    index: LikelihoodIndex,
    *,
    queries: int = 2000,
    seed: int | None = None,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> IdentifiabilityCheck:
    """Compare the predicted chances of cells with the outcomes of new simulated queries.

    Parameters
    ----------
    identifiability : Identifiability
        The probabilities of the cells.
    index : LikelihoodIndex
        The index from which they were computed.
    queries : int, default 2000
        Number of queries, 1 to 1,000,000.
    seed : int, optional
        Random seed; it must not be that of the trials. The default is the next number.
    threads : int, default 1
        Number of queries that are answered in parallel.
    progress : callable, optional
        Called with the number of finished queries and the number of queries.

    Returns
    -------
    IdentifiabilityCheck
        Correlations and calibration.

    Raises
    ------
    InputError
        If a number is out of range, the seed is that of the trials, or the index belongs to another
        database or noise model.

    Examples
    --------
    >>> from semsig_gis import build_index, identify, named_noise
    >>> index = build_index(demo_database, named_noise("medium"))
    >>> cells = identify(index, trials=200, class_trials=10)
    >>> check = check_identifiability(cells, index, queries=200)
    >>> check.correlations["found"] > 0.2, sum(item.queries for item in check.bins)
    (True, 200)
    """
    if seed is None:
        seed = identifiability.seed + 1
    require_number("number of queries", queries, least=1, most=MOST_TRIALS)
    require_number("number of threads", threads, least=1, most=MOST_WORKERS)
    require_number("seed", seed, least=0, most=MOST_SEED + 1)
    if seed == identifiability.seed:
        raise InputError(
            f"the seed of the check is {seed}, which is that of the trials; give another seed."
        )
    database = identifiability.database
    same = np.array_equal(index.database.cell_ids, database.cell_ids)
    if not same or index.noise != identifiability.noise:
        raise InputError(
            "the index belongs to another database or noise model; pass the matching one."
        )
    announce(queries * TRIAL_S / threads, "checking")
    cells = trial_cells(len(database), queries, seed=seed)
    photos = None
    if identifiability.view < FULL_TURN:
        headings = np.random.default_rng([seed, 2]).uniform(0.0, FULL_TURN, queries).tolist()
        photos = (Photo.looking(heading=angle, fov=identifiability.view) for angle in headings)
    outcomes = try_cells(
        index,
        cells,
        queries=draw_trials(index, cells, photos=photos, seed=seed),
        radius=identifiability.radius,
        threads=threads,
        progress=progress,
    )
    stated, success = identifiability.found[cells], outcomes.found.astype(np.float64)
    scores = {
        "found": stated,
        "near": identifiability.near[cells],
        "length": database.lengths[cells],
        "type_group": -database.type_group_sizes[cells],
    }
    bins = calibration_bins(pd.DataFrame({"chance": stated, "right": success}))
    # The rank correlation with a success that is drawn with the stated probability.
    ranks = _ranks(stated)
    spread = ranks.std() * math.sqrt(stated.mean() * (1.0 - stated.mean()))
    shared = float(((ranks - ranks.mean()) * stated).mean())
    return IdentifiabilityCheck(
        queries=queries,
        seed=seed,
        found=float(success.mean()),
        correlations={
            name: _correlation(_ranks(score), _ranks(success)) for name, score in scores.items()
        },
        attainable=shared / spread if spread > 0 else math.nan,
        bins=tuple(ChanceBin(*row) for row in bins[bins["n"] > 0].to_dict("split")["data"]),
    )


def _ranks(values: NDArray[Any]) -> NDArray[np.float64]:
    """Return the ranks of values; equal values get their mean rank."""
    return np.asarray(pd.Series(values).rank(), dtype=np.float64)


def _correlation(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    if not (np.ptp(first) and np.ptp(second)):
        return math.nan
    return float(np.corrcoef(first, second)[0, 1])
