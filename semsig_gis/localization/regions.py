"""Regions of a city to search in the field after a query, as ranked polygons."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NotRequired

import geopandas as gpd
import numpy as np
import shapely
from typing_extensions import TypedDict

from semsig_gis.core import Displayed, InputError, percent
from semsig_gis.localization.answers import REGION_SHARE
from semsig_gis.localization.likelihood.posterior import Posterior

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization.answers import Answer

CHANCES = ["chance", "searched_chance"]  # columns of the likelihood method only


class RegionsRecord(TypedDict):
    """The totals of all regions; the chance is that of the likelihood method."""

    regions: int
    cells: int
    km2: float
    percent: float
    chance: NotRequired[float]


@dataclass(frozen=True, eq=False, repr=False)
class SearchRegions(Displayed):
    """The regions of a city in which a query may have been seen.

    Parameters
    ----------
    table : GeoDataFrame
        One row per region, best first, in the CRS of the database: ``rank`` (from 1), ``chance``
        (probability that the place is in it; likelihood method only), ``cells``, ``km2``,
        ``best_cell_id``, ``best_x`` and ``best_y`` (its best cell and the viewpoint);
        ``searched_chance``, ``searched_km2`` and ``searched_percent`` (of the city), cumulative
        over the regions up to this one; ``geometry`` (polygon of cells that share sides).

    Examples
    --------
    >>> from semsig_gis import localize
    >>> answer = localize(demo_database, demo_database.signature(0), method="edit+edit", top=5)
    >>> regions = search_regions(answer, demo_database)
    >>> regions.table["cells"].tolist(), regions.to_dict()["regions"]
    ([5], 1)
    """

    table: gpd.GeoDataFrame

    def _facts(self) -> dict[str, object]:
        total = self.to_dict()
        chance = {"chance": percent(total["chance"])} if "chance" in total else {}
        area = f"{total['km2']:.3f} km² ({total['percent']:.2g} %)"
        return {"regions": total["regions"], "cells": total["cells"], "area": area, **chance}

    def to_dict(self) -> RegionsRecord:
        """Return the totals of all regions; ``percent`` is of the area of all cells."""
        last = self.table.iloc[-1]
        summary: RegionsRecord = {
            "regions": len(self.table),
            "cells": int(self.table["cells"].sum()),
            "km2": float(last["searched_km2"]),
            "percent": float(last["searched_percent"]),
        }
        if "chance" in self.table.columns:
            summary["chance"] = float(last["searched_chance"])
        return summary


def search_regions(
    answer: Answer,
    database: SignatureDatabase,
    *,
    share: float = REGION_SHARE,
    within: float = 0.0,
) -> SearchRegions:
    """Return the regions in which a query may have been seen.

    Parameters
    ----------
    answer : Location or Localization
        The answer to the query. With the likelihood method, the regions contain the smallest set of
        cells with the `share` of the probability; with a distance, the candidates.
    database : SignatureDatabase
        The database that was searched.
    share : float, default 0.9
        Share of the probability, above 0 and at most 1.
    within : float, default 0
        Margin in metres: other cells are added if their viewpoint is this close to one of these
        cells, for places between viewpoints and for errors of the map.

    Returns
    -------
    SearchRegions
        Merged polygons, by descending probability, or by the rank of their best candidate.

    Raises
    ------
    InputError
        If the share or the distance is out of range, or the answer is from another database.

    Examples
    --------
    >>> from semsig_gis import localize
    >>> answer = localize(demo_database, demo_database.signature(0), method="edit+edit", top=5)
    >>> search_regions(answer, demo_database).to_dict()["cells"]
    5
    """
    if not 0 < share <= 1:
        raise InputError(
            f"a share of {share} was given for regions; give a number above 0 and at most 1."
        )
    if not (math.isfinite(within) and within >= 0):
        raise InputError(f"a margin of {within} m was given for regions; give metres, 0 or more.")
    chances, cells = answer.chances, answer.region_cells(database, share)
    if within > 0:
        marks = np.zeros(len(database))
        marks[cells] = 1.0
        near = Posterior(database=database, chances=marks).mass_within(within) > 0
        cells = np.concatenate([cells, np.flatnonzero(near & (marks == 0))])
    shapes = shapely.get_parts(shapely.union_all(_column_runs(database, np.sort(cells))))
    points = np.asarray(shapely.points(database.xy[cells]))
    shape, inside = shapely.STRtree(points).query(shapes, predicate="contains")
    # Sorted by cell rank: the first cell of each region is its best.
    region = shape[np.argsort(inside)]
    first = np.unique(region, return_index=True)[1]
    counts = np.bincount(region)
    mass = np.bincount(region, None if chances is None else chances[cells])
    order = np.argsort(first if chances is None else -mass, kind="stable")
    best = cells[first[order]]
    km2 = counts[order] * database.grid.step**2 / 1e6
    table = gpd.GeoDataFrame(
        {
            "rank": np.arange(1, len(order) + 1),
            "chance": mass[order],
            "cells": counts[order],
            "km2": km2,
            "best_cell_id": database.cell_ids[best],
            "best_x": database.xy[best, 0],
            "best_y": database.xy[best, 1],
            "searched_chance": np.minimum(np.cumsum(mass[order]), 1.0),
            "searched_km2": np.cumsum(km2),
            "searched_percent": 100.0 * np.cumsum(counts[order]) / len(database),
        },
        geometry=shapes[order],
        crs=database.crs,
    )
    return SearchRegions(table if chances is not None else table.drop(columns=CHANCES))


def _column_runs(database: SignatureDatabase, cells: NDArray[np.int64]) -> NDArray[np.object_]:
    """Return cells as rectangles, one for each run of adjacent cells in a grid column."""
    step, (west, south) = database.grid.step, database.grid.origin
    breaks = np.diff(database.cell_ids[cells]) != 1
    first, last = cells[np.append(True, breaks)], cells[np.append(breaks, True)]
    columns, bottom, top = database.columns[first], database.rows[first], database.rows[last]
    left, right = west + columns * step, west + (columns + 1) * step
    return np.asarray(shapely.box(left, south + bottom * step, right, south + (top + 1) * step))
