"""Tiles: their plan, inputs and results, resumed runs, and equality with the whole database."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow.parquet as pq
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sentences import refused
from worlds import CODES, CORNER, World, assert_same, worlds

from semsig_gis.core import (
    CrsError,
    DatabaseError,
    EmptyResultError,
    GridSpec,
    InputError,
    SignatureSpec,
    SourceError,
    resources,
)
from semsig_gis.database import (
    MANIFEST,
    TOLERANCE_M,
    Footprints,
    TileSpec,
    ViewpointSpec,
    begin_run,
    build_database,
    build_tiles,
    describe_part,
    finished_tiles,
    open_database,
    part_name,
    plan_tiles,
    publish_tiles,
    save_database,
    tiles,
    touched_tiles,
)
from semsig_gis.objects import open_objects, read_surroundings, save_objects, save_surroundings

if TYPE_CHECKING:
    from semsig_gis.core import SemsigError
    from semsig_gis.database import PartFile, SignatureDatabase, TilePlan, ViewpointMode


def placed(*shapes: shapely.Geometry, **columns: object) -> gpd.GeoDataFrame:
    """Return shapes in the town, in its CRS."""
    placed_shapes = [shapely.transform(shape, lambda xy: xy + CORNER) for shape in shapes]
    return gpd.GeoDataFrame(columns, geometry=placed_shapes, crs="EPSG:2154")


def tiled(world: World, side: float, folder: Path, **options: Any) -> SignatureDatabase:  # noqa: ANN401
    """Build a world in tiles and open the result."""
    save_objects(world.street_objects, folder / "objects.parquet")
    build_tiles(
        folder / "objects.parquet",
        folder / "city",
        tile=TileSpec(side),
        grid=GridSpec(world.step, world.origin),
        spec=SignatureSpec(world.radius, world.levels),
        **options,
    )
    assert {path.stem for path in folder.iterdir()} <= {"objects", "buildings", "streets", "city"}
    return open_database(folder / "city")


def test_the_side_of_a_tile_is_rounded_to_cells() -> None:
    assert TileSpec().cells(GridSpec()) == 200
    assert TileSpec(104.0).cells(GridSpec(step=10.0)) == 10
    assert TileSpec(1.0).cells(GridSpec(step=10.0)) == 1
    for side in (0.0, -5.0, float("nan"), float("inf")):
        with refused(InputError, "side of a tile", "from 1"):
            TileSpec(side)


def test_the_tiles_with_most_objects_come_first(tmp_path: Path) -> None:
    west, north = CORNER + 50.0
    world = World(tuple((west + east, north, CODES[0]) for east in (0, 400, 401)))
    save_objects(world.street_objects, tmp_path / "objects.parquet")
    tiles = touched_tiles(tmp_path / "objects.parquet", grid=GridSpec(), side=10, reach=30.0)
    assert tiles == [(7656, 62750), (7652, 62750)]


def test_tiles_that_are_too_small_or_too_many_are_refused(
    objects_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with refused(InputError, "tile of 1 m", "range of 30 m", "at least 1.875 m"):
        touched_tiles(objects_file, grid=GridSpec(step=1.0), side=1, reach=30.0)
    monkeypatch.setattr("semsig_gis.database.tiles.MOST_TILES", 3)
    with refused(InputError, "tiles of 20 m", "more than 3"):
        touched_tiles(objects_file, grid=GridSpec(), side=2, reach=30.0)


@given(world=worlds(), side=st.sampled_from([12.0, 30.0, 77.0, 1000.0]))
@settings(suppress_health_check=[HealthCheck.too_slow])
def test_tiles_equal_the_whole_database(world: World, side: float) -> None:
    # Ranges go up to 40 m, more than some tiles.
    with tempfile.TemporaryDirectory() as folder:
        try:
            whole = world.database
        except EmptyResultError:
            with refused(EmptyResultError, "no cell sees", "range", "larger"):
                tiled(world, side, Path(folder))
            return
        assert_same(tiled(world, side, Path(folder)), whole)


def houses_and_streets() -> dict[str, gpd.GeoDataFrame]:
    """Return houses: joined, in two parts, invalid and flat; and streets with widths."""
    rng = np.random.default_rng(3)
    shapes: list[shapely.Geometry] = []
    for south in (10, 60, 110, 160):
        west = 0.0
        while west < 190:
            width, depth = rng.uniform(4, 14), rng.uniform(8, 20)
            shapes.append(shapely.box(west, south, west + width, south + depth))
            west += width + (rng.uniform(0, 6) if rng.random() < 0.3 else 0.04)
    shapes.append(shapely.MultiPolygon([shapely.box(2, 40, 8, 50), shapely.box(150, 40, 160, 52)]))
    shapes.append(shapely.Polygon([(100, 40), (110, 50), (110, 40), (100, 50)]))
    shapes.append(shapely.Polygon([(20, 40), (25, 40), (20, 40)]))  # flat
    lines = [shapely.LineString([(-20, y), (220, y)]) for y in (5, 55, 108, 155)]
    houses, streets = placed(*shapes), placed(*lines, half_width=[6.0, np.nan, 17.0, 3.0])
    houses.attrs["licenses"] = ["City (CC0): houses"]
    streets.attrs["licenses"] = ["Roads (OGL): lanes"]
    return {"buildings": houses, "streets": streets}


@pytest.mark.parametrize(
    ("mode", "suffix"),
    [("all", ".parquet"), ("outdoor", ".parquet"), ("streets", ".parquet"), ("streets", ".gpkg")],
)
def test_tiles_with_buildings_and_streets_equal_the_whole_database(
    town: World, tmp_path: Path, mode: ViewpointMode, suffix: str
) -> None:
    # A lamp where there is no building and no street near.
    town = World((*town.objects, (CORNER[0] + 900, CORNER[1] + 900, CODES[0])))
    viewpoints = ViewpointSpec(mode=mode, width=5.0)
    files, tables = {}, {}
    for role, table in houses_and_streets().items():
        files[role] = tmp_path / f"{role}{suffix}"
        save = save_surroundings if suffix == ".parquet" else gpd.GeoDataFrame.to_file
        save(table, files[role])
        # Widths are read only from Parquet files.
        tables[role] = read_surroundings(files[role], role=role, crs="EPSG:2154")  # type: ignore[arg-type]
    result = tiled(town, 50.0, tmp_path, viewpoints=viewpoints, **files)
    whole = build_database(
        town.street_objects,
        viewpoints=viewpoints,
        footprints=tables["buildings"],
        streets=tables["streets"],
    )
    assert_same(result, whole)
    assert (result.viewpoints, result.occlusion) == (viewpoints, TOLERANCE_M)
    assert len(result) < len(town.database) or mode == "all"
    covered = Footprints(tables["buildings"].geometry.to_numpy()).cover(result.xy)
    assert covered.any() == (mode == "all")


def test_tables_and_files_of_surroundings_give_equal_parts(
    objects_file: Path, tmp_path: Path
) -> None:
    tables: dict[str, Any] = houses_and_streets()
    files: dict[str, Any] = {role: tmp_path / f"{role}.parquet" for role in tables}
    for role, table in tables.items():
        save_surroundings(table, files[role])
    spec: dict[str, Any] = {"tile": TileSpec(100.0), "viewpoints": ViewpointSpec(mode="streets")}
    by_table = build_tiles(objects_file, tmp_path / "new" / "tables", **tables, **spec)
    by_file = build_tiles(objects_file, tmp_path / "files", **spec, **files)
    assert [part.sha256 for part in by_table.parts] == [part.sha256 for part in by_file.parts]
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["tables"]
    with refused(InputError, "the table contains a Polygon", "a table of lines"):
        build_tiles(objects_file, tmp_path / "none", streets=tables["buildings"])


def test_footprints_joined_far_away_hide_as_in_the_whole_database(tmp_path: Path) -> None:
    # A long house: its core is in one piece only because of a neighbour at the other end, three
    # tiles away. Seen from inside its near end, its far side across the yard must not hide.
    house = shapely.box(0, 0, 130, 20) - shapely.box(0, 6, 129.2, 14)
    houses = placed(house, shapely.box(130, -10, 140, 30))
    save_surroundings(houses, tmp_path / "buildings.parquet")
    world = World(tuple((CORNER[0] + x, CORNER[1] + 25.0, CODES[0]) for x in (5.0, 15.0, 25.0)))
    result = tiled(world, 30.0, tmp_path, buildings=tmp_path / "buildings.parquet")
    assert_same(result, build_database(world.street_objects, footprints=houses))
    without_neighbour = build_database(world.street_objects, footprints=houses.iloc[:1])
    assert len(without_neighbour) != len(result)  # the neighbour matters


HOUSES = placed(shapely.box(0, 0, 9, 9))
STREETS = placed(
    *(shapely.LineString([(0, y), (9, y)]) for y in (0, 5, 10)), half_width=[4.0, np.nan, 21.0]
)
ALONG = ViewpointSpec(mode="streets", width=5.0)


def plan(objects_file: Path, **options: Any) -> TilePlan:  # noqa: ANN401
    options = {"grid": GridSpec(), "viewpoints": ViewpointSpec(), **options}
    out = objects_file.with_name("city")
    return plan_tiles(objects_file, out, tile=TileSpec(50.0), spec=SignatureSpec(), **options)


def test_files_with_bounds_are_copied_unchanged(objects_file: Path, tmp_path: Path) -> None:
    houses, streets = tmp_path / "houses.parquet", tmp_path / "streets.parquet"
    save_surroundings(HOUSES, houses)
    save_surroundings(STREETS, streets)
    tile_plan = plan(objects_file, buildings=houses, streets=streets, viewpoints=ALONG)
    inputs = tmp_path / "city.partial" / "_inputs"
    assert tile_plan.objects.read_bytes() == objects_file.read_bytes()
    for name, file in (("buildings", houses), ("streets", streets)):
        assert getattr(tile_plan, name) == inputs / f"{name}.parquet"
        assert getattr(tile_plan, name).read_bytes() == file.read_bytes()
    assert tile_plan.folder == tmp_path / "city.partial"
    assert (tile_plan.side, tile_plan.reach, tile_plan.street_reach) == (5, 30.0, 21.0)
    assert tile_plan.box((15, -2), 3.0) == (747.0, -103.0, 803.0, -47.0)


def test_streets_that_no_viewpoint_needs_are_kept_for_maps(
    objects_file: Path, tmp_path: Path
) -> None:
    streets = tmp_path / "streets.parquet"
    save_surroundings(STREETS, streets)
    tile_plan = plan(objects_file, streets=streets)
    assert tile_plan.streets is None
    copy = tmp_path / "city.partial" / "_inputs" / "streets.parquet"
    assert copy.read_bytes() == streets.read_bytes()


def test_other_files_are_copied_once(objects_file: Path, town: World, tmp_path: Path) -> None:
    HOUSES.to_parquet(tmp_path / "plain.parquet")  # without bounds
    save_surroundings(HOUSES.to_crs("EPSG:4326"), tmp_path / "degrees.parquet")
    STREETS.drop(columns="half_width").to_file(tmp_path / "streets.gpkg")
    pq.write_table(pq.read_table(objects_file).drop_columns(["bbox"]), objects_file)
    inputs = tmp_path / "city.partial" / "_inputs"
    for name in ("plain", "degrees"):
        options = {"buildings": tmp_path / f"{name}.parquet", "viewpoints": ALONG}
        tile_plan = plan(objects_file, streets=tmp_path / "streets.gpkg", **options)
        assert tile_plan.objects == inputs / "objects.parquet"
        assert tile_plan.buildings == inputs / "buildings.parquet"
        assert tile_plan.streets == inputs / "streets.parquet"
        assert tile_plan.street_reach == 5.0
        assert len(open_objects(tile_plan.objects)) == len(town.objects)
        times = {path: path.stat().st_mtime_ns for path in inputs.iterdir()}
        assert plan(objects_file, streets=tmp_path / "streets.gpkg", **options) == tile_plan
        assert {path: path.stat().st_mtime_ns for path in inputs.iterdir()} == times


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"viewpoints": ViewpointSpec(mode="outdoor")}, InputError, ["need the buildings"]),
        ({"viewpoints": ViewpointSpec(mode="streets")}, InputError, ["need the streets"]),
        ({"grid": GridSpec(step=0.01)}, InputError, ["step of 0.01 m", "too small"]),
        ({"buildings": "nowhere.gpkg"}, SourceError, ["nowhere.gpkg", "does not exist"]),
        ({"buildings": "empty.parquet"}, SourceError, ["empty.parquet", "damaged"]),
        ({"buildings": "bare.parquet"}, SourceError, ["bare.parquet", "coordinate reference"]),
        ({"buildings": "lines.parquet"}, InputError, ["lines.parquet", "LineString"]),
        ({"buildings": "houses.geojson"}, (InputError, CrsError), []),  # no CRS is guessed
    ],
)
def test_invalid_inputs_are_refused_before_the_run(
    objects_file: Path,
    tmp_path: Path,
    options: dict[str, Any],
    error: type[SemsigError],
    words: list[str],
) -> None:
    (tmp_path / "empty.parquet").touch()
    HOUSES.set_crs(None, allow_override=True).to_parquet(tmp_path / "bare.parquet")
    STREETS.to_parquet(tmp_path / "lines.parquet")
    (tmp_path / "houses.geojson").write_text('{"type": "FeatureCollection", "features": []}')
    if "buildings" in options:
        options = {"buildings": tmp_path / options["buildings"]}
    with refused(error, *words):
        plan(objects_file, **options)
    with refused(DatabaseError, "none.parquet", "does not exist"):
        plan(tmp_path / "none.parquet")
    assert not (tmp_path / "city.partial").exists()


def test_a_run_identifies_its_inputs_by_content(objects_file: Path, tmp_path: Path) -> None:
    HOUSES.to_file(tmp_path / "houses.shp")
    options = {"buildings": tmp_path / "houses.shp"}
    marker = plan(objects_file, **options).folder / "tile_0_0.empty"
    marker.touch()
    for path in tmp_path.glob("houses.*"):
        path.write_bytes(path.read_bytes())  # newer, with the same content
    assert plan(objects_file, **options).folder == marker.parent
    (tmp_path / "houses.prj").write_text((tmp_path / "houses.prj").read_text() + " ")
    with refused(InputError, "inputs, buildings", "delete that folder"):
        plan(objects_file, **options)


RECIPE = {"grid": {"step": 10.0, "origin": (0.0, 0.0)}, "inputs": {"objects": "abc"}}


def build(folder: Path, database: SignatureDatabase) -> PartFile:
    path = folder / part_name((0, 0))
    save_database(database, path)
    (folder / part_name((0, 1))).with_suffix(".empty").touch()
    return describe_part((0, 0), database, path)


def test_finished_tiles_are_reused_and_damaged_ones_deleted(
    database: SignatureDatabase, tmp_path: Path
) -> None:
    folder = begin_run(tmp_path / "new" / "city", RECIPE)
    part = build(folder, database)
    assert finished_tiles(folder, [(0, 0), (0, 1), (7, 7)]) == {(0, 0): part, (0, 1): None}
    path = folder / part_name((0, 0))
    path.write_bytes(path.read_bytes()[:-20])
    assert finished_tiles(folder, [(0, 0), (0, 1)]) == {(0, 1): None}
    assert not path.exists()


def test_a_finished_database_replaces_the_old_one(
    database: SignatureDatabase, tmp_path: Path
) -> None:
    target, link = tmp_path / "city", tmp_path / "latest"
    save_database(database, target)  # a file
    link.symlink_to(target)
    for place, cells in (
        (target, database),
        (target, database.select(slice(20))),
        (link, database),
    ):
        folder = begin_run(place, RECIPE)
        parts = [build(folder, cells)]
        (folder / "_inputs").mkdir()
        (folder / "_inputs" / "buildings.parquet").touch()
        assert publish_tiles(folder, parts).cells == len(cells)
        names = {MANIFEST, "_inputs", part_name((0, 0))}
        assert {path.name for path in target.iterdir()} == names
        assert len(open_database(target)) == len(cells)
        assert {path.name for path in tmp_path.iterdir()} == {"city", "latest"}
    assert link.is_symlink()


def test_folders_with_other_files_are_never_replaced(
    database: SignatureDatabase, tmp_path: Path
) -> None:
    target = tmp_path / "home"
    target.mkdir()
    (target / "letter.txt").touch()
    with refused(InputError, "'letter.txt'", "not part of a signature database"):
        begin_run(target, RECIPE)
    (target / "letter.txt").unlink()
    folder = begin_run(target, RECIPE)
    publish_tiles(folder, [build(folder, database)])
    (target / "notes.txt").touch()  # next to the parts
    with refused(InputError, "'notes.txt'", "move that file elsewhere"):
        begin_run(target, RECIPE)
    assert {path.name for path in target.iterdir()} == {MANIFEST, part_name((0, 0)), "notes.txt"}
    (tmp_path / "city.partial").mkdir()
    (tmp_path / "city.partial" / "letter.txt").touch()
    with refused(InputError, "city.partial", "'letter.txt'", "no unfinished run"):
        begin_run(tmp_path / "city", RECIPE)
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
        with refused(InputError, "is a device or a pipe"):
            begin_run(tmp_path / "pipe", RECIPE)


def test_tiles_that_exceed_memory_are_refused(
    objects_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(resources, "free_memory", lambda: 150_000_000)
    build_tiles(objects_file, tmp_path / "city", tile=TileSpec(80.0))
    with refused(InputError, "by each of 2 processes", "0.2 GB", "smaller tiles"):
        build_tiles(objects_file, tmp_path / "other", tile=TileSpec(80.0), workers=2)
    assert not (tmp_path / "other.partial").exists()
    monkeypatch.setattr(tiles, "TILE_S", 1e6)
    with pytest.warns(UserWarning, match="building tiles will take about"):
        build_tiles(objects_file, tmp_path / "city", tile=TileSpec(80.0))


@pytest.mark.parametrize("fails", [1, 2])
def test_a_failed_rename_leaves_the_old_database_and_the_run(
    database: SignatureDatabase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: int
) -> None:
    target, rename, calls = tmp_path / "city", Path.rename, []
    folder = begin_run(target, RECIPE)
    publish_tiles(folder, [build(folder, database)])
    folder = begin_run(target, RECIPE)
    part = build(folder, database.select(slice(20)))

    def refuse(self: Path, to: Path) -> Path:
        calls.append(to)
        if len(calls) == fails:
            raise PermissionError(13, "Permission denied", str(self))
        return rename(self, to)

    with monkeypatch.context() as patch:
        patch.setattr("semsig_gis.storage.whole.exchange", lambda *_: False)
        patch.setattr(Path, "rename", refuse)
        with refused(InputError, str(target), "Permission denied", "run the same command again"):
            publish_tiles(folder, [part])
    assert_same(open_database(target), database)
    # The same command resumes the run.
    assert finished_tiles(begin_run(target, RECIPE), [(0, 0)]) == {(0, 0): part}
    publish_tiles(folder, [part])
    assert len(open_database(target)) == 20
    assert [path.name for path in tmp_path.iterdir()] == ["city"]
