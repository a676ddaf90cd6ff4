"""Scores of all cells, as loops that are compiled; each has a slow, obvious twin in the tests."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

_LARGE = 1e200  # from which on a product becomes a logarithm
LANES = 8
"""Detections that are added up together."""
TURNED_LANES = 16
"""Turns that are added up together."""
_BINS = 1024  # scores are counted in so many bins to find the best of them
_BINS_A_NAT = np.float32(16.0)


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
    (groups, levels, n), the density of its range. What is beyond the last detection stays 0.
    """
    groups, levels, steps = fine.shape
    bins = rows.shape[3]
    wide = steps // bins
    for two in range(len(shifts)):
        block, lane = two // LANES, two % LANES
        for group in range(groups):
            for level in range(levels):
                near = nearness[group, level, two]
                place = (wide // 2 - shifts[two]) % steps
                for one in range(bins):
                    rows[block, group, level, one, lane] = near * fine[group, level, place]
                    place += wide
                    if place >= steps:
                        place -= steps


@compiled
def _add_up(  # noqa: PLR0917
    odds: NDArray[np.float32],
    away: NDArray[np.float32],
    at: NDArray[np.uint64],
    names: NDArray[np.uint64],
    count: np.uint64,
    above: np.uint64,
    first: np.uint64,
    flat_rows: NDArray[np.float32],
    flat_named: NDArray[np.float32],
    disc: NDArray[np.float32],
    sums: NDArray[np.float32],
) -> None:
    """Fill `sums` with what one block of detections has from the objects of a place.

    A function of its own, or the eight sums are not added up in one go.
    """
    a0 = a1 = a2 = a3 = a4 = a5 = a6 = a7 = np.float32(1.0)
    for one in range(count):
        odd, left, row, name = odds[one], away[one], at[one] + above, names[one] + first
        b0 = odd * flat_rows[row] + left * disc[first]
        a0 += b0 * flat_named[name]
        b1 = odd * flat_rows[row + np.uint64(1)] + left * disc[first + np.uint64(1)]
        a1 += b1 * flat_named[name + np.uint64(1)]
        b2 = odd * flat_rows[row + np.uint64(2)] + left * disc[first + np.uint64(2)]
        a2 += b2 * flat_named[name + np.uint64(2)]
        b3 = odd * flat_rows[row + np.uint64(3)] + left * disc[first + np.uint64(3)]
        a3 += b3 * flat_named[name + np.uint64(3)]
        b4 = odd * flat_rows[row + np.uint64(4)] + left * disc[first + np.uint64(4)]
        a4 += b4 * flat_named[name + np.uint64(4)]
        b5 = odd * flat_rows[row + np.uint64(5)] + left * disc[first + np.uint64(5)]
        a5 += b5 * flat_named[name + np.uint64(5)]
        b6 = odd * flat_rows[row + np.uint64(6)] + left * disc[first + np.uint64(6)]
        a6 += b6 * flat_named[name + np.uint64(6)]
        b7 = odd * flat_rows[row + np.uint64(7)] + left * disc[first + np.uint64(7)]
        a7 += b7 * flat_named[name + np.uint64(7)]
    sums[0] = a0
    sums[1] = a1
    sums[2] = a2
    sums[3] = a3
    sums[4] = a4
    sums[5] = a5
    sums[6] = a6
    sums[7] = a7


@compiled
def scan(  # noqa: PLR0917
    part: NDArray[np.int64],
    offsets: NDArray[np.int64],
    kinds: NDArray[np.uint8],
    places: NDArray[np.uint16],
    group_of: NDArray[np.int64],
    rows: NDArray[np.float32],
    masses: NDArray[np.float32],
    width: float,
    named: NDArray[np.float32],
    disc: NDArray[np.float32],
    detected: NDArray[np.float32],
    seen: NDArray[np.float32],
    left: NDArray[np.float32],
    base: float,
    totals: NDArray[np.float64],
    products: NDArray[np.float64],
) -> None:
    """Fill `totals` and `products` of the cells ``part[0]`` to ``part[1] - 1``.

    The score of a cell is its total and the logarithm of its product: the sum over the detections
    of a photo of the logarithm of a sum over the objects. An object has a class row in `kinds` and
    a level of its distance and a bin of its bearing in `places`. By the group of its class
    (`group_of`) and its place, `rows` are those of `profile_rows`, and `masses` those of
    `mass_rows`, without a level where all round was seen. `named`, shape (lengths, k,
    blocks * LANES), is the chance of a name over the density of such false detections, `disc` the
    factor of their range. By length and class, `detected` is the chance of detection of what is
    near; by class and level, `seen` is what is left of it, and `left` what has left the range.
    `base` is what all get.
    """
    blocks, groups, levels, bins = rows.shape[0], rows.shape[1], rows.shape[2], rows.shape[3]
    longest, classes = len(detected) - 1, detected.shape[1]
    # Flat arrays and unsigned numbers, or each look-up is checked and worked out anew.
    lanes, wide = np.uint64(LANES), np.uint64(blocks * LANES)
    block_size = np.uint64(groups * levels * bins * LANES)
    flat_rows, flat_named, flat_masses = rows.ravel(), named.ravel(), masses.ravel()
    flat_detected, flat_seen, flat_left = detected.ravel(), seen.ravel(), left.ravel()
    partial = len(flat_masses) > 0
    starts = (group_of * (levels * bins)).astype(np.uint64)
    shift = np.uint64(int(math.log2(bins) + 0.5))
    one_f = np.float32(1.0)
    most = 0
    for cell in range(part[0], part[1]):
        most = max(most, offsets[cell + 1] - offsets[cell])
    odds, away = np.empty(most, np.float32), np.empty(most, np.float32)
    at, names = np.empty(most, np.uint64), np.empty(most, np.uint64)
    sums = np.empty(LANES, np.float32)
    for cell in range(part[0], part[1]):
        low, count = np.uint64(offsets[cell]), np.uint64(offsets[cell + 1] - offsets[cell])
        length = min(count, np.uint64(longest)) * np.uint64(classes)
        total, product, gone = base, 1.0, np.float32(0.0)
        for one in range(count):
            kind, place = np.uint64(kinds[low + one]), np.uint64(places[low + one])
            level = kind * np.uint64(levels) + (place >> shift)
            near = flat_detected[length + kind]
            place += starts[kind]
            chance = near * flat_seen[level]
            missed = one_f - chance
            if partial:
                missed = one_f - chance * flat_masses[place]
            away[one] = near * flat_left[level]
            gone += away[one]
            product *= missed
            if product < 1.0 / _LARGE:
                total += math.log(product)
                product = 1.0
            odds[one] = chance / missed
            at[one] = place * lanes
            names[one] = (length + kind) * wide
        for block in range(np.uint64(blocks)):
            first, above = block * lanes, block * block_size
            _add_up(odds, away, at, names, count, above, first, flat_rows, flat_named, disc, sums)
            # Each pair is below 1e38, all eight together may not be.
            for lane in range(0, LANES, 2):
                product *= np.float64(sums[lane] * sums[lane + 1])
            if product > _LARGE or product < 1.0 / _LARGE:
                total += math.log(product)
                product = 1.0
        totals[cell] = total - gone * width
        products[cell] = product


@compiled
def turned_rows(rows: NDArray[np.float32], turned: NDArray[np.float32]) -> None:
    """Fill `turned`, shape (..., bins // turns, 2 * turns), with rows of shape (..., bins).

    What an object in bin ``turns * q + r`` has when the photo is turned by t steps stands at
    ``[r, t - q]``, modulo the turns, so that all turns stand side by side.
    """
    bins = rows.shape[1]
    inside, twice = turned.shape[1], turned.shape[2]
    for row in range(len(rows)):
        for part in range(inside):
            for turn in range(twice):
                turned[row, part, turn] = rows[row, (part - turn * inside) % bins]


@compiled
def _rescaled(values: NDArray[np.float32]) -> tuple[np.float32, np.float32]:
    """Divide values, whole blocks of them, by the largest; return that, and what they add up to."""
    # Side by side, as in `scan`.
    a0 = a1 = a2 = a3 = a4 = a5 = a6 = a7 = np.float32(0.0)
    b0 = b1 = b2 = b3 = b4 = b5 = b6 = b7 = np.float32(0.0)
    for one in range(np.uint64(0), np.uint64(len(values)), np.uint64(LANES)):
        a0 = max(a0, values[one])
        a1 = max(a1, values[one + np.uint64(1)])
        a2 = max(a2, values[one + np.uint64(2)])
        a3 = max(a3, values[one + np.uint64(3)])
        a4 = max(a4, values[one + np.uint64(4)])
        a5 = max(a5, values[one + np.uint64(5)])
        a6 = max(a6, values[one + np.uint64(6)])
        a7 = max(a7, values[one + np.uint64(7)])
        b0 += values[one]
        b1 += values[one + np.uint64(1)]
        b2 += values[one + np.uint64(2)]
        b3 += values[one + np.uint64(3)]
        b4 += values[one + np.uint64(4)]
        b5 += values[one + np.uint64(5)]
        b6 += values[one + np.uint64(6)]
        b7 += values[one + np.uint64(7)]
    most = max(a0, a1, a2, a3, a4, a5, a6, a7)
    for one in range(len(values)):
        values[one] /= most
    return most, ((b0 + b1) + (b2 + b3) + (b4 + b5) + (b6 + b7)) / most


@compiled
def scan_turned(  # noqa: C901, PLR0912, PLR0915, PLR0917
    part: NDArray[np.int64],
    offsets: NDArray[np.int64],
    kinds: NDArray[np.uint8],
    places: NDArray[np.uint16],
    group_of: NDArray[np.int64],
    rows: NDArray[np.float32],
    masses: NDArray[np.float32],
    width: float,
    named: NDArray[np.float32],
    disc: NDArray[np.float32],
    detected: NDArray[np.float32],
    seen: NDArray[np.float32],
    left: NDArray[np.float32],
    base: float,
    first: int,
    priors: NDArray[np.float64],
    before_logs: NDArray[np.float32],
    before: NDArray[np.float32],
    logs: NDArray[np.float32],
    after: NDArray[np.float32],
    scores: NDArray[np.float32],
    best: NDArray[np.int16],
) -> None:
    """Fill `scores` as `scan`, summed over turns of the photo, and `best` with the likeliest turn.

    Turns are steps from `first` on, with their chances in `priors`, whole blocks of them. `rows`,
    shape (n, groups, levels, bins // turns, 2 * turns), and `masses` are those of `turned_rows`;
    `named` has shape (longest + 1, k, n). What the likelihood is by turn, `after` (cells, turns)
    with its scale `logs`, is kept if there is room. It is gone on from if it is given as `before`,
    which has all that is seen but for these detections.
    """
    size, groups, levels, inside = rows.shape[0], rows.shape[1], rows.shape[2], rows.shape[3]
    twice, ways = rows.shape[4], len(priors)
    turns, bins = twice // 2, inside * twice // 2
    longest, classes = len(detected) - 1, detected.shape[1]
    flat_rows, flat_named, flat_masses = rows.ravel(), named.ravel(), masses.ravel()
    partial, moving = len(flat_masses) > 0, left.max() > 0.0
    fresh, kept = len(before) == 0, len(after) > 0
    most = 0
    for cell in range(part[0], part[1]):
        most = max(most, offsets[cell + 1] - offsets[cell])
    starts = np.empty(most, np.uint64)
    # Odds by turn or, where they are the same for all, once for each block of turns.
    wide = ways if partial else TURNED_LANES
    odds = np.empty(most * wide, np.float32)
    sums = np.empty(ways, np.float32)
    product = np.empty(ways, np.float32)
    missed = np.ones(ways, np.float32)
    floors = np.empty(size, np.float32)
    gone = np.zeros(classes, np.float32)
    one_f = np.float32(1.0)
    # As in `scan`: unsigned numbers, and sums side by side that stay where they are added up.
    all_ways, block = np.uint64(ways), np.uint64(TURNED_LANES)
    of_one, of_way = np.uint64(wide), np.uint64(1 if partial else 0)
    one_size = np.uint64(groups * levels * inside * twice)
    for cell in range(part[0], part[1]):
        low, count = offsets[cell], offsets[cell + 1] - offsets[cell]
        length = min(count, longest)
        lost = np.float32(0.0)
        floors[:] = one_f
        if moving:
            for one in range(low, low + count):
                kind = kinds[one]
                gone[kind] += detected[length, kind] * left[kind, places[one] // bins]
            for kind in range(classes):
                if gone[kind] > 0.0:
                    lost += gone[kind]
                    for two in range(size):
                        floors[two] += gone[kind] * named[length, kind, two] * disc[two]
                    gone[kind] = 0.0
        total, scale = base, 1.0  # the product is so many times larger
        if fresh:
            total -= float(lost) * width
            for way in range(ways):
                product[way] = priors[way]
        else:
            total += before_logs[cell]
            product[:] = before[cell]
        for one in range(count):
            kind, place = kinds[low + one], places[low + one]
            level, place = place // bins, place % bins
            chance = detected[length, kind] * seen[kind, level]
            start = (first - place // inside) % turns
            start += ((group_of[kind] * levels + level) * inside + place % inside) * twice
            starts[one] = start
            own = odds[one * wide : (one + 1) * wide]
            if partial:
                held = flat_masses[start : start + ways]
                for way in range(ways):
                    none = one_f - chance * held[way]
                    own[way] = chance / none
                    missed[way] *= none
                if one % LANES == LANES - 1 or one == count - 1:
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
        for two in range(size):
            above = np.uint64(two) * one_size
            for way in range(np.uint64(0), all_ways, block):
                a0 = a1 = a2 = a3 = a4 = a5 = a6 = a7 = floors[two]
                b0 = b1 = b2 = b3 = b4 = b5 = b6 = b7 = floors[two]
                for one in range(np.uint64(count)):
                    kind = kinds[np.uint64(low) + one]
                    factor = flat_named[np.uint64((length * classes + kind) * size + two)]
                    at, of = above + starts[one] + way, one * of_one + way * of_way
                    a0 += factor * odds[of] * flat_rows[at]
                    a1 += factor * odds[of + np.uint64(1)] * flat_rows[at + np.uint64(1)]
                    a2 += factor * odds[of + np.uint64(2)] * flat_rows[at + np.uint64(2)]
                    a3 += factor * odds[of + np.uint64(3)] * flat_rows[at + np.uint64(3)]
                    a4 += factor * odds[of + np.uint64(4)] * flat_rows[at + np.uint64(4)]
                    a5 += factor * odds[of + np.uint64(5)] * flat_rows[at + np.uint64(5)]
                    a6 += factor * odds[of + np.uint64(6)] * flat_rows[at + np.uint64(6)]
                    a7 += factor * odds[of + np.uint64(7)] * flat_rows[at + np.uint64(7)]
                    b0 += factor * odds[of + np.uint64(8)] * flat_rows[at + np.uint64(8)]
                    b1 += factor * odds[of + np.uint64(9)] * flat_rows[at + np.uint64(9)]
                    b2 += factor * odds[of + np.uint64(10)] * flat_rows[at + np.uint64(10)]
                    b3 += factor * odds[of + np.uint64(11)] * flat_rows[at + np.uint64(11)]
                    b4 += factor * odds[of + np.uint64(12)] * flat_rows[at + np.uint64(12)]
                    b5 += factor * odds[of + np.uint64(13)] * flat_rows[at + np.uint64(13)]
                    b6 += factor * odds[of + np.uint64(14)] * flat_rows[at + np.uint64(14)]
                    b7 += factor * odds[of + np.uint64(15)] * flat_rows[at + np.uint64(15)]
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
        unit, mass = _rescaled(product)
        if kept:
            logs[cell] = total + math.log(scale * unit)
            after[cell] = product
        way = 0
        while product[way] < one_f:
            way += 1
        best[cell] = first + way
        scores[cell] = total + math.log(scale * unit * mass)


@compiled
def promising_cells(scores: NDArray[np.float32], count: int) -> NDArray[np.int64]:
    """Return the cells of the `count` highest scores and a few more, ascending, without sorting.

    Every cell left out is worse than `count` that are in; scores that are no numbers are the last.
    """
    last_bin = np.float32(_BINS - 1)
    top = np.float32(-np.inf)
    for score in scores:
        top = max(top, score)
    if top == -np.inf:
        return np.arange(len(scores))
    counts = np.zeros(_BINS, np.int64)
    for score in scores:
        below = (top - score) * _BINS_A_NAT
        counts[int(below) if below < last_bin else _BINS - 1] += 1  # NaN is not below
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
def count_types(  # noqa: C901, PLR0917
    offsets: NDArray[np.int64],
    codes: NDArray[np.uint8],
    row_of: NDArray[np.int64],
    query: NDArray[np.int64],
    detected: NDArray[np.float64],
    named: NDArray[np.float64],
    clutter: NDArray[np.float64],
    scores: NDArray[np.float32],
) -> None:
    """Compare how many objects of each class a query and each sequence of types have.

    Fills `scores`, shape (d,), with log-likelihoods. `query`, shape (k + 1,), counts the objects
    of the query by class, those of unknown class last. By length and class, `detected` is the
    chance of detection and `named`, shape (longest + 1, k, k), that of each name; `clutter` is in
    false objects per signature, and `row_of` the row of each class code.
    """
    kinds = len(clutter)
    most = 0
    for row in range(len(offsets) - 1):
        most = max(most, offsets[row + 1] - offsets[row])
    size = query.sum()
    factorials = np.zeros(max(most, size) + 1)
    for value in range(1, len(factorials)):
        factorials[value] = factorials[value - 1] + math.log(value)
    share = (size - query[kinds]) / size  # of the detections whose class is known
    counts = np.empty(kinds, np.int64)
    for row in range(len(scores)):
        length = min(offsets[row + 1] - offsets[row], len(detected) - 1)
        counts[:] = 0
        for entry in range(offsets[row], offsets[row + 1]):
            counts[row_of[codes[entry]]] += 1
        total = 0.0
        unnamed = 0.0
        for name in range(kinds):
            stray = clutter[name]  # expected detections of other things under this name
            for kind in range(kinds):
                if counts[kind] > 0 and kind != name:
                    stray += counts[kind] * detected[length, kind] * named[length, kind, name]
            unnamed += clutter[name] + counts[name] * detected[length, name]
            stray *= share
            chance = share * detected[length, name] * named[length, name, name]
            own, number = counts[name], query[name]
            if stray == 0.0:
                continue  # no class of the query is known
            # Binomial hits and Poisson strays that make up the number of the query.
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
        if query[kinds] > 0:
            unnamed *= 1.0 - share
            total += query[kinds] * math.log(unnamed) - factorials[query[kinds]] - unnamed
        scores[row] = total
