"""Streets of the synthetic city, and the objects along them: trees, lights, signals and others.

Streets are the edges between the faces of a Voronoi diagram. Neighbouring faces form quarters. The
edges between two quarters are one avenue, and each other edge is a street. Random numbers are
stratified, so that cities of the same size have nearly the same number of objects of each class.
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
JITTER = 0.9  # displacement of the middles from a regular lattice, as a share of its step
MARGIN = 2  # quarters outside the square, so that there is no effect of the edge
REACH_M = 60.0  # streets that are farther from the square are left out

# Metres from the centre line to the houses; PAVEMENT is the outer share of it.
STREET_HALF_WIDTH_M = (5.5, 9.0)
AVENUE_HALF_WIDTH_M = (11.0, 21.0)
PAVEMENT = 0.3


@dataclass(frozen=True, eq=False, slots=True)
class Network:
    """Edges of the street network between junctions, one entry per edge, and the faces.

    `start` is the first junction, in metres from the middle of the city, and `along` the unit
    vector to the second, both of shape (n, 2); `length` is in metres. `junction`, shape (n, 2), has
    the numbers of both ends. `street` is the street or avenue of the edge; avenues come first.
    `half_width` is metres from the centre line to the houses, and `clear`, shape (n, 2), metres
    without objects at each end, for the crossing street. `faces` are the polygons between the
    centre lines.
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

    def sample(self, limits: tuple[float, float], rng: np.random.Generator) -> Floats:
        """Draw a number per street, stratified for avenues and for streets; one entry per edge."""
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

    # Keep the edges and the faces near the square.
    ends, sides, corners = _shared_edges(faces)
    far = size / 2 + REACH_M
    square = shapely.box(-far, -far, far, far)
    near = shapely.intersects(shapely.linestrings(corners[ends]), square)
    ends, sides = ends[near], sides[near]
    faces = faces[shapely.intersects(faces, square)]

    # An edge between two quarters belongs to the avenue of this pair of quarters.
    quarter_pair = np.sort(quarter[sides], axis=1)
    avenue = quarter_pair[:, 0] != quarter_pair[:, 1]
    pair_key = quarter_pair[avenue] @ [len(quarters), 1]
    avenues, avenue_number = np.unique(pair_key, return_inverse=True)
    side_streets = len(ends) - len(avenue_number)
    street = np.empty(len(ends), np.int64)
    street[avenue] = avenue_number
    street[~avenue] = len(avenues) + np.arange(side_streets)
    half_width = np.concatenate(
        [
            _evenly(len(avenues), AVENUE_HALF_WIDTH_M, rng),
            _evenly(side_streets, STREET_HALF_WIDTH_M, rng),
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
    """Draw one number from each of `count` equal parts of a range, in random order."""
    low, high = limits
    share = (rng.permutation(count) + rng.uniform(size=count)) / max(count, 1)
    numbers: Floats = low + (high - low) * share
    return numbers


def _scattered_lattice(reach: float, step: float, turn: float, rng: np.random.Generator) -> Floats:
    """Return random places at a distance of about `step`, in a square with sides `2 * reach`."""
    most = math.ceil(reach * math.sqrt(2.0) / step)
    axis = np.arange(-most, most + 1)
    lattice = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2) * step
    shift = JITTER * step * (rng.uniform(size=lattice.shape) - 0.5)
    cos, sin = math.cos(turn), math.sin(turn)
    places: Floats = (lattice + shift) @ np.array([[cos, sin], [-sin, cos]])
    return places[(np.abs(places) <= reach).all(axis=1)]


def _shared_edges(faces: NDArray[np.object_]) -> tuple[Ints, Ints, Floats]:
    """Find the edges that two polygons share.

    Returns the two corners and the two faces of each edge, as indices, and the coordinates of all
    corners.
    """
    # GEOS gives all faces at a corner exactly the same coordinates.
    ring, face = shapely.get_coordinates(faces, return_index=True)
    corners, number = np.unique(ring.view(np.complex128).ravel(), return_inverse=True)
    # Edges between consecutive corners of a face, with the lower corner first.
    inner = face[1:] == face[:-1]
    ends = np.sort(np.stack([number[:-1], number[1:]], axis=1)[inner], axis=1)
    # Two equal keys are the same edge of two faces.
    key = ends @ [len(corners), 1]
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order]) == 0)
    edge, twin = order[first], order[first + 1]
    owner = face[:-1][inner]
    xy: Floats = np.stack([corners.real, corners.imag], axis=1)
    return ends[edge], np.stack([owner[edge], owner[twin]], axis=1), xy


