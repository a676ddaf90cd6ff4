"""Published files of Paris, compared with figures of an independent reader."""

from __future__ import annotations

import csv
import json
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import shapely

from semsig_gis.objects import build_objects
from semsig_gis.sources import RowCounts, load_catalog, paper_taxonomy
from semsig_gis.sources.services.layers import read_layers

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.objects import StreetObjects
    from semsig_gis.sources import RawLayer

STOPS = "positions-geographiques-des-stations-du-reseau-ratp.csv"
# File, layer, rows as published, filtered rows, rows with a repeated id, and objects at different
# places.
FILES = [
    ("fontaines-a-boire.json", "fountains", 1_323, 0, 0, 1_323),
    ("fontaines-a-boire__DashParis.csv", "fountains", 1_188, 0, 0, 1_188),
    ("sanisettesparis.json", "toilets", 615, 0, 0, 606),
    ("sanisettesparis__DashParis.csv", "toilets", 644, 0, 0, 633),
    ("velib-emplacement-des-stations.geojson", "bike_stations", 1_003, 0, 0, 1_003),
    ("gpdtut_paris_bike_stations.geojson", "bike_stations_2010s", 1_226, 0, 0, 1_226),
    ("bornes-dappel-taxi.csv", "taxi_ranks", 419, 0, 0, 417),
    ("Autolib_dataset.csv", "car_stations", 5_000, 0, 3_895, 1_105),
    ("coord-feurouge_west.json", "traffic_light_positions", 23_564, 0, 0, 4_539),
    ("signalisation-tricolore_15_16.geojson", "traffic_lights", 1_091, 0, 467, 624),
    ("signalisation-tricolore_arrond_sample.geojson", "traffic_lights", 1_264, 0, 22, 1_242),
    ("signalisation-tricolore_repeaters.geojson", "traffic_lights", 232, 0, 73, 159),
    ("les-arbres_10K_sample.csv", "trees", 9_999, 4_903, 0, 5_096),
    ("les-arbres_gael.geojson", "trees", 3_542, 3_030, 0, 512),
    ("les-arbres_julien2019.csv", "trees", 197, 195, 0, 2),
    ("les-arbres_nizar.csv", "trees", 2_948, 1_410, 0, 1_538),
    ("gpdtut_paris_trees.gpkg", "trees_extract", 7_856, 2_657, 0, 5_199),
    (STOPS, "bus_stops", 25_338, 955, 0, 11_589),
]
TREES = [name for name, layer, *_ in FILES if layer == "trees"]
# Boundaries and land use, without street objects.
OTHERS = {
    "arrondissements.geojson",
    "gpdtut_paris_districts.geojson",
    "gpdtut_paris_land_use.zip",
    "paris-perimeter.geojson",
}
# Around the region of Paris.
WEST, SOUTH, EAST, NORTH = 1.8, 48.5, 2.9, 49.2


@pytest.fixture(scope="module")
def paris(geodata: Path) -> Path:
    return geodata / "paris"


def read(path: Path, name: str, *, filters: bool = True) -> RawLayer:
    (layer,) = read_layers(path, [load_catalog("opendata_paris").layer(name)], filters=filters)
    return layer


def build(*layers: RawLayer) -> StreetObjects:
    catalog = load_catalog("opendata_paris")
    assert catalog.metric_crs is not None
    return build_objects(layers, taxonomy=catalog.taxonomy, crs=catalog.metric_crs)[0]


def rows_of(path: Path) -> list[dict[str, Any]]:
    """Read a CSV file with the csv module of Python."""
    with path.open(encoding="utf-8-sig", newline="") as stream:
        sample = stream.readline()
        stream.seek(0)
        return list(csv.DictReader(stream, delimiter=";" if ";" in sample else ","))


def features_of(path: Path) -> list[dict[str, Any]]:
    features: list[dict[str, Any]] = json.loads(path.read_text())["features"]
    return features


