"""The loops that compare every cell with every other, as machine code."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.jit import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

LINE = 64
"""Cells that are worked out together: as many as a cache line has bytes."""
MANTISSA_BITS = 9
"""Of a float32, how many the table of logarithms looks at."""
_LEFT = 23 - MANTISSA_BITS
_BEGIN = 127 << MANTISSA_BITS  # where the bits of 1.0 begin
_MOST_OBJECTS = 257  # whose bytes add up within 16 bits
_BLOCK = 4096  # cells whose powers stay in the fastest cache
_CANDIDATES = 24  # likest cells among which places are chosen
_OCTAVES = np.float32(100.0)  # powers of two beyond this are not told from it
_OCTAVES_A_NAT = 1.4426950408889634
# Of 2 ** x for x from 0 to 1, to 1 part in 10,000.
_FIRST, _SECOND, _THIRD = np.float32(0.69606564), np.float32(0.22449434), np.float32(0.07944024)
_ONE, _BIAS, _SHIFT = np.float32(1.0), np.float32(127.0), np.int32(23)


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
    unit of bin 0. By length and class, `odds` are of detection over a miss and `naming`, by name,
    the chance of the name over the density of such clutter; `logs` is the logarithm in steps, by
    the leading bits of a float32 from 1.
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
                    index = (bits[place] >> _LEFT) - _BEGIN
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
def _scan(
    columns: NDArray[np.uint8],
    symbols: NDArray[np.int64],
    constants: NDArray[np.float32],
    step: float,
    scores: NDArray[np.float32],
) -> None:
    """Fill `scores`, shape (n,), with the sums of one column for each object of a query.

    `symbols` are the rows of `columns`, shape (s, n), to add: at most 257, or 16 bits overflow.
    `constants` are what each cell adds to any query, `step` is the size of a step of the columns.
    """
    cells = len(constants)
    sums = np.empty(_BLOCK, np.uint16)
    scale = np.float32(step)
    for low in range(0, cells, _BLOCK):
        size = min(_BLOCK, cells - low)
        _add_up(columns, symbols, low, size, sums)
        for cell in range(size):
            scores[low + cell] = constants[low + cell] + scale * np.float32(sums[cell])


@compiled
def _score(
    symbols: NDArray[np.int64],
    flat: NDArray[np.uint8],
    constants: NDArray[np.float32],
    step: float,
    scores: NDArray[np.float32],
) -> None:
    """Score every cell by a signature of any length."""
    first = min(len(symbols), _MOST_OBJECTS)
    _scan(flat, symbols[:first], constants, step, scores)
    for low in range(first, len(symbols), _MOST_OBJECTS):
        _scan(flat, symbols[low : low + _MOST_OBJECTS], scores, step, scores)


@compiled
def _powers(
    scores: NDArray[np.float32],
    own: np.float32,
    factor: np.float32,
    bits: NDArray[np.int32],
    powers: NDArray[np.float32],
) -> np.int32:
    """Fill the powers of two of the differences to one score; return the largest of the `bits`."""
    whole = bits.view(np.float32)
    top = np.int32(0)
    for place in range(len(scores)):
        value = min(max((scores[place] - own) * factor, -_OCTAVES), _OCTAVES)
        floor = np.floor(value)
        rest = value - floor
        powers[place] = _ONE + rest * (_FIRST + rest * (_SECOND + rest * _THIRD))
        bits[place] = np.int32(floor + _BIAS) << _SHIFT
    for place in range(len(scores)):
        top = max(top, bits[place])
    for place in range(len(scores)):
        powers[place] *= whole[place]
    return top


@compiled
def _sum(values: NDArray[np.float32]) -> float:
    """Return the sum of values, which are lost: halves are added up, many numbers at once."""
    size = len(values)
    while size > 1:
        half = size // 2
        for place in range(half):
            values[place] += values[size - half + place]
        size -= half
    return float(values[0])


@compiled
def _sum_around(  # noqa: PLR0917 - a kernel takes no keywords
    middle: int,
    scores: NDArray[np.float32],
    own: np.float32,
    octaves: float,
    ids: NDArray[np.int64],
    circle: NDArray[np.int64],
) -> float:
    """Return the sum of the powers of the cells around the one of a number."""
    total = 0.0
    for line in range(len(circle)):
        last = middle + circle[line, 1]
        for cell in range(np.searchsorted(ids, middle + circle[line, 0]), len(ids)):
            if ids[cell] > last:
                break
            total += 2.0 ** min(max((scores[cell] - own) * octaves, -_OCTAVES), _OCTAVES)
    return total


@compiled
def _blot_out(
    middle: int, scores: NDArray[np.float32], ids: NDArray[np.int64], circle: NDArray[np.int64]
) -> None:
    """Take all likelihood from the cells around the one of a number."""
    for line in range(len(circle)):
        last = middle + circle[line, 1]
        for cell in range(np.searchsorted(ids, middle + circle[line, 0]), len(ids)):
            if ids[cell] > last:
                break
            scores[cell] = -np.inf


@compiled
def compare_signatures(  # noqa: C901, PLR0915, PLR0917 - a kernel takes no keywords
    cells: NDArray[np.int64],
    offsets: NDArray[np.int64],
    symbols: NDArray[np.int64],
    flat: NDArray[np.uint8],
    constants: NDArray[np.float32],
    step: float,
    temperature: float,
    ids: NDArray[np.int64],
    places: NDArray[np.int64],
    circle: NDArray[np.int64],
    limit: int,
    near: NDArray[np.float64],
    far: NDArray[np.float64],
    like: NDArray[np.int64],
    share: NDArray[np.float64],
) -> None:
    """Compare cells with all others, by the likelihood of their own signature there.

    `cells` (c,) are row numbers. The entries of a cell begin at its item of `offsets` (n + 1,) in
    `symbols` (m,), which are rows of `flat` (s, n), the columns of the index in steps of `step`;
    `constants` (n,) is what each cell adds to them. `ids` (n,) are the rising numbers of the cells,
    `places` (n, 2) their columns and rows, `circle` (a, 2) that of `cell_circle`, `limit` its
    squared radius in cells. It fills `near`, `far` (c,), `like` and `share` (c, k), unsorted.
    """
    count = len(constants)
    scores = np.empty(count, np.float32)
    octaves = temperature * _OCTAVES_A_NAT
    factor = np.float32(octaves)
    bits = np.empty(_BLOCK, np.int32)
    powers = np.empty(_BLOCK, np.float32)
    sums = np.empty(_BLOCK, np.float32)
    best = np.empty(_CANDIDATES, np.float32)
    apart = np.empty(_CANDIDATES, np.int64)
    whose = np.empty(_CANDIDATES, np.int64)
    for number in range(len(cells)):
        cell = cells[number]
        _score(symbols[offsets[cell] : offsets[cell + 1]], flat, constants, step, scores)
        own = scores[cell]
        near[number] = _sum_around(ids[cell], scores, own, octaves, ids, circle)
        # A difference of sums would drown what is far from a cell that is like no other.
        _blot_out(ids[cell], scores, ids, circle)
        sums[:] = 0.0
        best[:] = -np.inf
        last = best[_CANDIDATES - 1]
        least = np.int32(0)
        found = 0
        for low in range(0, count, _BLOCK):
            size = min(_BLOCK, count - low)
            block = scores[low : low + size]
            top = _powers(block, own, factor, bits[:size], powers[:size])
            for place in range(size):
                sums[place] += powers[place]
            if top < least:
                continue
            for other in range(low, low + size):
                score = scores[other]
                if score < last:
                    continue
                across = places[other, 0] - places[cell, 0]
                along = places[other, 1] - places[cell, 1]
                away = across * across + along * along
                # Of equals the nearer comes first.
                if away <= limit or (score == last and away >= apart[_CANDIDATES - 1]):
                    continue
                at = min(found, _CANDIDATES - 1)
                while at > 0 and (
                    score > best[at - 1] or (score == best[at - 1] and away < apart[at - 1])
                ):
                    best[at], apart[at], whose[at] = best[at - 1], apart[at - 1], whose[at - 1]
                    at -= 1
                best[at], apart[at], whose[at] = score, away, other
                found = min(found + 1, _CANDIDATES)
                last = best[_CANDIDATES - 1]
            value = min(max((last - own) * factor, -_OCTAVES), _OCTAVES)
            least = np.int32(np.floor(value) + _BIAS) << _SHIFT
        far[number] = _sum(sums)
        like[number] = -1
        chosen = 0
        for candidate in range(found):
            if chosen == like.shape[1]:
                break
            new = whose[candidate]
            free = True
            for place in range(chosen):
                old = like[number, place]
                across = places[old, 0] - places[new, 0]
                along = places[old, 1] - places[new, 1]
                free = free and across * across + along * along > 4 * limit
            if free:
                like[number, chosen] = new
                share[number, chosen] = _sum_around(ids[new], scores, own, octaves, ids, circle)
                chosen += 1


@compiled
def compare_without(  # noqa: PLR0917 - a kernel takes no keywords
    cells: NDArray[np.int64],
    offsets: NDArray[np.int64],
    symbols: NDArray[np.int64],
    kinds: NDArray[np.int64],
    flat: NDArray[np.uint8],
    constants: NDArray[np.float32],
    step: float,
    temperature: float,
    ids: NDArray[np.int64],
    circle: NDArray[np.int64],
    sample: NDArray[np.int64],
    sampled: NDArray[np.uint8],
    far: NDArray[np.float64],
) -> None:
    """Compare cells with a sample of others, with all classes and without each of them.

    As `compare_signatures`, but `kinds` (m,) has the class row of each entry, and `constants`
    (k + 1, n) is for all classes first, then without each. `sample` (d,) are the rising row numbers
    of the others, `sampled` (s, d) their part of `flat`. It fills `far` (c, k + 1).
    """
    count = len(sample)
    factor = np.float32(temperature * _OCTAVES_A_NAT)
    numbers = ids[sample]
    nothing = np.zeros(count, np.float32)
    bases = np.empty((len(constants), count), np.float32)
    for left_out in range(len(constants)):
        for other in range(count):
            bases[left_out, other] = constants[left_out, sample[other]]
    total = np.empty(count, np.float32)
    part = np.empty(count, np.float32)
    scores = np.empty(count, np.float32)
    bits = np.empty(count, np.int32)
    powers = np.empty(count, np.float32)
    for number in range(len(cells)):
        cell = cells[number]
        low, high = offsets[cell], offsets[cell + 1]
        seen, whose = symbols[low:high], kinds[low:high]
        _score(seen, sampled, nothing, step, total)
        for left_out in range(len(constants)):
            base = bases[left_out]
            others = 0
            for entry in range(low, high):
                if kinds[entry] != left_out - 1:
                    others += flat[symbols[entry], cell]
            own = np.float32(step * others) + constants[left_out, cell]
            for other in range(count):
                scores[other] = base[other] + total[other]
            mine = seen[whose == left_out - 1]
            if len(mine):
                _score(mine, sampled, nothing, step, part)
                for other in range(count):
                    scores[other] -= part[other]
            _blot_out(ids[cell], scores, numbers, circle)
            _powers(scores, own, factor, bits, powers)
            far[number, left_out] = _sum(powers)
