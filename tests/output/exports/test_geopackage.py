"""GeoPackages are read back unchanged, by this package and by other programs."""

from __future__ import annotations

import base64
import dataclasses
import json
import os
import re
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import warnings
from contextlib import closing
from pathlib import Path
from subprocess import PIPE
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import geopandas as gpd
import numpy as np
import pyogrio
import pytest
import rasterio
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from machine import PATIENCE_S
from map_pages import HOSTILE, hostile_database
from pyproj import CRS
from sentences import assert_sentence, refused
from small_city import chances_of, small_city, small_localization, small_location
from worlds import CORNER, World, assert_same

from semsig_gis.core import (
    OUTCOMES,
    PICTOGRAMS,
    DatabaseError,
    EmptyResultError,
    GridSpec,
    InputError,
    SignatureSpec,
    Taxonomy,
    class_signs,
    quantize,
)
from semsig_gis.database import ViewpointSpec, build_database
from semsig_gis.evaluation import Identifiability, evaluate
from semsig_gis.localization import Method
from semsig_gis.objects import Licence, StreetObjects, open_objects, save_objects
from semsig_gis.output import (
    CLASS_MARKERS,
    by_class,
    export_answer,
    export_database,
    read_geopackage,
    renderer,
)
from semsig_gis.sources import LayerSpec, paper_taxonomy, read_layer

if TYPE_CHECKING:
    from semsig_gis.database import CellGeometry

LOCAL = CRS("+proj=tmerc +lat_0=43.6123456789 +lon_0=3.88 +k=0.99987 +ellps=GRS80 +units=m")
LICENSE = "Town: é <b>\"quoted\"</b> & 'single' ]]> (CC0): trees, lamps"
PROGRAM = Path(__file__).parents[2] / "qgis_programs.py"
FEATURES = ["cells", "evaluation", "evaluation_lines", "objects"]
LAYERS = [*FEATURES, "evaluation_figures", "layer_styles"]
FORMULA = '=cmd|"/C calc"!A0 <script>'

