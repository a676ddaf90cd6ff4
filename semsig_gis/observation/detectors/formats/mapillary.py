"""Mapillary: images with cameras, and outlines in vector tiles."""

from __future__ import annotations

import base64
import binascii
from typing import TYPE_CHECKING, Any

from semsig_gis.core import InputError
from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.pictures import AnnotatedPicture, Shot, bounds, box_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from semsig_gis.observation.detectors.camera import Projection
    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Corners


CAMERAS: dict[str, Projection] = {
    "perspective": "pinhole",
    "brown": "pinhole",
    "fisheye": "fisheye",
    "equirectangular": "equirectangular",
    "spherical": "equirectangular",
}
# Errors in degrees of headings from structure from motion, and from the compass of a phone.
COMPUTED_ERROR, COMPASS_ERROR = 3.0, 10.0

# Protocol buffers: kinds of value, and field numbers of a tile, a layer and a feature.
VARINT, WIDE, BYTES, NARROW = 0, 1, 2, 5
LAYER, FEATURE, GEOMETRY, EXTENT = 3, 2, 4, 5
MOVE, LINE = 1, 2
USUAL_EXTENT = 4096


def matches(content: Any) -> bool:  # noqa: ANN401 - any JSON
    """Return whether JSON is from Mapillary."""
    return _images(content) is not None


@detection_format("Mapillary", ".json", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the pictures with camera, heading and position."""
    images = _images(document.content) or []
    return [_picture(image, str(document.file)) for image in images]


def _images(document: Any) -> list[dict[str, Any]] | None:  # noqa: ANN401 - any JSON
    """Return the images of a document with their detections; None if it is not from Mapillary.

    The document is one image with its ``detections``, a list of images, or a list of detections,
    each with or without its ``image``.
    """
    items = document["data"] if isinstance(document, dict) and "data" in document else document
    items = [items] if isinstance(items, dict) else items
    if (
        not isinstance(items, list)
        or not items
        or not all(isinstance(item, dict) for item in items)
    ):
        return None
    if all("detections" in item for item in items):
        return items
    if not all({"value", "geometry"} <= item.keys() for item in items):
        return None
    images: dict[str, dict[str, Any]] = {}
    for item in items:
        image = item.get("image") or {}
        entry = images.setdefault(str(image.get("id", "")), {**image, "detections": {"data": []}})
        entry["detections"]["data"].append(item)
    return list(images.values())


def _picture(image: dict[str, Any], source: str) -> AnnotatedPicture:
    """Return the picture of an image in the result of `_images`."""
    name = str(image.get("id") or "") or source
    detections = image["detections"]
    detections = detections["data"] if isinstance(detections, dict) else detections
    size = (int(image["width"]), int(image["height"])) if image.get("width") else None
    boxes = []
    for number, item in enumerate(detections, start=1):
        where = f"{source}, image {name}, detection {number}"
        corners, shares = _corners(item["geometry"], where)
        if not shares:
            if size is None:
                raise InputError(
                    f"{where} is in pixels of a picture of unknown size; request its width as well."
                )
            left, top, right, bottom = corners
            corners = left / size[0], top / size[1], right / size[0], bottom / size[1]
        boxes.append(box_of(item["value"], corners, where))
    computed, compass = image.get("computed_compass_angle"), image.get("compass_angle")
    heading = compass if computed is None else computed
    camera = CAMERAS.get(str(image.get("camera_type", "")).lower())
    focal = next(iter(image.get("camera_parameters") or []), None)
    point = (image.get("computed_geometry") or image.get("geometry") or {}).get("coordinates")
    shot = Shot(
        camera=camera,
        focal=float(focal) if focal and camera in {"pinhole", "fisheye"} else None,
        heading=None if heading is None else float(heading) % 360.0,
        heading_error=COMPASS_ERROR if computed is None else COMPUTED_ERROR,
        north="true",
        size=size,
        position=(float(point[1]), float(point[0])) if point else None,
    )
    return AnnotatedPicture(name=name, boxes=tuple(boxes), shares=True, shot=shot)


def _corners(geometry: Any, where: str) -> tuple[Corners, bool]:  # noqa: ANN401 - any JSON
    """Return the box of an outline, and whether it is in shares of the picture or in pixels."""
    if isinstance(geometry, str):
        try:
            return bounds(_tile_points(base64.b64decode(geometry, validate=True))), True
        except (binascii.Error, ValueError, IndexError, TypeError, ZeroDivisionError) as error:
            raise InputError(
                f"{where} has a geometry that is not a vector tile in base64; download it again."
            ) from error
    points = list(_points(geometry.get("coordinates") if isinstance(geometry, dict) else geometry))
    corners = bounds(points)
    return corners, max(corners) <= 1.0


def _points(values: Any) -> Iterator[list[Any]]:  # noqa: ANN401 - any JSON
    """Yield the points of nested lists."""
    if isinstance(values[0], list):
        for value in values:
            yield from _points(value)
    else:
        yield values


def _tile_points(tile: bytes) -> list[tuple[float, float]]:
    """Return the points of all outlines of a vector tile, in shares of its extent.

    See the Mapbox vector tile specification, 2.1; rows increase downwards, as in the picture.
    """
    points: list[tuple[float, float]] = []
    for layer in _values(tile, LAYER):
        extent = next(_values(layer, EXTENT), USUAL_EXTENT)
        for feature in _values(layer, FEATURE):
            for geometry in _values(feature, GEOMETRY):
                points += [(x / extent, y / extent) for x, y in _outline(geometry)]
    return points


def _outline(geometry: bytes) -> Iterator[tuple[int, int]]:
    """Yield the points of a geometry, which has commands with counts and steps between points."""
    numbers, position = [], 0
    while position < len(geometry):
        number, position = _varint(geometry, position)
        numbers.append(number)
    steps = iter(numbers)
    x = y = 0
    for command in steps:
        if command & 7 in {MOVE, LINE}:
            for _ in range(command >> 3):
                x, y = x + _zigzag(next(steps)), y + _zigzag(next(steps))
                yield x, y


def _zigzag(number: int) -> int:
    """Decode a signed number."""
    return (number >> 1) ^ -(number & 1)


def _varint(data: bytes, position: int) -> tuple[int, int]:
    """Return a number with seven bits per byte, lowest bits first, and the position after it."""
    number = shift = 0
    while True:
        byte = data[position]
        number |= (byte & 127) << shift
        position, shift = position + 1, shift + 7
        if byte < 128:  # noqa: PLR2004 - the continuation bit
            return number, position


def _values(message: Any, field: int) -> Iterator[Any]:  # noqa: ANN401 - bytes or a number
    """Yield the values of one field of a protocol buffer message."""
    position = 0
    while position < len(message):
        key, position = _varint(message, position)
        kind = key & 7
        value: Any
        if kind == VARINT:
            value, position = _varint(message, position)
        elif kind == BYTES:
            length, position = _varint(message, position)
            value, position = message[position : position + length], position + length
            if position > len(message):
                raise ValueError("it ends early")
        elif kind in {WIDE, NARROW}:
            value, position = None, position + (8 if kind == WIDE else 4)
        else:
            raise ValueError(f"{kind} is an unknown kind of value")
        if key >> 3 == field:
            yield value
