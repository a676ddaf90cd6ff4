"""GeoPackages: what other programs read from them is what the database holds."""

from __future__ import annotations

import dataclasses
import json
import resource
import sqlite3
import subprocess
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, Any

import fiona
import geopandas as gpd
import numpy as np
import pyogrio
import pytest
import shapely
from cells_told import told_of
from sentences import assert_sentence

from semsig_gis.building import build_database
from semsig_gis.catalog import paper_taxonomy
from semsig_gis.errors import InputError, UnknownNameError
from semsig_gis.exports import _layers
from semsig_gis.exports.geopackage import export_geopackage
from semsig_gis.grid import GridSpec
from semsig_gis.objects import StreetObjects, build_objects
from semsig_gis.signatures import SignatureSpec, quantize
from semsig_gis.sources.synthetic import CitySpec, synthetic_city
from semsig_gis.taxonomy import ObjectClass, Taxonomy

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from semsig_gis.database import SignatureDatabase

LICENSE = "Town: é <b>\"quoted\"</b> & 'single' ]]> (CC0): trees, lamps"
FORMULA = '=cmd|"/C calc"!A0 <script>'


@pytest.fixture(scope="module")
def objects() -> StreetObjects:
    layers = synthetic_city(CitySpec(size=300.0))
    made, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    classes = tuple(
        dataclasses.replace(item, title=f"{FORMULA} {item.title}") for item in made.taxonomy.classes
    )
    return StreetObjects(made.table, Taxonomy(classes), (LICENSE,))


@pytest.fixture(scope="module")
def database(objects: StreetObjects) -> SignatureDatabase:
    return build_database(
        objects, grid=GridSpec(12.5, (3.0, -4.0)), spec=SignatureSpec(25.0, levels=12)
    )


@pytest.fixture(autouse=True)
def _several_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_layers.Layer.blocks, "__defaults__", (100,))


def query(file: Path, sql: str) -> list[Any]:
    with closing(sqlite3.connect(file)) as connection:
        return connection.execute(sql).fetchall()


def test_cells_read_back_as_they_are(database: SignatureDatabase, tmp_path: Path) -> None:
    file = tmp_path / "city.gpkg"
    export_geopackage(database, file)
    assert pyogrio.list_layers(file).tolist() == [["cells", "Polygon"], ["layer_styles", None]]
    cells = gpd.read_file(file, layer="cells")
    assert cells.crs == database.crs
    assert len(cells) == len(database) > 300
    for name, expected in (
        ("cell_id", database.cell_ids),
        ("x", database.xy[:, 0]),
        ("y", database.xy[:, 1]),
        ("length", database.lengths),
        ("type_group_size", database.type_group_sizes),
        ("angle_group_size", database.angle_group_sizes),
    ):
        assert np.array_equal(cells[name].to_numpy(), expected), name
    for number, cell in enumerate(cells.itertuples()):
        seen = slice(database.offsets[number], database.offsets[number + 1])
        assert cell.types == database.types(number)
        degrees = database.bearings[seen]
        written = [float(text) for text in cell.bearings.split(" ")]
        assert cell.bearings == " ".join(f"{one:.2f}" for one in degrees)
        assert np.abs(np.array(written) - degrees).max() <= 0.005 + 1e-9
        assert max(written) < 360
        assert [int(text) for text in cell.levels.split(" ")] == quantize(degrees, 12).tolist()
        metres = [float(text) for text in cell.distances.split(" ")]
        assert np.abs(np.array(metres) - database.distances[seen]).max() <= 0.005 + 1e-9


def test_a_square_is_the_cell(database: SignatureDatabase, tmp_path: Path) -> None:
    file = tmp_path / "city.gpkg"
    export_geopackage(database, file)
    squares = gpd.read_file(file, layer="cells").geometry
    assert (squares.geom_type == "Polygon").all()
    assert np.allclose(squares.area, 12.5**2, rtol=1e-12)
    centres = np.stack([squares.centroid.x, squares.centroid.y], axis=1)
    assert np.allclose(centres, database.xy, atol=1e-6)
    bounds = squares.bounds.to_numpy()
    assert np.allclose(bounds[:, 2:] - bounds[:, :2], 12.5, atol=1e-9)
    # Neighbours share their corners to the last bit: nothing between them, nothing twice.
    corners = np.unique(bounds[:, [0, 2]])
    assert np.diff(corners).min() > 12
    assert np.array_equal(shapely.get_num_coordinates(squares.array), np.full(len(squares), 5))


def test_points(database: SignatureDatabase, tmp_path: Path) -> None:
    file = tmp_path / "CITY.GPKG"
    export_geopackage(database, file, geometry="point")
    cells = gpd.read_file(file, layer="cells")
    assert np.array_equal(shapely.get_coordinates(cells.geometry.array), database.xy)


