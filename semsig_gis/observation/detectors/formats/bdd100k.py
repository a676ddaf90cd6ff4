"""BDD100K and Scalabel: frames with labels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.pictures import (
    AnnotatedPicture,
    Shot,
    bounds,
    box_of,
    read_boxes,
    size_of,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Box, Corners

HIDDEN = ("occluded", "truncated")
CORNERS = ("x1", "y1", "x2", "y2")


def matches(content: Any) -> bool:  # noqa: ANN401 - any JSON
    """Return whether JSON is from BDD100K or Scalabel."""
    frames = _frames(content)
    return all("name" in frame for frame in frames) and any(
        "labels" in frame or "objects" in frame for frame in frames
    )


@detection_format("BDD100K", ".json", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture of each frame; lines, and labels of several objects, are counted."""
    content = document.content
    config = (content.get("config") or {}) if isinstance(content, dict) else {}
    size = config.get("imageSize") or {}
    return [_picture(frame, size, str(document.file)) for frame in _frames(content)]


def _frames(content: Any) -> list[dict[str, Any]]:  # noqa: ANN401 - any JSON
    """Return the frames of a list, or of a file with one name for all; none for other JSON."""
    shared = {}
    if isinstance(content, dict):
        shared = {"name": content["name"]} if "name" in content else {}
        content = content.get("frames")
    if not isinstance(content, list) or not all(isinstance(frame, dict) for frame in content):
        return []
    return [shared | frame for frame in content]


def _picture(frame: dict[str, Any], size: dict[str, Any], source: str) -> AnnotatedPicture:
    labels = frame.get("labels") or frame.get("objects") or ()
    boxes, others = read_boxes(labels, _box, f"{source}, frame {frame['name']}, label")
    size = frame.get("size") or size
    return AnnotatedPicture(
        name=str(frame["name"]),
        boxes=boxes,
        others=others,
        shot=Shot(size=size_of(size.get("width"), size.get("height"))),
    )


def _box(label: dict[str, Any], where: str) -> Box | None:
    attributes = label.get("attributes") or {}
    corners = None if attributes.get("crowd") else _corners(label)
    if corners is None:
        return None
    hidden = any(attributes.get(name) for name in HIDDEN)
    return box_of(
        label["category"], corners, where, score=label.get("score", 1.0), whole=not hidden
    )


def _corners(label: dict[str, Any]) -> Corners | None:
    """Return the box of a label, or the box of its closed outlines; None without both."""
    if box := label.get("box2d"):
        left, top, right, bottom = (float(box[side]) for side in CORNERS)
        return left, top, right, bottom
    outlines = [part for part in label.get("poly2d") or () if part.get("closed")]
    points = [point for part in outlines for point in part["vertices"]]
    return bounds(points) if points else None
