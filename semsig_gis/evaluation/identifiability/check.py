"""Whether the chances of cells come true, by queries that they were not learnt from."""

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

    from semsig_gis.evaluation.identifiability.result import Identifiability
    from semsig_gis.localization import LikelihoodIndex


@dataclass(frozen=True, slots=True)
class ChanceBin:
    """Queries from cells with a chance from `low` to `high`: the mean of it, and the share found.

    That is `true`, with Wilson's 95 % interval from `true_low` to `true_high`.
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
    """How the chances of cells compare with what came of queries.

    Parameters
    ----------
    queries, seed : int
        How many were asked, and the seed of their cells and of all chances.
    found : float
        Share of them whose best place was within the radius.
    correlations : mapping of str to float
        Rank correlation (Spearman's) with success by score of the cell: ``found`` and ``near`` of
        `Identifiability`; for comparison ``length``, the number of objects, and ``type_group``, how
        few cells have the same types. NaN where there is none.
    attainable : float
        The correlation of ``found`` if it were every cell's true chance; below 1, as success is yes
        or no.
    bins : tuple of ChanceBin
        The tenths of ``found`` that have queries.

    Examples
    --------
    >>> from semsig_gis import build_index, identify, named_noise
    >>> index = build_index(demo_database, named_noise("medium"))
    >>> check = check_identifiability(identify(index, trials=20, class_trials=5), index, queries=50)
    >>> sum(one.queries for one in check.bins)
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
            "found": percent(self.found),
            "correlation": f"{self.correlations['found']:.2f}",
            "attainable": f"{self.attainable:.2f}",
            "seed": self.seed,
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as plain values for JSON; None for a correlation that there is not."""
        return {
            **asdict(self),
            "correlations": {name: finite_or_none(one) for name, one in self.correlations.items()},
            "attainable": finite_or_none(self.attainable),
            "bins": [asdict(one) for one in self.bins],
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
    """Ask fresh queries from random cells, and compare what comes of them with the chances.

    Parameters
    ----------
    identifiability : Identifiability
        The chances of the cells.
    index : LikelihoodIndex
        The index that they were found out with.
    queries : int, default 2000
        How many to ask, 1 to 1,000,000.
    seed : int, optional
        Seed of the cells and of all draws, another than that of the trials; by default the next.
    threads : int, default 1
        How many queries are worked on at once.
    progress : callable, optional
        Called with the number of queries done and in all.

    Returns
    -------
    IdentifiabilityCheck
        Correlations and calibration.

    Raises
    ------
    InputError
        If a number is out of range, the seed is that of the trials, or the index is another.

    Examples
    --------
    >>> from semsig_gis import build_index, identify, named_noise
    >>> index = build_index(demo_database, named_noise("medium"))
    >>> cells = identify(index, trials=200, class_trials=10)
    >>> check = check_identifiability(cells, index, queries=200)
    >>> check.correlations["found"] > 0.2, sum(one.queries for one in check.bins)
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
        photos = (Photo.looking(heading=one, fov=identifiability.view) for one in headings)
    tried = try_cells(
        index,
        cells,
        queries=draw_trials(index, cells, photos=photos, seed=seed),
        radius=identifiability.radius,
        threads=threads,
        progress=progress,
    )
    stated, success = identifiability.found[cells], tried.found.astype(np.float64)
    scores = {
        "found": stated,
        "near": identifiability.near[cells],
        "length": database.lengths[cells],
        "type_group": -database.type_group_sizes[cells],
    }
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
        bins=_bins(stated, success),
    )


def _ranks(values: NDArray[Any]) -> NDArray[np.float64]:
    """Return ranks; those of equals are their mean."""
    return np.asarray(pd.Series(values).rank(), dtype=np.float64)


def _correlation(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    if not (np.ptp(one) and np.ptp(other)):
        return math.nan
    return float(np.corrcoef(one, other)[0, 1])


def _bins(stated: NDArray[np.float64], success: NDArray[np.float64]) -> tuple[ChanceBin, ...]:
    """Return the tenths that have queries."""
    bins = calibration_bins(pd.DataFrame({"chance": stated, "right": success}))
    return tuple(ChanceBin(*row) for row in bins[bins["n"] > 0].to_dict("split")["data"])
