"""Limits of who looks: a compass that is off, classes that are not known, a narrow view."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.errors import InputError
from semsig_gis.geometry import FULL_TURN, angular_distance

if TYPE_CHECKING:
    from semsig_gis.sight import CitySights, Sight, Spoiling

__all__ = ["CompassBias", "FieldOfView", "MissingClasses"]


@dataclass(frozen=True, slots=True, kw_only=True)
class CompassBias:
    """A compass that is off by the same angle for all objects of a query.

    The angle is normal, with a standard deviation of `sigma` degrees, 0 or more.
    """

    sigma: float = 10.0

    def __post_init__(self) -> None:  # noqa: D105
        if not (math.isfinite(self.sigma) and self.sigma >= 0):
            msg = (
                f"a compass that is off by {self.sigma!r} degrees was given; give a standard "
                "deviation, 0 or more."
            )
            raise InputError(msg)

    def ready(self, city: CitySights) -> Spoiling:  # noqa: ARG002 - all distortions take it
        """Return the function that distorts a query."""
        return lambda sight, rng: sight.turned(float(rng.normal(0.0, self.sigma)))


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingClasses:
    """A detector that does not know some classes of the city.

    With `others`, the named classes are the ones it knows, and all others are missing.
    """

    classes: tuple[str, ...] = ()
    others: bool = False

    def ready(self, city: CitySights) -> Spoiling:
        """Return the function that distorts a query.

        Raises UnknownNameError if the taxonomy of the city has no class of a name.
        """
        named = [city.taxonomy.by_name(name).code for name in self.classes]

        def spoil(sight: Sight, rng: np.random.Generator) -> Sight:  # noqa: ARG001
            return sight.only(np.isin(sight.codes, named, invert=not self.others))

        return spoil


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldOfView:
    """A camera that looks in one direction, drawn at random, and sees part of the turn.

    It sees `degrees`, above 0 and at most 360. Bearings are still counted from north; nothing tells
    which part of the turn was looked at.
    """

    degrees: float = 90.0

    def __post_init__(self) -> None:  # noqa: D105
        if not 0 < self.degrees <= FULL_TURN:
            msg = (
                f"a view of {self.degrees!r} degrees was given; give degrees above 0, at most 360."
            )
            raise InputError(msg)

    def ready(self, city: CitySights) -> Spoiling:  # noqa: ARG002 - all distortions take it
        """Return the function that distorts a query."""

        def spoil(sight: Sight, rng: np.random.Generator) -> Sight:
            aside = angular_distance(sight.bearings, rng.uniform(0.0, FULL_TURN))
            return sight.only(aside <= self.degrees / 2.0)

        return spoil
