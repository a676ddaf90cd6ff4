"""Metric coordinate systems, bearings, the grid of cells, and names of columns."""

from __future__ import annotations

import functools
import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from pyproj import CRS, Geod, Proj, Transformer
from pyproj.exceptions import CRSError

from semsig_gis.core.checks import require_number
from semsig_gis.core.errors import CrsError, InputError
from semsig_gis.core.resources import require_memory

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


FULL_TURN, HALF_TURN = 360.0, 180.0

AnyCrs: TypeAlias = "CRS | str | int"
"""A coordinate system, or text or an EPSG code for it."""


def wrap_degrees(angles: ArrayLike) -> NDArray[np.float64]:
    """Return angles in degrees wrapped to [0, 360)."""
    wrapped = np.mod(np.asarray(angles, dtype=np.float64), FULL_TURN)
    # The remainder of a tiny negative angle rounds to 360 itself.
    return np.where(wrapped >= FULL_TURN, 0.0, wrapped)


def signed_degrees(angles: ArrayLike) -> NDArray[np.float64]:
    """Return angles in degrees wrapped to [-180, 180)."""
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
GROUP = "group"
"""Number of the extended thing that a point belongs to, -1 for an object that is a point."""
HEIGHT = "height"
"""Metres from the ground to the top, NaN if unknown."""
TEXTS = (NAME, "brand", "operator", "ref", "house_number", "street")
"""Columns of what is written on objects, empty where nothing is."""

NOTES = "notes"
"""Key of the warnings in the metadata of a file."""

LICENSES = "licenses"
"""Key of the attribution lines in the `attrs` of a table of buildings or streets."""


def crs_text(crs: AnyCrs) -> str:
    """Return a coordinate system as text, such as ``EPSG:2154`` for the number 2154."""
    if isinstance(crs, CRS):
        return crs.to_string()
    return f"EPSG:{crs}" if isinstance(crs, int) else crs


def require_metric_crs(crs: AnyCrs | None) -> CRS:
    """Return a coordinate system, without its height, if it is metric.

    CrsError if it is missing, unknown, in degrees or feet, a Mercator or cylindrical projection
    (where lengths grow with the latitude: 1.5 times at Paris), or if its axes do not point east
    and north.
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
    problem = _metric_problem(system)
    if problem:
        raise CrsError(f"{system.name} {problem}; {advice}.")
    return system


def _metric_problem(system: CRS) -> str:
    """Return why distances and bearings cannot be computed in a system; empty if they can."""
    if system.is_geographic:
        return "is in degrees"
    if not system.is_projected:
        return f"is {system.type_name.removesuffix(' CRS').lower()}, not projected"
    # The operation of a bound CRS is its datum shift; the projection belongs to its source CRS.
    plane = system.source_crs if system.is_bound else system
    operation = plane.coordinate_operation if plane else None
    method = operation.method_name.lower() if operation else ""
    # Transverse and oblique projections (UTM, the Swiss and Hungarian grids) preserve lengths near
    # their central line.
    if re.search("mercator|cylindrical", method) and not re.search("transverse|oblique", method):
        return "is a Mercator or cylindrical projection, where lengths grow with latitude"
    if any(axis.unit_conversion_factor != 1.0 for axis in system.axis_info):
        return "is not in metres"
    if {axis.direction for axis in system.axis_info} != {"east", "north"}:
        return "has axes that do not point east and north"
    return ""


Bounds = tuple[float, float, float, float]

# Sample points along each side of an extent, where the plane is compared with the ellipsoid.
SAMPLES = 11
# Sample points along each edge of an extent that is transformed to degrees, where it is a curve.
EDGE_POINTS = 21
# Large compared to the rounding of coordinates, small compared to changes of the convergence.
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
    azimuth, _ = _geodesic_step(crs, xy, (0.0, STEP_M))
    return signed_degrees(azimuth)


def crs_label(crs: CRS) -> str:
    """Return the EPSG code of a CRS, or else its name, for messages."""
    code = crs.to_epsg()
    return crs.name if code is None else f"EPSG:{code}"


def epsg_code(crs: CRS) -> int | None:
    """Return the EPSG code of a CRS; None if it has none, or only that of a similar CRS."""
    code = crs.to_epsg()
    same = code is not None and CRS.from_epsg(code).equals(crs, ignore_axis_order=True)
    return code if same else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Distortion:
    """Distortion of angles and lengths by a metric CRS over an extent.

    `convergence` is the minimum and maximum angle from true to grid north, in degrees clockwise;
    `scale` is the minimum and maximum length in the plane of a metre on the ground.
    """

    convergence: tuple[float, float]
    scale: tuple[float, float]

    @property
    def angle(self) -> float:
        """Maximum angle between grid and true north, in degrees."""
        return max(map(abs, self.convergence))

    @property
    def turn(self) -> float:
        """Range of the convergence over the extent, in degrees."""
        return self.convergence[1] - self.convergence[0]

    @property
    def stretch(self) -> float:
        """Maximum relative error of a length."""
        return max(abs(scale - 1.0) for scale in self.scale)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields, ``angle`` and ``stretch`` for JSON; None for infinite values."""

        def rounded(value: float) -> float | None:
            # Further decimals contain only rounding errors.
            return round(value, 7) if math.isfinite(value) else None

        return {
            "convergence": [*map(rounded, self.convergence)],
            "angle": rounded(self.angle),
            "scale": [*map(rounded, self.scale)],
            "stretch": rounded(self.stretch),
        }


