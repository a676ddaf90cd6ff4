"""Where layers lie: their metric CRS, what is misplaced, and whether one plane holds them all.

Whatever is judged here is judged by the bulk of the data, never by its extremes: one row at (0, 0)
must not move a city.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import shapely
from pyproj import CRS, Transformer

from semsig_gis.core import (
    FULL_TURN,
    HALF_TURN,
    CrsError,
    EmptyResultError,
    InputError,
    cell_ids,
    crs_label,
    plane_distortion,
    require_metric_crs,
    signed_degrees,
    split_ids,
    wrap_degrees,
)
from semsig_gis.sources import LATITUDE_LIMIT, WGS84, fits_the_globe

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Bounds
    from semsig_gis.sources import RawLayer

MAX_DISTORTION = 6.0
"""How far bearings (degrees) and lengths (percent) may be off over what is loaded.

Grid north turns by at most six degrees within a zone of UTM.
"""

# Larger than any projected coordinate; files write -1.8e308 and the like for "no value".
BEYOND_EARTH_M = 1e8
# Places with gaps of less than about this between them are one town: 111 km.
GAP_DEGREES = 1.0
# Places are rounded to so many degrees before they are grouped.
ROUNDING_DEGREES = 0.1
# A degree of longitude counts as at least this share of one of latitude, at the poles too.
LEAST_WIDTH = 0.05
# A town of its own has at least so many places, or this share of all; 50 are always one.
FEW_PLACES, TOWN_SHARE, MANY_PLACES = 3, 0.01, 50
# Data may lie so far outside of where a CRS is used: such areas are drawn along borders.
AREA_MARGIN = 0.5
PLACES_TOLD = 3
EXCHANGE = "exchange x_field and y_field in the catalogue, or the axes in the file"


@dataclass(frozen=True, eq=False)
class _Located:
    """A layer, and a point of each of its rows in degrees, shape (n, 2), NaN where there is none.

    `coordinates` are those of the points in the CRS of the layer, shape (p, 2).
    """

    layer: RawLayer
    degrees: NDArray[np.float64]
    coordinates: NDArray[np.float64]

    @cached_property
    def places(self) -> NDArray[np.float64]:
        """The different places on the Earth, shape (d, 2)."""
        return _distinct(self.degrees)

    @cached_property
    def swapped(self) -> tuple[float, float] | None:
        """The middle of the places if x and y are exchanged; None if they are off the Earth."""
        places = _distinct(_to_degrees(self.coordinates[:, ::-1], self.layer.table.crs))
        return _Towns(places).centre() if len(places) else None


class _Towns:
    """Different places in degrees, in towns by the gaps between them; the largest comes first."""

    def __init__(self, places: NDArray[np.float64]) -> None:
        turn = np.radians(places[:, 0])
        # Longitudes are counted from the middle, so that no town is cut at 180 degrees.
        self._middle = float(np.degrees(np.arctan2(np.sin(turn).mean(), np.cos(turn).mean())))
        cells, cell = self._cells(places)
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

    def _cells(self, degrees: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the different rounded places, shape (c, 2), and which of them each place is in."""
        ids = cell_ids(*np.rint(self._plane(degrees) / ROUNDING_DEGREES).T)
        distinct, cell = np.unique(ids, return_inverse=True)
        cells = np.column_stack(split_ids(distinct)) * np.float64(ROUNDING_DEGREES)
        return cells, cell.astype(np.int64, copy=False)

    def of(self, degrees: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the town in which each position lies, -1 where in none."""
        cells, cell = self._cells(degrees)
        towns = np.full(len(cells), -1)
        point, town = self._tree.query(shapely.points(cells), predicate="intersects")
        towns[point] = town
        return towns[cell]

    @property
    def large(self) -> int:
        """How many of the towns are more than a few places that have strayed from the largest.

        All are, if the largest does not hold most places.
        """
        sizes = np.bincount(self._town)
        if 2 * sizes[0] <= len(self._places):
            return len(sizes)
        least = max(FEW_PLACES, min(MANY_PLACES, TOWN_SHARE * len(self._places)))
        return max(1, int((sizes >= least).sum()))

    def centre(self) -> tuple[float, float]:
        """Return the median longitude and latitude of the largest town."""
        x, y = np.median(self._plane(self._places[self._town == 0]), axis=0)
        return float(signed_degrees(x + self._middle)), float(y)

    def bounds(self, town: int) -> Bounds:
        """Return west, south, east and north of a town; west is the greater across 180 degrees."""
        plane = self._plane(self._places[self._town == town])
        (west, south), (east, north) = plane.min(axis=0), plane.max(axis=0)
        west, east = signed_degrees([west + self._middle, east + self._middle])
        return float(west), float(south), float(east), float(north)


def settle_extent(
    layers: Sequence[RawLayer],
    *,
    crs: CRS | str | None = None,
    max_distortion: float = MAX_DISTORTION,
) -> tuple[tuple[RawLayer, ...], CRS, tuple[str, ...]]:
    """Check where layers lie, leave out rows that lie far from all others, and choose the plane.

    Parameters
    ----------
    layers : sequence of RawLayer
        What was read.
    crs : pyproj.CRS or str, optional
        Metric CRS to work in; by default the UTM zone of the bulk of the objects.
    max_distortion : float
        By how many degrees bearings, and by how many percent lengths, may be off over the data.

    Returns
    -------
    layers : tuple of RawLayer
        The layers; rows left out are counted as misplaced, and a note says where they are.
    crs : pyproj.CRS
        The metric CRS.
    notes : tuple of str
        Warnings about all layers together.

    Raises
    ------
    CrsError
        If a layer has no CRS, lies outside of where its CRS or the metric one is used, or far from
        all others, or if the plane is too far from the ground.
    EmptyResultError
        If no metric CRS is given and no row has a position.
    InputError
        If the distortion is no number above 0.
    """
    if not max_distortion > 0:
        raise InputError(
            f"the largest distortion is {max_distortion:g}; give a number above 0, in degrees "
            "for bearings and in percent for lengths."
        )
    metric = None if crs is None else require_metric_crs(crs)
    located = [_located(layer) for layer in layers]
    placed = [one for one in located if len(one.coordinates)]
    for one in placed:
        # A row or two are left out where they lie far from all others.
        if (
            len(placed) == 1
            or len(one.places if len(one.places) else one.coordinates) >= FEW_PLACES
        ):
            _require_area(one, metric)
    places = _distinct(np.concatenate([np.empty((0, 2)), *_deciding(placed)]))
    if not len(places):
        if metric is None:
            raise EmptyResultError(
                "no layer has a feature with a position; look at the filters and the area."
            )
        return tuple(layers), metric, ()
    towns = _Towns(places)
    for one in placed:
        _require_company(one, towns)
    metric = metric or _utm_zone(*towns.centre())
    extents = [towns.bounds(town) for town in range(towns.large)]
    kept = places[towns.of(places) < towns.large]
    notes = _require_plane(extents, kept, metric, max_distortion)
    return tuple(_without_strays(one, towns) for one in located), metric, notes


def _deciding(placed: Sequence[_Located]) -> list[NDArray[np.float64]]:
    """Return the places of the layers that say where the city is: those of objects, if any."""
    objects = [one.places for one in placed if one.layer.spec.role == "objects"]
    return objects or [one.places for one in placed]


def _located(layer: RawLayer) -> _Located:
    crs = layer.table.crs
    if crs is None:
        raise CrsError(
            f"layer {layer.spec.name!r} has no coordinate reference system; "
            "state its crs in the catalogue."
        )
    geometry = layer.table.geometry.to_numpy()
    coordinates, row = shapely.get_coordinates(geometry, return_index=True)
    first = np.flatnonzero(np.diff(row, prepend=-1))
    first = first[(np.abs(coordinates[first]) < BEYOND_EARTH_M).all(axis=1)]  # false for NaN too
    degrees = np.full((len(geometry), 2), np.nan)
    degrees[row[first]] = _to_degrees(coordinates[first], crs)
    return _Located(layer, degrees, coordinates[first])


def _to_degrees(xy: NDArray[np.float64], crs: CRS) -> NDArray[np.float64]:
    """Return longitudes and latitudes, NaN off the Earth."""
    to_degrees = Transformer.from_crs(crs, WGS84, always_xy=True)
    degrees = np.column_stack(to_degrees.transform(xy[:, 0], xy[:, 1]))
    degrees[~_known(degrees)] = np.nan
    return degrees


def _known(degrees: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which positions are on the Earth."""
    finite = np.isfinite(degrees).all(axis=1)
    return np.asarray(finite & (np.abs(degrees[:, 1]) <= LATITUDE_LIMIT))


def _distinct(degrees: NDArray[np.float64]) -> NDArray[np.float64]:
    known = pd.DataFrame(degrees[_known(degrees)])
    return known.drop_duplicates().to_numpy()


def _require_area(one: _Located, metric: CRS | None) -> None:
    """Refuse a layer whose bulk lies where its CRS, or the metric one, is not used."""
    own: CRS = one.layer.table.crs
    centre = _Towns(one.places).centre() if len(one.places) else None
    systems = [own] if metric is None else [own, metric]
    wrong = next((crs for crs in systems if centre is None or not _in_area(centre, crs)), None)
    if wrong is None:
        return
    x, y = one.coordinates[0]
    where = f"has coordinates such as ({x:.12g}, {y:.12g}), which are nowhere on the Earth"
    if centre is not None:
        where = f"lies near {_place(centre)}"
    bounds = _used_in(wrong)
    used = "" if bounds is None else f" ({_box(bounds)} in degrees)"
    remedy = "state the crs that its coordinates are in"
    if one.swapped is not None and all(_in_area(one.swapped, crs) for crs in systems):
        there = _place(one.swapped)
        remedy = f"with x and y exchanged it would lie near {there}, so {EXCHANGE}"
    elif own.is_projected and fits_the_globe(one.coordinates):
        remedy = "its coordinates look like degrees, so state crs = 'EPSG:4326'"
    elif wrong is metric:
        remedy = f"give another metric CRS, such as {_zone_label(centre)}, or correct the layer's"
    kind = "the metric CRS" if wrong is metric else "its CRS"
    raise CrsError(
        f"layer {one.layer.spec.name!r} {where}, outside of where {kind}, {crs_label(wrong)}, is "
        f"used{used}; {remedy}."
    )


@lru_cache(maxsize=64)  # looking for the code takes 0.2 s
def _used_in(crs: CRS) -> Bounds | None:
    """Return where a CRS is used; for one that does not say, where its likeness of EPSG is."""
    code = crs.to_epsg() if crs.area_of_use is None else None
    area = crs.area_of_use if code is None else CRS.from_epsg(code).area_of_use
    return None if area is None else area.bounds


def _in_area(place: tuple[float, float], crs: CRS) -> bool:
    """Tell whether a CRS is used at a place, or nearly there; where it does not say, it is."""
    bounds = _used_in(crs)
    if bounds is None:
        return True
    west, south, east, north = bounds
    # From west to east; all the way round where both are the same meridian.
    width = float(wrap_degrees(east - west)) or FULL_TURN
    east_of = float(wrap_degrees(place[0] - west + AREA_MARGIN))
    return (
        east_of <= width + 2 * AREA_MARGIN
        and south - AREA_MARGIN <= place[1] <= north + AREA_MARGIN
    )


def _require_company(one: _Located, towns: _Towns) -> None:
    """Refuse a layer of which no place lies where most of the data does."""
    if len(one.places) < FEW_PLACES or (towns.of(one.places) == 0).any():
        return
    remedy = "correct the crs of the wrong ones, or load them separately"
    if one.swapped is not None and towns.of(np.array([one.swapped]))[0] == 0:
        remedy = f"with x and y exchanged it would lie there, so correct the wrong ones: {EXCHANGE}"
    here, there = _Towns(one.places).bounds(0), towns.bounds(0)
    raise CrsError(
        f"layer {one.layer.spec.name!r} lies at {_box(here)} in degrees, far from most of the data "
        f"at {_box(there)}; {remedy}."
    )


def _utm_zone(longitude: float, latitude: float) -> CRS:
    if not -80 <= latitude <= 84:  # noqa: PLR2004 - the ends of UTM
        raise CrsError(
            f"the data lies near {_place((longitude, latitude))}, where there is no UTM zone; give "
            "a projected CRS in metres as metric CRS."
        )
    # PROJ would look through all zones for a tenth of a second.
    zone = int((longitude + HALF_TURN) // 6) % 60 + 1
    return CRS.from_epsg((32600 if latitude >= 0 else 32700) + zone)


def _zone_label(centre: tuple[float, float] | None) -> str:
    return "EPSG:2154" if centre is None else crs_label(_utm_zone(*centre))


def _require_plane(
    extents: Sequence[Bounds], places: NDArray[np.float64], metric: CRS, most: float
) -> tuple[str, ...]:
    """Refuse a plane that turns or stretches too much between towns; note if there are several."""
    xy = np.column_stack(Transformer.from_crs(WGS84, metric, always_xy=True).transform(*places.T))
    distortion = plane_distortion(metric, (*xy.min(axis=0), *xy.max(axis=0)))
    listed = " and ".join(map(_box, extents[:PLACES_TOLD]))
    if len(extents) > PLACES_TOLD:
        listed += f" and {len(extents) - PLACES_TOLD} more"
    off = (
        f"bearings differ by {distortion.turn:.3g} degrees and lengths are off by "
        f"{100 * distortion.stretch:.2g} percent in {crs_label(metric)}"
        if np.isfinite(distortion.turn)
        else f"bearings and lengths mean nothing in {crs_label(metric)}"
    )
    if distortion.turn > most or 100 * distortion.stretch > most:
        what = f"lies in {len(extents)} places far apart" if len(extents) > 1 else "is too wide"
        raise CrsError(
            f"the data {what} ({listed} in degrees), over which {off}; at most {most:g} is "
            "allowed, so load part of it, for example with --clip and one of these boxes, or give "
            "a larger --max-distortion."
        )
    notes = []
    if len(extents) > 1:
        notes.append(
            f"the data lies in {len(extents)} places far apart ({listed} in degrees); {off}"
        )
    if distortion.angle > most:
        notes.append(
            f"grid north of {crs_label(metric)} is up to {distortion.angle:.3g} degrees off true "
            "north; give --north if bearings of queries are not measured from grid north"
        )
    return tuple(notes)


def _without_strays(one: _Located, towns: _Towns) -> RawLayer:
    """Leave out the objects that lie far from all others."""
    layer = one.layer
    known = _known(one.degrees)
    if layer.spec.role != "objects" or not known.any():
        return layer
    rows = np.flatnonzero(known)
    strays = rows[towns.of(one.degrees[rows]) >= towns.large]
    if not len(strays):
        return layer
    places = _distinct(one.degrees[strays])
    told = [_place((float(x), float(y))) for x, y in places[:PLACES_TOLD]]
    more = f" and {len(places) - PLACES_TOLD} more places" if len(places) > PLACES_TOLD else ""
    rows_lie = "1 row lies" if len(strays) == 1 else f"{len(strays):,} rows lie"
    note = f"{rows_lie} far from all others, at {' and '.join(told)}{more}; left out"
    counts = replace(layer.counts, misplaced=layer.counts.misplaced + len(strays))
    table = layer.table.drop(index=layer.table.index[strays]).reset_index(drop=True)
    return replace(layer, table=table, counts=counts, notes=(*layer.notes, note))


def _place(place: tuple[float, float]) -> str:
    return f"longitude {place[0]:.5g}, latitude {place[1]:.5g}"


def _box(bounds: Bounds) -> str:
    """Return bounds in degrees as an area is written, which is never smaller than they are."""
    west, south, east, north = (round(100.0 * side, 6) for side in bounds)
    sides = (math.floor(west), math.floor(south), math.ceil(east), math.ceil(north))
    return ",".join(f"{side / 100:g}" for side in sides)
