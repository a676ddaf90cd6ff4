"""Positions in the notations of people, spreadsheets, databases and portals."""

from __future__ import annotations

import ast
import functools
import math
import re
import tomllib
import unicodedata
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely
import shapely.geometry
from shapely.errors import ShapelyError

from semsig_gis.sources.catalog import data_folder
from semsig_gis.sources.numbers import decimal
from semsig_gis.sources.rows import BadFeatureError
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from semsig_gis.sources.layer_spec import AxisOrder
    from semsig_gis.sources.rows import Position

MOST_SHOWN_CHARACTERS = 60
# Well-known binary as hexadecimal, and text with the EPSG code or the address of its CRS before it.
HEXADECIMAL = re.compile(r"(?:\\x|0x)?((?:[0-9A-Fa-f]{2}){5,})")
WELL_KNOWN = re.compile(
    r"(?:SRID\s*=\s*(\d+)\s*;)?\s*(?:<\S*CRS84>\s*)?"
    r"((?:MULTI)?(?:POINT|LINESTRING|POLYGON)\s*(?:Z|M|ZM)?\s*[(E].*"
    r"|GEOMETRYCOLLECTION.*|LINEARRING.*)",
    re.DOTALL | re.IGNORECASE,
)
NUMBER = r"[+-]?\d+(?:\.\d+)?"
GEO_URI = re.compile(rf"geo:({NUMBER}),({NUMBER})(?:,{NUMBER})?(;.*)?", re.IGNORECASE)
# Addresses of maps: latitude, then longitude.
MAP_LINK = re.compile(
    rf"https?://\S*?(?:@|!3d|[?&](?:q|query|ll|mlat|lat)=)({NUMBER})"
    rf"(?:,|%2C|!4d|&(?:mlon|lon|lng)=)({NUMBER})\S*",
    re.IGNORECASE,
)
WORD = r"[^\W\d_.]+(?:\.\s?[^\W\d_.]+|\s[^\W\d_.]{4,})*\.?"
DEGREE = "(?:[°º˚⁰\N{REPLACEMENT CHARACTER}]|度|도)"
APOSTROPHES = "'`\N{RIGHT SINGLE QUOTATION MARK}\N{LEFT SINGLE QUOTATION MARK}"
APOSTROPHES += "\N{PRIME}\N{ACUTE ACCENT}"
MINUTE = f"(?:[{APOSTROPHES}]|分|분)"
SECOND = f'(?:["”“″]|{MINUTE}{MINUTE}|秒|초)'
PLAIN = r"\d+(?:[.,]\d+)?"
SHORT = r"\d{1,2}(?:[.,]\d+)?"
ANGLE = re.compile(
    rf"(?P<before>{WORD})?[\s:=]*(?P<sign>[+-]?)\s*(?P<degrees>{PLAIN})\s*(?P<mark>{DEGREE})?"
    rf"(?:(?:(?<={DEGREE})|[\s:-])\s*(?P<minutes>{SHORT})\s*(?P<minute>{MINUTE})?"
    rf"(?:(?:(?<={MINUTE})|[\s:-])\s*(?P<seconds>{SHORT})\s*(?:{SECOND})?)?)?"
    rf"\s*(?P<after>{WORD})?"
)
# The units of an angle as letters.
NO_LETTER = r"\.?(?![^\W\d_]\w)"
UNITS = re.compile(
    rf"(\d)\s*(?:degrees|degree|degrés|grad|deg|d){NO_LETTER}"
    rf"\s*(?:({PLAIN})\s*(?:minutes|minute|min|m){NO_LETTER})?"
    rf"\s*(?:({PLAIN})\s*(?:seconds|second|secondes|sekunden|sec|sek|s){NO_LETTER})?"
)
# What may stand between the two coordinates of a pair, the surest first.
SEPARATORS = tuple(
    map(
        re.compile,
        (
            r"\s*[;|&\n]\s*",
            r"\s*/\s*",
            r"\s*,\s+",
            r"(?<=[^\W\d_])\.?[\s,]*(?=[\d+-])",
            r"(?<=[\d'\"″\N{PRIME}°”\N{RIGHT SINGLE QUOTATION MARK}])[\s,]*(?=[^\W\d_])",
            r"\s*,\s*",
            r"\s+",
        ),
    )
)
# Fewer decimals are those of measurements.
MANY_DECIMALS = re.compile(r"\d[.,]\d{4}")
HALF_TURN, SIXTY = 180.0, 60.0
FLOAT = r"[+-]?\d+(?:\.\d*)?(?:e[+-]?\d+)?"
TWO_NUMBERS = re.compile(rf"({FLOAT})\s*[,;\s]\s*({FLOAT})")
# A pair with a height, and perhaps its accuracy.
WITH_HEIGHT = re.compile(
    r"^([+-]?\d+\.\d{4,}[\s,;]+[+-]?\d+\.\d{4,})(?:[\s,;]+[+-]?\d+(?:\.\d+)?){1,2}$"
)
# A point as Java prints a map.
JAVA_POINT = re.compile(
    rf"\{{.*\bcoordinates\s*=\s*\[+\s*({NUMBER})\s*,\s*({NUMBER})[^\[]*\]+.*\}}", re.DOTALL
)
LATITUDE, LONGITUDE = "lat", "lon"


