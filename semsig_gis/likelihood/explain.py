"""Why a place: which detections are which street objects, which were missed, which look false."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
import shapely

from semsig_gis.core.crs import SOURCE, SOURCE_ID
from semsig_gis.core.geometry import signed_degrees
from semsig_gis.core.taxonomy import WILDCARD
from semsig_gis.database.visibility import views_at, views_in
from semsig_gis.likelihood.association import associate, near_pairs, query_bearings
from semsig_gis.likelihood.noise.table import LONGEST_TABLE, noise_tables

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.core.rtree import ObjectIndex, StoredIndex
    from semsig_gis.core.signature import Signature
    from semsig_gis.core.taxonomy import Taxonomy
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.database.occlusion import Footprints
    from semsig_gis.database.visibility import Views
    from semsig_gis.likelihood.noise.model import Noise
    from semsig_gis.objects.table import StreetObjects

UNKNOWN_NAME = "unknown"
LEAST_CHANCE = 0.01  # of two things being one, to be set beside each other


@dataclass(frozen=True, eq=False, kw_only=True)
class Explanation:
    """What a query and a place have in common, and what not.

    `table` has one row for each object of the query, then one for each street object that none of
    them is likely to be, with the street object as geometry. `verdict` is ``"matched"`` (more
    likely an object than not), ``"misnamed"`` (the same, but of another class), ``"false"`` or
    ``"missed"``; `chance` is that it holds. `query` is the number of the object in the query,
    `object` the row in the table of objects, `distance` is in metres, and `bearing_error` in
    degrees clockwise from object to detection. What does not apply is missing.

    `xy` is the place in metres, `heading` the degrees that were added to the bearings of the query,
    and `loglik` the log-likelihood of the query at the place.
    """

    table: gpd.GeoDataFrame
    xy: tuple[float, float]
    heading: float
    loglik: float

    @property
    def counts(self) -> dict[str, int]:
        """How many rows there are of each verdict."""
        found = self.table["verdict"].value_counts()
        return {
            name: int(found.get(name, 0)) for name in ("matched", "misnamed", "missed", "false")
        }

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; what does not apply in a row is None."""
        plain = pd.DataFrame(self.table.drop(columns="geometry"))
        rows = plain.astype(object).where(plain.notna(), None).to_dict("records")
        return {
            "x": self.xy[0],
            "y": self.xy[1],
            "heading": self.heading,
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
    index: ObjectIndex | StoredIndex,
    radius: float = 30.0,
    heading: float = 0.0,
    footprints: Footprints | None = None,
) -> Explanation:
    """Say which objects of a query are which street objects, if it was seen from a place.

    The query needs bearings; its types may be unknown. `xy` and `radius`, the visibility range of
    classes that have none of their own, are in metres; `heading` is in degrees to add to the
    bearings. What `footprints` hide is not seen.

    Chances are those of all one-to-one associations together (see `likelihood.association`), each
    model of a mixture counting as much as the query speaks for it here. An object of the query is
    paired with the street object that it most likely is. An empty query and a class that the city
    does not have raise `InputError`.
    """
    place = np.array([xy], dtype=np.float64)
    view = views_at(objects, place, index=index, radius=radius, footprints=footprints)
    city = _City(objects.taxonomy, np.unique(objects.codes), objects.crs, objects)
    return _explained(query, (float(xy[0]), float(xy[1])), noise, city, view, heading)


def explain_cell(
    query: Signature,
    cell: int,
    noise: Noise,
    *,
    database: SignatureDatabase,
    heading: float = 0.0,
) -> Explanation:
    """Say which objects of a query are which objects of a cell, by the database alone.

    As `explain`, but a database does not know which objects a cell sees: the columns ``object``,
    ``source`` and ``source_id`` are missing, and places of objects are good to some decimetres.
    """
    view = views_in(database, np.array([cell]))
    city = _City(database.taxonomy, database.present_codes, database.crs)
    x, y = database.xy[cell].tolist()
    return _explained(query, (x, y), noise, city, view, heading)


@dataclass(frozen=True, slots=True)
class _City:
    """What there is to see."""

    taxonomy: Taxonomy
    codes: NDArray[np.uint8]
    crs: CRS
    objects: StreetObjects | None = None

    def class_name(self, code: int) -> str:
        return UNKNOWN_NAME if code == WILDCARD else self.taxonomy.by_code(code).name


def _explained(  # noqa: PLR0917 - two callers that have just these
    query: Signature,
    xy: tuple[float, float],
    noise: Noise,
    city: _City,
    view: Views,
    heading: float,
) -> Explanation:
    turned = (query_bearings(query) + heading) % 360.0
    chances, loglik = _chances(query, turned, view, noise, city)
    table = _table(query, turned, view, chances, city)
    placed = gpd.GeoDataFrame(table, geometry=_places(table, xy, city), crs=city.crs)
    return Explanation(table=placed, xy=xy, heading=heading, loglik=loglik)


