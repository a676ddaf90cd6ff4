from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from noisy_cells import noisy_town
from worlds import CODES, CORNER, World

from semsig_gis.core.rtree import ObjectIndex
from semsig_gis.core.signature import Signature
from semsig_gis.database.occlusion import Footprints
from semsig_gis.database.visibility import views_at
from semsig_gis.likelihood.noise.model import (
    NoiseMixture,
    NoiseSpec,
    cell_noise,
    named_noise,
    place_noise,
)
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


def test_places_between_the_viewpoints_are_found() -> None:
    errors, inside, masses = [], [], []
    for seed in range(12):
        world = noisy_town(seed)
        xy = CORNER + np.random.default_rng([seed, 1]).uniform(50, 150, 2)
        objects = world.street_objects
        found = refine(
            seen(world, xy, seed),
            world.database.xy,
            SHARP,
            objects=objects,
            index=ObjectIndex(objects.xy),
        )
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
    objects = world.street_objects
    cells = world.database.xy
    found = refine(
        seen(world, xy, 3, turn=12.0),
        cells,
        SHARP,
        objects=objects,
        index=ObjectIndex(objects.xy),
        north_sigma=north_sigma,
        headings=np.full(len(cells), 10.0),
    )
    away = np.array([*(np.array(found.xy) - xy), found.heading - 12.0])
    assert away @ np.linalg.inv(found.covariance) @ away < 16.3  # 99.9 %
    assert found.heading == pytest.approx(12.0, abs=6.0)
    assert math.sqrt(np.trace(found.covariance[:2, :2])) < 5.0
    assert 0.0 < found.covariance[2, 2] < 30.0


def test_what_else_is_known_and_buildings_count() -> None:
    world = World(((0.0, 10.0, CODES[0]), (1000.0, 10.0, CODES[0])))
    objects = world.street_objects
    tree = ObjectIndex(objects.xy)
    query = Signature(np.array([CODES[0]]), np.array([1.0]))
    cells = np.array([[0.0, 0.0], [1000.0, 0.0]])
    parts = {"objects": objects, "index": tree}
    even = refine(query, cells, SHARP, **parts)  # type: ignore[arg-type]
    assert even.mass == pytest.approx(0.5, abs=1e-4)
    told = refine(query, cells, SHARP, log_prior=np.log([0.1, 0.9]), **parts)  # type: ignore[arg-type]
    assert told.mass == pytest.approx(0.9, abs=1e-4)
    assert told.xy[0] == pytest.approx(1000.0, abs=5.0)
    wall = Footprints([shapely.box(-20.0, 6.0, 20.0, 8.0)])
    hidden = refine(query, cells, SHARP, footprints=wall, **parts)  # type: ignore[arg-type]
    assert hidden.xy[0] == pytest.approx(1000.0, abs=5.0)
    assert hidden.mass > 0.9


def test_parts_fill_the_cells() -> None:
    world = noisy_town(5)
    objects = world.street_objects
    cells = world.database.xy[:7]
    query = seen(world, CORNER + 100.0, 5)
    found = refine(query, cells, SHARP, objects=objects, index=ObjectIndex(objects.xy))
    assert (found.sizes**2).sum() == pytest.approx(7 * 100.0)
    assert np.abs(found.places[:, None] - cells).max(axis=2).min(axis=1).max() < 5.0


def test_a_mixture_of_noise_is_widened() -> None:
    wide = cell_noise(named_noise("generic"), 6.0)
    assert isinstance(wide, NoiseMixture)
    assert [spec.position_sigma for spec in wide.specs] == pytest.approx([math.sqrt(3.0)] * 3)
    twice = cell_noise(cell_noise(NoiseSpec(), 3.0), 4.0)
    assert isinstance(twice, NoiseSpec)
    assert twice.position_sigma == pytest.approx(5.0 / math.sqrt(12.0))


@pytest.mark.parametrize("sigma", [0.0, 1e-3, 0.7, 30.0])
def test_the_noise_of_a_known_place_comes_back(sigma: float) -> None:
    for noise in (NoiseSpec(position_sigma=sigma), named_noise("generic")):
        back = place_noise(cell_noise(noise, 10.0), 10.0)
        for one, other in zip(noise.specs, back.specs, strict=True):
            assert one.position_sigma == pytest.approx(other.position_sigma, abs=2e-3)


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
