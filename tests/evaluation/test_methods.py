from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from worlds import random_town

from semsig_gis.database.city import ObjectStore
from semsig_gis.evaluation.methods import make_locator, parse_method
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.locate import locate
from semsig_gis.likelihood.method import LikelihoodMethod
from semsig_gis.likelihood.noise.model import cell_noise, named_noise
from semsig_gis.matching.method import Method
from semsig_gis.queries.draw import QuerySpec, draw_queries

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from semsig_gis.core.signature import Signature
    from semsig_gis.database.answer import Ranking
    from semsig_gis.evaluation.methods import AnyMethod
    from semsig_gis.likelihood.index import LikelihoodIndex
    from semsig_gis.likelihood.noise.model import Noise

TOWN = random_town()
DATABASE = TOWN.database
STORE = ObjectStore.of(TOWN.street_objects)
LIGHT = named_noise("light")
INDEX = build_index(DATABASE, cell_noise(LIGHT, DATABASE.grid.step))
QUERIES = [
    query.asked.signature
    for query in draw_queries(
        DATABASE, QuerySpec(number=6, seen_from="anywhere", distortions=()), store=STORE
    )
    if len(query.asked)
]


def rankings(method: AnyMethod, queries: Sequence[Signature]) -> Iterator[Ranking]:
    def index(noise: Noise) -> LikelihoodIndex:
        assert noise == INDEX.noise
        return INDEX

    return make_locator(DATABASE, method, index=index, store=lambda: STORE).rankings(queries)


@pytest.mark.parametrize("text", ["likelihood:light", "likelihood:light:refined:heading=20"])
def test_the_likelihood_method_answers_as_it_locates(text: str) -> None:
    method = parse_method(text)
    assert isinstance(method, LikelihoodMethod)
    for query, answer in zip(QUERIES, rankings(method, QUERIES), strict=True):
        found = locate(
            INDEX, query, north_sigma=method.north_sigma, store=STORE, refined=method.refined
        )
        assert answer.scores.argmin() == found.answer.cell
        others = np.arange(len(DATABASE)) != found.answer.cell
        assert answer.scores[others] == pytest.approx(-found.loglik[others], rel=1e-6)
        assert answer.chance == found.answer.mass
        np.testing.assert_array_equal(answer.chances, found.chances)
        np.testing.assert_array_equal(answer.region, found.region)
        assert answer.best_score == pytest.approx(-found.loglik[found.answer.cell])
        if method.refined:
            assert answer.place == (found.estimate.x, found.estimate.y)
            assert answer.heading == found.estimate.heading
        else:
            assert (answer.place, answer.heading) == (None, None)


def test_nothing_is_asked() -> None:
    assert list(rankings(Method(), [])) == list(rankings(LikelihoodMethod(noise=LIGHT), [])) == []
