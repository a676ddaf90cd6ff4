"""Tests of semsig_gis.reports.parts."""

from __future__ import annotations

import pytest

from semsig_gis.reports.parts import Number


@pytest.mark.parametrize(
    ("ours", "paper", "difference"),
    [(0.5, 0.3733, 0.1267), (None, 0.3733, None), (0.5, None, None)],
)
def test_the_difference_needs_both_figures(
    ours: float | None, paper: float | None, difference: float | None
) -> None:
    assert Number(row="R", column="P", ours=ours, paper=paper).difference == difference
