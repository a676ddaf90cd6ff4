from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import TAXONOMY, distorted, parts_of, random_database, random_query

from semsig_gis.core.signature import Signature
from semsig_gis.core.statistics import wilson_interval
from semsig_gis.database.visibility import views_in
from semsig_gis.likelihood.noise.fit import (
    ALL,
    drawn_rates,
    estimated_rates,
    expected_counts,
    gather_evidence,
    model_change,
    next_model,
    starting_model,
)

NOTHING = Signature(np.empty(0, np.uint8), np.empty(0))


@given(st.integers(0, 500))
def test_counts_add_up(seed: int) -> None:
    database = random_database(seed, cells=20)
    detected = [NOTHING]
    for cell in range(1, 20):
        query = random_query(database, seed + cell, size=cell % 7)
        codes, bearings = parts_of(query)
        detected.append(Signature(codes[codes > 0], bearings[codes > 0]))
    evidence = gather_evidence(views_in(database, np.arange(20)), detected, taxonomy=TAXONOMY)
    model = starting_model(evidence, position_sigma=2.0)
    counts = expected_counts(evidence, model)
    assert evidence.present.sum() == len(database.codes)
    hits = counts.named.sum()
    assert hits == pytest.approx(counts.chances.sum())
    assert hits + counts.false.sum() == pytest.approx(len(evidence.labels), abs=0.05)
    assert (counts.named.sum(axis=1) <= evidence.present + 0.05).all()
    assert (counts.squares >= 0).all()
    new = next_model(evidence, counts, model)
    assert new.clutter.sum() * 20 == pytest.approx(counts.false.sum(), rel=0.02)
    assert new.named.sum(axis=2) == pytest.approx(1.0)


def test_rounds_raise_the_likelihood() -> None:
    database = random_database(3, cells=60, longest=5)
    rng = np.random.default_rng(0)
    detected = [distorted(database, cell, rng) for cell in range(60)]
    evidence = gather_evidence(views_in(database, np.arange(60)), detected, taxonomy=TAXONOMY)
    model = starting_model(evidence, position_sigma=0.0)
    before = -math.inf
    for _ in range(8):
        counts = expected_counts(evidence, model)
        assert counts.log_likelihood > before - 0.1  # classes are drawn to the whole, too
        before = counts.log_likelihood
        new = next_model(evidence, counts, model)
        assert model_change(model, model) == 0.0
        assert model_change(model, new) > 0
        model = new


def test_where_every_association_is_certain_the_intervals_are_the_text_books() -> None:
    database = random_database(0, cells=300, longest=1, classes=1)
    views = views_in(database, np.arange(300))
    seen = [
        Signature(views.codes[[row]], (views.bearings[[row]] + 1.0 - 2.0 * (row % 2)) % 360)
        if row % 10
        else NOTHING
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
