"""Vector files: the real ones of Montpellier, and ones the tests write and damage."""

from __future__ import annotations

import contextlib
import json
import math
import shutil
import sqlite3
import struct
import tempfile
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
import pyogrio
import pytest
import shapely
from geojson import collection, feature, point
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pyproj import CRS
from sentences import refused
from vector_files import pack, write

from semsig_gis.core import CatalogError, CrsError, SourceError, UnknownNameError
from semsig_gis.sources import ClassBy, LayerSpec, list_layers, read_layer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from semsig_gis.sources import RawLayer

    Publication = Callable[[str], Path]

DATA = Path(__file__).with_name("data")
CODED_DOMAIN = """
CREATE TABLE gpkg_data_columns (
    table_name TEXT, column_name TEXT, name TEXT, title TEXT, description TEXT, mime_type TEXT,
    constraint_name TEXT
);
CREATE TABLE gpkg_data_column_constraints (
    constraint_name TEXT, constraint_type TEXT, value TEXT, min NUMERIC, min_is_inclusive BOOLEAN,
    max NUMERIC, max_is_inclusive BOOLEAN, description TEXT
);
INSERT INTO gpkg_extensions
SELECT column1, NULL, 'gpkg_schema', 'http://www.geopackage.org/spec/#extension_schema',
    'read-write' FROM (VALUES ('gpkg_data_columns'), ('gpkg_data_column_constraints'));
INSERT INTO gpkg_data_columns (table_name, column_name, constraint_name)
VALUES ('trees', 'kind', 'kinds');
INSERT INTO gpkg_data_column_constraints (constraint_name, constraint_type, value, description)
VALUES ('kinds', 'enum', '1', 'oak'), ('kinds', 'enum', '2', 'elm'), ('kinds', 'enum', '4', NULL);
"""
FORMATS = ("csv", "fgb", "geojson", "gpkg", "shp", "zip")

pytestmark = pytest.mark.usefixtures("engine")


def spec_of(**what: Any) -> LayerSpec:  # noqa: ANN401 - any field of a LayerSpec
    return LayerSpec(**{"name": "things", "class_name": "bench", **what})


def frame(xy: Iterable[tuple[float, float]], **columns: Any) -> gpd.GeoDataFrame:  # noqa: ANN401
    points = shapely.points(np.array(list(xy), dtype=float).reshape(-1, 2))
    return gpd.GeoDataFrame(columns, geometry=points, crs="EPSG:2154")


def text_file(folder: Path, name: str, text: str, encoding: str = "utf-8") -> Path:
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


def write_geojson(folder: Path, *geometries: object, rows: Any = (), **members: object) -> Path:  # noqa: ANN401 - values
    """Write features of these geometries; `rows` are properties other than a number."""
    rows = rows or [{"n": n} for n in range(len(geometries))]
    document = collection(map(feature, geometries, rows), **members)
    return text_file(folder, "things.geojson", json.dumps(document))


def crs_member(name: str) -> dict[str, object]:
    return {"type": "name", "properties": {"name": name}}


def xy(layer: RawLayer) -> list[list[float]]:
    coordinates: list[list[float]] = shapely.get_coordinates(layer.table.geometry.array).tolist()
    return coordinates


def read(path: Path, **what: Any) -> RawLayer:  # noqa: ANN401 - any field of a LayerSpec
    return read_layer(path, spec_of(**what))


def counts(layer: RawLayer) -> tuple[int, int, int]:
    """Return how many rows were read, kept, and unreadable; the others are filtered."""
    rows, count = layer.counts, len(layer.table)
    assert rows.read == count + rows.filtered + rows.unreadable
    return rows.read, count, rows.unreadable


@pytest.fixture(scope="session")
def montpellier(geodata: Path) -> Publication:
    return lambda name: geodata / "montpellier" / f"VilleMTP_MTP_{name}"


