"""How well cells can be found: the fast way against very many simulated queries.

And whether the chances come true: against plain loops, and against chances that are known.
"""

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
TOLD = chances_of(DATABASE)
REPEATS, FEW = 25, 50
SHARP = NoiseSpec(detection=0.9, misnamed=0.05, clutter=0.5, bearing_sigma=4.0)


# From well told apart to hardly.
@settings(max_examples=2, deadline=None)
@given(
    st.integers(0, 1000),
    st.sampled_from([(6, 2), (12, 4), (9, 3)]),
    st.sampled_from([*map(named_noise, ("light", "medium", "generic")), SHARP]),
)
def test_chances_are_those_of_very_many_queries(
    seed: int, kind: tuple[int, int], noise: NoiseSpec
) -> None:
    longest, classes = kind
    database = random_database(seed, cells=FEW, longest=longest, classes=classes)
    index = build_index(database, noise)
    told = identify(index, radius=20.0, trials=800, class_trials=2)
    tried = try_cells(index, np.tile(np.arange(FEW), REPEATS), radius=20.0, seed=99)

    for name, most in (("itself", 1.0), ("near", 1.0), ("found", 1.0), ("bits", np.log2(FEW))):
        ours = getattr(told, name) / most
        truth = getattr(tried, name).reshape(REPEATS, FEW).mean(axis=0) / most
        assert abs(ours.mean() - truth.mean()) < 0.05
        # The means of so few queries are off by 0.1 themselves.
        assert np.sqrt(((ours - truth) ** 2).mean()) < 0.15
        # Cells that are all told apart alike have no order.
        assert np.std(truth) < 0.2 or spearmanr(ours, truth).statistic > 0.7


def check_ranges(told: Identifiability, cells: int, classes: int) -> None:
    for chances in (told.itself, told.near, told.found):
        assert chances.shape == (cells,)
        assert ((chances >= 0) & (chances <= 1)).all()
    assert (told.itself <= told.near).all()
    assert ((told.bits >= 0) & (told.bits <= math.log2(cells) + 1e-4)).all()
    assert told.gains.shape == (cells, classes)
    named = told.lookalike_chances.sum(axis=1)
    assert ((named >= 0) & (named <= 1.003 - told.near)).all()
    assert ((told.lookalikes >= 0) | (told.lookalike_chances == 0)).all()


@pytest.mark.parametrize("cells", [1, 2, 30])
@pytest.mark.parametrize("classes", [1, 3])
@pytest.mark.parametrize("radius", [0.0, 50.0, 1e6])
def test_cities_of_any_size(cells: int, classes: int, radius: float) -> None:
    database = random_database(3, cells=cells, classes=classes)
    index = build_index(database, named_noise("light"))
    told = identify(index, radius=radius, trials=40, class_trials=10)
    check_ranges(told, cells, len(database.present_codes))
    if radius == 1e6:
        assert (told.lookalikes == -1).all()


def test_chances_of_photos_are_those_of_very_many_photos() -> None:
    database = random_database(11, cells=FEW, longest=14)
    index = build_index(database, SHARP)
    told = identify(index, radius=20.0, view=90.0, trials=600, class_trials=4)
    check_ranges(told, FEW, len(database.present_codes))
    assert told.view == 90.0
    cells = np.tile(np.arange(FEW), REPEATS)
    headings = np.random.default_rng(1).uniform(0.0, 360.0, len(cells)).tolist()
    photos = [Photo.looking(heading=heading, fov=90.0) for heading in headings]
    queries = draw_trials(index, cells, photos=photos, seed=99)
    tried = try_cells(index, cells, queries=queries, radius=20.0)
    for name in ("itself", "near", "found"):
        truth = getattr(tried, name).reshape(REPEATS, FEW).mean(axis=0)
        assert abs(getattr(told, name).mean() - truth.mean()) < 0.06
        assert np.sqrt(((getattr(told, name) - truth) ** 2).mean()) < 0.15
    whole = identify(index, radius=20.0, trials=200, class_trials=4)
    assert told.found.mean() < whole.found.mean()
    check = check_identifiability(told, index, queries=300)
    assert sum(one.queries for one in check.bins) == 300
    assert abs(check.found - told.found.mean()) < 0.1


