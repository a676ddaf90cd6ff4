"""Tests of semsig_gis.reports.identifiability."""

from __future__ import annotations

from dataclasses import replace
from math import nan
from typing import TYPE_CHECKING

from worlds import random_town

from semsig_gis.evaluation.identify.check import check_identifiability
from semsig_gis.evaluation.identify.identify import identify
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.noise.model import named_noise
from semsig_gis.reports.identifiability import identifiability_page
from semsig_gis.reports.page import write_report

if TYPE_CHECKING:
    from pathlib import Path

INDEX = build_index(random_town().database, named_noise("light"))
TOLD = identify(INDEX, trials=40, class_trials=5)
CHECK = check_identifiability(TOLD, INDEX, queries=60)


def test_the_numbers_are_those_of_the_check(tmp_path: Path) -> None:
    page = identifiability_page(TOLD, CHECK, name="<town>", object_counts={3: 5})
    parts = {one.name: one for one in page.sections}
    ranks = {one.row: one.ours for one in parts["ranks"].numbers}
    assert ranks["chance to be found"] == CHECK.correlations["found"]
    (plot,) = parts["calibration"].plots
    assert plot.diagonal
    assert plot.curves[0].x == tuple(one.stated for one in CHECK.bins)
    assert plot.curves[0].y == tuple(one.true for one in CHECK.bins)
    asked = [one.ours for one in parts["calibration"].numbers if one.column == "queries"]
    assert sum(one or 0 for one in asked) == 60
    assert any(one.column == "objects" for one in parts["classes"].numbers)
    write_report(page, tmp_path)
    assert "&lt;town&gt;" in (tmp_path / "report.html").read_text("utf-8")
    assert (tmp_path / "figures" / "identifiability-calibration.svg").is_file()


def test_correlations_that_there_are_not() -> None:
    none = replace(CHECK, correlations=dict.fromkeys(CHECK.correlations, nan), attainable=nan)
    page = identifiability_page(TOLD, none, name="town")
    ranks = next(one for one in page.sections if one.name == "ranks")
    assert {one.ours for one in ranks.numbers} == {None}
    assert ranks.text == ()
    assert not any(one.column == "objects" for part in page.sections for one in part.numbers)
