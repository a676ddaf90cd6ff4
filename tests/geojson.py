"""GeoJSON objects."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

Feature = dict[str, Any]


def point(*coordinates: object) -> dict[str, Any]:
    return {"type": "Point", "coordinates": list(coordinates)}


def feature(geometry: object, properties: Mapping[str, object], **members: object) -> Feature:
    return {"type": "Feature", "properties": properties, "geometry": geometry, **members}


def collection(features: Iterable[Feature], **members: object) -> dict[str, Any]:
    return {"type": "FeatureCollection", **members, "features": list(features)}
