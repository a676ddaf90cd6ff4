"""CSV files in any encoding, and the numbers, shapes and names in them."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core import SourceError
from semsig_gis.sources import LayerSpec, decimal, list_layers

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.sources import RawLayer

    Read = Callable[..., RawLayer]

WORDS = {
    "cp1252": (
        "fr",
        "érable",
        "platane d\N{RIGHT SINGLE QUOTATION MARK}été",
        "hêtre",
        "n° 5",
        "m²",
    ),
    "mac_roman": ("fr", "érable", "hêtre", "chêne vert", "forêt", "à fleurs"),
    "cp1250": ("pl", "łąka", "żółty", "świerk", "dąb", "Piłsudskiego"),
    "cp1251": ("ru", "дерево", "улица Ленина", "скамейка", "фонарь"),
    "cp1253": ("el", "δέντρο", "οδός Ερμού", "παγκάκι"),
    "koi8_r": ("ru", "дерево", "улица Ленина", "скамейка", "фонарь"),
    "cp932": ("ja", "木", "東京都千代田区", "街灯"),
    "utf-16": ("fr", "érable", "木"),
    "utf-16-le": ("fr", "érable", "hêtre"),
    "utf-16-be": ("fr", "érable", "hêtre"),
    "utf-32": ("fr", "érable", "木"),
    "utf-8-sig": ("fr", "érable", "木"),
}


@pytest.fixture
def read(read_as: Read) -> Read:
    """Read a layer of a CSV file with this content; keywords are fields of its specification."""

    def call(content: str | bytes, by: str = "vector_file", **what: Any) -> RawLayer:  # noqa: ANN401
        spec = LayerSpec(name="a", class_name="bench", **{"crs": "EPSG:4326", **what})
        return read_as("a.csv", content, spec, by=by)

    return call


@pytest.mark.parametrize("by", ["vector_file", "opendatasoft"])
@pytest.mark.parametrize("encoding", WORDS)
def test_encoding_is_detected(read: Read, encoding: str, by: str) -> None:
    words = WORDS[encoding]
    lines = ["nom;lon;lat", *(f"{word};2,5;48,5" for word in words)]
    layer = read(
        "\r\n".join(lines).encode(encoding), by, id_field="nom", x_field="lon", y_field="lat"
    )
    assert tuple(layer.table.source_id) == words
    assert set(layer.table.geometry.to_wkt()) == {"POINT (2.5 48.5)"}
    notes = [f"the file is not in UTF-8; it is read as {encoding.replace('-', '_')}"]
    marked = encoding in {"utf-8-sig", "utf-16", "utf-32"}
    assert [note.partition(", which is not sure")[0] for note in layer.notes] == (
        [] if marked else notes
    )


def test_invalid_utf8_is_noted(read: Read) -> None:
    text = "nom;lon;lat\nérable;2;48\nhêtre;2;48\n".encode() + b"ch\xeane;2;48\n"
    layer = read(text, id_field="nom")
    assert list(layer.table.source_id) == ["érable", "hêtre", "ch\ufffdne"]
    assert layer.notes == ("1 places are not UTF-8 and are read as \ufffd",)


@pytest.mark.parametrize("by", ["vector_file", "opendatasoft"])
@pytest.mark.parametrize("separator", [";", ",", "\t"])
def test_column_names_are_stripped(read: Read, separator: str, by: str) -> None:
    lines = [["id ", " lon", "\u00a0lat "], ["7", " 2.5", "48.5 "]]
    layer = read(
        "\n".join(map(separator.join, lines)), by, id_field="id", x_field="lon", y_field="lat"
    )
    assert layer.table.geometry.to_wkt().tolist() == ["POINT (2.5 48.5)"]
    assert layer.table.source_id.tolist() == ["7"]


SQUARE = shapely.box(0, 0, 2, 2)
SHAPES = {
    "POINT (2.5 48.5)": "POINT (2.5 48.5)",
    " point(2.5 48.5) ": "POINT (2.5 48.5)",
    "POINT Z (2.5 48.5 35)": "POINT (2.5 48.5)",
    "SRID=4326;POINT(2.5 48.5)": "POINT (2.5 48.5)",
    SQUARE.wkt: SQUARE.wkt,
    SQUARE.wkb_hex: SQUARE.wkt,
    "": None,
}


@pytest.mark.parametrize("name", ["WKT", "geom", "geometry", "the_geom", " wkt "])
def test_geometry_in_well_known_text(tmp_path: Path, read: Read, name: str) -> None:
    rows = "".join(f'{number};"{text}"\n' for number, text in enumerate(SHAPES))
    layer = read(f"id;{name}\n{rows}99;here\n")
    assert [shape and shape.wkt for shape in layer.table.geometry] == list(SHAPES.values())
    assert layer.errors == (f"row 8: {name.strip()} 'here' is not a position",)
    (info,) = list_layers(tmp_path / "a.csv")
    assert (info.geometry, info.rows, info.crs) == ("Unknown", 8, "EPSG:4326")


def test_crs_of_well_known_text(read: Read) -> None:
    text = "the_geom\nSRID=2154;POINT(770000 6280000)\nSRID=4326;POINT(2 48)\nPOINT(1 2)\n"
    layer = read(text, crs=None)
    assert layer.table.crs == "EPSG:2154"
    assert layer.table.geometry.to_wkt().tolist() == ["POINT (770000 6280000)", "POINT (1 2)"]
    assert layer.errors == ("row 2: the_geom has SRID=4326, and rows before it have 2154",)
    with refused(SourceError, "SRID=999999", "unknown"):
        read("geom\nSRID=999999;POINT(2 48)\n")


NUMBERS: dict[str, float | None] = {
    "3.88": 3.88,
    " 3,88 ": 3.88,
    "\N{MINUS SIGN}3,5": -3.5,
    "1e5": 1e5,
    "770\u00a0123,5": 770_123.5,
    "6\u202f280\u2009000,25": 6_280_000.25,
    "1 234 567": 1_234_567.0,
    "2'600'000.5": 2_600_000.5,
    "1.234,5": 1_234.5,
    "1,234.5": 1_234.5,
    "6.280.000": 6_280_000.0,
    "43,610,123": 43_610_123.0,
    "": None,
    "48 85": None,
    "12,34,5": None,
    "1234.567,8": None,
    "1,5.3": None,
    "here": None,
}


@pytest.mark.parametrize("text", NUMBERS)
def test_decimal_reads_usual_notations(text: str) -> None:
    expected = NUMBERS[text]
    if expected is None:
        with pytest.raises(ValueError, match=f"{re.escape(text)}|convert"):
            decimal(text)
    else:
        assert decimal(text) == expected


def test_ambiguous_comma_is_an_error(read: Read) -> None:
    assert decimal("770,123") == 770.123
    assert decimal("2,3488", english=True) == 2.3488
    layer = read('x,y\n"770,123","6,280,000.5"\n"770,123.5","6,280,000"\n', crs="EPSG:2154")
    assert layer.errors == ("row 1: x '770,123' is not a number",)
    assert layer.table.geometry.to_wkt().tolist() == ["POINT (770123.5 6280000)"]


@given(st.floats(allow_nan=False, allow_infinity=False, width=32))
def test_decimal_reads_formatted_numbers(value: float) -> None:
    for text in (repr(value), repr(value).replace(".", ",")):
        assert decimal(text) == value
    rounded = round(value, 2)
    if abs(rounded) < 1e15:
        for blank in ("\u00a0", "\u202f", "\u2009", " ", "'"):
            styled = f"{rounded:,.2f}".replace(",", blank).replace(".", ",")
            assert math.isclose(decimal(styled), rounded)
