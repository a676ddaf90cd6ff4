"""What a place's data can carry: how much is seen from its streets, before a database is built."""

from __future__ import annotations

import itertools
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import lazy_loader
import numpy as np
from typing_extensions import TypedDict

from semsig_gis.core import (
    FAMILIES,
    SOURCE,
    EmptyResultError,
    GridSpec,
    ObjectIndex,
    Town,
    consecutive,
    town_of,
)
from semsig_gis.database.occlusion import Footprints
from semsig_gis.database.sightings import visible_objects_at
from semsig_gis.database.viewpoints import ViewpointSpec, choose_viewpoints, reproject

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable

    import shapely
    from numpy.typing import NDArray

    from semsig_gis.objects import Loaded, StreetObjects
else:
    shapely = lazy_loader.load("shapely")

BASE = "furniture"
"""Family that the other families are added to."""
STEP_M = 10.0
MOST_PLACES = 20_000
PLACES_PER_BLOCK = 1 << 11
LEAST_SEEN = (0, 1, 5, 10)
"""Least numbers of objects of the ranges in a survey."""
SEEN = ("0", "1-4", "5-9", "10+")

SeenRecord = TypedDict("SeenRecord", {"0": float, "1-4": float, "5-9": float, "10+": float})
"""Shares of the places by the number of objects that they see."""


class FamilyRecord(TypedDict):
    """A family in a survey; `FamilySurvey` describes the fields."""

    family: str
    optional: bool
    classes: int
    objects: int
    per_km: float | None
    added: SeenRecord
    own: SeenRecord


class SurveyRecord(TypedDict):
    """A survey as plain values."""

    objects: int
    places: int
    along_streets: bool
    occlusion: bool
    street_km: float
    radius: float
    town: Town
    families: list[FamilyRecord]


@dataclass(frozen=True, slots=True, kw_only=True)
class FamilySurvey:
    """A family of classes in a survey.

    `classes` and `objects` are their numbers on the map, `per_km` the objects for each kilometre of
    street, None without streets. `added` are the shares of the places by the number of objects
    that they see of this family and of those before it, `own` of this family only (see `SEEN`).
    With `optional`, they are the objects of optional layers.
    """

    family: str
    classes: int
    objects: int
    per_km: float | None
    added: tuple[float, ...]
    own: tuple[float, ...]
    optional: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """How many objects are seen from the streets of a place, by family.

    `places` is the number of places that were looked at, every 10 m along `street_km` of streets,
    or outdoors if there are no streets. With `occlusion`, buildings hide what is behind them. The
    first of `families` is street furniture, also if there is none; those of optional layers are
    the last. `town` is the nearest one of the middle of all objects.
    """

    places: int
    along_streets: bool
    occlusion: bool
    street_km: float
    radius: float
    town: Town
    families: tuple[FamilySurvey, ...]

    @property
    def objects(self) -> int:
        """The number of objects in the area, without optional layers."""
        return sum(item.objects for item in self.families if not item.optional)

    @property
    def seen(self) -> tuple[float, ...]:
        """The shares of the places by the number of objects that they see, as `objects`."""
        return next(item for item in reversed(self.families) if not item.optional).added

    def to_dict(self) -> SurveyRecord:
        """Return the survey as plain values for JSON."""
        town: Any = asdict(self.town)
        families: list[Any] = [
            {**asdict(item), "added": _record(item.added), "own": _record(item.own)}
            for item in self.families
        ]
        return {
            "objects": self.objects,
            "places": self.places,
            "along_streets": self.along_streets,
            "occlusion": self.occlusion,
            "street_km": self.street_km,
            "radius": self.radius,
            "town": town,
            "families": families,
        }


def _record(shares: Iterable[float]) -> dict[str, float]:
    return dict(zip(SEEN, shares, strict=True))


