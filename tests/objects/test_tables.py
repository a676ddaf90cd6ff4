"""Tables of positions in any layout, notation and language: drafted, and loaded to the cm."""

from __future__ import annotations

import csv
import functools
import io
import json
from typing import TYPE_CHECKING, Literal

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pyproj import CRS
from sentences import refused

from semsig_gis.core import EmptyResultError, SemsigError
from semsig_gis.objects import draft_catalog, load
from semsig_gis.sources import transform_points

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from semsig_gis.objects import StreetObjects

    Pair = tuple[float, float]

TOWNS = [(4.8357, 45.764), (-58.3816, -34.6037), (151.2093, -33.8688), (-0.1276, 51.5072),
         (126.978, 37.5665), (-77.0369, 38.9072), (37.6173, 55.7558), (12.49, 41.9)]  # fmt: skip
# Names of longitude and latitude.
HEADERS = [
    ("lon", "lat"), ("Longitude", "Latitude"), ("LNG", "LAT"), ("gps_long", "gps_lat"),
    ("X", "Y"), ("coord_x", "coord_y"), ("X_WGS84", "Y_WGS84"), ("point.lon", "point.lat"),
    ("Länge", "Breite"), ("geogr. Länge", "geogr. Breite"), ("Längengrad", "Breitengrad"),
    ("longitud", "latitud"), ("longitudine", "latitudine"), ("lengtegraad", "breedtegraad"),
    ("Długość geograficzna", "Szerokość geograficzna"), ("zeměpisná délka", "zeměpisná šířka"),
    ("Boylam", "Enlem"), ("længdegrad", "breddegrad"), ("lengdegrad", "breddegrad"),
    ("pituusaste", "leveysaste"), ("hosszúság", "szélesség"), ("долгота", "широта"),
    ("довгота", "широта"),
    ("γεωγραφικό μήκος", "γεωγραφικό πλάτος"), ("经度", "纬度"), ("經度", "緯度"), ("경도", "위도"),
    ("GPS경도", "GPS위도"), ("経度", "緯度"), ("خط الطول", "خط العرض"),
    ("קו אורך", "קו רוחב"), ("kinh độ", "vĩ độ"),
    ("bujur", "lintang"), ("x_long", "y_lat"), ("geoLon", "geoLat"),
]  # fmt: skip
WHOLE_NAMES = ["location", "geometry", "WKT", "Position", "the_geom", "SHAPE", "coords", "a",
               "Standort"]  # fmt: skip
# Columns that are no positions.
OTHERS: dict[str, Callable[[int], str]] = {
    "id": str, "height": lambda row: f"{171 + row / 7:.2f}", "year": lambda row: str(1990 + row),
    "diameter": lambda row: f"{12 + row}", "postcode": lambda row: f"6900{row % 9}",
    "number": lambda row: f"{row + 1}", "price": lambda row: f"{row + 10}.50",
    "date": lambda row: f"2024-05-{row + 1:02}", "time": lambda row: f"{row + 8:02}:30:15",
    "street": lambda _: "rue_Test", "species": lambda _: "Acer_campestre",
    "slope": lambda row: f"0.{row + 1:02}345678", "index": lambda row: f"{row}.{row:02}54321",
    "size": lambda row: f"{row + 2}.5x{row + 3}.5", "phone": lambda row: f"+33-472-1030{row:02}",
    "width": lambda row: f"{row / 4:.2f}", "plan_no": lambda row: f"{row + 3}/{row + 5}",
}  # fmt: skip


def sexagesimal(value: float, letters: str, style: str) -> str:
    """Return an angle in degrees and minutes, and mostly seconds."""
    letter = letters[value < 0]
    degrees, minutes = divmod(abs(value) * 60, 60)
    if style == "dm":
        return f"{degrees:.0f}° {minutes:.7f}' {letter}"
    whole, seconds = divmod(minutes * 60, 60)
    if style == "colons":
        return f"{'-' * (value < 0)}{degrees:.0f}:{whole:02.0f}:{seconds:08.5f}"
    if style == "blanks":
        return f"{degrees:.0f} {whole:02.0f} {seconds:08.5f} {letter}"
    return f"{degrees:.0f}°{whole:02.0f}'{seconds:08.5f}\"{letter}"


