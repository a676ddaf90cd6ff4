from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import TAXONOMY, random_database, random_query
from sentences import assert_sentence

from semsig_gis.core.errors import InputError
from semsig_gis.core.signature import Signature
from semsig_gis.database.visibility import views_in
from semsig_gis.likelihood.noise.fit import (
    expected_counts,
    gather_evidence,
    model_change,
    next_model,
    starting_model,
)
from semsig_gis.queries.paper_errors import distort, named_distortion

NOTHING = Signature(np.empty(0, np.uint8), np.empty(0))


@given(st.integers(0, 500))
def test_counts_add_up(seed: int) -> None:
    database = random_database(seed, cells=20)
    detected = [NOTHING]
    for cell in range(1, 20):
        query = random_query(database, seed + cell, size=cell % 7)
        kept = query.codes != 0
        assert query.codes is not None
        assert query.bearings is not None
        detected.append(Signature(query.codes[kept], query.bearings[kept]))
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
    detected = [
        distort(
            database.signature(cell),
            named_distortion("light"),
            classes=database.present_codes,
            rng=rng,
        )
        for cell in range(60)
    ]
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


def test_nothing_detected_at_all() -> None:
    database = random_database(0)
    with pytest.raises(InputError) as caught:
        gather_evidence(views_in(database, np.arange(2)), [NOTHING] * 2, taxonomy=TAXONOMY)
    assert_sentence(caught.value, "2 samples", "0 detections")
