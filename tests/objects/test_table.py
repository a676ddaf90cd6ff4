from __future__ import annotations

import dataclasses
import math
import tempfile
from collections import Counter
from pathlib import Path
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

from semsig_gis.core.errors import CrsError, DatabaseError, EmptyResultError, UnknownNameError
from semsig_gis.objects.load import build_objects
from semsig_gis.objects.table import Licence, objects_specs, open_objects, save_objects
from semsig_gis.sources import RowCounts
from semsig_gis.sources.catalog import load_catalog, paper_taxonomy
from semsig_gis.storage.geoparquet import geo_metadata, write_geoparquet

if TYPE_CHECKING:
    from semsig_gis.objects.table import StreetObjects
    from semsig_gis.sources import RawLayer

LAMBERT = "EPSG:2154"
TAXONOMY = paper_taxonomy()
NAN = math.nan


def build(*layers: RawLayer, collapse: bool = True) -> StreetObjects:
    objects, _ = build_objects(layers, taxonomy=TAXONOMY, crs=LAMBERT, collapse=collapse)
    return objects


def points(*places: tuple[float, float]) -> list[shapely.Point]:
    return [shapely.Point(x, y) for x, y in places]


def objects_columns(objects: StreetObjects) -> pa.Table:
    """Return what a file of objects holds."""
    columns = {name: objects.table[name] for name in ("class_code", "source", "source_id", "count")}
    wkb = pa.array(shapely.to_wkb(objects.table.geometry.array), pa.binary())
    return pa.table({**columns, "geometry": wkb})


def write(columns: pa.Table, path: Path, *, specs: dict[str, Any]) -> None:
    geo = geo_metadata(CRS(LAMBERT), geometry_types=["Point"], bounds=[1, 0, 3, 4])
    write_geoparquet(columns, path, geo=geo, specs=specs)


def test_the_table_has_the_columns_it_promises() -> None:
    objects = build(
        raw_layer(points((1, 2), (3, 4)), ids=["a7", "é8"], classes=["bench", "street_light"])
    )
    expected = gpd.GeoDataFrame(
        {
            "class_code": np.array([10, 3], np.uint8),
            "source": "trees",
            "source_id": ["a7", "é8"],
            "count": np.ones(2, np.int32),
        },
        geometry=shapely.points([[1, 2], [3, 4]]),
        crs=LAMBERT,
    )
    assert_geodataframe_equal(objects.table, expected)
    assert len(objects) == 2
    assert objects.codes.tolist() == [10, 3]
    assert objects.xy.tolist() == [[1, 2], [3, 4]]
    assert objects.crs == CRS(LAMBERT)
    assert objects.licenses == (Licence("Town (CC0)", ("trees",)),)


def test_every_publisher_is_named_once_with_the_layers_it_gave() -> None:
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
def test_an_object_stands_at_its_centroid(wkt: str, centre: tuple[float, float]) -> None:
    objects = build(raw_layer([shapely.from_wkt(wkt), shapely.Point(100, 100)]))
    assert objects.xy[0] == pytest.approx(centre)
    assert set(objects.table.geom_type) == {"Point"}
    assert not objects.table.has_z.any()


def test_rows_without_a_place_are_dropped_and_counted() -> None:
    bad = [
        None,
        shapely.Point(),
        shapely.Polygon(),
        shapely.from_wkt("MULTILINESTRING EMPTY"),
        shapely.from_wkt("GEOMETRYCOLLECTION EMPTY"),
    ]
    with np.errstate(invalid="ignore"):
        broken = shapely.linestrings([[(0, 0), (NAN, 1)], [(0, 0), (math.inf, 1)]])
    nowhere = [
        *points((NAN, 2), (NAN, NAN), (math.inf, 2)),
        *broken,
        shapely.from_wkt("LINESTRING (0 0, 1e308 1, -1e308 1)"),
        *points((-1.7976931348623157e308, 5), (3, -1e38), (1e8, 0)),
    ]
    good = points((1, 2), (3, 4))
    mixed = [good[0], *bad, *nowhere, good[1]]
    ids = [str(row) for row in range(len(mixed))]
    objects, report = build_objects([raw_layer(mixed, ids=ids)], taxonomy=TAXONOMY, crs=LAMBERT)
    assert objects.xy.tolist() == [[1, 2], [3, 4]]
    assert objects.table["source_id"].tolist() == ["0", ids[-1]]
    (told,) = report.layers
    assert told.counts == RowCounts(read=16, missing=5, misplaced=9)


