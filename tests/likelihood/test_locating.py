from __future__ import annotations

import math
from typing import Any

import geopandas as gpd
import numpy as np
import pytest
import shapely
from sentences import assert_sentence
from worlds import CORNER, random_town

from semsig_gis.core.errors import InputError
from semsig_gis.core.signature import Signature
from semsig_gis.database.store import ObjectStore
from semsig_gis.database.visibility import views_at
from semsig_gis.likelihood.answer_rule import AnswerRule
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.locate import locate, locate_route
from semsig_gis.likelihood.noise.model import cell_noise, named_noise
from semsig_gis.likelihood.priors import position_prior
from semsig_gis.likelihood.route import Leg

WORLD = random_town()
CITY = WORLD.database
STORE = ObjectStore.of(WORLD.street_objects)
INDEX = build_index(CITY, named_noise("generic"))
WIDE = build_index(CITY, cell_noise(named_noise("generic"), 10.0))
LONG = np.argsort(-CITY.lengths, kind="stable")[:20].tolist()


def seen_from(xy: np.ndarray, *, turn: float = 0.0) -> Signature:
    """Return what there is to see from a place, without a mistake."""
    view = views_at(STORE.objects, xy[None], index=STORE.index, radius=30.0)
    return Signature(view.codes, (view.bearings - turn) % 360.0)


def test_what_a_long_signature_was_seen_from_is_found() -> None:
    right = 0
    for cell in LONG:
        found = locate(INDEX, CITY.signature(cell), top=5)
        right += int(np.hypot(*(CITY.xy[cell] - [found.answer.x, found.answer.y])) <= 50)
        chances = found.candidates["chance"].to_numpy()
        assert (np.diff(chances) <= 0).all()
        assert 0 < chances.sum() <= 1 + 1e-9
        assert found.candidates["rank"].tolist() == [1, 2, 3, 4, 5]
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


def test_the_place_between_the_viewpoints_is_found() -> None:
    rng = np.random.default_rng(1)
    plain: list[float] = []
    close: list[float] = []
    for _ in range(12):
        xy = CORNER + rng.uniform(40, 160, 2)
        for refined, errors in ((False, plain), (True, close)):
            found = locate(WIDE, seen_from(xy), store=STORE, refined=refined, explained=1)
            errors.append(float(np.hypot(*(xy - [found.estimate.x, found.estimate.y]))))
            assert found.estimate.refined == refined
            assert found.posterior.chances.sum() == pytest.approx(1.0)
            assert (np.diff(found.candidates["chance"]) <= 0).all()
    assert np.median(close) < 1.0 < np.median(plain) < 8.0


def test_explanations_name_the_street_objects() -> None:
    xy = CORNER + np.array([103.0, 97.0])
    query = seen_from(xy)
    for refined in (False, True):
        found = locate(WIDE, query, store=STORE, refined=refined, explained=3)
        assert len(found.explanations) == 3
        best, first = found.explanations[0], found.candidates.iloc[0]
        assert math.dist(best.xy, first[["x", "y"]]) <= 5.0 * math.sqrt(2.0)
        assert best.counts["matched"] == len(query)
        rows = best.table[best.table["verdict"] == "matched"]
        ids = rows["source_id"].astype(int).to_numpy()
        assert (STORE.objects.codes[ids] == query.codes).all()
    alone = locate(WIDE, query, explained=1).explanations[0]
    assert alone.table["source_id"].isna().all()
    assert alone.counts["matched"] > len(query) // 2


def test_a_turned_place_is_refined_with_its_heading() -> None:
    xy = CORNER + np.array([103.0, 97.0])
    query = seen_from(xy, turn=70.0)
    found = locate(WIDE, query, north_sigma=math.inf, store=STORE, refined=True, explained=1)
    place = found.estimate
    assert math.dist((place.x, place.y), xy) < 2.0
    assert place.heading == pytest.approx(70.0, abs=3.0 * place.heading_sigma)
    assert found.candidates["heading"][0] == pytest.approx(70.0, abs=10.0)
    assert found.explanations[0].heading == pytest.approx(70.0, abs=10.0)


