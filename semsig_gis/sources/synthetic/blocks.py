"""What lies between the streets of the synthetic city: houses around courtyards, parks, squares."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import shapely

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.sources.synthetic.streets import Network

    Ints = NDArray[np.int64]
    Objects = NDArray[np.object_]

PARK_SHARE = 0.015  # of the faces
SQUARE_SHARE = 0.015  # of the faces, among the smaller ones
HOUSE_DEPTH_M = 12.0
FRONTAGE_M = 20.0
LEAST_BLOCK_M2 = 80.0  # smaller remains of faces are not built on
LEAST_HOUSE_M2 = 10.0
ARC_CHORDS = 8  # to a quarter of a circle, where streets end round
LEAST_HOUSES = 5  # around a block, so that each takes less than half a turn


def open_ground(network: Network, rng: np.random.Generator) -> tuple[Ints, Ints]:
    """Choose the faces, by number, that are not built on: parks, then squares."""
    by_area = np.argsort(shapely.area(network.faces))
    small, large = np.array_split(by_area, 2)
    parks, squares = (
        rng.choice(some, int(len(network.faces) * share + rng.uniform()), replace=False)
        for some, share in ((large, PARK_SHARE), (small, SQUARE_SHARE))
    )
    return parks, squares


def cut_back(faces: Objects, network: Network) -> Objects:
    """Return what of each face is farther from every centre line than its street's half-width.

    It may be several parts, or empty.
    """
    # An arc of chords lies inside the circle: a little wider, it holds the whole of it.
    radius = network.half_width / math.cos(math.pi / (4 * ARC_CHORDS))
    streets = shapely.buffer(network.lines, radius, quad_segs=ARC_CHORDS)
    face, street = shapely.STRtree(streets).query(faces, predicate="intersects")
    order = np.argsort(face, kind="stable")
    face, street = face[order], street[order]
    turn = np.arange(len(face)) - np.searchsorted(face, face)
    left = faces.copy()
    for number in range(int(turn.max(initial=-1)) + 1):
        now = turn == number
        left[face[now]] = shapely.difference(left[face[now]], streets[street[now]])
    return left


def build_houses(network: Network, built: Objects, rng: np.random.Generator) -> Objects:
    """Build a ring of houses around every block, with a courtyard where there is room for one."""
    blocks = shapely.get_parts(cut_back(built, network))
    blocks = blocks[shapely.area(blocks) >= LEAST_BLOCK_M2]
    rings = shapely.difference(blocks, shapely.buffer(blocks, -HOUSE_DEPTH_M, join_style="mitre"))
    outlines = shapely.get_exterior_ring(blocks)
    counts = np.maximum((shapely.length(outlines) / FRONTAGE_M).astype(np.int64), LEAST_HOUSES)
    block = np.repeat(np.arange(len(blocks)), counts)
    number = np.arange(len(block)) - np.repeat(np.cumsum(counts) - counts, counts)
    # Party walls run from the middle of the block through a point of its outline.
    share = (number + rng.uniform(-0.25, 0.25, size=len(block))) / counts[block] % 1.0
    wall = shapely.get_coordinates(
        shapely.line_interpolate_point(outlines[block], share, normalized=True)
    )
    following = np.arange(1, len(block) + 1)
    last = np.cumsum(counts) - 1
    following[last] = last + 1 - counts
    middle = shapely.get_coordinates(shapely.centroid(blocks))[block]
    # Far enough out that the chord leaves no corner of the block outside.
    beyond = middle + 8.0 * (wall - middle)
    wedges = shapely.polygons(np.stack([middle, beyond, beyond[following]], axis=1))
    houses: Objects = shapely.get_parts(shapely.intersection(rings[block], wedges))
    return houses[shapely.area(houses) >= LEAST_HOUSE_M2]
