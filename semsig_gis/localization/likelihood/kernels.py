"""Compiled loops that score all cells; the tests compare each with a slow, obvious one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import FULL_TURN, compiled, compiled_sums
from semsig_gis.localization.likelihood.records import (
    BINS,
    COARSE_BINS,
    COARSE_LEVELS,
    DISTANCE_LEVELS,
    LANES,
)
from semsig_gis.localization.likelihood.turns import TURN_BLOCK, WIDE_TURNS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.localization.likelihood.records import (
        BinnedObjects,
        LevelModel,
        PhotoGains,
        PhotoRows,
        TurnedPhoto,
    )
    from semsig_gis.localization.likelihood.turns import TurnPrior, TurnScores

# Unsigned constants, all powers of two: divisions by them are shifts.
_ALL_BINS, _COARSE_BINS, _COARSE_LEVELS = map(np.uint64, (BINS, COARSE_BINS, COARSE_LEVELS))
_BINS_A_BIN = np.uint64(BINS // COARSE_BINS)
_BINS_A_TURN = np.uint64(BINS // WIDE_TURNS)
_TURNS, _TWO_TURNS = np.uint64(WIDE_TURNS), np.uint64(2 * WIDE_TURNS)
_BINS_A_LEVEL = np.uint64(BINS * DISTANCE_LEVELS // COARSE_LEVELS)
_LARGE = 1e200  # products beyond this, or below its inverse, become logarithms
_BINS = 1024  # bins of the histogram that finds the best scores
_BINS_A_NAT = np.float32(16.0)
# Gains are logarithms in eighths of an octave: the bits of a float of 32 bits from its third digit
# on are left out.
_ONE_BITS = np.int32(np.float32(1.0).view(np.int32))
_DIGITS_LEFT_OUT = np.int32(20)
_A_GAIN = np.float32(math.log(2.0) / 8.0)


@compiled
def profile_rows(
    fine: NDArray[np.float32],
    shifts: NDArray[np.int64],
    nearness: NDArray[np.float32],
    rows: NDArray[np.float32],
) -> None:
    """Fill `rows`, shape (blocks, groups, levels, bins, LANES), with the density of each detection.

    `fine`, shape (groups, levels, f), is the density of a deviation in steps of a turn over f,
    `shifts` (n,) the bearing of each detection in such steps, and `nearness`, shape
    (groups, levels, n), the density of its range. Lanes after the last detection stay 0.
    """
    groups, levels, steps = fine.shape
    bins = rows.shape[3]
    stride = steps // bins
    for detection in range(len(shifts)):
        block, lane = detection // LANES, detection % LANES
        for group in range(groups):
            for level in range(levels):
                near = nearness[group, level, detection]
                # The deviation of the middle of the first bin; it grows by a bin at a time.
                step = (stride // 2 - shifts[detection]) % steps
                for bin_ in range(bins):
                    rows[block, group, level, bin_, lane] = near * fine[group, level, step]
                    step += stride
                    if step >= steps:
                        step -= steps


@compiled
def _add_up(  # noqa: PLR0917 - a kernel takes no keywords
    objects: tuple[NDArray[np.float32], ...],
    starts: tuple[NDArray[np.uint64], ...],
    count: np.uint64,
    above: np.uint64,
    first: np.uint64,
    photo: tuple[NDArray[np.float32], ...],
    sums: NDArray[np.float32],
) -> None:
    """Fill `sums` (LANES,) with 1 plus what the objects of a place add to a block of detections.

    By object, `objects` has the odds of detection and the share out of range, `starts` the first
    index of the object in the rows and in the names. `photo` has the rows, the names and the disc;
    the block begins at `above` in the rows and at `first` in the others. This is a function of its
    own, and written out, so that the sums stay in one register: a loop over the lanes takes 2.5
    times as long.
    """
    odds, leaving = objects
    row_starts, name_starts = starts
    rows, naming, disc = photo
    a0 = a1 = a2 = a3 = a4 = a5 = a6 = a7 = np.float32(1.0)
    for entry in range(count):
        odd, away = odds[entry], leaving[entry]
        row, name = row_starts[entry] + above, name_starts[entry] + first
        b0 = odd * rows[row] + away * disc[first]
        a0 += b0 * naming[name]
        b1 = odd * rows[row + np.uint64(1)] + away * disc[first + np.uint64(1)]
        a1 += b1 * naming[name + np.uint64(1)]
        b2 = odd * rows[row + np.uint64(2)] + away * disc[first + np.uint64(2)]
        a2 += b2 * naming[name + np.uint64(2)]
        b3 = odd * rows[row + np.uint64(3)] + away * disc[first + np.uint64(3)]
        a3 += b3 * naming[name + np.uint64(3)]
        b4 = odd * rows[row + np.uint64(4)] + away * disc[first + np.uint64(4)]
        a4 += b4 * naming[name + np.uint64(4)]
        b5 = odd * rows[row + np.uint64(5)] + away * disc[first + np.uint64(5)]
        a5 += b5 * naming[name + np.uint64(5)]
        b6 = odd * rows[row + np.uint64(6)] + away * disc[first + np.uint64(6)]
        a6 += b6 * naming[name + np.uint64(6)]
        b7 = odd * rows[row + np.uint64(7)] + away * disc[first + np.uint64(7)]
        a7 += b7 * naming[name + np.uint64(7)]
    sums[0] = a0
    sums[1] = a1
    sums[2] = a2
    sums[3] = a3
    sums[4] = a4
    sums[5] = a5
    sums[6] = a6
    sums[7] = a7


@compiled
def scan(  # noqa: PLR0917 - a kernel takes no keywords
    part: NDArray[np.int64],
    objects: BinnedObjects,
    model: LevelModel,
    photo: PhotoRows,
    totals: NDArray[np.float64],
    products: NDArray[np.float64],
) -> None:
    """Fill `totals` and `products` of the places ``part[0]`` to ``part[1] - 1``.

    The score of a place is its total and the logarithm of its product: the sum over the detections
    of a photo of the logarithm of a sum over the objects.
    """
    offsets, kinds, object_bins = objects.offsets, objects.kinds, objects.bins
    blocks, groups, levels, bins, _ = photo.rows.shape
    longest, classes = len(model.detected) - 1, model.detected.shape[1]
    # Flat arrays and unsigned indices: otherwise numba checks each index for negative values and
    # computes its strides again.
    rows, naming, masses = photo.rows.ravel(), photo.naming.ravel(), photo.masses.ravel()
    detected, remaining = model.detected.ravel(), model.remaining.ravel()
    leaving, disc = model.leaving.ravel(), photo.disc
    lanes, all_lanes = np.uint64(LANES), np.uint64(blocks * LANES)
    block_size = np.uint64(groups * levels * bins * LANES)
    group_starts = (model.group_of * (levels * bins)).astype(np.uint64)
    level_bits = np.uint64(int(math.log2(bins) + 0.5))
    in_sectors = len(masses) > 0
    one_f = np.float32(1.0)
    # Working memory for the place with the most objects.
    most = 0
    for place in range(part[0], part[1]):
        most = max(most, offsets[place + 1] - offsets[place])
    all_odds, all_leaving = np.empty(most, np.float32), np.empty(most, np.float32)
    all_rows, all_names = np.empty(most, np.uint64), np.empty(most, np.uint64)
    sums = np.empty(LANES, np.float32)
    # Tuples for `_add_up`, which are not made again for each place.
    chances, starts = (all_odds, all_leaving), (all_rows, all_names)
    arrays = rows, naming, disc
    for place in range(part[0], part[1]):
        low, count = np.uint64(offsets[place]), np.uint64(offsets[place + 1] - offsets[place])
        length = min(count, np.uint64(longest)) * np.uint64(classes)
        total, product, leaving_sum = photo.base, 1.0, np.float32(0.0)
        # Each object: the chance that it is missed, its odds, and where its numbers begin.
        for entry in range(count):
            kind, bin_ = np.uint64(kinds[low + entry]), np.uint64(object_bins[low + entry])
            level = kind * np.uint64(levels) + (bin_ >> level_bits)
            near = detected[length + kind]
            bin_ += group_starts[kind]
            chance = near * remaining[level]
            missed = one_f - chance
            if in_sectors:
                missed = one_f - chance * masses[bin_]
            all_leaving[entry] = near * leaving[level]
            leaving_sum += all_leaving[entry]
            product *= missed
            if product < 1.0 / _LARGE:
                total += math.log(product)
                product = 1.0
            all_odds[entry] = chance / missed
            all_rows[entry] = bin_ * lanes
            all_names[entry] = (length + kind) * all_lanes
        # Each block of detections: the sum over the objects, and the product of these sums.
        for block in range(np.uint64(blocks)):
            above, first_lane = block * block_size, block * lanes
            _add_up(chances, starts, count, above, first_lane, arrays, sums)
            # Each pair is below 1e38, all eight together may not be.
            for lane in range(0, LANES, 2):
                product *= np.float64(sums[lane] * sums[lane + 1])
            if product > _LARGE or product < 1.0 / _LARGE:
                total += math.log(product)
                product = 1.0
        totals[place] = total - leaving_sum * photo.width
        products[place] = product


@compiled
def gain_rows(  # noqa: C901, PLR0917 - a kernel takes no keywords
    rows: NDArray[np.float32],
    masses: NDArray[np.float32],
    shares: NDArray[np.float32],
    groups: NDArray[np.int64],
    chances: NDArray[np.float32],
    naming: NDArray[np.float32],
    scratch: tuple[NDArray[np.float32], NDArray[np.int32]],
    gains: NDArray[np.uint8],
    means: NDArray[np.float32],
) -> None:
    """Fill `gains`, shape (lengths, kinds, levels, bins, LANES), of the record `PhotoGains`.

    `rows`, shape (groups, levels, bins, LANES), and `masses`, which is empty for a full turn, have
    finer levels and bins; the mean of these masses is written to `means`, shape (groups, levels,
    bins). `shares` are the weights of the finer levels in these means. `groups` is by kind, the
    `chances` of detection by length, kind and level, `naming` by length, kind and lane. `scratch`
    is the same memory as floats and as integers.
    """
    floats, bits = scratch
    lengths, kinds, levels, bins, lanes = gains.shape
    many_levels, many_bins = rows.shape[1] // levels, rows.shape[2] // bins
    sums, one_f = np.empty(lanes, np.float32), np.float32(1.0)
    for group in range(len(rows)):
        for level in range(levels):
            for bin_ in range(bins):
                sums[:] = np.float32(0.0)
                mass = np.float32(0.0)
                for fine in range(level * many_levels, (level + 1) * many_levels):
                    share = shares[fine] / np.float32(many_bins)
                    for step in range(bin_ * many_bins, (bin_ + 1) * many_bins):
                        for lane in range(lanes):
                            sums[lane] += share * rows[group, fine, step, lane]
                        mass += share * (masses[group, fine, step] if masses.size else one_f)
                means[group, level, bin_] = mass
                for kind in range(kinds):
                    if groups[kind] != group:
                        continue
                    for length in range(lengths):
                        chance = chances[length, kind, level]
                        odds = chance / (one_f - chance * mass)
                        for lane in range(lanes):
                            floats[lane] = one_f + odds * sums[lane] * naming[length, kind, lane]
                        # The first bits of a float are about its logarithm.
                        for lane in range(lanes):
                            gain = (bits[lane] - _ONE_BITS) >> _DIGITS_LEFT_OUT
                            gains[length, kind, level, bin_, lane] = min(gain, 255)


@compiled
def scan_gains(
    part: NDArray[np.int64],
    objects: BinnedObjects,
    photo: PhotoGains,
    scores: NDArray[np.float32],
) -> None:
    """Fill `scores` of the places ``part[0]`` to ``part[1] - 1``, about as `scan`.

    Each detection adds the logarithm of the largest term of its sum over the objects, not of all.
    """
    offsets, kinds, object_bins = objects.offsets, objects.kinds, objects.bins
    # Flat arrays and unsigned indices, as in `scan`.
    gains, missed, inside = photo.gains.ravel(), photo.missed.ravel(), photo.inside.ravel()
    length_of, kind_of = photo.length_of, photo.kind_of
    all_kinds, classes = np.uint64(photo.gains.shape[1]), np.uint64(len(kind_of))
    longest, in_sectors = np.uint64(len(length_of) - 1), len(inside) > 0
    for place in range(part[0], part[1]):
        low, high = np.uint64(offsets[place]), np.uint64(offsets[place + 1])
        length = min(high - low, longest)
        above = length_of[length] * all_kinds
        length *= classes
        score = np.float32(photo.base)
        a0 = a1 = a2 = a3 = a4 = a5 = a6 = a7 = np.uint8(0)
        for entry in range(low, high):
            kind, bin_ = np.uint64(kinds[entry]), np.uint64(object_bins[entry])
            level = bin_ // _BINS_A_LEVEL
            row = (above + kind_of[kind]) * _COARSE_LEVELS + level
            row = row * _COARSE_BINS + bin_ % _ALL_BINS // _BINS_A_BIN
            if in_sectors:
                score += inside[row]
            else:
                score += missed[(length + kind) * _COARSE_LEVELS + level]
            row *= np.uint64(LANES)
            a0 = max(a0, gains[row])
            a1 = max(a1, gains[row + np.uint64(1)])
            a2 = max(a2, gains[row + np.uint64(2)])
            a3 = max(a3, gains[row + np.uint64(3)])
            a4 = max(a4, gains[row + np.uint64(4)])
            a5 = max(a5, gains[row + np.uint64(5)])
            a6 = max(a6, gains[row + np.uint64(6)])
            a7 = max(a7, gains[row + np.uint64(7)])
        total = np.int32(a0) + np.int32(a1) + np.int32(a2) + np.int32(a3)
        total += np.int32(a4) + np.int32(a5) + np.int32(a6) + np.int32(a7)
        scores[place] = score + np.float32(total) * _A_GAIN


@compiled
def turned_rows(rows: NDArray[np.float32], turned: NDArray[np.float32]) -> None:
    """Fill `turned`, shape (..., bins // turns, 2 * turns), with rows of shape (..., bins).

    The value of an object in bin ``turns * q + r`` when the photo is turned by t steps is at
    ``[r, t - q]``, modulo the turns: the values of all turns are neighbours in memory.
    """
    bins = rows.shape[1]
    inside, twice = turned.shape[1], turned.shape[2]
    for row in range(len(rows)):
        for bin_ in range(inside):
            for turn in range(twice):
                turned[row, bin_, turn] = rows[row, (bin_ - turn * inside) % bins]


@compiled
def _rescaled(values: NDArray[np.float32]) -> tuple[np.float32, np.float32]:
    """Divide values, in whole blocks, by the largest; return the largest and the new sum."""
    # Eight maxima and sums at a time, each in a lane of one register.
    a0 = a1 = a2 = a3 = a4 = a5 = a6 = a7 = np.float32(0.0)
    b0 = b1 = b2 = b3 = b4 = b5 = b6 = b7 = np.float32(0.0)
    for place in range(np.uint64(0), np.uint64(len(values)), np.uint64(LANES)):
        a0 = max(a0, values[place])
        a1 = max(a1, values[place + np.uint64(1)])
        a2 = max(a2, values[place + np.uint64(2)])
        a3 = max(a3, values[place + np.uint64(3)])
        a4 = max(a4, values[place + np.uint64(4)])
        a5 = max(a5, values[place + np.uint64(5)])
        a6 = max(a6, values[place + np.uint64(6)])
        a7 = max(a7, values[place + np.uint64(7)])
        b0 += values[place]
        b1 += values[place + np.uint64(1)]
        b2 += values[place + np.uint64(2)]
        b3 += values[place + np.uint64(3)]
        b4 += values[place + np.uint64(4)]
        b5 += values[place + np.uint64(5)]
        b6 += values[place + np.uint64(6)]
        b7 += values[place + np.uint64(7)]
    most = max(a0, a1, a2, a3, a4, a5, a6, a7)
    for place in range(len(values)):
        values[place] /= most
    return most, ((b0 + b1) + (b2 + b3) + (b4 + b5) + (b6 + b7)) / most


@compiled
def scan_turned(  # noqa: C901, PLR0912, PLR0915, PLR0917 - a kernel takes no keywords
    part: NDArray[np.int64],
    objects: BinnedObjects,
    model: LevelModel,
    photo: PhotoRows,
    prior: TurnPrior,
    before: TurnScores,
    after: TurnScores,
    scores: NDArray[np.float32],
    best: NDArray[np.int16],
) -> None:
    """Fill `scores` as `scan`, summed over turns of the photo, and `best` with the likeliest turn.

    The rows of the photo, shape (n, groups, levels, bins // turns, 2 * turns), and its masses are
    those of `turned_rows`. `after` gets the likelihood by turn, if it has room. `before`, if it is
    not empty, is that of the same photo without these detections.
    """
    offsets, kinds, object_bins = objects.offsets, objects.kinds, objects.bins
    group_of, detected, remaining = model.group_of, model.detected, model.remaining
    leaving, naming, disc = model.leaving, photo.naming, photo.disc
    first, chances = prior.first, prior.chances
    before_logs, before_shares = before.logs, before.shares
    after_logs, after_shares = after.logs, after.shares
    size, groups, levels, inside, twice = photo.rows.shape
    all_turns, ways = twice // 2, len(chances)
    bins = inside * all_turns
    longest, classes = len(detected) - 1, detected.shape[1]
    # Flat arrays and unsigned indices, as in `scan`.
    rows, flat_naming, masses = photo.rows.ravel(), naming.ravel(), photo.masses.ravel()
    in_sectors, at_edge = len(masses) > 0, leaving.max() > 0.0
    fresh, written = len(before_shares) == 0, len(after_shares) > 0
    most = 0
    for place in range(part[0], part[1]):
        most = max(most, offsets[place + 1] - offsets[place])
    starts = np.empty(most, np.uint64)
    # Odds by turn in sectors; in a full turn they are the same for all: one block of turns does.
    room = ways if in_sectors else TURN_BLOCK
    odds = np.empty(most * room, np.float32)
    sums = np.empty(ways, np.float32)
    product = np.empty(ways, np.float32)
    missed = np.ones(ways, np.float32)
    floors = np.empty(size, np.float32)
    leaving_of = np.zeros(classes, np.float32)
    one_f = np.float32(1.0)
    all_ways, block = np.uint64(ways), np.uint64(TURN_BLOCK)
    per_object, per_turn = np.uint64(room), np.uint64(1 if in_sectors else 0)
    per_detection = np.uint64(groups * levels * inside * twice)
    for place in range(part[0], part[1]):
        low, count = offsets[place], offsets[place + 1] - offsets[place]
        length = min(count, longest)
        # What any detection has from objects that came into range as others left it.
        leaving_sum = np.float32(0.0)
        floors[:] = one_f
        if at_edge:
            for entry in range(low, low + count):
                kind = kinds[entry]
                leaving_of[kind] += (
                    detected[length, kind] * leaving[kind, object_bins[entry] // bins]
                )
            for kind in range(classes):
                if leaving_of[kind] > 0.0:
                    leaving_sum += leaving_of[kind]
                    for detection in range(size):
                        floors[detection] += (
                            leaving_of[kind] * naming[length, kind, detection] * disc[detection]
                        )
                    leaving_of[kind] = 0.0
        # The likelihood by turn is e to the power of `total`, times `scale`, times `product`.
        total, scale = photo.base, 1.0
        if fresh:
            total -= float(leaving_sum) * photo.width
            for way in range(ways):
                product[way] = chances[way]
        else:
            total += before_logs[place]
            product[:] = before_shares[place]
        # Each object: its odds by turn, and the chance that it is missed.
        for entry in range(count):
            kind, bin_ = kinds[low + entry], object_bins[low + entry]
            level, bin_ = bin_ // bins, bin_ % bins
            chance = detected[length, kind] * remaining[kind, level]
            start = (first - bin_ // inside) % all_turns
            start += ((group_of[kind] * levels + level) * inside + bin_ % inside) * twice
            starts[entry] = start
            own = odds[entry * room : (entry + 1) * room]
            if in_sectors:
                shares = masses[start : start + ways]
                for way in range(ways):
                    none = one_f - chance * shares[way]
                    own[way] = chance / none
                    missed[way] *= none
                # A product of up to eight chances of a miss cannot run below the smallest number.
                if entry % LANES == LANES - 1 or entry == count - 1:
                    if fresh:
                        for way in range(ways):
                            product[way] *= missed[way]
                        scale *= float(_rescaled(product)[0])
                    missed[:] = one_f
            else:
                own[:] = chance / (one_f - chance)
                if fresh:
                    scale *= float(one_f - chance)
            if scale < 1.0 / _LARGE:
                total += math.log(scale)
                scale = 1.0
        # Each detection: the sum over the objects, for sixteen turns at a time. It is written out
        # so that the sums stay in two registers; a loop takes twice as long.
        for detection in range(size):
            above = np.uint64(detection) * per_detection
            for way in range(np.uint64(0), all_ways, block):
                a0 = a1 = a2 = a3 = a4 = a5 = a6 = a7 = floors[detection]
                b0 = b1 = b2 = b3 = b4 = b5 = b6 = b7 = floors[detection]
                for entry in range(np.uint64(count)):
                    kind = kinds[np.uint64(low) + entry]
                    factor = flat_naming[np.uint64((length * classes + kind) * size + detection)]
                    at, of = above + starts[entry] + way, entry * per_object + way * per_turn
                    a0 += factor * odds[of] * rows[at]
                    a1 += factor * odds[of + np.uint64(1)] * rows[at + np.uint64(1)]
                    a2 += factor * odds[of + np.uint64(2)] * rows[at + np.uint64(2)]
                    a3 += factor * odds[of + np.uint64(3)] * rows[at + np.uint64(3)]
                    a4 += factor * odds[of + np.uint64(4)] * rows[at + np.uint64(4)]
                    a5 += factor * odds[of + np.uint64(5)] * rows[at + np.uint64(5)]
                    a6 += factor * odds[of + np.uint64(6)] * rows[at + np.uint64(6)]
                    a7 += factor * odds[of + np.uint64(7)] * rows[at + np.uint64(7)]
                    b0 += factor * odds[of + np.uint64(8)] * rows[at + np.uint64(8)]
                    b1 += factor * odds[of + np.uint64(9)] * rows[at + np.uint64(9)]
                    b2 += factor * odds[of + np.uint64(10)] * rows[at + np.uint64(10)]
                    b3 += factor * odds[of + np.uint64(11)] * rows[at + np.uint64(11)]
                    b4 += factor * odds[of + np.uint64(12)] * rows[at + np.uint64(12)]
                    b5 += factor * odds[of + np.uint64(13)] * rows[at + np.uint64(13)]
                    b6 += factor * odds[of + np.uint64(14)] * rows[at + np.uint64(14)]
                    b7 += factor * odds[of + np.uint64(15)] * rows[at + np.uint64(15)]
                sums[way] = a0
                sums[way + np.uint64(1)] = a1
                sums[way + np.uint64(2)] = a2
                sums[way + np.uint64(3)] = a3
                sums[way + np.uint64(4)] = a4
                sums[way + np.uint64(5)] = a5
                sums[way + np.uint64(6)] = a6
                sums[way + np.uint64(7)] = a7
                sums[way + np.uint64(8)] = b0
                sums[way + np.uint64(9)] = b1
                sums[way + np.uint64(10)] = b2
                sums[way + np.uint64(11)] = b3
                sums[way + np.uint64(12)] = b4
                sums[way + np.uint64(13)] = b5
                sums[way + np.uint64(14)] = b6
                sums[way + np.uint64(15)] = b7
            for way in range(ways):
                product[way] *= sums[way]
            scale *= float(_rescaled(product)[0])
            if scale > _LARGE or scale < 1.0 / _LARGE:
                total += math.log(scale)
                scale = 1.0
        # The sum over the turns, and the first likeliest turn: its share is 1.
        unit, mass = _rescaled(product)
        if written:
            after_logs[place] = total + math.log(scale * unit)
            after_shares[place] = product
        way = 0
        while product[way] < one_f:
            way += 1
        best[place] = first + way
        scores[place] = total + math.log(scale * unit * mass)


@compiled_sums
def scan_profiles(  # noqa: C901, PLR0912, PLR0915, PLR0917 - a kernel takes no keywords
    part: NDArray[np.int64],
    objects: BinnedObjects,
    model: LevelModel,
    photo: TurnedPhoto,
    scores: NDArray[np.float32],
    best: NDArray[np.int64],
) -> None:
    """Fill `scores` as `scan`, summed over turns of the photo, and `best` with the likeliest turn.

    First the objects of a place make profiles by bearing: one for each class of the photo, and one
    for detections of other names. Then each detection reads them at all turns.
    """
    offsets, kinds, object_bins = objects.offsets, objects.kinds, objects.bins
    longest, classes = np.uint64(len(model.detected) - 1), np.uint64(model.detected.shape[1])
    detected, remaining = model.detected.ravel(), model.remaining.ravel()
    leaving, group_of = model.leaving.ravel(), model.group_of.astype(np.uint64)
    own, other, rows = photo.own.ravel(), photo.other.ravel(), photo.rows.ravel()
    levels, steps = np.uint64(model.remaining.shape[1]), np.uint64(photo.rows.shape[2])
    # Not a constant, or loops are written out instead of vectorized.
    turns = len(photo.chances)
    profile_of, one_f = photo.profile_of.astype(np.uint64), np.float32(1.0)
    # Profiles of objects, the first for other names; those of detections have two turns each.
    profiles = np.empty((photo.profile_of.max() + 1) * WIDE_TURNS, np.float32)
    doubled = np.empty(2 * len(profiles), np.float32)
    floors = np.empty(photo.profile_of.max() + 1, np.float32)
    product = np.empty(WIDE_TURNS, np.float32)
    for place in range(part[0], part[1]):
        low, high = np.uint64(offsets[place]), np.uint64(offsets[place + 1])
        length = min(high - low, longest) * classes
        profiles[:] = np.float32(0.0)
        floors[:] = np.float32(0.0)
        total, unseen, all_leaving = photo.base, 1.0, np.float32(0.0)
        for entry in range(low, high):
            kind, bin_ = np.uint64(kinds[entry]), np.uint64(object_bins[entry])
            level, bin_ = bin_ // _ALL_BINS, bin_ % _ALL_BINS
            near = detected[length + kind]
            chance = near * remaining[kind * levels + level]
            unseen *= one_f - chance
            if unseen < 1.0 / _LARGE:
                total += math.log(unseen)
                unseen = 1.0
            odds = chance / (one_f - chance)
            # The density at each turn from the bearing of the object on.
            row = (group_of[kind] * levels + level) * steps + bin_ % _BINS_A_TURN
            row = row * _TWO_TURNS + _TURNS - bin_ // _BINS_A_TURN
            weight = odds * other[length + kind]
            for turn in range(turns):
                profiles[turn] += weight * rows[row + np.uint64(turn)]
            # Objects that came into range as others left it, in any direction.
            away = near * leaving[kind * levels + level]
            all_leaving += away
            away /= np.float32(FULL_TURN)
            floors[0] += away * other[length + kind]
            profile = profile_of[kind]
            if profile > 0:
                weight = odds * own[length + kind]
                first = profile * _TURNS
                for turn in range(turns):
                    profiles[first + np.uint64(turn)] += weight * rows[row + np.uint64(turn)]
                floors[profile] += away * own[length + kind]
        total += math.log(unseen) - float(all_leaving)
        for profile in range(np.uint64(1), np.uint64(len(floors))):
            floor, first = one_f + floors[profile] + floors[0], profile * _TURNS
            for turn in range(turns):
                at = first + first + np.uint64(turn)
                doubled[at] = floor + profiles[first + np.uint64(turn)] + profiles[turn]
            for turn in range(turns):
                at = first + first + np.uint64(turn)
                doubled[at + _TURNS] = doubled[at]
        product[:] = photo.chances
        for detection in range(len(photo.sectors)):
            first = np.uint64(photo.profiles[detection]) * _TWO_TURNS
            first += np.uint64(photo.sectors[detection])
            for turn in range(turns):
                product[turn] *= doubled[first + np.uint64(turn)]
            if (detection + 1) % 4 == 0:  # four sums are below 1e38
                mass = np.float32(0.0)
                for turn in range(turns):
                    mass += product[turn]
                total += math.log(mass)
                share = one_f / mass
                for turn in range(turns):
                    product[turn] *= share
        likeliest, mass, most = 0, np.float32(0.0), np.float32(0.0)
        for turn in range(turns):
            mass += product[turn]
            most = max(most, product[turn])
        while product[likeliest] < most:
            likeliest += 1
        best[place] = likeliest
        scores[place] = total + math.log(mass)


@compiled
def promising_cells(scores: NDArray[np.float32], count: int) -> NDArray[np.int64]:
    """Return the cells of the `count` highest scores and a few more, ascending, without sorting.

    Each other cell is worse than at least `count` of these. NaN is lower than any number.
    """
    last_bin = np.float32(_BINS - 1)
    top = np.float32(-np.inf)
    for score in scores:
        top = max(top, score)
    if top == -np.inf:
        return np.arange(len(scores))
    # A histogram of the differences from the best score; the last bin takes all large ones.
    counts = np.zeros(_BINS, np.int64)
    for score in scores:
        below = (top - score) * _BINS_A_NAT
        counts[int(below) if below < last_bin else _BINS - 1] += 1  # NaN is not below
    # The bins that hold the `count` best, and the cells in these bins.
    last, inside = 0, counts[0]
    while inside < count:
        last += 1
        inside += counts[last]
    best = np.empty(inside, np.int64)
    filled = 0
    for cell in range(len(scores)):
        below = (top - scores[cell]) * _BINS_A_NAT
        if (int(below) if below < last_bin else _BINS - 1) <= last:
            best[filled] = cell
            filled += 1
    return best


@compiled
def count_types(  # noqa: C901, PLR0912, PLR0917 - a kernel takes no keywords
    offsets: NDArray[np.int64],
    codes: NDArray[np.uint8],
    row_of: NDArray[np.int64],
    query: NDArray[np.int64],
    detected: NDArray[np.float64],
    misnamed: NDArray[np.float64],
    others: NDArray[np.float64],
    clutter: NDArray[np.float64],
    scores: NDArray[np.float32],
) -> None:
    """Compare the numbers of objects by class of a query with those of each type sequence.

    Fills `scores`, shape (d,), with log-likelihoods. `query`, shape (k + 1,), counts the objects
    of the query by class, those of unknown class last. By length and class, `detected` is the
    chance of detection and `misnamed` that of another name, with shares `others`, shape (k, k);
    `clutter` is the expected number of false objects in a signature, and `row_of` the row of each
    class code.
    """
    kinds = len(clutter)
    most = 0
    for row in range(len(offsets) - 1):
        most = max(most, offsets[row + 1] - offsets[row])
    size = query.sum()
    # Logarithms of factorials, looked up below.
    factorials = np.zeros(max(most, size) + 1)
    for value in range(1, len(factorials)):
        factorials[value] = factorials[value - 1] + math.log(value)
    share = (size - query[kinds]) / size  # of detections of known class
    counts = np.empty(kinds, np.int64)
    here = np.empty(kinds, np.int64)  # classes of a sequence, ascending
    for row in range(len(scores)):
        length = min(offsets[row + 1] - offsets[row], len(detected) - 1)
        counts[:] = 0
        for entry in range(offsets[row], offsets[row + 1]):
            counts[row_of[codes[entry]]] += 1
        different = 0
        for kind in range(kinds):
            if counts[kind] > 0:
                here[different] = kind
                different += 1
        total = 0.0
        unnamed = 0.0  # expected detections of any name
        # Each name: the number that the query has, over all splits into right and wrong names.
        for name in range(kinds):
            stray = clutter[name]  # expected detections of other things under this name
            for kind in here[:different]:
                if kind != name:
                    chance = misnamed[length, kind] * others[kind, name]
                    stray += counts[kind] * detected[length, kind] * chance
            unnamed += clutter[name] + counts[name] * detected[length, name]
            stray *= share
            chance = share * detected[length, name] * (1.0 - misnamed[length, name])
            own, number = counts[name], query[name]
            if stray == 0.0:
                continue  # no class of the query is known
            if own == 0 and number == 0:
                total -= stray
                continue
            # Binomial hits and Poisson strays that add up to the number of the query, as
            # logarithms: `mass` is relative to the largest term, `peak`.
            peak = -np.inf
            mass = 0.0
            for hits in range(min(own, number) + 1):
                part = (
                    factorials[own]
                    - factorials[hits]
                    - factorials[own - hits]
                    + hits * math.log(chance)
                    + (own - hits) * math.log1p(-chance)
                    + (number - hits) * math.log(stray)
                    - factorials[number - hits]
                    - stray
                )
                if part > peak:
                    mass = mass * math.exp(peak - part) + 1.0
                    peak = part
                else:
                    mass += math.exp(part - peak)
            total += peak + math.log(mass)
        # Objects of unknown class: a Poisson number of all detections.
        if query[kinds] > 0:
            unnamed *= 1.0 - share
            total += query[kinds] * math.log(unnamed) - factorials[query[kinds]] - unnamed
        scores[row] = total
