"""Errors of the likelihood method for invalid arguments."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import shapely
from noisy_cells import TAXONOMY, noisy_town, random_database
from sentences import refused

from semsig_gis.core import InputError, Signature
from semsig_gis.database import ObjectStore
from semsig_gis.localization import (
    AnswerRule,
    CellScores,
    NoiseSpec,
    Sample,
    area_prior,
    build_index,
    calibrate,
    cell_noise,
    explain_cell,
    learn_noise,
    locate,
    named_noise,
    noise_tables,
    place_noise,
    position_prior,
    posterior,
    refine,
    rerank,
    route_posteriors,
    score_associations,
    weight_prior,
)
from semsig_gis.observation import Leg

if TYPE_CHECKING:
    from collections.abc import Callable

DATABASE = random_database(3, cells=120)
FLAT = np.zeros(120)
INDEX = build_index(DATABASE, cell_noise(named_noise("medium"), 10.0))
EVEN = posterior(DATABASE, FLAT)
OBJECTS = noisy_town(0).street_objects
STORE = ObjectStore.of(OBJECTS)
ONE = Signature(np.array([1], np.uint8), np.zeros(1))
TYPES = Signature(np.array([1], np.uint8), None)
NOISE = NoiseSpec()
STAY = Leg(dx=0.0, dy=0.0)
NOTHING = Signature(np.empty(0, np.uint8), np.empty(0))
LAMPS = Signature(np.array([11], np.uint8), np.zeros(1))
MANY = Signature(np.ones(258, np.uint8), np.zeros(258))
SQUARE = shapely.box(0.0, 0.0, 100.0, 100.0)
UNSEEN = Sample(signature=NOTHING, cell_id=int(DATABASE.cell_ids[0]))
ELSEWHERE = Sample(signature=ONE, xy=(5e6, 5e6))


def refined(query: Signature, cells: np.ndarray, **options: Any) -> None:  # noqa: ANN401
    refine(query, cells, NOISE, store=STORE, **options)


def table(**fields: Any) -> Any:  # noqa: ANN401
    codes = np.array([1, 3, 4], np.uint8)
    return noise_tables(
        NoiseSpec(**fields), taxonomy=TAXONOMY, codes=codes, longest=9, radius=30.0
    )[0][0]


CASES: list[tuple[Callable[[], object], str, str]] = [
    (lambda: INDEX.scores(LAMPS), "class code 11", "leave it out"),
    (lambda: INDEX.scores(ONE, north_sigma=-1.0), "north is -1.0", "from 0.001"),
    (lambda: INDEX.scores(ONE, north_sigma=math.nan), "north is nan", "infinity"),
    (lambda: rerank(INDEX, ONE, CellScores(loglik=FLAT), count=0), "re-rank is 0", "from 1"),
    (lambda: score_associations(DATABASE, TYPES, NOISE, np.arange(2)), "no bearings", "give them"),
    (lambda: explain_cell(TYPES, 0, NOISE, database=DATABASE), "no bearings", "give them"),
    (lambda: locate(INDEX, ONE, refined=True), "between the viewpoints", "object store"),
    (lambda: locate(INDEX, TYPES, refined=True, store=STORE), "no bearings", "give them"),
    (lambda: locate(INDEX, TYPES, explained=1), "no bearings", "give them"),
    (lambda: locate(INDEX, ONE, top=0), "0 candidates", "a whole number from 1"),
    (lambda: refined(TYPES, OBJECTS.xy[:3]), "no bearings", "give them"),
    (lambda: refined(ONE, OBJECTS.xy[:0]), "0 cells", "at least one"),
    (lambda: refined(ONE, OBJECTS.xy[:1], north_sigma=math.inf), "no headings", "give"),
    (lambda: refined(ONE, OBJECTS.xy[:1], north_sigma=-1.0), "north is -1.0", "from 0.001"),
    (lambda: place_noise(named_noise("light"), 10.0), "'light'", "cell_noise"),
    (lambda: table(detection_by_class={"bensh": 0.5}), "'bensh' that the database", "'bench'"),
    (lambda: table(clutter_shares={"bensh": 1.0}), "'bensh'", "the nearest is 'bench'"),
    (lambda: table(confusion={"indicator": {"bench": 1.0}}), "'indicator'", "that is seen"),
    (lambda: table(confusion={"indicator": {"bensh": 1.0}}), "'bensh'", "its classes are"),
    (lambda: table().query_rows(Signature(np.array([9], np.uint8), None)), "code 9", "code 0"),
    (lambda: table().query_rows(NOTHING), "no objects", "at least one"),
    (lambda: posterior(DATABASE, FLAT[:3]), "3 likelihoods or priors", "120 cells"),
    (lambda: posterior(DATABASE, FLAT, log_prior=FLAT[:2]), "2 likelihoods", "one for each cell"),
    (lambda: posterior(DATABASE, FLAT - math.inf), "excludes every cell", "widen"),
    (lambda: posterior(DATABASE, FLAT + math.nan), "is infinite", "give logarithms"),
    (lambda: posterior(DATABASE, FLAT + math.inf), "is infinite", "give logarithms"),
    (lambda: EVEN.credible_cells(0.0), "share of 0.0", "at most 1"),
    (lambda: EVEN.credible_cells(1.1), "share of 1.1", "at most 1"),
    (lambda: EVEN.credible_cells(math.nan), "share of nan", "at most 1"),
    (lambda: EVEN.mass_within(-1.0), "-1.0 m", "0 or more"),
    (lambda: EVEN.mass_within(math.nan), "nan m", "0 or more"),
    (lambda: EVEN.mass_within(math.inf), "inf m", "0 or more"),
    (lambda: area_prior(DATABASE, shapely.box(-9, -9, -8, -8)), "no cell lies in", "x -9 to -8"),
    (lambda: area_prior(DATABASE, shapely.Point(3, 3)), "Point", "give a polygon"),
    (lambda: area_prior(DATABASE, SQUARE, outside=1.0), "is 1.0", "0 to below 1"),
    (lambda: position_prior(DATABASE, (0.0, 0.0), sigma=0.0), "is 0.0", "from 0.01"),
    (lambda: position_prior(DATABASE, (0.0, 0.0), sigma=math.nan), "is nan", "from 0.01"),
    (lambda: position_prior(DATABASE, (0.0, 0.0), sigma=math.inf), "is inf", "from 0.01"),
    (lambda: position_prior(DATABASE, (math.nan, 0.0), sigma=1.0), "nan", "x and y in metres"),
    (lambda: position_prior(DATABASE, (1e7, 0.0), sigma=9.0), "outside the city", "latitude"),
    (lambda: weight_prior(DATABASE, [1, 2, 3]), "3 weights", "120 cells"),
    (lambda: weight_prior(DATABASE, FLAT - 1.0), "negative", "0 or more"),
    (lambda: weight_prior(DATABASE, FLAT + math.nan), "a weight", "0 or more"),
    (lambda: weight_prior(DATABASE, FLAT), "excludes every cell", "widen"),
    (lambda: Sample(signature=TYPES, cell_id=3), "types and the bearings", "give both"),
    (lambda: route_posteriors(DATABASE, [], []), "0 views", "one leg between"),
    (lambda: route_posteriors(DATABASE, [FLAT], [STAY]), "1 views", "one leg between"),
    (lambda: Leg(dx=math.nan, dy=0.0), "nan", "1,000,000 metres"),
    (lambda: Leg(dx=0.0, dy=0.0, sigma=-1.0), "-1.0", "metres"),
    (lambda: AnswerRule(threshold=math.nan), "the answer rule has threshold = nan", "0 or more"),
    (lambda: AnswerRule(threshold=0.5, precision=1.0), "precision = 1.0", "below 1"),
    (lambda: AnswerRule(threshold=0.5, confidence=0.0), "confidence = 0.0", "above 0"),
    (lambda: AnswerRule(threshold=0.5, radius=math.inf), "radius = inf", "above 0"),
    (lambda: AnswerRule(threshold=0.5, queries=1.0), "queries = 1.0", "a whole number of queries"),  # type: ignore[arg-type]
    (lambda: AnswerRule(threshold=0.5, wrong=1), "1 wrong", "counts that fit"),
    (lambda: calibrate([0.5], []), "1 chances and 0 outcomes", "one outcome"),
    (lambda: calibrate([math.nan], [True]), "1 chances", "one finite chance"),
    (lambda: calibrate([[0.5]], [[True]]), "1 chances", "one outcome"),
    (lambda: calibrate([0.5], [True], precision=2.0), "precision = 2.0", "below 1"),
    (lambda: learn_noise([], DATABASE), "no samples", "true places"),
    (lambda: learn_noise([ELSEWHERE], DATABASE), "none of the 1", "EPSG:2154"),
    (lambda: learn_noise([ELSEWHERE], OBJECTS), "none of the 1", "EPSG:2154"),
    (lambda: learn_noise([UNSEEN] * 2, DATABASE), "2 samples", "0 detections"),
    (lambda: learn_noise([UNSEEN], OBJECTS), "only its cell", "x and y"),
    (lambda: learn_noise([UNSEEN], DATABASE, position_sigma=math.nan), "nan m", "0 or more"),
]


@pytest.mark.parametrize(("call", "fault", "remedy"), CASES)
def test_invalid_arguments_are_refused(call: Callable[[], object], fault: str, remedy: str) -> None:
    with refused(InputError, fault, remedy):
        call()
