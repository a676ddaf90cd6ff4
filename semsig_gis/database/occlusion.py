"""Occlusion: objects that buildings hide, by sight lines against footprints."""

from __future__ import annotations

import copy
import functools
import math
import threading
from typing import TYPE_CHECKING

import lazy_loader
import numpy as np

from semsig_gis.core import HEIGHT, Displayed, InputError, cell_ids, consecutive, share_rows

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import geopandas as gpd
    import shapely
    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.database.sight_lines import WallGrid
else:
    shapely = lazy_loader.load("shapely")

TOLERANCE_M = 0.5
EYE_M = 1.6  # above the ground
SHADOW_M = 150.0
"""Distance within which a building may hide a landmark."""
GAP_M = 0.05  # buildings nearer to each other than twice this are joined
TOUCHING_M = 1.0  # more than the tolerance, and than a gap between joined buildings
# Added to a range: more than rounding errors, the tolerance and the gap between joined buildings.
MARGIN_M = 2.0
PAIRS_PER_BLOCK = 1 << 17
SHAPES_A_PART = 256  # for a thread
SQUARE_M, MOST_COLUMNS = 16.0, 4096  # of the raster in which places are found
TINY = 1e-9
POLYGON_DIMENSIONS = 2


class Footprints(Displayed):
    """The footprints of the buildings of a city, prepared for many sight lines.

    Parameters
    ----------
    polygons : array_like of shapely.Polygon or shapely.MultiPolygon
        Footprints in a metric CRS; each part of a multipolygon counts. Missing and empty ones
        are left out, invalid ones repaired.
    tolerance : float, default 0.5
        Depth in metres to which a sight line may enter buildings without being blocked.
    heights : array_like of float, optional
        Height of each building in metres, NaN if unknown.

    Attributes
    ----------
    repaired : int
        Number of invalid footprints that were repaired.
    roofs : Roofs or None
        The buildings of known height, which may hide landmarks; None if there are none.

    Raises
    ------
    InputError
        If the tolerance is not from 0 up, a geometry is not a polygon or not finite, or no
        footprint remains.

    Examples
    --------
    >>> house = Footprints([shapely.box(0, 0, 10, 10)])
    >>> house.cover([[5.0, 5.0], [11.0, 5.0]]).tolist()
    [True, False]
    """

    def __init__(
        self,
        polygons: NDArray[np.object_] | Sequence[shapely.Geometry | None],
        *,
        tolerance: float = TOLERANCE_M,
        heights: NDArray[np.floating] | None = None,
    ) -> None:
        if not (math.isfinite(tolerance) and tolerance >= 0):
            raise InputError(f"tolerance is {tolerance} m; give a number of metres from 0 up.")
        self.tolerance = float(tolerance)
        self._cores: dict[int, NDArray[np.object_]] = {}
        self._polygons, row, self.repaired = _usable(np.asarray(polygons, dtype=object).reshape(-1))
        if len(self._polygons) == 0:
            raise InputError("no building footprint encloses an area; give polygons.")
        self.roofs = None if heights is None else Roofs.of(self._polygons, heights[row])

    @classmethod
    def of(cls, buildings: gpd.GeoDataFrame) -> Footprints:
        """Return the footprints of a table in a metric CRS, with their heights if it has them."""
        return cls(buildings.geometry.to_numpy(), heights=building_heights(buildings))

    def __len__(self) -> int:  # noqa: D105
        return len(self._polygons)

    def joined(self, other: Footprints) -> Footprints:
        """Return these footprints and others that do not touch them, without preparing them again.

        Both have the same tolerance.
        """
        both = copy.copy(self)
        start = len(self.interiors)
        for name in ("_tree", "walls", "interior_tree"):
            vars(both).pop(name, None)
        vars(both).update(
            repaired=self.repaired + other.repaired,
            interiors=np.concatenate([self.interiors, other.interiors]),
            _polygons=np.concatenate([self._polygons, other._polygons]),
            _widened=np.concatenate([self._widened, other._widened]),
            _cores=self._cores | {start + row: own for row, own in other._cores.items()},
        )
        return both

    def _facts(self) -> dict[str, object]:
        return {
            "buildings": len(self),
            "repaired": self.repaired,
            "tolerance": f"{self.tolerance:g} m",
        }

    @functools.cached_property
    def interiors(self) -> NDArray[np.object_]:
        """Parts of the buildings that are deeper inside than the tolerance, one row per polygon.

        The depth is measured from the common outline of joined buildings, so that there is no gap
        to look through where two share a wall, or are less than ten centimetres apart.
        """
        first, second = self._tree.query(self._widened, predicate="intersects")
        block = _component_labels(first, second, len(self._widened))
        order = np.argsort(block, kind="stable")
        _, number = np.unique(block[order], return_inverse=True)
        # The union of each block of houses takes a sixth of the time of one union of all.
        blocks = np.asarray(shapely.multipolygons(self._widened[order], indices=number))

        def cut_back(some: NDArray[np.object_]) -> NDArray[np.object_]:
            outlines = shapely.union_all(some[:, None], axis=1)
            return np.asarray(shapely.buffer(outlines, -GAP_M - self.tolerance))

        return _polygons_of(_in_threads(cut_back, blocks))

    @functools.cached_property
    def walls(self) -> WallGrid | None:
        """The walls of the interiors; None if there are none."""
        from semsig_gis.database.sight_lines import wall_grid  # noqa: PLC0415 - numba, 0.2 s

        rings, row = shapely.get_rings(self.interiors, return_index=True)
        xy, ring = shapely.get_coordinates(rings, return_index=True)
        joined = ring[1:] == ring[:-1]
        ends = np.stack([xy[:-1], xy[1:]], axis=1)[joined]
        return wall_grid(ends, row[ring[1:][joined]].astype(np.int32)) if len(ends) else None

    @functools.cached_property
    def interior_tree(self) -> shapely.STRtree:
        """The interiors in an R-tree."""
        return shapely.STRtree(self.interiors)

    @functools.cached_property
    def _widened(self) -> NDArray[np.object_]:
        # Neighbours with a tiny gap would have two walls, or cause errors in GEOS.
        return _in_threads(
            lambda some: shapely.buffer(some, GAP_M, join_style="mitre"), self._polygons
        )

    def cores(self, interior: int) -> NDArray[np.object_]:
        """Return the parts of a row of `interiors` that belong to single footprints."""
        if interior not in self._cores:
            whole = self.interiors[interior]
            own = self._tree.query(whole, predicate="intersects")
            self._cores[interior] = _polygons_of(shapely.intersection(whole, self._widened[own]))
        return self._cores[interior]

    @functools.cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree(self._widened)

    def cover(self, xy: ArrayLike) -> NDArray[np.bool_]:
        """Return a mask of the places, shape (n, 2) in metres, in a footprint or on its outline."""
        places = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
        covered = np.zeros(len(places), bool)
        shapely.prepare(self._polygons)
        for start in range(0, len(places), PAIRS_PER_BLOCK):
            block = places[start : start + PAIRS_PER_BLOCK]
            covered[start + _places_in(self._polygons, block)[1]] = True
        return covered