def plane_distortion(crs: CRS, bounds: Bounds) -> Distortion:
    """Return the distortion of a metric CRS within ``xmin, ymin, xmax, ymax``.

    It is computed at 11 x 11 points; infinite if one of them is not on the Earth.
    """
    if not np.isfinite(bounds).all():
        return Distortion(convergence=(-math.inf, math.inf), scale=(0.0, math.inf))
    x, y = np.linspace(bounds[:2], bounds[2:], SAMPLES).T
    xy = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    azimuth, north_lengths = _geodesic_step(crs, xy, (0.0, STEP_M))
    _, east_lengths = _geodesic_step(crs, xy, (STEP_M, 0.0))
    angles = signed_degrees(azimuth)
    if np.isnan(angles).any():
        return plane_distortion(crs, (math.nan,) * 4)
    scales = STEP_M / np.concatenate([north_lengths, east_lengths])
    return Distortion(
        convergence=(float(angles.min()), float(angles.max())),
        scale=(float(scales.min()), float(scales.max())),
    )


@functools.lru_cache(maxsize=8)  # creating one takes longer than answering a query
def to_degrees(crs: CRS) -> Transformer:
    """Return the transformer from a CRS to longitude and latitude of WGS 84."""
    return Transformer.from_crs(crs, "EPSG:4326", always_xy=True)


def degree_bounds(crs: CRS, bounds: Bounds) -> Bounds:
    """Return west, south, east and north in degrees of ``xmin, ymin, xmax, ymax`` in a CRS.

    West is greater than east where the box crosses 180 degrees.
    """
    west, south, east, north = to_degrees(crs).transform_bounds(*bounds, densify_pts=EDGE_POINTS)
    return west, south, east, north


def across_180(longitudes: ArrayLike, crs: CRS, *, turn: float = FULL_TURN) -> NDArray[np.float64]:
    """Return longitudes in the area of use of a metric CRS without a jump at 180 degrees.

    Longitudes on the other side of 180 degrees than the middle of the area of use become greater
    than 180 or less than -180. They are unchanged if the CRS has no area of use. `turn` is a full
    turn in their unit: degrees, or x of a web map.
    """
    degrees = np.asarray(longitudes, dtype=np.float64)
    area = crs.area_of_use
    width = 0.0 if area is None else float(wrap_degrees(area.east - area.west))
    if area is None or width == 0.0:  # 0: the area of use goes all the way round
        return degrees
    middle = float(signed_degrees(area.west + width / 2)) * turn / FULL_TURN
    degrees = np.where(degrees - middle > turn / 2, degrees - turn, degrees)
    return np.where(degrees - middle < -turn / 2, degrees + turn, degrees)


