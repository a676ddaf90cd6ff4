"""The objects seen from points off the centres of cells, computed only from the cells."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from semsig_gis.core import (
    BEARING_UNITS,
    FULL_TURN,
    cell_ids,
    compiled,
    share_rows,
    signed_degrees,
)
from semsig_gis.database import VisibleObjects

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase

CELLS_A_THREAD = 64  # the fewest cells that are worth a thread
# The cell itself and its neighbours, as steps east and north: number 3 * (east + 1) + (north + 1).
AROUND = tuple((east, north) for east in (-1, 0, 1) for north in (-1, 0, 1))
OWN = AROUND.index((0, 0))
SECTORS = 60  # of bearings, by which objects of neighbours are left out quickly
FIRST_ROOM = 4096  # objects
_UNITS_A_SECTOR = np.uint16(BEARING_UNITS // SECTORS)
TINY = 1e-300  # avoids a division by 0: an object at exactly the point counts as north of it


class _CellObjects(NamedTuple):
    """The objects of all cells in units of the database, and what these units are.

    `ranges` is by class code, `metres` by distance unit, `east` and `north` of a metre by bearing
    unit. `own`, by class code, is whether only the cell itself has objects of the class: points of
    an extended thing differ from cell to cell, and far landmarks are rounded to many metres.
    `nearest`, by cell around and sector, is the least distance unit at which an object of that cell
    may be out of range of the cell itself. `step` is the side of a cell in metres.
    """

    offsets: NDArray[np.int64]
    codes: NDArray[np.uint8]
    bearing_units: NDArray[np.uint16]
    distance_units: NDArray[np.uint8]
    ranges: NDArray[np.float64]
    own: NDArray[np.bool_]
    metres: NDArray[np.float64]
    east: NDArray[np.float64]
    north: NDArray[np.float64]
    nearest: NDArray[np.int64]
    step: float


def visible_objects_off_centre(
    database: SignatureDatabase, cells: NDArray[np.int64], points: NDArray[np.float64]
) -> VisibleObjects:
    """Return the views from points off the centres of some cells, computed only from the cells.

    The points, shape (p, 2), are metres to the east and north of the centre, less than a cell; that
    of cell i and point j is view ``i * len(points) + j``. Objects that come into range there are
    taken from the neighbouring cells on that side. If one of these cells is missing, objects that
    are out of range there are kept, at their distance, as are extended things and landmarks, which
    are taken only from the cell itself.
    """
    # The row of each neighbour, -1 where there is none; the cells of a column follow each other.
    columns, rows = database.columns[cells].astype(np.int64), database.rows[cells].astype(np.int64)
    ids, around = database.cell_ids, np.full((len(cells), len(AROUND)), -1)
    for east in np.unique(np.append(np.sign(points[:, 0]), 0)).astype(np.int64).tolist():
        number = np.searchsorted(ids, cell_ids(columns + east, rows - 1))
        for north in (-1, 0, 1):
            there = ids[np.minimum(number, len(ids) - 1)] == cell_ids(columns + east, rows + north)
            around[there, AROUND.index((east, north))] = number[there]
            number += there
    own = np.zeros(256, np.bool_)
    own[[item.code for item in database.taxonomy.classes if item.tall or item.shape != "point"]] = (
        True
    )
    angles = np.radians((np.arange(BEARING_UNITS) + 0.5) * (FULL_TURN / BEARING_UNITS))
    ranges = database.taxonomy.ranges(database.spec.radius)
    # The nearest objects are not at exactly the point.
    metres, step = database.scale.positive_metres, float(database.grid.step)
    objects = _CellObjects(
        offsets=database.offsets,
        codes=database.codes,
        bearing_units=database.bearing_units,
        distance_units=database.distance_units,
        ranges=ranges,
        own=own,
        metres=metres,
        east=np.sin(angles),
        north=np.cos(angles),
        nearest=_nearest_units(metres, step, radius=float(ranges[~own[: len(ranges)]].min())),
        step=step,
    )
    points = np.ascontiguousarray(points, dtype=np.float64)
    parts = {}

    def view_part(part: NDArray[np.int64]) -> None:
        parts[int(part[0])] = _objects_from_points(part, around, points, objects)

    share_rows(view_part, len(cells), least=CELLS_A_THREAD)
    lengths, entries, bearings, distances = (
        np.concatenate(values)
        for values in zip(*(parts[first] for first in sorted(parts)), strict=True)
    )
    return VisibleObjects(
        offsets=np.append(0, np.cumsum(lengths)),
        objects=np.full(len(entries), -1),
        codes=database.codes[entries],
        bearings=bearings,
        distances=distances,
        extents=None if database.extents is None else database.extents[entries],
    )


def _nearest_units(metres: NDArray[np.float64], step: float, *, radius: float) -> NDArray[np.int64]:
    """Return `_CellObjects.nearest` for objects with a range of at least `radius` metres."""
    away = step * np.hypot(*np.transpose(AROUND))
    direction = np.degrees(np.arctan2(*np.transpose(AROUND)))
    middles = (np.arange(SECTORS) + 0.5) * (FULL_TURN / SECTORS)
    # The smallest angle of the sector with the direction of the cell.
    angle = np.abs(signed_degrees(middles - direction[:, None])) - 0.5 * FULL_TURN / SECTORS
    along = away[:, None] * np.cos(np.radians(np.maximum(angle, 0.0)))
    # An object is farther than the radius from the cell itself beyond this distance, or anywhere.
    square = along**2 + radius**2 - away[:, None] ** 2
    beyond = np.where(square > 0.0, np.sqrt(np.maximum(square, 0.0)) - along, 0.0)
    nearest = np.maximum(np.searchsorted(metres, beyond) - 1, 0)  # rounded down
    nearest[OWN] = 0  # its own objects are all in range
    return nearest


@compiled
def _longer(
    entries: NDArray[np.int64],
    bearings: NDArray[np.float64],
    distances: NDArray[np.float64],
    size: int,
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Return copies of the arrays with room for `size` objects."""
    more = np.empty(size, np.int64), np.empty(size), np.empty(size)
    for place in range(len(entries)):
        more[0][place], more[1][place] = entries[place], bearings[place]
        more[2][place] = distances[place]
    return more


