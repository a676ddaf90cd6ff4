"""The loops that compare every cell with every other, as machine code."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from semsig_gis.core import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

BLOCK = 1024
"""Cells whose columns stay in the second cache."""
LINE = 64
"""Cells that are worked out together: as many as a cache line has bytes."""
MANTISSA_BITS = 9
"""Of a float32, how many the table of logarithms looks at."""
_SHIFT = 23 - MANTISSA_BITS
_ONE = 127 << MANTISSA_BITS  # where the bits of 1.0 begin
_MOST_OBJECTS = 257  # whose bytes add up within 16 bits
_BYTE = np.uint16(8)
_MOST = np.float32(1e33)  # so that sums stay finite
_CANDIDATES = 24  # likest cells among which places are chosen


@compiled
def _byte(inside: int) -> int:
    """Return where the byte of a cell is in a block: pairs are of one half and the other."""
    half = BLOCK // 2
    return 2 * (inside % half) + inside // half


@compiled
def fill_columns(  # noqa: C901, PLR0912, PLR0917 - a kernel takes no keywords
    lines: NDArray[np.int64],
    offsets: NDArray[np.int64],
    rows: NDArray[np.uint8],
    bearing_units: NDArray[np.uint16],
    spread_of: NDArray[np.uint8],
    spread: NDArray[np.float32],
    odds: NDArray[np.float32],
    leaving: NDArray[np.float32],
    naming: NDArray[np.float32],
    logs: NDArray[np.uint8],
    columns: NDArray[np.uint8],
) -> None:
    """Write the columns of some cells: the log of what each symbol adds, in whole steps.

    Fills the cells of ``lines[0]`` to ``lines[1] - 1``, each `LINE` cells, in `columns`, shape
    (blocks, k, bins, BLOCK). By entry, `rows` are class rows, `spread_of` rows of `spread`, shape
    (levels, units, bins), the density per degree in each bin for an object at a unit of bin 0,
    `odds` those of detection over a miss, and `leaving` the density of others in its stead.
    `naming` is, by length, class and name, the chance of the name over the density of such clutter;
    `logs` is the logarithm in steps, by the leading bits of a float32 from 1.
    """
    cells = len(offsets) - 1
    kinds, longest = naming.shape[1], len(naming) - 1
    symbols, bins = columns.shape[1], columns.shape[2]
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
            length = min(high - low, longest)
            present[:] = False
            for entry in range(low, high):
                kind = rows[entry]
                if not present[kind]:
                    present[kind] = True
                    heard[kind, :] = np.float32(0.0)
                level = spread_of[entry]
                shift = bearing_units[entry] // units
                unit = bearing_units[entry] - shift * units
                factor = odds[entry]
                if leaving[entry] > 0:
                    for place in range(bins):
                        heard[kind, place] += leaving[entry]
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
                    block, inside = divmod(cell, BLOCK)
                    columns[block, symbol, place, _byte(inside)] = buffer[
                        symbol, place, cell - first
                    ]


@compiled
def _add_up(
    columns: NDArray[np.uint16],
    symbols: NDArray[np.int64],
    base: NDArray[np.unsignedinteger],
    words: NDArray[np.uint16],
    sums: NDArray[np.unsignedinteger],
) -> None:
    """Fill `sums` (n,) with those of some columns, bytes in pairs (s, n / 2), and of a base.

    The first half of the sums is that of the lower bytes, the second that of the higher ones.
    `words` (2, n / 2) are working memory. A sum of the pairs as numbers is that of the lower bytes
    and 256 times that of the higher ones, so that only the latter have to be set apart.
    """
    half = columns.shape[1]
    whole, high = words[0, :half], words[1, :half]
    for place in range(2 * half):
        sums[place] = base[place]
    for low in range(0, len(symbols), _MOST_OBJECTS):
        part = symbols[low : low + _MOST_OBJECTS]
        whole[:] = 0
        high[:] = 0
        # Four columns in one go: a sum is fetched and put back a quarter as often.
        fours = len(part) - len(part) % 4
        for place in range(0, fours, 4):
            first, second = columns[part[place]], columns[part[place + 1]]
            third, fourth = columns[part[place + 2]], columns[part[place + 3]]
            for pair in range(half):
                whole[pair] += first[pair] + second[pair] + third[pair] + fourth[pair]
                high[pair] += (
                    (first[pair] >> _BYTE)
                    + (second[pair] >> _BYTE)
                    + (third[pair] >> _BYTE)
                    + (fourth[pair] >> _BYTE)
                )
        for symbol in part[fours:]:
            column = columns[symbol]
            for pair in range(half):
                whole[pair] += column[pair]
                high[pair] += column[pair] >> _BYTE
        for pair in range(half):
            sums[pair] += np.uint16(whole[pair] - (high[pair] << _BYTE))
        for pair in range(half):
            sums[half + pair] += high[pair]


@compiled
def score_cells(
    symbols: NDArray[np.int64],
    values: NDArray[np.uint8],
    constants: NDArray[np.float32],
    step: float,
    scores: NDArray[np.float32],
) -> None:
    """Fill the scores of all cells (n,), a sum of columns and of a constant of each."""
    pairs, scale = values.view(np.uint16), np.float32(step)
    nothing, words = np.zeros(BLOCK, np.uint32), np.empty((2, BLOCK // 2), np.uint16)
    sums = np.empty(BLOCK, np.uint32)
    for block in range(len(values)):
        _add_up(pairs[block], symbols, nothing, words, sums)
        low = block * BLOCK
        for inside in range(min(BLOCK, len(scores) - low)):
            scores[low + inside] = constants[low + inside] + scale * np.float32(sums[inside])


@compiled
def _total(values: NDArray[np.float32]) -> float:
    """Return the sum of values, which are lost: halves are added up, many numbers at once."""
    size = len(values)
    while size > 1:
        half = size // 2
        for place in range(half):
            values[place] += values[size - half + place]
        size -= half
    return float(values[0])


@compiled
def _high(sums: NDArray[np.uint32], rank: int, best: NDArray[np.int64]) -> int:
    """Return the sum of a rank, the highest being 1; `best` is working memory."""
    best[:rank] = 0
    last = np.int64(0)
    for one in sums:
        if one > last:
            at = rank - 1
            while at > 0 and one > best[at - 1]:
                best[at] = best[at - 1]
                at -= 1
            best[at] = one
            last = best[rank - 1]
    return int(last)


@compiled
def _blot_out(
    middle: int, sums: NDArray[np.uint32], ids: NDArray[np.int64], circle: NDArray[np.int64]
) -> None:
    """Take the sums from the cells around the one of a number."""
    for line in range(len(circle)):
        last = middle + circle[line, 1]
        for cell in range(np.searchsorted(ids, middle + circle[line, 0]), len(ids)):
            if ids[cell] > last:
                break
            sums[cell] = 0


@compiled
def _sum_at(values: NDArray[np.uint8], symbols: NDArray[np.int64], cell: int) -> int:
    """Return the sum of some columns in one cell."""
    block, inside = divmod(cell, BLOCK)
    place = _byte(inside)
    total = 0
    for symbol in symbols:
        total += values[block, symbol, place]
    return total


class Places(NamedTuple):
    """Where the n cells are: rising numbers, columns and rows (n, 2), and the circle around each.

    `circle` (a, 2) is that of `cell_circle`, `limit` its squared radius in cells.
    """

    ids: NDArray[np.int64]
    at: NDArray[np.int64]
    circle: NDArray[np.int64]
    limit: int


class Entries(NamedTuple):
    """What the cells see: where each begins (n + 1,), and symbols, class rows and bearings (m,)."""

    offsets: NDArray[np.int64]
    symbols: NDArray[np.int64]
    kinds: NDArray[np.int64]
    bearing_units: NDArray[np.uint16]


class Bases(NamedTuple):
    """What cells have before anything is added, by direction (d), in n cells or a sample of them.

    `levels` (d, n) are whole steps from 1, `trims` (d, n) are the powers of what that leaves,
    `lifts` those of not missing the objects of each class: (d, n, k), of a sample (d, k, n).
    """

    levels: NDArray[np.unsignedinteger]
    trims: NDArray[np.float32]
    lifts: NDArray[np.float32]


class Sample(NamedTuple):
    """Cells that stand for all that are not likely, (s,) rising row numbers, `weight` for each.

    `pairs` (symbols, s / 2) are their bytes in twos, of one half and the other. Likely is who has
    at least the sum of a `rank` among them; all are if there is no sample. Of class k, it is
    ``seeing[starts[k]:starts[k + 1]]`` of them that see it.
    """

    cells: NDArray[np.int64]
    ids: NDArray[np.int64]
    pairs: NDArray[np.uint16]
    bases: Bases
    starts: NDArray[np.int64]
    seeing: NDArray[np.int64]
    rank: int
    weight: float


@compiled
def _sum_circle(  # noqa: PLR0917 - a kernel takes no keywords
    middle: int,
    own: int,
    left_out: int,
    direction: int,
    shown: NDArray[np.int64],
    values: NDArray[np.uint8],
    bases: Bases,
    powers: NDArray[np.float32],
    places: Places,
) -> float:
    """Return the sum of the powers of the cells around one, but for those around another."""
    top = len(powers) // 2
    total = 0.0
    for line in range(len(places.circle)):
        last = places.ids[middle] + places.circle[line, 1]
        first = places.ids[middle] + places.circle[line, 0]
        for cell in range(np.searchsorted(places.ids, first), len(places.ids)):
            if places.ids[cell] > last:
                break
            if left_out >= 0:
                across = places.at[cell, 0] - places.at[left_out, 0]
                along = places.at[cell, 1] - places.at[left_out, 1]
                if across * across + along * along <= places.limit:
                    continue
            rise = bases.levels[direction, cell] + _sum_at(values, shown, cell) - own
            total += powers[top + min(max(rise, -top), top)] * bases.trims[direction, cell]
    return total


@compiled
def compare_cells(  # noqa: C901, PLR0912, PLR0915, PLR0917 - a kernel takes no keywords
    looks: NDArray[np.int64],
    entries: Entries,
    inside: NDArray[np.bool_],
    values: NDArray[np.uint8],
    constants: NDArray[np.float32],
    step: float,
    bases: Bases,
    powers: NDArray[np.float32],
    sample: Sample,
    places: Places,
    buffer: NDArray[np.unsignedinteger],
    near: NDArray[np.float64],
    far: NDArray[np.float64],
    like: NDArray[np.int64],
    share: NDArray[np.float64],
    rest: NDArray[np.float64],
) -> None:
    """Compare looks from cells with all cells, by the likelihood of what each shows there.

    `looks` (q,) are ``row * d + direction``, and `inside` (d, units) tells which bearings are seen
    in each of d directions. `values` (blocks, symbols, BLOCK), `constants` (d, n) and `step` are
    those of `SymbolColumns`, `powers` (2 l + 1,) those of -l to l steps. `buffer` (3, s), at least
    a block wide, is working memory. It fills `near`, `far` (q,), `like` and `share` (q, p),
    unsorted, and `rest` (q, k), what `far` would be without the detections of each class.
    """
    directions = len(constants)
    asked, classes, size = len(looks), rest.shape[1], len(sample.cells)
    top, scale = np.int32(len(powers) // 2), np.float32(step)
    starts = np.zeros(asked + 1, np.int64)
    for look in range(asked):
        cell, direction = divmod(looks[look], directions)
        starts[look + 1] = starts[look]
        for entry in range(entries.offsets[cell], entries.offsets[cell + 1]):
            starts[look + 1] += inside[direction, entries.bearing_units[entry]]
    symbols = np.empty(starts[asked], np.int64)
    kinds = np.empty(starts[asked], np.int64)
    own = np.zeros(asked, np.int64)
    level = np.ones(asked, np.int64)
    highest = np.empty(max(sample.rank, 1), np.int64)
    words = np.empty((2, max(size, BLOCK) // 2), np.uint16)
    weights, terms = np.empty(size, np.float32), np.empty(size, np.float32)
    sees, nothing = np.zeros((asked, classes), np.bool_), np.zeros(size, buffer.dtype)
    far[:] = 0.0
    rest[:] = 0.0
    for look in range(asked):
        cell, direction = divmod(looks[look], directions)
        at = starts[look]
        for entry in range(entries.offsets[cell], entries.offsets[cell + 1]):
            if inside[direction, entries.bearing_units[entry]]:
                symbols[at], kinds[at] = entries.symbols[entry], entries.kinds[entry]
                sees[look, kinds[at]] = True
                at += 1
        shown, named = symbols[starts[look] : at], kinds[starts[look] : at]
        own[look] = bases.levels[direction, cell] + _sum_at(values, shown, cell)
        if size == 0 or len(shown) == 0:
            continue
        sums, part = buffer[0, :size], buffer[1, :size]
        _add_up(sample.pairs, shown, sample.bases.levels[direction], words, sums)
        _blot_out(places.ids[cell], sums, sample.ids, places.circle)
        level[look] = max(_high(sums, sample.rank, highest), 1)
        trims, mine, least = sample.bases.trims[direction], np.int32(own[look]), level[look]
        for other in range(size):
            rise = min(max(np.int32(sums[other]) - mine, -top), top)
            weight = powers[top + rise] * trims[other]
            counts = (sums[other] > 0) & (sums[other] < least)
            weights[other] = weight if counts else np.float32(0.0)
        terms[:] = weights
        far[look] = _total(terms)
        for left_out in range(classes):
            lifts = sample.bases.lifts[direction, left_out]
            if not sees[look, left_out]:
                for place in range(sample.starts[left_out], sample.starts[left_out + 1]):
                    other = sample.seeing[place]
                    rest[look, left_out] += weights[other] * (lifts[other] - 1.0)
                continue
            _add_up(sample.pairs, shown[named == left_out], nothing, words, part)
            for other in range(size):
                fall = min(np.int32(part[other]), top)
                lift = lifts[other] * powers[top - fall]
                terms[other] = min(weights[other] * lift, _MOST)
            rest[look, left_out] = _total(terms)
        far[look] *= sample.weight
        rest[look] *= sample.weight
    pairs = values.view(np.uint16)
    best = np.full((asked, _CANDIDATES), -np.inf, np.float32)
    apart = np.zeros((asked, _CANDIDATES), np.int64)
    whose = np.full((asked, _CANDIDATES), -1, np.int64)
    found = np.zeros(asked, np.int64)
    tops = np.empty(LINE, buffer.dtype)
    falls = np.empty(classes, np.int64)
    for block in range(len(values)):
        low = block * BLOCK
        for look in range(asked):
            shown = symbols[starts[look] : starts[look + 1]]
            if len(shown) == 0:
                continue
            cell, direction = divmod(looks[look], directions)
            sums = buffer[0, :BLOCK]
            _add_up(pairs[block], shown, bases.levels[direction, low : low + BLOCK], words, sums)
            tops[:] = sums[:LINE]
            for line in range(LINE, BLOCK, LINE):
                for place in range(LINE):
                    tops[place] = max(tops[place], sums[line + place])
            for place in range(LINE):
                if tops[place] < level[look]:
                    continue
                for inner in range(place, BLOCK, LINE):
                    if sums[inner] < level[look]:
                        continue
                    other = low + inner
                    across = places.at[other, 0] - places.at[cell, 0]
                    along = places.at[other, 1] - places.at[cell, 1]
                    away = across * across + along * along
                    if away <= places.limit:
                        continue
                    rise = min(max(np.int64(sums[inner]) - own[look], -top), top)
                    weight = powers[top + rise] * bases.trims[direction, other]
                    far[look] += weight
                    falls[:] = 0
                    byte = _byte(inner)
                    for entry in range(starts[look], starts[look + 1]):
                        falls[kinds[entry]] += values[block, symbols[entry], byte]
                    for left_out in range(classes):
                        lift = np.float64(bases.lifts[direction, other, left_out])
                        lift *= powers[top - min(falls[left_out], top)]
                        if not sees[look, left_out]:
                            lift -= 1.0
                        rest[look, left_out] += weight * lift
                    added = sums[inner] - bases.levels[direction, other]
                    score = constants[direction, other] + scale * np.float32(added)
                    last = _CANDIDATES - 1
                    # Of equals the nearer comes first.
                    if score < best[look, last] or (
                        score == best[look, last] and away >= apart[look, last]
                    ):
                        continue
                    at = min(found[look], last)
                    while at > 0 and (
                        score > best[look, at - 1]
                        or (score == best[look, at - 1] and away < apart[look, at - 1])
                    ):
                        best[look, at] = best[look, at - 1]
                        apart[look, at] = apart[look, at - 1]
                        whose[look, at] = whose[look, at - 1]
                        at -= 1
                    best[look, at], apart[look, at], whose[look, at] = score, away, other
                    found[look] = min(found[look] + 1, _CANDIDATES)
    like[:] = -1
    share[:] = 0.0
    near[:] = 0.0
    for look in range(asked):
        shown = symbols[starts[look] : starts[look + 1]]
        if len(shown) == 0:
            continue
        cell, direction = divmod(looks[look], directions)
        trim = bases.trims[direction, cell]
        falls[:] = 0
        for entry in range(starts[look], starts[look + 1]):
            falls[kinds[entry]] += _sum_at(values, symbols[entry : entry + 1], cell)
        for left_out in range(classes):
            lift = bases.lifts[direction, cell, left_out] * powers[top - min(falls[left_out], top)]
            if not sees[look, left_out]:
                rest[look, left_out] += far[look]
            rest[look, left_out] /= lift * trim
        far[look] /= trim
        near[look] = (
            _sum_circle(cell, own[look], -1, direction, shown, values, bases, powers, places) / trim
        )
        chosen = 0
        for candidate in range(found[look]):
            if chosen == like.shape[1]:
                break
            new = whose[look, candidate]
            free = True
            for place in range(chosen):
                old = like[look, place]
                across = places.at[old, 0] - places.at[new, 0]
                along = places.at[old, 1] - places.at[new, 1]
                free = free and across * across + along * along > 4 * places.limit
            if free:
                like[look, chosen] = new
                total = _sum_circle(
                    new, own[look], cell, direction, shown, values, bases, powers, places
                )
                share[look, chosen] = total / trim
                chosen += 1
