"""Convert pictures with boxes, and data of their cameras, to views."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from semsig_gis.core import (
    FULL_TURN,
    MAX_RANGE_M,
    WILDCARD,
    InputError,
    Taxonomy,
    UnknownNameError,
    require_number,
    wrap_degrees,
)
from semsig_gis.observation.detectors.camera import USUAL_FOV, Camera, Projection
from semsig_gis.observation.detectors.exif import PANORAMAS, read_exif
from semsig_gis.observation.detectors.picture_files import PictureFiles
from semsig_gis.observation.detectors.pictures import ROBOFLOW, Shot, same_shape, upright
from semsig_gis.observation.view import (
    CLASSES,
    LEAST_RANGE_ERROR,
    LEAST_RANGE_M,
    MOST_RANGE_ERROR,
    Photo,
    View,
)
from semsig_gis.sources import built_in_taxonomy
from semsig_gis.storage import read_rows, row_value

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from semsig_gis.observation.detectors.labels import LabelMap, Meaning
    from semsig_gis.observation.detectors.pictures import AnnotatedPicture, Box
    from semsig_gis.storage import Row

Places = Literal["each", "gps", "all"]
"""Pictures of one place: none, pictures within a few metres, or all."""

SAME_PLACE_M = 5.0
METRES_PER_DEGREE = 111_320.0
# A box this near to the edge of the picture is cut off: pixels, and share of the side.
EDGE_PIXELS, EDGE_SHARE = 1.0, 0.002
EDGE_ERROR_PIXELS = 1.0
"""Standard deviation of the height of a box, from both its ends."""

SCORE_DIGITS, DEGREE_DIGITS, METRE_DIGITS, ERROR_DIGITS = 4, 2, 2, 3


@dataclass(slots=True)
class Tally:
    """Counts of the pictures and boxes of files, used and left out."""

    photos: int = 0
    objects: int = 0
    ranges: int = 0
    below_min_score: int = 0
    no_boxes: int = 0
    faulty_boxes: list[str] = field(default_factory=list)
    """Why boxes cannot be used."""
    turned: set[str] = field(default_factory=set)
    """Pictures with boxes that were turned with the picture."""
    stretched: set[str] = field(default_factory=set)
    """Pictures with boxes that were stretched to the picture."""
    several: dict[str, Path] = field(default_factory=dict)
    """The files that were used of pictures with several."""
    no_objects: Counter[str] = field(default_factory=Counter)
    unknown: Counter[str] = field(default_factory=Counter)
    not_in_city: Counter[str] = field(default_factory=Counter)
    unknown_heading: int = 0
    travels: int = 0
    """Number of headings that are directions of travel."""
    north: Counter[str] = field(default_factory=Counter)
    unusable: dict[str, str] = field(default_factory=dict)
    """Why pictures were left out, by name."""
    unread: dict[str, str] = field(default_factory=dict)
    """Why files of pictures were not read, by name, where no data of them was needed."""
    times: dict[str, str] = field(default_factory=dict)
    """Time of the first picture of a view, by the name of the view, if it is known."""

    def to_dict(self) -> dict[str, Any]:
        """Return the counts for JSON."""
        return {
            "photos": self.photos,
            "objects": self.objects,
            "with_range": self.ranges,
            "unknown_heading": self.unknown_heading,
            "headings_from_north": dict(self.north),
            "left_out": {
                "pictures": dict(self.unusable),
                "below_min_score": self.below_min_score,
                "no_boxes": self.no_boxes,
                "faulty_boxes": len(self.faulty_boxes),
                "no_street_objects": dict(self.no_objects),
                "unknown_labels": dict(self.unknown),
                "classes_not_in_city": dict(self.not_in_city),
            },
        }


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class LocatedBoxes:
    """The boxes of a picture with bearings, ranges and classes.

    `corners`, shape (n, 4), are in pixels, `bearings` in degrees clockwise from the camera's axis,
    `ranges` in metres with relative `range_errors`, NaN if unknown, and `scores`, shape (n, 256),
    the probabilities of the class codes.
    """

    camera: Camera
    shot: Shot
    corners: NDArray[np.float64]
    bearings: NDArray[np.float64]
    ranges: NDArray[np.float64]
    range_errors: NDArray[np.float64]
    scores: NDArray[np.float64]

    @property
    def codes(self) -> NDArray[np.uint8]:
        """Code of the likeliest class of each box; `WILDCARD` if no class has a score."""
        by_class = self.scores[:, 1:]
        codes = np.where(by_class.any(axis=1), 1 + by_class.argmax(axis=1), WILDCARD)
        return codes.astype(np.uint8)


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewBuilder:
    """Options to convert pictures with boxes to views.

    Parameters
    ----------
    labels : LabelMap
        The meanings of the labels.
    taxonomy : Taxonomy
        The classes of the city; boxes of others are left out and counted.
    min_score : float, default 0.3
        Boxes with lower scores are left out and counted.
    shot : Shot, optional
        Data of all pictures.
    shots : mapping of str to Shot, optional
        Data of single pictures, by file name.
    folders : sequence of Path or None, optional
        Folders of the pictures, to read their EXIF; None for those near the files of detections.
    """

    labels: LabelMap
    taxonomy: Taxonomy
    min_score: float = 0.3
    shot: Shot = field(default_factory=Shot)
    shots: Mapping[str, Shot] = field(default_factory=dict)
    folders: Sequence[Path] | None = ()
    _files: PictureFiles = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Prepare the search for the files of pictures."""
        object.__setattr__(self, "_files", PictureFiles(self.folders))

    def views(
        self, pictures: Iterable[AnnotatedPicture], *, places: Places = "each"
    ) -> tuple[list[tuple[str, View]], Tally]:
        """Return the view of each place, with the name of its first picture, and the counts.

        Pictures with the same place in `shots` are one view in any case. Pictures that cannot be
        used, as their size or field of view is unknown, are left out and counted. InputError if no
        picture can be used, or `shots` contains none of the pictures.
        """
        pictures = list(pictures)
        if (
            self.shots
            and pictures
            and not self.shots.keys() & {name for picture in pictures for name in picture.names}
        ):
            # Otherwise a table of other pictures would leave every heading unknown.
            raise InputError(
                f"--photos names {next(iter(self.shots))}, but none of the pictures with boxes; "
                f"name them as {pictures[0].name}."
            )
        tally = Tally()
        groups: dict[str, list[View]] = {}
        names: dict[str, str] = {}
        positions: list[tuple[tuple[float, float], str]] = []
        for number, picture in enumerate(pictures):
            try:
                shot = self._shot(picture, tally)
                self._camera(picture, shot)
            except InputError as error:
                tally.unusable[picture.name] = str(error)
                if len(tally.unusable) == len(pictures):
                    raise
                continue
            tally.no_boxes += picture.others
            view = self._view(picture, tally)
            key = f"{number}"
            if shot.place is not None:
                key = f"place {shot.place}"
            elif places == "all":
                key = "all"
            elif places == "gps" and shot.position is not None:
                # The group of the first picture within a few metres, otherwise a new one.
                near = (
                    other
                    for position, other in positions
                    if _metres(position, shot.position) <= SAME_PLACE_M
                )
                key = next(near, key)
                positions += [(shot.position, key)] if key not in groups else []
            if key not in names:
                names[key] = picture.name if shot.place is None else shot.place
                tally.times |= {} if shot.time is None else {names[key]: shot.time}
            groups.setdefault(key, []).append(view)
        _require_objects(tally)
        views = [
            (names[key], parts[0] if len(parts) == 1 else View.joined(parts).turned(0.0))
            for key, parts in groups.items()
        ]
        return views, tally

    def _shot(self, picture: AnnotatedPicture, tally: Tally) -> Shot:
        """Combine camera data of a picture from options, annotations and EXIF, by priority.

        A file that cannot be read is counted if size, field of view and heading are known anyway.
        """
        own = next((self.shots[name] for name in picture.names if name in self.shots), Shot())
        if own.heading_error is None:
            own = replace(own, heading_error=self.shot.heading_error)
        shot = own.filled(replace(self.shot, size=None)).filled(picture.shot)
        if files := self._files.find(picture):
            file = files[0]
            if len(files) > 1:
                tally.several[picture.name] = files[0]
            try:
                exif = read_exif(file)
            except InputError as error:
                whole = shot.filled(Shot(size=self.shot.size))
                if whole.size is None or whole.heading is None or field_of_view(whole) is None:
                    raise
                tally.unread[picture.name] = str(error)
                exif = Shot()
            if shot.size and exif.size and not same_shape(shot.size, exif.size):
                if any(map(ROBOFLOW.fullmatch, picture.names)):
                    tally.stretched.add(picture.name)
                    return replace(shot, size=exif.size).filled(replace(exif, turn=None))
                if exif.turn and same_shape(shot.size, exif.size[::-1]):
                    # The boxes are those of a program that does not turn the picture.
                    tally.turned.add(picture.name)
                    return replace(shot, size=shot.size[::-1]).filled(exif)
                boxes, upright = (f"{wide} x {high}" for wide, high in (shot.size, exif.size))
                raise InputError(
                    f"the boxes of {picture.name} are in a picture of {boxes} pixels, but {file} "
                    f"is {upright} as it is shown; detect the objects again in this file, or give "
                    "the picture that was used."
                )
            shot = shot.filled(replace(exif, turn=None))
        return shot.filled(Shot(size=self.shot.size))

    def _camera(self, picture: AnnotatedPicture, shot: Shot) -> Camera:
        if shot.size is None:
            raise InputError(
                f"the size of the picture {picture.name} is not known; give the folder of the "
                f"pictures with --images, or --size WIDTHxHEIGHT{self._files.searched(picture)}."
            )
        width, height = shot.size
        fov = field_of_view(shot)
        if fov is None:
            raise InputError(
                f"the field of view of the picture {picture.name} is not known; give --fov in "
                "degrees, or with --images the folder of the pictures with their EXIF"
                f"{self._files.searched(picture)}."
            )
        return Camera(
            width=width,
            height=height,
            fov=fov,
            projection=shot.camera or "pinhole",
            pitch=shot.pitch or 0.0,
            roll=shot.roll or 0.0,
            horizon=None
            if shot.horizon is None or shot.camera not in PANORAMAS
            else shot.horizon * height,
        )

    def located_boxes(self, picture: AnnotatedPicture, tally: Tally) -> LocatedBoxes:
        """Return the boxes of a picture with a known class, and count them; raises as `views`."""
        shot = self._shot(picture, tally)
        camera = self._camera(picture, shot)
        boxes = [(box, meaning) for box in picture.boxes if (meaning := self._meaning(box, tally))]
        # Boxes may be of the picture before it was turned or stretched.
        stated = (1, 1) if picture.shares else picture.shot.size or (camera.width, camera.height)
        if shot.turn:
            boxes = [
                (replace(box, corners=upright(box.corners, shot.turn, stated)), meaning)
                for box, meaning in boxes
            ]
            stated = stated[::-1]
        scale = np.array([camera.width, camera.height] * 2, dtype=float)
        corners = np.array([box.corners for box, _ in boxes], dtype=float).reshape(-1, 4)
        corners *= scale / np.array(stated * 2)
        inside: NDArray[np.bool_] = np.logical_and(
            (corners[:, :2] < scale[:2]).all(axis=1), (corners[:, 2:] > 0).all(axis=1)
        )
        for number in np.flatnonzero(~inside):
            tally.faulty_boxes.append(
                f"the box {boxes[number][0].corners} of {picture.name} is out of the picture"
            )
        boxes = [item for item, is_inside in zip(boxes, inside, strict=True) if is_inside]
        corners = np.clip(corners[inside], 0.0, scale)
        # The probability of each class, the rest is any class; the height and its deviation.
        scores = np.zeros((len(boxes), CLASSES))
        heights = np.full((len(boxes), 2), math.nan)
        for row, height, (box, meaning) in zip(scores, heights, boxes, strict=True):
            for name, share in meaning.classes:
                row[self._code(name)] += round(share * box.score, SCORE_DIGITS)
            row[WILDCARD] = 0.0
            row[:] = row / max(row.sum(), 1.0)  # rounded up
            row[WILDCARD] = max(round(1.0 - row.sum(), SCORE_DIGITS), 0.0)
            if meaning.height is not None:
                height[:] = meaning.height
            elif not meaning.part and len(meaning.classes) == 1:
                item = self.taxonomy.by_name(meaning.classes[0][0])
                if item.height_m is not None and item.height_sigma is not None:
                    height[:] = item.height_m, item.height_sigma
        whole = np.array([box.whole for box, _ in boxes], dtype=bool)
        bearings, ranges, errors = locate_boxes(camera, corners, heights=heights, whole=whole)
        tally.photos += 1
        tally.objects += len(boxes)
        tally.ranges += int(np.isfinite(ranges).sum())
        return LocatedBoxes(
            camera=camera,
            shot=shot,
            corners=corners,
            bearings=bearings,
            ranges=ranges,
            range_errors=errors,
            scores=scores,
        )

    def _view(self, picture: AnnotatedPicture, tally: Tally) -> View:
        """Return the view of one picture."""
        boxes = self.located_boxes(picture, tally)
        ranges, errors, scores = boxes.ranges, boxes.range_errors, boxes.scores
        heading, error = boxes.shot.heading, boxes.shot.heading_error
        if heading is None:
            tally.unknown_heading += 1
            heading, error = 0.0, math.inf
        elif boxes.shot.north is not None:
            tally.north[boxes.shot.north] += 1
            tally.travels += bool(boxes.shot.travels)
        certain = bool((scores.max(axis=1, initial=0.0) == 1.0).all())
        any_range = bool(np.isfinite(ranges).any())
        bearings = wrap_degrees(heading + boxes.bearings)
        bearings = np.round(bearings, DEGREE_DIGITS) % FULL_TURN
        sectors = [
            (float(wrap_degrees(low + heading)), high - low) for low, high in boxes.camera.sectors()
        ]
        return View(
            boxes.codes,
            bearings,
            ranges=np.round(ranges, METRE_DIGITS) if any_range else None,
            range_errors=np.round(errors, ERROR_DIGITS) if any_range else None,
            scores=None if certain else scores,
            photos=(
                Photo(
                    sectors=tuple((low, low + width) for low, width in sectors), north_sigma=error
                ),
            ),
        ).turned(0.0)

    def _meaning(self, box: Box, tally: Tally) -> Meaning | None:
        """Return the meaning of a box, or count it and return None if it is left out."""
        if box.fault:
            tally.faulty_boxes.append(box.fault)
            return None
        if box.score < self.min_score:
            tally.below_min_score += 1
            return None
        meaning = self.labels.find(box.label)
        if meaning is None:
            tally.unknown[box.label] += 1
        elif not meaning.classes:
            tally.no_objects[box.label] += 1
        elif not any(self._code(name) for name, _ in meaning.classes):
            tally.not_in_city[box.label] += 1
        else:
            return meaning
        return None

    def _code(self, name: str) -> int:
        """Return the code of a class, or the code of any class if the city does not have it."""
        try:
            return self.taxonomy.by_name(name).code
        except UnknownNameError:
            return WILDCARD


