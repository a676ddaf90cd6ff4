"""Compare two evaluations that asked queries from the same places."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from semsig_gis.core import InputError
from semsig_gis.evaluation.figures import percentiles

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from semsig_gis.evaluation.result import Evaluation

RESAMPLES = 2000
AT_ONCE = 50
PERCENTILES = {"error_median": ("error_m", 50), "error_p90": ("error_m", 90)}
HEADINGS = {"heading_error_median": ("heading_error", 50)}
INTERVAL = (2.5, 97.5)


def compare_evaluations(
    first: Evaluation, second: Evaluation, *, resamples: int = RESAMPLES, seed: int = 0
) -> pd.DataFrame:
    """Return by how much the figures of two evaluations differ.

    Parameters
    ----------
    first, second : Evaluation
        Evaluations with queries from the same places, number by number.
    resamples : int, default 2000
        How often the queries are drawn again.
    seed : int, default 0
        Seed of these draws.

    Returns
    -------
    DataFrame
        One row a figure of `experiments.tables.experiment_figures` that both have: ``figure``,
        ``first``, ``second``, ``difference`` (the second less the first), ``low`` and ``high`` (its
        95 % interval); NaN where one of them is infinite. The bootstrap is by pairs, so that what
        is hard for both methods does not blur the difference.

    Raises
    ------
    InputError
        If the queries are not from the same places.

    Examples
    --------
    >>> from semsig_gis import Method, evaluate
    >>> one = evaluate(demo_database, queries=50, method=Method.parse("types:jaccard"))
    >>> other = evaluate(demo_database, queries=50, method=Method.parse("edit+edit"))
    >>> figures = compare_evaluations(one, other).set_index("figure")
    >>> bool(figures["low"]["p50"] <= figures["difference"]["p50"] <= figures["high"]["p50"])
    True
    """
    _require_pairs(first, second)
    shares = [one.figures for one in (first, second)]
    names = [name for name in shares[0] if name in shares[1]]
    values = [figures[names].to_numpy(dtype=np.float64) for figures in shares]
    columns = {**PERCENTILES, **(HEADINGS if _turned(first) and _turned(second) else {})}
    errors = [
        [one.queries[column].to_numpy(dtype=np.float64) for one in (first, second)]
        for column, _ in columns.values()
    ]

    def figures_of(rows: NDArray[np.int64]) -> NDArray[np.float64]:
        # Of both, for samples of the queries: shape (2, samples, figures).
        means = np.stack([_means(one, rows) for one in values])
        ends = [
            np.stack([percentiles(one[rows], percent) for one in pair])
            for pair, (_, percent) in zip(errors, columns.values(), strict=True)
        ]
        return np.concatenate([means, np.stack(ends, axis=-1)], axis=-1)

    count = len(first.queries)
    rng = np.random.default_rng(seed)
    drawn = [
        figures_of(rng.integers(0, count, (min(AT_ONCE, resamples - start), count)))
        for start in range(0, resamples, AT_ONCE)
    ]
    one, other = figures_of(np.arange(count)[None])[:, 0]
    samples = np.concatenate(drawn, axis=1)
    with np.errstate(invalid="ignore"):  # of two infinite errors there is no difference
        differences = samples[1] - samples[0]
        difference = other - one
    finite = np.isfinite(differences).all(axis=0)
    bounds = np.full((2, len(finite)), np.nan)
    bounds[:, finite] = np.percentile(differences[:, finite], INTERVAL, axis=0)
    return pd.DataFrame(
        {
            "figure": [*names, *columns],
            "first": one,
            "second": other,
            "difference": difference,
            "low": bounds[0],
            "high": bounds[1],
        }
    )


def changed_successes(first: Evaluation, second: Evaluation) -> tuple[int, int]:
    """Return how many queries only the second one answers well, and how many only the first one."""
    _require_pairs(first, second)
    before, after = first.successful, second.successful
    return int((after & ~before).sum()), int((before & ~after).sum())


def common_cases(
    first: Mapping[str, Evaluation], second: Mapping[str, Evaluation]
) -> dict[str, tuple[Evaluation, Evaluation]]:
    """Return the evaluations of two results that have the same name; InputError if none has.

    Of two single evaluations, return these, whatever they are called.
    """
    if len(first) == len(second) == 1:
        (name, one), (other_name, other) = *first.items(), *second.items()
        return {name or other_name: (one, other)}
    common = {name: (first[name], second[name]) for name in first if name in second}
    if not common:
        raise InputError(
            f"the first results have {_listed(first)} and the second {_listed(second)}, none in "
            "common; give two with results in common, or the folders of two evaluations."
        )
    return common


def _listed(results: Mapping[str, Evaluation]) -> str:
    return ", ".join(name or "a single evaluation" for name in results)


def _require_pairs(first: Evaluation, second: Evaluation) -> None:
    """Refuse evaluations whose queries are not from the same places, number by number."""
    keys = ["seed", "number"]
    tables = [one.queries.reset_index(drop=True) for one in (first, second)]
    same = tables[0][keys].equals(tables[1][keys]) and first.queries.crs == second.queries.crs
    if same:
        places = [np.column_stack([one.geometry.x, one.geometry.y]) for one in tables]
        same = np.array_equal(places[0], places[1])
    if not same:
        raise InputError(
            f"the two evaluations have different queries ({len(tables[0])} and {len(tables[1])}); "
            "compare evaluations with the same places, seeds and number of queries."
        )


def _turned(evaluation: Evaluation) -> bool:
    return bool(evaluation.queries["heading_error"].notna().any())


def _means(values: NDArray[np.float64], rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the mean of each column over samples of the rows, NaN left out."""
    weights = np.stack([np.bincount(row, minlength=len(values)) for row in rows]).astype(np.float64)
    counted = ~np.isnan(values)
    with np.errstate(invalid="ignore"):  # a sample may have nothing to count
        return np.asarray((weights @ np.where(counted, values, 0.0)) / (weights @ counted))
