"""Legs: the displacements between the places of a route."""

from __future__ import annotations

import math
from dataclasses import dataclass

from semsig_gis.core import MOST_METRES, require_number

MOST_SIGMA_M = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    """The displacement from one place of a route to the next.

    Parameters
    ----------
    dx, dy : float
        Metres to grid east and grid north, at most 1,000,000 each way, or InputError.
    sigma : float, default 0
        Standard deviation of each of them, in metres; 0 to 1000, or InputError.

    Examples
    --------
    >>> Leg.towards(90.0, 20.0).dx
    20.0
    """

    dx: float
    dy: float
    sigma: float = 0.0

    def __post_init__(self) -> None:  # noqa: D105
        for value in (self.dx, self.dy):
            require_number("leg", value, least=-MOST_METRES, most=MOST_METRES, unit="metres")
        require_number("deviation of a leg", self.sigma, least=0, most=MOST_SIGMA_M, unit="metres")

    @classmethod
    def towards(cls, bearing: float, distance: float, *, sigma: float = 0.0) -> Leg:
        """Return a leg of a length in metres, `bearing` degrees clockwise from grid north."""
        angle = math.radians(bearing)
        return cls(dx=distance * math.sin(angle), dy=distance * math.cos(angle), sigma=sigma)
