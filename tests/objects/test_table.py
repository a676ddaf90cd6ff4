from __future__ import annotations

import dataclasses
import math
import tempfile
from collections import Counter
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from geopandas.testing import assert_geodataframe_equal
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import CRS, Transformer
from raw_layers import raw_layer
from sentences import assert_sentence, refused
from worlds import objects_of

from semsig_gis.core import CrsError, DatabaseError, EmptyResultError, UnknownNameError
from semsig_gis.objects import (
    LayerReport,
    Licence,
    StreetObjects,
    build_objects,
    objects_specs,
    open_objects,
    save_objects,
)
from semsig_gis.sources import RowCounts, load_catalog, paper_taxonomy
from semsig_gis.storage import geo_metadata, write_geoparquet

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.sources import RawLayer

LAMBERT = "EPSG:2154"
TAXONOMY = paper_taxonomy()
NAN = math.nan


def build(*layers: RawLayer, collapse: bool = True) -> StreetObjects:
    objects, _ = build_objects(layers, taxonomy=TAXONOMY, crs=LAMBERT, collapse=collapse)
    return objects


def points(*places: tuple[float, float]) -> list[shapely.Point]:
    return [shapely.Point(x, y) for x, y in places]


def test_geodataframe_has_names_and_symbols_of_classes() -> None:
    objects = build(
        raw_layer(points((0, 0), (50, 0)), classes=["bench", "street_light"], ids=["7", "8"])
    )
    table = objects.to_geodataframe()
    assert table[["symbol", "class_name", "source_id"]].to_numpy().tolist() == [
        ["L", "bench", "7"],
        ["D", "street_light", "8"],
    ]
    assert table.crs == objects.crs
    assert table.attrs["licenses"] == [str(licence) for licence in objects.licenses]
    assert "symbol" not in objects.table


def test_texts_that_are_missing_are_empty() -> None:
    objects = build(raw_layer(points((0, 0), (50, 0), (90, 0)), classes=["bench"] * 3))
    table = objects.table.assign(name=["Old bench", None, NAN], house_number=[NAN, 7, 7.5])
    objects = StreetObjects(table, objects.taxonomy, objects.licenses)
    assert objects.texts is not None
    assert objects.texts.to_pydict() == {
        "name": ["Old bench", "", ""],
        "house_number": ["", "7", "7.5"],
    }


ABSENT = object()


def write(objects: StreetObjects, path: Path, change: dict[str, Any], *, rows: int) -> None:
    """Write the first rows of a file of objects, with other columns or specs."""
    columns = {name: objects.table[name] for name in ("class_code", "source", "source_id", "count")}
    columns["geometry"] = pa.array(shapely.to_wkb(objects.table.geometry.array), pa.binary())
    specs = objects_specs(objects)
    for name, value in change.items():
        part = columns if name in columns else specs
        part[name] = value
        if value is ABSENT:
            del part[name]
    geo = geo_metadata(CRS(LAMBERT), geometry_types=["Point"], bounds=[1, 0, 3, 4])
    write_geoparquet(pa.table(columns).slice(0, rows), path, geo=geo, specs=specs)


def test_table_has_the_documented_columns() -> None:
    objects = build(
        raw_layer(points((1, 2), (3, 4)), ids=["a7", "é8"], classes=["bench", "street_light"])
    )
    town = (Licence("Town (CC0)", ("trees",)),)
    expected = objects_of((1, 2, 10, "trees", "a7"), (3, 4, 3, "trees", "é8"), licenses=town)
    assert_geodataframe_equal(objects.table, expected.table)
    assert (objects.licenses, objects.codes.tolist()) == (town, [10, 3])
    assert objects.xy.tolist() == [[1, 2], [3, 4]]
    assert not objects.xy.flags.writeable


def test_licences_list_each_publisher_once_with_its_layers() -> None:
    place = points((1, 2))
    objects = build(
        raw_layer(place, name="trees"),
        raw_layer(place, name="lights", attribution=""),
        raw_layer(place, name="taps"),
        raw_layer(place, name="taps"),
    )
    assert objects.licenses == (
        Licence("Town (CC0)", ("trees", "taps")),
        Licence("no attribution given (CC0)", ("lights",)),
    )
    assert str(objects.licenses[0]) == "Town (CC0): trees, taps"