def survey(
    loaded: Loaded,
    *,
    optional: Collection[str] = (),
    radius: float = 30.0,
    area: shapely.Polygon | shapely.MultiPolygon | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Survey:
    """Return how many objects of each family are seen from the streets of a place.

    Parameters
    ----------
    loaded : Loaded
        The street objects, with buildings and streets if there are any.
    optional : collection of str
        Names of the layers that are counted after all others.
    radius : float, default 30
        Visibility range in metres of classes without their own.
    area : shapely.Polygon or shapely.MultiPolygon, optional
        In the CRS of the objects; only places in it are looked at, and only objects in it counted.
    progress : callable, optional
        Called with the number of finished places and of all places.

    Returns
    -------
    Survey
        The numbers. Of more than 20,000 places, a random part is looked at, always the same.

    Raises
    ------
    EmptyResultError
        If there is no place outside the buildings.

    Examples
    --------
    >>> from semsig_gis import CitySpec, assemble, load_catalog, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> result = survey(assemble(layers, load_catalog("openstreetmap")))
    >>> [item.family for item in result.families], result.along_streets
    (['furniture'], False)
    """
    objects = loaded.objects
    buildings = None
    if loaded.buildings is not None and not loaded.buildings.empty:
        buildings = Footprints.of(reproject(loaded.buildings, objects.crs))
    streets = np.empty(0, object)
    if loaded.streets is not None:
        streets = _lines(reproject(loaded.streets, objects.crs).geometry.to_numpy(), area)
    if along_streets := len(streets) > 0:
        places = _along(streets)
        if buildings is not None:
            places = places[~buildings.cover(places)]
    else:
        places = _outdoors(objects, buildings, area)
    if len(places) == 0:
        raise EmptyResultError(
            "there is no place outside the buildings here; check the area and the buildings."
        )
    names, family_of = _families(objects, optional)
    counts = np.zeros((len(places), len(names)), np.int64)
    index = ObjectIndex(objects.xy)
    for start in range(0, len(places), PLACES_PER_BLOCK):
        block = places[start : start + PLACES_PER_BLOCK]
        views = visible_objects_at(objects, block, index=index, radius=radius, footprints=buildings)
        place = start + np.repeat(np.arange(len(block)), views.lengths)
        np.add.at(counts, (place, family_of[views.objects]), 1)
        if progress is not None:
            progress(start + len(block), len(places))
    km = float(shapely.length(streets).sum()) / 1e3
    inside = np.ones(len(objects), np.bool_)
    if area is not None:
        inside = shapely.intersects_xy(area, objects.xy[:, 0], objects.xy[:, 1])
    families = []
    for number, (extra, name) in enumerate(names):
        rows = np.flatnonzero(inside & (family_of == number))
        things = _things(objects, rows)
        families.append(
            FamilySurvey(
                family=name,
                optional=extra,
                classes=len(np.unique(objects.codes[rows])),
                objects=things,
                per_km=things / km if along_streets else None,
                added=_shares(counts[:, : number + 1].sum(axis=1)),
                own=_shares(counts[:, number]),
            )
        )
    return Survey(
        places=len(places),
        along_streets=along_streets,
        occlusion=buildings is not None,
        street_km=km,
        radius=radius,
        town=town_of(objects.xy, objects.crs),
        families=tuple(families),
    )


def _lines(
    shapes: NDArray[np.object_], area: shapely.Polygon | shapely.MultiPolygon | None
) -> NDArray[np.object_]:
    """Return the parts of the centre lines in the area that have a length."""
    if area is not None:
        shapes = shapely.intersection(shapes, area)
    parts: NDArray[np.object_] = shapely.get_parts(shapely.get_parts(shapes))
    return parts[shapely.length(parts) > 0]


def _along(lines: NDArray[np.object_]) -> NDArray[np.float64]:
    """Return places about every 10 m along lines, at least one on each."""
    lengths = shapely.length(lines)
    counts = np.maximum(np.rint(lengths / STEP_M), 1).astype(np.int64)
    line = np.repeat(np.arange(len(lines)), counts)
    step = consecutive(np.zeros(len(counts), np.int64), counts)
    rows = np.arange(len(line))
    if len(line) > MOST_PLACES:
        rows = np.random.default_rng(0).choice(len(line), MOST_PLACES, replace=False)
    line, step = line[rows], step[rows]
    points = shapely.line_interpolate_point(
        lines[line], (step + 0.5) * lengths[line] / counts[line]
    )
    places: NDArray[np.float64] = shapely.get_coordinates(points)
    return places


def _outdoors(
    objects: StreetObjects,
    buildings: Footprints | None,
    area: shapely.Polygon | shapely.MultiPolygon | None,
) -> NDArray[np.float64]:
    """Return the centres of cells in the area, or else in the box of the objects, outdoors."""
    grid = GridSpec(STEP_M)
    box = np.vstack([objects.xy.min(axis=0), objects.xy.max(axis=0)])
    if area is not None:
        box = np.reshape(area.bounds, (2, 2))
    (first, last), (low, high) = grid.cells_at(box)
    height = int(high - low) + 1
    number = (int(last - first) + 1) * height
    cells = np.arange(number)
    if number > MOST_PLACES:
        cells = np.unique(np.random.default_rng(0).integers(0, number, MOST_PLACES))
    columns, rows = first + cells // height, low + cells % height
    spec = ViewpointSpec(mode="all" if buildings is None else "outdoor", area=area)
    mask = choose_viewpoints(columns, rows, grid=grid, spec=spec, footprints=buildings)
    return grid.viewpoints(columns[mask], rows[mask])


def _families(
    objects: StreetObjects, optional: Collection[str]
) -> tuple[list[tuple[bool, str]], NDArray[np.int64]]:
    """Return the families on the map, furniture first, and the number of that of each object.

    Those of optional layers are others, after the first ones.
    """
    titles = {item.code: item.family or BASE for item in objects.taxonomy.classes}
    extra = objects.table[SOURCE].isin(list(optional)).tolist()
    keys = list(zip(extra, (titles[code] for code in objects.codes.tolist()), strict=True))
    order = dict.fromkeys((BASE, *FAMILIES, *titles.values()))
    present = {(False, BASE), *keys}
    names = [key for key in itertools.product((False, True), order) if key in present]
    numbers = {key: number for number, key in enumerate(names)}
    return names, np.array([numbers[key] for key in keys], np.int64)


def _things(objects: StreetObjects, rows: NDArray[np.int64]) -> int:
    """Return the number of some objects; the points of an extended thing are one."""
    if objects.groups is None:
        return len(rows)
    groups = objects.groups[rows]
    return int((groups < 0).sum()) + len(np.unique(groups[groups >= 0]))


def _shares(counts: NDArray[np.int64]) -> tuple[float, ...]:
    """Return the shares of the places in each range of the number of objects."""
    ranges = np.searchsorted(LEAST_SEEN, counts, side="right") - 1
    shares = np.bincount(ranges, minlength=len(LEAST_SEEN)) / len(counts)
    return tuple(shares.tolist())
