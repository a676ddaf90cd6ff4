"""Explain a place: which detections are which street objects, and which are missed or false.

Objects outside the sectors of all photos are neither.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, NotRequired, get_args

import numpy as np
from typing_extensions import TypedDict

from semsig_gis.core import SOURCE, SOURCE_ID, WILDCARD, Displayed, signed_degrees, wrap_degrees
from semsig_gis.database import visible_objects_at, visible_objects_in
from semsig_gis.localization.likelihood.association import Detections, associate, near_pairs
from semsig_gis.localization.likelihood.texts import best_text
from semsig_gis.localization.noise.table import (
    LONGEST_TABLE,
    DividedTaxonomy,
    noise_tables,
    query_bearings,
)
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

LEAST_PAIR_CHANCE = 0.01  # that a detection is an object, to list them in one row
LEAST_INSIDE = 0.5  # chance that the bearing of an object is in a sector, to count it as inside
Verdict = Literal["matched", "misnamed", "missed", "false"]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
OUTSIDE = "outside"
IN_WORDS = {
    "matched": "is there",
    "misnamed": "is another thing",
    "missed": "was not mentioned",
    "false": "is not there",
    OUTSIDE: "was not looked at",
}
"""The verdicts as a person reads them."""
ROW_NUMBERS = ("query", "photo", "object")


class ExplanationRow(TypedDict):
    """An object of the query, a street object, or both."""

    verdict: Verdict | Literal["outside"]
    chance: float
    query: int | None
    photo: int | None
    query_class: str | None
    query_bearing: float | None
    query_range: float | None
    object: int | None
    source: str | None
    source_id: str | None
    object_class: str | None
    object_bearing: float | None
    distance: float | None
    bearing_error: float | None
    query_text: NotRequired[str | None]
    object_text: NotRequired[str | None]


class HeadingsRecord(TypedDict):
    """The degrees added to the bearings of each photo, of several."""

    headings: NotRequired[list[float]]


class ExplanationRecord(HeadingsRecord):
    """An explanation as plain values."""

    x: float
    y: float
    heading: float
    loglik: float
    counts: dict[Verdict, int]
    rows: list[ExplanationRow]


TEXT_COLUMNS = ["query_text", "object_text"]
"""Columns of an explanation of a view with texts."""
COLUMNS = [name for name in ExplanationRow.__annotations__ if name not in TEXT_COLUMNS]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Explanation(Displayed):
    """Which objects a query and a place have in common, and which not.

    `rows` has a row for each object of the query of a class that the map has, then one for each
    street object that is probably none of them; `table` is a table of these rows. `verdict` is
    ``"matched"`` (more likely an object than not), ``"misnamed"`` (the same, but of another class),
    ``"false"``, ``"missed"`` or, for street objects in the sectors of no photo, ``"outside"``;
    `chance` is the probability of the verdict. `query`, `photo` and `object` are row numbers,
    `distance` and `query_range`, if given, are in metres, `bearing_error` is in degrees clockwise
    from object to detection, and `place` that of the street object. If texts were read, they are
    the `query_text`, and `object_text` is that of the map. Values that do not apply are None.
    `place` and `xy` are in metres in `crs`, `headings` are the degrees added to the bearings of
    each photo.
    """

    rows: tuple[dict[str, Any], ...]
    xy: tuple[float, float]
    headings: tuple[float, ...]
    loglik: float
    crs: CRS

    def _facts(self) -> dict[str, object]:
        return {
            **{str(verdict): count for verdict, count in self.counts.items()},
            "place": f"{self.xy[0]:.1f}, {self.xy[1]:.1f}",
            "heading": ", ".join(f"{heading:.1f}°" for heading in self.headings),
        }

    @property
    def heading(self) -> float:
        """The degrees added to the bearings of the first photo."""
        return self.headings[0]

    @cached_property
    def table(self) -> gpd.GeoDataFrame:
        """The rows with the street object as geometry; values that do not apply are missing."""
        import geopandas as gpd  # noqa: PLC0415 - it takes 0.3 s
        import pandas as pd  # noqa: PLC0415
        import shapely  # noqa: PLC0415

        places = [row["place"] for row in self.rows]
        points = [None if place is None else shapely.Point(place) for place in places]
        table = pd.DataFrame(self.rows, columns=self.columns).astype(
            dict.fromkeys(ROW_NUMBERS, "Int64")
        )
        return gpd.GeoDataFrame(table, geometry=points, crs=self.crs)

    @property
    def columns(self) -> list[str]:
        """The names of the columns, with those of texts if some were read."""
        read = any(row.get("query_text") for row in self.rows)
        return [*COLUMNS, *(TEXT_COLUMNS if read else ())]

    def numbered(self, rows: NDArray[np.int64]) -> Explanation:
        """Return the explanation of some rows of a query, with their numbers there."""
        numbers: list[Any] = rows.tolist()
        return replace(
            self,
            rows=tuple(
                row if row["query"] is None else {**row, "query": numbers[row["query"]]}
                for row in self.rows
            ),
        )

    def ends(self, reach: float) -> NDArray[np.float64]:
        """Return the end of the line to each row, shape (n, 2): at its range, or at `reach`.

        It has the bearing of the detection or, without one, that of the street object.
        """

        def first_value(row: dict[str, Any], *names: str) -> float:
            return next((row[name] for name in names if row[name] is not None), reach)

        bearings = [first_value(row, "query_bearing", "object_bearing") for row in self.rows]
        metres = [first_value(row, "query_range", "distance") for row in self.rows]
        angles = np.radians(np.array(bearings, dtype=np.float64))
        away = np.stack([np.sin(angles), np.cos(angles)], axis=1)
        return np.asarray(np.array(self.xy) + np.array(metres)[:, None] * away)

    @property
    def counts(self) -> dict[Verdict, int]:
        """The number of rows by verdict, without objects outside the sectors."""
        counts = Counter(row["verdict"] for row in self.rows)
        return {verdict: counts[verdict] for verdict in VERDICTS}

    def to_dict(self, north: North = GRID_NORTH) -> ExplanationRecord:
        """Return plain values for JSON; values that do not apply are None.

        Bearings count from `north`, not from grid north as in the table.
        """
        names = self.columns
        rows: list[Any] = [{name: row[name] for name in names} for row in self.rows]
        for row in rows:
            for name in ("query_bearing", "object_bearing"):
                row[name] = None if row[name] is None else north.from_grid(row[name])
        several: HeadingsRecord = (
            {"headings": list(self.headings)} if len(self.headings) > 1 else {}
        )
        return {
            "x": self.xy[0],
            "y": self.xy[1],
            "heading": self.heading,
            **several,
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
    plain: Signature | None = None,
) -> Explanation:
    """Explain which objects of a query are which street objects, if it was seen from a place.

    The query, perhaps a `View`, needs bearings; its types may be unknown. `xy` and `radius` are in
    metres, `heading` is in degrees to add to the bearings, one for all or one for each photo, and
    objects behind `footprints` are not visible. Chances are sums over all one-to-one associations;
    each model of a mixture is weighted by the likelihood of the query at this place. Objects
    of classes that the city does not have are left out; a query of no others raises `InputError`.
    `plain` is the same query with scores of whole classes, if the scores of `query` are of parts of
    classes.
    """
    x, y = map(float, xy)
    place = np.array([[x, y]])
    view = visible_objects_at(objects, place, index=index, radius=radius, footprints=footprints)
    codes = objects.present_codes
    scene = _Scene((x, y), view, codes, objects.taxonomy, objects.crs, radius, objects)
    return scene.explanation(query, noise, heading, query if plain is None else plain)


def explain_cell(
    query: Signature,
    cell: int,
    noise: Noise,
    *,
    database: SignatureDatabase,
    heading: float | Sequence[float] = 0.0,
    plain: Signature | None = None,
) -> Explanation:
    """Explain which objects of a query are which objects of a cell, using only the database.

    It is like `explain`, but a database does not contain which street objects a cell sees: the
    columns ``object``, ``source`` and ``source_id`` are missing, and places of objects are exact to
    some decimetres.
    """
    x, y = database.xy_of(cell).tolist()
    view = visible_objects_in(database, np.array([cell]))
    codes, radius = database.present_codes, database.spec.radius
    scene = _Scene((x, y), view, codes, database.taxonomy, database.crs, radius)
    return scene.explanation(query, noise, heading, query if plain is None else plain)


OBJECT_FIELDS = ("objects", "codes", "bearings", "distances")


@dataclass(frozen=True, slots=True)
class _Chances:
    """Chances of pairs by object (rows) and detection; of a miss and of being in a sector."""

    chances: NDArray[np.float64]
    missed: NDArray[np.float64]
    inside: NDArray[np.float64]
    loglik: float


@dataclass(frozen=True, slots=True)
class _Scene:
    """The objects visible from a place, and the classes of the city."""

    xy: tuple[float, float]
    view: VisibleObjects
    codes: NDArray[np.uint8]
    taxonomy: Taxonomy
    crs: CRS
    radius: float
    objects: StreetObjects | None = None

    def explanation(
        self,
        query: Signature,
        noise: Noise,
        heading: float | Sequence[float],
        plain: Signature,
    ) -> Explanation:
        """Return the verdicts on the objects of a query and of the scene; see `explain`."""
        view = View.of(query)
        turns = np.broadcast_to(heading, len(view.photos)).astype(np.float64)
        # `replace` keeps the order of the objects, which is that of the rows of the query.
        view = replace(
            view,
            bearings=wrap_degrees(query_bearings(query) + turns[view.photo_rows]),
            photos=tuple(map(Photo.turned, view.photos, turns.tolist())),
        )
        pairs = self._pair_chances(view, noise)
        partners: dict[int, int] = {}
        for number in range(len(view.photos)):
            own = np.flatnonzero(view.photo_rows == number)
            places = _partners(pairs.chances[:, own])
            partners |= {int(own[place]): entry for place, entry in places.items()}
        rows = self._detection_rows(view, pairs.chances, partners, View.of(plain))
        for entry, (missed, inside) in enumerate(
            zip(pairs.missed.tolist(), pairs.inside.tolist(), strict=True)
        ):
            if entry not in partners.values():
                is_inside = inside >= LEAST_INSIDE
                verdict = "missed" if is_inside else OUTSIDE
                chance = missed if is_inside else 1.0 - inside
                rows.append({"verdict": verdict, "chance": chance, **self._object(entry)})
        blank = dict.fromkeys([*COLUMNS, *TEXT_COLUMNS, "place"])
        return Explanation(
            rows=tuple(blank | row for row in rows),
            xy=self.xy,
            headings=tuple(turns.tolist()),
            loglik=pairs.loglik,
            crs=self.crs,
        )

    def _pair_chances(self, query: View, noise: Noise) -> _Chances:
        """Return the chance that each object is each detection."""
        tables, weights = noise_tables(
            noise,
            taxonomy=self.taxonomy,
            codes=self.codes,
            longest=LONGEST_TABLE,
            radius=self.radius,
        )
        rows = np.flatnonzero(query.among(self.codes))
        tables[0].query_rows(query.select(rows))  # raises without any known class
        # Every photo may show the same objects; its detections come one photo after the other.
        photos, size = len(query.photos), len(self.view.codes)
        rows = rows[np.argsort(query.photo_rows[rows], kind="stable")]
        detections = Detections.of([query.select(rows)], tables[0])
        views = replace(
            self.view,
            offsets=np.arange(photos + 1) * size,
            **{name: np.tile(getattr(self.view, name), photos) for name in OBJECT_FIELDS},
            extents=None if self.view.extents is None else np.tile(self.view.extents, photos),
        )
        pairs = near_pairs(views.offsets, views.bearings, detections.starts, detections.bearings)
        logliks, inside = np.log(weights), np.zeros((photos, size))
        by_model = np.zeros((len(tables), size, len(query)))
        lengths = np.full(photos, size)
        for number, (table, weight) in enumerate(zip(tables, weights.tolist(), strict=True)):
            association = associate(table, views, detections, pairs, lengths=lengths)
            objects = pairs.objects % max(size, 1)
            by_model[number, objects, rows[pairs.detections]] = association.chances
            logliks[number] += association.loglik.sum()
            inside += weight * association.inside.reshape(photos, size)
        # The mean over the models, each weighted by its likelihood.
        total = float(np.logaddexp.reduce(logliks))
        chances = np.tensordot(np.exp(logliks - total), by_model, axes=1)
        missed = np.ones(size)
        for number in range(photos):
            missed *= 1.0 - chances[:, query.photo_rows == number].sum(axis=1)
        return _Chances(chances, np.maximum(missed, 0.0), inside.max(axis=0), total)

    def _detection_rows(
        self,
        query: View,
        chances: NDArray[np.float64],
        partners: dict[int, int],
        plain: View,
    ) -> list[dict[str, Any]]:
        """Return a row for each object of the query of a known class."""
        bearings = query_bearings(query)
        taxonomy = self.taxonomy
        if isinstance(taxonomy, DividedTaxonomy):
            taxonomy = taxonomy.whole
        scores, names = plain.class_scores(), plain.class_names(taxonomy)
        likeliest = scores == scores.max(axis=1, keepdims=True)
        ranges = np.full(len(query), np.nan) if query.ranges is None else query.ranges
        rows = []
        for number in np.flatnonzero(query.among(self.codes)).tolist():
            metres = float(ranges[number])
            row: dict[str, Any] = {
                "verdict": "false",
                "chance": max(1.0 - float(chances[:, number].sum()), 0.0),
                "query": number,
                "photo": int(query.photo_rows[number]) if len(query.photos) > 1 else None,
                "query_class": names[number],
                "query_bearing": float(bearings[number]),
                "query_range": None if math.isnan(metres) else metres,
                "query_text": query.text_rows[number] or None,
            }
            if number in partners:
                entry = partners[number]
                code = self._code(int(self.view.codes[entry]))
                same = likeliest[number, [WILDCARD, code]].any()
                away = signed_degrees(bearings[number] - self.view.bearings[entry])
                row |= {
                    "verdict": "matched" if same else "misnamed",
                    "chance": float(chances[entry, number]),
                    "bearing_error": float(away),
                    **self._object(entry, query.text_rows[number]),
                }
            rows.append(row)
        return rows

    def _object(self, entry: int, text: str = "") -> dict[str, Any]:
        """Return the columns of a street object, with its text that is most like another one."""
        view = self.view
        bearing, distance = float(view.bearings[entry]), float(view.distances[entry])
        facts: dict[str, Any] = {
            "object_class": self.taxonomy.by_code(self._code(int(view.codes[entry]))).name,
            "object_bearing": bearing,
            "distance": distance,
        }
        if self.objects is None:
            x, y = self.xy
            angle = np.radians(bearing)
            place = float(x + distance * np.sin(angle)), float(y + distance * np.cos(angle))
            return facts | {"place": place}
        row, table = int(view.objects[entry]), self.objects.arrow
        return facts | {
            "object": row,
            "source": table[SOURCE][row].as_py(),
            "source_id": table[SOURCE_ID][row].as_py(),
            "object_text": best_text(self.objects, row, text),
            "place": tuple(self.objects.xy[row].tolist()),
        }

    def _code(self, code: int) -> int:
        """Return the class code of an object, that of the whole class of a part."""
        taxonomy = self.taxonomy
        return taxonomy.whole_code(code) if isinstance(taxonomy, DividedTaxonomy) else code


def _partners(chances: NDArray[np.float64]) -> dict[int, int]:
    """Return the likeliest object of each real detection; each object at most once."""
    real = chances.sum(axis=0) > 0.5  # noqa: PLR2004 - more likely than not
    partners: dict[int, int] = {}
    for place in np.argsort(-chances, axis=None, kind="stable").tolist():
        entry, number = divmod(place, chances.shape[1])
        if chances[entry, number] <= LEAST_PAIR_CHANCE:
            break
        if real[number] and number not in partners and entry not in partners.values():
            partners[number] = entry
    return partners
