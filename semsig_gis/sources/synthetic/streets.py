"""The street network of the synthetic city: the edges between the faces of a Voronoi diagram.

Faces are what streets enclose. Neighbouring faces form quarters; the edges between two quarters
are an avenue, all others are streets of their own.
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
        """Draw a number for each avenue and street, and return that of every edge, shape (n,).

        Avenues fill the range between the limits evenly, and so do streets.
        """
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
    """Return the edges that two faces share: numbers of their corners and faces, and the corners.

    GEOS gives all faces at a corner the same coordinates, to the last bit.
    """
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
    """Return how much of either end of each edge what crosses there takes up.

    An avenue is not interrupted by itself, only by the streets that join it.
    """
    widest = np.zeros((2, int(ends.max(initial=0)) + 1))
    for end in (0, 1):
        np.maximum.at(widest[0], ends[:, end], kerb)
        np.maximum.at(widest[1], ends[~avenue, end], kerb[~avenue])
    any_street, side_street = widest[:, ends]
    clear: Floats = np.where(avenue[:, None] & (side_street > 0), side_street, any_street)
    return clear + 1.0
