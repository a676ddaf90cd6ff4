"""Files of Opendatasoft portals in every spelling, and a portal that runs on this machine."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused
from servers import Answer, published

from semsig_gis.core.errors import CatalogError, CrsError, SourceError
from semsig_gis.sources.area import Area
from semsig_gis.sources.layers import ClassBy, LayerSpec
from semsig_gis.sources.opendatasoft.reader import (
    _outline,
    fetch_layers,
    find_field,
    fold,
    read_layers,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from servers import Seen, Server

    from semsig_gis.sources import RawLayer
    from semsig_gis.sources.http.cache import Cache, Fetched
    from semsig_gis.sources.http.fetch import HttpSpec

    Fetch = Callable[..., Fetched]

TREES = LayerSpec(
    name="trees",
    class_name="alignment_tree",
    files=("les-arbres*",),
    dataset="les-arbres",
    id_field="IDBASE",
    unique_id=True,
)
# Longitude, latitude, id and domain of some trees.
PLACES = [
    (2.35, 48.85, 11, "Alignement"),
    (2.36, 48.86, 12, "Jardin"),
    (2.37, 48.87, 13, "Alignement"),
]


def read(path: Path, spec: LayerSpec = TREES, **options: Any) -> RawLayer:  # noqa: ANN401
    (layer,) = read_layers(path, [spec], **options)
    assert layer.counts.kept == len(layer.table)
    return layer


def xy(layer: RawLayer) -> list[tuple[float, float]]:
    points = shapely.get_coordinates(shapely.centroid(layer.table.geometry.array))
    return [(x, y) for x, y in points.round(9).tolist()]


def shape(lon: float, lat: float, kind: str = "Point") -> dict[str, Any]:
    return {"type": kind, "coordinates": [lon, lat] if kind == "Point" else [[lon, lat]]}


# --- Every kind of file -------------------------------------------------------------------------


def v1(lon: float, lat: float, number: int, domain: str) -> dict[str, Any]:
    fields = {"idbase": number, "domanialite": domain, "geo_point_2d": [lat, lon]}
    return {
        "datasetid": "les-arbres",
        "recordid": f"{number:040x}",
        "fields": fields,
        "geometry": shape(lon, lat),
    }


def v21(lon: float, lat: float, number: int, domain: str) -> dict[str, Any]:
    return {
        "idbase": number,
        "domanialite": domain,
        "geo_shape": {"type": "Feature", "geometry": shape(lon, lat), "properties": {}},
        "geo_point_2d": {"lon": lon, "lat": lat},
    }


def feature(lon: float, lat: float, number: int, domain: str) -> dict[str, Any]:
    properties = {"idbase": number, "domanialite": domain, "geo_point_2d": [lat, lon]}
    return {"type": "Feature", "geometry": shape(lon, lat), "properties": properties}


def as_csv(header: list[str], rows: list[list[Any]], separator: str = ";") -> str:
    stream = io.StringIO()
    csv.writer(stream, delimiter=separator, lineterminator="\r\n").writerows([header, *rows])
    return stream.getvalue()


def parquet(columns: dict[str, Any]) -> bytes:
    stream = io.BytesIO()
    pq.write_table(pa.table(columns), stream)
    return stream.getvalue()


LABELS = ["IDBASE", "DOMANIALITE", "geo_point_2d"]
IDS = [number for _, _, number, _ in PLACES]
DOMAINS = [domain for *_, domain in PLACES]
WKB = [shapely.to_wkb(shapely.Point(lon, lat)) for lon, lat, *_ in PLACES]
FILES: dict[str, str | bytes] = {
    "v1.json": json.dumps([v1(*place) for place in PLACES]),
    "v1_search.json": json.dumps({"nhits": 3, "records": [v1(*place) for place in PLACES]}),
    "v20.json": json.dumps(
        {"total_count": 3, "records": [{"links": [], "record": v1(*place)} for place in PLACES]}
    ),
    "v21.json": json.dumps([v21(*place) for place in PLACES]),
    "v21_records.json": json.dumps(
        {"total_count": 3, "results": [v21(*place) for place in PLACES]}
    ),
    "v21.geojson": json.dumps(
        {"type": "FeatureCollection", "features": [feature(*place) for place in PLACES]}
    ),
    "labels.csv": as_csv(LABELS, [[n, d, f"{lat}, {lon}"] for lon, lat, n, d in PLACES]),
    "tight.csv": as_csv(LABELS, [[n, d, f"{lat},{lon}"] for lon, lat, n, d in PLACES]),
    "commas.csv": as_csv(LABELS, [[n, d, f"{lat},{lon}"] for lon, lat, n, d in PLACES], ","),
    "tabs.csv": as_csv(LABELS, [[n, d, f"{lat}, {lon}"] for lon, lat, n, d in PLACES], "\t"),
    "mark.csv": "\ufeff" + as_csv(LABELS, [[n, d, f"{lat}, {lon}"] for lon, lat, n, d in PLACES]),
    "floats.csv": as_csv(LABELS, [[f"{n}.0", d, f"{lat}, {lon}"] for lon, lat, n, d in PLACES]),
    "accents.csv": as_csv(
        ["Id Base", "Domanialité", "Géo point 2D"],
        [[n, d, f"{lat}, {lon}"] for lon, lat, n, d in PLACES],
    ),
    "shapes.csv": as_csv(
        ["idbase", "domanialite", "geo_shape", "geopoint_datagouv"],
        [
            [n, d, json.dumps(shape(lon, lat, "MultiPoint")), f"{lon}, {lat}"]
            for lon, lat, n, d in PLACES
        ],
    ),
    "wkb.parquet": parquet(
        {
            "idbase": [float(number) for number in IDS],
            "domanialite": DOMAINS,
            "geo_point_2d": WKB,
            "geo_shape": WKB,
        }
    ),
    "struct.parquet": parquet(
        {
            "idbase": IDS,
            "domanialite": DOMAINS,
            "geo_point_2d": [{"lon": lon, "lat": lat} for lon, lat, *_ in PLACES],
        }
    ),
    "text.parquet": parquet(
        {
            "idbase": IDS,
            "domanialite": DOMAINS,
            "geo_point_2d": [f"{lat}, {lon}" for lon, lat, *_ in PLACES],
            "geo_shape": [json.dumps(shape(lon, lat)) for lon, lat, *_ in PLACES],
        }
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_every_kind_of_file_says_the_same(tmp_path: Path, name: str) -> None:
    content = FILES[name]
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    chosen = replace(TREES, where=(("DOMANIALITE", ("Alignement",)),))
    everything, some = read_layers(path, [TREES, chosen])
    assert everything.table["source_id"].tolist() == ["11", "12", "13"]
    assert xy(everything) == [(lon, lat) for lon, lat, *_ in PLACES]
    assert everything.table.crs == "EPSG:4326"
    assert (everything.errors, everything.notes) == ((), ())
    assert some.table["source_id"].tolist() == ["11", "13"]
    assert (some.counts.filtered, everything.spec, some.spec) == (1, TREES, chosen)
    assert len(read(path, chosen, filters=False).table) == 3


@pytest.mark.parametrize("name", ["trees.gpkg", "trees.fgb", "trees.shp", "trees.geojson"])
def test_what_other_programs_made_of_a_file_loads_too(tmp_path: Path, name: str) -> None:
    frame = gpd.GeoDataFrame(
        {"idbase": [float(number) for number in IDS], "domanialit": DOMAINS},
        geometry=gpd.points_from_xy(*zip(*[place[:2] for place in PLACES], strict=True)),
        crs="EPSG:4326",
    ).to_crs("EPSG:2154")
    # FlatGeobuf would put the rows in another order for its index.
    options = {"SPATIAL_INDEX": "NO"} if name.endswith(".fgb") else {}
    frame.to_file(tmp_path / name, **options)
    spec = replace(
        TREES,
        where=(("DOMANIALITE", ("Alignement",)),),
        aliases=(("DOMANIALITE", ("DOMANIALIT",)),),
    )
    layer = read(tmp_path / name, spec)
    assert layer.table["source_id"].tolist() == ["11", "13"]
    assert layer.table.crs == "EPSG:2154"
    assert layer.spec is spec
    back = shapely.get_coordinates(layer.table.to_crs("EPSG:4326").geometry.array)
    assert back == pytest.approx(np.array([place[:2] for place in PLACES])[[0, 2]], abs=1e-6)


def test_a_geoparquet_file_says_what_its_geometry_is(tmp_path: Path) -> None:
    frame = gpd.GeoDataFrame(
        {"idbase": IDS, "place": gpd.points_from_xy([2.35, 2.36, 2.37], [48.85, 48.86, 48.87])},
        geometry="place",
        crs="EPSG:4326",
    )
    frame.to_parquet(tmp_path / "a.parquet")
    assert xy(read(tmp_path / "a.parquet")) == [place[:2] for place in PLACES]
    frame.to_crs("EPSG:2154").to_parquet(tmp_path / "b.parquet")
    assert read(tmp_path / "b.parquet").table.crs == "EPSG:2154"


# --- Fields -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "names",
    [
        ("TYPE EMPLACEMENT", "TYPEEMPLACEMENT", "typeemplacement", "Type_Emplacement"),
        ("Disponibilité", "DISPONIBILITE", "disponibilite\u0301", "\ufeffdisponibilite"),
        ("geo_point_2d", "Geo Point 2D", "geopoint2d"),
        ("CIRCONFERENCE (cm)", "circonference_cm"),
    ],
)
def test_styles_of_a_name_are_one(names: tuple[str, ...]) -> None:
    assert len({fold(name) for name in names}) == 1


@given(st.text())
def test_folding_twice_is_folding_once(name: str) -> None:
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
def test_the_nearest_spelling_goes_first(fields: list[str], expected: str | None) -> None:
    spec = replace(TREES, aliases=(("gid", ("Identifiant",)),))
    assert find_field("gid", spec, fields) == expected


def test_a_class_may_hang_on_a_field(tmp_path: Path) -> None:
    path = tmp_path / "toilets.csv"
    path.write_text("TYPE;geo_point_2d\nSANISETTES;48.85,2.35\nURINOIR;48.86,2.36\n")
    spec = LayerSpec(
        name="toilets",
        class_name="bench",
        class_by=ClassBy("type", (("/SANISETTES?/", "automatic_wc"),)),
    )
    layer = read(path, spec)
    assert layer.table["class_name"].tolist() == ["automatic_wc", "bench"]
    assert layer.table["source_id"].tolist() == ["1", "2"]


@pytest.mark.parametrize(
    ("spec", "key"),
    [
        (replace(TREES, id_field="idbaze"), "id_field"),
        (replace(TREES, where=(("DOMAIN", ("Alignement",)),)), "where"),
        (replace(TREES, class_by=ClassBy("KIND", (("x", "bench"),))), "class_by"),
    ],
)
def test_a_field_that_is_not_there_is_named(tmp_path: Path, spec: LayerSpec, key: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(str(FILES["labels.csv"]))
    with refused(CatalogError, key, "trees", str(path), "IDBASE"):
        read(path, spec)


# --- Positions ----------------------------------------------------------------------------------


def test_a_shape_goes_before_a_point_and_a_point_before_coordinates(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    line = {"type": "LineString", "coordinates": [[2.0, 48.0], [2.2, 48.0]]}
    rows = [
        {"geo_shape": line, "geo_point_2d": [49, 3], "lng": 4, "lat": 50},
        {"geo_shape": None, "geo_point_2d": [49, 3], "lng": 4, "lat": 50},
        {"geo_shape": {"type": "Feature", "geometry": None}, "lng": "4", "lat": "50"},
        {"geo_point_2d": "", "lng": None, "lat": ""},
        {"lng": 0.0, "lat": 0.0},
    ]
    path.write_text(json.dumps(rows))
    spec = LayerSpec(name="a", class_name="bench", geometry="line", x_field="LNG", y_field="lat")
    layer = read(path, spec)
    assert xy(layer) == [(2.1, 48.0), (3.0, 49.0), (4.0, 50.0), (0.0, 0.0)]
    assert layer.table.geometry.isna().tolist() == [False, False, False, True, False]


def test_an_alias_names_the_point_and_so_its_order(tmp_path: Path) -> None:
    path = tmp_path / "taxi.csv"
    path.write_text("id;geopoint;geopoint_datagouv\n1;48.85, 2.35;2.35, 48.85\n")
    spec = LayerSpec(name="taxi", class_name="taxi_station")
    with refused(SourceError, "taxi", "geopoint", "geo_point_2d", "alias"):
        read(path, spec)
    named = replace(spec, aliases=(("geo_point_2d", ("geopoint",)),))
    assert xy(read(path, named)) == [(2.35, 48.85)]


BAD_ROWS = {
    "its point 'nowhere' is not": {"geo_point_2d": "nowhere"},
    "its point '1, 2, 3' is not": {"geo_point_2d": "1, 2, 3"},
    "its point '[1]' is not": {"geo_point_2d": [1]},
    "its point \"{'lon': 2}\" is not": {"geo_point_2d": {"lon": 2}},
    "its point '7' is not": {"geo_point_2d": 7},
    'its shape \'{"type": "Po\' is not': {"geo_shape": '{"type": "Po'},
    "its shape \"{'type': 'Point'}\" is not": {"geo_shape": {"type": "Point"}},
    "its shape \"{'type': 'Blob', 'coordinates': [1]}\" is not": {
        "geo_shape": {"type": "Blob", "coordinates": [1]}
    },
    "its shape '[2, 48]' is not": {"geo_shape": [2, 48]},
    "its coordinates (2.35, 95) are not in EPSG:4326": {"geo_point_2d": [95, 2.35]},
    "its coordinates (inf, 48.85) are not finite": {"geo_point_2d": [48.85, math.inf]},
    "its coordinates (nan, 1) are not finite": {
        "geo_shape": {"type": "LineString", "coordinates": [[math.nan, 1], [2, 3]]}
    },
}


def test_coordinates_that_are_no_numbers(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("lat;lng\n48.85;2.35\n48.86;\nhere;2.37\n;\n")
    layer = read(path, LayerSpec(name="a", class_name="bench", x_field="lng", y_field="lat"))
    assert layer.errors == (
        "row 2: its lng '' and lat '48.86' are not two numbers",
        "row 3: its lng '2.37' and lat 'here' are not two numbers",
    )
    assert layer.table.geometry.isna().tolist() == [False, True]


@pytest.mark.parametrize("message", BAD_ROWS)
def test_a_bad_row_is_counted_and_the_others_are_read(tmp_path: Path, message: str) -> None:
    path = tmp_path / "a.json"
    good = {"geo_point_2d": [48.85, 2.35], "geo_shape": None}
    path.write_text(json.dumps([good, BAD_ROWS[message], good, "what?"]))
    layer = read(path, LayerSpec(name="a", class_name="bench"))
    assert xy(layer) == [(2.35, 48.85)] * 2
    assert layer.counts.unreadable == 2
    assert layer.errors[0].startswith(f"row 2: {message}")
    assert layer.errors[1] == 'row 4: is "what?", not a record'


def test_bad_lines_of_a_csv_file_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(
        "IDBASE;geo_point_2d\n1;48.1,2.1\n\n2;48.2,2.2;x\n3\n"
        '4;"48.4,2.4"x\n5;48.5,2.5\n6;"48.6,2.6\n7;48.7,2.7\n'
    )
    layer = read(path)
    assert layer.table["source_id"].tolist() == ["1", "5"]
    assert [error.partition(": ")[2] for error in layer.errors] == [
        "has 3 values, and the header has 2 names",
        "has 1 values, and the header has 2 names",
        "cannot be read (';' expected after '\"')",
        "cannot be read (unexpected end of data)",
    ]


def test_a_shape_may_be_longer_than_python_expects(tmp_path: Path) -> None:
    angles = np.linspace(0, 2 * np.pi, 20_000)
    ring = np.column_stack([2.35 + np.cos(angles) / 100, 48.85 + np.sin(angles) / 100]).tolist()
    ring[-1] = ring[0]
    text = json.dumps({"type": "Polygon", "coordinates": [ring]})
    assert len(text) > csv.field_size_limit()
    path = tmp_path / "a.csv"
    path.write_text(as_csv(["geo_shape"], [[text]]))
    before = csv.field_size_limit()
    layer = read(path, LayerSpec(name="a", class_name="bench", geometry="polygon"))
    assert xy(layer)[0] == pytest.approx((2.35, 48.85))
    assert csv.field_size_limit() == before


# --- Ids that are unique ------------------------------------------------------------------------


def test_rows_of_one_id_are_one_object(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(
        "IDBASE;geo_point_2d\n1;\n2;48.2,2.2\n1;48.1,2.1\n2.0;48.2,2.2\n;48.3,2.3\n;48.4,2.4\n"
        "2;nowhere\n5;\n"
    )
    layer = read(path)
    # Of the first id, the row that has a position stays; rows without an id all stay.
    assert layer.table["source_id"].tolist() == ["2", "1", "", "", "5"]
    assert xy(layer) == [(2.2, 48.2), (2.1, 48.1), (2.3, 48.3), (2.4, 48.4)]
    assert (layer.counts.read, layer.counts.duplicates, layer.counts.unreadable) == (8, 2, 1)
    assert layer.notes == ()
    others = read(path, replace(TREES, unique_id=False))
    assert others.table["source_id"].tolist() == ["1", "2", "1", "2", "5", "6", "5"]
    assert others.counts.duplicates == 0


def test_rows_of_one_id_that_are_apart_are_told(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("IDBASE;geo_point_2d\n1;48.1,2.1\n1;48.1,2.1000001\n1;48.1,2.2\n2;48,2\n")
    layer = read(path)
    assert xy(layer) == [(2.1, 48.1), (2.0, 48.0)]
    assert layer.counts.duplicates == 2
    assert layer.notes == (
        "1 rows have the id of a row that stands elsewhere; the first one's place is used",
    )


def test_the_filter_comes_before_the_ids(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("IDBASE;state;geo_point_2d\n1;old;48.1,2.1\n1;new;48.2,2.2\n")
    layer = read(path, replace(TREES, where=(("state", ("new",)),)))
    assert xy(layer) == [(2.2, 48.2)]
    assert (layer.counts.filtered, layer.counts.duplicates) == (1, 0)


# --- Coordinate systems -------------------------------------------------------------------------


def test_a_stated_crs_goes_before_the_default(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("x_l93;y_l93\n652000;6862000\n")
    spec = LayerSpec(name="a", class_name="bench", x_field="X_L93", y_field="Y_L93")
    with refused(CrsError, "652000", "EPSG:4326", "crs"):
        read(path, spec)
    assert read(path, replace(spec, crs="EPSG:2154")).table.crs == "EPSG:2154"
    assert read(path, spec, crs="EPSG:2154").table.crs == "EPSG:2154"


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
def test_an_old_geojson_file_may_state_its_crs(
    tmp_path: Path, member: object, expected: str | None
) -> None:
    path = tmp_path / "a.geojson"
    path.write_text(
        json.dumps(
            {"type": "FeatureCollection", "crs": member, "features": [feature(2.0, 48.0, 1, "x")]}
        )
    )
    if expected is None:
        with refused(CrsError, str(path), "CRS"):
            read(path)
    else:
        assert read(path).table.crs == expected


# --- Files that are none ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "content", "word"),
    [
        ("a.json", b"", "is empty"),
        ("a.csv", b"\xef\xbb\xbf \n", "is empty"),
        ("a.json", b'[{"a": 1}, {"a"', "whole JSON"),
        ("a.json", b"[" * 100_000, "whole JSON"),
        ("a.json", b'{"message": "no such dataset"}', "no records"),
        ("a.json", b'{"results": 3}', "no records"),
        ("a.json", b"[1, 2]", "no records"),
        ("a.json", b'[{"a": "\xe9"}]', "UTF-8"),
        ("a.csv", "nom;geo_point_2d\nCafé;48,2\n".encode("latin-1"), "UTF-8"),
        ("a.csv", "thé;geo_point_2d\n".encode("latin-1"), "UTF-8"),
        ("a.csv", b"nom;geo_point_2d\n" + b"a;48,2\n" * 5_000 + b"\xe9;48,2\n", "UTF-8"),
        ("a.csv", b"a;b\n1;2\n", "geo_point_2d"),
        ("a.parquet", b"PAR1" + bytes(100), "Parquet"),
        ("a.parquet", b"PAR1", "Parquet"),
        ("a.png", b"\x89PNG\r\n\x1a\n\0\0", "not a text"),
        ("a.gpkg", b"SQLite", "a.gpkg"),
    ],
)
def test_files_that_are_none(tmp_path: Path, name: str, content: bytes, word: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with refused(SourceError, str(path), word):
        read(path, LayerSpec(name="a", class_name="bench"))


def test_a_parquet_file_that_was_cut(tmp_path: Path) -> None:
    whole = bytes(FILES["wkb.parquet"])  # type: ignore[arg-type]
    path = tmp_path / "a.parquet"
    path.write_bytes(whole[:-40])
    with refused(SourceError, "whole Parquet"):
        read(path)
    path.write_bytes(whole[:4] + bytes(len(whole) // 3) + whole[4 + len(whole) // 3 :])
    with refused(SourceError, "whole Parquet"):
        read(path)


def test_a_path_without_a_file(tmp_path: Path) -> None:
    for path, word in ((tmp_path / "a.csv", "does not exist"), (tmp_path, "is a folder")):
        with refused(SourceError, word):
            read(path)


@pytest.mark.parametrize(
    "content", ["[]", '{"type": "FeatureCollection", "features": []}', '{"results": []}']
)
def test_no_rows_are_no_fault(tmp_path: Path, content: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(content)
    layer = read(path, replace(TREES, where=(("DOMANIALITE", ("Alignement",)),)))
    assert (layer.counts.read, len(layer.table), layer.table.crs) == (0, 0, "EPSG:4326")
    assert layer.notes == ("the layer has no rows",)


coordinates = st.tuples(st.floats(-180, 180), st.floats(-90, 90))


@given(st.lists(coordinates, min_size=1, max_size=5))
def test_spellings_of_a_point_are_one_place(
    tmp_path_factory: pytest.TempPathFactory, places: list[tuple[float, float]]
) -> None:
    path = tmp_path_factory.mktemp("points") / "a.json"
    spellings: list[Callable[[float, float], dict[str, Any]]] = [
        lambda x, y: {"geo_point_2d": f"{y!r}, {x!r}"},
        lambda x, y: {"geo_point_2d": f"{y!r},{x!r}"},
        lambda x, y: {"geo_point_2d": [y, x]},
        lambda x, y: {"geo_point_2d": {"lon": x, "lat": y}},
        lambda x, y: {"geo_point_2d": shape(x, y)},
        lambda x, y: {"geo_shape": shape(x, y)},
        lambda x, y: {"geo_shape": json.dumps(shape(x, y, "MultiPoint"))},
        lambda x, y: {"geo_shape": {"type": "Feature", "geometry": shape(x, y)}},
    ]
    rows = [spelling(x, y) for x, y in places for spelling in spellings]
    path.write_text(json.dumps([{"geo_shape": None, "geo_point_2d": None} | row for row in rows]))
    layer = read(path, LayerSpec(name="a", class_name="bench"))
    found = shapely.get_coordinates(layer.table.geometry.array)
    assert found.tolist() == [[x, y] for x, y in places for _ in spellings]


@pytest.mark.parametrize(
    ("page", "rest"),
    [
        ({"total_count": 1323, "results": 2}, "1,321 records more"),
        ({"nhits": 3, "records": 2}, "1 records more"),
        ({"total_count": 2, "results": 2}, None),
        ({"total_count": "many", "results": 2}, None),
    ],
)
def test_a_page_of_a_longer_answer_is_told(
    tmp_path: Path, page: dict[str, Any], rest: str | None
) -> None:
    row = {"geo_point_2d": {"lon": 2.3, "lat": 48.8}}
    rows = {key: [row] * 2 if key in {"results", "records"} else page[key] for key in page}
    path = tmp_path / "page.json"
    path.write_text(json.dumps(rows), encoding="utf-8")
    layer = read(path, LayerSpec(name="a", class_name="bench"))
    assert layer.counts.read == 2
    assert len(layer.notes) == (rest is not None)
    assert rest is None or rest in layer.notes[0]


# --- A portal -----------------------------------------------------------------------------------

DATASETS = "/api/explore/v2.1/catalog/datasets"
EXPORT = f"{DATASETS}/les-arbres/exports/geojson"
TYPES = {
    "idbase": "int",
    "domanialite": "text",
    "geo_shape": "geo_shape",
    "geo_point_2d": "geo_point_2d",
}
ROWS = [v21(*place) for place in PLACES]


class Portal:
    """Plays the Explore API v2.1 for one dataset, with as much of its language as we speak."""

    def __init__(self, server: Server) -> None:
        described = {"fields": [{"name": name, "type": kind} for name, kind in TYPES.items()]}
        server.on(f"{DATASETS}/les-arbres", published(json.dumps(described).encode(), etag='"d"'))
        server.on(EXPORT, self.geojson)

    def geojson(self, seen: Seen) -> Answer:
        assert seen.query["limit"] == "-1"
        conditions = re.findall(r"\((.+?)\)(?: and (?=\()|$)", seen.query.get("where", ""))
        names = seen.query.get("select", ",".join(TYPES)).split(",")
        assert set(names) <= set(TYPES)
        features = []
        for row in ROWS:
            if all(self._holds(text, row) for text in conditions):
                properties = {name: row[name] for name in names}
                geometry = properties.pop("geo_shape")["geometry"]
                features.append({"type": "Feature", "geometry": geometry, "properties": properties})
        content = {"type": "FeatureCollection", "features": features}
        return Answer(json.dumps(content).encode(), type="application/geo+json", chunked=True)

    @staticmethod
    def _holds(condition: str, row: dict[str, Any]) -> bool:
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


@pytest.fixture
def fetched(server: Server, cache: Cache, quick: HttpSpec) -> Fetch:
    """Fetch one layer from the server."""

    def fetch(layer: LayerSpec = TREES, **options: Any) -> Fetched:  # noqa: ANN401
        given = {"endpoints": [server.url], "cache": cache, "spec": quick, **options}
        ((spec, file),) = fetch_layers([layer], **given)
        assert spec is layer
        return file

    return fetch


def box(west: float, south: float, east: float, north: float) -> Area:
    return Area(shapely.box(west, south, east, north), "a box")


def test_an_export_is_fetched_and_read(server: Server, fetched: Fetch) -> None:
    Portal(server)
    layer = read(fetched().path)
    assert layer.table["source_id"].tolist() == ["11", "12", "13"]
    assert xy(layer) == [place[:2] for place in PLACES]
    assert server.paths() == [f"{DATASETS}/les-arbres", EXPORT]
    assert len(read(fetched(area=box(5.0, 48.0, 5.1, 48.1)).path).table) == 0  # which is no fault


def test_what_is_not_wanted_is_not_sent(server: Server, fetched: Fetch) -> None:
    Portal(server)
    spec = replace(
        TREES,
        server_where="domanialite = 'Alignement'",
        select=("IDBASE",),
        where=(("DOMANIALITE", ("Alignement",)),),
    )
    file = fetched(spec, endpoints=[f"{server.url}/"], area=box(2.0, 48.0, 2.36, 48.9))
    query = server.seen[-1].query
    assert query["where"] == (
        "(domanialite = 'Alignement') and "
        "(in_bbox(geo_point_2d, 48.0000000, 2.0000000, 48.9000000, 2.3600000))"
    )
    assert query["select"] == "idbase,domanialite,geo_shape,geo_point_2d"
    layer = read(file.path, spec)
    assert layer.table["source_id"].tolist() == ["11"]
    assert (layer.counts.read, layer.counts.filtered) == (1, 0)


def test_an_area_may_be_a_polygon(server: Server, fetched: Fetch) -> None:
    Portal(server)
    area = Area(shapely.Polygon([(2.355, 48.855), (2.4, 48.855), (2.38, 48.9)]), "a corner")
    file = fetched(area=area)
    assert server.seen[-1].query["where"].startswith("(intersects(geo_point_2d, geom'POLYGON ((")
    assert read(file.path).table["source_id"].tolist() == ["12", "13"]


@given(st.integers(3, 3_000), st.floats(0.0, 0.5), st.integers(0, 10**6))
def test_a_long_outline_is_shortened_and_loses_nothing(
    corners: int, roughness: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    angles = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    radii = 0.05 * (1 - roughness * rng.random(corners))
    area = shapely.Polygon(
        np.column_stack([2.35 + radii * np.cos(angles), 48.85 + radii * np.sin(angles)])
    )
    text = _outline(area)
    assert len(text) <= 2_000
    # Rounding to 7 decimals moves a corner by less than a centimetre.
    assert shapely.from_wkt(text).buffer(1e-7).covers(area)


def test_a_second_run_is_answered_from_the_cache(
    server: Server, fetched: Fetch, quick: HttpSpec
) -> None:
    offline = replace(quick, offline=True)
    with refused(SourceError, "les-arbres", "cache"):
        fetched(spec=offline)
    assert server.seen == []
    Portal(server)
    date = "Sat, 21 Nov 2026 00:00:00 GMT"
    body = str(FILES["v21.geojson"]).encode()
    server.on(EXPORT, published(body, type="application/geo+json", modified=date))
    first, second = fetched(), fetched()
    assert (first.from_cache, second.from_cache) == (False, True)
    assert (first.sha256, first.path) == (second.sha256, second.path)
    assert server.seen[-1].headers["if-modified-since"] == date
    asked = len(server.seen)
    assert fetched(spec=offline).sha256 == first.sha256
    assert len(server.seen) == asked


def test_a_busy_portal_is_asked_again(server: Server, fetched: Fetch, quick: HttpSpec) -> None:
    portal = Portal(server)
    waits: list[float] = []
    busy = Answer(b'{"message": "slow down"}', status=429, headers={"Retry-After": "7"})
    server.on(EXPORT, busy, busy, portal.geojson)
    assert len(read(fetched(spec=replace(quick, sleep=waits.append)).path).table) == 3
    assert waits == [7.0, 7.0]


def test_a_cut_connection_goes_on_where_it_was_cut(server: Server, fetched: Fetch) -> None:
    Portal(server)
    body = str(FILES["v21.geojson"]).encode()
    server.on(EXPORT, published(body, type="application/geo+json", etag='"1"', cuts=[100]))
    seen: list[tuple[int, int]] = []
    file = fetched(progress=lambda done, total: seen.append((done, total)))
    assert file.path.read_bytes() == body
    assert server.seen[-1].headers["range"] == "bytes=100-"
    assert seen[-1] == (len(body), len(body))


def test_an_export_that_ends_too_soon_is_not_kept(server: Server, fetched: Fetch) -> None:
    portal = Portal(server)

    def half(seen: Seen) -> Answer:
        whole = portal.geojson(seen)
        return replace(whole, body=whole.body[: len(whole.body) // 2], chunked=True)

    server.on(EXPORT, half)
    with refused(SourceError, "whole geojson"):
        fetched()
    server.on(EXPORT, portal.geojson)
    assert len(read(fetched().path).table) == 3


UNKNOWN_FIELD = b'{"error_code": "ODSQLError", "message": "Unknown field: kind. Check it."}'
NO_POSITIONS = b'{"fields": [{"name": "idbase", "type": "int"}]}'


@pytest.mark.parametrize(
    ("layer", "answers", "error", "words"),
    [
        (
            replace(TREES, dataset="arbres"),
            {},
            CatalogError,
            ["http://", "'arbres'", "'trees'", "/explore", "`dataset`", "catalogue"],
        ),
        (
            TREES,
            {f"{DATASETS}/les-arbres": Answer(b'{"message": "Log in"}', status=403)},
            SourceError,
            ["layer 'trees'", "403", "Log in"],
        ),
        (
            replace(TREES, server_where="kind = 'x'"),
            {EXPORT: Answer(UNKNOWN_FIELD, status=400)},
            SourceError,
            ["layer 'trees'", "400", "Unknown field: kind"],
        ),
        (
            replace(TREES, select=("idbaze",)),
            {},
            CatalogError,
            ["les-arbres", "'idbaze'", "select", "'idbase'"],
        ),
        (
            TREES,
            {f"{DATASETS}/les-arbres": Answer(NO_POSITIONS)},
            CatalogError,
            ["les-arbres", "trees", "positions"],
        ),
        *(
            (TREES, {f"{DATASETS}/les-arbres": answer}, SourceError, ["address"])
            for answer in (
                Answer(b"<html></html>", type="text/html"),
                Answer(b"[1, 2]"),
                Answer(b'{"fields": [{"id": 1}]}'),
                Answer(b'{"fields":'),
            )
        ),
    ],
)
def test_what_a_portal_cannot_give_is_told(
    server: Server,
    fetched: Fetch,
    *,
    layer: LayerSpec,
    answers: dict[str, Answer],
    error: type[Exception],
    words: list[str],
) -> None:
    Portal(server)
    for path, answer in answers.items():
        server.on(path, answer)
    with refused(error, *words):
        fetched(layer, area=box(2.0, 48.0, 3.0, 49.0))


def test_the_field_of_the_area_goes_by_its_own_name(server: Server, fetched: Fetch) -> None:
    fields = [
        {"name": "other_point", "type": "geo_point_2d"},
        {"name": "coordonnees_geo", "type": "geo_point_2d"},
        {"name": "stationcode", "type": "text"},
    ]
    server.on(f"{DATASETS}/velib", Answer(json.dumps({"fields": fields}).encode()))
    content = b'{"type": "FeatureCollection", "features": []}'
    server.on(f"{DATASETS}/velib/exports/geojson", Answer(content))
    aliases = (("geo_point_2d", ("coordonnees_geo",)),)
    spec = LayerSpec(name="bikes", class_name="bike_station", dataset="velib", aliases=aliases)
    fetched(spec, area=box(2.0, 48.0, 3.0, 49.0))
    assert "in_bbox(coordonnees_geo, " in server.seen[-1].query["where"]


def test_another_host_is_not_followed(server: Server, fetched: Fetch) -> None:
    Portal(server)
    server.on(EXPORT, Answer(status=302, headers={"Location": f"{server.other_host}{EXPORT}"}))
    with refused(SourceError, "localhost"):
        fetched()
    assert server.paths().count(EXPORT) == 1


def test_the_name_of_a_dataset_is_part_of_the_path(
    server: Server, cache: Cache, quick: HttpSpec
) -> None:
    files_only = replace(TREES, dataset=None)
    assert fetch_layers([files_only], endpoints=[server.url], cache=cache, spec=quick) == []
    with pytest.raises(CatalogError):
        fetch_layers(
            [replace(TREES, dataset="a/../b?c")], endpoints=[server.url], cache=cache, spec=quick
        )
    assert server.paths() == [f"{DATASETS}/a%2F..%2Fb%3Fc"]
