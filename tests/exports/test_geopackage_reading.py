"""A database in a GeoPackage comes back as it was, and what is no such file is refused."""

from __future__ import annotations

import dataclasses
import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import shapely
import worlds
from cell_chances import chances_of
from hypothesis import given, settings
from hypothesis import strategies as st
from map_pages import HOSTILE, hostile_database
from pyproj import CRS
from sentences import refused
from small_city import small_city
from worlds import CORNER, World

from semsig_gis.core.errors import DatabaseError, EmptyResultError
from semsig_gis.database.viewpoints import ViewpointSpec
from semsig_gis.evaluation.identify.result import Identifiability
from semsig_gis.exports import export_database
from semsig_gis.exports.geopackage import read_geopackage
from semsig_gis.objects.table import Licence, StreetObjects, open_objects, save_objects

if TYPE_CHECKING:
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.exports.layers import CellGeometry

LOCAL = CRS("+proj=tmerc +lat_0=43.6123456789 +lon_0=3.88 +k=0.99987 +ellps=GRS80 +units=m")


def assert_same(database: SignatureDatabase, again: SignatureDatabase) -> None:
    worlds.assert_same(database, again)
    assert (database.viewpoints, database.occlusion) == (again.viewpoints, again.occlusion)


PLACES = st.tuples(
    st.floats(-60, 60).map(lambda x: CORNER[0] + x),
    st.floats(-60, 60).map(lambda y: CORNER[1] + y),
    st.sampled_from([1, 3, 12, 18]),
)
WORLDS = st.builds(
    World,
    st.lists(PLACES, min_size=1, max_size=12).map(tuple),
    step=st.floats(3, 40),
    origin=st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)),
    radius=st.sampled_from([0.7, 2.5, 30.0, 47.123456, 90.0]),
    levels=st.integers(1, 72),
)
AREA = shapely.box(0.1, 1 / 3, 10, 20)
FACTS = st.fixed_dictionaries(
    {
        "crs": st.sampled_from([CRS(2154), CRS(32631), LOCAL]),
        "occlusion": st.none() | st.floats(0, 5),
        "licenses": st.lists(st.text(st.characters(codec="utf-8"), max_size=20), max_size=3).map(
            tuple
        ),
        "version": st.just("0.0.1 of yesterday"),
        "viewpoints": st.builds(
            ViewpointSpec, mode=st.just("streets"), width=st.floats(1, 50), area=st.just(AREA)
        ),
    }
)


@settings(max_examples=25)
@given(WORLDS, FACTS, st.sampled_from(["polygon", "point"]))
def test_a_database_comes_back_as_it_was(
    world: World, facts: dict[str, Any], geometry: CellGeometry
) -> None:
    try:
        database = dataclasses.replace(world.database, **facts)
    except EmptyResultError:
        return
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "city.gpkg"
        export_database(database, file, geometry=geometry)
        contents = read_geopackage(file)
    assert_same(database, contents.database)
    assert (contents.objects, contents.identifiability, contents.notes) == (None, None, ())


def test_all_else_comes_back_too(tmp_path: Path) -> None:
    database, seen = small_city()
    texts = [HOSTILE, "", "\u202eright\u0001'\"); DROP TABLE cells; --" + "é" * 10_000]
    table = seen.table.assign(merged=[texts[row % 3] for row in range(len(seen))])
    seen = StreetObjects(table, seen.taxonomy, (*seen.licenses, Licence(HOSTILE)))
    told, file = chances_of(database), tmp_path / "city.gpkg"
    export_database(database, file, objects=seen, identifiability=told)
    found = read_geopackage(file)
    assert_same(database, found.database)
    assert found.notes == ()
    assert found.identifiability is not None
    for field in dataclasses.fields(Identifiability):
        ours, theirs = (getattr(one, field.name) for one in (told, found.identifiability))
        if field.name != "database":
            assert np.array_equal(ours, theirs) if isinstance(ours, np.ndarray) else ours == theirs
    assert found.objects is not None
    columns = list(found.objects.table.columns)
    assert found.objects.table.equals(table[columns])
    assert set(columns) == set(table.columns)
    assert (found.objects.crs, found.objects.taxonomy) == (seen.crs, seen.taxonomy)
    assert found.objects.licenses == seen.licenses


