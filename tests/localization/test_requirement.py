"""Requirements on the objects that a cell sees."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core import WILDCARD, InputError, UnknownNameError
from semsig_gis.database import SequenceTable
from semsig_gis.localization import Requirement
from semsig_gis.sources import paper_taxonomy

if TYPE_CHECKING:
    from semsig_gis.core import SemsigError


PAPER = paper_taxonomy()
UNREADABLE = ["", "M,", "M;B", "B>2", "B>=", "B>=-1", "B=x", "MB"]
ROWS = st.lists(st.lists(st.integers(1, 4), max_size=6), max_size=20)
LIMIT = st.tuples(
    st.sampled_from([WILDCARD, 1, 2, 3, 11]),
    st.integers(0, 3),
    st.integers(3, 5) | st.just(math.inf),
)


@given(ROWS, st.lists(LIMIT, max_size=3))
def test_mask_equals_check_of_each_cell(
    rows: list[list[int]], limits: list[tuple[int, int, float]]
) -> None:
    expected = []
    for row in rows:
        counts = Counter(row) | Counter({WILDCARD: len(row)})
        expected.append(all(low <= counts[code] <= high for code, low, high in limits))
    flat = np.array([value for row in rows for value in row], np.uint8)
    table = SequenceTable.from_csr(flat, np.cumsum([0, *map(len, rows)]))
    assert Requirement(tuple(limits)).met(table).tolist() == expected


@pytest.mark.parametrize(
    ("text", "limits"),
    [
        ("M", {11: (1, math.inf)}),
        ("2B", {1: (2, math.inf)}),
        ("B>=2", {1: (2, math.inf)}),
        (" B <= 5 ", {1: (0, 5)}),
        ("B=0", {1: (0, 0)}),
        ("?=12", {WILDCARD: (12, 12)}),
        ("2B,B<=5,M", {1: (2, 5), 11: (1, math.inf)}),
    ],
)
def test_requirement_is_parsed(text: str, limits: dict[int, tuple[int, float]]) -> None:
    read = Requirement.parse(text, PAPER).limits
    assert {code: (low, high) for code, low, high in read} == limits


@pytest.mark.parametrize(
    ("kind", "text", "words"),
    [
        *((InputError, text, "cannot be read") for text in UNREADABLE),
        (InputError, "3B,B<=2", "at least 3 and at most 2 of 'B'"),
        (UnknownNameError, "2", "symbol '2'"),
        (UnknownNameError, "Z", "'Z'"),
    ],
)
def test_invalid_text_is_refused(kind: type[SemsigError], text: str, words: str) -> None:
    with refused(kind, words):
        Requirement.parse(text, PAPER)
