"""What is seen from a viewpoint: the street objects within range."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from semsig_gis.core.geometry import FULL_TURN, bearings
from semsig_gis.core.grid import cell_ids, split_ids
from semsig_gis.database.database import BEARING_UNITS
from semsig_gis.database.occlusion import hidden

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from semsig_gis.core.grid import GridSpec
    from semsig_gis.core.rtree import ObjectIndex, PackedIndex, StoredIndex
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.database.occlusion import Footprints
    from semsig_gis.objects.table import StreetObjects


BEARING_DECIMALS = 9


# So many that the arrays of a block stay in the cache of a processor.
CELLS_A_BLOCK = 1 << 14


PAIRS_A_BLOCK = 1 << 20


TILE_CELLS = 16


# More than any rounding, so that the measured distance decides alone.
ROUNDING_CELLS = 1e-3


@dataclass(frozen=True, eq=False, slots=True)
class Sightings:
    """Pairs of a viewpoint and an object that is seen from it, both as row numbers.

    `bearing` is in degrees clockwise from grid north, [0, 360), to nine decimals, `distance` in
    metres.
    """

    viewpoint: NDArray[np.int64]
    object: NDArray[np.int64]
    bearing: NDArray[np.float64]
    distance: NDArray[np.float64]

    def only(self, kept: NDArray[np.bool_] | NDArray[np.int64]) -> Sightings:
        """Return some of the pairs, by mask or number, or all of them in another order."""
        return Sightings(
            self.viewpoint[kept], self.object[kept], self.bearing[kept], self.distance[kept]
        )


def visible_objects(
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
    objects: NDArray[np.float64],
    *,
    grid: GridSpec,
    index: PackedIndex,
    ranges: NDArray[np.float64],
) -> Iterator[tuple[slice, Sightings]]:
    """Yield what is seen from the centres of grid cells, block by block.

    The cells are distinct and ordered by column and row. `index` is an R-tree over `objects`,
    positions in metres; `ranges` tells from how far each object is seen: its visibility range R in
    metres. Each block is a slice of the cells and the pairs within range (paper, section on
    semantic signatures), viewpoints counted from the first cell of the block, in any order.

    The R-tree is asked which objects are near each tile of cells. Around such an object, the cells
    of one column that see it follow each other, so that two searches in the list of cells find them
    all. The distance of every pair is then measured.
    """
    cells = len(columns)
    starts = range(0, cells, CELLS_A_BLOCK)
    blocks = [slice(start, min(start + CELLS_A_BLOCK, cells)) for start in reversed(starts)]
    while blocks:
        block = blocks.pop()
        here = columns[block], rows[block]
        runs = _runs(*here, objects, grid=grid, index=index, ranges=ranges)
        if runs.size.sum() > PAIRS_A_BLOCK and block.stop - block.start > 1:
            middle = (block.start + block.stop) // 2
            blocks += [slice(middle, block.stop), slice(block.start, middle)]
        else:
            yield block, _sightings(runs, grid.viewpoints(*here), objects, ranges=ranges)


class _Runs(NamedTuple):
    """Objects, and the cells of one column that may see each: some that follow each other."""

    object: NDArray[np.int64]
    first: NDArray[np.int64]
    size: NDArray[np.int64]


def _runs(
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
    objects: NDArray[np.float64],
    *,
    grid: GridSpec,
    index: PackedIndex,
    ranges: NDArray[np.float64],
) -> _Runs:
    """Return where in a list of cells those are that may see an object."""
    ids = cell_ids(columns, rows)
    # Tiles, and the corners of the part of them that is in this block.
    tiles = np.sort(cell_ids(columns // TILE_CELLS, rows // TILE_CELLS))
    tile = np.stack(split_ids(tiles[np.append(True, np.diff(tiles) > 0)]), axis=-1)
    low = np.maximum(tile * TILE_CELLS, [columns[0], rows.min()])
    high = np.minimum((tile + 1) * TILE_CELLS - 1, [columns[-1], rows.max()])
    furthest = ranges.max() / grid.step + ROUNDING_CELLS
    corners = grid.viewpoints(*(low - furthest).T), grid.viewpoints(*(high + furthest).T)
    box, item = index.pairs_in(*corners)

    # The columns in reach of each object, then the rows in each of them.
    place = (objects[item] - grid.origin) / grid.step - 0.5
    reach = ranges[item] / grid.step + ROUNDING_CELLS
    first = np.maximum(np.ceil(place[:, 0] - reach), low[box, 0]).astype(np.int64)
    last = np.minimum(np.floor(place[:, 0] + reach), high[box, 0]).astype(np.int64)
    pair, column = _ranges(first, np.maximum(last + 1 - first, 0))
    half = np.sqrt(np.maximum(reach[pair] ** 2 - (column - place[pair, 0]) ** 2, 0.0))
    first = np.maximum(np.ceil(place[pair, 1] - half), low[box[pair], 1])
    last = np.minimum(np.floor(place[pair, 1] + half), high[box[pair], 1])
    begin = np.searchsorted(ids, cell_ids(column, first))
    end = np.searchsorted(ids, cell_ids(column, last), side="right")
    return _Runs(item[pair], begin, np.maximum(end - begin, 0))


def _ranges(
    first: NDArray[np.int64], size: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return, for ranges of whole numbers, which range each number is in, and the numbers."""
    ends = np.cumsum(size)
    own = np.repeat(np.arange(len(size)), size)
    return own, np.repeat(first - ends + size, size) + np.arange(len(own))


