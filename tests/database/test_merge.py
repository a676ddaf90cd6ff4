"""Merging: the result equals a build from the objects of both databases."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import shapely
from sentences import refused
from worlds import CODES, CORNER, TAXONOMY, assert_same, objects_of, surroundings

from semsig_gis.core import DatabaseError, GridSpec, SignatureSpec, Taxonomy
from semsig_gis.database import (
    ObjectStore,
    TileSpec,
    ViewpointSpec,
    build_database,
    build_tiles,
    merge_databases,
    open_database,
    open_store,
    save_database,
    save_with_store,
    store_path,
)
from semsig_gis.objects import Licence, save_objects

if TYPE_CHECKING:
    from pathlib import Path

    import geopandas as gpd

    from semsig_gis.database import ViewpointMode
    from semsig_gis.objects import StreetObjects

EAST = float(CORNER[0])
RANGES = zip((TAXONOMY.by_code(code).name for code in CODES), (45.0, 12.5), strict=False)
CLASSES = TAXONOMY.with_ranges(dict(RANGES))
# Rows of joined houses from west to east, across the border, with some gaps.
HOUSES = surroundings(
    *(
        shapely.transform(shapely.box(x, y, x + 11.96, y + 9), lambda xy: xy + CORNER)
        for y in (20, 75, 130)
        for x in range(0, 400, 12)
        if x % 60
    )
).to_crs("EPSG:2154")
STREETS = surroundings(
    *(
        shapely.transform(shapely.LineString([(x, y), (x + 100, y)]), lambda xy: xy + CORNER)
        for y in (50, 110)
        for x in (0, 100, 200, 300)
    ),
    half_width=[9.0, np.nan, 14.0, 6.0] * 2,
).to_crs("EPSG:2154")


def city(
    objects: StreetObjects,
    path: Path,
    mode: ViewpointMode,
    west: float,
    east: float,
    **specs: Any,  # noqa: ANN401
) -> Path:
    """Build the database of a strip of the town, with the shapes that begin in the strip."""

    def cut(table: gpd.GeoDataFrame) -> gpd.GeoDataFrame:
        x = table.geometry.bounds["minx"] - EAST
        return table[(x >= west) & (x < east)]

    part = dataclasses.replace(objects, table=cut(objects.table))
    around: dict[str, Any] = {
        "footprints": None if mode == "all" else cut(HOUSES),
        "streets": cut(STREETS) if mode == "streets" else None,
    }
    database = build_database(part, viewpoints=ViewpointSpec(mode=mode), **around, **specs)
    save_with_store(database, ObjectStore.of(part, **around), path)
    return path


@pytest.fixture
def objects() -> StreetObjects:
    rng = np.random.default_rng(7)
    places = np.round(rng.uniform((0, 0), (400, 160), (180, 2)) * 4) / 4
    codes = rng.choice(CODES[:6], 180)
    # At the border at 200 m: visible from 45 m, and no western object is nearer to the border.
    places[(places[:, 0] > 195) & (places[:, 0] < 200), 0] -= 5.0
    places[:2], codes[:2] = [(195, 85), (200, 85)], CODES[0]
    rows = zip(*(places + CORNER).T, codes, ["trees"] * 180, map(str, range(180)), strict=True)
    return objects_of(*rows, licenses=(Licence("A (CC0)", ("trees",)),), taxonomy=CLASSES)


@pytest.mark.parametrize("mode", ["all", "outdoor", "streets"])
@pytest.mark.parametrize(("end", "start"), [(200, 200), (230, 170), (120, 300), (400, 0)])
def test_a_merged_database_equals_a_build_from_both(
    objects: StreetObjects, tmp_path: Path, mode: ViewpointMode, end: float, start: float
) -> None:
    west = city(objects, tmp_path / "west.parquet", mode, 0, end)
    east = city(objects, tmp_path / "east.parquet", mode, start, 400)
    region, whole = tmp_path / "region.parquet", tmp_path / "whole.parquet"
    report = merge_databases(west, east, out=region)
    store = open_store(region)
    around = {"footprints": store.footprints, "streets": store.streets}
    save_database(
        build_database(store.objects, viewpoints=ViewpointSpec(mode=mode), **around), whole
    )
    assert region.read_bytes() == whole.read_bytes()
    x = objects.xy[:, 0] - EAST
    expected = objects.table[(x < end) | (x >= start)]
    assert sorted(store.objects.table["source_id"]) == sorted(expected["source_id"])
    assert report.shared_objects == ((x < end) & (x >= start)).sum()
    ids = [open_database(path).cell_ids for path in (west, east)]
    assert report.shared_cells == np.isin(ids[0], ids[1]).sum()
    assert (report.recomputed == 0) == (end == 120)
    assert (report.cells, report.objects) == (len(open_database(region)), len(expected))
    if start == end:
        town = city(objects, tmp_path / "town.parquet", mode, 0, 400)
        assert town.read_bytes() == region.read_bytes()


def test_tiles_are_merged_into_a_file(objects: StreetObjects, tmp_path: Path) -> None:
    west = city(objects, tmp_path / "west.parquet", "streets", 0, 200)
    east = city(objects, tmp_path / "east.parquet", "streets", 200, 400)
    store, tiles = open_store(east), tmp_path / "east"
    save_objects(store.objects, tmp_path / "objects.parquet")
    build_tiles(
        tmp_path / "objects.parquet",
        tiles,
        tile=TileSpec(100.0),
        viewpoints=ViewpointSpec(mode="streets"),
        buildings=store.footprints,
        streets=store.streets,
    )
    region, expected = tmp_path / "region.parquet", tmp_path / "expected.parquet"
    report = merge_databases(west, tiles, out=region)
    assert report == merge_databases(west, east, out=expected)
    assert_same(open_database(region), open_database(expected))


def test_databases_with_different_settings_are_not_merged(
    objects: StreetObjects, tmp_path: Path
) -> None:
    west = city(objects, tmp_path / "west.parquet", "all", 0, 200)
    out = tmp_path / "region.parquet"
    others = dataclasses.replace(objects, table=objects.table.to_crs("EPSG:32631"))
    other_classes = dataclasses.replace(objects, taxonomy=TAXONOMY)
    few_classes = dataclasses.replace(objects, taxonomy=Taxonomy(CLASSES.classes[:-5]))
    for words, part, mode, specs in (
        ("grid", objects, "all", {"grid": GridSpec(7.0)}),
        ("range or angle levels", objects, "all", {"spec": SignatureSpec(20.0)}),
        ("viewpoints", objects, "outdoor", {}),
        (
            "classes (18 and 18; not the same in both: alignment_tree, water_fountain)",
            other_classes,
            "all",
            {},
        ),
        ("classes (18 and 13; only the first has ", few_classes, "all", {}),
    ):
        east = city(part, tmp_path / "east.parquet", mode, 200, 400, **specs)  # type: ignore[arg-type]
        with refused(DatabaseError, f"differ in their {words}", "build both in the same way"):
            merge_databases(west, east, out=out)
    save_with_store(build_database(others), ObjectStore.of(others), tmp_path / "east.parquet")
    with refused(DatabaseError, "coordinate reference system"):
        merge_databases(west, tmp_path / "east.parquet", out=out)
    bare = tmp_path / "bare.parquet"
    save_database(open_database(west), bare)
    with refused(DatabaseError, "bare.parquet has no object store"):
        merge_databases(west, bare, out=out)
    with refused(DatabaseError, "nowhere.parquet does not exist"):
        merge_databases(west, "nowhere.parquet", out=out)
    assert not out.exists()
    assert not store_path(out).exists()
