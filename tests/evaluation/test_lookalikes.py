"""Kernels of identifiability compared with plain loops, and trials compared with their steps."""

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
from semsig_gis.evaluation.identifiability import trials as trial_module
from semsig_gis.localization import (
    CellScores,
    NoiseMixture,
    NoiseSpec,
    build_index,
    named_noise,
    posterior,
    score_associations,
)
from semsig_gis.observation import Photo, View

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import SymbolColumns
    from semsig_gis.localization import Noise

COLUMNS = symbol_columns(build_index(random_database(5, cells=300), named_noise("medium")))


def bytes_of(columns: SymbolColumns) -> np.ndarray:
    """Return the values of all symbols in all cells, in steps."""
    return columns.of(np.arange(len(columns.database)))


def ratios(columns: SymbolColumns, cell: int, temperature: float) -> np.ndarray:
    """Return the tempered ratios of all cells to a cell, from the columns of its objects."""
    part = slice(*columns.database.offsets[cell : cell + 2].tolist())
    sums = bytes_of(columns)[columns.symbols[part]].sum(axis=0, dtype=np.int64)
    loglik = columns.constants[0] + columns.step * sums
    octaves = temperature * (loglik - loglik[cell]) / math.log(2.0)
    return np.asarray(2.0 ** np.clip(octaves, -100.0, 100.0))


def distances_from(index: SymbolColumns, cell: int) -> np.ndarray:
    return np.asarray(np.hypot(*(index.database.xy - index.database.xy[cell]).T).round(6))


@settings(max_examples=25, deadline=None)
@given(
    noise_specs(),
    st.integers(0, 50),
    st.sampled_from([1, 2, 40, 200]),
    st.floats(0.1, 1.0),
    st.sampled_from([0.0, 10.0, 30.0, 50.0, 1000.0]),
)
def test_sums_agree_with_a_plain_loop(
    noise: NoiseSpec, seed: int, cells: int, temperature: float, radius: float
) -> None:
    database = random_database(seed, cells=cells)
    # A row of the confusion matrix needs a class that occurs.
    assume(not noise.confusion or np.isin(database.present_codes, [1, 3]).any())
    index = symbol_columns(build_index(database, noise))
    result = find_lookalikes(index, temperature=temperature, radius=radius, places=3)
    for cell in range(0, cells, 7):
        powers, away = ratios(index, cell, temperature), distances_from(index, cell)
        near = away <= radius
        assert math.isclose(result.near[cell], powers[near].sum(), rel_tol=2e-3)
        assert math.isclose(result.far[cell], powers[~near].sum(), rel_tol=2e-3, abs_tol=1e-26)
        places = result.cells[cell][result.cells[cell] >= 0]
        assert (result.sums[cell][result.cells[cell] < 0] == 0).all()
        assert (np.diff(result.sums[cell]) <= 0).all()
        if near.all():
            assert not len(places)
            continue
        best = powers[~near].max()
        assert math.isclose(powers[places].max(), best, rel_tol=1e-4)
        for place, total in zip(places.tolist(), result.sums[cell], strict=False):
            around = distances_from(index, place) <= radius
            assert not near[place]
            # Cells in both circles count with the least ratio.
            expected = powers[around & ~near].sum() + 2.0**-100 * (around & near).sum()
            assert math.isclose(total, expected, rel_tol=2e-3)
            others = places[places != place]
            assert (distances_from(index, place)[others] > 2 * radius).all()


def test_nearer_cell_is_selected_of_equal_ones() -> None:
    database = random_database(2, cells=1)
    many = np.arange(30)
    repeated = database.select(np.zeros(30, np.int64))
    zeros, rows = np.zeros(30, np.int32), (many * 10).astype(np.int32)
    row = dataclasses.replace(repeated, columns=zeros, rows=rows)
    columns = symbol_columns(build_index(row, named_noise("light")))
    result = find_lookalikes(columns, temperature=0.5, radius=20.0, places=2)
    assert sorted(result.cells[10].tolist()) == [9, 11]
    assert np.allclose(result.sums[10], 1.0, rtol=1e-3)
    assert math.isclose(result.far[10], 29.0, rel_tol=1e-3)