def _geodesic_step(
    crs: CRS, xy: ArrayLike, step: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the true azimuth, and the length on the ellipsoid, of a step in the plane."""
    plane, ellipsoid = Proj(crs), crs.get_geod() or Geod(ellps="WGS84")
    start = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    end = start + step
    first = plane(start[:, 0], start[:, 1], inverse=True)
    last = plane(end[:, 0], end[:, 1], inverse=True)
    azimuth, _, metres = ellipsoid.inv(*first, *last)
    return np.where(np.isfinite(metres), azimuth, np.nan), np.asarray(metres)


ROW_SPAN = 10**8
CELL_BYTES = 48  # peak memory of `cells_near` for each cell
LEAST_STEP, MOST_STEP = 0.01, 100_000
# Cells on each side of a point; more would fill the memory.
MAX_REACH = 1000
# Greatest row that fits into a cell number, with room for the cells around a point.
MAX_CELL = ROW_SPAN // 2 - MAX_REACH - 1


@dataclass(frozen=True, slots=True)
class GridSpec:
    """A grid of square cells over a metric CRS.

    Parameters
    ----------
    step : float, default 10
        Side of a cell in metres (the paper's s), from 0.01 to 100,000.
    origin : tuple of (float, float), default (0, 0)
        Lower-left corner of the cell in column 0 and row 0, in metres.

    Raises
    ------
    InputError
        If the step is out of range or the origin is not finite.

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
        """Return the columns and rows of the cells that contain points, shape (n, 2) in metres.

        A point on an edge belongs to the cell east or north of it. InputError if a point is too
        far from the origin for a cell number.
        """
        cells = np.floor((np.asarray(xy, dtype=np.float64) - self.origin) / self.step)
        if not (np.abs(cells) <= MAX_CELL).all():
            raise InputError(
                f"a point lies more than {MAX_CELL:,} cells from the grid origin; make the step "
                f"({self.step:g} m) larger, or put the origin {self.origin} nearer."
            )
        return cells[:, 0].astype(np.int64), cells[:, 1].astype(np.int64)


def cell_ids(columns: ArrayLike, rows: ArrayLike) -> NDArray[np.int64]:
    """Return cell numbers, ``column * 10**8 + row``, which do not change when the area grows.

    Rows are from -50 million to 50 million.
    """
    return np.asarray(columns, np.int64) * ROW_SPAN + np.asarray(rows, np.int64)


def split_ids(ids: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the columns and rows of cell numbers, the inverse of `cell_ids`."""
    numbers = np.asarray(ids, np.int64)
    columns = (numbers + ROW_SPAN // 2) // ROW_SPAN
    return columns, numbers - columns * ROW_SPAN


def consecutive(first: NDArray[np.int64], size: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the concatenated integer ranges that begin at `first` and have `size` elements."""
    ends = np.cumsum(size)
    return np.repeat(first - ends + size, size) + np.arange(size.sum())


def cells_near(
    xy: NDArray[np.float64], *, grid: GridSpec, radius: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the columns and rows of the cells with centres possibly within `radius` of a point.

    Points, shape (n, 2), and radius are in metres. Cells are distinct, ordered by column, then row.
    They fill the square around each point, so some are farther than `radius` from all points.
    InputError if there are more cells than fit into memory.
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
    # Extend the cells in both directions: by rows as minor part of the number, then by columns.
    rows, columns = split_ids(_widened(cell_ids(rows, columns), reach))
    return split_ids(_widened(cell_ids(columns, rows), reach))


def require_step(grid: GridSpec, radius: float) -> None:
    """Raise InputError if the step is too small for a range, which would contain too many cells."""
    if radius > (MAX_REACH - 1) * grid.step:
        raise InputError(
            f"a step of {grid.step:g} m is too small for a range of {radius:g} m; make the step "
            f"larger, at least {radius / (MAX_REACH - 1):.3g} m."
        )


def _widened(ids: NDArray[np.int64], reach: int) -> NDArray[np.int64]:
    """Return all numbers that differ by at most `reach` from one of `ids`, sorted and distinct."""
    ids = np.sort(ids)
    # Numbers with overlapping or adjacent neighbourhoods form one range.
    starts = np.append(True, np.diff(ids) > 2 * reach + 1)
    first = ids[starts] - reach
    return consecutive(first, ids[np.append(starts[1:], True)] + reach + 1 - first)
