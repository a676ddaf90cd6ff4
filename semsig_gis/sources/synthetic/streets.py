"""The streets of the synthetic city and what stands along them: trees, lights, signals, the rest.

Streets are the edges between the faces of a Voronoi diagram. Neighbouring faces form quarters; the
edges between two quarters are an avenue, all others are streets of their own. What is scattered is
drawn evenly, so that cities of a size have nearly the same number of each class.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]
    Bools = NDArray[np.bool_]

BLOCK_M = 112.0  # mean distance between the middles of neighbouring faces
QUARTER_M = 395.0  # and of neighbouring quarters
JITTER = 0.9  # of a block or quarter, by which the middles leave a regular lattice
MARGIN = 2  # quarters beyond the square, so that its edge is like its middle
REACH_M = 60.0  # streets that are farther from the square are left out

# Metres from the centre line to the houses; the pavement is the outer part of it.
STREET_HALF_WIDTH_M = (5.5, 9.0)
AVENUE_HALF_WIDTH_M = (11.0, 21.0)
PAVEMENT = 0.3


@dataclass(frozen=True, eq=False, slots=True)
class Network:
    """Edges of the street network, one entry an edge between two junctions, and the faces.

    `start` is the first junction, in metres from the middle of the city, and `along` the unit
    vector to the second, both of shape (n, 2); `length` is in metres. `junction`, shape (n, 2), has
    the numbers of both ends. `street` is the street or avenue of the edge; avenues come first.
    `half_width` is metres from the centre line to the houses, and `clear`, shape (n, 2), metres to
    leave free at either end for what crosses there. `faces` are the polygons that the centre lines
    enclose.
    """

    start: Floats
    along: Floats
    length: Floats
    junction: Ints
    street: Ints
    avenue: Bools
    half_width: Floats
    clear: Floats
    faces: NDArray[np.object_]

    def __len__(self) -> int:
        """Return the number of edges."""
        return len(self.length)

    def drawn(self, limits: tuple[float, float], rng: np.random.Generator) -> Floats:
        """Draw numbers that fill a range evenly for avenues, and for streets; of every edge."""
        avenues = int(self.street[self.avenue].max(initial=-1)) + 1
        streets = int(self.street.max(initial=-1)) + 1 - avenues
        numbers = np.concatenate([_evenly(avenues, limits, rng), _evenly(streets, limits, rng)])
        return numbers[self.street]

    @property
    def kerb(self) -> Floats:
        """Metres from the centre line to the kerb, shape (n,)."""
        return self.half_width * (1.0 - PAVEMENT)

    @property
    def lines(self) -> NDArray[np.object_]:
        """Centre lines, shape (n,)."""
        ends = np.stack([self.start, self.start + self.along * self.length[:, None]], axis=1)
        return np.asarray(shapely.linestrings(ends))

    def place(self, edge: Ints, t: Floats, offset: Floats) -> Floats:
        """Return positions on edges, shape (k, 2), in metres from the middle of the city.

        `t` is metres along an edge, `offset` metres to the right of its centre line.
        """
        along = self.along[edge]
        right = np.stack([along[:, 1], -along[:, 0]], axis=1)
        place: Floats = self.start[edge] + t[:, None] * along + offset[:, None] * right
        return place


def lay_streets(size: float, rng: np.random.Generator) -> Network:
    """Lay the streets in and near a square city with sides of `size` metres."""
    turn = rng.uniform(0.0, math.pi / 2)
    reach = size / 2 + MARGIN * QUARTER_M
    middles = _scattered_lattice(reach, BLOCK_M, turn, rng)
    quarters = _scattered_lattice(reach, QUARTER_M, turn, rng)
    faces = shapely.get_parts(shapely.voronoi_polygons(shapely.multipoints(middles)))
    quarter = shapely.STRtree(np.asarray(shapely.points(quarters))).nearest(shapely.centroid(faces))

    ends, sides, corners = _shared_edges(faces)
    far = size / 2 + REACH_M
    square = shapely.box(-far, -far, far, far)
    near = shapely.intersects(shapely.linestrings(corners[ends]), square)
    ends, sides = ends[near], sides[near]
    faces = faces[shapely.intersects(faces, square)]

    beside = np.sort(quarter[sides], axis=1)
    avenue = beside[:, 0] != beside[:, 1]
    pair, own = np.unique(beside[avenue] @ [len(quarters), 1], return_inverse=True)
    street = np.empty(len(ends), np.int64)
    street[avenue] = own
    street[~avenue] = len(pair) + np.arange(len(ends) - len(own))
    half_width = np.concatenate(
        [
            _evenly(len(pair), AVENUE_HALF_WIDTH_M, rng),
            _evenly(len(ends) - len(own), STREET_HALF_WIDTH_M, rng),
        ]
    )[street]

    step = corners[ends[:, 1]] - corners[ends[:, 0]]
    length = np.hypot(*step.T)
    return Network(
        start=corners[ends[:, 0]],
        along=step / length[:, None],
        length=length,
        junction=ends,
        street=street,
        avenue=avenue,
        half_width=half_width,
        clear=_crossing(ends, avenue, half_width * (1.0 - PAVEMENT)),
        faces=faces,
    )


def _evenly(count: int, limits: tuple[float, float], rng: np.random.Generator) -> Floats:
    """Draw one number from each of `count` equal parts of a range, in any order."""
    low, high = limits
    share = (rng.permutation(count) + rng.uniform(size=count)) / max(count, 1)
    numbers: Floats = low + (high - low) * share
    return numbers


def _scattered_lattice(reach: float, step: float, turn: float, rng: np.random.Generator) -> Floats:
    """Return places about `step` apart in the square of twice the reach."""
    most = math.ceil(reach * math.sqrt(2.0) / step)
    axis = np.arange(-most, most + 1)
    lattice = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2) * step
    shift = JITTER * step * (rng.uniform(size=lattice.shape) - 0.5)
    cos, sin = math.cos(turn), math.sin(turn)
    places: Floats = (lattice + shift) @ np.array([[cos, sin], [-sin, cos]])
    return places[(np.abs(places) <= reach).all(axis=1)]


def _shared_edges(faces: NDArray[np.object_]) -> tuple[Ints, Ints, Floats]:
    """Return the edges that two faces share: numbers of corners and faces, and the corners."""
    # GEOS gives all faces at a corner the same coordinates, to the last bit.
    ring, face = shapely.get_coordinates(faces, return_index=True)
    corners, number = np.unique(ring.view(np.complex128).ravel(), return_inverse=True)
    inner = face[1:] == face[:-1]
    ends = np.sort(np.stack([number[:-1], number[1:]], axis=1)[inner], axis=1)
    key = ends @ [len(corners), 1]
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order]) == 0)
    one, other = order[first], order[first + 1]
    owner = face[:-1][inner]
    xy: Floats = np.stack([corners.real, corners.imag], axis=1)
    return ends[one], np.stack([owner[one], owner[other]], axis=1), xy


def _crossing(ends: Ints, avenue: Bools, kerb: Floats) -> Floats:
    """Return how much of either end of each edge what crosses there takes up."""
    widest = np.zeros((2, int(ends.max(initial=0)) + 1))
    for end in (0, 1):
        np.maximum.at(widest[0], ends[:, end], kerb)
        np.maximum.at(widest[1], ends[~avenue, end], kerb[~avenue])
    any_street, side_street = widest[:, ends]
    # An avenue is not interrupted by itself, only by the streets that join it.
    clear: Floats = np.where(avenue[:, None] & (side_street > 0), side_street, any_street)
    return clear + 1.0


# --- Objects ------------------------------------------------------------------------------------

# The numbers below are calibrated together: the signatures of PARIS_LIKE then hold each class as
# often as the paper's. Change one, and its test tells which counts have left their range.
# Metres between neighbours in a row; one rhythm a street.
STREET_LIGHT_SPACING_M = (15.0, 32.0)
AVENUE_LIGHT_SPACING_M = (6.0, 11.0)
TREE_SPACING_M = (4.5, 7.0)
LIGHT_JITTER_M = 0.3  # either way
TREE_JITTER_M = 0.5

ALTERNATING_SHARE = 0.25  # of the streets, whose lights change sides
TREE_LINED_AVENUES = 0.57  # share of the avenues
TREE_LINED_STREETS = 0.02  # and of the streets
DOUBLE_ROW_HALF_WIDTH_M = 17.0  # tree-lined avenues as wide as this have two rows a side
TREE_GAPS = (0.0, 0.3)  # share of the trees of a row that are missing; one a street
ONE_SIDED_SHARE = 0.2  # of the tree-lined streets, with trees on one side alone
PARK_TREE_SPACING_M = 12.0
SQUARE_LIGHT_SPACING_M = 18.0
SIGNALLED_CORNERS = 0.115  # share of the corners of an avenue and a street
THROUGH = 2  # edges of an avenue that passes a corner; where more meet, there always are signals

# Objects a kilometre of avenue.
RATES = {
    "bench": 15.75,
    "indicator": 4.2,
    "bus_stop": 3.76,
    "bike_station": 1.67,
    "automatic_wc": 0.925,
    "water_fountain": 0.785,
    "car_station": 0.506,
    "taxi_station": 0.293,
}
AVENUE_TO_STREET_RATE = 10.0

# Metres from the kerb to the objects of a class; others stand at the last.
SETBACKS_M = {"alignment_tree": 1.0, "street_light": 0.5, "traffic_light": 0.3}
SETBACK_M = 0.8
SECOND_ROW_M = 3.0


@dataclass(frozen=True, eq=False, slots=True)
class Furniture:
    """Objects of one class: metres from the middle of the city, shape (k, 2), and identifiers."""

    xy: Floats
    ids: NDArray[np.str_]


def furnish(
    class_name: str,
    network: Network,
    *,
    parks: NDArray[np.object_],
    squares: NDArray[np.object_],
    rng: np.random.Generator,
) -> Furniture:
    """Place the objects of one class; parks and squares, polygons, have trees and lights too."""
    if class_name == "alignment_tree":
        return _joined(*_trees(network, rng), _on_ground(parks, PARK_TREE_SPACING_M, rng))
    if class_name == "street_light":
        return _joined(*_lights(network, rng), _on_ground(squares, SQUARE_LIGHT_SPACING_M, rng))
    if class_name == "traffic_light":
        return _joined(*_signals(network, rng))
    return _scattered(network, RATES[class_name], rng)


def _joined(*parts: Furniture) -> Furniture:
    xy = np.concatenate([part.xy for part in parts])
    return Furniture(xy, np.concatenate([part.ids for part in parts]))


@dataclass(frozen=True, eq=False, slots=True)
class _Row:
    """Places along edges, one entry an object."""

    edge: Ints
    number: Ints
    t: Floats  # metres from the first junction

    def only(self, kept: Bools) -> _Row:
        return _Row(self.edge[kept], self.number[kept], self.t[kept])

    def beside(
        self, network: Network, side: Floats, setback: float, *, second: bool = False
    ) -> Furniture:
        """Return objects outside the kerb, on the right where `side` is 1, else on the left."""
        offset = side * (network.kerb[self.edge] + setback)
        letters = np.where(side > 0, "R", "L").tolist()
        ids = [
            f"{edge}{letter * (1 + second)}{number}"
            for edge, letter, number in zip(
                self.edge.tolist(), letters, self.number.tolist(), strict=True
            )
        ]
        return Furniture(network.place(self.edge, self.t, offset), np.array(ids, dtype=np.str_))


def _row(
    network: Network, edges: Ints, spacing: Floats, jitter: float, rng: np.random.Generator
) -> _Row:
    """Return objects evenly spaced on edges, by the spacing of every edge, shape (n,)."""
    gap = spacing[edges]
    begin = network.clear[edges, 0] + rng.uniform(size=len(edges)) * gap
    room = network.length[edges] - network.clear[edges, 1] - begin
    counts = np.maximum(np.floor(room / gap).astype(np.int64) + 1, 0)
    owner, number = counted(counts)
    shift = rng.uniform(-jitter, jitter, size=len(owner))
    return _Row(edges[owner], number, begin[owner] + number * gap[owner] + shift)


def counted(counts: Ints) -> tuple[Ints, Ints]:
    """Return who owns each of the things counted, and its number with its owner."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)


