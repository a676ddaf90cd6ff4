from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sentences import refused
from worlds import CODES, CORNER, TAXONOMY, World, assert_same, random_town, worlds

from semsig_gis.core.errors import EmptyResultError, InputError
from semsig_gis.core.grid import GridSpec
from semsig_gis.core.signature import SignatureSpec
from semsig_gis.database.build import build_database
from semsig_gis.database.file import open_database
from semsig_gis.database.occlusion import TOLERANCE_M
from semsig_gis.database.tiles import TileSpec, build_tiles, touched_tiles
from semsig_gis.database.viewpoints import ViewpointSpec
from semsig_gis.objects.surroundings import read_surroundings, save_surroundings
from semsig_gis.objects.table import save_objects

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.database.viewpoints import Mode


def tiled(world: World, side: float, folder: Path, **options: Any) -> SignatureDatabase:  # noqa: ANN401
    """Build a world in tiles and open what was written."""
    save_objects(world.street_objects, folder / "objects.parquet")
    build_tiles(
        folder / "objects.parquet",
        folder / "city",
        tile=TileSpec(side),
        grid=GridSpec(world.step, world.origin),
        spec=SignatureSpec(world.radius, world.levels),
        **options,
    )
    inputs = {"objects", "houses", "streets"}
    assert {path.stem for path in folder.iterdir()} <= inputs | {"city"}
    return open_database(folder / "city")


# --- The sides of tiles -----------------------------------------------------------------------


def test_a_tile_is_so_many_whole_cells() -> None:
    assert TileSpec().cells(GridSpec()) == 200
    assert TileSpec(104.0).cells(GridSpec(step=10.0)) == 10
    assert TileSpec(1.0).cells(GridSpec(step=10.0)) == 1


@pytest.mark.parametrize("side", [0.0, -5.0, float("nan"), float("inf")])
def test_a_side_that_is_no_length_is_refused(side: float) -> None:
    with refused(InputError, "side of a tile", "above 0"):
        TileSpec(side)


# --- Which tiles ------------------------------------------------------------------------------


@given(world=worlds(), side=st.integers(1, 12))
@settings(max_examples=40)
def test_every_cell_lies_in_a_tile_that_is_touched(world: World, side: int) -> None:
    grid = GridSpec(world.step, world.origin)
    with tempfile.TemporaryDirectory() as folder:
        save_objects(world.street_objects, f"{folder}/objects.parquet")
        tiles = touched_tiles(f"{folder}/objects.parquet", grid=grid, side=side, reach=world.radius)
    assert len(set(tiles)) == len(tiles)
    try:
        database = world.database
    except EmptyResultError:
        return
    columns, rows = database.columns // side, database.rows // side
    assert set(zip(columns.tolist(), rows.tolist(), strict=True)) <= set(tiles)


def test_the_tiles_with_most_objects_come_first(tmp_path: Path) -> None:
    west, north = CORNER + 50.0
    objects = [
        (west, north, CODES[0]),
        (west + 400, north, CODES[0]),
        (west + 401, north, CODES[0]),
    ]
    save_objects(World(tuple(objects)).street_objects, tmp_path / "objects.parquet")
    tiles = touched_tiles(tmp_path / "objects.parquet", grid=GridSpec(), side=10, reach=30.0)
    assert tiles == [(7656, 62750), (7652, 62750)]


def test_tiles_that_are_too_small_or_too_many_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "objects.parquet"
    save_objects(random_town().street_objects, path)
    with refused(InputError, "tile of 1 m", "range of 30 m", "at least 1.875 m"):
        touched_tiles(path, grid=GridSpec(step=1.0), side=1, reach=30.0)
    monkeypatch.setattr("semsig_gis.database.tiles.MOST_TILES", 3)
    with refused(InputError, "tiles of 20 m", "more than 3"):
        touched_tiles(path, grid=GridSpec(), side=2, reach=30.0)


# --- The same as in one piece -----------------------------------------------------------------


@given(world=worlds(), side=st.sampled_from([5.0, 30.0, 77.0, 1000.0]))
@settings(max_examples=25, suppress_health_check=[HealthCheck.too_slow])
def test_tiles_are_the_same_as_the_whole(world: World, side: float) -> None:
    # Ranges go up to 30 m, which is more than some tiles.
    with tempfile.TemporaryDirectory() as folder:
        try:
            whole = world.database
        except EmptyResultError:
            with refused(EmptyResultError, "no cell sees", "range", "larger"):
                tiled(world, side, Path(folder))
            return
        assert_same(tiled(world, side, Path(folder)), whole)


def test_a_range_larger_than_a_tile_and_a_step_larger_than_the_area_work(tmp_path: Path) -> None:
    town = random_town()
    for number, world in enumerate(
        (
            World(town.objects, radius=150.0),  # the town is 200 m wide
            World(town.objects, step=5_000.0, radius=5_000.0),
        )
    ):
        folder = tmp_path / str(number)
        assert_same(tiled(world, 100.0, folder), world.database)


