"""COCO: annotations, with their pictures and categories, or results of a detector."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.core import InputError
from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.pictures import (
    AnnotatedPicture,
    Shot,
    bounds,
    box_of,
    size_of,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Box, Corners


def matches(content: Any) -> bool:  # noqa: ANN401 - any JSON
    """Return whether JSON is from COCO."""
    return _is_coco(content) or _is_results(content)


@detection_format("COCO", ".json", matches)
def pictures(document: Document, documents: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the pictures; those of the first annotations are left to the results, if any."""
    content, source = document.content, str(document.file)
    first = next((other.content for other in documents if _is_coco(other.content)), None)
    if _is_coco(content):
        if content is first and any(_is_results(other.content) for other in documents):
            return []
        return _pictures(content, content.get("annotations", []), source)
    if first is None:
        raise InputError(
            f"{source} contains COCO results without images and categories; give the file of its "
            "annotations as well, which has them."
        )
    return _pictures(first, content, source)


def _is_coco(content: Any) -> bool:  # noqa: ANN401 - any JSON
    return isinstance(content, dict) and {"images", "categories"} <= content.keys()


def _is_results(content: Any) -> bool:  # noqa: ANN401 - any JSON
    return (
        isinstance(content, list)
        and bool(content)
        and all(
            isinstance(item, dict) and {"image_id", "category_id"} <= item.keys()
            for item in content
        )
    )


def _pictures(
    content: dict[str, Any], annotations: list[Any], source: str
) -> list[AnnotatedPicture]:
    names = {item["id"]: item["name"] for item in content["categories"]}
    boxes: dict[Any, list[Box]] = {item["id"]: [] for item in content["images"]}
    others = dict.fromkeys(boxes, 0)
    for number, item in enumerate(annotations, start=1):
        where = f"{source}, annotation {number}"
        image, category = item["image_id"], item["category_id"]
        if image not in boxes or category not in names:
            what = f"image {image!r}" if image not in boxes else f"category {category!r}"
            raise InputError(
                f"{where} is of the {what}, which is not listed; give the file that lists it."
            )
        corners = _corners(item)
        if corners is None:
            others[image] += 1
            continue
        boxes[image].append(box_of(names[category], corners, where, score=item.get("score")))
    return [
        AnnotatedPicture(
            name=str(item.get("file_name", item["id"])),
            boxes=tuple(boxes[item["id"]]),
            others=others[item["id"]],
            shot=Shot(size=size_of(item.get("width"), item.get("height"))),
        )
        for item in content["images"]
    ]


def _corners(item: dict[str, Any]) -> Corners | None:
    """Return the box of an annotation, or the box of all its polygons; None without both."""
    if item.get("iscrowd"):  # several objects
        return None
    if item.get("bbox"):
        left, top, width, height = item["bbox"]
        return left, top, left + width, top + height
    parts = item.get("segmentation")
    if not parts or not isinstance(parts, list):  # none, or a compressed mask
        return None
    return bounds(point for part in parts for point in zip(part[::2], part[1::2], strict=True))
