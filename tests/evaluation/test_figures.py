"""Figures compared with cases counted by hand, including ties."""

from __future__ import annotations

import math

import geopandas as gpd
import numpy as np
import pandas as pd
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core import InputError, wilson_interval
from semsig_gis.evaluation import (
    AMBIGUITIES,
    LENGTHS,
    calibration_bins,
    coverage_curve,
    district_labels,
    figure_means,
    grouped_means,
    percentile,
    query_figures,
    range_labels,
)
from semsig_gis.localization import THRESHOLDS

NAN = math.nan

# Five queries of a database of 200 cells. The first is right; the second ties with one cell 30 m
# away; the third has an error of 60 m; the fourth a large error; the fifth has no objects.
ERRORS = ([0.0], [0.0, 30.0], [60.0], [900.0], [math.inf])
RANKS = ((1, 1), (1, 2), (3, 4), (150, 150), (200, 200))
CHANCES = (0.97, 0.5, 0.91, 0.2, NAN)


def table() -> pd.DataFrame:
    errors = [np.array(values) for values in ERRORS]
    within = {x: [(values <= x).mean() for values in errors] for x in THRESHOLDS}
    low, high = zip(*RANKS, strict=True)
    stated = ~np.isnan(CHANCES)
    return pd.DataFrame(
        {
            "error_m": [values.mean() for values in errors],
            **{f"p{x}": shares for x, shares in within.items()},
            **{f"near{count}": within[25] for count in (1, 5, 10, 20)},
            "rank_low": low,
            "rank_high": high,
            "chance": CHANCES,
            "right": np.where(stated, within[50], NAN),
            "in_region": stated.astype(float),
        }
    )


def test_figures_counted_by_hand() -> None:
    means = figure_means(query_figures(table(), cells=200))
    expected = {
        "p5": 1.5 / 5,
        "p10": 1.5 / 5,
        "p25": 1.5 / 5,
        "p50": 2.0 / 5,
        "p100": 3.0 / 5,
        "near1": 1.5 / 5,
        "near20": 1.5 / 5,
        # 1 % are two cells, 10 % are twenty: the second query is in both, the third only in 10 %.
        "recall1": 2.0 / 5,
        "recall10": 3.0 / 5,
        "coverage": 2.0 / 5,
        "precision": 1.0 / 2,
        "in_region": 4.0 / 5,
    }
    assert {name: means.loc[name, "value"] for name in expected} == pytest.approx(expected)
    assert means.loc["precision", "n"] == 2
    assert means.loc["p50", "n"] == 5
    for name, value in expected.items():
        low, high = wilson_interval(value, int(means["n"][name]))
        assert (means["low"][name], means["high"][name]) == pytest.approx((low, high))


def test_means_are_grouped() -> None:
    figures = query_figures(table(), cells=200)
    labels = ["a", "b", "a", "b", "a"]
    means = grouped_means(figures, labels, by="part", order=["b", "a", "c"])
    assert means["part"].tolist() == ["b", "a", "c"]
    assert means["n"].tolist() == [2, 3, 0]
    assert means["p50"].iloc[:2].tolist() == pytest.approx([0.5, 1 / 3])
    assert means["p50"].isna().tolist() == [False, False, True]
    low, high = wilson_interval(0.5, 2)
    assert (means["p50_low"][0], means["p50_high"][0]) == pytest.approx((low, high))


def test_sizes_are_labelled_by_range() -> None:
    sizes = [0, 1, 4, 5, 9, 10, 19, 20, 400]
    expected = ["0", "1-4", "1-4", "5-9", "5-9", "10-19", "10-19", "20+", "20+"]
    assert range_labels(np.array(sizes), LENGTHS) == expected
    groups = [0, 1, 2, 9, 10, 99, 100, 999, 1000]
    expected = ["0", "1", "2-9", "2-9", "10-99", "10-99", "100-999", "100-999", "1000+"]
    assert range_labels(np.array(groups), AMBIGUITIES) == expected


