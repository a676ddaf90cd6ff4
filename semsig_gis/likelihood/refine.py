"""Look for the place of a query between the viewpoints, part by part of the likeliest cells.

A part of side s counts with an uncertainty of the place of ``s / 12 ** 0.5`` each way, the
deviation of places anywhere in it, so that its likelihood stands for the mean over the part.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.core.geometry import signed_degrees
from semsig_gis.database.visibility import views_at
from semsig_gis.likelihood.association import turn_logs
from semsig_gis.likelihood.index import check_north
from semsig_gis.likelihood.noise.table import LONGEST_TABLE, noise_tables, place_loglik

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.core.rtree import ObjectIndex, StoredIndex
    from semsig_gis.core.signature import Signature
    from semsig_gis.database.occlusion import Footprints
    from semsig_gis.likelihood.noise.model import Noise
    from semsig_gis.objects.table import StreetObjects

KEPT = (1000, 400, 200, 100)
"""How many parts are divided, level by level: cells, their quarters, and so on."""
LEAST_CHANCE = 1e-6  # of a part, against the likeliest, to be divided
TURNS = (7.5, 6.0, 4.5, 3.0)  # degrees to each side that are tried, level by level
TURNS_A_SIDE = 3
NEAR = 25.0  # metres from the best place that are averaged over
BEST = 300  # likeliest parts among which the best place is looked for
CORNERS = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])


@dataclass(frozen=True, eq=False, kw_only=True)
class Refinement:
    """The chances of places on and off the grid.

    By square part of a cell: `places`, shape (p, 2), its middle in metres; `sizes`, the length of
    its sides; `loglik`, the mean over the part; `headings`, the mean degrees to add to the bearings
    of the query (0 if north is known), with `heading_sigmas`; and `chances`, which sum to one. The
    best place is averaged over `near` metres around it.
    """

    places: NDArray[np.float64]
    sizes: NDArray[np.float64]
    loglik: NDArray[np.float64]
    headings: NDArray[np.float64]
    heading_sigmas: NDArray[np.float64]
    chances: NDArray[np.float64]
    near: float

    @property
    def mass(self) -> float:
        """Chance that the place is within `near` of the best one."""
        return float(self.chances[self._inside].sum())

    @cached_property
    def xy(self) -> tuple[float, float]:
        """The mean place around the best one, in metres."""
        inside = self._inside
        x, y = np.average(self.places[inside], axis=0, weights=self.chances[inside]).tolist()
        return x, y

    @cached_property
    def heading(self) -> float:
        """Degrees to add to the bearings of the query there, in [-180, 180)."""
        angles = np.radians(self.headings[self._inside])
        mean = np.exp(1j * angles) @ self.chances[self._inside]
        return float(signed_degrees(math.degrees(float(np.angle(mean)))))

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Of x, y (metres) and heading (degrees) around the best place, shape (3, 3)."""
        inside = self._inside
        weights = self.chances[inside] / self.chances[inside].sum()
        turned = signed_degrees(self.headings[inside] - self.heading)
        away = np.column_stack([self.places[inside] - self.xy, turned])
        covariance = (weights[:, None] * away).T @ away
        # The place may be anywhere in a part.
        covariance[[0, 1], [0, 1]] += weights @ self.sizes[inside] ** 2 / 12.0
        covariance[2, 2] += weights @ self.heading_sigmas[inside] ** 2
        return np.asarray(covariance)

    @cached_property
    def _inside(self) -> NDArray[np.bool_]:
        """Which parts are near the one around which most of the chance lies."""
        order = np.argsort(-self.chances, kind="stable")[:BEST]
        away = self.places[order, None] - self.places[None]
        inside = np.hypot(away[..., 0], away[..., 1]) <= self.near
        return np.asarray(inside[np.round(inside @ self.chances, 9).argmax()])


def refine(
    query: Signature,
    cells: NDArray[np.float64],
    noise: Noise,
    *,
    objects: StreetObjects,
    index: ObjectIndex | StoredIndex,
    step: float = 10.0,
    radius: float = 30.0,
    north_sigma: float = 0.0,
    headings: NDArray[np.floating] | None = None,
    log_prior: NDArray[np.float64] | None = None,
    footprints: Footprints | None = None,
) -> Refinement:
    """Look for the place of a query within some cells; chances are likelihood times area.

    The query needs bearings; its types may be unknown. `cells`, shape (c, 2), are the middles in
    metres of the likeliest cells, likeliest first; some hundred will do. `noise` is for a known
    place. `step` and `radius` are in metres, `north_sigma` in degrees; where it is not 0,
    `headings`, the likeliest one in each cell, are needed. `log_prior` is what else is known of the
    cells.
    """
    check_north(north_sigma)
    if len(cells) == 0 or (headings is None and north_sigma > 0):
        msg = (
            f"{len(cells)} cells and {'no' if headings is None else 'some'} headings were given; "
            "give at least one cell, and headings where north is not known."
        )
        raise InputError(msg)
    tables, weights = noise_tables(
        noise, taxonomy=objects.taxonomy, codes=np.unique(objects.codes), longest=LONGEST_TABLE
    )
    reach = float(objects.taxonomy.ranges(radius).max())
    size = float(step)
    parts = np.asarray(cells[: KEPT[0]], dtype=np.float64)
    prior = np.zeros(len(parts)) if log_prior is None else np.asarray(log_prior)[: KEPT[0]]
    turned = np.zeros(len(parts)) if headings is None else np.asarray(headings)[: KEPT[0]]
    finished: list[tuple[NDArray[np.float64], ...]] = []
    for level, turn in enumerate(TURNS):
        parts = (parts[:, None] + CORNERS * (size / 4.0)).reshape(-1, 2)
        prior, turned = np.repeat(prior, 4), np.repeat(turned, 4)
        size /= 2.0
        views = views_at(objects, parts, index=index, radius=radius, footprints=footprints)
        wide = [
            replace(table, position_sigma=math.hypot(table.position_sigma, size / math.sqrt(12.0)))
            for table in tables
        ]
        steps = np.linspace(-turn, turn, 2 * TURNS_A_SIDE + 1) if north_sigma > 0 else np.zeros(1)
        turns = turned[:, None] + steps
        by_turn = place_loglik(query, views, wide, weights, turns=turns, reach=reach)
        if north_sigma > 0:
            by_turn += turn_logs(turns, steps[1] - steps[0], north_sigma)
        loglik = np.logaddexp.reduce(by_turn, axis=1)
        shares = np.exp(by_turn - loglik[:, None])
        turned = (shares * turns).sum(axis=1)
        sigmas = np.sqrt((shares * (turns - turned[:, None]) ** 2).sum(axis=1))
        total = loglik + prior
        divided = np.zeros(len(parts), np.bool_)
        if level + 1 < len(TURNS):
            best = np.argsort(-total, kind="stable")[: KEPT[level + 1]]
            divided[best] = total[best] > total[best[0]] + math.log(LEAST_CHANCE)
        columns = parts, np.full(len(parts), size), loglik, prior, turned, sigmas
        finished.append(tuple(column[~divided] for column in columns))
        parts, prior, turned = parts[divided], prior[divided], turned[divided]
    places, sizes, loglik, prior, turned, sigmas = map(np.concatenate, zip(*finished, strict=True))
    weight = loglik + prior + 2.0 * np.log(sizes)
    chances = np.exp(weight - weight.max())
    return Refinement(
        places=places,
        sizes=sizes,
        loglik=loglik,
        headings=signed_degrees(turned),
        heading_sigmas=sigmas,
        chances=chances / chances.sum(),
        near=NEAR,
    )
