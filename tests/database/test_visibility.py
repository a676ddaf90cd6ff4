from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semsig_gis.core.geometry import bearings, wrap_degrees
from semsig_gis.core.grid import GridSpec, cells_near
from semsig_gis.core.rtree import PackedIndex
from semsig_gis.database import build
from semsig_gis.database.build import visible_objects
from semsig_gis.database.visibility import Sightings

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Cells of 2 m with their centres at whole numbers.
GRID = GridSpec(2.0, (-1.0, -1.0))


def look(
    cells: list[tuple[int, int]] | NDArray[np.int64],
    places: object,
    ranges: float | NDArray[np.float64] = 30.0,
    grid: GridSpec = GRID,
) -> Sightings:
    """Return all that is seen, ordered by cell and object."""
    objects = np.asarray(places, dtype=float)
    columns, rows = np.asarray(cells).reshape(-1, 2).T
    index, reach = PackedIndex(objects), np.broadcast_to(np.float64(ranges), len(objects))
    end, parts = 0, [Sightings(*(np.empty(0, kind) for kind in (int, int, float, float)))]
    for block, seen in visible_objects(
        columns, rows, objects, grid=grid, index=index, ranges=reach
    ):
        assert block.start == end
        end = block.stop
        assert ((seen.viewpoint >= 0) & (seen.viewpoint < block.stop - block.start)).all()
        moved = seen.viewpoint + block.start
        parts.append(Sightings(moved, seen.object, seen.bearing, seen.distance))
    assert end == len(columns)
    names = ("viewpoint", "object", "bearing", "distance")
    whole = Sightings(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))
    return whole.only(np.lexsort((whole.object, whole.viewpoint)))


def slow_look(
    cells: NDArray[np.int64],
    objects: NDArray[np.float64],
    ranges: NDArray[np.float64],
    grid: GridSpec,
) -> Sightings:
    """Measure every pair there is."""
    delta = objects[None] - grid.viewpoints(*cells.T)[:, None]
    distance = np.hypot(delta[..., 0], delta[..., 1])
    bearing = wrap_degrees(np.round(bearings(delta[..., 0], delta[..., 1]), 9))
    viewpoint, item = np.nonzero(distance <= ranges)
    return Sightings(viewpoint, item, bearing[viewpoint, item], distance[viewpoint, item])


def assert_equal(one: Sightings, other: Sightings) -> None:
    for name in ("viewpoint", "object", "bearing", "distance"):
        assert getattr(one, name).tolist() == getattr(other, name).tolist(), name


def test_what_is_seen_has_bearing_and_distance() -> None:
    seen = look([(50, 50)], [[100, 110], [120, 100], [100, 70], [82, 76], [100, 131]])
    assert seen.object.tolist() == [0, 1, 2, 3]
    assert seen.bearing == pytest.approx([0, 90, 180, 180 + math.degrees(math.atan2(3, 4))])
    assert seen.distance.tolist() == [10, 20, 30, 30]
    assert seen.viewpoint.tolist() == [0, 0, 0, 0]


def test_an_object_at_the_viewpoint_is_due_north() -> None:
    seen = look([(5, 5)], [[10, 10]])
    assert (seen.bearing.tolist(), seen.distance.tolist()) == ([0.0], [0.0])


def test_viewpoints_are_counted_as_the_cells_are() -> None:
    seen = look([(0, 0), (5, 0), (250, 0)], [[5, 0], [500, 3], [6, 1]])
    assert seen.viewpoint.tolist() == [0, 0, 1, 1, 2]
    assert seen.object.tolist() == [0, 2, 0, 2, 1]
    assert look([(450, 450)], [[0, 0]]).viewpoint.size == 0
    assert look([], [[0, 0]]).viewpoint.size == 0


STEPS = st.sampled_from([0.5, 3.0, 7.3, 10.0, 12.5, 40.0, 1000.0])
RADII = st.sampled_from([0.25, 5.0, 12.5, 30.0, 61.7])


