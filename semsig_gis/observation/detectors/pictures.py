"""Pictures with boxes from a detector or a person, in any file format."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, fields, replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, TypeVar
from urllib.parse import parse_qs, unquote, urlsplit

from semsig_gis.core import InputError
from semsig_gis.observation.detectors.camera import MOST_PIXELS
from semsig_gis.observation.detectors.documents import INVALID

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from semsig_gis.observation.detectors.camera import Projection

Corners = tuple[float, float, float, float]
"""Left, top, right and bottom."""
NO_CORNERS: Corners = (math.nan, math.nan, math.nan, math.nan)

NO_SCORE = frozenset({"none", "null", "nan", "n/a", "na", "-", ""})
NO_NUMBER = "has a box or a score that is not a number"

_Shape = TypeVar("_Shape")
_Corners = TypeVar("_Corners")

FOLDERS = {"labels": "images", "label_2": "image_2", "ann": "img", "Annotations": "JPEGImages"}
"""Folders of pictures of data sets, by the folder of their labels."""

# Boxes are of another picture if the ratio of its sides differs by more.
SAME_SHAPE = 0.05

# Roboflow names its copy of street.jpg "street_jpg.rf.0a1b2c.jpg", or without "_jpg".
ROBOFLOW = re.compile(r"(?i)(.+?)(?:_(jpe?g|png|webp|tiff?|heic))?\.rf\.\w+(\.\w+)?")
# Label Studio names its copy of street.jpg "0a1b2c3d-street.jpg".
UPLOAD = re.compile(r"[0-9a-f]{8}(?:-|__)(.+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """An object in a picture: its label, its corners, and the score of the detector.

    `whole` is false if a part of the object is marked as hidden. `fault` says why the box cannot be
    used; it is empty if it can.
    """

    label: str
    corners: Corners
    score: float = 1.0
    whole: bool = True
    fault: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """Camera, direction, place and time of a picture; None for unknown values.

    `focal` is the focal length divided by the longer side of the picture, `position` latitude and
    longitude, `time` in ISO 8601 with a time zone, and `north` the name of the north of the
    heading; `travels` is whether the heading is only the direction of travel. `horizon` is the row
    of the horizon of a cropped panorama, as a share of its height. `turn` is the angle in degrees
    by which the pixels of a file are turned clockwise to show it upright. Pictures with the same
    `place` are one view.
    """

    camera: Projection | None = None
    fov: float | None = None
    focal: float | None = None
    heading: float | None = None
    heading_error: float | None = None
    north: str | None = None
    travels: bool | None = None
    pitch: float | None = None
    roll: float | None = None
    horizon: float | None = None
    size: tuple[int, int] | None = None
    position: tuple[float, float] | None = None
    time: str | None = None
    place: str | None = None
    turn: int | None = None

    def filled(self, other: Shot) -> Shot:
        """Return a copy with unknown values taken from another.

        A field of view has priority over the other's focal length. The error, the north and the
        kind of a heading are from the same source as the heading.
        """
        fixed = {"focal"} if self.fov is not None else set()
        if self.heading is not None:
            fixed |= {"heading_error", "north", "travels"}
        names = {item.name for item in fields(self)} - fixed
        values = {name: getattr(other, name) for name in names if getattr(self, name) is None}
        return replace(self, **values)


@dataclass(frozen=True, slots=True, kw_only=True)
class AnnotatedPicture:
    """A picture with its name, its boxes, and the shot data of its file.

    With `shares`, corners are shares of its width and height, otherwise pixels. `others` is the
    number of shapes that are not boxes, such as points. `folder` is the folder of its file of
    detections.
    """

    name: str
    boxes: tuple[Box, ...]
    shares: bool = False
    others: int = 0
    shot: Shot = field(default_factory=Shot)
    folder: Path | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its file, best first: as given, without folders, without the suffix."""
        address = urlsplit(self.name) if "://" in self.name or "?" in self.name else None
        place = self.name
        if address:
            place = parse_qs(address.query).get("d", [address.path])[0]
        path = PurePosixPath(unquote(place).replace("\\", "/"))
        names = [self.name, str(path), path.name]
        if original := ROBOFLOW.fullmatch(path.name):
            names += [f"{original[1]}.{original[2]}"] if original[2] else []
            names += [original[1]]
        if original := UPLOAD.fullmatch(path.name):
            names += [original[1], PurePosixPath(original[1]).stem]
        return tuple(dict.fromkeys([*names[:3], path.stem, *names[3:]]))

    @property
    def folders(self) -> tuple[Path, ...]:
        """The folders where its file may be, best first: next to the file of detections."""
        if self.folder is None:
            return ()
        parts = self.folder.absolute().parts
        same_set = [
            Path(*parts[:number], FOLDERS[part], *parts[number + 1 :])
            for number, part in enumerate(parts)
            if part in FOLDERS
        ]
        return (self.folder, *same_set[::-1], self.folder / "images", self.folder.parent / "images")


