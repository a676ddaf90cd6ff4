"""Time of occlusion in a city, compared with shapely, and the share of objects it hides."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

from benchmarks._cities import made_up
from benchmarks.comparison import Comparison, compare
from semsig_gis.core import GridSpec, cells_near
from semsig_gis.database import GAP_M, TOLERANCE_M, Footprints, hidden
from semsig_gis.sources import CitySpec, synthetic_surroundings

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

__all__ = ["comparisons"]

_SIDES = {"full": 4_000.0, "small": 300.0}  # metres of the procedural city
_RADIUS = 30.0


def comparisons(size: str) -> Iterator[Comparison]:
    """Measure the footprints, the sight lines, and the mean length with and without buildings."""
    city = CitySpec(size=_SIDES[size])
    objects = made_up(city)
    houses, _ = synthetic_surroundings(city)
    polygons = houses.table.geometry.to_numpy()
    footprints = Footprints(polygons)
    viewpoints = GridSpec().viewpoints(*cells_near(objects.xy, grid=GridSpec(), radius=_RADIUS))
    viewpoints = viewpoints[~footprints.cover(viewpoints)]
    starts, ends = _pairs(viewpoints, objects.xy)

    yield compare(
        f"preparing {len(polygons):,} building footprints",
        lambda _: len(Footprints(polygons).interiors),
        lambda _: _at_once(polygons),
        peer_name="shapely: one union, cut back, cut by footprint",
        repeats=1,
    )
    blocked = hidden(starts, ends, footprints=footprints)  # prepares them
    yield compare(
        f"occlusion of {len(starts):,} pairs by {len(polygons):,} footprints",
        lambda _: hidden(starts, ends, footprints=footprints),
        lambda _: _crossing(starts, ends, polygons),
        peer_name="shapely.STRtree of the footprints, lines that cross any",
        repeats=1,
        bar=6.0,
    )
    mean = len(starts) / len(viewpoints)
    yield Comparison(
        name=f"mean length of {len(viewpoints):,} outdoor cells with buildings",
        unit="objects",
        ours=mean * float(1 - blocked.mean()),
        peer=mean,
        peer_name="the same cells without buildings",
        bar=None,
    )


def _pairs(
    viewpoints: NDArray[np.float64], objects: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the ends of all sight lines within range, ordered by viewpoint."""
    tree = shapely.STRtree(np.asarray(shapely.points(objects)))
    points = np.asarray(shapely.points(viewpoints))
    start, end = tree.query(points, predicate="dwithin", distance=_RADIUS)
    return viewpoints[start], objects[end]


def _at_once(polygons: NDArray[np.object_]) -> NDArray[np.object_]:
    """Prepare all footprints together, as the definition says."""
    widened = shapely.buffer(polygons, GAP_M, join_style="mitre")
    blocks = shapely.get_parts(shapely.union_all(widened))
    deep = shapely.buffer(blocks, -GAP_M - TOLERANCE_M)
    part, own = shapely.STRtree(widened).query(deep, predicate="intersects")
    cores: NDArray[np.object_] = shapely.intersection(deep[part], widened[own])
    return cores


def _crossing(
    starts: NDArray[np.float64], ends: NDArray[np.float64], polygons: NDArray[np.object_]
) -> NDArray[np.bool_]:
    """Whether each line touches a footprint, without tolerance and exceptions."""
    lines = np.asarray(shapely.linestrings(np.stack([starts, ends], axis=1)))
    crossed = np.zeros(len(lines), bool)
    crossed[shapely.STRtree(polygons).query(lines, predicate="intersects")[0]] = True
    return crossed