def test_result_does_not_depend_on_threads_and_selected_cells() -> None:
    whole = find_lookalikes(COLUMNS, temperature=0.4, threads=3)
    steps: list[tuple[int, int]] = []
    two = np.array([250, 3])
    part = find_lookalikes(
        COLUMNS, temperature=0.4, looks=two, progress=lambda *step: steps.append(step)
    )
    assert steps == [(2, 2)]
    for name in ("near", "far", "cells", "sums", "rise"):
        assert getattr(part, name).tolist() == getattr(whole, name)[two].tolist()


@settings(max_examples=15, deadline=None)
@given(noise_specs(), st.integers(0, 50), st.sampled_from([0.0, 30.0]))
def test_rise_without_a_class_agrees_with_a_plain_loop(
    noise: NoiseSpec, seed: int, radius: float
) -> None:
    database = random_database(seed, cells=60)
    index = symbol_columns(build_index(database, noise))
    rise = find_lookalikes(index, temperature=0.4, radius=radius).rise
    table, flat = index.table, bytes_of(index)
    owner = np.repeat(np.arange(len(database)), database.lengths)
    length = np.minimum(database.lengths, len(table.missed) - 1)[owner]
    kinds, far = table.row_of[database.codes], database.distance_units
    detected = table.detected[length, kinds]
    missed = (
        np.log1p(-detected * table.remaining[kinds, far]) - detected * table.leaving[kinds, far]
    )
    for cell in range(0, len(database), 13):
        beyond = distances_from(index, cell) > radius
        sums = []
        for omitted in [-1, *range(len(table.codes))]:
            part = slice(database.offsets[cell], database.offsets[cell + 1])
            kinds = table.row_of[database.codes[part]]
            symbols = kinds * 72 + database.bearing_units[part] // 100
            scores = index.step * flat[symbols[kinds != omitted]].astype(float).sum(axis=0)
            without = table.row_of[database.codes] == omitted
            scores += index.constants[0] - np.bincount(
                owner[without], missed[without], len(database)
            )
            sums.append(np.exp(0.4 * (scores - scores[cell]))[beyond].sum())
        if sums[0] > 1e-3:
            expected = np.log(np.array(sums[1:]) / sums[0])
            assert np.allclose(rise[cell], expected, atol=2e-2)