@pytest.mark.parametrize(
    ("wkt", "centre"),
    [
        ("POINT (1 2)", (1, 2)),
        ("POINT Z (1 2 30)", (1, 2)),
        ("MULTIPOINT ((0 0), (4 2))", (2, 1)),
        ("LINESTRING (0 0, 10 0)", (5, 0)),
        ("LINESTRING Z (0 0 5, 10 0 7)", (5, 0)),
        ("LINESTRING (0 0, 10 0, 10 10)", (7.5, 2.5)),
        ("LINESTRING (3 3, 3 3)", (3, 3)),
        ("MULTILINESTRING ((0 0, 2 0), (0 4, 2 4))", (1, 2)),
        ("POLYGON ((0 0, 6 0, 0 6, 0 0))", (2, 2)),
        ("POLYGON ((5 5, 5 5, 5 5, 5 5))", (5, 5)),
        ("MULTIPOLYGON (((0 0, 2 0, 2 2, 0 2, 0 0)), ((4 0, 6 0, 6 2, 4 2, 4 0)))", (3, 1)),
        ("GEOMETRYCOLLECTION (POINT (9 9), LINESTRING (0 0, 2 0))", (1, 0)),
    ],
)
def test_object_is_placed_at_its_centroid(wkt: str, centre: tuple[float, float]) -> None:
    objects = build(raw_layer([shapely.from_wkt(wkt), shapely.Point(100, 100)]))
    assert objects.xy[0] == pytest.approx(centre)
    assert set(objects.table.geom_type) == {"Point"}
    assert not objects.table.has_z.any()


def test_centroid_is_computed_in_metres() -> None:
    # At 60 degrees north, a degree to the east is half as long as one to the north.
    bent = shapely.LineString([(24.941, 60.165), (24.941, 60.1654), (24.9416, 60.1654)])
    metric = "EPSG:32635"
    degrees = gpd.GeoSeries([bent], crs="EPSG:4326")
    layer = raw_layer([bent], crs="EPSG:4326")
    objects, _ = build_objects([layer], taxonomy=TAXONOMY, crs=metric)
    expected = shapely.get_coordinates(degrees.to_crs(metric).centroid)
    assert objects.xy == pytest.approx(expected, abs=1e-6)


AREA = shapely.box(0, 0, 20, 20)


@pytest.mark.parametrize(
    ("shapes", "places", "counts"),
    [
        ([shapely.Point(3, 4), AREA], [(3, 4)], [2]),
        ([AREA, shapely.Point(3, 4)], [(3, 4)], [2]),
        ([AREA, shapely.Point(0, 4), shapely.Point(5, 5)], [(0, 4), (5, 5)], [2, 1]),
        ([AREA, AREA.buffer(9), shapely.Point(3, 4)], [(3, 4)], [3]),
        ([AREA, shapely.Point(21, 4)], [(10, 10), (21, 4)], [1, 1]),
        ([AREA, AREA.boundary], [(10, 10)], [2]),
    ],
    ids=["point first", "area first", "several points", "several areas", "outside", "a line"],
)
def test_area_and_point_in_it_are_one_object(
    shapes: list[shapely.Geometry], places: list[tuple[float, float]], counts: list[int]
) -> None:
    objects, report = build_objects([raw_layer(shapes)], taxonomy=TAXONOMY, crs=LAMBERT)
    assert objects.xy.tolist() == [list(place) for place in places]
    assert objects.table["count"].tolist() == counts
    assert report.layers[0].counts.collapsed == len(shapes) - len(places)
    apart, _ = build_objects([raw_layer(shapes)], taxonomy=TAXONOMY, crs=LAMBERT, collapse=False)
    assert len(apart) == len(shapes)


def test_area_of_another_class_or_layer_is_another_object() -> None:
    shapes = [AREA, shapely.Point(3, 4)]
    kinds = raw_layer(shapes, classes=["bench", "alignment_tree"])
    assert len(build(kinds)) == 2
    layers = [raw_layer([shape], name=name) for name, shape in zip("ab", shapes, strict=True)]
    assert len(build(*layers)) == 1
    # Objects of classes in `apart` are merged later by `conflate`.
    apart = ["alignment_tree"]
    objects, _ = build_objects(layers, taxonomy=TAXONOMY, crs=LAMBERT, apart=apart)
    assert len(objects) == 2