class Located(NamedTuple):
    """A position in a value; `srid` is the EPSG code that it states, or 0.

    `pair` is whether it is two numbers; their `order` may be certain from letters or names.
    """

    position: Position
    srid: int = 0
    pair: bool = False
    order: AxisOrder | None = None
    bracketed: bool = False


class _Angle(NamedTuple):
    value: float
    axis: str = ""
    marked: bool = False


@functools.cache
def position_words() -> Mapping[str, Mapping[str, Any]]:
    """Return the words for positions."""
    text = (data_folder() / "position_words.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def plain_letters(text: str) -> str:
    """Return text in lower case without accents."""
    letters = unicodedata.normalize("NFKD", text)
    return "".join(letter for letter in letters if not unicodedata.combining(letter)).casefold()


@functools.cache
def _letters() -> Mapping[str, tuple[str, int]]:
    """Return the axis and the sign for each word of a hemisphere, 0 for an unknown sign."""
    table = position_words()["hemispheres"]
    kinds = {
        "north": (LATITUDE, 1),
        "south": (LATITUDE, -1),
        "east": (LONGITUDE, 1),
        "west": (LONGITUDE, -1),
        "east_or_west": (LONGITUDE, 0),
    }
    words = {word: kind for name, kind in kinds.items() for word in table[name]}
    for axis, name in ((LONGITUDE, "x"), (LATITUDE, "y")):
        for word in position_words()[name]["words"]:
            words.setdefault(word, (axis, 1))
    return {plain_letters(word).replace(" ", ""): kind for word, kind in words.items()}


def coordinate(value: object, *, english: bool = False, o_is_east: bool = False) -> float:
    """Return the number or the angle in degrees that is in a value; ValueError if there is none."""
    try:
        return float(value) if isinstance(value, str) else _angle(value).value
    except ValueError:
        return _angle(value, english=english, o_is_east=o_is_east).value


def is_angle(value: object) -> bool:
    """Whether a value is an angle with degrees, minutes or a hemisphere."""
    try:
        return _angle(value).marked
    except (TypeError, ValueError):
        return False


def is_negative(value: object, *, o_is_east: bool = False) -> bool:
    """Whether a value is the name or the letter of the southern or western hemisphere."""
    kind = _letters().get(plain_letters(value).strip()) if isinstance(value, str) else None
    return kind is not None and (kind[1] < 0 or (kind[1] == 0 and not o_is_east))


def axis_of(value: object) -> str:
    """Return the axis that a value says with a letter, lat or lon, or an empty text."""
    try:
        return _angle(value).axis
    except (TypeError, ValueError):
        return ""


def _angle(value: object, *, english: bool = False, o_is_east: bool = False) -> _Angle:
    if not isinstance(value, str):
        if isinstance(value, bool) or value is None:
            raise TypeError
        return _Angle(float(value))  # type: ignore[arg-type] # raises
    try:
        return _Angle(decimal(value, english=english))
    except ValueError:
        if english and re.fullmatch(r"\s*[+-]?\d+,\d+\s*", value):
            raise
    text = value.strip().casefold().replace("\N{MINUS SIGN}", "-").replace("\u2013", "-")
    match = ANGLE.fullmatch(UNITS.sub(_with_marks, text))
    if match is None:
        raise ValueError(f"{value!r} is not a coordinate")
    axis, sign, lettered = "", -1 if match["sign"] == "-" else 1, False
    for word in filter(None, (match["before"], match["after"])):
        kind = _letters().get(plain_letters(word).replace(" ", "").rstrip("."))
        if kind is None or (axis and axis != kind[0]):
            raise ValueError(f"{value!r} is not a coordinate")
        axis, lettered = kind[0], True
        if kind[1] < 0 or (kind[1] == 0 and not o_is_east):
            sign = -1
    parts = [match[name] for name in ("degrees", "minutes", "seconds") if match[name]]
    numbers = [float(part.replace(",", ".")) for part in parts]
    marked = bool(match["mark"] or match["minute"]) or lettered
    whole = all(part.isdecimal() for part in parts[:-1])
    limit = HALF_TURN if len(parts) > 1 else math.inf
    bare = len(parts) == 2 and not marked and ":" not in text  # noqa: PLR2004 - "48 85"
    if not whole or bare or numbers[0] > limit or any(part >= SIXTY for part in numbers[1:]):
        raise ValueError(f"{value!r} is not a coordinate")
    number = sum(part / SIXTY**place for place, part in enumerate(numbers))
    return _Angle(sign * number, axis, marked or len(parts) > 1)


def _with_marks(match: re.Match[str]) -> str:
    minutes = f"{match[2]}'" if match[2] else ""
    return f'{match[1]}°{minutes}{match[3]}"' if match[3] else f"{match[1]}°{minutes} "


def locate(
    value: Any,  # noqa: ANN401 - whatever is in the file
    order: AxisOrder | None = None,
    *,
    o_is_east: bool = False,
) -> Located | None:
    """Return the position in a value, or None if it is blank; BadFeatureError if there is none.

    Values are geometries, well-known text or binary (also extended, or as hexadecimal), GeoJSON,
    Esri's JSON, mappings and lists of coordinates, all of these also as text, ``geo:`` URIs,
    addresses of maps, and pairs of numbers or angles as text. `order` is that of a pair which does
    not show its own, by default longitude first in brackets, and else latitude.
    """
    if isinstance(value, str):
        value = value.strip()
    if value is None or (isinstance(value, str | list | dict) and not value):
        return None
    if isinstance(value, shapely.Geometry):
        return Located(value)
    try:
        with np.errstate(invalid="ignore"):  # NaN is checked later for all geometries at once
            if isinstance(value, bytes | bytearray | memoryview):
                return _of_shape(shapely.from_wkb(bytes(value)))
            if isinstance(value, dict):
                return _of_mapping(value, order)
            if isinstance(value, list | tuple):
                return _of_list(value, order)
            if isinstance(value, str):
                return _of_text(value, order, o_is_east=o_is_east)
    except (AttributeError, LookupError, TypeError, ValueError, ShapelyError) as error:
        raise BadFeatureError(f"{shown(value)} is not a position") from error
    raise BadFeatureError(f"{shown(value)} is not a position")


def _of_shape(shape: shapely.Geometry, srid: int = 0) -> Located:
    srid = srid or int(shapely.get_srid(shape))
    if isinstance(shape, shapely.Point) and not shape.is_empty:
        return Located((shape.x, shape.y), srid)
    return Located(shape, srid)


def _of_text(text: str, order: AxisOrder | None, *, o_is_east: bool) -> Located | None:
    if code := HEXADECIMAL.fullmatch(text):
        return _of_shape(shapely.from_wkb(code[1]))
    if match := WELL_KNOWN.fullmatch(text):
        return _of_shape(shapely.from_wkt(match[2]), int(match[1] or 0))
    if uri := GEO_URI.fullmatch(text):
        if "crs=" in (uri[3] or "").lower().replace("crs=wgs84", ""):
            raise ValueError("a CRS of its own")
        return Located((float(uri[2]), float(uri[1])), pair=True, order="lat_lon")
    if link := MAP_LINK.fullmatch(text):
        return Located((float(link[2]), float(link[1])), pair=True, order="lat_lon")
    if text.startswith(("{", "[")) and (content := _content(text)) is not None:
        return locate(content, order)
    return _of_pair(text, order, o_is_east=o_is_east)


def _content(text: str) -> dict[str, Any] | list[Any] | None:
    """Return what a text holds as JSON, or as Python or Java print it, or None."""
    if point := JAVA_POINT.fullmatch(text):
        return {"type": "Point", "coordinates": [float(point[1]), float(point[2])]}
    try:
        content = parse_json(text)
    except ValueError:
        try:
            content = ast.literal_eval(text)
        except (SyntaxError, ValueError, MemoryError, RecursionError):
            return None
    return content if isinstance(content, dict | list) else None


def _of_pair(text: str, order: AxisOrder | None, *, o_is_east: bool) -> Located:
    """Return the point of two coordinates in a text, which may end an address."""
    bracketed = text.startswith("[")
    if text.endswith(")") and (start := text.rfind("(")) > 0:
        text = text[start:]
    inner = text.strip("()[]{} \t\r\n")
    if "\n" in inner:
        inner = inner.splitlines()[-1].strip() or inner
    inner = WITH_HEIGHT.sub(r"\1", inner).casefold()
    tokens = inner.split()
    if len(tokens) == 6 and all(token.replace(".", "").isdecimal() for token in tokens):  # noqa: PLR2004 - two angles
        inner = f"{' '.join(tokens[:3])}; {' '.join(tokens[3:])}"
    if plain := TWO_NUMBERS.fullmatch(inner):
        return _of_numbers(float(plain[1]), float(plain[2]), None, order, bracketed=bracketed)
    for separator in SEPARATORS:
        parts = [part for part in separator.split(UNITS.sub(_with_marks, inner)) if part]
        if len(parts) != 2:  # noqa: PLR2004 - a pair
            continue
        try:
            first, second = (_angle(part, o_is_east=o_is_east) for part in parts)
        except ValueError:
            continue
        own: AxisOrder | None = None
        if first.axis or second.axis:
            if not (first.axis and second.axis) or first.axis == second.axis:
                continue
            own = "lat_lon" if first.axis == LATITUDE else "lon_lat"
        return _of_numbers(first.value, second.value, own, order, bracketed=bracketed)
    raise ValueError("no pair")


def _of_numbers(
    first: float,
    second: float,
    own: AxisOrder | None,
    order: AxisOrder | None,
    *,
    bracketed: bool,
) -> Located:
    # Coordinates in a plane are written with x first.
    plane = abs(first) > HALF_TURN and abs(second) > HALF_TURN
    used = own or order or ("lon_lat" if bracketed or plane else "lat_lon")
    xy = (first, second) if used == "lon_lat" else (second, first)
    return Located(xy, pair=True, order=own, bracketed=bracketed)


def _of_list(values: Sequence[Any], order: AxisOrder | None) -> Located | None:
    if len(values) == 1 and isinstance(values[0], dict | list):
        return locate(values[0], order)
    if not 2 <= len(values) <= 3 or any(isinstance(value, dict | list) for value in values):  # noqa: PLR2004 - perhaps a height
        raise ValueError("no pair")
    first, second = (_angle(value) for value in values[:2])
    return _of_numbers(first.value, second.value, None, order, bracketed=True)


def _of_mapping(value: Mapping[str, Any], order: AxisOrder | None) -> Located | None:
    """Return the position of GeoJSON, of Esri's JSON, or of two members for the coordinates."""
    if value.get("type") == "Feature":
        return locate(value.get("geometry"), order)
    if "type" in value and ("coordinates" in value or "geometries" in value):
        if value["type"] == "Point" and value["coordinates"]:
            x, y = value["coordinates"][:2]
            return Located((float(x), float(y)))
        return Located(shapely.geometry.shape(_with_numbers(value)))
    if {"points", "paths", "rings"} & value.keys() or value.keys() <= {"x", "y", "z", "m"} | {
        "spatialReference"
    }:
        srid = (value.get("spatialReference") or {}).get("latestWkid", 0)
        return Located(esri_shape(value), srid if isinstance(srid, int) else 0)
    return _of_members(value, order)


def _of_members(value: Mapping[str, Any], order: AxisOrder | None) -> Located | None:
    """Return the position of a latitude and a longitude, or of a member that has them."""
    axes: dict[str, Any] = {}
    for name, member in value.items():
        kind = _letters().get(plain_letters(str(name)).replace("_", ""))
        if kind is not None and not isinstance(member, dict | list):
            axes.setdefault(kind[0], member)
    if LATITUDE in axes and LONGITUDE in axes:
        if all(member is None or member == "" for member in axes.values()):
            return None
        xy = coordinate(axes[LONGITUDE]), coordinate(axes[LATITUDE])
        return Located(xy, pair=True, order="lat_lon")
    for member in value.values():
        pair = isinstance(member, str) and len(MANY_DECIMALS.findall(member)) > 1
        if pair or (isinstance(member, dict | list | tuple) and member):
            try:
                return locate(member, order)
            except BadFeatureError:
                continue
    raise ValueError("no coordinates")


def _with_numbers(geometry: Any) -> Any:  # noqa: ANN401 - part of a geometry
    """Return a geometry of GeoJSON with numbers in place of texts."""
    if isinstance(geometry, dict):
        return {
            key: _with_numbers(part) if key in {"coordinates", "geometries"} else part
            for key, part in geometry.items()
        }
    if isinstance(geometry, list | tuple):
        return [_with_numbers(part) for part in geometry]
    return float(geometry) if isinstance(geometry, str) else geometry


def esri_shape(geometry: Mapping[str, Any]) -> Position:
    """Return a geometry from JSON of the ArcGIS REST API; a ring inside another is a hole."""
    if "x" in geometry:
        x, y = (math.nan if value is None else float(value) for value in map(geometry.get, "xy"))
        return None if math.isnan(x) and math.isnan(y) else (x, y)
    if "points" in geometry:
        return shapely.MultiPoint([point[:2] for point in geometry["points"]])
    parts = geometry["paths"] if "paths" in geometry else geometry["rings"]
    lines = shapely.MultiLineString([[point[:2] for point in part] for part in parts])
    return lines if "paths" in geometry else shapely.build_area(lines) or None


def shown(value: object) -> str:
    """Return a value for a message."""
    text = value if isinstance(value, str) else repr(value)
    short = text if len(text) <= MOST_SHOWN_CHARACTERS else f"{text[:MOST_SHOWN_CHARACTERS]}..."
    return repr(short)
