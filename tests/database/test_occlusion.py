from __future__ import annotations

from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from sentences import assert_sentence, refused

from semsig_gis.core.errors import InputError
from semsig_gis.database import occlusion
from semsig_gis.database.occlusion import Footprints, buildings_near, hidden
from semsig_gis.sources.catalog import load_catalog
from semsig_gis.sources.osm import file as osm_file

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

HOUSE = shapely.box(0, 0, 10, 10)


def blocked(
    start: tuple[float, float],
    end: tuple[float, float],
    *polygons: shapely.Geometry,
    tolerance: float = 0.5,
) -> bool:
    footprints = Footprints(polygons, tolerance=tolerance)
    return bool(hidden(np.array([start]), np.array([end]), footprints=footprints)[0])


def oracle(
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    polygons: NDArray[np.object_],
    tolerance: float,
) -> bool:
    """Decide one pair from the buildings round about, one polygon after the other."""
    line = shapely.LineString([start, end])
    window = line.buffer(5 * tolerance + 1)
    around = [polygon for polygon in polygons if polygon.intersects(window)]
    around = [polygon.buffer(0.05, join_style="mitre") for polygon in around]
    deep = shapely.union_all(around).buffer(-tolerance - 0.05)
    for polygon in around:
        core = polygon.intersection(deep)
        if core.area > 0 and not core.intersects(shapely.Point(start)) and line.intersects(core):
            return True
    return False


def check_against_oracle(
    polygons: NDArray[np.object_], starts: NDArray[np.float64], ends: NDArray[np.float64]
) -> float:
    """Return the share of the pairs that are hidden."""
    found = hidden(starts, ends, footprints=Footprints(polygons))
    tree = shapely.STRtree(polygons)
    expected = [
        oracle(start, end, polygons[tree.query(shapely.LineString([start, end]).buffer(9))], 0.5)
        for start, end in zip(starts, ends, strict=True)
    ]
    assert found.tolist() == expected
    return float(found.mean())


