from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.core import InputError
from semsig_gis.localization import (
    THRESHOLDS,
    best_cells,
    chance_within,
    expected_best,
    expected_recall,
    rank_range,
    top_candidates,
)

Errors = st.lists(st.integers(0, 60).map(float), max_size=6)


@given(
    size=st.integers(1, 3000), levels=st.integers(1, 400), seed=st.integers(0, 99), data=st.data()
)
def test_best_cells_include_ties_with_last(
    size: int, levels: int, seed: int, data: st.DataObject
) -> None:
    scores = np.random.default_rng(seed).integers(0, levels, size).astype(np.float32)
    count = data.draw(st.integers(1, size))
    cut = np.sort(scores)[count - 1]
    assert best_cells(scores, count).tolist() == np.flatnonzero(scores <= cut).tolist()


def test_expectation_is_exact_for_many_ties() -> None:
    tied = np.repeat([5.0, 500.0], [7, 13])
    _, within = expected_best([], tied, slots=4, thresholds=[5])
    assert within[0] == pytest.approx(1 - math.comb(13, 4) / math.comb(20, 4), rel=1e-12)
    expected, within = expected_best([], np.arange(300_000.0), slots=1, thresholds=[29_999])
    assert (expected, within[0]) == pytest.approx((299_999 / 2, 0.1), rel=1e-9)


@given(better=Errors, tied=Errors.filter(bool), data=st.data())
def test_expectation_equals_mean_of_all_draws(
    better: list[float], tied: list[float], data: st.DataObject
) -> None:
    slots = data.draw(st.integers(1, len(tied)))
    draws = [min((*better, *draw)) for draw in itertools.combinations(tied, slots)]
    limits = [*THRESHOLDS, *better, *tied]
    expected, within = expected_best(better, tied, slots=slots, thresholds=limits)
    assert expected == pytest.approx(np.mean(draws), abs=1e-9)
    shares = [np.mean([best <= limit for best in draws]) for limit in limits]
    assert within == pytest.approx(shares, abs=1e-12)
    chances = [chance_within(better, tied, slots=slots, metres=limit) for limit in limits]
    assert chances == pytest.approx(shares, abs=1e-12)


@given(
    scores=st.lists(st.integers(0, 2), min_size=1, max_size=6),
    percent=st.integers(1, 100),
    data=st.data(),
)
def test_cut_and_ranks_equal_all_orders_of_ties(
    scores: list[int], percent: int, data: st.DataObject
) -> None:
    n = len(scores)
    cell = data.draw(st.integers(0, n - 1))
    top = data.draw(st.integers(1, n))
    errors = np.abs(np.arange(n) - cell) * 10.0
    orders = [sorted(order, key=scores.__getitem__) for order in itertools.permutations(range(n))]
    values = np.array(scores, dtype=np.float32)
    better, tied = top_candidates(values, top)
    expected, within = expected_best(errors[better], errors[tied], slots=top - len(better))
    best = np.array([errors[order[:top]].min() for order in orders])
    assert expected == pytest.approx(best.mean())
    assert within == pytest.approx([(best <= limit).mean() for limit in THRESHOLDS])
    ranks = np.array([order.index(cell) + 1 for order in orders])
    low, high = rank_range(values, cell)
    assert (low, high) == (ranks.min(), ranks.max())
    recall = expected_recall([low], [high], cells=n, percent=percent)
    assert recall[0] == pytest.approx((ranks <= percent * n // 100).mean())


def test_recall_rounds_number_of_cells_down_and_refuses_other_percentages() -> None:
    # 7 % of 100 cells are seven, although 0.07 * 100 is slightly more.
    assert expected_recall([7, 8], [7, 8], cells=100, percent=7).tolist() == [1, 0]
    assert expected_recall([2], [2], cells=199, percent=1).tolist() == [0]
    assert expected_recall([290], [290], cells=1000, percent=29).tolist() == [1]
    for percent in (0, -1, 100.5, math.nan):
        with pytest.raises(InputError, match="percentage above 0 and at most 100"):
            expected_recall([1], [1], cells=10, percent=percent)
