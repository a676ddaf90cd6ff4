"""Results of a detector: JSON lists of boxes, as Ultralytics and Transformers write it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.pictures import AnnotatedPicture, bounds, box_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.observation.detectors.documents import Document

LEFT, TOP = ("x1", "xmin", "x2", "xmax", "x3", "x4"), ("y1", "ymin", "y2", "ymax", "y3", "y4")
"""Names of columns and rows of corners in Ultralytics and Transformers."""


def matches(content: Any) -> bool:  # noqa: ANN401 - any JSON
    """Return whether JSON is a list of boxes with names of their sides, or such lists."""
    parts = _parts(content, "")
    return any(items for _, items in parts) and all(
        isinstance(item, dict) and ("box" in item and isinstance(item["box"], dict | None))
        for _, items in parts
        for item in items
    )


def _parts(content: Any, name: str) -> list[tuple[str, list[Any]]]:  # noqa: ANN401 - any JSON
    """Return the lists of boxes, each with the name of its picture."""
    if isinstance(content, dict) and all(isinstance(items, list) for items in content.values()):
        return list(content.items())
    if isinstance(content, list):
        if len(content) == 1 and isinstance(content[0], list):  # a batch of one picture
            return [(name, content[0])]
        return [(name, content)]
    return []


@detection_format("results of Ultralytics or Transformers", ".json", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the pictures by name, or the one that is named as the file."""
    return [
        _picture(name, items, str(document.file))
        for name, items in _parts(document.content, document.file.stem)
    ]


def _picture(name: str, items: Sequence[dict[str, Any]], source: str) -> AnnotatedPicture:
    boxes = []
    for number, item in enumerate(items, start=1):
        sides = item["box"] or {}
        points = zip(
            *([sides[key] for key in keys if key in sides] for keys in (LEFT, TOP)), strict=True
        )
        box = box_of(
            item.get("name", item.get("label")),
            bounds(points),
            f"{source}, box {number}",
            score=item.get("confidence", item.get("score", 1.0)),
        )
        boxes.append(box)
    # Ultralytics may write shares of the picture.
    shares = all(0 <= corner <= 1 for box in boxes if not box.fault for corner in box.corners)
    return AnnotatedPicture(name=name, boxes=tuple(boxes), shares=shares)
