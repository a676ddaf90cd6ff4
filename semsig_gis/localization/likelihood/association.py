"""Which detection is which object: chances and sums over all one-to-one associations.

A detection is one of the objects or clutter; an object is detected once or missed. The weight of a
pair is how much likelier the two are one thing than a miss and clutter. The likelihood sums over
all associations (see `likelihood.photo`). The index adds up over the detections one by one, so that
one lamp may explain three; its best cells are ranked again by this sum. An alignment that keeps the
order would lose one query in twenty, because bearing noise swaps neighbours.

The sum is the Bethe approximation that belief propagation settles on (Williams and Lau,
"Approximate evaluation of marginal association probabilities with belief propagation", 2014): exact
if the pairs form no loop, otherwise a little too small.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from semsig_gis.core import FULL_TURN, HALF_TURN, InputError, log_sum, signed_degrees
from semsig_gis.database import visible_objects_in
from semsig_gis.localization.likelihood.index import own_sigma, photo_power
from semsig_gis.localization.likelihood.photo import PhotoTable, photo_loglik
from semsig_gis.localization.likelihood.turns import turn_logs
from semsig_gis.localization.noise.table import database_tables, extent_sigma
from semsig_gis.observation import View

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase, VisibleObjects
    from semsig_gis.localization.likelihood.index import CellScores, LikelihoodIndex, _Models
    from semsig_gis.localization.noise.model import Noise
    from semsig_gis.localization.noise.table import NoiseTable

    _Ranks = tuple[NDArray[np.float64], list[NDArray[np.float64]]]


WIDE = 45.0  # degrees of deviation from which on the tails meet behind the observer
LAPS = 360.0 * np.arange(-3, 4)
FARTHEST = 8.0  # deviations, beyond which a normal distribution is over
ROOT = math.sqrt(2.0 * math.pi)
# Without BLAS: on a busy machine its threads wait long for each other.
sum_products = partial(np.einsum, optimize=False)


@dataclass(frozen=True, eq=False, kw_only=True)
class Pairs:
    """Pairs of an object and a detection that may be one thing, for several problems.

    The pairs of problem i are ``starts[i]:starts[i + 1]``. `objects` and `detections` are row
    numbers that run on over all problems. `away` is the bearing of the detection less that of the
    object, in degrees in [-180, 180).
    """

    starts: NDArray[np.int64]
    objects: NDArray[np.int64]
    detections: NDArray[np.int64]
    away: NDArray[np.float64]


def near_pairs(
    object_starts: NDArray[np.int64],
    object_bearings: NDArray[np.float64],
    detection_starts: NDArray[np.int64],
    detection_bearings: NDArray[np.float64],
    *,
    reach: float = 180.0,
) -> Pairs:
    """Return the pairs of each problem with bearings at most `reach` degrees apart.

    Problem i has the objects ``object_starts[i]:object_starts[i + 1]``, and detections likewise.
    Pairs are ordered by problem and object.
    """
    here, there = np.diff(object_starts), np.diff(detection_starts)
    problem = np.repeat(np.arange(len(here)), here * there)
    inside = np.arange(len(problem)) - (np.cumsum(here * there) - here * there)[problem]
    row, column = np.divmod(inside, there[problem])
    objects = object_starts[problem] + row
    detections = detection_starts[problem] + column
    away = signed_degrees(detection_bearings[detections] - object_bearings[objects])
    near = np.abs(away) <= reach
    starts = np.concatenate([[0], np.cumsum(np.bincount(problem[near], minlength=len(here)))])
    return Pairs(starts=starts, objects=objects[near], detections=detections[near], away=away[near])


@dataclass(frozen=True, eq=False, kw_only=True)
class Detections:
    """The detections of some photos, one photo after the other.

    The detections of photo i are ``starts[i]:starts[i + 1]``; the arrays are joined over all
    photos, with the detection as the last axis.
    """

    photos: tuple[PhotoTable, ...]
    starts: NDArray[np.int64]
    bearings: NDArray[np.float64]
    bearing_errors: NDArray[np.float64]
    ranges: NDArray[np.float64]
    range_errors: NDArray[np.float64]
    scores: NDArray[np.float64]
    disc: NDArray[np.float64]

    @classmethod
    def of(cls, views: Sequence[Signature], table: NoiseTable) -> Detections:
        """Return the detections of views with bearings, for the classes of a table."""
        parts = [part for view in views for part in View.of(view).split()]
        photos = tuple(PhotoTable.of(part, table) for part in parts)
        names = ("bearings", "bearing_errors", "ranges", "range_errors", "scores", "disc")
        joined = {
            name: np.concatenate([getattr(photo, name) for photo in photos], axis=-1)
            for name in names
        }
        return cls(photos=photos, starts=np.cumsum([0, *map(len, parts)]), **joined)

    @cached_property
    def photo_rows(self) -> NDArray[np.int64]:
        """The photo of each detection."""
        return np.repeat(np.arange(len(self.photos)), np.diff(self.starts))

    @cached_property
    def turns(self) -> NDArray[np.float64]:
        """The share of a full turn that each photo shows."""
        return np.array([photo.width for photo in self.photos])

    @cached_property
    def sectors(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The first sector of each photo and an end, shape (photos + 1,), and all sectors."""
        counts = [len(photo.sectors) for photo in self.photos]
        return np.cumsum([0, *counts]), np.concatenate([photo.sectors for photo in self.photos])

    def inside(
        self,
        owners: NDArray[np.int64],
        bearings: NDArray[np.float64],
        spreads: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the share of the wrapped normal of some objects in the sectors of their photo.

        Object i, of photo ``owners[i]``, has a bearing and a spread in degrees. The second array is
        the mean square of the deviations inside, in squares of the spread.
        """
        from semsig_gis.localization.likelihood.association_kernels import sector_shares  # noqa: PLC0415 - numba, 0.25 s

        mass, squares = np.empty((2, len(owners)))
        sector_shares(*self.sectors, owners, bearings, spreads, mass, squares)
        return mass, squares


@dataclass(frozen=True, eq=False, kw_only=True)
class Association:
    """The chances that detections are objects.

    By pair, `chances` that it is one thing. By object, its chance of `detection` at its distance,
    and `inside` and `squares` as in `Detections.inside`. By detection, `clutter` is the share of
    clutter in the detections that are none of the objects; the others are objects that are in range
    of the observer but not of the place. `loglik` is the log-likelihood of each photo.
    """

    chances: NDArray[np.float64]
    detection: NDArray[np.float64]
    inside: NDArray[np.float64]
    squares: NDArray[np.float64]
    clutter: NDArray[np.float64]
    loglik: NDArray[np.float64]


def associate(
    table: NoiseTable,
    views: VisibleObjects,
    photos: Detections,
    pairs: Pairs,
    *,
    lengths: NDArray[np.int64],
) -> Association:
    """Return the chance that each pair is one thing, and the log-likelihood of each photo.

    `views` are the objects that each photo may show, of classes of the table; `lengths`, by photo,
    is the number of objects by which the table is looked up.
    """
    rows, kinds = table.length_rows(lengths), table.row_of[views.codes]
    owners = np.repeat(np.arange(len(views)), views.lengths)
    distances = at_distances(table, views)
    units = table.scale.units(distances)
    spreads = bearing_spreads(table, kinds, distances, views.extents)
    # By object: the chances of its detection and of a miss.
    inside, squares = photos.inside(owners, views.bearings, spreads)
    near = table.detected[rows[owners], kinds]
    detection = near * table.remaining[kinds, units]
    missed = 1.0 - detection * inside
    # By detection: the density of clutter, and of objects that come into range in any direction,
    # as many as leave it.
    used_rows, row = np.unique(rows, return_inverse=True)
    name_chances = np.stack(
        [sum_products("kc,cn->kn", table.named(used), photos.scores) for used in used_rows.tolist()]
    )
    leaving = np.zeros((len(views), len(table.codes)))
    np.add.at(leaving, (owners, kinds), near * table.leaving[kinds, units])
    names = name_chances[row[photos.photo_rows], :, np.arange(len(photos.photo_rows))]
    arriving = (leaving[photos.photo_rows] * names).sum(axis=1)
    clutter = table.clutter @ photos.scores
    floor = (clutter + arriving) * photos.disc / FULL_TURN
    # By pair: the odds of detection, times the densities of bearing, name and range over the floor.
    objects, detections = pairs.objects, pairs.detections
    rough = np.minimum(np.hypot(spreads[objects], photos.bearing_errors[detections]), HALF_TURN)
    weights = (detection / missed)[objects] * _bearing_densities(pairs.away, rough)
    weights *= name_chances[row[owners[objects]], kinds[objects], detections] / floor[detections]
    ranged = np.flatnonzero(~np.isnan(photos.ranges[detections]))
    if len(ranged):
        rows_with_range, metres = detections[ranged], distances[objects[ranged]]
        spread = range_spreads(table, photos, kinds[objects[ranged]], metres, rows_with_range)
        away = np.log(photos.ranges[rows_with_range] / metres) / spread
        weights[ranged] *= np.exp(-0.5 * away**2) / (spread * ROOT)
    chances, log_sums = associate_pairs(pairs, weights)
    return Association(
        chances=chances,
        detection=detection,
        inside=inside,
        squares=squares,
        clutter=clutter / (clutter + arriving),
        loglik=log_sums
        + np.bincount(owners, np.log(missed), len(views))
        + np.bincount(photos.photo_rows, np.log(floor), len(views))
        - photos.turns * (table.clutter.sum() + leaving.sum(axis=1)),
    )


def at_distances(table: NoiseTable, views: VisibleObjects) -> NDArray[np.float64]:
    """Return the distances of objects in metres; the nearest is above 0."""
    return np.asarray(np.maximum(views.distances, table.distances[0]))


def bearing_spreads(
    table: NoiseTable,
    kinds: NDArray[np.int64],
    distances: NDArray[np.float64],
    extents: NDArray[np.float64] | None,
) -> NDArray[np.float64]:
    """Return the deviation of the bearing of objects in degrees, by class, distance and extent."""
    spreads = np.hypot(table.sigma[kinds], np.degrees(table.position_sigma / distances))
    if extents is not None:
        spreads = np.hypot(spreads, extent_sigma(extents))
    return np.minimum(spreads, HALF_TURN)


def _bearing_densities(
    away: NDArray[np.float64], spread: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the density of the wrapped normal per degree."""
    density = np.exp(-0.5 * (away / spread) ** 2)
    wide = spread > WIDE
    laps = (away[wide, None] + LAPS) / spread[wide, None]
    density[wide] = np.exp(-0.5 * laps**2).sum(axis=1)
    return np.asarray(density / (spread * ROOT))


def range_spreads(
    table: NoiseTable,
    photos: Detections,
    kinds: NDArray[np.int64],
    distances: NDArray[np.float64],
    detections: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Return the deviation of the logarithm of the range of pairs, by class and distance."""
    own = photos.range_errors[detections]
    errors = np.where(np.isnan(own), table.range_sigma[kinds], own)
    return np.hypot(errors, table.position_sigma / distances)


def associate_pairs(
    pairs: Pairs, weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the probability of each pair, summed over all one-to-one associations.

    `weights` has one weight of 0 or more for each pair of an object and a detection. Also returns
    the logarithm of the sum over the associations of each problem.
    """
    from semsig_gis.localization.likelihood.association_kernels import associate  # noqa: PLC0415 - numba, 0.25 s

    chances = np.empty(len(weights))
    log_sums = np.empty(len(pairs.starts) - 1)
    associate(
        pairs.starts,
        pairs.objects,
        pairs.detections,
        np.ascontiguousarray(weights, dtype=np.float64),
        np.ones(pairs.objects.max(initial=-1) + 1),
        np.ones(pairs.detections.max(initial=-1) + 1),
        chances,
        log_sums,
    )
    return chances, log_sums


RERANKED = 500
"""Default number of cells that are re-ranked."""
CHOSEN_FROM = 8  # those to re-rank are chosen from this multiple of their number
# Cells in the first batch of each; then as many again, twice as many, ...
FIRST_CHOSEN, FIRST_RERANKED = 512, 16
SAMPLE = 192  # of the other cells
# Batches end when the last one holds less than this share of the chance. Other cells that together
# hold less are not sampled.
LOG_LEAST_SHARE = math.log(1e-3)
MARGIN = 20.0  # nats below the best cell at which an upper bound of a score is enough
NEGLIGIBLE = 30.0  # nats below the best re-ranked cell at which all cells together are negligible
POOL = 16  # the sample is drawn from this multiple of its size
WINDOWS = 8  # ranges of the likelihood, each with a shift of its own
# Degrees around the likeliest turn of the quick sums, which try one in 4.5 degrees. Those near it
# come first, and bound the others.
TURN_STEP = 3.0
NEAR_TURNS = np.array([-1.5, 1.5, -4.5, 4.5])


def score_associations(
    database: SignatureDatabase,
    photo: Signature,
    noise: Noise,
    cells: NDArray[np.int64],
    *,
    turns: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return the log-likelihood of a photo in some cells, summed over one-to-one associations.

    `turns`, shape (c, r), are the degrees to turn the photo by in each cell; the shape is that of
    `turns`, or (c,) without them.
    """
    tables, weights = database_tables(database, noise)
    ways = np.zeros((len(cells), 1)) if turns is None else turns
    table = PhotoTable.of(View.of(photo), tables[0])
    loglik = photo_loglik(table, visible_objects_in(database, cells), tables, weights, turns=ways)
    return loglik[:, 0] if turns is None else loglik


def rerank(
    index: LikelihoodIndex,
    query: Signature,
    scores: CellScores,
    *,
    north_sigma: float = 0.0,
    log_prior: NDArray[np.float64] | None = None,
    count: int = RERANKED,
    off_centre: bool = True,
) -> CellScores:
    """Replace the scores of the best cells by their one-to-one likelihoods.

    Up to `count` cells are re-ranked, until a batch of them has a negligible share of the chance. A
    sample of the others is scored as well, and each other cell is shifted by as much as the cells
    of the sample with similar scores, so that all chances are comparable. `log_prior` helps to
    choose the cells and is not part of the result. Without bearings, the scores are returned as
    they are. The cells are chosen by quick one-to-one sums at the centres of some thousand (see
    `likelihood.choice`). For queries from anywhere in a cell, nine points `off_centre` are scored
    in each chosen cell.
    """
    from semsig_gis.localization.likelihood.choice import quick_scorer  # noqa: PLC0415 - numba, 0.25 s
    from semsig_gis.localization.likelihood.kernels import promising_cells  # noqa: PLC0415 - numba, 0.25 s

    if count < 1:
        raise InputError(f"the number of cells to re-rank is {count}; give a whole number from 1.")
    view = View.of(query)
    if view.bearings is None:
        return scores
    prior = np.zeros(len(scores.loglik)) if log_prior is None else log_prior
    total = scores.loglik + prior
    quick = quick_scorer(index, view, scores, north_sigma=north_sigma)
    models, points = index.observer_offsets if off_centre else (index.models, np.zeros((1, 2)))

    def choose(cells: NDArray[np.int64], reached: float) -> _Ranks:
        logliks, turns = quick(cells, reached - MARGIN - prior[cells])
        return prior[cells] + logliks, turns

    def rank(cells: NDArray[np.int64], reached: float) -> _Ranks:
        return _score_cells(
            index,
            view,
            cells,
            models=models,
            points=points,
            scores=scores,
            prior=prior[cells],
            north_sigma=north_sigma,
            least=reached - MARGIN,
        )

    choice = promising_cells(total.astype(np.float32), min(CHOSEN_FROM * count, len(total)))
    choice = choice[total[choice] > -np.inf]
    nearer = _rank_best(choose, choice, total[choice], first=FIRST_CHOSEN)
    choice, before = nearer.cells, nearer.after
    scores = _with_turns(scores, nearer)
    ranked = _rank_best(rank, choice, before, first=FIRST_RERANKED, count=count)
    # The other cells change by as much as a sample of them.
    move = nearer.move + ranked.move
    loglik, reached = scores.loglik + np.float64(move), log_sum(ranked.after)
    left = np.ones(len(choice), np.bool_)
    left[ranked.order] = False
    live = total > min(ranked.after.max(), total.max()) - NEGLIGIBLE
    live[choice] = False
    rest = np.flatnonzero(live)
    loglik[choice[left]] = before[left] + ranked.move - prior[choice[left]]
    for cells, old, usual in ((choice[left], before[left], ranked.move), (rest, total[rest], move)):
        if len(cells) and log_sum(old) + usual > reached + LOG_LEAST_SHARE:
            changed = old + _changes(rank, cells, old)
            changed -= prior[cells]
            loglik[cells] = changed
    loglik[ranked.cells] = ranked.after - prior[ranked.cells]
    return replace(_with_turns(scores, ranked), loglik=loglik)


class _Ranked(NamedTuple):
    """Cells that were scored again, of those that were given.

    `order` has their positions among these, `after` their scores and `turns` the turns of each
    photo; `move` is the change of the last batch.
    """

    cells: NDArray[np.int64]
    order: NDArray[np.int64]
    after: NDArray[np.float64]
    turns: list[NDArray[np.float64]]
    move: float


def _with_turns(scores: CellScores, ranked: _Ranked) -> CellScores:
    """Return scores with the likeliest turns of some cells in place of those of the scan."""
    headings: list[NDArray[np.float32] | None] = []
    for heading, turn in zip(scores.headings, ranked.turns, strict=True):
        if heading is None:
            headings.append(None)
            continue
        exact = heading.copy()
        exact[ranked.cells] = signed_degrees(turn)
        headings.append(exact)
    return replace(scores, headings=tuple(headings))


def _rank_best(
    rank: Callable[[NDArray[np.int64], float], _Ranks],
    cells: NDArray[np.int64],
    before: NDArray[np.float64],
    *,
    first: int,
    count: int | None = None,
) -> _Ranked:
    """Score the best of some cells again: the `first` of them, then more and more up to `count`.

    Scores are log-likelihoods with the prior: `before`, and what `rank` returns, with turns, for
    cells and the best score before them. The end is where the last batch is negligible.
    """
    order = np.argsort(-before, kind="stable")[:count]
    after, turns, size, move, best = np.empty(0), [], 0, 0.0, -math.inf
    while size < len(order):
        batch = order[size : max(first, 2 * size)]
        scores, own_turns = rank(cells[batch], best)
        after, size = np.append(after, scores), size + len(batch)
        turns.append(own_turns)
        best, move = float(after.max()), log_sum(scores) - log_sum(before[batch])
        if size > first and log_sum(scores) < log_sum(after) + LOG_LEAST_SHARE:
            break
    joined = [np.concatenate(each) for each in zip(*turns, strict=True)]
    return _Ranked(cells[order[:size]], order[:size], after, joined, move)


def _changes(
    rank: Callable[[NDArray[np.int64], float], _Ranks],
    cells: NDArray[np.int64],
    before: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return how much the scores of some cells change, by a sample of them.

    The scores are those of `_rank_best`.
    """
    # More of the likely cells than of the others, and the change of the chance by window.
    pool = np.arange(0, len(cells), max(1, len(cells) // (POOL * SAMPLE)))
    pool = pool[np.argsort(-before[pool], kind="stable")]
    ranks = np.unique(np.geomspace(1, len(pool), SAMPLE).astype(np.int64)) - 1
    sample = pool[ranks]
    new, old, window = rank(cells[sample], -math.inf)[0], before[sample], SAMPLE // WINDOWS
    moves, levels = [], []
    for low in range(0, len(sample), window):
        part = slice(low, low + window)
        moves.append(log_sum(new[part]) - log_sum(old[part]))
        levels.append(old[part].mean())
    return np.asarray(np.interp(before, levels[::-1], moves[::-1]))


def _score_cells(
    index: LikelihoodIndex,
    view: View,
    cells: NDArray[np.int64],
    *,
    models: _Models,
    points: NDArray[np.float64],
    scores: CellScores,
    prior: NDArray[np.float64],
    north_sigma: float,
    least: float,
) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """Return the log-likelihood of some cells with the prior, and the likeliest turns in each.

    It is the mean over some points in each cell; an upper bound where it is surely below `least`.
    """
    from semsig_gis.localization.likelihood.off_centre import visible_objects_off_centre  # noqa: PLC0415 - numba, 0.25 s

    views = (
        visible_objects_off_centre(index.database, cells, points)
        if len(points) > 1
        else visible_objects_in(index.database, cells)
    )
    total, likeliest = np.zeros((len(cells), len(points))), []
    for photo, heading in zip(view.split(), scores.headings, strict=True):
        turns = np.zeros((len(cells), 1)) if heading is None else heading[cells, None] + NEAR_TURNS
        table = PhotoTable.of(photo, index.table)
        point_turns = np.repeat(turns, len(points), axis=0)
        chances = np.zeros(point_turns.shape)
        if heading is not None:
            step, sigma = TURN_STEP, own_sigma(photo, north_sigma)
            chances = turn_logs(point_turns, step, sigma)
        logliks = chances + photo_loglik(
            table,
            views,
            *models,
            turns=point_turns,
            log_prior=chances + np.repeat(prior, len(points))[:, None],
            # A place that does not fit one photo may fit the others.
            group=len(points) if len(scores.headings) == 1 else 1,
            least=least if len(scores.headings) == 1 else -math.inf,
        )
        logliks = logliks.reshape(len(cells), len(points), -1)
        best = np.logaddexp.reduce(logliks, axis=1).argmax(axis=1)
        likeliest.append(turns[np.arange(len(cells)), best])
        total += np.logaddexp.reduce(logliks, axis=2)
    total *= photo_power(len(likeliest), index.noise)
    return prior + np.logaddexp.reduce(total, axis=1) - math.log(len(points)), likeliest
