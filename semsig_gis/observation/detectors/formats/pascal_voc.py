"""Pascal VOC: an XML file per picture."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

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
    from semsig_gis.observation.detectors.pictures import Box

ROTATED = ("cx", "cy", "w", "h", "angle")
CORNERS = ("xmin", "ymin", "xmax", "ymax")
PARTLY_HIDDEN = ("truncated", "occluded")


def matches(content: Any) -> bool:  # noqa: ANN401 - an XML element
    """Return whether XML is from Pascal VOC."""
    return bool(content.tag == "annotation")


def _corners(item: ET.Element) -> Sequence[str | float | None] | None:
    """Return the box of an object, or that of its outline; None without both."""
    if (box := item.find("bndbox")) is not None:
        return [box.findtext(side) for side in CORNERS]
    if (box := item.find("robndbox")) is not None:  # its centre, size and angle in radians
        x, y, width, height, angle = (float(box.findtext(key) or "nan") for key in ROTATED)
        corners = x - width / 2, y - height / 2, x + width / 2, y + height / 2
        return turned(corners, math.degrees(angle), (x, y))
    if (outline := item.find("polygon")) is None:
        return None
    values = [part.text for part in outline.iter() if re.fullmatch(r"[xy]\d*", part.tag)]
    if len(values) <= 2:  # noqa: PLR2004 - a point
        return None
    return bounds(zip(values[::2], values[1::2], strict=False))


@detection_format("Pascal VOC", ".xml", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture; objects without an outline are counted."""
    root = document.content
    boxes, others = read_boxes(root.iterfind("object"), _box, f"{document.file}, object")
    # Files that were written without the picture have the size 0.
    width, height = root.findtext("size/width"), root.findtext("size/height")
    return [
        AnnotatedPicture(
            name=(root.findtext("filename") or "").strip() or document.file.stem,
            boxes=boxes,
            others=others,
            shot=Shot(size=size_of(width, height)),
        )
    ]


def _box(item: ET.Element, where: str) -> Box | None:
    if (corners := _corners(item)) is None:
        return None
    label = (item.findtext("name") or "").strip() or "no label"
    hidden = any((item.findtext(name) or "0").strip() == "1" for name in PARTLY_HIDDEN)
    score = item.findtext("score", item.findtext("confidence", "1"))
    return box_of(label, corners, where, score=score, whole=not hidden)
