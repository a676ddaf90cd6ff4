"""Tests of semsig_gis.experiments.paper.report."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from reproductions import QUERIES

from semsig_gis.experiments.paper.report import reproduction_report
from semsig_gis.reports import paris
from semsig_gis.reports.page import write_report

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.experiments.paper.reproduce import Reproduction
    from semsig_gis.reports.parts import Number, Report


@pytest.fixture(scope="module")
def report(reproduction: Reproduction) -> Report:
    return reproduction_report(reproduction)


def numbers(report: Report, section: str) -> dict[tuple[str, str], Number]:
    """Return the numbers of a section by row and column."""
    (found,) = (one for one in report.sections if one.name == section)
    return {(one.row, one.column): one for one in found.numbers}


def test_every_figure_that_the_paper_prints_stands_beside_ours(report: Report) -> None:
    told = [one.paper for part in report.sections for one in part.numbers if one.paper is not None]
    printed = [
        *paris.OCCURRENCES.values(),
        *paris.DATABASE.values(),
        *(float(text.replace(",", "")) for key in ("count", "mean", "std", "max")
          for text in paris.GROUPS[key]),
        *(value for pair in paris.ACCURACY.values() for value in pair if value is not None),
        *paris.QUERY_MS.values(),
        paris.ALONE,
    ]  # fmt: skip
    assert set(printed) <= set(told)
    points = [y for part in report.sections for plot in part.plots for _, y, _ in plot.paper]
    assert set(paris.READ_OFF.values()) <= {*told, *points}


def test_figures_are_those_of_the_evaluations(report: Report, reproduction: Reproduction) -> None:
    experiments = reproduction.experiments
    medium = experiments["medium"]["medium/stages-5-top1"]
    shown = numbers(report, "levels")["medium", "P(error ≤ 50 m)"]
    assert shown.ours == pytest.approx(medium.cdf([50])[0])
    assert (shown.low, shown.high) == tuple(medium.means().loc["p50", ["low", "high"]])
    assert shown.paper == 0.3733
    recall = numbers(report, "ranges")["R = 40 m", "recall@10 %"]
    assert recall.ours == pytest.approx(experiments["range-40"]["medium/stages-5-top1"].recall(10))
    assert recall.paper == 0.7269
    wide = experiments["range-40"]["medium/stages-5-top1"].queries
    some = wide[(wide["length"] >= 10) & (wide["length"] <= 19)]
    column = "P(error ≤ 50 m) of queries that see 10 to 19 objects"
    middling = numbers(report, "ranges")["R = 40 m", column].ours
    assert middling == (pytest.approx(some["p50"].mean()) if len(some) else None)
    assert numbers(report, "scales")["Q = 24", "P(error ≤ 50 m)"].paper == 0.3861
    single = numbers(report, "single")["edit, angles", "medium: recall@20 %"]
    assert single.ours == pytest.approx(
        experiments["medium"]["medium/angles-edit-top100"].recall(20)
    )
    best = numbers(report, "single")["best of these", "no distortion: P(error ≤ 10 m)"]
    assert best.ours == max(
        number.ours or 0.0
        for (_, column), number in numbers(report, "single").items()
        if column == best.column
    )
    times = numbers(report, "times")["edit distance", "angles"]
    assert (times.paper, times.unit) == (1850.0, "ms")
    assert times.ours == 1000 * reproduction.seconds["angles:edit"]


def test_unambiguous_queries_alone(report: Report, reproduction: Reproduction) -> None:
    queries = reproduction.experiments["levels"]["light/stages-5-top1"].queries
    alone = queries[queries["type_group"] == 1]
    found = numbers(report, "alone")
    assert found["light", "P(error ≤ 50 m)"].ours == pytest.approx(alone["p50"].mean())
    assert found["queries", "share alone"].ours == pytest.approx(len(alone) / QUERIES)


def test_the_share_of_unambiguous_queries_can_be_the_papers(
    report: Report, reproduction: Reproduction
) -> None:
    queries = reproduction.experiments["medium"]["medium/stages-5-top1"].queries
    alone = queries["type_group"] == 1
    row = "as the first, with the paper's share of unambiguous queries"
    weighed = numbers(report, "readings")[row, "P(error ≤ 50 m)"]
    expected = 0.418 * queries["p50"][alone].mean() + 0.582 * queries["p50"][~alone].mean()
    assert weighed.ours == pytest.approx(expected)
    assert weighed.low is not None
    assert weighed.high is not None
    assert weighed.low < expected < weighed.high


def test_curves_end_where_they_must(report: Report) -> None:
    plots = [plot for part in report.sections for plot in part.plots]
    assert len(plots) >= 14
    for plot in plots:
        assert plot.curves
        for curve in plot.curves:
            assert list(curve.x) == sorted(curve.x)
            if plot.name.endswith(("error", "recall")):
                assert list(curve.y) == sorted(curve.y)
            if plot.name.endswith("recall"):
                assert curve.y[-1] == pytest.approx(1.0)


def test_parts_that_could_not_be_run_are_left_out(reproduction: Reproduction) -> None:
    less = {k: v for k, v in reproduction.experiments.items() if not k.startswith("range")}
    found = replace(reproduction, experiments=less, variants={}, missing=("No ranges.",))
    report = reproduction_report(found)
    assert "ranges" not in [part.name for part in report.sections]
    assert "No ranges." in report.text


def test_the_files_hold_every_number(report: Report, tmp_path: Path) -> None:
    write_report(report, tmp_path)
    with (tmp_path / "numbers.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(len(part.numbers) for part in report.sections)
    content = json.loads((tmp_path / "report.json").read_text("utf-8"))
    assert content["facts"]["settings"]["queries"] == QUERIES
    page = (tmp_path / "report.html").read_text("utf-8")
    assert page.count("<img") == sum(len(part.drawn) for part in report.sections)
