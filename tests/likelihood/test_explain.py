from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from worlds import CODES, World

from semsig_gis.core.rtree import ObjectIndex
from semsig_gis.core.signature import Signature
from semsig_gis.likelihood.explain import explain, explain_cell
from semsig_gis.likelihood.noise.model import NoiseSpec, named_noise

if TYPE_CHECKING:
    from semsig_gis.likelihood.explain import Explanation

NOISE = NoiseSpec(detection=0.8, misnamed=0.05, clutter=1.0, bearing_sigma=4.0)
TREE, LAMP = CODES[0], CODES[1]
# North, east and south of the place, and one out of sight.
WORLD = World(((0.0, 10.0, TREE), (20.0, 0.0, LAMP), (0.0, -15.0, TREE), (0.0, 99.0, TREE)))


def explained(query: Signature, world: World = WORLD, **options: Any) -> Explanation:  # noqa: ANN401
    xy, noise = options.pop("xy", (0.0, 0.0)), options.pop("noise", NOISE)
    objects = world.street_objects
    index = ObjectIndex(objects.xy)
    return explain(query, xy, noise, objects=objects, index=index, **options)


def test_every_verdict() -> None:
    query = Signature(np.array([TREE, TREE, LAMP]), np.array([357.0, 92.0, 300.0]))
    found = explained(query)
    rows = found.to_dict()["rows"]
    assert [(row["verdict"], row["object"], row["source_id"], row["query"]) for row in rows] == [
        ("matched", 0, "0", 0),
        ("misnamed", 1, "1", 1),
        ("false", None, None, 2),
        ("missed", 2, "2", None),
    ]
    assert rows[0]["bearing_error"] == pytest.approx(-3.0)
    assert rows[0]["distance"] == pytest.approx(10.0)
    assert rows[1]["object_bearing"] == pytest.approx(90.0)
    assert rows[1]["object_class"] != rows[1]["query_class"]
    assert all(0.5 < row["chance"] <= 1.0 for row in rows)
    assert found.counts == {"matched": 1, "misnamed": 1, "missed": 1, "false": 1}
    assert json.loads(json.dumps(found.to_dict()))["x"] == 0.0
    shapes = found.table.geometry
    assert shapes.isna().tolist() == [False, False, True, False]
    assert found.table.crs == WORLD.street_objects.crs


def test_chances_are_those_of_one_pair() -> None:
    world = World(((0.0, 10.0, TREE), (0.0, -500.0, LAMP)))
    found = explained(Signature(np.array([TREE]), np.array([8.0])), world)
    density = np.exp(-0.5 * 4.0) / (4.0 * np.sqrt(2 * np.pi))
    weight = 0.8 / 0.2 * 0.95 * density / (0.5 / 360)
    assert found.table["chance"].iloc[0] == pytest.approx(weight / (1 + weight), rel=1e-6)
    expected = np.log(0.2 * (0.5 / 360) * (1 + weight)) - 1.0
    assert found.loglik == pytest.approx(expected, rel=1e-6)


def test_no_object_is_matched_twice() -> None:
    lamps = World(((0.0, 10.0, LAMP), (1.0, 10.0, LAMP)))
    query = Signature(np.array([LAMP, LAMP]), np.array([2.0, 3.0]))
    found = explained(query, lamps, noise=named_noise("light"))
    assert sorted(found.table["object"].tolist()) == [0, 1]
    assert found.counts["matched"] == 2


def test_a_query_of_unknown_classes_that_is_turned() -> None:
    found = explained(Signature(None, np.array([350.0, 80.0])), heading=10.0)
    assert found.table["verdict"].tolist() == ["matched", "matched", "missed"]
    assert found.table["query_class"].tolist()[:2] == ["unknown", "unknown"]
    assert found.table["query_bearing"].tolist()[:2] == [0.0, 90.0]
    assert found.heading == 10.0


def test_where_nothing_is_seen_all_is_false() -> None:
    found = explained(Signature(np.array([TREE]), np.array([0.0])), xy=(500.0, 500.0))
    assert found.counts == {"matched": 0, "misnamed": 0, "missed": 0, "false": 1}
    assert found.table["chance"].tolist() == [1.0]


def test_a_cell_is_explained_without_the_street_objects() -> None:
    database = WORLD.database
    cell = int(np.flatnonzero((database.xy == [5.0, 5.0]).all(axis=1))[0])
    query = database.signature(cell)
    found = explain_cell(query, cell, NOISE, database=database)
    exact = explained(query, xy=(5.0, 5.0))
    assert found.counts == exact.counts
    assert found.loglik == pytest.approx(exact.loglik, abs=0.1)
    assert found.table["object"].isna().all()
    apart = found.table.geometry.distance(exact.table.geometry)
    assert apart.max() < 0.2
    assert found.table.crs == WORLD.street_objects.crs