def box_of(
    label: object, corners: Iterable[Any], where: str, *, score: object = 1.0, whole: bool = True
) -> Box:
    """Return a box, with a fault that names the place `where` if it is invalid.

    A box without a score has the score NaN and a fault, which is for files with other scores.
    """
    try:
        left, top, right, bottom = (float(corner) for corner in corners)
        empty = str(score).strip().casefold() in NO_SCORE
        value = math.nan if empty else float(str(score))
    except INVALID:
        left = top = right = bottom = value = math.nan
    numbers = left, top, right, bottom
    if any(map(math.isnan, numbers)):
        return faulty_box(f"{where} {NO_NUMBER}")
    in_range = all(abs(number) <= MOST_PIXELS for number in numbers)
    if not in_range or right <= left or bottom <= top:
        return faulty_box(f"{where} has the box {numbers}, not four numbers with sides above 0")
    if empty:
        fault = f"{where} has no score, which others have"
        return Box(label=str(label), corners=numbers, score=value, whole=whole, fault=fault)
    if not 0 <= value <= 1:
        return faulty_box(f"{where} has the score {value:g}, not a number from 0 to 1")
    return Box(label=str(label), corners=numbers, score=value, whole=whole)


def faulty_box(fault: str) -> Box:
    """Return a box that cannot be used."""
    return Box(label="", corners=(0.0, 0.0, 0.0, 0.0), fault=fault)


def scored(pictures: Sequence[AnnotatedPicture]) -> list[AnnotatedPicture]:
    """Return the pictures of a file; if it has no scores, those of all boxes are 1."""
    if any(not box.fault for picture in pictures for box in picture.boxes):
        return [*pictures]
    return [
        replace(
            picture,
            boxes=tuple(
                replace(box, score=1.0, fault="") if math.isnan(box.score) else box
                for box in picture.boxes
            ),
        )
        for picture in pictures
    ]


def same_shape(first: tuple[float, float], second: tuple[float, float]) -> bool:
    """Return whether two pictures have the same ratio of sides, as one may be a smaller copy."""
    return math.isclose(first[0] * second[1], first[1] * second[0], rel_tol=SAME_SHAPE)


def size_of(width: Any, height: Any) -> tuple[int, int] | None:  # noqa: ANN401 - any JSON
    """Return width and height in pixels; None if they are missing or 0."""
    wide, high = round(float(width or 0)), round(float(height or 0))
    return (wide, high) if wide and high else None


def bounds(points: Iterable[Iterable[Any]]) -> Corners:
    """Return the corners of the box around points (column, row); NaN if they are not points."""
    try:
        columns, rows = zip(*((float(x), float(y)) for x, y in points), strict=True)
    except INVALID:
        return NO_CORNERS
    return min(columns), min(rows), max(columns), max(rows)


def read_boxes(
    shapes: Iterable[_Shape], read: Callable[[_Shape, str], Box | None], where: str
) -> tuple[tuple[Box, ...], int]:
    """Return the boxes that a function reads from shapes, and the number of shapes without one.

    The function is given a shape and its place for messages, and returns None for points and
    lines. A shape that it cannot read becomes a box with a fault.
    """
    boxes, others = [], 0
    for number, shape in enumerate(shapes, start=1):
        place = f"{where} {number}"
        try:
            box = read(shape, place)
        except KeyError as error:
            box = faulty_box(f"{place} lacks {error}")
        except INVALID as error:
            own = isinstance(error, InputError)
            fault = str(error).rstrip(".") if own else f"{place} {NO_NUMBER}"
            box = faulty_box(fault)
        if box is None:
            others += 1
        else:
            boxes.append(box)
    return tuple(boxes), others


def corners_of(read: Callable[[_Shape], _Corners], shape: _Shape) -> _Corners | Corners:
    """Return the corners that a function reads from a shape; NaN if it cannot be read."""
    try:
        return read(shape)
    except INVALID:
        return NO_CORNERS


def upright(corners: Corners, turn: int, size: tuple[int, int]) -> Corners:
    """Return a box of a picture of a size in the picture that is turned by 90 or 270 degrees."""
    left, top, right, bottom = corners
    wide, high = size
    if turn == 90:  # noqa: PLR2004 - degrees clockwise
        return high - bottom, left, high - top, right
    return top, wide - right, bottom, wide - left


def turned(corners: Corners, degrees: float, about: tuple[float, float]) -> Corners:
    """Rotate a box clockwise about a point; return the upright box that encloses it."""
    left, top, right, bottom = corners
    angle = math.radians(degrees)
    cosine, sine = math.cos(angle), math.sin(angle)
    return bounds(
        (
            about[0] + (x - about[0]) * cosine - (y - about[1]) * sine,
            about[1] + (x - about[0]) * sine + (y - about[1]) * cosine,
        )
        for x, y in ((left, top), (right, top), (right, bottom), (left, bottom))
    )
