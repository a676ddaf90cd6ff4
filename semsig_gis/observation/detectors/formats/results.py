"""Results of a detector for one picture: a JSON list, as Ultralytics and Transformers write it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.pictures import AnnotatedPicture, box_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.observation.detectors.documents import Document

SIDES = (("x1", "y1", "x2", "y2"), ("xmin", "ymin", "xmax", "ymax"))
"""Names of left, top, right and bottom in Ultralytics and Transformers."""


def matches(content: Any) -> bool:  # noqa: ANN401 - any JSON
    """Return whether JSON is a list of boxes with names of their sides."""
    return (
        isinstance(content, list)
        and bool(content)
        and all(isinstance(item, dict) and isinstance(item.get("box"), dict) for item in content)
    )


@detection_format("results of Ultralytics or Transformers", ".json", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture that is named as the file."""
    boxes = []
    for number, item in enumerate(document.content, start=1):
        sides = next((names for names in SIDES if names[0] in item["box"]), SIDES[0])
        box = box_of(
            item.get("name", item.get("label")),
            map(item["box"].get, sides),
            f"{document.file}, box {number}",
            score=item.get("confidence", item.get("score")),
        )
        boxes.append(box)
    # Ultralytics may write shares of the picture.
    shares = all(0 <= corner <= 1 for box in boxes if not box.fault for corner in box.corners)
    return [AnnotatedPicture(name=document.file.stem, boxes=tuple(boxes), shares=shares)]
