"""Sightings: the objects in range of a viewpoint that no building hides."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import FULL_TURN, ObjectIndex, share_rows, signed_degrees
from semsig_gis.database.occlusion import hidden

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.database.occlusion import Footprints
    from semsig_gis.objects import StreetObjects


BEARING_DECIMALS = 9
PLACES_A_THREAD = 512  # the fewest places that are worth a thread
BEARING_BITS = 40  # of a bearing in a sort key: finer than its nine decimals


@dataclass(frozen=True, eq=False, slots=True)
class SightingPairs:
    """Pairs of a viewpoint and a visible object, both as row numbers.

    `bearing` is in degrees clockwise from grid north, [0, 360), to nine decimals, `distance` in
    metres. `extent` is the angular width of the visible points of an extended thing in degrees, 0
    for points; None if there are no extended things.
    """

    viewpoint: NDArray[np.int64]
    object: NDArray[np.int64]
    bearing: NDArray[np.float64]
    distance: NDArray[np.float64]
    extent: NDArray[np.float64] | None = None

    def take(self, pairs: NDArray[np.bool_] | NDArray[np.int64]) -> SightingPairs:
        """Return some of the pairs, by mask or by number in any order."""
        return SightingPairs(
            self.viewpoint[pairs],
            self.object[pairs],
            self.bearing[pairs],
            self.distance[pairs],
            None if self.extent is None else self.extent[pairs],
        )


def bearings(dx: ArrayLike, dy: ArrayLike) -> NDArray[np.float64]:
    """Return the bearings of displacements to east and north, in degrees in [0, 360).

    A displacement of zero has bearing 0.
    """
    degrees = np.degrees(np.arctan2(np.asarray(dx), np.asarray(dy)))
    # Equal to `wrap_degrees` in [-180, 180], but without its slow remainder.
    wrapped = np.where(degrees < 0.0, degrees + FULL_TURN, np.abs(degrees))
    return np.where(wrapped >= FULL_TURN, 0.0, wrapped)


def measure_sightings(
    viewpoint: NDArray[np.int64],
    item: NDArray[np.int64],
    viewpoints: NDArray[np.float64],
    objects: NDArray[np.float64],
    *,
    ranges: NDArray[np.float64],
    footprints: Footprints | None = None,
    groups: NDArray[np.int32] | None = None,
    tops: NDArray[np.float64] | None = None,
) -> SightingPairs:
    """Return the pairs that are within range and not hidden by a building, with measures.

    A pair is a row of `viewpoints` and a row of `objects`, positions in metres; `ranges` is the
    visibility range of each object in metres. `groups` is the extended thing that each object is a
    point of, -1 for none: of these, only the nearest visible point is returned. `tops` is as in
    `landmark_tops`: landmarks are hidden only by roofs of known height.
    """
    dx = objects[:, 0][item] - viewpoints[:, 0][viewpoint]
    dy = objects[:, 1][item] - viewpoints[:, 1][viewpoint]
    distance = np.hypot(dx, dy)
    near = distance <= ranges[item]
    # Processors differ in the last digits of an arctangent, which must not decide ties.
    bearing = np.round(bearings(dx[near], dy[near]), BEARING_DECIMALS)
    bearing[bearing >= FULL_TURN] = 0.0
    pairs = SightingPairs(viewpoint[near], item[near], bearing, distance[near])
    if footprints is not None:
        # `hidden` is fastest if the pairs of a viewpoint follow each other.
        pairs = pairs.take(np.argsort(pairs.viewpoint, kind="stable"))
        pairs = pairs.take(~_hidden(pairs, viewpoints, objects, footprints, tops))
    return pairs if groups is None else _nearest_points(pairs, groups)


def _hidden(
    pairs: SightingPairs,
    viewpoints: NDArray[np.float64],
    objects: NDArray[np.float64],
    footprints: Footprints,
    tops: NDArray[np.float64] | None,
) -> NDArray[np.bool_]:
    """Return a mask of the pairs that a building hides."""
    starts, ends = viewpoints[pairs.viewpoint], objects[pairs.object]
    if tops is None:
        return hidden(starts, ends, footprints=footprints)
    heights = tops[pairs.object]
    mask, far = np.zeros(len(starts), np.bool_), ~np.isnan(heights)
    mask[~far] = hidden(starts[~far], ends[~far], footprints=footprints)
    if footprints.roofs is not None:
        mask[far] = footprints.roofs.hide(starts[far], ends[far], heights[far])
    return mask


def landmark_tops(objects: StreetObjects) -> NDArray[np.float64] | None:
    """Return the height of the top of each landmark in metres, shape (n,); None without landmarks.

    It is infinite if it is unknown, and NaN for objects that are not tall.
    """
    codes = np.intersect1d(objects.present_codes, objects.taxonomy.tall_codes)
    if not len(codes):
        return None
    tall = np.isin(objects.codes, codes)
    tops = np.full(len(tall), math.nan)
    tops[tall] = math.inf
    if objects.heights is not None:
        stated = tall & (objects.heights > 0)
        tops[stated] = objects.heights[stated]
    return tops


def _nearest_points(pairs: SightingPairs, groups: NDArray[np.int32]) -> SightingPairs:
    """Return the pairs with only the nearest point of each group, and the extent of the group.

    Of points at one distance, the first clockwise from north is taken.
    """
    group = groups[pairs.object]
    grouped = np.flatnonzero(group >= 0)
    extent = np.zeros(len(group))
    if not len(grouped):
        return replace(pairs, extent=extent)
    keys = pairs.viewpoint[grouped] * (int(group.max()) + 1) + group[grouped]
    # The points of one viewpoint and group follow each other in `grouped`.
    order = np.argsort(keys, kind="stable")
    keys, grouped = keys[order], grouped[order]
    starts = np.flatnonzero(np.append(True, keys[1:] != keys[:-1]))
    sizes = np.diff(np.append(starts, len(keys)))

    def least(values: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.asarray(values == np.repeat(np.minimum.reduceat(values, starts), sizes))

    distance, bearing = pairs.distance[grouped], pairs.bearing[grouped]
    nearest = np.flatnonzero(least(np.where(least(distance), bearing, math.inf)))
    # Several points may be at one place.
    nearest = nearest[np.unique(keys[nearest], return_index=True)[1]]
    away = signed_degrees(bearing - np.repeat(bearing[nearest], sizes))
    extent[grouped[nearest]] = np.maximum.reduceat(away, starts) - np.minimum.reduceat(away, starts)
    shown = np.ones(len(group), np.bool_)
    shown[grouped] = False
    shown[grouped[nearest]] = True
    return replace(pairs, extent=extent).take(shown)


def clockwise_order(pairs: SightingPairs, codes: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the order of sightings by viewpoint, then bearing, distance and class code.

    `codes` is the class of every object (not of every sighting).
    """
    viewpoint, bearing = pairs.viewpoint, pairs.bearing
    # One integer key per pair: viewpoint, bearing, number of the pair. Integers are sorted many
    # times faster than pairs by two keys.
    viewpoint_bits = int(viewpoint.max(initial=0)).bit_length()
    pair_bits = len(viewpoint).bit_length()
    bearing_bits = min(64 - viewpoint_bits - pair_bits, BEARING_BITS)
    keys = viewpoint.astype(np.uint64) << np.uint64(bearing_bits)
    keys |= (bearing * (2.0**bearing_bits / FULL_TURN)).astype(np.uint64)
    keys <<= np.uint64(pair_bits)
    keys |= np.arange(len(keys), dtype=np.uint64)
    keys.sort()
    order = (keys & np.uint64((1 << pair_bits) - 1)).astype(np.int64)
    # Objects in nearly the same direction are rare; only they are sorted by all criteria.
    keys >>= np.uint64(pair_bits)
    same = np.flatnonzero(keys[1:] == keys[:-1])
    tie = np.zeros(len(order), np.bool_)
    tie[same] = tie[same + 1] = True
    tied = order[tie]
    criteria = (codes[pairs.object[tied]], pairs.distance[tied], bearing[tied], viewpoint[tied])
    order[tie] = tied[np.lexsort(criteria)]
    return order