def _sightings(
    runs: _Runs,
    viewpoints: NDArray[np.float64],
    objects: NDArray[np.float64],
    *,
    ranges: NDArray[np.float64],
) -> Sightings:
    """Return the pairs of some runs that are within range."""
    run, viewpoint = _ranges(runs.first, runs.size)
    return _within(viewpoint, runs.object[run], viewpoints, objects, ranges=ranges)


def seen_from(
    places: NDArray[np.float64],
    objects: NDArray[np.float64],
    *,
    index: ObjectIndex | StoredIndex,
    ranges: NDArray[np.float64],
) -> Sightings:
    """Return the pairs within range of a place anywhere and an object.

    `index` is an R-tree over `objects`. Positions and `ranges`, from how far each object is seen,
    are in metres.
    """
    pairs = index.pairs_within(places, radius=float(ranges.max()))
    return _within(*pairs, places, objects, ranges=ranges)


def _within(
    viewpoint: NDArray[np.int64],
    item: NDArray[np.int64],
    viewpoints: NDArray[np.float64],
    objects: NDArray[np.float64],
    *,
    ranges: NDArray[np.float64],
) -> Sightings:
    """Measure pairs and keep those within range."""
    dx = objects[:, 0][item] - viewpoints[:, 0][viewpoint]
    dy = objects[:, 1][item] - viewpoints[:, 1][viewpoint]
    distance = np.hypot(dx, dy)
    near = distance <= ranges[item]
    # Processors differ in the last digits of an arctangent: they must not decide about ties.
    bearing = np.round(bearings(dx[near], dy[near]), BEARING_DECIMALS)
    bearing[bearing >= FULL_TURN] = 0.0
    return Sightings(viewpoint[near], item[near], bearing, distance[near])


# Of a bearing in a number that is sorted: finer than its nine decimals.
TURN_BITS = 40


