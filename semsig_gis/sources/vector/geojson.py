"""What GDAL does not say of a GeoJSON file: its validity, the stated CRS, rows without geometry."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from semsig_gis.sources.rows import WGS84, usable_crs
from semsig_gis.sources.vector.member import UNKNOWN, LayerDescription, unreadable
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from pyproj import CRS

    from semsig_gis.sources.vector.member import Member

WGS84_NAMES = re.compile(r"4326|CRS84|WGS ?84", re.IGNORECASE)


def parse_geojson(member: Member) -> tuple[LayerDescription, bool]:
    """Parse a GeoJSON file; return its description, and whether GDAL finds the same rows.

    If not, only the CRS is certain. SourceError if it is not valid JSON, which GDAL may accept.
    """
    try:
        with member.open() as stream:
            document = parse_json(stream.read().decode("utf-8-sig", errors="replace"))
    except (OSError, ValueError) as error:
        raise unreadable(member, error) from error
    document = document if isinstance(document, dict) else {}
    listed = document.get("features", [document])
    items = listed if isinstance(listed, list) else []
    features = [item for item in items if isinstance(item, dict) and item.get("type") == "Feature"]
    fields = _fields(features)
    description = LayerDescription(
        UNKNOWN,
        fields or (),
        _stated_crs(document["crs"]) if "crs" in document else WGS84,
        len(features),
        implicit="crs" not in document,
        empty=frozenset(row for row, item in enumerate(features, 1) if _is_empty(item)),
    )
    return description, fields is not None and len(features) == len(items) > 0


def _stated_crs(stated: Any) -> CRS | None:  # noqa: ANN401 - whatever is in the file
    properties = stated.get("properties") if isinstance(stated, dict) else None
    if not isinstance(properties, dict):
        return None
    name = properties.get("name", f"EPSG:{properties.get('code')}")
    crs = usable_crs(name) if isinstance(name, str) else None
    if crs is None:
        return WGS84 if WGS84_NAMES.search(str(name)) else None
    return WGS84 if crs.equals(WGS84, ignore_axis_order=True) else crs


def _fields(features: list[dict[str, Any]]) -> tuple[str, ...] | None:
    """Return the names of all properties, and ``id`` if a feature has a text as identifier."""
    names: dict[str, None] = {}
    for item in features:
        if isinstance(item.get("id"), str):
            names["id"] = None
        properties = item.get("properties", item)
        if properties is item or not isinstance(properties, dict | None):
            return None
        names.update(dict.fromkeys(properties or ()))
    return tuple(names)


def _is_empty(item: dict[str, Any]) -> bool:
    """Whether the geometry of a feature is null or has no coordinates."""
    geometry = item.get("geometry")
    if isinstance(geometry, dict):
        return _is_blank(geometry.get("coordinates", geometry.get("geometries")))
    return geometry is None


def _is_blank(parts: object) -> bool:
    return isinstance(parts, list) and all(_is_blank(part) for part in parts)
