"""Features in GML 2 to 3.2, as Web Feature Services send them."""

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
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

SRS_NAME = re.compile(r"\bsrsName=[\"']([^\"']+)[\"']")
# Names of this form mean the axis order of the authority; other names mean x first.
AUTHORITY_ORDER = re.compile(r"(?:urn:|https?://www\.opengis\.net/def/)", re.IGNORECASE)
ID = "id"  # field for the identifier of a feature, unless it has another field of this name
MEMBERS = frozenset({"member", "featureMember", "featureMembers"})
NOT_FIELDS = frozenset({"boundedBy", "location"})  # elements of a feature that are not fields
POINTS, LINES = frozenset({"Point"}), frozenset({"LineString", "LinearRing", "LineStringSegment"})
AREAS = frozenset({"Polygon", "PolygonPatch"})
BOUNDARIES = frozenset({"exterior", "interior", "outerBoundaryIs", "innerBoundaryIs"})
COLLECTIONS = frozenset(
    {"CompositeCurve", "CompositeSurface", "Curve", "MultiCurve", "MultiGeometry",
     "MultiLineString", "MultiPoint", "MultiPolygon", "MultiSurface", "Ring", "Surface"}
)  # fmt: skip
GEOMETRIES = POINTS | LINES | AREAS | COLLECTIONS
# Types of geometries that consist of parts of one type.
MULTIPLE: dict[str, Callable[..., shapely.Geometry]] = {
    "Point": shapely.MultiPoint,
    "LineString": shapely.MultiLineString,
    "Polygon": shapely.MultiPolygon,
}


def local_name(element: ET.Element) -> str:
    """Return the name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


def parse_xml(content: bytes) -> ET.Element:
    """Parse XML and return its root; ValueError if it is invalid or has a document type."""
    # A document type can define entities that expand without limit. UTF-16 has zero bytes.
    if b"<!DOCTYPE" in content.replace(b"\0", b""):
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
    """Return the first CRS in a document, and whether its first coordinate is the northing."""
    match = SRS_NAME.search(content.decode("utf-8", errors="replace"))
    if match is None:
        return None, False
    name = match[1]
    if name.endswith("CRS84"):
        return WGS84, False
    code = re.search(r"epsg.*?(\d+)$", name, re.IGNORECASE)
    try:
        crs = CRS.from_user_input(f"EPSG:{code[1]}" if code else name)
    except CRSError as error:
        raise CrsError(
            f"the GML names the CRS {name[:60]!r}, which is unknown; report it to the publisher."
        ) from error
    northing_first = crs.axis_info[0].direction.lower() in {"north", "south"}
    return crs, northing_first and AUTHORITY_ORDER.match(name) is not None


def read_feature(
    feature: ET.Element, *, swap: bool
) -> tuple[dict[str, Any], shapely.Geometry | BadFeatureError | None]:
    """Return the fields of a feature, and its geometry or the error in it."""
    values: dict[str, Any] = {}
    geometry: shapely.Geometry | BadFeatureError | None = None
    for item in feature:
        name = local_name(item)
        inner = next(iter(item), None)
        if inner is None:
            values[name] = (item.text or "").strip() or None
        elif local_name(inner) in GEOMETRIES:
            if name not in NOT_FIELDS or geometry is None:
                geometry = _shape(inner, swap=swap)
        elif name not in NOT_FIELDS:
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
        boundaries = (part for part in element if local_name(part) in BOUNDARIES)
        outer, *inner = (
            shapely.get_coordinates(_geometry(part[0], swap=swap)) for part in boundaries
        )
        return shapely.Polygon(outer, inner)
    if name not in COLLECTIONS:
        raise ValueError(f"{name} is not read")
    # The children of `element` are properties such as pointMember; their children are the parts.
    parts = [_geometry(part, swap=swap) for member in element for part in member]
    if name in {"Curve", "CompositeCurve", "Ring"}:
        return shapely.LineString(shapely.get_coordinates(parts))
    if len(parts) == 1:
        return parts[0]
    flat = shapely.get_parts(parts)
    # The name of the only type; the names of several types are no key.
    build = MULTIPLE.get("".join({part.geom_type for part in flat}), shapely.GeometryCollection)
    return shapely.union_all(parts) if name == "CompositeSurface" else build(flat)


def _positions(element: ET.Element, *, swap: bool) -> NDArray[np.float64]:
    """Return x and y of the positions in a point, line or ring, shape (n, 2)."""
    rows: list[NDArray[np.float64]] = []
    for item in element.iter():
        name, text = local_name(item), item.text or ""
        if name in {"pos", "posList"}:
            numbers = np.array(text.split(), float)
            size = int(item.get("srsDimension") or element.get("srsDimension") or 2)
            if name == "pos":
                size = max(len(numbers), 1)
            rows.extend(numbers.reshape(-1, size)[:, :2])
        elif name == "coordinates":
            separator = item.get("cs", ",")
            rows.extend(np.array(place.split(separator)[:2], float) for place in text.split())
    xy = np.array(rows, float).reshape(-1, 2)
    return xy[:, ::-1] if swap else xy
