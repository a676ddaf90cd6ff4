"""Choosing viewpoints: the cells in an area, outside of buildings, or along streets."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from semsig_gis.core import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core import GridSpec
    from semsig_gis.database.occlusion import Footprints
    from semsig_gis.database.sightings import ViewpointSpec

CELLS_A_BLOCK = 1 << 18
CURVES = 1  # dimensions


def checked_area(area: object) -> shapely.Polygon | shapely.MultiPolygon:
    """Return the area of viewpoints, made valid; InputError if it encloses nothing."""
    shape = shapely.make_valid(area) if isinstance(area, BaseGeometry) else area
    if not isinstance(shape, shapely.Polygon | shapely.MultiPolygon) or not shape.area > 0:
        raise InputError(f"the area of the viewpoints is {_brief(area)}; give a polygon.")
    return shape


def read_area(text: str) -> shapely.Geometry:
    """Return what well-known text describes; InputError if it is none."""
    try:
        return shapely.from_wkt(text)
    except shapely.errors.GEOSException as error:
        raise InputError(
            f"the area of the viewpoints is not WKT ({error}); write a polygon."
        ) from error


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
    The footprints are needed for ``"outdoor"``, and the centre lines in metres for ``"streets"``,
    which leaves out what is in footprints too, because nobody stands there; missing and empty lines
    are left out. `widths` holds half the width of each street in metres,
    not finite where ``spec.width`` holds.
    """
    require_surroundings(spec, footprints, streets)
    places = grid.viewpoints(columns, rows)
    chosen = np.ones(len(places), bool)
    if spec.area is not None:
        shapely.prepare(spec.area)
        chosen &= shapely.intersects_xy(spec.area, places[:, 0], places[:, 1])
    if spec.mode == "streets" and streets is not None:
        lines, reaches = _lines(streets, widths, spec.width)
        chosen[chosen] = _within(places[chosen], lines, reaches)
    if spec.mode != "all" and footprints is not None:
        chosen[chosen] = ~footprints.cover(places[chosen])
    return chosen


def require_surroundings(spec: ViewpointSpec, footprints: object, streets: object) -> None:
    """Raise InputError if what viewpoints are chosen by is missing, which is None then."""
    if spec.mode == "outdoor" and footprints is None:
        raise InputError("viewpoints 'outdoor' need the buildings; give their footprints.")
    if spec.mode == "streets" and streets is None:
        raise InputError("viewpoints 'streets' need the streets; give their centre lines.")


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
            raise InputError(
                "the half-widths of streets are not all above 0; give metres for each street."
            )
        reaches = np.where(np.isfinite(own), own, width)
    drawn = ~(shapely.is_missing(given) | shapely.is_empty(given))
    lines = given[drawn]
    if len(lines) == 0 or not (shapely.get_dimensions(lines) == CURVES).all():
        others = lines[shapely.get_dimensions(lines) != CURVES]
        what = f"the streets contain {_brief(others[0])}" if len(others) else "there is no street"
        raise InputError(f"{what}; give the centre lines of streets.")
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
