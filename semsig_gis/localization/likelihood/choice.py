"""Choose the cells to re-rank: quick one-to-one sums at the centres of cells.

The sum over detections one by one counts an object that explains several detections several times:
in cells with many objects it is far too high. The quick sum takes the same binned densities, and
some rounds of belief propagation (see `likelihood.association`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import FULL_TURN, compiled, compiled_sums, share_rows
from semsig_gis.localization.likelihood.index import own_sigma, photo_power, photo_rows
from semsig_gis.localization.likelihood.records import BINS
from semsig_gis.localization.likelihood.turns import turn_logs

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from semsig_gis.localization.likelihood.index import CellScores, LikelihoodIndex
    from semsig_gis.localization.likelihood.records import BinnedObjects, LevelModel, PhotoRows
    from semsig_gis.observation import View

    _TurnedScores = tuple[NDArray[np.float64], list[NDArray[np.float64]]]

CELLS_A_THREAD = 128  # the fewest cells that are worth a thread
NEAR_TURNS = np.array([-4.5, 0.0, 4.5])  # degrees around the likeliest turn of the scan
_ROUNDS = 3  # of messages
_LEAST_WEIGHT = np.float32(1e-3)  # of all pairs of an object, against a miss
_LARGE = 1e200  # products beyond this, or below its inverse, become logarithms


def quick_scorer(
    index: LikelihoodIndex, view: View, scores: CellScores, *, north_sigma: float
) -> Callable[[NDArray[np.int64], NDArray[np.float64]], _TurnedScores]:
    """Return a function of cells: about the one-to-one log-likelihood of a view at their centres.

    It is that of the mean of the noise models. Photos of uncertain north are turned to about the
    likeliest turns in the `scores` of the scan; the best turn of each photo is returned as well.
    The second argument of the function is a score by cell: where the log-likelihood is surely
    lower, an upper bound of it is enough.
    """
    photos = view.split()
    # The detections of an object are neighbours in memory.
    rows = [photo_rows(photo, index.levels) for photo in photos]
    rows = [row._replace(rows=np.ascontiguousarray(np.moveaxis(row.rows, 0, 3))) for row in rows]
    sigmas = [own_sigma(photo, north_sigma) for photo in photos]
    power = photo_power(len(photos), index.noise)
    step = float(NEAR_TURNS[1] - NEAR_TURNS[0])

    def score(cells: NDArray[np.int64], least: NDArray[np.float64]) -> _TurnedScores:
        # A cell that does not fit one photo, or one turn, may fit the others.
        total, best = np.zeros(len(cells)), []
        each = (
            least - math.log(len(NEAR_TURNS)) if len(photos) == 1 else np.full(len(cells), -np.inf)
        )
        for row, heading, sigma in zip(rows, scores.headings, sigmas, strict=True):
            turns, prior = np.zeros((len(cells), 1)), np.zeros(1)
            if heading is not None:
                turns = heading[cells, None] + NEAR_TURNS
                prior = turn_logs(turns, step, sigma)
            logliks = _by_turn(index, row, cells, turns, each) + prior
            total += np.logaddexp.reduce(logliks, axis=1)
            best.append(turns[np.arange(len(cells)), logliks.argmax(axis=1)])
        return total * power, best

    return score


def _by_turn(
    index: LikelihoodIndex,
    photo: PhotoRows,
    cells: NDArray[np.int64],
    turns: NDArray[np.float64],
    least: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the log-likelihood of a photo in some cells by turn in degrees, both of one shape."""
    shifts = np.rint(turns * (BINS / FULL_TURN)).astype(np.int64) % BINS
    logliks = np.empty(turns.shape)
    (objects, rows), model = index.objects_of(cells), index.levels.model
    share_rows(
        lambda part: _associate_cells(part, rows, least, objects, model, photo, shifts, logliks),
        len(cells),
        least=CELLS_A_THREAD,
    )
    return logliks


@compiled
def _log_product(values: NDArray[np.float32]) -> float:
    """Return the logarithm of the product of numbers."""
    total, product = 0.0, 1.0
    for value in values:
        product *= np.float64(value)
        if product > _LARGE or product < 1.0 / _LARGE:
            total += math.log(product)
            product = 1.0
    return total + math.log(product)