# A city on an unusual grid, with hostile texts.
CLASSES = [
    dataclasses.replace(item, title=f"{FORMULA} {item.title}") for item in paper_taxonomy().classes
]
OBJECTS = dataclasses.replace(
    small_city()[1], taxonomy=Taxonomy(tuple(CLASSES)), licenses=(Licence(LICENSE),)
)
DATABASE = build_database(
    OBJECTS, grid=GridSpec(12.5, (3.0, -4.0)), spec=SignatureSpec(25.0, levels=12)
)
CHANCES = chances_of(DATABASE)
EVALUATION = evaluate(DATABASE, queries=60, distortion="strong", method=Method())


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a GeoPackage with all layers of the city."""
    path = tmp_path_factory.mktemp("exported") / "city.gpkg"
    export_database(DATABASE, path, objects=OBJECTS, identifiability=CHANCES, evaluation=EVALUATION)
    return path


def run(*command: str | Path, environment: dict[str, str]) -> str:
    """Run a program that must not fail; return its output."""
    result = subprocess.run(
        command, check=False, capture_output=True, text=True, timeout=PATIENCE_S, env=environment
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert "GPKG: unrecognized user_version" not in result.stdout + result.stderr
    return result.stdout


def query(file: Path, sql: str) -> list[Any]:
    with closing(sqlite3.connect(file)) as connection:
        return connection.execute(sql).fetchall()


def test_cells_are_read_back_unchanged(file: Path) -> None:
    database, cells = DATABASE, gpd.read_file(file, layer="cells")
    assert cells.crs == database.crs
    assert len(cells) == len(database) > 300
    for name in ("cell_id", "length", "type_group_size", "angle_group_size"):
        assert np.array_equal(cells[name], getattr(database, f"{name}s")), name
    assert np.array_equal(cells[["x", "y"]], database.xy)
    for number, cell in enumerate(cells.itertuples()):
        rows = slice(database.offsets[number], database.offsets[number + 1])
        assert cell.types == database.types(number)
        degrees = database.bearings[rows]
        bearings = [float(text) for text in cell.bearings.split(" ")]
        assert cell.bearings == " ".join(f"{bearing:.2f}" for bearing in degrees)
        assert np.abs(np.array(bearings) - degrees).max() <= 0.005 + 1e-9
        assert max(bearings) < 360
        assert [int(text) for text in cell.levels.split(" ")] == quantize(degrees, 12).tolist()
        metres = [float(text) for text in cell.distances.split(" ")]
        assert np.abs(np.array(metres) - database.distances[rows]).max() <= 0.005 + 1e-9
    table = CHANCES.table()
    assert cells["lookalike_3"].isna().tolist() == (CHANCES.lookalikes[:, 2] < 0).tolist()
    for name in table.column_names:
        expected = np.array(table[name].to_pylist(), dtype=float)
        assert np.array_equal(cells[name].to_numpy(float), expected, equal_nan=True)


def test_cells_are_squares_or_points_at_viewpoints(file: Path, tmp_path: Path) -> None:
    squares = gpd.read_file(file, layer="cells").geometry
    assert (squares.geom_type == "Polygon").all()
    assert np.allclose(squares.area, 12.5**2, rtol=1e-12)
    centres = np.stack([squares.centroid.x, squares.centroid.y], axis=1)
    assert np.allclose(centres, DATABASE.xy, atol=1e-6)
    bounds = squares.bounds.to_numpy()
    assert np.allclose(bounds[:, 2:] - bounds[:, :2], 12.5, atol=1e-9)
    # Neighbours share their corners exactly, without gaps and overlaps.
    corners = np.unique(bounds[:, [0, 2]])
    assert np.diff(corners).min() > 12
    assert np.array_equal(shapely.get_num_coordinates(squares.array), np.full(len(squares), 5))
    local = dataclasses.replace(DATABASE, crs=LOCAL)
    export_database(local, tmp_path / "a.gpkg", geometry="point")
    cells = gpd.read_file(tmp_path / "a.gpkg", layer="cells")
    assert cells.crs == LOCAL
    assert np.array_equal(shapely.get_coordinates(cells.geometry.array), DATABASE.xy)


def test_objects_are_read_by_fiona_unchanged(file: Path) -> None:
    fiona = pytest.importorskip("fiona", reason="there is no fiona for this Python")
    assert fiona.listlayers(file) == LAYERS
    with fiona.open(file, layer="objects") as layer:
        assert layer.crs.to_epsg() == 32631
        assert list(layer.schema["properties"]) == [
            *("class_code", "symbol", "class_name", "title", "source", "source_id", "family"),
            "count",
        ]
        read = list(layer)
    assert len(read) == len(OBJECTS) > 100
    for feature, (_, row) in zip(read, OBJECTS.table.iterrows(), strict=True):
        item = OBJECTS.taxonomy.by_code(row["class_code"])
        assert item.title.startswith(FORMULA)
        assert tuple(feature.properties.values()) == (
            *(item.code, item.symbol, item.name, item.title),
            *(*row[["source", "source_id"]], item.family, row["count"]),
        )
        assert feature.geometry.coordinates == (row.geometry.x, row.geometry.y)


def test_metadata_have_specs_and_licences(file: Path) -> None:
    cells, objects = (pyogrio.read_info(file, layer=name) for name in ("cells", "objects"))
    facts = cells["layer_metadata"]
    assert json.loads(facts["grid"]) == {"step": 12.5, "origin": [3.0, -4.0]}
    assert json.loads(facts["signature"]) == {"radius": 25.0, "levels": 12}
    assert Taxonomy.from_list(json.loads(facts["taxonomy"])) == DATABASE.taxonomy
    assert json.loads(facts["licenses"]) == [LICENSE]
    assert json.loads(facts["written_by"]).startswith("semsig_gis ")
    assert json.loads(objects["layer_metadata"]["licenses"]) == [LICENSE]
    contents = query(file, "SELECT table_name, identifier, description FROM gpkg_contents")
    assert {name: title for name, title, _ in contents} == {
        "cells": "Signature cells",
        "objects": "Street objects",
        "evaluation": "Queries",
        "evaluation_lines": "From the true to the best place",
        "evaluation_figures": "Figures of the queries",
        "layer_styles": "layer_styles",
    }
    assert all(LICENSE in description for *_, description in contents[:-1])
    assert "12.5 m" in contents[0][2]


def test_file_is_a_valid_geopackage_1_2(file: Path) -> None:
    assert query(file, "PRAGMA user_version") == [(10200,)]
    assert query(file, "PRAGMA application_id") == [(0x47504B47,)]
    assert query(file, "PRAGMA integrity_check") == [("ok",)]
    assert query(file, "PRAGMA foreign_key_check") == []
    index = "SELECT table_name FROM gpkg_extensions WHERE extension_name = 'gpkg_rtree_index'"
    assert {name for (name,) in query(file, index)} == set(FEATURES)
    tables = query(file, "SELECT DISTINCT table_name FROM gpkg_extensions")
    assert {("gpkg_metadata",), ("gpkg_metadata_reference",)} <= set(tables)
    kinds = query(file, "SELECT table_name, data_type, srs_id FROM gpkg_contents")
    system = query(file, "SELECT srs_id FROM gpkg_geometry_columns")[0][0]
    features = [(name, "features", system) for name in FEATURES]
    assert sorted(kinds) == sorted([*features, *((name, "attributes", 0) for name in LAYERS[4:])])
    extents = query(file, "SELECT table_name, min_x, min_y, max_x, max_y FROM gpkg_contents")
    boxes = {name: box for name, *box in extents}
    for layer in FEATURES:
        assert np.allclose(boxes[layer], gpd.read_file(file, layer=layer).total_bounds)
    assert list(file.parent.iterdir()) == [file]


def test_progress_is_reported_and_an_interruption_leaves_the_old_file(tmp_path: Path) -> None:
    steps: list[tuple[int, int]] = []
    file, rows = tmp_path / "city.gpkg", len(DATABASE) + len(OBJECTS)
    export_database(DATABASE, file, objects=OBJECTS, progress=lambda *step: steps.append(step))
    assert (steps[0], steps[-1]) == ((100, rows), (rows, rows))
    assert steps == sorted(set(steps))
    before = file.read_bytes()

    def stop(written: int, total: int) -> None:
        if written > total // 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export_database(DATABASE, file, objects=OBJECTS, geometry="point", progress=stop)
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]


def test_qgis_counts_the_objects_in_the_cells(
    file: Path, qgis_process: Path, qgis_environment: dict[str, str], tmp_path: Path
) -> None:
    run(
        *(qgis_process, "run", "native:countpointsinpolygon", "--"),
        *(f"POLYGONS={file}|layername=cells", f"POINTS={file}|layername=objects"),
        *("FIELD=NUMPOINTS", f"OUTPUT={tmp_path / 'counted.gpkg'}"),
        environment=qgis_environment,
    )
    numbers = gpd.read_file(tmp_path / "counted.gpkg").set_index("cell_id")["NUMPOINTS"]
    columns, rows = DATABASE.grid.cells_at(OBJECTS.xy)
    expected = {int(cell): 0 for cell in DATABASE.cell_ids}
    for cell in (columns * 10**8 + rows).tolist():
        expected[cell] += 1  # the cell of each object sees it, so it is in the database
    assert numbers.astype(int).to_dict() == expected


def test_every_layer_has_a_style(file: Path, tmp_path: Path) -> None:
    answer = tmp_path / "answer.gpkg"
    export_answer(small_location(), small_city()[0], answer)
    styles = [
        (source, *row)
        for source in (file, answer)
        for row in query(
            source,
            "SELECT f_table_name, f_geometry_column, styleName, useAsDefault, styleQML, "
            "update_time FROM layer_styles WHERE f_table_schema = '' AND f_table_catalog = ''",
        )
    ]
    assert [style[1:5] for style in styles] == [
        ("cells", "geom", "Identifiability", 1),
        ("cells", "geom", "Ambiguity", 0),
        ("evaluation", "geom", "Outcome", 1),
        ("evaluation_figures", "", "Fields", 1),
        ("evaluation_lines", "geom", "Outcome", 1),
        ("objects", "geom", "Classes", 1),
        ("regions", "geom", "Rank", 1),
        ("candidates", "geom", "Rank", 1),
        ("place", "geom", "Answer", 1),
        ("ellipse", "geom", "Answer", 1),
        ("rays", "geom", "Verdict", 1),
    ]
    for source, layer, _, _, _, qml, updated in styles:
        root = ET.fromstring(qml)  # noqa: S314 - our own
        fields = {*pyogrio.read_info(source, layer=layer)["fields"]}
        assert {item.attrib["field"] for item in root.findall("aliases/alias")} == fields
        expressions = [item.attrib["attr"] for item in root.findall("renderer-v2")]
        # An expression decides which features are drawn, or there is only the name of a field.
        columns = [re.findall(r'"(\w+)"', text) or [text] for text in expressions]
        assert {name for names in columns for name in names} <= fields
        assert (root.find("renderer-v2") is None) == (layer == "evaluation_figures")
        used = {item.attrib["symbol"] for item in root.iter() if "symbol" in item.attrib}
        assert used == {item.attrib["name"] for item in root.findall("renderer-v2/symbols/symbol")}
        assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z", updated)


def test_layers_of_an_evaluation(file: Path, tmp_path: Path) -> None:
    results = EVALUATION
    points, lines = (gpd.read_file(file, layer=name) for name in ("evaluation", "evaluation_lines"))
    assert points.geometry.geom_equals(results.queries.geometry.reset_index(drop=True)).all()
    assert set(points["outcome"]) == set(OUTCOMES)
    assert ((points["outcome"] == "successful") == results.successful).all()
    assert 0 < len(lines) < len(points) - results.unlocalized
    truth = shapely.get_coordinates(results.queries.geometry.array)
    best = results.queries[["best_x", "best_y"]].to_numpy(np.float64)
    assert len(lines) == (best != truth).any(axis=1).sum() - results.unlocalized
    ends = points.set_index("number").loc[lines["number"], ["best_x", "best_y"]]
    assert np.array_equal(shapely.get_coordinates(lines.geometry.array)[1::2], ends.to_numpy())
    assert np.allclose(lines.geometry.length, lines["off_m"])
    assert points["error_m"].isna().tolist() == np.isinf(results.queries["error_m"]).tolist()
    queries = results.queries[results.queries["query_length"] == 0]
    empty, file = dataclasses.replace(results, queries=queries), tmp_path / "empty.gpkg"
    export_database(DATABASE, file, evaluation=empty)
    assert len(gpd.read_file(file, layer="evaluation_lines")) == 0
    assert set(gpd.read_file(file, layer="evaluation")["outcome"]) == {"failed"}


def test_ogrinfo_of_the_system_reads_the_layers(file: Path) -> None:
    ogrinfo = shutil.which("ogrinfo", path=os.defpath)
    if ogrinfo is None:
        pytest.skip("ogrinfo is not on this machine")
    output = run(ogrinfo, "-ro", "-al", "-so", file, environment={"LANG": "C.UTF-8"})
    names = re.findall("^Layer name: (.*)$", output, re.MULTILINE)
    assert sorted(names) == sorted(LAYERS)
    counts = re.findall("^Feature Count: (.*)$", output, re.MULTILINE)
    rows = dict(zip(names, counts, strict=True))
    assert rows["cells"] == str(len(DATABASE))
    assert (rows["objects"], rows["evaluation"]) == (str(len(OBJECTS)), "60")


# Uses of the file by another program, until it reads a line from standard input.
HOLDERS = {
    "reads": "BEGIN; SELECT count(*) FROM cells",
    "writes": "BEGIN IMMEDIATE; UPDATE cells SET length = 0",
    "keeps a log": "PRAGMA journal_mode = WAL; CREATE TABLE more (id INTEGER)",
}
HOLDER = """
import sqlite3, sys
connection = sqlite3.connect(sys.argv[1], isolation_level=None)
for name, in connection.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
    connection.execute(f'DROP TRIGGER "{name}"')
