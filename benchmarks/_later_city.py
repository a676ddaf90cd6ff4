"""Simulate a city some years later: objects are removed, added and moved, single or in rows.

The simulation does not use the noise models: rows of trees are felled and planted again, streets
get new lamps at other places, and new rows appear.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import scipy.spatial

from semsig_gis.core import CLASS_CODE, COUNT, SOURCE, SOURCE_ID

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from semsig_gis.objects import StreetObjects

    Places = NDArray[np.float64]

__all__ = ["later_city"]

_STREET = 60.0  # metres around the middle of a part of a street that is renewed
_NEIGHBOUR = (3.0, 25.0)  # metres from an object of its class to a new one
_NUDGE, _LEAP, _LEAPS = 1.2, 12.0, 0.2  # deviations of moves in metres, and the share of long ones


@dataclass(frozen=True, slots=True, kw_only=True)
class _Wear:
    """Shares of the objects of a class that change in a year.

    Single objects are `removed`, `added` and `displaced`. In parts of streets that are `renewed`,
    all objects are removed, and a share `replaced` is added again, moved by up to `shift` metres
    along and across the street. A share is added in new `rows`, with objects `gap` metres apart.
    """

    removed: float = 0.12
    added: float = 0.16
    displaced: float = 0.10
    renewed: float = 0.0
    replaced: float = 0.0
    shift: tuple[float, float] = (0.0, 0.0)
    rows: float = 0.0
    gap: float = 0.0


_WEAR = {
    "alignment_tree": _Wear(
        removed=0.03,
        added=0.04,
        displaced=0.02,
        renewed=0.05,
        replaced=0.75,
        shift=(5.0, 1.0),
        rows=0.08,
        gap=8.0,
    ),
    "street_light": _Wear(
        removed=0.03,
        added=0.04,
        displaced=0.02,
        renewed=0.06,
        replaced=0.85,
        shift=(14.0, 3.0),
        rows=0.03,
        gap=22.0,
    ),
}


def later_city(objects: StreetObjects, years: int, *, seed: int) -> StreetObjects:
    """Return the street objects of a city some years later."""
    rng = np.random.default_rng(seed)
    for year in range(years):
        objects = _next_year(objects, f"{seed}-{year}", rng)
    return objects


def _next_year(objects: StreetObjects, label: str, rng: np.random.Generator) -> StreetObjects:
    table = objects.table
    xy, codes = objects.xy.copy(), objects.codes
    ids, sources = (table[name].to_numpy(object) for name in (SOURCE_ID, SOURCE))
    remains = np.ones(len(xy), np.bool_)
    columns: list[tuple[Places, int, object]] = []
    for code in np.unique(codes).tolist():
        rows = np.flatnonzero(codes == code)
        wear = _WEAR.get(objects.taxonomy.by_code(code).name, _Wear())
        places = xy[rows]
        new = [_neighbours(places, rng.poisson(wear.added * len(rows)), rng)]
        for part in _parts(places, wear.renewed * len(rows), rng):
            remains[rows[part]] = False
            new.append(_renewed(places[part], wear, rng))
        new += _rows(objects.xy, wear, wear.rows * len(rows), rng)
        remains[rows[rng.random(len(rows)) < wear.removed]] = False
        displaced = rows[rng.random(len(rows)) < wear.displaced]
        sigma = np.where(rng.random(len(displaced)) < _LEAPS, _LEAP, _NUDGE)
        xy[displaced] += sigma[:, None] * rng.normal(size=(len(displaced), 2))
        columns.append((np.concatenate(new), code, sources[rows[0]]))
    counts = [len(places) for places, _, _ in columns]
    new_ids = np.array([f"new {label}-{number}" for number in range(sum(counts))], object)
    places = np.concatenate([xy[remains], *(places for places, _, _ in columns)])
    values = {
        CLASS_CODE: np.append(codes[remains], np.repeat([code for _, code, _ in columns], counts)),
        SOURCE: np.append(sources[remains], np.repeat([name for *_, name in columns], counts)),
        SOURCE_ID: np.append(ids[remains], new_ids),
        COUNT: np.ones(len(places), np.int64),
    }
    values[CLASS_CODE] = values[CLASS_CODE].astype(np.uint8)
    later = gpd.GeoDataFrame(values, geometry=gpd.points_from_xy(*places.T), crs=objects.crs)
    return dataclasses.replace(objects, table=later)


def _neighbours(places: Places, count: int, rng: np.random.Generator) -> Places:
    """Return new places, each near one of `places`."""
    turn, distance = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(*_NEIGHBOUR, count)
    offsets = np.column_stack([np.cos(turn), np.sin(turn)]) * distance[:, None]
    return np.asarray(places[rng.integers(len(places), size=count)] + offsets)


def _parts(places: Places, amount: float, rng: np.random.Generator) -> Iterator[NDArray[np.int64]]:
    """Yield parts of streets, as rows of places, with `amount` places in all on average."""
    tree = scipy.spatial.cKDTree(places)
    unused = np.ones(len(places), np.bool_)
    while amount > 0:
        part = np.array(tree.query_ball_point(places[rng.integers(len(places))], _STREET))
        part = part[unused[part]]
        if not len(part) or rng.random() > amount / len(part):
            return
        unused[part] = False
        amount -= len(part)
        yield part


def _renewed(places: Places, wear: _Wear, rng: np.random.Generator) -> Places:
    """Return the places of objects in a part of a street after it was renewed."""
    _, _, axes = np.linalg.svd(places - places.mean(axis=0), full_matrices=True)
    along, across = wear.shift
    shift = rng.uniform(along / 3.0, along) * axes[0] + rng.uniform(-across, across) * axes[1]
    replaced = places[rng.random(len(places)) < wear.replaced]
    return np.asarray(replaced + shift + rng.normal(0.0, 0.5, replaced.shape))


def _rows(
    anywhere: Places, wear: _Wear, amount: float, rng: np.random.Generator
) -> Iterator[Places]:
    """Yield new rows near any objects, with `amount` places in all on average."""
    while amount > 0:
        count = int(rng.integers(4, 13))
        if rng.random() > amount / count:
            return
        amount -= count
        turn = rng.uniform(0.0, 2.0 * np.pi)
        step = wear.gap * np.array([np.cos(turn), np.sin(turn)])
        start = anywhere[rng.integers(len(anywhere))] + rng.normal(0.0, 8.0, 2)
        yield start + np.arange(count)[:, None] * step + rng.normal(0.0, 0.4, (count, 2))
