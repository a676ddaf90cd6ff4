"""Compiled loops of sight lines against the walls of buildings, which lie in a grid."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from semsig_gis.core import compiled, share_rows

if TYPE_CHECKING:
    from numpy.typing import NDArray

CLEAR, BLOCKED, UNSURE = 0, 1, 2
"""States of a sight line; unsure if it passes so near to the end of a wall that rounding counts."""
CELL_M = 10.0
# Most cells of the grid for a wall; beyond, for buildings far apart, the cells are larger.
MOST_CELLS_A_WALL = 64
# Metres that a wall is longer for the grid, much more than rounding errors.
MARGIN_M = 1e-3
# A point is on a line if the area of its triangle with it is below this part of the products.
ROUNDING = 1e-12


class WallGrid(NamedTuple):
    """Walls of buildings, in the cells of a grid that they may cross.

    `walls`, shape (w, 4), are x and y of both ends in metres relative to `origin`, and `owner` the
    building of each. The walls of cell c, row by row, are ``entries[first[c] : first[c + 1]]``; the
    grid has `columns` and `rows` cells of `size` metres.
    """

    origin: NDArray[np.float64]
    size: float
    columns: int
    rows: int
    first: NDArray[np.int64]
    entries: NDArray[np.int32]
    walls: NDArray[np.float64]
    owner: NDArray[np.int32]


def wall_grid(ends: NDArray[np.float64], owner: NDArray[np.int32]) -> WallGrid:
    """Return the grid of walls: both ends of each, shape (w, 2, 2) in metres, and its building."""
    origin = ends.min(axis=(0, 1)) - 1.0
    walls = (ends - origin).reshape(-1, 4)
    extent = walls.reshape(-1, 2).max(axis=0) + 1.0
    size = max(CELL_M, math.sqrt(float(extent.prod()) / (MOST_CELLS_A_WALL * len(walls))))
    columns, rows = (extent // size).astype(np.int64).tolist()
    columns, rows = columns + 1, rows + 1
    first = np.zeros(columns * rows + 1, np.int64)
    _count_walls(walls, size, columns, first)
    entries = np.empty(first[-1], np.int32)
    _sort_walls(walls, size, columns, first[:-1].copy(), entries)
    return WallGrid(origin, size, columns, rows, first, entries, walls, owner)


@compiled  # pragma: no cover - coverage does not see machine code
def _cells_of(wall: NDArray[np.float64], size: float) -> tuple[int, int, int, int]:
    """Return the first row and the one after the last that a wall may cross, then the columns."""
    ax, ay, bx, by = wall
    return (
        int((min(ay, by) - MARGIN_M) / size),
        int((max(ay, by) + MARGIN_M) / size) + 1,
        int((min(ax, bx) - MARGIN_M) / size),
        int((max(ax, bx) + MARGIN_M) / size) + 1,
    )


@compiled  # pragma: no cover - coverage does not see machine code
def _count_walls(
    walls: NDArray[np.float64], size: float, columns: int, first: NDArray[np.int64]
) -> None:
    """Fill `first` with the sums of the numbers of walls in the cells before each cell."""
    for wall in range(len(walls)):
        south, north, west, east = _cells_of(walls[wall], size)
        for row in range(south, north):
            for column in range(west, east):
                first[row * columns + column + 1] += 1
    for cell in range(1, len(first)):
        first[cell] += first[cell - 1]


@compiled  # pragma: no cover - coverage does not see machine code
def _sort_walls(
    walls: NDArray[np.float64],
    size: float,
    columns: int,
    places: NDArray[np.int64],
    entries: NDArray[np.int32],
) -> None:
    """Fill `entries` with the walls of each cell, the first one at its place."""
    for wall in range(len(walls)):
        south, north, west, east = _cells_of(walls[wall], size)
        for row in range(south, north):
            for column in range(west, east):
                cell = row * columns + column
                entries[places[cell]] = wall
                places[cell] += 1


@compiled  # pragma: no cover - coverage does not see machine code
def _side(  # noqa: PLR0917 - a kernel takes no keywords
    ax: float, ay: float, bx: float, by: float, px: float, py: float
) -> int:
    """Return on which side of a line a point is, 1 or -1; 0 if rounding may decide it."""
    left, right = (bx - ax) * (py - ay), (by - ay) * (px - ax)
    area = left - right
    least = ROUNDING * (abs(left) + abs(right) + 1.0)
    if area > least:
        return 1
    return -1 if area < -least else 0


def cross_walls(
    starts: NDArray[np.float64],
    ends: NDArray[np.float64],
    around: NDArray[np.int32],
    *,
    grid: WallGrid,
) -> NDArray[np.uint8]:
    """Return whether sight lines cross walls: `CLEAR`, `BLOCKED` or `UNSURE`, shape (p,).

    `starts` and `ends` have shape (p, 2), in metres. Walls of the building `around` a viewpoint,
    -1 if there is none, do not count.
    """
    states = np.empty(len(starts), np.uint8)

    def cross(part: NDArray[np.int64]) -> None:
        rows = slice(*part)
        _cross_walls(starts[rows], ends[rows], around[rows], grid, states[rows])

    share_rows(cross, len(starts))
    return states


@compiled  # pragma: no cover - coverage does not see machine code
def _cross_walls(  # noqa: C901
    starts: NDArray[np.float64],
    ends: NDArray[np.float64],
    around: NDArray[np.int32],
    grid: WallGrid,
    states: NDArray[np.uint8],
) -> None:
    """Write the result of `cross_walls` to `states`."""
    size, walls, owner = grid.size, grid.walls, grid.owner
    west, south = grid.origin
    for pair in range(len(starts)):
        ax, ay = starts[pair, 0] - west, starts[pair, 1] - south
        bx, by = ends[pair, 0] - west, ends[pair, 1] - south
        dx, dy = bx - ax, by - ay
        own = around[pair]
        state = CLEAR
        # Go from cell to cell along the line; `next_x` and `next_y` are the shares of the line at
        # which it enters the next column and row.
        column, row = math.floor(ax / size), math.floor(ay / size)
        step_x, step_y = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
        next_x = ((column + (dx > 0)) * size - ax) / dx if dx != 0 else math.inf
        next_y = ((row + (dy > 0)) * size - ay) / dy if dy != 0 else math.inf
        each_x = size / abs(dx) if dx != 0 else math.inf
        each_y = size / abs(dy) if dy != 0 else math.inf
        while True:
            if 0 <= column < grid.columns and 0 <= row < grid.rows:
                cell = row * grid.columns + column
                for entry in range(grid.first[cell], grid.first[cell + 1]):
                    wall = grid.entries[entry]
                    if owner[wall] == own:
                        continue
                    cx, cy, ex, ey = walls[wall]
                    if (
                        max(cx, ex) < min(ax, bx)
                        or min(cx, ex) > max(ax, bx)
                        or max(cy, ey) < min(ay, by)
                        or min(cy, ey) > max(ay, by)
                    ):
                        continue
                    first = _side(ax, ay, bx, by, cx, cy)
                    second = _side(ax, ay, bx, by, ex, ey)
                    if first * second > 0:
                        continue
                    third = _side(cx, cy, ex, ey, ax, ay)
                    fourth = _side(cx, cy, ex, ey, bx, by)
                    if third * fourth > 0:
                        continue
                    if first * second < 0 and third * fourth < 0:
                        state = BLOCKED
                        break
                    state = UNSURE
            if state == BLOCKED or min(next_x, next_y) > 1.0:
                break
            if next_x < next_y:
                column += step_x
                next_x += each_x
            else:
                row += step_y
                next_y += each_y
        states[pair] = state
