"""Choice of viewpoints: the cells in an area, outside of buildings, or along streets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

import lazy_loader
import numpy as np

from semsig_gis.core import CrsError, InputError, nearest_name, require_number

if TYPE_CHECKING:
    from collections.abc import Sequence

    import geopandas as gpd
    import shapely
    from numpy.typing import ArrayLike, NDArray
    from pyproj import CRS

    from semsig_gis.core import GridSpec
    from semsig_gis.database.occlusion import Footprints
else:
    shapely = lazy_loader.load("shapely")

ViewpointMode = Literal["all", "outdoor", "streets"]
STREET_HALF_WIDTH_M = 8.0
LEAST_HALF_WIDTH_M, MOST_HALF_WIDTH_M = 0.05, 200
PLACES_PER_BLOCK = 1 << 18
LINE_DIMENSIONS = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewpointSpec:
    """Which cells are viewpoints.

    Parameters
    ----------
    mode : {"all", "outdoor", "streets"}
        Every cell, cells with the centre outside the building footprints, or cells with the
        centre near the centre line of a street and, if footprints are given, outside them.
    width : float, default 8
        Largest distance of a near centre line in metres: half the width of a street; from 0.05 to
        200.
    area : shapely.Polygon or shapely.MultiPolygon, optional
        In the CRS of the objects; only cells with the centre in it count, in every mode.

    Raises
    ------
    InputError
        If a value is out of its range, or the area encloses nothing.

    Examples
    --------
    >>> ViewpointSpec(mode="streets").width
    8.0
    """

    mode: ViewpointMode = "all"
    width: float = STREET_HALF_WIDTH_M
    area: shapely.Polygon | shapely.MultiPolygon | None = None

    def __post_init__(self) -> None:  # noqa: D105
        modes = get_args(ViewpointMode)
        if self.mode not in modes:
            raise InputError(
                f"viewpoints {self.mode!r} are unknown{nearest_name(str(self.mode), modes)}; give "
                f"one of {', '.join(modes)}."
            )
        require_number(
            "street half-width",
            self.width,
            least=LEAST_HALF_WIDTH_M,
            most=MOST_HALF_WIDTH_M,
            unit="metres",
        )
        if self.area is not None:
            object.__setattr__(self, "area", _checked_area(self.area))

    def to_dict(self) -> dict[str, Any]:
        """Return the choice as values for JSON: ``mode``, ``width`` and ``area`` (WKT or None)."""
        area = None if self.area is None else self.area.wkt
        return {"mode": self.mode, "width": self.width, "area": area}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> ViewpointSpec:
        """Return the choice that `to_dict` wrote; InputError if a value cannot be used."""
        area: Any = None
        if values["area"] is not None:
            try:
                area = shapely.from_wkt(values["area"])
            except shapely.errors.GEOSException as error:
                raise InputError(
                    f"the area of the viewpoints is not WKT ({error}); write a polygon."
                ) from error
        return cls(mode=values["mode"], width=values["width"], area=area)


def _checked_area(area: object) -> shapely.Polygon | shapely.MultiPolygon:
    """Return the area of viewpoints, made valid; InputError if it encloses nothing."""
    shape = shapely.make_valid(area) if isinstance(area, shapely.Geometry) else area
    if not isinstance(shape, shapely.Polygon | shapely.MultiPolygon) or not shape.area > 0:
        raise InputError(f"the area of the viewpoints is {_kind_of(area)}; give a polygon.")
    return shape


def _kind_of(shape: object) -> str:
    return f"a {type(shape).__name__}" if isinstance(shape, shapely.Geometry) else repr(shape)


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
    """Return a mask of the cells with a centre that is allowed as a viewpoint by `spec`.

    A centre on the outline of a building is no viewpoint; one on the edge of a street or of the
    area is. Mode ``"outdoor"`` needs the footprints. Mode ``"streets"`` needs the centre lines in
    metres, and leaves out centres in footprints too; missing and empty lines are ignored. `widths`
    is half the width of each street in metres; ``spec.width`` replaces values that are not finite.
    """
    require_surroundings(spec, footprints, streets)
    places = grid.viewpoints(columns, rows)
    # Each step tests only the cells that the steps before have left, the costly ones last.
    mask = np.ones(len(places), bool)
    if spec.area is not None:
        shapely.prepare(spec.area)
        mask &= shapely.intersects_xy(spec.area, places[:, 0], places[:, 1])
    if spec.mode == "streets" and streets is not None:
        lines, reaches = _lines(streets, widths, spec.width)
        mask[mask] = _near_lines(places[mask], lines, reaches)
    if spec.mode != "all" and footprints is not None:
        mask[mask] = ~footprints.cover(places[mask])
    return mask


def select_elements(
    table: gpd.GeoDataFrame | None, role: Literal["buildings", "streets"]
) -> gpd.GeoDataFrame | None:
    """Return the buildings or streets of a table, which may have OpenStreetMap elements."""
    if table is None:
        return None
    from semsig_gis.objects import select_role  # noqa: PLC0415 - it takes 350 ms to load

    return select_role(table, role)


def reproject(table: gpd.GeoDataFrame, crs: CRS) -> gpd.GeoDataFrame:
    """Return buildings or streets in a CRS; raise CrsError if the table has none."""
    if table.crs is None:
        raise CrsError("buildings or streets have no coordinate reference system; state their crs.")
    return table.to_crs(crs)


def require_surroundings(spec: ViewpointSpec, footprints: object, streets: object) -> None:
    """Raise InputError if the footprints or streets that the choice needs are None."""
    if spec.mode == "outdoor" and footprints is None:
        raise InputError("viewpoints 'outdoor' need the buildings; give their footprints.")
    if spec.mode == "streets" and streets is None:
        raise InputError("viewpoints 'streets' need the streets; give their centre lines.")


def _lines(
    streets: NDArray[np.object_] | Sequence[shapely.Geometry | None],
    widths: ArrayLike | None,
    width: float,
) -> tuple[NDArray[np.object_], NDArray[np.float64]]:
    """Return the usable centre lines and their half-widths in metres."""
    shapes = np.asarray(streets, dtype=object).reshape(-1)
    reaches = np.full(len(shapes), width)
    if widths is not None:
        try:
            own = np.asarray(widths, dtype=np.float64)
        except (TypeError, ValueError):
            own = np.zeros(0)
        if own.shape != shapes.shape or (own <= 0).any():
            raise InputError(
                "the half-widths of streets are not all above 0; give metres for each street."
            )
        reaches = np.where(np.isfinite(own), own, width)
    present = ~(shapely.is_missing(shapes) | shapely.is_empty(shapes))
    lines = shapes[present]
    if len(lines) == 0:
        raise InputError("there is no street; give the centre lines of streets.")
    others = lines[shapely.get_dimensions(lines) != LINE_DIMENSIONS]
    if len(others):
        raise InputError(
            f"the streets contain {_kind_of(others[0])}; give the centre lines of streets."
        )
    return lines, reaches[present]


def _near_lines(
    places: NDArray[np.float64], lines: NDArray[np.object_], reaches: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return a mask of the places that are within the half-width of any line."""
    near = np.zeros(len(places), bool)
    tree = shapely.STRtree(lines)
    widest = reaches.max()
    for start in range(0, len(places), PLACES_PER_BLOCK):
        points = np.asarray(shapely.points(places[start : start + PLACES_PER_BLOCK]))
        # The tree takes one distance, so narrower streets are measured again.
        point, line = tree.query(points, predicate="dwithin", distance=widest)
        narrow = np.flatnonzero(reaches[line] < widest)
        within = np.ones(len(point), bool)
        within[narrow] = shapely.dwithin(
            points[point[narrow]], lines[line[narrow]], reaches[line[narrow]]
        )
        near[start + point[within]] = True
    return near
