from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
import pytest
import shapely
from noisy_cells import noisy_town
from worlds import CODES, CORNER, World

from semsig_gis.core.rtree import ObjectIndex
from semsig_gis.core.signature import Signature
from semsig_gis.database.occlusion import Footprints
from semsig_gis.database.visibility import views_at
from semsig_gis.likelihood.noise.model import NoiseSpec
from semsig_gis.likelihood.refine import Refinement, refine

SHARP = NoiseSpec(detection=0.95, misnamed=0.02, clutter=0.5, bearing_sigma=3.0)


def seen(world: World, xy: np.ndarray, seed: int, *, turn: float = 0.0) -> Signature:
    """Return what a good detector gives at a place."""
    objects = world.street_objects
    view = views_at(objects, xy[None], index=ObjectIndex(objects.xy), radius=30.0)
    rng = np.random.default_rng(seed)
    noise = rng.normal(0.0, SHARP.bearing_sigma, len(view.codes))
    kept = rng.random(len(view.codes)) < SHARP.detection
    return Signature(view.codes[kept], ((view.bearings + noise - turn) % 360.0)[kept])


def refined(query: Signature, world: World, **options: Any) -> Refinement:  # noqa: ANN401
    objects = world.street_objects
    cells = options.pop("cells", world.database.xy)
    return refine(query, cells, SHARP, objects=objects, index=ObjectIndex(objects.xy), **options)


def test_places_between_the_viewpoints_are_found() -> None:
    errors, inside, masses = [], [], []
    for seed in range(12):
        world = noisy_town(seed)
        xy = CORNER + np.random.default_rng([seed, 1]).uniform(50, 150, 2)
        found = refined(seen(world, xy, seed), world)
        away = np.array(found.xy) - xy
        errors.append(float(np.hypot(*away)))
        inside.append(away @ np.linalg.inv(found.covariance[:2, :2]) @ away < 9.21)
        masses.append(found.mass)
        assert found.chances.sum() == pytest.approx(1.0)
        assert found.covariance[2, 2] == 0.0
    assert np.median(errors) < 1.5
    assert max(errors) < 5.0
    assert np.mean(inside) > 0.8  # 0.99 but for chance and clipped numbers
    assert min(masses) > 0.9


@pytest.mark.parametrize("north_sigma", [10.0, math.inf])
def test_the_heading_is_found_too(north_sigma: float) -> None:
    world = noisy_town(3)
    xy = CORNER + np.array([103.0, 98.0])
    query = seen(world, xy, 3, turn=12.0)
    headings = np.full(len(world.database), 10.0)
    found = refined(query, world, north_sigma=north_sigma, headings=headings)
    away = np.array([*(np.array(found.xy) - xy), found.heading - 12.0])
    assert away @ np.linalg.inv(found.covariance) @ away < 16.3  # 99.9 %
    assert found.heading == pytest.approx(12.0, abs=6.0)
    assert math.sqrt(np.trace(found.covariance[:2, :2])) < 5.0
    assert 0.0 < found.covariance[2, 2] < 30.0


def test_what_else_is_known_and_buildings_count() -> None:
    world = World(((0.0, 10.0, CODES[0]), (1000.0, 10.0, CODES[0])))
    query = Signature(np.array([CODES[0]]), np.array([1.0]))
    find = partial(refined, query, world, cells=np.array([[0.0, 0.0], [1000.0, 0.0]]))
    assert find().mass == pytest.approx(0.5, abs=1e-4)
    likely = find(log_prior=np.log([0.1, 0.9]))
    assert likely.mass == pytest.approx(0.9, abs=1e-4)
    assert likely.xy[0] == pytest.approx(1000.0, abs=5.0)
    hidden = find(footprints=Footprints([shapely.box(-20.0, 6.0, 20.0, 8.0)]))
    assert hidden.xy[0] == pytest.approx(1000.0, abs=5.0)
    assert hidden.mass > 0.9


def test_parts_fill_the_cells() -> None:
    world = noisy_town(5)
    cells = world.database.xy[:7]
    found = refined(seen(world, CORNER + 100.0, 5), world, cells=cells)
    assert (found.sizes**2).sum() == pytest.approx(7 * 100.0)
    assert np.abs(found.places[:, None] - cells).max(axis=2).min(axis=1).max() < 5.0


def test_headings_are_averaged_over_north() -> None:
    found = Refinement(
        places=np.zeros((2, 2)),
        sizes=np.ones(2),
        loglik=np.zeros(2),
        headings=np.array([-179.0, 179.0]),
        heading_sigmas=np.full(2, 2.0),
        chances=np.array([0.5, 0.5]),
        near=25.0,
    )
    assert abs(found.heading) == pytest.approx(180.0)
    assert found.covariance[2, 2] == pytest.approx(5.0)