def test_a_place_off_the_earth_is_misplaced() -> None:
    with np.errstate(invalid="ignore"):
        broken = shapely.linestrings([(3.88, 43.61), (NAN, 43.61)])
    places = points((3.88, 43.61), (500, 900), (3.9, 43.6), (1e38, 0))
    degrees = raw_layer([*places, broken], crs="EPSG:4326")
    objects, report = build_objects([degrees], taxonomy=TAXONOMY, crs=LAMBERT)
    assert report.layers[0].counts.misplaced == 3
    assert objects.table["source_id"].tolist() == ["0", "2"]


@pytest.mark.parametrize(
    ("layers", "rows", "counts"),
    [
        (
            [("trees", [(0, 0), (5, 5), (0, 0), (0, 0.001), (0, 1)])],
            [["trees", "0", 3], ["trees", "1", 1], ["trees", "4", 1]],
            [RowCounts(read=5, collapsed=2)],
        ),
        (
            [("north", [(0, 0), (1, 1)]), ("south", [(1, 1), (1, 1), (2, 2)])],
            [["north", "0", 1], ["north", "1", 3], ["south", "2", 1]],
            [RowCounts(read=2), RowCounts(read=3, collapsed=2)],
        ),
        (
            [("trees", [(0, 0)]), ("trees", [(0, 0), (1, 1), (2, 2)])],
            [["trees", "0", 2], ["trees", "1", 1], ["trees", "2", 1]],
            [RowCounts(read=1), RowCounts(read=3, collapsed=1)],
        ),
    ],
    ids=["one layer", "two layers", "two of one name"],
)
def test_one_class_at_one_place_is_one_object_of_the_first_layer(
    layers: list[tuple[str, list[tuple[float, float]]]],
    rows: list[list[object]],
    counts: list[RowCounts],
) -> None:
    raw = [raw_layer(points(*places), name=name) for name, places in layers]
    objects, report = build_objects(raw, taxonomy=TAXONOMY, crs=LAMBERT)
    assert objects.table[["source", "source_id", "count"]].to_numpy().tolist() == rows
    places = {(name, str(row)): place for name, at in layers for row, place in enumerate(at)}
    assert objects.xy.tolist() == [list(places[str(row[0]), str(row[1])]) for row in rows]
    names = [name for name, _ in layers]
    assert [(item.name, item.counts) for item in report.layers] == [
        *zip(names, counts, strict=True)
    ]


def test_layers_in_several_systems_meet_in_one() -> None:
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
def test_unknown_classes_and_other_systems_are_refused(
    layer: RawLayer, crs: str, error: type[Exception], words: tuple[str, ...]
) -> None:
    with refused(error, *words):
        build_objects([raw_layer(HERE), layer], taxonomy=TAXONOMY, crs=crs)


def test_nothing_left_is_an_error() -> None:
    nothing = raw_layer([None, shapely.Point(NAN, NAN)], filtered=7)
    for layers in ([], [raw_layer([])], [nothing], [nothing, raw_layer([], crs="EPSG:4326")]):
        with pytest.raises(EmptyResultError) as caught:
            build(*layers)
        rows = sum(item.counts.read for item in layers)
        assert_sentence(caught.value, f"of {rows} rows in {len(layers)} layers", "look at")


def test_an_empty_layer_beside_a_full_one_is_fine() -> None:
    for crs in ("EPSG:4326", LAMBERT):
        empty, bad = raw_layer([], name="a", crs=crs), raw_layer([None], name="b", crs=crs)
        layers = [empty, raw_layer(HERE), bad]
        objects, report = build_objects(layers, taxonomy=TAXONOMY, crs=LAMBERT)
        assert objects.xy.tolist() == [[1, 2]]
        assert [item.counts.kept for item in report.layers] == [0, 1, 0]


PLACES = st.tuples(st.integers(0, 2), st.integers(0, 2)).map(shapely.Point)
BAD = st.sampled_from([None, shapely.Point(), shapely.Point(NAN, 1), shapely.Point(1, math.inf)])
LINES = st.just(shapely.LineString([(0, 0), (2, 2)]))


@st.composite
def raw_layers(draw: st.DrawFn) -> RawLayer:
    geometries = draw(st.lists(st.one_of(PLACES, BAD, LINES), max_size=12))
    names = st.sampled_from(["bench", "bus_stop"])
    return raw_layer(
        geometries,
        name=draw(st.sampled_from(["a", "b"])),
        classes=draw(st.lists(names, min_size=len(geometries), max_size=len(geometries))),
        filtered=draw(st.integers(0, 5)),
        unreadable=draw(st.integers(0, 15)),
        notes=draw(st.sampled_from([(), ("odd",)])),
    )


