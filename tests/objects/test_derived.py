"""Junctions, dead ends, corners and gaps, computed from small towns, and fronts of buildings."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Literal

import geopandas as gpd
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from raw_layers import raw_layer

from semsig_gis.objects import assemble, load
from semsig_gis.sources import (
    Catalog,
    LayerSpec,
    RawLayer,
    RowCounts,
    built_in_taxonomy,
    derived_layer,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from semsig_gis.objects import Loaded
    from semsig_gis.sources import Derivation

# A place in the metric CRS, so that no coordinate is far from all others on the Earth.
ORIGIN = np.array([600_000.0, 6_800_000.0])
CRS = "EPSG:2154"


def ground(
    role: Literal["streets", "buildings"],
    shapes: Sequence[shapely.Geometry],
    columns: Mapping[str, object],
) -> RawLayer:
    places = [shapely.transform(shape, lambda xy: xy + ORIGIN) for shape in shapes]
    frame = gpd.GeoDataFrame(geometry=places, crs=CRS)
    frame = frame.assign(class_name="", source_id="", **columns)
    spec = LayerSpec(name=role, role=role, files=("*",))
    return RawLayer(spec=spec, counts=RowCounts(read=len(frame)), table=frame)


def town(
    *,
    streets: Sequence[Sequence[tuple[float, float]]] = (),
    names: Sequence[str] = (),
    houses: Sequence[shapely.Geometry] = (),
    derive: Sequence[Derivation] = (),
    objects: Sequence[RawLayer] = (),
    half_width: float = 6.0,
) -> Loaded:
    specs = [LayerSpec(name=what, derive=what) for what in derive]
    layers = [*objects, *map(derived_layer, specs)]
    if streets:
        lines = list(map(shapely.LineString, streets))
        columns = {"name": list(names) or [""] * len(lines), "half_width": half_width}
        layers.append(ground("streets", lines, columns))
    if houses:
        layers.append(ground("buildings", houses, {}))
    catalog = Catalog(name="town", title="Town", taxonomy=built_in_taxonomy(), layers=tuple(specs))
    return assemble(layers, catalog, metric_crs=CRS, merge=False)


def found(loaded: Loaded) -> dict[str, list[tuple[float, float]]]:
    """Return the places of the objects by class, rounded to metres and sorted."""
    objects = loaded.objects
    places: dict[str, list[tuple[float, float]]] = {}
    for code, (x, y) in zip(objects.codes.tolist(), objects.xy - ORIGIN, strict=True):
        name = objects.taxonomy.by_code(code).name
        places.setdefault(name, []).append((round(x), round(y)))
    return {name: sorted(xy) for name, xy in places.items()}


def junctions(
    *streets: Sequence[tuple[float, float]], names: Sequence[str] = ()
) -> dict[str, list[tuple[float, float]]]:
    return found(town(streets=streets, names=names, derive=["junctions"]))


def test_arms_of_a_junction_are_counted() -> None:
    through = [(-100, 0), (0, 0), (100, 0)]
    assert junctions(through, [(0, 0), (0, 100)]) == {"t_junction": [(0, 0)]}
    # The same if the street is in two parts.
    assert junctions(through[:2], through[1:], [(0, 0), (0, 100)]) == {"t_junction": [(0, 0)]}
    crossing = [(0, -100), (0, 0), (0, 100)]
    assert junctions(through, crossing) == {"crossroads": [(0, 0)]}
    star = [[(0, 0), (-90, 90)], [(0, 0), (90, -70)]]
    assert junctions(through, crossing, *star) == {"large_junction": [(0, 0)]}
    # A bridge is no junction, and neither is a street that goes on under another name.
    apart = [[(500, 500), (510, 500), (510, 600)], [(510, 500), (600, 500)]]
    assert junctions([(-100, 0), (100, 0)], [(0, -100), (0, 100)], *apart) == {
        "t_junction": [(510, 500)]
    }
    # Ends that miss the street by less than a metre meet it.
    assert junctions([(-100, 0), (100, 0)], [(0, 0.7), (0, 100)]) == {"t_junction": [(0, 1)]}


def test_carriageways_of_a_street_are_one_arm() -> None:
    def dual(y: float) -> list[tuple[float, float]]:
        return [(-200, y), (-8, y), (8, y), (200, y)]

    single = [(0, -200), (0, -6), (0, 6), (0, 200)]
    west, east = [(-8, -200), (-8, -6), (-8, 6), (-8, 200)], [(8, -200), (8, -6), (8, 6), (8, 200)]
    pair = [[(-200, y), (0, y), (200, y)] for y in (-6.0, 6.0)]
    assert junctions(*pair, single) == {"crossroads": [(0, 0)]}
    assert junctions(*pair, single[:3]) == {"t_junction": [(0, 0)]}
    assert junctions(dual(-6), dual(6), west, east) == {"crossroads": [(0, 0)]}
    # Streets with different names that leave side by side are two.
    assert junctions(*pair, single, names=["A", "B", "C"]) == {"large_junction": [(0, 0)]}
    # A street that divides around an island is no junction.
    island = [[(-99, 0), (0, 0)], [(0, 0), (40, 6), (99, 6)], [(0, 0), (40, -6), (99, -6)]]
    junction = [[(300, 300), (400, 300)], [(300, 300), (200, 300)], [(300, 300), (300, 200)]]
    assert junctions(*island, *junction, names=["A"] * 6) == {"t_junction": [(300, 300)]}


@pytest.mark.parametrize("parts", [1, 3])
def test_ring_is_a_roundabout_and_has_no_other_junctions(parts: int) -> None:
    angles = np.linspace(0, 2 * np.pi, 13)
    ring = [(round(20 * np.sin(a), 3), round(20 * np.cos(a), 3)) for a in angles]
    ring[-1] = ring[0]
    rings = [ring[12 * i // parts : 12 * (i + 1) // parts + 1] for i in range(parts)]
    arms = [[ring[at], (6 * ring[at][0], 6 * ring[at][1])] for at in (0, 3, 6, 9)]
    assert junctions(*rings, *arms) == {"roundabout": [(0, 0)]}
    square = [(300.0, 0.0), (340.0, 0.0), (340.0, 40.0), (300.0, 40.0), (300.0, 0.0)]
    assert "roundabout" not in junctions(square, [(300, 0), (200, 0)])


def test_dead_ends_are_inside_of_the_data_and_not_at_tunnels() -> None:
    frame = [(0.0, 0.0), (500.0, 0.0), (500.0, 500.0), (0.0, 500.0), (0.0, 0.0)]
    lane = [(250.0, 0.0), (250.0, 100.0)]
    tunnel = [[(100.0, 0.0), (100.0, 80.0)], [(100.0, 240.0), (100.0, 500.0)]]
    beyond = [(500.0, 0.0), (600.0, 0.0)]
    ends = found(town(streets=[frame, lane, *tunnel, beyond], derive=["dead_ends"]))
    assert ends == {"dead_end": [(250, 100)]}


grids = st.lists(st.lists(st.booleans(), min_size=5, max_size=5), min_size=5, max_size=5)


@settings(max_examples=40, deadline=None)
@given(grids)
def test_corners_are_where_one_of_four_squares_is_built(cells: list[list[bool]]) -> None:
    built = np.pad(np.array(cells), 1)
    around = [built[:-1, :-1], built[:-1, 1:], built[1:, :-1], built[1:, 1:]]
    number = np.sum(around, axis=0)
    diagonal = (number == 2) & (around[0] == around[3])
    if diagonal.any():
        return  # where two buildings touch with their corners, these are none
    expected = sorted((5 * int(x), 5 * int(y)) for x, y in np.argwhere(number == 1))
    houses = [shapely.box(5 * x, 5 * y, 5 * x + 5, 5 * y + 5) for x, y in np.argwhere(built) - 1]
    extra = [shapely.box(500, 500, 503.9, 520)]  # no wall here meets another of 4 m
    bench = raw_layer([shapely.Point(ORIGIN)], classes="bench")
    loaded = town(houses=[*houses, *extra], derive=["building_corners"], objects=[bench])
    assert found(loaded).get("building_corner", []) == expected


def test_gap_is_an_opening_to_a_street() -> None:
    street = [(0.0, -6.0), (100.0, -6.0)]
    houses = [
        shapely.box(0, 0, 20, 12),
        shapely.box(24, 0, 40, 12),  # 4 m apart
        shapely.box(40.5, 0, 60, 12),  # a joint
        shapely.box(70, 0, 90, 12),  # too wide
        shapely.box(0, 30, 20, 42),
        shapely.box(23, 30, 40, 42),  # not at the street
    ]
    assert found(town(streets=[street], houses=houses, derive=["gaps"])) == {
        "building_gap": [(22, 0)]
    }


def test_what_cannot_be_computed_is_noted() -> None:
    bench = raw_layer([shapely.Point(ORIGIN)], classes="bench")
    loaded = town(derive=["junctions", "gaps"], objects=[bench])
    assert loaded.objects.class_counts == {10: 1}
    notes = " ".join(loaded.objects.notes)
    assert "junctions: computed from streets, which are not there; left out" in notes
    assert "gaps: computed from streets and buildings" in notes


def shops(*places: tuple[float, float], kind: str = "bakery") -> RawLayer:
    points = [shapely.Point(ORIGIN + place) for place in places]
    return raw_layer(points, classes=kind, name=kind)


def test_shops_inside_of_buildings_move_to_their_fronts() -> None:
    street = [(0.0, -8.0), (100.0, -8.0)]
    houses = [shapely.box(0, 0, 20, 30), shapely.box(20, 0, 40, 30)]
    inside, outside, wall = (6.2, 9.0), (50.0, 3.0), (30.0, 0.3)
    loaded = town(
        streets=[street],
        houses=houses,
        objects=[shops(inside, outside, wall), shops(inside, kind="bench")],
    )
    places = loaded.objects.xy - ORIGIN
    assert loaded.report.fronts == 1
    assert places[0] == pytest.approx((7.0, -0.5))
    assert places[1:] == pytest.approx(np.array([outside, wall, inside]))
    # The shared wall is nearer, but nobody sees it.
    without = town(houses=houses, objects=[shops((19.0, 10.0))]).objects.xy - ORIGIN
    assert without[0] == pytest.approx((19.0, -0.5))


def test_entrance_near_the_front_has_priority() -> None:
    street, house = [(0.0, -8.0), (100.0, -8.0)], shapely.box(0, 0, 20, 30)
    near, far = shops((9.4, 0.0), kind="entrance"), shops((18.0, 0.0), kind="entrance")
    for door, x in ((near, 9.0), (far, 7.0)):
        loaded = town(streets=[street], houses=[house], objects=[shops((6.2, 9.0)), door])
        assert loaded.objects.xy[0] - ORIGIN == pytest.approx((x, -0.5))


def test_building_of_a_shop_has_it_at_its_front() -> None:
    house = shapely.box(0, 0, 20, 30)
    shape = shapely.transform(house, lambda xy: xy + ORIGIN)
    area, church = (
        raw_layer([shape], classes=kind, name=kind) for kind in ("supermarket", "church_tower")
    )
    street = [(0.0, -8.0), (100.0, -8.0)]
    places = town(streets=[street], houses=[house], objects=[area, church]).objects.xy - ORIGIN
    assert places == pytest.approx(np.array([(9.0, -0.5), (10.0, 15.0)]), abs=2.1)
    assert places[1] == pytest.approx((10, 15))


def test_fronts_of_a_real_town_are_outside_of_all_buildings(geodata: Path) -> None:
    loaded = load(geodata / "osm" / "neukolln_2024.osm", layers=["shops", "food"])
    footprints = loaded.buildings
    assert footprints is not None
    points: NDArray[np.object_] = np.asarray(shapely.points(loaded.objects.xy), object)
    tree = shapely.STRtree(footprints.geometry.to_numpy())
    inside, building = tree.query(points, predicate="within")
    depth = shapely.distance(
        points[inside], shapely.boundary(footprints.geometry.to_numpy()[building])
    )
    assert loaded.report.fronts > 20
    assert depth.max(initial=0) <= 0.5


def test_roundabouts_of_a_real_town_are_those_of_its_tags(geodata: Path) -> None:
    """Counted by pyosmium with the tag junction=roundabout, joined to rings: 22 of 26 and 24."""
    loaded = load(geodata / "osm" / "monaco_2022.osm.pbf", layers=["junctions"])
    counts = Counter(loaded.objects.taxonomy.by_code(code).name for code in loaded.objects.codes)
    assert 20 <= counts["roundabout"] <= 28
    assert counts["t_junction"] > counts["crossroads"] > counts["large_junction"] > 0
