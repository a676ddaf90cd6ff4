"""Whether the chances that are told of cells come true, by queries that they were not learnt from.

Two questions: do cells with a higher chance succeed more often (a rank correlation), and do as many
succeed as their chances say (calibration)?
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from semsig_gis.core.errors import InputError
from semsig_gis.core.statistics import wilson_interval
from semsig_gis.evaluation.identify.trials import trial_cells, try_cells

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from semsig_gis.evaluation.identify.result import Identifiability
    from semsig_gis.likelihood.index import LikelihoodIndex

BINS = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class ChanceBin:
    """Queries from cells with a chance from `low` to `high`.

    `stated` is the mean of their chances, `true` the share of the queries that was found, with
    Wilson's 95 % interval from `true_low` to `true_high`.
    """

    low: float
    high: float
    queries: int
    stated: float
    true: float
    true_low: float
    true_high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifiabilityCheck:
    """How what was told of cells compares with what came of queries.

    Parameters
    ----------
    queries : int
        How many were asked.
    seed : int
        Seed of their cells and of all chances.
    found : float
        Share of them whose best place was within the radius.
    correlations : mapping of str to float
        Rank correlation (Spearman's) of a score of the cells with success, by score: ``found``
        and ``near`` are chances of `Identifiability`; for comparison ``length``, the number of
        objects, and ``type_group``, how few cells have the same types. NaN where there is none.
    attainable : float
        What the correlation of ``found`` would be if it were every cell's true chance. Success
        is yes or no, so that it is below 1.
    bins : tuple of ChanceBin
        The tenths of ``found`` that have queries.
    """

    queries: int
    seed: int
    found: float
    correlations: Mapping[str, float]
    attainable: float
    bins: tuple[ChanceBin, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values for JSON.

        Returns
        -------
        dict
            The fields; None for a correlation that there is not.
        """
        plain = {
            name: None if math.isnan(value) else value for name, value in self.correlations.items()
        }
        return {
            "queries": self.queries,
            "seed": self.seed,
            "found": self.found,
            "correlations": plain,
            "attainable": None if math.isnan(self.attainable) else self.attainable,
            "bins": [asdict(one) for one in self.bins],
        }


def check_identifiability(
    told: Identifiability,
    index: LikelihoodIndex,
    *,
    queries: int = 2000,
    seed: int | None = None,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> IdentifiabilityCheck:
    """Ask fresh queries from random cells, and compare what comes of them with what was told.

    Parameters
    ----------
    told : Identifiability
        What was told of the cells.
    index : LikelihoodIndex
        The index that it was found out with.
    queries : int, default 2000
        How many to ask, 1 or more.
    seed : int, optional
        Seed of the cells and of all chances, another than that of `told`; by default the next.
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
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.database.build import build_database
    >>> from semsig_gis.evaluation.identify.identify import identify
    >>> from semsig_gis.likelihood.index import build_index
    >>> from semsig_gis.likelihood.noise.model import named_noise
    >>> from semsig_gis.objects.clean import build_objects
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> index = build_index(build_database(objects), named_noise("medium"))
    >>> told = identify(index, trials=200, class_trials=10)
    >>> check = check_identifiability(told, index, queries=200)
    >>> check.correlations["found"] > 0.2, sum(one.queries for one in check.bins)
    (True, 200)
    """
    chosen = told.seed + 1 if seed is None else seed
    if queries < 1:
        msg = f"a check by {queries} queries was asked for; give a whole number from 1."
        raise InputError(msg)
    if chosen < 0 or chosen == told.seed:
        msg = (
            f"a check with seed {chosen} was asked for; give a whole number from 0 other than "
            f"{told.seed}, with which the chances were found out."
        )
        raise InputError(msg)
    same = np.array_equal(index.database.cell_ids, told.database.cell_ids)
    if not same or index.noise != told.noise:
        msg = "the index is of other cells or another noise than what is to be checked; give its."
        raise InputError(msg)
    cells = trial_cells(len(told.database), queries, seed=chosen)
    tried = try_cells(
        index, cells, radius=told.radius, seed=chosen, threads=threads, progress=progress
    )
    stated, success = told.found[cells], tried.found.astype(np.float64)
    scores = {
        "found": stated,
        "near": told.near[cells],
        "length": told.database.lengths[cells],
        "type_group": -told.database.type_group_sizes[cells],
    }
    ranks = _ranks(stated)
    spread = ranks.std() * math.sqrt(stated.mean() * (1.0 - stated.mean()))
    shared = float(((ranks - ranks.mean()) * stated).mean())
    return IdentifiabilityCheck(
        queries=queries,
        seed=chosen,
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
    places = np.minimum((stated * BINS).astype(np.int64), BINS - 1)
    bins = []
    for place in np.unique(places).tolist():
        inside = places == place
        count, true = int(inside.sum()), float(success[inside].mean())
        low, high = wilson_interval(true, count)
        bins.append(
            ChanceBin(
                low=place / BINS,
                high=(place + 1) / BINS,
                queries=count,
                stated=float(stated[inside].mean()),
                true=true,
                true_low=low,
                true_high=high,
            )
        )
    return tuple(bins)
