"""Names of places in words, from the streets and buildings around them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import lazy_loader
import numpy as np

from semsig_gis.core import NAME

if TYPE_CHECKING:
    import geopandas as gpd
    import shapely
else:
    shapely = lazy_loader.load("shapely")

ON_STREET_M = 40.0
CORNER_M = 25.0
CROSSING_M = 12.0  # largest gap between the lines of two streets that meet
NEAR_M = 60.0
FAR_M = 300.0


class PlaceNames:
    """The named streets and buildings of a city, in R-trees.

    `streets` and `buildings` are in one metric CRS; rows without a name that is text are not used.
    """

    def __init__(
        self, streets: gpd.GeoDataFrame | None, buildings: gpd.GeoDataFrame | None
    ) -> None:
        self._streets = _Named(streets)
        self._buildings = _Named(buildings)

    def of(self, x: float, y: float) -> str:
        """Return a place in words, for example ``on High Street, near Town Hall``.

        The position is in metres. The text is empty if no street or building with a name is near.
        """
        place = shapely.Point(x, y)
        streets = self._streets.around(place, NEAR_M)
        names = [name for name, away in streets.items() if away <= ON_STREET_M][:1]
        if names:
            close = [name for name, away in streets.items() if away <= CORNER_M]
            names += [name for name in close if self._meet(place, names[0], name)][:1]
        near = next(iter(self._buildings.around(place, NEAR_M)), None)
        if near is None and len(names) < 2:  # noqa: PLR2004 - not at a corner
            near = next((name for name in streets if name not in names), None)
        parts = [f"on {name}" for name in names]
        if len(names) > 1:
            parts = [f"at the corner of {' and '.join(names)}"]
        if near is not None:
            parts.append(f"near {near}")
        return ", ".join(parts) or self._far(place)

    def _far(self, place: shapely.Point) -> str:
        """Return the distance of the nearest name; empty if none is near enough."""
        around = self._streets.around(place, FAR_M) | self._buildings.around(place, FAR_M)
        if not around:
            return ""
        name = min(around, key=lambda name: around[name])
        return f"{round(around[name], -1):.0f} m from {name}"

    def _meet(self, place: shapely.Point, first: str, second: str) -> bool:
        """Whether two streets meet near a place."""
        if first == second:
            return False
        gap = shapely.shortest_line(
            *(self._streets.lines(place, name, ON_STREET_M) for name in (first, second))
        )
        return bool(gap.length <= CROSSING_M and gap.distance(place) <= ON_STREET_M)


class _Named:
    """The shapes of a table that have a name, in an R-tree."""

    def __init__(self, table: gpd.GeoDataFrame | None) -> None:
        shapes, names = np.empty(0, object), np.empty(0, object)
        if table is not None and NAME in table:
            texts = [name.strip() if isinstance(name, str) else "" for name in table[NAME]]
            names = np.array(texts, dtype=object)
            shapes = table.geometry.to_numpy()
        self._shapes, self._names = shapes[names != ""], names[names != ""]
        self._tree = shapely.STRtree(self._shapes)

    def around(self, place: shapely.Point, distance: float) -> dict[str, float]:
        """Return the names within a distance of a place in metres, nearest first."""
        rows = np.sort(self._tree.query(place, predicate="dwithin", distance=distance))
        metres = shapely.distance(self._shapes[rows], place)
        order = np.argsort(metres, kind="stable")
        distances: dict[str, float] = {}
        for row, away in zip(rows[order].tolist(), metres[order].tolist(), strict=True):
            distances.setdefault(self._names[row], away)
        return distances

    def lines(self, place: shapely.Point, name: str, distance: float) -> shapely.Geometry:
        """Return the parts with a name within a distance of a place as one shape."""
        rows = self._tree.query(place, predicate="dwithin", distance=distance)
        return shapely.union_all(self._shapes[rows[self._names[rows] == name]])
