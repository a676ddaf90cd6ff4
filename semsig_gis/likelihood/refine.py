"""The likelihood of a query at places anywhere, summed over one-to-one associations."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.core.geometry import signed_degrees
from semsig_gis.database.visibility import views_at
from semsig_gis.likelihood.association import place_loglik, turn_logs
from semsig_gis.likelihood.noise.table import LONGEST_TABLE, noise_tables

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.core.rtree import ObjectIndex, StoredIndex
    from semsig_gis.core.signature import Signature
    from semsig_gis.database.occlusion import Footprints
    from semsig_gis.likelihood.noise.model import Noise
    from semsig_gis.likelihood.noise.table import NoiseTable
    from semsig_gis.objects.table import StreetObjects


KEPT = (1000, 400, 200, 100)
"""How many parts are divided, level by level: cells, their quarters, and so on."""


LEAST_CHANCE = 1e-6  # of a part, against the likeliest, to be divided


TURNS = (7.5, 6.0, 4.5, 3.0)  # degrees to each side that are tried, level by level


TURNS_A_SIDE = 3


ROUNDING = 1e-6  # square metres


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
    def best(self) -> int:
        """The part around which most of the chance lies."""
        return self._around()[0]

    @property
    def mass(self) -> float:
        """Chance that the place is within `near` of the best one."""
        _, inside = self._around()
        return float(self.chances[inside].sum())

    @property
    def xy(self) -> tuple[float, float]:
        """The mean place around the best one, in metres."""
        _, inside = self._around()
        x, y = np.average(self.places[inside], axis=0, weights=self.chances[inside]).tolist()
        return x, y

    @property
    def heading(self) -> float:
        """Degrees to add to the bearings of the query there, in [-180, 180)."""
        _, inside = self._around()
        angles = np.radians(self.headings[inside])
        mean = np.exp(1j * angles) @ self.chances[inside]
        return float(signed_degrees(math.degrees(float(np.angle(mean)))))

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Of x, y (metres) and heading (degrees) around the best place, shape (3, 3)."""
        _, inside = self._around()
        weights = self.chances[inside] / self.chances[inside].sum()
        turned = signed_degrees(self.headings[inside] - self.heading)
        away = np.column_stack([self.places[inside] - self.xy, turned])
        covariance = (weights[:, None] * away).T @ away
        # The place may be anywhere in a part.
        covariance[[0, 1], [0, 1]] += weights @ self.sizes[inside] ** 2 / 12.0
        covariance[2, 2] += weights @ self.heading_sigmas[inside] ** 2
        return np.asarray(covariance)

    def _around(self) -> tuple[int, NDArray[np.bool_]]:
        """Return the best part, and which parts are near it."""
        order = np.argsort(-self.chances, kind="stable")[:BEST]
        away = self.places[order, None] - self.places[None]
        inside = np.hypot(away[..., 0], away[..., 1]) <= self.near
        best = int(np.round(inside @ self.chances, 9).argmax())
        return int(order[best]), inside[best]


BEST = 300
"""Likeliest parts among which the best place is looked for."""


