"""Camera models: convert directions to pixels, and boxes in pixels to bearings and heights."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from semsig_gis.core import FULL_TURN, InputError, require_number, signed_degrees

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.observation.view import Sector

Projection = Literal["pinhole", "equirectangular", "cylindrical", "fisheye"]

USUAL_FOV: dict[str, float] = {"equirectangular": 360.0, "cylindrical": 360.0, "fisheye": 180.0}
"""Default fields of view in degrees; a pinhole camera has none."""

POSSIBLE_FOV = (40.0, 55.0, 70.0, 85.0, 100.0)
"""Fields of view in degrees that a photograph of unknown field of view may have."""

MOST_PIXELS = 1_000_000
MOST_FOV = {"pinhole": 175.0}  # a flat picture cannot show half a turn

# Search for the edges of a picture: bearings of the first pass, and bisections of each edge.
EDGE_STEPS, BISECTIONS = 1440, 20

# Gauss-Newton fit of an upright object to a box.
FIT_ITERATIONS = 20
DIFFERENCE_STEP = 1e-6  # for numerical derivatives
LARGEST_STEP = 0.3
LARGEST_MISFIT = 0.1  # share of the size of the box
OUTLINE_HEIGHTS, OUTLINE_SIDES = 9, 3  # points of an outline
MIN_DEPTH = 1e-3


@dataclass(frozen=True, slots=True)
class UprightObjects:
    """Upright objects as a camera sees them; each array has shape (n,).

    `bearings` are in degrees clockwise from the camera's axis, in [-180, 180). `rises` are their
    heights divided by their distances, NaN if unknown; `pixels` are their heights in the picture.
    """

    bearings: NDArray[np.float64]
    rises: NDArray[np.float64]
    pixels: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """A camera model: size, field of view and projection of a picture.

    Parameters
    ----------
    width, height : int
        Size of the picture in pixels.
    fov : float
        Field of view over its width in degrees: up to 175 for a pinhole camera, else up to 360.
    projection : {"pinhole", "equirectangular", "cylindrical", "fisheye"}
        A photograph with straight lines; panoramas with rows by angle (equirectangular) or by
        height (cylindrical); a fisheye picture with the angle as the distance from the centre
        (equidistant).
    pitch, roll : float, default 0
        Angle of the camera above the horizon, and clockwise rotation about its axis, in degrees.
    horizon : float, optional
        Row of the camera's axis in pixels, beyond the picture if need be; default its middle. Only
        a cropped panorama has another.

    Raises
    ------
    InputError
        If a value is out of its range.

    Examples
    --------
    >>> phone = Camera(width=4000, height=3000, fov=67)
    >>> phone.upright_objects([[1900, 1000, 2100, 1800]]).bearings.round(2).tolist()
    [0.0]
    >>> phone.sectors()
    ((-33.5, 33.5),)
    """

    width: int
    height: int
    fov: float
    projection: Projection = "pinhole"
    pitch: float = 0.0
    roll: float = 0.0
    horizon: float | None = None

    def __post_init__(self) -> None:  # noqa: D105
        if self.projection not in get_args(Projection):
            names = ", ".join(get_args(Projection))
            raise InputError(f"the camera {self.projection!r} is unknown; the cameras are {names}.")
        for what, size in (("width", self.width), ("height", self.height)):
            require_number(
                f"the {what} of a picture", size, least=1, most=MOST_PIXELS, unit="pixels"
            )
        most = MOST_FOV.get(self.projection, FULL_TURN)
        require_number(
            f"the field of view of a {self.projection} camera",
            self.fov,
            least=0.1,
            most=most,
            unit="degrees",
        )
        require_number("the pitch", self.pitch, least=-90, most=90, unit="degrees")
        require_number("the roll", self.roll, least=-180, most=180, unit="degrees")
        require_number(
            "the row of the horizon",
            self.axis_row,
            least=-MOST_PIXELS,
            most=MOST_PIXELS,
            unit="pixels",
        )

    @property
    def axis_row(self) -> float:
        """Row of the camera's axis in pixels."""
        return self.height / 2.0 if self.horizon is None else self.horizon

    @property
    def focal(self) -> float:
        """Pixels per radian, or the focal length of a pinhole camera in pixels."""
        if self.projection == "pinhole":
            return self.width / 2.0 / math.tan(math.radians(self.fov) / 2.0)
        return self.width / math.radians(self.fov)

    def log_scale(self, bearings: ArrayLike) -> float:
        """Return the sum of the logarithms of radians per pixel at some bearings from the axis.

        It turns a density of bearings per degree into one of columns per pixel, up to a constant:
        views of one photograph with different fields of view are compared by the latter.
        """
        angles = np.radians(np.asarray(bearings, dtype=np.float64))
        logs = -math.log(self.focal) * angles.size
        if self.projection == "pinhole":
            logs += 2.0 * float(np.log(np.maximum(np.cos(angles), MIN_DEPTH)).sum())
        return logs

    @property
    def _turn(self) -> NDArray[np.float64]:
        """Rotation matrix from camera directions (right, down, ahead) to those without tilt."""
        pitch, roll = math.radians(self.pitch), math.radians(self.roll)
        tilt = [
            [1.0, 0.0, 0.0],
            [0.0, math.cos(pitch), -math.sin(pitch)],
            [0.0, math.sin(pitch), math.cos(pitch)],
        ]
        spin = [
            [math.cos(roll), -math.sin(roll), 0.0],
            [math.sin(roll), math.cos(roll), 0.0],
            [0.0, 0.0, 1.0],
        ]
        return np.asarray(np.asarray(tilt) @ np.asarray(spin))

    def pixels(self, directions: ArrayLike) -> NDArray[np.float64]:
        """Return the columns and rows of directions, shape (..., 2), NaN behind a pinhole.

        Directions, shape (..., 3), are lengths to the right, down and ahead of a camera without
        pitch and roll.
        """
        right, down, ahead = np.moveaxis(np.asarray(directions) @ self._turn, -1, 0)
        focal = self.focal
        if self.projection == "pinhole":
            depth = np.where(ahead > MIN_DEPTH * np.hypot(right, down), ahead, np.nan)
            across, along = focal * right / depth, focal * down / depth
        elif self.projection == "fisheye":
            radial = np.hypot(right, down)
            scale = focal * np.arctan2(radial, ahead) / np.where(radial > 0, radial, 1.0)
            across, along = scale * right, scale * down
        else:
            flat = np.hypot(right, ahead)
            across = focal * np.arctan2(right, ahead)
            along = focal * (
                np.arctan2(down, flat)
                if self.projection == "equirectangular"
                else down / np.where(flat > 0, flat, np.nan)
            )
        return np.stack([self.width / 2.0 + across, self.axis_row + along], axis=-1)

    def directions(self, pixels: ArrayLike) -> NDArray[np.float64]:
        """Return the direction of each pixel, shape (..., 3), the inverse of `pixels`."""
        columns, rows = np.moveaxis(np.asarray(pixels, dtype=np.float64), -1, 0)
        across = (columns - self.width / 2.0) / self.focal
        along = (rows - self.axis_row) / self.focal
        if self.projection == "pinhole":
            right, down, ahead = across, along, np.ones_like(across)
        elif self.projection == "fisheye":
            angle = np.hypot(across, along)
            scale = np.sinc(angle / np.pi)
            right, down, ahead = scale * across, scale * along, np.cos(angle)
        elif self.projection == "equirectangular":
            right = np.sin(across) * np.cos(along)
            down, ahead = np.sin(along), np.cos(across) * np.cos(along)
        else:
            right, down, ahead = np.sin(across), along, np.cos(across)
        return np.asarray(np.stack([right, down, ahead], axis=-1) @ self._turn.T)

    def sectors(self) -> tuple[Sector, ...]:
        """Return the sectors of bearings in the picture, from the camera's axis; none for all.

        The bearings are at the height of the camera or, if it is not in the picture, at the height
        of the centre of the picture.
        """
        middle = self.directions([self.width / 2.0, self.height / 2.0])
        ahead = math.degrees(math.atan2(middle[0], middle[2]))
        sides = ahead + np.arange(EDGE_STEPS) * (FULL_TURN / EDGE_STEPS)
        rise = 0.0
        if not (shown := self._shows(sides, rise)).any():
            rise = float(-middle[1] / max(math.hypot(middle[0], middle[2]), MIN_DEPTH))
            shown = self._shows(sides, rise)
            shown[0] = True
        if shown.all():
            return ()
        # The first and last bearing of each run in the picture, then the exact edges.
        first, last = shown & ~np.roll(shown, 1), shown & ~np.roll(shown, -1)
        step = FULL_TURN / EDGE_STEPS
        low = self._edge(sides[first], sides[first] - step, rise)
        high = self._edge(sides[last], sides[last] + step, rise)
        if high[0] < low[0]:  # the last sector continues at the first bearing
            high = np.roll(high, -1)
        low -= FULL_TURN * np.round(low / FULL_TURN)
        width = np.mod(high - low, FULL_TURN)
        return tuple(
            (round(start, 6), round(start + span, 6))
            for start, span in zip(low.tolist(), width.tolist(), strict=True)
        )

    def _shows(self, bearings: NDArray[Any], rise: float) -> NDArray[np.bool_]:
        """Return a mask of the bearings that are in the picture at a height by distance."""
        angles = np.radians(bearings)
        down = np.full_like(angles, -rise)
        column, row = np.moveaxis(
            self.pixels(np.stack([np.sin(angles), down, np.cos(angles)], axis=-1)), -1, 0
        )
        inside = (column >= 0) & (column <= self.width) & (row >= 0) & (row <= self.height)
        return np.asarray(inside)

    def _edge(
        self, inside: NDArray[Any], outside: NDArray[Any], rise: float
    ) -> NDArray[np.float64]:
        """Return the bearings of the edges between bearings inside and outside, by bisection."""
        for _ in range(BISECTIONS):
            middle = (inside + outside) / 2.0
            shown = self._shows(middle, rise)
            inside, outside = np.where(shown, middle, inside), np.where(shown, outside, middle)
        return inside

    def upright_objects(self, boxes: ArrayLike) -> UprightObjects:
        """Return the upright objects with these boxes as outlines.

        Boxes, shape (n, 4), are left, top, right and bottom in pixels. The model of an object is a
        flat upright rectangle that faces the camera. Its bearing, width, foot and head, divided by
        its distance, are fitted to the box, so that tilted cameras and panoramas are exact.
        """
        boxes = np.asarray(boxes, dtype=np.float64).reshape(-1, 4)
        # Estimate bearing, half width, foot and head, by distance, from the middles of sides.
        left, top, right, bottom = boxes.T
        column, row = (left + right) / 2.0, (top + bottom) / 2.0
        sides = [(column, row), (left, row), (right, row), (column, bottom), (column, top)]
        rays = self.directions(np.stack([np.stack(side, axis=-1) for side in sides]))
        bearings = np.arctan2(rays[..., 0], rays[..., 2])
        rises = -rays[..., 1] / np.maximum(np.hypot(rays[..., 0], rays[..., 2]), MIN_DEPTH)
        span = np.radians(np.abs(signed_degrees(np.degrees(bearings[2] - bearings[1]))))
        half = np.tan(np.clip(span / 2.0, 0.0, 1.0))
        guess = np.stack([bearings[0], half, *np.sort(rises[3:], axis=0)], axis=-1)
        objects = self._fit(guess, boxes)
        misfit = np.abs(self._outline(objects, boxes) - boxes).max(axis=1)
        size = (boxes[:, 2:] - boxes[:, :2]).max(axis=1)
        fits = misfit <= np.maximum(1.0, LARGEST_MISFIT * size)  # false for NaN
        bearing, _, foot, head = objects.T
        has_height = fits & (head > foot)
        ends = self._unwrap(self._points(objects)[:, [0, -1], OUTLINE_SIDES // 2], boxes)
        pixels = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
        return UprightObjects(
            bearings=signed_degrees(np.degrees(np.where(fits, bearing, guess[:, 0]))),
            rises=np.where(has_height, head - foot, np.nan),
            pixels=np.where(has_height, pixels, np.nan),
        )

    def _fit(self, guess: NDArray[np.float64], boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Fit objects to boxes by Gauss-Newton iterations from a guess."""
        objects = guess.copy()
        for _ in range(FIT_ITERATIONS):
            outline = self._outline(objects, boxes)
            # Numerical derivatives of the outline by each parameter.
            columns = []
            for number in range(4):
                shifted = objects.copy()
                shifted[:, number] += DIFFERENCE_STEP
                columns.append((self._outline(shifted, boxes) - outline) / DIFFERENCE_STEP)
            slopes = np.stack(columns, axis=-1)
            # Objects behind the camera do not change.
            invalid = ~np.isfinite(slopes).all(axis=(1, 2)) | ~np.isfinite(outline).all(axis=1)
            slopes[invalid], outline[invalid] = np.eye(4), boxes[invalid]
            step = np.einsum("nij,nj->ni", np.linalg.pinv(slopes), boxes - outline)
            largest = np.abs(step).max(axis=1, keepdims=True, initial=LARGEST_STEP)
            objects += step * (LARGEST_STEP / largest)
            objects[:, 1] = np.maximum(objects[:, 1], 0.0)
            if np.abs(step).max(initial=0.0) < DIFFERENCE_STEP:
                break
        return objects

    def _points(self, objects: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the pixels of points of flat upright objects, shape (n, heights, 3, 2)."""
        bearing, half, foot, head = (column[:, None, None] for column in objects.T)
        across = half * np.linspace(-1.0, 1.0, OUTLINE_SIDES)[None, None, :]
        rise = foot + (head - foot) * np.linspace(0.0, 1.0, OUTLINE_HEIGHTS)[None, :, None]
        right = np.sin(bearing) + across * np.cos(bearing)
        ahead = np.cos(bearing) - across * np.sin(bearing)
        return self.pixels(np.stack(np.broadcast_arrays(right, -rise, ahead), axis=-1))

    def _unwrap(
        self, points: NDArray[np.float64], boxes: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return points of a panorama on the same side of its seam as their boxes."""
        if self.projection in {"pinhole", "fisheye"}:
            return points
        period = math.tau * self.focal
        shape = (-1, *[1] * (points.ndim - 2))
        away = points[..., 0] - ((boxes[:, 0] + boxes[:, 2]) / 2.0).reshape(shape)
        unwrapped = points.copy()
        unwrapped[..., 0] -= period * np.round(away / period)
        return unwrapped

    def _outline(
        self, objects: NDArray[np.float64], boxes: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the boxes of flat upright objects, shape (n, 4)."""
        points = self._unwrap(self._points(objects), boxes).reshape(
            len(objects), OUTLINE_HEIGHTS * OUTLINE_SIDES, 2
        )
        return np.concatenate([points.min(axis=1), points.max(axis=1)], axis=-1)
