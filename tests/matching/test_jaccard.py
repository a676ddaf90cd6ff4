from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.database.sequences import SequenceTable
from semsig_gis.matching.metrics import jaccard

ONE = st.lists(st.integers(0, 8), max_size=8)


def slow(left: list[int], right: list[int]) -> float:
    either = set(left) | set(right)
    return 1 - len(set(left) & set(right)) / len(either) if either else 0


@pytest.mark.parametrize("normalized", [True, False])
@given(query=ONE, row=ONE)
def test_one_minus_common_over_all(*, normalized: bool, query: list[int], row: list[int]) -> None:
    table = SequenceTable.from_csr(np.array(row, np.uint8), np.array([0, len(row)]))
    found = jaccard.distances([np.array(query, np.uint8)], table, normalized=normalized)
    assert found[0, 0] == np.float32(slow(query, row))
