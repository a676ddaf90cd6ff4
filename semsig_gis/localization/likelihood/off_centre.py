"""What is seen from places beside the centres of cells, computed only from the cells."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import BEARING_UNITS, DISTANCE_UNITS, FULL_TURN, cell_ids, compiled, share_rows
from semsig_gis.database import VisibleObjects

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase

CELLS_A_PART = 64  # that are worth a thread
# The cells around a cell, at 3 * (columns + 1) + (rows + 1).
AROUND = tuple((aside, up) for aside in (-1, 0, 1) for up in (-1, 0, 1))
OWN = AROUND.index((0, 0))
FIRST_ROOM = 4096  # entries
TINY = 1e-300  # an object at exactly the place counts as north of it


def views_aside(
    database: SignatureDatabase, cells: NDArray[np.int64], places: NDArray[np.float64]
) -> VisibleObjects:
    """Return what is seen from places beside the centres of some cells, using only the cells.

    The places, shape (p, 2), are metres to the east and north of the centre and less than a cell
    away; that of cell i and place j is view ``i * len(places) + j``. Objects that come into range
    there are taken from the neighbouring cells on that side. If one of these cells is missing,
    objects that have left the range are kept, at their distance.
    """
    columns, rows = database.columns[cells].astype(np.int64), database.rows[cells].astype(np.int64)
    ids, around = database.cell_ids, np.full((len(cells), len(AROUND)), -1)
    for aside in np.unique(np.append(np.sign(places[:, 0]), 0)).astype(np.int64).tolist():
        number = np.searchsorted(ids, cell_ids(columns + aside, rows - 1))
        for up in (-1, 0, 1):  # the cells of a column follow each other
            there = ids[np.minimum(number, len(ids) - 1)] == cell_ids(columns + aside, rows + up)
            around[there, AROUND.index((aside, up))] = number[there]
            number += there
    angles = np.radians((np.arange(BEARING_UNITS) + 0.5) * (FULL_TURN / BEARING_UNITS))
    metre = database.reach / DISTANCE_UNITS
    parts = {}

    def look(part: NDArray[np.int64]) -> None:
        parts[int(part[0])] = _look(
            part,
            around,
            np.ascontiguousarray(places, dtype=np.float64),
            float(database.grid.step),
            database.offsets,
            database.codes,
            database.bearing_units,
            database.distance_units,
            database.taxonomy.ranges(database.spec.radius),
            # The nearest objects are not at exactly the place.
            np.maximum(np.arange(DISTANCE_UNITS + 1), 0.5) * metre,
            np.sin(angles),
            np.cos(angles),
        )

    share_rows(look, len(cells), least=CELLS_A_PART)
    lengths, codes, bearings, distances = (
        np.concatenate(values)
        for values in zip(*(parts[first] for first in sorted(parts)), strict=True)
    )
    return VisibleObjects(
        offsets=np.append(0, np.cumsum(lengths)),
        objects=np.full(len(codes), -1),
        codes=codes,
        bearings=bearings,
        distances=distances,
    )


@compiled
def _longer(
    codes: NDArray[np.uint8], turns: NDArray[np.float64], distances: NDArray[np.float64], size: int
) -> tuple[NDArray[np.uint8], NDArray[np.float64], NDArray[np.float64]]:
    """Return the arrays with room for so many."""
    more = np.empty(size, np.uint8), np.empty(size), np.empty(size)
    for one in range(len(codes)):
        more[0][one], more[1][one], more[2][one] = codes[one], turns[one], distances[one]
    return more


@compiled
def _polar(east: NDArray[np.float64], north: NDArray[np.float64]) -> None:
    """Turn metres to the east and north into bearings in degrees and distances, in place.

    The arc tangent is right to 2e-8 (Abramowitz and Stegun, 4.4.49), and many are taken at once.
    """
    for one in range(len(east)):
        x, y = east[one], north[one]
        wide, high = abs(x), abs(y)
        part = min(wide, high) / max(wide, high, TINY)
        square = part * part
        angle = 0.0028662257
        for factor in (
            -0.0161657367,
            0.0429096138,
            -0.0752896400,
            0.1065626393,
            -0.1420889944,
            0.1999355085,
            -0.3333314528,
            1.0,
        ):
            angle = angle * square + factor
        angle *= part * (180.0 / math.pi)
        angle = 90.0 - angle if wide > high else angle
        angle = 180.0 - angle if y < 0.0 else angle
        angle = FULL_TURN - angle if x < 0.0 else angle
        east[one] = angle if angle < FULL_TURN else 0.0
        north[one] = math.sqrt(x * x + y * y)


@compiled
def _look(  # noqa: C901, PLR0912, PLR0915, PLR0917 - a kernel takes no keywords
    part: NDArray[np.int64],
    around: NDArray[np.int64],
    places: NDArray[np.float64],
    step: float,
    offsets: NDArray[np.int64],
    codes: NDArray[np.uint8],
    bearing_units: NDArray[np.uint16],
    distance_units: NDArray[np.uint8],
    ranges: NDArray[np.float64],
    metres: NDArray[np.float64],
    east: NDArray[np.float64],
    north: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.uint8], NDArray[np.float64], NDArray[np.float64]]:
    """Look around at all places of the cells ``part[0]`` to ``part[1] - 1``.

    `around` has the rows of the cells around each, -1 where there is none. `metres` is by distance
    unit, `east` and `north` of a metre by bearing unit, `ranges` by class code. Returns how much is
    seen from each place, and the class code, bearing in degrees and distance of all that is.
    """
    here = np.empty(len(AROUND) + 1, np.int64)  # where the entries of each cell around start
    most = 0  # without functions of numpy, which load slowly
    for cell in range(part[0], part[1]):
        total = 0
        for row in around[cell]:
            if row >= 0:
                total += offsets[row + 1] - offsets[row]
        most = max(most, total)
    x, y, reach = np.empty(most), np.empty(most), np.empty(most)
    kinds = np.empty(most, np.uint8)
    sources = np.empty(4, np.int64)
    lengths = np.empty((part[1] - part[0]) * len(places), np.int64)
    seen, turns, distances = np.empty(0, np.uint8), np.empty(0), np.empty(0)
    view = at = 0
    for cell in range(part[0], part[1]):
        size = 0
        for source in range(len(AROUND)):
            here[source] = size
            row = around[cell, source]
            if row < 0:
                continue
            right, above = (source // 3 - 1) * step, (source % 3 - 1) * step
            for entry in range(offsets[row], offsets[row + 1]):
                metre, angle = metres[distance_units[entry]], bearing_units[entry]
                x[size], y[size] = metre * east[angle] + right, metre * north[angle] + above
                kinds[size] = codes[entry]
                reach[size] = ranges[codes[entry]] ** 2
                # What the cell itself sees as well is there already.
                if source == OWN or x[size] ** 2 + y[size] ** 2 > reach[size]:
                    size += 1
        here[len(AROUND)] = size
        if at + size * len(places) > len(seen):
            room = 2 * len(seen) + size * len(places) + FIRST_ROOM
            seen, turns, distances = _longer(seen, turns, distances, room)
        for place in range(len(places)):
            dx, dy = places[place, 0], places[place, 1]
            aside, up = int(np.sign(dx)), int(np.sign(dy))
            sources[0] = OWN
            used = 1
            if aside != 0:
                sources[used] = OWN + 3 * aside
                used += 1
            if up != 0:
                sources[used] = OWN + up
                used += 1
            if aside != 0 and up != 0:
                sources[used] = OWN + 3 * aside + up
                used += 1
            whole = used > 1
            for one in range(used):
                whole &= around[cell, sources[one]] >= 0
            first = at
            for one in range(used):
                kept = one == 0 and not whole
                for entry in range(here[sources[one]], here[sources[one] + 1]):
                    away_x, away_y = x[entry] - dx, y[entry] - dy
                    away = away_x**2 + away_y**2
                    if away > reach[entry] and not kept:
                        continue
                    twice = False
                    for other in range(1, one):
                        if around[cell, sources[other]] >= 0:
                            there_x = x[entry] - (sources[other] // 3 - 1) * step
                            there_y = y[entry] - (sources[other] % 3 - 1) * step
                            twice |= there_x**2 + there_y**2 <= reach[entry]
                    if twice:
                        continue
                    # East and north for now.
                    seen[at], turns[at], distances[at] = kinds[entry], away_x, away_y
                    at += 1
            lengths[view] = at - first
            view += 1
    _polar(turns[:at], distances[:at])
    return lengths, seen[:at], turns[:at], distances[:at]