ANGLES: dict[str, Callable[[float, str], str]] = {
    "formula": lambda value, _: f'="{value:.7f}"',
    "kept as text": lambda value, _: f"'{value:.7f}",
    "point": lambda value, _: f"{value:.7f}",
    "comma": lambda value, _: f"{value:.7f}".replace(".", ","),
    "sign": lambda value, _: f"{value:+.7f}",
    "degree": lambda value, _: f"{value:.7f}°",
    "after": lambda value, letters: f"{abs(value):.7f}{letters[value < 0]}",
    "before": lambda value, letters: f"{letters[value < 0]} {abs(value):.7f}",
    **{
        style: functools.partial(sexagesimal, style=style)
        for style in ("dms", "dm", "colons", "blanks")
    },
}
WHOLES: dict[str, Callable[[float, float], str]] = {
    "wkt": lambda x, y: f"POINT ({x:.7f} {y:.7f})",
    "ewkt": lambda x, y: f"SRID=4326;POINT({x:.7f} {y:.7f})",
    "wkb": lambda x, y: shapely.to_wkb(shapely.Point(x, y), hex=True),
    "ewkb": lambda x, y: shapely.to_wkb(
        shapely.set_srid(shapely.Point(x, y), 4326), hex=True, include_srid=True
    ),
    "geojson": lambda x, y: json.dumps({"type": "Point", "coordinates": [x, y]}),
    "texts": lambda x, y: json.dumps({"type": "Point", "coordinates": [str(x), str(y)]}),
    "json": lambda x, y: json.dumps({"latitude": y, "longitude": x}),
    "python": lambda x, y: repr({"lat": str(y), "lng": str(x), "address": '{"zip": 1}'}),
    "uri": lambda x, y: f"geo:{y:.7f},{x:.7f}",
    "java": lambda x, y: f"{{coordinates=[{x:.7f}, {y:.7f}], type=Point}}",
    "heights": lambda x, y: f"{y:.7f} {x:.7f} 171.2 4.5",
    "list": lambda x, y: f"[{x:.7f}, {y:.7f}]",
    "parentheses": lambda x, y: f"({y:.7f}, {x:.7f})",
    "lat, lon": lambda x, y: f"{y:.7f}, {x:.7f}",
    "lat lon": lambda x, y: f"{y:.7f} {x:.7f}",
    "lat;lon": lambda x, y: f"{y:.7f};{x:.7f}",
    "commas": lambda x, y: f"{y:.7f} {x:.7f}".replace(".", ","),
    "address": lambda x, y: f"12 rue Test\n69001 Lyon\n({y:.7f}, {x:.7f})",
    "letters": lambda x, y: f"{ANGLES['after'](y, 'NS')} {ANGLES['after'](x, 'EW')}",
    "angles": lambda x, y: f"{ANGLES['dms'](y, 'NS')}, {ANGLES['dms'](x, 'EW')}",
    "words": lambda x, y: f"lat: {y:.7f}, lon: {x:.7f}",
    "link": lambda x, y: f"https://www.example.org/maps/@{y:.7f},{x:.7f},17z",
}
TITLES = ["Street lights of the town", "# exported by hand", "", "Source: the town, 2024"]


