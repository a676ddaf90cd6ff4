"""Viewpoints: which cells of the grid a view may be taken from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from semsig_gis.core.errors import InputError, nearest_name

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core.grid import GridSpec
    from semsig_gis.database.occlusion import Footprints

Mode = Literal["all", "outdoor", "streets"]
STREET_HALF_WIDTH_M = 8.0
CELLS_A_BLOCK = 1 << 18
CURVES = 1  # dimensions


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewpointSpec:
    """Which cells are viewpoints.

    Parameters
    ----------
    mode : {"all", "outdoor", "streets"}
        Every cell, those whose centre is outside the building footprints, or those whose centre
        is near the centre line of a street.
    width : float, default 8
        How far from a centre line is near, in metres: half the width of a street.
    area : shapely.Polygon or shapely.MultiPolygon, optional
        In the CRS of the objects; only cells whose centre is in it count, in every mode.

    Raises
    ------
    InputError
        If a value is out of its range, or the area encloses nothing.

    Examples
    --------
    >>> ViewpointSpec(mode="streets").width
    8.0
    """

    mode: Mode = "all"
    width: float = STREET_HALF_WIDTH_M
    area: shapely.Polygon | shapely.MultiPolygon | None = None

    def __post_init__(self) -> None:  # noqa: D105
        if self.mode not in get_args(Mode):
            known = ", ".join(get_args(Mode))
            near = nearest_name(str(self.mode), get_args(Mode))
            msg = f"viewpoints {self.mode!r} are unknown{near}; give one of {known}."
            raise InputError(msg)
        if not (math.isfinite(self.width) and self.width > 0):
            msg = f"street half-width is {self.width} m; give a number of metres above 0."
            raise InputError(msg)
        if self.area is not None:
            area = shapely.make_valid(self.area)
            if not isinstance(area, shapely.Polygon | shapely.MultiPolygon) or not area.area > 0:
                msg = f"the area of the viewpoints is {_brief(self.area)}; give a polygon."
                raise InputError(msg)
            object.__setattr__(self, "area", area)

    def to_dict(self) -> dict[str, Any]:
        """Return the choice as values for JSON: ``mode``, ``width`` and ``area`` (WKT or None)."""
        area = None if self.area is None else shapely.to_wkt(self.area, rounding_precision=-1)
        return {"mode": self.mode, "width": self.width, "area": area}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> ViewpointSpec:
        """Return the choice that `to_dict` wrote; InputError if a value cannot be used."""
        try:
            area = None if values["area"] is None else shapely.from_wkt(values["area"])
        except shapely.errors.GEOSException as error:
            msg = f"the area of the viewpoints is not WKT ({error}); write a polygon."
            raise InputError(msg) from error
        return cls(mode=values["mode"], width=values["width"], area=area)


def _brief(shape: object) -> str:
    return f"a {shape.geom_type}" if isinstance(shape, BaseGeometry) else repr(shape)


def choose_viewpoints(
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
    *,
    grid: GridSpec,
    spec: ViewpointSpec,
    footprints: Footprints | None = None,
    streets: NDArray[np.object_] | Sequence[shapely.Geometry | None] | None = None,
    widths: ArrayLike | None = None,
) -> NDArray[np.bool_]:
    """Tell which cells are viewpoints, by their centres.

    A centre on the outline of a building is none; one on the edge of a street or of the area is.
    The footprints are needed for ``"outdoor"``, and the centre lines in metres for ``"streets"``;
    missing and empty lines are left out. `widths` holds half the width of each street in metres,
    not finite where ``spec.width`` holds.
    """
    require_surroundings(spec, footprints, streets)
    places = grid.viewpoints(columns, rows)
    chosen = np.ones(len(places), bool)
    if spec.area is not None:
        shapely.prepare(spec.area)
        chosen &= shapely.intersects_xy(spec.area, places[:, 0], places[:, 1])
    if spec.mode == "outdoor" and footprints is not None:
        chosen[chosen] = ~footprints.cover(places[chosen])
    elif spec.mode == "streets" and streets is not None:
        lines, reaches = _lines(streets, widths, spec.width)
        chosen[chosen] = _within(places[chosen], lines, reaches)
    return chosen


def require_surroundings(spec: ViewpointSpec, footprints: object, streets: object) -> None:
    """Raise InputError if what viewpoints are chosen by is missing, which is None then."""
    if spec.mode == "outdoor" and footprints is None:
        msg = "viewpoints 'outdoor' need the buildings; give their footprints."
        raise InputError(msg)
    if spec.mode == "streets" and streets is None:
        msg = "viewpoints 'streets' need the streets; give their centre lines."
        raise InputError(msg)


def _lines(
    streets: NDArray[np.object_] | Sequence[shapely.Geometry | None],
    widths: ArrayLike | None,
    width: float,
) -> tuple[NDArray[np.object_], NDArray[np.float64]]:
    """Return the centre lines that can be used, and how far each of them reaches."""
    given = np.asarray(streets, dtype=object).reshape(-1)
    reaches = np.full(len(given), width)
    if widths is not None:
        try:
            own = np.asarray(widths, dtype=np.float64)
        except (TypeError, ValueError):
            own = np.zeros(0)
        if own.shape != given.shape or (own <= 0).any():
            msg = "the half-widths of streets are not all above 0; give one in metres a street."
            raise InputError(msg)
        reaches = np.where(np.isfinite(own), own, width)
    drawn = ~(shapely.is_missing(given) | shapely.is_empty(given))
    lines = given[drawn]
    if len(lines) == 0 or not (shapely.get_dimensions(lines) == CURVES).all():
        others = lines[shapely.get_dimensions(lines) != CURVES]
        what = f"the streets hold {_brief(others[0])}" if len(others) else "there is no street"
        msg = f"{what}; give the centre lines of streets."
        raise InputError(msg)
    return lines, reaches[drawn]


def _within(
    places: NDArray[np.float64], lines: NDArray[np.object_], reaches: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Tell which places have a line within the line's reach."""
    near = np.zeros(len(places), bool)
    tree = shapely.STRtree(lines)
    widest = reaches.max()
    for start in range(0, len(places), CELLS_A_BLOCK):
        points = np.asarray(shapely.points(places[start : start + CELLS_A_BLOCK]))
        point, line = tree.query(points, predicate="dwithin", distance=widest)
        narrow = np.flatnonzero(reaches[line] < widest)
        kept = np.ones(len(point), bool)
        kept[narrow] = shapely.dwithin(
            points[point[narrow]], lines[line[narrow]], reaches[line[narrow]]
        )
        near[start + point[kept]] = True
    return near
