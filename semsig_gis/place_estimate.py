"""One place with its uncertainty, and the heading, from the chances of cells or of their parts."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.alignment import align_cells
from semsig_gis.refinement import Refinement

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.noise import Noise
    from semsig_gis.posterior import Posterior
    from semsig_gis.signatures import Signature

__all__ = ["PlaceEstimate", "cell_estimate", "refined_estimate"]

MOST_CELLS = 200
"""Likeliest cells near the answer that are averaged; the others hold next to nothing."""
TURN = 2.0  # degrees between the headings that are tried


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class PlaceEstimate:
    """A place and a heading, each with its uncertainty.

    Parameters
    ----------
    x, y : float
        The mean place in metres.
    heading : float or None
        Degrees to add to the bearings of the query, in [-180, 180); None where they are known.
    covariance : ndarray of float64, shape (3, 3)
        Of x, y (metres) and heading (degrees).
    refined : bool
        Whether the place is from between the viewpoints, not from whole cells alone.

    Examples
    --------
    >>> found = PlaceEstimate(
    ...     x=0.0, y=0.0, heading=None, covariance=np.diag([4.0, 1.0, 0.0]), refined=True
    ... )
    >>> [round(part, 2) for part in found.ellipse(0.9)]
    [4.29, 2.15, 90.0]
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

        Parameters
        ----------
        share : float, default 0.9
            Above 0, below 1.

        Returns
        -------
        longer, shorter : float
            Half axes in metres.
        bearing : float
            Degrees clockwise from grid north of the longer one, in [0, 180).
        """
        values, vectors = np.linalg.eigh(self.covariance[:2, :2])
        scale = math.sqrt(-2.0 * math.log(1.0 - share))
        shorter, longer = (scale * np.sqrt(np.maximum(values, 0.0))).tolist()
        bearing = math.degrees(math.atan2(*vectors[:, 1].tolist())) % 180.0
        return longer, shorter, bearing

    def to_dict(self) -> dict[str, Any]:
        """Return the estimate as plain values, ready for JSON.

        Returns
        -------
        dict
            The fields; the covariance with two rows where the heading is known.
        """
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
    """Return the mean place around a cell, from the chances of the cells.

    Parameters
    ----------
    query : Signature
        What was seen.
    noise : NoiseSpec or NoiseMixture
        The noise model.
    found : Posterior
        The chances.
    cell : int
        Row number of the cell around which the place lies.
    radius : float
        Metres around it over which is averaged.
    north_sigma : float, default 0
        Standard deviation in degrees of the north of the query: 0 where it is known, infinite
        where it is not known at all.

    Returns
    -------
    PlaceEstimate
        The mean. The covariance has ``step ** 2 / 12`` each way for the place in a cell.

    Notes
    -----
    Of a place in two streets at once the mean is between them; it is the place that is least far
    off in the mean square. The chances of the headings are worked out in steps of two degrees
    round the whole turn, cell by cell.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.noise import NoiseSpec
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.posterior import posterior
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> sure = posterior(database, np.where(np.arange(len(database)) == 7, 0.0, -99.0))
    >>> place = cell_estimate(database.signature(7), NoiseSpec(), sure, 7, radius=50.0)
    >>> [place.x, place.y] == database.xy[7].tolist(), round(place.sigma, 3)
    (True, 2.887)
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
    """Return the best place around another one, from the chances of the parts of cells.

    Parameters
    ----------
    found : Refinement
        The chances.
    xy : tuple of float
        The viewpoint of the answer in metres.
    radius : float
        Metres around it in which the best place is looked for.
    turned : bool
        Whether the heading was looked for, too.

    Returns
    -------
    PlaceEstimate or None
        The mean over what is near the best part; None where no part is in the circle.

    Examples
    --------
    >>> parts = Refinement(
    ...     places=np.array([[0.0, 0.0], [2.0, 0.0], [90.0, 0.0]]), sizes=np.full(3, 2.0),
    ...     loglik=np.zeros(3), headings=np.zeros(3), heading_sigmas=np.zeros(3),
    ...     chances=np.array([0.2, 0.2, 0.6]), near=25.0,
    ... )
    >>> refined_estimate(parts, (5.0, 0.0), radius=50.0, turned=False).x
    1.0
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