@pytest.mark.parametrize("temperature", [0.2, 0.6])
def test_sample_represents_cells_that_are_not_likely(
    temperature: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    columns = symbol_columns(build_index(random_database(7, cells=400), named_noise("medium")))
    some = np.arange(0, 400, 5)
    whole = find_lookalikes(columns, temperature=temperature, looks=some)
    monkeypatch.setattr(lookalikes, "SAMPLE_CELLS", 200)
    monkeypatch.setattr(lookalikes, "LIKELY_CELLS", 100)
    result = find_lookalikes(columns, temperature=temperature, looks=some)
    # Likely cells are not sampled: the lookalikes and the sums around them are the same.
    for name in ("near", "cells", "sums"):
        assert getattr(result, name).tolist() == getattr(whole, name).tolist()
    errors = np.log(result.far / whole.far)
    assert 0.0 < np.abs(errors).max() < 0.3
    assert abs(errors.mean()) < 0.03
    assert np.abs(result.rise - whole.rise).mean() < 0.1


def test_signature_with_more_objects_than_fit_into_16_bits() -> None:
    database = random_database(4, cells=6, longest=700, classes=3)
    assert database.lengths.max() > 257
    index = symbol_columns(build_index(database, named_noise("light")))
    result = find_lookalikes(index, temperature=0.2, radius=0.0)
    for cell in range(6):
        powers = ratios(index, cell, 0.2)
        assert math.isclose(result.near[cell] + result.far[cell], powers.sum(), rel_tol=5e-3)


@pytest.mark.parametrize("noise", ["light", "generic"])
@pytest.mark.parametrize("radius", [0.0, 30.0])
def test_outcomes_of_trials_agree_with_the_whole_method(
    noise: str, radius: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Every cell is re-ranked.
    monkeypatch.setattr(trial_module, "LEAST_SHARE", 0.0)
    monkeypatch.setattr(trial_module, "RERANKED", 500)
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
        first = CellScores(loglik=columns.scores(query, 0, bases=columns.bases()))
        errors = first.loglik - index.scores(query).loglik
        assert np.abs(errors).mean() < 0.2 * len(query)  # bearings are in steps of five degrees
        exact = score_associations(database, query, index.noise, np.arange(len(database)))
        answer = posterior(database, exact)
        away = np.hypot(*(database.xy - database.xy[cell]).T)
        assert math.isclose(trials.itself[row], answer.chances[cell], abs_tol=1e-6)
        assert math.isclose(trials.near[row], answer.chances[away <= radius].sum(), abs_tol=1e-6)
        assert math.isclose(trials.bits[row], answer.entropy, abs_tol=1e-4)
        best, _ = answer.best_place(radius)
        assert trials.found[row] == (away[best] <= radius)
        own = columns.loglik(cell, 0, np.arange(120))
        lean = answer.chances @ (own - own[cell])
        assert math.isclose(trials.lean[row], lean, abs_tol=1e-3)


def large_city(seed: int, cells: int, *, longest: int = 12) -> SignatureDatabase:
    """Return a city of many cells, in which 400 signatures are repeated."""
    database = random_database(seed, cells=400, longest=longest)
    columns, rows = np.divmod(np.arange(cells, dtype=np.int32), 50)
    repeated = database.select(np.arange(cells) % 400)
    return dataclasses.replace(repeated, columns=columns, rows=rows)


@pytest.mark.parametrize("noise", ["light", "generic"])
def test_sampled_cells_of_trials_represent_the_others(
    noise: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    database = large_city(8, 2000, longest=6)
    index = build_index(database, named_noise(noise))
    cells = trial_cells(len(database), 150, seed=2)
    columns = symbol_columns(index)
    whole = try_cells(index, cells, columns=columns, seed=3)
    monkeypatch.setattr(trial_module, "LIKELIEST", 500)
    part = try_cells(index, cells, columns=columns, seed=3)
    for name in ("itself", "near", "found"):
        errors = 1.0 * getattr(part, name) - getattr(whole, name)
        # A view that fits many cells is found in fewer or more places by chance.
        assert abs(errors.mean()) < (0.1 if name == "found" else 2e-3)
        assert np.sqrt((errors**2).mean()) < (0.3 if name == "found" else 1e-2)
    assert abs((part.bits - whole.bits).mean()) < 0.3
    assert np.abs(part.bits - whole.bits).max() < 1.0


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 50), st.sampled_from([1, 40, 300]), st.sampled_from([0.0, 3.0, math.inf]))
def test_scores_agree_with_a_plain_loop(seed: int, cells: int, margin: float) -> None:
    database = random_database(seed, cells=cells, classes=3)
    columns = symbol_columns(build_index(database, named_noise("medium")))
    query = database.signature(seed % cells)
    flat, rows = bytes_of(columns), columns.table.query_rows(query)
    symbols = rows * 72 + np.floor(parts_of(query)[1] / 5.0).astype(np.int64) % 72
    sums = columns.step * flat[symbols].sum(axis=0, dtype=np.int64)
    sums += np.log(columns.table.density[rows]).sum()
    for omitted in (None, 0):
        expected = columns.constants[0] + sums
        if omitted is not None:
            others = columns.counts[0].sum(axis=0) > columns.counts[0, omitted]
            expected = np.where(others, expected - columns.missed[0, omitted], -np.inf)
        bases = columns.bases(omitted)
        scores = columns.scores(query, 0, bases=bases, margin=margin)
        selection = np.isfinite(scores)
        assert np.allclose(scores[selection], expected[selection], atol=1e-3)
        assert (selection | ~(expected > expected.max() - margin + 1e-3)).all()


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 100), st.integers(1, 400), st.floats(0.5, 3.0))
def test_shifts_interpolate_the_changes_of_a_sample(seed: int, count: int, slope: float) -> None:
    rng = np.random.default_rng(seed)
    scores = rng.normal(0.0, 5.0, count)
    sample = trial_module._sample(scores)
    assert len(np.unique(sample)) == len(sample) <= trial_module.RERANKED_SAMPLE
    assert (np.diff(scores[sample]) <= 0).all()
    before = scores[sample]
    # The same change everywhere is found again; a change by score lies between its extremes.
    assert np.allclose(trial_module._shifts(scores, before, before - slope), -slope)
    shifts = trial_module._shifts(scores, before, before * (1.0 + slope))
    assert shifts.min() >= slope * before.min() - 1e-9
    assert shifts.max() <= slope * before.max() + 1e-9


