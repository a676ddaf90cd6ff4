"""Cameras: where in a picture things of the world appear, and where in the world boxes stand."""

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
"""Of pictures whose field of view nobody says; a pinhole's is never known."""

MOST_PIXELS = 1_000_000
MOST_FOV = {"pinhole": 175.0}  # a flat picture cannot hold half a turn

# Bearings at which the edges of a picture are looked for, and how often each is then halved.
STEPS, HALVINGS = 1440, 20

# Of a search for the upright thing whose outline has a given box.
ROUNDS = 20
NUDGE = 1e-6
MOST_STEP = 0.3
MOST_MISFIT = 0.1
HEIGHTS, SIDES = 9, 3
MIN_DEPTH = 1e-3


@dataclass(frozen=True, slots=True)
class Standing:
    """Upright things as a camera sees them; each array has shape (n,).

    `bearings` are degrees clockwise from where the camera looks, in [-180, 180). `rises` are their
    heights by their distance, NaN where the picture does not tell; `pixels` how tall they are in
    the picture.
    """

    bearings: NDArray[np.float64]
    rises: NDArray[np.float64]
    pixels: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """How a picture shows the world.

    Parameters
    ----------
    width, height : int
        Size of the picture in pixels.
    fov : float
        Field of view over its width in degrees: up to 175 for a pinhole camera, else up to 360.
    projection : {"pinhole", "equirectangular", "cylindrical", "fisheye"}
        A photograph with straight lines; panoramas with degrees, or heights, as rows; a picture in
        which distance from the centre is the angle (equidistant).
    pitch, roll : float, default 0
        How far the camera looks up, and how far it is turned clockwise about where it looks, in
        degrees.

    Raises
    ------
    InputError
        If a value is out of its range.

    Examples
    --------
    >>> phone = Camera(width=4000, height=3000, fov=67)
    >>> phone.standing([[1900, 1000, 2100, 1800]]).bearings.round(2).tolist()
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

    @property
    def focal(self) -> float:
        """Pixels to a radian, or of a pinhole's focal length."""
        if self.projection == "pinhole":
            return self.width / 2.0 / math.tan(math.radians(self.fov) / 2.0)
        return self.width / math.radians(self.fov)

    @property
    def _turn(self) -> NDArray[np.float64]:
        """Matrix that takes directions of the camera (right, down, ahead) to the world's."""
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
        """Return where directions appear, (..., 2): columns and rows, NaN behind a pinhole.

        Directions, shape (..., 3), are lengths to the right of where the camera looks, down, and
        ahead; the camera's pitch and roll do not turn them.
        """
        right, down, ahead = np.moveaxis(np.asarray(directions) @ self._turn, -1, 0)
        focal = self.focal
        if self.projection == "pinhole":
            depth = np.where(ahead > MIN_DEPTH * np.hypot(right, down), ahead, np.nan)
            across, along = focal * right / depth, focal * down / depth
        elif self.projection == "fisheye":
            aside = np.hypot(right, down)
            scale = focal * np.arctan2(aside, ahead) / np.where(aside > 0, aside, 1.0)
            across, along = scale * right, scale * down
        else:
            flat = np.hypot(right, ahead)
            across = focal * np.arctan2(right, ahead)
            along = focal * (
                np.arctan2(down, flat)
                if self.projection == "equirectangular"
                else down / np.where(flat > 0, flat, np.nan)
            )
        return np.stack([self.width / 2.0 + across, self.height / 2.0 + along], axis=-1)

    def directions(self, pixels: ArrayLike) -> NDArray[np.float64]:
        """Return the direction of each pixel, shape (..., 3), the inverse of `pixels`."""
        columns, rows = np.moveaxis(np.asarray(pixels, dtype=np.float64), -1, 0)
        across = (columns - self.width / 2.0) / self.focal
        along = (rows - self.height / 2.0) / self.focal
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
        """Return which bearings are in the picture, from where the camera looks; none for all.

        They are those at the height of the camera or, where that is not in the picture, of what
        is in its middle.
        """
        middle = self.directions([self.width / 2.0, self.height / 2.0])
        ahead = math.degrees(math.atan2(middle[0], middle[2]))
        sides = ahead + np.arange(STEPS) * (FULL_TURN / STEPS)
        rise = 0.0
        if not (seen := self._shows(sides, rise)).any():
            rise = float(-middle[1] / max(math.hypot(middle[0], middle[2]), MIN_DEPTH))
            seen = self._shows(sides, rise)
            seen[0] = True
        if seen.all():
            return ()
        first, last = seen & ~np.roll(seen, 1), seen & ~np.roll(seen, -1)
        step = FULL_TURN / STEPS
        low = self._edge(sides[first], sides[first] - step, rise)
        high = self._edge(sides[last], sides[last] + step, rise)
        if high[0] < low[0]:  # the last one goes on where the bearings begin
            high = np.roll(high, -1)
        low -= FULL_TURN * np.round(low / FULL_TURN)
        width = np.mod(high - low, FULL_TURN)
        return tuple(
            (round(start, 6), round(start + span, 6))
            for start, span in zip(low.tolist(), width.tolist(), strict=True)
        )

    def _shows(self, bearings: NDArray[Any], rise: float) -> NDArray[np.bool_]:
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
        """Return the bearings of the picture's edge between some inside and some outside."""
        for _ in range(HALVINGS):
            middle = (inside + outside) / 2.0
            shown = self._shows(middle, rise)
            inside, outside = np.where(shown, middle, inside), np.where(shown, outside, middle)
        return inside

    def standing(self, boxes: ArrayLike) -> Standing:
        """Return the upright things that have these boxes as outlines.

        Boxes, shape (n, 4), are left, top, right and bottom in pixels. A thing is taken for a flat
        one that faces the camera: its bearing, width, and where it begins and ends by its distance
        are what gives the box, also where a tilted camera or a panorama bends uprights.
        """
        boxes = np.asarray(boxes, dtype=np.float64).reshape(-1, 4)
        guess = self._guess(boxes)
        found = self._fitted(guess, boxes)
        misfit = np.abs(self._outline(found, boxes) - boxes).max(axis=1)
        size = (boxes[:, 2:] - boxes[:, :2]).max(axis=1)
        fits = misfit <= np.maximum(1.0, MOST_MISFIT * size)  # false for NaN
        bearing, _, foot, head = found.T
        told = fits & (head > foot)
        ends = self._near(self._points(found)[:, [0, -1], SIDES // 2], boxes)
        pixels = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
        return Standing(
            bearings=signed_degrees(np.degrees(np.where(fits, bearing, guess[:, 0]))),
            rises=np.where(told, head - foot, np.nan),
            pixels=np.where(told, pixels, np.nan),
        )

    def _guess(self, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return bearing, half width, foot and head, by the distance, from the middles of sides."""
        left, top, right, bottom = boxes.T
        column, row = (left + right) / 2.0, (top + bottom) / 2.0
        sides = [(column, row), (left, row), (right, row), (column, bottom), (column, top)]
        rays = self.directions(np.stack([np.stack(side, axis=-1) for side in sides]))
        bearings = np.arctan2(rays[..., 0], rays[..., 2])
        flat = np.maximum(np.hypot(rays[..., 0], rays[..., 2]), MIN_DEPTH)
        rises = -rays[..., 1] / flat
        span = np.radians(np.abs(signed_degrees(np.degrees(bearings[2] - bearings[1]))))
        half = np.tan(np.clip(span / 2.0, 0.0, 1.0))
        ends = np.sort(rises[3:], axis=0)
        return np.stack([bearings[0], half, ends[0], ends[1]], axis=-1)

    def _fitted(
        self, first: NDArray[np.float64], boxes: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the things, of those near `first`, whose outlines are nearest to the boxes."""
        found = first.copy()
        for _ in range(ROUNDS):
            outline = self._outline(found, boxes)
            columns = []
            for number in range(4):
                moved = found.copy()
                moved[:, number] += NUDGE
                columns.append((self._outline(moved, boxes) - outline) / NUDGE)
            slopes = np.stack(columns, axis=-1)
            lost = ~np.isfinite(slopes).all(axis=(1, 2)) | ~np.isfinite(outline).all(axis=1)
            slopes[lost], outline[lost] = np.eye(4), boxes[lost]
            step = np.einsum("nij,nj->ni", np.linalg.pinv(slopes), boxes - outline)
            largest = np.abs(step).max(axis=1, keepdims=True, initial=MOST_STEP)
            found += step * (MOST_STEP / largest)
            found[:, 1] = np.maximum(found[:, 1], 0.0)
            if np.abs(step).max(initial=0.0) < NUDGE:
                break
        return found

    def _points(self, things: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where the points of flat upright things appear, shape (n, heights, 3, 2)."""
        bearing, half, foot, head = (column[:, None, None] for column in things.T)
        aside = half * np.linspace(-1.0, 1.0, SIDES)[None, None, :]
        rise = foot + (head - foot) * np.linspace(0.0, 1.0, HEIGHTS)[None, :, None]
        right = np.sin(bearing) + aside * np.cos(bearing)
        ahead = np.cos(bearing) - aside * np.sin(bearing)
        return self.pixels(np.stack(np.broadcast_arrays(right, -rise, ahead), axis=-1))

    def _near(self, points: NDArray[np.float64], boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points of a panorama on the side of its seam on which the box of each is."""
        if self.projection in {"pinhole", "fisheye"}:
            return points
        period = math.tau * self.focal
        shape = (-1, *[1] * (points.ndim - 2))
        away = points[..., 0] - ((boxes[:, 0] + boxes[:, 2]) / 2.0).reshape(shape)
        nearer = points.copy()
        nearer[..., 0] -= period * np.round(away / period)
        return nearer

    def _outline(
        self, things: NDArray[np.float64], boxes: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the boxes of flat upright things, shape (n, 4)."""
        points = self._near(self._points(things), boxes).reshape(len(things), HEIGHTS * SIDES, 2)
        return np.concatenate([points.min(axis=1), points.max(axis=1)], axis=-1)