def test_places_of_several_looks_become_few() -> None:
    database = random_database(3, cells=40)
    at = np.stack([database.columns, database.rows], axis=1) * 10.0
    rng = np.random.default_rng(2)
    found = rng.integers(-1, 40, (120, 3))
    chances = rng.random((120, 3))
    named, sums = _merged_places(database, found, chances, radius=20.0)
    for cell in range(40):
        of_cell = slice(3 * cell, 3 * cell + 3)
        some = found[of_cell] >= 0
        places, masses = found[of_cell][some], chances[of_cell][some] / 3.0
        for one, total in zip(named[cell].tolist(), sums[cell].tolist(), strict=True):
            if one < 0:
                assert (total, len(places)) == (0.0, 0)
                continue
            near = np.hypot(*(at[places][:, None] - at[places]).transpose(2, 0, 1)) <= 20.0
            around = (near * masses).sum(axis=1)
            assert total == pytest.approx(around.max())
            far = np.hypot(*(at[places] - at[one]).T) > 40.0
            places, masses = places[far], masses[far]


def test_a_noise_that_leaves_nothing() -> None:
    noise = NoiseSpec(detection=0.0, clutter=0.0)
    index = build_index(random_database(3, cells=20, longest=2), noise)
    told = identify(index, trials=10, class_trials=2)
    check_ranges(told, 20, len(index.table.codes))
    assert told.found.max() < 0.6


def test_lookalikes_take_what_the_answers_give_them() -> None:
    # Two and two cells that nobody can tell apart, far from each other.
    database = random_database(6, cells=60, longest=14)
    twins = database.select(np.array([*range(60), *range(30)]))
    order = np.arange(90)
    apart = dataclasses.replace(
        twins, columns=(order * 20).astype(np.int32), rows=np.zeros(90, np.int32)
    )
    told = identify(build_index(apart, named_noise("light")), trials=500, class_trials=2)
    rich = np.flatnonzero(apart.lengths[:30] >= 8)
    assert len(rich) > 5
    assert (told.lookalikes[rich, 0] == rich + 60).all()
    assert (told.lookalikes[rich + 60, 0] == rich).all()
    assert np.abs(told.lookalike_chances[rich, 0] - 0.5).max() < 0.2
    assert np.abs(told.near[rich] - 0.5).max() < 0.2


def test_a_class_that_tells_cells_apart_adds_most() -> None:
    database = random_database(2, cells=80, longest=10, classes=2)
    # The first class is seen in the same direction from everywhere.
    units = np.where(database.codes == 1, 0, database.bearing_units).astype(np.uint16)
    owner = np.repeat(np.arange(80), database.lengths)
    order = np.lexsort((units, owner))
    plain = dataclasses.replace(database, bearing_units=units[order], codes=database.codes[order])
    told = identify(build_index(plain, named_noise("medium")), trials=300, class_trials=80)
    first, second = told.classes
    assert second.near > first.near
    assert second.bits > first.bits
    sees = (plain.codes == 2).astype(int)
    without = np.add.reduceat(sees, plain.offsets[:-1]) == 0
    assert told.gains[~without, 1].mean() > told.gains[without, 1].mean()


def test_the_same_whatever_the_threads() -> None:
    index = build_index(random_database(3), named_noise("medium"))
    steps: list[tuple[int, int]] = []
    few = functools.partial(identify, index, trials=60, class_trials=20)
    one = few(seed=4)
    many = few(seed=4, threads=3, progress=lambda *step: steps.append(step))
    assert one.table().equals(many.table())
    assert one.classes == many.classes
    assert steps == sorted(steps)
    assert steps[-1][0] == steps[-1][1] == steps[0][1]
    assert not one.table().equals(few(seed=5).table())


def test_a_check_is_that_of_plain_loops() -> None:
    check = check_identifiability(TOLD, INDEX, queries=300, seed=9)
    cells = trial_cells(len(DATABASE), 300, seed=9)
    tried = try_cells(INDEX, cells, radius=TOLD.radius, seed=9)
    assert check.found == pytest.approx(tried.found.mean())
    scores = {
        "found": TOLD.found,
        "near": TOLD.near,
        "length": DATABASE.lengths,
        "type_group": -DATABASE.type_group_sizes,
    }
    assert set(check.correlations) == set(scores)
    for name, score in scores.items():
        expected = spearmanr(score[cells], tried.found).statistic
        assert check.correlations[name] == pytest.approx(expected)
    assert sum(one.queries for one in check.bins) == 300
    stated = TOLD.found[cells]
    for one in check.bins:
        inside = (one.low <= stated) & ((stated < one.high) | (one.high == 1.0))
        assert one.queries == inside.sum()
        assert one.stated == pytest.approx(stated[inside].mean())
        assert one.true == pytest.approx(tried.found[inside].mean())
        assert (one.true_low, one.true_high) == wilson_interval(one.true, one.queries)