def xy_of(layer: RawLayer) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    xy: np.ndarray[tuple[int, int], np.dtype[np.float64]]
    xy = shapely.get_coordinates(shapely.centroid(layer.table.geometry.array))
    return xy


def lat_lon(texts: list[str]) -> list[list[float]]:
    """Return (longitude, latitude) of texts with the latitude first."""
    return [[float(part) for part in text.split(",")][::-1] for text in texts]


def test_all_files_of_the_folder_are_listed(paris: Path) -> None:
    assert {path.name for path in paris.iterdir()} == {name for name, *_ in FILES} | OTHERS


@pytest.mark.parametrize("published", FILES, ids=[file for file, *_ in FILES])
def test_published_files_load_as_they_are(
    paris: Path, published: tuple[str, str, int, int, int, int]
) -> None:
    file, name, rows, filtered, duplicates, places = published
    layer = read(paris / file, name)
    assert layer.counts == RowCounts(read=rows, filtered=filtered, duplicates=duplicates)
    assert layer.counts.kept == len(layer.table)
    assert (layer.errors, layer.notes) == ((), ())
    assert set(layer.table["class_name"]) == {layer.spec.class_name}
    if layer.table.crs == "EPSG:4326":
        x, y = xy_of(layer).T
        assert ((x > WEST) & (x < EAST) & (y > SOUTH) & (y < NORTH)).all()
    objects = build(layer)
    assert len(objects) == places
    assert objects.table["count"].sum() == rows - filtered - duplicates
    # Filters can be off.
    layer = read(paris / file, name, filters=False)
    assert (layer.counts.filtered, layer.counts.unreadable) == (0, 0)
    assert len(layer.table) + layer.counts.duplicates == layer.counts.read


# --- Special cases of single files --------------------------------------------------------------


@pytest.mark.parametrize(("filters", "count"), [(False, 16_328), (True, 7_055)])
def test_tree_ids_of_all_files_are_distinct(paris: Path, *, filters: bool, count: int) -> None:
    layers = [read(paris / file, "trees", filters=filters) for file in TREES]
    ids: set[str] = set().union(*(layer.table["source_id"] for layer in layers))
    trees = [
        {name.lower(): value for name, value in tree.items()}
        for file in TREES
        for tree in (
            rows_of(paris / file)
            if file.endswith(".csv")
            else [item["properties"] for item in features_of(paris / file)]
        )
    ]
    # Some ids are written as floats, and some headers in capitals.
    assert len(ids) == count
    assert ids == {
        str(tree["idbase"]).removesuffix(".0")
        for tree in trees
        if tree["domanialite"] == "Alignement" or not filters
    }


@pytest.mark.parametrize(
    ("name", "filters", "ids"),
    [
        ("trees", False, 16_328),
        ("trees", True, 7_055),
        ("fountains", True, 1_355),
        ("traffic_lights", True, 2_010),
    ],
)
def test_objects_in_several_files_are_taken_once(
    paris: Path, name: str, *, filters: bool, ids: int
) -> None:
    files = [file for file, layer, *_ in FILES if layer == name]
    layers = [read(paris / file, name, filters=filters) for file in files]
    objects = build(*layers)
    assert objects.table["count"].sum() == ids
    assert len({identifier for layer in layers for identifier in layer.table["source_id"]}) == ids


@pytest.mark.parametrize(
    ("file", "name", "field", "identifier"),
    [
        ("les-arbres_10K_sample.csv", "trees", "geo_point_2d", "IDBASE"),
        ("les-arbres_julien2019.csv", "trees", "geo_point_2d", "IDBASE"),
        ("fontaines-a-boire__DashParis.csv", "fountains", "geo_point_2d", "Identifiant"),
        ("bornes-dappel-taxi.csv", "taxi_ranks", "geopoint", "id"),
        (STOPS, "bus_stops", "Coordinates", "ID"),
    ],
)
def test_positions_equal_the_point_column(
    paris: Path, file: str, name: str, field: str, identifier: str
) -> None:
    layer = read(paris / file, name, filters=False)
    rows = rows_of(paris / file)
    ids = [row[identifier].removesuffix(".0") for row in rows]
    assert layer.table["source_id"].tolist() == ids
    # The shape has more decimals than the point.
    assert xy_of(layer) == pytest.approx(np.array(lat_lon([row[field] for row in rows])), abs=1e-9)