@given(st.lists(raw_layers(), max_size=4), st.booleans())
def test_every_row_is_accounted_for(layers: list[RawLayer], collapse: bool) -> None:  # noqa: FBT001
    expected: Counter[tuple[str, float, float]] = Counter()
    for item in layers:
        for name, geometry in zip(item.table["class_name"], item.table.geometry, strict=True):
            if geometry is not None and not geometry.is_empty:
                centre = geometry.centroid if geometry.geom_type != "Point" else geometry
                if math.isfinite(centre.x) and math.isfinite(centre.y):
                    expected[name, centre.x, centre.y] += 1
    if not expected:
        with pytest.raises(EmptyResultError):
            build(*layers)
        return
    objects, report = build_objects(layers, taxonomy=TAXONOMY, crs=LAMBERT, collapse=collapse)
    assert len(report.layers) == len(layers)
    for item, told in zip(layers, report.layers, strict=True):
        assert min(*dataclasses.astuple(told.counts), told.counts.kept) >= 0
        for reason in ("read", "unreadable", "filtered"):
            assert getattr(told.counts, reason) == getattr(item.counts, reason)
        assert told.notes == (*item.notes, *item.errors)
    assert sum(item.counts.kept for item in report.layers) == len(objects)
    found: Counter[tuple[str, float, float]] = Counter()
    for code, (x, y), count in zip(
        objects.codes, objects.xy.tolist(), objects.table["count"], strict=True
    ):
        found[TAXONOMY.by_code(code).name, x, y] += int(count)
    assert found == expected
    assert len(objects) == (len(expected) if collapse else expected.total())


LICENCE = st.builds(
    Licence,
    st.sampled_from(["Town (CC0)", "A: b, c", ""]),
    st.lists(st.text("ab,: ", min_size=1, max_size=6), unique=True, max_size=3).map(tuple),
)


