"""Maps of street objects, streets and buildings as their user asks for them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import shapely
from osm_xml import node, way, write_osm
from pyproj import Transformer
from sentences import sentence
from worlds import CORNER, random_town, surroundings

from semsig_gis.database.store import ObjectStore, save_with_store
from semsig_gis.objects.surroundings import save_surroundings
from semsig_gis.objects.table import StreetObjects, save_objects

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Done, Run

WORLD = random_town()
X, Y = CORNER.tolist()
HOUSE = surroundings(shapely.box(X, Y, X + 40.0, Y + 30.0))
LANE = surroundings(shapely.LineString([(X, Y - 5.0), (X + 200.0, Y - 5.0)]))
OBJECTS, GROUND = "semsig.streetObjects(", "= semsig.ground("


@pytest.fixture
def city(tmp_path: Path) -> Path:
    """Return a database with its object store and its objects beside it."""
    save_objects(WORLD.street_objects, tmp_path / "objects.parquet")
    save_with_store(WORLD.database, ObjectStore.of(WORLD.street_objects), tmp_path / "city.parquet")
    return tmp_path / "city.parquet"


def drawn(done: Done, city: Path, *options: object) -> str:
    page = city.with_name("map.html")
    out = done("map", city, *options, "--out", page)
    assert f"map: {page}" in out
    return page.read_text(encoding="utf-8")


def test_objects_alone_and_over_an_evaluation(city: Path, done: Done) -> None:
    objects = ("--objects", city.with_name("objects.parquet"))
    alone = drawn(done, city, *objects)
    assert alone.count(OBJECTS) == 1
    assert GROUND not in alone
    folder = city.with_name("evaluation")
    done("evaluate", city, "--queries", 5, "--out", folder)
    both = drawn(done, city, "--evaluation", folder, *objects)
    assert both.count(OBJECTS) == 1
    assert "Localization errors" in both


def test_streets_and_buildings_of_the_store_or_of_files(city: Path, done: Done) -> None:
    objects = ("--objects", city.with_name("objects.parquet"))
    store = ObjectStore.of(WORLD.street_objects, footprints=HOUSE, streets=LANE)
    save_with_store(WORLD.database, store, city)
    page = drawn(done, city, *objects)
    assert page.count(GROUND) == 1
    assert '{"buildings":' in page
    assert '"streets":' in page
    query = ("localize", city, "--types", "DD", "--map", city.with_name("query.html"))
    done(*query)
    assert GROUND in city.with_name("query.html").read_text(encoding="utf-8")

    far = surroundings(shapely.box(X + 9000.0, Y, X + 9010.0, Y + 10.0))
    save_with_store(WORLD.database, ObjectStore.of(WORLD.street_objects, footprints=far), city)
    assert GROUND not in drawn(done, city, *objects)

    save_with_store(WORLD.database, ObjectStore.of(WORLD.street_objects), city)
    save_surroundings(LANE, city.with_name("streets.parquet"))
    page = drawn(done, city, *objects, "--streets", city.with_name("streets.parquet"))
    assert page.count(GROUND) == 1
    assert '{"buildings":' not in page


def test_openstreetmap_is_named_for_its_buildings(city: Path, done: Done) -> None:
    to_degrees = Transformer.from_crs("EPSG:2154", "EPSG:4326", always_xy=True)
    corners = np.array(to_degrees.transform([X, X + 50.0, X], [Y, Y, Y + 50.0])).T
    file = write_osm(
        city.with_name("town.osm"),
        *(node(at, lon, lat) for at, (lon, lat) in enumerate(corners.tolist(), start=1)),
        way(9, [1, 2, 3, 1], {"building": "yes"}),
    )
    objects = ("--objects", city.with_name("objects.parquet"))
    page = drawn(done, city, *objects, "--buildings", file)
    assert "OpenStreetMap contributors (ODbL" in page


def test_what_cannot_be_drawn_leaves_the_map_as_it_was(city: Path, run: Run) -> None:
    page, objects = city.with_name("map.html"), city.with_name("objects.parquet")
    page.write_text("before")
    save_surroundings(LANE, city.with_name("streets.parquet"))
    far = surroundings(shapely.LineString([(X + 9000.0, Y), (X + 9100.0, Y)]))
    save_surroundings(far, city.with_name("far.parquet"))
    for options, words in (
        ((), ("--evaluation", "--identifiability", "--objects")),
        (("--objects", "nowhere.parquet"), ("nowhere.parquet",)),
        (("--objects", objects, "--buildings", "gone.zip"), ("gone.zip",)),
        (("--objects", objects, "--buildings", city.with_name("streets.parquet")), ("polygon",)),
        (("--objects", objects, "--streets", city.with_name("far.parquet")), ("in the city",)),
    ):
        sentence(run("map", city, *options, "--out", page), *words)
    assert page.read_text() == "before"


def test_objects_of_another_city_are_refused(city: Path, run: Run) -> None:
    page, far = city.with_name("map.html"), city.with_name("far.parquet")
    table = WORLD.street_objects.table
    moved = table.set_geometry(table.translate(50_000.0)).to_crs("EPSG:32631")
    save_objects(StreetObjects(moved, WORLD.street_objects.taxonomy, ()), far)
    told = run("map", city, "--ambiguity", "--objects", far, "--out", page)
    sentence(told, "street objects", "same city")
    assert not page.exists()
