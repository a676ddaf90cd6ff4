"""Pictures with the boxes that a detector or a person drew in them, from files of any format."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

from semsig_gis.core import InputError
from semsig_gis.observation.detectors.camera import MOST_PIXELS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from semsig_gis.observation.detectors.camera import Projection

Corners = tuple[float, float, float, float]
"""Left, top, right and bottom."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """An object in a picture: its label, its corners, and how sure a detector is of it.

    `whole` is false where it is said that a part of the object is hidden.
    """

    label: str
    corners: Corners
    score: float = 1.0
    whole: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """What is known of how and where a picture was taken; None where it is not.

    `focal` is the focal length in lengths of the picture's longer side, `position` are latitude and
    longitude, `time` is when it was, with its zone (ISO 8601), `north` says what the heading counts
    from, and pictures of one `place` are one view.
    """

    camera: Projection | None = None
    fov: float | None = None
    focal: float | None = None
    heading: float | None = None
    heading_error: float | None = None
    north: str | None = None
    pitch: float | None = None
    roll: float | None = None
    size: tuple[int, int] | None = None
    position: tuple[float, float] | None = None
    time: str | None = None
    place: str | None = None

    def filled(self, other: Shot) -> Shot:
        """Return the same, with what is not known here taken from another.

        A field of view here goes before a focal length there; the error and the north of a heading
        are those of whoever says the heading.
        """
        known = {one.name: getattr(self, one.name) for one in fields(self)}
        fixed = {"focal"} if self.fov is not None else set()
        if self.heading is not None:
            fixed |= {"heading_error", "north"}
        more = {
            name: getattr(other, name)
            for name, value in known.items()
            if value is None and name not in fixed
        }
        return replace(self, **more)


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A picture: its name, its boxes, and what its file says of how it was taken.

    With `shares`, corners are shares of its width and height, else pixels. `others` counts shapes
    that are no boxes, such as points.
    """

    name: str
    boxes: tuple[Box, ...]
    shares: bool = False
    others: int = 0
    shot: Shot = field(default_factory=Shot)


def box_of(
    label: object, corners: Iterable[Any], where: str, *, score: object = None, whole: bool = True
) -> Box:
    """Return a checked box; InputError says where the wrong one stands."""
    try:
        left, top, right, bottom = (float(value) for value in corners)
        sure = 1.0 if score is None else float(str(score))
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{where} has a box or a score that is not a number; correct it or take it out."
        ) from error
    numbers = left, top, right, bottom
    near = all(abs(number) <= MOST_PIXELS for number in numbers)  # false for NaN
    if not near or right < left or bottom < top:
        raise InputError(
            f"{where} has the box {numbers}; give four numbers, none of its sides below 0."
        )
    if not 0 <= sure <= 1:
        raise InputError(f"{where} has the score {sure:g}; give a number from 0 to 1.")
    return Box(label=str(label), corners=numbers, score=sure, whole=whole)


def bounds(points: Iterable[Iterable[Any]]) -> Corners:
    """Return the corners of the box around points, each of a column and a row."""
    columns, rows = zip(*((float(x), float(y)) for x, y in points), strict=True)
    return min(columns), min(rows), max(columns), max(rows)


def turned(corners: Corners, degrees: float, about: tuple[float, float]) -> Corners:
    """Return the box around one that is turned clockwise about a point."""
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
