"""What stands along the streets of the synthetic city: trees, lights, signals and the rest.

Every class has a rule of its own. What is scattered is drawn evenly, so that a city of a size has
nearly the same number of each class whatever its seed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.sources.synthetic.streets import Network

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]
    Bools = NDArray[np.bool_]

CLASSES = (
    "alignment_tree",
    "water_fountain",
    "street_light",
    "indicator",
    "traffic_light",
    "bike_station",
    "automatic_wc",
    "car_station",
    "taxi_station",
    "bench",
    "bus_stop",
)
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
    """The objects of one class: metres from the middle of the city, shape (k, 2), and identifiers.

    An identifier is edge, side and number along it such as ``"57R4"``, or ground and number such as
    ``"p3-41"``.
    """

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
    """Place the objects of one of the paper's eleven classes.

    Parks and squares are polygons of open ground, which have trees and lights of their own.
    """
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
    """Return objects evenly spaced on edges, the first at random within one spacing.

    The spacing is of every edge, shape (n,).
    """
    gap = spacing[edges]
    begin = network.clear[edges, 0] + rng.uniform(size=len(edges)) * gap
    room = network.length[edges] - network.clear[edges, 1] - begin
    counts = np.maximum(np.floor(room / gap).astype(np.int64) + 1, 0)
    owner, number = _counted(counts)
    shift = rng.uniform(-jitter, jitter, size=len(owner))
    return _Row(edges[owner], number, begin[owner] + number * gap[owner] + shift)


def _counted(counts: Ints) -> tuple[Ints, Ints]:
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
    number = _counted(np.bincount(edge, minlength=len(network)))[1]
    side = rng.choice([-1.0, 1.0], size=count)
    return _Row(edge, number, t).beside(network, side, SETBACK_M)


def _on_ground(grounds: NDArray[np.object_], spacing: float, rng: np.random.Generator) -> Furniture:
    """Place objects about `spacing` apart all over open ground."""
    bounds = shapely.bounds(grounds).reshape(-1, 4)
    cells = np.ceil((bounds[:, 2:] - bounds[:, :2]) / spacing).astype(np.int64)
    owner, number = _counted(cells.prod(axis=1))
    lattice = np.stack(np.divmod(number, cells[owner, 1]), axis=1) + 0.5
    xy = bounds[owner, :2] + (lattice + rng.uniform(-0.2, 0.2, size=lattice.shape)) * spacing
    inside = shapely.contains_xy(grounds[owner], *xy.T)
    ids = [f"p{one}-{each}" for one, each in zip(owner[inside], number[inside], strict=True)]
    return Furniture(xy[inside], np.array(ids, dtype=np.str_))
