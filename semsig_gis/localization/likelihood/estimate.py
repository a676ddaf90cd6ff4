"""The mean place of an answer, and its uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from typing_extensions import TypedDict

from semsig_gis.core import Displayed, signed_degrees
from semsig_gis.localization.likelihood.association import score_associations
from semsig_gis.localization.likelihood.index import own_sigma
from semsig_gis.localization.likelihood.posterior import Refinement, holding
from semsig_gis.localization.noise.table import database_tables
from semsig_gis.observation import View

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization.likelihood.posterior import Posterior
    from semsig_gis.localization.noise.model import Noise

NEGLIGIBLE = 1e-4
"""Share of the chance near the answer in cells that are left out of a mean heading."""
ELLIPSE_STEPS = 72
HEADING_STEPS = (6.0, 4.0, 3.0, 2.0)  # degrees between the headings that are tried
STEP_DEVIATIONS = 1.5  # most deviations of the heading in a step; sums are then exact to 1e-3


class EllipseRecord(TypedDict):
    """Half axes in metres, and the bearing of the longer one."""

    longer: float
    shorter: float
    bearing: float


class EstimateRecord(TypedDict):
    """A place in metres and a heading in degrees, with their uncertainty."""

    x: float
    y: float
    sigma: float
    heading: float | None
    heading_sigma: float | None
    covariance: list[list[float]]
    ellipse_90: EllipseRecord
    refined: bool


@dataclass(frozen=True, eq=False, repr=False, slots=True, kw_only=True)
class PlaceEstimate(Displayed):
    """A mean place in metres and a heading, each with its uncertainty.

    `heading` is in degrees to add to the bearings of the query, in [-180, 180), or None if they are
    known. `covariance`, shape (3, 3), is of x, y (metres) and heading (degrees). `refined` is
    whether the place was searched between the viewpoints, not only by whole cells.
    """

    x: float
    y: float
    heading: float | None
    covariance: NDArray[np.float64]
    refined: bool

    def _facts(self) -> dict[str, object]:
        turned = self.heading is not None
        return {
            "place": f"{self.x:.1f}, {self.y:.1f}",
            "give or take": f"{self.sigma:.1f} m",
            "heading": f"{self.heading:.1f}° ±{self.heading_sigma:.1f}°" if turned else "known",
            "refined": "yes" if self.refined else "no",
        }

    @property
    def sigma(self) -> float:
        """Standard deviation of the place in metres: the root mean square of x and y."""
        return math.sqrt(float(self.covariance[0, 0] + self.covariance[1, 1]) / 2.0)

    @property
    def heading_sigma(self) -> float:
        """Standard deviation of the heading in degrees."""
        return math.sqrt(float(self.covariance[2, 2]))

    def ellipse(self, share: float = 0.9) -> tuple[float, float, float]:
        """Return the ellipse that contains a share of a normal distribution of this covariance.

        It is the longer and the shorter half axis in metres, and the bearing of the longer one in
        degrees clockwise from grid north, in [0, 180).
        """
        values, vectors = np.linalg.eigh(self.covariance[:2, :2])
        scale = math.sqrt(-2.0 * math.log(1.0 - share))
        shorter, longer = (scale * np.sqrt(np.maximum(values, 0.0))).tolist()
        bearing = math.degrees(math.atan2(*vectors[:, 1].tolist())) % 180.0
        return longer, shorter, bearing

    def outline(self, share: float = 0.9) -> NDArray[np.float64]:
        """Return points on that ellipse in metres, shape (n, 2); the last is the first again."""
        longer, shorter, bearing = self.ellipse(share)
        turn, angle = math.radians(bearing), np.linspace(0.0, 2.0 * np.pi, ELLIPSE_STEPS + 1)
        along, across = longer * np.cos(angle), shorter * np.sin(angle)
        x = self.x + along * math.sin(turn) + across * math.cos(turn)
        y = self.y + along * math.cos(turn) - across * math.sin(turn)
        return np.column_stack([x, y])

    def to_dict(self) -> EstimateRecord:
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
    posterior: Posterior,
    cell: int,
    *,
    radius: float,
    north_sigma: float = 0.0,
    turned: bool = True,
) -> PlaceEstimate:
    """Return the mean place within `radius` metres of a cell, from the chances of the cells.

    If the place may be in one of two streets, the mean is between them: it has the least mean
    squared error. The covariance includes ``step ** 2 / 12`` in each direction for the place in a
    cell. `north_sigma` is in degrees. If the query may be `turned`, headings are tried every few
    degrees in each cell.
    """
    database, chances = posterior.database, posterior.chances
    # The cells are ordered by column: all cells of the columns around are one slice.
    reach = math.ceil(radius / database.grid.step)
    ends = database.columns[cell] + np.array([-reach, reach + 1])
    near = np.arange(*np.searchsorted(database.columns, ends))
    away = np.subtract(database.xy_of(near), database.xy_of(cell))
    inside = near[np.hypot(away[:, 0], away[:, 1]) <= radius]
    view = View.of(query)
    photo = view.split()[0]
    north_sigma = own_sigma(photo, north_sigma)
    turned = turned and north_sigma > 0 and view.bearings is not None and len(view) > 0
    inside = inside[holding(chances[inside], NEGLIGIBLE if turned else 0.0)]
    headings = heading_sigmas = np.zeros(len(inside))
    if turned:
        turns = np.arange(-180.0, 180.0, _heading_step(database, noise, len(photo)))
        each = np.broadcast_to(turns, (len(inside), len(turns)))
        logs = score_associations(database, photo, noise, inside, turns=each)
        logs -= 0.5 * (turns / north_sigma) ** 2
        shares = np.exp(logs - np.logaddexp.reduce(logs, axis=1)[:, None])
        headings = np.degrees(np.angle(shares @ np.exp(1j * np.radians(turns))))
        off = signed_degrees(turns - headings[:, None])
        heading_sigmas = np.sqrt((shares * off**2).sum(axis=1) + HEADING_STEPS[-1] ** 2 / 12.0)
    parts = Refinement(
        cells=inside,
        places=database.xy_of(inside),
        sizes=np.full(len(inside), database.grid.step),
        loglik=np.zeros(len(inside)),
        headings=headings,
        heading_sigmas=heading_sigmas,
        chances=chances[inside],
        near=math.inf,
    )
    return _estimate(parts, turned=turned, refined=False)


def _heading_step(database: SignatureDatabase, noise: Noise, objects: int) -> float:
    """Return the widest step between headings for a photo with a number of objects."""
    tables, _ = database_tables(database, noise)
    sigma = min(
        math.hypot(table.sigma.min(), math.degrees(table.position_sigma / table.ranges.max()))
        for table in tables
    )
    most = STEP_DEVIATIONS * sigma / math.sqrt(objects)
    return next((step for step in HEADING_STEPS if step <= most), HEADING_STEPS[-1])


def refined_estimate(
    refinement: Refinement, xy: tuple[float, float], *, radius: float, turned: bool
) -> PlaceEstimate | None:
    """Return the mean place within `radius` metres of another, around the best part of a cell.

    It is None if no part is in the circle. `turned` is whether the heading was searched as well.
    """
    away = refinement.places - np.asarray(xy)
    inside = np.hypot(away[:, 0], away[:, 1]) <= radius
    chances = refinement.chances[inside]
    if not chances.sum() > 0:
        return None
    parts = replace(
        refinement,
        cells=refinement.cells[inside],
        places=refinement.places[inside],
        sizes=refinement.sizes[inside],
        loglik=refinement.loglik[inside],
        headings=refinement.headings[inside],
        heading_sigmas=refinement.heading_sigmas[inside],
        chances=chances / chances.sum(),
    )
    return _estimate(parts, turned=turned, refined=True)


def _estimate(parts: Refinement, *, turned: bool, refined: bool) -> PlaceEstimate:
    x, y = parts.xy
    heading = parts.heading if turned else None
    return PlaceEstimate(x=x, y=y, heading=heading, covariance=parts.covariance, refined=refined)