def test_objects_read_back_as_they_are(
    database: SignatureDatabase, objects: StreetObjects, tmp_path: Path
) -> None:
    file = tmp_path / "city.gpkg"
    export_geopackage(database, file, objects=objects)
    assert fiona.listlayers(file) == ["cells", "objects", "layer_styles"]
    with fiona.open(file, layer="objects") as layer:
        assert layer.crs.to_epsg() == 32631
        assert list(layer.schema["properties"]) == [
            *("class_code", "symbol", "class_name", "title", "source", "source_id", "count")
        ]
        read = list(layer)
    assert len(read) == len(objects) > 100
    for feature, (_, row) in zip(read, objects.table.iterrows(), strict=True):
        item = objects.taxonomy.by_code(row["class_code"])
        properties = dict(feature.properties)
        assert properties.pop("class_code") == item.code
        assert properties == {
            "symbol": item.symbol,
            "class_name": item.name,
            "title": item.title,
            "source": row["source"],
            "source_id": row["source_id"],
            "count": row["count"],
        }
        assert properties["title"].startswith(FORMULA)
        assert feature.geometry.coordinates == (row.geometry.x, row.geometry.y)


def test_specs_and_licences_travel_along(
    database: SignatureDatabase, objects: StreetObjects, tmp_path: Path
) -> None:
    file = tmp_path / "city.gpkg"
    export_geopackage(database, file, objects=objects)
    cells, things = (pyogrio.read_info(file, layer=name) for name in ("cells", "objects"))
    for facts in (cells["dataset_metadata"], cells["layer_metadata"]):
        assert json.loads(facts["grid"]) == {"step": 12.5, "origin": [3.0, -4.0]}
        assert json.loads(facts["signature"]) == {"radius": 25.0, "levels": 12}
        assert Taxonomy.from_list(json.loads(facts["taxonomy"])) == database.taxonomy
        assert json.loads(facts["licenses"]) == [LICENSE]
    assert cells["dataset_metadata"]["written_by"].startswith("semsig_gis ")
    assert json.loads(things["layer_metadata"]["licenses"]) == [LICENSE]
    contents = query(file, "SELECT table_name, identifier, description FROM gpkg_contents")
    assert [row[:2] for row in contents] == [
        ("cells", "Signature cells"),
        ("objects", "Street objects"),
        ("layer_styles", "layer_styles"),
    ]
    assert all(LICENSE in description for *_, description in contents[:2])
    assert "12.5 m" in contents[0][2]


def test_it_is_a_sound_geopackage_1_2(
    database: SignatureDatabase, objects: StreetObjects, tmp_path: Path
) -> None:
    file = tmp_path / "city.gpkg"
    export_geopackage(database, file, objects=objects)
    assert query(file, "PRAGMA user_version") == [(10200,)]
    assert query(file, "PRAGMA application_id") == [(0x47504B47,)]
    assert query(file, "PRAGMA integrity_check") == [("ok",)]
    assert query(file, "PRAGMA foreign_key_check") == []
    index = "SELECT table_name FROM gpkg_extensions WHERE extension_name = 'gpkg_rtree_index'"
    assert sorted(query(file, index)) == [("cells",), ("objects",)]
    assert [path.name for path in tmp_path.iterdir()] == ["city.gpkg"]


def test_a_crs_of_its_own(database: SignatureDatabase, tmp_path: Path) -> None:
    local = type(database.crs)("+proj=tmerc +lat_0=43.6 +lon_0=3.88 +ellps=GRS80 +units=m")
    file = tmp_path / "city.gpkg"
    export_geopackage(dataclasses.replace(database, crs=local), file, geometry="point")
    assert gpd.read_file(file, layer="cells").crs == local


