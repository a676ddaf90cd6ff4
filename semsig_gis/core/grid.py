"""The grid of cells in which a city is sampled."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

ROW_SPAN = 10**8
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
        Side of a cell in metres (the paper's s).
    origin : tuple of (float, float), default (0, 0)
        Lower-left corner of the cell in column 0 and row 0, in metres. Only its remainder by
        `step` matters for where cells lie; it also sets where columns and rows count from.

    Raises
    ------
    InputError
        If the step is not a positive number or the origin is not finite.

    Examples
    --------
    >>> GridSpec().viewpoints([76520], [627500]).tolist()
    [[765205.0, 6275005.0]]
    """

    step: float = 10.0
    origin: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:  # noqa: D105
        if not (math.isfinite(self.step) and self.step > 0):
            msg = f"grid step is {self.step} m; give a number of metres above 0."
            raise InputError(msg)
        if np.shape(self.origin) != (2,) or not np.isfinite(self.origin).all():
            msg = f"grid origin is {self.origin}; give two finite coordinates in metres."
            raise InputError(msg)

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
            msg = (
                f"a point lies more than {MAX_CELL:,} cells from the grid origin; make the step "
                f"({self.step:g} m) larger, or put the origin {self.origin} nearer."
            )
            raise InputError(msg)
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


def cells_near(
    xy: NDArray[np.float64], *, grid: GridSpec, radius: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the columns and rows of every cell whose centre may be within `radius` of a point.

    Points, shape (n, 2), and radius are in metres. Cells are distinct, ordered by column, then row.
    The square around a point is taken, so that some cells see nothing in the end.
    """
    require_step(grid, radius)
    reach = math.ceil(radius / grid.step + 0.5)
    columns, rows = grid.cells_at(xy)
    rows, columns = split_ids(_widened(cell_ids(rows, columns), reach))
    return split_ids(_widened(cell_ids(columns, rows), reach))


def require_step(grid: GridSpec, radius: float) -> None:
    """Raise InputError if the step is so small that a range would hold too many cells."""
    if radius > (MAX_REACH - 1) * grid.step:
        msg = (
            f"a step of {grid.step:g} m is too small for a range of {radius:g} m; make the step "
            f"larger, at least {radius / (MAX_REACH - 1):.3g} m."
        )
        raise InputError(msg)


def _widened(ids: NDArray[np.int64], reach: int) -> NDArray[np.int64]:
    """Return all numbers at most `reach` from some of the given ones, ascending."""
    ids = np.sort(ids)
    new = np.append(True, np.diff(ids) > 2 * reach + 1)
    first = ids[new] - reach
    lengths = ids[np.append(new[1:], True)] + reach + 1 - first
    ends = np.cumsum(lengths)
    return np.repeat(first - ends + lengths, lengths) + np.arange(ends[-1])