def test_similar_cells_are_neighbours() -> None:
    order = COLUMNS.order
    assert sorted(order.tolist()) == list(range(300))
    assert (COLUMNS.slots[order] == np.arange(300)).all()
    sees = (COLUMNS.counts[0][:, order] > 0).T
    changes = (sees[1:] != sees[:-1]).any(axis=1).sum()
    assert changes == len(np.unique(sees, axis=0)) - 1


def test_blocks_without_likely_cells_do_not_change_the_result(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Some of several blocks are skipped. The likely cells and their places are the same.
    columns = symbol_columns(build_index(large_city(9, 5000), named_noise("medium")))
    monkeypatch.setattr(lookalikes, "LIKELY_CELLS", 40)
    some = np.arange(0, 5000, 250)
    result = find_lookalikes(columns, temperature=0.5, radius=20.0, looks=some)
    for row, cell in enumerate(some.tolist()):
        powers, away = ratios(columns, cell, 0.5), distances_from(columns, cell)
        beyond = powers * (away > 20.0)
        assert math.isclose(result.near[row], powers[away <= 20.0].sum(), rel_tol=2e-3)
        assert math.isclose(powers[result.cells[row]].max(), beyond.max(), rel_tol=1e-4)
        assert abs(np.log(result.far[row] / beyond.sum())) < 0.5


def test_query_without_detections_is_not_answered() -> None:
    database = random_database(8, cells=10)
    index = build_index(database, named_noise("light"))
    nothing = Signature(np.zeros(0, np.uint8), np.zeros(0))
    trials = try_cells(index, np.array([4]), queries=[nothing])
    assert (trials.itself[0], trials.near[0], trials.found[0]) == (0.0, 0.0, False)
    assert math.isclose(trials.bits[0], math.log2(10))
    assert math.isnan(trials.lean[0])


@settings(max_examples=50)
@given(st.integers(1, 50), st.integers(0, 200), st.integers(0, 5))
def test_every_cell_has_almost_the_same_number_of_trials(cells: int, count: int, seed: int) -> None:
    cells_of_trials = trial_cells(cells, count, seed=seed)
    counts = np.bincount(cells_of_trials, minlength=cells)
    assert len(cells_of_trials) == count
    assert counts.max() - counts.min() <= 1
    assert trial_cells(cells, count + 1, seed=seed)[:count].tolist() == cells_of_trials.tolist()


@settings(max_examples=30, deadline=None)
@given(mixtures(), st.integers(0, 100), st.integers(0, 19))
def test_query_is_sorted_and_independent_of_other_queries(
    noise: Noise, seed: int, cell: int
) -> None:
    index = build_index(random_database(1, cells=20, longest=8, classes=3), noise)
    queries = list(draw_trials(index, np.array([3, 7, cell, 5]), seed=seed))
    *_, repeated = draw_trials(index, np.array([0, 0, cell]), seed=seed)
    for query in queries:
        assert (np.diff(parts_of(query)[1]) >= 0).all()
    for part, other in zip(parts_of(repeated), parts_of(queries[2]), strict=True):
        assert part.tolist() == other.tolist()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 100), st.integers(1, 4))
