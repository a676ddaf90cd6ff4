from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.database.sequences import SequenceTable
from semsig_gis.matching.metrics import histogram

ONE = st.lists(st.integers(0, 4), max_size=12)


def slow_sum(left: list[int], right: list[int]) -> float:
    x, y = Counter(left), Counter(right)
    return sum(min(x[value], y[value]) / max(x[value], y[value]) for value in {*x, *y})


def distance(query: list[int], row: list[int], *, normalized: bool) -> float:
    table = SequenceTable.from_csr(np.array(row, np.uint8), np.array([0, len(row)]))
    found = histogram.distances([np.array(query, np.uint8)], table, normalized=normalized)
    return float(found[0, 0])


@given(query=ONE, row=ONE)
def test_raw_is_minus_the_sum(query: list[int], row: list[int]) -> None:
    expected = pytest.approx(-slow_sum(query, row), abs=1e-6)
    assert distance(query, row, normalized=False) == expected


@given(query=ONE, row=ONE)
def test_normalized_is_one_minus_the_mean(query: list[int], row: list[int]) -> None:
    either = {*query, *row}
    expected = 1 - slow_sum(query, row) / len(either) if either else 0
    assert distance(query, row, normalized=True) == pytest.approx(expected, abs=1e-6)