def test_hostile_classes_and_licences_come_back(tmp_path: Path) -> None:
    database = hostile_database(small_city()[0])
    export_database(database, tmp_path / "city.gpkg")
    assert_same(database, read_geopackage(tmp_path / "city.gpkg").database)


def changed(file: Path, sql: str) -> None:
    with closing(sqlite3.connect(file)) as connection, connection:
        for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'"):
            connection.execute(f'DROP TRIGGER "{name}"')  # they need functions of GDAL
        connection.execute(sql)


def test_cells_that_were_deleted_are_gone(tmp_path: Path) -> None:
    database, file = small_city()[0], tmp_path / "city.gpkg"
    export_database(database, file, identifiability=chances_of(database))
    changed(file, "DELETE FROM cells WHERE length < 3")
    found = read_geopackage(file)
    assert_same(database.select(database.lengths >= 3), found.database)
    assert found.identifiability is None
    assert "other signatures" in found.notes[0]


def test_objects_that_were_drawn_are_read(tmp_path: Path) -> None:
    (database, objects), file = small_city(), tmp_path / "city.gpkg"
    export_database(database, file, objects=objects)
    # As QGIS adds a point of which the class alone was told.
    changed(file, "INSERT INTO objects (geom, class_code) SELECT geom, 3 FROM objects LIMIT 1")
    found = read_geopackage(file).objects
    assert found is not None
    added = found.table.iloc[-1]
    assert (added["source"], added["source_id"], added["count"]) == ("", "", 1)
    save_objects(found, tmp_path / "objects.parquet")
    assert len(open_objects(tmp_path / "objects.parquet")) == len(objects) + 1


@pytest.mark.parametrize("start", range(3))
def test_a_file_with_a_hole_is_refused(start: int, tmp_path: Path) -> None:
    file = tmp_path / "city.gpkg"
    export_database(small_city()[0], file)
    content = bytearray(file.read_bytes())
    pages = range(4096 * (12 + start), len(content), 3 * 4096)
    for page in pages:
        content[page : page + 4096] = bytes(4096)
    file.write_bytes(content)
    with refused(DatabaseError, "city.gpkg", "damaged"):
        read_geopackage(file)


@pytest.mark.parametrize(
    "sql",
    [
        "UPDATE cells SET bearings = '1.00 x' WHERE fid = 3",
        "UPDATE cells SET bearings = '' WHERE fid = 3",
        "UPDATE cells SET bearings = NULL WHERE fid = 3",
        "UPDATE cells SET bearings = bearings || ' 359.95' WHERE fid = 3",
        "UPDATE cells SET distances = replace(distances, '.', '00.')",
        "UPDATE cells SET types = '!' WHERE fid = 3",
        "UPDATE cells SET cell_id = 7 WHERE fid < 3",
        "DELETE FROM cells",
        "DELETE FROM gpkg_metadata_reference",
        "ALTER TABLE cells DROP COLUMN distances",
        "UPDATE cells SET bearings = zeroblob(3)",
        "UPDATE objects SET count = -3 WHERE fid = 2",
        "UPDATE objects SET class_code = NULL WHERE fid = 2",
    ],
)
def test_a_damaged_file_is_refused(sql: str, tmp_path: Path) -> None:
    file = tmp_path / "city.gpkg"
    database, objects = small_city()
    export_database(database, file, objects=objects)
    changed(file, sql)
    with refused(DatabaseError, "city.gpkg", "damaged"):
        read_geopackage(file)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nowhere.gpkg", "nowhere.gpkg does not exist"),
        ("", "is a folder"),
        ("a.gpkg", "not written by semsig export"),
        ("b.gpkg", "b.gpkg has no layer 'cells'"),
    ],
)
def test_what_is_no_exported_database_is_refused(name: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "a.gpkg").write_bytes(b"SQLite format 3\0 but not really")
    database, objects = small_city()
    export_database(database, tmp_path / "b.gpkg", layers=["objects"], objects=objects)
    with refused(DatabaseError, words):
        read_geopackage(tmp_path / name)
