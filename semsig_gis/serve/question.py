"""Questions of the workbench page: photos with marks, and views composed on a compass."""

from __future__ import annotations

import json
import math
import shlex
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from semsig_gis.core import FULL_TURN, InputError, UnknownNameError, nearest_name, wrap_degrees
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
"""Indices of a view of the page, of a photo in this view, and of a mark in this photo."""

STEP_ERROR = 0.2
"""Relative standard deviation of the length of a step without a stated error."""
MOST_TOP, MOST_PHOTOS, MOST_MARKS = 100, 20, 200
DEFAULT_TOP = 10  # of `semsig localize`
POINT_LENGTH, BOX_LENGTH = 2, 4


@dataclass(frozen=True, eq=False, kw_only=True)
class Question:
    """Views from one or several places, and the options of their answer.

    `views` holds one view per place, `marks` the mark of each of its objects, and `legs` the ways
    between the places; `place_number` is the place to localize. No more objects of the classes with
    the codes `absent` are visible from the first place; it is `near` a known place, given in the
    words of `semsig localize`. A `quick` answer uses only the cells.
    """

    views: tuple[View, ...]
    marks: tuple[tuple[MarkNumber, ...], ...]
    legs: tuple[Leg, ...]
    place_number: int
    top: int
    seen_from: SeenFrom
    noise: object
    truth: tuple[float, float] | None
    absent: tuple[int, ...] = ()
    near: str | None = None
    quick: bool = False

    @classmethod
    def parse(cls, value: object, *, taxonomy: Taxonomy, radius: float) -> Question:
        """Parse the JSON of a page; InputError or UnknownNameError if it is not a question."""
        body = _mapping(value, "the question")
        rows = mappings(body.get("views"), "views", most=MOST_PHOTOS)
        places: list[list[tuple[View, list[MarkNumber]]]] = []
        steps: list[Leg] = []
        place_of_view: list[int] = []
        for index, row in enumerate(rows):
            # A view with a step is from a new place, others join the place before.
            step = row.get("step")
            if index and step is not None:
                steps.append(_leg(_mapping(step, "a step")))
            if not index or step is not None:
                places.append([])
            places[-1] += _photos(row, index, taxonomy, radius)
            place_of_view.append(len(places) - 1)
        if not any(places):
            raise InputError("nothing is marked yet; mark an object that you see.")
        views, marks = zip(*(_merged_view(photos) for photos in places if photos), strict=True)
        legs, place_numbers = _legs(places, steps)
        last = len(rows) - 1
        view = _whole(body.get("view", last), "view", most=last)
        seen_from = body.get("seen_from", "anywhere")
        if seen_from not in get_args(SeenFrom):
            raise UnknownNameError(f"seen_from was given as {seen_from!r}; give cells or anywhere.")
        truth = body.get("truth")
        return cls(
            views=views,
            marks=marks,
            legs=legs,
            place_number=place_numbers[place_of_view[view]],
            top=_whole(body.get("top", DEFAULT_TOP), "top", least=1, most=MOST_TOP),
            seen_from=seen_from,
            noise=body.get("noise"),
            truth=None if truth is None else latlon(truth),
            absent=_absent_codes(body.get("absent") or [], taxonomy),
            near=_near_text(body.get("near")),
            quick=body.get("quick") is True,
        )

    def rows(self, taxonomy: Taxonomy) -> list[dict[str, Any]]:
        """Return the views as rows of JSON lines for `semsig localize --queries`."""
        rows = [dict[str, Any](view.to_dict(taxonomy)) for view in self.views]
        for row, leg in zip(rows[1:], self.legs, strict=True):
            row |= {"dx": leg.dx, "dy": leg.dy, "sigma": leg.sigma}
        return rows

    def command(self, taxonomy: Taxonomy, *, options: Sequence[str]) -> str:
        """Return the command line with the same answer; `options` name the database."""
        rows = self.rows(taxonomy)
        words = ["semsig", "localize" if len(rows) == 1 else "route", *options]
        words += ["--on-grid"] if self.seen_from == "cells" else []
        words += [] if self.near is None else ["--near", self.near]
        words += ["--top", str(self.top)] if self.top != DEFAULT_TOP else []
        absent = ", ".join(f"no {taxonomy.by_code(code).title.lower()}" for code in self.absent)
        view_options = _command_options(rows[0]) if len(rows) == 1 else None
        if view_options is not None:
            return shlex.join([*words, *([absent] if absent else []), *view_options])
        # Other views have no options of their own: pipe them as JSON lines.
        lines = shlex.join(["printf", "%s\\n", *map(json.dumps, rows)])
        words += ["--queries", "-"] if len(rows) == 1 else ["-", "--json"]
        return f"{lines} | {shlex.join(words)}" + (f"  # without: {absent}" if absent else "")