def random_pairs(
    polygons: NDArray[np.object_], size: int, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return sight lines of up to 40 m that begin near the corners of buildings."""
    corners = shapely.get_coordinates(polygons)
    starts = corners[rng.integers(0, len(corners), size)] + rng.uniform(-15, 15, (size, 2))
    angle, length = rng.uniform(0, 2 * np.pi, size), rng.uniform(0, 40, size)
    steps = np.stack([np.cos(angle), np.sin(angle)], axis=1) * length[:, None]
    return starts, starts + steps


def test_a_house_hides_what_is_behind_it() -> None:
    assert blocked((5, -8), (5, 12), HOUSE)
    assert not blocked((5, -8), (20, -8), HOUSE)


def test_an_object_in_a_facade_is_seen_from_its_own_side_at_any_slant() -> None:
    for depth in (-0.2, 0.0, 0.4):
        assert not blocked((5, -8), (5, depth), HOUSE)
        assert not blocked((-20, -1), (9, depth), HOUSE)
        assert blocked((5, 18), (5, depth), HOUSE)
    assert blocked((5, -8), (5, 0.6), HOUSE)
    assert blocked((5, -8), (5, 0.1), HOUSE, tolerance=0.05)


def test_a_line_may_cut_a_corner_by_less_than_the_tolerance() -> None:
    assert not blocked((-5, 5.4), (5.4, -5), HOUSE)
    assert blocked((-5, 7), (7, -5), HOUSE)


def test_a_viewpoint_in_a_footprint_sees_out_of_it_but_not_through_the_next() -> None:
    neighbour, across = shapely.box(10, 0, 20, 10), shapely.box(0, 20, 10, 30)
    assert not blocked((5, 5), (5, 18), HOUSE, neighbour, across)
    assert not blocked((5, 5), (5, 20.4), HOUSE, neighbour, across)
    assert blocked((5, 5), (5, 32), HOUSE, neighbour, across)
    assert blocked((5, 5), (25, 5), HOUSE, neighbour, across)


def test_houses_that_share_a_wall_leave_no_gap() -> None:
    assert blocked((10, -8), (10, 18), HOUSE, shapely.box(10, 0, 20, 10))
    assert blocked((10.04, -8), (10.04, 18), HOUSE, shapely.box(10.08, 0, 20, 10))
    assert not blocked((10.5, -8), (10.5, 18), HOUSE, shapely.box(11, 0, 20, 10))


def test_a_wall_thinner_than_twice_the_tolerance_hides_nothing() -> None:
    fence = shapely.box(0, 4, 10, 4.9)
    assert not blocked((5, 0), (5, 9), fence)
    assert blocked((5, 0), (5, 9), fence, tolerance=0.4)


def test_a_courtyard_is_open() -> None:
    block = shapely.Polygon(
        shapely.box(0, 0, 40, 40).exterior, [shapely.box(9, 9, 31, 31).exterior]
    )
    assert not blocked((12, 12), (28, 28), block)
    assert blocked((12, 12), (12, -3), block)


def test_invalid_footprints_are_repaired_and_counted() -> None:
    bow = shapely.Polygon([(0, 0), (10, 10), (10, 0), (0, 10)])
    footprints = Footprints([bow, None, shapely.Polygon(), HOUSE])
    assert footprints.repaired == 1
    assert len(footprints) == 3
    spike = shapely.Polygon([(0, 0), (10, 0), (10, 10), (10, 30), (10, 10), (0, 10)])
    assert not blocked((5, 20), (15, 20), spike)
    assert blocked((5, -8), (5, 12), spike)


def test_what_is_no_footprint_is_refused() -> None:
    with refused(InputError, "1 building footprints", "Point", "give polygons"):
        Footprints([HOUSE, shapely.Point(0, 0)])
    with pytest.raises(InputError) as caught:
        Footprints([HOUSE, shapely.Polygon([(0, 0), (np.inf, 0), (1, 1)])])
    assert_sentence(caught.value, "not finite", "number 2")
    for nothing in ([], [None, shapely.Polygon()], [shapely.Polygon([(0, 0), (5, 5), (9, 9)])]):
        with refused(InputError, "no building footprint", "give"):
            Footprints(nothing)
    for tolerance in (-1.0, np.nan, np.inf):
        with refused(InputError, str(tolerance), "metres"):
            Footprints([HOUSE], tolerance=tolerance)


def test_no_pairs_and_no_cores() -> None:
    nothing = np.empty((0, 2))
    assert hidden(nothing, nothing, footprints=Footprints([HOUSE])).size == 0
    assert not blocked((-5, 5), (15, 5), HOUSE, tolerance=6.0)
    assert not blocked((-5, 5), (-5, 5), HOUSE)


def test_blocks_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    polygons = np.array([HOUSE, shapely.box(15, 3, 30, 20)])
    starts, ends = random_pairs(polygons, 500, rng)
    starts = starts[np.repeat(np.arange(100), 5)]
    footprints = Footprints(polygons)
    whole, inside = hidden(starts, ends, footprints=footprints), footprints.cover(starts)
    monkeypatch.setattr(occlusion, "PAIRS_A_BLOCK", 7)
    assert np.array_equal(hidden(starts, ends, footprints=footprints), whole)
    assert np.array_equal(footprints.cover(starts), inside)
    assert 0 < whole.mean() < 1


def test_interiors_and_cores_make_up_the_same() -> None:
    rng = np.random.default_rng(8)
    corners, sizes = rng.uniform(0, 120, (40, 2)), rng.uniform(3, 20, (40, 2))
    footprints = Footprints(np.asarray(shapely.box(*corners.T, *(corners + sizes).T)))
    assert len(footprints.interiors) > 3
    for number, interior in enumerate(footprints.interiors):
        cores = footprints.cores(number)
        assert shapely.union_all(cores).symmetric_difference(interior).area < 1e-6
        assert footprints.cores(number) is cores


EDGES = st.lists(st.tuples(st.integers(0, 30), st.integers(0, 30)), max_size=40)


@given(EDGES)
def test_what_a_chain_of_pairs_joins_has_one_label(edges: list[tuple[int, int]]) -> None:
    first, second = np.array(edges, np.int64).reshape(-1, 2).T
    labels = occlusion._joined(first, second, 31)
    groups = [{thing} for thing in range(31)]
    for a, b in edges:
        joined = groups[a] | groups[b]
        for thing in joined:
            groups[thing] = joined
    assert labels.tolist() == [min(group) for group in groups]


def test_a_long_row_of_houses_is_one_block() -> None:
    order = np.random.default_rng(4).permutation(3000)
    labels = occlusion._joined(order[:-1], order[1:], 3000)
    assert not labels.any()
    row = [shapely.box(8.0 * number, 0, 8.0 * number + 8, 10) for number in order if number < 300]
    assert len(Footprints(row).interiors) == 1


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_random_towns_equal_the_oracle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners, sizes = rng.uniform(0, 60, (12, 2)), rng.uniform(0.3, 20, (12, 2))
    polygons = np.asarray(shapely.box(*corners.T, *(corners + sizes).T))
    check_against_oracle(polygons, *random_pairs(polygons, 40, rng))


def test_helsinki_equals_the_oracle(geodata: Path) -> None:
    spec = load_catalog("openstreetmap").layer("buildings")
    (layer,) = osm_file.read_layers(geodata / "osm/helsinki_2019.osm.pbf", [spec])
    polygons = layer.table.to_crs(layer.table.estimate_utm_crs()).geometry.to_numpy()
    rng = np.random.default_rng(1)
    share = check_against_oracle(polygons, *random_pairs(polygons, 2000, rng))
    assert 0.2 < share < 0.8


def test_montpellier_equals_the_oracle(geodata: Path) -> None:
    table = gpd.read_file(geodata / "montpellier/VilleMTP_MTP_Batiments.zip").to_crs("EPSG:2154")
    footprints = Footprints(table.geometry.to_numpy())
    assert footprints.repaired == 1
    polygons = shapely.get_parts(shapely.make_valid(table.geometry.to_numpy()))
    rng = np.random.default_rng(2)
    share = check_against_oracle(polygons, *random_pairs(polygons, 2000, rng))
    assert 0.2 < share < 0.8


def test_whole_blocks_of_houses_are_looked_at() -> None:
    row = [shapely.box(10 * number, 0, 10 * number + 10, 8) for number in range(30)]
    houses = np.array([shapely.box(40, 20, 45, 25), *row])
    near = buildings_near(houses, np.array([[0.0, -5.0]]), distance=20.0)
    assert near.tolist() == list(range(1, 31))
    assert len(buildings_near(houses, np.array([[0.0, -50.0]]), distance=20.0)) == 0
