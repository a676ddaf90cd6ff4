"""Queries from known places, distorted: on and off the grid, with another north, and routes."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import Signature, cell_ids, wrap_degrees
from semsig_gis.database import visible_objects_at
from semsig_gis.evaluation import distort, named_distortion
from semsig_gis.observation import Leg

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import ObjectIndex
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.objects import StreetObjects

__all__ = ["City", "Query", "Walk", "off_grid", "on_grid", "straight_walk", "turned", "walks"]

_SEED = 0
# Streams of random numbers: each kind of query has its own.
_PLACES, _DISTORTION, _ANYWHERE, _WALKS, _LEGS = range(5)
_APART = 20.0  # metres between the panoramas of a route, as near as cells allow
_DIRECTIONS = 36


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class City:
    """A city with the data to draw queries.

    Parameters
    ----------
    name : str
        Its name.
    database : SignatureDatabase
        The cells.
    objects : StreetObjects
        The street objects that are visible from the cells.
    tree : ObjectIndex
        R-tree of these objects.
    """

    name: str
    database: SignatureDatabase
    objects: StreetObjects
    tree: ObjectIndex


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Query:
    """A query and its true place.

    Parameters
    ----------
    unsorted : Signature
        The distorted signature, its objects in the order of the map.
    signature : Signature
        The same in the order of its bearings.
    cell : int
        Row number of the true cell.
    xy : tuple of float
        The true place, in metres.
    length : int
        Number of objects visible from there.
    """

    unsorted: Signature
    signature: Signature
    cell: int
    xy: tuple[float, float]
    length: int


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Walk:
    """Queries along a route, and the legs between them by their standard deviation in metres."""

    queries: tuple[Query, ...]
    legs: Mapping[float, tuple[Leg, ...]]


def on_grid(city: City, level: str, count: int) -> list[Query]:
    """Return queries from the viewpoints of random cells; the first ones depend on no count."""
    cells = _cells(city.database)[:count]
    return [
        _query(city, level, city.database.signature(cell), cell, xy, _random(_DISTORTION, number))
        for number, (cell, xy) in enumerate(zip(cells, _centres(city, cells), strict=True))
    ]


def off_grid(city: City, level: str, count: int) -> list[Query]:
    """Return queries from random places in the same cells, of the objects visible from there."""
    database = city.database
    cells = _cells(database)[:count]
    offsets = _random(_ANYWHERE).uniform(-0.5, 0.5, (len(cells), 2)) * database.grid.step
    places = database.xy[cells] + offsets
    views = visible_objects_at(city.objects, places, index=city.tree, radius=database.spec.radius)
    queries = []
    for number, (low, high) in enumerate(pairwise(views.offsets.tolist())):
        signature = Signature(views.codes[low:high], views.bearings[low:high])
        rng = _random(_DISTORTION, number)
        x, y = places[number].tolist()
        queries.append(_query(city, level, signature, cells[number], (x, y), rng))
    return queries


def turned(queries: Sequence[Query], turns: Sequence[float]) -> list[Query]:
    """Return queries with their north turned clockwise by an angle in degrees each."""
    signatures = [
        _turned(query.signature, turn) for query, turn in zip(queries, turns, strict=True)
    ]
    return [
        dataclasses.replace(query, unsorted=signature, signature=signature)
        for query, signature in zip(queries, signatures, strict=True)
    ]


def walks(
    city: City, level: str, count: int, panoramas: int, *, leg_sigmas: Sequence[float]
) -> list[Walk]:
    """Return straight routes along the cells of a city."""
    routes: list[Walk] = []
    for start in _random(_WALKS).permutation(len(city.database)).tolist():
        if len(routes) == count:
            break
        rng = _random(_WALKS, start)
        cells = straight_walk(city.database, start, panoramas, rng)
        if not cells:
            continue
        places = _centres(city, cells)
        queries = tuple(
            _query(city, level, city.database.signature(cell), cell, xy, rng)
            for cell, xy in zip(cells, places, strict=True)
        )
        slips = _random(_LEGS, start).normal(0.0, 1.0, (panoramas - 1, 2))
        legs = {sigma: _legs(places, slips * sigma, sigma) for sigma in leg_sigmas}
        routes.append(Walk(queries=queries, legs=legs))
    return routes


def _legs(
    places: Sequence[tuple[float, float]], slips: NDArray[np.float64], sigma: float
) -> tuple[Leg, ...]:
    """Return the legs between places, with errors `slips`."""
    steps = np.diff(np.asarray(places), axis=0) + slips
    return tuple(Leg(dx=dx, dy=dy, sigma=sigma) for dx, dy in steps.tolist())


def straight_walk(
    database: SignatureDatabase, start: int, panoramas: int, rng: np.random.Generator
) -> list[int]:
    """Return cells along a straight line in a random direction; none if no line has only cells."""
    ids = database.cell_ids
    far = np.arange(panoramas) * (_APART / database.grid.step)
    for direction in rng.permutation(_DIRECTIONS) * (2.0 * math.pi / _DIRECTIONS):
        targets = cell_ids(
            database.columns[start] + np.rint(far * math.sin(direction)).astype(np.int64),
            database.rows[start] + np.rint(far * math.cos(direction)).astype(np.int64),
        )
        rows = np.minimum(np.searchsorted(ids, targets), len(ids) - 1)
        if (ids[rows] == targets).all():
            return [int(row) for row in rows]
    return []


def _query(  # noqa: PLR0917 - a private helper of three callers
    city: City,
    level: str,
    signature: Signature,
    cell: int,
    xy: tuple[float, float],
    rng: np.random.Generator,
) -> Query:
    """Distort a signature, in the same way for every method."""
    distorted = distort(
        signature,
        dataclasses.replace(named_distortion(level), resort=False),
        classes=city.database.present_codes,
        rng=rng,
    )
    in_order = _turned(distorted, 0.0)
    return Query(unsorted=distorted, signature=in_order, cell=cell, xy=xy, length=len(signature))


def _turned(signature: Signature, turn: float) -> Signature:
    """Return a signature with its north turned by an angle, in the order of its bearings."""
    if signature.codes is None or signature.bearings is None:
        raise ValueError("a query without types or bearings cannot be turned.")
    bearings = wrap_degrees(signature.bearings - turn)
    order = np.argsort(bearings, kind="stable")
    return Signature(signature.codes[order], bearings[order])


def _cells(database: SignatureDatabase) -> list[int]:
    cells: list[int] = _random(_PLACES).permutation(len(database)).tolist()
    return cells


def _centres(city: City, cells: list[int]) -> list[tuple[float, float]]:
    return [(x, y) for x, y in city.database.xy[cells].tolist()]


def _random(*stream: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(_SEED, spawn_key=stream))
