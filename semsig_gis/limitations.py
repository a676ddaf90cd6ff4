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

    Parameters
    ----------
    sigma : float, default 10.0
        Standard deviation of that angle in degrees; 0 or more.

    Raises
    ------
    InputError
        If it is out of range.

    Examples
    --------
    >>> CompassBias(sigma=-1.0)
    Traceback (most recent call last):
    ...
    semsig_gis.errors.InputError: a compass that is off by -1.0 degrees was given; give a standard
    deviation, 0 or more.
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
        """Return what is done to a query.

        Parameters
        ----------
        city : CitySights
            What there is to see in the city.

        Returns
        -------
        callable
            From what is seen and a generator to what seems to be seen.
        """
        return lambda sight, rng: sight.turned(float(rng.normal(0.0, self.sigma)))


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingClasses:
    """A detector that does not know some classes of the city.

    Parameters
    ----------
    classes : tuple of str, default ()
        Their names.
    others : bool, default False
        Whether the classes are those that it knows, and all others are missing.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.sight import CitySights
    >>> city = CitySights(
    ...     taxonomy=paper_taxonomy(), codes=np.array([3], np.uint8),
    ...     frequencies=np.array([9]), reach=30.0,
    ... )
    >>> MissingClasses(classes=("benc",)).ready(city)
    Traceback (most recent call last):
    ...
    semsig_gis.errors.UnknownNameError: class 'benc' is unknown; the nearest is 'bench';
    the classes are alignment_tree, water_fountain, street_light, indicator, traffic_light,
    bike_station, automatic_wc, car_station, taxi_station, bench, bus_stop.
    """

    classes: tuple[str, ...] = ()
    others: bool = False

    def ready(self, city: CitySights) -> Spoiling:
        """Return what is done to a query.

        Parameters
        ----------
        city : CitySights
            Its taxonomy has the classes.

        Returns
        -------
        callable
            From what is seen and a generator to what seems to be seen.

        Raises
        ------
        UnknownNameError
            If the city has no class of a name.
        """
        named = [city.taxonomy.by_name(name).code for name in self.classes]

        def spoil(sight: Sight, rng: np.random.Generator) -> Sight:  # noqa: ARG001
            return sight.only(np.isin(sight.codes, named, invert=not self.others))

        return spoil


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldOfView:
    """A camera that looks in one direction, any with equal chance, not all round.

    Parameters
    ----------
    degrees : float, default 90.0
        How much of the turn it sees, above 0 and at most 360.

    Raises
    ------
    InputError
        If it is out of range.

    Notes
    -----
    The bearings are still counted from north; nothing tells which part of the turn was looked at.

    Examples
    --------
    >>> FieldOfView(degrees=400.0)
    Traceback (most recent call last):
    ...
    semsig_gis.errors.InputError: a view of 400.0 degrees was given; give degrees above 0, at most
    360.
    """

    degrees: float = 90.0

    def __post_init__(self) -> None:  # noqa: D105
        if not 0 < self.degrees <= FULL_TURN:
            msg = (
                f"a view of {self.degrees!r} degrees was given; give degrees above 0, at most 360."
            )
            raise InputError(msg)

    def ready(self, city: CitySights) -> Spoiling:  # noqa: ARG002 - all distortions take it
        """Return what is done to a query.

        Parameters
        ----------
        city : CitySights
            What there is to see in the city.

        Returns
        -------
        callable
            From what is seen and a generator to what seems to be seen.
        """

        def spoil(sight: Sight, rng: np.random.Generator) -> Sight:
            aside = angular_distance(sight.bearings, rng.uniform(0.0, FULL_TURN))
            return sight.only(aside <= self.degrees / 2.0)

        return spoil
