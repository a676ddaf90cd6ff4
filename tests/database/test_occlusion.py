from __future__ import annotations

from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core import InputError
from semsig_gis.database import Footprints, ObjectStore, buildings_near, hidden, occlusion
from semsig_gis.sources import load_catalog
from semsig_gis.sources.osm import file as osm_file

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray
    from worlds import World

HOUSE = shapely.box(0, 0, 10, 10)


def oracle(
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    polygons: NDArray[np.object_],
    tolerance: float,
) -> bool:
    """Return whether a pair is hidden, by testing each polygon near the line."""
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
    polygons: NDArray[np.object_], pairs: int, rng: np.random.Generator
) -> float:
    """Return the share of random pairs that are hidden."""
    starts, ends = random_pairs(polygons, pairs, rng)
    result = hidden(starts, ends, footprints=Footprints(polygons))
    tree = shapely.STRtree(polygons)
    expected = [
        oracle(start, end, polygons[tree.query(shapely.LineString([start, end]).buffer(9))], 0.5)
        for start, end in zip(starts, ends, strict=True)
    ]
    assert result.tolist() == expected
    return float(result.mean())


def random_pairs(
    polygons: NDArray[np.object_], size: int, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return sight lines of up to 40 m that begin near the corners of buildings."""
    corners = shapely.get_coordinates(polygons)
    starts = corners[rng.integers(0, len(corners), size)] + rng.uniform(-15, 15, (size, 2))
    angle, length = rng.uniform(0, 2 * np.pi, size), rng.uniform(0, 40, size)
    steps = np.stack([np.cos(angle), np.sin(angle)], axis=1) * length[:, None]
    return starts, starts + steps


NEIGHBOUR = shapely.box(10, 0, 20, 10)
ROW = (HOUSE, NEIGHBOUR, shapely.box(0, 20, 10, 30))
FENCE = shapely.box(0, 4, 10, 4.9)
BLOCK = shapely.box(0, 0, 40, 40) - shapely.box(9, 9, 31, 31)
SPIKE = shapely.Polygon([(0, 0), (10, 0), (10, 10), (10, 30), (10, 10), (0, 10)])


@pytest.mark.parametrize(
    ("start", "end", "houses", "tolerance", "expected"),
    [
        # A house hides an object behind it.
        ((5, -8), (5, 12), [HOUSE], 0.5, True),
        ((5, -8), (20, -8), [HOUSE], 0.5, False),
        # An object in a facade is visible from its own side at any angle.
        *(((5, -8), (5, depth), [HOUSE], 0.5, False) for depth in (-0.2, 0.0, 0.4)),
        *(((-20, -1), (9, depth), [HOUSE], 0.5, False) for depth in (-0.2, 0.0, 0.4)),
        *(((5, 18), (5, depth), [HOUSE], 0.5, True) for depth in (-0.2, 0.0, 0.4)),
        ((5, -8), (5, 0.6), [HOUSE], 0.5, True),
        ((5, -8), (5, 0.1), [HOUSE], 0.05, True),
        # A line may cut a corner by less than the tolerance.
        ((-5, 5.4), (5.4, -5), [HOUSE], 0.5, False),
        ((-5, 7), (7, -5), [HOUSE], 0.5, True),
        # A viewpoint in a footprint sees out of it, but not through the next.
        ((5, 5), (5, 18), ROW, 0.5, False),
        ((5, 5), (5, 20.4), ROW, 0.5, False),
        ((5, 5), (5, 32), ROW, 0.5, True),
        ((5, 5), (25, 5), ROW, 0.5, True),
        # Houses that share a wall leave no gap.
        ((10, -8), (10, 18), [HOUSE, NEIGHBOUR], 0.5, True),
        ((10.04, -8), (10.04, 18), [HOUSE, shapely.box(10.08, 0, 20, 10)], 0.5, True),
        ((10.5, -8), (10.5, 18), [HOUSE, shapely.box(11, 0, 20, 10)], 0.5, False),
        # A wall thinner than twice the tolerance hides nothing.
        ((5, 0), (5, 9), [FENCE], 0.5, False),
        ((5, 0), (5, 9), [FENCE], 0.4, True),
        # A courtyard is open, and a spike of an invalid footprint is nothing.
        ((12, 12), (28, 28), [BLOCK], 0.5, False),
        ((12, 12), (12, -3), [BLOCK], 0.5, True),
        ((5, 20), (15, 20), [SPIKE], 0.5, False),
        ((5, -8), (5, 12), [SPIKE], 0.5, True),
        # No part of a building is deep enough; both ends are the same place.
        ((-5, 5), (15, 5), [HOUSE], 6.0, False),
        ((-5, 5), (-5, 5), [HOUSE], 0.5, False),
    ],
)
def test_buildings_hide_objects_behind_them(
    start: tuple[float, float],
    end: tuple[float, float],
    houses: list[shapely.Polygon],
    tolerance: float,
    expected: bool,  # noqa: FBT001
) -> None:
    footprints = Footprints(houses, tolerance=tolerance)
    assert hidden(np.array([start]), np.array([end]), footprints=footprints).tolist() == [expected]


def test_footprints_are_repaired_or_refused() -> None:
    bow = shapely.Polygon([(0, 0), (10, 10), (10, 0), (0, 10)])
    footprints = Footprints([bow, None, shapely.Polygon(), HOUSE])
    assert (footprints.repaired, len(footprints)) == (1, 3)
    nothing = np.empty((0, 2))
    assert hidden(nothing, nothing, footprints=footprints).size == 0
    with refused(InputError, "1 building footprints", "Point", "give polygons"):
        Footprints([HOUSE, shapely.Point(0, 0)])
    with refused(InputError, "not finite", "number 2"):
        Footprints([HOUSE, shapely.Polygon([(0, 0), (np.inf, 0), (1, 1)])])
    for empty in ([], [None, shapely.Polygon()], [shapely.Polygon([(0, 0), (5, 5), (9, 9)])]):
        with refused(InputError, "no building footprint", "give"):
            Footprints(empty)
    for tolerance in (-1.0, np.nan, np.inf):
        with refused(InputError, str(tolerance), "metres"):
            Footprints([HOUSE], tolerance=tolerance)


def test_block_size_does_not_change_occlusion(monkeypatch: pytest.MonkeyPatch) -> None:
    polygons = np.array([HOUSE, shapely.box(15, 3, 30, 20)])
    starts, ends = random_pairs(polygons, 500, np.random.default_rng(3))
    starts = starts[np.repeat(np.arange(100), 5)]
    footprints = Footprints(polygons)
    whole, inside = hidden(starts, ends, footprints=footprints), footprints.cover(starts)
    monkeypatch.setattr(occlusion, "PAIRS_PER_BLOCK", 7)
    assert np.array_equal(hidden(starts, ends, footprints=footprints), whole)
    assert np.array_equal(footprints.cover(starts), inside)
    assert 0 < whole.mean() < 1


EDGES = st.lists(st.tuples(st.integers(0, 30), st.integers(0, 30)), max_size=40)


@given(EDGES)
def test_connected_nodes_have_one_label(edges: list[tuple[int, int]]) -> None:
    first, second = np.array(edges, np.int64).reshape(-1, 2).T
    labels = occlusion._component_labels(first, second, 31)
    groups = [{node} for node in range(31)]
    for a, b in edges:
        joined = groups[a] | groups[b]
        for node in joined:
            groups[node] = joined
    assert labels.tolist() == [min(group) for group in groups]


@settings(max_examples=25)
@given(
    seed=st.integers(0, 2**32 - 1),
    span=st.sampled_from([60.0, 3_000.0]),
    origin=st.sampled_from([0.0, -500.0, 6_700_000.0]),
)
def test_occlusion_in_random_towns_equals_the_oracle(seed: int, span: float, origin: float) -> None:
    rng = np.random.default_rng(seed)
    corners = origin + rng.uniform(0, span, (12, 2))
    sizes = rng.uniform(0.3, rng.choice([20.0, 200.0]), (12, 2))
    polygons = np.asarray(shapely.box(*corners.T, *(corners + sizes).T))
    check_against_oracle(polygons, 40, rng)


@given(st.integers(0, 2**32 - 1))
def test_occlusion_along_walls_and_through_corners_equals_the_oracle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners, sizes = rng.integers(0, 12, (4, 2)), rng.integers(2, 8, (4, 2))
    polygons = np.asarray(shapely.box(*corners.T, *(corners + sizes).T), dtype=object)
    footprints = Footprints(polygons)
    # The ends are corners of the cut-back buildings and whole metres between them.
    places = np.concatenate(
        [shapely.get_coordinates(footprints.interiors), rng.integers(0, 20, (40, 2)) + 0.55]
    )
    starts, ends = (places[rng.integers(0, len(places), 100)] for _ in range(2))
    exact = occlusion._hidden_exactly(starts, ends, footprints)
    assert hidden(starts, ends, footprints=footprints).tolist() == exact.tolist()


@given(
    seed=st.integers(0, 2**32 - 1),
    span=st.sampled_from([20, 300, 10**6]),
    origin=st.sampled_from([0.0, -500.0, 6_700_000.0]),
)
def test_covered_places_are_in_a_footprint_or_on_its_outline(
    seed: int, span: int, origin: float
) -> None:
    rng = np.random.default_rng(seed)
    corners = origin + rng.integers(0, span, (12, 2))
    polygons = np.asarray(shapely.box(*corners.T, *(corners + rng.integers(1, 90, (12, 2))).T))
    polygons[:6] = shapely.buffer(shapely.centroid(polygons[:6]), rng.uniform(1, 90, 6))
    places = np.concatenate(
        [origin + rng.integers(0, span, (60, 2)), shapely.get_coordinates(polygons[3:9])]
    )
    expected = shapely.intersects(polygons[:, None], shapely.points(places)).any(axis=0)
    assert Footprints(polygons).cover(places).tolist() == expected.tolist()


def test_occlusion_in_helsinki_equals_the_oracle(geodata: Path) -> None:
    spec = load_catalog("openstreetmap").layer("buildings")
    (layer,) = osm_file.read_layers(geodata / "osm/helsinki_2019.osm.pbf", [spec])
    polygons = layer.table.to_crs(layer.table.estimate_utm_crs()).geometry.to_numpy()
    assert 0.2 < check_against_oracle(polygons, 2000, np.random.default_rng(1)) < 0.8


def test_occlusion_in_montpellier_equals_the_oracle(geodata: Path) -> None:
    table = gpd.read_file(geodata / "montpellier/VilleMTP_MTP_Batiments.zip").to_crs("EPSG:2154")
    footprints = Footprints(table.geometry.to_numpy())
    assert footprints.repaired == 1
    polygons = shapely.get_parts(shapely.make_valid(table.geometry.to_numpy()))
    assert 0.2 < check_against_oracle(polygons, 2000, np.random.default_rng(2)) < 0.8


def test_buildings_near_include_their_block() -> None:
    row = [shapely.box(10 * number, 0, 10 * number + 10, 8) for number in range(30)]
    houses = np.array([shapely.box(40, 20, 45, 25), *row])
    near = buildings_near(houses, np.array([[0.0, -5.0]]), distance=20.0)
    assert near.tolist() == list(range(1, 31))
    assert len(buildings_near(houses, np.array([[0.0, -50.0]]), distance=20.0)) == 0


def test_buildings_of_a_store_hide_what_they_hide_together(town: World) -> None:
    rng = np.random.default_rng(5)
    corners = rng.uniform(0, 600, (150, 2))
    sides = rng.uniform(5, 30, (150, 2))
    houses = np.asarray(shapely.box(*corners.T, *(corners + sides).T))
    flat = shapely.Polygon([(0, 0), (9, 0), (4, 0)])
    table = gpd.GeoDataFrame(geometry=[*houses, flat], crs=town.street_objects.crs)
    store = ObjectStore.of(town.street_objects, footprints=table)
    together = Footprints(houses)
    for _ in range(6):  # each time, more of the city is prepared
        middle = rng.uniform(0, 600, 2)
        starts = middle + rng.uniform(-25, 25, (200, 2))
        ends = starts + rng.uniform(-40, 40, (200, 2))
        near = store.buildings_around(starts, distance=60.0)
        expected = hidden(starts, ends, footprints=together)
        assert near is None or np.array_equal(hidden(starts, ends, footprints=near), expected)
        assert near is not None or not expected.any()
    assert store.buildings_around(starts, distance=60.0, occlusion=None) is None
    assert store.buildings_around(np.array([[9e5, 9e5]]), distance=60.0) is None
