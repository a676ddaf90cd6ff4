"""CSV with a box in each row, as from Roboflow: filename, width, height, class and corners."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.pictures import AnnotatedPicture, Shot, box_of, size_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Box

CORNERS = ("xmin", "ymin", "xmax", "ymax")


def matches(content: Any) -> bool:  # noqa: ANN401 - rows of CSV
    """Return whether a table has the columns of Roboflow."""
    names = content[0][1] if content else None
    return isinstance(names, dict) and {"filename", "class", *CORNERS} <= names.keys()


@detection_format("CSV of Roboflow", ".csv", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture of each file name."""
    boxes: dict[str, list[Box]] = {}
    shots: dict[str, Shot] = {}
    for line, row in document.content:
        if isinstance(row, Exception):
            raise row
        name = row["filename"]
        corners = [row[side] for side in CORNERS]
        box = box_of(row["class"], corners, f"{document.file}, line {line}")
        boxes.setdefault(name, []).append(box)
        shots[name] = Shot(size=size_of(row.get("width"), row.get("height")))
    return [
        AnnotatedPicture(name=name, boxes=tuple(items), shot=shots[name])
        for name, items in boxes.items()
    ]
