"""Move what people see at the front of a building, and maps have inside of it, to the front."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from semsig_gis.core import GEOMETRY, HALF_WIDTH
from semsig_gis.objects.table import arrow_objects
from semsig_gis.storage import points_to_wkb

if TYPE_CHECKING:
    import geopandas as gpd
    from numpy.typing import NDArray

    from semsig_gis.core import Taxonomy
    from semsig_gis.objects.table import StreetObjects

FAMILIES = {"shop", "food", "service", "worship", "culture", "leisure", "building"}
ENTRANCE = "entrance"
# What is less deep inside of a building is at its wall already.
WALL_M = 0.5
# Walls are considered at points this far apart.
STEP_M = 2.0
# An entrance this near to a front is used instead.
ENTRANCE_M = 5.0
# A metre between a wall and the edge of the street counts as many metres inside the building.
STREET_WEIGHT = 2.0
# Beyond this, a wall does not face the street, and its distance does not matter.
MOST_STREET_M = 15.0
# Half of the width of a street that states none.
HALF_WIDTH_M = 8.0


class _Walls(NamedTuple):
    """Free places in front of walls, shape (w, 2), sorted by the number of their building."""

    building: NDArray[np.int64]
    places: NDArray[np.float64]


def moved_to_fronts(
    objects: StreetObjects, buildings: gpd.GeoDataFrame, streets: gpd.GeoDataFrame | None
) -> tuple[StreetObjects, int]:
    """Return the objects with those inside of buildings at the fronts, and the number of these.

    Shops, restaurants and the like are moved, if they are deeper inside than half a metre: to the
    place half a metre in front of the wall that is near them and near the edge of a street, or of
    an entrance near to this place. Without streets, the nearest wall counts that is not shared
    with another building. An object in a building without a free wall remains where it is.
    """
    footprints = buildings.geometry.to_numpy()
    tree = shapely.STRtree(footprints)
    rows, building = _inside(objects, footprints, tree)
    if not len(rows):
        return objects, 0
    walls = _free_walls(footprints, np.unique(building), tree)
    # All pairs of an object and a place at a wall of its building.
    start = np.searchsorted(walls.building, building, side="left")
    counts = np.searchsorted(walls.building, building, side="right") - start
    pair_object = np.repeat(np.arange(len(rows)), counts)
    pair_wall = np.arange(counts.sum()) + np.repeat(start - np.cumsum(counts) + counts, counts)
    metres = np.hypot(*(objects.xy[rows][pair_object] - walls.places[pair_wall]).T)
    to_street = street_distances(walls.places, streets)
    metres += STREET_WEIGHT * to_street[pair_wall]
    best = _first_of_each(pair_object, metres)
    rows, front = rows[pair_object[best]], pair_wall[best]
    places = walls.places[front]
    # An entrance of the building near the front has priority.
    entrances = _at_entrances(objects, walls)
    if len(entrances):
        index = shapely.STRtree(_points(walls.places[entrances]))
        near, entrance, metres = _nearest(index, places)
        used = (metres <= ENTRANCE_M) & (
            walls.building[entrances[entrance]] == walls.building[front[near]]
        )
        places[near[used]] = walls.places[entrances[entrance[used]]]
    xy = objects.xy.copy()
    xy[rows] = places
    table = objects.arrow
    table = table.set_column(table.column_names.index(GEOMETRY), GEOMETRY, points_to_wkb(xy))
    result = arrow_objects(
        table,
        xy=xy,
        crs=objects.crs,
        taxonomy=objects.taxonomy,
        licenses=objects.licenses,
        notes=objects.notes,
    )
    return result, len(rows)


def _front_codes(taxonomy: Taxonomy) -> list[int]:
    return [
        item.code
        for item in taxonomy.classes
        if item.family in FAMILIES and item.shape == "point" and not item.tall
    ]


def _inside(
    objects: StreetObjects, footprints: NDArray[np.object_], tree: shapely.STRtree
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the objects to move, in order, and for each its building, the largest around it."""
    rows = np.flatnonzero(np.isin(objects.codes, _front_codes(objects.taxonomy)))
    points = _points(objects.xy[rows])
    at, building = tree.query(points, predicate="within")
    deep = shapely.distance(points[at], shapely.boundary(footprints[building])) > WALL_M
    at, building = at[deep], building[deep]
    first = _first_of_each(at, -shapely.area(footprints[building]))
    return rows[at[first]], building[first]


