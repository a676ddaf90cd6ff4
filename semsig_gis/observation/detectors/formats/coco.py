"""COCO: annotations, with their pictures and categories, or results of a detector."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import InputError
from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.formats.yolo import read_class_names
from semsig_gis.observation.detectors.pictures import (
    AnnotatedPicture,
    Shot,
    bounds,
    box_of,
    corners_of,
    faulty_box,
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
        first = _numbered(content, document, documents)
    if first is None:
        raise InputError(
            f"{source} contains COCO results without images and categories; give the file of its "
            "annotations as well, which has them, or if Ultralytics wrote it, the data.yaml."
        )
    return _pictures(first, content, source)


def _numbered(
    content: list[dict[str, Any]], document: Document, documents: Sequence[Document]
) -> dict[str, Any] | None:
    """Return the pictures and categories of results of Ultralytics by a file of class names.

    None without such a file. Its versions count classes from 0 or from 1: InputError if the numbers
    do not show which.
    """
    source = next((other.file for other in documents if other.content is None), None)
    if source is None:
        return None
    names = read_class_names(source)
    last = max(number for number, name in names.items() if name)
    used = {int(item["category_id"]) for item in content}
    if 0 not in used and last + 1 not in used:
        raise InputError(
            f"{document.file} has classes that may be counted from 0 or from 1, as neither 0 nor "
            f"{last + 1} is one of them; give the file of annotations with images and categories."
        )
    first = 0 if 0 in used else 1
    pictures = {item["image_id"]: item.get("file_name", item["image_id"]) for item in content}
    return {
        "images": [{"id": key, "file_name": str(name)} for key, name in pictures.items()],
        "categories": [{"id": number + first, "name": name} for number, name in names.items()],
    }


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
    # Programs write identifiers as numbers or as text, some the name of the picture.
    names = {str(item["id"]): item["name"] for item in content["categories"]}
    boxes: dict[str, list[Box]] = {str(item["id"]): [] for item in content["images"]}
    stems = {
        PurePosixPath(str(item.get("file_name"))).stem: str(item["id"])
        for item in content["images"]
    }
    others = dict.fromkeys(boxes, 0)
    unlisted = []
    for number, item in enumerate(annotations, start=1):
        where = f"{source}, annotation {number}"
        if not isinstance(item, dict):
            unlisted.append(faulty_box(f"{where} is not an object"))
            continue
        if "image_id" not in item:
            unlisted.append(faulty_box(f"{where} lacks 'image_id'"))
            continue
        image, category = str(item["image_id"]), str(item.get("category_id"))
        image = image if image in boxes else stems.get(image, image)
        if image not in boxes or category not in names:
            name = "category_id" if image in boxes else "image_id"
            what = f"{name.removesuffix('_id')} {item.get(name)!r}"
            unlisted.append(faulty_box(f"{where} is of the {what}, which is not listed"))
            continue
        if item.get("iscrowd"):  # several objects
            others[image] += 1
            continue
        corners = corners_of(_corners, item)
        if corners is None:
            others[image] += 1
        else:
            boxes[image].append(
                box_of(names[category], corners, where, score=item.get("score", 1.0))
            )
    if unlisted and (len(unlisted) == len(annotations) or not boxes):
        raise InputError(f"{unlisted[0].fault}; give the file that lists it.")
    if boxes:
        next(iter(boxes.values())).extend(unlisted)
    return [
        AnnotatedPicture(
            name=str(item.get("file_name", item["id"])),
            boxes=tuple(boxes[str(item["id"])]),
            others=others[str(item["id"])],
            shot=Shot(size=size_of(item.get("width"), item.get("height"))),
        )
        for item in content["images"]
    ]


def _corners(item: dict[str, Any]) -> Corners | None:
    """Return the box of an annotation, or the box of its outline or mask; None without them."""
    shape = item.get("segmentation")
    if item.get("bbox") and (any(item["bbox"]) or not shape):
        left, top, width, height = item["bbox"]
        return left, top, left + width, top + height
    if isinstance(shape, dict):
        return mask_corners(shape)
    if not shape:
        return None
    parts = shape if isinstance(shape[0], list) else [shape]
    return bounds(point for part in parts for point in np.reshape(part, (-1, 2)))


def mask_corners(mask: dict[str, Any]) -> Corners | None:
    """Return the box of a mask in run lengths; None if it is empty.

    The mask is read column by column: `counts` are the numbers of pixels that are alternately out
    of the object and in it, or these numbers as text.
    """
    high, counts = int(mask["size"][0]), mask["counts"]
    if high < 1:
        raise ValueError("a mask has no rows")
    runs = _run_lengths(counts) if isinstance(counts, str) else map(int, counts)
    ends = np.cumsum(np.array([*runs], np.int64))
    first, last = ends[:-1:2], ends[1::2] - 1
    first, last = first[first <= last], last[first <= last]
    if not len(first):
        return None
    one_column = first // high == last // high
    top = np.where(one_column, first % high, 0).min()
    bottom = np.where(one_column, last % high, high - 1).max() + 1
    return float(first[0] // high), float(top), float(last[-1] // high + 1), float(bottom)


def _run_lengths(text: str) -> list[int]:
    """Return the run lengths in a text of COCO.

    A character has five bits of a number, lowest first, and whether others follow. From the fourth
    number on, they are differences from the second last one.
    """
    runs: list[int] = []
    value = shift = 0
    for character in text:
        code = ord(character) - 48
        value |= (code & 31) << shift
        shift += 5
        if code & 32:
            continue
        if code & 16:  # the number is negative
            value -= 1 << shift
        runs.append(value + (runs[-2] if len(runs) > 2 else 0))  # noqa: PLR2004
        value = shift = 0
    return runs
