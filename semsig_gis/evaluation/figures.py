"""Figures of scored queries with intervals: shares, percentiles, groups and calibration.

The value of a query in a figure is a probability, over all orders of the tied cells.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from typing_extensions import TypedDict

from semsig_gis.core import ERROR_BREAKS, InputError, quantile_ranks, wilson_interval
from semsig_gis.localization import DEFAULT_RULE, NEAR_PLACES, expected_recall

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import geopandas as gpd
    from numpy.typing import NDArray

RECALLS = (1, 10)
LENGTHS = ("1-4", "5-9", "10-19", "20+")  # objects visible from the true place
AMBIGUITIES = ("1", "2-9", "10-99", "100-999", "1000+")  # cells with the types of the true one
ELSEWHERE = "elsewhere"
ANSWER_THRESHOLDS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99)
CALIBRATION_BINS = 10


class MeanRecord(TypedDict):
    """A row of `figure_means` as plain values."""

    figure: str
    value: float | None
    low: float | None
    high: float | None
    n: int


class CoverageRecord(TypedDict):
    """A row of `coverage_curve` as plain values."""

    threshold: float
    answered: int
    coverage: float
    precision: float | None
    low: float | None
    high: float | None


CalibrationRecord = TypedDict(
    "CalibrationRecord",
    {
        "from": float,
        "to": float,
        "n": int,
        "stated": float | None,
        "true": float | None,
        "low": float | None,
        "high": float | None,
    },
)
"""A row of `calibration_bins` as plain values."""


def query_figures(queries: pd.DataFrame, *, cells: int) -> pd.DataFrame:
    """Return the value of each query in each figure: probabilities, one row for each query.

    Columns are ``p5``, ... (error at most 5 m, ...), ``near1``, ... (one of the best N places
    within 25 m), ``recall1``, ``recall10`` (true cell in the top 1 or 10 % of all `cells`) and, if
    the method gives probabilities, ``coverage`` (answered), ``precision`` (answered and right; NaN
    if not answered) and ``in_region``.
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

    Columns are ``value``, ``low`` and ``high`` (Wilson's 95 % interval; slightly too wide for
    fractional values of ties) and ``n``, the number of values that are not NaN.
    """
    means = [_share(values) for values in figures.to_numpy(dtype=np.float64).T]
    names = pd.Index(figures.columns, name="figure")
    return pd.DataFrame(means, index=names, columns=["value", "low", "high", "n"])


def _share(values: NDArray[np.float64]) -> tuple[float, float, float, int]:
    """Return mean, ends of the Wilson interval, and number of the values that are not NaN."""
    chances = values[~np.isnan(values)]
    if not chances.size:
        return math.nan, math.nan, math.nan, 0
    share = float(chances.mean())
    return share, *wilson_interval(share, chances.size), chances.size


def grouped_means(
    figures: pd.DataFrame, labels: Sequence[str], *, by: str, order: Iterable[str]
) -> pd.DataFrame:
    """Return the means of all figures for each group of `order`; a group may be empty.

    `labels` has the group of each query. Columns are `by` (the group), ``n``, all figures, and
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
    """Return the bin label of each number, such as ``5-9`` or ``20+``; ``"0"`` below all bins."""
    starts = [int(label.rstrip("+").split("-")[0]) for label in ranges]
    places = np.searchsorted(starts, sizes, side="right")
    return [("0", *ranges)[place] for place in places.tolist()]


def district_labels(queries: gpd.GeoDataFrame, districts: gpd.GeoDataFrame, name: str) -> list[str]:
    """Return the name of the first district that contains each query, or ``"elsewhere"``.

    Districts are polygons in any CRS with names in the column `name`; InputError if it is missing.
    """
    if name not in districts:
        columns = ", ".join(str(column) for column in districts if column != "geometry")
        raise InputError(f"the districts have no column {name!r}; give one of {columns}.")
    polygons = districts.to_crs(queries.crs)
    points, areas = polygons.sindex.query(queries.geometry, predicate="intersects")
    labels = [ELSEWHERE] * len(queries)
    names = districts[name].astype(str).to_list()
    # In reverse, so that the first district of a point is written last and stays.
    for point, area in sorted(zip(points.tolist(), areas.tolist(), strict=True), reverse=True):
        labels[point] = names[area]
    return labels


def percentile(values: NDArray[np.float64], percent: float) -> tuple[float, float, float]:
    """Return a percentile as `percentiles` does, and the ends of its interval of about 95 %.

    The ends are order statistics: the number of values below the true percentile is binomial.
    """
    ordered = np.sort(values[~np.isnan(values)])
    if not ordered.size:
        return math.nan, math.nan, math.nan
    low, high = quantile_ranks(ordered.size, percent / 100.0)
    (value,) = percentiles(ordered[None], percent).tolist()
    return value, float(ordered[low - 1]), float(ordered[high - 1])


def percentiles(samples: NDArray[np.float64], percent: float) -> NDArray[np.float64]:
    """Return a percentile of each row without NaN; NaN if a row has no other values.

    It is interpolated between neighbours, and infinite if the upper one is.
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
    """Return how many queries are answered, and how many answers are right, by threshold.

    One row for each ``threshold`` (least stated probability that is answered): ``answered``
    (queries), ``coverage``, ``precision``, and ``low`` and ``high`` of the precision (95 %).
    """
    chance = queries["chance"].to_numpy(dtype=np.float64)
    right = queries["right"].to_numpy(dtype=np.float64)
    rows = []
    for threshold in ANSWER_THRESHOLDS:
        answered = chance >= threshold
        precision, low, high, count = _share(right[answered])
        rows.append((threshold, count, count / len(chance), precision, low, high))
    columns = ["threshold", "answered", "coverage", "precision", "low", "high"]
    return pd.DataFrame(rows, columns=columns)


def calibration_bins(queries: pd.DataFrame) -> pd.DataFrame:
    """Return stated probabilities and the share of right answers, one row for each tenth.

    Columns are ``from`` and ``to`` (stated probabilities), ``n``, ``stated`` (their mean), ``true``
    (share of right answers), and ``low`` and ``high`` of that (95 %); NaN in an empty bin.
    """
    chance = queries["chance"].to_numpy(dtype=np.float64)
    right = queries["right"].to_numpy(dtype=np.float64)
    # The last bin contains 1. Rounded first, so that 0.3 is not below its bin.
    bins = np.floor(np.round(chance * CALIBRATION_BINS, 9))
    bins = np.minimum(bins, CALIBRATION_BINS - 1)
    rows = []
    for number in range(CALIBRATION_BINS):
        inside = bins == number
        stated, _, _, count = _share(chance[inside])
        true, low, high, _ = _share(right[inside])
        ends = {"from": number / CALIBRATION_BINS, "to": (number + 1) / CALIBRATION_BINS}
        rows.append({**ends, "n": count, "stated": stated, "true": true, "low": low, "high": high})
    return pd.DataFrame(rows)


def plain_records(table: pd.DataFrame) -> list[Any]:
    """Return the rows of a table as values for JSON, with None for infinite numbers and NaN."""
    return [
        {
            str(name): finite_or_none(value) if isinstance(value, float) else value
            for name, value in row.items()
        }
        for row in table.to_dict("records")
    ]


def finite_or_none(value: float) -> float | None:
    """Return a number, or None if it is infinite or NaN, which JSON cannot store."""
    return value if math.isfinite(value) else None
