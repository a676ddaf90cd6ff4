from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from noisy_cells import random_database
from small_city import chances_of
from worlds import random_town

from semsig_gis.evaluation.identify.check import (
    ChanceBin,
    IdentifiabilityCheck,
    check_identifiability,
)
from semsig_gis.evaluation.identify.identify import identify
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.noise.model import named_noise
from semsig_gis.reports.identifiability import (
    check_tables,
    identifiability_page,
    identifiability_tables,
)
from semsig_gis.reports.page import write_report

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

TOLD = chances_of(random_database(3, cells=40, classes=3))
TENTH = ChanceBin(
    low=0.2, high=0.3, queries=1234, stated=0.25, true=0.3, true_low=0.2, true_high=0.4
)
CHECK = IdentifiabilityCheck(
    queries=2000,
    seed=1,
    found=0.4,
    attainable=0.61,
    bins=(TENTH,),
    correlations={"found": 0.5, "near": 0.4, "length": -0.3, "type_group": math.nan},
)


def test_tables(snapshot: Callable[[str, str], None]) -> None:
    whole, plain = identifiability_tables(TOLD)
    facts = TOLD.summary()
    cells = {row[0]: row[1] for row in whole.rows}
    assert cells["chance that the answer is within 30 m"] == f"{100 * facts['chance_found']:.1f} %"
    assert cells["bits left"] == f"{facts['bits_left']:.2f} of {math.log2(40):.2f}"
    _, counted = identifiability_tables(TOLD, object_counts={1: 2000, 3: 10})
    assert [row[:3] for row in counted.rows] == list(plain.rows)
    gain = next(item.near for item in TOLD.classes if item.code == 3)
    lights = next(row for row in counted.rows if row[0].startswith("Street light"))
    assert lights[3:] == ("10", f"{1e5 * gain / 10:+.3f} %")
    tables = (whole, plain, counted, *check_tables(CHECK))
    snapshot("identifiability.md", "\n".join(table.markdown() for table in tables))


def test_the_numbers_of_a_page_are_those_of_the_check(tmp_path: Path) -> None:
    index = build_index(random_town().database, named_noise("light"))
    told = identify(index, trials=40, class_trials=5)
    check = check_identifiability(told, index, queries=60)
    page = identifiability_page(told, check, name="<town>", object_counts={3: 5})
    parts = {one.name: one for one in page.sections}
    ranks = {one.row: one.ours for one in parts["ranks"].numbers}
    assert ranks["chance to be found"] == check.correlations["found"]
    (plot,) = parts["calibration"].plots
    assert plot.diagonal
    assert plot.curves[0].x == tuple(one.stated for one in check.bins)
    assert plot.curves[0].y == tuple(one.true for one in check.bins)
    asked = [one.ours for one in parts["calibration"].numbers if one.column == "queries"]
    assert sum(one or 0 for one in asked) == 60
    assert any(one.column == "objects" for one in parts["classes"].numbers)
    write_report(page, tmp_path)
    assert "&lt;town&gt;" in (tmp_path / "report.html").read_text("utf-8")
    assert (tmp_path / "figures" / "identifiability-calibration.svg").is_file()


def test_correlations_that_there_are_not() -> None:
    nothing = dict.fromkeys(CHECK.correlations, math.nan)
    check = replace(CHECK, correlations=nothing, attainable=math.nan)
    assert check_tables(check)[1].note == ""
    page = identifiability_page(TOLD, check, name="town")
    ranks = next(one for one in page.sections if one.name == "ranks")
    assert {one.ours for one in ranks.numbers} == {None}
    assert ranks.text == ()
    assert not any(one.column == "objects" for part in page.sections for one in part.numbers)
