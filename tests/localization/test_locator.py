"""Locate queries by both kinds of methods, and by the default method."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any

import pytest
from sentences import refused
from worlds import random_town, save_town

import semsig_gis
from semsig_gis.core import DEFAULT_METHOD, PAPER_METHOD, InputError
from semsig_gis.database import open_city
from semsig_gis.evaluation import evaluate
from semsig_gis.localization import (
    LikelihoodMethod,
    Method,
    Requirement,
    build_index,
    cell_noise,
    localize,
    locate,
    named_noise,
    parse_method,
)

if TYPE_CHECKING:
    from pathlib import Path

TOWN = random_town()
CITY = TOWN.database
LONGEST = int(CITY.lengths.argmax())
QUERY = CITY.signature(LONGEST)
INDEX = build_index(CITY, cell_noise(named_noise("generic"), CITY.grid.step))


def test_default_method_is_likelihood() -> None:
    assert isinstance(parse_method(DEFAULT_METHOD), LikelihoodMethod)
    assert isinstance(parse_method(PAPER_METHOD), Method)
    for function in (semsig_gis.localize, semsig_gis.evaluate):
        assert inspect.signature(function).parameters["method"].default is DEFAULT_METHOD


def test_database_is_searched_by_likelihood() -> None:
    assert localize(CITY, QUERY).to_dict() == locate(INDEX, QUERY).to_dict()
    limited = localize(CITY, QUERY, requirement=Requirement.parse("?<=3", CITY.taxonomy))
    assert limited.candidates["length"].max() <= 3
    with refused(InputError, "store"):
        localize(CITY, QUERY, method="likelihood:generic:refined")


def test_place_is_refined_between_cells_of_city(tmp_path: Path) -> None:
    city = open_city(save_town(tmp_path, TOWN))
    refined = locate(INDEX, QUERY, store=city.store, refined=True)
    assert localize(city, QUERY).to_dict() == refined.to_dict()
    on_grid = localize(city, QUERY, method=LikelihoodMethod.parse("likelihood:generic:on_grid"))
    assert on_grid.answer.cell == LONGEST
    assert localize(city, QUERY, method=PAPER_METHOD).to_dict() == (
        localize(CITY, QUERY, method=Method.parse(PAPER_METHOD)).to_dict()
    )


@pytest.mark.parametrize("method", [DEFAULT_METHOD, PAPER_METHOD])
def test_evaluation_accepts_text_of_method(method: str) -> None:
    settings: dict[str, Any] = {"queries": 12, "seed": 3}
    evaluation = evaluate(CITY, method=method, **settings)
    grid = build_index(CITY, named_noise("generic"))
    used = grid if method == DEFAULT_METHOD else Method.parse(method)
    same = evaluate(CITY, method=used, **settings)
    assert evaluation.queries.equals(same.queries)
    assert str(evaluation.method) == str(same.method)
    with refused(InputError, "refined"):
        evaluate(CITY, method="likelihood:generic:refined", **settings)