def test_rows_without_a_position_are_dropped_and_counted() -> None:
    empty = [None, *map(shapely.from_wkt, ("POINT EMPTY", "POLYGON EMPTY"))]
    empty += map(shapely.from_wkt, ("MULTILINESTRING EMPTY", "GEOMETRYCOLLECTION EMPTY"))
    with np.errstate(invalid="ignore"):
        broken = shapely.linestrings([[(0, 0), (NAN, 1)], [(0, 0), (math.inf, 1)]])
    nowhere = [
        *points((NAN, 2), (NAN, NAN), (math.inf, 2)),
        *broken,
        shapely.from_wkt("LINESTRING (0 0, 1e308 1, -1e308 1)"),
        *points((-1.7976931348623157e308, 5), (3, -1e38), (1e8, 0)),
    ]
    mixed = [*points((1, 2)), *empty, *nowhere, *points((3, 4))]
    objects, report = build_objects([raw_layer(mixed)], taxonomy=TAXONOMY, crs=LAMBERT)
    assert objects.xy.tolist() == [[1, 2], [3, 4]]
    assert objects.table["source_id"].tolist() == ["0", str(len(mixed) - 1)]
    assert report.layers[0].counts == RowCounts(read=16, missing=5, misplaced=9)


def test_position_off_the_earth_is_misplaced() -> None:
    with np.errstate(invalid="ignore"):
        broken = shapely.linestrings([(3.88, 43.61), (NAN, 43.61)])
    places = points((3.88, 43.61), (500, 900), (3.9, 43.6), (1e38, 0))
    degrees = raw_layer([*places, broken], crs="EPSG:4326")
    objects, report = build_objects([degrees], taxonomy=TAXONOMY, crs=LAMBERT)
    assert report.layers[0].counts.misplaced == 3
    assert objects.table["source_id"].tolist() == ["0", "2"]


def test_layers_in_several_crs_are_joined() -> None:
    lon, lat = 3.876716, 43.610769
    x, y = Transformer.from_crs("EPSG:4171", LAMBERT, always_xy=True).transform(lon, lat)
    layers = [
        raw_layer(points((lon, lat)), name="degrees", crs="EPSG:4171"),
        raw_layer(points((x, y + 10)), name="metres"),
        raw_layer(points((x, y + 20)), name="esri", crs=CRS(LAMBERT).to_wkt("WKT1_ESRI")),
    ]
    objects = build(*layers)
    assert objects.xy == pytest.approx(np.array([[x, y], [x, y + 10], [x, y + 20]]), abs=1e-3)
    assert objects.crs == CRS(LAMBERT)


HERE = [shapely.Point(1, 2)]
NOWHERE = raw_layer(HERE, name="parks", crs=None)


@pytest.mark.parametrize(
    ("layer", "crs", "error", "words"),
    [
        (NOWHERE, LAMBERT, CrsError, ("'parks'", "no coordinate reference", "state its crs")),
        (raw_layer(HERE, classes="kiosk"), LAMBERT, UnknownNameError, ("'kiosk'",)),
        *(
            (raw_layer(HERE), crs, CrsError, ("projected CRS in metres",))
            for crs in ("EPSG:4326", "EPSG:3857", "EPSG:2263", "nonsense")
        ),
    ],
)
def test_unknown_class_and_unusable_crs_are_refused(
    layer: RawLayer, crs: str, error: type[Exception], words: tuple[str, ...]
) -> None:
    with refused(error, *words):
        build_objects([raw_layer(HERE), layer], taxonomy=TAXONOMY, crs=crs)


def test_layers_without_objects_are_refused() -> None:
    nothing = raw_layer([None, shapely.Point(NAN, NAN)], filtered=7)
    for layers in ([], [raw_layer([])], [nothing], [nothing, raw_layer([], crs="EPSG:4326")]):
        with pytest.raises(EmptyResultError) as caught:
            build(*layers)
        rows = sum(item.counts.read for item in layers)
        assert_sentence(caught.value, f"of {rows} rows in {len(layers)} layers", "look at")


def test_empty_layer_next_to_a_full_one_is_accepted() -> None:
    for crs in ("EPSG:4326", LAMBERT):
        empty, bad = raw_layer([], name="a", crs=crs), raw_layer([None], name="b", crs=crs)
        layers = [empty, raw_layer(HERE), bad]
        objects, report = build_objects(layers, taxonomy=TAXONOMY, crs=LAMBERT)
        assert objects.xy.tolist() == [[1, 2]]
        assert [item.counts.kept for item in report.layers] == [0, 1, 0]