def clockwise_order(sightings: Sightings, codes: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the order in which a clockwise sweep from north meets the objects.

    The permutation sorts p sightings by viewpoint, then bearing; on the same bearing the nearer
    object comes first, then the lower class code. `codes` holds the class of every object, not
    sighting.
    """
    viewpoint, bearing = sightings.viewpoint, sightings.bearing
    # One number for each pair, the viewpoint in front and the pair itself behind; plain numbers
    # are sorted many times faster than pairs by two keys.
    viewpoint_bits = int(viewpoint.max(initial=0)).bit_length()
    pair_bits = len(viewpoint).bit_length()
    turn_bits = min(64 - viewpoint_bits - pair_bits, TURN_BITS)
    numbers = viewpoint.astype(np.uint64) << np.uint64(turn_bits)
    numbers |= (bearing * (2.0**turn_bits / FULL_TURN)).astype(np.uint64)
    numbers <<= np.uint64(pair_bits)
    numbers |= np.arange(len(numbers), dtype=np.uint64)
    numbers.sort()
    order = (numbers & np.uint64((1 << pair_bits) - 1)).astype(np.int64)
    # Objects in nearly one direction are rare, so that all keys are looked at for them alone.
    numbers >>= np.uint64(pair_bits)
    same = np.flatnonzero(numbers[1:] == numbers[:-1])
    level = np.zeros(len(order), np.bool_)
    level[same] = level[same + 1] = True
    tied = order[level]
    keys = (codes[sightings.object[tied]], sightings.distance[tied], bearing[tied], viewpoint[tied])
    order[level] = tied[np.lexsort(keys)]
    return order


HALF_UNIT = 180.0 / BEARING_UNITS


@dataclass(frozen=True, eq=False, kw_only=True)
class Views:
    """What is seen from v places, each clockwise from north.

    The entries of place ``i`` are ``offsets[i]`` to ``offsets[i + 1]``. `objects` are rows in the
    table of objects, -1 where not known; `codes` their classes; `bearings` are in degrees clockwise
    from grid north, `distances` in metres.
    """

    offsets: NDArray[np.int64]
    objects: NDArray[np.int64]
    codes: NDArray[np.uint8]
    bearings: NDArray[np.float64]
    distances: NDArray[np.float64]

    def __len__(self) -> int:  # noqa: D105
        return len(self.offsets) - 1

    @property
    def lengths(self) -> NDArray[np.int64]:
        """How many objects are seen from each place, shape (v,)."""
        return np.diff(self.offsets)


def views_at(
    objects: StreetObjects,
    places: NDArray[np.float64],
    *,
    index: ObjectIndex | StoredIndex,
    radius: float,
    footprints: Footprints | None = None,
) -> Views:
    """Return what is seen from places anywhere, in metres in the CRS of the objects, not rounded.

    `index` is an R-tree over ``objects.xy``; `radius` is the visibility range in metres of classes
    that have none of their own; what `footprints` hide is not seen.
    """
    ranges = objects.taxonomy.ranges(radius)
    places = np.ascontiguousarray(places, dtype=np.float64)
    codes = objects.codes
    seen = seen_from(places, objects.xy, index=index, ranges=ranges[codes])
    if footprints is not None:
        ends = places[seen.viewpoint], objects.xy[seen.object]
        seen = seen.only(~hidden(*ends, footprints=footprints))
    order = clockwise_order(seen, codes)
    lengths = np.bincount(seen.viewpoint, minlength=len(places))
    rows = seen.object[order]
    return Views(
        offsets=np.concatenate([[0], np.cumsum(lengths)]),
        objects=rows,
        codes=codes[rows],
        bearings=seen.bearing[order],
        distances=seen.distance[order],
    )


def views_in(database: SignatureDatabase, cells: NDArray[np.int64]) -> Views:
    """Return what a database says is seen from some of its cells; one may stand there twice.

    Bearings are in the middle of their units, and the rows of the objects are not known.
    """
    lengths = database.lengths[cells]
    offsets = np.concatenate([[0], np.cumsum(lengths)])
    entries = np.repeat(database.offsets[cells] - offsets[:-1], lengths) + np.arange(offsets[-1])
    units = database.bearing_units[entries]
    return Views(
        offsets=offsets,
        objects=np.full(len(entries), -1),
        codes=database.codes[entries],
        bearings=units * (360.0 / BEARING_UNITS) + HALF_UNIT,
        distances=database.distance_units[entries] * (database.reach / 255.0),
    )
