"""Compiled loops over the points in range of places, which lie in the cells of a grid."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from semsig_gis.core.jit import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

CELL_M = 16.0
# Most cells of the grid for a point; beyond, for points far apart, the cells are larger.
MOST_CELLS_A_POINT = 4
_ROUNDING = 1e-9


class PointGrid(NamedTuple):
    """Points in metres, in the order of the cells of a grid.

    The points of cell c, row by row, have the numbers ``points[first[c] : first[c + 1]]``, and
    `xy`, shape (n, 2), are their places. The grid has `columns` and `rows` cells of `size` metres
    from a `corner` in the south-west.
    """

    corner: NDArray[np.float64]
    size: float
    columns: int
    rows: int
    first: NDArray[np.int64]
    points: NDArray[np.int64]
    xy: NDArray[np.float64]


def point_grid(xy: NDArray[np.float64]) -> PointGrid:
    """Return the grid of points, shape (n, 2) in metres."""
    corner, extent = xy.min(axis=0), np.ptp(xy, axis=0)
    size = max(
        CELL_M,
        math.sqrt(float(extent.prod()) / (MOST_CELLS_A_POINT * len(xy))),
        float(extent.max()) / (MOST_CELLS_A_POINT * len(xy)),
    )
    columns, rows = (int(side // size) + 1 for side in extent.tolist())
    column, row = ((xy - corner) // size).astype(np.int64).T
    cells = row * columns + column
    points = np.argsort(cells, kind="stable")
    first = np.append(0, np.cumsum(np.bincount(cells, minlength=columns * rows)))
    return PointGrid(corner, size, columns, rows, first, points, xy[points])


@compiled  # pragma: no cover - coverage does not see machine code
def _cells(low: float, high: float, size: float, count: int) -> tuple[int, int]:
    """Return the first cell that an interval meets, and the one after the last."""
    start = math.floor(min(max(low / size, 0.0), float(count)))
    end = math.floor(min(max(high / size, -1.0), float(count - 1))) + 1
    return int(start), int(end)


@compiled  # pragma: no cover - coverage does not see machine code
def near_points(  # noqa: PLR0917 - a kernel takes no keywords
    part: NDArray[np.int64],
    places: NDArray[np.float64],
    grid: PointGrid,
    reach: float,
    ranges: NDArray[np.float64],
    kinds: NDArray[np.uint8],
    starts: NDArray[np.int64],
    counts: NDArray[np.int64],
    points: NDArray[np.int64],
) -> None:
    """Find the points at most their range from the places ``part[0]`` to ``part[1] - 1``.

    The range of a point is that of its kind; kinds with a range of more than `reach` are left out.
    Fills ``points[starts[place] : starts[place] + counts[place]]``, in the order of the grid, and
    `counts`; without `points`, `counts` is filled with the room that each place needs.
    """
    size, nearer = grid.size, reach * reach * (1.0 + _ROUNDING)
    for place in range(part[0], part[1]):
        x, y = places[place]
        east, north = x - grid.corner[0], y - grid.corner[1]
        west_cell, east_cell = _cells(east - reach, east + reach, size, grid.columns)
        south_cell, north_cell = _cells(north - reach, north + reach, size, grid.rows)
        count, start = 0, starts[place]
        for row in range(south_cell, north_cell):
            low = grid.first[row * grid.columns + west_cell]
            high = grid.first[row * grid.columns + east_cell]
            if not len(points):
                count += high - low
                continue
            for entry in range(low, high):
                dx, dy = grid.xy[entry, 0] - x, grid.xy[entry, 1] - y
                # Always written, and kept by counting it: that is faster than a branch.
                points[start + count] = entry
                count += dx * dx + dy * dy <= nearer
        if len(points):
            near, count = count, 0
            for number in range(start, start + near):
                entry = points[number]
                dx, dy = grid.xy[entry, 0] - x, grid.xy[entry, 1] - y
                point = grid.points[entry]
                limit = ranges[kinds[point]]
                square, most = dx * dx + dy * dy, limit * limit
                points[start + count] = point
                inside = square <= most
                if abs(square - most) <= _ROUNDING * most:  # as exact as everywhere else
                    inside = math.hypot(dx, dy) <= limit
                count += inside & (limit <= reach)
        counts[place] = count
