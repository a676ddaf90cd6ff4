"""CSV with a box in each row, as from Roboflow, TensorFlow or supervision."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.pictures import (
    AnnotatedPicture,
    Shot,
    box_of,
    faulty_box,
    size_of,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Box
    from semsig_gis.storage import Row

NAMES = (("xmin", "x_min"), ("ymin", "y_min"), ("xmax", "x_max"), ("ymax", "y_max"))
PICTURES = ("filename", "image_name", "image", "imageid")
LABELS = ("class_name", "label", "labelname", "name", "class")
SCORES = ("confidence", "score")


def matches(content: Any) -> bool:  # noqa: ANN401 - rows of CSV
    """Return whether a table has columns of labels and corners."""
    row = content[0][1] if content else None
    if not isinstance(row, dict):
        return False
    columns = _lower(row).keys()
    return all(any(name in columns for name in names) for names in (*NAMES, LABELS))


@detection_format("CSV of Roboflow", ".csv", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture of each file name; without names, the one that is named as the file."""
    boxes: dict[str, list[Box]] = {}
    shots: dict[str, Shot] = {}
    name = document.file.stem
    for line, cells in document.content:
        if not isinstance(cells, dict):
            boxes.setdefault(name, []).append(
                faulty_box(f"{document.file}, line {line} is no row of a table")
            )
            continue
        row = _lower(cells)
        name = _first(row, PICTURES) or document.file.stem
        box = box_of(
            _first(row, LABELS),
            [_first(row, names) for names in NAMES],
            f"{document.file}, line {line}",
            score=_first(row, SCORES) if row.keys() & {*SCORES} else 1.0,
        )
        boxes.setdefault(name, []).append(box)
        shots[name] = Shot(size=size_of(row.get("width"), row.get("height")))
    corners = [side for items in boxes.values() for box in items for side in box.corners]
    shares = max(corners) <= 1 and any(side % 1 for side in corners)
    return [
        AnnotatedPicture(name=name, boxes=tuple(items), shares=shares, shot=shots.get(name, Shot()))
        for name, items in boxes.items()
    ]


def _lower(row: Row) -> dict[str, Any]:
    """Return a row with the names of its columns in lower case."""
    return {str(name).strip().lower(): value for name, value in row.items()}


def _first(row: dict[str, Any], names: Sequence[str]) -> Any:  # noqa: ANN401 - any cell
    """Return the value of the first column with one of some names; None without."""
    return next((row[name] for name in names if row.get(name) not in {None, ""}), None)