def houses_and_streets() -> tuple[gpd.GeoDataFrame, gpd.GeoDataFrame]:
    """Return houses wall to wall, in two parts, invalid and flat, and streets of some widths."""
    rng = np.random.default_rng(3)
    shapes: list[shapely.Geometry] = []
    for south in (10, 60, 110, 160):
        west = 0.0
        while west < 190:
            width, depth = rng.uniform(4, 14), rng.uniform(8, 20)
            shapes.append(shapely.box(west, south, west + width, south + depth))
            west += width + (rng.uniform(0, 6) if rng.random() < 0.3 else 0.04)
    shapes.append(shapely.MultiPolygon([shapely.box(2, 40, 8, 50), shapely.box(150, 40, 160, 52)]))
    bow = [(100, 40), (110, 50), (110, 40), (100, 50)]
    shapes.append(shapely.Polygon(bow))
    shapes.append(shapely.Polygon([(20, 40), (25, 40), (20, 40)]))  # flat
    lines = [shapely.LineString([(-20, y), (220, y)]) for y in (5, 55, 108, 155)]

    def placed(given: Sequence[shapely.Geometry], **columns: object) -> gpd.GeoDataFrame:
        moved = [shapely.transform(shape, lambda xy: xy + CORNER) for shape in given]
        return gpd.GeoDataFrame(columns, geometry=moved, crs="EPSG:2154")

    houses, streets = placed(shapes), placed(lines, half_width=[6.0, np.nan, 17.0, 3.0])
    houses.attrs["licenses"] = ["City (CC0): houses"]
    streets.attrs["licenses"] = ["Roads (OGL): lanes"]
    return houses, streets


@pytest.mark.parametrize("mode", ["all", "outdoor", "streets"])
@pytest.mark.parametrize("suffix", [".parquet", ".gpkg"])
def test_tiles_with_buildings_and_streets_are_the_same_as_the_whole(
    tmp_path: Path,
    mode: Mode,
    suffix: str,
) -> None:
    town = random_town()
    # A lamp where there is no building and no street near.
    town = World((*town.objects, (CORNER[0] + 900, CORNER[1] + 900, CODES[0])))
    houses, streets = houses_and_streets()
    viewpoints = ViewpointSpec(mode=mode, width=5.0)
    for table, name in ((houses, "houses"), (streets, "streets")):
        if suffix == ".parquet":
            save_surroundings(table, tmp_path / f"{name}.parquet")
        else:
            table.to_file(tmp_path / f"{name}.gpkg")
    found = tiled(
        town,
        30.0,
        tmp_path,
        viewpoints=viewpoints,
        buildings=tmp_path / f"houses{suffix}",
        streets=tmp_path / f"streets{suffix}",
    )
    # Of other files than Parquet, no widths are read.
    whole = build_database(
        town.street_objects,
        viewpoints=viewpoints,
        footprints=read_surroundings(
            tmp_path / f"houses{suffix}", role="buildings", crs="EPSG:2154"
        ),
        streets=read_surroundings(tmp_path / f"streets{suffix}", role="streets", crs="EPSG:2154"),
    )
    assert_same(found, whole)
    assert found.viewpoints == whole.viewpoints == viewpoints
    assert found.occlusion == whole.occlusion == TOLERANCE_M
    assert len(found) < len(town.database) or mode == "all"


def test_a_wall_whose_neighbour_is_far_hides_as_in_the_whole(tmp_path: Path) -> None:
    # A long house: its core is one piece only through a neighbour at the other end, three tiles
    # away. From inside its near end, its far side across the yard must not hide.
    thin, long = 0.8, 130.0
    house = shapely.Polygon(
        [
            (0, 0),
            (long, 0),
            (long, 20),
            (0, 20),
            (0, 14),
            (long - thin, 14),
            (long - thin, 6),
            (0, 6),
        ]
    )
    neighbour = shapely.box(long, -10, long + 10, 30)
    lamps = tuple((CORNER[0] + x, CORNER[1] + 25.0, CODES[0]) for x in (5.0, 15.0, 25.0))
    houses = gpd.GeoDataFrame(
        geometry=[shapely.transform(one, lambda xy: xy + CORNER) for one in (house, neighbour)],
        crs="EPSG:2154",
    )
    save_surroundings(houses, tmp_path / "houses.parquet")
    world = World(lamps)
    found = tiled(world, 30.0, tmp_path, buildings=tmp_path / "houses.parquet")
    assert_same(found, build_database(world.street_objects, footprints=houses))
    alone = build_database(world.street_objects, footprints=houses.iloc[:1])
    assert len(alone) != len(found)  # or nothing would have been shown


def test_ranges_of_classes_are_kept(tmp_path: Path) -> None:
    ranged = [item for item in TAXONOMY.classes if item.range_m is not None]
    code = ranged[0].code if ranged else CODES[0]
    world = World(tuple((x, y, code) for x, y, _ in random_town().objects))
    assert_same(tiled(world, 40.0, tmp_path), world.database)
