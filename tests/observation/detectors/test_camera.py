"""Camera models: bearings and ranges from the boxes of rendered scenes, and sectors."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from benchmarks.rendered import Scene
from semsig_gis.core import InputError, angular_distance
from semsig_gis.observation import Camera

if TYPE_CHECKING:
    from semsig_gis.observation import Projection

PROJECTIONS: dict[Projection, float] = {
    "pinhole": 80.0,
    "equirectangular": 360.0,
    "cylindrical": 360.0,
    "fisheye": 180.0,
}
TILTS = st.floats(-15, 15)


@given(
    st.sampled_from(sorted(PROJECTIONS)),
    st.one_of(st.just((0.0, 0.0)), st.tuples(TILTS, TILTS)),
    st.integers(0, 2**32),
)
def test_bearings_and_ranges_from_boxes_of_rendered_scene(
    projection: Projection, tilt: tuple[float, float], seed: int
) -> None:
    camera = Camera(
        width=5000,
        height=2500,
        fov=PROJECTIONS[projection],
        projection=projection,
        pitch=tilt[0],
        roll=tilt[1],
    )
    scene = Scene.random(seed)
    boxes = scene.boxes(camera)
    whole = np.flatnonzero(np.isfinite(boxes).all(axis=1))
    scene = scene.select(whole)
    result = camera.upright_objects(np.round(boxes[whole]))  # as detectors give them
    assert (angular_distance(result.bearings, scene.bearings) < 0.1).all()
    off = np.abs(scene.heights / result.rises / scene.distances - 1)
    # Both ends are off by half a pixel, and in a tilted picture the sides, too.
    assert (off <= 1.5 / (result.pixels - 1) + 0.002).all()


@pytest.mark.parametrize("projection", ["equirectangular", "cylindrical"])
def test_cropped_panorama_shows_the_same_as_the_full_one(projection: Projection) -> None:
    full = Camera(width=4000, height=2000, fov=360, projection=projection)
    part = Camera(width=1000, height=600, fov=90, projection=projection, horizon=300 - 150)
    boxes = np.array([[1900.0, 900.0, 1950.0, 1200.0], [2200.0, 950.0, 2210.0, 1000.0]])
    whole = full.upright_objects(boxes)
    cut = part.upright_objects(boxes - [1500, 850, 1500, 850])
    for name in ("bearings", "rises", "pixels"):
        assert getattr(cut, name) == pytest.approx(getattr(whole, name), abs=1e-6)
    assert part.sectors() == ((-45.0, 45.0),)


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_directions_are_inverse_of_pixels(projection: Projection) -> None:
    camera = Camera(width=400, height=300, fov=90, projection=projection, pitch=-20, roll=130)
    pixels = np.random.default_rng(0).uniform(0, 300, (50, 2))
    assert np.allclose(camera.pixels(camera.directions(pixels)), pixels)


def test_boxes_that_fit_no_upright_object_have_bearings() -> None:
    # Too narrow for a tall object in a tilted picture, in a corner, or without height.
    camera = Camera(width=4000, height=3000, fov=70, roll=20)
    boxes = [[2000, 500, 2010, 2500], [0, 0, 5, 5], [2000, 1500, 2100, 1500], [3990, 0, 4000, 3000]]
    result = camera.upright_objects(boxes)
    middles = [[(west + east) / 2, (top + bottom) / 2] for west, top, east, bottom in boxes]
    rays = camera.directions(middles)
    assert np.isfinite(result.bearings).all()
    expected = np.degrees(np.arctan2(rays[:, 0], rays[:, 2]))
    assert (angular_distance(result.bearings, expected) < 12).all()
    assert math.isnan(result.rises[2])
    assert len(camera.upright_objects([]).bearings) == 0


WIDE = math.degrees(2 * math.atan(0.75 * math.tan(math.radians(30))))
# The horizon is below the middle and crosses the sides nearer to the camera's axis. At 40 degrees
# it is outside the picture, and the sectors are at the height of the middle.
LIFTED = math.degrees(math.atan(math.tan(math.radians(30)) * math.cos(math.radians(20))))
OVER = 40.405


@pytest.mark.parametrize(
    ("camera", "sectors"),
    [
        (Camera(width=400, height=300, fov=60), [(-30, 30)]),
        (Camera(width=400, height=300, fov=60, roll=90), [(-WIDE / 2, WIDE / 2)]),
        (Camera(width=400, height=300, fov=60, pitch=20), [(-LIFTED, LIFTED)]),
        (Camera(width=400, height=300, fov=60, pitch=40), [(-OVER, OVER)]),
        (Camera(width=400, height=300, fov=60, pitch=90), []),
        (Camera(width=400, height=400, fov=90, pitch=90, projection="fisheye"), []),
        (Camera(width=400, height=200, fov=360, projection="equirectangular"), []),
        (Camera(width=400, height=200, fov=200, projection="cylindrical"), [(-100, 100)]),
        (Camera(width=400, height=400, fov=180, projection="fisheye"), [(-90, 90)]),
    ],
    ids=str,
)
def test_sectors_of_cameras(camera: Camera, sectors: list[tuple[float, float]]) -> None:
    result = np.reshape(camera.sectors(), (-1, 2))
    assert np.allclose(result, np.reshape(sectors, (-1, 2)), atol=1e-3)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"fov": 0}, "the field of view of a pinhole camera is 0; give a number from 0.1 to 175"),
        ({"fov": 180}, "to 175.0 degrees"),
        ({"fov": 361, "projection": "fisheye"}, "to 360.0 degrees"),
        ({"projection": "box"}, "the cameras are pinhole"),
        ({"width": 0}, "the width of a picture is 0"),
        ({"pitch": 91}, "from -90 to 90 degrees"),
        ({"roll": math.nan}, "from -180 to 180 degrees"),
    ],
)
def test_values_out_of_range_are_refused(wrong: dict[str, object], words: str) -> None:
    values: dict[str, object] = {"width": 400, "height": 300, "fov": 70, **wrong}
    with refused(InputError, words):
        Camera(**values)  # type: ignore[arg-type]


@pytest.mark.parametrize("projection", ["pinhole", "equirectangular"])
def test_scale_is_the_turn_of_a_pixel(projection: Projection) -> None:
    camera = Camera(width=1000, height=500, fov=PROJECTIONS[projection], projection=projection)
    columns = np.array([100.0, 400.0, 730.0])
    edges = columns[:, None] + [-0.5, 0.0, 0.5]
    rays = camera.directions(np.stack([edges, np.full(edges.shape, 250.0)], axis=-1))
    bearings = np.arctan2(rays[..., 0], rays[..., 2])
    turns = bearings[:, 2] - bearings[:, 0]
    scale = camera.log_scale(np.degrees(bearings[:, 1]))
    assert scale == pytest.approx(np.log(turns).sum(), abs=1e-4)