def _first_of_each(group: NDArray[np.int64], value: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the index of the least value of each group, in the order of the groups."""
    order = np.lexsort((value, group))
    return order[np.flatnonzero(np.diff(group[order], prepend=-1))]


def _free_walls(
    footprints: NDArray[np.object_], numbers: NDArray[np.int64], tree: shapely.STRtree
) -> _Walls:
    """Return the places in front of the outer walls of some buildings, outside of all buildings."""
    parts, of = shapely.get_parts(footprints[numbers], return_index=True)
    rings = shapely.get_exterior_ring(shapely.orient_polygons(parts))
    xy, ring = shapely.get_coordinates(rings, return_index=True)
    same = ring[1:] == ring[:-1]
    same &= (xy[1:] != xy[:-1]).any(axis=1)
    start, step, owner = xy[:-1][same], np.diff(xy, axis=0)[same], ring[1:][same]
    lengths = np.hypot(*step.T)
    counts = np.ceil(lengths / STEP_M).astype(np.int64)
    wall = np.repeat(np.arange(len(step)), counts)
    number = np.arange(len(wall)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = ((number + 0.5) / counts[wall])[:, np.newaxis]
    # The outside of a ring that turns left is at its right.
    outward = (np.column_stack([step[:, 1], -step[:, 0]]) / lengths[:, np.newaxis])[wall]
    places = start[wall] + share * step[wall] + WALL_M * outward
    free = np.ones(len(places), bool)
    free[tree.query(shapely.points(places), predicate="intersects")[0]] = False
    building = numbers[of[owner[wall]]]
    order = np.flatnonzero(free)[np.argsort(building[free], kind="stable")]
    return _Walls(building[order], places[order])


def street_distances(
    places: NDArray[np.float64], streets: gpd.GeoDataFrame | None
) -> NDArray[np.float64]:
    """Return the distance of places, shape (n, 2), to the edge of the nearest street.

    It is at most 15 m, also farther away, and 0 if there are no streets.
    """
    if streets is None or not len(streets):
        return np.zeros(len(places))
    tree = shapely.STRtree(streets.geometry.to_numpy())
    half = np.full(len(streets), np.nan)
    if HALF_WIDTH in streets:
        half = streets[HALF_WIDTH].to_numpy(np.float64)
    half = np.where(np.isnan(half), HALF_WIDTH_M, half)
    (place, street), metres = tree.query_nearest(
        shapely.points(places),
        max_distance=MOST_STREET_M + half.max(),
        all_matches=False,
        return_distance=True,
    )
    result = np.full(len(places), MOST_STREET_M)
    result[place] = np.clip(metres - half[street], 0, MOST_STREET_M)
    return result


def _points(xy: NDArray[np.float64]) -> NDArray[np.object_]:
    return np.asarray(shapely.points(xy), object)


def _nearest(
    tree: shapely.STRtree, places: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    (place, other), metres = tree.query_nearest(
        shapely.points(places), all_matches=False, return_distance=True
    )
    return place, other, metres


def _at_entrances(objects: StreetObjects, walls: _Walls) -> NDArray[np.int64]:
    """Return the places at walls that are at an entrance."""
    codes = [item.code for item in objects.taxonomy.classes if item.name == ENTRANCE]
    entrances = objects.xy[np.isin(objects.codes, codes)]
    if not len(entrances) or not len(walls.places):
        return np.empty(0, np.int64)
    _, wall, metres = _nearest(shapely.STRtree(_points(walls.places)), entrances)
    near = metres <= WALL_M + STEP_M
    return np.unique(wall[near])
