"""One photo as arrays for a noise table, and its likelihood at places.

With objects i of a place (class ``t_i``, bearing ``b_i``, distance ``d_i``) and detections j of a
photo that shows the sectors S (bearing ``a_j``, rough range ``r_j``, scores ``c_j``), the
likelihood sums over all one-to-one associations A of objects and detections:

    L = prod_i (1 - w_i p_i) * exp(-clutter |S|) * prod_j lambda_j
        * sum_A prod_(i,j in A) p_i / (1 - w_i p_i) C_ij N(a_j - b_i) R(r_j; d_i) / lambda_j

with ``p_i`` the chance of detection at its distance, ``w_i`` the chance that its bearing is in S,
``C_ij`` the chance of its name, R a log-normal density (1 without a range), and ``lambda_j`` the
density of false detections: uniform over the turn and, for a range, the disc.

At the edge of range, an observer off the centre of a cell misses objects that are seen from the
centre, and sees as many others of the same class: ``p_i`` falls there, and ``lambda_j`` rises by
the same amount.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import (
    BEARING_UNITS,
    FULL_TURN,
    WILDCARD,
    InputError,
    share_rows,
)
from semsig_gis.localization.likelihood.records import (
    PhotoArrays,
    PlaceObjects,
    TurnGrid,
)
from semsig_gis.localization.noise.table import extent_sigma, stack_models

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.database import VisibleObjects
    from semsig_gis.localization.noise.table import NoiseTable
    from semsig_gis.observation import View

PLACES_A_THREAD = 32  # the fewest places that are worth a thread
FIRST_PLACES = 128  # likely places that are scored first; their best score bounds the others
LOST_SHARE = 3e-3  # of a sum, that negligible terms together may have


@dataclass(frozen=True, eq=False, kw_only=True)
class PhotoTable:
    """The n detections of one photo, for noise tables of k classes.

    `bearing_errors` are added to those of the noise table, 0 for none. `ranges` and `range_errors`
    are NaN if unknown. `scores`, shape (k, n), are the scores of the
    classes. `disc` is the density of the logarithm of the range of a false detection, 1 without a
    range. `sectors`, shape (s, 2), are empty for a full turn; `width` is the share of a full turn
    that the photo shows.
    """

    bearings: NDArray[np.float64]
    bearing_errors: NDArray[np.float64]
    ranges: NDArray[np.float64]
    range_errors: NDArray[np.float64]
    scores: NDArray[np.float64]
    disc: NDArray[np.float64]
    sectors: NDArray[np.float64]
    width: float

    @classmethod
    def of(cls, photo: View, table: NoiseTable) -> PhotoTable:
        """Return the detections of a photo as arrays; InputError if a class is not in `table`."""
        if photo.bearings is None:
            raise InputError(
                "the query has no bearings, which the search between cells needs; give them."
            )
        size = len(photo.bearings)
        unknown = np.full(size, math.nan)
        ranges = unknown if photo.ranges is None else photo.ranges
        ranged = ~np.isnan(ranges)
        scores = name_scores(photo, table)
        # False objects may be anywhere in the disc; with landmarks, in that of the class.
        radii = np.full(size, table.scale.reach)
        if table.scale.logarithmic:
            weights = table.clutter[:, None] * scores
            squares = (weights / table.ranges[:, None] ** 2).sum(axis=0) / weights.sum(axis=0)
            radii = 1.0 / np.sqrt(squares)
        disc = np.where(ranged, 2.0 * (np.where(ranged, ranges, 1.0) / radii) ** 2, 1.0)
        errors = unknown if photo.range_errors is None else photo.range_errors
        rough = np.zeros(size) if photo.bearing_errors is None else photo.bearing_errors
        (look,) = photo.photos
        return cls(
            bearings=photo.bearings,
            bearing_errors=np.nan_to_num(rough),
            ranges=ranges,
            range_errors=errors,
            scores=scores,
            disc=disc,
            sectors=np.array(look.sectors, dtype=np.float64).reshape(-1, 2),
            width=look.width / FULL_TURN,
        )

    def range_sigma(self, table: NoiseTable) -> NDArray[np.float64]:
        """Return the relative error of each range by class, shape (k, n)."""
        return np.where(~np.isnan(self.range_errors), self.range_errors, table.range_sigma[:, None])

    def arrays(self, tables: Sequence[NoiseTable]) -> PhotoArrays:
        """Return the photo and its names by some tables, as the kernel takes them."""
        return PhotoArrays(
            bearings=self.bearings,
            bearing_errors=self.bearing_errors,
            ranges=self.ranges,
            range_sigma=np.stack([self.range_sigma(table) for table in tables]),
            own=self.scores,
            other=np.stack([table.others @ self.scores for table in tables]),
            density=np.stack([self.density(table) for table in tables]),
            disc=self.disc,
            sectors=self.sectors,
            width=self.width,
        )

    def density(self, table: NoiseTable) -> NDArray[np.float64]:
        """Return the density per degree of false detections with the name of each, shape (n,)."""
        return np.asarray(table.clutter @ self.scores * self.disc / FULL_TURN)

    def named(self, table: NoiseTable) -> NDArray[np.float64]:
        """Return the chance of the scores of each detection, by length and class, (l, k, n)."""
        wrong = table.misnamed[:, :, None]
        return np.asarray((1.0 - wrong) * self.scores + wrong * (table.others @ self.scores))


def name_scores(photo: View, table: NoiseTable) -> NDArray[np.float64]:
    """Return the scores of the classes of a table for each detection, shape (k, n).

    InputError if a class is not in the table.
    """
    if photo.scores is None:
        codes = np.zeros(len(photo), np.uint8) if photo.codes is None else photo.codes
        table.class_rows(codes)  # raises for unknown classes
        return np.asarray((table.codes[:, None] == codes) | (codes == WILDCARD), dtype=np.float64)
    any_class = photo.scores[:, WILDCARD]
    shared = np.where(any_class < 1.0, any_class / len(table.codes), 1.0)
    scores = np.asarray(photo.scores[:, table.codes].T + shared)
    # Classes that no cell sees cannot be meant: the others share their chance.
    absent = np.delete(photo.scores, [WILDCARD, *table.codes], axis=1).sum(axis=1)
    nowhere = np.flatnonzero(scores.sum(axis=0) == 0.0)
    table.class_rows(photo.scores[nowhere].argmax(axis=1).astype(np.uint8))  # raises
    scores[:, absent > 0.0] /= scores.sum(axis=0)[absent > 0.0]
    return scores


def photo_loglik(
    photo: PhotoTable,
    views: VisibleObjects,
    tables: Sequence[NoiseTable],
    weights: NDArray[np.float64],
    *,
    turns: NDArray[np.float64],
    log_prior: NDArray[np.float64] | None = None,
    group: int = 1,
    whole: bool = False,
    least: float = -math.inf,
) -> NDArray[np.float64]:
    """Return the log-likelihood of a photo by place and turn, shape (v, r).

    `weights` are the chances of the tables, `turns` the degrees to turn the photo by at each place.
    If only sums over each `group` of successive places are needed, with a `log_prior` of places and
    turns, or only the sum over the `whole`, in which likely places come first, then terms that are
    negligible in the sum (`LOST_SHARE`) are not computed: they get an upper bound. So do terms that
    are surely below `least` with their prior.
    """
    from semsig_gis.localization.likelihood.association_kernels import sum_associations  # noqa: PLC0415 - numba, 0.25 s

    first = tables[0]
    bearing_units = np.minimum(views.bearings * (BEARING_UNITS / FULL_TURN), BEARING_UNITS - 1)
    kinds = first.row_of[views.codes]
    limits = first.ranges[kinds]
    objects = PlaceObjects(
        offsets=views.offsets,
        kinds=kinds,
        bearing_units=bearing_units.astype(np.uint16),
        distance_units=first.scale.units(views.distances),
        beyond=views.distances > limits + first.scale.rounding(limits),
        extent_sigma=np.empty(0) if views.extents is None else extent_sigma(views.extents),
    )
    prior = np.zeros(turns.shape) if log_prior is None else np.ascontiguousarray(log_prior)
    grid = TurnGrid(np.ascontiguousarray(turns, dtype=np.float64), prior)
    arrays, models = photo.arrays(tables), stack_models(tables, weights)
    logliks = np.empty((len(tables), *turns.shape))
    summed = len(tables) * turns.shape[1] * (len(turns) if whole else group)
    margin = math.log(summed / LOST_SHARE)

    def fill(part: NDArray[np.int64], reached: float) -> None:
        sum_associations(part, group, reached, margin, objects, arrays, models, grid, logliks)

    groups, a_thread = -(-len(turns) // group), max(PLACES_A_THREAD // group, 1)
    ahead, reached = 0, least + margin
    if whole:
        ahead = min(FIRST_PLACES, groups)
        share_rows(lambda part: fill(part, least + margin), ahead, least=a_thread)
        reached = float((logliks[:, :ahead] + prior[:ahead]).max(initial=reached))
    share_rows(lambda part: fill(part + ahead, reached), groups - ahead, least=a_thread)
    return np.asarray(np.logaddexp.reduce(logliks, axis=0))
