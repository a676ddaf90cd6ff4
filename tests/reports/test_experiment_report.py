from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest
from noisy_cells import random_database

from semsig_gis.evaluation.evaluate import evaluate
from semsig_gis.evaluation.spec import ExperimentSpec
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.method import LikelihoodMethod
from semsig_gis.likelihood.noise.model import named_noise
from semsig_gis.matching.method import Method
from semsig_gis.queries.chain import parse_chain
from semsig_gis.reports.evaluation import (
    comparison_table,
    experiment_figures,
    experiment_markdown,
    experiment_tables,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from semsig_gis.likelihood.index import LikelihoodIndex

DATABASE = random_database(5, cells=150)
LIGHT = named_noise("light")
SPEC = ExperimentSpec(
    database="city.parquet",
    methods={"paper": Method(), "light": LikelihoodMethod(noise=LIGHT)},
    distortions={"none": (), "some": parse_chain("errors:2, view:180")},
    queries=40,
)
METHODS: dict[str, Method | LikelihoodIndex] = {
    "paper": Method(),
    "light": build_index(DATABASE, LIGHT),
}
FOUND = {
    case.name: evaluate(
        DATABASE,
        queries=40,
        method=METHODS[case.method],
        distortion=SPEC.distortions[case.distortion],
    )
    for case in SPEC.cases
}
QUERIES = FOUND["some/paper-top1"].queries


def test_figures_of_every_case() -> None:
    table = experiment_figures(FOUND)
    assert list(dict.fromkeys(table["case"])) == [case.name for case in SPEC.cases]
    for name, evaluation in FOUND.items():
        mine = table[table["case"] == name].set_index("figure")
        errors = evaluation.queries["error_m"]
        assert mine["value"]["error_median"] == pytest.approx(np.median(errors))
        assert mine["n"]["error_median"] == 40
        assert ("coverage" in mine.index) == ("light" in name)
        assert "heading_error_median" not in mine.index


def test_tables_of_an_experiment(snapshot: Callable[[str, str], None]) -> None:
    tables = experiment_tables(SPEC, FOUND)
    assert {table.columns[-1] for table in tables[1:]} == {"s a query"}
    assert all(len(row) == len(table.columns) for table in tables for row in table.rows)
    lost = replace(FOUND["some/paper-top1"], queries=QUERIES.assign(error_m=np.inf))
    snapshot("experiment.md", experiment_markdown(SPEC, {**FOUND, "some/paper-top1": lost}))


def test_a_comparison_says_what_is_proven() -> None:
    rows = [
        ("p50", 0.5, 0.6, 0.1, 0.05, 0.2),
        ("p5", 0.5, 0.4, -0.1, -0.2, 0.0),
        ("p10", 0.5, 0.3, -0.2, -0.3, -0.1),
        ("error_p90", math.inf, 5.0, math.nan, math.nan, math.nan),
    ]
    names = ["figure", "first", "second", "difference", "low", "high"]
    table = comparison_table(pd.DataFrame(rows, columns=names), "one and other")
    assert table.rows == (
        ("p50", "0.5000", "0.6000", "+0.1000", "+0.0500 to +0.2000", "more"),
        ("p5", "0.5000", "0.4000", "-0.1000", "-0.2000 to +0.0000", ""),
        ("p10", "0.5000", "0.3000", "-0.2000", "-0.3000 to -0.1000", "less"),
        ("error_p90", "infinite", "5.0000", "", "", ""),
    )
