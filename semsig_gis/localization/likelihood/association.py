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
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import FULL_TURN, HALF_TURN, InputError, signed_degrees
from semsig_gis.database import visible_objects_in
from semsig_gis.localization.likelihood.index import CellScores, own_sigma, photo_power
from semsig_gis.localization.likelihood.photo import PhotoTable, photo_loglik
from semsig_gis.localization.noise.table import database_tables, extent_sigma
from semsig_gis.observation import View

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase, VisibleObjects
    from semsig_gis.localization.likelihood.index import LikelihoodIndex
    from semsig_gis.localization.noise.model import Noise
    from semsig_gis.localization.noise.table import NoiseTable

    _Ranks = tuple[NDArray[np.float64], list[NDArray[np.float64]]]


WIDE = 45.0  # degrees of deviation from which on the tails meet behind the observer
LAPS = 360.0 * np.arange(-3, 4)
FARTHEST = 8.0  # deviations, beyond which a normal distribution is over
ROOT = math.sqrt(2.0 * math.pi)
# Without BLAS: on a busy machine its threads wait long for each other.
sum_products = partial(np.einsum, optimize=False)


def turn_logs(turns: NDArray[np.float64], step: float, north_sigma: float) -> NDArray[np.float64]:
    """Return the log of the chance of each turn, which is one `step` wide; all are in degrees."""
    if math.isinf(north_sigma):
        return np.full(turns.shape, math.log(step / 360.0))
    scale = math.log(step / (north_sigma * math.sqrt(2.0 * math.pi)))
    return np.asarray(scale - 0.5 * (signed_degrees(turns) / north_sigma) ** 2)


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
FIRST_RERANKED = 100  # always re-ranked; then as many again, twice as many, ...
# Points in the other cells at which a sample of these is scored: usually, and for a quick answer.
SAMPLE, QUICK_SAMPLE = 2304, 768
# Cells that are scored off their centres first, to choose the others: at most, at least, and the
# sample of the rest.
OFF_CENTRE, FIRST_OFF_CENTRE, SAMPLE_OFF_CENTRE = 8192, 2048, 1024
# Re-ranking ends when the last batch of cells holds less than this share of the chance.
LOG_LEAST_SHARE = math.log(1e-3)
NEGLIGIBLE = 30.0  # nats below the best re-ranked cell at which all cells together are negligible
POOL = 16  # the sample is drawn from this multiple of its size
WINDOWS = 8  # ranges of the likelihood, each with a shift of its own
# Degrees around the likeliest turn of the scan, which is exact to less than six degrees.
NEAR_TURNS = np.arange(-7.5, 7.6, 3.0)


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
    sample: int = SAMPLE,
) -> CellScores:
    """Replace the scores of the best cells by their one-to-one likelihoods.

    Up to `count` cells are re-ranked, until a batch of them has a negligible share of the chance. A
    `sample` of the others is scored as well, and each other cell is shifted by as much as the cells
    of the sample with similar scores, so that all chances are comparable. `log_prior` helps to
    choose the cells and is not part of the result. Without bearings, the scores are returned as
    they are. For queries from anywhere in a cell, points `off_centre` are scored: four in each of
    some thousand cells by the plain sum, to choose the cells, and then nine in each chosen cell.
    """
    if count < 1:
        raise InputError(f"the number of cells to re-rank is {count}; give a whole number from 1.")
    view = View.of(query)
    if view.bearings is None:
        return scores
    loglik = scores.loglik.astype(np.float64)
    if off_centre and len(index.observer_offsets[1]) > 1:
        scorer = index.off_centre_scorer(view, north_sigma=north_sigma)
        loglik, _, _ = _replace_best(
            lambda cells: (scorer(cells), []),
            loglik,
            log_prior,
            count=OFF_CENTRE,
            first=FIRST_OFF_CENTRE,
            sample=SAMPLE_OFF_CENTRE,
        )
    loglik, cells, turns = _replace_best(
        partial(
            _score_cells, index, view, scores=scores, north_sigma=north_sigma, off_centre=off_centre
        ),
        loglik,
        log_prior,
        count=count,
        first=FIRST_RERANKED,
        sample=sample // (len(index.observer_offsets[1]) if off_centre else 1),
    )
    headings = []
    for before, turn in zip(scores.headings, turns, strict=True):
        heading = before
        if before is not None:
            heading = before.copy()
            heading[cells] = signed_degrees(turn)
        headings.append(heading)
    return CellScores(loglik=loglik, headings=tuple(headings))


