"""What every reader makes of the same rows, and of damaged, absent, other and too large files."""

from __future__ import annotations

import bz2
import gzip
import io
import json
import zipfile
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import geopandas as gpd
import numpy as np
import osmium
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pyogrio
import pytest
import shapely
from geojson import collection, feature, point
from osm_xml import node, write_osm
from raw_layers import ENGINES
from sentences import refused
from vector_files import write as write_table

from semsig_gis.core import CatalogError, CrsError, SourceError
from semsig_gis.sources import (
    HARMLESS_BYTES,
    ClassBy,
    LayerSpec,
    RowCounts,
    check_compression_ratio,
    list_layers,
    read_layer,
    read_layers,
    reader,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from semsig_gis.sources import RawLayer

    Rows = Sequence[dict[str, Any]]
    Read = Callable[..., RawLayer]
    Write = Callable[[Rows], Read]

X, Y, STEP = 2.0, 48.5, 1 / 64
THINGS = LayerSpec(name="things", class_name="bench", crs="EPSG:4326")
BENCH = {"amenity": "bench"}
TAGGED = replace(THINGS, tags=((("amenity", ("bench",)),),))


def places(rows: Rows) -> list[tuple[float, float]]:
    return [(X + STEP * n, Y) for n in range(len(rows))]


def frame(rows: Rows) -> gpd.GeoDataFrame:
    table = pd.DataFrame(list(rows)) if rows else pd.DataFrame({"kind": pd.Series(dtype="str")})
    return gpd.GeoDataFrame(
        table, geometry=shapely.points(np.reshape(places(rows), (-1, 2))), crs="EPSG:4326"
    )


def write_vector(path: Path, rows: Rows) -> None:
    # FlatGeobuf would put the rows in another order for its index.
    options = {"SPATIAL_INDEX": "NO"} if path.suffix == ".fgb" else {}
    write_table(frame(rows), path.parent, path.suffix[1:], geometry_type="Point", **options)


def write_by(driver: str, **options: str) -> Callable[[Path, Rows], None]:
    """Return a writer of files by a driver of GDAL."""

    def write(path: Path, rows: Rows) -> None:
        frame(rows).to_file(path, driver=driver, geometry_type="Point", **options)

    return write


def write_geodatabase(path: Path, rows: Rows) -> None:
    write_by("OpenFileGDB", TARGET_ARCGIS_VERSION="ARCGIS_PRO_3_2_OR_LATER")(path, rows)


def write_sheet(path: Path, rows: Rows) -> None:
    table = frame(rows)
    columns = pd.DataFrame(table.drop(columns="geometry"))
    columns = columns.assign(lon=table.geometry.x, lat=table.geometry.y)
    pyogrio.write_dataframe(columns, path, driver=path.suffix[1:].upper())


def write_compressed(path: Path, rows: Rows) -> None:
    plain = path.with_name("plain.geojson")
    write_by("GeoJSON")(plain, rows)
    path.write_bytes(gzip.compress(plain.read_bytes()))


def write_topology(path: Path, rows: Rows) -> None:
    """Write TopoJSON with positions as multiples of the step."""
    geometries = [
        {"type": "Point", "coordinates": [n, 0], "properties": row} for n, row in enumerate(rows)
    ]
    objects = {"things": {"type": "GeometryCollection", "geometries": geometries}}
    transform = {"scale": [STEP, 1], "translate": [X, Y]}
    topology = {"type": "Topology", "transform": transform, "objects": objects, "arcs": []}
    path.write_text(json.dumps(topology))


def write_map(path: Path, rows: Rows) -> None:
    """Write a saved map of uMap that has an empty layer, too."""
    features = [feature(point(*place), row) for place, row in zip(places(rows), rows, strict=True)]
    layers = [{**collection(items), "_umap_options": {"name": "x"}} for items in ([], features)]
    content = {"type": "umap", "geometry": point(9, 9), "properties": {}, "layers": layers}
    path.write_text(json.dumps(content))


def write_parquet(path: Path, rows: Rows) -> None:
    frame(rows).to_parquet(path)


def elements(rows: Rows) -> list[tuple[int, float, float, dict[str, str]]]:
    """Return number, place and tags of the rows as nodes of OpenStreetMap."""
    return [
        (n, x, y, BENCH | {key: str(value) for key, value in row.items() if value is not None})
        for n, ((x, y), row) in enumerate(zip(places(rows), rows, strict=True), start=1)
    ]


def write_extract(path: Path, rows: Rows) -> None:
    """Write an extract of OpenStreetMap, packed as its suffix says."""
    plain = write_osm(path.with_suffix(".xml"), *(node(*element) for element in elements(rows)))
    if path.suffix.lower() == ".pbf":
        packed = path.with_name("packed.osm.pbf")
        with osmium.SimpleWriter(str(packed)) as writer:
            for element in osmium.FileProcessor(str(plain), osmium.osm.NODE):
                writer.add(element)
        packed.replace(path)
        return
    content = plain.read_bytes()
    if path.suffix == ".gz":
        content = gzip.compress(content)
    if path.suffix == ".bz2":
        content = bz2.compress(content)
    path.write_bytes(content)


def write_overpass(path: Path, rows: Rows) -> None:
    nodes = [
        {"type": "node", "id": n, "lat": y, "lon": x, "tags": tags}
        for n, x, y, tags in elements(rows)
    ]
    path.write_text(json.dumps({"elements": nodes}))


def write_tagged(path: Path, rows: Rows) -> None:
    features = [feature(point(x, y), tags, id=f"node/{n}") for n, x, y, tags in elements(rows)]
    path.write_text(json.dumps(collection(features)))


def write_mapillary(path: Path, rows: Rows) -> None:
    pairs = enumerate(places(rows))
    features = [{"id": n, "object_value": "x", "geometry": point(x, y)} for n, (x, y) in pairs]
    path.write_text(json.dumps({"data": features}))


def write_overture(path: Path, rows: Rows) -> None:
    names = dict.fromkeys(key for row in rows for key in row)
    columns = {name: [row.get(name) for row in rows] for name in names}
    shapes = [shapely.to_wkb(shapely.Point(place)) for place in places(rows)]
    tags = {name: ["bench"] * len(rows) for name in ("amenity", "class")}
    ids = [f"gers-{n}" for n in range(len(rows))]
    own = {"id": pa.array(ids, pa.string()), "geometry": pa.array(shapes, pa.binary()), **tags}
    pq.write_table(pa.table({**own, **columns}), path)


def write_portal(path: Path, rows: Rows) -> None:
    pairs = zip(places(rows), rows, strict=True)
    path.write_text(json.dumps([{"geo_point_2d": [y, x], **row} for (x, y), row in pairs]))


def write_gml(path: Path, rows: Rows) -> None:
    members = "".join(
        "<member><thing>"
        + "".join(f"<{key}>{value}</{key}>" for key, value in row.items() if value is not None)
        + f"<place><gml:Point><gml:pos>{x} {y}</gml:pos></gml:Point></place></thing></member>"
        for (x, y), row in zip(places(rows), rows, strict=True)
    )
    path.write_text(f'<FeatureCollection xmlns:gml="g">{members}</FeatureCollection>')


class Case(NamedTuple):
    """A reader, a kind of file that it reads, and the words of its errors."""

    reader: str
    suffix: str
    write: Callable[[Path, Rows], object]
    spec: LayerSpec
    truncated: str = ""  # empty if the reader cannot detect it
    absent: str = "does not exist"
    folder: str = "is a folder"
    crs: str = "EPSG:4326"  # of the layer, if the user states EPSG:2154


DAMAGED = "it is damaged or not the kind"
NO_OVERPASS = "is not JSON as Overpass servers send it"
NO_ANSWER = "is not an answer of Mapillary about map features"
NO_GEOPARQUET = "cannot be read as GeoParquet"
LAMBERT = "EPSG:2154"
KINDS = {
    "CSV": Case("vector_file", "csv", write_vector, THINGS, crs=LAMBERT),
    "FlatGeobuf": Case("vector_file", "fgb", write_vector, THINGS),
    "GeoJSON": Case("vector_file", "geojson", write_vector, THINGS, "cannot be read ("),
    "GeoPackage": Case("vector_file", "gpkg", write_vector, THINGS, "cannot be read ("),
    "shapefile": Case("vector_file", "shp", write_vector, THINGS),
    "archive": Case("vector_file", "zip", write_vector, THINGS, "(File is not a zip file)"),
    "GeoJSON in lines": Case("vector_file", "ndjson", write_by("GeoJSONSeq"), THINGS, crs=LAMBERT),
    "GeoJSON, separated": Case("vector_file", "json", write_by("GeoJSONSeq", RS="YES"), THINGS,
                               crs=LAMBERT),
    "GeoJSON, gzip": Case("vector_file", "geojson.gz", write_compressed, THINGS, "cannot be read"),
    "TopoJSON": Case("vector_file", "topojson", write_topology, THINGS, "cannot be read (",
                     crs=LAMBERT),
    "uMap": Case("vector_file", "umap", write_map, THINGS, crs=LAMBERT),
    "SQLite": Case("vector_file", "sqlite", write_by("SQLite"), THINGS, "cannot be read ("),
    "KML": Case("vector_file", "kml", write_by("LIBKML"), THINGS),
    "MapInfo": Case("vector_file", "mif", write_by("MapInfo File"), THINGS),
    "geodatabase": Case("vector_file", "gdb", write_geodatabase, THINGS, folder="not the kind"),
    "Excel": Case("vector_file", "xlsx", write_sheet, THINGS, crs=LAMBERT),
    "OpenDocument": Case("vector_file", "ods", write_sheet, THINGS, crs=LAMBERT),
    "OSM": Case("osm_file", "osm", write_extract, TAGGED, DAMAGED),
    "OSM, gzip": Case("osm_file", "osm.gz", write_extract, TAGGED, DAMAGED),
    "OSM, bzip2": Case("osm_file", "osm.bz2", write_extract, TAGGED, DAMAGED),
    "OSM, mixed case": Case("osm_file", "Osm.PBF", write_extract, TAGGED),
    "OSM, upper case": Case("osm_file", "OSM", write_extract, TAGGED),
    "OSM, pbf": Case("osm_file", "pbf", write_extract, TAGGED, DAMAGED),
    "Overpass": Case("overpass", "json", write_overpass, TAGGED, NO_OVERPASS,
                     "cannot be read (No such file", "cannot be read (Is a directory"),
    "table of OSM": Case("osm_features", "geojson", write_tagged, TAGGED, "cannot be read"),
    "Mapillary": Case("mapillary", "json", write_mapillary, THINGS,
                      NO_ANSWER, NO_ANSWER, NO_ANSWER),
    "Overture": Case("overture", "parquet", write_overture, TAGGED,
                     NO_GEOPARQUET, NO_GEOPARQUET, NO_GEOPARQUET),
    "portal JSON": Case("opendatasoft", "json", write_portal, THINGS, "is not whole JSON",
                        crs=LAMBERT),
    "portal CSV": Case("opendatasoft", "csv", write_vector, THINGS, crs=LAMBERT),
    "GeoParquet": Case("opendatasoft", "parquet", write_parquet, THINGS, "is not a whole Parquet"),
    "GML": Case("wfs", "gml", write_gml, THINGS, "is not whole GML", crs=LAMBERT),
}  # fmt: skip
# Only some vector files are read by more than one engine.
BY_FIONA = {"csv", "fgb", "geojson", "gpkg", "shp", "zip"}
EACH = [
    (engine, kind)
    for kind, case in KINDS.items()
    for engine in (ENGINES if case.suffix in BY_FIONA else ENGINES[:1])
]
WITH_VALUES = [(engine, kind) for engine, kind in EACH if kind != "Mapillary"]
WITH_FIELDS = [(engine, kind) for engine, kind in WITH_VALUES if KINDS[kind].spec is not TAGGED]
# Files of these kinds that have no rows are empty, or say nothing of their fields.
WITHOUT_HEAD = {"table of OSM", "GeoJSON in lines", "GeoJSON, separated", "Excel", "OpenDocument"}
# The other readers read the rows before the end, or cannot detect it.
DETECTING = [(engine, kind) for engine, kind in EACH if KINDS[kind].truncated]


def by_each(cases: Sequence[tuple[str, str]]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize(("engine", "kind"), cases, indirect=["engine"])


@pytest.fixture
def case(engine: str, kind: str) -> Case:  # noqa: ARG001 - the engine patches the reader
    return KINDS[kind]


@pytest.fixture
def path(case: Case, tmp_path: Path) -> Path:
    return tmp_path / f"things.{case.suffix}"


@pytest.fixture
def write(case: Case, path: Path) -> Write:
    """Write rows; return a function that reads their layer with changes of its specification."""

    def call(rows: Rows) -> Read:
        case.write(path, rows)

        def read(*, filters: bool = True, crs: str | None = None, **change: Any) -> RawLayer:  # noqa: ANN401
            spec = replace(case.spec, **change)
            (layer,) = reader(case.reader)(path, [spec], filters=filters, crs=crs)
            assert layer.counts.kept == len(layer.table)
            assert layer.table.crs == (case.crs if crs else "EPSG:4326")
            return layer

        return read

    return call


def numbers(layer: RawLayer) -> list[int]:
    """Return the numbers of the rows that were kept, by their places."""
    assert set(layer.table.geometry.y) <= {Y}
    return [int(n) for n in (layer.table.geometry.x - X) / STEP]


KINDS_AND_SIZES = [
    {"kind": "Tree", "size": 1, "height": 1.0},
    {"kind": "tree", "size": 2, "height": 1.5},
    {"kind": "Tree ", "size": 3, "height": 2.0},
    {"kind": "Trees", "size": 10, "height": 2.5},
    {"kind": "Tree", "size": 1, "height": 1.0},
]


@by_each(WITH_VALUES)
def test_where_compares_values_exactly(write: Write) -> None:
    read = write(KINDS_AND_SIZES)

    def matching(**accepted: Any) -> list[int]:  # noqa: ANN401 - one value or several
        where = [(k, v if isinstance(v, tuple) else (v,)) for k, v in accepted.items()]
        layer = read(where=tuple(where))
        assert layer.counts.filtered == 5 - len(layer.table)
        return numbers(layer)

    assert matching(kind=("tree", "Trees")) == [1, 3]
    assert matching(size=1) == matching(size=1.0) == matching(size="1") == [0, 4]
    assert matching(size=(1, 10)) == [0, 3, 4]
    assert matching(height=1.5) == matching(height="1.5") == [1]
    assert matching(height=1) == matching(kind="Tree", size=1) == [0, 4]
    assert matching(kind="tree", size=1) == matching(kind=1) == matching(size=True) == []


@by_each(WITH_VALUES)
def test_class_by_where_and_not_select_rows(write: Write) -> None:
    rows: Rows = [
        {"state": "there", "level": "0", "colour": "red"},
        {"state": "there", "level": "-1", "colour": "red"},
        {"state": "gone", "level": "1", "colour": "red"},
        {"state": "there", "level": None, "colour": "blue"},
        {"state": "there", "level": "-1;0", "colour": None},
    ]
    change: dict[str, Any] = {
        "where": (("state", ("there",)),),
        "exclusions": (("level", ("<0",)),),
        "class_by": ClassBy("colour", (("red", "taxi_station"),), otherwise=True),
    }
    read = write(rows)
    layer = read(**change)
    assert layer.counts == RowCounts(read=5, filtered=1, excluded=1)
    assert numbers(layer) == [0, 3, 4]
    assert layer.table["class_name"].tolist() == ["taxi_station", "bench", "bench"]
    assert layer.notes == ("left out by the catalogue's not: level 1",)
    everything = read(filters=False, **change)
    assert (everything.counts, everything.notes) == (RowCounts(read=5), ())


# A table without rows does not show that it is from OpenStreetMap.
@by_each([case for case in EACH if case[1] not in WITHOUT_HEAD])
def test_file_without_rows_is_accepted(write: Write) -> None:
    layer = write([])(rows=(1, 5))
    assert (layer.counts, layer.notes) == (RowCounts(read=0), ("the layer has no rows",))
    text = pd.Series(dtype="str").dtype
    types = {"class_name": text, "source_id": text, "geometry": "geometry"}
    assert layer.table.dtypes.to_dict() == types


@pytest.mark.parametrize(
    "change",
    [
        {"where": (("kinds", ("a",)),)},
        {"exclusions": (("kinds", ("a",)),)},
        {"class_by": ClassBy("kinds", (("a", "bench"),))},
        {"id_field": "kinds"},
    ],
)
@by_each(WITH_FIELDS)
def test_missing_field_is_refused(change: dict[str, Any], write: Write) -> None:
    (key,) = change
    read = write([{"kind": "a", "size": 1}])
    words = f"no field 'kinds', which the catalogue names in {key.replace('exclusions', 'not')}"
    with refused(CatalogError, "layer 'things'", words, "the nearest is 'kind'", "size"):
        read(**change)
    if key in {"where", "exclusions"}:  # which needs no field if it is not applied
        assert read(filters=False, **change).counts.kept == 1


MANY: Rows = [{"n": n, "text": f"{n * 2654435761 % 2**32:x}"} for n in range(2000)]


@by_each(EACH)
def test_file_is_read_in_its_own_crs(write: Write, case: Case, path: Path) -> None:
    read = write([{"n": 1}])
    assert read(crs="EPSG:2154").counts.kept == read().counts.kept == 1
    assert reader(case.reader)(path, []) == ()


@pytest.mark.parametrize("part", [0.0, 0.001, 0.4, 0.9, 0.999])
@by_each(DETECTING)
def test_truncated_file_is_refused(write: Write, case: Case, path: Path, part: float) -> None:
    read = write(MANY)
    path.write_bytes(path.read_bytes()[: int(part * path.stat().st_size)])
    with refused(SourceError, str(path), case.truncated if part else ""):
        read()


@by_each(EACH)
def test_absent_path_and_folder_are_refused(case: Case, path: Path) -> None:
    read = reader(case.reader)
    with refused(SourceError, case.absent):
        read(path, [case.spec])
    path.mkdir()
    with refused(SourceError, case.folder):
        read(path, [case.spec])


@by_each([(engine, "GeoPackage") for engine in ENGINES])
def test_damaged_schema_of_a_geopackage_is_refused(write: Write, path: Path) -> None:
    read = write(MANY)
    path.write_bytes(path.read_bytes().replace(b"CREATE TRIGGER", b"CREATE T\xffIGGER"))
    with refused(SourceError, f"{path} cannot be read ("):
        read()


@by_each([(ENGINES[0], "GeoParquet")])
def test_damaged_values_of_a_parquet_file_are_refused(write: Write, path: Path) -> None:
    read = write(MANY)
    content = path.read_bytes()  # the metadata at the end stays
    size = 4 * len(content) // 5
    path.write_bytes(content[:4] + bytes(size - 4) + content[size:])
    with refused(SourceError, str(path), "whole Parquet"):
        read()


def parquet(**columns: list[Any]) -> bytes:
    stream = io.BytesIO()
    pq.write_table(pa.table(columns), stream)
    return stream.getvalue()


# Files that a reader refuses: reader, name, content and the words of the error.
GEOJSON = json.dumps(collection([feature(point(2, 48), BENCH)])).encode()
REPORT = b"<ExceptionReport><ExceptionText>No.</ExceptionText></ExceptionReport>"
TIMED_OUT = b'{"elements": [], "remark": "runtime error: Query timed out after 91 seconds."}'
OSM = b'<osm version="0.6"><node id="1" version="1" lat="48" lon="2"/></osm>'
OSM_BOMB = b'<!DOCTYPE osm [<!ENTITY a "aaaa">]><osm version="0.6">&a;</osm>'
PAGE = b"<!DOCTYPE html><html><body>Log in</body></html>"
TRACK = b'<trk><trkseg><trkpt lat="48" lon="2"/><trkpt lat="49" lon="2"/></trkseg></trk>'
GPX = b'<gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1">' + TRACK + b"</gpx>"
LINK = b"<OGRVRTDataSource><!-- <kml --></OGRVRTDataSource>"
WRONG_FILES: list[tuple[str, str, bytes, str]] = [
    *(("vector_file", f"a.{suffix}", PAGE, "web page")
      for suffix in ("csv", "geojson", "gpkg", "kml", "shp", "xlsx", "zip", "html")),
    ("vector_file", "a.csv", b"PK\3\4" + bytes(99), "a ZIP archive: rename it to end with .zip"),
    ("vector_file", "a.geojson", gzip.compress(b"{}"), "add .gz to its name"),
    ("vector_file", "a.geojson", b"lon,lat\n1,2\n", "rename it to end with .csv"),
    ("vector_file", "a", b"lon,lat\n1,2\n", "rename it to end with .csv"),
    ("vector_file", "a.xml", b"<kml></kml>", "rename it to end with .kml"),
    ("vector_file", "a.kml", LINK, "not the kind"),
    *(("vector_file", name, b"var x = {}", "JavaScript") for name in ("a.js", "a.geojson")),
    *(("vector_file", name, b"Rar!", "unpack it") for name in ("a.rar", "a.7z", "a.tar.gz")),
    ("vector_file", "a.sql", b"SET x;", "`ogr2ogr out.gpkg PG:"),
    ("vector_file", "a.e00", b"EXP", "`ogr2ogr out.gpkg a.e00`"),
    ("vector_file", "a.dbf", b"\3", "give its .shp"),
    ("vector_file", "a.tab", b"!table", "with .dat, .map and .id"),
    ("vector_file", "a.gdb", b"x", "give the folder"),
    ("vector_file", "a.gpx", GPX, "has 1 tracks and 0 routes, but no waypoints"),
    ("vector_file", "a.topojson", b'{"type": "Topology", "arcs": [1]}', "not whole"),
    *(("vector_file", f"a.{suffix}", content, f"a.{suffix}")
      for suffix in ("fgb", "geojson", "gpkg", "json", "shp")
      for content in (b"", b'[{"a": 1}]')),
    # What GDAL accepts after the end, or in a member that it ignores.
    *(("vector_file", "a.geojson", GEOJSON[:-1] + b', "a": ' + damage, "download it again")
      for damage in (b"{", b'"\x01"', b"[" * 5000)),
    *(("vector_file", "a.csv", content, "a.csv")
      for content in (b"", b"\xef\xbb\xbf", b"\n\n", b"\0\1\2" * 99, bytes(range(256)))),
    ("osm_file", "a.osm", b"", "is empty"),
    ("osm_file", "a.osm", b'<osm version="0.6"><node id="1" lat="north" lon="2"/></osm>', "north"),
    *(("osm_file", f"a.osm{suffix}", content, "download it again")
      for suffix in ("", ".gz", ".bz2", ".pbf")
      for content in (b'{"elements": []}', b"<gpx></gpx>", OSM_BOMB)),
    *(("osm_file", f"a.osm{suffix}", packed, "download it again")
      for suffix, unpack in (("", bytes), (".gz", gzip.compress), (".bz2", bz2.compress))
      for packed in (bz2.compress(OSM), gzip.compress(OSM), b"\0\0\0\x0d\x0a\x09OSMHeader")
      if packed != unpack(OSM)),
    *(("osm_file", f"a.osm{suffix}", OSM, "download it again") for suffix in (".bz2", ".pbf")),
    *(("overpass", "a.json", content, NO_OVERPASS)
      for content in (b"", b"\xff\xfe", b"null", b"[" * 100_000)),
    ("overpass", "a.json", TIMED_OUT, "is incomplete (runtime error: Query timed out"),
    *(("mapillary", "a.json", content, NO_ANSWER)
      for content in (b'{"data": [{"id": 1}]}', b"[]", b'{"features": [1]}', b"x")),
    ("overture", "a.parquet", b"PAR1", NO_GEOPARQUET),
    ("overture", "a.parquet", parquet(id=["a"], amenity=["bench"]), "not a file of Overture Maps"),
    ("overture", "a.parquet", parquet(id=["a"], amenity=["x"]), "its columns are id, amenity"),
    ("opendatasoft", "a.json", b"", "is empty"),
    ("opendatasoft", "a.json", b'[{"a": 1}, {"a"', "whole JSON"),
    ("opendatasoft", "a.json", b"[" * 100_000, "whole JSON"),
    ("opendatasoft", "a.json", b'{"message": "no such dataset"}', "no records"),
    ("opendatasoft", "a.json", b'{"results": 3}', "no records"),
    ("opendatasoft", "a.json", b"[1, 2]", "no records"),
    ("opendatasoft", "a.json", b'[{"a": "\xe9"}]', "is not UTF-8 text"),
    ("opendatasoft", "a.csv", b"\xef\xbb\xbf \n", "is empty"),
    ("opendatasoft", "a.csv", b"a;b\n1;2\n", "geometry_field"),
    ("opendatasoft", "a.png", b"\x89PNG\r\n\x1a\n\0\0", "its content is a picture"),
    ("opendatasoft", "a.gpkg", b"SQLite", "a.gpkg"),
    ("opendatasoft", "a.parquet", b"PAR1" + bytes(100), "whole Parquet"),
    ("opendatasoft", "a.parquet", b"PAR1", "whole Parquet"),
    ("wfs", "a.gml", b"<!DOCTYPE html><html/>", "web page"),
    ("wfs", "a.gml", b"<kml/>", "its content is KML: rename it to end with .kml"),
    ("wfs", "a.gml", REPORT, "contains the error No"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("engine", "wrong"),
    [
        (engine, wrong)
        for wrong in WRONG_FILES
        for engine in (ENGINES if wrong[0] == "vector_file" else ENGINES[:1])
    ],
    indirect=["engine"],
)
@pytest.mark.usefixtures("engine")
def test_damaged_file_or_other_content_is_refused(
    tmp_path: Path, wrong: tuple[str, str, bytes, str]
) -> None:
    name, file, content, words = wrong
    path = tmp_path / file
    path.write_bytes(content)
    with refused(SourceError, str(path), words):
        reader(name)(path, [TAGGED])
    if name == "vector_file":
        with refused(SourceError, str(path), words):
            list_layers(path)


@by_each([(ENGINES[0], "GML")])
def test_unknown_crs_of_gml_is_refused(write: Write, path: Path) -> None:
    read = write([{"n": 1}])
    path.write_bytes(path.read_bytes().replace(b"<place>", b"<place srsName='EPSG:99999'>"))
    with refused(CrsError, "'EPSG:99999'", "unknown"):
        read()


# Several members in succession, so that the test compresses less.
GZIP_BOMB = gzip.compress(b" " * 2**24) * 10
BZIP_BOMB = bz2.compress(b" " * 2**24) * 10


@pytest.mark.parametrize(("suffix", "bomb"), [(".gz", GZIP_BOMB), (".bz2", BZIP_BOMB)])
def test_extract_with_a_high_ratio_is_refused(tmp_path: Path, suffix: str, bomb: bytes) -> None:
    path = tmp_path / f"city.osm{suffix}"
    path.write_bytes(bomb)
    with refused(SourceError, f"{path} unpacks to more than 250 times", "give what is inside"):
        read_layers(path, [TAGGED])


def test_archive_with_a_high_ratio_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "city.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("city.csv", b" " * (HARMLESS_BYTES + 1))
    with refused(SourceError, f"city.csv in {path} unpacks to more than 250 times"):
        read_layer(path, THINGS)


@pytest.mark.parametrize(
    "content", [gzip.compress(b" " * 2**24), GZIP_BOMB[:1000], b"", b"no archive"]
)
def test_small_or_damaged_file_passes(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "city.osm.gz"
    path.write_bytes(content)
    check_compression_ratio(path)
