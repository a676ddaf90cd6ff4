from __future__ import annotations

import json

import numpy as np
import pytest
from worlds import random_town

from semsig_gis.likelihood.answer_rule import AnswerRule
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.locate import locate
from semsig_gis.likelihood.noise.model import named_noise

CITY = random_town().database
INDEX = build_index(CITY, named_noise("generic"))
LONGEST = int(CITY.lengths.argmax())


def test_an_answer_is_plain_values_and_points() -> None:
    found = locate(INDEX, CITY.signature(LONGEST), top=4, explained=2)
    plain = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert plain["cells"] == len(CITY)
    assert plain["answered"] == found.answer.given
    assert len(plain["candidates"]) == 4
    likely = found.candidates["cell"].to_numpy()
    assert found.loglik[likely].tolist() == found.candidates["loglik"].to_list()
    assert ["explanation" in one for one in plain["candidates"]] == [True, True, False, False]
    place = plain["place"]
    assert place["within_m"] == 50.0
    assert [place["x"], place["y"]] == [found.estimate.x, found.estimate.y]
    assert place["chance"] == found.answer.mass
    assert place["heading"] is None
    assert np.shape(place["covariance"]) == (2, 2)
    assert place["lon"] == pytest.approx(3.8, abs=1.0)
    assert found.to_geodataframe().crs == CITY.crs


def test_a_rule_that_answers_nothing_is_plain_too() -> None:
    found = locate(INDEX, CITY.signature(LONGEST), rule=AnswerRule(threshold=float("inf")))
    plain = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert plain["threshold"] is None
    assert not plain["answered"]


def test_the_region_has_an_area() -> None:
    found = locate(INDEX, CITY.signature(LONGEST))
    assert found.region_km2 == pytest.approx(len(found.region) * 1e-4)
    assert found.posterior.chances[found.region].sum() >= 0.9 - 1e-9