@compiled_sums
def _associate_cells(  # noqa: C901, PLR0912, PLR0915, PLR0917 - a kernel takes no keywords
    part: NDArray[np.int64],
    cells: NDArray[np.int64],
    least: NDArray[np.float64],
    objects: BinnedObjects,
    model: LevelModel,
    photo: PhotoRows,
    shifts: NDArray[np.int64],
    totals: NDArray[np.float64],
) -> None:
    """Fill `totals`, shape (cells, turns), for ``cells[part[0]]`` to ``cells[part[1] - 1]``.

    `shifts` are the turns in bins. The rows of the photo, shape (groups, levels, bins, blocks,
    lanes), and its other arrays are in whole blocks of lanes; those that fill the last block have
    no name. Where the likelihood is below `least`, an upper bound of it is enough.
    """
    offsets, kinds, object_bins = objects.offsets, objects.kinds, objects.bins
    _, levels, bins, blocks, lanes = photo.rows.shape
    longest, classes = len(model.detected) - 1, model.detected.shape[1]
    # Flat arrays and unsigned indices, as in `kernels.scan`.
    rows, naming, masses = photo.rows.ravel(), photo.naming.ravel(), photo.masses.ravel()
    detected, remaining = model.detected.ravel(), model.remaining.ravel()
    leaving, disc = model.leaving.ravel(), photo.disc
    group_starts = (model.group_of * (levels * bins)).astype(np.uint64)
    size, all_bins, all_levels = np.uint64(blocks * lanes), np.uint64(bins), np.uint64(levels)
    in_sectors = len(masses) > 0
    one_f = np.float32(1.0)
    most = 0
    for number in range(part[0], part[1]):
        most = max(most, offsets[cells[number] + 1] - offsets[cells[number]])
    # Weights of pairs and messages from objects to detections: all detections of an object, and
    # then the next object. By detection, 1 plus the sum of its messages, and other sums.
    weights, messages = np.empty(most * size, np.float32), np.empty(most * size, np.float32)
    sums, floor = np.empty(size, np.float32), np.empty(size, np.float32)
    shares, others = np.empty(size, np.float32), np.empty(size, np.float32)
    at_object = np.empty(most, np.float32)
    for number in range(part[0], part[1]):
        low = np.uint64(offsets[cells[number]])
        count = np.uint64(offsets[cells[number] + 1]) - low
        length = min(count, np.uint64(longest)) * np.uint64(classes)
        for way in range(shifts.shape[1]):
            shift = all_bins - np.uint64(shifts[number, way])
            total, unseen, all_leaving, used = photo.base, 1.0, np.float32(0.0), np.uint64(0)
            floor[:] = one_f
            # The weights of pairs: one thing, against a miss.
            for entry in range(low, low + count):
                kind, bin_ = np.uint64(kinds[entry]), np.uint64(object_bins[entry])
                level = bin_ // all_bins
                place = group_starts[kind] + level * all_bins + (bin_ + shift) % all_bins
                near = detected[length + kind]
                chance = near * remaining[kind * all_levels + level]
                missed = one_f - chance
                if in_sectors:
                    missed = one_f - chance * masses[place]
                unseen *= missed
                if unseen < 1.0 / _LARGE:
                    total += math.log(unseen)
                    unseen = 1.0
                odds, own = chance / missed, np.float32(0.0)
                row, name, first = place * size, (length + kind) * size, used * size
                for detection in range(size):
                    weight = odds * rows[row + detection] * naming[name + detection]
                    weights[first + detection] = weight
                    own += weight
                used += np.uint64(own > _LEAST_WEIGHT)  # others are written over
                away = near * leaving[kind * all_levels + level]
                if away > 0.0:
                    all_leaving += away
                    for detection in range(size):
                        floor[detection] += away * disc[detection] * naming[name + detection]
            total += math.log(unseen) - float(all_leaving) * photo.width + _log_product(floor)
            # Against false detections, with objects that came into range as others left it. The sum
            # over the detections one by one is an upper bound.
            for detection in range(size):
                shares[detection] = one_f / floor[detection]
                sums[detection] = one_f
            for entry in range(used):
                first = entry * size
                for detection in range(size):
                    weight = weights[first + detection] * shares[detection]
                    weights[first + detection] = messages[first + detection] = weight
                    sums[detection] += weight
            bound = total + _log_product(sums)
            # A lower bound: for any numbers of 1 or more by object, their product times the sum
            # with weights that are divided by them. Here they are the expected detections.
            if bound >= least[number]:
                for detection in range(size):
                    shares[detection] = one_f / sums[detection]
                    others[detection] = one_f
                factors = 1.0
                for entry in range(used):
                    first, expected = entry * size, np.float32(0.0)
                    for detection in range(size):
                        expected += weights[first + detection] * shares[detection]
                    expected = max(expected, one_f)
                    factors *= float(expected)
                    for detection in range(size):
                        others[detection] += weights[first + detection] / expected
                bound = min(bound, total + math.log(factors) + _log_product(others))
            if bound < least[number]:
                totals[number, way] = bound
                continue
            # Belief propagation, as in `association_kernels.sum_associations`, for all detections
            # of an object at once.
            for _ in range(_ROUNDS):
                for entry in range(used):
                    first, here = entry * size, one_f
                    for detection in range(size):
                        rest = max(sums[detection] - messages[first + detection], one_f)
                        shares[detection] = weights[first + detection] / rest
                        here += shares[detection]
                    at_object[entry] = here
                    for detection in range(size):
                        rest = max(here - shares[detection], one_f)
                        message = weights[first + detection] / rest
                        sums[detection] += message - messages[first + detection]
                        messages[first + detection] = message
            # The Bethe approximation of the sum.
            total += _log_product(sums)
            for entry in range(used):
                first = entry * size
                for detection in range(size):
                    rest = max(sums[detection] - messages[first + detection], one_f)
                    shares[detection] = rest / (rest + messages[first + detection])
                total += math.log(at_object[entry]) + _log_product(shares)
            totals[number, way] = total