def _replace_best(
    rank: Callable[[NDArray[np.int64]], _Ranks],
    old: NDArray[np.float64],
    log_prior: NDArray[np.float64] | None,
    *,
    count: int,
    first: int,
    sample: int,
) -> tuple[NDArray[np.float64], NDArray[np.int64], list[NDArray[np.float64]]]:
    """Return better log-likelihoods of all cells, the best cells, and their turns.

    `rank` returns log-likelihoods and turns of cells: it is called for the `first` cells, then for
    more and more up to `count`. The others are shifted by a `sample` of them.
    """
    from semsig_gis.localization.likelihood.kernels import promising_cells  # noqa: PLC0415 - numba, 0.25 s

    total = old if log_prior is None else old + log_prior
    count = min(count, len(old))
    cells = promising_cells(total.astype(np.float32), count)
    cells = cells[np.argsort(-total[cells], kind="stable")][:count]
    cells = cells[total[cells] > -np.inf]
    parts, size = [rank(cells[:first])], min(first, len(cells))
    while size < len(cells):
        logs = np.concatenate([part for part, _ in parts])
        if log_prior is not None:
            logs += log_prior[cells[:size]]
        last = logs[-len(parts[-1][0]) :]
        if np.logaddexp.reduce(last) < np.logaddexp.reduce(logs) + LOG_LEAST_SHARE:
            break
        parts.append(rank(cells[size : 2 * size]))
        size = min(2 * size, len(cells))
    cells, new = cells[:size], np.concatenate([part for part, _ in parts])
    turns = [np.concatenate(each) for each in zip(*(turn for _, turn in parts), strict=True)]
    loglik = old.copy()
    if len(cells) < len(old):
        # The best re-ranked cell may be far below the first scores of the others.
        best = (new if log_prior is None else new + log_prior[cells]).max()
        rest = total > min(best, total.max()) - NEGLIGIBLE
        rest[cells] = False
        _shift(loglik, lambda cells: rank(cells)[0], total, np.flatnonzero(rest), sample)
    loglik[cells] = new
    return loglik, cells, turns


def _shift(
    loglik: NDArray[np.float64],
    rank: Callable[[NDArray[np.int64]], NDArray[np.float64]],
    total: NDArray[np.float64],
    tail: NDArray[np.int64],
    size: int,
) -> None:
    """Shift the log-likelihood of all cells as much as it changes for a sample of the `tail`.

    `rank` returns the new likelihood of cells, `total` is the old one of all cells with the prior;
    `size` is that of the sample.
    """
    if not len(tail):
        return
    pool = tail
    if len(tail) > POOL * size:
        random = np.random.default_rng(0)
        pool = random.choice(tail, POOL * size, replace=False, shuffle=False)
    # More of the likely cells than of the others, and the change of the chance by window.
    pool = pool[np.argsort(-total[pool], kind="stable")]
    ranks = np.unique(np.geomspace(1, len(pool), size).astype(np.int64)) - 1
    sample = pool[ranks]
    new, before, window = rank(sample), loglik[sample], size // WINDOWS
    moves, levels = [], []
    for low in range(0, len(sample), window):
        part = slice(low, low + window)
        moves.append(np.logaddexp.reduce(new[part]) - np.logaddexp.reduce(before[part]))
        levels.append(total[sample[part]].mean())
    move = np.full(len(loglik), moves[-1])  # the others are worse than any level
    move[tail] = np.interp(total[tail], levels[::-1], moves[::-1])
    loglik += move


def _score_cells(
    index: LikelihoodIndex,
    view: View,
    cells: NDArray[np.int64],
    *,
    scores: CellScores,
    north_sigma: float,
    off_centre: bool,
) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """Return the log-likelihood of some cells, and the likeliest turns of the photos in each."""
    from semsig_gis.localization.likelihood.off_centre import visible_objects_off_centre  # noqa: PLC0415 - numba, 0.25 s

    models, points = index.observer_offsets if off_centre else (index.models, np.zeros((1, 2)))
    views = (
        visible_objects_off_centre(index.database, cells, points)
        if off_centre
        else visible_objects_in(index.database, cells)
    )
    total, likeliest = np.zeros((len(cells), len(points))), []
    for photo, heading in zip(view.split(), scores.headings, strict=True):
        turns = np.zeros((len(cells), 1)) if heading is None else heading[cells, None] + NEAR_TURNS
        table = PhotoTable.of(photo, index.table)
        point_turns = np.repeat(turns, len(points), axis=0)
        chances = np.zeros(point_turns.shape)
        if heading is not None:
            step, sigma = NEAR_TURNS[1] - NEAR_TURNS[0], own_sigma(photo, north_sigma)
            chances = turn_logs(point_turns, step, sigma)
        logliks = chances + photo_loglik(
            table,
            views,
            *models,
            turns=point_turns,
            log_prior=chances,
            # A place that does not fit one photo may fit the others.
            group=len(points) if len(scores.headings) == 1 else 1,
        )
        logliks = logliks.reshape(len(cells), len(points), -1)
        best = np.logaddexp.reduce(logliks, axis=1).argmax(axis=1)
        likeliest.append(turns[np.arange(len(cells)), best])
        total += np.logaddexp.reduce(logliks, axis=2)
    total *= photo_power(len(likeliest), index.noise)
    return np.logaddexp.reduce(total, axis=1) - math.log(len(points)), likeliest
