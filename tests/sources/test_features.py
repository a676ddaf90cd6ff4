"""Elements of OpenStreetMap as the rows of tables, in the many forms that programs give them."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import pytest
import shapely
from geojson import collection, feature, point
from sentences import refused

from semsig_gis.core import SourceError
from semsig_gis.sources import (
    RowCounts,
    file_reader,
    find_files,
    frame_layers,
    has_element_columns,
    load_catalog,
)
from semsig_gis.sources.osm.features import read_layers

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from semsig_gis.sources import RawLayer

BENCH, TREE = {"amenity": "bench", "layer": "1", "name": 'so "called"'}, {"natural": "tree"}
HSTORE = (r'"amenity"=>"bench","layer"=>"1","name"=>"so \"called\"","x"=>NULL', '"natural"=>"tree"')
SPECS = tuple(load_catalog("openstreetmap").layer(name) for name in ("benches", "trees"))
IDS = ["node/1", "node/2"]
SQUARE = shapely.box(2, 48, 2.001, 48.001)


def frame(shapes: Sequence[object] | None = None, **columns: list[Any]) -> gpd.GeoDataFrame:
    size = len(next(iter(columns.values())))
    geometry = shapes or [shapely.Point(2 + number, 48) for number in range(size)]
    names = {name.replace("at_", "@"): values for name, values in columns.items()}
    return gpd.GeoDataFrame(names, geometry=geometry, crs="EPSG:4326")


def ids(layers: tuple[RawLayer, ...]) -> list[list[str]]:
    return [layer.table["source_id"].tolist() for layer in layers]


FORMS = {
    "osmnx": {"element": ["node"] * 2, "id": [1, 2], "amenity": ["bench", None],
              "natural": [None, "tree"]},
    "osmnx 1": {"element_type": ["node"] * 2, "osmid": [1, 2], "amenity": ["bench", None],
                "natural": [None, "tree"]},
    "QuackOSM": {"feature_id": IDS, "tags": [BENCH, TREE]},
    "pairs": {"feature_id": IDS, "tags": [list(BENCH.items()), list(TREE.items())]},
    "DuckDB": {"feature_id": IDS, "tags": [[{"key": "amenity", "value": "bench"}],
                                           [{"key": "natural", "value": "tree"}]]},
    "pyrosm": {"osm_type": ["node"] * 2, "id": [1, 2], "amenity": ["bench", None],
               "tags": ['{"layer":"1"}', '{"natural":"tree"}']},
    "osm2pgsql": {"osm_id": [1, 2], "tags": list(HSTORE)},
    "GDAL": {"osm_id": ["1", "2"], "other_tags": list(HSTORE), "highway": [None, None]},
    "QuickOSM": {"full_id": ["n1", "n2"], "osm_id": ["1", "2"], "osm_type": ["node"] * 2,
                 "amenity": ["bench", None], "natural": [None, "tree"]},
    "overpass turbo": {"at_id": IDS, "amenity": ["bench", None], "natural": [None, "tree"]},
    "osmtogeojson": {"type": ["node"] * 2, "id": [1, 2], "tags": [BENCH, TREE]},
    "ohsome": {"at_osmId": IDS, "at_snapshotTimestamp": ["2024"] * 2, "amenity": ["bench", None],
               "at_other_tags": [{"layer": "1"}, TREE]},
    "Geofabrik": {"osm_id": ["1", "2"], "code": [2902, 4121], "fclass": ["bench", "tree"],
                  "name": ["", None]},
}  # fmt: skip


@pytest.mark.parametrize("columns", FORMS.values(), ids=FORMS)
def test_elements_are_recognized_by_their_columns(columns: dict[str, list[Any]]) -> None:
    table = frame(**columns)
    assert has_element_columns(table.columns) or "type" in columns
    layers = frame_layers(table, SPECS)
    assert ids(layers) == [["node/1"], ["node/2"]]
    assert [layer.notes for layer in layers] == [(), ()]


@pytest.mark.parametrize("name", ["overpass turbo", "osmtogeojson", "GDAL", "ohsome"])
def test_geojson_is_read_like_a_table(tmp_path: Path, name: str) -> None:
    columns = {key.replace("at_", "@"): values for key, values in FORMS[name].items()}
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    features = [feature(point(2, n), row) for n, row in enumerate(rows)]
    path = tmp_path / "some.geojson"
    path.write_text(json.dumps(collection(features)))
    assert file_reader(path) == "osm_features"
    assert ids(read_layers(path, SPECS)) == [["node/1"], ["node/2"]]


def test_geofabrik_shapefiles_are_read_together(tmp_path: Path) -> None:
    """Roads and buildings have classes that are values of a key; landuse is ignored."""
    folder = tmp_path / "shp"
    folder.mkdir()
    line = shapely.LineString([(2, 48), (2.001, 48)])
    for name, shapes, code, fclass in (
        ("pois", None, 2902, "bench"),
        ("roads", [line], 5122, "residential"),
        ("landuse_a", [SQUARE], 7203, "residential"),
        ("buildings_a", [SQUARE], 1500, "building"),
    ):
        some = frame(shapes, osm_id=["7"], code=[code], fclass=[fclass])
        some.to_file(folder / f"gis_osm_{name}_free_1.shp")
    names = ("benches", "streets", "buildings")
    specs = [load_catalog("openstreetmap").layer(name) for name in names]
    pairs, missing = find_files(specs, [folder])
    assert (len(pairs), missing) == (12, ())
    layers = read_layers([path for _, path in pairs[:4]], specs)
    assert ids(layers) == [["node/7"], ["way/7"], ["way/7"]]
    assert layers[1].table["half_width"].tolist() == [8.0]


def test_columns_and_shapes_distinguish_ways_and_relations() -> None:
    ring = shapely.Polygon(
        SQUARE.exterior, [shapely.box(2.0004, 48.0004, 2.0006, 48.0006).exterior]
    )
    shapes = [SQUARE.exterior, SQUARE, ring, shapely.Point(2, 48), shapely.MultiPoint([(2, 48)])]
    fountains = load_catalog("openstreetmap").layer("fountains")
    layer = frame_layers(
        frame(shapes, osm_id=[1, 2, -3, 4, 5], amenity=["fountain"] * 5), [fountains]
    )[0]
    assert ids((layer,)) == [["way/1", "way/2", "relation/3", "node/4", "node/5"]]
    # A closed line is an area, also from another program.
    assert shapely.area(layer.table.geometry.array).round(9).tolist()[:3] == [1e-6, 1e-6, 9.6e-7]
    gdal = frame(
        [SQUARE] * 2,
        osm_id=["1", None],
        osm_way_id=[None, "2"],
        other_tags=['"amenity"=>"fountain"'] * 2,
    )
    assert ids(frame_layers(gdal, [fountains])) == [["relation/1", "way/2"]]
    # Without a number every row is an element of its own.
    nameless = frame(amenity=["fountain"] * 2)
    assert frame_layers(nameless, [fountains])[0].counts.kept == 2


def test_element_counts_once_and_unreadable_tags_are_noted() -> None:
    snapshots = frame(at_osmId=["node/1", "node/1"], amenity=["bench", "bench"])
    assert frame_layers(snapshots, SPECS)[0].counts == RowCounts(read=2, duplicates=1)
    broken = frame(feature_id=IDS, tags=["{amenity}", TREE])
    assert frame_layers(broken, SPECS)[0].notes == ("1 rows have tags that cannot be read",)
    joined = frame(feature_id=IDS, amenity=[["bench", "shelter"], "bench"])
    assert ids(frame_layers(joined, SPECS)) == [["node/2"], []]


def test_file_without_tags_is_refused(tmp_path: Path) -> None:
    path, folder = tmp_path / "trees.gpkg", tmp_path / "city"
    frame(art=["oak"]).to_file(path)
    assert file_reader(path) is None
    with refused(SourceError, "trees.gpkg", "*.pbf", "tags"):
        find_files(SPECS, [path])
    folder.mkdir()
    (folder / "broken.gpkg").write_text("nothing")
    with refused(SourceError, "city contains no file"):
        find_files(SPECS, [folder])
    damaged = tmp_path / "damaged.parquet"
    damaged.write_text("PAR1")
    with refused(SourceError, "damaged.parquet", "download it again"):
        find_files(SPECS, [damaged])
