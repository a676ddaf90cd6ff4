"""Supervisely: a JSON file per picture."""

from __future__ import annotations

import base64
import struct
import zlib
from typing import TYPE_CHECKING, Any

from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.pictures import (
    AnnotatedPicture,
    Shot,
    bounds,
    box_of,
    corners_of,
    size_of,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Corners

OUTLINES = frozenset({"rectangle", "polygon"})
PARTLY_HIDDEN = frozenset({"truncated", "occluded"})
PNG_SIZE = slice(16, 24)  # of the header of a PNG


def matches(content: Any) -> bool:  # noqa: ANN401 - any JSON
    """Return whether JSON is from Supervisely."""
    return isinstance(content, dict) and {"objects", "size"} <= content.keys()


@detection_format("Supervisely", ".json", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture, named by the file; points and lines are counted."""
    content = document.content
    boxes, others = [], 0
    for number, item in enumerate(content["objects"], start=1):
        corners = corners_of(_corners, item)
        if corners is None:
            others += 1
            continue
        tags = {
            str(tag["name"]).casefold(): tag.get("value")
            for tag in item.get("tags") or ()
            if isinstance(tag, dict)
        }
        box = box_of(
            item["classTitle"],
            corners,
            f"{document.file}, object {number}",
            score=tags.get("confidence"),
            whole=not PARTLY_HIDDEN & tags.keys(),
        )
        boxes.append(box)
    size = size_of(content["size"]["width"], content["size"]["height"])
    return [
        AnnotatedPicture(
            name=document.file.stem, boxes=tuple(boxes), others=others, shot=Shot(size=size)
        )
    ]


def _corners(item: dict[str, Any]) -> Corners | None:
    """Return the box of an object; None for points and lines."""
    kind = item.get("geometryType") or ("bitmap" if item.get("bitmap") else "polygon")
    if kind in OUTLINES:
        return bounds(item["points"]["exterior"])
    if kind != "bitmap":
        return None
    # The mask is a compressed PNG; its header has its size.
    packed = base64.b64decode(item["bitmap"]["data"])
    try:
        header = zlib.decompressobj().decompress(packed, PNG_SIZE.stop)
        width, height = struct.unpack(">II", header[PNG_SIZE])
    except (zlib.error, struct.error) as error:
        raise ValueError("a bitmap is not a PNG") from error
    left, top = (float(side) for side in item["bitmap"]["origin"])
    return left, top, left + width, top + height
