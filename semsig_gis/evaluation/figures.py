"""Figures of many scored queries, with intervals: shares, percentiles, groups, calibration.

Every function takes the table of queries that `evaluation.result` keeps. What a query
adds to a figure is a chance, an expectation over all orders of the tied cells.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from semsig_gis.core.errors import InputError
from semsig_gis.core.statistics import quantile_ranks, wilson_interval
from semsig_gis.likelihood.answer_rule import DEFAULT_RULE
from semsig_gis.matching.ties import NEAR_PLACES, expected_recall

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import geopandas as gpd
    from numpy.typing import NDArray

WITHIN = (5, 10, 25, 50, 100)
RECALLS = (1, 10)
LENGTHS = ("1-4", "5-9", "10-19", "20+")
"""Ranges of how many objects are really seen."""
AMBIGUITIES = ("1", "2-9", "10-99", "100-999", "1000+")
"""Ranges of how many cells have the types of the true one."""
ELSEWHERE = "elsewhere"
RULES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99)
BINS = 10


def query_figures(queries: pd.DataFrame, *, cells: int) -> pd.DataFrame:
    """Return what each query adds to each figure: chances in [0, 1], one row a query.

    Columns are ``p5``, ``p10``, ``p25``, ``p50``, ``p100`` (error at most so many metres),
    ``recall1``, ``recall10`` (true cell in the top 1 or 10 % of so many `cells`), ``near1``,
    ``near5``, ``near10``, ``near20`` (one of the best N places within 25 m) and, where a method
    states chances, ``coverage`` (answered), ``precision`` (answered and right; NaN where not
    answered) and ``in_region``.
    """
    names = [*(f"p{metres}" for metres in WITHIN), *(f"near{count}" for count in NEAR_PLACES)]
    figures = {name: queries[name].to_numpy(dtype=np.float64) for name in names}
    for percent in RECALLS:
        figures[f"recall{percent}"] = expected_recall(
            queries["rank_low"], queries["rank_high"], cells=cells, percent=percent
        )
    chance = queries["chance"].to_numpy(dtype=np.float64)
    if not np.isnan(chance).all():
        answered = chance >= DEFAULT_RULE.threshold
        figures["coverage"] = answered.astype(np.float64)
        figures["precision"] = np.where(answered, queries["right"], np.nan)
        figures["in_region"] = queries["in_region"].to_numpy(dtype=np.float64)
    return pd.DataFrame(figures)


def figure_means(figures: pd.DataFrame) -> pd.DataFrame:
    """Return the mean of each figure of `query_figures`, with an interval.

    Columns are ``value``, ``low`` and ``high`` (Wilson's 95 % interval) and ``n``, the number of
    values that are not NaN; the others are NaN where there are none. Where ties make a query count
    with a chance, the interval is a little too wide: such values vary less than those of 0 or 1.
    """
    means = _means(figures.to_numpy(dtype=np.float64))
    names = pd.Index(figures.columns, name="figure")
    return pd.DataFrame(means, index=names, columns=["value", "low", "high", "n"])


def _means(values: NDArray[np.float64]) -> list[tuple[float, float, float, int]]:
    """Return for each column the mean, its interval, and how many values are told."""
    found = []
    for column in values.T:
        told = column[~np.isnan(column)]
        value = float(told.mean()) if told.size else math.nan
        low, high = wilson_interval(value, told.size) if told.size else (math.nan, math.nan)
        found.append((value, low, high, told.size))
    return found


def grouped_means(
    figures: pd.DataFrame, labels: Sequence[str], *, by: str, order: Iterable[str]
) -> pd.DataFrame:
    """Return the means of all figures, one row a group, in the order wanted.

    `labels` has the group of each query. Columns are the one named `by`, ``n``, all figures, and
    ``p50_low`` and ``p50_high`` (95 %). Groups without queries have a row, too.
    """
    groups, values = np.asarray(labels), figures.to_numpy(dtype=np.float64)
    rows = []
    for group in order:
        inside = groups == group
        means = dict(zip(figures, _means(values[inside]), strict=True))
        row: dict[str, Any] = {by: group, "n": int(inside.sum())}
        row |= {str(name): value for name, (value, *_) in means.items()}
        _, row["p50_low"], row["p50_high"], _ = means["p50"]
        rows.append(row)
    return pd.DataFrame(rows)


def length_labels(queries: pd.DataFrame) -> list[str]:
    """Return for each query the one of `LENGTHS` in which its ``length`` is.

    It is ``"0"`` where nothing is seen.
    """
    return _ranges(queries["length"].to_numpy(), LENGTHS)


def ambiguity_labels(queries: pd.DataFrame) -> list[str]:
    """Return for each query the one of `AMBIGUITIES` in which its ``type_group`` is.

    It is ``"0"`` where the true cell is not in the database.
    """
    return _ranges(queries["type_group"].to_numpy(), AMBIGUITIES)


def district_labels(queries: gpd.GeoDataFrame, districts: gpd.GeoDataFrame, name: str) -> list[str]:
    """Return the district in which each query was seen.

    Districts are polygons in any CRS with their names in the column `name`. The label is that of
    the first of several, and ``"elsewhere"`` in none. Raises InputError if there is no such column.
    """
    if name not in districts:
        columns = ", ".join(str(one) for one in districts if one != "geometry")
        msg = f"the districts have no column {name!r}; give one of {columns}."
        raise InputError(msg)
    polygons = districts.to_crs(queries.crs)
    point, polygon = polygons.sindex.query(queries.geometry, predicate="intersects")
    labels = [ELSEWHERE] * len(queries)
    names = districts[name].astype(str).to_list()
    for one, inside in sorted(zip(point.tolist(), polygon.tolist(), strict=True), reverse=True):
        labels[one] = names[inside]
    return labels


def percentile(values: NDArray[np.float64], percent: float) -> tuple[float, float, float]:
    """Return a percentile and the low and high end of its interval of about 95 %.

    NaN is left out; all three are NaN where nothing is left. Values may be infinite. Between
    neighbours the percentile is interpolated, infinite if the upper one is. The ends are order
    statistics and suppose nothing of the distribution: how many values are below the true
    percentile is binomial.
    """
    ordered = np.sort(values[~np.isnan(values)])
    if not ordered.size:
        return math.nan, math.nan, math.nan
    place = percent / 100.0 * (ordered.size - 1)
    below, above = ordered[math.floor(place)], ordered[math.ceil(place)]
    part = place - math.floor(place)
    # Nothing is interpolated towards infinity.
    value = below if part == 0.0 or below == above else below + part * (above - below)
    low, high = quantile_ranks(ordered.size, percent / 100.0)
    return float(value), float(ordered[low - 1]), float(ordered[high - 1])


def coverage_curve(queries: pd.DataFrame) -> pd.DataFrame:
    """Return how many queries are answered, and how many answers are right, rule by rule.

    One row a rule: ``threshold`` (least chance that is answered), ``answered`` (queries),
    ``coverage``, ``precision``, and ``low`` and ``high`` of the precision (95 %).
    """
    chance = queries["chance"].to_numpy(dtype=np.float64)
    right = queries["right"].to_numpy(dtype=np.float64)
    rows = []
    for threshold in RULES:
        answered = chance >= threshold
        told = right[answered]
        precision = float(told.mean()) if told.size else math.nan
        low, high = wilson_interval(precision, told.size) if told.size else (math.nan, math.nan)
        rows.append(
            {
                "threshold": threshold,
                "answered": int(told.size),
                "coverage": told.size / len(chance),
                "precision": precision,
                "low": low,
                "high": high,
            }
        )
    return pd.DataFrame(rows)


def calibration_bins(queries: pd.DataFrame) -> pd.DataFrame:
    """Return how often stated chances come true, one row for each tenth.

    Columns are ``from`` and ``to`` (chances stated), ``n``, ``stated`` (their mean), ``true``
    (share that was right), and ``low`` and ``high`` of that (95 %); NaN in an empty bin.
    """
    chance = queries["chance"].to_numpy(dtype=np.float64)
    right = queries["right"].to_numpy(dtype=np.float64)
    told = ~np.isnan(chance)
    # The last bin holds 1, too. In whole numbers, so that 0.3 is not a rounding below its bin.
    bins = np.minimum(np.floor(np.round(chance[told] * BINS, 9)), BINS - 1)
    rows = []
    for number in range(BINS):
        inside = bins == number
        size = int(inside.sum())
        stated, true = (
            float(values[told][inside].mean()) if size else math.nan for values in (chance, right)
        )
        low, high = wilson_interval(true, size) if size else (math.nan, math.nan)
        ends = {"from": number / BINS, "to": (number + 1) / BINS}
        rows.append({**ends, "n": size, "stated": stated, "true": true, "low": low, "high": high})
    return pd.DataFrame(rows)


def plain_records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a table as values for JSON; None for infinite numbers and NaN."""
    return [
        {
            str(name): None if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in row.items()
        }
        for row in table.to_dict("records")
    ]


def _ranges(sizes: NDArray[np.int64], labels: Sequence[str]) -> list[str]:
    """Return the range that each size is in, such as ``5-9`` or ``20+``."""
    starts = [int(label.rstrip("+").split("-")[0]) for label in labels]
    return [
        "0" if size < 1 else labels[int(place)]
        for size, place in zip(
            sizes.tolist(), np.searchsorted(starts, sizes, side="right") - 1, strict=True
        )
    ]
