"""The answer of the likelihood method: chances, a place with its region, or "cannot tell"."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
from pyproj import Transformer

from semsig_gis.core.grid import cell_ids

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from semsig_gis.core.signature import Signature
    from semsig_gis.likelihood.answer_rule import Answer, AnswerRule
    from semsig_gis.likelihood.estimate import PlaceEstimate
    from semsig_gis.likelihood.explain import Explanation
    from semsig_gis.likelihood.posterior import Posterior

REGION_SHARE = 0.9
"""Of the chance, that the region holds."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Location:
    """The answer of the likelihood method to a query.

    Parameters
    ----------
    query : Signature
        What was searched for.
    noise : str
        Name of the noise model.
    candidates : DataFrame
        One row a cell, likeliest first: ``rank`` (from 1), ``cell`` (row in the database),
        ``cell_id``, ``x`` and ``y`` (viewpoint, CRS of the database), ``types`` (symbols),
        ``length`` (objects), ``loglik`` (natural logarithm of the likelihood), ``chance`` and,
        where north was not known for sure, ``heading`` (degrees to add to the bearings of the
        query).
    answer : Answer
        The cell around which the chance is largest, that chance, and whether it is enough for an
        answer.
    estimate : PlaceEstimate
        The place around that cell and the heading, each with its uncertainty: what to take for
        the place if it is there.
    rule : AnswerRule
        What the decision rests on.
    region : ndarray of int64
        Row numbers of the fewest cells that hold 90 % of the chance, likeliest first.
    posterior : Posterior
        The chance of every cell.
    loglik : ndarray of float, shape (n,)
        Natural logarithm of the likelihood of every cell.
    explanations : tuple of Explanation
        Of the first candidates, in their order: which detections are which street objects.
    """

    query: Signature
    noise: str
    candidates: pd.DataFrame
    answer: Answer
    estimate: PlaceEstimate
    rule: AnswerRule
    region: NDArray[np.int64]
    posterior: Posterior
    loglik: NDArray[np.floating]
    explanations: tuple[Explanation, ...] = ()

    @property
    def region_km2(self) -> float:
        """Area of the cells of the region in square kilometres."""
        return len(self.region) * self.posterior.database.grid.step**2 / 1e6

    @property
    def cell_id(self) -> int:
        """Id of the grid cell in which the estimated place is; a database may lack it."""
        estimate = np.array([[self.estimate.x, self.estimate.y]])
        return int(cell_ids(*self.posterior.database.grid.cells_at(estimate))[0])

    def to_geodataframe(self) -> gpd.GeoDataFrame:
        """Return the candidates with their viewpoints as points in the CRS of the database.

        Returns
        -------
        GeoDataFrame
            The columns of `candidates` and ``geometry``.
        """
        points = gpd.points_from_xy(self.candidates["x"], self.candidates["y"])
        crs = self.posterior.database.crs
        return gpd.GeoDataFrame(self.candidates.copy(), geometry=points, crs=crs)

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the chances of all cells as plain values that JSON can hold.

        Returns
        -------
        dict
            ``query``, ``noise``, ``cells``, ``answered``, ``place`` (what
            `PlaceEstimate.to_dict` gives, its ``cell_id``, ``lon``, ``lat``, ``chance`` and
            ``within_m``), ``threshold`` (None where nothing is answered), ``region`` (``share``,
            ``cells``, ``km2``), ``entropy_bits``, ``crs``, ``licenses``, and ``candidates``, a
            list with the columns of `candidates`, ``lon``, ``lat`` (degrees, WGS 84) and, of the
            first ones, ``explanation``.
        """
        database = self.posterior.database
        to_degrees = Transformer.from_crs(database.crs, "EPSG:4326", always_xy=True)
        place = to_degrees.transform(self.estimate.x, self.estimate.y)
        lon, lat = to_degrees.transform(
            self.candidates["x"].to_numpy(), self.candidates["y"].to_numpy()
        )
        listed = self.candidates.assign(lon=np.round(lon, 7), lat=np.round(lat, 7))
        candidates = listed.to_dict(orient="records")
        for candidate, why in zip(candidates, self.explanations, strict=False):
            candidate["explanation"] = why.to_dict()
        threshold = self.rule.threshold
        return {
            "query": self.query.to_dict(database.taxonomy),
            "noise": self.noise,
            "cells": len(database),
            "answered": self.answer.given,
            "place": {
                "cell_id": self.cell_id,
                **self.estimate.to_dict(),
                "lon": round(place[0], 7),
                "lat": round(place[1], 7),
                "chance": self.answer.mass,
                "within_m": self.rule.radius,
            },
            "threshold": threshold if math.isfinite(threshold) else None,
            "region": {
                "share": REGION_SHARE,
                "cells": len(self.region),
                "km2": self.region_km2,
            },
            "entropy_bits": self.posterior.entropy,
            "crs": database.crs.to_string(),
            "licenses": list(database.licenses),
            "candidates": candidates,
        }
