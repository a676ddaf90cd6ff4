"""What chances of cells are made of: kernels against plain loops, trials against their parts."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from noisy_cells import mixtures, noise_specs, parts_of, random_database
from scipy.special import ndtr

from semsig_gis.core import Signature
from semsig_gis.evaluation import (
    draw_trials,
    find_lookalikes,
    leave_class_out,
    symbol_columns,
    trial_cells,
    try_cells,
    try_without_classes,
)
from semsig_gis.evaluation.identifiability import lookalikes
from semsig_gis.localization import (
    CellScores,
    NoiseMixture,
    NoiseSpec,
    build_index,
    named_noise,
    posterior,
    rerank,
)
from semsig_gis.observation import Photo, View

if TYPE_CHECKING:
    from semsig_gis.evaluation import SymbolColumns
    from semsig_gis.localization import Noise

COLUMNS = symbol_columns(build_index(random_database(5, cells=300), named_noise("medium")))


def bytes_of(columns: SymbolColumns) -> np.ndarray:
    """Return what each symbol adds to each cell, in steps."""
    return columns.of(np.arange(len(columns.database)))


def ratios(columns: SymbolColumns, cell: int, temperature: float) -> np.ndarray:
    """Return the tempered ratios of all cells, from the columns of what the cell sees."""
    seen = slice(*columns.database.offsets[cell : cell + 2].tolist())
    sums = bytes_of(columns)[columns.symbols[seen]].sum(axis=0, dtype=np.int64)
    loglik = columns.constants[0] + columns.step * sums
    octaves = temperature * (loglik - loglik[cell]) / math.log(2.0)
    return np.asarray(2.0 ** np.clip(octaves, -100.0, 100.0))


def apart(index: SymbolColumns, cell: int) -> np.ndarray:
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
    index = symbol_columns(build_index(database, noise))
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
            # Cells in both circles count as the least ratio.
            expected = powers[around & ~near].sum() + 2.0**-100 * (around & near).sum()
            assert math.isclose(total, expected, rel_tol=2e-3)
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
        symbol_columns(build_index(row, named_noise("light"))),
        temperature=0.5,
        radius=20.0,
        places=2,
    )
    assert sorted(found.cells[10].tolist()) == [9, 11]
    assert np.allclose(found.sums[10], 1.0, rtol=1e-3)
    assert math.isclose(found.far[10], 29.0, rel_tol=1e-3)


def test_threads_and_a_choice_of_cells_change_nothing() -> None:
    whole = find_lookalikes(COLUMNS, temperature=0.4, threads=3)
    seen: list[tuple[int, int]] = []
    two = np.array([250, 3])
    some = find_lookalikes(
        COLUMNS, temperature=0.4, looks=two, progress=lambda *step: seen.append(step)
    )
    assert seen == [(2, 2)]
    for name in ("near", "far", "cells", "sums", "rise"):
        assert getattr(some, name).tolist() == getattr(whole, name)[two].tolist()


@settings(max_examples=15, deadline=None)
@given(noise_specs(), st.integers(0, 50), st.sampled_from([0.0, 30.0]))
def test_without_a_class(noise: NoiseSpec, seed: int, radius: float) -> None:
    database = random_database(seed, cells=60)
    index = symbol_columns(build_index(database, noise))
    rise = find_lookalikes(index, temperature=0.4, radius=radius).rise
    table, flat = index.table, bytes_of(index)
    owner = np.repeat(np.arange(len(database)), database.lengths)
    length = np.minimum(database.lengths, len(table.missed) - 1)[owner]
    kinds, far = table.row_of[database.codes], database.distance_units
    sure = table.detected[length, kinds]
    missed = np.log1p(-sure * table.seen[kinds, far]) - sure * table.left[kinds, far]
    for cell in range(0, len(database), 13):
        beyond = apart(index, cell) > radius
        sums = []
        for left_out in [-1, *range(len(table.codes))]:
            seen = slice(database.offsets[cell], database.offsets[cell + 1])
            kinds = table.row_of[database.codes[seen]]
            symbols = kinds * 72 + database.bearing_units[seen] // 100
            scores = index.step * flat[symbols[kinds != left_out]].astype(float).sum(axis=0)
            gone = table.row_of[database.codes] == left_out
            scores += index.constants[0] - np.bincount(owner[gone], missed[gone], len(database))
            sums.append(np.exp(0.4 * (scores - scores[cell]))[beyond].sum())
        if sums[0] > 1e-3:
            expected = np.log(np.array(sums[1:]) / sums[0])
            assert np.allclose(rise[cell], expected, atol=2e-2)


@pytest.mark.parametrize("temperature", [0.2, 0.6])
def test_a_sample_stands_for_cells_that_are_not_likely(
    temperature: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    columns = symbol_columns(build_index(random_database(7, cells=400), named_noise("medium")))
    some = np.arange(0, 400, 5)
    whole = find_lookalikes(columns, temperature=temperature, looks=some)
    monkeypatch.setattr(lookalikes, "SAMPLE_CELLS", 200)
    monkeypatch.setattr(lookalikes, "LIKELY_CELLS", 100)
    found = find_lookalikes(columns, temperature=temperature, looks=some)
    # What is likely is not drawn: the lookalikes are the same, and what is near them.
    for name in ("near", "cells", "sums"):
        assert getattr(found, name).tolist() == getattr(whole, name).tolist()
    off = np.log(found.far / whole.far)
    assert 0.0 < np.abs(off).max() < 0.3
    assert abs(off.mean()) < 0.03
    assert np.abs(found.rise - whole.rise).mean() < 0.1


def test_a_signature_longer_than_the_sums_of_bytes() -> None:
    database = random_database(4, cells=6, longest=700, classes=3)
    assert database.lengths.max() > 257
    index = symbol_columns(build_index(database, named_noise("light")))
    found = find_lookalikes(index, temperature=0.2, radius=0.0)
    for cell in range(6):
        powers = ratios(index, cell, 0.2)
        assert math.isclose(found.near[cell] + found.far[cell], powers.sum(), rel_tol=5e-3)


@pytest.mark.parametrize("noise", ["light", "generic"])
@pytest.mark.parametrize("radius", [0.0, 30.0])
def test_outcomes_are_those_of_the_whole_method(noise: str, radius: float) -> None:
    database = random_database(8, cells=120, longest=6)
    index = build_index(database, named_noise(noise))
    cells = trial_cells(len(database), 60, seed=2)
    columns = symbol_columns(index)
    trials = try_cells(index, cells, columns=columns, radius=radius, seed=3)
    for row, query in enumerate(draw_trials(index, cells, seed=3)):
        if not len(query):
            assert trials.near[row] == 0
            continue
        cell = int(cells[row])
        first = CellScores(loglik=columns.scores(query, 0))
        off = first.loglik - index.scores(query).loglik
        assert np.abs(off).mean() < 0.2 * len(query)  # bearings are in steps of five degrees
        found = posterior(database, rerank(index, query, first).loglik)
        away = np.hypot(*(database.xy - database.xy[cell]).T)
        assert math.isclose(trials.itself[row], found.chances[cell], abs_tol=1e-6)
        assert math.isclose(trials.near[row], found.chances[away <= radius].sum(), abs_tol=1e-6)
        assert math.isclose(trials.bits[row], found.entropy, abs_tol=1e-4)
        best, _ = found.best_place(radius)
        assert trials.found[row] == (away[best] <= radius)
        own = columns.loglik(cell, 0, np.arange(120))
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
    # Nothing is asked again where the class plays no part.
    sees = [
        np.add.reduceat(database.codes == code, database.offsets[:-1]) > 0 for code in (1, 2, 3)
    ]
    assert (np.isfinite(near) == np.isfinite(bits)).all()
    assert np.isfinite(near)[np.stack(sees, axis=1)].all()
    assert np.isnan(near).any() or (index.table.clutter > 1.0).any()
    asked, blank = np.isfinite(near), np.broadcast_to(whole.near[:, None], near.shape)
    near, bits = np.where(asked, near, blank), np.where(asked, bits, whole.bits[:, None])
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


@settings(max_examples=20, deadline=None)
@given(noise_specs(), st.integers(0, 50), st.sampled_from([1, 63, 65]))
def test_a_column_is_what_an_object_in_its_step_adds(
    noise: NoiseSpec, seed: int, cells: int
) -> None:
    database = random_database(seed, cells=cells)
    assume(not noise.confusion or np.isin(database.present_codes, [1, 3]).any())
    columns = symbol_columns(build_index(database, noise), threads=2)
    values = bytes_of(columns)
    table, kinds = columns.table, columns.kinds
    symbol = int(np.random.default_rng(seed).integers(len(values)))
    name, place = divmod(symbol, 72)
    sigma = table.sigmas[kinds, database.distance_units]
    low = 5.0 * place - (database.bearings + 0.025) + 360.0 * np.arange(-3, 4)[:, None]
    inside = (ndtr((low + 5.0) / sigma) - ndtr(low / sigma)).sum(axis=0) / 5.0
    owner = np.repeat(np.arange(cells), database.lengths)
    length = np.minimum(database.lengths, len(table.missed) - 1)[owner]
    sure, far = table.detected[length, kinds], database.distance_units
    chance = sure * table.seen[kinds, far]
    heard = chance / (1.0 - chance) * inside + sure * table.left[kinds, far] / 360.0
    heard *= table.named[length, kinds, name]
    expected = np.log1p(np.bincount(owner, heard, cells) / table.density[name])
    # A byte holds no more than 255 steps; deviations come in levels where they differ.
    expected = np.minimum(expected, 255 * columns.step)
    slack = 0.5 * columns.step + 2.0**-9 + (0.2 if table.position_sigma else 1e-3)
    assert np.abs(expected - columns.step * values[symbol]).max() < slack


def test_photos_are_compared_by_what_each_shows() -> None:
    database = random_database(5, cells=150, longest=20)
    looks = tuple(Photo.looking(heading=heading, fov=70.0) for heading in (0.0, 120.0, 240.0))
    index = build_index(database, named_noise("medium"))
    columns = symbol_columns(index, looks=looks)
    found = find_lookalikes(columns, temperature=0.5, radius=20.0)
    away_from = functools.partial(apart, columns)
    off = []
    for number in range(0, 450, 11):
        cell, look = divmod(number, 3)
        seen = View.of(database.signature(cell), photos=(looks[look],))
        seen = seen.select(looks[look].sees(parts_of(seen)[1]))
        assert columns.counts[look, :, cell].sum() == len(seen)
        if not len(seen):
            assert (found.near[number], found.far[number]) == (0.0, 0.0)
            assert (found.cells[number] == -1).all()
            continue
        loglik = index.scores(seen).loglik.astype(np.float64)
        powers = np.exp(0.5 * (loglik - loglik[cell]))
        beyond = away_from(cell) > 20.0
        # Of objects at the very edge, the scan takes the odds that they are in the picture.
        off.append(np.log(found.far[number] / powers[beyond].sum()))
        assert np.corrcoef(columns.loglik(cell, look, np.arange(150)), loglik)[0, 1] > 0.85
    assert np.abs(off).mean() < 0.15
    assert np.abs(np.mean(off)) < 0.1
