"""Answers of services for one picture: Amazon Rekognition, Google Cloud Vision and Roboflow."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.observation.detectors.documents import INVALID
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
    from collections.abc import Callable, Iterator, Sequence

    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Corners

    Items = list[tuple[Any, Any, Any]]

PERCENT = 100.0


def _share(item: dict[str, Any]) -> float | None:
    percent = item.get("Confidence", PERCENT)
    return None if percent is None else percent / PERCENT


def _rekognition(content: dict[str, Any]) -> Items:
    """Return label, box and score of each object; labels of the whole picture have none."""
    return [
        (label["Name"], item.get("BoundingBox"), _share(item))
        for label in content["Labels"]
        for item in label.get("Instances") or []
    ]


def _vision(content: dict[str, Any]) -> Items:
    answers = content.get("responses", [content])
    return [
        (item.get("name"), item.get("boundingPoly"), item.get("score", 1.0))
        for answer in answers
        for item in answer.get("localizedObjectAnnotations") or []
    ]


def _roboflow(content: dict[str, Any]) -> Items:
    return [
        (item.get("class"), item, item.get("confidence", 1.0)) for item in content["predictions"]
    ]


READERS: dict[str, Callable[[dict[str, Any]], Items]] = {
    "Labels": _rekognition,
    "responses": _vision,
    "localizedObjectAnnotations": _vision,
    "predictions": _roboflow,
}
"""How an answer is read, by the key that it has."""


def _readers(content: Any) -> Iterator[Callable[[dict[str, Any]], Items]]:  # noqa: ANN401 - any JSON
    if isinstance(content, dict):
        for key, reader in READERS.items():
            if isinstance(content.get(key), list):
                yield reader


def matches(content: Any) -> bool:  # noqa: ANN401 - any JSON
    """Return whether JSON is the answer of a service."""
    try:
        return any(isinstance(reader(content), list) for reader in _readers(content))
    except INVALID:
        return False


@detection_format("answers of Rekognition, Vision or Roboflow", ".json", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture that is named as the file."""
    content = document.content
    reader = next(_readers(content))
    boxes = []
    for number, (label, item, score) in enumerate(reader(content), start=1):
        corners = corners_of(_corners, item)
        where = f"{document.file}, object {number}"
        boxes.append(box_of(label, corners, where, score=score))
    image = content.get("image") or {}
    return [
        AnnotatedPicture(
            name=document.file.stem,
            boxes=tuple(boxes),
            shares=reader is not _roboflow,
            shot=Shot(size=size_of(image.get("width"), image.get("height"))),
        )
    ]


def _corners(item: Any) -> Corners:  # noqa: ANN401 - any JSON
    """Return the corners of a box, by a corner and size, by its centre and size, or by points."""
    if "Left" in item:
        left, top = float(item["Left"]), float(item["Top"])
        return left, top, left + float(item["Width"]), top + float(item["Height"])
    if "normalizedVertices" in item:  # without the coordinates that are 0
        points = ((point.get("x", 0), point.get("y", 0)) for point in item["normalizedVertices"])
        return bounds(points)
    x, y = float(item["x"]), float(item["y"])
    across, down = float(item["width"]) / 2, float(item["height"]) / 2
    return x - across, y - down, x + across, y + down