def refine(
    query: Signature,
    cells: NDArray[np.float64],
    noise: Noise,
    *,
    objects: StreetObjects,
    index: ObjectIndex | StoredIndex,
    step: float = 10.0,
    radius: float = 30.0,
    near: float = 25.0,
    north_sigma: float = 0.0,
    headings: NDArray[np.floating] | None = None,
    log_prior: NDArray[np.float64] | None = None,
    footprints: Footprints | None = None,
) -> Refinement:
    """Look for the place of a query within some cells.

    The query needs bearings; its types may be unknown. `cells`, shape (c, 2), are the middles in
    metres of the likeliest cells, likeliest first, of a ranking with the noise that `cell_noise`
    gives; some hundred will do. `noise` itself is for a known place. `step`, `near` (see
    `Refinement`) and `radius`, the visibility range of classes that have none of their own, are in
    metres. `north_sigma` is the standard deviation in degrees of the query's north, infinite if it
    is not known at all; then `headings`, the likeliest one in each cell, are needed. `log_prior` is
    what else is known of the cells, and what `footprints` hide is not seen.

    The likelihood is that of `likelihood.rerank`. A part of side s counts with an uncertainty of
    the place of ``s / 12 ** 0.5`` each way, the deviation of places anywhere in it, so that its
    likelihood stands for the mean over the part; chances are likelihood times area.
    """
    _check(cells, north_sigma, headings)
    codes = np.unique(objects.codes)
    tables, weights = noise_tables(
        noise, taxonomy=objects.taxonomy, codes=codes, longest=LONGEST_TABLE
    )
    size = float(step)
    parts = np.asarray(cells[: KEPT[0]], dtype=np.float64)
    prior = np.zeros(len(parts)) if log_prior is None else np.asarray(log_prior)[: KEPT[0]]
    turned = np.zeros(len(parts)) if headings is None else np.asarray(headings)[: KEPT[0]]
    done: list[tuple[NDArray[np.float64], ...]] = []
    for level, turn in enumerate(TURNS):
        parts, prior, turned = _quarters(parts, size), np.repeat(prior, 4), np.repeat(turned, 4)
        size /= 2.0
        views = views_at(objects, parts, index=index, radius=radius, footprints=footprints)
        spread = [_with_place(table, size) for table in tables]
        reach = float(objects.taxonomy.ranges(radius).max())
        steps = np.linspace(-turn, turn, 2 * TURNS_A_SIDE + 1) if north_sigma > 0 else np.zeros(1)
        turns = turned[:, None] + steps
        found = place_loglik(query, views, spread, weights, turns=turns, reach=reach)
        if north_sigma > 0:
            found += turn_logs(turns, steps[1] - steps[0], north_sigma)
        loglik = np.logaddexp.reduce(found, axis=1)
        shares = np.exp(found - loglik[:, None])
        turned = (shares * turns).sum(axis=1)
        sigmas = np.sqrt((shares * (turns - turned[:, None]) ** 2).sum(axis=1))
        total = loglik + prior
        divided = np.zeros(len(parts), np.bool_)
        if level + 1 < len(TURNS):
            best = np.argsort(-total, kind="stable")[: KEPT[level + 1]]
            divided[best] = total[best] > total[best[0]] + math.log(LEAST_CHANCE)
        kept = ~divided
        sizes = np.full(len(parts), size)
        done.append(
            (parts[kept], sizes[kept], loglik[kept], prior[kept], turned[kept], sigmas[kept])
        )
        parts, prior, turned = parts[divided], prior[divided], turned[divided]
    places, sizes, loglik, prior, turned, sigmas = (
        np.concatenate(column) for column in zip(*done, strict=True)
    )
    weight = loglik + prior + 2.0 * np.log(sizes)
    chances = np.exp(weight - weight.max())
    return Refinement(
        places=places,
        sizes=sizes,
        loglik=loglik,
        headings=signed_degrees(turned),
        heading_sigmas=sigmas,
        chances=chances / chances.sum(),
        near=near,
    )


def _check(
    cells: NDArray[np.float64],
    north_sigma: float,
    headings: NDArray[np.floating] | None,
) -> None:
    if not north_sigma >= 0:
        msg = f"the deviation of north is {north_sigma} degrees; give 0 or more, or infinity."
        raise InputError(msg)
    if len(cells) == 0 or (headings is None and north_sigma > 0):
        msg = (
            f"{len(cells)} cells and {'no' if headings is None else 'some'} headings were given; "
            "give at least one cell, and headings where north is not known."
        )
        raise InputError(msg)


def _quarters(parts: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    """Return the middles of the four quarters of squares."""
    corners = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]]) * (size / 4.0)
    return np.asarray((parts[:, None] + corners).reshape(-1, 2))


def _with_place(table: NoiseTable, size: float) -> NoiseTable:
    """Return a noise model for places anywhere in a square."""
    return replace(table, position_sigma=math.hypot(table.position_sigma, size / math.sqrt(12.0)))
