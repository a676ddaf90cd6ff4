from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import mixtures, noise_specs, parts_of, random_database, random_query, turned_query
from scipy.special import ndtr
from scipy.stats import binom, poisson
from sentences import refused

from semsig_gis.core.errors import DatabaseError, InputError
from semsig_gis.core.signature import Signature
from semsig_gis.database.city import City
from semsig_gis.database.file import save_database
from semsig_gis.likelihood.index import (
    BIN_DEGREES,
    LEAST_PRIOR,
    build_index,
    index_fingerprint,
    open_index,
    ready_index,
    save_index,
)
from semsig_gis.likelihood.kernels import promising_cells
from semsig_gis.likelihood.noise.model import NoiseSpec, named_noise

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from typing import Any

    from semsig_gis.likelihood.index import LikelihoodIndex
    from semsig_gis.likelihood.noise.model import Noise

SEEDS = st.integers(0, 10_000)
NOISE = named_noise("generic")
DATABASE = random_database(12, cells=150)


def bin_density(bearing: float, seen: float, sigma: float) -> float:
    """Return the mean density a degree of a wrapped normal over the bin of a bearing."""
    low = math.floor(seen / BIN_DEGREES) * BIN_DEGREES - bearing + 360 * np.arange(-4, 5)
    return float((ndtr((low + BIN_DEGREES) / sigma) - ndtr(low / sigma)).sum()) / BIN_DEGREES


def slow_loglik(index: LikelihoodIndex, query: Signature, cell: int) -> float:
    """Return the formula of one cell, one number at a time, without steps."""
    table, database = index.table, index.database
    part = slice(database.offsets[cell], database.offsets[cell + 1])
    length = min(int(database.lengths[cell]), len(table.missed) - 1)
    kinds = table.row_of[database.codes[part]].tolist()
    sigmas = table.sigmas(database.reach)[kinds, database.distance_units[part]].tolist()
    bearings = (database.bearings[part] + 0.025).tolist()  # the middle of a unit
    total = sum(math.log(table.missed[length, kind]) for kind in kinds) - table.clutter.sum()
    names, seen_at = table.query_rows(query), parts_of(query)[1]
    for name, seen in zip(names.tolist(), seen_at.tolist(), strict=True):
        density = alone = table.density[name]
        for kind, bearing, sigma in zip(kinds, bearings, sigmas, strict=True):
            missed = table.missed[length, kind]
            chance = 1.0 if name == len(table.codes) else table.named[length, kind, name]
            odds = (1 - missed) / missed * chance
            density += odds * bin_density(bearing, seen, sigma)
        # A byte holds no more than what four objects in one direction add.
        total += min(math.log(density), math.log(alone) + 255 * index.step)
    return float(total)


def slack(index: LikelihoodIndex, query: Signature) -> float:
    """Return how far the steps of the columns may be from the formula."""
    return len(query) * (0.5 * index.step + 2.0**-9) + 1e-3


def slow_counts(index: LikelihoodIndex, query: list[int], cell: int) -> float:
    """Return the likelihood of so many objects of each class, by sums over all hits."""
    table, database = index.table, index.database
    length = int(database.lengths[cell])
    codes = database.codes[database.offsets[cell] : database.offsets[cell + 1]]
    own = np.bincount(table.row_of[codes], minlength=len(table.codes))
    share = sum(query[:-1]) / sum(query)
    detected = own * (1 - table.missed[length])
    named, right = table.named[length], np.diag(table.named[length])
    strays = share * (table.clutter + detected @ named - detected * right)
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


UNSURE_PLACES = st.builds(NoiseSpec, position_sigma=st.floats(0.5, 15.0))


@settings(max_examples=35)
@given(SEEDS, mixtures() | UNSURE_PLACES, st.integers(1, 9))
def test_scores_are_the_formula_to_within_the_steps(seed: int, noise: Noise, size: int) -> None:
    database = random_database(seed, cells=8)
    index = build_index(database, noise)
    query = random_query(database, seed, size=size)
    scores = index.scores(query)
    assert scores.heading is None
    # Deviations that depend on the distance are kept in 128 levels, two per cent apart.
    levels = 0.2 * size if index.table.position_sigma else 0.0
    expected = [slow_loglik(index, query, cell) for cell in range(len(database))]
    assert scores.loglik == pytest.approx(np.array(expected), abs=slack(index, query) + levels)


