"""Compiled loops that compare every cell with every other."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from semsig_gis.core import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

BLOCK_CELLS = 1024
"""Cells of a block; its columns fit into the second-level cache."""
LINE_CELLS = 64
"""Cells that are computed together: as many as a cache line has bytes."""
MANTISSA_BITS = 9
"""Leading mantissa bits of a float32 that index the table of logarithms."""
_SHIFT = 23 - MANTISSA_BITS
_ONE = 127 << MANTISSA_BITS  # leading bits of 1.0
_MOST_OBJECTS = 257  # the most bytes with a sum that fits into 16 bits
_BYTE = np.uint16(8)
_MOST = np.float32(1e33)  # so that sums stay finite
_CANDIDATES = 24  # most similar cells among which the places are selected


@compiled
def _byte(inside: int) -> int:
    """Return the place of a cell in its block: cells of the first and second half take turns."""
    half = BLOCK_CELLS // 2
    return 2 * (inside % half) + inside // half


class DetectedObjects(NamedTuple):
    """Objects seen from n cells: first object (n + 1,), and what a detector makes of each (m,).

    `rows` are class rows, `spread_of` rows of the noise of a bearing, `odds` those of detection,
    and `leaving` the density of other objects that are detected instead.
    """

    offsets: NDArray[np.int64]
    rows: NDArray[np.uint8]
    bearing_units: NDArray[np.uint16]
    spread_of: NDArray[np.uint8]
    odds: NDArray[np.float32]
    leaving: NDArray[np.float32]


@compiled
def fill_columns(  # noqa: C901, PLR0912, PLR0917 - a kernel takes no keywords
    lines: NDArray[np.int64],
    order: NDArray[np.int64],
    objects: DetectedObjects,
    spread: NDArray[np.float32],
    naming: NDArray[np.float32],
    logs: NDArray[np.uint8],
    columns: NDArray[np.uint8],
) -> None:
    """Compute, for some cells, the log-likelihood that each detected symbol adds, in whole steps.

    Fills the slots of the lines from ``lines[0]`` to ``lines[1] - 1``, `LINE_CELLS` slots each, in
    `columns`, shape (blocks, k, bins, BLOCK_CELLS); `order` has the cell of each slot. `spread`,
    shape (levels, units, bins), is the density per degree in each bin for an object at a unit of
    bin 0. `naming`, by length, class and name, is the probability of the name divided by the
    density of false objects of that name. `logs` is a table of logarithms in steps, by the leading
    bits of a float32 of 1 or more.
    """
    offsets, rows, bearing_units = objects.offsets, objects.rows, objects.bearing_units
    spread_of, odds, leaving = objects.spread_of, objects.odds, objects.leaving
    cells = len(offsets) - 1
    kinds, longest = naming.shape[1], len(naming) - 1
    symbols, bins = columns.shape[1], columns.shape[2]
    units = spread.shape[1]
    density = np.zeros((kinds, bins), np.float32)
    present = np.zeros(kinds, np.bool_)
    inner = np.empty(bins, np.float32)
    bits = inner.view(np.int32)
    top = len(logs) - 1
    buffer = np.empty((symbols, bins, LINE_CELLS), np.uint8)
    for line in range(lines[0], lines[1]):
        first = line * LINE_CELLS
        last = min(first + LINE_CELLS, cells)
        for slot in range(first, last):
            low, high = offsets[order[slot]], offsets[order[slot] + 1]
            length = min(high - low, longest)
            # Sum the densities of the detections of the objects of each class in each bin.
            present[:] = False
            for entry in range(low, high):
                kind = rows[entry]
                if not present[kind]:
                    present[kind] = True
                    density[kind, :] = np.float32(0.0)
                level = spread_of[entry]
                shift = bearing_units[entry] // units
                unit = bearing_units[entry] - shift * units
                factor = odds[entry]
                # The spread is that of bin 0: it is shifted to the bin of the object, and wrapped.
                if leaving[entry] > 0:
                    for place in range(bins):
                        density[kind, place] += leaving[entry]
                for place in range(bins - shift):
                    density[kind, place + shift] += factor * spread[level, unit, place]
                for place in range(bins - shift, bins):
                    density[kind, place + shift - bins] += factor * spread[level, unit, place]
            # For each name and bin, sum over the true classes and take the logarithm.
            for symbol in range(symbols):
                for place in range(bins):
                    inner[place] = np.float32(1.0)
                for kind in range(kinds):
                    if present[kind]:
                        share = naming[length, kind, symbol]
                        for place in range(bins):
                            inner[place] += share * density[kind, place]
                for place in range(bins):
                    index = (bits[place] >> _SHIFT) - _ONE
                    buffer[symbol, place, slot - first] = logs[min(index, top)]
        # Write a whole line at once, so that each cache line of the columns is touched once.
        for symbol in range(symbols):
            for place in range(bins):
                for slot in range(first, last):
                    block, inside = divmod(slot, BLOCK_CELLS)
                    columns[block, symbol, place, _byte(inside)] = buffer[
                        symbol, place, slot - first
                    ]


@compiled
def _add_up(  # noqa: C901 - the columns are added in groups
    columns: NDArray[np.uint16],
    symbols: NDArray[np.int64],
    base: NDArray[np.unsignedinteger],
    words: NDArray[np.uint16],
    sums: NDArray[np.unsignedinteger],
) -> None:
    """Fill `sums` (n,) with the sums of some columns and of a base.

    The columns are pairs of bytes as 16-bit numbers, shape (s, n / 2). The first half of the sums
    is that of the lower bytes, the second half that of the higher bytes. A sum of the pairs is the
    sum of the lower bytes plus 256 times that of the higher ones (modulo 2**16), so that only the
    higher bytes are summed separately. `words` (2, n / 2) is working memory.
    """
    half = np.uint64(columns.shape[1])
    # A flat array and unsigned indices, which are faster.
    flat, whole, high = columns.ravel(), words[0][:half], words[1][:half]
    for place in range(2 * half):
        sums[place] = base[place]
    for low in range(0, len(symbols), _MOST_OBJECTS):
        part = symbols[low : low + _MOST_OBJECTS]
        whole[:] = 0
        high[:] = 0
        # Eight columns at once, which needs an eighth of the loads and stores of the sums.
        eights = len(part) - len(part) % 8
        for place in range(0, eights, 8):
            a, b = np.uint64(part[place]) * half, np.uint64(part[place + 1]) * half
            c, d = np.uint64(part[place + 2]) * half, np.uint64(part[place + 3]) * half
            e, f = np.uint64(part[place + 4]) * half, np.uint64(part[place + 5]) * half
            g, h = np.uint64(part[place + 6]) * half, np.uint64(part[place + 7]) * half
            for pair in range(half):
                whole[pair] += (
                    flat[a + pair]
                    + flat[b + pair]
                    + flat[c + pair]
                    + flat[d + pair]
                    + flat[e + pair]
                    + flat[f + pair]
                    + flat[g + pair]
                    + flat[h + pair]
                )
                high[pair] += (
                    (flat[a + pair] >> _BYTE)
                    + (flat[b + pair] >> _BYTE)
                    + (flat[c + pair] >> _BYTE)
                    + (flat[d + pair] >> _BYTE)
                    + (flat[e + pair] >> _BYTE)
                    + (flat[f + pair] >> _BYTE)
                    + (flat[g + pair] >> _BYTE)
                    + (flat[h + pair] >> _BYTE)
                )
        pairs = len(part) - len(part) % 2
        for place in range(eights, pairs, 2):
            a, b = np.uint64(part[place]) * half, np.uint64(part[place + 1]) * half
            for pair in range(half):
                whole[pair] += flat[a + pair] + flat[b + pair]
                high[pair] += (flat[a + pair] >> _BYTE) + (flat[b + pair] >> _BYTE)
        for symbol in part[pairs:]:
            a = np.uint64(symbol) * half
            for pair in range(half):
                whole[pair] += flat[a + pair]
                high[pair] += flat[a + pair] >> _BYTE
        for pair in range(half):
            sums[pair] += np.uint16(whole[pair] - (high[pair] << _BYTE))
        for pair in range(half):
            sums[half + pair] += high[pair]


@compiled
def _highest(sums: NDArray[np.unsignedinteger]) -> int:
    """Return the highest of some sums."""
    top = sums[0]
    for place in range(len(sums)):  # with an index, it is vectorized
        top = max(top, sums[place])
    return int(top)


class SlotBases(NamedTuple):
    """Scores of the cells for a query without detections, by direction of view (d) and slot.

    `scores` (d, n) are minus infinity for slots without a cell, `peaks` (d, b) are the highest of
    each block.
    """

    scores: NDArray[np.float32]
    peaks: NDArray[np.float32]


@compiled
def score_cells(  # noqa: PLR0917 - a kernel takes no keywords
    symbols: NDArray[np.int64],
    look: int,
    values: NDArray[np.uint8],
    peaks: NDArray[np.uint16],
    order: NDArray[np.int64],
    bases: SlotBases,
    step: float,
    margin: float,
    scores: NDArray[np.float32],
) -> None:
    """Fill the scores of all cells (n,): the sum of some columns and the base of each cell.

    Cells that are more than `margin` below the best cell may get minus infinity. `values`, `peaks`
    and `order` are those of `CellColumns`.
    """
    pairs, scale = values.view(np.uint16), np.float32(step)
    blocks, wide = len(values), 2 * peaks.shape[1]
    size = max(BLOCK_CELLS, wide)
    nothing, words = np.zeros(size, np.uint32), np.empty((2, size // 2), np.uint16)
    sums, highest = np.empty(BLOCK_CELLS, np.uint32), np.empty(wide, np.uint32)
    some = np.empty(BLOCK_CELLS, np.float32)
    _add_up(peaks, symbols, nothing, words, highest)
    bounds = bases.peaks[look] + scale * highest[:blocks].astype(np.float32)
    scores[:] = -np.inf
    top = np.float32(-np.inf)
    # The best block first, so that the others can be skipped.
    for block in np.argsort(-bounds):
        if bounds[block] < top - margin:
            break
        _add_up(pairs[block], symbols, nothing, words, sums)
        low = block * BLOCK_CELLS
        best = np.float32(-np.inf)
        for place in range(BLOCK_CELLS):
            some[place] = bases.scores[look, low + place] + scale * np.float32(sums[place])
            best = max(best, some[place])
        top = max(top, best)
        if best < top - margin:
            continue
        for place in range(min(BLOCK_CELLS, len(scores) - low)):
            scores[order[low + place]] = some[place]


@compiled
def _total(values: NDArray[np.float32]) -> float:
    """Return the sum of values, which are overwritten: halves are added in vector operations."""
    size = len(values)
    while size > 1:
        half = size // 2
        for place in range(half):
            values[place] += values[size - half + place]
        size -= half
    return float(values[0])


@compiled
def _high(sums: NDArray[np.uint32], rank: int, best: NDArray[np.int64]) -> int:
    """Return the sum with a rank, where the highest has rank 1; `best` is working memory."""
    best[:rank] = 0
    last = np.int64(0)
    for value in sums:
        if value > last:
            # Insert into the sorted list of the highest sums.
            at = rank - 1
            while at > 0 and value > best[at - 1]:
                best[at] = best[at - 1]
                at -= 1
            best[at] = value
            last = best[rank - 1]
    return int(last)


@compiled
def _clear_circle(
    middle: int, sums: NDArray[np.uint32], ids: NDArray[np.int64], circle: NDArray[np.int64]
) -> None:
    """Set the sums of all cells in the circle around the cell with the id `middle` to zero."""
    for line in range(len(circle)):
        last = middle + circle[line, 1]
        for cell in range(np.searchsorted(ids, middle + circle[line, 0]), len(ids)):
            if ids[cell] > last:
                break
            sums[cell] = 0


@compiled
def _sum_at(values: NDArray[np.uint8], symbols: NDArray[np.int64], slot: int) -> int:
    """Return the sum of some columns in the cell of a slot."""
    block, inside = divmod(slot, BLOCK_CELLS)
    # A flat array and unsigned indices, which are faster.
    flat, size = values.ravel(), np.uint64(BLOCK_CELLS)
    first = np.uint64(block) * np.uint64(values.shape[1]) * size + np.uint64(_byte(inside))
    total = 0
    for place in range(len(symbols)):
        total += flat[first + np.uint64(symbols[place]) * size]
    return total


class CellColumns(NamedTuple):
    """What each symbol adds to the score of each of n cells, as in `SymbolColumns`.

    `values` (blocks, symbols, BLOCK_CELLS) are in steps of `step`, `constants` (d, n) by direction
    and slot; `order` (n,) and `slots` (n,) are the cell of each slot and the slot of each cell.
    `peaks` (symbols, b / 2) are the highest value of each block, as pairs of the first and the
    second half of b blocks in turn; an even number, so that the last may be empty. `powers`
    (2 l + 1,) are the tempered likelihood ratios of -l to l steps.
    """

    values: NDArray[np.uint8]
    order: NDArray[np.int64]
    slots: NDArray[np.int64]
    peaks: NDArray[np.uint16]
    constants: NDArray[np.float32]
    step: float
    powers: NDArray[np.float32]


class Comparisons(NamedTuple):
    """Results of q looks, as in `Lookalikes`: `like` and `share` (q, p) are its cells and sums.

    `rest` (q, k) is the value of `far` without each class.
    """

    near: NDArray[np.float64]
    far: NDArray[np.float64]
    like: NDArray[np.int64]
    share: NDArray[np.float64]
    rest: NDArray[np.float64]


class CellPlaces(NamedTuple):
    """Places of n cells: rising ids, and columns and rows (n, 2) by slot; the circle around each.

    `circle` (a, 2) is that of `cell_circle`, `limit` its squared radius in cells.
    """

    ids: NDArray[np.int64]
    at: NDArray[np.int64]
    circle: NDArray[np.int64]
    limit: int


class Entries(NamedTuple):
    """Objects seen from n cells: first object (n + 1,), symbols, class rows and bearings (m,)."""

    offsets: NDArray[np.int64]
    symbols: NDArray[np.int64]
    kinds: NDArray[np.int64]
    bearing_units: NDArray[np.uint16]


class BaseScores(NamedTuple):
    """Scores of the cells for a query without detections, by direction of view (d) and slot.

    `levels` (d, n) are whole steps from 1, with 0 for slots without a cell, and `peaks` (d, b) the
    highest of each block. `trims` (d, n) are the tempered ratios of the rest.
    `lifts` are the tempered ratios of not having the objects of each class: (d, n, k), in a sample
    (d, k, n).
    """

    levels: NDArray[np.unsignedinteger]
    peaks: NDArray[np.unsignedinteger]
    trims: NDArray[np.float32]
    lifts: NDArray[np.float32]


class CellSample(NamedTuple):
    """Sample that represents the cells that are not likely, (s,) rising row numbers.

    Each counts for `weight` cells. `pairs` (symbols, s / 2) are their bytes as 16-bit numbers, of
    the first and the second half in turn. A cell is likely if its sum is at least the one with a
    `rank` in the sample; without a sample, all cells are. The cells of the sample that see class k
    are ``seeing[starts[k]:starts[k + 1]]``.
    """

    cells: NDArray[np.int64]
    ids: NDArray[np.int64]
    pairs: NDArray[np.uint16]
    bases: BaseScores
    starts: NDArray[np.int64]
    seeing: NDArray[np.int64]
    rank: int
    weight: float


@compiled
def _sum_circle(  # noqa: PLR0917 - a kernel takes no keywords
    middle: int,
    own: int,
    excluded: int,
    direction: int,
    shown: NDArray[np.int64],
    columns: CellColumns,
    bases: BaseScores,
    places: CellPlaces,
) -> float:
    """Sum the likelihood ratios of the cells around a cell, except those around another.

    The other one is `excluded`, a slot; -1 for none.
    """
    powers, slots = columns.powers, columns.slots
    top = len(powers) // 2
    total = 0.0
    for line in range(len(places.circle)):
        last = places.ids[middle] + places.circle[line, 1]
        first = places.ids[middle] + places.circle[line, 0]
        for cell in range(np.searchsorted(places.ids, first), len(places.ids)):
            if places.ids[cell] > last:
                break
            slot = slots[cell]
            if excluded >= 0:
                across = places.at[slot, 0] - places.at[excluded, 0]
                along = places.at[slot, 1] - places.at[excluded, 1]
                if across * across + along * along <= places.limit:
                    continue
            rise = bases.levels[direction, slot] + _sum_at(columns.values, shown, slot) - own
            total += powers[top + min(max(rise, -top), top)] * bases.trims[direction, slot]
    return total


@compiled
def compare_cells(  # noqa: C901, PLR0912, PLR0915, PLR0917 - a kernel takes no keywords
    looks: NDArray[np.int64],
    entries: Entries,
    inside: NDArray[np.bool_],
    columns: CellColumns,
    bases: BaseScores,
    sample: CellSample,
    places: CellPlaces,
    results: Comparisons,
) -> None:
    """Compare looks from cells with all cells, by the likelihood of each look there.

    `looks` (q,) are ``row * d + direction``, and `inside` (d, units) is whether each of d
    directions includes each bearing. Fills `results`, with `like` and `share` unsorted.
    """
    values, constants, powers = columns.values, columns.constants, columns.powers
    order, slots, blocks = columns.order, columns.slots, len(columns.values)
    near, far, like = results.near, results.far, results.like
    share, rest = results.share, results.rest
    directions = len(constants)
    count, classes, size = len(looks), rest.shape[1], len(sample.cells)
    top, scale = np.int32(len(powers) // 2), np.float32(columns.step)
    # Collect the objects of all looks: those of look i are in starts[i] to starts[i + 1].
    starts = np.zeros(count + 1, np.int64)
    for look in range(count):
        cell, direction = divmod(looks[look], directions)
        starts[look + 1] = starts[look]
        for entry in range(entries.offsets[cell], entries.offsets[cell + 1]):
            starts[look + 1] += inside[direction, entries.bearing_units[entry]]
    symbols = np.empty(starts[count], np.int64)
    kinds = np.empty(starts[count], np.int64)
    own = np.zeros(count, np.int64)
    level = np.ones(count, np.int64)
    bounds = np.empty(bases.peaks.shape[1], bases.levels.dtype)
    sums = np.empty(BLOCK_CELLS, bases.levels.dtype)
    promising = np.zeros((blocks, count), np.bool_)
    highest = np.empty(max(sample.rank, 1), np.int64)
    words = np.empty((2, max(size, BLOCK_CELLS, len(bounds)) // 2), np.uint16)
    weights, terms = np.empty(size, np.float32), np.empty(size, np.float32)
    sees, nothing = np.zeros((count, classes), np.bool_), np.zeros(size, bases.levels.dtype)
    sampled, part = np.empty_like(nothing), np.empty_like(nothing)
    far[:] = 0.0
    rest[:] = 0.0
    for look in range(count):
        cell, direction = divmod(looks[look], directions)
        at = starts[look]
        for entry in range(entries.offsets[cell], entries.offsets[cell + 1]):
            if inside[direction, entries.bearing_units[entry]]:
                symbols[at], kinds[at] = entries.symbols[entry], entries.kinds[entry]
                sees[look, kinds[at]] = True
                at += 1
        shown, shown_kinds = symbols[starts[look] : at], kinds[starts[look] : at]
        slot = slots[cell]
        own[look] = bases.levels[direction, slot] + _sum_at(values, shown, slot)
        if len(shown) == 0:
            continue
        if size > 0:
            # Estimate the sum over the unlikely cells from the sample, without the circle of the
            # cell.
            _add_up(sample.pairs, shown, sample.bases.levels[direction], words, sampled)
            _clear_circle(places.ids[cell], sampled, sample.ids, places.circle)
            level[look] = max(_high(sampled, sample.rank, highest), 1)
            trims, own_sum, least = sample.bases.trims[direction], np.int32(own[look]), level[look]
            for other in range(size):
                rise = min(max(np.int32(sampled[other]) - own_sum, -top), top)
                weight = powers[top + rise] * trims[other]
                unlikely = (sampled[other] > 0) & (sampled[other] < least)
                weights[other] = weight if unlikely else np.float32(0.0)
            terms[:] = weights
            far[look] = _total(terms)
            # The same without each class: divide by the ratios of its detections, and multiply by
            # that of not having its objects.
            for class_row in range(classes):
                lifts = sample.bases.lifts[direction, class_row]
                if not sees[look, class_row]:
                    for place in range(sample.starts[class_row], sample.starts[class_row + 1]):
                        other = sample.seeing[place]
                        rest[look, class_row] += weights[other] * (lifts[other] - 1.0)
                    continue
                _add_up(sample.pairs, shown[shown_kinds == class_row], nothing, words, part)
                for other in range(size):
                    fall = min(np.int32(part[other]), top)
                    lift = lifts[other] * powers[top - fall]
                    terms[other] = min(weights[other] * lift, _MOST)
                rest[look, class_row] = _total(terms)
            far[look] *= sample.weight
            rest[look] *= sample.weight
        # Blocks without a likely cell are skipped: the sum of the highest values is too low.
        _add_up(columns.peaks, shown, bases.peaks[direction], words, bounds)
        for block in range(blocks):
            promising[block, look] = bounds[block] >= level[look]
    # Compare with the likely cells one by one, block by block, and keep the best candidates.
    pairs = values.view(np.uint16)
    best = np.full((count, _CANDIDATES), -np.inf, np.float32)
    apart = np.zeros((count, _CANDIDATES), np.int64)
    candidates = np.full((count, _CANDIDATES), -1, np.int64)
    candidate_counts = np.zeros(count, np.int64)
    falls = np.empty(classes, np.int64)
    for block in range(blocks):
        low = block * BLOCK_CELLS
        for look in range(count):
            if not promising[block, look]:
                continue
            shown = symbols[starts[look] : starts[look + 1]]
            cell, direction = divmod(looks[look], directions)
            slot = slots[cell]
            _add_up(
                pairs[block], shown, bases.levels[direction, low : low + BLOCK_CELLS], words, sums
            )
            # Most blocks have no likely cell, and most lines of the others.
            if _highest(sums) < level[look]:
                continue
            for line in range(0, BLOCK_CELLS, LINE_CELLS):
                if _highest(sums[line : line + LINE_CELLS]) < level[look]:
                    continue
                for inner in range(line, line + LINE_CELLS):
                    if sums[inner] < level[look]:
                        continue
                    other = low + inner
                    across = places.at[other, 0] - places.at[slot, 0]
                    along = places.at[other, 1] - places.at[slot, 1]
                    away = across * across + along * along
                    if away <= places.limit:
                        continue
                    rise = min(max(np.int64(sums[inner]) - own[look], -top), top)
                    weight = powers[top + rise] * bases.trims[direction, other]
                    far[look] += weight
                    # The same without each class.
                    falls[:] = 0
                    byte = _byte(inner)
                    for entry in range(starts[look], starts[look + 1]):
                        falls[kinds[entry]] += values[block, symbols[entry], byte]
                    for class_row in range(classes):
                        lift = np.float64(bases.lifts[direction, other, class_row])
                        if sees[look, class_row]:
                            lift *= powers[top - min(falls[class_row], top)]
                        else:
                            lift -= 1.0
                        rest[look, class_row] += weight * lift
                    added = sums[inner] - bases.levels[direction, other]
                    score = constants[direction, other] + scale * np.float32(added)
                    last = _CANDIDATES - 1
                    # Insert into the candidates, sorted by score; of equal ones the nearer first.
                    if score < best[look, last] or (
                        score == best[look, last] and away >= apart[look, last]
                    ):
                        continue
                    at = min(candidate_counts[look], last)
                    while at > 0 and (
                        score > best[look, at - 1]
                        or (score == best[look, at - 1] and away < apart[look, at - 1])
                    ):
                        best[look, at] = best[look, at - 1]
                        apart[look, at] = apart[look, at - 1]
                        candidates[look, at] = candidates[look, at - 1]
                        at -= 1
                    best[look, at], apart[look, at], candidates[look, at] = score, away, other
                    candidate_counts[look] = min(candidate_counts[look] + 1, _CANDIDATES)
    # Divide all sums by the ratio of the cell itself, and select places among the candidates.
    like[:] = -1
    share[:] = 0.0
    near[:] = 0.0
    for look in range(count):
        shown = symbols[starts[look] : starts[look + 1]]
        if len(shown) == 0:
            continue
        cell, direction = divmod(looks[look], directions)
        slot = slots[cell]
        trim = bases.trims[direction, slot]
        falls[:] = 0
        for entry in range(starts[look], starts[look + 1]):
            falls[kinds[entry]] += _sum_at(values, symbols[entry : entry + 1], slot)
        for class_row in range(classes):
            lift = (
                bases.lifts[direction, slot, class_row] * powers[top - min(falls[class_row], top)]
            )
            if not sees[look, class_row]:
                rest[look, class_row] += far[look]
            rest[look, class_row] /= lift * trim
        far[look] /= trim
        near[look] = (
            _sum_circle(cell, own[look], -1, direction, shown, columns, bases, places) / trim
        )
        # Take candidates from the best on, if their circles do not overlap with earlier ones.
        selected = 0
        for candidate in range(candidate_counts[look]):
            if selected == like.shape[1]:
                break
            new = candidates[look, candidate]
            free = True
            for place in range(selected):
                old = slots[like[look, place]]
                across = places.at[old, 0] - places.at[new, 0]
                along = places.at[old, 1] - places.at[new, 1]
                free = free and across * across + along * along > 4 * places.limit
            if free:
                like[look, selected] = order[new]
                total = _sum_circle(
                    order[new], own[look], slot, direction, shown, columns, bases, places
                )
                share[look, selected] = total / trim
                selected += 1
