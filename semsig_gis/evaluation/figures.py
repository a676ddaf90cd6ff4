"""Figures of many scored queries, with intervals: shares, percentiles, groups, calibration.

What a query adds to a figure is a chance, an expectation over all orders of the tied cells.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from semsig_gis.core import ERROR_BREAKS, InputError, quantile_ranks, wilson_interval
from semsig_gis.localization import DEFAULT_RULE, NEAR_PLACES, expected_recall

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import geopandas as gpd
    from numpy.typing import NDArray

RECALLS = (1, 10)
LENGTHS = ("1-4", "5-9", "10-19", "20+")  # objects that are really seen
AMBIGUITIES = ("1", "2-9", "10-99", "100-999", "1000+")  # cells with the types of the true one
ELSEWHERE = "elsewhere"
RULES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99)
BINS = 10


def query_figures(queries: pd.DataFrame, *, cells: int) -> pd.DataFrame:
    """Return what each query adds to each figure: chances in [0, 1], one row a query.

    Columns are ``p5``, ... (error at most so many metres), ``near1``, ... (one of the best N places
    within 25 m), ``recall1``, ``recall10`` (true cell in the top 1 or 10 % of so many `cells`) and,
    where a method states chances, ``coverage`` (answered), ``precision`` (answered and right; NaN
    where not answered) and ``in_region``.
    """
    names = [*(f"p{metres}" for metres in ERROR_BREAKS), *(f"near{count}" for count in NEAR_PLACES)]
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

    Columns are ``value``, ``low`` and ``high`` (Wilson's 95 % interval; a little wide where ties
    make a query count with a chance) and ``n``, the number of values that are not NaN.
    """
    means = [_share(values) for values in figures.to_numpy(dtype=np.float64).T]
    names = pd.Index(figures.columns, name="figure")
    return pd.DataFrame(means, index=names, columns=["value", "low", "high", "n"])


def _share(values: NDArray[np.float64]) -> tuple[float, float, float, int]:
    """Return the mean of the values that are not NaN, its interval, and how many they are."""
    chances = values[~np.isnan(values)]
    if not chances.size:
        return math.nan, math.nan, math.nan, 0
    share = float(chances.mean())
    return share, *wilson_interval(share, chances.size), chances.size


def grouped_means(
    figures: pd.DataFrame, labels: Sequence[str], *, by: str, order: Iterable[str]
) -> pd.DataFrame:
    """Return the means of all figures, one row a group in the order wanted, with queries or not.

    `labels` has the group of each query. Columns are the one named `by`, ``n``, all figures, and
    ``p50_low`` and ``p50_high`` (95 %).
    """
    groups, values = np.asarray(labels), figures.to_numpy(dtype=np.float64)
    rows = []
    for group in order:
        inside = groups == group
        means = dict(zip(figures, map(_share, values[inside].T), strict=True))
        row: dict[str, Any] = {by: group, "n": int(inside.sum())}
        row |= {str(name): value for name, (value, *_) in means.items()}
        _, row["p50_low"], row["p50_high"], _ = means["p50"]
        rows.append(row)
    return pd.DataFrame(rows)


def range_labels(sizes: NDArray[np.int64], ranges: Sequence[str]) -> list[str]:
    """Return the range that each size is in, such as ``5-9`` or ``20+``; ``"0"`` for none."""
    starts = [int(label.rstrip("+").split("-")[0]) for label in ranges]
    places = np.searchsorted(starts, sizes, side="right")
    return [("0", *ranges)[place] for place in places.tolist()]


def district_labels(queries: gpd.GeoDataFrame, districts: gpd.GeoDataFrame, name: str) -> list[str]:
    """Return the name of the first district around each query, ``"elsewhere"`` in none.

    Districts are polygons in any CRS, named by the column `name`; InputError if there is none.
    """
    if name not in districts:
        columns = ", ".join(str(one) for one in districts if one != "geometry")
        raise InputError(f"the districts have no column {name!r}; give one of {columns}.")
    polygons = districts.to_crs(queries.crs)
    point, polygon = polygons.sindex.query(queries.geometry, predicate="intersects")
    labels = [ELSEWHERE] * len(queries)
    names = districts[name].astype(str).to_list()
    for one, inside in sorted(zip(point.tolist(), polygon.tolist(), strict=True), reverse=True):
        labels[one] = names[inside]
    return labels


def percentile(values: NDArray[np.float64], percent: float) -> tuple[float, float, float]:
    """Return a percentile as `percentiles`, and the ends of its interval of about 95 %.

    The ends are order statistics: how many values are below the true percentile is binomial.
    """
    ordered = np.sort(values[~np.isnan(values)])
    if not ordered.size:
        return math.nan, math.nan, math.nan
    low, high = quantile_ranks(ordered.size, percent / 100.0)
    (value,) = percentiles(ordered[None], percent).tolist()
    return value, float(ordered[low - 1]), float(ordered[high - 1])


def percentiles(samples: NDArray[np.float64], percent: float) -> NDArray[np.float64]:
    """Return a percentile of each row, NaN left out; NaN where nothing is left.

    Between neighbours it is interpolated, infinite if the upper one is.
    """
    ordered = np.sort(samples, axis=1)  # NaN comes last
    last = np.maximum((~np.isnan(ordered)).sum(axis=1) - 1, 0)
    place = percent / 100.0 * last
    rows = np.arange(len(ordered))
    below, above = (ordered[rows, end(place).astype(np.int64)] for end in (np.floor, np.ceil))
    part: NDArray[np.float64] = place - np.floor(place)
    with np.errstate(invalid="ignore"):  # of two infinite neighbours
        between = below + part * (above - below)
    return np.asarray(np.where((part == 0.0) | (below == above), below, between))


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
        precision, low, high, count = _share(right[answered])
        rows.append((threshold, count, count / len(chance), precision, low, high))
    columns = ["threshold", "answered", "coverage", "precision", "low", "high"]
    return pd.DataFrame(rows, columns=columns)


def calibration_bins(queries: pd.DataFrame) -> pd.DataFrame:
    """Return how often stated chances come true, one row for each tenth.

    Columns are ``from`` and ``to`` (chances stated), ``n``, ``stated`` (their mean), ``true``
    (share that was right), and ``low`` and ``high`` of that (95 %); NaN in an empty bin.
    """
    chance = queries["chance"].to_numpy(dtype=np.float64)
    right = queries["right"].to_numpy(dtype=np.float64)
    # The last bin holds 1, too. In whole numbers, so that 0.3 is not a rounding below its bin.
    bins = np.minimum(np.floor(np.round(chance * BINS, 9)), BINS - 1)
    rows = []
    for number in range(BINS):
        inside = bins == number
        stated, _, _, count = _share(chance[inside])
        true, low, high, _ = _share(right[inside])
        ends = {"from": number / BINS, "to": (number + 1) / BINS}
        rows.append({**ends, "n": count, "stated": stated, "true": true, "low": low, "high": high})
    return pd.DataFrame(rows)


def plain_records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a table as values for JSON; None for infinite numbers and NaN."""
    return [
        {
            str(name): finite_or_none(value) if isinstance(value, float) else value
            for name, value in row.items()
        }
        for row in table.to_dict("records")
    ]


def finite_or_none(value: float) -> float | None:
    """Return a number, or None for what JSON cannot hold."""
    return value if math.isfinite(value) else None
