"""Generate a synthetic city for demonstrations, tests and benchmarks without data.

It is calibrated: the signature database of `PARIS_LIKE` (30 m, cells of 10 m, viewpoints
``"streets"``) has about the figures of the paper for Paris.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyproj
import shapely

from semsig_gis.core import CLASS_NAME, MOST_SEED, SOURCE_ID, InputError, require_number
from semsig_gis.sources.catalog import paper_taxonomy
from semsig_gis.sources.layer import RawLayer, RowCounts
from semsig_gis.sources.layer_spec import LayerSpec
from semsig_gis.sources.synthetic.streets import expand_counts, furnish, lay_streets

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Bounds
    from semsig_gis.sources.layer_spec import GeometryKind, Role
    from semsig_gis.sources.synthetic.streets import Network

    Ints = NDArray[np.int64]
    Objects = NDArray[np.object_]

PARK_SHARE = 0.015  # share of the faces
SQUARE_SHARE = 0.015  # share of the faces; squares are among the smaller ones
HOUSE_DEPTH_M = 12.0
FRONTAGE_M = 20.0
LEAST_BLOCK_M2 = 80.0  # smaller parts of faces have no houses
LEAST_HOUSE_M2 = 10.0
ARC_CHORDS = 8  # chords per quarter of a circle, at the round ends of streets
LEAST_HOUSES = 5  # per block, so that the angle of each house is less than 180 degrees


def open_ground(network: Network, rng: np.random.Generator) -> tuple[Ints, Ints]:
    """Choose the faces without houses; return the numbers of parks and of squares."""
    by_area = np.argsort(shapely.area(network.faces))
    small, large = np.array_split(by_area, 2)
    parks, squares = (
        rng.choice(faces, int(len(network.faces) * share + rng.uniform()), replace=False)
        for faces, share in ((large, PARK_SHARE), (small, SQUARE_SHARE))
    )
    return parks, squares


def cut_back(faces: Objects, network: Network) -> Objects:
    """Return the faces without the streets, which reach a half-width from their centre line."""
    # Chords lie inside their circle: enlarge the radius, so that they enclose it.
    radius = network.half_width / math.cos(math.pi / (4 * ARC_CHORDS))
    streets = shapely.buffer(network.lines, radius, quad_segs=ARC_CHORDS)
    face, street = shapely.STRtree(streets).query(faces, predicate="intersects")
    order = np.argsort(face, kind="stable")
    face, street = face[order], street[order]
    # Subtract one street from every face at a time; `step` is the number of a face's street.
    step = np.arange(len(face)) - np.searchsorted(face, face)
    remainder = faces.copy()
    for number in range(int(step.max(initial=-1)) + 1):
        pair = step == number
        remainder[face[pair]] = shapely.difference(remainder[face[pair]], streets[street[pair]])
    return remainder


def build_houses(network: Network, built: Objects, rng: np.random.Generator) -> Objects:
    """Build a ring of houses around each block, with a courtyard if there is room."""
    blocks = shapely.get_parts(cut_back(built, network))
    blocks = blocks[shapely.area(blocks) >= LEAST_BLOCK_M2]
    rings = shapely.difference(blocks, shapely.buffer(blocks, -HOUSE_DEPTH_M, join_style="mitre"))
    outlines = shapely.get_exterior_ring(blocks)
    counts = np.maximum((shapely.length(outlines) / FRONTAGE_M).astype(np.int64), LEAST_HOUSES)
    block, number = expand_counts(counts)
    # A wall between two houses runs from the middle of the block through a point of its outline.
    share = (number + rng.uniform(-0.25, 0.25, size=len(block))) / counts[block] % 1.0
    wall = shapely.get_coordinates(
        shapely.line_interpolate_point(outlines[block], share, normalized=True)
    )
    # The wall that follows each wall around its block.
    following = np.arange(1, len(block) + 1)
    last = np.cumsum(counts) - 1
    following[last] = last + 1 - counts
    middle = shapely.get_coordinates(shapely.centroid(blocks))[block]
    # Extend the walls, so that the wedge between two walls contains the corners of the block.
    beyond = middle + 8.0 * (wall - middle)
    wedges = shapely.polygons(np.stack([middle, beyond, beyond[following]], axis=1))
    houses: Objects = shapely.get_parts(shapely.intersection(rings[block], wedges))
    return houses[shapely.area(houses) >= LEAST_HOUSE_M2]


CRS = "EPSG:32631"
# On the central meridian of the zone, where grid north is true north.
CENTRE = (500_000.0, 5_400_000.0)
SIZE_LIMITS = (100, 20_000)
MOST_CENTRE_M = 1e8
SURROUNDINGS: dict[str, tuple[Role, GeometryKind]] = {
    "buildings": ("buildings", "polygon"),
    "streets": ("streets", "line"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class CitySpec:
    """Size, place and seed of a synthetic city; InputError if a value is out of its range.

    Parameters
    ----------
    size : float, default 2000
        Side of the square city in metres, 100 to 20,000.
    seed : int, default 0
        Seed of the random numbers; the same specification gives the same city.
    centre : tuple of (float, float), default (500000, 5400000)
        Middle of the city in metres of EPSG:32631.

    Examples
    --------
    >>> CitySpec(size=300.0).seed
    0
    """

    size: float = 2000.0
    seed: int = 0
    centre: tuple[float, float] = CENTRE

    def __post_init__(self) -> None:  # noqa: D105
        least, most = SIZE_LIMITS
        require_number("size of the city", self.size, least=least, most=most, unit="metres")
        require_number("seed of the city", self.seed, least=0, most=MOST_SEED)
        if not all(abs(coordinate) <= MOST_CENTRE_M for coordinate in self.centre):
            raise InputError(f"centre of the city is {self.centre}; give x and y in metres.")


PARIS_LIKE = CitySpec(size=9690.0)
"""A synthetic city with the numbers of cells and of objects per class of the paper's Paris.