def test_published_coordinates_are_unchanged(montpellier: Publication) -> None:
    path = montpellier("Horodateurs_2011.zip")
    with zipfile.ZipFile(path) as archive:
        shp = archive.read("VilleMTP_MTP_Horodateurs_2011.shp")
    # Of a point shapefile: a header of 100 bytes, then 8 + 20 bytes a record, x and y at the end.
    stored = [struct.unpack_from("<2d", shp, 100 + 28 * n + 12) for n in range(823)]
    assert xy(read(path)) == [list(pair) for pair in stored]


def test_published_polygons_and_lines_are_unchanged(montpellier: Publication) -> None:
    layer = read(montpellier("Batiments.zip"), geometry="polygon")
    assert (counts(layer), layer.notes) == ((3356, 3356, 0), ())
    assert set(layer.table.geom_type) <= {"Polygon", "MultiPolygon"}
    layer = read(montpellier("AccTrottoir.zip"))
    assert layer.notes == ("7654 of 7654 rows are LineString, not point",)


def test_published_geojson_in_metres(montpellier: Publication) -> None:
    path = montpellier("Signalisation.geojson")
    with refused(CrsError, "(767686.3955, 6279032.6454)", "state the crs"):
        read(path)
    by_user = read_layer(path, spec_of(), crs="EPSG:2154")
    by_catalogue = read(path, crs="EPSG:2154")
    twin = read(montpellier("Signalisation.zip"))
    assert by_user.table.crs == by_catalogue.table.crs == twin.table.crs
    assert by_user.notes == by_catalogue.notes == ()
    np.testing.assert_allclose(xy(by_user), xy(twin), atol=1e-6)
    assert list_layers(path)[0].crs is None


@pytest.fixture
def fountains(montpellier: Publication, tmp_path: Path) -> Path:
    """Return an unpacked copy of a real shapefile of 89 points."""
    with zipfile.ZipFile(montpellier("FontainesPublic.zip")) as archive:
        archive.extractall(tmp_path / "fountains")
    return tmp_path / "fountains" / "VilleMTP_MTP_FontainesPublic.shp"


def cut(path: Path, size: int) -> None:
    path.write_bytes(path.read_bytes()[:size])


@pytest.mark.parametrize(
    ("suffix", "size", "count", "error"),
    [
        (".shp", 100 + 28 * 50, 50, "row 51: Error in fread()"),  # 50 whole records
        (".dbf", 10_000, 27, "row 28: fread(343) failed on DBF file"),
    ],
)
def test_truncated_shapefile_loses_only_its_end(
    fountains: Path, tmp_path: Path, engine: str, *, suffix: str, size: int, count: int, error: str
) -> None:
    cut(fountains.with_suffix(suffix), size)
    layer = read(fountains, id_field="ID")
    assert counts(layer) == (89, count, 89 - count)
    assert len(layer.errors) == 10
    if suffix == ".shp":
        error = error if "fiona" in engine else "row 51: its geometry is damaged"
        archive = pack(tmp_path / "cut.zip", *fountains.parent.iterdir())
        assert counts(read(archive)) == counts(layer)
    assert layer.errors[0].startswith(error)


def test_corrupt_records_are_counted(fountains: Path, engine: str) -> None:
    content = bytearray(fountains.read_bytes())
    struct.pack_into("<d", content, 100 + 28 * 5 + 12, math.nan)  # x of row 6
    struct.pack_into("<i", content, 100 + 28 * 9 + 8, 0)  # row 10 becomes a null shape
    struct.pack_into("<i", content, 100 + 28 * 11 + 8, 5)  # row 12 becomes a polygon
    fountains.write_bytes(content)
    layer = read(fountains)
    assert counts(layer) == (89, 87, 2)
    y = "6279715.2637" if "fiona" in engine else "nan"
    assert layer.errors[0].startswith(f"row 6: its coordinates (nan, {y}")
    damage = "Corrupted .shp file" if "fiona" in engine else "its geometry is damaged"
    assert layer.errors[1].startswith(f"row 12: {damage}")
    assert layer.table.geometry.isna().sum() == 1


