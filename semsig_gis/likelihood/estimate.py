"""One place with its uncertainty, and the heading, from the chances of cells or of their parts."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.likelihood.refine import Refinement
from semsig_gis.likelihood.rerank import align_cells

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.core.signature import Signature
    from semsig_gis.likelihood.noise.model import Noise
    from semsig_gis.likelihood.posterior import Posterior

MOST_CELLS = 200
"""Likeliest cells near the answer that are averaged; the others hold next to nothing."""
TURN = 2.0  # degrees between the headings that are tried


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class PlaceEstimate:
    """A mean place in metres and a heading, each with its uncertainty.

    `heading` is in degrees to add to the bearings of the query, in [-180, 180), or None if they are
    known. `covariance`, shape (3, 3), is of x, y (metres) and heading (degrees). `refined` tells
    whether the place comes from between the viewpoints rather than from whole cells.
    """

    x: float
    y: float
    heading: float | None
    covariance: NDArray[np.float64]
    refined: bool

    @property
    def sigma(self) -> float:
        """Standard deviation of the place in metres, the root of the mean of both ways."""
        return math.sqrt(float(self.covariance[0, 0] + self.covariance[1, 1]) / 2.0)

    @property
    def heading_sigma(self) -> float:
        """Standard deviation of the heading in degrees."""
        return math.sqrt(float(self.covariance[2, 2]))

    def ellipse(self, share: float = 0.9) -> tuple[float, float, float]:
        """Return the ellipse that holds a share of a normal distribution of this covariance.

        It is the longer and the shorter half axis in metres, and the bearing of the longer one in
        degrees clockwise from grid north, in [0, 180).
        """
        values, vectors = np.linalg.eigh(self.covariance[:2, :2])
        scale = math.sqrt(-2.0 * math.log(1.0 - share))
        shorter, longer = (scale * np.sqrt(np.maximum(values, 0.0))).tolist()
        bearing = math.degrees(math.atan2(*vectors[:, 1].tolist())) % 180.0
        return longer, shorter, bearing

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; the covariance has two rows if the heading is known."""
        size = 2 if self.heading is None else 3
        longer, shorter, bearing = self.ellipse(0.9)
        return {
            "x": self.x,
            "y": self.y,
            "sigma": self.sigma,
            "heading": self.heading,
            "heading_sigma": None if self.heading is None else self.heading_sigma,
            "covariance": self.covariance[:size, :size].tolist(),
            "ellipse_90": {"longer": longer, "shorter": shorter, "bearing": bearing},
            "refined": self.refined,
        }


def cell_estimate(
    query: Signature,
    noise: Noise,
    found: Posterior,
    cell: int,
    *,
    radius: float,
    north_sigma: float = 0.0,
) -> PlaceEstimate:
    """Return the mean place within `radius` metres of a cell, from the chances of the cells.

    For a place in two streets at once the mean lies between them, as it has the least mean squared
    error. The covariance has ``step ** 2 / 12`` each way for the place in a cell. `north_sigma` is
    the standard deviation in degrees of the query's north: 0 if known, infinite if not known at
    all. Headings are tried every two degrees all round, cell by cell.
    """
    database = found.database
    away = database.xy - database.xy[cell]
    inside = np.flatnonzero((np.hypot(away[:, 0], away[:, 1]) <= radius) & (found.chances > 0))
    inside = inside[np.argsort(-found.chances[inside], kind="stable")[:MOST_CELLS]]
    headings = sigmas = np.zeros(len(inside))
    turned = north_sigma > 0 and query.bearings is not None and len(query) > 0
    if turned:
        headings, sigmas = _headings(query, noise, found, inside, north_sigma)
    parts = Refinement(
        places=database.xy[inside],
        sizes=np.full(len(inside), database.grid.step),
        loglik=np.zeros(len(inside)),
        headings=headings,
        heading_sigmas=sigmas,
        chances=found.chances[inside],
        near=math.inf,
    )
    return _estimate(parts, turned=turned, refined=False)


def refined_estimate(
    found: Refinement, xy: tuple[float, float], *, radius: float, turned: bool
) -> PlaceEstimate | None:
    """Return the best place within `radius` metres of another, from the chances of parts of cells.

    It is the mean over what is near the best part, or None if no part is in the circle. `turned`
    tells whether the heading was looked for, too.
    """
    away = found.places - np.asarray(xy)
    inside = np.hypot(away[:, 0], away[:, 1]) <= radius
    if not found.chances[inside].sum() > 0:
        return None
    parts = replace(
        found,
        places=found.places[inside],
        sizes=found.sizes[inside],
        loglik=found.loglik[inside],
        headings=found.headings[inside],
        heading_sigmas=found.heading_sigmas[inside],
        chances=found.chances[inside] / found.chances[inside].sum(),
    )
    return _estimate(parts, turned=turned, refined=True)


def _estimate(parts: Refinement, *, turned: bool, refined: bool) -> PlaceEstimate:
    x, y = parts.xy
    heading = parts.heading if turned else None
    return PlaceEstimate(x=x, y=y, heading=heading, covariance=parts.covariance, refined=refined)


def _headings(
    query: Signature,
    noise: Noise,
    found: Posterior,
    cells: NDArray[np.int64],
    north_sigma: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean heading in each cell and its standard deviation, in degrees."""
    turns = np.arange(-180.0, 180.0, TURN)
    each = np.broadcast_to(turns, (len(cells), len(turns)))
    logs = align_cells(found.database, query, noise, cells, turns=each)
    logs -= 0.5 * (turns / north_sigma) ** 2
    shares = np.exp(logs - np.logaddexp.reduce(logs, axis=1)[:, None])
    means = np.degrees(np.angle(shares @ np.exp(1j * np.radians(turns))))
    away = (turns - means[:, None] + 180.0) % 360.0 - 180.0
    return means, np.sqrt((shares * away**2).sum(axis=1) + TURN**2 / 12.0)
