"""Trials without a class."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import noise_specs, random_database

from semsig_gis.evaluation.identify.trials import leave_class_out, try_cells, try_without_classes
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.noise.model import NoiseMixture, NoiseSpec, named_noise

if TYPE_CHECKING:
    from semsig_gis.likelihood.noise.model import Noise


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 100), st.integers(1, 4))
def test_cells_without_a_class_are_those_of_a_plain_loop(seed: int, code: int) -> None:
    database = random_database(seed, cells=20, longest=4)
    left, rows = leave_class_out(database, code)
    kept: list[int] = []
    for cell in range(len(database)):
        signature = database.signature(cell)
        assert signature.codes is not None
        assert signature.bearings is not None
        others = signature.codes != code
        if not others.any():
            assert rows[cell] == -1
            continue
        assert rows[cell] == len(kept)
        kept.append(cell)
        found = left.signature(int(rows[cell]))
        assert found.codes.tolist() == signature.codes[others].tolist()  # type: ignore[union-attr]
        assert found.bearings.tolist() == signature.bearings[others].tolist()  # type: ignore[union-attr]
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
