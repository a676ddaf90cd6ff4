"""A city of the paper's eleven classes: the same database and answers as before further classes."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from semsig_gis.database import build
from semsig_gis.evaluation import QuerySpec, draw_queries
from semsig_gis.localization import localize
from semsig_gis.objects import load

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from semsig_gis.database import City

# Of the last commit with classes that were only points, without names.
ARRAYS = {
    "cell_ids": "4cb9a1d490ec969d",
    "offsets": "cd891aebda376863",
    "codes": "5e372d892e7462f7",
    "bearing_units": "a9b2bfe3b880342f",
    "distance_units": "7295c182ed87b580",
}
# Of three distorted views: the best cell, the chance of its place, and its logarithm.
ANSWERS = (
    (282, 0.9999999913031753, -88.10043829393773),
    (85, 0.13780853021886724, -62.19977665001247),
    (2045, 0.893091541066482, -62.934105467481764),
)


def digest(values: NDArray[Any]) -> str:
    return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()[:16]


@pytest.fixture(scope="module")
def helsinki(geodata: Path) -> City:
    loaded = load(geodata / "osm/helsinki_2019.osm.pbf", selection="paper")
    return build(loaded, viewpoints="streets")


def test_the_database_of_the_papers_classes_has_not_changed(helsinki: City) -> None:
    assert {name: digest(getattr(helsinki.database, name)) for name in ARRAYS} == ARRAYS


def test_answers_with_the_papers_classes_have_not_changed(helsinki: City) -> None:
    spec = QuerySpec(number=len(ANSWERS), seen_from="anywhere")
    queries = draw_queries(helsinki.database, spec, store=helsinki.store)
    for query, (cell, chance, loglik) in zip(queries, ANSWERS, strict=True):
        answer = localize(helsinki, query.asked.signature)
        assert answer.columns["cell"][0] == cell
        # The likelihood of most other cells is estimated from a sample.
        assert answer.chance == pytest.approx(chance, abs=0.01)
        # Processors differ in the last digits of logarithms.
        assert answer.loglik.max() == pytest.approx(loglik, rel=1e-9)