cursors = [connection.execute(sql).fetchmany(1) for sql in sys.argv[2].split("; ")]
print("open", flush=True)
sys.stdin.readline()
"""


@pytest.mark.parametrize("use", HOLDERS)
def test_file_that_is_open_in_another_program_is_unchanged(use: str, tmp_path: Path) -> None:
    file, link = tmp_path / "city.gpkg", tmp_path / "link.gpkg"
    export_database(DATABASE, file)
    link.symlink_to(file)
    command = [sys.executable, "-c", HOLDER, str(file), HOLDERS[use]]
    with subprocess.Popen(command, stdin=PIPE, stdout=PIPE, text=True) as other:
        assert other.stdin is not None
        assert other.stdout is not None
        assert other.stdout.readline() == "open\n"
        before = file.read_bytes()
        for path in (file, link):
            with refused(InputError, path.name, "open in another program", "close it"):
                export_database(DATABASE, path, geometry="point")
        assert file.read_bytes() == before
        other.communicate("done\n")
    export_database(DATABASE, file, geometry="point")
    assert pyogrio.read_info(file, layer="cells")["geometry_type"] == "Point"


def test_file_that_is_opened_during_the_export_is_unchanged(tmp_path: Path) -> None:
    file = tmp_path / "city.gpkg"
    export_database(DATABASE, file)
    before = file.read_bytes()
    with closing(sqlite3.connect(file)) as other:

        def lock(written: int, total: int) -> None:
            if written == total:
                other.execute("BEGIN IMMEDIATE")

        with refused(InputError, "open in another program"):
            export_database(DATABASE, file, progress=lock)
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]


def test_objects_have_the_signs_of_their_classes() -> None:
    classes = paper_taxonomy().classes
    ours = dataclasses.replace(classes[-1], name="stop_of_ours", family="")
    taxonomy = Taxonomy((*classes[:-1], ours))
    root = ET.fromstring(renderer(by_class(taxonomy, [1, 5, 11]), "point"))  # noqa: S314 - our own
    by_name = {item.attrib["name"]: item for item in root.iter("symbol")}
    symbols = {
        item.attrib["value"]: by_name[item.attrib["symbol"]] for item in root.iter("category")
    }
    assert sorted(symbols, key=int) == ["1", "5", "11"]
    for code, symbol in symbols.items():
        sign = class_signs(taxonomy)[int(code)]
        shape, drawing = (
            {item.attrib.get("name"): item.attrib.get("value") for item in layer.iter("Option")}
            for layer in symbol.iter("layer")
        )
        colours = [(shape, sign.colour)]
        pictogram = PICTOGRAMS.get(taxonomy.by_code(int(code)).name)
        if pictogram is None:
            assert shape["name"] == CLASS_MARKERS[sign.shape][0]
            assert drawing["chr"] == sign.symbol
            colours.append((drawing, sign.ink))
        else:
            assert shape["name"] == "circle"
            svg = base64.b64decode(str(drawing["name"]).removeprefix("base64:")).decode()
            assert pictogram in svg
            assert sign.ink in svg
        for options, colour in colours:
            assert options["color"] == ",".join(map(str, (*bytes.fromhex(colour[1:]), 255)))


UNKNOWN_SHAPES = """
import sys
from qgis.core import QgsSimpleMarkerSymbolLayerBase as Markers
print([name for name in sys.argv[1:] if not Markers.decodeShape(name)[1]])
"""


def test_qgis_knows_every_shape(qgis_python: str, qgis_environment: dict[str, str]) -> None:
    names = [name for name, *_ in CLASS_MARKERS.values()]
    assert run(qgis_python, "-c", UNKNOWN_SHAPES, *names, environment=qgis_environment) == "[]\n"


def colours_of(picture: Path) -> set[tuple[int, int, int]]:
    """Return the colours of a picture that cover more than a few pixels."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(picture) as read:
            pixels = read.read()[:3].reshape(3, -1).T
    colours, counts = np.unique(pixels, axis=0, return_counts=True)
    return {*map(tuple, colours[counts > 9].tolist())}


