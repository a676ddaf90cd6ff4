"""Extended things: lines and outlines of areas as points, with a group number for each thing."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from semsig_gis.objects.connected import connected

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

# Points of a thing are at most this far apart.
SPACING_M = 5.0
# Lines with ends this near to each other continue each other.
TOUCH_M = 0.1
RING_POINTS = 4  # at least
AREA_DIMENSIONS = 2


class ThingPoints(NamedTuple):
    """Points of things: the row of the thing, the position, and the group, from 0."""

    rows: NDArray[np.int64]
    xy: NDArray[np.float64]
    groups: NDArray[np.int64]


def thing_points(
    shapes: NDArray[np.object_],
    codes: NDArray[np.uint8],
    names: Sequence[str],
    *,
    keys: Sequence[str],
    joins: NDArray[np.bool_],
) -> ThingPoints:
    """Return the points along lines and outlines.

    Shapes are in a metric CRS. Both ends of a line are points, and no two neighbours are more than
    5 m apart. Lines of a class that continue each other, where `joins` is true, are one thing:
    those of the same name with touching ends, and those without a name where just two end. Rows
    of a class with the same key, unless it is empty, are one thing, too.
    """
    parts, row = shapely.get_parts(shapes, return_index=True)
    areas = shapely.get_dimensions(parts) == AREA_DIMENSIONS
    parts[areas] = shapely.boundary(parts[areas])
    parts, whole = shapely.get_parts(parts, return_index=True)  # the rings of an area with holes
    row = row[whole]
    part, xy = _along(parts)
    group = connected(
        len(codes),
        itertools.chain(_same_keys(codes, keys), _continued(parts, row, codes, names, joins)),
    )
    # Number the groups without gaps, in the order of the rows.
    _, first, groups = np.unique(group[row[part]], return_index=True, return_inverse=True)
    order = np.empty(len(first), np.int64)
    order[np.argsort(first)] = np.arange(len(first))
    return ThingPoints(row[part], xy, order[groups])


def _along(parts: NDArray[np.object_]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return points along lines: the line of each, and the position."""
    lengths = shapely.length(parts)
    closed = shapely.is_closed(parts) & (lengths > 0)
    steps = np.ceil(lengths / SPACING_M).astype(np.int64)
    steps = np.maximum(steps, np.where(closed, RING_POINTS, np.where(lengths > 0, 1, 0)))
    counts = steps + ~closed  # the last point of a ring is its first
    part = np.repeat(np.arange(len(parts)), counts)
    number = np.arange(len(part)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = number / np.maximum(steps, 1)[part]
    places = parts[part]
    lines = shapely.get_dimensions(places) == 1
    places[lines] = shapely.line_interpolate_point(places[lines], share[lines], normalized=True)
    return part, shapely.get_coordinates(places)


def _same_keys(codes: NDArray[np.uint8], keys: Sequence[str]) -> Iterator[tuple[int, int]]:
    """Yield pairs of rows of a class with the same key."""
    first: dict[tuple[int, str], int] = {}
    for row, key in enumerate(zip(codes.tolist(), keys, strict=True)):
        if key[1]:
            yield first.setdefault(key, row), row


def _continued(
    parts: NDArray[np.object_],
    row: NDArray[np.int64],
    codes: NDArray[np.uint8],
    names: Sequence[str],
    joins: NDArray[np.bool_],
) -> Iterator[tuple[int, int]]:
    """Yield pairs of rows with lines that continue each other."""
    ends_of: dict[tuple[int, str, int, int], list[int]] = {}
    open_lines = joins[row] & ~shapely.is_closed(parts) & (shapely.get_dimensions(parts) == 1)
    for index in (0, -1):
        points = shapely.get_coordinates(shapely.get_point(parts[open_lines], index))
        places = np.rint(points / TOUCH_M).astype(np.int64).tolist()
        for thing, (x, y) in zip(row[open_lines].tolist(), places, strict=True):
            ends_of.setdefault((int(codes[thing]), names[thing], x, y), []).append(thing)
    for (_, name, _, _), (first, *others) in ends_of.items():
        if name or len(others) == 1:
            yield from ((first, other) for other in others)