It is a square of 9,690 m.
"""


def synthetic_city(spec: CitySpec | None = None) -> tuple[RawLayer, ...]:
    """Generate the street objects of a city, of the eleven classes of the paper.

    Lights and trees are regularly spaced along a street, trees with gaps, and each street has its
    own spacing. Junctions of avenues have signals, and some junctions of a street and an avenue.
    All other classes are scattered, with a rate that is ten times higher on avenues.

    Parameters
    ----------
    spec : CitySpec, optional
        Size, place and seed; by default a city of 2 km by 2 km.

    Returns
    -------
    tuple of RawLayer
        One layer per class, in EPSG:32631. In a small city, the layer of a rare class may be
        empty. ``source_id`` is edge, side and number along the edge, such as ``"57R4"`` (``RR`` in
        a second row of trees), or number of the park or square and of the object in it, such as
        ``"p3-41"``.

    Examples
    --------
    >>> from semsig_gis import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=500.0, seed=1))
    >>> [layer.spec.class_name for layer in layers[:3]]
    ['alignment_tree', 'water_fountain', 'street_light']
    """
    spec = spec or CitySpec()
    network = lay_streets(spec.size, _random(spec, "streets"))
    parks, squares = (
        cut_back(network.faces[numbers], network)
        for numbers in open_ground(network, _random(spec, "open ground"))
    )
    layers = []
    for name in (item.name for item in paper_taxonomy().classes):
        rng = _random(spec, name)
        objects = furnish(name, network, parks=parks, squares=squares, rng=rng)
        inside = (np.abs(objects.xy) <= spec.size / 2).all(axis=1)
        places = _placed(spec, np.asarray(shapely.points(objects.xy[inside])))
        layers.append(_layer(spec, name, places, objects.ids[inside].tolist()))
    return tuple(layers)


def synthetic_surroundings(spec: CitySpec | None = None) -> tuple[RawLayer, RawLayer]:
    """Generate the buildings and the streets of a city.

    Parameters
    ----------
    spec : CitySpec, optional
        Size, place and seed; by default a city of 2 km by 2 km.

    Returns
    -------
    buildings, streets : RawLayer
        Footprints (polygons) and centre lines of the city that `synthetic_city` returns for the
        same specification, in EPSG:32631. The streets also have the columns ``half_width``
        (metres from the centre line to the houses) and ``name``. Their ``source_id`` is the edge in
        the ids of objects.

    Examples
    --------
    >>> buildings, streets = synthetic_surroundings(CitySpec(size=300.0))
    >>> buildings.spec.role, streets.spec.role
    ('buildings', 'streets')
    """
    spec = spec or CitySpec()
    network = lay_streets(spec.size, _random(spec, "streets"))
    built = np.ones(len(network.faces), bool)
    built[np.concatenate(open_ground(network, _random(spec, "open ground")))] = False
    faces = shapely.clip_by_rect(network.faces[built], *_square(spec))
    houses = build_houses(network, faces[~shapely.is_empty(faces)], _random(spec, "houses"))
    numbers = [str(number) for number in range(len(houses))]
    buildings = _layer(spec, "buildings", _placed(spec, houses), numbers)
    return buildings, _streets(spec, network)


def synthetic_streets(spec: CitySpec) -> RawLayer:
    """Generate only the streets of `synthetic_surroundings`."""
    return _streets(spec, lay_streets(spec.size, _random(spec, "streets")))


def _streets(spec: CitySpec, network: Network) -> RawLayer:
    lines = shapely.clip_by_rect(network.lines, *_square(spec))
    edges = np.flatnonzero(~shapely.is_empty(lines))
    numbers = [str(number) for number in edges]
    streets = _layer(spec, "streets", _placed(spec, lines[edges]), numbers)
    kinds = np.where(network.avenue[edges], "Avenue", "Street").tolist()
    names = zip(kinds, network.street[edges].tolist(), strict=True)
    table = streets.table.assign(
        half_width=network.half_width[edges],
        name=[f"{kind} {street + 1}" for kind, street in names],
    )
    return RawLayer(spec=streets.spec, counts=streets.counts, table=table)


def _square(spec: CitySpec) -> Bounds:
    half = spec.size / 2
    return -half, -half, half, half


def _random(spec: CitySpec, purpose: str) -> np.random.Generator:
    # Each class has its own stream, so that a change of one class does not move the others.
    return np.random.default_rng([spec.seed, *purpose.encode()])


def _placed(spec: CitySpec, shapes: NDArray[np.object_]) -> NDArray[np.object_]:
    """Move shapes to the place of the city, with coordinates rounded to centimetres."""
    exact = shapely.transform(shapes, lambda xy: xy + spec.centre)
    rounded = shapely.transform(exact, lambda xy: np.round(xy, 2))
    # Rounding may make a thin polygon invalid; then keep the exact one.
    return np.where(shapely.is_valid(rounded), rounded, exact)


def _layer(spec: CitySpec, what: str, shapes: NDArray[np.object_], ids: Sequence[str]) -> RawLayer:
    """Return the layer of a class, or of the buildings or streets."""
    role, geometry = SURROUNDINGS.get(what, ("objects", "point"))
    class_name = what if role == "objects" else ""
    return RawLayer(
        spec=LayerSpec(
            name=f"synthetic_{what}",
            class_name=class_name,
            geometry=geometry,
            crs=CRS,
            role=role,
            license="CC0-1.0",
            attribution=f"synthetic city of semsig_gis, seed {spec.seed}: no real place",
        ),
        columns=pa.table(
            {
                CLASS_NAME: pa.repeat(pa.scalar(class_name), len(ids)),
                SOURCE_ID: pa.array(ids, pa.string()),
            }
        ),
        geometry=shapes,
        crs=pyproj.CRS(CRS),
        counts=RowCounts(read=len(ids)),
    )
