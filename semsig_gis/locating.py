"""Where a query was seen from: chances, a place with its region, or "cannot tell".

The steps of the likelihood method in one call: score every cell by the index, re-rank the best
by one-to-one associations, turn the scores into chances, and decide whether to answer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
from pyproj import Transformer

from semsig_gis.abstention import AnswerRule
from semsig_gis.alignment import rerank
from semsig_gis.errors import InputError
from semsig_gis.posterior import posterior

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.abstention import Answer
    from semsig_gis.likelihood import LikelihoodIndex
    from semsig_gis.posterior import Posterior
    from semsig_gis.signatures import Signature

__all__ = ["DEFAULT_RULE", "Location", "locate"]

REGION_SHARE = 0.9
DEFAULT_RULE = AnswerRule(threshold=0.9)
"""Answer where the place is within 50 m of the best one with a chance of 0.9 by the model."""


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
        The place around which the chance is largest, and whether it is given as the answer.
    rule : AnswerRule
        What the decision rests on.
    region : ndarray of int64
        Row numbers of the fewest cells that hold 90 % of the chance, likeliest first.
    posterior : Posterior
        The chance of every cell.
    """

    query: Signature
    noise: str
    candidates: pd.DataFrame
    answer: Answer
    rule: AnswerRule
    region: NDArray[np.int64]
    posterior: Posterior

    @property
    def region_km2(self) -> float:
        """Area of the cells of the region in square kilometres."""
        return len(self.region) * self.posterior.database.grid.step**2 / 1e6

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
            ``query``, ``noise``, ``cells``, ``answered``, ``place`` (``cell_id``, ``x``, ``y``,
            ``lon``, ``lat``, ``chance`` and ``within_m``), ``threshold``, ``region`` (``share``,
            ``cells``, ``km2``), ``entropy_bits``, ``crs``, ``licenses`` and ``candidates``, a
            list with the columns of `candidates` and ``lon``, ``lat`` (degrees, WGS 84).
        """
        database = self.posterior.database
        to_degrees = Transformer.from_crs(database.crs, "EPSG:4326", always_xy=True)
        place = to_degrees.transform(self.answer.x, self.answer.y)
        lon, lat = to_degrees.transform(
            self.candidates["x"].to_numpy(), self.candidates["y"].to_numpy()
        )
        listed = self.candidates.assign(lon=np.round(lon, 7), lat=np.round(lat, 7))
        return {
            "query": self.query.to_dict(database.taxonomy),
            "noise": self.noise,
            "cells": len(database),
            "answered": self.answer.given,
            "place": {
                "cell_id": int(database.cell_ids[self.answer.cell]),
                "x": self.answer.x,
                "y": self.answer.y,
                "lon": round(place[0], 7),
                "lat": round(place[1], 7),
                "chance": self.answer.mass,
                "within_m": self.rule.radius,
            },
            "threshold": self.rule.threshold,
            "region": {
                "share": REGION_SHARE,
                "cells": len(self.region),
                "km2": self.region_km2,
            },
            "entropy_bits": self.posterior.entropy,
            "crs": database.crs.to_string(),
            "licenses": list(database.licenses),
            "candidates": listed.to_dict(orient="records"),
        }


def locate(
    index: LikelihoodIndex,
    query: Signature,
    *,
    north_sigma: float = 0.0,
    log_prior: NDArray[np.float64] | None = None,
    rule: AnswerRule = DEFAULT_RULE,
    top: int = 10,
) -> Location:
    """Find where a query was seen from, by likelihood.

    Parameters
    ----------
    index : LikelihoodIndex
        The cells and the noise model.
    query : Signature
        At least one object; types or bearings may be unknown.
    north_sigma : float, default 0
        Standard deviation in degrees of the north of the query: 0 where it is known, infinite
        where it is not known at all.
    log_prior : ndarray of float64, shape (n,), optional
        What else is known of the place (see `semsig_gis.priors`).
    rule : AnswerRule, optional
        When to answer; from a chance of 0.9 by default.
    top : int, default 10
        How many cells to list, at least 1.

    Returns
    -------
    Location
        The answer.

    Raises
    ------
    InputError
        If the query is empty or has a class that no cell sees, or a number is out of its range.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.likelihood import build_index
    >>> from semsig_gis.noise import named_noise
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> index = build_index(database, named_noise("generic"))
    >>> longest = int(database.lengths.argmax())
    >>> found = locate(index, database.signature(longest), top=3)
    >>> int(found.candidates["cell"][0]) == longest, len(found.candidates)
    (True, 3)
    """
    if top < 1:
        msg = f"{top} candidates were asked for; give a whole number from 1."
        raise InputError(msg)
    database = index.database
    scores = index.scores(query, north_sigma=north_sigma)
    scores = rerank(index, query, scores, north_sigma=north_sigma, log_prior=log_prior)
    found = posterior(database, scores.loglik, log_prior=log_prior)
    count = min(top, len(database))
    likely = np.argpartition(-found.chances, count - 1)[:count]
    listed = likely[np.lexsort((likely, -found.chances[likely]))]
    xy = database.xy[listed]
    columns = {
        "rank": np.arange(1, count + 1),
        "cell": listed,
        "cell_id": database.cell_ids[listed],
        "x": xy[:, 0],
        "y": xy[:, 1],
        "types": [database.types(cell) for cell in listed.tolist()],
        "length": database.lengths[listed],
        "loglik": scores.loglik[listed].astype(np.float64),
        "chance": found.chances[listed],
    }
    if scores.heading is not None:
        columns["heading"] = scores.heading[listed].astype(np.float64)
    return Location(
        query=query,
        noise=index.noise.name,
        candidates=pd.DataFrame(columns),
        answer=rule.decide(found),
        rule=rule,
        region=found.credible_cells(REGION_SHARE),
        posterior=found,
    )