@settings(max_examples=10)
@given(SEEDS, st.sampled_from([4.0, 20.0, math.inf]))
def test_turns_are_summed_over_with_their_chances(seed: int, sigma: float) -> None:
    database = random_database(seed, cells=20)
    index = build_index(database, named_noise("medium"))
    query = random_query(database, seed, size=6)
    turns = np.arange(-36, 36) * BIN_DEGREES
    chances = np.exp(-0.5 * (turns / sigma) ** 2)
    chances[chances <= LEAST_PRIOR] = 0.0  # the likeliest has 1
    chances /= chances.sum()
    logliks = [index.scores(turned_query(query, turn)).loglik for turn in turns.tolist()]
    found = index.scores(query, north_sigma=sigma)
    with np.errstate(divide="ignore"):
        each = np.stack(logliks).astype(np.float64) + np.log(chances)[:, None]
    assert found.loglik == pytest.approx(np.logaddexp.reduce(each, axis=0), abs=2e-3)
    assert found.heading is not None
    rows = ((found.heading + 180.0) / BIN_DEGREES).astype(int)
    reached = each[rows, np.arange(len(database))]
    assert reached == pytest.approx(each.max(axis=0), abs=2e-3)


@settings(max_examples=20)
@given(SEEDS, noise_specs(), st.lists(st.integers(0, 4), min_size=1, max_size=9))
def test_types_alone_are_compared_by_their_numbers(
    seed: int, spec: NoiseSpec, codes: list[int]
) -> None:
    database = random_database(seed, cells=30)
    index = build_index(database, spec)
    query = Signature(np.array(codes, np.uint8), None)
    counts = np.bincount(index.table.query_rows(query), minlength=5).tolist()
    expected = [slow_counts(index, counts, cell) for cell in range(len(database))]
    assert index.scores(query).loglik == pytest.approx(np.array(expected), rel=1e-4, abs=1e-3)


def test_a_query_longer_than_sixteen_bits_hold_is_scored() -> None:
    database = random_database(2, cells=5)
    index = build_index(database, named_noise("medium"))
    one = random_query(database, 2, size=1)
    many = Signature(*(np.repeat(part, 600) for part in parts_of(one)))
    single, found = index.scores(one).loglik, index.scores(many).loglik
    assert found - index.constants == pytest.approx(600 * (single - index.constants), rel=1e-4)


@pytest.mark.parametrize("cells", [1, 63, 64, 65])
def test_any_number_of_cells_is_worked_out(cells: int) -> None:
    database = random_database(6, cells=cells)
    index = build_index(database, named_noise("light"), threads=3)
    query = random_query(database, 6, size=3)
    for cell in (0, cells - 1):
        expected = slow_loglik(index, query, cell)
        assert index.scores(query).loglik[cell] == pytest.approx(expected, abs=slack(index, query))


def test_columns_come_out_the_same_whatever_the_threads_and_the_progress_is_told() -> None:
    database = random_database(8, cells=390)
    done: list[tuple[int, int]] = []
    one, four = (
        build_index(database, NOISE, threads=threads, progress=lambda *cells: done.append(cells))
        for threads in (1, 4)
    )
    assert np.array_equal(one.columns, four.columns)
    assert done[-1] == (390, 390)


