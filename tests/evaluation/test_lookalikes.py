"""Comparing cells: the kernels against plain loops."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from noisy_cells import noise_specs, random_database

from semsig_gis.evaluation.identify import lookalikes
from semsig_gis.evaluation.identify.lookalikes import (
    compare_without_classes,
    find_lookalikes,
)
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.noise.model import named_noise

if TYPE_CHECKING:
    import pytest

    from semsig_gis.likelihood.index import LikelihoodIndex
    from semsig_gis.likelihood.noise.model import NoiseSpec

INDEX = build_index(random_database(5, cells=300), named_noise("medium"))


def ratios(index: LikelihoodIndex, cell: int, temperature: float) -> np.ndarray:
    """Return the tempered ratios of all cells, from the index as a query asks it."""
    loglik = index.scores(index.database.signature(cell)).loglik.astype(np.float64)
    octaves = temperature * (loglik - loglik[cell]) / math.log(2.0)
    return np.asarray(2.0 ** np.clip(octaves, -100.0, 100.0))


def apart(index: LikelihoodIndex, cell: int) -> np.ndarray:
    return np.asarray(np.hypot(*(index.database.xy - index.database.xy[cell]).T).round(6))


@settings(max_examples=25, deadline=None)
@given(
    noise_specs(),
    st.integers(0, 50),
    st.sampled_from([1, 2, 40, 200]),
    st.floats(0.1, 1.0),
    st.sampled_from([0.0, 10.0, 30.0, 50.0, 1000.0]),
)
def test_sums_are_those_of_a_plain_loop(
    noise: NoiseSpec, seed: int, cells: int, temperature: float, radius: float
) -> None:
    database = random_database(seed, cells=cells)
    # A row of confusion needs a class that is seen.
    assume(not noise.confusion or np.isin(database.present_codes, [1, 3]).any())
    index = build_index(database, noise)
    found = find_lookalikes(index, temperature=temperature, radius=radius, places=3)
    for cell in range(0, cells, 7):
        powers, away = ratios(index, cell, temperature), apart(index, cell)
        near = away <= radius
        assert math.isclose(found.near[cell], powers[near].sum(), rel_tol=2e-3)
        assert math.isclose(found.far[cell], powers[~near].sum(), rel_tol=2e-3, abs_tol=1e-26)
        named = found.cells[cell][found.cells[cell] >= 0]
        assert (found.sums[cell][found.cells[cell] < 0] == 0).all()
        assert (np.diff(found.sums[cell]) <= 0).all()
        if near.all():
            assert not len(named)
            continue
        best = powers[~near].max()
        assert math.isclose(powers[named].max(), best, rel_tol=1e-4)
        for one, total in zip(named.tolist(), found.sums[cell], strict=False):
            around = apart(index, one) <= radius
            assert not near[one]
            assert math.isclose(total, powers[around & ~near].sum(), rel_tol=2e-3)
            others = named[named != one]
            assert (apart(index, one)[others] > 2 * radius).all()


def test_of_equals_the_nearer_is_named() -> None:
    database = random_database(2, cells=1)
    many = np.arange(30)
    repeated = database.select(np.zeros(30, np.int64))
    row = dataclasses.replace(
        repeated, columns=np.zeros(30, np.int32), rows=(many * 10).astype(np.int32)
    )
    found = find_lookalikes(
        build_index(row, named_noise("light")), temperature=0.5, radius=20.0, places=2
    )
    assert sorted(found.cells[10].tolist()) == [9, 11]
    assert np.allclose(found.sums[10], 1.0, rtol=1e-3)
    assert math.isclose(found.far[10], 29.0, rel_tol=1e-3)


def test_threads_and_a_choice_of_cells_change_nothing() -> None:
    whole = find_lookalikes(INDEX, temperature=0.4, threads=3)
    seen: list[tuple[int, int]] = []
    two = np.array([250, 3])
    some = find_lookalikes(
        INDEX, temperature=0.4, cells=two, progress=lambda *step: seen.append(step)
    )
    assert seen == [(2, 2)]
    for name in ("near", "far", "cells", "sums"):
        assert getattr(some, name).tolist() == getattr(whole, name)[two].tolist()
    rise = compare_without_classes(INDEX, temperature=0.4, threads=3)
    assert compare_without_classes(INDEX, temperature=0.4, cells=two).tolist() == rise[two].tolist()


@settings(max_examples=15, deadline=None)
@given(noise_specs(), st.integers(0, 50), st.sampled_from([0.0, 30.0]))
def test_without_a_class(noise: NoiseSpec, seed: int, radius: float) -> None:
    database = random_database(seed, cells=60)
    index = build_index(database, noise)
    rise = compare_without_classes(index, temperature=0.4, radius=radius)
    table, flat = index.table, index.columns.reshape(-1, len(database))
    owner = np.repeat(np.arange(len(database)), database.lengths)
    length = np.minimum(database.lengths, len(table.missed) - 1)[owner]
    missed = np.log(table.missed)[length, table.row_of[database.codes]]
    for cell in range(0, len(database), 13):
        far = apart(index, cell) > radius
        sums = []
        for left_out in [-1, *range(len(table.codes))]:
            seen = slice(database.offsets[cell], database.offsets[cell + 1])
            kinds = table.row_of[database.codes[seen]]
            symbols = kinds * 72 + database.bearing_units[seen] // 100
            scores = index.step * flat[symbols[kinds != left_out]].astype(float).sum(axis=0)
            gone = table.row_of[database.codes] == left_out
            scores += index.constants - np.bincount(owner[gone], missed[gone], len(database))
            sums.append(np.exp(0.4 * (scores - scores[cell]))[far].sum())
        if sums[0] > 1e-3:
            expected = np.log(np.array(sums[1:]) / sums[0])
            assert np.allclose(rise[cell], expected, atol=2e-2)


def test_a_sample_of_the_cells_will_do(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = compare_without_classes(INDEX, temperature=0.3)
    monkeypatch.setattr(lookalikes, "SAMPLE", 200)
    some = compare_without_classes(INDEX, temperature=0.3)
    assert 0.0 < np.abs(whole - some).mean() < 0.2


def test_a_signature_longer_than_the_sums_of_bytes() -> None:
    database = random_database(4, cells=6, longest=700, classes=3)
    assert database.lengths.max() > 257
    index = build_index(database, named_noise("light"))
    found = find_lookalikes(index, temperature=0.2, radius=0.0)
    for cell in range(6):
        powers = ratios(index, cell, 0.2)
        assert math.isclose(found.near[cell] + found.far[cell], powers.sum(), rel_tol=2e-3)