@pytest.mark.parametrize("encoding", ["UTF-8", "ISO-8859-1"])
def test_shapefile_without_encoding_is_utf8_or_else_latin(tmp_path: Path, encoding: str) -> None:
    table = frame([(1, 2), (3, 4)], kind=["allée", "square"])
    path = tmp_path / "things.shp"
    table.to_file(path, encoding=encoding)
    path.with_suffix(".cpg").unlink()
    layer = read(path, where=(("kind", ("allée",)),))
    assert xy(layer) == [[1, 2]]
    assert counts(layer) == (2, 1, 0)
    notes = [note for note in layer.notes if "the encoding is not stated; read as cp1252" in note]
    assert layer.notes == (() if encoding == "UTF-8" else tuple(notes))
    assert bool(notes) == (encoding != "UTF-8")


def test_field_names_of_a_shapefile_without_encoding_are_latin(tmp_path: Path) -> None:
    table = frame([(1, 2), (3, 4)], catégorie=["allée", "square"])
    path = tmp_path / "things.shp"
    table.to_file(path, encoding="ISO-8859-1")
    path.with_suffix(".cpg").unlink()
    layer = read(path, where=(("catégorie", ("allée",)),))
    assert xy(layer) == [[1, 2]]
    assert counts(layer) == (2, 1, 0)


@pytest.mark.parametrize(
    ("suffix", "message"), [(".shp", "unreadable, or corrupt"), (".shx", "shx")]
)
def test_incomplete_shapefile_is_refused(fountains: Path, suffix: str, message: str) -> None:
    cut(fountains.with_suffix(suffix), 50)
    with refused(SourceError, message, "download it again"):
        read(fountains)