def _trees(network: Network, rng: np.random.Generator) -> list[Furniture]:
    spacing = network.drawn(TREE_SPACING_M, rng)
    gaps = network.drawn(TREE_GAPS, rng)
    share = np.where(network.avenue, TREE_LINED_AVENUES, TREE_LINED_STREETS)
    lined = network.drawn((0.0, 1.0), rng) < share
    one_sided = network.drawn((0.0, 1.0), rng) < ONE_SIDED_SHARE
    double = lined & network.avenue & (network.half_width >= DOUBLE_ROW_HALF_WIDTH_M)
    parts = []
    for edges, side, second in (
        (lined, 1.0, False),
        (lined & ~one_sided, -1.0, False),
        (double, 1.0, True),
        (double & ~one_sided, -1.0, True),
    ):
        row = _row(network, np.flatnonzero(edges), spacing, TREE_JITTER_M, rng)
        missing = rng.uniform(size=len(row.t)) < gaps[row.edge]
        row = row.only(~missing)
        setback = SETBACKS_M["alignment_tree"] + second * SECOND_ROW_M
        parts.append(row.beside(network, np.full(len(row.t), side), setback, second=second))
    return parts


def _lights(network: Network, rng: np.random.Generator) -> list[Furniture]:
    street_spacing = network.drawn(STREET_LIGHT_SPACING_M, rng)
    avenue_spacing = network.drawn(AVENUE_LIGHT_SPACING_M, rng)
    alternating = network.drawn((0.0, 1.0), rng) < ALTERNATING_SHARE
    lit_side = np.sign(network.drawn((-1.0, 1.0), rng))
    setback = SETBACKS_M["street_light"]

    edges = np.flatnonzero(~network.avenue)
    row = _row(network, edges, street_spacing, LIGHT_JITTER_M, rng)
    turned = alternating[row.edge] & (row.number % 2 == 1)
    parts = [row.beside(network, lit_side[row.edge] * np.where(turned, -1.0, 1.0), setback)]
    edges = np.flatnonzero(network.avenue)
    for side in (-1.0, 1.0):
        row = _row(network, edges, avenue_spacing, LIGHT_JITTER_M, rng)
        parts.append(row.beside(network, np.full(len(row.t), side), setback))
    return parts


