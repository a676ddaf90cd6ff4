"""Compare two evaluations with queries from the same places."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from typing_extensions import TypedDict

from semsig_gis.core import InputError
from semsig_gis.evaluation.figures import percentiles

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from semsig_gis.evaluation.result import Evaluation

RESAMPLES = 2000
BATCH = 50  # samples computed together
PERCENTILES = {"error_median": ("error_m", 50), "error_p90": ("error_m", 90)}
HEADINGS = {"heading_error_median": ("heading_error", 50)}
INTERVAL = (2.5, 97.5)


class DifferenceRecord(TypedDict):
    """A row of `compare_evaluations` as plain values."""

    figure: str
    first: float | None
    second: float | None
    difference: float | None
    low: float | None
    high: float | None


ComparisonRecord = dict[str, list[DifferenceRecord]]
"""The differences by case."""


def compare_evaluations(
    first: Evaluation, second: Evaluation, *, resamples: int = RESAMPLES, seed: int = 0
) -> pd.DataFrame:
    """Return the differences between the figures of two evaluations, with intervals.

    Parameters
    ----------
    first, second : Evaluation
        Evaluations with queries from the same places, number by number.
    resamples : int, default 2000
        Number of bootstrap samples of the queries.
    seed : int, default 0
        Seed of these samples.

    Returns
    -------
    DataFrame
        One row for each figure of `experiments.tables.experiment_figures` that both have:
        ``figure``, ``first``, ``second``, ``difference`` (second minus first), ``low`` and ``high``
        (its 95 % interval); NaN if one of the values is infinite. The bootstrap resamples pairs, so
        queries that are hard for both methods do not widen the interval.

    Raises
    ------
    InputError
        If the queries are not from the same places.

    Examples
    --------
    >>> from semsig_gis import Method, evaluate
    >>> first = evaluate(demo_database, queries=50, method=Method.parse("types:jaccard"))
    >>> second = evaluate(demo_database, queries=50, method=Method.parse("edit+edit"))
    >>> figures = compare_evaluations(first, second).set_index("figure")
    >>> bool(figures["low"]["p50"] <= figures["difference"]["p50"] <= figures["high"]["p50"])
    True
    """
    _require_pairs(first, second)
    both = (first, second)
    shares = [evaluation.figures for evaluation in both]
    names = [name for name in shares[0] if name in shares[1]]
    values = [figures[names].to_numpy(dtype=np.float64) for figures in shares]
    with_headings = all(evaluation.queries["heading_error"].notna().any() for evaluation in both)
    columns = {**PERCENTILES, **(HEADINGS if with_headings else {})}
    errors = [
        [evaluation.queries[column].to_numpy(dtype=np.float64) for evaluation in both]
        for column, _ in columns.values()
    ]

    def sample_figures(rows: NDArray[np.int64]) -> NDArray[np.float64]:
        # Figures of both for samples of the queries: shape (2, samples, figures).
        means = np.stack([_sample_means(table, rows) for table in values])
        ends = [
            np.stack([percentiles(column[rows], percent) for column in pair])
            for pair, (_, percent) in zip(errors, columns.values(), strict=True)
        ]
        return np.concatenate([means, np.stack(ends, axis=-1)], axis=-1)

    count = len(first.queries)
    rng = np.random.default_rng(seed)
    batches = [
        sample_figures(rng.integers(0, count, (min(BATCH, resamples - start), count)))
        for start in range(0, resamples, BATCH)
    ]
    first_figures, second_figures = sample_figures(np.arange(count)[None])[:, 0]
    samples = np.concatenate(batches, axis=1)
    with np.errstate(invalid="ignore"):  # the difference of two infinite errors is NaN
        differences = samples[1] - samples[0]
        difference = second_figures - first_figures
    finite = np.isfinite(differences).all(axis=0)
    bounds = np.full((2, len(finite)), np.nan)
    bounds[:, finite] = np.percentile(differences[:, finite], INTERVAL, axis=0)
    return pd.DataFrame(
        {
            "figure": [*names, *columns],
            "first": first_figures,
            "second": second_figures,
            "difference": difference,
            "low": bounds[0],
            "high": bounds[1],
        }
    )


def changed_successes(first: Evaluation, second: Evaluation) -> tuple[int, int]:
    """Return how many queries succeed only in the second, and how many only in the first."""
    _require_pairs(first, second)
    before, after = first.successful, second.successful
    return int((after & ~before).sum()), int((before & ~after).sum())


def common_cases(
    first: Mapping[str, Evaluation], second: Mapping[str, Evaluation]
) -> dict[str, tuple[Evaluation, Evaluation]]:
    """Return the pairs of evaluations with the same name in both; InputError if there are none.

    If both results are a single evaluation, return this pair, whatever the names are.
    """
    if len(first) == len(second) == 1:
        (first_name, first_case), (second_name, second_case) = *first.items(), *second.items()
        return {first_name or second_name: (first_case, second_case)}
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
    """Raise InputError unless the queries have the same seeds, numbers and places."""
    keys = ["seed", "number"]
    tables = [evaluation.queries.reset_index(drop=True) for evaluation in (first, second)]
    same = tables[0][keys].equals(tables[1][keys]) and first.queries.crs == second.queries.crs
    if same:
        places = [np.column_stack([table.geometry.x, table.geometry.y]) for table in tables]
        same = np.array_equal(places[0], places[1])
    if not same:
        raise InputError(
            f"the two evaluations have different queries ({len(tables[0])} and {len(tables[1])}); "
            "compare evaluations with the same places, seeds and number of queries."
        )


def _sample_means(values: NDArray[np.float64], rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the mean of each column over samples of the rows, without NaN."""
    weights = np.stack([np.bincount(row, minlength=len(values)) for row in rows]).astype(np.float64)
    counted = ~np.isnan(values)
    with np.errstate(invalid="ignore"):  # all values of a sample may be NaN
        return np.asarray((weights @ np.where(counted, values, 0.0)) / (weights @ counted))
