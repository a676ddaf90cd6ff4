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
    read_boxes,
    size_of,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Box, Corners

OUTLINES = frozenset({"polygon", "rectangle", "rotation", "mask", "circle"})


def matches(content: Any) -> bool:  # noqa: ANN401 - any JSON
    """Return whether JSON is from LabelMe."""
    return isinstance(content, dict) and {"shapes", "imagePath"} <= content.keys()


@detection_format("LabelMe", ".json", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture; points and lines are counted."""
    content = document.content
    boxes, others = read_boxes(content["shapes"], _box, f"{document.file}, shape")
    return [
        AnnotatedPicture(
            name=str(content["imagePath"] or document.file.stem),
            boxes=boxes,
            others=others,
            shot=Shot(size=size_of(content.get("imageWidth"), content.get("imageHeight"))),
        )
    ]


def _box(shape: dict[str, Any], where: str) -> Box | None:
    # Old files have polygons without a type.
    kind, points = shape.get("shape_type") or "polygon", shape["points"]
    if kind not in OUTLINES:
        return None
    corners = bounds(points) if kind != "circle" else _circle(points)
    score = shape.get("score")  # null for what a person drew
    return box_of(shape["label"], corners, where, score=1.0 if score is None else score)


def _circle(points: list[list[float]]) -> Corners:
    """Return the corners of a circle from its centre and a point on it."""
    (x, y), edge = points
    radius = math.dist((x, y), edge)
    return x - radius, y - radius, x + radius, y + radius
