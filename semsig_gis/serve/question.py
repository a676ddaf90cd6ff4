"""What the page of the workbench asks: photos with marks, and views composed by hand."""

from __future__ import annotations

import json
import math
import shlex
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from semsig_gis.core import InputError, UnknownNameError, nearest_name, wrap_degrees
from semsig_gis.evaluation import SeenFrom
from semsig_gis.observation import (
    DEGREE_DIGITS,
    ERROR_DIGITS,
    METRE_DIGITS,
    Camera,
    Leg,
    View,
    locate_boxes,
    mappings,
    parse_view,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Taxonomy

MarkNumber = tuple[int, int, int]
"""The numbers of a view of the page, of a photo in it, and of a mark in that."""

STEP_ERROR = 0.2
"""Standard deviation of a step that nobody measured, by its length."""
MOST_TOP, MOST_PHOTOS, MOST_MARKS = 100, 20, 200
POINT, BOX = 2, 4


@dataclass(frozen=True, eq=False, kw_only=True)
class Question:
    """Views of one or several places, and how they are to be answered.

    `views` has one view for each place, `marks` which mark each of its objects is, and `legs` the
    ways between the places. `shown` is the place that is asked for. Of the classes that are
    `absent`, by code, none was seen from the first place beside what is marked; that place is
    `near` another, as `semsig localize` takes it. A `quick` answer is by cells alone.
    """

    views: tuple[View, ...]
    marks: tuple[tuple[MarkNumber, ...], ...]
    legs: tuple[Leg, ...]
    shown: int
    top: int
    seen_from: SeenFrom
    noise: object
    truth: tuple[float, float] | None
    absent: tuple[int, ...] = ()
    near: str | None = None
    quick: bool = False

    @classmethod
    def parse(cls, told: object, *, taxonomy: Taxonomy, radius: float) -> Question:
        """Read the JSON of a page; InputError or UnknownNameError if it cannot be answered."""
        body = _mapping(told, "the question")
        rows = mappings(body.get("views"), "views", most=MOST_PHOTOS)
        places: list[list[tuple[View, list[MarkNumber]]]] = []
        ways: list[Leg] = []
        own: list[int] = []
        for number, row in enumerate(rows):
            step = row.get("step")
            if number and step is not None:
                ways.append(_leg(_mapping(step, "a step")))
            if not number or step is not None:
                places.append([])
            places[-1] += _photos(row, number, taxonomy, radius)
            own.append(len(places) - 1)
        if not any(places):
            raise InputError("nothing is marked yet; mark an object that you see.")
        views, marks = zip(*(_joined(photos) for photos in places if photos), strict=True)
        legs, kept = _kept(places, ways)
        last = len(rows) - 1
        shown = _whole(body.get("view", last), "view", most=last)
        seen_from = body.get("seen_from", "anywhere")
        if seen_from not in get_args(SeenFrom):
            raise UnknownNameError(f"seen_from was given as {seen_from!r}; give cells or anywhere.")
        truth = body.get("truth")
        return cls(
            views=views,
            marks=marks,
            legs=legs,
            shown=kept[own[shown]],
            top=_whole(body.get("top", 10), "top", least=1, most=MOST_TOP),
            seen_from=seen_from,
            noise=body.get("noise"),
            truth=None if truth is None else degrees(truth),
            absent=_codes(body.get("absent") or [], taxonomy),
            near=_near(body.get("near")),
            quick=body.get("quick") is True,
        )

    def rows(self, taxonomy: Taxonomy) -> list[dict[str, Any]]:
        """Return the views as JSON lines that `semsig localize --queries` reads."""
        rows = [view.to_dict(taxonomy) for view in self.views]
        for row, leg in zip(rows[1:], self.legs, strict=True):
            row |= {"dx": leg.dx, "dy": leg.dy, "sigma": leg.sigma}
        return rows

    def command(self, taxonomy: Taxonomy, *, options: Sequence[str]) -> str:
        """Return the command line that gives the same answer, with options of the database."""
        rows = self.rows(taxonomy)
        words = ["semsig", "localize" if len(rows) == 1 else "route", *options]
        words += ["--on-grid"] if self.seen_from == "cells" else []
        words += [] if self.near is None else ["--near", self.near]
        words += ["--top", str(self.top)] if self.top != 10 else []  # noqa: PLR2004 - its default
        absent = ", ".join(f"no {taxonomy.by_code(code).title.lower()}" for code in self.absent)
        plain = _options(rows[0]) if len(rows) == 1 else None
        if plain is not None:
            return shlex.join([*words, *([absent] if absent else []), *plain])
        lines = shlex.join(["printf", "%s\\n", *map(json.dumps, rows)])
        words += ["--queries", "-"] if len(rows) == 1 else ["-", "--json"]
        return f"{lines} | {shlex.join(words)}" + (f"  # without: {absent}" if absent else "")


def degrees(told: object) -> tuple[float, float]:
    """Return a latitude and a longitude."""
    if not (isinstance(told, list) and len(told) == POINT):
        raise InputError(f"a place was given as {told!r}; give latitude and longitude.")
    return number(told[0], "a latitude", most=90.0), number(told[1], "a longitude", most=360.0)


def _near(told: object) -> str | None:
    """Return a known place, given as latitude, longitude and metres, in words."""
    if told is None:
        return None
    if not (isinstance(told, list) and len(told) == POINT + 1):
        raise InputError(f"near was given as {told!r}; give latitude, longitude and metres.")
    lat, lon = degrees(told[:POINT])
    metres = number(told[POINT], "the deviation of a place")
    return (
        f"{abs(lat):.10g}{'S' if lat < 0 else 'N'},{abs(lon):.10g}{'W' if lon < 0 else 'E'},"
        f"{metres:g}"
    )


def number(told: object, what: str, *, most: float = math.inf) -> float:
    """Return a number that is finite and at most so far from 0; InputError if it is none."""
    plain = isinstance(told, int | float) and not isinstance(told, bool)
    if not plain or not math.isfinite(value := float(told)) or abs(value) > most:  # type: ignore[arg-type]
        limit = "" if math.isinf(most) else f" from {-most:g} to {most:g}"
        raise InputError(f"{what} was given as {told!r}; give a number{limit}.")
    return value


def camera_of(photo: Mapping[str, Any]) -> Camera:
    """Return the camera of a photo of the page."""
    width, height = (
        _whole(photo.get(side), f"the {side} of a photo", least=1, most=1_000_000)
        for side in ("width", "height")
    )
    return Camera(
        width=width,
        height=height,
        fov=number(photo.get("fov"), "the field of view of a photo"),
        projection=photo.get("projection") or "pinhole",
    )


def _photos(
    row: Mapping[str, Any], view: int, taxonomy: Taxonomy, radius: float
) -> list[tuple[View, list[MarkNumber]]]:
    """Return the photos of a view that have marks, and the numbers of these by object."""
    told = [row] if "compass" in row else mappings(row.get("photos"), "photos", most=MOST_PHOTOS)
    photos = []
    for number_, photo in enumerate(told):
        name = "compass" if "compass" in photo else "marks"
        marks = mappings(photo.get(name), name, most=MOST_MARKS)
        if not marks:
            continue
        if name == "compass":
            detections = [{**mark, "range": mark.get("range")} for mark in marks]
            look = {"sectors": photo.get("sectors") or []}
            bearings = [number(mark.get("bearing"), "a bearing", most=360.0) for mark in marks]
        else:
            heading = photo.get("heading")
            middle = 0.0 if heading is None else number(heading, "a heading", most=360.0)
            camera = camera_of(photo)
            detections = _detections(camera, marks, taxonomy)
            for detection in detections:
                turned = float(wrap_degrees(middle + detection.pop("offset")))
                detection["bearing"] = round(turned, DEGREE_DIGITS) % 360.0
            edges = [(low + middle, high + middle) for low, high in camera.sectors()]
            whole = sum(high - low for low, high in edges) >= 360.0  # noqa: PLR2004 - full turn
            look = {"sectors": [] if whole else [[low, high] for low, high in edges]}
            bearings = [detection["bearing"] for detection in detections]
        error = photo.get("heading_error")
        if name == "marks" and photo.get("heading") is None:
            error = "unknown"
        if error is not None:
            look["heading_error"] = error
        seen = parse_view({"detections": detections, **look}, taxonomy=taxonomy, radius=radius)
        # As views sort their objects.
        order = np.argsort(wrap_degrees(np.array(bearings)), kind="stable").tolist()
        photos.append((seen, [(view, number_, mark) for mark in order]))
    return photos


def _detections(
    camera: Camera, marks: Sequence[Mapping[str, Any]], taxonomy: Taxonomy
) -> list[dict[str, Any]]:
    """Return marks in a photo, with their offset from its middle and rough range."""
    corners, heights = [], []
    for mark in marks:
        box = mark.get("box")
        if box is None:
            box = [mark.get("x"), mark.get("y")] * 2
        if not (isinstance(box, list) and len(box) == BOX):
            raise InputError(
                f"a box was given as {box!r}; give left, top, right and bottom in pixels."
            )
        corners.append([number(side, "a mark", most=1e6) for side in box])
        heights.append(_height(mark, taxonomy))
    edges = np.array(corners).reshape(-1, BOX)
    edges = np.concatenate(
        [np.minimum(edges[:, :2], edges[:, 2:]), np.maximum(edges[:, :2], edges[:, 2:])], axis=1
    )
    edges = np.clip(edges, 0.0, [camera.width, camera.height] * 2)
    tall = np.array(heights).reshape(-1, 2)
    offsets, ranges, errors = locate_boxes(camera, edges, heights=tall, whole=~np.isnan(tall[:, 0]))
    return [
        {
            "class": mark.get("class", "?"),
            "offset": float(offset),
            **_range(mark, metres, error),
        }
        for mark, offset, metres, error in zip(
            marks, offsets.tolist(), ranges.tolist(), errors.tolist(), strict=True
        )
    ]


def _height(mark: Mapping[str, Any], taxonomy: Taxonomy) -> tuple[float, float]:
    """Return the height of what a box holds and its deviation, NaN where it is no help."""
    if mark.get("box") is None or mark.get("range") is not None:
        return math.nan, math.nan
    item = next((one for one in taxonomy.classes if one.name == mark.get("class")), None)
    if item is None or item.height_m is None or item.height_sigma is None:
        return math.nan, math.nan
    return item.height_m, item.height_sigma


def _range(mark: Mapping[str, Any], metres: float, error: float) -> dict[str, Any]:
    """Return the range that a mark tells, or that its box does."""
    if mark.get("range") is not None:
        return {"range": mark["range"], "range_error": mark.get("range_error")}
    if math.isnan(metres):
        return {"range": None}
    return {"range": round(metres, METRE_DIGITS), "range_error": round(error, ERROR_DIGITS)}


def _kept(
    places: Sequence[Sequence[object]], ways: Sequence[Leg]
) -> tuple[tuple[Leg, ...], list[int]]:
    """Return the legs between the places that have marks, and of each place which of these it is.

    One without marks is passed on the way, and stands for the one before.
    """
    legs, kept = list[Leg](), list[int]()
    found, dx, dy, variance = 0, 0.0, 0.0, 0.0
    for photos, way in zip(places, (Leg(dx=0.0, dy=0.0), *ways), strict=True):
        dx, dy, variance = dx + way.dx, dy + way.dy, variance + way.sigma**2
        if photos:
            if found:
                legs.append(Leg(dx=dx, dy=dy, sigma=math.sqrt(variance)))
            found, dx, dy, variance = found + 1, 0.0, 0.0, 0.0
        kept.append(max(found - 1, 0))
    return tuple(legs), kept


def _joined(photos: Sequence[tuple[View, list[MarkNumber]]]) -> tuple[View, tuple[MarkNumber, ...]]:
    """Return the photos of one place as one view, and the marks by object."""
    if len(photos) == 1:
        return photos[0][0], tuple(photos[0][1])
    view = View.joined([seen for seen, _ in photos])
    marks = [mark for _, own in photos for mark in own]
    order: NDArray[np.int64] = np.argsort(wrap_degrees(np.asarray(view.bearings)), kind="stable")
    return view.turned(0.0), tuple(marks[row] for row in order.tolist())


def _leg(step: Mapping[str, Any]) -> Leg:
    metres = number(step.get("metres"), "the length of a step")
    error = step.get("sigma")
    return Leg.towards(
        number(step.get("bearing"), "the bearing of a step", most=360.0),
        metres,
        sigma=STEP_ERROR * abs(metres) if error is None else number(error, "the error of a step"),
    )


def _options(row: Mapping[str, Any]) -> list[str] | None:
    """Return a view as options of `semsig localize`, None where these cannot say it."""
    if {"range_errors", "scores", "photos"} & row.keys():
        return None
    words = ["--types", row["types"], "--bearings", ",".join(f"{one:g}" for one in row["bearings"])]
    if "ranges" in row:
        told = ("?" if one is None else f"{one:g}" for one in row["ranges"])
        words += ["--ranges", ",".join(told)]
    if "sectors" in row:
        words += ["--sectors", ",".join(f"{low:.10g}-{high:.10g}" for low, high in row["sectors"])]
    if "heading_error" in row:
        words += ["--heading", str(row["heading_error"] or "known")]
    return words


def _codes(told: object, taxonomy: Taxonomy) -> tuple[int, ...]:
    """Return the codes of some classes, by name."""
    codes = {item.name: item.code for item in taxonomy.classes}
    if not isinstance(told, list) or not all(isinstance(name, str) for name in told):
        raise InputError(
            f"absent was given as {str(told)[:60]!r}; give a list of names of classes."
        )
    for name in told:
        if name not in codes:
            raise UnknownNameError(
                f"{name!r} is not a class of this city{nearest_name(name, codes)}."
            )
    return tuple(dict.fromkeys(codes[name] for name in told))


def _mapping(told: object, what: str) -> Mapping[str, Any]:
    if not isinstance(told, dict):
        raise InputError(
            f"{what} was given as {str(told)[:60]!r}; give a mapping of names to values."
        )
    return told


def _whole(told: object, what: str, *, least: int = 0, most: int) -> int:
    if not isinstance(told, int) or isinstance(told, bool) or not least <= told <= most:
        raise InputError(
            f"{what} was given as {told!r}; give a whole number from {least} to {most:,}."
        )
    return told