def test_damaged_archive_is_refused(montpellier: Publication, tmp_path: Path) -> None:
    path = Path(shutil.copy(montpellier("FontainesPublic.zip"), tmp_path / "copy.zip"))
    content = path.read_bytes()
    cut(path, len(content) // 2)
    with refused(SourceError, "copy.zip cannot be read (File is not a zip file)"):
        list_layers(path)
    path.write_bytes(content[:3000] + bytes(100) + content[3100:])
    with refused(SourceError, "copy.zip is damaged at VilleMTP_MTP_Fontaines", "shx"):
        read(path)


# Eighths of a metre are exact in binary and in the fifteen digits that text formats keep.
metres = st.integers(-80_000_000, 80_000_000).map(lambda n: n / 8)
things = st.lists(
    st.tuples(metres, metres, st.sampled_from(["bench", "Bänk", "a, b; c", "x"])), min_size=1
)


@pytest.mark.parametrize("suffix", FORMATS)
@given(rows=things)
@example(rows=[(0.0, 0.0, "x")])
@settings(max_examples=8)
def test_rows_of_every_format_are_read(suffix: str, rows: list[tuple[float, float, str]]) -> None:
    x, y, kinds = zip(*rows, strict=True)
    table = frame(zip(x, y, strict=True), ident=np.arange(len(rows)) + 100, kind=list(kinds))
    spec = spec_of(id_field="ident", where=(("kind", ("Bänk", "a, b; c")),), crs="EPSG:2154")
    with tempfile.TemporaryDirectory() as folder:
        path = write(table, Path(folder), suffix)
        layer = read_layer(path, spec)
        (info,) = list_layers(path)
        numbered = read_layer(path, spec_of(crs="EPSG:2154"), filters=False)
    expected = {
        str(100 + n): [a, b] for n, (a, b, kind) in enumerate(rows) if kind in {"Bänk", "a, b; c"}
    }
    assert counts(layer) == (len(rows), len(expected), 0)
    assert (info.rows, info.crs) == (len(rows), None if suffix == "csv" else "EPSG:2154")
    assert {"ident", "kind"} <= set(info.fields)
    assert layer.table.crs == CRS.from_epsg(2154)
    # FlatGeobuf stores features in the order of a space-filling curve.
    assert dict(zip(layer.table["source_id"], xy(layer), strict=True)) == expected
    assert sorted(xy(numbered)) == sorted([a, b] for a, b, _ in rows)
    assert numbered.table["source_id"].is_unique


TEXT = pd.Series(dtype="str").dtype
TYPES = {"class_name": TEXT, "source_id": TEXT, "geometry": "geometry"}


@pytest.mark.parametrize("name", ["x#y?z! %20", "x%y;z", "x&y!z"])
@pytest.mark.parametrize("suffix", FORMATS)
def test_file_names_with_special_characters(suffix: str, name: str, tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    plain.mkdir()
    path = write(frame([(1, 2)], n=[1]), plain, suffix)
    folder = plain.rename(tmp_path / f"in {name}")
    path = folder / path.name
    if suffix != "shp":
        path = path.rename(folder / f"{name}.{suffix}")
    assert read(path, crs="EPSG:2154").table.dtypes.to_dict() == TYPES
    assert list_layers(path)[0].rows == 1


@pytest.mark.parametrize("suffix", ["fgb", "geojson", "gpkg", "shp"])
def test_null_and_empty_geometries_are_not_errors(suffix: str, tmp_path: Path) -> None:
    table = frame([(1, 2), (3, 4), (5, 6), (7, 8)], n=[1, 2, 3, 4])
    table.loc[1, "geometry"] = None
    table.loc[2, "geometry"] = shapely.Point()
    path = tmp_path / f"things.{suffix}"
    table.to_file(path, **({"SPATIAL_INDEX": "NO"} if suffix == "fgb" else {}))
    layer = read(path)
    assert counts(layer) == (4, 4, 0)
    missing = layer.table.geometry.isna() | layer.table.geometry.is_empty
    assert missing.tolist() == [False, True, True, False]


def test_other_geometries_are_noted() -> None:
    layer = read(DATA / "mixed.geojson", rows=(10, 20))
    kinds = ["Point", "Point", "Point", "LineString", "Polygon", "GeometryCollection"]
    assert layer.table.geom_type.tolist() == kinds
    assert counts(layer) == (6, 6, 0)
    assert not layer.table.has_z.any()  # the third dimension of points is left out
    assert layer.notes == (
        "the layer has 5 rows, and 10 to 20 were expected",
        "3 of 5 rows are GeometryCollection, LineString, Polygon, not point",
        "1 rows are MultiPoints; each of their 2 points is an object, counted as a row",
    )


def test_invalid_geojson_geometries_are_distinguished_from_null(tmp_path: Path) -> None:
    path = DATA / "broken.geojson"  # five rows are valid: a point, and empty geometries
    layer = read(path)
    assert counts(layer) == (13, 5, 8)
    assert [message.split(":")[0] for message in layer.errors] == [f"row {n}" for n in range(1, 9)]
    assert layer.errors[0] == "row 1: its geometry is not valid GeoJSON"
    assert layer.errors[6].startswith("row 7: its LineString is not valid")
    archive = pack(tmp_path / "things.zip", path, inside="below/")
    assert read(archive).errors == layer.errors
    feature = text_file(tmp_path, "things.geojson", json.dumps(point(3, 43)))  # without features
    assert xy(read(feature)) == [[3.0, 43.0]]


def test_open_rings_are_closed_and_counted(tmp_path: Path) -> None:
    corners = [[3.0, 43.0], [3.1, 43.0], [3.1, 43.1], [3.0, 43.1]]
    whole, hole = [*corners, corners[0]], [[3.04, 43.04], [3.06, 43.04], [3.06, 43.06]]
    shapes: dict[str, list[Any]] = {
        "Polygon": [[corners], [whole], [whole, hole]],
        "MultiPolygon": [[[whole], [corners]]],
    }
    geometries = [
        {"type": kind, "coordinates": coordinates}
        for kind, several in shapes.items()
        for coordinates in several
    ]
    layer = read(write_geojson(tmp_path, *geometries), geometry="polygon")
    assert layer.notes == ("3 of 4 rows have rings that are not closed; closed here",)
    assert (layer.counts.kept, layer.table.geometry[0].area) == (4, pytest.approx(0.01))


def test_coordinates_that_are_not_finite_are_errors(tmp_path: Path, engine: str) -> None:
    line = {"type": "LineString", "coordinates": [[1, 2], [math.nan, 3]]}
    bad = [point(math.nan, 43), point(3, math.inf), line, point(3, 430)]
    good = [point(3, 43), point(180, 90), point(-180, -90)]
    layer = read(write_geojson(tmp_path, *bad, *good))
    assert counts(layer) == (7, 3, 4)
    assert layer.errors == (
        f"row 1: its coordinates (nan, {43 if 'fiona' in engine else 'nan'}) are not finite",
        "row 2: its coordinates (3, inf) are not finite",
        "row 3: its coordinates (nan, 3) are not finite",
        "row 4: its coordinates (3, 430) are not in EPSG:4326",
    )


def test_truncated_flatgeobuf_loses_only_its_end(tmp_path: Path) -> None:
    path = write(frame([(n, n) for n in range(2000)], n=range(2000)), tmp_path, "fgb")
    cut(path, 2 * path.stat().st_size // 3)
    layer = read(path)
    rows, count, _ = counts(layer)
    assert (rows, len(layer.errors)) == (2000, 10)
    assert 0 < count < 2000


def test_gdal_prints_nothing(
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    engine: str,
) -> None:
    path = write(frame([(n, n) for n in range(9)], n=range(9)), tmp_path, "shp")
    cut(path, 200)
    assert read(path).counts.unreadable == 6
    write_geojson(tmp_path, point("a", "b"), point(3, 43))
    assert read(tmp_path / "things.geojson").counts.unreadable == 1
    with pytest.raises(SourceError):
        read(text_file(tmp_path, "none.gpkg", "none"))
    assert caplog.records == []
    assert capfd.readouterr().err == ""
    if "fiona" in engine:  # what others do with fiona still reaches their log
        fiona = pytest.importorskip("fiona")
        with fiona.open(path) as source:
            assert len(list(source)) == 9
        assert "Error in fread" in caplog.text


@pytest.mark.parametrize("wish", [None, False])
def test_gdal_option_of_the_user_is_restored(tmp_path: Path, wish: object) -> None:
    path = write(frame([(0, 0)], n=[1]), tmp_path, "shp")
    pyogrio.set_gdal_config_options({"USE_OSR_FIND_MATCHES": wish})
    try:
        assert counts(read(path)) == (1, 1, 0)
        assert pyogrio.get_gdal_config_option("USE_OSR_FIND_MATCHES") is wish
    finally:
        pyogrio.set_gdal_config_options({"USE_OSR_FIND_MATCHES": None})


@pytest.mark.parametrize("separator", [";", ",", "\t"])
@pytest.mark.parametrize("header", ["lon lat", "Longitude LATITUDE", "X Y", "lat lon", "y x"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_csv_dialects(tmp_path: Path, separator: str, header: str, encoding: str) -> None:
    names = header.split()
    values = ["43.5", "3.25"] if names[0] in {"lat", "y"} else ["3.25", "43.5"]
    lines = [separator.join(["ident", *names]), separator.join(["7", *values])]
    path = text_file(tmp_path, "things.csv", "\r\n".join(lines) + "\r\n", encoding)
    layer = read(path, crs="EPSG:4326", id_field="ident")
    assert xy(layer) == [[3.25, 43.5]]
    assert layer.table["source_id"].tolist() == ["7"]
    (info,) = list_layers(path)
    assert (info.geometry, info.crs) == ("Point", None)
    assert list(info.fields) == ["ident", *names]


EAST = "x;y;size (a, b, c, d);east;north\n1;2;9,5;765277,5;6275109,25\n"


@pytest.mark.parametrize(
    ("text", "what", "places"),
    [
        (EAST, {"x_field": "east", "y_field": "north"}, [[765277.5, 6275109.25]]),
        (EAST, {}, [[1.0, 2.0]]),
        ("\ufeffx,y,2014\n1,2,3\n1,3,4\n", {"where": (("2014", (3,)),)}, [[1.0, 2.0]]),
        # Degrees go before a plane.
        ("x,y,lat,lon\n765277,6275109,43.5,3.25\n", {"crs": "EPSG:4326"}, [[3.25, 43.5]]),
    ],
)
def test_csv_coordinates(
    tmp_path: Path, text: str, what: dict[str, Any], places: list[list[float]]
) -> None:
    path = text_file(tmp_path, "things.csv", text)
    for file in (path, pack(tmp_path / "things.zip", path)):
        assert xy(read(file, **{"crs": "EPSG:2154", **what})) == places


def test_csv_rows_without_numbers_are_errors(tmp_path: Path) -> None:
    rows = ["1;2", "here;2", "1;", ";", " ; ", "nan;1", "1;inf", "1,5;2", "1", "1;2;3;4"]
    path = text_file(tmp_path, "things.csv", "x;y\n" + "\n".join(rows) + "\n")
    layer = read(path, crs="EPSG:2154")
    assert counts(layer) == (10, 4, 6)
    assert layer.errors == (
        "row 2: x 'here' is not a number",
        "row 3: y '' is not a number",
        "row 6: x 'nan' is not a number",
        "row 7: y 'inf' is not a number",
        "row 9: y '' is not a number",
        "row 10: has 4 values, and the header has 2 names",
    )
    assert layer.table.geometry.isna().sum() == 2
    assert xy(layer) == [[1.0, 2.0], [1.5, 2.0]]


@pytest.mark.parametrize(
    ("what", "error", "words"),
    [
        ({}, SourceError, ["only ident, place", "x_field", "y_field", "geometry_field"]),
        ({"x_field": "plase", "y_field": "place"}, CatalogError, ["'plase'", "is 'place'"]),
        ({"x_field": "place", "y_field": "placed"}, CatalogError, ["'placed'", "is 'place'"]),
        ({"x_field": "place"}, CatalogError, ["only one of x_field and y_field"]),
    ],
)
def test_csv_without_coordinates_is_refused(
    tmp_path: Path, what: dict[str, str], error: type[Exception], words: list[str]
) -> None:
    path = text_file(tmp_path, "things.csv", "ident;place\n1;here\n")
    with refused(error, *words):
        read(path, **what)
    assert list_layers(path)[0].geometry == "None"


@pytest.mark.parametrize("suffix", ["csv", "fgb", "gpkg", "shp"])
@pytest.mark.filterwarnings("ignore:'crs' was not provided")
def test_missing_crs_is_refused(suffix: str, tmp_path: Path) -> None:
    table = frame([(765277, 6275109)], n=[1]).set_crs(None, allow_override=True)
    path = write(table, tmp_path, suffix)
    assert list_layers(path)[0].crs is None
    with refused(CrsError, "'things'", "does not say which CRS", "state its crs"):
        read(path)
    assert read(path, crs="EPSG:2154").table.crs == CRS.from_epsg(2154)
    layer = read_layer(path, spec_of(crs="EPSG:4326"), crs="EPSG:2154")  # the user knows better
    assert layer.table.crs == CRS.from_epsg(2154)
    with refused(CrsError, "CRS 'EPSG:99' is unknown"):
        read_layer(path, spec_of(), crs="EPSG:99")


LAMBERT = {"crs": crs_member("urn:ogc:def:crs:EPSG::2154")}
CRS84 = {"crs": crs_member("urn:ogc:def:crs:OGC:1.3:CRS84")}
STATED = "the coordinates look like degrees, yet EPSG:2154 is stated"
OTHER = "the file is in EPSG:4326, not in EPSG:2154 as stated; the file's CRS is used"
DEGREES, PLANE = (3, 43), (765277, 6275109)


@pytest.mark.parametrize(
    "case",
    [
        ({}, DEGREES, None, "EPSG:4326", ()),
        ({}, DEGREES, "EPSG:2154", "EPSG:2154", (STATED,)),
        (LAMBERT, PLANE, "EPSG:2154", "EPSG:2154", ()),
        (CRS84, DEGREES, "EPSG:2154", "EPSG:4326", (OTHER,)),
    ],
)
def test_crs_of_geojson(tmp_path: Path, case: tuple[Any, ...]) -> None:
    members, place, stated, crs, notes = case
    # A property of that name says nothing.
    path = write_geojson(tmp_path, point(*place), rows=[{"crs": "EPSG:2154"}], **members)
    layer = read(path, crs=stated)
    assert (layer.table.crs, layer.notes) == (crs, notes)
    assert list_layers(path)[0].crs == ("EPSG:2154" if members is LAMBERT else "EPSG:4326")


def test_geojson_with_a_null_or_wrong_crs(tmp_path: Path) -> None:
    for member in (None, crs_member("urn:nobody:knows")):
        path = write_geojson(tmp_path, point(*DEGREES), crs=member)
        with refused(CrsError, "does not say which CRS"):
            read(path)
        assert list_layers(path)[0].crs is None
    path = write_geojson(tmp_path, point(*PLANE), crs=crs_member("urn:ogc:def:crs:EPSG::4326"))
    with refused(CrsError, "correct the file"):
        read_layer(path, spec_of(), crs="EPSG:2154")


@pytest.mark.parametrize(("value", "filtered"), [(True, 3), ("false", 3), (1, 4)])
def test_where_on_logical_and_missing_values(tmp_path: Path, value: Any, filtered: int) -> None:  # noqa: ANN401
    rows = [{"on": True}, {"on": False}, {"on": None}, {}]
    path = write_geojson(tmp_path, *[point(3, 43)] * 4, rows=rows)
    assert read(path, where=(("on", (value,)),)).counts.filtered == filtered


def test_classes_and_identifiers(tmp_path: Path) -> None:
    table = frame([(n, 0) for n in range(4)], n=[123704.0, 2.0, 1.5, None])
    by = ClassBy("n", (("123704", "bus_stop"), (2, "taxi_station")), otherwise=True)
    layer = read(write(table, tmp_path, "gpkg"), id_field="n", class_by=by)
    assert layer.table["class_name"].tolist() == ["bus_stop", "taxi_station", "bench", "bench"]
    # A feature without a value has its number.
    assert layer.table["source_id"].tolist() == ["123704", "2", "1.5", "4"]
    text = "n;x;y\n123704.0;1;2\n 007 ;1;2\n1.50;1;2\nA1.0;1;2\n;1;2\n"
    layer = read(text_file(tmp_path, "t.csv", text), id_field="n", crs="EPSG:2154")
    assert layer.table["source_id"].tolist() == ["123704", "007", "1.50", "A1.0", "5"]


@pytest.fixture
def container(tmp_path: Path) -> Path:
    path = tmp_path / "city.gpkg"
    frame([(1, 2)], n=[1]).to_file(path, layer="trees")
    frame([(1, 2), (3, 4)], n=[1, 2]).to_file(path, layer="lights")
    return path


def test_layers_of_a_container(container: Path) -> None:
    layers = {layer.name: layer.rows for layer in list_layers(container)}
    assert layers == {"trees": 1, "lights": 2}
    assert read(container, layer="lights").counts.read == 2
    with refused(SourceError, "contains 2 layers (trees, lights); give the name of one"):
        read(container)
    with refused(UnknownNameError, "no layer 'light'; the nearest is 'lights'"):
        read(container, layer="light")


def test_values_of_a_coded_domain_are_their_labels(tmp_path: Path, engine: str) -> None:
    if engine == "fiona":
        pytest.skip("fiona, which reads damaged files, returns the codes")
    path = tmp_path / "city.gpkg"
    kinds = pd.array([1, 2, 7, 4, None], dtype="Int32")
    frame([(n, n) for n in range(5)], kind=kinds).to_file(path, layer="trees")
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.executescript(CODED_DOMAIN)
    names = ("oak", "elm", "7", "4", "none")  # two codes are without a label
    for row, name in enumerate(names):
        layer = read(path, where=(("kind", (name,)),))
        assert (xy(layer), counts(layer)) == ([[row, row]], (5, 1, 0))
    by = ClassBy("kind", (("oak", "bench"), ("elm", "street_light")))
    layer = read(path, class_name=None, class_by=by)
    assert layer.table["class_name"].tolist() == ["bench", "street_light"]


def test_tables_without_geometry_are_ignored(container: Path, tmp_path: Path) -> None:
    single = tmp_path / "single.gpkg"
    frame([(1, 2)], n=[1]).to_file(single, layer="trees")
    for path in (single, container):
        pyogrio.write_dataframe(pd.DataFrame({"styleName": ["red"]}), path, layer="layer_styles")
    assert read(single).counts.read == 1
    with refused(SourceError, "contains 2 layers (trees, lights)"):
        read(container)
    with refused(SourceError, "has no geometry"):
        read(single, layer="layer_styles")
    assert list_layers(single)[1].geometry == "None"


def test_archive_with_folders_and_companions(tmp_path: Path) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    write(frame([(1, 2)], n=[1]), inner, "shp")
    text_file(inner, "legend.csv", "code;meaning\n1;oak\n")
    text_file(inner, "metadata.json", "{}")
    path = pack(tmp_path / "city.zip", *inner.iterdir(), inside="data/2014/")
    assert [layer.name for layer in list_layers(path)] == ["things"]
    assert read(path).counts.read == 1
    write_geojson(inner, point(3, 43))
    with refused(SourceError, "contains 2 layers"):
        read(pack(tmp_path / "two.zip", *inner.iterdir()))


def test_path_that_is_not_a_vector_file_is_refused(tmp_path: Path) -> None:
    text = text_file(tmp_path, "readme.md", "x,y\n1,2\n")
    empty = tmp_path / "empty.gpkg"
    frame([(1, 2)], n=[1]).to_file(empty, SPATIAL_INDEX="NO")
    with contextlib.closing(sqlite3.connect(empty)) as container:
        container.executescript(
            "DELETE FROM gpkg_contents; DELETE FROM gpkg_geometry_columns; DROP TABLE empty;"
        )
    for path, words in (
        (text, "readme.md is not a vector file; give one of .csv"),
        (pack(tmp_path / "a.zip", text), "contains no vector file, only readme.md; one of .csv"),
        (pack(tmp_path / "b.zip"), "only nothing"),
        (empty, "empty.gpkg"),
    ):
        for use in (read, list_layers):
            with refused(SourceError, words):
                use(path)


def test_drivers_are_limited(tmp_path: Path) -> None:
    write_geojson(tmp_path, point(3, 43))
    link = (
        "<OGRVRTDataSource><OGRVRTLayer name='things'>"
        f"<SrcDataSource>{tmp_path / 'things.geojson'}</SrcDataSource>"
        "</OGRVRTLayer></OGRVRTDataSource>"
    )
    path = text_file(tmp_path, "link.geojson", link)
    assert pyogrio.read_info(path)["driver"] == "OGR_VRT"  # GDAL not held back
    with refused(SourceError, "not the kind of file that its name says"):
        list_layers(path)
