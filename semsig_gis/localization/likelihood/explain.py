"""Why a place: which detections are which street objects, which were missed, which look false.

What stands outside the sectors of all photos is neither.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import SOURCE, SOURCE_ID, WILDCARD, Displayed, signed_degrees, wrap_degrees
from semsig_gis.database import visible_objects_at, visible_objects_in
from semsig_gis.localization.likelihood.association import Detections, associate, near_pairs
from semsig_gis.localization.noise.table import LONGEST_TABLE, noise_tables, query_bearings
from semsig_gis.observation import GRID_NORTH, Photo, View

if TYPE_CHECKING:
    from collections.abc import Sequence

    import geopandas as gpd
    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.core import ObjectIndex, Signature, Taxonomy
    from semsig_gis.database import Footprints, SignatureDatabase, VisibleObjects
    from semsig_gis.localization.noise.model import Noise
    from semsig_gis.objects import StreetObjects
    from semsig_gis.observation import North

UNKNOWN_NAME = "unknown"
LEAST_CHANCE = 0.01  # of two things being one, to be set beside each other
LEAST_SEEN = 0.5  # of an object's bearing in a sector, that it is in it
VERDICTS = ("matched", "misnamed", "missed", "false")
OUTSIDE = "outside"
NUMBERS = ("query", "photo", "object")  # of rows
COLUMNS = [
    *("verdict", "chance", "query", "photo", "query_class", "query_bearing", "query_range"),
    *("object", "source", "source_id", "object_class", "object_bearing", "distance"),
    "bearing_error",
]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Explanation(Displayed):
    """What a query and a place have in common, and what not.

    `rows` has one for each object of the query, then one for each street object that none of them
    is likely to be; `table` is the table of them. `verdict` is ``"matched"`` (more likely an object
    than not), ``"misnamed"`` (the same, but of another class), ``"false"``, ``"missed"`` or, for
    street objects in the sectors of no photo, ``"outside"``; `chance` is that it holds. `query`,
    `photo` and `object` are row numbers, `distance` and `query_range`, as far as it was told, are
    in metres, `bearing_error` in degrees clockwise from object to detection, and `place` that of
    the street object. What does not apply is None. `place` and `xy` are in metres in `crs`,
    `headings` are the degrees added to the bearings of each photo.
    """

    rows: tuple[dict[str, Any], ...]
    xy: tuple[float, float]
    headings: tuple[float, ...]
    loglik: float
    crs: CRS

    def _facts(self) -> dict[str, object]:
        return {
            **self.counts,
            "place": f"{self.xy[0]:.1f}, {self.xy[1]:.1f}",
            "heading": ", ".join(f"{heading:.1f}°" for heading in self.headings),
        }

    @property
    def heading(self) -> float:
        """The degrees added to the bearings of the first photo."""
        return self.headings[0]

    @cached_property
    def table(self) -> gpd.GeoDataFrame:
        """The rows with the street object as geometry; what does not apply is missing."""
        import geopandas as gpd  # noqa: PLC0415 - it loads slowly
        import pandas as pd  # noqa: PLC0415
        import shapely  # noqa: PLC0415

        places = [row["place"] for row in self.rows]
        points = [None if place is None else shapely.Point(place) for place in places]
        table = pd.DataFrame(self.rows, columns=COLUMNS).astype(dict.fromkeys(NUMBERS, "Int64"))
        return gpd.GeoDataFrame(table, geometry=points, crs=self.crs)

    def ends(self, reach: float) -> NDArray[np.float64]:
        """Return where the line to each row ends, shape (n, 2): at its range, or at `reach`.

        It goes where a detection was seen, and else where the street object stands.
        """
        seen = [row["query_bearing"] for row in self.rows]
        stands = [row["object_bearing"] for row in self.rows]
        bearings = [there if at is None else at for at, there in zip(seen, stands, strict=True)]
        metres = [
            next(one for one in (row["query_range"], row["distance"], reach) if one is not None)
            for row in self.rows
        ]
        angles = np.radians(np.array(bearings, dtype=np.float64))
        away = np.stack([np.sin(angles), np.cos(angles)], axis=1)
        return np.asarray(np.array(self.xy) + np.array(metres)[:, None] * away)

    @property
    def counts(self) -> dict[str, int]:
        """How many rows there are of each verdict, without what stands outside the sectors."""
        counts = Counter(row["verdict"] for row in self.rows)
        return {verdict: counts[verdict] for verdict in VERDICTS}

    def to_dict(self, north: North = GRID_NORTH) -> dict[str, Any]:
        """Return plain values for JSON; what does not apply in a row is None.

        The bearings of the table count from grid north, those of the values from `north`.
        """
        rows = [{name: row[name] for name in COLUMNS} for row in self.rows]
        for row in rows:
            for name in ("query_bearing", "object_bearing"):
                row[name] = None if row[name] is None else north.from_grid(row[name])
        return {
            "x": self.xy[0],
            "y": self.xy[1],
            "heading": self.heading,
            **({"headings": list(self.headings)} if len(self.headings) > 1 else {}),
            "loglik": self.loglik,
            "counts": self.counts,
            "rows": rows,
        }


def explain(
    query: Signature,
    xy: tuple[float, float],
    noise: Noise,
    *,
    objects: StreetObjects,
    index: ObjectIndex,
    radius: float = 30.0,
    heading: float | Sequence[float] = 0.0,
    footprints: Footprints | None = None,
) -> Explanation:
    """Say which objects of a query are which street objects, if it was seen from a place.

    The query, perhaps a `View`, needs bearings; its types may be unknown. `xy` and `radius` are in
    metres, `heading` is in degrees to add to the bearings, one for all or one for each photo, and
    what `footprints` hide is not seen. Chances are those of all one-to-one associations together,
    each model of a mixture counting as much as the query speaks for it here. An object of a class
    that the city does not have is false; a query without any other raises `InputError`.
    """
    x, y = map(float, xy)
    place = np.array([[x, y]])
    view = visible_objects_at(objects, place, index=index, radius=radius, footprints=footprints)
    codes = np.flatnonzero(np.bincount(objects.codes)).astype(np.uint8)
    scene = _Scene((x, y), view, codes, objects.taxonomy, objects.crs, radius, objects)
    return scene.explanation(query, noise, heading)


def explain_cell(
    query: Signature,
    cell: int,
    noise: Noise,
    *,
    database: SignatureDatabase,
    heading: float | Sequence[float] = 0.0,
) -> Explanation:
    """Say which objects of a query are which objects of a cell, using only the database.

    As `explain`, but a database does not know which objects a cell sees: the columns ``object``,
    ``source`` and ``source_id`` are missing, and places of objects are good to some decimetres.
    """
    x, y = database.xy[cell].tolist()
    view = visible_objects_in(database, np.array([cell]))
    codes, radius = database.present_codes, database.spec.radius
    scene = _Scene((x, y), view, codes, database.taxonomy, database.crs, radius)
    return scene.explanation(query, noise, heading)


ENTRIES = ("objects", "codes", "bearings", "distances")


@dataclass(frozen=True, slots=True)
class _Chances:
    """Chances that objects, in rows, are detections; of being missed, and of being in a sector."""

    chances: NDArray[np.float64]
    missed: NDArray[np.float64]
    seen: NDArray[np.float64]
    loglik: float


@dataclass(frozen=True, slots=True)
class _Scene:
    """What is seen from a place, of the classes that the city has."""

    xy: tuple[float, float]
    view: VisibleObjects
    codes: NDArray[np.uint8]
    taxonomy: Taxonomy
    crs: CRS
    radius: float
    objects: StreetObjects | None = None

    def explanation(
        self, query: Signature, noise: Noise, heading: float | Sequence[float]
    ) -> Explanation:
        """Return the verdicts on the objects of a query and those of the scene."""
        view = View.of(query)
        turns = np.broadcast_to(heading, len(view.photos)).astype(np.float64)
        # Kept in its order, in which the rows are told.
        view = replace(
            view,
            bearings=wrap_degrees(query_bearings(query) + turns[view.photo_rows]),
            photos=tuple(map(Photo.turned, view.photos, turns.tolist())),
        )
        found = self._associated(view, noise)
        partners: dict[int, int] = {}
        for number in range(len(view.photos)):
            own = np.flatnonzero(view.photo_rows == number)
            places = _partners(found.chances[:, own])
            partners |= {int(own[place]): entry for place, entry in places.items()}
        rows = self._detections(view, found.chances, partners)
        for entry, (missed, seen) in enumerate(
            zip(found.missed.tolist(), found.seen.tolist(), strict=True)
        ):
            if entry not in partners.values():
                verdict = ("missed", missed) if seen >= LEAST_SEEN else (OUTSIDE, 1.0 - seen)
                facts = dict(zip(("verdict", "chance"), verdict, strict=True))
                rows.append(facts | self._object(entry))
        blank = dict.fromkeys([*COLUMNS, "place"])
        return Explanation(
            rows=tuple(blank | row for row in rows),
            xy=self.xy,
            headings=tuple(turns.tolist()),
            loglik=found.loglik,
            crs=self.crs,
        )

    def _associated(self, query: View, noise: Noise) -> _Chances:
        """Return the chance that each object is each detection."""
        tables, weights = noise_tables(
            noise,
            taxonomy=self.taxonomy,
            codes=self.codes,
            longest=LONGEST_TABLE,
            radius=self.radius,
        )
        known = np.flatnonzero(query.among(self.codes))
        tables[0].query_rows(query.select(known))  # refuses a query without any
        # Every photo sees the same objects; its detections come one photo after the other.
        photos, size = len(query.photos), len(self.view.codes)
        known = known[np.argsort(query.photo_rows[known], kind="stable")]
        seen = Detections.of([query.select(known)], tables[0])
        views = replace(
            self.view,
            offsets=np.arange(photos + 1) * size,
            **{name: np.tile(getattr(self.view, name), photos) for name in ENTRIES},
        )
        pairs = near_pairs(views.offsets, views.bearings, seen.starts, seen.bearings)
        logliks, inside = np.log(weights), np.zeros((photos, size))
        each = np.zeros((len(tables), size, len(query)))
        lengths = np.full(photos, size)
        for number, (table, weight) in enumerate(zip(tables, weights.tolist(), strict=True)):
            found = associate(table, views, seen, pairs, lengths=lengths)
            each[number, pairs.objects % max(size, 1), known[pairs.detections]] = found.chances
            logliks[number] += found.loglik.sum()
            inside += weight * found.inside.reshape(photos, size)
        total = float(np.logaddexp.reduce(logliks))
        chances = np.tensordot(np.exp(logliks - total), each, axes=1)
        missed = np.ones(size)
        for number in range(photos):
            missed *= 1.0 - chances[:, query.photo_rows == number].sum(axis=1)
        seen_at_all = inside.max(axis=0)
        return _Chances(chances, np.maximum(missed, 0.0), seen_at_all, total)

    def _detections(
        self, query: View, chances: NDArray[np.float64], partners: dict[int, int]
    ) -> list[dict[str, Any]]:
        """Return one row for each object of the query."""
        bearings = query_bearings(query)
        codes = query.class_scores().argmax(axis=1)
        ranges = np.full(len(query), np.nan) if query.ranges is None else query.ranges
        rows = []
        for number, (code, metres) in enumerate(zip(codes.tolist(), ranges.tolist(), strict=True)):
            row: dict[str, Any] = {
                "verdict": "false",
                "chance": max(1.0 - float(chances[:, number].sum()), 0.0),
                "query": number,
                "photo": int(query.photo_rows[number]) if len(query.photos) > 1 else None,
                "query_class": self._class_name(code),
                "query_bearing": float(bearings[number]),
                "query_range": None if math.isnan(metres) else metres,
            }
            if number in partners:
                entry = partners[number]
                other = code not in {WILDCARD, int(self.view.codes[entry])}
                away = signed_degrees(bearings[number] - self.view.bearings[entry])
                row |= {
                    "verdict": "misnamed" if other else "matched",
                    "chance": float(chances[entry, number]),
                    "bearing_error": float(away),
                    **self._object(entry),
                }
            rows.append(row)
        return rows

    def _object(self, entry: int) -> dict[str, Any]:
        """Return what the table says of a street object."""
        view = self.view
        bearing, distance = float(view.bearings[entry]), float(view.distances[entry])
        facts: dict[str, Any] = {
            "object_class": self._class_name(int(view.codes[entry])),
            "object_bearing": bearing,
            "distance": distance,
        }
        if self.objects is None:
            x, y = self.xy
            angle = np.radians(bearing)
            place = float(x + distance * np.sin(angle)), float(y + distance * np.cos(angle))
            return facts | {"place": place}
        row = int(view.objects[entry])
        table = self.objects.table
        return facts | {
            "object": row,
            "source": str(table[SOURCE].iloc[row]),
            "source_id": str(table[SOURCE_ID].iloc[row]),
            "place": tuple(self.objects.xy[row].tolist()),
        }

    def _class_name(self, code: int) -> str:
        return UNKNOWN_NAME if code == WILDCARD else self.taxonomy.by_code(code).name


def _partners(chances: NDArray[np.float64]) -> dict[int, int]:
    """Return the object that each detection most likely is, no object twice."""
    real = chances.sum(axis=0) > 0.5  # noqa: PLR2004 - more likely than not
    partners: dict[int, int] = {}
    for place in np.argsort(-chances, axis=None, kind="stable").tolist():
        entry, number = divmod(place, chances.shape[1])
        if chances[entry, number] <= LEAST_CHANCE:
            break
        if real[number] and number not in partners and entry not in partners.values():
            partners[number] = entry
    return partners