@st.composite
def tables(draw: st.DrawFn) -> tuple[bytes, list[Pair]]:
    """Draw a table and its positions."""
    lon, lat = draw(st.sampled_from(TOWNS))
    steps = draw(st.lists(st.tuples(st.integers(0, 300), st.integers(0, 300)), min_size=3,
                          max_size=9, unique=True))  # fmt: skip
    places = [(round(lon + a * 1.17e-5, 7), round(lat + b * 1.13e-5, 7)) for a, b in steps]
    if draw(st.booleans()):
        names = draw(st.sampled_from(HEADERS))
        styles = ANGLES[draw(st.sampled_from(sorted(ANGLES)))]
        columns = {
            names[0]: [styles(x, "EW") for x, _ in places],
            names[1]: [styles(y, "NS") for _, y in places],
        }
    else:
        style = WHOLES[draw(st.sampled_from(sorted(WHOLES)))]
        columns = {draw(st.sampled_from(WHOLE_NAMES)): [style(x, y) for x, y in places]}
    for name in draw(
        st.lists(st.sampled_from(sorted(OTHERS)), min_size=1, max_size=6, unique=True)
    ):
        columns[name] = [OTHERS[name](row) for row in range(len(places))]
    order = draw(st.permutations(sorted(columns)))
    separator = draw(st.sampled_from([";", ",", "\t", "|", " "]))
    text = io.StringIO()
    ending = draw(st.sampled_from(["\n", "\r\n"]))
    for title in draw(st.lists(st.sampled_from(TITLES), max_size=3)):
        text.write(title + ending)
    if separator != " " and draw(st.booleans()) and not text.getvalue():
        text.write(f"sep={separator}{ending}")
    quoted = draw(st.booleans())
    quoting: Literal[0, 1] = csv.QUOTE_ALL if quoted else csv.QUOTE_MINIMAL
    writer = csv.writer(text, delimiter=separator, lineterminator=ending, quoting=quoting)
    writer.writerow(order)
    writer.writerows(zip(*(columns[name] for name in order), strict=True))
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]))
    return text.getvalue().encode(encoding), places


def read(file: Path, text: str) -> StreetObjects:
    """Load a file with the text of a draft."""
    catalog = file.with_suffix(".toml")
    catalog.write_text(text, encoding="utf-8")
    return load(file, catalog=catalog, collapse=False, merge=False).objects


def farthest(objects: StreetObjects, places: Sequence[Pair]) -> float:
    """Return the largest distance of an object to its place in metres, of rows in order."""
    right = transform_points(np.array(places), CRS(4326), objects.crs)
    return float(np.hypot(*(right - objects.xy).T).max())


def test_every_table_is_drafted_and_loaded_to_the_centimetre(tmp_path: Path) -> None:
    @settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
    @given(tables())
    def holds(table: tuple[bytes, list[Pair]]) -> None:
        content, places = table
        file = tmp_path / "street_lights.csv"
        file.write_bytes(content)
        objects = read(file, draft_catalog(file))
        assert len(objects) == len(places)
        assert farthest(objects, places) < 0.01

    holds()


PLACES = [(round(4.8357 + row * 1.3e-4, 7), round(45.764 + row * 0.9e-4, 7)) for row in range(9)]
IN_SWITZERLAND = [(x + 3.7, y + 1.6) for x, y in PLACES]
SWISS = transform_points(np.array(IN_SWITZERLAND), CRS(4326), CRS(2056))
# Tables with a question, by the names of the fields: the rows, and the words of the question.
QUESTIONS: dict[str, tuple[Callable[[float, float], str], list[str]]] = {
    "lat;lon": (lambda x, y: f"{x};{y}", ["exchanged", "Somalia", "Lyon"]),
    "Y;X": (lambda x, y: f"{x};{y}", ["exchanged", "Somalia", "Lyon"]),
    "latlon": (lambda x, y: f'"{x}, {y}"', ["exchanged", "Somalia", "Lyon"]),
    "coordinates": (lambda x, y: f'"{x}, {y}"', ["exchanged", "Somalia", "Lyon"]),
    "geom": (lambda x, y: f"POINT({y} {x})", ["exchanged", "Somalia", "Lyon"]),
    "place": (lambda x, y: f"{y} {x}", ["exchanged", "Somalia", "Lyon"]),
    "a;b": (lambda x, y: f"{x};{y}", ["by their values"]),
    "cam_lat;cam_lon;light_lat;light_lon": (
        lambda x, y: f"45.7641;4.8352;{y};{x}",
        ["cam_lon and cam_lat", "other places"],
    ),
    "photo_x;photo_y;wkt": (
        lambda x, y: f"4.8352;45.7641;POINT({x} {y})",
        ["photo_x and photo_y", "other places"],
    ),
}


@pytest.mark.parametrize("names", QUESTIONS)
def test_draft_asks_where_another_reading_is_possible(names: str, tmp_path: Path) -> None:
    row, words = QUESTIONS[names]
    file = tmp_path / "street_lights.csv"
    file.write_text("\n".join([f"id;{names}", *(f"{n};{row(*p)}" for n, p in enumerate(PLACES))]))
    text = draft_catalog(file)
    (question,) = (line for line in text.splitlines() if "_field" in line and "EDIT" in line)
    assert all(word in question for word in words)
    assert "# Its positions are near Lyon, France." in text
    assert farthest(read(file, text), PLACES) < 0.01


