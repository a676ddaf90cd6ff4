"""Darwin of V7: a JSON file per picture."""

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


def matches(content: Any) -> bool:  # noqa: ANN401 - any JSON
    """Return whether JSON is from Darwin, version 2."""
    return (
        isinstance(content, dict)
        and isinstance(content.get("item"), dict)
        and "annotations" in content
    )


@detection_format("Darwin", ".json", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture; points, lines and tags are counted."""
    item = document.content["item"]
    annotations = document.content["annotations"]
    boxes, others = read_boxes(annotations, _box, f"{document.file}, annotation")
    slot: dict[str, Any] = next(iter(item.get("slots") or []), {})
    return [
        AnnotatedPicture(
            name=str(item["name"]),
            boxes=boxes,
            others=others,
            shot=Shot(size=size_of(slot.get("width"), slot.get("height"))),
        )
    ]


def _box(shape: dict[str, Any], where: str) -> Box | None:
    if (corners := _corners(shape)) is None:
        return None
    score = (shape.get("inference") or {}).get("confidence", 1.0)
    return box_of(shape["name"], corners, where, score=score)


def _corners(shape: dict[str, Any]) -> Corners | None:
    """Return the box of an annotation, or that of its outline; None without both."""
    if box := shape.get("bounding_box"):
        left, top = float(box["x"]), float(box["y"])
        return left, top, left + float(box["w"]), top + float(box["h"])
    if outline := shape.get("polygon"):
        return bounds((point["x"], point["y"]) for path in outline["paths"] for point in path)
    return None