def test_shapes_of_toilets_are_points_in_a_list(paris: Path) -> None:
    for file in ("sanisettesparis.json", "sanisettesparis__DashParis.csv"):
        layer = read(paris / file, "toilets")
        assert set(layer.table.geometry.geom_type) == {"MultiPoint"}
        assert (layer.table.geometry.count_geometries() == 1).all()
    points = [row["geo_point_2d"] for row in rows_of(paris / file)]
    assert xy_of(layer) == pytest.approx(np.array(lat_lon(points)), abs=1e-9)


def test_autolib_stations_have_one_position(paris: Path) -> None:
    rows = rows_of(paris / "Autolib_dataset.csv")
    places = {row["ID"]: row["Geo point"] for row in rows}
    assert all(places[row["ID"]] == row["Geo point"] for row in rows)
    layer = read(paris / "Autolib_dataset.csv", "car_stations")
    assert layer.table["source_id"].tolist() == list(places)
    assert xy_of(layer).tolist() == lat_lon([*places.values()])


def test_lamps_of_a_support_are_one_traffic_light(paris: Path) -> None:
    for file in [file for file, name, *_ in FILES if name == "traffic_lights"]:
        features = features_of(paris / file)
        supports = Counter(item["properties"]["cod_ouvrag"] for item in features)
        places = {tuple(item["geometry"]["coordinates"]) for item in features}
        layer = read(paris / file, "traffic_lights")
        assert layer.table["source_id"].tolist() == list(supports)
        assert len(build(layer)) == len(places) == len(supports)


def test_traffic_light_positions_are_distinct(paris: Path) -> None:
    content = json.loads((paris / "coord-feurouge_west.json").read_text())
    places = {(item["lng"], item["lat"]) for item in content}
    layer = read(paris / "coord-feurouge_west.json", "traffic_light_positions")
    assert set(map(tuple, xy_of(layer).tolist())) == places
    assert len(build(layer)) == len(places) == 4_539


def test_stops_in_capitals_are_bus_and_tram_stops(paris: Path) -> None:
    file = paris / STOPS
    layer = read(file, "bus_stops")
    rows = rows_of(file)
    stops = [row for row in rows if row["Name"] == row["Name"].upper()]
    assert layer.table["source_id"].tolist() == [row["ID"] for row in stops]
    # Short ids belong to stations, which have names in mixed case.
    assert len(rows) - len(stops) == 955
    assert all(len(row["ID"]) == 7 for row in stops)


# --- The catalogue ------------------------------------------------------------------------------


def test_the_catalogue(snapshot: Callable[[str, str], None]) -> None:
    catalog = load_catalog("opendata_paris")
    classes = {spec.class_name for spec in catalog.layers if spec.role == "objects"}
    assert classes == {item.name for item in paper_taxonomy().classes}
    assert catalog.taxonomy.classes == paper_taxonomy().classes
    assert (catalog.reader, catalog.metric_crs) == ("opendatasoft", "EPSG:2154")
    assert catalog.endpoints == ("https://opendata.paris.fr",)
    assert all(spec.note for spec in catalog.layers)
    lines = []
    for spec in catalog.layers:
        kind = f"{spec.role}{', optional' * spec.optional}"
        lines.append(f"{spec.name} ({kind}): {spec.dataset or 'no dataset'}, {spec.license}\n")
    snapshot("opendata_paris.txt", "".join(lines))
