"""The loops of the likelihood method, compiled; each has a slow, obvious twin in the tests."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.jit import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

_TURN = 360.0
_REACH = 4.5  # deviations beyond which a detection is not taken for an object
_WIDE = 45.0  # deviation in degrees from which on the tails meet behind the observer
_LARGE = 1e200
# How often messages are sent, and the relative change at which they are taken for settled.
_ROUNDS, _SETTLED = 30, 1e-2
_PAIR_ROUNDS, _PAIR_SETTLED = 60, 1e-5

LINE = 64
"""Cells that are worked out together: as many as a cache line has bytes."""
MANTISSA_BITS = 9
"""Of a float32, how many the table of logarithms looks at."""
_SHIFT = 23 - MANTISSA_BITS
_ONE = 127 << MANTISSA_BITS  # where the bits of 1.0 begin
_BLOCK = 4096  # cells whose sums stay in the fastest cache
_BINS = 1024  # scores are counted in so many bins to find the best of them
_BINS_A_NAT = np.float32(16.0)


@compiled
def align(  # noqa: C901, PLR0912, PLR0915, PLR0917 - a kernel takes no keywords
    offsets: NDArray[np.int64],
    kinds: NDArray[np.int64],
    bearing_units: NDArray[np.uint16],
    distance_units: NDArray[np.uint8],
    unit: float,
    names: NDArray[np.int64],
    bearings: NDArray[np.float64],
    turns: NDArray[np.float64],
    odds: NDArray[np.float64],
    naming: NDArray[np.float64],
    sigma: NDArray[np.float64],
    totals: NDArray[np.float64],
) -> None:
    """Sum over the one-to-one associations of a query with what is seen from some places.

    Fills `totals`, shape (models, places, turns), with logarithms; the empty association counts as
    one. Objects seen have class rows `kinds` and bearings of `unit` degrees a unit, those of the
    query class rows `names` and `bearings` in degrees, turned by `turns`, shape (places, turns). By
    model, signature length and class, `odds` are of detection over a miss and `naming`, by name,
    the chance of the name over the density of such clutter; `sigma`, shape (models, k, 256), is the
    deviation of a bearing in degrees by distance.
    """
    models, longest = odds.shape[0], odds.shape[1] - 1
    size = len(names)
    most = 0
    for place in range(len(offsets) - 1):
        most = max(most, offsets[place + 1] - offsets[place])
    pairs = most * size
    left = np.empty(pairs, np.int64)
    right = np.empty(pairs, np.int64)
    weight = np.empty(pairs)
    forth = np.empty(pairs)  # messages from the objects of the place to those of the query
    back = np.empty(pairs)
    at_left = np.empty(most)
    at_right = np.empty(size)
    for place in range(len(offsets) - 1):
        low = offsets[place]
        count = offsets[place + 1] - low
        length = min(count, longest)
        for way in range(turns.shape[1]):
            turn = turns[place, way]
            for model in range(models):
                edges = 0
                for one in range(count):
                    kind = kinds[low + one]
                    spread = sigma[model, kind, distance_units[low + one]]
                    factor = odds[model, length, kind] / (spread * math.sqrt(2.0 * math.pi))
                    reach = min(_REACH * spread, 180.0)
                    shift = turn - (bearing_units[low + one] + 0.5) * unit
                    for other in range(size):
                        away = bearings[other] + shift
                        away -= _TURN * math.floor(away / _TURN + 0.5)
                        if abs(away) > reach:
                            continue
                        density = math.exp(-0.5 * (away / spread) ** 2)
                        if spread > _WIDE:
                            for lap in range(1, 4):
                                density += math.exp(-0.5 * ((away + _TURN * lap) / spread) ** 2)
                                density += math.exp(-0.5 * ((away - _TURN * lap) / spread) ** 2)
                        left[edges] = one
                        right[edges] = other
                        weight[edges] = factor * density * naming[model, length, kind, names[other]]
                        back[edges] = 1.0
                        edges += 1
                # Belief propagation, as in `associate`; as a function of its own it is slower.
                for _ in range(_ROUNDS):
                    at_left[:count] = 1.0
                    for edge in range(edges):
                        at_left[left[edge]] += weight[edge] * back[edge]
                    at_right[:] = 1.0
                    for edge in range(edges):
                        rest = at_left[left[edge]] - weight[edge] * back[edge]
                        forth[edge] = weight[edge] / max(rest, 1.0)
                        at_right[right[edge]] += forth[edge]
                    change = 0.0
                    for edge in range(edges):
                        new = 1.0 / max(at_right[right[edge]] - forth[edge], 1.0)
                        change = max(change, abs(new - back[edge]) / new)
                        back[edge] = new
                    if change < _SETTLED:
                        break
                at_left[:count] = 1.0
                for edge in range(edges):
                    at_left[left[edge]] += weight[edge] * back[edge]
                total = 0.0
                product = 1.0
                for one in range(count):
                    product *= at_left[one]
                    if product > _LARGE:
                        total += math.log(product)
                        product = 1.0
                for other in range(size):
                    product *= at_right[other]
                    if product > _LARGE:
                        total += math.log(product)
                        product = 1.0
                for edge in range(edges):
                    product /= 1.0 + forth[edge] * back[edge]
                    if product < 1.0 / _LARGE:
                        total += math.log(product)
                        product = 1.0
                totals[model, place, way] = total + math.log(product)


@compiled
def associate(  # noqa: C901, PLR0917
    starts: NDArray[np.int64],
    left: NDArray[np.int64],
    right: NDArray[np.int64],
    weight: NDArray[np.float64],
    at_left: NDArray[np.float64],
    at_right: NDArray[np.float64],
    chance: NDArray[np.float64],
    total: NDArray[np.float64],
) -> None:
    """Sum over the one-to-one associations of independent problems.

    The pairs of problem i are ``starts[i]:starts[i + 1]``, each an object `left` and a detection
    `right` with a weight of 0 or more; no two problems share one. `at_left` and `at_right` are
    working memory. Fills `chance`, that a pair is one thing, and `total`, the logarithm of the sum
    of each problem, in which the empty association counts as one.
    """
    back = np.ones(len(weight))
    forth = np.empty(len(weight))
    for problem in range(len(starts) - 1):
        low, high = starts[problem], starts[problem + 1]
        for _ in range(_PAIR_ROUNDS):
            for edge in range(low, high):
                at_left[left[edge]] = 1.0
                at_right[right[edge]] = 1.0
            for edge in range(low, high):
                at_left[left[edge]] += weight[edge] * back[edge]
            for edge in range(low, high):
                rest = at_left[left[edge]] - weight[edge] * back[edge]
                forth[edge] = weight[edge] / max(rest, 1.0)
                at_right[right[edge]] += forth[edge]
            change = 0.0
            for edge in range(low, high):
                new = 1.0 / max(at_right[right[edge]] - forth[edge], 1.0)
                change = max(change, abs(new - back[edge]) / new)
                back[edge] = new
            if change < _PAIR_SETTLED:
                break
        # Each object and detection counts once, at the first of its pairs.
        for edge in range(low, high):
            at_left[left[edge]] = 1.0
        for edge in range(low, high):
            at_left[left[edge]] += weight[edge] * back[edge]
        sums = 0.0
        for edge in range(low, high):
            pair = forth[edge] * back[edge]
            chance[edge] = pair / (1.0 + pair)
            sums -= math.log1p(pair)
            for once in (at_left[left[edge]], at_right[right[edge]]):
                sums += math.log(once)
            at_left[left[edge]] = 1.0
            at_right[right[edge]] = 1.0
        total[problem] = sums


@compiled
def fill_columns(  # noqa: C901, PLR0912, PLR0917 - a kernel takes no keywords
    lines: NDArray[np.int64],
    offsets: NDArray[np.int64],
    rows: NDArray[np.uint8],
    bearing_units: NDArray[np.uint16],
    spread_of: NDArray[np.uint8],
    spread: NDArray[np.float32],
    odds: NDArray[np.float32],
    naming: NDArray[np.float32],
    logs: NDArray[np.uint8],
    columns: NDArray[np.uint8],
) -> None:
    """Write the columns of some cells: the log of what each symbol adds, in whole steps.

    Fills the cells of ``lines[0]`` to ``lines[1] - 1``, each `LINE` cells, in `columns`, shape
    (symbols, bins, n). `rows` are the class rows of the entries and `spread_of` their rows of
    `spread`, shape (levels, units, bins): the density per degree in each bin for an object at a
    unit of bin 0. `odds` and `naming` are as in `align`, without models; `logs` is the logarithm in
    steps, by the leading bits of a float32 from 1.
    """
    cells = len(offsets) - 1
    kinds = odds.shape[1]
    symbols, bins = columns.shape[0], columns.shape[1]
    units = spread.shape[1]
    heard = np.zeros((kinds, bins), np.float32)
    present = np.zeros(kinds, np.bool_)
    inner = np.empty(bins, np.float32)
    bits = inner.view(np.int32)
    top = len(logs) - 1
    buffer = np.empty((symbols, bins, LINE), np.uint8)
    for line in range(lines[0], lines[1]):
        first = line * LINE
        last = min(first + LINE, cells)
        for cell in range(first, last):
            low, high = offsets[cell], offsets[cell + 1]
            length = min(high - low, len(odds) - 1)
            present[:] = False
            for entry in range(low, high):
                kind = rows[entry]
                if not present[kind]:
                    present[kind] = True
                    heard[kind, :] = np.float32(0.0)
                level = spread_of[entry]
                shift = bearing_units[entry] // units
                unit = bearing_units[entry] - shift * units
                factor = odds[length, kind]
                for place in range(bins - shift):
                    heard[kind, place + shift] += factor * spread[level, unit, place]
                for place in range(bins - shift, bins):
                    heard[kind, place + shift - bins] += factor * spread[level, unit, place]
            for symbol in range(symbols):
                for place in range(bins):
                    inner[place] = np.float32(1.0)
                for kind in range(kinds):
                    if present[kind]:
                        share = naming[length, kind, symbol]
                        for place in range(bins):
                            inner[place] += share * heard[kind, place]
                for place in range(bins):
                    index = (bits[place] >> _SHIFT) - _ONE
                    buffer[symbol, place, cell - first] = logs[min(index, top)]
        for symbol in range(symbols):
            for place in range(bins):
                for cell in range(first, last):
                    columns[symbol, place, cell] = buffer[symbol, place, cell - first]


@compiled
def _add_up(
    columns: NDArray[np.uint8],
    symbols: NDArray[np.int64],
    low: int,
    size: int,
    sums: NDArray[np.uint16],
) -> None:
    """Fill the sums of some columns over a block of cells."""
    for cell in range(size):
        sums[cell] = 0
    # Four columns in one go: a sum is fetched and put back a quarter as often.
    fours = len(symbols) - len(symbols) % 4
    for place in range(0, fours, 4):
        first = columns[symbols[place], low : low + size]
        second = columns[symbols[place + 1], low : low + size]
        third = columns[symbols[place + 2], low : low + size]
        fourth = columns[symbols[place + 3], low : low + size]
        for cell in range(size):
            sums[cell] += (
                np.uint16(first[cell])
                + np.uint16(second[cell])
                + np.uint16(third[cell])
                + np.uint16(fourth[cell])
            )
    for symbol in symbols[fours:]:
        column = columns[symbol, low : low + size]
        for cell in range(size):
            sums[cell] += column[cell]


@compiled
def scan(  # noqa: PLR0917
    columns: NDArray[np.uint8],
    symbols: NDArray[np.int64],
    constants: NDArray[np.float32],
    base: float,
    step: float,
    scores: NDArray[np.float32],
) -> None:
    """Fill `scores`, shape (n,), with the sums of one column for each object of a query.

    `symbols` are the rows of `columns`, shape (s, n), to add: at most 257, or 16 bits overflow.
    `constants` are what each cell adds to any query, `base` what the query adds in any cell, and
    `step` is the size of a step of the columns.
    """
    cells = len(constants)
    sums = np.empty(_BLOCK, np.uint16)
    start, scale = np.float32(base), np.float32(step)
    for low in range(0, cells, _BLOCK):
        size = min(_BLOCK, cells - low)
        _add_up(columns, symbols, low, size, sums)
        for cell in range(size):
            scores[low + cell] = constants[low + cell] + (start + scale * np.float32(sums[cell]))


@compiled
def scan_turned(  # noqa: PLR0917
    columns: NDArray[np.uint8],
    symbols: NDArray[np.int64],
    turns: NDArray[np.int64],
    priors: NDArray[np.float32],
    decay: NDArray[np.float32],
    constants: NDArray[np.float32],
    base: float,
    step: float,
    scores: NDArray[np.float32],
    best: NDArray[np.int16],
) -> None:
    """Add up columns for a query turned in several ways, and sum over the turns.

    As `scan`, with `symbols` of shape (turns, objects), the chance of each turn in `priors`, and
    ``exp(-step * i)`` in `decay`, beyond whose end nothing counts. Fills `scores` with the
    logarithms of the sums and `best` with the number in `turns` of the likeliest turn of each cell.
    """
    cells = len(constants)
    sums = np.empty(_BLOCK, np.uint16)
    peak = np.empty(_BLOCK, np.int32)
    mass = np.empty(_BLOCK, np.float32)
    first = np.empty(_BLOCK, np.float32)
    reach = len(decay)
    for low in range(0, cells, _BLOCK):
        size = min(_BLOCK, cells - low)
        peak[:] = 0
        mass[:] = 0.0
        first[:] = 0.0
        for turn in range(len(turns)):
            _add_up(columns, symbols[turn], low, size, sums)
            prior = priors[turn]
            for cell in range(size):
                rise = np.int32(sums[cell]) - peak[cell]
                if rise > 0:
                    scale = decay[rise] if rise < reach else np.float32(0.0)
                    mass[cell] *= scale
                    first[cell] *= scale
                    peak[cell] += rise
                    part = prior
                else:
                    part = prior * decay[-rise] if -rise < reach else np.float32(0.0)
                mass[cell] += part
                if part > first[cell]:
                    first[cell] = part
                    best[low + cell] = turns[turn]
        for cell in range(size):
            total = base + step * peak[cell] + math.log(mass[cell])
            scores[low + cell] = constants[low + cell] + np.float32(total)


@compiled
def promising_cells(scores: NDArray[np.float32], count: int) -> NDArray[np.int64]:
    """Return the cells of the `count` highest scores and a few more, ascending, without sorting.

    Every cell left out is worse than `count` that are in. Scores must not be NaN.
    """
    top = scores[0]
    for score in scores:
        top = max(top, score)
    if top == -np.inf:
        return np.arange(len(scores))
    counts = np.zeros(_BINS, np.int64)
    for score in scores:
        counts[int(min((top - score) * _BINS_A_NAT, np.float32(_BINS - 1)))] += 1
    last, inside = 0, counts[0]
    while inside < count:
        last += 1
        inside += counts[last]
    best = np.empty(inside, np.int64)
    filled = 0
    for cell in range(len(scores)):
        place = int(min((top - scores[cell]) * _BINS_A_NAT, np.float32(_BINS - 1)))
        if place <= last:
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