def _signals(network: Network, rng: np.random.Generator) -> list[Furniture]:
    """Put a light on the right of every approach to a signalled junction."""
    junctions = int(network.junction.max()) + 1
    avenues = np.bincount(network.junction[network.avenue].ravel(), minlength=junctions)
    signalled = avenues > THROUGH
    # Bresenham's rule spreads them: one whenever the sum passes a whole number.
    corner = np.flatnonzero(avenues == THROUGH)
    sums = np.arange(len(corner) + 1) * SIGNALLED_CORNERS + rng.uniform()
    signalled[corner] = np.diff(np.floor(sums)) > 0
    passable = network.clear.sum(axis=1) < network.length
    parts = []
    # Driving towards the second junction the right side is +1, towards the first it is -1.
    for end, side in ((0, -1.0), (1, 1.0)):
        edge = np.flatnonzero(signalled[network.junction[:, end]] & passable)
        t = network.clear[edge, 0] if end == 0 else network.length[edge] - network.clear[edge, 1]
        row = _Row(edge, np.full(len(edge), end), t)
        parts.append(row.beside(network, np.full(len(edge), side), SETBACKS_M["traffic_light"]))
    return parts


def _scattered(network: Network, rate: float, rng: np.random.Generator) -> Furniture:
    """Scatter objects at a rate a kilometre of avenue, evenly over all streets."""
    free = np.maximum(network.length - network.clear.sum(axis=1), 0.0)
    per_metre = rate / 1000.0 / np.where(network.avenue, 1.0, AVENUE_TO_STREET_RATE)
    expected = np.concatenate([[0.0], np.cumsum(free * per_metre)])
    count = int(expected[-1] + rng.uniform())
    drawn = (np.arange(count) + rng.uniform(size=count)) * (expected[-1] / max(count, 1))
    edge = np.searchsorted(expected, drawn, side="right") - 1
    t = network.clear[edge, 0] + (drawn - expected[edge]) / per_metre[edge]
    number = counted(np.bincount(edge, minlength=len(network)))[1]
    side = rng.choice([-1.0, 1.0], size=count)
    return _Row(edge, number, t).beside(network, side, SETBACK_M)


def _on_ground(grounds: NDArray[np.object_], spacing: float, rng: np.random.Generator) -> Furniture:
    """Place objects about `spacing` apart all over open ground."""
    bounds = shapely.bounds(grounds).reshape(-1, 4)
    cells = np.ceil((bounds[:, 2:] - bounds[:, :2]) / spacing).astype(np.int64)
    owner, number = counted(cells.prod(axis=1))
    lattice = np.stack(np.divmod(number, cells[owner, 1]), axis=1) + 0.5
    xy = bounds[owner, :2] + (lattice + rng.uniform(-0.2, 0.2, size=lattice.shape)) * spacing
    inside = shapely.contains_xy(grounds[owner], *xy.T)
    ids = [f"p{one}-{each}" for one, each in zip(owner[inside], number[inside], strict=True)]
    return Furniture(xy[inside], np.array(ids, dtype=np.str_))