@dataclass(frozen=True, eq=False, kw_only=True)
class VisibleObjects:
    """Objects visible from v places, clockwise from north for each place.

    The entries of place ``i`` are ``offsets[i]`` to ``offsets[i + 1]``. `objects` are rows in the
    table of objects, -1 if unknown; `codes` are their classes; `bearings` are in degrees clockwise
    from grid north, `distances` in metres. `extents` are the angular widths of extended things in
    degrees, 0 for points; None if there are none.
    """

    offsets: NDArray[np.int64]
    objects: NDArray[np.int64]
    codes: NDArray[np.uint8]
    bearings: NDArray[np.float64]
    distances: NDArray[np.float64]
    extents: NDArray[np.float64] | None = None

    def __len__(self) -> int:  # noqa: D105
        return len(self.offsets) - 1

    @property
    def lengths(self) -> NDArray[np.int64]:
        """Number of objects visible from each place, shape (v,)."""
        return np.diff(self.offsets)


def visible_objects_at(
    objects: StreetObjects,
    places: NDArray[np.float64],
    *,
    index: ObjectIndex,
    radius: float,
    footprints: Footprints | None = None,
) -> VisibleObjects:
    """Return the objects visible from any places, in metres in the CRS of the objects, unrounded.

    `index` is over ``objects.xy``; `radius` is the visibility range in metres of classes
    without a range of their own. Objects that `footprints` hide are left out.
    """
    from semsig_gis.database.clockwise import measure_clockwise  # noqa: PLC0415 - numba, 0.25 s

    codes, xy = objects.codes, objects.xy
    places = np.ascontiguousarray(places, dtype=np.float64)
    offsets, rows = _in_range(objects, places, index, objects.taxonomy.ranges(radius))
    near, rows = rows, np.empty_like(rows)
    bearing, distance = np.empty((2, len(rows)))
    share_rows(
        lambda part: measure_clockwise(
            part, places, xy, codes, offsets, near, rows, bearing, distance
        ),
        len(places),
        least=PLACES_A_THREAD,
    )
    extents = None
    if footprints is not None or objects.groups is not None:
        viewpoint = np.repeat(np.arange(len(places)), np.diff(offsets))
        pairs = SightingPairs(viewpoint, rows, bearing, distance)
        if footprints is not None:
            pairs = pairs.take(~_hidden(pairs, places, xy, footprints, landmark_tops(objects)))
        if objects.groups is not None:
            pairs = _nearest_points(pairs, objects.groups)
        lengths = np.bincount(pairs.viewpoint, minlength=len(places))
        offsets, extents = np.append(0, np.cumsum(lengths)), pairs.extent
        rows, bearing, distance = pairs.object, pairs.bearing, pairs.distance
    return VisibleObjects(
        offsets=offsets,
        objects=rows,
        codes=codes[rows],
        bearings=bearing,
        distances=distance,
        extents=extents,
    )


def _in_range(
    objects: StreetObjects,
    places: NDArray[np.float64],
    index: ObjectIndex,
    ranges: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the objects within the range of their class, as `ObjectIndex.points_in_range`."""
    codes, present = objects.codes, objects.present_codes
    low = np.setdiff1d(present, objects.taxonomy.tall_codes)
    reach = float(ranges[low].max(initial=0.0))
    offsets, rows = index.points_in_range(places, ranges=ranges, kinds=codes, reach=reach)
    farthest = float(ranges[present].max())
    if farthest <= reach:
        return offsets, rows
    # There are few landmarks, but very many other objects are in range of one.
    far = np.flatnonzero(ranges[codes] > reach)
    further = ObjectIndex(objects.xy[far]).points_in_range(
        places, ranges=ranges, kinds=codes[far], reach=farthest
    )
    rows = np.concatenate([rows, far[further[1]]])
    lengths = np.diff([offsets, further[0]])
    viewpoint = np.concatenate([np.repeat(np.arange(len(places)), each) for each in lengths])
    return offsets + further[0], rows[np.argsort(viewpoint, kind="stable")]