def _crossing(ends: Ints, avenue: Bools, kerb: Floats) -> Floats:
    """Return the width in metres of the crossing street at each end of each edge."""
    # Widest street at each junction: of all streets, and of streets that are not avenues.
    widest = np.zeros((2, int(ends.max(initial=0)) + 1))
    for end in (0, 1):
        np.maximum.at(widest[0], ends[:, end], kerb)
        np.maximum.at(widest[1], ends[~avenue, end], kerb[~avenue])
    any_street, side_street = widest[:, ends]
    # An avenue is interrupted only by the streets that join it, not by itself.
    clear: Floats = np.where(avenue[:, None] & (side_street > 0), side_street, any_street)
    return clear + 1.0


# --- Objects ------------------------------------------------------------------------------------

# The numbers below are calibrated together, so that each class is as frequent in the signatures of
# PARIS_LIKE as in the paper. After a change, the test of PARIS_LIKE shows counts out of range.
# Metres between neighbours in a row; each street has its own spacing.
STREET_LIGHT_SPACING_M = (15.0, 32.0)
AVENUE_LIGHT_SPACING_M = (6.0, 11.0)
TREE_SPACING_M = (4.5, 7.0)
LIGHT_JITTER_M = 0.3  # either way
TREE_JITTER_M = 0.5

ALTERNATING_SHARE = 0.25  # share of the streets with lights on alternating sides
TREE_LINED_AVENUES = 0.57  # share of the avenues
TREE_LINED_STREETS = 0.02  # and of the streets
DOUBLE_ROW_HALF_WIDTH_M = 17.0  # tree-lined avenues from this width have two rows per side
TREE_GAPS = (0.0, 0.3)  # share of missing trees in a row; each street has its own
ONE_SIDED_SHARE = 0.2  # share of the tree-lined streets with trees on one side only
PARK_TREE_SPACING_M = 12.0
SQUARE_LIGHT_SPACING_M = 18.0
SIGNALLED_CORNERS = 0.115  # share of the corners of an avenue and a street
THROUGH = 2  # avenue edges at a corner that an avenue passes; with more edges there are signals

# Objects per kilometre of avenue.
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

# Metres from the kerb to the objects of a class, and of other classes.
SETBACKS_M = {"alignment_tree": 1.0, "street_light": 0.5, "traffic_light": 0.3}
SETBACK_M = 0.8
SECOND_ROW_M = 3.0


@dataclass(frozen=True, eq=False, slots=True)
class Furniture:
    """Objects of a class: metres from the middle of the city, shape (k, 2), and identifiers."""

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
    """Place the objects of a class; the polygons `parks` have trees, `squares` have lights."""
    if class_name == "alignment_tree":
        return _joined(*_trees(network, rng), _on_ground(parks, PARK_TREE_SPACING_M, rng))
    if class_name == "street_light":
        return _joined(*_lights(network, rng), _on_ground(squares, SQUARE_LIGHT_SPACING_M, rng))
    if class_name == "traffic_light":
        return _joined(*_signals(network, rng))
    # Other classes are scattered over all streets; the rate is per kilometre of avenue.
    free = np.maximum(network.length - network.clear.sum(axis=1), 0.0)
    rate = RATES[class_name] / 1000.0
    per_metre = rate / np.where(network.avenue, 1.0, AVENUE_TO_STREET_RATE)
    # Expected number of objects up to each edge.
    expected = np.concatenate([[0.0], np.cumsum(free * per_metre)])
    count = int(expected[-1] + rng.uniform())
    # One object in each of `count` equal parts of the sum.
    position = (np.arange(count) + rng.uniform(size=count)) * (expected[-1] / max(count, 1))
    edge = np.searchsorted(expected, position, side="right") - 1
    t = network.clear[edge, 0] + (position - expected[edge]) / per_metre[edge]
    number = expand_counts(np.bincount(edge, minlength=len(network)))[1]
    side = rng.choice([-1.0, 1.0], size=count)
    return _Row(edge, number, t).objects(network, side, SETBACK_M)


def _joined(*parts: Furniture) -> Furniture:
    xy = np.concatenate([part.xy for part in parts])
    return Furniture(xy, np.concatenate([part.ids for part in parts]))


