"""Pascal VOC: an XML file per picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.pictures import AnnotatedPicture, Shot, box_of, size_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.observation.detectors.documents import Document

CORNERS = ("xmin", "ymin", "xmax", "ymax")
PARTLY_HIDDEN = ("truncated", "occluded")


def matches(content: Any) -> bool:  # noqa: ANN401 - an XML element
    """Return whether XML is from Pascal VOC."""
    return bool(content.tag == "annotation")


@detection_format("Pascal VOC", ".xml", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture; objects with a mask or a rotated box only are counted."""
    root = document.content
    boxes, others = [], 0
    for number, item in enumerate(root.iterfind("object"), start=1):
        box = item.find("bndbox")
        if box is None:
            others += 1
            continue
        label = (item.findtext("name") or "").strip() or "no label"
        hidden = any((item.findtext(name) or "0").strip() == "1" for name in PARTLY_HIDDEN)
        score = item.findtext("score") or item.findtext("confidence")
        corners = [box.findtext(side) for side in CORNERS]
        where = f"{document.file}, object {number}"
        boxes.append(box_of(label, corners, where, score=score, whole=not hidden))
    # Files that were written without the picture have the size 0.
    width, height = root.findtext("size/width"), root.findtext("size/height")
    return [
        AnnotatedPicture(
            name=(root.findtext("filename") or "").strip() or document.file.stem,
            boxes=tuple(boxes),
            others=others,
            shot=Shot(size=size_of(width, height)),
        )
    ]
