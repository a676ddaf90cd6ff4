"""VGG Image Annotator (VIA), version 1 or 2: a project, or its annotations as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.pictures import (
    AnnotatedPicture,
    bounds,
    box_of,
    read_boxes,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Box, Corners

PROJECT = "_via_img_metadata"
LABELS = ("label", "class", "name", "type", "category", "object")
"""Usual names of the attribute that is the label, best first; otherwise the first attribute."""


def matches(content: Any) -> bool:  # noqa: ANN401 - any JSON
    """Return whether JSON is from VIA."""
    if not isinstance(content, dict) or PROJECT in content:
        return isinstance(content, dict)
    return bool(content) and all(
        isinstance(item, dict) and {"filename", "regions"} <= item.keys()
        for item in content.values()
    )


@detection_format("VIA", ".json", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the pictures, without sizes; points and lines are counted."""
    images = document.content.get(PROJECT, document.content)
    return [_picture(image, str(document.file)) for image in images.values()]


def _picture(image: dict[str, Any], source: str) -> AnnotatedPicture:
    regions = image["regions"]
    boxes, others = read_boxes(
        regions.values() if isinstance(regions, dict) else regions,
        _box,
        f"{source}, image {image['filename']}, region",
    )
    return AnnotatedPicture(name=str(image["filename"]), boxes=boxes, others=others)


def _box(region: dict[str, Any], where: str) -> Box | None:
    if (corners := _corners(region["shape_attributes"])) is None:
        return None
    return box_of(_label(region.get("region_attributes") or {}), corners, where)


def _label(attributes: dict[str, Any]) -> str:
    """Return the label among the attributes of a region, which the user names."""
    usual = {name.strip().casefold(): value for name, value in attributes.items()}
    for value in (*(usual.get(name) for name in LABELS), *attributes.values()):
        if isinstance(value, dict):  # of a checkbox: the chosen options
            value = next((option for option, choice in value.items() if choice), None)  # noqa: PLW2901
        if value not in {None, ""}:
            return str(value).strip()
    return "no label"


def _corners(shape: dict[str, Any]) -> Corners | None:
    kind = shape["name"]
    if kind == "rect":
        left, top = float(shape["x"]), float(shape["y"])
        return left, top, left + float(shape["width"]), top + float(shape["height"])
    if kind == "polygon":
        return bounds(zip(shape["all_points_x"], shape["all_points_y"], strict=True))
    if kind in {"circle", "ellipse"}:
        x, y = float(shape["cx"]), float(shape["cy"])
        across = float(shape["r"] if kind == "circle" else shape["rx"])
        down = float(shape["r"] if kind == "circle" else shape["ry"])
        return x - across, y - down, x + across, y + down
    return None
