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
from semsig_gis.reports.experiment import (
    comparison_table,
    experiment_figures,
    experiment_markdown,
    experiment_tables,
)

if TYPE_CHECKING:
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


def test_a_table_for_each_distortion() -> None:
    tables = experiment_tables(SPEC, FOUND)
    titles = [table.title for table in tables]
    assert titles == ["Experiment", "none: no distortion", "some: errors:2, view:180"]
    assert ("Method light", "likelihood:light") in tables[0].rows
    for table in tables[1:]:
        assert [row[0] for row in table.rows] == ["paper, t = 1", "light, t = 1"]
        assert all(len(row) == len(table.columns) for row in table.rows)
        assert table.columns[-1] == "s a query"
        answered = table.columns.index("Answered")
        assert [bool(row[answered]) for row in table.rows] == [False, True]
    text = experiment_markdown(SPEC, FOUND)
    assert text.startswith("## Experiment\n\n### Experiment\n")
    assert "s a query" not in text


def test_an_infinite_error_is_told() -> None:
    case = "some/paper-top1"
    one = FOUND[case]
    lost = one.queries.assign(error_m=np.inf)
    found = {**FOUND, case: replace(one, queries=lost)}
    assert experiment_tables(SPEC, found)[2].rows[0][-3:-1] == ("infinite", "infinite")


def test_a_comparison_says_what_is_proven() -> None:
    rows = [
        {"figure": "p50", "first": 0.5, "second": 0.6, "difference": 0.1, "low": 0.05, "high": 0.2},
        {"figure": "p5", "first": 0.5, "second": 0.4, "difference": -0.1, "low": -0.2, "high": 0.0},
        {
            "figure": "p10",
            "first": 0.5,
            "second": 0.3,
            "difference": -0.2,
            "low": -0.3,
            "high": -0.1,
        },
        {
            "figure": "error_p90",
            "first": math.inf,
            "second": 5.0,
            "difference": math.nan,
            "low": math.nan,
            "high": math.nan,
        },
    ]
    table = comparison_table(pd.DataFrame(rows), "one and other")
    assert [row[-1] for row in table.rows] == ["more", "", "less", ""]
    assert table.rows[0][1:5] == ("0.5000", "0.6000", "+0.1000", "+0.0500 to +0.2000")
    assert table.rows[3][1:] == ("infinite", "5.0000", "", "", "")