def test_the_fingerprint_changes_with_what_the_index_depends_on() -> None:
    database = random_database(8)
    nearer = replace(database, distance_units=database.distance_units // 2)
    others = [random_database(9), database.select(slice(39)), nearer]
    prints = {index_fingerprint(one, NOISE) for one in (database, *others)}
    prints.add(index_fingerprint(database, named_noise("light")))
    assert len(prints) == 5
    assert index_fingerprint(random_database(8), NOISE) in prints


@given(
    st.lists(st.one_of(st.floats(-500, 0, width=32), st.just(-math.inf)), min_size=1, max_size=60),
    st.integers(1, 60),
)
def test_promising_cells_hold_the_best(scores: list[float], count: int) -> None:
    array = np.array(scores, np.float32)
    count = min(count, len(array))
    cells = promising_cells(array, count)
    assert len(cells) >= count
    assert (np.diff(cells) > 0).all()
    worst = np.sort(array[cells])[-count]
    assert worst > np.delete(array, cells).max(initial=-math.inf) or len(cells) == len(array)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return the file of an index."""
    save_index(DATABASE, NOISE, tmp_path / "city.likelihood")
    return tmp_path / "city.likelihood"


def test_an_index_comes_back_from_its_file(path: Path) -> None:
    built, opened = build_index(DATABASE, NOISE), open_index(DATABASE, NOISE, path)
    query = random_query(DATABASE, 1, size=6)
    assert np.array_equal(built.columns, opened.columns)
    assert np.array_equal(built.scores(query).loglik, opened.scores(query).loglik)
    assert opened.fingerprint == built.fingerprint
    assert not opened.columns.flags.writeable
    assert list(path.parent.iterdir()) == [path]
    path.unlink()
    with refused(DatabaseError, "No such file"):
        open_index(DATABASE, NOISE, path)


def test_each_model_has_a_file_of_its_own(tmp_path: Path) -> None:
    city = City(tmp_path / "city.parquet")
    noises = [NOISE, named_noise("light"), NoiseSpec(), NoiseSpec(clutter=2.0)]
    names = {city.index_path(noise).name for noise in noises}
    assert len(names) == 4
    assert all(name.startswith("city.parquet.") for name in names)
    assert city.index_path(NoiseSpec(name="a/b c")).parent == tmp_path


@pytest.mark.parametrize("make", [ready_index, save_index])
def test_a_database_is_not_replaced(make: Callable[..., object], tmp_path: Path) -> None:
    path = tmp_path / "city.parquet"
    save_database(DATABASE, path)
    content = path.read_bytes()
    with refused(InputError, str(City(path).index_path(NOISE))):
        make(DATABASE, NOISE, path)
    assert path.read_bytes() == content


DAMAGED = "damaged"
FAULTS: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "cut": (lambda content: content[:-1], DAMAGED),
    "empty": (lambda _: b"", DAMAGED),
    "header": (lambda content: b"\xff" + content[1:], DAMAGED),
    "list": (lambda content: b"[]".ljust(len(content)), DAMAGED),
    "constants": (lambda content: content[:16385] + b"\x77" + content[16386:], DAMAGED),
    "step": (lambda content: content.replace(b'"step": 0', b'"step":-0', 1), DAMAGED),
    "number": (lambda content: content.replace(b'"step": 0.0', b'"step": 0.1', 1), DAMAGED),
    "stale": (
        lambda content: content.replace(b'"fingerprint": "', b'"fingerprint":"x', 1),
        "another database, noise model or version",
    ),
}


@pytest.mark.parametrize(("fault", "word"), FAULTS.values(), ids=FAULTS)
def test_a_damaged_file_is_refused_and_then_renewed(
    fault: Callable[[bytes], bytes], word: str, path: Path
) -> None:
    path.write_bytes(fault(path.read_bytes()))
    with refused(DatabaseError, word, "again"):
        open_index(DATABASE, NOISE, path)
    notes: list[str] = []
    done: list[tuple[int, int]] = []
    told: Any = {"note": notes.append, "progress": lambda *cells: done.append(cells)}
    index = ready_index(DATABASE, NOISE, path, **told, threads=2)
    assert np.array_equal(index.columns, build_index(DATABASE, NOISE).columns)
    assert done[-1] == (150, 150)
    ready_index(DATABASE, NOISE, path, **told)
    (note,) = notes
    assert note.startswith("The likelihood index is built again: ")
    assert word in note


def test_a_column_that_was_changed_is_told_when_a_query_needs_it(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[-1] ^= 1  # of the last class, which stands for "not known"
    path.write_bytes(content)
    index = open_index(DATABASE, NOISE, path)
    index.scores(DATABASE.signature(3))
    with refused(DatabaseError, path.name, "delete it"):
        index.flat_columns()


def test_where_no_file_can_be_written_the_index_is_kept_in_memory(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way of a folder")
    notes: list[str] = []
    index = ready_index(DATABASE, NOISE, tmp_path / "file" / "x", note=notes.append)
    assert "kept in memory only" in notes[-1]
    assert len(index.constants) == 150
    assert ready_index(DATABASE, NOISE, tmp_path / "file" / "x").step == index.step
