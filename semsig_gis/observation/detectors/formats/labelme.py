"""LabelMe: a JSON file per picture."""

from __future__ import annotations

import math
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

OUTLINES = frozenset({"polygon", "rectangle", "rotation", "mask", "circle"})


def matches(content: Any) -> bool:  # noqa: ANN401 - any JSON
    """Return whether JSON is from LabelMe."""
    return isinstance(content, dict) and {"shapes", "imagePath"} <= content.keys()


@detection_format("LabelMe", ".json", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture; points and lines are counted."""
    content = document.content
    boxes, others = [], 0
    for number, shape in enumerate(content["shapes"], start=1):
        # Old files have polygons without a type.
        kind, points = shape.get("shape_type") or "polygon", shape["points"]
        if kind not in OUTLINES:
            others += 1
            continue
        corners = bounds(points) if kind != "circle" else corners_of(_circle, points)
        where = f"{document.file}, shape {number}"
        boxes.append(box_of(shape["label"], corners, where, score=shape.get("score")))
    return [
        AnnotatedPicture(
            name=str(content["imagePath"] or document.file.stem),
            boxes=tuple(boxes),
            others=others,
            shot=Shot(size=size_of(content.get("imageWidth"), content.get("imageHeight"))),
        )
    ]


def _circle(points: list[list[float]]) -> Corners:
    """Return the corners of a circle from its centre and a point on it."""
    (x, y), edge = points
    radius = math.dist((x, y), edge)
    return x - radius, y - radius, x + radius, y + radius
