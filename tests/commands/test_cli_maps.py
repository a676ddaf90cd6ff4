"""`semsig map`: maps of objects, streets, cells, answers and changes."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import shapely
from osm_xml import node, way, write_osm
from pyproj import Transformer
from sentences import sentence
from worlds import CORNER, random_town, surroundings

from semsig_gis.database import ObjectStore, build_database, save_with_store
from semsig_gis.evaluation.identifiability import analysis
from semsig_gis.objects import save_surroundings

if TYPE_CHECKING:
    import geopandas as gpd

    from conftest import Run, RunOk

OBJECTS = random_town().street_objects
FEWER = dataclasses.replace(OBJECTS, table=OBJECTS.table[4:].reset_index(drop=True))
X, Y = CORNER.tolist()
HOUSE = surroundings(shapely.box(X, Y, X + 40.0, Y + 30.0))
LANE = surroundings(shapely.LineString([(X, Y - 5.0), (X + 200.0, Y - 5.0)]))
pytestmark = pytest.mark.usefixtures("town")
DRAWN_OBJECTS, DRAWN_GROUND = "semsig.streetObjects(", "= semsig.ground("


def save_city(**ground: gpd.GeoDataFrame) -> None:
    store = ObjectStore.of(OBJECTS, **ground)
    save_with_store(build_database(OBJECTS), store, "city.parquet")


def map_page(run_ok: RunOk, options: str) -> str:
    """Return the page of a map."""
    assert run_ok(f"map city.parquet {options} --out map.html").endswith("map: map.html\n")
    return Path("map.html").read_text(encoding="utf-8")


def test_objects_with_and_without_an_evaluation(run_ok: RunOk) -> None:
    page = map_page(run_ok, "--objects objects.parquet")
    assert (page.count(DRAWN_OBJECTS), page.count(DRAWN_GROUND)) == (1, 0)
    run_ok("evaluate city.parquet --queries 5 --out evaluation")
    both = map_page(run_ok, "--evaluation evaluation --objects objects.parquet")
    assert both.count(DRAWN_OBJECTS) == 1
    assert "Localization errors" in both


def test_streets_and_buildings_from_the_store_or_files(run_ok: RunOk) -> None:
    objects = "--objects objects.parquet"
    save_city(footprints=HOUSE, streets=LANE)
    page = map_page(run_ok, objects)
    assert page.count(DRAWN_GROUND) == 1
    assert '{"buildings":' in page
    assert '"streets":' in page
    run_ok("localize city.parquet --types DD --map query.html")
    assert DRAWN_GROUND in Path("query.html").read_text(encoding="utf-8")

    save_city(footprints=surroundings(shapely.box(X + 9000.0, Y, X + 9010.0, Y + 10.0)))
    assert DRAWN_GROUND not in map_page(run_ok, objects)

    save_city()
    save_surroundings(LANE, "streets.parquet")
    page = map_page(run_ok, f"{objects} --streets streets.parquet")
    assert page.count(DRAWN_GROUND) == 1
    assert '{"buildings":' not in page


def test_licence_of_buildings_is_shown(tmp_path: Path, run_ok: RunOk) -> None:
    to_degrees = Transformer.from_crs("EPSG:2154", "EPSG:4326", always_xy=True)
    corners = np.array(to_degrees.transform([X, X + 50.0, X], [Y, Y, Y + 50.0])).T
    write_osm(
        tmp_path / "town.osm",
        *(node(at, lon, lat) for at, (lon, lat) in enumerate(corners.tolist(), start=1)),
        way(9, [1, 2, 3, 1], {"building": "yes"}),
    )
    page = map_page(run_ok, "--objects objects.parquet --buildings town.osm")
    assert "OpenStreetMap contributors (ODbL" in page


def test_everything_on_one_map(run_ok: RunOk, monkeypatch: pytest.MonkeyPatch) -> None:
    quick = functools.partial(analysis.identify, trials=60, class_trials=5)
    monkeypatch.setattr(analysis, "identify", quick)
    run_ok("evaluate city.parquet --queries 5 --out evaluation")
    run_ok("identify city.parquet")
    run_ok("localize city.parquet --types DD --method likelihood --out answer.tif")
    options = "--evaluation evaluation --ambiguity --identifiability --drift city.parquet"
    page = map_page(run_ok, f"{options} --location answer.tif --objects objects.parquet")
    for name in (
        *("Same types", "Chance to be found", "What has changed", "Chance within 50 m"),
        "Share of queries found",
        *("Lines from true to estimated places", "Best place"),
    ):
        assert page.count(f'"{name}" :') == 1
    assert DRAWN_OBJECTS in page


def test_raster_without_chances_is_refused(run_ok: RunOk, run: Run) -> None:
    run_ok("export city.parquet --out cells.tif")
    outcome = run("map city.parquet --location cells.tif --out map.html")
    sentence(outcome, "cells.tif does not contain the chances of the cells", "give a .tif file")


@pytest.mark.parametrize("suffix", ["gpkg", "geojson", "kml", "parquet", "csv", "fgb"])
def test_answers_of_all_formats_are_drawn(run_ok: RunOk, suffix: str) -> None:
    run_ok(f"localize city.parquet --types DD --method likelihood --out answer.{suffix}")
    page = map_page(run_ok, f"--location answer.{suffix}")
    assert '"Regions to search (' in page
    assert '"Region 1"' in page
    assert ('"Candidates (10)"' in page) == (suffix in {"gpkg", "geojson", "kml"})
    assert ('"Rank 10"' in page) == (suffix in {"gpkg", "geojson", "kml"})


@pytest.mark.parametrize("name", ["objects.parquet", "words.geojson", "cells.gpkg"])
def test_file_without_an_answer_is_refused(run_ok: RunOk, run: Run, name: str) -> None:
    Path("words.geojson").write_text("words", encoding="utf-8")
    if name == "cells.gpkg":
        run_ok("export city.parquet --out cells.gpkg")
    outcome = run(f"map city.parquet --location {name} --out map.html")
    sentence(outcome, name, "give a file that semsig localize --out wrote")
    assert not Path("map.html").exists()


def test_changes_are_drawn(run: Run) -> None:
    save_with_store(build_database(FEWER), ObjectStore.of(FEWER), "new.parquet")
    line = "map city.parquet --drift new.parquet --out drift.html"
    code, out, err = run(line)
    assert (code, "drawing cells only" in err) == (0, False)
    assert out.endswith("map: drift.html\n")
    assert "Objects removed (4)" in Path("drift.html").read_text(encoding="utf-8")
    # Without its store, a database has cells to compare, but no objects.
    Path("new.objects").rename("elsewhere")
    code, _, err = run(line)
    assert (code, "drawing cells only" in err) == (0, True)
    assert "Objects removed" not in Path("drift.html").read_text(encoding="utf-8")


def test_tiles_that_pages_from_disk_do_not_get_are_named(run: Run) -> None:
    for tiles, refused in (("OpenStreetMap.Mapnik", True), ("CyclOSM", False)):
        code, _, remarks = run(f"map city.parquet --ambiguity --tiles {tiles} --out map.html")
        assert code == 0
        assert ("pages that are opened from disk" in " ".join(remarks.split())) == refused


def test_map_of_an_answer_compares_without_being_asked(run_ok: RunOk) -> None:
    for view, compared in (("--types DD --bearings 10,80", True), ("--types DD", False)):
        text = run_ok(f"localize city.parquet {view} --map query.html --json")
        assert "explanation" not in text
        page = Path("query.html").read_text(encoding="utf-8")
        assert '"answerObjects"' in page
        assert ('"verdict":"matched"' in page) == compared
