"""The metric plane: coordinate system, names of columns, bearings, and the grid of cells."""

from __future__ import annotations

import functools
import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from pyproj import CRS, Geod, Proj, Transformer
from pyproj.exceptions import CRSError

from semsig_gis.core.checks import require_number
from semsig_gis.core.errors import CrsError, InputError
from semsig_gis.core.resources import require_memory

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


FULL_TURN, HALF_TURN = 360.0, 180.0


def wrap_degrees(angles: ArrayLike) -> NDArray[np.float64]:
    """Return any finite angles in degrees as the same directions in [0, 360)."""
    wrapped = np.mod(np.asarray(angles, dtype=np.float64), FULL_TURN)
    # The remainder of a tiny negative angle rounds to 360 itself.
    return np.where(wrapped >= FULL_TURN, 0.0, wrapped)


def signed_degrees(angles: ArrayLike) -> NDArray[np.float64]:
    """Return angles in degrees as the same directions in [-180, 180)."""
    return np.asarray((np.asarray(angles) + HALF_TURN) % FULL_TURN - HALF_TURN)


def angular_distance(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """Return the smaller angle between directions in degrees, from 0 to 180."""
    difference = wrap_degrees(np.asarray(a, dtype=np.float64) - np.asarray(b, dtype=np.float64))
    return np.minimum(difference, FULL_TURN - difference)


CLASS_CODE = "class_code"
CLASS_NAME = "class_name"
SOURCE = "source"
SOURCE_ID = "source_id"
COUNT = "count"
MERGED = "merged"
GEOMETRY = "geometry"
HALF_WIDTH = "half_width"
NAME = "name"

NOTES = "notes"
"""Key of the warnings in the metadata of a file."""

LICENSES = "licenses"
"""Whom to name for a table of buildings or streets: a key of its `attrs`."""


def require_metric_crs(crs: CRS | str | int | None) -> CRS:
    """Return a coordinate system, without its height, if distances in metres can be taken in it.

    Raises CrsError if it is missing, unknown, in degrees or feet, a Mercator or cylindrical
    projection, where lengths grow with the latitude (1.5 times at Paris), or if its axes do not
    point east and north, from which bearings are counted.
    """
    advice = (
        "give a projected CRS in metres, such as 'EPSG:2154' for France or the UTM zone of the city"
    )
    if crs is None:
        raise CrsError(f"no coordinate reference system was given; {advice}.")
    try:
        system = CRS.from_user_input(crs).to_2d()
    except CRSError as error:
        raise CrsError(f"coordinate reference system {crs!r} is unknown; {advice}.") from error
    fault = _fault(system)
    if fault:
        raise CrsError(f"{system.name} {fault}; {advice}.")
    return system


def _fault(system: CRS) -> str:
    """Return why distances and bearings cannot be taken in a system, or nothing."""
    if system.is_geographic:
        return "is in degrees"
    if not system.is_projected:
        return f"is {system.type_name.removesuffix(' CRS').lower()}, not projected"
    # The operation of a bound system is its datum shift; the projection is its source's.
    plane = system.source_crs if system.is_bound else system
    operation = plane.coordinate_operation if plane else None
    method = operation.method_name.lower() if operation else ""
    # Transverse and oblique ones (UTM, the Swiss and Hungarian grids) are true near their line.
    if re.search("mercator|cylindrical", method) and not re.search("transverse|oblique", method):
        return "is a Mercator or cylindrical projection, whose lengths grow with latitude"
    if any(axis.unit_conversion_factor != 1.0 for axis in system.axis_info):
        return "is not in metres"
    if {axis.direction for axis in system.axis_info} != {"east", "north"}:
        return "has axes that do not point east and north"
    return ""


Bounds = tuple[float, float, float, float]

# Places along each side of an extent at which a plane is compared with the ground.
SAMPLES = 11
# Points of an edge of the extent whose degrees are looked at: in degrees an edge is a curve.
EDGE_POINTS = 21
# Long against the rounding of coordinates, short against how fast the angle changes.
STEP_M = 10.0


def grid_convergence(crs: CRS, xy: ArrayLike) -> NDArray[np.float64]:
    """Return the angle from true to grid north at places in a metric CRS, in degrees clockwise.

    A bearing from true north is the bearing in the grid plus this angle.

    Parameters
    ----------
    crs : pyproj.CRS
        Metric coordinate reference system.
    xy : array_like of float, shape (n, 2)
        Places in metres.

    Returns
    -------
    ndarray of float, shape (n,)
        Angles in [-180, 180), NaN where a place is not on the Earth.

    Examples
    --------
    >>> from semsig_gis.core.geometry import grid_convergence, require_metric_crs
    >>> grid_convergence(require_metric_crs("EPSG:2154"), [(770_000, 6_280_000)]).round(2).tolist()
    [0.63]
    """
    azimuth, _ = _on_the_ground(crs, xy, (0.0, STEP_M))
    return signed_degrees(azimuth)


def crs_label(crs: CRS) -> str:
    """Return a short name for messages: the code where there is one."""
    code = crs.to_epsg()
    return crs.name if code is None else f"EPSG:{code}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Distortion:
    """How a metric CRS differs from the ground over an extent.

    `convergence` are the least and the largest angle from true to grid north, in degrees clockwise;
    `scale` the least and the largest length in the plane of a metre on the ground.
    """

    convergence: tuple[float, float]
    scale: tuple[float, float]

    @property
    def angle(self) -> float:
        """The largest angle between grid and true north, in degrees."""
        return max(map(abs, self.convergence))

    @property
    def turn(self) -> float:
        """By how many degrees grid north turns over the extent."""
        return self.convergence[1] - self.convergence[0]

    @property
    def stretch(self) -> float:
        """The largest share by which a length is off."""
        return max(abs(scale - 1.0) for scale in self.scale)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields, ``angle`` and ``stretch`` for JSON, None for what is infinite."""
        values = (*self.convergence, self.angle, *self.scale, self.stretch)
        # More decimals would be those of the rounding.
        known = [round(value, 7) if math.isfinite(value) else None for value in values]
        return {
            "convergence": known[:2],
            "angle": known[2],
            "scale": known[3:5],
            "stretch": known[5],
        }


def plane_distortion(crs: CRS, bounds: Bounds) -> Distortion:
    """Return how a metric CRS differs from the ground within ``xmin, ymin, xmax, ymax``.

    It is measured at 11 x 11 places; infinite where one of them is not on the Earth.
    """
    if not np.isfinite(bounds).all():
        return Distortion(convergence=(-math.inf, math.inf), scale=(0.0, math.inf))
    x, y = np.linspace(bounds[:2], bounds[2:], SAMPLES).T
    xy = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    north, lengths = _on_the_ground(crs, xy, (0.0, STEP_M))
    _, others = _on_the_ground(crs, xy, (STEP_M, 0.0))
    angles = signed_degrees(north)
    if np.isnan(angles).any():
        return plane_distortion(crs, (math.nan,) * 4)
    scales = STEP_M / np.concatenate([lengths, others])
    return Distortion(
        convergence=(float(angles.min()), float(angles.max())),
        scale=(float(scales.min()), float(scales.max())),
    )


@functools.lru_cache(maxsize=8)  # it takes longer to find than a query to answer
def to_degrees(crs: CRS) -> Transformer:
    """Return what turns x and y in a CRS into longitudes and latitudes of WGS 84."""
    return Transformer.from_crs(crs, "EPSG:4326", always_xy=True)


def degree_bounds(crs: CRS, bounds: Bounds) -> Bounds:
    """Return west, south, east and north in degrees of ``xmin, ymin, xmax, ymax`` in a CRS.

    West is greater than east where the box crosses 180 degrees.
    """
    west, south, east, north = to_degrees(crs).transform_bounds(*bounds, densify_pts=EDGE_POINTS)
    return west, south, east, north


def across_180(longitudes: ArrayLike, crs: CRS, *, turn: float = FULL_TURN) -> NDArray[np.float64]:
    """Return longitudes of places in a metric CRS such that neighbours are near each other.

    Those across 180 degrees from the middle of where the CRS is used go beyond 180 or -180. A CRS
    that does not say where it is used leaves them as they are. `turn` is a full turn, in degrees or
    as x of a web map.
    """
    degrees = np.asarray(longitudes, dtype=np.float64)
    area = crs.area_of_use
    width = 0.0 if area is None else float(wrap_degrees(area.east - area.west))
    if area is None or width == 0.0:  # or it is used all the way round
        return degrees
    middle = float(signed_degrees(area.west + width / 2)) * turn / FULL_TURN
    degrees = np.where(degrees - middle > turn / 2, degrees - turn, degrees)
    return np.where(degrees - middle < -turn / 2, degrees + turn, degrees)


def _on_the_ground(
    crs: CRS, xy: ArrayLike, step: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return true azimuth and length of a step in the plane from places, along the ellipsoid."""
    plane, ellipsoid = Proj(crs), crs.get_geod() or Geod(ellps="WGS84")
    here = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    from_to = [plane(xy[:, 0], xy[:, 1], inverse=True) for xy in (here, here + step)]
    azimuth, _, metres = ellipsoid.inv(*from_to[0], *from_to[1])
    return np.where(np.isfinite(metres), azimuth, np.nan), np.asarray(metres)


ROW_SPAN = 10**8
CELL_BYTES = 48  # for a cell, while all are gathered
LEAST_STEP, MOST_STEP = 0.01, 100_000
# More cells on each side of a point than this would fill the memory.
MAX_REACH = 1000
# Rows that a cell number can hold, with room for the cells around a point.
MAX_CELL = ROW_SPAN // 2 - MAX_REACH - 1


@dataclass(frozen=True, slots=True)
class GridSpec:
    """A grid of square cells over a metric CRS.

    Parameters
    ----------
    step : float, default 10
        Side of a cell in metres (the paper's s), from 0.01 to 100,000.
    origin : tuple of (float, float), default (0, 0)
        Lower-left corner of the cell in column 0 and row 0, in metres. Only its remainder by
        `step` matters for where cells lie; it also sets where columns and rows count from.

    Raises
    ------
    InputError
        If the step is out of its range or the origin is not finite.

    Examples
    --------
    >>> GridSpec().viewpoints([76520], [627500]).tolist()
    [[765205.0, 6275005.0]]
    """

    step: float = 10.0
    origin: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:  # noqa: D105
        require_number("grid step", self.step, least=LEAST_STEP, most=MOST_STEP, unit="metres")
        if np.shape(self.origin) != (2,) or not np.isfinite(self.origin).all():
            raise InputError(
                f"grid origin is {self.origin}; give two finite coordinates in metres."
            )

    def viewpoints(self, columns: ArrayLike, rows: ArrayLike) -> NDArray[np.float64]:
        """Return the centres of n cells in metres, shape (n, 2)."""
        return np.stack(
            [
                self.origin[0] + (np.asarray(columns) + 0.5) * self.step,
                self.origin[1] + (np.asarray(rows) + 0.5) * self.step,
            ],
            axis=-1,
        )

    def cells_at(self, xy: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the columns and rows of the cells in which points, shape (n, 2) in metres, lie.

        A point on an edge belongs to the cell east or north of it. InputError if a point is so far
        from the origin that its cell cannot be numbered.
        """
        cells = np.floor((np.asarray(xy, dtype=np.float64) - self.origin) / self.step)
        if not (np.abs(cells) <= MAX_CELL).all():
            raise InputError(
                f"a point lies more than {MAX_CELL:,} cells from the grid origin; make the step "
                f"({self.step:g} m) larger, or put the origin {self.origin} nearer."
            )
        return cells[:, 0].astype(np.int64), cells[:, 1].astype(np.int64)


def cell_ids(columns: ArrayLike, rows: ArrayLike) -> NDArray[np.int64]:
    """Return ``column * 10**8 + row``, a cell's number that stays the same when the area grows.

    Rows must be within 50 million of 0.
    """
    return np.asarray(columns, np.int64) * ROW_SPAN + np.asarray(rows, np.int64)


def split_ids(ids: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the columns and rows of cell numbers, the inverse of `cell_ids`."""
    numbers = np.asarray(ids, np.int64)
    columns = (numbers + ROW_SPAN // 2) // ROW_SPAN
    return columns, numbers - columns * ROW_SPAN


def consecutive(first: NDArray[np.int64], size: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the whole numbers of some ranges, one range after the other."""
    ends = np.cumsum(size)
    return np.repeat(first - ends + size, size) + np.arange(size.sum())


def cells_near(
    xy: NDArray[np.float64], *, grid: GridSpec, radius: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the columns and rows of every cell whose centre may be within `radius` of a point.

    Points, shape (n, 2), and radius are in metres. Cells are distinct, ordered by column, then row.
    The square around a point is taken, so that some cells see nothing in the end. InputError if
    there would be more than the memory holds.
    """
    require_step(grid, radius)
    reach = math.ceil(radius / grid.step + 0.5)
    columns, rows = grid.cells_at(xy)
    if len(xy):
        around, box = 2 * reach + 1, (np.ptp(columns) + 2 * reach + 1, np.ptp(rows) + 2 * reach + 1)
        most = min(len(xy) * around**2, int(box[0]) * int(box[1]))
        require_memory(
            most * CELL_BYTES,
            f"up to {most:,} cells of {grid.step:g} m within {radius:g} m of {len(xy):,} points",
            advice="make the step larger or the range smaller, or build in tiles",
        )
    rows, columns = split_ids(_widened(cell_ids(rows, columns), reach))
    return split_ids(_widened(cell_ids(columns, rows), reach))


def require_step(grid: GridSpec, radius: float) -> None:
    """Raise InputError if the step is so small that a range would hold too many cells."""
    if radius > (MAX_REACH - 1) * grid.step:
        raise InputError(
            f"a step of {grid.step:g} m is too small for a range of {radius:g} m; make the step "
            f"larger, at least {radius / (MAX_REACH - 1):.3g} m."
        )


def _widened(ids: NDArray[np.int64], reach: int) -> NDArray[np.int64]:
    """Return all numbers at most `reach` from some of the given ones, ascending."""
    ids = np.sort(ids)
    new = np.append(True, np.diff(ids) > 2 * reach + 1)
    first = ids[new] - reach
    lengths = ids[np.append(new[1:], True)] + reach + 1 - first
    ends = np.cumsum(lengths)
    return np.repeat(first - ends + lengths, lengths) + np.arange(ends[-1])
