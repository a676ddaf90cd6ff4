from __future__ import annotations

import json

import numpy as np
import pytest
from sentences import assert_sentence
from worlds import random_town

from semsig_gis.abstention import AnswerRule
from semsig_gis.errors import InputError
from semsig_gis.likelihood import build_index
from semsig_gis.locating import locate
from semsig_gis.noise import named_noise
from semsig_gis.priors import position_prior
from semsig_gis.signatures import Signature

CITY = random_town().database
INDEX = build_index(CITY, named_noise("generic"))
LONG = np.argsort(-CITY.lengths, kind="stable")[:20].tolist()


def test_what_a_long_signature_was_seen_from_is_found() -> None:
    right = 0
    for cell in LONG:
        found = locate(INDEX, CITY.signature(cell), top=5)
        right += int(np.hypot(*(CITY.xy[cell] - [found.answer.x, found.answer.y])) <= 50)
        chances = found.candidates["chance"].to_numpy()
        assert (np.diff(chances) <= 0).all()
        assert 0 < chances.sum() <= 1 + 1e-9
        assert found.candidates["rank"].tolist() == [1, 2, 3, 4, 5]
        region = found.posterior.chances[found.region].sum()
        assert region >= 0.9 - 1e-9
        assert found.region_km2 == pytest.approx(len(found.region) * 1e-4)
    assert right >= len(LONG) - 1


def test_a_turned_query_is_found_with_its_heading() -> None:
    cell = LONG[3]
    query = CITY.signature(cell)
    assert query.bearings is not None
    turned = Signature(query.codes, (query.bearings - 70.0) % 360.0)
    found = locate(INDEX, turned, north_sigma=float("inf"), top=1)
    assert found.candidates["cell"].tolist() == [cell]
    assert found.candidates["heading"][0] == pytest.approx(70.0, abs=5.0)


def test_a_prior_and_a_rule_decide() -> None:
    cell = LONG[0]
    query = Signature(CITY.signature(cell).codes[:1], None)  # type: ignore[index]
    anywhere = locate(INDEX, query)
    assert not anywhere.answer.given
    near = position_prior(CITY, tuple(CITY.xy[cell].tolist()), sigma=10.0)
    there = locate(INDEX, query, log_prior=near, rule=AnswerRule(threshold=0.5))
    assert there.answer.given
    assert there.posterior.entropy < anywhere.posterior.entropy
    assert not locate(INDEX, query, log_prior=near, rule=AnswerRule(threshold=1.5)).answer.given


def test_an_answer_is_plain_values_and_points() -> None:
    found = locate(INDEX, CITY.signature(LONG[0]), top=4)
    plain = json.loads(json.dumps(found.to_dict()))
    assert plain["cells"] == len(CITY)
    assert plain["answered"] == found.answer.given
    assert len(plain["candidates"]) == 4
    assert plain["place"]["within_m"] == 50.0
    assert found.to_geodataframe().crs == CITY.crs


def test_no_candidates_are_refused() -> None:
    with pytest.raises(InputError) as caught:
        locate(INDEX, CITY.signature(0), top=0)
    assert_sentence(caught.value, "0 candidates", "from 1")
