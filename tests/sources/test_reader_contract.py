"""What every reader does with files that are damaged, of another kind, absent or too large."""

from __future__ import annotations

import bz2
import gzip
import io
import json
import tempfile
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import geopandas as gpd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from geojson import collection, feature, point
from sentences import refused

from semsig_gis.core import CrsError, SourceError
from semsig_gis.sources import (
    HARMLESS_BYTES,
    LayerSpec,
    check_compression_ratio,
    list_layers,
    read_layer,
    read_layers,
    reader,
)
from semsig_gis.sources.osm import features, file, overpass
from semsig_gis.sources.readers import mapillary, overture
from semsig_gis.sources.services import layers as services

if TYPE_CHECKING:
    from collections.abc import Callable

pytestmark = pytest.mark.usefixtures("engine")


def parquet(**columns: list[Any]) -> bytes:
    stream = io.BytesIO()
    pq.write_table(pa.table(columns), stream)
    return stream.getvalue()


def vector(suffix: str) -> bytes:
    """Return the content of a vector file with some points."""
    places = shapely.points([(2 + n / 1000, 48) for n in range(500)])
    table = gpd.GeoDataFrame({"n": range(500)}, geometry=places, crs="EPSG:4326")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a.{suffix}"
        table.to_file(path)
        return path.read_bytes()


PLAIN = LayerSpec(name="benches", class_name="bench")
OSM = LayerSpec(name="benches", class_name="bench", tags=((("amenity", ("bench",)),),))
OVERTURE = LayerSpec(name="benches", class_name="bench", tags=((("class", ("bench",)),),))
WKB = [shapely.to_wkb(shapely.Point(2, 48))]
POINT = point(2, 48)
BENCH = {"amenity": "bench"}


def encoded(content: object) -> bytes:
    return json.dumps(content).encode()


class Case(NamedTuple):
    """A reader with a file of benches, and the words of its errors."""

    read: Callable[..., Any]
    spec: LayerSpec
    name: str
    content: bytes
    truncated: str = ""  # empty if the reader cannot detect it
    absent: str = "does not exist"
    folder: str = "is a folder"
    crs: str = "EPSG:4326"  # of the layer, if the user states EPSG:2154
    rows: int = 1


