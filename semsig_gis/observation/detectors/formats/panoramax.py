"""Panoramax: pictures of its API with annotations and their tags."""

from __future__ import annotations

import contextlib
import re
from typing import TYPE_CHECKING, Any

from semsig_gis.core import FULL_TURN, UnknownNameError
from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.pictures import (
    AnnotatedPicture,
    Shot,
    bounds,
    box_of,
    size_of,
)
from semsig_gis.sources import built_in_taxonomy, class_codes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.observation.detectors.documents import Document

COMPASS_ERROR = 10.0
"""Standard deviation in degrees of headings from a compass or from the path of the camera."""

# Properties of a picture, and the tag with the score of another tag.
ORIENTATION, HEADING = "pers:interior_orientation", "view:azimuth"
SCORE = re.compile(r"detection_confidence\[(?:osm\|)?([^=]+)(?:=(.*))?\]")


def matches(content: Any) -> bool:  # noqa: ANN401 - any JSON
    """Return whether JSON is a picture of Panoramax or a collection of them."""
    items = _items(content)
    return bool(items) and all(
        isinstance(item, dict)
        and isinstance(item.get("properties"), dict)
        and item["properties"].keys() & {"annotations", ORIENTATION, HEADING}
        for item in items
    )


@detection_format("Panoramax", ".json", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the pictures with camera and heading; annotations without a tag are counted."""
    return [_picture(item, str(document.file)) for item in _items(document.content)]


def _items(content: Any) -> list[Any]:  # noqa: ANN401 - any JSON
    if not isinstance(content, dict):
        return []
    features = content.get("features", [content])
    return features if isinstance(features, list) else []


def _picture(item: dict[str, Any], source: str) -> AnnotatedPicture:
    name, about = str(item["id"]), item["properties"]
    boxes, others = [], 0
    for number, annotation in enumerate(about.get("annotations") or (), start=1):
        label, score = _label(annotation.get("semantics") or ())
        if label is None:
            others += 1
            continue
        # A polygon, or the box that services send to the API.
        shape = annotation["shape"]
        corners = bounds(shape["coordinates"][0]) if isinstance(shape, dict) else shape
        where = f"{source}, picture {name}, annotation {number}"
        boxes.append(box_of(label, corners, where, score=score))
    orientation = about.get(ORIENTATION) or {}
    fov, heading = orientation.get("field_of_view"), about.get(HEADING)
    point = (item.get("geometry") or {}).get("coordinates")
    return AnnotatedPicture(
        name=name,
        boxes=tuple(boxes),
        others=others,
        shot=Shot(
            camera=None if not fov else "equirectangular" if fov == FULL_TURN else "pinhole",
            fov=float(fov) if fov else None,
            heading=None if heading is None else float(heading) % FULL_TURN,
            heading_error=COMPASS_ERROR,
            north="true",
            size=size_of(*(orientation.get("sensor_array_dimensions") or (None, None))),
            position=(float(point[1]), float(point[0])) if point else None,
            time=about.get("datetime"),
        ),
    )


def _label(semantics: Sequence[dict[str, Any]]) -> tuple[str | None, str]:
    """Return the tag of a class, or else the first tag, and its score."""
    tags: list[tuple[str, str]] = []
    scores: dict[tuple[str, str], str] = {}
    for tag in semantics:
        key, value = str(tag["key"]), str(tag["value"])
        if score := SCORE.fullmatch(key):
            scores[score[1], score[2] or "*"] = value
        elif not key.endswith("]"):  # a qualifier of another tag
            tags.append((key.removeprefix("osm|"), value))
    if not tags:
        return None, "1"
    key, value = next((tag for tag in tags if _is_class("=".join(tag))), tags[0])
    return f"{key}={value}", scores.get((key, value), scores.get((key, "*"), "1"))


def _is_class(tag: str) -> bool:
    with contextlib.suppress(UnknownNameError):
        return bool(class_codes(tag, built_in_taxonomy()))
    return False
