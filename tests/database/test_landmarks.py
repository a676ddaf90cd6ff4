"""Landmarks: the cells that see them, what hides them, and equality of all ways to build."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sentences import refused
from worlds import CORNER, assert_same, objects_of

from semsig_gis.core import (
    GROUP,
    HEIGHT,
    GridSpec,
    InputError,
    ObjectClass,
    ObjectIndex,
    Taxonomy,
)
from semsig_gis.database import (
    Footprints,
    ObjectStore,
    TileSpec,
    build_database,
    build_tiles,
    merge_databases,
    open_database,
    open_store,
    save_with_store,
    update_database,
    update_tiles,
    visible_objects_at,
)
from semsig_gis.objects import Licence, StreetObjects, save_objects

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase

LAMP = ObjectClass(3, "D", "street_light", "Street light", family="furniture", range_m=25.0)
WALL = ObjectClass(230, "w", "wall", "Wall", family="barrier", shape="line", range_m=25.0)
TOWER = ObjectClass(232, "Я", "tower", "Tower", family="landmark", range_m=150.0, tall=True)
TAXONOMY = Taxonomy((LAMP, WALL, TOWER))
GRID = GridSpec(10.0, (float(CORNER[0]), float(CORNER[1])))
Thing = tuple[float, float, int, int, float]  # x, y, class code, group, height
coordinates = st.integers(0, 24).map(lambda number: 5.0 * number)
things = st.tuples(
    coordinates,
    coordinates,
    st.sampled_from([(3, -1), (230, 0), (230, 1), (232, -1)]),
    st.sampled_from([np.nan, 12.0, 60.0]),
).map(lambda thing: (thing[0], thing[1], *thing[2], thing[3] if thing[2][0] == 232 else np.nan))
houses = st.lists(
    st.tuples(coordinates, coordinates, st.sampled_from([np.nan, 4.0, 20.0])), max_size=4
)


def town(*rows: Thing, layer: str = "world") -> StreetObjects:
    """Return objects, with groups and heights if there are any."""
    points = [
        (CORNER[0] + x, CORNER[1] + y, code, layer, str(number))
        for number, (x, y, code, _, _) in enumerate(rows)
    ]
    groups = np.array([group for *_, group, _ in rows], np.int32)
    heights = np.array([height for *_, height in rows], np.float32)
    columns: dict[str, Any] = {}
    if (groups >= 0).any():
        columns[GROUP] = groups
    if not np.isnan(heights).all():
        columns[HEIGHT] = heights
    licenses = (Licence("World (CC0)", (layer,)),)
    return objects_of(*points, licenses=licenses, taxonomy=TAXONOMY, **columns)


def buildings(rows: list[tuple[float, float, float]]) -> gpd.GeoDataFrame | None:
    """Return houses of 8 m by 8 m at places, with their heights."""
    if not rows:
        return None
    shapes = [
        shapely.transform(
            shapely.box(x + 1.37, y + 1.37, x + 8.61, y + 8.61), lambda xy: xy + CORNER
        )
        for x, y, _ in rows
    ]
    heights = [height for *_, height in rows]
    return gpd.GeoDataFrame({HEIGHT: heights}, geometry=shapes, crs="EPSG:2154")


def is_hidden(
    place: NDArray[np.float64],
    tower: NDArray[np.float64],
    top: float,
    rows: gpd.GeoDataFrame | None,
) -> bool:
    """Whether a roof hides a landmark: by the first point of each house on the sight line."""
    if rows is None or np.isnan(top):
        return False
    line, start, end = (
        shapely.LineString([place, tower]),
        shapely.Point(place),
        shapely.Point(tower),
    )
    slope = (top - 1.6) / line.length if line.length else np.inf
    for shape, height in zip(rows.geometry, rows[HEIGHT], strict=True):
        if np.isnan(height) or shape.intersects(start) or shape.distance(end) <= 1.0:
            continue
        away = shapely.distance(start, shapely.intersection(shape, line))
        if away <= 150.0 and (height - 1.6) / away >= slope:
            return True
    return False


@settings(max_examples=10, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(things, min_size=1, max_size=6), houses)
def test_landmarks_are_seen_over_lower_roofs_up_to_100_m_from_an_object(
    rows: list[Thing], roofs: list[tuple[float, float, float]]
) -> None:
    objects, footprints = town(*rows), buildings(roofs)
    xy, tall = objects.xy, objects.codes == TOWER.code
    heights = np.full(len(xy), np.nan) if objects.heights is None else objects.heights
    grid = GridSpec(20.0, GRID.origin)
    database = build_database(objects, grid=grid, footprints=footprints)
    window = [(column, row) for column in range(-9, 16) for row in range(-9, 16)]
    towers_of = dict.fromkeys(window, 0)
    cells = zip(database.columns.tolist(), database.rows.tolist(), strict=True)
    for cell, place in enumerate(cells):
        codes = database.codes[database.offsets[cell] : database.offsets[cell + 1]]
        towers_of[place] = int((codes == TOWER.code).sum())
    for key, count in towers_of.items():
        centre = grid.viewpoints(*np.array([key]).T)[0]
        expected = sum(
            not is_hidden(centre, xy[row], float(heights[row]), footprints)
            for row in np.flatnonzero(tall & (np.hypot(*(xy - centre).T) <= 150.0))
        )
        inside = bool((np.hypot(*(xy - centre).T) <= 100.0).any())
        assert count == (expected if inside else 0)


def test_a_landmark_in_its_own_building_is_seen_and_a_near_roof_hides_it() -> None:
    church = buildings([(100.0, 100.0, 30.0), (60.0, 100.0, 10.0), (0.0, 100.0, 10.0)])
    tower = town((105.0, 105.0, 232, -1, 45.0), (0.0, 0.0, 3, -1, np.nan))
    places = CORNER + np.array([[30.0, 105.0], [58.0, 105.0], [-40.0, 105.0]])
    assert church is not None
    view = visible_objects_at(
        tower,
        places,
        index=ObjectIndex(tower.xy),
        radius=30.0,
        footprints=ObjectStore.of(tower, footprints=church).buildings_around(places, distance=30.0),
    )
    # The low house hides it from the second place only, which is near to it.
    assert view.lengths.tolist() == [1, 0, 1]
    unknown = town((105.0, 105.0, 232, -1, np.nan))
    view = visible_objects_at(
        unknown,
        places,
        index=ObjectIndex(unknown.xy),
        radius=30.0,
        footprints=Footprints.of(church),
    )
    assert view.lengths.tolist() == [1, 1, 1]


def test_heights_of_buildings_may_be_text() -> None:
    tower = town((105.0, 5.0, 232, -1, 20.0), (0.0, 0.0, 3, -1, np.nan))
    values: list[object] = ["12 m", "", "three storeys", None, np.inf, -3.0, 0, "9,5", 7]
    heights = [12.0, *[np.nan] * 6, 9.5, 7.0]
    rows = buildings([(10.0 * number, 0.0, 0.0) for number in range(len(values))])
    assert rows is not None
    texts, numbers = rows.assign(height=values), rows.assign(height=heights)
    assert_equal(*(build_database(tower, grid=GRID, footprints=part) for part in (texts, numbers)))
    stored = ObjectStore.of(tower, footprints=texts).footprints
    assert stored is not None
    np.testing.assert_array_equal(stored[HEIGHT], heights)


def assert_equal(first: SignatureDatabase, second: SignatureDatabase) -> None:
    assert_same(first, second)
    values = [part.extents for part in (first, second)]
    widths = [np.zeros(len(first.codes)) if extent is None else extent for extent in values]
    assert widths[0].tolist() == widths[1].tolist()


@settings(max_examples=2, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(things, min_size=2, max_size=9), st.integers(1, 8), houses)
def test_tiles_updates_and_merges_equal_a_build(
    rows: list[Thing], cut: int, roofs: list[tuple[float, float, float]]
) -> None:
    tower = (100.0, 80.0, 232, -1, 40.0)
    whole, footprints = town(tower, *rows), buildings(roofs)
    fewer = town(tower, *rows[: min(cut, len(rows) - 1)])
    options: dict[str, Any] = {"grid": GRID, "footprints": footprints}
    expected = build_database(whole, **options)
    with TemporaryDirectory() as name:
        folder = Path(name)
        for objects, file in ((whole, "whole"), (fewer, "fewer")):
            save_objects(objects, folder / f"{file}.parquet")
        for file in ("whole", "fewer"):
            build_tiles(
                folder / f"{file}.parquet",
                folder / file,
                tile=TileSpec(120.0),
                grid=GRID,
                buildings=footprints,
            )
        assert_equal(open_database(folder / "whole"), expected)
        update_tiles(folder / "fewer", folder / "whole.parquet")
        assert_equal(open_database(folder / "fewer"), expected)
    before = build_database(fewer, **options), ObjectStore.of(fewer, footprints=footprints)
    updated, _, report = update_database(*before, whole)
    assert_equal(updated, expected)
    assert report.cells == len(expected)
    updated, _, _ = update_database(expected, ObjectStore.of(whole, footprints=footprints), fewer)
    assert_equal(updated, before[0])


def test_merged_databases_with_landmarks_equal_a_build(tmp_path: Path) -> None:
    west = town((0.0, 0.0, 3, -1, np.nan), (10.0, 20.0, 232, -1, np.nan), layer="west")
    east = town(
        (300.0, 250.0, 3, -1, np.nan),
        (90.0, 240.0, 232, -1, np.nan),
        *[(100.0 + 5.0 * number, 200.0, 230, 0, np.nan) for number in range(9)],
        layer="east",
    )
    for objects, file in ((west, "west"), (east, "east")):
        database = build_database(objects, grid=GRID)
        save_with_store(database, ObjectStore.of(objects), tmp_path / f"{file}.parquet")
    out = tmp_path / "both.parquet"
    merge_databases(tmp_path / "west.parquet", tmp_path / "east.parquet", out=out)
    both = open_store(out).objects
    assert len(both) == len(west) + len(east)
    assert_equal(open_database(out), build_database(both, grid=GRID))


def test_the_first_landmark_needs_a_new_database() -> None:
    lamps = town((0.0, 0.0, 3, -1, np.nan))
    lamps = StreetObjects(lamps.table, Taxonomy((LAMP,)), lamps.licenses)
    with_tower = town((0.0, 0.0, 3, -1, np.nan), (5.0, 5.0, 232, -1, np.nan))
    with refused(InputError, "tower", "150 m", "build the database again"):
        update_database(build_database(lamps), ObjectStore.of(lamps), with_tower)
