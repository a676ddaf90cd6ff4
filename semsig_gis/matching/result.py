"""The answer to a query: the best cells, with ties told."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
from pyproj import Transformer

from semsig_gis.matching.ties import top_candidates

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.core.signature import Signature
    from semsig_gis.core.taxonomy import Taxonomy
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.matching.method import Method


@dataclass(frozen=True, eq=False, kw_only=True)
class Localization:
    """The best cells for a query.

    Parameters
    ----------
    query : Signature
        What was searched for.
    method : Method
        How the cells were ranked.
    used : str
        Which parts of the query were compared: ``"types"``, ``"angles"`` or ``"types+angles"``.
    candidates : DataFrame
        One row a cell, best first, equal distances in the order of the database: ``rank_low``
        and ``rank_high`` (the first and last rank, from 1, that the cell can have when ties are
        broken either way), ``tied`` (how many cells share its distance), ``cell`` (row in the
        database), ``cell_id``, ``x`` and ``y`` (viewpoint, CRS of the database), ``types``
        (symbols), ``length`` (objects), ``distance``.
    cells : int
        How many cells were searched.
    tied_beyond : int
        How many cells are as good as the last candidate but are not listed.
    crs : pyproj.CRS
        CRS of ``x`` and ``y``.
    taxonomy : Taxonomy
        The classes behind the symbols.
    licenses : tuple of str
        Where the street objects of the database come from.
    """

    query: Signature
    method: Method
    used: str
    candidates: pd.DataFrame
    cells: int
    tied_beyond: int
    crs: CRS
    taxonomy: Taxonomy
    licenses: tuple[str, ...]

    def to_geodataframe(self) -> gpd.GeoDataFrame:
        """Return the candidates with their viewpoints as points in the CRS of the database.

        Returns
        -------
        GeoDataFrame
            The columns of `candidates` and ``geometry``.
        """
        points = gpd.points_from_xy(self.candidates["x"], self.candidates["y"])
        return gpd.GeoDataFrame(self.candidates.copy(), geometry=points, crs=self.crs)

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values that JSON can hold.

        Returns
        -------
        dict
            ``query``, ``method``, ``used``, ``cells``, ``tied_beyond``, ``crs``, ``licenses``
            and ``candidates``, a list with the columns of `candidates` and ``lon``, ``lat``
            (degrees, WGS 84).
        """
        to_degrees = Transformer.from_crs(self.crs, "EPSG:4326", always_xy=True)
        lon, lat = to_degrees.transform(
            self.candidates["x"].to_numpy(), self.candidates["y"].to_numpy()
        )
        listed = self.candidates.assign(lon=np.round(lon, 7), lat=np.round(lat, 7))
        return {
            "query": self.query.to_dict(self.taxonomy),
            "method": str(self.method),
            "used": self.used,
            "cells": self.cells,
            "tied_beyond": self.tied_beyond,
            "crs": self.crs.to_string(),
            "licenses": list(self.licenses),
            "candidates": listed.to_dict(orient="records"),
        }


class Shortlist:
    """The best `top` cells of a search, gathered from one part of a database after the other.

    `listed` holds them best first, equal distances in the order of columns and rows; `present` the
    class codes that some cell sees; `cells` how many cells were looked at.
    """

    def __init__(self, top: int) -> None:
        self.listed = pd.DataFrame()
        self.present: set[int] = set()
        self.cells = 0
        self._top = top
        # How many cells have each distance, up to that of the last listed one at least.
        self._sizes: Counter[float] = Counter()

    def add(self, database: SignatureDatabase, scores: NDArray[np.float32]) -> None:
        """Take the best cells of a part, given the distances of all its cells."""
        better, level = top_candidates(scores, min(self._top, len(scores)))
        better = better[np.argsort(scores[better], kind="stable")]
        cells = np.concatenate([better, level])
        values, sizes = np.unique(scores[cells], return_counts=True)
        self._sizes.update(dict(zip(values.tolist(), sizes.tolist(), strict=True)))
        cells = cells[: self._top]
        xy = database.xy[cells]
        part = pd.DataFrame(
            {
                "cell": cells,
                "cell_id": database.cell_ids[cells],
                "x": xy[:, 0],
                "y": xy[:, 1],
                "types": [database.types(cell) for cell in cells.tolist()],
                "length": database.lengths[cells],
                "distance": scores[cells].astype(np.float64),
            }
        )
        if self.cells:
            both = pd.concat([self.listed, part], ignore_index=True)
            part = both.sort_values(["distance", "cell_id"], ignore_index=True).head(self._top)
        self.listed = part
        self.present.update(database.present_codes.tolist())
        self.cells += len(database)

    def ranked(self) -> tuple[pd.DataFrame, int]:
        """Return the candidates and the number of ties beyond them, as in `Localization`."""
        values = np.array(sorted(self._sizes))
        sizes = np.array([self._sizes[value] for value in values.tolist()])
        place = np.searchsorted(values, self.listed["distance"].to_numpy())
        high, tied = np.cumsum(sizes)[place], sizes[place]
        ranks = pd.DataFrame({"rank_low": high - tied + 1, "rank_high": high, "tied": tied})
        return pd.concat([ranks, self.listed], axis=1), int(high[-1]) - len(self.listed)
