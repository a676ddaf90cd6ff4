"""Trials: the outcomes of simulated queries against all that the parts say."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import mixtures, noise_specs, parts_of, random_database

from semsig_gis.core.signature import Signature
from semsig_gis.evaluation.identify.trials import (
    draw_trials,
    leave_class_out,
    trial_cells,
    try_cells,
    try_without_classes,
)
from semsig_gis.likelihood.association import rerank
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.noise.model import NoiseMixture, NoiseSpec, named_noise
from semsig_gis.likelihood.posterior import posterior

if TYPE_CHECKING:
    from semsig_gis.likelihood.noise.model import Noise


@pytest.mark.parametrize("noise", ["light", "generic"])
@pytest.mark.parametrize("radius", [0.0, 30.0])
def test_outcomes_are_those_of_the_whole_method(noise: str, radius: float) -> None:
    database = random_database(8, cells=120, longest=6)
    index = build_index(database, named_noise(noise))
    cells = trial_cells(len(database), 60, seed=2)
    trials = try_cells(index, cells, radius=radius, seed=3)
    for row, query in enumerate(draw_trials(index, cells, seed=3)):
        if not len(query):
            assert trials.near[row] == 0
            continue
        cell = int(cells[row])
        found = posterior(database, rerank(index, query, index.scores(query)).loglik)
        away = np.hypot(*(database.xy - database.xy[cell]).T)
        assert math.isclose(trials.itself[row], found.chances[cell], abs_tol=1e-6)
        assert math.isclose(trials.near[row], found.chances[away <= radius].sum(), abs_tol=1e-6)
        assert math.isclose(trials.bits[row], found.entropy, abs_tol=1e-4)
        best, _ = found.best_place(radius)
        assert trials.found[row] == (away[best] <= radius)
        own = index.scores(database.signature(cell)).loglik
        lean = found.chances @ (own - own[cell])
        assert math.isclose(trials.lean[row], lean, abs_tol=1e-3)


def test_nothing_detected_is_not_answered() -> None:
    database = random_database(8, cells=10)
    index = build_index(database, named_noise("light"))
    nothing = Signature(np.zeros(0, np.uint8), np.zeros(0))
    trials = try_cells(index, np.array([4]), queries=[nothing])
    assert (trials.itself[0], trials.near[0], trials.found[0]) == (0.0, 0.0, False)
    assert math.isclose(trials.bits[0], math.log2(10))
    assert math.isnan(trials.lean[0])


@settings(max_examples=50)
@given(st.integers(1, 50), st.integers(0, 200), st.integers(0, 5))
def test_all_cells_are_tried_equally_often(cells: int, count: int, seed: int) -> None:
    tried = trial_cells(cells, count, seed=seed)
    counts = np.bincount(tried, minlength=cells)
    assert len(tried) == count
    assert counts.max() - counts.min() <= 1
    assert trial_cells(cells, count + 1, seed=seed)[:count].tolist() == tried.tolist()


@settings(max_examples=30, deadline=None)
@given(mixtures(), st.integers(0, 100), st.integers(0, 19))
def test_a_query_is_in_order_and_does_not_depend_on_the_others(
    noise: Noise, seed: int, cell: int
) -> None:
    index = build_index(random_database(1, cells=20, longest=8, classes=3), noise)
    queries = list(draw_trials(index, np.array([3, 7, cell, 5]), seed=seed))
    *_, again = draw_trials(index, np.array([0, 0, cell]), seed=seed)
    for query in queries:
        assert (np.diff(parts_of(query)[1]) >= 0).all()
    for one, other in zip(parts_of(again), parts_of(queries[2]), strict=True):
        assert one.tolist() == other.tolist()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 100), st.integers(1, 4))
def test_cells_without_a_class_are_those_of_a_plain_loop(seed: int, code: int) -> None:
    database = random_database(seed, cells=20, longest=4)
    left, rows = leave_class_out(database, code)
    kept: list[int] = []
    for cell in range(len(database)):
        codes, bearings = parts_of(database.signature(cell))
        others = codes != code
        if not others.any():
            assert rows[cell] == -1
            continue
        assert rows[cell] == len(kept)
        kept.append(cell)
        found = [part.tolist() for part in parts_of(left.signature(int(rows[cell])))]
        assert found == [codes[others].tolist(), bearings[others].tolist()]
    assert len(left) == len(kept)
    assert left.cell_ids.tolist() == database.cell_ids[kept].tolist()


@pytest.mark.parametrize(
    "noise",
    [
        named_noise("medium"),
        named_noise("generic"),
        NoiseSpec(confusion={"alignment_tree": {"alignment_tree": 1.0}}),
        NoiseSpec(clutter_shares={"alignment_tree": 1.0}),
        NoiseMixture(specs=(NoiseSpec(), NoiseSpec(clutter=3.0)), weights=(0.5, 0.5)),
    ],
)
def test_a_class_tells_something(noise: Noise) -> None:
    database = random_database(4, cells=80, longest=8, classes=3)
    index = build_index(database, noise)
    cells = np.arange(len(database))
    whole = try_cells(index, cells, radius=20.0)
    told: list[tuple[int, int]] = []
    near, bits = try_without_classes(
        index, cells, radius=20.0, progress=lambda done, all_: told.append((done, all_))
    )
    assert near.shape == bits.shape == (80, 3)
    assert told[-1] == (240, 240)
    assert (near.mean(axis=0) < whole.near.mean()).all()
    assert (bits.mean(axis=0) > whole.bits.mean()).all()


@settings(max_examples=10, deadline=None)
@given(noise_specs())
def test_without_its_only_class_nothing_is_left(noise: NoiseSpec) -> None:
    index = build_index(random_database(1, cells=10, classes=1), noise)
    near, bits = try_without_classes(index, np.arange(4))
    assert near.tolist() == [[0.0]] * 4
    assert np.allclose(bits, np.log2(10))