def latlon(value: object) -> tuple[float, float]:
    """Return a checked latitude and longitude."""
    if not (isinstance(value, list) and len(value) == POINT_LENGTH):
        raise InputError(f"a place was given as {value!r}; give latitude and longitude.")
    return number(value[0], "a latitude", most=90.0), number(value[1], "a longitude", most=360.0)


def _near_text(value: object) -> str | None:
    """Convert [latitude, longitude, metres] to text for ``--near``, such as ``48.9N,2.3E,50``."""
    if value is None:
        return None
    if not (isinstance(value, list) and len(value) == POINT_LENGTH + 1):
        raise InputError(f"near was given as {value!r}; give latitude, longitude and metres.")
    lat, lon = latlon(value[:POINT_LENGTH])
    metres = number(value[POINT_LENGTH], "the deviation of a place")
    return (
        f"{abs(lat):.10g}{'S' if lat < 0 else 'N'},{abs(lon):.10g}{'W' if lon < 0 else 'E'},"
        f"{metres:g}"
    )


def number(value: object, what: str, *, most: float = math.inf) -> float:
    """Return a finite number from -most to most; InputError for any other value."""
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or not math.isfinite(value)
        or abs(value) > most
    ):
        limit = "" if math.isinf(most) else f" from {-most:g} to {most:g}"
        raise InputError(f"{what} was given as {value!r}; give a number{limit}.")
    return float(value)


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
    """Return each photo of a view that has marks, and the numbers of the marks by object."""
    items = [row] if "compass" in row else mappings(row.get("photos"), "photos", most=MOST_PHOTOS)
    photos = []
    for index, photo in enumerate(items):
        name = "compass" if "compass" in photo else "marks"
        marks = mappings(photo.get(name), name, most=MOST_MARKS)
        if not marks:
            continue
        if name == "compass":
            detections = [{**mark, "range": mark.get("range")} for mark in marks]
            look = {"sectors": photo.get("sectors") or []}
            bearings = [number(mark.get("bearing"), "a bearing", most=360.0) for mark in marks]
        else:
            # Bearings of marks are relative to the middle of the photo, which looks at the heading.
            heading = photo.get("heading")
            middle = 0.0 if heading is None else number(heading, "a heading", most=360.0)
            camera = camera_of(photo)
            detections = _detections(camera, marks, taxonomy)
            for detection in detections:
                turned = float(wrap_degrees(middle + detection.pop("offset")))
                detection["bearing"] = round(turned, DEGREE_DIGITS) % FULL_TURN
            edges = [(low + middle, high + middle) for low, high in camera.sectors()]
            full_turn = sum(high - low for low, high in edges) >= FULL_TURN
            look = {"sectors": [] if full_turn else [[low, high] for low, high in edges]}
            bearings = [detection["bearing"] for detection in detections]
        error = photo.get("heading_error")
        if name == "marks" and photo.get("heading") is None:
            error = "unknown"
        if error is not None:
            look["heading_error"] = error
        view_of_photo = parse_view(
            {"detections": detections, **look}, taxonomy=taxonomy, radius=radius
        )
        # The order in which the view sorts its objects.
        order = np.argsort(wrap_degrees(np.array(bearings)), kind="stable").tolist()
        photos.append((view_of_photo, [(view, index, mark) for mark in order]))
    return photos