def test_attainable_is_what_true_chances_would_have() -> None:
    check = check_identifiability(TOLD, INDEX, queries=400, seed=9)
    stated = TOLD.found[trial_cells(len(DATABASE), 400, seed=9)]
    rng = np.random.default_rng(0)
    drawn = [spearmanr(stated, rng.random(400) < stated).statistic for _ in range(300)]
    assert check.attainable == pytest.approx(np.mean(drawn), abs=0.01)


def test_the_default_seed_is_fresh_and_threads_change_nothing() -> None:
    steps: list[tuple[int, int]] = []
    one = check_identifiability(TOLD, INDEX, queries=60)
    two = check_identifiability(
        TOLD, INDEX, queries=60, seed=TOLD.seed + 1, threads=3,
        progress=lambda done, all_: steps.append((done, all_)),
    )  # fmt: skip
    assert one == two
    assert steps[-1] == (60, 60)


def test_where_all_succeed_there_is_no_correlation() -> None:
    database = random_database(5, cells=1)  # with nothing to be mistaken for
    told = dataclasses.replace(chances_of(database), found=np.ones(1))
    check = check_identifiability(told, build_index(database, told.noise), queries=20)
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
def test_columns_hold_what_is_known_cell_by_cell(rows: slice) -> None:
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


def test_the_summary_adds_up() -> None:
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
def test_all_comes_back(
    tmp_path_factory: pytest.TempPathFactory, seed: int, noise: Noise, radius: float
) -> None:
    path = tmp_path_factory.mktemp("all") / "city.parquet"
    database = random_database(seed, cells=30, classes=3)
    save_database(database, path)
    assert open_identifiability(database, path) is None
    told = dataclasses.replace(chances_of(database, seed=seed), noise=noise, radius=radius)
    save_identifiability(told, path)
    opened = open_database(path)
    found = open_identifiability(opened, path)
    assert found is not None
    for name in ("noise", "radius", "classes", "trials", "seed"):
        assert getattr(found, name) == getattr(told, name)
    assert found.database is opened
    assert found.table().equals(told.table())


def test_other_signatures_and_formats_are_told(city: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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
def test_damage_is_told(city: Path, facts: dict[str, object]) -> None:
    columns = pa.table({"chance_itself": np.zeros(len(CELLS))})
    City(city).put_columns(identifiability_file.NAME, columns, cell_ids=CELLS.cell_ids, facts=facts)
    with refused(DatabaseError, "is damaged", "run semsig identify again"):
        open_identifiability(CELLS, city)


LIGHT = build_index(DATABASE, named_noise("light"))
ELSEWHERE = build_index(random_database(6, cells=90), TOLD.noise)
ask = functools.partial(identify, INDEX)
check = functools.partial(check_identifiability, TOLD, index=INDEX)
alike = functools.partial(find_lookalikes, COLUMNS)


@pytest.mark.parametrize(
    ("call", "options", "words"),
    [
        (ask, {"trials": 0}, ["number of trials", "is 0", "from 1"]),
        (ask, {"class_trials": -1}, ["trials without a class", "-1", "from 1"]),
        (ask, {"threads": 0}, ["threads", "is 0", "from 1"]),
        (ask, {"seed": -1}, ["seed", "is -1", "from 0"]),
        (ask, {"view": 5.0}, ["view is 5.0", "from 10 to 360"]),
        (ask, {"radius": -5.0}, ["radius is -5.0", "from 0"]),
        (ask, {"radius": math.nan}, ["radius is nan", "from 0"]),
        (check, {"queries": 0}, ["queries is 0", "from 1"]),
        (check, {"seed": TOLD.seed}, ["which is that of the trials"]),
        (check, {"seed": -1}, ["seed is -1", "from 0"]),
        (check, {"index": LIGHT}, ["another database or noise model", "matching one"]),
        (check, {"index": ELSEWHERE}, ["another database or noise model", "matching one"]),
        (alike, {"temperature": 0.0}, ["temperature of 0.0", "above 0"]),
        (alike, {"temperature": math.nan}, ["temperature", "above 0"]),
        (alike, {"temperature": 0.4, "radius": -1.0}, ["radius is -1.0", "from 0"]),
    ],
)
def test_what_is_refused(
    call: Callable[..., object], options: dict[str, Any], words: list[str]
) -> None:
    with refused(InputError, *words):
        call(**options)