def hidden(
    viewpoints: NDArray[np.float64], objects: NDArray[np.float64], *, footprints: Footprints
) -> NDArray[np.bool_]:
    """Return a mask of the objects that a building hides from their viewpoint.

    Each row of `viewpoints` and `objects` is the two ends of a sight line, shape (p, 2) in metres
    in the CRS of the footprints. An object is hidden if the line enters the buildings deeper than
    the tolerance. A footprint that contains the viewpoint deeper than that (an arcade, a passage, a
    roof on posts) hides nothing.
    """
    starts = np.asarray(viewpoints, dtype=np.float64).reshape(-1, 2)
    ends = np.asarray(objects, dtype=np.float64).reshape(-1, 2)
    from semsig_gis.database.sight_lines import (  # noqa: PLC0415 - numba, 0.2 s
        BLOCKED,
        UNSURE,
        cross_walls,
    )

    walls = footprints.walls
    if walls is None or not len(starts):
        return np.zeros(len(starts), bool)
    # The pairs of one viewpoint follow each other, and the building around it is found once.
    first = np.ones(len(starts), bool)
    x, y = starts.T
    first[1:] = (x[1:] != x[:-1]) | (y[1:] != y[:-1])
    around = np.full(int(first.sum()), -1, np.int32)
    row, place = _places_in(footprints.interiors, starts[first])
    around[place] = row
    around = around[np.cumsum(first) - 1]
    states = cross_walls(starts, ends, around, grid=walls)
    blocked: NDArray[np.bool_] = states == BLOCKED
    rest = np.flatnonzero(~blocked & ((states == UNSURE) | (around >= 0)))
    for low in range(0, len(rest), PAIRS_PER_BLOCK):  # to bound the memory
        part = rest[low : low + PAIRS_PER_BLOCK]
        blocked[part] = _hidden_exactly(starts[part], ends[part], footprints)
    return blocked


