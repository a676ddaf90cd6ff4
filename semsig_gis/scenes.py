"""Places with what is seen there: cells, and examples of queries that were found or not."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pyproj import Transformer

from semsig_gis.grid import cell_ids
from semsig_gis.report_parts import Scene, SceneObject
from semsig_gis.sight import Sight

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation_result import Evaluation

__all__ = ["cell_scene", "example_scenes"]

SAME_M = 1.0
"""How far apart, in metres, two cells may see one object: bearings and distances are rounded."""


def cell_scene(database: SignatureDatabase, cell: int, *, title: str = "") -> Scene:
    """Return what is seen from a cell.

    Parameters
    ----------
    database : SignatureDatabase
        The database.
    cell : int
        Row number in the database.
    title : str, optional
        What to call it; the cell's number by default.

    Returns
    -------
    Scene
        The objects of its signature, and those around that only other cells see.

    Examples
    --------
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> cell_scene(database, 0, title="A corner").types == database.types(0)
    True
    """
    x, y = database.xy[cell].tolist()
    lon, lat = Transformer.from_crs(database.crs, 4326, always_xy=True).transform(x, y)
    number = int(database.cell_ids[cell])
    own = _seen_from(database, cell)
    return Scene(
        name=f"cell-{number}",
        title=title or f"Cell {number}",
        lon=lon,
        lat=lat,
        radius=database.spec.radius,
        types=database.types(cell),
        objects=_drawn(own),
        others=_drawn(_seen_around(database, cell, own)),
    )


def example_scenes(
    evaluation: Evaluation, database: SignatureDatabase, *, successful: bool, count: int = 4
) -> tuple[Scene, ...]:
    """Return the first queries that were answered well (see `Evaluation.successful`), or not.

    The queries must be seen from cells of the database. The objects that are not seen from a cell
    are those that the cells around it see.
    """
    queries = evaluation.queries
    chosen = queries[(evaluation.successful == successful) & (queries["cell"] >= 0)].head(count)
    kind = "found" if successful else "lost"
    scenes = []
    for place, row in enumerate(chosen.to_dict("records"), start=1):
        cell = int(row["cell"])
        x, y = database.xy[cell].tolist()
        aside = (float(row["best_x"]) - x, float(row["best_y"]) - y)
        title = f"{'Found' if successful else 'Not found'}: query {int(row['number']):,}"
        scenes.append(
            replace(
                cell_scene(database, cell, title=title),
                name=f"{kind}-{place}",
                answer=aside if math.isfinite(aside[0]) else None,
                error_m=float(row["error_m"]),
            )
        )
    return tuple(scenes)


class _Seen(NamedTuple):
    """A class code, and metres east and north."""

    code: int
    east: float
    north: float


def _drawn(seen: list[_Seen]) -> tuple[SceneObject, ...]:
    return tuple(SceneObject(code=one.code, east=one.east, north=one.north) for one in seen)


def _seen_from(database: SignatureDatabase, cell: int) -> list[_Seen]:
    """Return what is seen from a cell, clockwise from north."""
    sight = Sight.of_cell(database, cell)
    turned = np.radians(sight.bearings)
    east, north = sight.distances * np.sin(turned), sight.distances * np.cos(turned)
    seen = zip(sight.codes.tolist(), east.tolist(), north.tolist(), strict=True)
    return [_Seen(*one) for one in seen]


def _seen_around(database: SignatureDatabase, cell: int, own: list[_Seen]) -> list[_Seen]:
    """Return what the cells around see, but not the cell itself, each thing once."""
    grid = database.grid
    reach = int(np.ceil(database.spec.radius / grid.step))
    steps = np.arange(-reach, reach + 1)
    columns, rows = (
        one.ravel()
        for one in np.meshgrid(database.columns[cell] + steps, database.rows[cell] + steps)
    )
    wanted = cell_ids(columns, rows)
    there = np.flatnonzero(np.isin(database.cell_ids, wanted))
    found: list[_Seen] = []
    for other in there.tolist():
        dx, dy = (database.xy[other] - database.xy[cell]).tolist()
        for one in _seen_from(database, other):
            moved = _Seen(one.code, one.east + dx, one.north + dy)
            if not any(_same(moved, known) for known in (*own, *found)):
                found.append(moved)
    return found


def _same(one: _Seen, other: _Seen) -> bool:
    apart = math.hypot(one.east - other.east, one.north - other.north)
    return one.code == other.code and apart <= SAME_M
