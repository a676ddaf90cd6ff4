"""Rows of several points, and what stands in a field of identifiers where there is none."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.objects import load
from semsig_gis.sources import LayerSpec, RowCounts, frame_layers, load_catalog, reader

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.sources import RawLayer

LAMPS = LayerSpec(name="lamps", class_name="street_light", id_field="id", crs="EPSG:4326")
SHAPES = [
    shapely.MultiPoint([(2, 48), (2.1, 48), (2, 48)]),
    shapely.MultiPoint([(3, 48)]),
    shapely.Point(4, 48),
    shapely.GeometryCollection([shapely.Point(5, 48), shapely.Point(5, 49)]),
    shapely.MultiPoint([(6, 48), (6, 49)]),
]
IDS = ["a", "b", "c", "d", "e"]
PARTS = {"a/1": (2, 48), "a/2": (2.1, 48), "a/3": (2, 48), "b": (3, 48), "c": (4, 48),
         "d/1": (5, 48), "d/2": (5, 49), "e/1": (6, 48), "e/2": (6, 49)}  # fmt: skip


def collection(path: Path) -> None:
    features = [
        {"type": "Feature", "properties": {"id": name}, "geometry": shape.__geo_interface__}
        for name, shape in zip(IDS, SHAPES, strict=True)
    ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))


def records(path: Path) -> None:
    items = zip(IDS, (shape.__geo_interface__ for shape in SHAPES), strict=True)
    path.write_text(json.dumps([{"id": name, "geo_shape": shape} for name, shape in items]))


def esri(path: Path) -> None:
    features = [
        {
            "attributes": {"id": name},
            "geometry": {"points": shapely.get_coordinates(shape).tolist()},
        }
        for name, shape in zip(IDS, SHAPES, strict=True)
    ]
    path.write_text(json.dumps({"features": features, "spatialReference": {"wkid": 4326}}))


def well_known_text(path: Path) -> None:
    rows = (f"{name};{shape.wkt}\n" for name, shape in zip(IDS, SHAPES, strict=True))
    path.write_text(f"id;wkt\n{''.join(rows)}")


def frame(path: Path) -> None:
    gpd.GeoDataFrame({"id": IDS}, geometry=SHAPES, crs=4326).to_file(path)


@pytest.mark.parametrize(
    ("name", "file", "write"),
    [
        ("vector_file", "a.geojson", collection),
        ("vector_file", "a.gpkg", frame),
        ("vector_file", "a.csv", well_known_text),
        ("opendatasoft", "a.json", records),
        ("arcgis", "a.json", esri),
    ],
)
def test_every_point_of_a_row_is_an_object(
    tmp_path: Path, name: str, file: str, write: Callable[[Path], None]
) -> None:
    write(tmp_path / file)
    (layer,) = reader(name)(tmp_path / file, [LAMPS])
    places = map(tuple, shapely.get_coordinates(layer.geometry).tolist())
    assert dict(zip(layer.columns["source_id"].to_pylist(), places, strict=True)) == PARTS
    assert layer.counts == RowCounts(read=len(PARTS))
    note = "3 rows are MultiPoints; each of their 7 points is an object, counted as a row"
    assert note in layer.notes
    # The points keep their ids where these are those of one object.
    (unique,) = reader(name)(tmp_path / file, [replace(LAMPS, unique_id=True)])
    assert unique.columns.equals(layer.columns)


def test_note_on_parts_that_lie_apart(tmp_path: Path) -> None:
    near, far = (
        shapely.MultiLineString([[(2, 48), (2.0001, 48)], [(2 + gap, 48), (2.0001 + gap, 48)]])
        for gap in (0.0002, 0.01)
    )
    path, catalog = tmp_path / "lamps.geojson", tmp_path / "town.toml"
    gpd.GeoDataFrame({"id": [1, 2]}, geometry=[near, far], crs=4326).to_file(path)
    catalog.write_text(
        'name = "town"\ntitle = "Town"\n[[layers]]\nname = "lamps"\nclass = "street_light"\n'
        'files = ["lamps.*"]\ngeometry = "line"\n'
    )
    loaded = load(path, catalog=catalog)
    assert len(loaded.objects) == 2
    assert any("1 rows have parts that lie apart" in note for note in loaded.report.notes)


NOTHING = [None, "", " ", 0, "0", "0.0", -1, "-1", "N/A", "null", "NaN", "none", "Unknown", "-",
           "?", -9999, "00000000-0000-0000-0000-000000000000", "<Null>"]  # fmt: skip


def layer_of_ids(write: Path, ids: list[Any], **options: Any) -> RawLayer:  # noqa: ANN401
    features = [
        {
            "type": "Feature",
            "properties": {"id": value},
            "geometry": {"type": "Point", "coordinates": [2 + number / 1000, 48]},
        }
        for number, value in enumerate(ids)
    ]
    write.write_text(json.dumps({"features": features}))
    (layer,) = reader("opendatasoft")(write, [replace(LAMPS, **options)])
    return layer


@pytest.mark.parametrize("value", NOTHING, ids=repr)
def test_placeholder_is_no_identifier(tmp_path: Path, value: object) -> None:
    ids = [value, "7", value, value, "7"]
    unique = layer_of_ids(tmp_path / "a.json", ids, unique_id=True)
    assert unique.columns["source_id"].to_pylist() == ["", "7", "", ""]
    assert unique.counts == RowCounts(read=5, duplicates=1)
    plain = layer_of_ids(tmp_path / "b.json", ids)
    assert plain.columns["source_id"].to_pylist() == ["1", "7", "3", "4", "7"]


@given(st.lists(st.integers(-1, 30), max_size=12, unique=True))
def test_every_number_identifies_one_row(
    tmp_path_factory: pytest.TempPathFactory, ids: list[int]
) -> None:
    path = tmp_path_factory.mktemp("ids") / "a.json"
    if ids:
        layer = layer_of_ids(path, list(ids), unique_id=True)
        assert layer.columns["source_id"].to_pylist() == [str(number) for number in ids]


@pytest.mark.parametrize(
    ("columns", "ids"),
    [
        ({"osm_id": [0.0, 0.0, 7.0]}, ["row 1", "row 2", "node/7"]),
        ({"osm_id": [-1, -1, 7]}, ["row 1", "row 2", "node/7"]),
        ({"osm_id": ["7.0", "8", None]}, ["node/7", "node/8", "row 3"]),
        ({"osm_id": ["node/0", "node/0", "n12"]}, ["row 1", "row 2", "node/12"]),
        ({"@id": ["node/7", "Way 12", "https://www.openstreetmap.org/relation/9"]},
         ["node/7", "way/12", "relation/9"]),
        ({"@id": ["node/-1", "r12", "W3"]}, ["node/-1", "relation/12", "way/3"]),
        ({"osm_type": ["node", "way", "node"], "osm_id": [3.0, 4.0, 0.0]},
         ["node/3", "way/4", "row 3"]),
    ],
)  # fmt: skip
def test_placeholder_is_no_number_of_an_element(
    columns: dict[str, list[Any]], ids: list[str]
) -> None:
    points = shapely.points(np.column_stack([[2, 2.1, 2.2], [48, 48, 48]]))
    table = gpd.GeoDataFrame({**columns, "amenity": ["bench"] * 3}, geometry=points, crs=4326)
    benches = load_catalog("openstreetmap").layer("benches")
    spec = replace(benches, elements=("node", "way", "relation"))
    (layer,) = frame_layers(table, [spec])
    expected = [
        name for name in ids if not name.startswith("relation")
    ]  # points are no multipolygons
    assert layer.columns["source_id"].to_pylist() == expected