# A millimetre further is the same place.
PLACES = st.tuples(st.sampled_from([0, 0.001, 1, 2]), st.integers(0, 2)).map(shapely.Point)
NO_GEOMETRY = st.sampled_from([None, shapely.Point()])
NO_PLACE = st.sampled_from([shapely.Point(NAN, 1), shapely.Point(1, math.inf)])
LINES = st.just(shapely.LineString([(0, 0), (2, 2)]))


@st.composite
def raw_layers(draw: st.DrawFn) -> RawLayer:
    geometries = draw(st.lists(PLACES | LINES | NO_GEOMETRY | NO_PLACE, max_size=12))

    def a_row_each(values: list[str]) -> list[str]:
        size = len(geometries)
        return draw(st.lists(st.sampled_from(values), min_size=size, max_size=size))

    return raw_layer(
        geometries,
        name=draw(st.sampled_from(["a", "b"])),
        classes=a_row_each(["bench", "bus_stop"]),
        ids=a_row_each(["", *"0123456789"]),
        filtered=draw(st.integers(0, 5)),
        unreadable=draw(st.integers(0, 15)),
        notes=draw(st.sampled_from([(), ("odd",)])),
        unique_id=draw(st.booleans()),
    )


@given(
    layers=st.lists(raw_layers(), max_size=4),
    collapse=st.booleans(),
    apart=st.sampled_from([(), ("bench",)]),
)
@settings(max_examples=100)
def test_counts_of_rows_equal_a_simple_implementation(
    *, layers: list[RawLayer], collapse: bool, apart: tuple[str, ...]
) -> None:
    things: dict[object, list[Any]] = {}  # the first of each class at a place, and their number
    ids = set()
    reports = []
    for number, layer in enumerate(layers):
        source, dropped = layer.spec.name, Counter[str]()
        for name, source_id, shape in layer.table.itertuples(index=False):
            if shape is None or shape.is_empty:
                dropped["missing"] += 1
                continue
            x, y = (shape if shape.geom_type == "Point" else shape.centroid).coords[0]
            if not math.isfinite(x + y):
                dropped["misplaced"] += 1
                continue
            place = (number if name in apart else None, name, round(x, 2), round(y, 2))
            key = place if collapse else len(things)
            if layer.spec.unique_id and source_id and (source, source_id) in ids:
                dropped["duplicates"] += 1
            elif key in things:
                dropped["collapsed"] += 1
                things[key][-1] += 1
            else:
                things[key] = [name, source, source_id, x, y, 1]
            ids.add((source, source_id))
        counts = dataclasses.replace(layer.counts, **dropped)
        notes = (*layer.notes, *layer.errors)
        reports.append(LayerReport(source, counts, notes, classes=layer.spec.classes))
    try:
        objects, report = build_objects(
            layers, taxonomy=TAXONOMY, crs=LAMBERT, collapse=collapse, apart=apart
        )
    except EmptyResultError:
        assert not things
        return
    assert report.layers == tuple(reports)
    assert sum(item.counts.kept for item in report.layers) == len(objects)
    columns = (objects.table[name] for name in ("source", "source_id", "count"))
    assert list(things.values()) == [
        [TAXONOMY.by_code(code).name, source, name, x, y, count]
        for code, source, name, count, (x, y) in zip(
            objects.codes, *columns, objects.xy.tolist(), strict=True
        )
    ]


LICENCE = st.builds(
    Licence,
    st.sampled_from(["Town (CC0)", "A: b, c", ""]),
    st.lists(st.text("ab,: ", min_size=1, max_size=6), unique=True, max_size=3).map(tuple),
)


@given(st.lists(LICENCE, max_size=3).map(tuple), st.sets(st.text("ab,: ", max_size=4)))
def test_licences_are_read_back_for_any_layer_names(
    licenses: tuple[Licence, ...], sources: set[str]
) -> None:
    layers = sources.union(*(licence.layers for licence in licenses)) or {"trees"}
    objects = build(*(raw_layer(points((1, number)), name=n) for number, n in enumerate(layers)))
    objects = dataclasses.replace(objects, licenses=licenses)
    with tempfile.TemporaryDirectory() as folder:
        save_objects(objects, f"{folder}/objects.parquet")
        assert open_objects(f"{folder}/objects.parquet").licenses == licenses


