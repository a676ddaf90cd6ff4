"""Label Studio: tasks with rectangles and polygons in percent of the picture."""

from __future__ import annotations

import re
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.pictures import (
    AnnotatedPicture,
    Shot,
    bounds,
    box_of,
    read_boxes,
    size_of,
    turned,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Box, Corners

PERCENT = 100.0


SHAPES = ("rectanglelabels", "polygonlabels")


def matches(content: Any) -> bool:  # noqa: ANN401 - any JSON
    """Return whether JSON is a list of tasks, whole or as JSON-MIN."""
    return (
        isinstance(content, list)
        and bool(content)
        and all(isinstance(item, dict) and ("data" in item or _shapes(item)) for item in content)
    )


def _shapes(task: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the shapes of a task in JSON-MIN, which stand under a name that the user chooses."""
    return [
        item
        for values in task.values()
        if isinstance(values, list)
        for item in values
        if isinstance(item, dict) and "original_width" in item
    ]


@detection_format("Label Studio", ".json", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture of each task."""
    tasks = (task if "data" in task else _whole_task(task) for task in document.content)
    return [_picture(task, str(document.file)) for task in tasks]


def _whole_task(task: dict[str, Any]) -> dict[str, Any]:
    """Return a task of JSON-MIN in the form of whole tasks."""
    texts = {name: value for name, value in task.items() if isinstance(value, str)}
    result = [
        {**shape, "type": kind, "value": shape}
        for shape in _shapes(task)
        for kind in shape
        if kind.endswith("labels")
    ]
    return {"id": task.get("id", "?"), "data": texts, "annotations": [{"result": result}]}


def _picture(task: dict[str, Any], source: str) -> AnnotatedPicture:
    where = f"{source}, task {task.get('id', '?')}"
    annotations = [item for item in task.get("annotations") or [] if not item.get("was_cancelled")]
    last = (annotations or task.get("predictions") or [{"result": []}])[-1]
    # Other results are texts and choices.
    shapes = [
        item
        for item in last["result"]
        if not isinstance(item, dict) or str(item.get("type", "")).endswith("labels")
    ]
    sizes = (_size(item) for item in shapes if isinstance(item, dict))
    size = next(filter(None, sizes), None)
    boxes, others = read_boxes(
        shapes, lambda item, place: _box(item, size or (1, 1), place), f"{where}, result"
    )
    values = [text for text in task["data"].values() if isinstance(text, str)]
    address = str(task["data"].get("image") or next(iter(values), task.get("id", "?")))
    parts = urlsplit(address)
    path = (parse_qs(parts.query).get("d") or [parts.path])[0]
    # Uploads have a prefix of eight hexadecimal digits.
    name = re.sub(r"^[0-9a-f]{8}-", "", PurePosixPath(path).name) or address
    return AnnotatedPicture(
        name=name, boxes=boxes, shares=True, others=others, shot=Shot(size=size)
    )


def _size(item: dict[str, Any]) -> tuple[int, int] | None:
    return size_of(item.get("original_width"), item.get("original_height"))


def _box(item: dict[str, Any], size: tuple[int, int], where: str) -> Box | None:
    """Return the box of a result; `size` is that of the picture if the result does not have it."""
    if (kind := item["type"]) not in SHAPES:
        return None
    value = item["value"]
    label = value[kind][0] if value.get(kind) else "no label"
    corners = _corners(value, _size(item) or size)
    return box_of(label, corners, where, score=item.get("score", 1.0))


def _corners(value: dict[str, Any], size: tuple[int, int]) -> Corners:
    """Return the corners of a rectangle or polygon in percent, in shares of the picture."""
    if "points" in value:
        corners = bounds(value["points"])
    else:
        left, top = float(value["x"]), float(value["y"])
        corners = left, top, left + float(value["width"]), top + float(value["height"])
        if angle := float(value.get("rotation") or 0.0):
            # The rotation is about the left top corner, in pixels.
            wide, high = size
            scaled = corners[0] * wide, corners[1] * high, corners[2] * wide, corners[3] * high
            box = turned(scaled, angle, (left * wide, top * high))
            corners = box[0] / wide, box[1] / high, box[2] / wide, box[3] / high
    first, second, third, fourth = (number / PERCENT for number in corners)
    return first, second, third, fourth