def _chances(
    query: Signature,
    turned: NDArray[np.float64],
    view: Views,
    noise: Noise,
    city: _City,
) -> tuple[NDArray[np.float64], float]:
    """Return the chance that each object is each detection, and the log-likelihood of the query."""
    tables, weights = noise_tables(
        noise, taxonomy=city.taxonomy, codes=city.codes, longest=LONGEST_TABLE
    )
    names = tables[0].query_rows(query)
    kinds = tables[0].row_of[view.codes]
    pairs = near_pairs(view.offsets, view.bearings, np.array([0, len(query)]), turned)
    logliks = np.log(weights)
    each = np.zeros((len(tables), len(view.codes), len(query)))
    for number, table in enumerate(tables):
        chances, loglik = associate(
            table,
            pairs,
            kinds=kinds,
            distances=view.distances,
            lengths=np.full(len(kinds), len(kinds)),
            names=names,
        )
        each[number, pairs.objects, pairs.detections] = chances
        logliks[number] += loglik
    total = float(np.logaddexp.reduce(logliks))
    return np.tensordot(np.exp(logliks - total), each, axes=1), total


def _table(
    query: Signature,
    turned: NDArray[np.float64],
    view: Views,
    chances: NDArray[np.float64],
    city: _City,
) -> pd.DataFrame:
    """Return the verdicts as a table, without geometry."""
    codes = np.full(len(query), WILDCARD) if query.codes is None else query.codes
    rows: list[dict[str, Any]] = []
    partners = _partners(chances)
    for number, code in enumerate(codes.tolist()):
        whole = float(chances[:, number].sum())
        row = {
            "verdict": "false",
            "chance": max(1.0 - whole, 0.0),
            "query": number,
            "query_class": city.class_name(code),
            "query_bearing": float(turned[number]),
        }
        if number in partners:
            entry = partners[number]
            other = code not in {WILDCARD, int(view.codes[entry])}
            row |= {
                "verdict": "misnamed" if other else "matched",
                "chance": float(chances[entry, number]),
                "bearing_error": float(signed_degrees(turned[number] - view.bearings[entry])),
                **_object(entry, view, city),
            }
        rows.append(row)
    for entry in range(len(view.codes)):
        if entry not in partners.values():
            chance = max(1.0 - float(chances[entry].sum()), 0.0)
            rows.append({"verdict": "missed", "chance": chance, **_object(entry, view, city)})
    table = pd.DataFrame(rows, columns=COLUMNS)
    for name in ("query", "object"):
        table[name] = table[name].astype("Int64")
    return table


def _places(
    table: pd.DataFrame, xy: tuple[float, float], city: _City
) -> list[shapely.Point | None]:
    """Return where the street objects of a table stand."""
    if city.objects is not None:
        points = city.objects.table.geometry.array
        return [None if pd.isna(row) else points[int(row)] for row in table["object"]]
    angle = np.radians(table["object_bearing"].to_numpy(np.float64))
    away = table["distance"].to_numpy(np.float64)
    x, y = xy[0] + away * np.sin(angle), xy[1] + away * np.cos(angle)
    seen = np.isfinite(away)
    return [
        shapely.Point(*place) if there else None for *place, there in zip(x, y, seen, strict=True)
    ]


def _partners(chances: NDArray[np.float64]) -> dict[int, int]:
    """Return the object that each detection most likely is, no object twice."""
    real = chances.sum(axis=0) > 0.5  # noqa: PLR2004 - more likely than not
    found: dict[int, int] = {}
    for place in np.argsort(-chances, axis=None, kind="stable").tolist():
        entry, number = divmod(place, chances.shape[1])
        if chances[entry, number] <= LEAST_CHANCE:
            break
        if real[number] and number not in found and entry not in found.values():
            found[number] = entry
    return found


COLUMNS = [
    "verdict",
    "chance",
    "query",
    "query_class",
    "query_bearing",
    "object",
    "source",
    "source_id",
    "object_class",
    "object_bearing",
    "distance",
    "bearing_error",
]


def _object(entry: int, view: Views, city: _City) -> dict[str, Any]:
    """Return what a row of the table says of a street object."""
    found: dict[str, Any] = {
        "object_class": city.class_name(int(view.codes[entry])),
        "object_bearing": float(view.bearings[entry]),
        "distance": float(view.distances[entry]),
    }
    if city.objects is not None:
        row = int(view.objects[entry])
        of_object = city.objects.table.iloc[row]
        found |= {
            "object": row,
            "source": str(of_object[SOURCE]),
            "source_id": str(of_object[SOURCE_ID]),
        }
    return found
