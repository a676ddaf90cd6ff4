"""Identifiability of cells: compared with many simulated queries, checked, saved and opened."""

from __future__ import annotations

import dataclasses
import functools
import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import mixtures, random_database
from scipy.stats import spearmanr
from sentences import refused
from small_city import chances_of

from semsig_gis.core import DatabaseError, InputError, wilson_interval
from semsig_gis.database import City, open_database, save_database
from semsig_gis.evaluation import (
    check_identifiability,
    draw_trials,
    find_lookalikes,
    identify,
    open_identifiability,
    save_identifiability,
    symbol_columns,
    trial_cells,
    try_cells,
)
from semsig_gis.evaluation.identifiability import result as identifiability_file
from semsig_gis.evaluation.identifiability.analysis import _merged_places
from semsig_gis.localization import NoiseSpec, build_index, named_noise
from semsig_gis.observation import Photo

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.evaluation import Identifiability
    from semsig_gis.localization import Noise

DATABASE = random_database(5, cells=90, longest=8)
INDEX = build_index(DATABASE, named_noise("medium"))
COLUMNS = symbol_columns(INDEX)
IDENTIFIABILITY = chances_of(DATABASE)
REPEATS, FEW = 25, 50
SHARP = NoiseSpec(detection=0.9, misnamed=0.05, clutter=0.5, bearing_sigma=4.0)


# From cities with distinct cells to cities with similar cells.
@settings(max_examples=2, deadline=None)
@given(
    st.integers(0, 1000),
    st.sampled_from([(6, 2), (12, 4), (9, 3)]),
    st.sampled_from([*map(named_noise, ("light", "medium", "generic")), SHARP]),
)
def test_probabilities_agree_with_many_simulated_queries(
    seed: int, kind: tuple[int, int], noise: NoiseSpec
) -> None:
    longest, classes = kind
    database = random_database(seed, cells=FEW, longest=longest, classes=classes)
    index = build_index(database, noise)
    result = identify(index, radius=20.0, trials=800, class_trials=2)
    trials = try_cells(index, np.tile(np.arange(FEW), REPEATS), radius=20.0, seed=99)

    for name, most in (("itself", 1.0), ("near", 1.0), ("found", 1.0), ("bits", np.log2(FEW))):
        ours = getattr(result, name) / most
        truth = getattr(trials, name).reshape(REPEATS, FEW).mean(axis=0) / most
        assert abs(ours.mean() - truth.mean()) < 0.05
        # The means of these few queries have errors of 0.1 themselves.
        assert np.sqrt(((ours - truth) ** 2).mean()) < 0.15
        # If all cells have almost the same probability, their order is random.
        assert np.std(truth) < 0.2 or spearmanr(ours, truth).statistic > 0.7


def check_ranges(result: Identifiability, cells: int, classes: int) -> None:
    for chances in (result.itself, result.near, result.found):
        assert chances.shape == (cells,)
        assert ((chances >= 0) & (chances <= 1)).all()
    assert (result.itself <= result.near).all()
    assert ((result.bits >= 0) & (result.bits <= math.log2(cells) + 1e-4)).all()
    assert result.gains.shape == (cells, classes)
    sums = result.lookalike_chances.sum(axis=1)
    assert ((sums >= 0) & (sums <= 1.003 - result.near)).all()
    assert ((result.lookalikes >= 0) | (result.lookalike_chances == 0)).all()


@pytest.mark.parametrize("cells", [1, 2, 30])
@pytest.mark.parametrize("classes", [1, 3])
@pytest.mark.parametrize("radius", [0.0, 50.0, 1e6])
def test_values_are_in_range_in_cities_of_any_size(cells: int, classes: int, radius: float) -> None:
    database = random_database(3, cells=cells, classes=classes)
    index = build_index(database, named_noise("light"))
    result = identify(index, radius=radius, trials=40, class_trials=10)
    check_ranges(result, cells, len(database.present_codes))
    assert radius < 1e6 or (result.lookalikes == -1).all()