@given(
    seed=st.integers(0, 2**32 - 1),
    step=STEPS,
    radius=RADII,
    corner=st.sampled_from([(0.0, 0.0), (765_200.0, 6_275_000.0), (-3e6, 1e7)]),
    mixed=st.sampled_from([0.0, 0.5]),
    kept=st.sampled_from([1.0, 0.5, 0.02]),
    exact=st.booleans(),
    blocks=st.sampled_from([(1 << 14, 1 << 20), (7, 1 << 20), (100, 1), (1 << 14, 60)]),
)
@settings(deadline=None)
def test_what_is_seen_is_what_measuring_every_pair_finds(
    *,
    seed: int,
    step: float,
    radius: float,
    corner: tuple[float, float],
    mixed: float,
    kept: float,
    exact: bool,
    blocks: tuple[int, int],
) -> None:
    rng = np.random.default_rng(seed)
    grid = GridSpec(step, tuple(rng.uniform(-50, 50, 2)))
    size = max(2.0 * radius, step)
    objects = rng.uniform(-size, size, (12, 2)) + corner
    if exact:  # in quarters of a metre, where circles and edges of tiles are met exactly
        grid, objects = GridSpec(step, (0.25, -4.5)), np.round(objects * 4) / 4
    ranges = np.where(rng.random(12) < mixed, radius / 5, radius)
    near = np.stack(cells_near(objects, grid=grid, radius=radius), axis=-1)
    chosen = np.flatnonzero(rng.random(len(near)) < max(kept, 5 / len(near)))[:3000]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "CELLS_A_BLOCK", blocks[0])
        patch.setattr(build, "PAIRS_A_BLOCK", blocks[1])
        found = look(near[chosen], objects, ranges, grid)
    assert_equal(found, slow_look(near[chosen], objects, ranges, grid))


@given(st.integers(-30, 30), st.integers(-30, 30), st.integers(1, 12))
def test_objects_in_one_direction_have_one_bearing(dx: int, dy: int, times: int) -> None:
    # The last digits of an arctangent depend on the processor; ties must not.
    seen = look([(0, 0)], [[dx, dy], [dx * times, dy * times]], 600.0)
    assert seen.bearing[0] == seen.bearing[1]


@pytest.mark.parametrize("most", [1, 50, 10**6])
def test_a_block_that_sees_very_much_is_halved(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build, "PAIRS_A_BLOCK", most)
    objects = np.random.default_rng(3).uniform(0, 60, (40, 2))
    columns, rows = cells_near(objects, grid=GridSpec(), radius=30.0)
    index = PackedIndex(objects)
    blocks = [
        (block.stop - block.start, len(seen.object))
        for block, seen in visible_objects(
            columns, rows, objects, grid=GridSpec(), index=index, ranges=np.full(40, 30.0)
        )
    ]
    assert sum(cells for cells, _ in blocks) == len(columns)
    assert all(pairs <= most or cells == 1 for cells, pairs in blocks)
    assert (len(blocks) == 1) == (most == 10**6)


def test_some_of_the_pairs_can_be_left_out() -> None:
    seen = look([(0, 0)], [[5, 0], [6, 1], [7, 2]])
    kept = seen.only(seen.object != 1)
    assert kept.object.tolist() == [0, 2]
    assert kept.distance.tolist() == seen.distance[seen.object != 1].tolist()
    assert len(kept.viewpoint) == len(kept.bearing) == 2


def test_the_pairs_can_be_put_in_another_order() -> None:
    seen = look([(0, 0)], [[5, 0], [6, 1], [7, 2]])
    turned = seen.only(np.array([2, 0, 1]))
    assert turned.object.tolist() == [2, 0, 1]
    assert turned.bearing.tolist() == seen.bearing[[2, 0, 1]].tolist()


def test_noise_beside_north_is_north() -> None:
    seen = look([(0, 0)], [[-1e-13, 20], [1e-13, 20], [-1e-300, 20], [-5e-7, 20]])
    assert seen.bearing[:3].tolist() == [0.0, 0.0, 0.0]
    assert 359.9999 < seen.bearing[3] < 360.0


@given(st.integers(0, 2**32 - 1))
def test_bearings_and_distances_lead_back_to_the_objects(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places = rng.uniform(0, 100, (30, 2)) + np.array([765_200.0, 6_275_000.0])
    cells = np.stack(cells_near(places[:1], grid=GridSpec(), radius=20.0), axis=-1)
    seen = look(cells, places, grid=GridSpec())
    assert ((seen.bearing >= 0) & (seen.bearing < 360) & (seen.distance <= 30)).all()
    angle = np.radians(seen.bearing)
    views = GridSpec().viewpoints(*cells.T)
    back = views[seen.viewpoint] + np.stack(
        [seen.distance * np.sin(angle), seen.distance * np.cos(angle)], axis=1
    )
    assert back == pytest.approx(places[seen.object], abs=1e-6)
