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
    read_boxes,
    size_of,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Box, Corners

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
    boxes, others = read_boxes(content["objects"], _box, f"{document.file}, object")
    size = size_of(content["size"]["width"], content["size"]["height"])
    return [
        AnnotatedPicture(name=document.file.stem, boxes=boxes, others=others, shot=Shot(size=size))
    ]


def _box(item: dict[str, Any], where: str) -> Box | None:
    if (corners := _corners(item)) is None:
        return None
    tags = {
        str(tag["name"]).casefold(): tag.get("value")
        for tag in item.get("tags") or ()
        if isinstance(tag, dict)
    }
    hidden = PARTLY_HIDDEN & tags.keys()
    score = tags.get("confidence", 1.0)
    return box_of(item["classTitle"], corners, where, score=score, whole=not hidden)


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
