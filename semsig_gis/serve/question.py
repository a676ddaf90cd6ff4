"""Questions of the workbench page: photos with marks, and views composed on a compass."""

from __future__ import annotations

import json
import math
import shlex
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from semsig_gis.commands import Localize, Route, command_line
from semsig_gis.core import (
    FULL_TURN,
    MOST_METRES,
    MOST_SEED,
    Accepts,
    FileTable,
    InputError,
    UnknownNameError,
    file_key,
    length,
    nearest_name,
    number,
    read_table,
    wrap_degrees,
)
from semsig_gis.evaluation import SeenFrom  # noqa: TC001 - of fields
from semsig_gis.observation import (
    DEGREE_DIGITS,
    ERROR_DIGITS,
    METRE_DIGITS,
    PANORAMAS,
    POSSIBLE_FOV,
    USUAL_FOV,
    Camera,
    Leg,
    View,
    locate_boxes,
    parse_view,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Taxonomy

MarkNumber = tuple[int, int, int]
"""Indices of a view of the page, of a photo in this view, and of a mark in this photo."""

_MarkedPhoto = tuple[View, tuple[MarkNumber, ...], float]
"""A photo, the mark of each of its objects, and its weight (see `Camera.log_scale`)."""

MIDDLE_FOV = POSSIBLE_FOV[len(POSSIBLE_FOV) // 2]
STEP_ERROR = 0.2
"""Relative standard deviation of the length of a step without a stated error."""
MOST_TOP, MOST_PHOTOS, MOST_MARKS, MOST_TEXT = 100, 20, 200, 200
DEFAULT_TOP = 10  # of `semsig localize`
BOX_LENGTH = 4
MOST_PIXELS = 1_000_000

_Lat = Annotated[float, number("a latitude from -90 to 90", -90, 90)]
_Lon = Annotated[float, number("a longitude from -360 to 360", -360, 360)]
_Degrees = Annotated[float, number("degrees from -360 to 360", -FULL_TURN, FULL_TURN)]
_Metres = Annotated[
    float,
    number(f"metres from {-MOST_METRES:,} to {MOST_METRES:,}", -MOST_METRES, MOST_METRES),
]
_Pixel = Annotated[
    float,
    number(f"pixels from {-MOST_PIXELS:,} to {MOST_PIXELS:,}", -MOST_PIXELS, MOST_PIXELS),
]
_Side = Annotated[
    int, number(f"a whole number from 1 to {MOST_PIXELS:,}", 1, MOST_PIXELS, whole=True)
]
_Fov = Annotated[float, number("a field of view of up to 360 degrees", -FULL_TURN, FULL_TURN)]
_Box = Annotated[
    tuple[_Pixel, _Pixel, _Pixel, _Pixel],
    Accepts(f"left, top, right and bottom of a box in pixels, up to {MOST_PIXELS:,}"),
]
_Text = Annotated[str, length(0, MOST_TEXT), Accepts(f"text of up to {MOST_TEXT} letters")]
LatLon = Annotated[
    tuple[_Lat, _Lon],
    Accepts("latitude and longitude in degrees, from -90 to 90 and from -360 to 360"),
]


class _Seen(FileTable, extra="ignore"):
    """The class or family, the text and the range of a marked object; `parse_view` checks them."""

    kind: Annotated[Any, file_key("class")]
    text: _Text | None = None
    range: Any = None
    range_error: Any = None


class _CompassMark(_Seen):
    bearing: _Degrees


class _PhotoMark(_Seen):
    kind: Annotated[Any, file_key("class")] = "?"
    x: _Pixel | None = None
    y: _Pixel | None = None
    box: _Box | None = None


class PagePhoto(FileTable, extra="ignore"):
    """A photo of the page; only one with marks needs a size. Without `fov` it is unknown."""

    name: str | None = None
    width: _Side | None = None
    height: _Side | None = None
    fov: _Fov | None = None
    projection: Any = None
    horizon: _Pixel | None = None
    heading: _Degrees | None = None
    heading_error: Any = None
    marks: Annotated[tuple[_PhotoMark, ...], length(0, MOST_MARKS)] = ()

    def camera(self, unknown_fov: float) -> Camera:
        """Return the camera, with another field of view if its own is unknown.

        InputError if its size is missing or its field of view does not fit.
        """
        if self.width is None or self.height is None:
            raise InputError("the width or height of a photo is missing; give pixels.")
        projection: Any = self.projection or "pinhole"
        fov = USUAL_FOV.get(str(projection), unknown_fov) if self.fov is None else self.fov
        return Camera(
            width=self.width,
            height=self.height,
            fov=fov,
            projection=projection,
            horizon=self.horizon if str(projection) in PANORAMAS else None,
        )

    @property
    def fov_unknown(self) -> bool:
        """Whether it has marks, and no field of view."""
        return bool(self.marks) and self.fov is None and self.projection in (None, "pinhole")


class _Step(FileTable, extra="ignore"):
    bearing: _Degrees
    metres: _Metres
    sigma: _Metres | None = None


class _PageView(FileTable, extra="ignore"):
    photos: Annotated[tuple[PagePhoto, ...], length(0, MOST_PHOTOS)] = ()
    compass: Annotated[tuple[_CompassMark, ...], length(0, MOST_MARKS)] | None = None
    sectors: Any = None
    heading_error: Any = None
    step: _Step | None = None


class PagePlace(FileTable, extra="ignore"):
    """A request about a place."""

    place: LatLon


class PageSimulation(PagePlace):
    """A request for a simulated view, of the full turn or of a photo."""

    fov: _Fov | None = None
    heading: _Degrees | None = None
    noise: Any = None
    seed: Annotated[int, number("a whole number from 0 to 10**18", 0, MOST_SEED, whole=True)] = 0


class PageBoxes(FileTable, extra="ignore"):
    """The content of a file of detections, and the photos to which they may belong."""

    text: str | None = None
    name: str | None = None
    classes: str | None = None
    labels: tuple[str, ...] | None = None
    photos: tuple[PagePhoto, ...] = ()


class _PageQuestion(FileTable, extra="ignore"):
    views: Annotated[tuple[_PageView, ...], length(0, MOST_PHOTOS)]
    view: Annotated[int, number("the number of a view", 0, whole=True)] | None = None
    top: Annotated[int, number(f"a whole number from 1 to {MOST_TOP}", 1, MOST_TOP, whole=True)] = (
        DEFAULT_TOP
    )
    seen_from: SeenFrom = "anywhere"
    noise: Any = None
    truth: LatLon | None = None
    absent: Annotated[tuple[str, ...], Accepts("a list of names of classes")] | None = None
    near: (
        Annotated[
            tuple[_Lat, _Lon, _Metres],
            Accepts(
                "latitude from -90 to 90, longitude from -360 to 360, and metres up to "
                f"{MOST_METRES:,}"
            ),
        ]
        | None
    ) = None
    quick: Any = False  # any other value than True is False


@dataclass(frozen=True, eq=False, kw_only=True)
class Question:
    """Views from one or several places, and the options of their answer.

    `versions` holds, for each field of view that photos of an unknown one may have (`fovs`, empty
    if there are none), one view per place, `marks` likewise the mark of each object of a view, and
    `log_weights` the weight of each view (see `Camera.log_scale`). `legs` are the ways between the
    places; `place_number` is the place to localize. No more objects of the classes with
    the codes `absent` are visible from the first place; it is `near` a known place, given in the
    words of `semsig localize`. A `quick` answer uses only the cells.
    """

    versions: tuple[tuple[View, ...], ...]
    marks: tuple[tuple[tuple[MarkNumber, ...], ...], ...]
    log_weights: tuple[tuple[float, ...], ...]
    fovs: tuple[float, ...]
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
        page = read_table(_PageQuestion, value, "the question", error=InputError)
        unknown = any(photo.fov_unknown for row in page.views for photo in row.photos)
        fovs = POSSIBLE_FOV if unknown else ()
        versions = [_places(page.views, taxonomy, radius, fov) for fov in fovs or (MIDDLE_FOV,)]
        places = versions[0]
        # A view with a step is from a new place, others join the place before.
        new = [bool(index and row.step is not None) for index, row in enumerate(page.views)]
        steps = [_leg(row.step) for row in page.views[1:] if row.step is not None]
        place_of_view = np.cumsum(new).tolist()
        if not any(places):
            raise InputError("nothing is marked yet; mark an object that you see.")
        merged = [[_merged_view(photos) for photos in version if photos] for version in versions]
        legs, place_numbers = _legs(places, steps)
        last = len(page.views) - 1
        view = last if page.view is None else page.view
        if view > last:
            raise InputError(f"view {view} is not there; give a number from 0 to {last}.")
        return cls(
            versions=tuple(tuple(view for view, _, _ in version) for version in merged),
            marks=tuple(tuple(marks for _, marks, _ in version) for version in merged),
            log_weights=tuple(tuple(weight for _, _, weight in version) for version in merged),
            fovs=fovs,
            legs=legs,
            place_number=place_numbers[place_of_view[view]],
            top=page.top,
            seen_from=page.seen_from,
            noise=page.noise,
            truth=page.truth,
            absent=_absent_codes(page.absent or (), taxonomy),
            near=None if page.near is None else _near_text(*page.near),
            quick=page.quick is True,
        )

    def rows(self, taxonomy: Taxonomy, version: int = 0) -> list[dict[str, Any]]:
        """Return the views of a version as rows of JSON lines for `semsig localize --queries`."""
        rows = [dict[str, Any](view.to_dict(taxonomy)) for view in self.versions[version]]
        for row, leg in zip(rows[1:], self.legs, strict=True):
            row |= {"dx": leg.dx, "dy": leg.dy, "sigma": leg.sigma}
        return rows

    def command(self, taxonomy: Taxonomy, version: int = 0, **options: Any) -> str:  # noqa: ANN401 - any fields
        """Return the command line with the same answer; `options` are the database and others.

        Of an unknown field of view, it is the command for one version, with a remark.
        """
        rows = self.rows(taxonomy, version)
        options |= {"on_grid": self.seen_from == "cells", "near": self.near, "top": self.top}
        remark = f"  # if the field of view is {self.fovs[version]:g} degrees" if self.fovs else ""
        absent = ", ".join(f"no {taxonomy.by_code(code).title.lower()}" for code in self.absent)
        view_options = _view_options(rows[0]) if len(rows) == 1 else None
        if view_options is not None:
            words = command_line(Localize(**options, seen=absent or None, **view_options))
            return words + remark
        # Other views have no options of their own: pipe them as JSON lines.
        lines = shlex.join(["printf", "%s\\n", *map(json.dumps, rows)])
        if len(rows) == 1:
            words = command_line(Localize(**options, queries="-"))
        else:
            words = f"{command_line(Route(**options, views='-'))} --json"
        return f"{lines} | {words}{remark}" + (f"  # without: {absent}" if absent else "")


def _near_text(lat: float, lon: float, metres: float) -> str:
    """Return a known place as text for ``--near``, such as ``48.9N,2.3E,50``."""
    return (
        f"{abs(lat):.10g}{'S' if lat < 0 else 'N'},{abs(lon):.10g}{'W' if lon < 0 else 'E'},"
        f"{metres:g}"
    )


def _places(
    rows: Sequence[_PageView], taxonomy: Taxonomy, radius: float, fov: float
) -> list[list[_MarkedPhoto]]:
    """Return the photos with marks of each place, with a field of view if theirs is unknown."""
    places: list[list[_MarkedPhoto]] = []
    for index, row in enumerate(rows):
        if not index or row.step is not None:
            places.append([])
        places[-1] += _photos(row, index, taxonomy, radius, fov)
    return places


def _photos(
    row: _PageView, view: int, taxonomy: Taxonomy, radius: float, fov: float
) -> list[_MarkedPhoto]:
    """Return each photo of a view that has marks."""
    photos = []
    items: tuple[_PageView | PagePhoto, ...] = row.photos if row.compass is None else (row,)
    for index, photo in enumerate(items):
        detections: list[dict[str, Any]]
        weight = 0.0
        if isinstance(photo, _PageView):
            error = photo.heading_error
            detections = [mark.model_dump(by_alias=True) for mark in photo.compass or ()]
            look = {"sectors": photo.sectors or []}
        elif photo.marks:
            # Bearings of marks are relative to the middle of the photo, which looks at the heading.
            middle = photo.heading or 0.0
            error = "unknown" if photo.heading is None else photo.heading_error
            camera = photo.camera(fov)
            detections = _detections(camera, photo.marks, taxonomy)
            if photo.fov_unknown:
                weight = camera.log_scale([detection["offset"] for detection in detections])
            for detection in detections:
                turned = float(wrap_degrees(middle + detection.pop("offset")))
                detection["bearing"] = round(turned, DEGREE_DIGITS) % FULL_TURN
            edges = [(low + middle, high + middle) for low, high in camera.sectors()]
            full_turn = sum(high - low for low, high in edges) >= FULL_TURN
            look = {"sectors": [] if full_turn else [[low, high] for low, high in edges]}
        else:
            continue
        if not detections:
            continue
        if error is not None:
            look["heading_error"] = error
        view_of_photo = parse_view(
            {"detections": detections, **look}, taxonomy=taxonomy, radius=radius
        )
        # The order in which the view sorts its objects.
        bearings = np.array([detection["bearing"] for detection in detections], np.float64)
        order = np.argsort(wrap_degrees(bearings), kind="stable").tolist()
        numbers = tuple((view, index, mark) for mark in order)
        photos.append((view_of_photo, numbers, weight))
    return photos


def _detections(
    camera: Camera, marks: Sequence[_PhotoMark], taxonomy: Taxonomy
) -> list[dict[str, Any]]:
    """Return the class, the offset from the middle in degrees and the range of marks in a photo."""
    corners, heights = [], []
    for mark in marks:
        box = mark.box
        if box is None:
            if mark.x is None or mark.y is None:
                raise InputError("a mark has no place in its photo; give x and y, or a box.")
            box = (mark.x, mark.y, mark.x, mark.y)
        corners.append(box)
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
        detection: dict[str, Any] = {"class": mark.kind, "offset": offset, "range": None}
        detection["text"] = mark.text
        # The range of a mark overrides the one computed from its box.
        if mark.range is not None:
            detection |= {"range": mark.range, "range_error": mark.range_error}
        elif not math.isnan(metres):
            detection["range"] = round(metres, METRE_DIGITS)
            detection["range_error"] = round(error, ERROR_DIGITS)
        detections.append(detection)
    return detections


def _height(mark: _PhotoMark, taxonomy: Taxonomy) -> tuple[float, float]:
    """Return height and deviation of the class of a box, NaN if its range needs none."""
    if mark.box is None or mark.range is not None:
        return math.nan, math.nan
    item = next((item for item in taxonomy.classes if item.name == mark.kind), None)
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


def _merged_view(photos: Sequence[_MarkedPhoto]) -> _MarkedPhoto:
    """Return the photos of one place as one view."""
    if len(photos) == 1:
        return photos[0]
    view = View.joined([view for view, _, _ in photos])
    marks = [mark for _, photo_marks, _ in photos for mark in photo_marks]
    order: NDArray[np.int64] = np.argsort(wrap_degrees(np.asarray(view.bearings)), kind="stable")
    weight = sum(weight for _, _, weight in photos)
    return view.turned(0.0), tuple(marks[row] for row in order.tolist()), weight


def _leg(step: _Step) -> Leg:
    sigma = STEP_ERROR * abs(step.metres) if step.sigma is None else step.sigma
    return Leg.towards(step.bearing, step.metres, sigma=sigma)


def _view_options(row: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return a view as options of `semsig localize`, None if no options exist for it."""
    if {"range_errors", "scores", "photos", "texts"} & row.keys():
        return None
    bearings = ",".join(f"{bearing:g}" for bearing in row["bearings"])
    options = {"types": row["types"], "bearings": bearings}
    if "ranges" in row:
        ranges = ("?" if metres is None else f"{metres:g}" for metres in row["ranges"])
        options["ranges"] = ",".join(ranges)
    if "sectors" in row:
        options["sectors"] = ",".join(f"{low:.10g}-{high:.10g}" for low, high in row["sectors"])
    if "heading_error" in row:
        options["heading"] = str(row["heading_error"] or "known")
    return options


def _absent_codes(names: Sequence[str], taxonomy: Taxonomy) -> tuple[int, ...]:
    """Return the class codes of names of classes."""
    codes = {item.name: item.code for item in taxonomy.classes}
    for name in names:
        if name not in codes:
            raise UnknownNameError(
                f"{name!r} is not a class of this city{nearest_name(name, codes)}."
            )
    return tuple(dict.fromkeys(codes[name] for name in names))