def test_buildings_hide_what_is_behind_them() -> None:
    xy = CORNER + np.array([103.0, 97.0])
    east, north = xy.tolist()
    wall = shapely.box(east + 4.0, north - 40.0, east + 8.0, north + 40.0)
    houses = gpd.GeoDataFrame(geometry=[wall], crs="EPSG:2154")
    stores = STORE, ObjectStore.of(WORLD.street_objects, footprints=houses)
    free, walled = (
        locate(WIDE, seen_from(xy), store=store, refined=True, explained=1).explanations[0]
        for store in stores
    )
    assert math.dist(free.xy, xy) < 1.0
    assert math.dist(walled.xy, xy) > 3.0  # half of what was seen would be hidden here
    assert walled.loglik < free.loglik - 3.0


def test_a_route_settles_what_one_view_leaves_open() -> None:
    start, way = LONG[0], np.array([20.0, 0.0])
    (after,) = np.flatnonzero((CITY.xy == CITY.xy[start] + way).all(axis=1)).tolist()
    poor = Signature(CITY.signature(start).codes[:2], CITY.signature(start).bearings[:2])  # type: ignore[index]
    legs = [Leg(dx=20.0, dy=0.0, sigma=1.0)] * 2
    nothing = Signature(np.empty(0, np.uint8), np.empty(0))
    views = [poor, CITY.signature(after), nothing]
    for refined in (False, True):
        options = {"store": STORE, "refined": refined, "explained": 1}
        alone = locate(WIDE, poor, **options)  # type: ignore[arg-type]
        first, _, last = locate_route(WIDE, views, legs, **options)  # type: ignore[arg-type]
        assert first.posterior.chances[start] > alone.posterior.chances[start]
        assert math.dist((first.estimate.x, first.estimate.y), CITY.xy[start]) < 12.0
        assert math.dist((last.estimate.x, last.estimate.y), CITY.xy[start] + 2 * way) < 15.0
        assert [len(one.explanations) for one in (first, last)] == [1, 0]
        assert not last.estimate.refined
    with pytest.raises(InputError) as caught:
        locate_route(WIDE, views, legs[:1])
    assert_sentence(caught.value, "3 views", "1 legs")


def test_one_cell_is_the_answer() -> None:
    database = CITY.select(slice(0, 1))
    index = build_index(database, cell_noise(named_noise("generic"), 10.0))
    for refined in (False, True):
        found = locate(index, database.signature(0), store=STORE, refined=refined, explained=3)
        assert found.answer.given
        assert found.posterior.chances.tolist() == [1.0]
        assert math.dist((found.estimate.x, found.estimate.y), database.xy[0]) < 8.0
        assert found.region.tolist() == [0]


@pytest.mark.parametrize("north_sigma", [0.0, math.inf])
def test_a_query_longer_than_any_signature(north_sigma: float) -> None:
    rng = np.random.default_rng(0)
    query = Signature(rng.choice(CITY.present_codes, 200), np.sort(rng.uniform(0, 360, 200)))
    found = locate(WIDE, query, north_sigma=north_sigma, store=STORE, refined=True, explained=1)
    assert np.isfinite(found.candidates["loglik"]).all()
    assert found.explanations[0].counts["false"] > 150


def test_what_cannot_be_asked_is_refused() -> None:
    query = CITY.signature(LONG[0])
    blind = Signature(query.codes, None)
    nothing = Signature(np.empty(0, np.uint8), np.empty(0))
    options: list[tuple[Any, Signature, dict[str, Any], str]] = [
        (WIDE, nothing, {}, "no objects"),
        (WIDE, query, {"refined": True}, "store"),
        (WIDE, blind, {"refined": True, "store": STORE}, "bearings"),
        (WIDE, blind, {"explained": 1}, "bearings"),
        (INDEX, query, {"refined": True, "store": STORE}, "middles of cells"),
        (WIDE, query, {"north_sigma": math.nan}, "nan"),
    ]
    for index, asked, more, word in options:
        with pytest.raises(InputError) as caught:
            locate(index, asked, **more)
        assert_sentence(caught.value, word)


def test_no_candidates_are_refused() -> None:
    with pytest.raises(InputError) as caught:
        locate(INDEX, CITY.signature(0), top=0)
    assert_sentence(caught.value, "0 candidates", "from 1")