NO_OVERPASS = "is not JSON as Overpass servers send it"
NO_GEOPARQUET = "cannot be read as GeoParquet"
NO_ANSWER = "is not an answer of Mapillary about map features"
OSM_XML = (
    b'<osm version="0.6"><node id="1" version="1" lat="48" lon="2">'
    b'<tag k="amenity" v="bench"/></node></osm>'
)
OVERPASS = {"elements": [{"type": "node", "id": 1, "lat": 48, "lon": 2, "tags": BENCH}]}
GEOJSON = collection([feature(POINT, BENCH)])
MAP_FEATURES = {"data": [{"id": "1", "object_value": "x", "geometry": POINT}]}
GML = (
    b'<FeatureCollection xmlns:gml="g"><member><a><p><gml:Point><gml:pos>2 48</gml:pos>'
    b"</gml:Point></p></a></member></FeatureCollection>"
)
OVERTURE_COLUMNS: dict[str, list[Any]] = {"id": ["1"], "geometry": WKB, "class": ["bench"]}
VECTOR = reader("vector_file")
IN_DEGREES = replace(PLAIN, crs="EPSG:4326")
GEOPACKAGE, FLATGEOBUF = vector("gpkg"), vector("fgb")
CASES = {
    "vector GeoJSON": Case(VECTOR, PLAIN, "a.geojson", encoded(GEOJSON), "cannot be read (",
                           crs="EPSG:2154"),
    "vector GeoPackage": Case(VECTOR, PLAIN, "a.gpkg", GEOPACKAGE, "cannot be read (", rows=500),
    "vector FlatGeobuf": Case(VECTOR, PLAIN, "a.fgb", FLATGEOBUF, rows=500),
    "vector CSV": Case(VECTOR, IN_DEGREES, "a.csv", b"x;y\n2;48\n", crs="EPSG:2154"),
    "osm_file": Case(file.read_layers, OSM, "a.osm", OSM_XML, "it is damaged or not the kind"),
    "overpass": Case(overpass.read_layers, OSM, "a.json", encoded(OVERPASS), NO_OVERPASS,
                     "cannot be read (No such file", "cannot be read (Is a directory"),
    "osm_features": Case(features.read_layers, OSM, "a.geojson", encoded(GEOJSON),
                         "cannot be read"),
    "mapillary": Case(mapillary.read_layers, PLAIN, "a.json", encoded(MAP_FEATURES),
                      NO_ANSWER, NO_ANSWER, NO_ANSWER),
    "overture": Case(overture.read_layers, OVERTURE, "a.parquet", parquet(**OVERTURE_COLUMNS),
                     NO_GEOPARQUET, NO_GEOPARQUET, NO_GEOPARQUET),
    "service JSON": Case(services.read_layers, PLAIN, "a.json",
                         encoded([{"geo_point_2d": [48, 2]}]), "is not whole JSON",
                         crs="EPSG:2154"),
    "service GML": Case(services.read_layers, PLAIN, "a.gml", GML, "is not whole GML",
                        crs="EPSG:2154"),
    "service Parquet": Case(services.read_layers, PLAIN, "a.parquet", parquet(geo_shape=WKB),
                            "is not a whole Parquet", crs="EPSG:2154"),
}  # fmt: skip
# The other readers read the rows before the end, or cannot detect it.
DETECTING = {name: case for name, case in CASES.items() if case.truncated}
# Files that a reader refuses: their name, content and the words of the error.
REPORT = b"<ExceptionReport><ExceptionText>No.</ExceptionText></ExceptionReport>"
TIMED_OUT = b'{"elements": [], "remark": "runtime error: Query timed out after 91 seconds."}'
WHOLE = parquet(idbase=list(range(50)), geo_shape=WKB * 50)
WRONG_FILES: dict[str, list[tuple[str, bytes, str]]] = {
    "vector GeoJSON": [
        *((f"a.{suffix}", content, f"a.{suffix}")
          for suffix in ("fgb", "geojson", "gpkg", "json", "shp")
          for content in (b"", b'[{"a": 1}]')),
        # What GDAL accepts after the end, or in a member that it ignores.
        *(("a.geojson", encoded(GEOJSON)[:-1] + b', "a": ' + damage, "download it again")
          for damage in (b"{", b'"\x01"', b"[" * 5000)),
        ("a.gpkg", GEOPACKAGE.replace(b"CREATE TRIGGER", b"CREATE T\xffIGGER"),
         "a.gpkg cannot be read ("),
    ],
    "vector CSV": [
        ("a.csv", content, "a.csv")
        for content in (b"", b"\xef\xbb\xbf", b"\n\n", b"\0\1\2" * 99, bytes(range(256)))
    ],
    "osm_file": [
        ("a.osm", b"", "is empty"),
        ("a.osm", b'<osm version="0.6"><node id="1" lat="north" lon="2"/></osm>', "north"),
    ],
    "overpass": [
        *(("a.json", content, NO_OVERPASS)
          for content in (b"", b"\xff\xfe", b"null", b"[" * 100_000)),
        ("a.json", TIMED_OUT, "is incomplete (runtime error: Query timed out"),
    ],
    "mapillary": [
        ("a.json", content, NO_ANSWER)
        for content in (b'{"data": [{"id": 1}]}', b"[]", b'{"features": [1]}', b"x")
    ],
    "overture": [
        ("a.parquet", b"PAR1", NO_GEOPARQUET),
        ("a.parquet", parquet(id=["a"], amenity=["bench"]), "not a file of Overture Maps"),
        ("a.parquet", parquet(id=["a"], amenity=["bench"]), "its columns are id, amenity"),
    ],
    "service JSON": [
        ("a.json", b"", "is empty"),
        ("a.json", b'[{"a": 1}, {"a"', "whole JSON"),
        ("a.json", b"[" * 100_000, "whole JSON"),
        ("a.json", b'{"message": "no such dataset"}', "no records"),
        ("a.json", b'{"results": 3}', "no records"),
        ("a.json", b"[1, 2]", "no records"),
        ("a.json", b'[{"a": "\xe9"}]', "is not UTF-8 text"),
        ("a.csv", b"\xef\xbb\xbf \n", "is empty"),
        ("a.csv", b"a;b\n1;2\n", "geo_point_2d"),
        ("a.png", b"\x89PNG\r\n\x1a\n\0\0", "unknown encoding"),
        ("a.gpkg", b"SQLite", "a.gpkg"),
    ],
    "service GML": [
        ("a.gml", b"<!DOCTYPE html><html/>", "document type"),
        ("a.gml", b"<kml/>", "has no features"),
        ("a.gml", REPORT, "contains the error No"),
    ],
    "service Parquet": [
        ("a.parquet", b"PAR1" + bytes(100), "whole Parquet"),
        ("a.parquet", b"PAR1", "whole Parquet"),
        ("a.parquet", WHOLE[:-40], "whole Parquet"),
        # The metadata at the end is intact, the values are not.
        ("a.parquet", b"PAR1" + bytes(len(WHOLE) // 3) + WHOLE[4 + len(WHOLE) // 3 :],
         "whole Parquet"),
    ],
}  # fmt: skip


@pytest.fixture(params=CASES.values(), ids=list(CASES))
def case(request: pytest.FixtureRequest) -> Case:
    result: Case = request.param
    return result


def test_file_is_read_in_its_own_crs(case: Case, tmp_path: Path) -> None:
    path = tmp_path / case.name
    path.write_bytes(case.content)
    for stated, expected in ((None, "EPSG:4326"), ("EPSG:2154", case.crs)):
        (layer,) = case.read(path, [case.spec], crs=stated)
        assert (layer.counts.kept, len(layer.table)) == (case.rows, case.rows)
        assert layer.table.crs == expected
    assert case.read(path, []) == ()


@pytest.mark.parametrize("part", [0.4, 0.9])
@pytest.mark.parametrize("case", DETECTING.values(), ids=list(DETECTING))
def test_truncated_file_is_refused(case: Case, tmp_path: Path, part: float) -> None:
    path = tmp_path / case.name
    path.write_bytes(case.content[: int(part * len(case.content))])
    with refused(SourceError, str(path), case.truncated):
        case.read(path, [case.spec])


def test_absent_path_and_folder_are_refused(case: Case, tmp_path: Path) -> None:
    with refused(SourceError, case.absent):
        case.read(tmp_path / case.name, [case.spec])
    (tmp_path / case.name).mkdir()
    with refused(SourceError, case.folder):
        case.read(tmp_path / case.name, [case.spec])


@pytest.mark.parametrize(
    ("key", "name", "content", "words"),
    [(key, *wrong) for key, files in WRONG_FILES.items() for wrong in files],
)
def test_damaged_file_or_other_content_is_refused(
    tmp_path: Path, key: str, name: str, content: bytes, words: str
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with refused(SourceError, str(path), words):
        CASES[key].read(path, [CASES[key].spec])
    if key.startswith("vector"):
        with refused(SourceError, str(path), words):
            list_layers(path)


def test_unknown_crs_of_gml_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.gml"
    path.write_bytes(CASES["service GML"].content.replace(b"<p>", b"<p srsName='EPSG:99999'>"))
    with refused(CrsError, "'EPSG:99999'", "unknown"):
        services.read_layers(path, [PLAIN])


# Several members in succession, so that the test compresses less.
GZIP_BOMB = gzip.compress(b" " * 2**24) * 10
BZIP_BOMB = bz2.compress(b" " * 2**24) * 10


@pytest.mark.parametrize(("suffix", "bomb"), [(".gz", GZIP_BOMB), (".bz2", BZIP_BOMB)])
def test_extract_with_a_high_ratio_is_refused(tmp_path: Path, suffix: str, bomb: bytes) -> None:
    path = tmp_path / f"city.osm{suffix}"
    path.write_bytes(bomb)
    with refused(SourceError, f"{path} unpacks to more than 250 times", "give what is inside"):
        read_layers(path, [OSM])


def test_archive_with_a_high_ratio_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "city.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("city.csv", b" " * (HARMLESS_BYTES + 1))
    with refused(SourceError, f"city.csv in {path} unpacks to more than 250 times"):
        read_layer(path, PLAIN)


@pytest.mark.parametrize(
    "content", [gzip.compress(b" " * 2**24), GZIP_BOMB[:1000], b"", b"no archive"]
)
def test_small_or_damaged_file_passes(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "city.osm.gz"
    path.write_bytes(content)
    check_compression_ratio(path)
