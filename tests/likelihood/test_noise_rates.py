from __future__ import annotations

import math

import numpy as np
import pytest
from noisy_cells import TAXONOMY, random_database

from semsig_gis.core.signature import Signature
from semsig_gis.core.statistics import wilson_interval
from semsig_gis.database.visibility import views_in
from semsig_gis.likelihood.noise.fit import (
    ALL,
    drawn_rates,
    estimated_rates,
    expected_counts,
    gather_evidence,
    starting_model,
)


def test_where_every_association_is_certain_the_intervals_are_the_text_books() -> None:
    database = random_database(0, cells=300, longest=1, classes=1)
    views = views_in(database, np.arange(300))
    seen = [
        Signature(views.codes[[row]], (views.bearings[[row]] + 1.0 - 2.0 * (row % 2)) % 360)
        if row % 10
        else Signature(np.empty(0, np.uint8), np.empty(0))
        for row in range(300)
    ]
    evidence = gather_evidence(views, seen, taxonomy=TAXONOMY)
    model = starting_model(evidence, position_sigma=0.0)
    for name, values in (("missed", [[0.1]]), ("clutter", [1e-6]), ("sigma", [1.0])):
        object.__setattr__(model, name, np.array(values))
    rates = estimated_rates(evidence, expected_counts(evidence, model), model)
    rows = rates[rates["class"] == ALL].set_index("quantity").to_dict("index")
    found = rows["detection"]
    assert found["own"] == pytest.approx(0.9, abs=1e-4)
    assert found["samples"] == 300
    expected = wilson_interval(0.9, 300)
    assert (found["low_95"], found["high_95"]) == pytest.approx(expected, abs=0.003)
    sigma = rows["bearing_sigma"]
    assert sigma["own"] == pytest.approx(1.0, abs=0.03)  # half a unit of bearing is noise too
    assert math.log(sigma["high_95"] / sigma["own"]) >= 1.96 / math.sqrt(2 * 270) - 1e-6
    assert len(rates) == 8


def test_rates_are_drawn_as_the_overall_rate_with_eight_samples() -> None:
    found = drawn_rates(np.array([1.0, 99.0]), np.array([2.0, 198.0]))
    assert found.tolist() == [0.5, 0.5]
    found = drawn_rates(np.array([0.0, 90.0]), np.array([10.0, 90.0]))
    assert found == pytest.approx([8 * 0.9 / 18, (90 + 8 * 0.9) / 98])
    assert drawn_rates(np.zeros(2), np.zeros(2)).tolist() == [0.0, 0.0]
