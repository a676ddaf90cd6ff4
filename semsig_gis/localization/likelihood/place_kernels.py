"""Compiled loops over the chances of cells: sums in circles, and distinct places."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

DIGITS = 1e9  # sums of chances that are equal when rounded to nine decimals are equal


@compiled
def sum_powers(
    chances: NDArray[np.float64],
    powers: NDArray[np.int64],
    counts: NDArray[np.int64],
    sums: NDArray[np.float64],
) -> None:
    """Add the number and the sum of chances above 0 to `counts` and `sums`, by their `powers`."""
    for cell in range(len(chances)):
        if chances[cell] > 0.0:
            counts[powers[cell]] += 1
            sums[powers[cell]] += chances[cell]


@compiled
def _position(ids: NDArray[np.int64], value: int, start: int) -> int:
    """Return the number of ids below a value, searched near `start`; they are ascending."""
    if start > 0 and ids[start - 1] >= value:
        start = 0
    # Steps twice as long until the value is passed, then halves of the last one.
    step, low, high = 1, start, start
    while high < len(ids) and ids[high] < value:
        low, high = high + 1, high + step
        step *= 2
    high = min(high, len(ids))
    while low < high:
        middle = (low + high) // 2
        if ids[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low


@compiled
def sum_circles(  # noqa: PLR0917 - a kernel takes no keywords
    centres: NDArray[np.int64],
    ids: NDArray[np.int64],
    before: NDArray[np.float64],
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
    sums: NDArray[np.float64],
) -> None:
    """Fill `sums` with the chance in a circle around each of some cells.

    `centres` are ids of cells; ascending ones are faster. `ids` are those of all cells, ascending,
    and `before` the sum of the chances before each of them and of all. The circle has the ids of a
    centre plus `columns`, and up to `rows` more or less in each column.
    """
    lows = np.zeros(len(columns), np.int64)
    for place in range(len(centres)):
        total = 0.0
        for number in range(len(columns)):
            middle = centres[place] + columns[number]
            lows[number] = _position(ids, middle - rows[number], lows[number])
            high = _position(ids, middle + rows[number] + 1, lows[number])
            total += before[high] - before[lows[number]]
        sums[place] = total


@compiled
def take_places(  # noqa: C901, PLR0912, PLR0917 - a kernel takes no keywords
    likely: NDArray[np.int64],
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
    sums: NDArray[np.float64],
    ids: NDArray[np.int64],
    chances: NDArray[np.float64],
    circle: tuple[float, NDArray[np.int64], NDArray[np.int64]],
    span: int,
    centres: NDArray[np.int64],
    cells: NDArray[np.int64],
    totals: NDArray[np.float64],
) -> int:
    """Fill `centres`, `cells` and `totals` with the places of `Posterior.places`.

    Returns their number. `likely` are the cells that may be centres, with their `columns`, `rows`
    and `sums` of chances in the circle, which are changed; `ids` and `chances` are of all cells.
    The circle is that of `Posterior._circle`; `span` is the difference between the ids of two
    columns.
    """
    steps, east, north = circle
    remaining = chances[likely] > 0.0
    used = np.zeros(len(chances), np.bool_)
    inside = np.empty((2 * north + 1).sum(), np.int64)
    for place in range(len(centres)):
        best, most = -1, -1.0
        for number in range(len(likely)):
            rounded = np.rint(sums[number] * DIGITS)
            if remaining[number] and rounded > most:
                best, most = number, rounded
        if best < 0:
            return place
        centres[place], totals[place] = likely[best], 0.0
        size, top = 0, -1.0
        for column in range(len(east)):
            middle = (columns[best] + east[column]) * span + rows[best]
            cell = np.searchsorted(ids, middle - north[column])
            while cell < len(ids) and ids[cell] <= middle + north[column]:
                if not used[cell]:
                    used[cell] = True
                    inside[size] = cell
                    size += 1
                    totals[place] += chances[cell]
                    if chances[cell] > top:
                        cells[place], top = cell, chances[cell]
                cell += 1
        for number in range(len(likely)):
            across, along = columns[number] - columns[best], rows[number] - rows[best]
            away = across * across + along * along
            if away <= steps * steps:
                remaining[number] = False
            if not remaining[number] or away > 4.0 * steps * steps:
                continue
            for cell in inside[:size]:
                across = (ids[cell] + span // 2) // span - columns[number]
                along = ids[cell] - (columns[number] + across) * span - rows[number]
                if across * across + along * along <= steps * steps:
                    sums[number] -= chances[cell]
    return len(centres)
