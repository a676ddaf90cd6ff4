"""The loop that takes distinct places from the chances of cells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

DIGITS = 1e9  # sums of chances that are equal when rounded to nine decimals are equal


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
