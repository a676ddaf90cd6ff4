from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from six_cells import rows, six_cells

from semsig_gis.core.statistics import wilson_interval
from semsig_gis.evaluation.evaluate import evaluate
from semsig_gis.matching.method import Method
from semsig_gis.queries.chain import parse_chain
from semsig_gis.queries.draw import QuerySpec
from semsig_gis.reports.evaluation import evaluation_markdown, evaluation_tables

if TYPE_CHECKING:
    from semsig_gis.evaluation.result import Evaluation


@pytest.fixture(scope="module")
def evaluation() -> Evaluation:
    return evaluate(six_cells(), queries=6, method=Method.parse("edit+edit:5%"), seed=1)


def test_settings_and_figures_of_an_evaluation(evaluation: Evaluation) -> None:
    settings, figures, by_length, by_ambiguity = evaluation_tables(evaluation)
    assert rows(settings)["Method"] == ("edit+edit:5%",)
    assert rows(settings)["Distortions"] == ("medium",)
    assert rows(settings)["Seen from"] == ("cells",)
    assert "Size" not in rows(settings)
    shown = rows(figures)
    low, high = wilson_interval(evaluation.cdf([50])[0], 6)
    told = f"{evaluation.cdf([50])[0]:.4f}", f"{low:.4f} to {high:.4f}", "0.3733"
    assert shown["P(error ≤ 50 m)"] == told
    assert shown["recall@10 %"][::2] == (f"{evaluation.recall(10):.4f}", "0.6462")
    assert shown["P(error ≤ 10 m)"][2] == ""
    assert shown["recall@5 within 25 m"][0] == f"{evaluation.queries['near5'].mean():.4f}"
    assert "Paris" in figures.note
    assert [row[0] for row in by_length.rows] == ["1-4", "5-9", "10-19", "20+"]
    assert by_length.rows[3][1:] == ("0", "", "", "", "", "", "")
    assert [row[:2] for row in by_ambiguity.rows][:2] == [("1", "1"), ("2-9", "5")]
    for table in (settings, figures, by_length, by_ambiguity):
        assert all(len(row) == len(table.columns) for row in table.rows)


@pytest.mark.parametrize(
    "changed",
    [
        {"top": 100},
        {"method": Method.parse("edit+edit")},
        {"method": Method.parse("edit+edit:5%:weights=2/1/1")},
        {"asked": QuerySpec(distortions=parse_chain("light"))},
        {"asked": QuerySpec(distortions=parse_chain("medium:bearing_sigma=0"))},
        {"asked": QuerySpec(distortions=parse_chain("medium, view:90"))},
        {"asked": QuerySpec(seen_from="anywhere")},
        {"step_m": 5.0},
        {"radius_m": 35.0},
    ],
)
def test_other_settings_are_not_compared_with_the_paper(
    evaluation: Evaluation, changed: dict[str, object]
) -> None:
    facts = {key: value for key, value in changed.items() if key.endswith("_m")}
    settings = {key: value for key, value in changed.items() if key not in facts}
    other = replace(evaluation, database={**evaluation.database, **facts}, **settings)  # type: ignore[arg-type]
    figures = evaluation_tables(other)[1]
    assert figures.columns == ("Figure", "Ours", "95 %")
    assert all(len(row) == 3 for row in figures.rows)
    assert "Paris" not in figures.note


@pytest.mark.parametrize(
    ("radius", "levels", "p50", "recall10"),
    [(20.0, 16, "0.1793", "0.5110"), (40.0, 16, "0.4946", "0.7269"), (30.0, 24, "0.3861", "")],
)
def test_the_paper_has_figures_for_other_ranges_and_levels(
    evaluation: Evaluation, radius: float, levels: int, p50: str, recall10: str
) -> None:
    facts = {**evaluation.database, "radius_m": radius, "levels": levels}
    figures = rows(evaluation_tables(replace(evaluation, database=facts))[1])
    assert figures["P(error ≤ 50 m)"][2] == p50
    assert figures["recall@10 %"][2] == recall10


def test_distortions_are_told(evaluation: Evaluation) -> None:
    quiet = parse_chain("medium:resort=false, view:90")
    settings = rows(evaluation_tables(replace(evaluation, asked=QuerySpec(distortions=quiet)))[0])
    assert settings["Distortions"] == ("medium:resort=false, view:90",)
    none = replace(evaluation, asked=QuerySpec(distortions=()))
    assert rows(evaluation_tables(none)[0])["Distortions"] == ("none",)


def test_an_infinite_median_is_told(evaluation: Evaluation) -> None:
    lost = evaluation.queries.assign(error_m=np.inf)
    figures = rows(evaluation_tables(replace(evaluation, queries=lost))[1])
    assert figures["Median error"][0] == "infinite"


def test_markdown_of_an_evaluation(evaluation: Evaluation) -> None:
    text = evaluation_markdown(evaluation)
    assert text.startswith("## Evaluation\n\n### Settings\n")
    assert "| P(error ≤ 50 m) |" in text
    assert text.endswith("|\n")
