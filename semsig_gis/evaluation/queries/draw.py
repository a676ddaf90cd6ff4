"""Simulated queries from known places: cells or any places, of this city or of another date.

Distortions change the sight from a place, and the result is the query. All random numbers depend on
a seed and the number of the query, so that query 17 is the same whatever the number of queries.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from semsig_gis.core import (
    MOST_SEED,
    CrsError,
    InputError,
    UnknownNameError,
    nearest_name,
    require_number,
)
from semsig_gis.database import visible_objects_at
from semsig_gis.evaluation.queries.distortion_text import prepare_chain
from semsig_gis.evaluation.queries.distortions import DISTORTIONS
from semsig_gis.evaluation.queries.true_view import CitySights, Sight

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from semsig_gis.database import ObjectStore, SignatureDatabase
    from semsig_gis.evaluation.queries.distortion_text import QueryDistortion

SeenFrom = Literal["cells", "anywhere"]

TRIES = 20
"""Number of random places in a cell that are tried to find one outside the buildings."""


@dataclass(frozen=True, slots=True, kw_only=True)
class QuerySpec:
    """Number, seeds, places and distortions of simulated queries.

    Parameters
    ----------
    number : int, default 500
        Number of queries of each seed; at least 1.
    seeds : tuple of int, default (0,)
        Distinct random seeds, each from 0 to 10**18.
    seen_from : {"cells", "anywhere"}, default "cells"
        The viewpoints of cells, as in the paper, or random places in cells, outside buildings.
    distortions : tuple, default the paper's medium level
        The distortions, in order (see `queries.distortion_text`).

    Raises
    ------
    InputError
        If a number is out of range.
    UnknownNameError
        If `seen_from` is neither.

    Examples
    --------
    >>> QuerySpec(number=100, seeds=(1, 2)).seen_from
    'cells'
    """

    number: int = 500
    seeds: tuple[int, ...] = (0,)
    seen_from: SeenFrom = "cells"
    distortions: tuple[QueryDistortion, ...] = (DISTORTIONS["medium"],)

    def __post_init__(self) -> None:  # noqa: D105
        if self.number < 1:
            raise InputError(f"{self.number} queries were asked for; give a whole number from 1.")
        if not self.seeds or len(set(self.seeds)) < len(self.seeds):
            raise InputError(
                f"the seeds are {list(self.seeds)}; give at least one, and none twice."
            )
        for seed in self.seeds:
            require_number("a seed", seed, least=0, most=MOST_SEED)
        if self.seen_from not in get_args(SeenFrom):
            hint = nearest_name(self.seen_from, get_args(SeenFrom))
            raise UnknownNameError(
                f"queries are seen from {self.seen_from!r}{hint}; give cells or anywhere."
            )


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class SimulatedQuery:
    """A simulated query with its true place.

    It is seen from `xy`, metres in the CRS of the database, in the cell of row number `cell` (-1 if
    the database has no such cell), where `length` objects are visible. `number` counts from 0 for
    each seed. `asked` is the sight after all distortions, with the error of its north; `pick`, in
    [0, 1), selects one of equally good answers.
    """

    seed: int
    number: int
    xy: tuple[float, float]
    cell: int
    length: int
    asked: Sight
    pick: float


def draw_queries(
    database: SignatureDatabase,
    spec: QuerySpec,
    *,
    store: ObjectStore | None = None,
    city: SignatureDatabase | None = None,
    part: slice = slice(None),
) -> list[SimulatedQuery]:
    """Draw simulated queries from known places.

    Parameters
    ----------
    database : SignatureDatabase
        The database to search.
    spec : QuerySpec
        Number, seeds, places and distortions of the queries.
    store : ObjectStore, optional
        The street objects, and buildings if any, of the observed city; required if `seen_from` is
        ``"anywhere"``.
    city : SignatureDatabase, optional
        The observed city, if it is not the searched one: for example the same city at another
        date, in the same coordinate reference system. Places are in its cells.
    part : slice, optional
        The queries to draw, counted over all seeds in order; all by default.

    Returns
    -------
    list of SimulatedQuery
        ``spec.number`` queries for each seed. Objects of classes that no cell of the database sees
        are not in the queries.

    Raises
    ------
    InputError
        If there are more queries than cells or places, or the street objects are missing.
    CrsError
        If the two cities have different coordinate reference systems.

    Examples
    --------
    >>> from semsig_gis import ObjectStore
    >>> spec = QuerySpec(number=3, seen_from="anywhere", distortions=())
    >>> queries = draw_queries(demo_database, spec, store=ObjectStore.of(demo_objects))
    >>> [query.length == len(query.asked) for query in queries]
    [True, True, True]
    """
    city = database if city is None else city
    if city.crs != database.crs:
        raise CrsError(
            f"queries are seen in {city.crs.to_string()} and searched for in "
            f"{database.crs.to_string()}; build both databases in one reference system."
        )
    check_count("queries", spec.number, len(city))
    if spec.seen_from == "anywhere" and store is None:
        raise InputError(
            "queries from anywhere need the street objects of the city; build its database with "
            "them, or let queries be seen from cells."
        )
    distort = prepare_chain(spec.distortions, CitySights.of(database))
    database_codes = _database_codes(city, database)
    queries = []
    for seed, numbers in _numbers(spec, part):
        places, sights = _sights(city, spec, seed, numbers, store)
        cells = database.cells_at(places)
        for number, place, cell, sight in zip(numbers, places, cells, sights, strict=True):
            codes = database_codes[sight.codes]
            true = replace(sight, codes=codes).only(codes > 0)
            queries.append(
                SimulatedQuery(
                    seed=seed,
                    number=number,
                    xy=(float(place[0]), float(place[1])),
                    cell=int(cell),
                    length=len(sight),
                    asked=distort(true, seed, number),
                    pick=float(_random(seed, "pick", number).random()),
                )
            )
    return queries


def check_count(what: str, count: int, cells: int) -> None:
    """Raise InputError unless `count` is from 1 to the number of cells."""
    if not 1 <= count <= cells:
        raise InputError(
            f"{count} {what} were asked for; give a number from 1 to {cells}, the number of cells."
        )


def _numbers(spec: QuerySpec, part: slice) -> Iterator[tuple[int, range]]:
    """Yield each seed with the numbers of its queries that are in a part."""
    start, stop, _ = part.indices(spec.number * len(spec.seeds))
    for place, seed in enumerate(spec.seeds):
        first = place * spec.number
        low, high = max(start - first, 0), min(stop - first, spec.number)
        if low < high:
            yield seed, range(low, high)


def _sights(
    city: SignatureDatabase,
    spec: QuerySpec,
    seed: int,
    numbers: range,
    store: ObjectStore | None,
) -> tuple[NDArray[np.float64], Iterator[Sight]]:
    """Return the places of the queries of a seed and the sight from each."""
    # All queries come from one permutation, so that the first ones do not depend on their number.
    cells = np.random.default_rng(np.random.SeedSequence(seed)).permutation(len(city))
    if spec.seen_from == "cells" or store is None:
        cells = cells[numbers.start : numbers.stop]
        return city.xy[cells], (Sight.of_cell(city, cell) for cell in cells.tolist())
    places = _places(city, cells, spec.number, seed, store)[numbers.start : numbers.stop]
    views = visible_objects_at(
        store.objects,
        places,
        index=store.index,
        radius=city.spec.radius,
        footprints=store.buildings_around(
            places, distance=city.near_reach, occlusion=city.occlusion
        ),
    )
    parts = (slice(low, high) for low, high in pairwise(views.offsets.tolist()))
    return places, (
        Sight(
            codes=views.codes[part],
            bearings=views.bearings[part],
            distances=views.distances[part],
            extents=None if views.extents is None else views.extents[part],
        )
        for part in parts
    )


def _places(
    city: SignatureDatabase, cells: NDArray[np.int64], number: int, seed: int, store: ObjectStore
) -> NDArray[np.float64]:
    """Return one place outside the buildings in each of the first cells that have such a place."""
    step = city.grid.step
    places: list[NDArray[np.float64]] = []
    for start in range(0, len(cells), number):
        block = cells[start : start + number]
        offsets = np.stack(
            [
                _random(seed, "place", start + row).uniform(-0.5, 0.5, (TRIES, 2))
                for row in range(len(block))
            ]
        )
        candidates = city.xy[block][:, None] + step * offsets
        buildings = store.buildings_around(city.xy[block], distance=step, occlusion=city.occlusion)
        free = np.ones(candidates.shape[:2], np.bool_)
        if buildings is not None:
            free = ~buildings.cover(candidates.reshape(-1, 2)).reshape(free.shape)
        # The first free candidate of each cell that has one.
        usable = free.any(axis=1)
        places.append(candidates[usable, free.argmax(axis=1)[usable]])
        if sum(map(len, places)) >= number:
            return np.concatenate(places)[:number]
    raise InputError(
        f"{number} queries were asked for, but only {sum(map(len, places))} of the {len(cells)} "
        "cells have a place outside the buildings; give a smaller number."
    )


def _database_codes(city: SignatureDatabase, database: SignatureDatabase) -> NDArray[np.uint8]:
    """Return the database's code of each class code of a city, 0 for classes it does not see."""
    present = set(database.present_codes.tolist())
    codes = {item.name: item.code for item in database.taxonomy.classes if item.code in present}
    database_codes = np.zeros(256, np.uint8)
    for item in city.taxonomy.classes:
        database_codes[item.code] = codes.get(item.name, 0)
    return database_codes


def _random(seed: int, stream: str, number: int) -> np.random.Generator:
    key = (number, zlib.crc32(stream.encode()))
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
