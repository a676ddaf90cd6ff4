"""Check the extent of layers: choose the metric CRS, and remove misplaced rows.

All decisions use the majority of the data and never its extremes: a single row at (0, 0) must not
change the result.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import asdict, dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
import shapely
from pyproj import CRS

from semsig_gis.core import (
    FULL_TURN,
    HALF_TURN,
    CrsError,
    EmptyResultError,
    InputError,
    cell_ids,
    crs_label,
    nearest_town,
    plane_distortion,
    require_metric_crs,
    signed_degrees,
    split_ids,
    wrap_degrees,
)
from semsig_gis.sources import LATITUDE_LIMIT, WGS84, fits_the_globe, transform_points

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import AnyCrs, Bounds
    from semsig_gis.sources import RawLayer

MAX_DISTORTION = 6.0
"""Maximum error of bearings (degrees) and lengths (percent) over the loaded data.

Grid north turns by at most six degrees within a UTM zone.
"""

# Larger than any projected coordinate; files use values such as -1.8e308 for "no value".
BEYOND_EARTH_M = 1e8
# Places with smaller gaps between them are one town; 1 degree is 111 km.
GAP_DEGREES = 1.0
# Places are rounded to this before they are grouped.
ROUNDING_DEGREES = 0.1
# Minimum length of a degree of longitude, relative to a degree of latitude, also at the poles.
LEAST_WIDTH = 0.05
# A town has at least 3 places and 1 % of all; with 50 places it is always a town.
FEW_PLACES, TOWN_SHARE, MANY_PLACES = 3, 0.01, 50
# Tolerance around the area of use of a CRS in degrees, because such areas follow borders.
AREA_MARGIN = 0.5
PLACES_SHOWN = 3
EXCHANGE = "exchange x_field and y_field in the catalogue, or the axes in the file"


@dataclass(frozen=True, eq=False)
class _LocatedLayer:
    """A layer with a point of each row in degrees, shape (n, 2); NaN for a row without a position.

    `coordinates`, shape (p, 2), are the points in the CRS of the layer.
    """

    layer: RawLayer
    degrees: NDArray[np.float64]
    coordinates: NDArray[np.float64]

    @cached_property
    def places(self) -> NDArray[np.float64]:
        """The distinct valid points, shape (d, 2)."""
        return _distinct(self.degrees)

    @cached_property
    def swapped(self) -> tuple[float, float] | None:
        """Centre of the layer if x and y are exchanged; None if that is not on the Earth."""
        places = _distinct(_to_degrees(self.coordinates[:, ::-1], self.layer.known_crs))
        return _Towns(places).centre() if len(places) else None


class _Towns:
    """Distinct places in degrees, grouped into towns by the gaps between them, largest first."""

    def __init__(self, places: NDArray[np.float64]) -> None:
        radians = np.radians(places[:, 0])
        # Longitudes are relative to their mean direction, so that no town is cut at 180 degrees.
        self._middle = float(np.degrees(np.arctan2(np.sin(radians).mean(), np.cos(radians).mean())))
        self._points = self._plane(places)
        cells, cell = self._cells(self._points)
        # A town is a part of the union of boxes of the gap's size around all places.
        x, y = cells.T
        half = GAP_DEGREES / 2
        wide = half / np.maximum(np.cos(np.radians(y)), LEAST_WIDTH)
        boxes = shapely.box(x - wide, y - half, x + wide, y + half)
        parts = shapely.get_parts(shapely.union_all(boxes))
        _, town = shapely.STRtree(parts).query(shapely.points(cells), predicate="intersects")
        order = np.argsort(-np.bincount(town[cell], minlength=len(parts)), kind="stable")
        self._tree = shapely.STRtree(parts[order])
        self._places = places
        self._town = np.argsort(order)[town][cell]

    def _plane(self, degrees: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.column_stack([signed_degrees(degrees[:, 0] - self._middle), degrees[:, 1]])

    def _cells(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Round points to a grid; return distinct ones, shape (c, 2), and the row of each point."""
        ids = cell_ids(*np.rint(points / ROUNDING_DEGREES).T)
        distinct, cell = np.unique(ids, return_inverse=True)
        cells = np.column_stack(split_ids(distinct)) * np.float64(ROUNDING_DEGREES)
        return cells, cell.astype(np.int64, copy=False)

    def of(self, degrees: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the index of the town that contains each position, or -1."""
        cells, cell = self._cells(self._plane(degrees))
        towns = np.full(len(cells), -1)
        point, town = self._tree.query(shapely.points(cells), predicate="intersects")
        towns[point] = town
        return towns[cell]

    @property
    def number(self) -> int:
        """Number of towns."""
        return int(self._town.max()) + 1

    @property
    def large(self) -> int:
        """Number of towns without those that are only a few stray places far from the largest.

        All towns count if the largest does not contain most places.
        """
        sizes = np.bincount(self._town)
        if 2 * sizes[0] <= len(self._places):
            return len(sizes)
        least = max(FEW_PLACES, min(MANY_PLACES, TOWN_SHARE * len(self._places)))
        return max(1, int((sizes >= least).sum()))

    def centre(self) -> tuple[float, float]:
        """Return the median longitude and latitude of the largest town."""
        x, y = np.median(self._points[self._town == 0], axis=0)
        return float(signed_degrees(x + self._middle)), float(y)

    def bounds(self, town: int) -> Bounds:
        """Return west, south, east and north of a town; across 180 degrees, west exceeds east."""
        plane = self._points[self._town == town]
        (west, south), (east, north) = plane.min(axis=0), plane.max(axis=0)
        west, east = signed_degrees([west + self._middle, east + self._middle])
        return float(west), float(south), float(east), float(north)


def settle_extent(
    layers: Sequence[RawLayer],
    *,
    crs: AnyCrs | None = None,
    max_distortion: float = MAX_DISTORTION,
    keep_far: bool = False,
) -> tuple[tuple[RawLayer, ...], CRS, tuple[str, ...]]:
    """Check the positions of layers, remove rows far from all others, and choose the metric CRS.

    Parameters
    ----------
    layers : sequence of RawLayer
        The layers.
    crs : int, str or pyproj.CRS, optional
        Metric CRS; by default the UTM zone of most objects.
    max_distortion : float
        Maximum error of bearings in degrees, and of lengths in percent, over the data.
    keep_far : bool, default False
        Whether rows and layers far from all others are kept.

    Returns
    -------
    layers : tuple of RawLayer
        The layers; removed rows are counted as misplaced, and a note gives their places.
    crs : pyproj.CRS
        The metric CRS.
    notes : tuple of str
        Warnings about all layers together.

    Raises
    ------
    CrsError
        If a layer has no CRS, is outside the area of use of its CRS or of the metric one, or is
        far from all others, or if the distortion of the metric CRS is too large.
    EmptyResultError
        If no metric CRS is given and no row has a position.
    InputError
        If `max_distortion` is not above 0.
    """
    if not max_distortion > 0:
        raise InputError(
            f"the largest distortion is {max_distortion:g}; give a number above 0, in degrees "
            "for bearings and in percent for lengths."
        )
    metric = None if crs is None else require_metric_crs(crs)
    located_layers = [_located(layer) for layer in layers]
    with_points = [located for located in located_layers if len(located.coordinates)]
    for located in with_points:
        # A layer of one or two rows does not raise: they are removed below if they are far away.
        points = located.places if len(located.places) else located.coordinates
        if len(with_points) == 1 or len(points) >= FEW_PLACES:
            _require_area(located, metric)
    # The layers of objects decide where the city is, or all if there are no objects.
    objects = [item.places for item in with_points if item.layer.spec.role == "objects"]
    deciding = objects or [item.places for item in with_points]
    places = _distinct(np.concatenate([np.empty((0, 2)), *deciding]))
    if not len(places):
        unreadable = [item for item in layers if item.counts.unreadable > len(item)]
        if unreadable and unreadable[0].errors:
            raise EmptyResultError(
                f"no row has a position that can be read: in layer {unreadable[0].spec.name!r}, "
                f"{unreadable[0].errors[0]}; correct the file, or name other fields of it in the "
                "catalogue, in x_field and y_field or in geometry_field."
            )
        if metric is None:
            totals = Counter[str]()
            for item in layers:
                totals.update(asdict(item.counts))
            rows = totals.pop("read")
            reasons = "".join(f", {count:,} {name}" for name, count in totals.items() if count)
            raise EmptyResultError(
                f"no layer has a feature with a position (rows: {rows:,} read{reasons}); look at "
                "the filters and the area."
            )
        return tuple(layers), metric, ()
    towns = _Towns(places)
    for located in () if keep_far else with_points:
        _refuse_isolated_layer(located, towns)
    metric = metric or _utm_zone(*towns.centre())
    number = towns.number if keep_far else towns.large
    extents = [towns.bounds(town) for town in range(number)]
    places = places[towns.of(places) < number]
    notes = _require_plane(extents, places, metric, max_distortion)
    return tuple(_without_strays(item, towns, number) for item in located_layers), metric, notes


def _located(layer: RawLayer) -> _LocatedLayer:
    crs = layer.known_crs
    coordinates, row = shapely.get_coordinates(layer.geometry, return_index=True)
    first = np.flatnonzero(np.diff(row, prepend=-1))
    first = first[(np.abs(coordinates[first]) < BEYOND_EARTH_M).all(axis=1)]  # false for NaN too
    degrees = np.full((len(layer), 2), np.nan)
    degrees[row[first]] = _to_degrees(coordinates[first], crs)
    return _LocatedLayer(layer, degrees, coordinates[first])


def _to_degrees(xy: NDArray[np.float64], crs: CRS) -> NDArray[np.float64]:
    """Return longitudes and latitudes; NaN for points that are not on the Earth."""
    degrees = transform_points(xy, crs, WGS84)
    degrees[~_valid(degrees)] = np.nan
    return degrees


def _valid(degrees: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return a mask of the positions on the Earth."""
    finite = np.isfinite(degrees).all(axis=1)
    return np.asarray(finite & (np.abs(degrees[:, 1]) <= LATITUDE_LIMIT))


def _distinct(degrees: NDArray[np.float64]) -> NDArray[np.float64]:
    valid = degrees[_valid(degrees)] + 0.0  # no -0.0
    _, first = np.unique(valid.view(np.complex128).ravel(), return_index=True)
    return valid[np.sort(first)]


def _require_area(located: _LocatedLayer, metric: CRS | None) -> None:
    """Raise CrsError if the centre of a layer is outside the area of use of its CRS or `metric`."""
    own = located.layer.known_crs
    centre = _Towns(located.places).centre() if len(located.places) else None
    systems = [own] if metric is None else [own, metric]
    wrong = next((crs for crs in systems if centre is None or not _in_area(centre, crs)), None)
    if wrong is None:
        return
    x, y = located.coordinates[0]
    where = f"has coordinates such as ({x:.12g}, {y:.12g}), which are nowhere on the Earth"
    if centre is not None:
        where = f"lies near {_place(centre)}"
    bounds = _used_in(wrong)
    used = "" if bounds is None else f" ({_box(bounds)} in degrees)"
    remedy = "state the crs that its coordinates are in"
    # Suggest the most likely correction: exchanged axes, degrees, or another metric CRS.
    if located.swapped is not None and all(_in_area(located.swapped, crs) for crs in systems):
        place = _place(located.swapped)
        remedy = f"with x and y exchanged it would lie near {place}, so {EXCHANGE}"
    elif own.is_projected and fits_the_globe(located.coordinates):
        remedy = "its coordinates look like degrees, so state crs = 'EPSG:4326'"
    elif wrong is metric:
        zone = "EPSG:2154" if centre is None else crs_label(_utm_zone(*centre))
        remedy = f"give another metric CRS, such as {zone}, or correct the layer's"
    kind = "the metric CRS" if wrong is metric else "its CRS"
    raise CrsError(
        f"layer {located.layer.spec.name!r} {where}, outside of where {kind}, {crs_label(wrong)}, "
        f"is used{used}; {remedy}."
    )


@lru_cache(maxsize=64)  # the search for the code takes 0.2 s
def _used_in(crs: CRS) -> Bounds | None:
    """Return the area of use of a CRS, or else of the equivalent EPSG code; None if unknown."""
    code = crs.to_epsg() if crs.area_of_use is None else None
    area = crs.area_of_use if code is None else CRS.from_epsg(code).area_of_use
    return None if area is None else area.bounds


def _in_area(place: tuple[float, float], crs: CRS) -> bool:
    """Whether a place is in or near the area of use of a CRS; true if that is unknown."""
    bounds = _used_in(crs)
    if bounds is None:
        return True
    west, south, east, north = bounds
    # From west to east; a full turn if both are the same meridian.
    width = float(wrap_degrees(east - west)) or FULL_TURN
    east_of = float(wrap_degrees(place[0] - west + AREA_MARGIN))
    return (
        east_of <= width + 2 * AREA_MARGIN
        and south - AREA_MARGIN <= place[1] <= north + AREA_MARGIN
    )


def _refuse_isolated_layer(located: _LocatedLayer, towns: _Towns) -> None:
    """Raise CrsError if no place of a layer is in the largest town."""
    if len(located.places) < FEW_PLACES or (towns.of(located.places) == 0).any():
        return
    remedy = (
        "correct the crs of the wrong ones, load them separately, or give --clip none if both are "
        "right"
    )
    if located.swapped is not None and towns.of(np.array([located.swapped]))[0] == 0:
        remedy = f"with x and y exchanged it would lie there, so correct the wrong ones: {EXCHANGE}"
    own = _Towns(located.places)
    layer_box, data_box = (
        f"{_box(item.bounds(0))} in degrees ({nearest_town(*item.centre())})"
        for item in (own, towns)
    )
    raise CrsError(
        f"layer {located.layer.spec.name!r} lies at {layer_box}, far from most of the data at "
        f"{data_box}; {remedy}."
    )


def _utm_zone(longitude: float, latitude: float) -> CRS:
    if not -80 <= latitude <= 84:  # noqa: PLR2004 - the ends of UTM
        raise CrsError(
            f"the data lies near {_place((longitude, latitude))}, where there is no UTM zone; give "
            "a projected CRS in metres as metric CRS."
        )
    # A search by PROJ would take 0.1 s.
    zone = int((longitude + HALF_TURN) // 6) % 60 + 1
    return CRS.from_epsg((32600 if latitude >= 0 else 32700) + zone)


def _require_plane(
    extents: Sequence[Bounds], places: NDArray[np.float64], metric: CRS, most: float
) -> tuple[str, ...]:
    """Raise CrsError if the distortion over the towns exceeds `most`; return notes on it."""
    xy = transform_points(places, WGS84, metric)
    distortion = plane_distortion(metric, (*xy.min(axis=0), *xy.max(axis=0)))
    boxes = " and ".join(map(_box, extents[:PLACES_SHOWN]))
    if len(extents) > PLACES_SHOWN:
        boxes += f" and {len(extents) - PLACES_SHOWN} more"
    errors = (
        f"bearings differ by {distortion.turn:.3g} degrees and lengths are off by "
        f"{100 * distortion.stretch:.2g} percent in {crs_label(metric)}"
        if np.isfinite(distortion.turn)
        else f"bearings and lengths mean nothing in {crs_label(metric)}"
    )
    if distortion.turn > most or 100 * distortion.stretch > most:
        what = f"lies in {len(extents)} places far apart" if len(extents) > 1 else "is too wide"
        raise CrsError(
            f"the data {what} ({boxes} in degrees), over which {errors}; at most {most:g} is "
            "allowed, so load part of it, for example with --clip and one of these boxes, or give "
            "a larger --max-distortion."
        )
    notes = []
    if len(extents) > 1:
        notes.append(
            f"the data lies in {len(extents)} places far apart ({boxes} in degrees); {errors}"
        )
    if distortion.angle > most:
        notes.append(
            f"grid north of {crs_label(metric)} is up to {distortion.angle:.3g} degrees off true "
            "north; give --north if bearings of queries are not measured from grid north"
        )
    return tuple(notes)


def _without_strays(located: _LocatedLayer, towns: _Towns, number: int) -> RawLayer:
    """Return a layer without the objects that are in none of the first `number` towns."""
    layer = located.layer
    rows = np.flatnonzero(_valid(located.degrees))
    if layer.spec.role != "objects" or not len(rows):
        return layer
    strays = rows[towns.of(located.degrees[rows]) >= number]
    if not len(strays):
        return layer
    places = _distinct(located.degrees[strays])
    shown = " and ".join(_place((float(x), float(y))) for x, y in places[:PLACES_SHOWN])
    more = f" and {len(places) - PLACES_SHOWN} more places" if len(places) > PLACES_SHOWN else ""
    rows_lie = "1 row lies" if len(strays) == 1 else f"{len(strays):,} rows lie"
    note = f"{rows_lie} far from all others, at {shown}{more}; left out (--clip none keeps all)"
    counts = replace(layer.counts, misplaced=layer.counts.misplaced + len(strays))
    keep = np.ones(len(layer), bool)
    keep[strays] = False
    return layer.select(keep, counts=counts, notes=(*layer.notes, note))


def _place(place: tuple[float, float]) -> str:
    """Return latitude and longitude, and the nearest town."""
    return f"latitude {place[1]:.5g}, longitude {place[0]:.5g} ({nearest_town(*place)})"


def _box(bounds: Bounds) -> str:
    """Return bounds in degrees as ``west,south,east,north``, rounded outwards to 0.01 degrees."""
    west, south, east, north = (round(100.0 * side, 6) for side in bounds)
    sides = (math.floor(west), math.floor(south), math.ceil(east), math.ceil(north))
    return ",".join(f"{side / 100:g}" for side in sides)