WEST = [(-x, y) for x, y in PLACES]


@pytest.mark.parametrize(
    ("content", "row", "places"),
    [
        (
            "id;lat;lat_dir;lon;lon_dir",
            lambda x, y: f"1;{y};N;{abs(x)};{'EW'[x < 0]}",
            WEST,
        ),
        (
            "GPSLatitude;GPSLatitudeRef;GPSLongitude;GPSLongitudeRef",
            lambda x, y: f"{y};North;{abs(x)};West",
            WEST,
        ),
        (
            "Lights 2024;;;\n;;;\nid;lat;lon;note",
            lambda x, y: f"1;{y};{x};".replace(".", ","),
            PLACES,
        ),
    ],
)
def test_tables_of_spreadsheets_and_cameras_are_read(
    content: str, row: Callable[[float, float], str], places: list[Pair], tmp_path: Path
) -> None:
    file = tmp_path / "street_lights.csv"
    file.write_text("\n".join([content, *(row(*place) for place in places)]))
    assert farthest(read(file, draft_catalog(file)), places) < 0.01


@pytest.mark.parametrize("names", ["E;N", "Y_Koord;X_Koord", "Ostwert;Nordwert", "x;y", "a;b"])
def test_swiss_grid_is_known_by_its_numbers(names: str, tmp_path: Path) -> None:
    file = tmp_path / "street_lights.csv"
    rows = (f"{n};{x:.3f};{y:.3f}" for n, (x, y) in enumerate(SWISS))
    file.write_text("\n".join([f"id;{names}", *rows]))
    text = draft_catalog(file)
    assert 'crs = "EPSG:2056"  # EDIT' in text
    assert farthest(read(file, text), IN_SWITZERLAND) < 0.01


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("1;4.8357;45.764\n2;4.8358;45.765\n", ["no header", "'4.8357'", "'lon;lat;column3'"]),
        ("1;POINT(4.8 45.7)\n2;POINT(4.9 45.7)\n", ["no header"]),
        ("id;lat;lon\n1;here;4.8\n2;there;4.8\n", ["row 1: lat 'here' is not a number"]),
        (
            "id;lat;lon\n1;45764000;4835700\n2;45764100;4835800\n",
            ["divided by 1,000,000", "near Lyon", "--crs"],
        ),
        ("name;size\na;1\n", ["name, size", "x_field = ", "y_field = ", 'geometry_field = "size"']),
    ],
)
def test_refusal_names_the_value_or_the_keys(
    content: str, words: list[str], tmp_path: Path
) -> None:
    file = tmp_path / "street_lights.csv"
    file.write_text(content)
    with refused(SemsigError, *words):
        draft_catalog(file)


def test_draft_asks_about_geometries_with_latitude_first(tmp_path: Path) -> None:
    file = tmp_path / "street_lights.geojson"
    points = [{"type": "Point", "coordinates": [y, x]} for x, y in PLACES]
    features = [{"type": "Feature", "properties": {}, "geometry": point} for point in points]
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    assert "EDIT: with longitude and latitude exchanged they would be near Lyon" in draft_catalog(
        file
    )


def test_built_in_catalogue_finds_well_known_text_under_any_name(tmp_path: Path) -> None:
    file = tmp_path / "BAUMKATOGD.csv"
    rows = (f"{n},POINT ({x} {y})" for n, (x, y) in enumerate(PLACES))
    file.write_text("\n".join(["OBJECTID,SHAPE", *rows]))
    objects = load(file, catalog="vienna", metric_crs="EPSG:2154", merge=False).objects
    assert farthest(objects, PLACES) < 0.01


def test_first_value_that_cannot_be_read_is_reported(tmp_path: Path) -> None:
    file = tmp_path / "street_lights.csv"
    file.write_text("id;lat;lon\n1;45.764;4.8357\n2;45.765;4.8358\n")
    text = draft_catalog(file)
    file.write_text("id;lat;lon\n1;n/a;4.8357\n2;45.7.65;4.8358\n")
    with refused(EmptyResultError, "row 1: lat 'n/a' is not a number", "geometry_field"):
        read(file, text)