@given(st.lists(LICENCE, max_size=3).map(tuple), st.sets(st.text("ab,: ", max_size=4)))
def test_licences_come_back_whatever_layers_are_called(
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
def test_an_older_file_tells_layers_by_its_objects(
    tmp_path: Path, line: str, layers: tuple[str, ...]
) -> None:
    """Files of earlier versions have lines for people, and nothing beside them."""
    names = ("parks, trees", "lamps", "x: y", "b", "b, b")
    objects = build(
        *(raw_layer(points((1, number)), name=name) for number, name in enumerate(names))
    )
    terms = line.removesuffix(f": {', '.join(layers)}")
    objects = dataclasses.replace(objects, licenses=(Licence(terms, layers),))
    specs = {
        name: value for name, value in objects_specs(objects).items() if name != "license_layers"
    }
    assert specs["licenses"] == [line]
    path = tmp_path / "objects.parquet"
    write(objects_columns(objects), path, specs=specs)
    assert open_objects(path).licenses == objects.licenses


def test_a_file_says_of_layers_only_what_its_lines_do_not_tell() -> None:
    lamps, benches = (raw_layer(HERE, name=name) for name in ("lamps", "benches"))
    assert "license_layers" not in objects_specs(build(lamps, benches, collapse=False))
    specs = objects_specs(build(lamps, raw_layer([], name="benches")))
    assert specs["licenses"] == ["Town (CC0): lamps, benches"]
    assert specs["license_layers"] == [["lamps", "benches"]]


def test_saved_objects_come_back(tmp_path: Path) -> None:
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
    for name in ("taxonomy", "licenses", "crs"):
        assert getattr(again, name) == getattr(objects, name)
    assert again.xy.tolist() == objects.xy.tolist()
    frame = gpd.read_parquet(path)
    assert frame["source_id"].tolist() == ["Écusson n°7 - 東", ""]
    assert frame.crs == CRS(LAMBERT)


def scattered(count: int) -> StreetObjects:
    rng = np.random.default_rng(9)
    places = rng.uniform(0, 5_000, (count, 2)) + np.array([765_000.0, 6_275_000.0])
    return build(raw_layer(points(*map(tuple, places.tolist()))))


def test_saved_objects_come_back_in_an_order_that_stays() -> None:
    objects = scattered(3_000)
    with tempfile.TemporaryDirectory() as folder:
        one, two = Path(folder) / "one.parquet", Path(folder) / "two.parquet"
        save_objects(objects, one)
        again = open_objects(one)
        # Every object once, whatever the order.
        by_id = {number: row for row, number in enumerate(objects.table["source_id"])}
        rows = [by_id[number] for number in again.table["source_id"]]
        assert sorted(rows) == list(range(len(objects)))
        expected = objects.table.iloc[rows].reset_index(drop=True)
        assert_geodataframe_equal(again.table, expected)
        save_objects(again, two)
        assert one.read_bytes() == two.read_bytes()
    # Neighbours in the file are neighbours in the city.
    steps = np.hypot(*np.diff(again.xy, axis=0).T)
    assert np.median(steps) < 150
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
def test_a_box_holds_exactly_the_objects_in_it(
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
    west, south = corner[0] * 0.1 + at[0], corner[1] * 0.1 + at[1]
    east, north = (corner[0] + size[0]) * 0.1 + at[0], (corner[1] + size[1]) * 0.1 + at[1]
    objects, _ = build_objects(
        [raw_layer(points(*placed))], taxonomy=TAXONOMY, crs=LAMBERT, collapse=False
    )
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr("semsig_gis.objects.table.GROUP_ROWS", group_rows)
        save_objects(objects, f"{folder}/objects.parquet", keep_order=keep_order)
        found = open_objects(f"{folder}/objects.parquet", box=(west, south, east, north))
    inside = [
        number for number, (x, y) in enumerate(placed) if west <= x <= east and south <= y <= north
    ]
    assert sorted(int(number) for number in found.table["source_id"]) == inside
    assert found.xy.shape == (len(inside), 2)
    assert found.taxonomy == objects.taxonomy


def test_only_the_groups_near_a_box_are_read(tmp_path: Path) -> None:
    objects = scattered(40_000)
    save_objects(objects, tmp_path / "objects.parquet")
    read: list[list[int]] = []
    original = pq.ParquetFile.read_row_groups

    def watched(self: pq.ParquetFile, groups: list[int], *args: object) -> pa.Table:
        read.append(groups)
        return original(self, groups, *args)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pq.ParquetFile, "read_row_groups", watched)
        box = (765_100.0, 6_275_100.0, 765_500.0, 6_275_500.0)
        found = open_objects(tmp_path / "objects.parquet", box=box)
    assert 100 < len(found) < 500
    assert [len(groups) for groups in read] == [1]  # of five


def test_other_programs_and_files_of_before_read_by_box_too(tmp_path: Path) -> None:
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


def test_positions_cannot_be_changed_by_accident() -> None:
    objects = build(raw_layer(points((1, 2))))
    with pytest.raises(ValueError, match="read-only"):
        objects.xy[0, 0] = 9
    with pytest.raises(dataclasses.FrozenInstanceError):
        objects.licenses = ()  # type: ignore[misc]


def test_a_cut_file_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "objects.parquet"
    save_objects(build(raw_layer(points((1, 2), (3, 4)))), path)
    content = path.read_bytes()
    for size in range(0, len(content), 50):
        path.write_bytes(content[:size])
        with refused(DatabaseError, str(path), "street objects"):
            open_objects(path)


@pytest.mark.parametrize(
    ("column", "values"),
    [
        ("class_code", pa.array([1, 99], pa.uint8())),
        ("class_code", pa.array([1, None], pa.uint8())),
        ("class_code", None),
        ("source_id", None),
        ("geometry", pa.array([b"POINT", b"x"])),
        ("geometry", pa.array([shapely.to_wkb(shapely.Point(1, 2)), None], pa.binary())),
        ("geometry", pa.array(shapely.to_wkb([shapely.Point(1, 2), shapely.Point()]))),
        ("geometry", pa.array(shapely.to_wkb([shapely.Point(1, 2), shapely.box(0, 0, 1, 1)]))),
        ("geometry", pa.array(shapely.to_wkb([shapely.Point(1, 2), shapely.Point(1, NAN)]))),
        ("geometry", None),
        ("specs", {"taxonomy": None}),
        ("specs", {"taxonomy": [{"code": 1}]}),
        ("specs", {"taxonomy": [{"code": 0, "symbol": "B", "name": "b", "title": "B"}]}),
        ("specs", {"licenses": None}),
        ("specs", {"license_layers": None}),
        ("specs", {"license_layers": []}),
        ("specs", {"license_layers": [["parks"]]}),
        ("specs", {"license_layers": [5]}),
        ("specs", {}),
        ("rows", None),
    ],
)
def test_a_file_that_does_not_fit_itself_is_an_error(
    tmp_path: Path, column: str, values: object
) -> None:
    objects = build(raw_layer(points((1, 2), (3, 4))))
    table = objects_columns(objects)
    specs = {"kind": "street objects", "taxonomy": TAXONOMY.to_list(), "licenses": []}
    if column == "specs":
        assert isinstance(values, dict)
        specs = {"kind": "street objects", **values}
        if "license_layers" in values:
            specs |= {"taxonomy": TAXONOMY.to_list(), "licenses": ["Town (CC0): trees"]}
    elif column == "rows":
        table = table.slice(0, 0)
    elif values is None:
        table = table.drop_columns([column])
    else:
        table = table.set_column(table.column_names.index(column), column, [values])
    path = tmp_path / "objects.parquet"
    write(table, path, specs=specs)
    with refused(DatabaseError, str(path), "is damaged", "load the street objects again"):
        open_objects(path)
