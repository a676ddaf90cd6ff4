"""Lines, areas and landmarks: what a viewpoint sees of them, and the files of such databases."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow.parquet as pq
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from sentences import refused
from worlds import CORNER, assert_same, objects_of

from semsig_gis.core import (
    GROUP,
    DatabaseError,
    GridSpec,
    ObjectClass,
    ObjectIndex,
    Taxonomy,
    signed_degrees,
)
from semsig_gis.database import (
    Footprints,
    bearings,
    build_database,
    file,
    hidden,
    open_database,
    save_database,
    visible_objects_at,
    visible_objects_in,
)
from semsig_gis.localization import visible_objects_off_centre
from semsig_gis.objects import Licence

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.objects import StreetObjects

LAMP = ObjectClass(3, "D", "street_light", "Street light", family="furniture")
RAIL = ObjectClass(230, "é", "rail", "Rail", family="transport", shape="line")
PARK = ObjectClass(231, "Ж", "grove", "Grove", family="leisure", shape="area", range_m=45.0)
TAXONOMY = Taxonomy((LAMP, RAIL, PARK))
HOUSE = shapely.transform(shapely.box(12.0, 12.0, 27.0, 31.0), lambda xy: xy + CORNER)
# Coordinates on a coarse grid make equal distances and bearings likely.
coordinates = st.integers(0, 24).map(lambda number: 2.5 * number)
points = st.tuples(
    coordinates, coordinates, st.sampled_from([(3, -1), (230, 0), (230, 1), (231, 7)])
)


def extended(*things: tuple[float, float, tuple[int, int]]) -> StreetObjects:
    """Return objects from x, y and (class code, group)."""
    rows = [
        (CORNER[0] + x, CORNER[1] + y, code, "world", str(row))
        for row, (x, y, (code, _)) in enumerate(things)
    ]
    groups = np.array([group for _, _, (_, group) in things], np.int32)
    licenses = (Licence("World (CC0)", ("world",)),)
    columns: dict[str, Any] = {GROUP: groups} if (groups >= 0).any() else {}
    return objects_of(*rows, licenses=licenses, taxonomy=TAXONOMY, **columns)


def built(objects: StreetObjects, house: shapely.Polygon | None = None) -> SignatureDatabase:
    houses = None if house is None else gpd.GeoDataFrame(geometry=[house], crs="EPSG:2154")
    return build_database(
        objects, grid=GridSpec(17.0, (float(CORNER[0]), float(CORNER[1]))), footprints=houses
    )


def nearest_points(
    objects: StreetObjects, place: NDArray[np.float64], house: shapely.Polygon | None
) -> list[tuple[float, float, int, float]]:
    """Return (bearing, distance, class code, extent) of what is seen from a place, by a loop."""
    points_of: dict[tuple[int, int], list[tuple[float, float]]] = {}
    unseen = np.zeros(len(objects), bool)
    if house is not None:
        places = np.repeat(place[None], len(objects), axis=0)
        unseen = hidden(places, objects.xy, footprints=Footprints([house]))
    groups = [-1] * len(objects) if objects.groups is None else objects.groups.tolist()
    for row, (xy, code) in enumerate(zip(objects.xy, objects.codes.tolist(), strict=True)):
        dx, dy = xy - place
        distance = float(np.hypot(dx, dy))
        if unseen[row] or distance > (objects.taxonomy.by_code(code).range_m or 30.0):
            continue
        bearing = float(np.round(bearings(dx, dy), 9)) % 360.0
        number = groups[row] if groups[row] >= 0 else -1 - row
        points_of.setdefault((code, number), []).append((distance, bearing))
    things = []
    for (code, _), all_points in points_of.items():
        distance, bearing = min(all_points)
        away = [float(signed_degrees(other - bearing)) for _, other in all_points]
        things.append((bearing, distance, code, max(away) - min(away)))
    return sorted(things)


@settings(max_examples=25)
@given(st.lists(points, min_size=1, max_size=12), st.sampled_from([None, HOUSE]))
def test_a_cell_sees_the_nearest_visible_point_of_a_group_and_its_extent(
    things: list[tuple[float, float, tuple[int, int]]], house: shapely.Polygon | None
) -> None:
    objects = extended(*things)
    database = built(objects, house)
    views = visible_objects_in(database, np.arange(len(database)))
    extents = np.zeros(len(views.codes)) if views.extents is None else views.extents
    footprints = None if house is None else Footprints([house])
    exact = visible_objects_at(
        objects,
        database.xy,
        index=ObjectIndex(objects.xy),
        radius=30.0,
        footprints=footprints,
    )
    assert exact.offsets.tolist() == database.offsets.tolist()
    for cell, place in enumerate(database.xy):
        expected = nearest_points(objects, place, house)
        part = slice(*database.offsets[cell : cell + 2])
        columns = exact.bearings[part], exact.distances[part], exact.codes[part]
        assert list(zip(*(column.tolist() for column in columns), strict=True)) == [
            thing[:3] for thing in expected
        ]
        widths = [thing[3] for thing in expected]
        if exact.extents is not None:
            assert exact.extents[part].tolist() == pytest.approx(widths)
        assert np.abs(extents[part] - widths).max() <= 180.0 / 255 + 1e-9
        assert database.codes[part].tolist() == [thing[2] for thing in expected]


def test_a_rail_is_seen_at_its_nearest_point_as_wide_as_it_is() -> None:
    rail = [(x, 10.0, (230, 5)) for x in range(0, 100, 5)]
    objects = extended((50.0, -8.0, (3, -1)), *rail)
    place = CORNER + np.array([51.0, 0.0])
    view = visible_objects_at(objects, place[None], index=ObjectIndex(objects.xy), radius=30.0)
    assert sorted(objects.taxonomy.decode(view.codes)) == ["D", "é"]
    number = view.codes.tolist().index(230)
    assert view.distances[number] == pytest.approx(math.hypot(1.0, 10.0))
    ends = [math.degrees(math.atan2(x - 51.0, 10.0)) for x in (25.0, 75.0)]
    assert view.extents is not None
    assert view.extents[number] == pytest.approx(ends[1] - ends[0])
    assert view.extents[1 - number] == 0.0


def test_off_centre_views_have_each_extended_thing_once() -> None:
    rail = [(x, 28.0, (230, 5)) for x in range(0, 200, 5)]
    objects = extended((50.0, 2.0, (3, -1)), *rail)
    database = built(objects)
    cells = np.arange(len(database))
    points = np.array([[2.0, 2.0], [-2.0, -2.0]])
    views = visible_objects_off_centre(database, cells, points)
    counts = np.add.reduceat(views.codes == 230, views.offsets[:-1])
    own = np.add.reduceat(database.codes == 230, database.offsets[:-1])
    assert counts.tolist() == np.repeat(own, 2).tolist()
    assert views.extents is not None
    assert database.extents is not None
    assert views.extents.max() == database.extents.max() > 0.0


# --- Files ------------------------------------------------------------------------------------


def test_a_file_keeps_extents_and_letters_beyond_ascii(tmp_path: Path) -> None:
    database = built(extended(*[(5.0 * x, 9.0, (231, 0)) for x in range(9)], (3.0, 3.0, (3, -1))))
    save_database(database, tmp_path / "city.parquet")
    again = open_database(tmp_path / "city.parquet")
    assert_same(again, database)
    assert again.extents is not None
    assert database.extents is not None
    assert again.extents.tolist() == database.extents.tolist()
    types = pq.read_table(tmp_path / "city.parquet")["types"].to_pylist()
    assert types == [database.types(cell) for cell in range(len(database))]
    assert "ЖD" in types
    frame = database.to_geodataframe()
    assert frame["types"].tolist() == types
    assert frame["extents"].str.split().str.len().tolist() == database.lengths.tolist()


def specs_of(database: SignatureDatabase, path: Path) -> dict[str, object]:
    save_database(database, path)
    specs: dict[str, object] = json.loads(pq.read_schema(path).metadata[b"semsig"])
    return specs


def test_only_files_with_something_new_have_a_new_format(tmp_path: Path) -> None:
    path = tmp_path / "city.parquet"
    lamps = objects_of(
        (*CORNER, 3, "world", "1"),
        licenses=(Licence("World (CC0)", ("world",)),),
        taxonomy=Taxonomy((LAMP,)),
    )
    database = build_database(lamps)
    specs = specs_of(database, path)
    assert (specs["format"], specs["taxonomy"]) == (
        2,
        [{"code": 3, "symbol": "D", "name": "street_light", "title": "Street light"}],
    )
    assert open_database(path).taxonomy.by_code(3).family == "furniture"
    tower = ObjectClass(232, "T", "tower", "Tower", range_m=2000.0, tall=True)
    for taxonomy in (Taxonomy((LAMP, tower)), Taxonomy((LAMP, replace(RAIL, symbol="r")))):
        newer = replace(database, taxonomy=taxonomy)
        assert specs_of(newer, path)["format"] == 3
        assert open_database(path).taxonomy.to_list() == taxonomy.to_list()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(file, "FORMAT", 2)  # as in the version before
        with refused(DatabaseError, "another version of semsig", "build the database again"):
            open_database(path)


def test_a_file_that_lacks_the_extents_is_damaged(tmp_path: Path) -> None:
    database = built(extended(*[(5.0 * x, 9.0, (231, 0)) for x in range(9)]))
    path = tmp_path / "city.parquet"
    save_database(database, path)
    table = pq.read_table(path)
    pq.write_table(table.drop_columns(["extents"]), path)
    with refused(DatabaseError, "damaged", "build the database again"):
        open_database(path)
