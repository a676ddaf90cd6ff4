"""The first sum over all cells, compared with a slow one; see also `view_oracle`."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import NOTHING, noise_specs, parts_of, random_database, random_query
from scipy.stats import binom, poisson
from small_city import small_city
from view_oracle import cell_loglik, random_view, set_loglik
from worlds import random_town

from semsig_gis.core import Signature
from semsig_gis.localization import (
    TURNS,
    IncrementalIndex,
    build_index,
    index_fingerprint,
    locate,
    named_noise,
    promising_cells,
)
from semsig_gis.localization.likelihood import incremental
from semsig_gis.localization.likelihood import index as index_module
from semsig_gis.observation import Photo, View

if TYPE_CHECKING:
    from semsig_gis.localization import LikelihoodIndex, NoiseSpec

SEEDS = st.integers(0, 10_000)
NOISE = named_noise("generic")
TURN = 360.0 / TURNS
TOWN = random_town()


def slow_counts(index: LikelihoodIndex, query: list[int], cell: int) -> float:
    """Return the likelihood of the counts of the classes, by sums over all hits."""
    table, database = index.table, index.database
    length = int(database.lengths[cell])
    codes = database.codes[database.offsets[cell] : database.offsets[cell + 1]]
    own = np.bincount(table.row_of[codes], minlength=len(table.codes))
    share = sum(query[:-1]) / sum(query)
    detected = own * (1 - table.missed[length])
    names, right = table.named(length), np.diag(table.named(length))
    strays = share * (table.clutter + detected @ names - detected * right)
    chances = share * (1 - table.missed[length]) * right
    total = 0.0
    if share:
        for number, count, stray, chance in zip(query, own, strays, chances, strict=False):
            hits = np.arange(min(count, number) + 1)
            each = binom.pmf(hits, count, chance) * poisson.pmf(number - hits, stray)
            total += math.log(each.sum())
    if query[-1]:
        rate = (1 - share) * float(table.clutter.sum() + detected.sum())
        total += float(poisson.logpmf(query[-1], rate))
    return total


FADING = st.none() | st.just({"all": [[5, 1.0], [20, 0.8], [30, 0.3]]})
PLACES = st.just(0.0) | st.floats(0.5, 5.0)
SECTORS = st.lists(
    st.tuples(st.floats(0, 360), st.floats(5, 300)), max_size=2, unique_by=lambda sector: sector[0]
).map(lambda pairs: tuple((low, low + width) for low, width in pairs))


@settings(max_examples=40)
@given(SEEDS, noise_specs(), FADING, PLACES, st.lists(SECTORS, min_size=1, max_size=2))
def test_scores_equal_the_formula(
    seed: int,
    noise: NoiseSpec,
    fading: dict[str, list[list[float]]] | None,
    position_sigma: float,
    sectors: list[tuple[tuple[float, float], ...]],
) -> None:
    database = random_database(seed, cells=8)
    noise = replace(
        noise,
        fading=fading or {},
        position_sigma=position_sigma,
        bearing_sigma=max(noise.bearing_sigma, 3.0),  # against steps of 0.7 degrees
    )
    photos = [Photo(sectors=some) for some in sectors]
    view = random_view(database, np.random.default_rng(seed), size=3, photos=photos)
    scores = build_index(database, noise).scores(view)
    assert scores.headings == (None,) * len(photos)
    expected = [
        cell_loglik(database, view, noise, cell, form=set_loglik) for cell in range(len(database))
    ]
    # The scan has steps of bearings and levels of distances, which matter most for ranges. A level
    # has an error of up to 9 %, and so has a deviation; if the only object near a detection hardly
    # fits, its square counts.
    errors = np.abs(scores.loglik - expected)
    assert np.median(errors) < 0.25 * len(view)
    assert (errors < 0.5 * len(view) + 0.2 * np.abs(expected)).all()


@settings(max_examples=15)
@given(SEEDS, st.sampled_from([4.0, 20.0, math.inf]), SECTORS)
def test_scores_are_summed_over_turns_by_their_chances(
    seed: int, sigma: float, sectors: tuple[tuple[float, float], ...]
) -> None:
    database = random_database(seed, cells=20)
    index = build_index(database, named_noise("medium"))
    photo = Photo(sectors=sectors, north_sigma=sigma)
    view = View.of(random_query(database, seed, size=6), photos=(photo,))
    turns = np.arange(-32, 32) * TURN
    chances = np.exp(-0.5 * (turns / sigma) ** 2)
    chances /= chances.sum()
    fixed = replace(view, photos=(replace(photo, north_sigma=0.0),))
    logliks = [index.scores(fixed.turned(turn)).loglik for turn in turns.tolist()]
    result = index.scores(view)
    with np.errstate(divide="ignore"):
        each = np.stack(logliks).astype(np.float64) + np.log(chances)[:, None]
    assert result.loglik == pytest.approx(np.logaddexp.reduce(each, axis=0), abs=2e-2)
    assert result.heading is not None
    rows = np.rint((result.heading + 180.0) / TURN).astype(int)
    reached = each[rows, np.arange(len(database))]
    assert reached == pytest.approx(each.max(axis=0), abs=2e-2)


@settings(max_examples=20)
@given(SEEDS, noise_specs(), st.lists(st.integers(0, 4), min_size=1, max_size=9))
def test_types_without_bearings_are_scored_by_their_counts(
    seed: int, spec: NoiseSpec, codes: list[int]
) -> None:
    database = random_database(seed, cells=30)
    index = build_index(database, spec)
    query = Signature(np.array(codes, np.uint8), None)
    counts = np.bincount(index.table.query_rows(query), minlength=5).tolist()
    expected = [slow_counts(index, counts, cell) for cell in range(len(database))]
    assert index.scores(query).loglik == pytest.approx(np.array(expected), rel=1e-4, abs=1e-3)


def test_a_query_of_many_objects_is_scored() -> None:
    database = random_database(2, cells=5)
    index = build_index(database, named_noise("medium"))
    query = random_query(database, 2, size=1)
    many = Signature(*(np.repeat(part, 600) for part in parts_of(query)))
    single, total = index.scores(query).loglik, index.scores(many).loglik
    nothing = index.scores(NOTHING).loglik
    assert total - nothing == pytest.approx(600 * (single - nothing), rel=1e-4)


def test_scores_do_not_depend_on_the_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    database = random_database(8, cells=390)
    query = random_query(database, 8, size=6)
    expected = build_index(database, NOISE).scores(query).loglik
    monkeypatch.setattr("semsig_gis.core.threads.ROWS_A_PART", 50)
    monkeypatch.setattr("semsig_gis.core.threads.cores", lambda: 3)
    assert np.array_equal(build_index(database, NOISE).scores(query).loglik, expected)


@pytest.mark.parametrize("north_sigma", [0.0, 20.0])
def test_scores_by_block_equal_those_of_all_cells(
    monkeypatch: pytest.MonkeyPatch, north_sigma: float
) -> None:
    database = random_database(5, cells=100)
    view = View.of(database.signature(3))
    answer = locate(build_index(database, NOISE), view, north_sigma=north_sigma)
    monkeypatch.setattr(index_module, "MOST_HELD", 0)
    monkeypatch.setattr(index_module, "CELLS_A_BLOCK", 7)
    index = build_index(database, NOISE)
    for scored in (index.scores, index.first_scores):
        scores = scored(view, north_sigma=north_sigma)
        assert len(scores.loglik) == len(database)
        assert (scores.heading is None) == (north_sigma == 0.0)
    by_block = locate(index, view, north_sigma=north_sigma)
    assert "objects" not in vars(index)
    assert by_block.loglik.tolist() == answer.loglik.tolist()
    assert by_block.chances.tolist() == answer.chances.tolist()
    assert by_block.to_dict() == answer.to_dict()


def test_the_fingerprint_depends_on_database_and_noise() -> None:
    database = random_database(8)
    nearer = replace(database, distance_units=database.distance_units // 2)
    others = [random_database(9), database.select(slice(39)), nearer]
    prints = {index_fingerprint(city, NOISE) for city in (database, *others)}
    prints.add(index_fingerprint(database, named_noise("light")))
    assert len(prints) == 5
    assert index_fingerprint(random_database(8), NOISE) in prints


@given(
    st.lists(st.one_of(st.floats(-500, 0, width=32), st.just(-math.inf)), min_size=1, max_size=60),
    st.integers(1, 60),
)
def test_promising_cells_include_the_best(scores: list[float], count: int) -> None:
    array = np.array(scores, np.float32)
    count = min(count, len(array))
    cells = promising_cells(array, count)
    assert len(cells) >= count
    assert (np.diff(cells) > 0).all()
    worst = np.sort(array[cells])[-count]
    assert worst > np.delete(array, cells).max(initial=-math.inf) or len(cells) == len(array)


def test_promising_cells_accept_nan_and_infinity() -> None:
    scores = np.array([math.nan, -3.0, math.inf, -1.0, -math.inf], np.float32)
    for top in (scores, scores[[0, 1, 3, 4]], scores[:1]):
        cells = promising_cells(top, min(2, len(top)))
        assert set(cells.tolist()) <= set(range(len(top)))


@pytest.mark.parametrize("remembered", [True, False])
@pytest.mark.parametrize("sectors", [(), ((10.0, 130.0),)])
def test_incremental_scores_equal_scores_from_scratch(
    sectors: tuple[tuple[float, float], ...],
    monkeypatch: pytest.MonkeyPatch,
    *,
    remembered: bool,
) -> None:
    if not remembered:
        monkeypatch.setattr(incremental, "MOST_BYTES", 0)
    database, _ = small_city()
    index = build_index(database, named_noise("generic"))
    growing = IncrementalIndex(index)
    whole = View.of(
        database.signature(int(database.lengths.argmax())),
        photos=(Photo(sectors=sectors, north_sigma=math.inf),),
    )
    near = np.where(np.arange(len(whole)) % 2, np.nan, 12.0)
    steps = [[0], [0, 1], [0, 2], [0, 1, 2], [0, 1, 2, 2], [1, 2], [], [0, 1, 2, 3, 4]]
    for rows in [*steps, *steps[::-1]]:
        for view in (whole, View.of(whole, ranges=near)):
            part = view.select(np.array(rows, np.int64))
            expected, result = index.scores(part), growing.scores(part)
            assert result.loglik == pytest.approx(expected.loglik, abs=1e-4)
            assert expected.heading is not None
            assert result.heading is not None
            assert (expected.heading == result.heading).mean() > 0.99
    assert (len(growing._photos) == 2) == remembered
