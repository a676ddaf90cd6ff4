"""Positions in the values of tables: their notations, and the choice of their fields."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
import shapely
from sentences import refused

from semsig_gis.core import CatalogError, SourceError
from semsig_gis.sources import LayerSpec, built_in_taxonomy, find_positions

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from semsig_gis.sources import RawLayer

    Read = Callable[..., RawLayer]

SPEC = LayerSpec(name="a", class_name="bench", crs="EPSG:4326", geometry_field="place")
POINT = shapely.Point(4.5, 45.75)
# Values of one place, 4.5 degrees to the east and 45.75 to the north.
VALUES: list[object] = [
    *("45.75, 4.5", "45.75,4.5", "45.75 4.5", "45,75 4,5", "45.75;4.5", "45.75 / 4.5"),
    *("(45.75, 4.5)", "[4.5, 45.75]", "1 rue A\nLyon\n(45.75, 4.5)", "1 rue A\n45.75, 4.5"),
    *("geo:45.75,4.5", "geo:45.75,4.5,180;u=3", "https://example.org/?q=45.75,4.5"),
    *("lat: 45.75, lon: 4.5", "lon=4.5&lat=45.75", "4.5 E, 45.75 N", "N 45.75 E 4.5"),
    *("45°45'N 4°30'E", "45° 45.0' N, 4° 30.0' E", "45 45 00 4 30 00", "E4°30'00\" N45°45'00\""),
    *("45d45m0s N, 4d30m0s E", "45 deg 45 min N; 4 deg 30 min E", "北纬45.75,东经4.5"),
    *(
        "45.75 северной широты, 4.5 восточной долготы",
        "POINT (4.5 45.75)",
        "Point Z(4.5 45.75 9)",
        POINT.wkb_hex,
    ),
    *("SRID=4326;POINT(4.5 45.75)", POINT.wkb, {"x": 4.5, "y": 45.75}, [4.5, 45.75]),
    *({"lat": "45.75", "lng": "4.5"}, {"latitude": 45.75, "longitude": 4.5, "zip": "69001"}),
    *({"at": {"lat": 45.75, "lon": 4.5}}, {"coordinates": [4.5, 45.75]}),
    {"type": "Point", "coordinates": ["4.5", "45.75"]},
    {"type": "Feature", "geometry": {"type": "Point", "coordinates": [4.5, 45.75]}},
    "{'latitude': '45.75', 'longitude': '4.5', 'address': '{\"zip\": 1}'}",
    *("45.7500 4.5000 170.5 3.0", {"location": "45.7500,4.5000"}),
    *("{coordinates=[4.5, 45.75], type=Point}", '="45.75" ="4.5"'),
]
NO_PLACES = ["nowhere", "12-14", "2024-05-01", "04 72 10 30 30", "45.763.1", "95°70'", "5 Main St"]


def test_positions_are_read_in_every_notation(read_as: Read) -> None:
    rows = [{"place": value.hex() if isinstance(value, bytes) else value} for value in VALUES]
    layer = read_as("a.json", rows, SPEC, by="opendatasoft")
    assert layer.errors == ()
    assert shapely.get_coordinates(layer.geometry).tolist() == [[4.5, 45.75]] * len(VALUES)


def test_order_of_the_axes_may_be_stated(read_as: Read) -> None:
    rows = [{"place": "4.5, 45.75"}, {"place": [4.5, 45.75]}, {"place": "45.75 N 4.5 E"}]
    spec = replace(SPEC, axis_order="lon_lat")
    layer = read_as("a.json", rows, spec, by="opendatasoft")
    assert shapely.get_coordinates(layer.geometry).tolist() == [[4.5, 45.75]] * 3


def test_values_without_a_position_are_errors(read_as: Read) -> None:
    rows = [{"place": value} for value in ["45.75, 4.5", *NO_PLACES]]
    layer = read_as("a.json", rows, SPEC, by="opendatasoft")
    assert layer.errors == tuple(
        f"row {row}: place {value!r} is not a position" for row, value in enumerate(NO_PLACES, 2)
    )


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"geometry_field": "plce"}, ["'plce'", "geometry_field", "is 'place'"]),
        ({"geometry_field": "place", "x_field": "a", "y_field": "b"}, ["x_field", "remove"]),
        ({"axis_order": "lat_lon", "geometry_field": None}, ["axis_order", "geometry_field"]),
    ],
)
def test_keys_that_do_not_fit_are_refused(
    read_as: Read, keys: dict[str, Any], words: list[str]
) -> None:
    spec = replace(SPEC, files=("*.csv",), **keys)
    with refused(CatalogError, *words):
        spec.check(built_in_taxonomy())
        read_as("a.csv", "id;place\n1;45.75 4.5\n", spec)


def test_fields_without_names_of_positions_are_not_taken_without_asking(read_as: Read) -> None:
    text = "id;a;b\n1;4.8351234;45.7641234\n2;4.8361234;45.7651234\n"
    with refused(SourceError, 'x_field = "a"', 'y_field = "b"'):
        read_as("a.csv", text, replace(SPEC, geometry_field=None))


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([{"place": "48.85, 2.35"}, {"place": None}], ("place",)),
        ([{"place": "rue 1, 2"}], ()),
        ([{"x": 1, "y": 2}], ("x", "y")),
        ([{"lng": "here", "lat": "there"}], ("lng", "lat")),  # the first bad value is an error
        ([{"x": 1}], ()),
        ([{"Coord_X": "770000,5", "Coord_Y": "6 280 000,5"}], ("Coord_X", "Coord_Y")),
        ([{"X_L93": 770000, "Y_L93": 6280000}], ("X_L93", "Y_L93")),
        ([{"lon_wgs84": 2.5, "lat_wgs84": 48.5}], ("lon_wgs84", "lat_wgs84")),
        ([{"X_L93": 7e5, "lat": 48, "Y_L93": 6e6, "lon": 2}], ("lon", "lat")),
        ([{"x_old": 1, "lat_new": 48, "y_old": 2, "lon_new": 2}], ("x_old", "y_old")),
        ([{"lon": "?", "lat": 1}, {"lon": 2.5, "lat": 48}], ("lon", "lat")),
    ],
)
def test_fields_of_positions_are_found(
    rows: Sequence[dict[str, Any]], expected: tuple[str, ...]
) -> None:
    fields = list(dict.fromkeys(name for row in rows for name in row))
    place_fields = find_positions(fields, rows)
    assert (place_fields.names if place_fields else ()) == expected
