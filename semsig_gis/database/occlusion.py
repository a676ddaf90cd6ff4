"""What buildings hide: sight lines against footprints."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import numpy as np
import shapely

from semsig_gis.core import Displayed, InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

TOLERANCE_M = 0.5
# Houses nearer to each other than twice this share a wall.
GAP_M = 0.05
# More than the tolerance, and than what counts as a gap between buildings.
TOUCHING_M = 1.0
PAIRS_A_BLOCK = 1 << 17
POLYGONAL = 2  # dimensions


class Footprints(Displayed):
    """The footprints of the buildings of a city, ready to be looked at many times.

    Parameters
    ----------
    polygons : array_like of shapely.Polygon or shapely.MultiPolygon
        Footprints in a metric CRS; the parts of a multipolygon count as several. Missing and
        empty ones are left out, invalid ones repaired.
    tolerance : float, default 0.5
        How deep inside the buildings, in metres, a sight line may run without being blocked.

    Attributes
    ----------
    repaired : int
        How many footprints were invalid and have been repaired.

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
    ) -> None:
        if not (math.isfinite(tolerance) and tolerance >= 0):
            raise InputError(f"tolerance is {tolerance} m; give a number of metres from 0 up.")
        self.tolerance = float(tolerance)
        self._cores: dict[int, NDArray[np.object_]] = {}
        self._polygons, self.repaired = _usable(np.asarray(polygons, dtype=object).reshape(-1))
        if len(self._polygons) == 0:
            raise InputError("no building footprint encloses an area; give polygons.")

    def __len__(self) -> int:  # noqa: D105
        return len(self._polygons)

    def _facts(self) -> dict[str, object]:
        return {
            "buildings": len(self),
            "repaired": self.repaired,
            "tolerance": f"{self.tolerance:g} m",
        }

    @functools.cached_property
    def interiors(self) -> NDArray[np.object_]:
        """What is deeper inside the buildings than the tolerance, block by block of houses.

        The depth is from their common outline, so that there is no gap to look through where two of
        them share a wall, or are less than ten centimetres apart.
        """
        first, second = self._tree.query(self._widened, predicate="intersects")
        block = _joined(first, second, len(self._widened))
        order = np.argsort(block, kind="stable")
        _, number = np.unique(block[order], return_inverse=True)
        # Houses of one block at a time, which takes a sixth of the time of all at once.
        blocks = np.asarray(shapely.multipolygons(self._widened[order], indices=number))
        outlines = shapely.union_all(blocks[:, None], axis=1)
        return _polygons_of(np.asarray(shapely.buffer(outlines, -GAP_M - self.tolerance)))

    @functools.cached_property
    def _widened(self) -> NDArray[np.object_]:
        # Neighbours that were drawn hair's breadths apart would be two walls, or confuse GEOS.
        widened: NDArray[np.object_] = shapely.buffer(self._polygons, GAP_M, join_style="mitre")
        return widened

    def cores(self, interior: int) -> NDArray[np.object_]:
        """Return what each footprint has of the interior with a number in `interiors`, in parts."""
        if interior not in self._cores:
            whole = self.interiors[interior]
            own = self._tree.query(whole, predicate="intersects")
            self._cores[interior] = _polygons_of(shapely.intersection(whole, self._widened[own]))
        return self._cores[interior]

    @functools.cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree(self._widened)

    def cover(self, xy: ArrayLike) -> NDArray[np.bool_]:
        """Tell which places, shape (n, 2) in metres, are in a footprint or on its outline."""
        places = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
        covered = np.zeros(len(places), bool)
        shapely.prepare(self._polygons)
        for start in range(0, len(places), PAIRS_A_BLOCK):
            points = np.asarray(shapely.points(places[start : start + PAIRS_A_BLOCK]))
            inside = shapely.STRtree(points).query(self._polygons, predicate="intersects")[1]
            covered[start + inside] = True
        return covered