def test_leaving_out_a_class_agrees_with_a_plain_loop(seed: int, code: int) -> None:
    database = random_database(seed, cells=20, longest=4)
    without, rows = leave_class_out(database, code)
    rows_of_cells: list[int] = []
    for cell in range(len(database)):
        codes, bearings = parts_of(database.signature(cell))
        others = codes != code
        if not others.any():
            assert rows[cell] == -1
            continue
        assert rows[cell] == len(rows_of_cells)
        rows_of_cells.append(cell)
        actual = [part.tolist() for part in parts_of(without.signature(int(rows[cell])))]
        assert actual == [codes[others].tolist(), bearings[others].tolist()]
    assert len(without) == len(rows_of_cells)
    assert without.cell_ids.tolist() == database.cell_ids[rows_of_cells].tolist()


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
def test_every_class_gains_information(noise: Noise) -> None:
    database = random_database(4, cells=80, longest=8, classes=3)
    index = build_index(database, noise)
    cells = np.arange(len(database))
    whole = try_cells(index, cells, radius=20.0)
    steps: list[tuple[int, int]] = []
    near, bits = try_without_classes(
        index, cells, radius=20.0, progress=lambda *step: steps.append(step)
    )
    assert near.shape == bits.shape == (80, 3)
    # Queries are repeated only if the class is visible or detected.
    sees = [
        np.add.reduceat(database.codes == code, database.offsets[:-1]) > 0 for code in (1, 2, 3)
    ]
    assert (np.isfinite(near) == np.isfinite(bits)).all()
    assert np.isfinite(near)[np.stack(sees, axis=1)].all()
    assert np.isnan(near).any() or (index.table.clutter > 1.0).any()
    repeated, blank = np.isfinite(near), np.broadcast_to(whole.near[:, None], near.shape)
    near, bits = np.where(repeated, near, blank), np.where(repeated, bits, whole.bits[:, None])
    assert steps[-1] == (240, 240)
    assert (near.mean(axis=0) < whole.near.mean()).all()
    assert (bits.mean(axis=0) > whole.bits.mean()).all()


@settings(max_examples=10, deadline=None)
@given(noise_specs())
def test_cells_cannot_be_found_without_their_only_class(noise: NoiseSpec) -> None:
    index = build_index(random_database(1, cells=10, classes=1), noise)
    near, bits = try_without_classes(index, np.arange(4))
    assert near.tolist() == [[0.0]] * 4
    assert np.allclose(bits, np.log2(10))


@settings(max_examples=20, deadline=None)
@given(noise_specs(), st.integers(0, 50), st.sampled_from([1, 63, 65]))
def test_columns_agree_with_the_noise_table(noise: NoiseSpec, seed: int, cells: int) -> None:
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
    detected, far = table.detected[length, kinds], database.distance_units
    chance = detected * table.remaining[kinds, far]
    density = chance / (1.0 - chance) * inside + detected * table.leaving[kinds, far] / 360.0
    chances = np.stack([table.named(row) for row in range(len(table.missed))])
    density *= chances[length, kinds, name]
    expected = np.log1p(np.bincount(owner, density, cells) / table.density[name])
    # A byte holds at most 255 steps; standard deviations are rounded to levels if they differ.
    expected = np.minimum(expected, 255 * columns.step)
    slack = 0.5 * columns.step + 2.0**-9 + (0.2 if table.position_sigma else 1e-3)
    assert np.abs(expected - columns.step * values[symbol]).max() < slack


def test_photos_are_compared_by_their_visible_objects() -> None:
    database = random_database(5, cells=150, longest=20)
    looks = tuple(Photo.looking(heading=heading, fov=70.0) for heading in (0.0, 120.0, 240.0))
    index = build_index(database, named_noise("medium"))
    columns = symbol_columns(index, looks=looks)
    result = find_lookalikes(columns, temperature=0.5, radius=20.0)
    away_from = functools.partial(distances_from, columns)
    errors = []
    for number in range(0, 450, 11):
        cell, look = divmod(number, 3)
        view = View.of(database.signature(cell), photos=(looks[look],))
        view = view.select(looks[look].sees(parts_of(view)[1]))
        assert columns.counts[look, :, cell].sum() == len(view)
        if not len(view):
            assert (result.near[number], result.far[number]) == (0.0, 0.0)
            assert (result.cells[number] == -1).all()
            continue
        loglik = index.scores(view).loglik.astype(np.float64)
        powers = np.exp(0.5 * (loglik - loglik[cell]))
        beyond = away_from(cell) > 20.0
        # For objects at the edge of the view, the likelihood uses the odds of being in it.
        errors.append(np.log(result.far[number] / powers[beyond].sum()))
        assert np.corrcoef(columns.loglik(cell, look, np.arange(150)), loglik)[0, 1] > 0.85
    assert np.abs(errors).mean() < 0.15
    assert np.abs(np.mean(errors)) < 0.1