def test_qgis_draws_the_layers_with_their_styles(
    qgis_python: str, qgis_environment: dict[str, str], tmp_path: Path
) -> None:
    extent = ",".join(map(repr, OBJECTS.table.total_bounds.tolist()))

    def draw(picture: str, *layers: str) -> list[dict[str, Any]]:
        """Draw layers, the uppermost first; return the facts that QGIS reports of each."""
        program = (qgis_python, PROGRAM, "draw", tmp_path / picture, "400x400", extent)
        output = run(*program, *layers, environment=qgis_environment)
        return [json.loads(line) for line in output.splitlines()]

    nasty = HOSTILE + "[% env('HOME') %]" + "é" * 10_000
    taxonomy = Taxonomy(tuple(dataclasses.replace(item, title=nasty) for item in CLASSES))
    harmful = dataclasses.replace(DATABASE, taxonomy=taxonomy, licenses=(nasty,))
    objects = dataclasses.replace(OBJECTS, taxonomy=taxonomy, licenses=(Licence(nasty),))
    file, answer = tmp_path / "city.gpkg", tmp_path / "answer.gpkg"
    export_database(harmful, file, objects=objects, identifiability=CHANCES, evaluation=EVALUATION)
    export_answer(small_localization(), small_city()[0], answer)
    sources = [
        *(f"{file}|layername={name}" for name in ("objects", "evaluation", "evaluation_lines")),
        *(f"{answer}|layername={name}" for name in ("candidates", "regions")),
        f"{file}|layername=cells",
    ]
    layers = draw("a.png", *sources)
    assert all(layer["valid"] for layer in layers)
    renderers = [*["categorizedSymbol"] * 3, *["graduatedSymbol"] * 3]
    assert [layer["renderer"] for layer in layers] == renderers
    labels = layers[0]["labels"]
    assert len(labels) == len(objects.class_counts)
    assert all("<script>" in label for label in labels)  # QGIS shows a legend as plain text
    assert all(label.isprintable() and "[%" not in label for label in labels)
    assert max(map(len, labels)) <= 60
    assert [layer["labels"] for layer in layers[1:3]] == [list(OUTCOMES)] * 2
    assert layers[-1]["labels"][-1] == "found: 90 to 100 %"
    assert layers[-1]["features"] == len(DATABASE)
    signs = class_signs(taxonomy)
    colours = {tuple(bytes.fromhex(signs[code].colour[1:])) for code in objects.class_counts}
    assert colours <= colours_of(tmp_path / "a.png")
    # Cells have the colours of their chance; QGIS leaves no lock on the file.
    draw("b.png", f"{file}|layername=cells")
    assert len(colours_of(tmp_path / "b.png")) >= 10
    export_database(DATABASE, file)


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
TEXTS = st.text(st.characters(codec="utf-8"), max_size=20)
FACTS = st.fixed_dictionaries(
    {
        "crs": st.sampled_from([CRS(2154), CRS(32631), LOCAL]),
        "occlusion": st.none() | st.floats(0, 5),
        "licenses": st.lists(TEXTS, max_size=3).map(tuple),
        "version": st.just("0.0.1 of yesterday"),
        "viewpoints": st.builds(
            ViewpointSpec, mode=st.just("streets"), width=st.floats(1, 50), area=st.just(AREA)
        ),
    }
)


