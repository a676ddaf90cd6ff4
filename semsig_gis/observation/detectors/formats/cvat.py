"""CVAT for images 1.1."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.core import InputError
from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.pictures import (
    AnnotatedPicture,
    Shot,
    bounds,
    box_of,
    read_boxes,
    size_of,
    turned,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from xml.etree import ElementTree as ET

    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Box, Corners

CORNERS = ("xtl", "ytl", "xbr", "ybr")
MASK = ("left", "top", "width", "height")
ELLIPSE = ("cx", "cy", "rx", "ry")


def matches(content: Any) -> bool:  # noqa: ANN401 - an XML element
    """Return whether XML is from CVAT."""
    return bool(content.tag == "annotations")


@detection_format("CVAT for images", ".xml", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the pictures; InputError for tracks of a video."""
    if document.content.find("track") is not None:
        raise InputError(
            f"{document.file} contains tracks of a video; export it as CVAT for images 1.1."
        )
    return [_picture(image, str(document.file)) for image in document.content.iter("image")]


def _picture(image: ET.Element, source: str) -> AnnotatedPicture:
    name = image.attrib["name"]
    shapes = (shape for shape in image if shape.tag != "tag")
    boxes, others = read_boxes(shapes, _box, f"{source}, image {name!r}, shape")
    size = size_of(image.get("width"), image.get("height"))
    return AnnotatedPicture(name=name, boxes=boxes, others=others, shot=Shot(size=size))


def _box(shape: ET.Element, where: str) -> Box | None:
    if (corners := _corners(shape)) is None:
        return None
    attributes = {item.get("name"): item.text for item in shape.iter("attribute")}
    return box_of(
        shape.attrib["label"],
        corners,
        where,
        score=attributes.get("score", attributes.get("confidence", 1.0)),
        whole=shape.get("occluded", "0") != "1",
    )


def _corners(shape: ET.Element) -> Corners | None:
    """Return the corners of a shape; None for points and lines."""
    if shape.tag == "polygon":
        return bounds(point.split(",") for point in shape.attrib["points"].split(";"))
    if shape.tag == "box":
        left, top, right, bottom = (float(shape.attrib[key]) for key in CORNERS)
        angle = float(shape.get("rotation", 0.0))
        corners = left, top, right, bottom
        return (
            turned(corners, angle, ((left + right) / 2, (top + bottom) / 2)) if angle else corners
        )
    if shape.tag == "mask":
        left, top, width, height = (float(shape.attrib[key]) for key in MASK)
        return left, top, left + width, top + height
    if shape.tag == "ellipse":
        x, y, across, down = (float(shape.attrib[key]) for key in ELLIPSE)
        return x - across, y - down, x + across, y + down
    return None