def field_of_view(shot: Shot) -> float | None:
    """Return the horizontal field of view of a picture in degrees; None if it is unknown."""
    projection = shot.camera or "pinhole"
    if shot.fov is None and shot.focal and shot.size and projection in {"pinhole", "fisheye"}:
        half = shot.size[0] / 2.0 / (shot.focal * max(shot.size))
        fov = math.degrees(2.0 * (math.atan(half) if projection == "pinhole" else half))
        return min(fov, FULL_TURN)
    return shot.fov or USUAL_FOV.get(projection)


def locate_boxes(
    camera: Camera,
    corners: NDArray[np.float64],
    *,
    heights: NDArray[np.float64],
    whole: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return bearings, ranges and relative range errors of the objects in boxes.

    `corners`, shape (n, 4), are in pixels; `heights`, shape (n, 2), are the heights of the objects
    and their standard deviations in metres, NaN if unknown; `whole` marks boxes of objects that are
    not partly hidden. Bearings are in degrees clockwise from the camera's axis. Ranges are NaN if
    unknown.
    """
    objects = camera.upright_objects(corners)
    # Boxes at the edge of the picture are cut off: no range.
    scale = np.array([camera.width, camera.height] * 2, dtype=float)
    margin = np.maximum(EDGE_PIXELS, EDGE_SHARE * scale)
    whole = whole & ((corners > margin) | (np.arange(4) >= 2)).all(axis=1)  # noqa: PLR2004
    whole &= ((corners < scale - margin) | (np.arange(4) < 2)).all(axis=1)  # noqa: PLR2004
    ranges: NDArray[np.float64] = np.where(whole, heights[:, 0] / objects.rises, np.nan)
    ranges[~((ranges >= LEAST_RANGE_M) & (ranges <= MAX_RANGE_M))] = np.nan
    errors: NDArray[np.float64] = np.hypot(
        heights[:, 1] / heights[:, 0], EDGE_ERROR_PIXELS / objects.pixels
    )
    errors = np.where(
        np.isnan(ranges), np.nan, np.clip(errors, LEAST_RANGE_ERROR, MOST_RANGE_ERROR)
    )
    return objects.bearings, ranges, errors


def with_heights(taxonomy: Taxonomy) -> Taxonomy:
    """Return the taxonomy with missing heights from built-in classes of the same name."""
    heights = {
        item.name: (item.height_m, item.height_sigma) for item in built_in_taxonomy().classes
    }
    classes = []
    for item in taxonomy.classes:
        own = item.height_m, item.height_sigma
        height, sigma = heights.get(item.name, own) if item.height_m is None else own
        classes.append(replace(item, height_m=height, height_sigma=sigma))
    return Taxonomy(tuple(classes))


def read_shots(path: str | Path) -> dict[str, Shot]:
    """Read data of single pictures from a CSV or JSON lines file, by name.

    The columns are ``image``, the name of the file, and any of ``camera``, ``fov``, ``heading``,
    ``heading_error``, ``pitch``, ``roll`` and ``place``. InputError if a row is invalid.
    """
    shots: dict[str, Shot] = {}
    for _, (name, shot) in read_rows(path, _shot_of, what="picture"):
        shots[name] = shots[PurePosixPath(name).stem] = shot
    return shots


def _shot_of(row: Row) -> tuple[str, Shot]:
    name = row_value(row, "image")
    if name is None:
        raise InputError("it names no image")
    camera, place = row_value(row, "camera"), row_value(row, "place")
    if camera is not None and camera not in get_args(Projection):
        raise InputError(f"the camera {camera!r} is none of {', '.join(get_args(Projection))}")
    numbers: dict[str, Any] = {
        name: float(value)
        for name in ("fov", "heading", "pitch", "roll")
        if (value := row_value(row, name)) is not None
    }
    if "heading" in numbers:
        require_number(
            "the heading", numbers["heading"], least=-FULL_TURN, most=FULL_TURN, unit="degrees"
        )
    error = row_value(row, "heading_error")
    return str(name), Shot(
        camera=camera,
        place=None if place is None else str(place),
        heading_error=None if error is None else north_sigma(error),
        **numbers,
    )


def north_sigma(error: str | float) -> float:
    """Return the standard deviation of a heading in degrees, infinite for ``unknown``."""
    try:
        return math.inf if error == "unknown" else float(error)
    except ValueError as fault:
        raise InputError(
            f"the error of a heading is {error!r}; give degrees or 'unknown'."
        ) from fault


def _require_objects(tally: Tally) -> None:
    """Raise InputError if all there is are boxes with faults, or shapes that are no boxes."""
    left_out = tally.below_min_score, *tally.unknown, *tally.no_objects, *tally.not_in_city
    if tally.objects or any(left_out):
        return
    if tally.faulty_boxes:
        raise InputError(f"{tally.faulty_boxes[0]}; correct the file, or export it again.")
    if tally.no_boxes:
        raise InputError(
            f"none of the shapes ({tally.no_boxes:,}) is a box or an outline of one object, only "
            "points, lines or groups; mark each object with a box or an outline."
        )


def _metres(first: tuple[float, float], second: tuple[float, float]) -> float:
    """Return the approximate distance of two places in degrees of latitude and longitude."""
    north = first[0] - second[0]
    east = (first[1] - second[1]) * math.cos(math.radians(first[0]))
    return METRES_PER_DEGREE * math.hypot(north, east)
