"""Files of Opendatasoft portals in all formats, and a local portal."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from geojson import collection, feature
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from raw_layers import ids, xy
from sentences import refused
from servers import Answer, published
from stand_ins import sent

from semsig_gis.core import CatalogError, CrsError, SourceError
from semsig_gis.sources import Area, ClassBy, LayerSpec, find_field, fold
from semsig_gis.sources.readers import opendatasoft
from semsig_gis.sources.services.fetch import fetch_layers
from semsig_gis.sources.services.layers import read_layers

if TYPE_CHECKING:
    from collections.abc import Callable

    from servers import Request, Server

    from semsig_gis.sources import Cache, Fetched, HttpSpec, RawLayer

    Fetch = Callable[..., Fetched]
    Read = Callable[..., RawLayer]

PLAIN = LayerSpec(name="a", class_name="bench")
TREES = LayerSpec(
    name="trees",
    class_name="alignment_tree",
    files=("les-arbres*",),
    dataset="les-arbres",
    id_field="IDBASE",
    unique_id=True,
)
ALIGNED = replace(
    TREES,
    where=(("DOMANIALITE", ("Alignement",)),),
    class_by=ClassBy("DOMANIALITE", (("/Jard.*/", "bench"),), otherwise=True),
)
# Three trees in all formats of a portal.
DATA = Path(__file__).with_name("data") / "les-arbres"
IDS, DOMAINS = [11, 12, 13], ["Alignement", "Jardin", "Alignement"]
XY = [(2.35, 48.85), (2.36, 48.86), (2.37, 48.87)]


def read(path: Path, spec: LayerSpec = TREES, **options: Any) -> RawLayer:  # noqa: ANN401
    (layer,) = read_layers(path, [spec], **options)
    assert layer.counts.kept == len(layer.table)
    return layer


def shape(lon: float, lat: float, kind: str = "Point") -> dict[str, Any]:
    return {"type": kind, "coordinates": [lon, lat] if kind == "Point" else [[lon, lat]]}


def parquet(ids: list[Any], **columns: Any) -> bytes:  # noqa: ANN401
    stream = io.BytesIO()
    pq.write_table(pa.table({"idbase": ids, "domanialite": DOMAINS, **columns}), stream)
    return stream.getvalue()


WKB = [shapely.to_wkb(shapely.Point(*place)) for place in XY]
WHOLE = parquet([float(n) for n in IDS], geo_point_2d=WKB, geo_shape=WKB)
FILES: dict[str, bytes] = {path.name: path.read_bytes() for path in sorted(DATA.iterdir())} | {
    "wkb.parquet": WHOLE,
    "struct.parquet": parquet(IDS, geo_point_2d=[{"lon": lon, "lat": lat} for lon, lat in XY]),
    "text.parquet": parquet(
        IDS,
        geo_point_2d=[f"{lat}, {lon}" for lon, lat in XY],
        geo_shape=[json.dumps(shape(lon, lat)) for lon, lat in XY],
    ),
}
PUBLISHED = FILES["v21.geojson"]


@pytest.mark.parametrize("name", FILES)
def test_all_file_formats_give_the_same_layer(read_as: Read, tmp_path: Path, name: str) -> None:
    unfiltered = read_as(name, FILES[name], ALIGNED, filters=False)
    assert [*unfiltered.table["class_name"]] == ["alignment_tree", "bench", "alignment_tree"]
    everything, some = read_layers(tmp_path / name, [TREES, ALIGNED])
    assert (ids(everything), xy(everything)) == (["11", "12", "13"], XY)
    assert everything.table.crs == "EPSG:4326"
    assert (everything.errors, everything.notes) == ((), ())
    assert (ids(some), some.counts.filtered) == (["11", "13"], 1)
    assert (everything.spec, some.spec) == (TREES, ALIGNED)


@pytest.mark.parametrize("name", ["trees.gpkg", "trees.fgb", "trees.shp", "trees.geojson"])
def test_vector_file_of_another_program_is_read(tmp_path: Path, name: str) -> None:
    frame = gpd.GeoDataFrame(
        {"idbase": [float(number) for number in IDS], "domanialit": DOMAINS},
        geometry=shapely.points(XY),
        crs="EPSG:4326",
    ).to_crs("EPSG:2154")
    # FlatGeobuf would put the rows in another order for its index.
    options = {"SPATIAL_INDEX": "NO"} if name.endswith(".fgb") else {}
    frame.to_file(tmp_path / name, **options)
    spec = replace(ALIGNED, aliases=(("DOMANIALITE", ("DOMANIALIT",)),))
    layer = read(tmp_path / name, spec)
    assert (ids(layer), layer.table.crs) == (["11", "13"], "EPSG:2154")
    assert layer.spec is spec
    back = shapely.get_coordinates(layer.table.to_crs("EPSG:4326").geometry.array)
    assert back == pytest.approx(np.array(XY)[[0, 2]], abs=1e-6)


def test_geoparquet_metadata_names_the_geometry(tmp_path: Path) -> None:
    columns = {"idbase": IDS, "place": shapely.points(XY)}
    frame = gpd.GeoDataFrame(columns, geometry="place", crs="EPSG:4326")
    frame.to_parquet(tmp_path / "a.parquet")
    assert xy(read(tmp_path / "a.parquet")) == XY
    frame.to_crs("EPSG:2154").to_parquet(tmp_path / "b.parquet")
    assert read(tmp_path / "b.parquet").table.crs == "EPSG:2154"


@pytest.mark.parametrize(
    "names",
    [
        ("TYPE EMPLACEMENT", "TYPEEMPLACEMENT", "typeemplacement", "Type_Emplacement"),
        ("Disponibilité", "DISPONIBILITE", "disponibilite\u0301", "\ufeffdisponibilite"),
        ("geo_point_2d", "Geo Point 2D", "geopoint2d"),
        ("CIRCONFERENCE (cm)", "circonference_cm"),
    ],
)
def test_spellings_of_a_name_fold_to_one(names: tuple[str, ...]) -> None:
    assert len({fold(name) for name in names}) == 1


@given(st.text())
def test_fold_is_idempotent(name: str) -> None:
    assert fold(fold(name)) == fold(name)


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        (["gid", "GID"], "gid"),
        (["GID", "Identifiant"], "Identifiant"),
        (["GID", "IDENTIFIANT"], "GID"),
        (["IDENTIFIANT", "x"], "IDENTIFIANT"),
        (["°", "gid2", "id"], None),
        ([], None),
    ],
)
def test_exact_field_name_is_preferred(fields: list[str], expected: str | None) -> None:
    spec = replace(TREES, aliases=(("gid", ("Identifiant",)),))
    assert find_field("gid", spec, fields) == expected


def test_shape_is_preferred_to_point_and_point_to_coordinates(read_as: Read) -> None:
    line = {"type": "LineString", "coordinates": [[2.0, 48.0], [2.2, 48.0]]}
    rows = [
        {"geo_shape": line, "geo_point_2d": [49, 3], "lng": 4, "lat": 50},
        {"geo_shape": None, "geo_point_2d": [49, 3], "lng": 4, "lat": 50},
        {"geo_shape": {"type": "Feature", "geometry": None}, "lng": "4", "lat": "50"},
        {"geo_point_2d": "", "lng": None, "lat": ""},
        {"lng": 0.0, "lat": 0.0},
    ]
    layer = read_as("a.json", rows, replace(PLAIN, geometry="line", x_field="LNG", y_field="lat"))
    assert xy(layer) == [(2.1, 48.0), (3.0, 49.0), (4.0, 50.0), (0.0, 0.0)]
    assert layer.table.geometry.isna().tolist() == [False, False, False, True, False]


def test_alias_names_the_point_field(read_as: Read) -> None:
    text = "id;geopoint;geopoint_datagouv\n1;48.85, 2.35;2.35, 48.85\n"
    assert xy(read_as("taxi.csv", text, PLAIN)) == [(2.35, 48.85)]
    with_alias = replace(PLAIN, aliases=(("geo_point_2d", ("geopoint",)),))
    assert xy(read_as("taxi.csv", text, with_alias)) == [(2.35, 48.85)]


BAD_ROWS = {
    "geo_point_2d 'nowhere' is not": {"geo_point_2d": "nowhere"},
    "geo_point_2d '1, 2, 3' is not": {"geo_point_2d": "1, 2, 3"},
    "geo_point_2d '[1]' is not": {"geo_point_2d": [1]},
    "geo_point_2d \"{'lon': 2}\" is not": {"geo_point_2d": {"lon": 2}},
    "geo_point_2d '7' is not": {"geo_point_2d": 7},
    'geo_shape \'{"type": "Po\' is not': {"geo_shape": '{"type": "Po'},
    "geo_shape \"{'type': 'Point'}\" is not": {"geo_shape": {"type": "Point"}},
    "geo_shape \"{'type': 'Blob', 'coordinates': [1]}\" is not": {
        "geo_shape": {"type": "Blob", "coordinates": [1]}
    },
    "its coordinates (2.35, 95) are not in EPSG:4326": {"geo_point_2d": [95, 2.35]},
    "its coordinates (inf, 48.85) are not finite": {"geo_point_2d": [48.85, math.inf]},
    "its coordinates (nan, 1) are not finite": {
        "geo_shape": {"type": "LineString", "coordinates": [[math.nan, 1], [2, 3]]}
    },
    "lng '' is not a number": {"lng": "", "lat": "48.86"},
    "lat 'here' is not a number": {"lng": "2.37", "lat": "here"},
}


@pytest.mark.parametrize("message", BAD_ROWS)
def test_invalid_row_is_counted_and_the_others_are_read(read_as: Read, message: str) -> None:
    good = {"geo_point_2d": [48.85, 2.35], "geo_shape": None}
    rows = [good, BAD_ROWS[message], good, "what?"]
    layer = read_as("a.json", rows, replace(PLAIN, x_field="lng", y_field="lat"))
    assert xy(layer) == [(2.35, 48.85)] * 2
    assert layer.counts.unreadable == 2
    assert layer.errors[0].startswith(f"row 2: {message}")
    assert layer.errors[1] == 'row 4: is "what?", not a record'


def test_invalid_lines_of_a_csv_file_are_counted(read_as: Read) -> None:
    text = (
        "IDBASE;geo_point_2d\n1;48.1,2.1\n\n2;48.2,2.2;x\n3\n"
        '4;"48.4,2.4"x\n5;48.5,2.5\n6;"48.6,2.6\n7;48.7,2.7\n'
    )
    layer = read_as("a.csv", text, TREES)
    assert ids(layer) == ["1", "3", "5"]
    assert layer.table.geometry.isna().tolist() == [False, True, False]
    assert [error.partition(": ")[2] for error in layer.errors] == [
        "has 3 values, and the header has 2 names",
        "cannot be read (';' expected after '\"')",
        "cannot be read (unexpected end of data)",
    ]


def test_shape_may_exceed_the_csv_field_limit(read_as: Read) -> None:
    circle = shapely.Point(2.35, 48.85).buffer(0.01, quad_segs=5_000)
    text = shapely.to_geojson(circle)
    before = csv.field_size_limit()
    assert len(text) > before
    quoted = text.replace('"', '""')
    layer = read_as("a.csv", f'geo_shape\n"{quoted}"\n', replace(PLAIN, geometry="polygon"))
    assert xy(layer)[0] == pytest.approx((2.35, 48.85))
    assert csv.field_size_limit() == before


def test_rows_with_one_id_are_one_object(read_as: Read) -> None:
    text = (
        "IDBASE;geo_point_2d\n1;\n2;48.2,2.2\n1;48.1,2.1\n2.0;48.2,2.2\n;48.3,2.3\n;48.4,2.4\n"
        "2;nowhere\n5;\n"
    )
    layer = read_as("a.csv", text, TREES)
    # Of the first id, the row that has a position stays; rows without an id all stay.
    assert ids(layer) == ["2", "1", "", "", "5"]
    assert xy(layer) == [(2.2, 48.2), (2.1, 48.1), (2.3, 48.3), (2.4, 48.4)]
    assert (layer.counts.read, layer.counts.duplicates, layer.counts.unreadable) == (8, 2, 1)
    assert layer.notes == ()
    others = read_as("a.csv", text, replace(TREES, unique_id=False))
    assert ids(others) == ["1", "2", "1", "2", "5", "6", "5"]
    assert others.counts.duplicates == 0


def test_rows_with_one_id_at_different_places_are_noted(read_as: Read) -> None:
    rows = "1;new;48.1,2.1\n1;new;48.1,2.1000001\n1;new;48.1,2.2\n2;new;48,2\n"
    text = f"IDBASE;state;geo_point_2d\n2;old;48,1\n{rows}"  # the filter comes before the ids
    layer = read_as("a.csv", text, replace(TREES, where=(("state", ("new",)),)))
    assert xy(layer) == [(2.1, 48.1), (2.0, 48.0)]
    assert (layer.counts.filtered, layer.counts.duplicates) == (1, 2)
    assert layer.notes == (
        "1 rows have the id of a row at another place; the place of the first row is used",
    )


def test_stated_crs_replaces_the_default(read_as: Read) -> None:
    text = "x_l93;y_l93\n652000;6862000\n"
    spec = replace(PLAIN, x_field="X_L93", y_field="Y_L93")
    with refused(CrsError, "652000", "EPSG:4326", "crs"):
        read_as("a.csv", text, spec)
    assert read_as("a.csv", text, replace(spec, crs="EPSG:2154")).table.crs == "EPSG:2154"
    assert read_as("a.csv", text, spec, crs="EPSG:2154").table.crs == "EPSG:2154"


@pytest.mark.parametrize(
    ("member", "expected"),
    [
        ({"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}, "EPSG:4326"),
        ({"type": "name", "properties": {"name": "EPSG:2154"}}, "EPSG:2154"),
        ({"type": "name", "properties": {"name": "nonsense"}}, None),
        ("EPSG:2154", "EPSG:2154"),
        ({"type": "link"}, None),
    ],
)
def test_crs_member_of_geojson_is_used(read_as: Read, member: object, expected: str | None) -> None:
    content = {"crs": member, **json.loads(PUBLISHED)}
    with nullcontext() if expected else refused(CrsError, "a.geojson", "CRS"):
        assert read_as("a.geojson", content, TREES).table.crs == expected


@pytest.mark.parametrize(
    "content", [[], {"type": "FeatureCollection", "features": []}, {"results": []}]
)
def test_file_without_rows_is_accepted(read_as: Read, content: object) -> None:
    layer = read_as("a.json", content, ALIGNED)
    assert (layer.counts.read, len(layer.table), layer.table.crs) == (0, 0, "EPSG:4326")
    assert layer.notes == ("the layer has no rows",)


coordinates = st.tuples(st.floats(-180, 180), st.floats(-90, 90))
SPELLINGS: list[Callable[[float, float], dict[str, Any]]] = [
    lambda x, y: {"geo_point_2d": f"{y!r}, {x!r}"},
    lambda x, y: {"geo_point_2d": f"{y!r},{x!r}"},
    lambda x, y: {"geo_point_2d": [y, x]},
    lambda x, y: {"geo_point_2d": {"lon": x, "lat": y}},
    lambda x, y: {"geo_point_2d": shape(x, y)},
    lambda x, y: {"geo_shape": shape(x, y)},
    lambda x, y: {"geo_shape": json.dumps(shape(x, y, "MultiPoint"))},
    lambda x, y: {"geo_shape": {"type": "Feature", "geometry": shape(x, y)}},
]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(places=st.lists(coordinates, min_size=1, max_size=5))
def test_spellings_of_a_point_give_one_position(
    read_as: Read, places: list[tuple[float, float]]
) -> None:
    rows = [spelling(x, y) for x, y in places for spelling in SPELLINGS]
    rows = [{"geo_shape": None, "geo_point_2d": None} | row for row in rows]
    layer = read_as("a.json", rows, PLAIN)
    points = shapely.get_coordinates(layer.table.geometry.array)
    assert points.tolist() == [[x, y] for x, y in places for _ in SPELLINGS]


ROWS = [{"geo_point_2d": {"lon": 2.3, "lat": 48.8}}] * 2


@pytest.mark.parametrize(
    ("page", "rest"),
    [
        ({"total_count": 1323, "results": ROWS}, "1,321 records more"),
        ({"nhits": 3, "records": ROWS}, "1 records more"),
        ({"total_count": 2, "results": ROWS}, None),
        ({"total_count": "many", "results": ROWS}, None),
    ],
)
def test_single_page_of_a_dataset_is_noted(
    read_as: Read, page: dict[str, Any], rest: str | None
) -> None:
    layer = read_as("page.json", page, PLAIN)
    assert layer.counts.read == 2
    assert len(layer.notes) == (rest is not None)
    assert rest is None or rest in layer.notes[0]


DATASETS = "/api/explore/v2.1/catalog/datasets"
DESCRIPTION = f"{DATASETS}/les-arbres"
EXPORT = f"{DESCRIPTION}/exports/geojson"
TYPES = {
    "idbase": "int",
    "domanialite": "text",
    "geo_shape": "geo_shape",
    "geo_point_2d": "geo_point_2d",
}


def holds(condition: str, row: dict[str, Any]) -> bool:
    """Whether a condition is true for a row, for the conditions that the package writes."""
    place = shapely.Point(row["geo_point_2d"]["lon"], row["geo_point_2d"]["lat"])
    box = re.fullmatch(r"in_bbox\(geo_point_2d, (\S+), (\S+), (\S+), (\S+)\)", condition)
    if box:
        south, west, north, east = map(float, box.groups())
        return bool(shapely.box(west, south, east, north).covers(place))
    outline = re.fullmatch(r"intersects\(geo_point_2d, geom'(.+)'\)", condition)
    if outline:
        return bool(shapely.from_wkt(outline[1]).intersects(place))
    equals = re.fullmatch(r"(\w+) = '(\w+)'", condition)
    assert equals, condition
    return bool(row[equals[1]] == equals[2])


def exported(request: Request) -> Answer:
    """Answer to an export as the Explore API v2.1 does."""
    assert request.query["limit"] == "-1"
    conditions = re.findall(r"\((.+?)\)(?: and (?=\()|$)", request.query.get("where", ""))
    names = request.query.get("select", ",".join(TYPES)).split(",")
    assert set(names) <= set(TYPES)
    features = []
    for row in json.loads(FILES["v21.json"]):
        if all(holds(text, row) for text in conditions):
            properties = {name: row[name] for name in names}
            features.append(feature(properties.pop("geo_shape")["geometry"], properties))
    return sent(collection(features), type="application/geo+json", chunked=True)


@pytest.fixture
def fetched(server: Server, cache: Cache, quick: HttpSpec) -> Fetch:
    """Fetch one layer from the server, which is a portal with one dataset."""
    described = {"fields": [{"name": name, "type": kind} for name, kind in TYPES.items()]}
    server.on(DESCRIPTION, published(json.dumps(described).encode(), etag='"d"'))
    server.on(EXPORT, exported)

    def fetch(layer: LayerSpec = TREES, **options: Any) -> Fetched:  # noqa: ANN401
        arguments = {"endpoints": [server.url], "cache": cache, "spec": quick, **options}
        (download,) = fetch_layers(opendatasoft.fetch_layer, [layer], **arguments)
        assert download.spec is layer
        (file,) = download.files
        return file

    return fetch


def box(west: float, south: float, east: float, north: float) -> Area:
    return Area(shapely.box(west, south, east, north), "a box")


def test_export_is_fetched_and_read(server: Server, fetched: Fetch, quick: HttpSpec) -> None:
    steps: list[tuple[int, int]] = []
    file = fetched(progress=lambda size, total: steps.append((size, total)))
    layer = read(file.path)
    assert (ids(layer), xy(layer)) == (["11", "12", "13"], XY)
    assert steps[-1][0] == file.path.stat().st_size
    assert server.paths() == [DESCRIPTION, EXPORT]
    assert fetched(spec=replace(quick, offline=True)) == replace(file, from_cache=True)
    assert len(server.requests) == 2
    assert len(read(fetched(area=box(5.0, 48.0, 5.1, 48.1)).path).table) == 0  # not an error


def test_export_is_limited_by_filter_area_and_fields(server: Server, fetched: Fetch) -> None:
    spec = replace(ALIGNED, server_where="domanialite = 'Alignement'", select=("IDBASE",))
    file = fetched(spec, endpoints=[f"{server.url}/"], area=box(2.0, 48.0, 2.36, 48.9))
    query = server.requests[-1].query
    assert query["where"] == (
        "(domanialite = 'Alignement') and "
        "(in_bbox(geo_point_2d, 48.0000000, 2.0000000, 48.9000000, 2.3600000))"
    )
    assert query["select"] == "idbase,domanialite,geo_shape,geo_point_2d"
    layer = read(file.path, spec)
    assert ids(layer) == ["11"]
    assert (layer.counts.read, layer.counts.filtered) == (1, 0)


def test_area_may_be_a_polygon(server: Server, fetched: Fetch) -> None:
    area = Area(shapely.Polygon([(2.355, 48.855), (2.4, 48.855), (2.38, 48.9)]), "a corner")
    file = fetched(area=area)
    assert (
        server.requests[-1].query["where"].startswith("(intersects(geo_point_2d, geom'POLYGON ((")
    )
    assert ids(read(file.path)) == ["12", "13"]


@given(st.integers(3, 3_000), st.floats(0.0, 0.5), st.integers(0, 10**6))
def test_short_outline_covers_the_long_one(corners: int, roughness: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    angles = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    radii = 0.05 * (1 - roughness * rng.random(corners))
    area = shapely.Polygon(
        np.column_stack([2.35 + radii * np.cos(angles), 48.85 + radii * np.sin(angles)])
    )
    text = opendatasoft._outline(area)
    assert len(text) <= 2_000
    # Rounding to 7 decimals moves a corner by less than a centimetre.
    assert shapely.from_wkt(text).buffer(1e-7).covers(area)


UNKNOWN_DATASET = ["http://", "'arbres'", "'trees'", "/explore", "`dataset`", "catalogue"]
UNKNOWN_FIELD = b'{"error_code": "ODSQLError", "message": "Unknown field: kind. Check it."}'
NO_POSITIONS = Answer(b'{"fields": [{"name": "idbase", "type": "int"}]}')
BAD_QUERY = Answer(UNKNOWN_FIELD, status=400)
LOG_IN = Answer(b'{"message": "Log in"}', status=403)


@pytest.mark.parametrize(
    "case",
    [
        ({"dataset": "arbres"}, {}, CatalogError, UNKNOWN_DATASET),
        (
            {"select": ("idbaze",)},
            {},
            CatalogError,
            ["les-arbres", "'idbaze'", "select", "'idbase'"],
        ),
        ({"server_where": "kind=1"}, {EXPORT: BAD_QUERY}, SourceError, ["400", "field: kind"]),
        ({}, {EXPORT: Answer(PUBLISHED[:-20])}, SourceError, ["whole geojson"]),
        ({}, {DESCRIPTION: LOG_IN}, SourceError, ["layer 'trees'", "403", "Log in"]),
        ({}, {DESCRIPTION: NO_POSITIONS}, CatalogError, ["les-arbres", "trees", "positions"]),
        ({}, {DESCRIPTION: Answer(b"<html>", type="text/html")}, SourceError, ["address"]),
        ({}, {DESCRIPTION: Answer(b"[1, 2]")}, SourceError, ["address"]),
        ({}, {DESCRIPTION: Answer(b'{"fields": [{"id": 1}]}')}, SourceError, ["address"]),
        ({}, {DESCRIPTION: Answer(b'{"fields":')}, SourceError, ["address"]),
    ],
)
def test_error_of_a_portal_names_the_cause(
    server: Server, fetched: Fetch, case: tuple[Any, ...]
) -> None:
    change, answers, error, words = case
    for path, answer in answers.items():
        server.on(path, answer)
    with refused(error, *words):
        fetched(replace(TREES, **change), area=box(2.0, 48.0, 3.0, 49.0))


def test_area_uses_the_name_of_the_point_field(server: Server, fetched: Fetch) -> None:
    names = {"other_point": "geo_point_2d", "coordonnees_geo": "geo_point_2d", "code": "text"}
    fields = [{"name": name, "type": kind} for name, kind in names.items()]
    server.on(f"{DATASETS}/velib", Answer(json.dumps({"fields": fields}).encode()))
    content = b'{"type": "FeatureCollection", "features": []}'
    server.on(f"{DATASETS}/velib/exports/geojson", Answer(content))
    aliases = (("geo_point_2d", ("coordonnees_geo",)),)
    fetched(replace(PLAIN, dataset="velib", aliases=aliases), area=box(2.0, 48.0, 3.0, 49.0))
    assert "in_bbox(coordonnees_geo, " in server.requests[-1].query["where"]


def test_dataset_name_is_quoted_in_the_path(server: Server, cache: Cache, fetched: Fetch) -> None:
    files_only = replace(TREES, dataset=None)
    assert (
        fetch_layers(opendatasoft.fetch_layer, [files_only], endpoints=[server.url], cache=cache)
        == []
    )
    with pytest.raises(CatalogError):
        fetched(replace(TREES, dataset="a/../b?c"))
    assert server.paths() == [f"{DATASETS}/a%2F..%2Fb%3Fc"]
