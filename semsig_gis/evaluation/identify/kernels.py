"""The loops that compare every cell with every other, as machine code."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.jit import compiled
from semsig_gis.likelihood.kernels import scan

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MOST_OBJECTS = 257  # whose bytes add up within 16 bits
_BLOCK = 4096  # cells whose powers stay in the fastest cache
_CANDIDATES = 24  # likest cells among which places are chosen
_OCTAVES = np.float32(100.0)  # powers of two beyond this are not told from it
_OCTAVES_A_NAT = 1.4426950408889634
# Of 2 ** x for x from 0 to 1, to 1 part in 10,000.
_FIRST, _SECOND, _THIRD = np.float32(0.69606564), np.float32(0.22449434), np.float32(0.07944024)
_ONE, _BIAS, _SHIFT = np.float32(1.0), np.float32(127.0), np.int32(23)


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
    scan(flat, symbols[:first], constants, 0.0, step, scores)
    for low in range(first, len(symbols), _MOST_OBJECTS):
        scan(flat, symbols[low : low + _MOST_OBJECTS], scores, 0.0, step, scores)


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
