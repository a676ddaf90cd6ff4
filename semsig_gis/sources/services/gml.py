"""Features in GML, of version 2 to 3.2, as Web Feature Services send them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import numpy as np
import shapely
from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core import CrsError
from semsig_gis.sources.rows import WGS84, BadFeatureError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

SRS_NAME = re.compile(r"\bsrsName=[\"']([^\"']+)[\"']")
# By these names the axes are in the order of the authority; by others, x goes first.
AUTHORITY_ORDER = re.compile(r"(?:urn:|https?://www\.opengis\.net/def/)", re.IGNORECASE)
ID = "id"  # the field that the identifier of a feature becomes, if it has none of that name
MEMBERS = frozenset({"member", "featureMember", "featureMembers"})
BESIDE = frozenset({"boundedBy", "location"})  # of a feature, and none of its fields
POINTS, LINES = frozenset({"Point"}), frozenset({"LineString", "LinearRing", "LineStringSegment"})
AREAS = frozenset({"Polygon", "PolygonPatch"})
SEVERAL = frozenset(
    {"CompositeCurve", "CompositeSurface", "Curve", "MultiCurve", "MultiGeometry",
     "MultiLineString", "MultiPoint", "MultiPolygon", "MultiSurface", "Ring", "Surface"}
)  # fmt: skip
GEOMETRIES = POINTS | LINES | AREAS | SEVERAL


def local_name(element: ET.Element) -> str:
    """Return the name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


def parse_xml(content: bytes) -> ET.Element:
    """Return the root of a document; ValueError if it is none, or defines texts of its own."""
    if b"<!DOCTYPE" in content.replace(b"\0", b""):  # may define texts that swell; in UTF-16, too
        raise ValueError("it has a document type")
    try:
        return ET.fromstring(content)  # noqa: S314 - without a document type
    except ET.ParseError as error:
        raise ValueError(str(error)) from error


def features(root: ET.Element) -> Iterator[ET.Element]:
    """Yield the features of a collection."""
    for element in root:
        if local_name(element) in MEMBERS:
            yield from element


def stated_crs(content: bytes) -> tuple[CRS | None, bool]:
    """Return the first CRS that a document names, and whether it puts northing first."""
    found = SRS_NAME.search(content.decode("utf-8", errors="replace"))
    if found is None:
        return None, False
    name = found[1]
    if name.endswith("CRS84"):
        return WGS84, False
    code = re.search(r"epsg.*?(\d+)$", name, re.IGNORECASE)
    try:
        crs = CRS.from_user_input(f"EPSG:{code[1]}" if code else name)
    except CRSError as error:
        raise CrsError(
            f"the GML names the CRS {name[:60]!r}, which is unknown; tell its publisher."
        ) from error
    northing_first = crs.axis_info[0].direction.lower() in {"north", "south"}
    return crs, northing_first and AUTHORITY_ORDER.match(name) is not None


def read_feature(
    feature: ET.Element, *, swap: bool
) -> tuple[dict[str, Any], shapely.Geometry | BadFeatureError | None]:
    """Return the fields of a feature, and its geometry or what is wrong with it."""
    values: dict[str, Any] = {}
    geometry: shapely.Geometry | BadFeatureError | None = None
    for item in feature:
        name = local_name(item)
        inner = next(iter(item), None)
        if inner is None:
            values[name] = (item.text or "").strip() or None
        elif local_name(inner) in GEOMETRIES:
            if name not in BESIDE or geometry is None:
                geometry = _shape(inner, swap=swap)
        elif name not in BESIDE:
            values[name] = " ".join(" ".join(item.itertext()).split()) or None
    identifier = next((v for k, v in feature.attrib.items() if k.rpartition("}")[2] == ID), None)
    if identifier is not None:
        values.setdefault(ID, identifier)
    return values, geometry


def _shape(element: ET.Element, *, swap: bool) -> shapely.Geometry | BadFeatureError:
    try:
        with np.errstate(invalid="ignore"):
            return _geometry(element, swap=swap)
    except (IndexError, TypeError, ValueError, shapely.errors.ShapelyError) as error:
        return BadFeatureError(f"its {local_name(element)} is not valid GML ({error})")


def _geometry(element: ET.Element, *, swap: bool) -> shapely.Geometry:
    name = local_name(element)
    if name in POINTS:
        positions = _positions(element, swap=swap)
        return shapely.Point(positions[0]) if len(positions) else shapely.Point()
    if name in LINES:
        return shapely.LineString(_positions(element, swap=swap))
    if name in AREAS:
        outer, *inner = (_ring(part, swap=swap) for part in element if _is_boundary(part))
        return shapely.Polygon(outer, inner)
    if name not in SEVERAL:
        raise ValueError(f"{name} is not read")
    parts = [_geometry(part, swap=swap) for part in _parts(element)]
    if name in {"Curve", "CompositeCurve", "Ring"}:
        return shapely.LineString(np.vstack([shapely.get_coordinates(part) for part in parts]))
    if len(parts) == 1:
        return parts[0]
    return shapely.union_all(parts) if name == "CompositeSurface" else _together(parts)


def _together(parts: list[shapely.Geometry]) -> shapely.Geometry:
    flat = shapely.get_parts(parts)
    kind = {part.geom_type for part in flat}
    if kind == {"Point"}:
        return shapely.MultiPoint(flat)
    if kind == {"LineString"}:
        return shapely.MultiLineString(flat)
    return shapely.MultiPolygon(flat) if kind == {"Polygon"} else shapely.GeometryCollection(flat)


def _parts(element: ET.Element) -> Iterable[ET.Element]:
    """Yield the geometries that are the members, segments or patches of one."""
    for part in element:
        yield from part


def _is_boundary(element: ET.Element) -> bool:
    return local_name(element) in {"exterior", "interior", "outerBoundaryIs", "innerBoundaryIs"}


def _ring(element: ET.Element, *, swap: bool) -> NDArray[np.float64]:
    return shapely.get_coordinates(_geometry(element[0], swap=swap))


def _positions(element: ET.Element, *, swap: bool) -> NDArray[np.float64]:
    """Return x and y of the positions in a point, line or ring, shape (n, 2)."""
    rows: list[NDArray[np.float64]] = []
    for item in element.iter():
        name, text = local_name(item), item.text or ""
        if name in {"pos", "posList"}:
            size = next(
                (int(each.get("srsDimension", 0)) for each in (item, element)
                 if each.get("srsDimension")), 2,
            )  # fmt: skip
            numbers = np.array(text.split(), float)
            if name == "pos":
                size = max(len(numbers), 1)
            rows.extend(numbers.reshape(-1, size)[:, :2])
        elif name == "coordinates":
            between = item.get("cs", ",")
            rows.extend(np.array(place.split(between)[:2], float) for place in text.split())
    xy = np.array(rows, float).reshape(-1, 2)
    return xy[:, ::-1] if swap else xy