@compiled
def _polar(east: NDArray[np.float64], north: NDArray[np.float64]) -> None:
    """Turn metres to the east and north into bearings in degrees and distances, in place.

    The arc tangent has an error of 2e-8 (Abramowitz and Stegun, 4.4.49), and the loop vectorizes.
    """
    for place in range(len(east)):
        x, y = east[place], north[place]
        wide, high = abs(x), abs(y)
        # The polynomial is for the first eighth of a turn; the others follow by symmetry.
        ratio = min(wide, high) / max(wide, high, TINY)
        square = ratio * ratio
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
        angle *= ratio * (180.0 / math.pi)
        angle = 90.0 - angle if wide > high else angle
        angle = 180.0 - angle if y < 0.0 else angle
        angle = FULL_TURN - angle if x < 0.0 else angle
        east[place] = angle if angle < FULL_TURN else 0.0
        north[place] = math.sqrt(x * x + y * y)


@compiled
def _objects_from_points(  # noqa: C901, PLR0912, PLR0915 - a kernel is one function
    part: NDArray[np.int64],
    around: NDArray[np.int64],
    points: NDArray[np.float64],
    objects: _CellObjects,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the views from all points of the cells ``part[0]`` to ``part[1] - 1``.

    `around` has the rows of the cells around each, -1 where there is none. Returns the number of
    objects by point, and the entry, bearing in degrees and distance of each object.
    """
    offsets, codes, step = objects.offsets, objects.codes, objects.step
    bearing_units, distance_units = objects.bearing_units, objects.distance_units
    ranges, metres, east, north = objects.ranges, objects.metres, objects.east, objects.north
    nearest = objects.nearest
    # Working memory for the cell with the most objects around, without functions of numpy, which
    # load slowly.
    most = 0
    for cell in range(part[0], part[1]):
        total = 0
        for row in around[cell]:
            if row >= 0:
                total += offsets[row + 1] - offsets[row]
        most = max(most, total)
    starts = np.empty(len(AROUND) + 1, np.int64)  # where the objects of each cell around start
    x, y, reach = np.empty(most), np.empty(most), np.empty(most)
    numbers, stays = np.empty(most, np.int64), np.empty(most, np.bool_)
    sources = np.empty(4, np.int64)
    lengths = np.empty((part[1] - part[0]) * len(points), np.int64)
    entries, bearings, distances = np.empty(0, np.int64), np.empty(0), np.empty(0)
    view = at = 0
    for cell in range(part[0], part[1]):
        # The objects of the cell and its neighbours, in metres from its centre. If the cell itself
        # sees an object of a neighbour, it is in its own list already.
        size = 0
        for source in range(len(AROUND)):
            starts[source] = size
            row = around[cell, source]
            if row < 0:
                continue
            right, above = (source // 3 - 1) * step, (source % 3 - 1) * step
            for entry in range(offsets[row], offsets[row + 1]):
                angle = bearing_units[entry]
                if distance_units[entry] < nearest[source, angle // _UNITS_A_SECTOR]:
                    continue
                metre = metres[distance_units[entry]]
                x[size], y[size] = metre * east[angle] + right, metre * north[angle] + above
                numbers[size], stays[size] = entry, objects.own[codes[entry]]
                reach[size] = ranges[codes[entry]] ** 2
                if source == OWN or (not stays[size] and x[size] ** 2 + y[size] ** 2 > reach[size]):
                    size += 1
        starts[len(AROUND)] = size
        if at + size * len(points) > len(entries):
            room = 2 * len(entries) + size * len(points) + FIRST_ROOM
            entries, bearings, distances = _longer(entries, bearings, distances, room)
        for point in range(len(points)):
            # The cells that are needed: its own, and the neighbours on the side of the point.
            dx, dy = points[point, 0], points[point, 1]
            side_x, side_y = int(np.sign(dx)), int(np.sign(dy))
            sources[0] = OWN
            used = 1
            if side_x != 0:
                sources[used] = OWN + 3 * side_x
                used += 1
            if side_y != 0:
                sources[used] = OWN + side_y
                used += 1
            if side_x != 0 and side_y != 0:
                sources[used] = OWN + 3 * side_x + side_y
                used += 1
            whole = used > 1
            for number in range(used):
                whole &= around[cell, sources[number]] >= 0
            # The objects in range of the point; without all neighbours, all objects of the cell.
            first = at
            for number in range(used):
                any_distance = number == 0 and not whole
                for entry in range(starts[sources[number]], starts[sources[number] + 1]):
                    away_x, away_y = x[entry] - dx, y[entry] - dy
                    away = away_x**2 + away_y**2
                    if away > reach[entry] and not any_distance and not stays[entry]:
                        continue
                    # An object that an earlier neighbour sees has been listed with that one.
                    twice = False
                    for other in range(1, number):
                        if around[cell, sources[other]] >= 0:
                            there_x = x[entry] - (sources[other] // 3 - 1) * step
                            there_y = y[entry] - (sources[other] % 3 - 1) * step
                            twice |= there_x**2 + there_y**2 <= reach[entry]
                    if twice:
                        continue
                    # East and north for now; `_polar` converts all at once.
                    entries[at], bearings[at], distances[at] = numbers[entry], away_x, away_y
                    at += 1
            lengths[view] = at - first
            view += 1
    _polar(bearings[:at], distances[:at])
    return lengths, entries[:at], bearings[:at], distances[:at]
