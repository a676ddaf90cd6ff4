"""Datumaro: a JSON file of items with boxes, outlines and masks in pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.formats.coco import mask_corners
from semsig_gis.observation.detectors.pictures import (
    NO_CORNERS,
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

    def box(shape: dict[str, Any], where: str) -> Box | None:
        if shape.get("type") not in SHAPES:
            return None
        attributes = shape.get("attributes") or {}
        hidden = attributes.get("occluded") or attributes.get("truncated")
        label, score = names[shape["label_id"]], attributes.get("score", 1.0)
        return box_of(label, _corners(shape), where, score=score, whole=not hidden)

    annotations = item.get("annotations") or []
    boxes, others = read_boxes(annotations, box, f"{source}, item {item['id']}, annotation")
    image = item.get("image") or item.get("media") or {}
    height, width = image.get("size") or (None, None)
    return AnnotatedPicture(
        name=str(image.get("path") or item["id"]),
        boxes=boxes,
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