def test_queries_are_labelled_by_district() -> None:
    places = [shapely.Point(x, 5.0) for x in (1.0, 10.0, 15.0, 25.0)]
    queries = gpd.GeoDataFrame(geometry=places, crs=2154)
    boxes = [shapely.box(0, 0, 10, 10), shapely.box(10, 0, 20, 10)]
    districts = gpd.GeoDataFrame({"name": [7, "new"]}, geometry=boxes, crs=2154)
    # The second place is on the border: the first district that contains it counts.
    expected = ["7", "7", "new", "elsewhere"]
    assert district_labels(queries, districts, "name") == expected
    far = gpd.GeoDataFrame(geometry=[shapely.Point(765_205, 6_275_005)], crs=2154)
    block = gpd.GeoSeries([shapely.box(765_200, 6_275_000, 765_210, 6_275_010)], crs=2154)
    degrees = gpd.GeoDataFrame({"name": ["town"]}, geometry=block.to_crs(4326).to_numpy(), crs=4326)
    assert district_labels(far, degrees, "name") == ["town"]
    with refused(InputError, "'nom'", "name"):
        district_labels(queries, districts, "nom")


@pytest.mark.parametrize(
    ("values", "percent", "expected"),
    [
        ([1.0, 2.0, NAN], 50, 1.5),
        ([0.0, 1.0, math.inf, math.inf], 50, math.inf),
        ([0.0, 1.0, math.inf], 50, 1.0),
        ([math.inf, math.inf], 90, math.inf),
        ([NAN], 50, NAN),
    ],
)
def test_percentiles_of_missing_and_infinite_values(
    values: list[float], percent: float, expected: float
) -> None:
    value, low, high = percentile(np.array(values), percent)
    assert [value] == pytest.approx([expected], nan_ok=True)
    assert low <= value <= high or math.isnan(low) is math.isnan(high) is True


@given(
    values=st.lists(st.floats(0, 1e4), min_size=1, max_size=60), percent=st.sampled_from([50, 90])
)
def test_percentiles_agree_with_numpy(values: list[float], percent: float) -> None:
    value, low, high = percentile(np.array(values), percent)
    assert value == pytest.approx(np.percentile(values, percent))
    assert low <= value + 1e-9
    assert value <= high + 1e-9


def test_intervals_contain_the_median_in_95_percent() -> None:
    rng = np.random.default_rng(5)
    count = 0
    for _ in range(1000):
        _, low, high = percentile(rng.exponential(1.0, 200), 50)
        count += low <= math.log(2.0) <= high
    assert 930 <= count <= 985


def test_coverage_curve_by_hand() -> None:
    curve = coverage_curve(table()).set_index("threshold")
    answered = {0.0: 4, 0.2: 4, 0.3: 3, 0.5: 3, 0.6: 2, 0.9: 2, 0.95: 1, 0.98: 0}
    assert {key: curve["answered"][key] for key in answered} == answered
    assert curve["coverage"][0.9] == pytest.approx(2 / 5)
    right = {0.0: 2.0 / 4, 0.3: 2.0 / 3, 0.9: 1.0 / 2, 0.95: 1.0}
    assert {key: curve["precision"][key] for key in right} == pytest.approx(right)
    assert math.isnan(curve["precision"][0.98])
    assert (curve["low"][0.95], curve["high"][0.95]) == wilson_interval(1.0, 1)


def test_calibration_by_hand() -> None:
    bins = calibration_bins(table())
    assert bins["n"].tolist() == [0, 0, 1, 0, 0, 1, 0, 0, 0, 2]
    assert bins["stated"].iloc[9] == pytest.approx(0.94)
    assert bins["true"].iloc[[2, 5, 9]].tolist() == pytest.approx([0.0, 1.0, 0.5])
    assert bins["true"].isna().sum() == 7
    assert (bins["low"].iloc[9], bins["high"].iloc[9]) == wilson_interval(0.5, 2)
    edges = calibration_bins(pd.DataFrame({"chance": [0.0, 0.3, 1.0], "right": [0.0, 0.5, 1.0]}))
    assert edges["n"].tolist() == [1, 0, 0, 1, 0, 0, 0, 0, 0, 1]


@given(seed=st.integers(0, 2**32))
def test_true_probabilities_are_calibrated(seed: int) -> None:
    rng = np.random.default_rng(seed)
    chance = rng.random(4000)
    right = (rng.random(4000) < chance).astype(float)
    bins = calibration_bins(pd.DataFrame({"chance": chance, "right": right}))
    assert bins["n"].sum() == 4000
    spread = np.sqrt(bins["stated"] * (1 - bins["stated"]) / bins["n"])
    assert ((bins["stated"] - bins["true"]).abs() < 6 * spread + 1e-9).all()
