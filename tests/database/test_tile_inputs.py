from __future__ import annotations

from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow.parquet as pq
import pytest
import shapely
from sentences import refused
from worlds import CORNER, random_town

from semsig_gis.core.errors import CrsError, DatabaseError, InputError, SourceError
from semsig_gis.core.grid import GridSpec
from semsig_gis.core.signature import SignatureSpec
from semsig_gis.database.tiles import TileSpec, plan_tiles
from semsig_gis.database.viewpoints import ViewpointSpec
from semsig_gis.objects.surroundings import save_surroundings
from semsig_gis.objects.table import open_objects, save_objects

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.core.errors import SemsigError
    from semsig_gis.database.tiles import TilePlan

HOUSES = gpd.GeoDataFrame(
    geometry=[shapely.transform(shapely.box(0, 0, 9, 9), lambda xy: xy + CORNER)], crs="EPSG:2154"
)
STREETS = gpd.GeoDataFrame(
    {"half_width": [4.0, np.nan, 21.0]},
    geometry=[
        shapely.transform(shapely.LineString([(0, y), (9, y)]), lambda xy: xy + CORNER)
        for y in (0, 5, 10)
    ],
    crs="EPSG:2154",
)


def plan(folder: Path, **options: Any) -> TilePlan:  # noqa: ANN401
    given = {
        "tile": TileSpec(50.0),
        "grid": GridSpec(),
        "spec": SignatureSpec(),
        "viewpoints": ViewpointSpec(),
        **options,
    }
    return plan_tiles(folder / "objects.parquet", folder / "city", **given)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    save_objects(random_town().street_objects, tmp_path / "objects.parquet")
    return tmp_path


def test_files_that_can_be_read_by_box_are_used_where_they_are(folder: Path) -> None:
    save_surroundings(HOUSES, folder / "houses.parquet")
    save_surroundings(STREETS, folder / "streets.parquet")
    found = plan(
        folder,
        buildings=folder / "houses.parquet",
        streets=folder / "streets.parquet",
        viewpoints=ViewpointSpec(mode="streets", width=5.0),
    )
    assert found.objects == folder / "objects.parquet"
    assert found.buildings == folder / "houses.parquet"
    assert found.streets == folder / "streets.parquet"
    assert found.folder == folder / "city.partial"
    assert (found.side, found.reach, found.street_reach) == (5, 30.0, 21.0)
    assert found.box((15, -2), 3.0) == (747.0, -103.0, 803.0, -47.0)


def test_other_files_are_copied_once(folder: Path) -> None:
    HOUSES.to_parquet(folder / "plain.parquet")  # without bounds
    STREETS.drop(columns="half_width").to_file(folder / "streets.gpkg")
    pq.write_table(
        pq.read_table(folder / "objects.parquet").drop_columns(["bbox"]),
        folder / "objects.parquet",
    )
    options = {
        "buildings": folder / "plain.parquet",
        "streets": folder / "streets.gpkg",
        "viewpoints": ViewpointSpec(mode="streets", width=5.0),
    }
    found = plan(folder, **options)
    inputs = folder / "city.partial" / "_inputs"
    assert found.objects == inputs / "objects.parquet"
    assert found.buildings == inputs / "buildings.parquet"
    assert found.streets == inputs / "streets.parquet"
    assert found.street_reach == 5.0
    assert len(open_objects(found.objects)) == len(random_town().objects)
    times = {path: path.stat().st_mtime_ns for path in inputs.iterdir()}
    assert plan(folder, **options) == found
    assert {path: path.stat().st_mtime_ns for path in inputs.iterdir()} == times


def test_surroundings_in_another_crs_are_copied(folder: Path) -> None:
    save_surroundings(HOUSES.to_crs("EPSG:4326"), folder / "houses.parquet")
    found = plan(folder, buildings=folder / "houses.parquet")
    assert found.buildings == folder / "city.partial" / "_inputs" / "buildings.parquet"


def test_streets_that_no_viewpoint_needs_are_left_aside(folder: Path) -> None:
    assert plan(folder, streets=folder / "nowhere.parquet").streets is None


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
    ],
)
def test_what_cannot_be_used_is_said_at_once_and_leaves_nothing(
    folder: Path, options: dict[str, Any], error: type[SemsigError], words: list[str]
) -> None:
    (folder / "empty.parquet").touch()
    HOUSES.set_crs(None, allow_override=True).to_parquet(folder / "bare.parquet")
    STREETS.to_parquet(folder / "lines.parquet")
    if "buildings" in options:
        options = {"buildings": folder / options["buildings"]}
    with refused(error, *words):
        plan(folder, **options)
    assert not (folder / "city.partial").exists()


def test_objects_that_are_missing_are_named(tmp_path: Path) -> None:
    with refused(DatabaseError, "objects.parquet", "does not exist"):
        plan(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_run_knows_its_inputs_by_their_content(folder: Path) -> None:
    HOUSES.to_file(folder / "houses.shp")
    options = {"buildings": folder / "houses.shp"}
    done = plan(folder, **options).folder / "tile_0_0.empty"
    done.touch()
    for path in folder.glob("houses.*"):
        content = path.read_bytes()
        path.write_bytes(content)  # later, and the same
    assert plan(folder, **options).folder == done.parent
    (folder / "houses.prj").write_text((folder / "houses.prj").read_text() + " ")
    with refused(InputError, "inputs, buildings", "delete that folder"):
        plan(folder, **options)


def test_a_crs_that_nobody_states_is_not_guessed(folder: Path) -> None:
    (folder / "houses.geojson").write_text('{"type": "FeatureCollection", "features": []}')
    with pytest.raises((InputError, CrsError)):
        plan(folder, buildings=folder / "houses.geojson")