@settings(max_examples=25)
@given(WORLDS, FACTS, st.sampled_from(["polygon", "point"]))
def test_database_is_read_back_unchanged(
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


def test_objects_and_identifiability_with_hostile_texts_are_read_back(tmp_path: Path) -> None:
    database, (_, objects) = hostile_database(small_city()[0]), small_city()
    texts = [HOSTILE, "", "\u202eright\u0001'\"); DROP TABLE cells; --" + "é" * 10_000]
    table = objects.table.assign(merged=[texts[row % 3] for row in range(len(objects))])
    objects = StreetObjects(table, database.taxonomy, (*objects.licenses, Licence(HOSTILE)))
    chances, file = chances_of(database), tmp_path / "city.gpkg"
    export_database(database, file, objects=objects, identifiability=chances)
    contents = read_geopackage(file)
    assert_same(database, contents.database)
    assert contents.notes == ()
    assert contents.identifiability is not None
    for name in {field.name for field in dataclasses.fields(Identifiability)} - {"database"}:
        assert np.array_equal(getattr(chances, name), getattr(contents.identifiability, name))
    result = contents.objects
    assert result is not None
    assert result.table.equals(table[[*result.table.columns]])
    assert set(result.table.columns) == set(table.columns)
    assert (result.crs, result.taxonomy) == (objects.crs, objects.taxonomy)
    assert result.licenses == objects.licenses


def execute(file: Path, sql: str) -> None:
    with closing(sqlite3.connect(file)) as connection, connection:
        for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'"):
            connection.execute(f'DROP TRIGGER "{name}"')  # they need functions of GDAL
        connection.execute(sql)


def test_cells_deleted_and_objects_added_in_qgis_are_read(tmp_path: Path) -> None:
    (database, objects), file = small_city(), tmp_path / "city.gpkg"
    export_database(database, file, objects=objects, identifiability=chances_of(database))
    execute(file, "DELETE FROM cells WHERE length < 3")
    # As QGIS adds a point with only its class.
    execute(file, "INSERT INTO objects (geom, class_code) SELECT geom, 3 FROM objects LIMIT 1")
    contents = read_geopackage(file)
    assert_same(database.select(database.lengths >= 3), contents.database)
    assert contents.identifiability is None
    assert "other signatures" in contents.notes[0]
    fewer = int((database.lengths < 3).sum())
    assert f"{fewer:,} fewer than exported" in contents.notes[1]
    assert "objects" in contents.notes[2]
    assert "1 more than exported" in contents.notes[2]
    assert contents.objects is not None
    row = contents.objects.table.iloc[-1]
    assert (row["source"], row["source_id"], row["count"]) == ("", "", 1)
    save_objects(contents.objects, tmp_path / "objects.parquet")
    assert len(open_objects(tmp_path / "objects.parquet")) == len(objects) + 1


def test_geometry_in_the_type_of_geoarrow_is_read(tmp_path: Path) -> None:
    types = pytest.importorskip("geoarrow.types.type_pyarrow", reason="geoarrow is not installed")
    (database, objects), file = small_city(), tmp_path / "city.gpkg"
    export_database(database, file, objects=objects)
    with types.registered_extension_types():  # as after `import geoarrow.pyarrow`
        contents = read_geopackage(file)
        layer = read_layer(file, LayerSpec(name="objects", class_name="bench", layer="objects"))
        assert contents.objects is not None
        save_objects(contents.objects, tmp_path / "objects.parquet")
    assert len(layer) == len(open_objects(tmp_path / "objects.parquet")) == len(objects)


def test_changed_cells_and_files_of_older_versions_are_noted(tmp_path: Path) -> None:
    (database, objects), file = small_city(), tmp_path / "city.gpkg"
    export_database(database, file, objects=objects)
    execute(file, "UPDATE cells SET bearings = '1.00' WHERE length = 1")
    (note,) = read_geopackage(file).notes
    assert "the layer cells" in note
    assert "was changed after it was exported" in note
    execute(file, """UPDATE gpkg_metadata SET metadata = replace(metadata, 'key="rows"', '')""")
    (note,) = read_geopackage(file).notes
    assert "older version" in note


def test_a_changed_bit_loses_no_cells_without_a_word(tmp_path: Path) -> None:
    database, file = small_city()[0], tmp_path / "city.gpkg"
    export_database(database, file)
    with closing(sqlite3.connect(file)) as connection:
        query = "SELECT rootpage FROM sqlite_master WHERE name = 'cells'"
        ((page,),) = connection.execute(query)
    intact = file.read_bytes()
    start, detected = 4096 * (page - 1), 0
    for place in range(45):  # the header of the page, and its first rows
        changed = bytearray(intact)
        changed[start + place] ^= 1 << place % 8
        file.write_bytes(changed)
        try:
            contents = read_geopackage(file)
        except DatabaseError as error:
            assert_sentence(error, "city.gpkg", "damaged")
            detected += 1
        else:
            assert contents.notes or len(contents.database) == len(database)
    assert detected > 10


def zero_pages(file: Path, start: int) -> None:
    """Write zeros over every third page."""
    content = bytearray(file.read_bytes())
    for page in range(4096 * (12 + start), len(content), 3 * 4096):
        content[page : page + 4096] = bytes(4096)
    file.write_bytes(content)


@pytest.mark.parametrize(
    "damage",
    [
        *range(3),
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
def test_damaged_file_is_refused(damage: int | str, tmp_path: Path) -> None:
    (database, objects), file = small_city(), tmp_path / "city.gpkg"
    export_database(database, file, objects=objects)
    if isinstance(damage, int):
        zero_pages(file, damage)
    else:
        execute(file, damage)
    with refused(DatabaseError, "city.gpkg", "damaged"):
        read_geopackage(file)


def test_file_without_a_database_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.gpkg").write_bytes(b"SQLite format 3\0 but not really")
    export_database(DATABASE, tmp_path / "b.gpkg", layers=["objects"], objects=OBJECTS)
    for name, words in (
        ("nowhere.gpkg", "nowhere.gpkg does not exist"),
        ("", "is a folder"),
        ("a.gpkg", "not written by semsig export"),
        ("b.gpkg", "b.gpkg has no layer 'cells'"),
    ):
        with refused(DatabaseError, words):
            read_geopackage(tmp_path / name)
