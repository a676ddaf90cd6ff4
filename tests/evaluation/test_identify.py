"""How well cells can be found: the fast way against very many simulated queries."""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import random_database
from scipy.stats import spearmanr
from sentences import refused

from semsig_gis.core.errors import InputError
from semsig_gis.evaluation.identify.identify import identify
from semsig_gis.evaluation.identify.trials import try_cells
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.noise.model import NoiseSpec, named_noise

if TYPE_CHECKING:
    from semsig_gis.evaluation.identify.result import Identifiability

REPEATS = 40
SHARP = NoiseSpec(detection=0.9, misnamed=0.05, clutter=0.5, bearing_sigma=4.0)


# From well told apart to hardly.
@settings(max_examples=3, deadline=None)
@given(
    st.integers(0, 1000),
    st.sampled_from([(6, 2), (12, 4), (9, 3)]),
    st.sampled_from([*map(named_noise, ("light", "medium", "generic")), SHARP]),
)
def test_chances_are_those_of_very_many_queries(
    seed: int, kind: tuple[int, int], noise: NoiseSpec
) -> None:
    longest, classes = kind
    database = random_database(seed, cells=80, longest=longest, classes=classes)
    index = build_index(database, noise)
    told = identify(index, radius=20.0, trials=800, class_trials=2)
    tried = try_cells(index, np.tile(np.arange(80), REPEATS), radius=20.0, seed=99)

    for name, most in (("itself", 1.0), ("near", 1.0), ("found", 1.0), ("bits", np.log2(80))):
        ours = getattr(told, name) / most
        truth = getattr(tried, name).reshape(REPEATS, 80).mean(axis=0) / most
        assert abs(ours.mean() - truth.mean()) < 0.05
        # The means of so few queries are off by 0.08 themselves.
        assert np.sqrt(((ours - truth) ** 2).mean()) < 0.15
        # Cells that are all told apart alike have no order.
        assert np.std(truth) < 0.2 or spearmanr(ours, truth).statistic > 0.7


def check(told: Identifiability, cells: int, classes: int) -> None:
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
    check(told, cells, len(database.present_codes))
    if radius == 1e6:
        assert (told.lookalikes == -1).all()


def test_a_noise_that_leaves_nothing() -> None:
    noise = NoiseSpec(detection=0.0, clutter=0.0)
    index = build_index(random_database(3, cells=20, longest=2), noise)
    told = identify(index, trials=10, class_trials=2)
    check(told, 20, len(index.table.codes))
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
    dones = [done for done, _ in steps]
    assert dones == sorted(dones)
    assert steps[-1][0] == steps[-1][1] == steps[0][1]
    assert not one.table().equals(few(seed=5).table())


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"trials": 0}, ("number of trials", "is 0", "from 1")),
        ({"class_trials": -1}, ("trials without a class", "-1", "from 1")),
        ({"threads": 0}, ("threads", "is 0", "from 1")),
        ({"seed": -1}, ("seed", "is -1", "from 0")),
        ({"radius": -5.0}, ("radius of -5.0", "0 or more")),
        ({"radius": math.nan}, ("radius of nan", "0 or more")),
    ],
)
def test_numbers_out_of_range(options: dict[str, int], words: tuple[str, ...]) -> None:
    index = build_index(random_database(3), named_noise("medium"))
    with refused(InputError, *words):
        identify(index, **options)  # type: ignore[arg-type]