def test_progress(database: SignatureDatabase, objects: StreetObjects, tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    export_geopackage(
        database,
        tmp_path / "city.gpkg",
        objects=objects,
        progress=lambda done, total: told.append((done, total)),
    )
    rows = len(database) + len(objects)
    assert told[0] == (100, rows)
    assert told[-1] == (rows, rows)
    assert [done for done, _ in told] == sorted({done for done, _ in told})


@pytest.mark.parametrize("name", ["city.shp", "city", "city.gpkg.zip"])
def test_other_file_names_are_refused(
    name: str, database: SignatureDatabase, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as caught:
        export_geopackage(database, tmp_path / name)
    assert_sentence(caught.value, name, ".gpkg")
    assert list(tmp_path.iterdir()) == []


def test_other_geometries_are_refused(database: SignatureDatabase, tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError) as caught:
        export_geopackage(database, tmp_path / "a.gpkg", geometry="polygons")  # type: ignore[arg-type]
    assert_sentence(caught.value, "'polygons'", "the nearest is 'polygon'")


def test_a_folder_that_cannot_be_written(database: SignatureDatabase, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here")
    with pytest.raises(InputError) as caught:
        export_geopackage(database, tmp_path / "file" / "city.gpkg")
    assert_sentence(caught.value, "city.gpkg", "folder")
    assert (tmp_path / "file").read_text() == "here"


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Let this process write no file beyond a size, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


# A share just below 1 is too little for the spatial index of the objects, which comes last.
@pytest.mark.parametrize("share", [0, 0.07, 0.4, 0.95])
def test_a_full_disk_leaves_the_old_file(
    share: float, database: SignatureDatabase, objects: StreetObjects, tmp_path: Path
) -> None:
    file = tmp_path / "city.gpkg"
    export_geopackage(database, file, objects=objects)
    before = file.read_bytes()
    with largest_file(round(share * len(before))), pytest.raises(InputError) as caught:
        export_geopackage(database, file, objects=objects)
    assert_sentence(caught.value, "city.gpkg", "unchanged")
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]


def test_an_interruption_leaves_the_old_file(
    database: SignatureDatabase, objects: StreetObjects, tmp_path: Path
) -> None:
    file = tmp_path / "city.gpkg"
    file.write_bytes(b"old")

    def stop(done: int, total: int) -> None:
        if done > total // 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export_geopackage(database, file, objects=objects, progress=stop)
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]


def test_qgis_counts_the_objects_in_the_cells(
    database: SignatureDatabase,
    objects: StreetObjects,
    qgis_process: Path,
    qgis_environment: dict[str, str],
    tmp_path: Path,
) -> None:
    file, counted = tmp_path / "city.gpkg", tmp_path / "counted.gpkg"
    export_geopackage(database, file, objects=objects)
    done = subprocess.run(
        [
            *(qgis_process, "run", "native:countpointsinpolygon", "--"),
            f"POLYGONS={file}|layername=cells",
            f"POINTS={file}|layername=objects",
            "FIELD=NUMPOINTS",
            f"OUTPUT={counted}",
        ],
        check=False,
        capture_output=True,
        text=True,
        timeout=120,
        env=qgis_environment,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "GPKG: unrecognized user_version" not in done.stdout + done.stderr
    numbers = gpd.read_file(counted).set_index("cell_id")["NUMPOINTS"]
    columns, rows = database.grid.cells_at(objects.xy)
    expected = {int(cell): 0 for cell in database.cell_ids}
    for cell in (columns * 10**8 + rows).tolist():
        expected[cell] += 1  # each object's own cell sees it, so it is in the database
    assert numbers.astype(int).to_dict() == expected


def test_text_that_no_program_may_stumble_over(tmp_path: Path) -> None:
    layers = synthetic_city(CitySpec(size=300.0))
    made, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    nasty = "\u202eright\u0001'\"); DROP TABLE cells; --" + "é" * 10_000
    table = made.table.copy()
    table["source_id"] = nasty
    classes = [
        ObjectClass(item.code, item.symbol, item.name, nasty) for item in made.taxonomy.classes
    ]
    hostile = StreetObjects(table, Taxonomy(tuple(classes)), (nasty,))
    file = tmp_path / "city.gpkg"
    export_geopackage(build_database(hostile), file, objects=hostile)
    read = gpd.read_file(file, layer="objects")
    assert set(read["source_id"]) == set(read["title"]) == {nasty}
    facts = pyogrio.read_info(file, layer="objects")["layer_metadata"]
    assert json.loads(facts["licenses"]) == [nasty]


def test_identifiability_goes_with_the_cells(database: SignatureDatabase, tmp_path: Path) -> None:
    told, file = told_of(database), tmp_path / "city.gpkg"
    export_geopackage(database, file, identifiability=told)
    cells = gpd.read_file(file, layer="cells")
    table = told.table()
    assert set(table.column_names) <= set(cells.columns)
    assert cells["lookalike_3"].isna().tolist() == (told.lookalikes[:, 2] < 0).tolist()
    for name in table.column_names:
        expected = np.array(table[name].to_pylist(), dtype=float)
        assert np.array_equal(cells[name].to_numpy(float), expected, equal_nan=True)


def test_identifiability_of_other_cells_is_refused(
    database: SignatureDatabase, tmp_path: Path
) -> None:
    told = told_of(database.select(slice(3, None)))
    with pytest.raises(InputError) as caught:
        export_geopackage(database, tmp_path / "city.gpkg", identifiability=told)
    assert_sentence(caught.value, "that of other cells")
    assert not list(tmp_path.iterdir())
