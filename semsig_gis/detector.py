"""A detector that fails as a noise model says, and worse the farther things are.

The likelihood method rests on a noise model; here queries are drawn from one. Drawn from the model
that the method has, they show the method at its best and its chances must come true; drawn from
another, they show what a wrong model costs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.errors import InputError
from semsig_gis.geometry import FULL_TURN, bearings, wrap_degrees
from semsig_gis.noise_table import LONGEST_TABLE, noise_tables

if TYPE_CHECKING:
    from semsig_gis.noise import Noise
    from semsig_gis.noise_table import NoiseTable
    from semsig_gis.sight import CitySights, Sight, Spoiling

__all__ = ["Detector"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Detector:
    """A detector that fails as a noise model says.

    An object at distance d metres is detected with chance ``p * 2 ** -((d / half) ** 2)``, where p
    is that of the model: at `half` metres (above 0) only half of the objects are left. False
    objects come as a Poisson number a class. An uncertain place of the model (``position_sigma``)
    is a step aside of the observer, which turns the bearings of near objects most. Of a mixture,
    one model is drawn for each query. The chances are those of `semsig_gis.noise_table`, with which
    the likelihood method computes: none is quite 0 or 1.
    """

    noise: Noise
    half: float = math.inf

    def __post_init__(self) -> None:  # noqa: D105
        if not self.half > 0:
            msg = (
                f"a detector that sees half at {self.half!r} m was given; give metres above 0, or "
                "infinity where distance does not matter."
            )
            raise InputError(msg)

    def ready(self, city: CitySights) -> Spoiling:
        """Return the function that distorts a query.

        Raises InputError if the noise model names a class that the city does not have.
        """
        tables, weights = noise_tables(
            self.noise, taxonomy=city.taxonomy, codes=city.codes, longest=LONGEST_TABLE
        )

        def spoil(sight: Sight, rng: np.random.Generator) -> Sight:
            table = tables[int(rng.choice(len(tables), p=weights))]
            moved = _from_aside(sight, table.position_sigma, rng)
            return _with_false(self._detected(moved, table, rng), table, city, rng).clockwise()

        return spoil

    def _detected(self, sight: Sight, table: NoiseTable, rng: np.random.Generator) -> Sight:
        """Return the objects that are detected, under the names and bearings they are given."""
        length = min(len(sight), len(table.missed) - 1)
        chances = 1.0 - table.missed[length, table.row_of[sight.codes]]
        chances *= np.exp2(-((sight.distances / self.half) ** 2))
        found = sight.only(rng.random(len(sight)) < chances)
        kinds = table.row_of[found.codes]
        names = np.cumsum(table.named[length, kinds], axis=1)
        given = (rng.random(len(found))[:, None] * names[:, -1:] >= names).sum(axis=1)
        off = rng.normal(0.0, table.sigma[kinds])
        return replace(found, codes=table.codes[given], bearings=wrap_degrees(found.bearings + off))


def _from_aside(sight: Sight, sigma: float, rng: np.random.Generator) -> Sight:
    """Return what is seen a step aside."""
    if not sigma:
        return sight
    turned = np.radians(sight.bearings)
    dx, dy = rng.normal(0.0, sigma, 2)
    x = sight.distances * np.sin(turned) - dx
    y = sight.distances * np.cos(turned) - dy
    return replace(sight, bearings=bearings(x, y), distances=np.hypot(x, y))


def _with_false(
    sight: Sight, table: NoiseTable, city: CitySights, rng: np.random.Generator
) -> Sight:
    """Return the objects and the false ones after them."""
    codes = np.repeat(table.codes, rng.poisson(table.clutter))
    return replace(
        sight,
        codes=np.concatenate([sight.codes, codes]),
        bearings=np.concatenate([sight.bearings, rng.uniform(0.0, FULL_TURN, len(codes))]),
        distances=np.concatenate([sight.distances, city.false_distances(len(codes), rng)]),
    )
