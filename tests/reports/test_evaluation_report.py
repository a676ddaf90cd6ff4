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
from semsig_gis.reports.evaluation import evaluation_tables

if TYPE_CHECKING:
    from collections.abc import Callable

EVALUATION = evaluate(six_cells(), queries=6, method=Method.parse("edit+edit:5%"), seed=1)


def test_settings_and_figures(snapshot: Callable[[str, str], None]) -> None:
    tables = evaluation_tables(EVALUATION)
    assert all(len(row) == len(table.columns) for table in tables for row in table.rows)
    figures = rows(tables[1])
    mean = EVALUATION.cdf([50])[0]
    low, high = wilson_interval(mean, 6)
    assert figures["P(error ≤ 50 m)"] == (f"{mean:.4f}", f"{low:.4f} to {high:.4f}", "0.3733")
    assert figures["recall@10 %"][::2] == (f"{EVALUATION.recall(10):.4f}", "0.6462")
    assert figures["recall@5 within 25 m"][0] == f"{EVALUATION.queries['near5'].mean():.4f}"
    quiet = parse_chain("medium:resort=false, view:90")
    lost = EVALUATION.queries.assign(error_m=np.inf, heading_error=np.arange(6) * 20.0)
    others = {
        "paper": EVALUATION,
        "other": replace(EVALUATION, asked=QuerySpec(distortions=quiet, seeds=(1, 2)), city="b"),
        "none": replace(EVALUATION, asked=QuerySpec(distortions=()), queries=lost),
    }
    for name, one in others.items():
        tables = evaluation_tables(replace(one, seconds_per_query=0.0125))
        snapshot(f"evaluation-{name}.md", "\n".join(table.markdown() for table in tables))


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
def test_other_settings_are_not_compared_with_the_paper(changed: dict[str, object]) -> None:
    facts = {key: value for key, value in changed.items() if key.endswith("_m")}
    settings = {key: value for key, value in changed.items() if key not in facts}
    other = replace(EVALUATION, database={**EVALUATION.database, **facts}, **settings)  # type: ignore[arg-type]
    figures = evaluation_tables(other)[1]
    assert figures.columns == ("Figure", "Ours", "95 %")
    assert all(len(row) == 3 for row in figures.rows)
    assert "Paris" not in figures.note


@pytest.mark.parametrize(
    ("radius", "levels", "p50", "recall10"),
    [(20.0, 16, "0.1793", "0.5110"), (40.0, 16, "0.4946", "0.7269"), (30.0, 24, "0.3861", "")],
)
def test_the_paper_has_figures_for_other_ranges_and_levels(
    radius: float, levels: int, p50: str, recall10: str
) -> None:
    facts = {**EVALUATION.database, "radius_m": radius, "levels": levels}
    figures = rows(evaluation_tables(replace(EVALUATION, database=facts))[1])
    assert figures["P(error ≤ 50 m)"][2] == p50
    assert figures["recall@10 %"][2] == recall10
