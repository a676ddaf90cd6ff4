"""Datumaro: a JSON file of items with boxes, outlines and masks in pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.observation.detectors.documents import INVALID
from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.formats.coco import mask_corners
from semsig_gis.observation.detectors.pictures import (
    NO_CORNERS,
    AnnotatedPicture,
    Shot,
    bounds,
    box_of,
    size_of,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Corners

SHAPES = frozenset({"bbox", "polygon", "mask"})


def matches(content: Any) -> bool:  # noqa: ANN401 - any JSON
    """Return whether JSON is from Datumaro."""
    return isinstance(content, dict) and {"categories", "items"} <= content.keys()


@detection_format("Datumaro", ".json", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture of each item; points and lines are counted."""
    names = [label["name"] for label in document.content["categories"]["label"]["labels"]]
    return [_picture(item, names, str(document.file)) for item in document.content["items"]]


def _picture(item: dict[str, Any], names: Sequence[str], source: str) -> AnnotatedPicture:
    boxes, others = [], 0
    for number, shape in enumerate(item.get("annotations") or [], start=1):
        if shape.get("type") not in SHAPES:
            others += 1
            continue
        attributes = shape.get("attributes") or {}
        try:
            label, corners = names[shape["label_id"]], _corners(shape)
        except INVALID:
            label, corners = "", NO_CORNERS
        box = box_of(
            label,
            corners,
            f"{source}, item {item['id']}, annotation {number}",
            score=attributes.get("score"),
            whole=not (attributes.get("occluded") or attributes.get("truncated")),
        )
        boxes.append(box)
    image = item.get("image") or item.get("media") or {}
    height, width = image.get("size") or (None, None)
    return AnnotatedPicture(
        name=str(image.get("path") or item["id"]),
        boxes=tuple(boxes),
        others=others,
        shot=Shot(size=size_of(width, height)),
    )


def _corners(shape: dict[str, Any]) -> Corners:
    if shape["type"] == "bbox":
        left, top, width, height = shape["bbox"]
        return left, top, left + width, top + height
    if shape["type"] == "polygon":
        return bounds(zip(shape["points"][::2], shape["points"][1::2], strict=True))
    return mask_corners(shape["rle"]) or NO_CORNERS
