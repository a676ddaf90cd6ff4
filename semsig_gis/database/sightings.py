"""Where views may be taken from, and what is seen there: objects in range that nothing hides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from semsig_gis.core import FULL_TURN, InputError, nearest_name, require_number

if TYPE_CHECKING:
    import shapely
    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core import ObjectIndex
    from semsig_gis.database.occlusion import Footprints
    from semsig_gis.objects import StreetObjects


BEARING_DECIMALS = 9
# Of a bearing in a number that is sorted: finer than its nine decimals.
TURN_BITS = 40


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


def bearings(dx: ArrayLike, dy: ArrayLike) -> NDArray[np.float64]:
    """Return degrees clockwise from grid north, in [0, 360), of displacements to east and north.

    A displacement of zero has bearing 0.
    """
    turned = np.degrees(np.arctan2(np.asarray(dx), np.asarray(dy)))
    # What `wrap_degrees` gives for half a turn to each side, without its costly remainder.
    wrapped = np.where(turned < 0.0, turned + FULL_TURN, np.abs(turned))
    return np.where(wrapped >= FULL_TURN, 0.0, wrapped)


def sightings(
    viewpoint: NDArray[np.int64],
    item: NDArray[np.int64],
    viewpoints: NDArray[np.float64],
    objects: NDArray[np.float64],
    *,
    ranges: NDArray[np.float64],
    footprints: Footprints | None = None,
) -> Sightings:
    """Measure pairs, and keep those within range that no building hides.

    A pair is a row of `viewpoints` and a row of `objects`, positions in metres; `ranges` holds from
    how far each object is seen.
    """
    dx = objects[:, 0][item] - viewpoints[:, 0][viewpoint]
    dy = objects[:, 1][item] - viewpoints[:, 1][viewpoint]
    distance = np.hypot(dx, dy)
    near = distance <= ranges[item]
    # Processors differ in the last digits of an arctangent: they must not decide about ties.
    bearing = np.round(bearings(dx[near], dy[near]), BEARING_DECIMALS)
    bearing[bearing >= FULL_TURN] = 0.0
    seen = Sightings(viewpoint[near], item[near], bearing, distance[near])
    if footprints is None:
        return seen
    from semsig_gis.database.occlusion import hidden  # noqa: PLC0415 - it loads slowly

    seen = seen.only(np.argsort(seen.viewpoint, kind="stable"))  # as `hidden` is fastest
    return seen.only(
        ~hidden(viewpoints[seen.viewpoint], objects[seen.object], footprints=footprints)
    )


def clockwise_order(seen: Sightings, codes: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the order of sightings by viewpoint, then bearing, distance and class code.

    `codes` holds the class of every object, not sighting.
    """
    viewpoint, bearing = seen.viewpoint, seen.bearing
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
    keys = (codes[seen.object[tied]], seen.distance[tied], bearing[tied], viewpoint[tied])
    order[level] = tied[np.lexsort(keys)]
    return order


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
    index: ObjectIndex,
    radius: float,
    footprints: Footprints | None = None,
) -> Views:
    """Return what is seen from places anywhere, in metres in the CRS of the objects, not rounded.

    `index` is an R-tree over ``objects.xy``; `radius` is the visibility range in metres of classes
    that have none of their own; what `footprints` hide is not seen.
    """
    codes, xy = objects.codes, objects.xy
    ranges = objects.taxonomy.ranges(radius)[codes]
    places = np.ascontiguousarray(places, dtype=np.float64)
    pairs = index.pairs_within(places, radius=float(ranges.max()))
    seen = sightings(*pairs, places, xy, ranges=ranges, footprints=footprints)
    order = clockwise_order(seen, codes)
    lengths = np.bincount(seen.viewpoint, minlength=len(places))
    rows = seen.object[order]
    return Views(
        offsets=np.append(0, np.cumsum(lengths)),
        objects=rows,
        codes=codes[rows],
        bearings=seen.bearing[order],
        distances=seen.distance[order],
    )


Mode = Literal["all", "outdoor", "streets"]
STREET_HALF_WIDTH_M = 8.0
LEAST_WIDTH_M, MOST_WIDTH_M = 0.05, 200


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewpointSpec:
    """Which cells are viewpoints.

    Parameters
    ----------
    mode : {"all", "outdoor", "streets"}
        Every cell, those whose centre is outside the building footprints, or those whose centre
        is near the centre line of a street and, where footprints are given, outside them.
    width : float, default 8
        How far from a centre line is near, in metres: half the width of a street; from 0.05 to
        200.
    area : shapely.Polygon or shapely.MultiPolygon, optional
        In the CRS of the objects; only cells whose centre is in it count, in every mode.

    Raises
    ------
    InputError
        If a value is out of its range, or the area encloses nothing.

    Examples
    --------
    >>> ViewpointSpec(mode="streets").width
    8.0
    """

    mode: Mode = "all"
    width: float = STREET_HALF_WIDTH_M
    area: shapely.Polygon | shapely.MultiPolygon | None = None

    def __post_init__(self) -> None:  # noqa: D105
        if self.mode not in get_args(Mode):
            known = ", ".join(get_args(Mode))
            near = nearest_name(str(self.mode), get_args(Mode))
            raise InputError(f"viewpoints {self.mode!r} are unknown{near}; give one of {known}.")
        require_number(
            "street half-width", self.width, least=LEAST_WIDTH_M, most=MOST_WIDTH_M, unit="metres"
        )
        if self.area is not None:
            from semsig_gis.database.viewpoints import checked_area  # noqa: PLC0415 - it loads slowly

            object.__setattr__(self, "area", checked_area(self.area))

    def to_dict(self) -> dict[str, Any]:
        """Return the choice as values for JSON: ``mode``, ``width`` and ``area`` (WKT or None)."""
        area = None if self.area is None else self.area.wkt
        return {"mode": self.mode, "width": self.width, "area": area}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> ViewpointSpec:
        """Return the choice that `to_dict` wrote; InputError if a value cannot be used."""
        area: Any = None
        if values["area"] is not None:
            from semsig_gis.database.viewpoints import read_area  # noqa: PLC0415 - it loads slowly

            area = read_area(values["area"])
        return cls(mode=values["mode"], width=values["width"], area=area)
