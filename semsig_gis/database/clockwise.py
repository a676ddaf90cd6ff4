"""A compiled loop that measures the objects around viewpoints, and orders them clockwise."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import FULL_TURN, compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

BEARING_DECIMALS = 9
_SCALE = 10.0**BEARING_DECIMALS
_TURN = FULL_TURN * _SCALE
_FEW = 64
_DEGREE = math.pi / 180.0


@compiled  # pragma: no cover - coverage does not see machine code
def measure_clockwise(  # noqa: C901, PLR0912, PLR0917 - a kernel takes no keywords
    part: NDArray[np.int64],
    places: NDArray[np.float64],
    xy: NDArray[np.float64],
    codes: NDArray[np.uint8],
    offsets: NDArray[np.int64],
    objects: NDArray[np.int64],
    ordered: NDArray[np.int64],
    bearings: NDArray[np.float64],
    distances: NDArray[np.float64],
) -> None:
    """Order the `objects` around the places ``part[0]`` to ``part[1] - 1``, and measure them.

    The objects of a place are ``offsets[place] : offsets[place + 1]``; `ordered` are those by
    bearing, distance and class code, equal ones in their order, with `bearings` and `distances`.
    """
    keys, order = np.empty(0, np.int64), np.empty(_FEW, np.int64)
    for place in range(part[0], part[1]):
        first, last = offsets[place], offsets[place + 1]
        count = last - first
        if count > len(keys):
            keys = np.empty(2 * count, np.int64)
        # One integer per object, its bearing and then its number: they are sorted fast.
        bits = 1
        while count >> bits:
            bits += 1
        for number in range(count):
            item = objects[first + number]
            dx, dy = xy[item, 0] - places[place, 0], xy[item, 1] - places[place, 1]
            degrees = math.atan2(dx, dy) / _DEGREE
            if degrees < 0.0:
                degrees += FULL_TURN
            # Processors differ in the last digits of an arctangent, which must not decide ties.
            bearing = np.rint(abs(degrees) * _SCALE)
            if bearing >= _TURN:
                bearing = 0.0
            keys[number] = int(bearing) << bits | number
        if count > _FEW:
            keys[:count].sort()
        else:
            # All pairs are compared, without a branch: faster than sorting a small number.
            for number in range(count):
                key, before = keys[number], 0
                for other in range(count):
                    before += keys[other] < key
                order[before] = key
            keys[:count] = order[:count]
        for number in range(count):
            item = objects[first + (keys[number] & ((1 << bits) - 1))]
            bearing = (keys[number] >> bits) / _SCALE
            distance = math.hypot(xy[item, 0] - places[place, 0], xy[item, 1] - places[place, 1])
            to = first + number
            while to > first and bearings[to - 1] == bearing:
                before = distances[to - 1]
                if before < distance or (
                    before == distance and codes[ordered[to - 1]] <= codes[item]
                ):
                    break
                ordered[to], bearings[to], distances[to] = ordered[to - 1], bearing, before
                to -= 1
            ordered[to], bearings[to], distances[to] = item, bearing, distance
