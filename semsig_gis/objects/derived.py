"""Objects that are computed from streets and buildings: junctions, dead ends, corners and gaps."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import shapely

from semsig_gis.core import (
    CLASS_NAME,
    FULL_TURN,
    NAME,
    SOURCE_ID,
    angular_distance,
    wrap_degrees,
)
from semsig_gis.objects.connected import connected
from semsig_gis.objects.fronts import street_distances
from semsig_gis.sources import WGS84, join_areas, transformed

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import geopandas as gpd
    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.sources import RawLayer

# Vertices nearer than this are the same; the ends of streets may be farther apart.
SAME_VERTEX_M, TOUCH_M = 0.01, 1.0
# Crossings that are joined by a street up to this length are one junction.
JUNCTION_M = 25.0
# The direction of a street is that from the junction to a point this far along it.
ARM_M = 15.0
# Streets that leave a junction in nearly one direction are the carriageways of one street.
PARALLEL_DEGREES, SPLIT_DEGREES, SAME_DEGREES = 25.0, 40.0, 10.0
CARRIAGEWAYS_M = 30.0
ARMS = {3: "t_junction", 4: "crossroads"}
MORE_ARMS = "large_junction"
# A roundabout is a ring of streets up to this length that is round and not a polygon.
RING_M, ROUNDNESS, RING_VERTICES = 300.0, 0.85, 8
AROUND_RING_M = 15.0
# Streets that end this near to the edge of the data continue beyond it.
EDGE_M = 20.0
# Two ends that point at each other over this distance are those of a tunnel or a passage.
TUNNEL_M, TUNNEL_DEGREES = 300.0, 25.0
# Sides of a corner, the least change of direction at it, and the detail that is not a wall.
SIDE_M, CORNER_DEGREES, DETAIL_M = 4.0, 30.0, 0.5
# Buildings with smaller gaps between them touch.
JOINED_M = 0.4
GAP_M = (1.0, 8.0)
# A gap is open to a street at this distance from its edge.
FRONT_M = 4.0


def derived_layers(
    layers: Sequence[RawLayer],
    *,
    streets: gpd.GeoDataFrame | None,
    buildings: gpd.GeoDataFrame | None,
    crs: CRS,
    within: shapely.Geometry | None,
) -> list[RawLayer]:
    """Return the layers with the objects of those that are to be computed.

    The surroundings and `within`, the area that the data covers if it is known, are in `crs`. A
    note says if the surroundings for a layer are not there.
    """
    town = _Town(streets, buildings, within)
    return [layer if layer.spec.derive is None else _computed(layer, town, crs) for layer in layers]


def covered_area(layers: Sequence[RawLayer], crs: CRS) -> shapely.Geometry | None:
    """Return the area that all layers of streets and buildings cover; None if one states none."""
    extents = {
        id(layer.extent): layer.extent for layer in layers if layer.spec.role != "objects"
    }.values()
    if not extents or None in extents:
        return None
    polygons = np.array([extent.polygon for extent in extents if extent is not None], object)
    joined = join_areas(polygons)
    if joined is None:
        return None
    (area,) = transformed(np.array([shapely.segmentize(joined, 0.01)], object), WGS84, crs)
    return area  # type: ignore[no-any-return]


def _computed(layer: RawLayer, town: _Town, crs: CRS) -> RawLayer:
    spec = layer.spec
    needs = ("streets", "buildings") if spec.derive == "gaps" else ("streets",)
    needs = ("buildings",) if spec.derive == "building_corners" else needs
    missing = [name for name in needs if getattr(town, name) is None]
    if missing:
        note = f"computed from {' and '.join(needs)}, which are not there; left out"
        return replace(layer, crs=crs, notes=(*layer.notes, note))
    names, xy = COMPUTATIONS[spec.derive or "junctions"](town)
    if town.within is not None and len(xy):
        inside = shapely.intersects(town.within, shapely.points(xy))
        names, xy = np.array(names)[inside].tolist(), xy[inside]
    columns = {CLASS_NAME: names, SOURCE_ID: [""] * len(names)}
    return replace(
        layer,
        columns=pa.table({name: pa.array(texts, pa.string()) for name, texts in columns.items()}),
        geometry=np.asarray(shapely.points(xy), object),
        crs=crs,
        counts=replace(layer.counts, read=len(names)),
    )


# Names of classes, and positions, shape (n, 2).
_Found = tuple[list[str], "NDArray[np.float64]"]


class _Town:
    """Streets and buildings, and what several computations need of them."""

    def __init__(
        self,
        streets: gpd.GeoDataFrame | None,
        buildings: gpd.GeoDataFrame | None,
        within: shapely.Geometry | None,
    ) -> None:
        self.streets = None if streets is None or not len(streets) else streets
        self.buildings = None if buildings is None or not len(buildings) else buildings
        self.within = within

    @cached_property
    def network(self) -> _Network:
        """The streets as a network."""
        assert self.streets is not None  # noqa: S101 - for mypy
        return _Network.of(self.streets)

    @cached_property
    def rings(self) -> NDArray[np.object_]:
        """The areas inside of roundabouts."""
        return _round_rings(self.network)

    @cached_property
    def blocks(self) -> NDArray[np.object_]:
        """The buildings, joined where they touch, without small details of their outlines."""
        assert self.buildings is not None  # noqa: S101 - for mypy
        footprints = shapely.make_valid(self.buildings.geometry.to_numpy())
        half = JOINED_M / 2
        wide = shapely.buffer(footprints, half, join_style="mitre")
        joined = shapely.buffer(shapely.union_all(wide), -half, join_style="mitre")
        blocks = shapely.get_parts(shapely.simplify(joined, DETAIL_M))
        return shapely.orient_polygons(blocks[~shapely.is_empty(blocks)])


@dataclass(frozen=True, eq=False)
class _Network:
    """Streets as a graph: positions of vertices, and by vertex the neighbours with street names."""

    xy: NDArray[np.float64]
    neighbours: list[dict[int, str]]

    @classmethod
    def of(cls, streets: gpd.GeoDataFrame) -> _Network:
        lines, row = shapely.get_parts(streets.geometry.to_numpy(), return_index=True)
        names = streets[NAME].tolist() if NAME in streets else [""] * len(streets)
        names = [names[place] if isinstance(names[place], str) else "" for place in row.tolist()]
        coordinates, line = shapely.get_coordinates(lines, return_index=True)
        keys = np.rint(coordinates / SAME_VERTEX_M).astype(np.int64)
        _, first, vertex = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        vertex = vertex.ravel()
        network = cls(coordinates[first], [{} for _ in first])
        inner = np.flatnonzero(line[1:] == line[:-1])
        for start, end, place in zip(
            vertex[inner].tolist(), vertex[inner + 1].tolist(), line[inner].tolist(), strict=True
        ):
            network.join(start, end, names[place])
        network._join_ends(lines, line, vertex)
        return network

    def join(self, start: int, end: int, name: str) -> None:
        """Add a street between two vertices."""
        if start != end:
            self.neighbours[start].setdefault(end, name)
            self.neighbours[end].setdefault(start, name)

    def _join_ends(
        self, lines: NDArray[np.object_], line: NDArray[np.int64], vertex: NDArray[np.int64]
    ) -> None:
        """Join ends of streets to other streets that they nearly touch."""
        ends = np.array([v for v, others in enumerate(self.neighbours) if len(others) == 1])
        if not len(ends):
            return
        vertices_of = np.split(vertex, np.flatnonzero(np.diff(line)) + 1)
        points = shapely.points(self.xy[ends])
        near, other = shapely.STRtree(lines).query(points, predicate="dwithin", distance=TOUCH_M)
        for end, number in zip(ends[near].tolist(), other.tolist(), strict=True):
            of_line = vertices_of[number]
            if end in of_line:
                continue
            place = shapely.line_locate_point(lines[number], shapely.Point(self.xy[end]))
            steps = np.hypot(*np.diff(self.xy[of_line], axis=0).T)
            after = min(int(np.searchsorted(np.cumsum(steps), place)), len(steps) - 1)
            start, stop = int(of_line[after]), int(of_line[after + 1])
            name = self.neighbours[start].pop(stop, None)
            if name is None:
                continue  # another end was joined there already
            del self.neighbours[stop][start]
            self.join(start, end, name)
            self.join(end, stop, name)

    @property
    def crossings(self) -> list[int]:
        """Vertices where at least three streets meet."""
        return [v for v, others in enumerate(self.neighbours) if len(others) > 2]  # noqa: PLR2004

    def walk(self, start: int, second: int, length: float) -> tuple[int, float, list[int]]:
        """Follow a street to the next crossing or end, or for a length.

        Return the last vertex, the length, and all vertices.
        """
        path, metres = [start, second], self._metres(start, second)
        while metres < length and len(self.neighbours[path[-1]]) == 2:  # noqa: PLR2004
            (following,) = (v for v in self.neighbours[path[-1]] if v != path[-2])
            if following == start:
                path.append(following)
                break
            metres += self._metres(path[-1], following)
            path.append(following)
        return path[-1], metres, path

    def _metres(self, start: int, end: int) -> float:
        return math.dist(self.xy[start], self.xy[end])

    def direction(self, start: int, second: int) -> float:
        """Return the bearing in which a street leaves a vertex, over its first metres."""
        _, _, path = self.walk(start, second, ARM_M)
        line = shapely.LineString(self.xy[path])
        place = shapely.line_interpolate_point(line, min(ARM_M, line.length))
        dx, dy = shapely.get_coordinates(place)[0] - self.xy[start]
        return float(wrap_degrees(math.degrees(math.atan2(dx, dy))))


@dataclass(frozen=True)
class _Arm:
    """A street that leaves a junction: at which vertex, in which direction, and its name."""

    vertex: int
    xy: tuple[float, float]
    bearing: float
    name: str

    def same_street(self, other: _Arm) -> bool:
        """Whether two arms are carriageways of one street."""
        turn = float(angular_distance(self.bearing, other.bearing))
        if self.vertex == other.vertex:
            return turn < (SPLIT_DEGREES if self.name == other.name != "" else SAME_DEGREES)
        same_name = self.name == other.name or "" in {self.name, other.name}
        near = math.dist(self.xy, other.xy) < CARRIAGEWAYS_M
        return same_name and near and turn < PARALLEL_DEGREES


def _junctions(town: _Town) -> _Found:
    """Return the junctions by the number of their arms, and the roundabouts."""
    network = town.network
    crossings = network.crossings
    in_ring = set[int]()
    if len(town.rings) and crossings:
        around = shapely.buffer(town.rings, AROUND_RING_M)
        points = shapely.points(network.xy[crossings])
        hits = shapely.STRtree(around).query(points, predicate="intersects")[0]
        in_ring = {crossings[hit] for hit in hits.tolist()}
    crossings = [vertex for vertex in crossings if vertex not in in_ring]
    number_of = {vertex: number for number, vertex in enumerate(crossings)}

    def links() -> Iterator[tuple[int, int]]:
        for vertex, number in number_of.items():
            for second in network.neighbours[vertex]:
                last, metres, _ = network.walk(vertex, second, JUNCTION_M)
                if last in number_of and metres <= JUNCTION_M:
                    yield number, number_of[last]

    clusters: dict[int, list[int]] = {}
    for vertex, cluster_number in zip(
        crossings, connected(len(crossings), links()).tolist(), strict=True
    ):
        clusters.setdefault(cluster_number, []).append(vertex)
    names, places = [], []
    for cluster in clusters.values():
        arms = _arm_count(network, cluster)
        if arms > 2:  # noqa: PLR2004 - else a street that divides
            names.append(ARMS.get(arms, MORE_ARMS))
            places.append(network.xy[cluster].mean(axis=0))
    centres = shapely.get_coordinates(shapely.centroid(town.rings))
    return names + ["roundabout"] * len(centres), np.vstack([*places, centres])


def _arm_count(network: _Network, cluster: list[int]) -> int:
    """Return the number of streets that leave a junction."""
    inside = set(cluster)
    arms = []
    for vertex in cluster:
        for second, name in network.neighbours[vertex].items():
            last, metres, _ = network.walk(vertex, second, JUNCTION_M)
            if last not in inside or metres > JUNCTION_M:
                x, y = network.xy[vertex].tolist()
                arms.append(_Arm(vertex, (x, y), network.direction(vertex, second), name))
    pairs = (
        (first, second)
        for first, second in itertools.combinations(range(len(arms)), 2)
        if arms[first].same_street(arms[second])
    )
    return len(np.unique(connected(len(arms), pairs)))


def _round_rings(network: _Network) -> NDArray[np.object_]:
    """Return the areas inside of closed streets that are round."""
    pairs = [(v, w) for v, others in enumerate(network.neighbours) for w in others if v < w]
    ends = network.xy[np.array(pairs, np.int64).reshape(-1, 2)]
    lines = np.asarray(shapely.linestrings(ends), object)
    faces: NDArray[np.object_] = shapely.get_parts(shapely.polygonize(lines))
    lengths = shapely.length(faces)
    roundness = 4 * math.pi * shapely.area(faces) / np.maximum(lengths, SAME_VERTEX_M) ** 2
    vertices = shapely.get_num_coordinates(faces) - 1
    result: NDArray[np.object_] = faces[
        (lengths <= RING_M) & (roundness >= ROUNDNESS) & (vertices >= RING_VERTICES)
    ]
    return result


def _dead_ends(town: _Town) -> _Found:
    """Return the ends of streets inside of the data, without those of tunnels and passages."""
    network = town.network
    ends = [v for v, others in enumerate(network.neighbours) if len(others) == 1]
    xy = network.xy[ends].reshape(-1, 2)
    low, high = network.xy.min(axis=0), network.xy.max(axis=0)
    inner = shapely.box(*low, *high) if town.within is None else town.within
    rows = shapely.intersects(shapely.buffer(inner, -EDGE_M), shapely.points(xy))
    rows &= ~_at_tunnels(network, ends, xy)
    return ["dead_end"] * int(rows.sum()), xy[rows]


def _at_tunnels(network: _Network, ends: list[int], xy: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which ends of streets point at another end that points at them."""
    outward = [network.direction(end, *network.neighbours[end]) + FULL_TURN / 2 for end in ends]
    bearing = wrap_degrees(np.array(outward))
    points = np.asarray(shapely.points(xy), object)
    first, second = shapely.STRtree(points).query(points, predicate="dwithin", distance=TUNNEL_M)
    dx, dy = (xy[second] - xy[first]).T
    between = np.degrees(np.arctan2(dx, dy))
    tunnel = first != second
    for end, turn in ((first, 0.0), (second, FULL_TURN / 2)):
        tunnel &= angular_distance(bearing[end], wrap_degrees(between + turn)) <= TUNNEL_DEGREES
    result = np.zeros(len(ends), bool)
    result[first[tunnel]] = True
    return result