@dataclass(frozen=True, eq=False, slots=True)
class _Row:
    """Places along edges, one entry per object."""

    edge: Ints
    number: Ints
    t: Floats  # metres from the first junction

    def objects(
        self, network: Network, side: Floats, setback: float, *, second: bool = False
    ) -> Furniture:
        """Place objects `setback` metres outside the kerb; `side` is 1 for right, -1 for left."""
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
    """Return regularly spaced objects on edges; `spacing` in metres per edge, shape (n,)."""
    gap = spacing[edges]
    begin = network.clear[edges, 0] + rng.uniform(size=len(edges)) * gap
    room = network.length[edges] - network.clear[edges, 1] - begin
    counts = np.maximum(np.floor(room / gap).astype(np.int64) + 1, 0)
    owner, number = expand_counts(counts)
    shift = rng.uniform(-jitter, jitter, size=len(owner))
    return _Row(edges[owner], number, begin[owner] + number * gap[owner] + shift)


def expand_counts(counts: Ints) -> tuple[Ints, Ints]:
    """Return the owner of each object and its number at its owner, from counts per owner."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)


def _trees(network: Network, rng: np.random.Generator) -> list[Furniture]:
    spacing = network.sample(TREE_SPACING_M, rng)
    gaps = network.sample(TREE_GAPS, rng)
    share = np.where(network.avenue, TREE_LINED_AVENUES, TREE_LINED_STREETS)
    lined = network.sample((0.0, 1.0), rng) < share
    one_sided = network.sample((0.0, 1.0), rng) < ONE_SIDED_SHARE
    double = lined & network.avenue & (network.half_width >= DOUBLE_ROW_HALF_WIDTH_M)
    parts = []
    for edges, side, second in (
        (lined, 1.0, False),
        (lined & ~one_sided, -1.0, False),
        (double, 1.0, True),
        (double & ~one_sided, -1.0, True),
    ):
        row = _row(network, np.flatnonzero(edges), spacing, TREE_JITTER_M, rng)
        present = rng.uniform(size=len(row.t)) >= gaps[row.edge]
        row = _Row(row.edge[present], row.number[present], row.t[present])
        setback = SETBACKS_M["alignment_tree"] + second * SECOND_ROW_M
        parts.append(row.objects(network, np.full(len(row.t), side), setback, second=second))
    return parts


def _lights(network: Network, rng: np.random.Generator) -> list[Furniture]:
    street_spacing = network.sample(STREET_LIGHT_SPACING_M, rng)
    avenue_spacing = network.sample(AVENUE_LIGHT_SPACING_M, rng)
    alternating = network.sample((0.0, 1.0), rng) < ALTERNATING_SHARE
    lit_side = np.sign(network.sample((-1.0, 1.0), rng))
    setback = SETBACKS_M["street_light"]

    edges = np.flatnonzero(~network.avenue)
    row = _row(network, edges, street_spacing, LIGHT_JITTER_M, rng)
    opposite = alternating[row.edge] & (row.number % 2 == 1)
    parts = [row.objects(network, lit_side[row.edge] * np.where(opposite, -1.0, 1.0), setback)]
    edges = np.flatnonzero(network.avenue)
    for side in (-1.0, 1.0):
        row = _row(network, edges, avenue_spacing, LIGHT_JITTER_M, rng)
        parts.append(row.objects(network, np.full(len(row.t), side), setback))
    return parts


def _signals(network: Network, rng: np.random.Generator) -> list[Furniture]:
    """Put a traffic light on the right of each approach to a junction with signals."""
    junctions = int(network.junction.max()) + 1
    avenues = np.bincount(network.junction[network.avenue].ravel(), minlength=junctions)
    signalled = avenues > THROUGH
    # Spread the signals evenly: a corner has one if the running sum passes a whole number.
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
        parts.append(row.objects(network, np.full(len(edge), side), SETBACKS_M["traffic_light"]))
    return parts


def _on_ground(grounds: NDArray[np.object_], spacing: float, rng: np.random.Generator) -> Furniture:
    """Place objects at a distance of about `spacing` metres all over open ground."""
    bounds = shapely.bounds(grounds).reshape(-1, 4)
    cells = np.ceil((bounds[:, 2:] - bounds[:, :2]) / spacing).astype(np.int64)
    owner, number = expand_counts(cells.prod(axis=1))
    lattice = np.stack(np.divmod(number, cells[owner, 1]), axis=1) + 0.5
    xy = bounds[owner, :2] + (lattice + rng.uniform(-0.2, 0.2, size=lattice.shape)) * spacing
    inside = shapely.contains_xy(grounds[owner], *xy.T)
    ids = [f"p{ground}-{item}" for ground, item in zip(owner[inside], number[inside], strict=True)]
    return Furniture(xy[inside], np.array(ids, dtype=np.str_))