@pytest.mark.parametrize(
    ("line", "layers"),
    [
        ("Town: of (CC0): parks, trees, lamps", ("parks, trees", "lamps")),
        ("Town (CC0): lamps, x: y", ("lamps", "x: y")),
        ("Town (CC0): lamps, benches", ()),  # a layer without objects, or one called by both
        ("Town (CC0): b, b, b", ()),  # two layers, and which?
        ("Town (CC0)", ()),
    ],
)
def test_layers_of_licences_in_older_files_are_inferred(
    tmp_path: Path, line: str, layers: tuple[str, ...]
) -> None:
    """Files of earlier versions have only attribution lines."""
    names = ("parks, trees", "lamps", "x: y", "b", "b, b")
    objects = build(
        *(raw_layer(points((1, number)), name=name) for number, name in enumerate(names))
    )
    terms = line.removesuffix(f": {', '.join(layers)}")
    objects = dataclasses.replace(objects, licenses=(Licence(terms, layers),))
    assert objects_specs(objects)["licenses"] == [line]
    path = tmp_path / "objects.parquet"
    write(objects, path, {"license_layers": ABSENT}, rows=len(names))
    assert open_objects(path).licenses == objects.licenses


def test_license_layers_are_stored_only_if_needed() -> None:
    lamps, benches = (raw_layer(HERE, name=name) for name in ("lamps", "benches"))
    assert "license_layers" not in objects_specs(build(lamps, benches, collapse=False))
    specs = objects_specs(build(lamps, raw_layer([], name="benches")))
    assert specs["licenses"] == ["Town (CC0): lamps, benches"]
    assert specs["license_layers"] == [["lamps", "benches"]]


def test_saved_objects_are_read_back(tmp_path: Path) -> None:
    taxonomy = load_catalog("montpellier").taxonomy
    layers = [
        raw_layer(points((700_000.123456789, 6_600_000.1)), ids=["Écusson n°7 - 東"], name="é"),
        raw_layer(points((1, 2), (1, 2)), ids=["", "b"], name="meters", classes="parking_meter"),
    ]
    objects, _ = build_objects(layers, taxonomy=taxonomy, crs=LAMBERT)
    path = tmp_path / "objects.parquet"
    save_objects(objects, path, keep_order=True)
    again = open_objects(str(path))
    assert_geodataframe_equal(again.table, objects.table)
    assert again.table["count"].tolist() == [1, 2]
    assert (again.taxonomy, again.licenses) == (objects.taxonomy, objects.licenses)
    frame = gpd.read_parquet(path)
    assert frame["source_id"].tolist() == ["Écusson n°7 - 東", ""]
    assert frame.crs == CRS(LAMBERT)


def scattered(count: int) -> StreetObjects:
    rng = np.random.default_rng(9)
    places = rng.uniform(0, 5_000, (count, 2)) + np.array([765_000.0, 6_275_000.0])
    return build(raw_layer(points(*map(tuple, places.tolist()))))


def test_order_of_saved_objects_is_stable(tmp_path: Path) -> None:
    objects = scattered(3_000)
    path = tmp_path / "objects.parquet"
    save_objects(objects, path)
    content, again = path.read_bytes(), open_objects(path)
    # Every object once, whatever the order.
    rows = again.table["source_id"].astype(int)
    assert sorted(rows) == list(range(len(objects)))
    assert_geodataframe_equal(again.table, objects.table.iloc[rows].reset_index(drop=True))
    save_objects(again, path)
    assert path.read_bytes() == content
    # Neighbours in the file are neighbours in the city.
    assert np.median(np.hypot(*np.diff(again.xy, axis=0).T)) < 150
    assert np.median(np.hypot(*np.diff(objects.xy, axis=0).T)) > 1_500


