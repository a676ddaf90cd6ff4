"""What is seen beside the middles of cells, by the cells alone."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.geometry import FULL_TURN, cell_ids
from semsig_gis.core.jit import compiled
from semsig_gis.core.signature import BEARING_UNITS, DISTANCE_UNITS
from semsig_gis.core.threads import share_rows
from semsig_gis.database.views import Views

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase

CELLS_A_PART = 64  # that are worth a thread
# The cells around a cell, at 3 * (columns + 1) + (rows + 1).
AROUND = tuple((aside, up) for aside in (-1, 0, 1) for up in (-1, 0, 1))
OWN = AROUND.index((0, 0))


def views_aside(
    database: SignatureDatabase, cells: NDArray[np.int64], places: NDArray[np.float64]
) -> Views:
    """Return what is seen from some cells at places other than their middles, by the cells alone.

    The places, shape (p, 2), are metres to the east and north of the middle and less than a cell
    away; that of place i and cell j is view ``i * len(cells) + j``. What comes into range there is
    known from the cells on that side; where one of these is missing, what has left the range is
    kept, at its distance.
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
    ranges = database.taxonomy.ranges(database.spec.radius)
    codes, turns, distances = np.empty(0, np.uint8), np.empty(0), np.empty(0)
    starts = np.zeros(len(places) * len(cells) + 1, np.int64)
    for counted in (False, True):
        if counted:
            np.cumsum(starts, out=starts)
            codes = np.empty(starts[-1], np.uint8)
            turns, distances = np.empty(starts[-1]), np.empty(starts[-1])
        work = partial(
            _look,
            around=around,
            places=np.ascontiguousarray(places, dtype=np.float64),
            step=float(database.grid.step),
            offsets=database.offsets,
            seen_codes=database.codes,
            bearing_units=database.bearing_units,
            distance_units=database.distance_units,
            ranges=ranges,
            # What is nearest is not at the very place.
            metres=np.maximum(np.arange(DISTANCE_UNITS + 1), 0.5) * metre,
            east=np.sin(angles),
            north=np.cos(angles),
            starts=starts,
            codes=codes,
            turns=turns,
            distances=distances,
        )
        share_rows(work, len(cells), least=CELLS_A_PART)
    return Views(
        offsets=starts,
        objects=np.full(len(codes), -1),
        codes=codes,
        bearings=turns,
        distances=distances,
    )


@compiled
def _look(  # noqa: C901, PLR0912, PLR0917 - a kernel takes no keywords
    part: NDArray[np.int64],
    around: NDArray[np.int64],
    places: NDArray[np.float64],
    step: float,
    offsets: NDArray[np.int64],
    seen_codes: NDArray[np.uint8],
    bearing_units: NDArray[np.uint16],
    distance_units: NDArray[np.uint8],
    ranges: NDArray[np.float64],
    metres: NDArray[np.float64],
    east: NDArray[np.float64],
    north: NDArray[np.float64],
    starts: NDArray[np.int64],
    codes: NDArray[np.uint8],
    turns: NDArray[np.float64],
    distances: NDArray[np.float64],
) -> None:
    """Look around at all places of the cells ``part[0]`` to ``part[1] - 1``.

    `around` has the rows of the cells around each, -1 where there is none. Without room in `codes`,
    what is seen in view i is counted in ``starts[i + 1]``; else it is written from ``starts[i]`` on
    to `codes`, `turns` (degrees) and `distances`. `metres` is by distance unit, `east` and `north`
    of a metre by bearing unit, `ranges` by class code.
    """
    counting = len(codes) == 0
    sources = np.empty(4, np.int64)
    for place in range(len(places)):
        dx, dy = places[place, 0], places[place, 1]
        aside, up = int(np.sign(dx)), int(np.sign(dy))
        sources[0] = OWN
        size = 1
        if aside != 0:
            sources[size] = OWN + 3 * aside
            size += 1
        if up != 0:
            sources[size] = OWN + up
            size += 1
        if aside != 0 and up != 0:
            sources[size] = OWN + 3 * aside + up
            size += 1
        for cell in range(part[0], part[1]):
            whole = True
            for one in range(size):
                whole &= around[cell, sources[one]] >= 0
            view = place * len(around) + cell
            at = 0 if counting else starts[view]
            for one in range(size):
                row = around[cell, sources[one]]
                if row < 0:
                    continue
                right = (sources[one] // 3 - 1) * step
                above = (sources[one] % 3 - 1) * step
                for entry in range(offsets[row], offsets[row + 1]):
                    metre, angle = metres[distance_units[entry]], bearing_units[entry]
                    x, y = metre * east[angle] + right, metre * north[angle] + above
                    reach = ranges[seen_codes[entry]] ** 2
                    away = (x - dx) ** 2 + (y - dy) ** 2
                    if away > reach and not (one == 0 and (size == 1 or not whole)):
                        continue
                    twice = False
                    for other in range(one):  # what these see, too, is there already
                        if around[cell, sources[other]] >= 0:
                            there_x = (sources[other] // 3 - 1) * step
                            there_y = (sources[other] % 3 - 1) * step
                            twice |= (x - there_x) ** 2 + (y - there_y) ** 2 <= reach
                    if twice:
                        continue
                    if not counting:
                        turn = math.degrees(math.atan2(x - dx, y - dy))
                        codes[at] = seen_codes[entry]
                        turns[at] = turn if turn >= 0.0 else turn + FULL_TURN
                        distances[at] = math.sqrt(away)
                    at += 1
            if counting:
                starts[view + 1] = at