def _places_in(
    polygons: NDArray[np.object_], places: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the rows of pairs of a prepared polygon and a place in it or on its outline."""
    x, y = places.T
    low, high = np.array([x.min(), y.min()]), np.array([x.max(), y.max()])
    bounds = shapely.bounds(polygons)
    rows = np.flatnonzero((bounds[:, :2] <= high).all(axis=1) & (bounds[:, 2:] >= low).all(axis=1))
    bounds = bounds[rows]
    # In the order of squares, the places in one column of squares of a box follow each other.
    size = max(SQUARE_M, float((high - low).max()) / MOST_COLUMNS)
    ids = cell_ids(*np.floor(places / size).T)
    order = np.argsort(ids, kind="stable")
    ids = ids[order]
    first, south = np.floor(np.maximum(bounds[:, :2], low) / size).astype(np.int64).T
    last, north = np.floor(np.minimum(bounds[:, 2:], high) / size).astype(np.int64).T
    box = np.repeat(np.arange(len(rows)), last + 1 - first)
    column = consecutive(first, last + 1 - first)
    begin = np.searchsorted(ids, cell_ids(column, south[box]))
    end = np.searchsorted(ids, cell_ids(column, north[box]), side="right")
    box, place = np.repeat(box, end - begin), order[consecutive(begin, end - begin)]
    # By column, because numpy takes several times longer for both at once.
    at_x, at_y = x[place], y[place]
    inside = (at_x >= bounds[:, 0][box]) & (at_x <= bounds[:, 2][box])
    inside &= (at_y >= bounds[:, 1][box]) & (at_y <= bounds[:, 3][box])
    row, place = rows[box[inside]], place[inside]
    inside = shapely.intersects_xy(polygons[row], x[place], y[place])
    return row[inside], place[inside]


def _hidden_exactly(
    starts: NDArray[np.float64], ends: NDArray[np.float64], footprints: Footprints
) -> NDArray[np.bool_]:
    """Return the result of `hidden`, by shapely for every line."""
    blocked = np.zeros(len(starts), bool)
    lines = np.asarray(shapely.linestrings(np.stack([starts, ends], axis=1)))
    # Interiors that a line meets hide its object, unless they contain the viewpoint.
    line, hit = footprints.interior_tree.query(lines, predicate="intersects")
    within = shapely.intersects_xy(footprints.interiors[hit], *starts[line].T)
    blocked[line[~within]] = True
    # From inside a block of houses, the house around the viewpoint does not hide; others do.
    inside = np.unique(line[within])
    if len(inside):
        cores = np.concatenate([footprints.cores(row) for row in np.unique(hit[within])])
        core, line = shapely.STRtree(lines[inside]).query(cores, predicate="intersects")
        within = shapely.intersects_xy(cores[core], *starts[inside[line]].T)
        blocked[inside[line[~within]]] = True
    return blocked


class Roofs:
    """Buildings of known height, which hide landmarks that are lower against the sky.

    `polygons` are valid, and `heights` are in metres above the ground.
    """

    def __init__(self, polygons: NDArray[np.object_], heights: NDArray[np.float64]) -> None:
        self._polygons, self._heights = polygons, heights
        self._bounds = shapely.bounds(polygons).reshape(-1, 4)
        shapely.prepare(polygons)

    @classmethod
    def of(cls, polygons: NDArray[np.object_], heights: NDArray[np.floating]) -> Roofs | None:
        """Return the roofs above the eye of a person, None without any; heights may be NaN."""
        high = heights > EYE_M
        return cls(polygons[high], heights[high].astype(np.float64)) if high.any() else None

    def hide(
        self,
        viewpoints: NDArray[np.float64],
        landmarks: NDArray[np.float64],
        tops: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Return a mask of the landmarks that a building hides from their viewpoint.

        Rows of `viewpoints` and `landmarks`, shape (p, 2), are the ends of sight lines in metres,
        `tops` the heights of the landmarks, infinite if unknown. A building hides a landmark if it
        is within `SHADOW_M` on the line, its roof is higher above the horizon than the top, and it
        contains neither the viewpoint nor the landmark.
        """
        blocked = np.zeros(len(viewpoints), bool)
        away = np.hypot(*(landmarks - viewpoints).T)
        usable = np.flatnonzero((away > 0) & np.isfinite(tops))
        for first in range(0, len(usable), PAIRS_PER_BLOCK):  # to bound the memory
            part = usable[first : first + PAIRS_PER_BLOCK]
            blocked[part] = self._hide(viewpoints[part], landmarks[part], tops[part], away[part])
        return blocked

    def _hide(
        self,
        starts: NDArray[np.float64],
        ends: NDArray[np.float64],
        tops: NDArray[np.float64],
        away: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        steps = (ends - starts) / away[:, None]
        slopes = np.maximum((tops - EYE_M) / away, TINY)
        # A building of height h hides if the line meets it within (h - eye) / slope.
        here = self._near(starts)
        highest = self._heights[here].max(initial=EYE_M)
        limits = np.minimum(np.minimum(away, SHADOW_M), (highest - EYE_M) / slopes)
        lines = _lines(starts, steps, limits)
        hit, line = shapely.STRtree(lines).query(self._polygons[here], predicate="intersects")
        roof = here[hit]
        near = np.minimum(limits[line], (self._heights[roof] - EYE_M) / slopes[line])
        polygons = self._polygons[roof]
        hides = shapely.intersects(polygons, _lines(starts[line], steps[line], near))
        hides &= ~shapely.intersects_xy(polygons, *starts[line].T)
        roof, line = roof[hides], line[hides]
        own = shapely.dwithin(self._polygons[roof], shapely.points(ends[line]), TOUCHING_M)
        blocked = np.zeros(len(starts), bool)
        blocked[line[~own]] = True
        return blocked

    def _near(self, places: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the roofs in the box of some places, widened by `SHADOW_M`."""
        west, south, east, north = self._bounds.T
        low, high = places.min(axis=0) - SHADOW_M, places.max(axis=0) + SHADOW_M
        return np.flatnonzero(
            (east >= low[0]) & (west <= high[0]) & (north >= low[1]) & (south <= high[1])
        )


def _lines(
    starts: NDArray[np.float64], steps: NDArray[np.float64], lengths: NDArray[np.float64]
) -> NDArray[np.object_]:
    """Return lines of some lengths in directions of unit vectors."""
    ends = starts + steps * lengths[:, None]
    return np.asarray(shapely.linestrings(np.stack([starts, ends], axis=1)))


def building_heights(buildings: gpd.GeoDataFrame) -> NDArray[np.float64] | None:
    """Return the heights of buildings in metres, NaN if unknown; None without such a column.

    They are rounded as in a store. A column of a user may be text.
    """
    if HEIGHT not in buildings:
        return None
    from semsig_gis.sources import heights_in  # noqa: PLC0415 - slow, and rarely needed

    return heights_in(buildings[HEIGHT].to_numpy()).astype(np.float32).astype(np.float64)


def _usable(
    shapes: NDArray[np.object_],
) -> tuple[NDArray[np.object_], NDArray[np.int64], int]:
    """Return valid polygons with an area, the row of each, and the number of repaired ones."""
    rows = np.flatnonzero(~(shapely.is_missing(shapes) | shapely.is_empty(shapes)))
    polygons = shapes[rows]
    wrong = np.flatnonzero(
        ~np.isin(
            shapely.get_type_id(polygons),
            [shapely.GeometryType.POLYGON, shapely.GeometryType.MULTIPOLYGON],
        )
    )
    if len(wrong):
        kind = polygons[wrong[0]].geom_type
        raise InputError(
            f"{len(wrong)} building footprints are not polygons (one is a {kind}); give polygons."
        )
    coordinates, row = shapely.get_coordinates(polygons, return_index=True)
    endless = np.unique(row[~np.isfinite(coordinates).all(axis=1)])
    if len(endless):
        raise InputError(
            f"{len(endless)} building footprints have coordinates that are not finite (the first "
            f"is number {endless[0] + 1}); remove them or choose another CRS."
        )
    invalid = ~shapely.is_valid(polygons)
    polygons[invalid] = shapely.make_valid(polygons[invalid])
    # A repaired polygon may be a collection of polygons and lines, even a nested one.
    parts, own = shapely.get_parts(polygons, return_index=True)
    parts, part = shapely.get_parts(parts, return_index=True)
    flat = shapely.area(parts) == 0
    return parts[~flat], rows[own[part[~flat]]], int(invalid.sum())


def _polygons_of(shapes: NDArray[np.object_]) -> NDArray[np.object_]:
    """Return the polygons in shapes, prepared; points and lines are left out."""
    parts = shapely.get_parts(shapely.get_parts(shapes))
    polygons: NDArray[np.object_] = parts[shapely.get_dimensions(parts) == POLYGON_DIMENSIONS]
    shapely.prepare(polygons)
    return polygons


def _in_threads(
    work: Callable[[NDArray[np.object_]], NDArray[np.object_]], shapes: NDArray[np.object_]
) -> NDArray[np.object_]:
    """Return ``work(shapes)``, a shape for each, computed in parallel threads."""
    result = np.empty(len(shapes), object)

    def work_on(part: NDArray[np.int64]) -> None:
        result[slice(*part)] = work(shapes[slice(*part)])

    share_rows(work_on, len(shapes), least=SHAPES_A_PART)
    return result


def _component_labels(
    first: NDArray[np.int64], second: NDArray[np.int64], size: int
) -> NDArray[np.int64]:
    """Return a label for each node of a graph, equal in each connected component (union-find)."""
    label = np.arange(size)
    while True:
        before = label.copy()
        least = np.minimum(label[first], label[second])
        # Both ends of an edge, and the roots of their labels, take the lower label.
        np.minimum.at(label, before[first], least)
        np.minimum.at(label, before[second], least)
        label = label[label]
        if np.array_equal(label, before):
            return label


class NearbyFootprints:
    """The footprints around places in a city, each prepared when a place near it is asked for.

    `polygons` are the footprints of the city in a metric CRS, and `heights` theirs in metres, NaN
    if unknown.
    """

    def __init__(
        self, polygons: NDArray[np.object_], heights: NDArray[np.float64] | None = None
    ) -> None:
        solid = ~_flat(polygons)
        self._polygons = polygons[solid]
        self._roofs = None
        if heights is not None and len(self._polygons):
            shapes, row, _ = _usable(self._polygons.copy())
            self._roofs = Roofs.of(shapes, heights[solid][row])
        self._tree = shapely.STRtree(self._polygons)
        self._ready = np.zeros(len(self._polygons), bool)
        self._footprints: Footprints | None = None
        self._lock = threading.Lock()

    def around(self, places: NDArray[np.float64], *, distance: float) -> Footprints | None:
        """Return at least the footprints within `distance` metres of places, shape (p, 2).

        None if there are none. Those joined to them are included, and all roofs of the city.
        """
        points = np.asarray(shapely.points(places))
        rows = self._tree.query(points, predicate="dwithin", distance=distance)[1]
        if not len(rows) and self._roofs is not None:
            rows = self._tree.query_nearest(points[:1])[1]  # any building, to have the roofs
        if not len(rows):
            return None
        with self._lock:
            new = _with_joined(self._tree, self._polygons, rows[~self._ready[rows]])
            if len(new):
                more = Footprints(self._polygons[new])
                more.roofs = self._roofs
                ready = self._footprints
                self._footprints = more if ready is None else ready.joined(more)
                self._ready[new] = True
            return self._footprints


def buildings_near(
    polygons: NDArray[np.object_], places: NDArray[np.float64], *, distance: float
) -> NDArray[np.int64]:
    """Return the rows of the buildings within `distance` metres of some places, ascending.

    Buildings joined to them are included: occlusion treats a block of houses as one shape.
    """
    tree = shapely.STRtree(polygons)
    rows = tree.query(shapely.points(places), predicate="dwithin", distance=distance)[1]
    return _with_joined(tree, polygons, rows)


def _with_joined(
    tree: shapely.STRtree, polygons: NDArray[np.object_], rows: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return rows of polygons and of all that are joined to them, ascending."""
    mask = np.zeros(len(polygons), bool)
    rows = np.unique(rows)
    while len(rows):
        mask[rows] = True
        touching = tree.query(polygons[rows], predicate="dwithin", distance=TOUCHING_M)[1]
        rows = np.unique(touching[~mask[touching]])
    return np.flatnonzero(mask)


def _flat(polygons: NDArray[np.object_]) -> NDArray[np.bool_]:
    """Return a mask of the polygons without an area, also after repair."""
    flat: NDArray[np.bool_] = shapely.area(polygons) == 0
    flat[flat] = shapely.area(shapely.make_valid(polygons[flat])) == 0
    return flat


def footprints_around(
    read: Callable[[Sequence[float]], gpd.GeoDataFrame], box: Sequence[float]
) -> gpd.GeoDataFrame:
    """Return the footprints that meet a box, and their neighbours, without flat ones.

    `read` returns the footprints that meet a box ``xmin, ymin, xmax, ymax`` in metres.
    """
    near = read(box)
    if len(near):
        low, high = near.total_bounds[:2], near.total_bounds[2:]
        near = read(
            (*(np.minimum(low, box[:2]) - MARGIN_M), *(np.maximum(high, box[2:]) + MARGIN_M))
        )
    # `Footprints` ignores flat polygons too, but raises if there are no others.
    return near[~_flat(near.geometry.to_numpy())]
