"""A procedural city, for demonstrations and tests that need no data.

Streets are the edges of a jittered, turned grid. Some of its lines are avenues: wide, lit on both
sides, lined with trees, signalled where they cross. Everything else stands along streets at a rate
per kilometre that is ten times higher on avenues.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pandas as pd
import shapely

from semsig_gis.errors import InputError
from semsig_gis.layer_spec import LayerSpec
from semsig_gis.schema import CLASS_NAME, SOURCE_ID
from semsig_gis.sources import RawLayer

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]
    Bools = NDArray[np.bool_]

__all__ = ["CitySpec", "synthetic_city"]

CRS = "EPSG:32631"
CENTRE = (500_000.0, 5_400_000.0)  # on the zone's central meridian, where north is north

SIZE_LIMITS = (100.0, 20_000.0)
BLOCK_LIMITS = (60.0, 1_000.0)
JITTER = 0.22  # of a block
AVENUE_JITTER = 0.3  # of the jitter: an avenue is straighter
CLOSED_SHARE = 0.12  # of the residential edges of the grid, which are not built

STREET_WIDTH = (9.0, 15.0)
AVENUE_WIDTH = (20.0, 38.0)
LIGHT_SPACING = (14.0, 30.0)
TREE_SPACING = (6.0, 10.0)
ALTERNATING_SHARE = 0.25  # of the residential streets, whose lights change sides
TREE_LINED_SHARE = 0.75  # of the avenues
TREE_GAP_SHARE = 0.12  # of the trees of a row, which are missing
SIGNALLED_SHARE = 0.1  # of the crossings of an avenue and a street; two avenues always are

# Objects a kilometre of avenue, and how far they stand from the kerb in metres.
RATES = {
    "bench": (9.0, 2.0),
    "indicator": (2.4, 1.0),
    "bus_stop": (2.2, 1.0),
    "bike_station": (1.0, 1.5),
    "automatic_wc": (0.5, 2.5),
    "water_fountain": (0.5, 2.5),
    "car_station": (0.4, 0.5),
    "taxi_station": (0.25, 0.5),
}
AVENUE_TO_STREET_RATE = 10.0
TREE_SETBACK = 1.5
LIGHT_SETBACK = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class CitySpec:
    """Size and character of a procedural city.

    Parameters
    ----------
    size : float, default 2000
        Side of the square city in metres, 100 to 20,000.
    block : float, default 110
        Mean distance between junctions in metres, 60 to 1,000.
    avenue_share : float, default 0.25
        Share of the lines of the street grid that are avenues, 0 to 1.
    seed : int, default 0
        Seed of the random numbers; the same specification gives the same city.

    Raises
    ------
    InputError
        If a value is out of its range.

    Examples
    --------
    >>> CitySpec(size=500.0).block
    110.0
    """

    size: float = 2000.0
    block: float = 110.0
    avenue_share: float = 0.25
    seed: int = 0

    def __post_init__(self) -> None:  # noqa: D105
        limits = {"size": SIZE_LIMITS, "block": BLOCK_LIMITS, "avenue_share": (0.0, 1.0)}
        for name, (least, most) in limits.items():
            value = getattr(self, name)
            if not least <= value <= most:  # which NaN is not either
                msg = f"{name} of the city is {value}; give a number from {least:g} to {most:g}."
                raise InputError(msg)
        if self.seed < 0:
            msg = f"seed of the city is {self.seed}; give a whole number, 0 or more."
            raise InputError(msg)


@dataclass(frozen=True, eq=False, slots=True)
class _Streets:
    """Edges of the street network, one entry an edge between two junctions."""

    start: Floats  # (n, 2) position of the first junction
    along: Floats  # (n, 2) unit vector from the first junction to the second
    length: Floats  # (n,) metres
    line: Ints  # (n,) line of the grid: the street or avenue that the edge belongs to
    avenue: Bools  # (n,)
    width: Floats  # (n,) metres between the kerbs
    clear: Floats  # (n, 2) metres to leave free at either end, for what crosses there
    signals: Bools  # (n, 2) whether the junction at either end has traffic lights

    def __len__(self) -> int:
        return len(self.length)

    def place(self, edge: Ints, t: Floats, side: Floats, setback: float) -> Floats:
        """Return positions at `t` metres along edges, outside the kerb on a side (-1 or 1)."""
        along = self.along[edge]
        right = np.stack([along[:, 1], -along[:, 0]], axis=1)
        offset = side * (self.width[edge] / 2 + setback)
        return self.start[edge] + t[:, None] * along + offset[:, None] * right


@dataclass(frozen=True, eq=False, slots=True)
class _Objects:
    """Positions of the objects of one class, and the identifiers: edge, side and number."""

    xy: Floats
    edge: Ints
    side: Floats
    number: Ints


def synthetic_city(spec: CitySpec | None = None) -> tuple[RawLayer, ...]:
    """Make up a city with the paper's eleven classes.

    Parameters
    ----------
    spec : CitySpec, optional
        Size and character; by default a city of 2 km by 2 km.

    Returns
    -------
    tuple of RawLayer
        One layer a class, in EPSG:32631 around (500000, 5400000). A class that is rarer than the
        city is large has an empty layer. ``source_id`` is edge, side and number along it, such as
        ``"57R4"``.

    Notes
    -----
    Lights stand 14-30 m apart and trees 6-10 m, the same along one street; trees have gaps. The
    rates of the other classes give about the shares that the paper reports for Paris.

    Examples
    --------
    >>> layers = synthetic_city(CitySpec(size=500.0, seed=1))
    >>> [layer.spec.class_name for layer in layers[:3]]
    ['alignment_tree', 'water_fountain', 'street_light']
    >>> layers[2].read > 100
    True
    """
    spec = spec or CitySpec()
    streets = _streets(spec, _random(spec, "streets"))
    makers: dict[str, Callable[[_Streets, np.random.Generator], _Objects]] = {
        "alignment_tree": _trees,
        "street_light": _lights,
        "traffic_light": _signals,
    }
    classes = (
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
    layers = []
    for name in classes:
        rng = _random(spec, name)
        objects = makers[name](streets, rng) if name in makers else _scattered(streets, rng, name)
        layers.append(_layer(spec, name, objects))
    return tuple(layers)


def _random(spec: CitySpec, purpose: str) -> np.random.Generator:
    # A stream for every class, so that a change to one leaves the others where they were.
    return np.random.default_rng([spec.seed, *purpose.encode()])


def _streets(spec: CitySpec, rng: np.random.Generator) -> _Streets:
    # Enough lines that the grid covers the square at any angle.
    reach = math.ceil(spec.size * math.sqrt(0.5) / spec.block) + 1
    lines = 2 * reach + 1
    axis = np.arange(lines)
    # Bresenham's rule spreads the avenues evenly: one whenever the sum passes a whole number. The
    # phases make avenues of the two lines through the centre, so that a small city has some.
    phases = (rng.uniform(size=2) - 1.0 - reach) * spec.avenue_share
    avenue = np.stack(
        [np.floor((axis + 1) * spec.avenue_share + p) > np.floor(axis * spec.avenue_share + p)
         for p in phases]
    )  # fmt: skip
    columns, rows = np.meshgrid(axis, axis, indexing="ij")
    jitter = rng.uniform(-JITTER, JITTER, size=(2, lines, lines))
    jitter[0] *= np.where(avenue[0, columns], AVENUE_JITTER, 1.0)
    jitter[1] *= np.where(avenue[1, rows], AVENUE_JITTER, 1.0)
    grid = (np.stack([columns, rows]) - reach + jitter) * spec.block
    angle = rng.uniform(0.0, math.pi / 2)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    junctions = (turn @ grid.reshape(2, -1)).T + CENTRE

    number = np.arange(lines * lines).reshape(lines, lines)
    first = np.concatenate([number[:, :-1].ravel(), number[:-1, :].ravel()])
    second = np.concatenate([number[:, 1:].ravel(), number[1:, :].ravel()])
    # Lines with a constant column come first, then those with a constant row.
    line = np.concatenate([columns[:, :-1].ravel(), lines + rows[:-1, :].ravel()])
    is_avenue = avenue.ravel()
    width = np.where(
        is_avenue, rng.uniform(*AVENUE_WIDTH, 2 * lines), rng.uniform(*STREET_WIDTH, 2 * lines)
    )
    built = is_avenue[line] | (rng.uniform(size=len(line)) >= CLOSED_SHARE)
    first, second, line = first[built], second[built], line[built]

    ends = np.stack([first, second], axis=1)
    row_at, column_at = rows.ravel()[ends], columns.ravel()[ends]
    crossing = np.where(line[:, None] < lines, lines + row_at, column_at)
    avenues_at = avenue[0, columns.ravel()].astype(int) + avenue[1, rows.ravel()]
    signalled = (avenues_at > 1) | (
        (avenues_at == 1) & (rng.uniform(size=lines * lines) < SIGNALLED_SHARE)
    )
    step = junctions[second] - junctions[first]
    length = np.hypot(*step.T)
    return _Streets(
        start=junctions[first],
        along=step / length[:, None],
        length=length,
        line=line,
        avenue=is_avenue[line],
        width=width[line],
        clear=width[crossing] / 2 + 1.0,
        signals=signalled[ends],
    )


def _row(
    streets: _Streets, edges: Ints, spacing: Floats, rng: np.random.Generator
) -> tuple[Ints, Ints, Floats]:
    """Return edge, number and metres along of objects evenly spaced on each edge.

    The spacing is of the whole line; the first object stands at random within one spacing.
    """
    gap = spacing[streets.line[edges]]
    begin = streets.clear[edges, 0] + rng.uniform(size=len(edges)) * gap
    room = streets.length[edges] - streets.clear[edges, 1] - begin
    counts = np.maximum(np.floor(room / gap).astype(np.int64) + 1, 0)
    owner = np.repeat(np.arange(len(edges)), counts)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    return edges[owner], number, begin[owner] + number * gap[owner]


def _per_line(streets: _Streets, limits: tuple[float, float], rng: np.random.Generator) -> Floats:
    return rng.uniform(*limits, size=int(streets.line.max()) + 1)


def _trees(streets: _Streets, rng: np.random.Generator) -> _Objects:
    spacing = _per_line(streets, TREE_SPACING, rng)
    lined = _per_line(streets, (0.0, 1.0), rng) < TREE_LINED_SHARE
    edges = np.flatnonzero(streets.avenue & lined[streets.line])
    # Both sides are planted alike, as a gardener would.
    edge, number, t = _row(streets, edges, spacing, rng)
    edge, number, t = np.tile(edge, 2), np.tile(number, 2), np.tile(t, 2)
    side = np.repeat([-1.0, 1.0], len(edge) // 2)
    kept = rng.uniform(size=len(edge)) >= TREE_GAP_SHARE
    xy = streets.place(edge, t, side, TREE_SETBACK)
    return _Objects(xy[kept], edge[kept], side[kept], number[kept])


def _lights(streets: _Streets, rng: np.random.Generator) -> _Objects:
    spacing = _per_line(streets, LIGHT_SPACING, rng)
    alternating = _per_line(streets, (0.0, 1.0), rng) < ALTERNATING_SHARE
    lit_side = np.sign(_per_line(streets, (-1.0, 1.0), rng))
    edges = np.flatnonzero(~streets.avenue)
    edge, number, t = _row(streets, edges, spacing, rng)
    line = streets.line[edge]
    side = lit_side[line] * np.where(alternating[line] & (number % 2 == 1), -1.0, 1.0)
    parts = [(edge, number, t, side)]
    avenues = np.flatnonzero(streets.avenue)
    for each in (-1.0, 1.0):
        edge, number, t = _row(streets, avenues, spacing, rng)
        parts.append((edge, number, t, np.full(len(edge), each)))
    edge, number, t, side = (np.concatenate(column) for column in zip(*parts, strict=True))
    return _Objects(streets.place(edge, t, side, LIGHT_SETBACK), edge, side, number)


def _signals(streets: _Streets, rng: np.random.Generator) -> _Objects:
    """Put a light on the right of every approach to a signalled junction, on avenues two."""
    del rng  # which junctions have signals belongs to the streets
    first, second = (np.flatnonzero(streets.signals[:, end]) for end in (0, 1))
    # Driving towards the second junction, the right side is +1; towards the first, -1.
    edge = np.concatenate([first, second])
    t = np.concatenate([streets.clear[first, 0], streets.length[second] - streets.clear[second, 1]])
    side = np.repeat([-1.0, 1.0], [len(first), len(second)])
    number = np.repeat([0, 1], [len(first), len(second)])
    twice = streets.avenue[edge]
    edge = np.concatenate([edge, edge[twice]])
    t = np.concatenate([t, t[twice]])
    side = np.concatenate([side, -side[twice]])
    number = np.concatenate([number, number[twice]])
    return _Objects(streets.place(edge, t, side, LIGHT_SETBACK), edge, side, number)


def _scattered(streets: _Streets, rng: np.random.Generator, name: str) -> _Objects:
    """Scatter objects at random along the streets, at the rate of their class."""
    rate, setback = RATES[name]
    per_metre = np.where(streets.avenue, rate, rate / AVENUE_TO_STREET_RATE) / 1000.0
    free = np.maximum(streets.length - streets.clear.sum(axis=1), 0.0)
    counts = rng.poisson(per_metre * streets.length)
    edge = np.repeat(np.arange(len(streets)), counts)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts)
    t = streets.clear[edge, 0] + rng.uniform(size=len(edge)) * free[edge]
    side = rng.choice([-1.0, 1.0], size=len(edge))
    return _Objects(streets.place(edge, t, side, setback), edge, side, number)


def _layer(spec: CitySpec, class_name: str, objects: _Objects) -> RawLayer:
    inside = (np.abs(objects.xy - CENTRE) <= spec.size / 2).all(axis=1)
    sides = np.where(objects.side > 0, "R", "L")
    ids = [
        f"{edge}{side}{number}"
        for edge, side, number in zip(
            objects.edge[inside], sides[inside], objects.number[inside], strict=True
        )
    ]
    table = gpd.GeoDataFrame(
        {
            CLASS_NAME: pd.Series([class_name] * len(ids), dtype="str"),
            SOURCE_ID: pd.Series(ids, dtype="str"),
        },
        geometry=shapely.points(np.round(objects.xy[inside], 2)),
        crs=CRS,
    )
    return RawLayer(
        spec=LayerSpec(
            name=f"synthetic_{class_name}",
            class_name=class_name,
            crs=CRS,
            license="CC0-1.0",
            attribution=f"synthetic city of semsig_gis, seed {spec.seed}: no real place",
        ),
        table=table,
        read=len(table),
    )
