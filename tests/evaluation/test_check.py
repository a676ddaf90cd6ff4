"""Whether chances come true: against plain loops, and against chances that are known."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from noisy_cells import random_database
from scipy.stats import spearmanr
from sentences import refused
from small_city import chances_of

from semsig_gis.core.errors import InputError
from semsig_gis.core.statistics import wilson_interval
from semsig_gis.evaluation.identify.check import check_identifiability
from semsig_gis.evaluation.identify.trials import trial_cells, try_cells
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.noise.model import named_noise

if TYPE_CHECKING:
    from semsig_gis.evaluation.identify.result import Identifiability
    from semsig_gis.likelihood.index import LikelihoodIndex

DATABASE = random_database(5, cells=90, longest=8)
INDEX = build_index(DATABASE, named_noise("medium"))
TOLD = chances_of(DATABASE)


def test_figures_are_those_of_plain_loops() -> None:
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
    for one in check.bins:
        inside = [
            row
            for row, cell in enumerate(cells.tolist())
            if one.low <= TOLD.found[cell] < one.high or TOLD.found[cell] == one.high == 1.0
        ]
        assert one.queries == len(inside)
        assert one.stated == pytest.approx(TOLD.found[cells[inside]].mean())
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


def alone() -> tuple[Identifiability, LikelihoodIndex]:
    """Return a city of one cell, in which there is nothing to be mistaken for."""
    database = random_database(5, cells=1)
    told = dataclasses.replace(chances_of(database), found=np.ones(1))
    return told, build_index(database, told.noise)


def test_where_all_succeed_there_is_no_correlation() -> None:
    check = check_identifiability(*alone(), queries=20)
    assert check.found == 1.0
    assert all(math.isnan(value) for value in check.correlations.values())
    assert math.isnan(check.attainable)
    plain = check.to_dict()
    assert json.loads(json.dumps(plain)) == plain
    assert plain["attainable"] is plain["correlations"]["found"] is None


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"queries": 0}, ("0 queries", "from 1")),
        ({"seed": TOLD.seed}, (f"other than {TOLD.seed}", "found out")),
        ({"seed": -1}, ("seed -1", "from 0")),
    ],
)
def test_numbers_out_of_range(options: dict[str, int], words: tuple[str, ...]) -> None:
    with refused(InputError, *words):
        check_identifiability(TOLD, INDEX, **options)  # type: ignore[arg-type]


def test_another_index_is_refused() -> None:
    others = (
        build_index(DATABASE, named_noise("light")),
        build_index(random_database(6, cells=90), TOLD.noise),
    )
    for index in others:
        with refused(InputError, "another database or noise model", "pass the matching one"):
            check_identifiability(TOLD, index)