def test_probabilities_of_photos_agree_with_many_photos() -> None:
    database = random_database(11, cells=FEW, longest=14)
    index = build_index(database, SHARP)
    result = identify(index, radius=20.0, view=90.0, trials=600, class_trials=4)
    check_ranges(result, FEW, len(database.present_codes))
    assert result.view == 90.0
    cells = np.tile(np.arange(FEW), REPEATS)
    headings = np.random.default_rng(1).uniform(0.0, 360.0, len(cells)).tolist()
    photos = [Photo.looking(heading=heading, fov=90.0) for heading in headings]
    queries = draw_trials(index, cells, photos=photos, seed=99)
    trials = try_cells(index, cells, queries=queries, radius=20.0)
    for name in ("itself", "near", "found"):
        off = getattr(result, name) - getattr(trials, name).reshape(REPEATS, FEW).mean(axis=0)
        assert abs(off.mean()) < 0.06
        assert np.sqrt((off**2).mean()) < 0.15
    whole = identify(index, radius=20.0, trials=200, class_trials=4)
    assert result.found.mean() < whole.found.mean()
    check = check_identifiability(result, index, queries=300)
    assert sum(item.queries for item in check.bins) == 300
    assert abs(check.found - result.found.mean()) < 0.1


def test_places_of_several_looks_are_merged() -> None:
    database = random_database(3, cells=40)
    at = np.stack([database.columns, database.rows], axis=1) * 10.0
    rng = np.random.default_rng(2)
    candidates = rng.integers(-1, 40, (120, 3))
    chances = rng.random((120, 3))
    merged, sums = _merged_places(database, candidates, chances, radius=20.0)
    for cell in range(40):
        of_cell = slice(3 * cell, 3 * cell + 3)
        valid = candidates[of_cell] >= 0
        places, masses = candidates[of_cell][valid], chances[of_cell][valid] / 3.0
        for place, total in zip(merged[cell].tolist(), sums[cell].tolist(), strict=True):
            if place < 0:
                assert (total, len(places)) == (0.0, 0)
                continue
            near = np.hypot(*(at[places][:, None] - at[places]).transpose(2, 0, 1)) <= 20.0
            around = (near * masses).sum(axis=1)
            assert total == pytest.approx(around.max())
            far = np.hypot(*(at[places] - at[place]).T) > 40.0
            places, masses = places[far], masses[far]


def test_detector_that_detects_nothing() -> None:
    noise = NoiseSpec(detection=0.0, clutter=0.0)
    index = build_index(random_database(3, cells=20, longest=2), noise)
    result = identify(index, trials=10, class_trials=2)
    check_ranges(result, 20, len(index.table.codes))
    assert result.found.max() < 0.6


def test_equal_cells_are_lookalikes_with_half_of_the_probability() -> None:
    # Pairs of cells with equal signatures, far from each other.
    database = random_database(6, cells=60, longest=14)
    twins = database.select(np.array([*range(60), *range(30)]))
    order = np.arange(90)
    columns, rows = (order * 20).astype(np.int32), np.zeros(90, np.int32)
    apart = dataclasses.replace(twins, columns=columns, rows=rows)
    result = identify(build_index(apart, named_noise("light")), trials=500, class_trials=2)
    rich = np.flatnonzero(apart.lengths[:30] >= 8)
    assert len(rich) > 5
    assert (result.lookalikes[rich, 0] == rich + 60).all()
    assert (result.lookalikes[rich + 60, 0] == rich).all()
    assert np.abs(result.lookalike_chances[rich, 0] - 0.5).max() < 0.2
    assert np.abs(result.near[rich] - 0.5).max() < 0.2


def test_class_that_distinguishes_cells_gains_most() -> None:
    database = random_database(2, cells=80, longest=10, classes=2)
    # The first class has the same bearing from every cell.
    units = np.where(database.codes == 1, 0, database.bearing_units).astype(np.uint16)
    owner = np.repeat(np.arange(80), database.lengths)
    order = np.lexsort((units, owner))
    plain = dataclasses.replace(database, bearing_units=units[order], codes=database.codes[order])
    result = identify(build_index(plain, named_noise("medium")), trials=300, class_trials=80)
    first, second = result.classes
    assert second.near > first.near
    assert second.bits > first.bits
    sees = (plain.codes == 2).astype(int)
    without = np.add.reduceat(sees, plain.offsets[:-1]) == 0
    assert result.gains[~without, 1].mean() > result.gains[without, 1].mean()


def test_result_does_not_depend_on_threads() -> None:
    index = build_index(random_database(3), named_noise("medium"))
    steps: list[tuple[int, int]] = []
    run = functools.partial(identify, index, trials=60, class_trials=20)
    single = run(seed=4)
    many = run(seed=4, threads=3, progress=lambda *step: steps.append(step))
    assert single.table().equals(many.table())
    assert single.classes == many.classes
    assert steps == sorted(steps)
    assert steps[-1][0] == steps[-1][1] == steps[0][1]
    assert not single.table().equals(run(seed=5).table())