def _building_corners(town: _Town) -> _Found:
    """Return the corners of blocks where two long walls meet outwards."""
    corner, xy = _corners(town.blocks, SIDE_M)
    return ["building_corner"] * len(corner), xy


def _corners(
    blocks: NDArray[np.object_], wall: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the convex corners of polygons with two long walls: block and position."""
    rings, block = shapely.get_rings(blocks, return_index=True)
    xy, ring = shapely.get_coordinates(rings, return_index=True)
    first = np.flatnonzero(np.diff(ring, prepend=-1))
    last = np.append(first[1:], len(ring)) - 1
    before = np.diff(xy, axis=0, prepend=xy[:1])
    before[first] = before[last]  # the first vertex of a ring is its last
    after = np.roll(before, -1, axis=0)
    lengths = np.hypot(*before.T), np.hypot(*after.T)
    # Walls lie left of their building's outside, so that a turn to the left is convex.
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    turn = np.degrees(np.arctan2(cross, (before * after).sum(axis=1)))
    corners = (turn >= CORNER_DEGREES) & (turn <= FULL_TURN / 2 - SAME_VERTEX_M)
    corners &= (lengths[0] >= wall) & (lengths[1] >= wall)
    corners[last] = False
    return block[ring[corners]], xy[corners]


def _gaps(town: _Town) -> _Found:
    """Return the openings between neighbouring blocks that are open to a street, one for a pair."""
    nothing: _Found = [], np.empty((0, 2))
    block, xy = _corners(town.blocks, GAP_M[0])
    tree = shapely.STRtree(town.blocks)
    corner, other = tree.query(shapely.points(xy), predicate="dwithin", distance=GAP_M[1])
    apart = block[corner] != other
    corner, other = corner[apart], other[apart]
    lines = shapely.shortest_line(shapely.points(xy[corner]), town.blocks[other])
    wide = shapely.length(lines) >= GAP_M[0]
    corner, other, lines = corner[wide], other[wide], lines[wide]
    if not len(corner):
        return nothing
    middles = shapely.get_coordinates(shapely.line_interpolate_point(lines, 0.5, normalized=True))
    metres = street_distances(middles, town.streets)
    free = metres <= FRONT_M
    assert town.streets is not None  # noqa: S101 - for mypy
    street = town.streets.geometry.to_numpy()
    to_street = shapely.STRtree(street)
    for views in (lines, _views(middles, street, to_street)):
        # Shorter than between the outlines, which the views may touch.
        inner = _shortened(views)
        free[tree.query(inner, predicate="intersects")[0]] = False
    if not free.any():
        return nothing
    low, high = np.sort([block[corner], other], axis=0)
    order = np.lexsort((metres, high, low))
    order = order[free[order]]
    changed = (np.diff(low[order], prepend=-1) != 0) | (np.diff(high[order], prepend=-1) != 0)
    best = np.sort(order[changed])
    return ["building_gap"] * len(best), middles[best]


def _views(
    places: NDArray[np.float64], streets: NDArray[np.object_], tree: shapely.STRtree
) -> NDArray[np.object_]:
    """Return the lines from places to the nearest streets."""
    points = shapely.points(places)
    _, street = tree.query_nearest(points, all_matches=False)
    return np.asarray(shapely.shortest_line(points, streets[street]), object)


def _shortened(lines: NDArray[np.object_]) -> NDArray[np.object_]:
    """Return lines without a bit at both ends."""
    ends = [shapely.line_interpolate_point(lines, x, normalized=True) for x in (0.05, 0.95)]
    return np.asarray(
        shapely.linestrings(np.stack([shapely.get_coordinates(end) for end in ends], axis=1)),
        object,
    )


COMPUTATIONS = {
    "junctions": _junctions,
    "dead_ends": _dead_ends,
    "building_corners": _building_corners,
    "gaps": _gaps,
}