def hidden(
    viewpoints: NDArray[np.float64], objects: NDArray[np.float64], *, footprints: Footprints
) -> NDArray[np.bool_]:
    """Tell which objects a building hides from the viewpoint they are looked at from.

    Row by row, `viewpoints` and `objects` are the two ends of a sight line, shape (p, 2) in metres
    in the CRS of the footprints. An object is hidden when the line comes deeper into the buildings
    than the tolerance; a footprint that has the viewpoint in it deeper than that (an arcade, a
    passage, a roof on posts) does not hide.
    """
    starts = np.asarray(viewpoints, dtype=np.float64).reshape(-1, 2)
    ends = np.asarray(objects, dtype=np.float64).reshape(-1, 2)
    blocked = np.zeros(len(starts), bool)
    west, south, east, north = shapely.bounds(footprints.interiors).reshape(-1, 4).T
    for first in range(0, len(starts), PAIRS_A_BLOCK):  # so that memory stays flat
        part = slice(first, first + PAIRS_A_BLOCK)
        low = np.minimum(starts[part], ends[part]).min(axis=0)
        high = np.maximum(starts[part], ends[part]).max(axis=0)
        # Only the part of a large city that these pairs are in.
        here = np.flatnonzero(
            (east >= low[0]) & (west <= high[0]) & (north >= low[1]) & (south <= high[1])
        )
        interiors = footprints.interiors[here]
        pair = first + _near(starts[part], ends[part], interiors)
        lines = np.asarray(shapely.linestrings(np.stack([starts[pair], ends[pair]], axis=1)))
        # The lines make the tree, so that it is the interiors that are prepared.
        hit, line = shapely.STRtree(lines).query(interiors, predicate="intersects")
        x, y = starts[pair[line]].T
        within = shapely.intersects_xy(interiors[hit], x, y)
        blocked[pair[line[~within]]] = True
        # From within a block of houses, the house around does not hide, and the others do.
        inside = np.unique(line[within])
        if len(inside):
            cores = np.concatenate([footprints.cores(row) for row in here[np.unique(hit[within])]])
            core, line = shapely.STRtree(lines[inside]).query(cores, predicate="intersects")
            x, y = starts[pair[inside[line]]].T
            within = shapely.intersects_xy(cores[core], x, y)
            blocked[pair[inside[line[~within]]]] = True
    return blocked


def _near(
    starts: NDArray[np.float64], ends: NDArray[np.float64], interiors: NDArray[np.object_]
) -> NDArray[np.int64]:
    """Return the pairs whose viewpoint may have an interior within reach; only they get lines."""
    # The pairs of one viewpoint follow each other.
    first = np.ones(len(starts), bool)
    first[1:] = (starts[1:] != starts[:-1]).any(axis=1)
    reach = np.hypot(*(ends - starts).T).max()
    places = shapely.STRtree(np.asarray(shapely.points(starts[first])))
    near = np.zeros(int(first.sum()), bool)
    around = shapely.bounds(interiors) + np.array([-1, -1, 1, 1]) * (reach + 1.0)
    near[places.query(np.asarray(shapely.box(*around.T)))[1]] = True
    return np.flatnonzero(near[np.cumsum(first) - 1])


def _usable(given: NDArray[np.object_]) -> tuple[NDArray[np.object_], int]:
    """Return the polygons of a city in valid form, and how many had to be repaired."""
    polygons = given[~(shapely.is_missing(given) | shapely.is_empty(given))]
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
    # A repaired polygon may be a collection of polygons and lines, even one within another.
    parts = shapely.get_parts(shapely.get_parts(polygons))
    return parts[shapely.area(parts) > 0], int(invalid.sum())


def _polygons_of(shapes: NDArray[np.object_]) -> NDArray[np.object_]:
    """Return the polygons that shapes consist of; what has no area is left out."""
    parts = shapely.get_parts(shapely.get_parts(shapes))
    found: NDArray[np.object_] = parts[shapely.get_dimensions(parts) == POLYGONAL]
    shapely.prepare(found)
    return found


def _joined(first: NDArray[np.int64], second: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    """Return a label for each of so many things, the same for those that pairs join in a chain."""
    label = np.arange(size)
    while True:
        before = label.copy()
        least = np.minimum(label[first], label[second])
        # Both ends, and what they are joined to so far, take the lower label.
        np.minimum.at(label, before[first], least)
        np.minimum.at(label, before[second], least)
        label = label[label]
        if np.array_equal(label, before):
            return label


def buildings_near(
    polygons: NDArray[np.object_], places: NDArray[np.float64], *, distance: float
) -> NDArray[np.int64]:
    """Return the rows of the buildings around some places, ascending; `distance` is in metres.

    All that they are joined to are among them: occlusion treats a block of houses as one shape.
    """
    tree = shapely.STRtree(polygons)
    chosen = np.zeros(len(polygons), bool)
    found = tree.query(shapely.points(places), predicate="dwithin", distance=distance)[1]
    while len(found):
        chosen[found] = True
        touching = tree.query(polygons[found], predicate="dwithin", distance=TOUCHING_M)[1]
        found = np.unique(touching[~chosen[touching]])
    return np.flatnonzero(chosen)