def test_check_agrees_with_plain_loops() -> None:
    check = check_identifiability(IDENTIFIABILITY, INDEX, queries=300, seed=9)
    cells = trial_cells(len(DATABASE), 300, seed=9)
    trials = try_cells(INDEX, cells, radius=IDENTIFIABILITY.radius, seed=9)
    assert check.found == pytest.approx(trials.found.mean())
    scores = {
        "found": IDENTIFIABILITY.found,
        "near": IDENTIFIABILITY.near,
        "length": DATABASE.lengths,
        "type_group": -DATABASE.type_group_sizes,
    }
    assert set(check.correlations) == set(scores)
    for name, score in scores.items():
        expected = spearmanr(score[cells], trials.found).statistic
        assert check.correlations[name] == pytest.approx(expected)
    assert sum(item.queries for item in check.bins) == 300
    stated = IDENTIFIABILITY.found[cells]
    for item in check.bins:
        inside = (item.low <= stated) & ((stated < item.high) | (item.high == 1.0))
        assert item.queries == inside.sum()
        assert item.stated == pytest.approx(stated[inside].mean())
        assert item.true == pytest.approx(trials.found[inside].mean())
        assert (item.true_low, item.true_high) == wilson_interval(item.true, item.queries)


def test_attainable_correlation_is_that_of_true_probabilities() -> None:
    check = check_identifiability(IDENTIFIABILITY, INDEX, queries=400, seed=9)
    stated = IDENTIFIABILITY.found[trial_cells(len(DATABASE), 400, seed=9)]
    rng = np.random.default_rng(0)
    samples = [spearmanr(stated, rng.random(400) < stated).statistic for _ in range(300)]
    assert check.attainable == pytest.approx(np.mean(samples), abs=0.01)


def test_check_has_a_new_seed_and_does_not_depend_on_threads() -> None:
    steps: list[tuple[int, int]] = []
    run = functools.partial(check_identifiability, IDENTIFIABILITY, INDEX, queries=60)
    seed = IDENTIFIABILITY.seed + 1
    assert run() == run(seed=seed, threads=3, progress=lambda *step: steps.append(step))
    assert steps[-1] == (60, 60)


def test_correlation_is_missing_if_all_queries_succeed() -> None:
    database = random_database(5, cells=1)  # with nothing to be mistaken for
    result = dataclasses.replace(chances_of(database), found=np.ones(1))
    check = check_identifiability(result, build_index(database, result.noise), queries=20)
    assert check.found == 1.0
    plain = check.to_dict()
    assert json.loads(json.dumps(plain)) == plain
    assert {plain["attainable"], *plain["correlations"].values()} == {None}


CELLS = random_database(3, cells=40, classes=3)
CHANCES = chances_of(CELLS)
NAMES = ["alignment_tree", "water_fountain", "street_light"]


@pytest.fixture
def city(tmp_path: Path) -> Path:
    save_database(CELLS, tmp_path / "city.parquet")
    return tmp_path / "city.parquet"


@pytest.mark.parametrize("rows", [slice(None), slice(3, 11), slice(0, 0)])
def test_table_has_the_values_of_each_cell(rows: slice) -> None:
    ids = CELLS.cell_ids
    for line, cell in zip(
        CHANCES.table(rows).to_pylist(), np.arange(len(CELLS))[rows].tolist(), strict=True
    ):
        expected = {
            "chance_itself": CHANCES.itself[cell],
            "chance_near": CHANCES.near[cell],
            "chance_found": CHANCES.found[cell],
            "bits_left": CHANCES.bits[cell],
        }
        for place, other in enumerate(CHANCES.lookalikes[cell].tolist(), start=1):
            expected[f"lookalike_{place}"] = ids[other] if other >= 0 else None
            expected[f"lookalike_{place}_chance"] = CHANCES.lookalike_chances[cell, place - 1]
        gains = zip(NAMES, CHANCES.gains[cell], strict=True)
        assert line == expected | {f"gain_{name}": gain for name, gain in gains}