def _detections(
    camera: Camera, marks: Sequence[Mapping[str, Any]], taxonomy: Taxonomy
) -> list[dict[str, Any]]:
    """Return the class, the offset from the middle in degrees and the range of marks in a photo."""
    corners, heights = [], []
    for mark in marks:
        box = mark.get("box")
        if box is None:
            box = [mark.get("x"), mark.get("y")] * 2
        if not (isinstance(box, list) and len(box) == BOX_LENGTH):
            raise InputError(
                f"a box was given as {box!r}; give left, top, right and bottom in pixels."
            )
        corners.append([number(side, "a mark", most=1e6) for side in box])
        heights.append(_height(mark, taxonomy))
    # A box may be drawn from any corner, and beyond the edge of the photo.
    edges = np.array(corners).reshape(-1, BOX_LENGTH)
    edges = np.concatenate(
        [np.minimum(edges[:, :2], edges[:, 2:]), np.maximum(edges[:, :2], edges[:, 2:])], axis=1
    )
    edges = np.clip(edges, 0.0, [camera.width, camera.height] * 2)
    sizes = np.array(heights).reshape(-1, 2)
    offsets, ranges, errors = locate_boxes(
        camera, edges, heights=sizes, whole=~np.isnan(sizes[:, 0])
    )
    detections = []
    columns = marks, offsets.tolist(), ranges.tolist(), errors.tolist()
    for mark, offset, metres, error in zip(*columns, strict=True):
        detection: dict[str, Any] = {"class": mark.get("class", "?"), "offset": offset}
        # The range of a mark overrides the one computed from its box.
        if mark.get("range") is not None:
            detection |= {"range": mark["range"], "range_error": mark.get("range_error")}
        elif math.isnan(metres):
            detection["range"] = None
        else:
            detection["range"] = round(metres, METRE_DIGITS)
            detection["range_error"] = round(error, ERROR_DIGITS)
        detections.append(detection)
    return detections


def _height(mark: Mapping[str, Any], taxonomy: Taxonomy) -> tuple[float, float]:
    """Return height and deviation of the class of a box, NaN if its range needs none."""
    if mark.get("box") is None or mark.get("range") is not None:
        return math.nan, math.nan
    item = next((item for item in taxonomy.classes if item.name == mark.get("class")), None)
    if item is None or item.height_m is None or item.height_sigma is None:
        return math.nan, math.nan
    return item.height_m, item.height_sigma


def _legs(
    places: Sequence[Sequence[object]], steps: Sequence[Leg]
) -> tuple[tuple[Leg, ...], list[int]]:
    """Return the legs between the places with marks, and for each place the number of its view.

    Steps over a place without marks are added up, and the place gets the number of the one before.
    """
    legs, numbers = list[Leg](), list[int]()
    count, dx, dy, variance = 0, 0.0, 0.0, 0.0
    for photos, step in zip(places, (Leg(dx=0.0, dy=0.0), *steps), strict=True):
        dx, dy, variance = dx + step.dx, dy + step.dy, variance + step.sigma**2
        if photos:
            if count:
                legs.append(Leg(dx=dx, dy=dy, sigma=math.sqrt(variance)))
            count, dx, dy, variance = count + 1, 0.0, 0.0, 0.0
        numbers.append(max(count - 1, 0))
    return tuple(legs), numbers


def _merged_view(
    photos: Sequence[tuple[View, list[MarkNumber]]],
) -> tuple[View, tuple[MarkNumber, ...]]:
    """Return the photos of one place as one view, and the marks by object."""
    if len(photos) == 1:
        return photos[0][0], tuple(photos[0][1])
    view = View.joined([view for view, _ in photos])
    marks = [mark for _, photo_marks in photos for mark in photo_marks]
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


def _command_options(row: Mapping[str, Any]) -> list[str] | None:
    """Return a view as options of `semsig localize`, None if no options exist for it."""
    if {"range_errors", "scores", "photos"} & row.keys():
        return None
    bearings = ",".join(f"{bearing:g}" for bearing in row["bearings"])
    words = ["--types", row["types"], "--bearings", bearings]
    if "ranges" in row:
        ranges = ("?" if metres is None else f"{metres:g}" for metres in row["ranges"])
        words += ["--ranges", ",".join(ranges)]
    if "sectors" in row:
        words += ["--sectors", ",".join(f"{low:.10g}-{high:.10g}" for low, high in row["sectors"])]
    if "heading_error" in row:
        words += ["--heading", str(row["heading_error"] or "known")]
    return words


def _absent_codes(names: object, taxonomy: Taxonomy) -> tuple[int, ...]:
    """Return the class codes of a list of class names."""
    codes = {item.name: item.code for item in taxonomy.classes}
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError(
            f"absent was given as {str(names)[:60]!r}; give a list of names of classes."
        )
    for name in names:
        if name not in codes:
            raise UnknownNameError(
                f"{name!r} is not a class of this city{nearest_name(name, codes)}."
            )
    return tuple(dict.fromkeys(codes[name] for name in names))


def _mapping(value: object, what: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise InputError(
            f"{what} was given as {str(value)[:60]!r}; give a mapping of names to values."
        )
    return value


def _whole(value: object, what: str, *, least: int = 0, most: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        raise InputError(
            f"{what} was given as {value!r}; give a whole number from {least} to {most:,}."
        )
    return value