@given(
    places=st.lists(st.tuples(st.integers(-20, 20), st.integers(-20, 20)), min_size=1, max_size=40),
    corner=st.tuples(st.integers(-20, 20), st.integers(-20, 20)),
    size=st.tuples(st.integers(0, 20), st.integers(0, 20)),
    at=st.sampled_from([(0.0, 0.0), (765_200.1, 6_275_000.7)]),
    group_rows=st.sampled_from([1, 3, 8192]),
    keep_order=st.booleans(),
)
@settings(max_examples=60)
def test_box_returns_exactly_the_objects_in_it(
    *,
    places: list[tuple[int, int]],
    corner: tuple[int, int],
    size: tuple[int, int],
    at: tuple[float, float],
    group_rows: int,
    keep_order: bool,
) -> None:
    placed = [(x * 0.1 + at[0], y * 0.1 + at[1]) for x, y in places]
    # The edges of the box go through objects.
    ends = corner[0] + size[0], corner[1] + size[1]
    (west, south), (east, north) = ((x * 0.1 + at[0], y * 0.1 + at[1]) for x, y in (corner, ends))
    objects = build(raw_layer(points(*placed)), collapse=False)
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr("semsig_gis.objects.table.GROUP_ROWS", group_rows)
        save_objects(objects, f"{folder}/objects.parquet", keep_order=keep_order)
        result = open_objects(f"{folder}/objects.parquet", box=(west, south, east, north))
    inside = [row for row, (x, y) in enumerate(placed) if west <= x <= east and south <= y <= north]
    assert sorted(result.table["source_id"].astype(int)) == inside
    assert result.xy.shape == (len(inside), 2)
    assert result.taxonomy == objects.taxonomy


def test_only_row_groups_near_the_box_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_objects(scattered(40_000), tmp_path / "objects.parquet")
    original, read = pq.ParquetFile.read_row_groups, []

    def watched(self: pq.ParquetFile, groups: list[int], *args: object) -> pa.Table:
        read.append(len(groups))
        return original(self, groups, *args)

    monkeypatch.setattr(pq.ParquetFile, "read_row_groups", watched)
    box = (765_100.0, 6_275_100.0, 765_500.0, 6_275_500.0)
    assert 100 < len(open_objects(tmp_path / "objects.parquet", box=box)) < 500
    assert read == [1]  # of five


def test_geopandas_and_older_files_support_reading_by_box(tmp_path: Path) -> None:
    objects = scattered(500)
    path = tmp_path / "objects.parquet"
    save_objects(objects, path)
    box = (766_000.0, 6_276_000.0, 768_000.0, 6_277_000.0)
    frame = gpd.read_parquet(path, bbox=box)
    ids = open_objects(path, box=box).table["source_id"].tolist()
    assert frame["source_id"].tolist() == ids
    assert "bbox" not in frame.columns
    pq.write_table(pq.read_table(path).drop_columns(["bbox"]), path)
    assert open_objects(path, box=box).table["source_id"].tolist() == ids


def test_truncated_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "objects.parquet"
    save_objects(build(raw_layer(points((1, 2), (3, 4)))), path)
    content = path.read_bytes()
    for size in range(0, len(content), 50):
        path.write_bytes(content[:size])
        with refused(DatabaseError, str(path), "street objects"):
            open_objects(path)


TREE = shapely.Point(1, 2)


@pytest.mark.parametrize(
    "change",
    [
        {"class_code": pa.array([1, 99], pa.uint8())},
        {"class_code": pa.array([1, None], pa.uint8())},
        {"class_code": ABSENT},
        {"source_id": ABSENT},
        {"geometry": pa.array([b"POINT", b"x"])},
        {"geometry": ABSENT},
        *(
            {"geometry": pa.array(shapely.to_wkb([TREE, other]), pa.binary())}
            for other in (None, shapely.Point(), shapely.box(0, 0, 1, 1), shapely.Point(1, NAN))
        ),
        *(
            {name: pa.array([value, value])}
            for name in ("class_code", "source", "source_id", "count")
            for value in ([1], 1.5, True, b"x")
        ),
        {"taxonomy": None},
        {"taxonomy": [{"code": 1}]},
        {"taxonomy": [{"code": 0, "symbol": "B", "name": "b", "title": "B"}]},
        {"taxonomy": ABSENT},
        {"licenses": None},
        {"licenses": ABSENT},
        {"license_layers": None},
        {"license_layers": []},
        {"license_layers": [["parks"]]},
        {"license_layers": [5]},
        {"rows": 0},
    ],
)
def test_inconsistent_file_is_refused(tmp_path: Path, change: dict[str, Any]) -> None:
    objects = build(raw_layer(points((1, 2), (3, 4))))
    path = tmp_path / "objects.parquet"
    write(objects, path, change, rows=change.get("rows", 2))
    with refused(DatabaseError, str(path), "is damaged", "load the street objects again"):
        open_objects(path)