def test_summary_is_consistent() -> None:
    facts = CHANCES.summary(object_counts={1: 50, 2: 10})
    assert sum(band["cells"] for band in facts["bands"]) == facts["cells"] == 40
    assert sum(band["share"] for band in facts["bands"]) == pytest.approx(1.0)
    for band in facts["bands"]:
        top = np.inf if band["to"] == 1 else band["to"]
        inside = (CHANCES.found >= band["from"]) & (CHANCES.found < top)
        assert band["cells"] == int(inside.sum())
    assert facts["noise"] == "medium"
    assert facts["chance_found"] == pytest.approx(CHANCES.found.mean())
    gains = [item["chance_near"] for item in facts["classes"]]
    assert gains == sorted(gains, reverse=True)
    by_code = {item["code"]: item for item in facts["classes"]}
    assert by_code[1]["chance_near_per_1000"] == 20.0 * by_code[1]["chance_near"]
    assert by_code[3]["objects"] == 0
    assert by_code[3]["chance_near_per_1000"] is None
    assert CHANCES.summary()["classes"][0]["objects"] is None


@settings(max_examples=20)
@given(st.integers(0, 100), mixtures(), st.floats(0, 1e6))
def test_saved_identifiability_is_opened(
    tmp_path_factory: pytest.TempPathFactory, seed: int, noise: Noise, radius: float
) -> None:
    path = tmp_path_factory.mktemp("all") / "city.parquet"
    database = random_database(seed, cells=30, classes=3)
    save_database(database, path)
    assert open_identifiability(database, path) is None
    saved = dataclasses.replace(chances_of(database, seed=seed), noise=noise, radius=radius)
    save_identifiability(saved, path)
    opened = open_database(path)
    read = open_identifiability(opened, path)
    assert read is not None
    for name in ("noise", "radius", "classes", "trials", "seed"):
        assert getattr(read, name) == getattr(saved, name)
    assert read.database is opened
    assert read.table().equals(saved.table())


def test_other_signatures_and_formats_are_refused(
    city: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_identifiability(CHANCES, city)
    units = CELLS.distance_units.copy()
    units[7] ^= 1
    other = dataclasses.replace(CELLS, distance_units=units)
    with refused(DatabaseError, "belongs to other signatures", "run semsig identify again"):
        open_identifiability(other, city)
    monkeypatch.setattr(identifiability_file, "FORMAT", identifiability_file.FORMAT + 1)
    with refused(DatabaseError, "another version of semsig"):
        open_identifiability(CELLS, city)


@pytest.mark.parametrize("facts", [{}, {"noise": 3}, {"noise": {"name": "x", "detection": 7.0}}])
def test_damaged_columns_are_refused(city: Path, facts: dict[str, object]) -> None:
    columns = pa.table({"chance_itself": np.zeros(len(CELLS))})
    City(city).put_columns(identifiability_file.NAME, columns, cell_ids=CELLS.cell_ids, facts=facts)
    with refused(DatabaseError, "is damaged", "run semsig identify again"):
        open_identifiability(CELLS, city)


LIGHT = build_index(DATABASE, named_noise("light"))
ELSEWHERE = build_index(random_database(6, cells=90), IDENTIFIABILITY.noise)
identify_city = functools.partial(identify, INDEX)
check = functools.partial(check_identifiability, IDENTIFIABILITY, index=INDEX)
compare_cells = functools.partial(find_lookalikes, COLUMNS)


@pytest.mark.parametrize(
    ("call", "options", "words"),
    [
        (identify_city, {"trials": 0}, ["number of trials", "is 0", "from 1"]),
        (identify_city, {"class_trials": -1}, ["trials without a class", "-1", "from 1"]),
        (identify_city, {"threads": 0}, ["threads", "is 0", "from 1"]),
        (identify_city, {"seed": -1}, ["seed", "is -1", "from 0"]),
        (identify_city, {"view": 5.0}, ["view is 5.0", "from 10 to 360"]),
        (identify_city, {"radius": -5.0}, ["radius is -5.0", "from 0"]),
        (identify_city, {"radius": math.nan}, ["radius is nan", "from 0"]),
        (check, {"queries": 0}, ["queries is 0", "from 1"]),
        (check, {"seed": IDENTIFIABILITY.seed}, ["which is that of the trials"]),
        (check, {"seed": -1}, ["seed is -1", "from 0"]),
        (check, {"index": LIGHT}, ["another database or noise model", "matching one"]),
        (check, {"index": ELSEWHERE}, ["another database or noise model", "matching one"]),
        (compare_cells, {"temperature": 0.0}, ["temperature of 0.0", "above 0"]),
        (compare_cells, {"temperature": math.nan}, ["temperature", "above 0"]),
        (compare_cells, {"temperature": 0.4, "radius": -1.0}, ["radius is -1.0", "from 0"]),
    ],
)
def test_invalid_options_are_refused(
    call: Callable[..., object], options: dict[str, Any], words: list[str]
) -> None:
    with refused(InputError, *words):
        call(**options)
