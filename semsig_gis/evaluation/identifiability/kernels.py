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
    objects: DetectedObjects,
    spread: NDArray[np.float32],
    naming: NDArray[np.float32],
    logs: NDArray[np.uint8],
    columns: NDArray[np.uint8],
) -> None:
    """Compute, for some cells, the log-likelihood that each detected symbol adds, in whole steps.

    Fills the cells of the lines from ``lines[0]`` to ``lines[1] - 1``, `LINE_CELLS` cells each, in
    `columns`, shape (blocks, k, bins, BLOCK_CELLS). `spread`, shape (levels, units, bins), is the
    density per degree in each bin for an object at a unit of bin 0. `naming`, by length, class and
    name, is the probability of the name divided by the density of false objects of that name.
    `logs` is a table of logarithms in steps, by the leading bits of a float32 of 1 or more.
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
        for cell in range(first, last):
            low, high = offsets[cell], offsets[cell + 1]
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
                    buffer[symbol, place, cell - first] = logs[min(index, top)]
        # Write a whole line at once, so that each cache line of the columns is touched once.
        for symbol in range(symbols):
            for place in range(bins):
                for cell in range(first, last):
                    block, inside = divmod(cell, BLOCK_CELLS)
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
    """Fill `sums` (n,) with the sums of some columns and of a base.

    The columns are pairs of bytes as 16-bit numbers, shape (s, n / 2). The first half of the sums
    is that of the lower bytes, the second half that of the higher bytes. A sum of the pairs is the
    sum of the lower bytes plus 256 times that of the higher ones (modulo 2**16), so that only the
    higher bytes are summed separately. `words` (2, n / 2) is working memory.
    """
    half = columns.shape[1]
    whole, high = words[0, :half], words[1, :half]
    for place in range(2 * half):
        sums[place] = base[place]
    for low in range(0, len(symbols), _MOST_OBJECTS):
        part = symbols[low : low + _MOST_OBJECTS]
        whole[:] = 0
        high[:] = 0
        # Four columns at once, which needs a quarter of the loads and stores of the sums.
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
    """Fill the scores of all cells (n,): the sum of some columns and a constant of each cell."""
    pairs, scale = values.view(np.uint16), np.float32(step)
    nothing, words = np.zeros(BLOCK_CELLS, np.uint32), np.empty((2, BLOCK_CELLS // 2), np.uint16)
    sums = np.empty(BLOCK_CELLS, np.uint32)
    for block in range(len(values)):
        _add_up(pairs[block], symbols, nothing, words, sums)
        low = block * BLOCK_CELLS
        for inside in range(min(BLOCK_CELLS, len(scores) - low)):
            scores[low + inside] = constants[low + inside] + scale * np.float32(sums[inside])


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
def _sum_at(values: NDArray[np.uint8], symbols: NDArray[np.int64], cell: int) -> int:
    """Return the sum of some columns in one cell."""
    block, inside = divmod(cell, BLOCK_CELLS)
    place = _byte(inside)
    total = 0
    for symbol in symbols:
        total += values[block, symbol, place]
    return total


class CellColumns(NamedTuple):
    """What each symbol adds to the score of each of n cells, as in `SymbolColumns`.

    `values` (blocks, symbols, BLOCK_CELLS) are in steps of `step`, `constants` (d, n) by direction;
    `powers` (2 l + 1,) are the tempered likelihood ratios of -l to l steps.
    """

    values: NDArray[np.uint8]
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
    """Places of n cells: rising ids, columns and rows (n, 2), and the circle around each.

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
    """Scores of the cells for a query without detections, by direction of view (d).

    `levels` (d, n) are whole steps from 1, and `trims` (d, n) the tempered ratios of the rest.
    `lifts` are the tempered ratios of not having the objects of each class: (d, n, k), in a sample
    (d, k, n).
    """

    levels: NDArray[np.unsignedinteger]
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
    values: NDArray[np.uint8],
    bases: BaseScores,
    powers: NDArray[np.float32],
    places: CellPlaces,
) -> float:
    """Sum the likelihood ratios of the cells around a cell, except those around `excluded`."""
    top = len(powers) // 2
    total = 0.0
    for line in range(len(places.circle)):
        last = places.ids[middle] + places.circle[line, 1]
        first = places.ids[middle] + places.circle[line, 0]
        for cell in range(np.searchsorted(places.ids, first), len(places.ids)):
            if places.ids[cell] > last:
                break
            if excluded >= 0:
                across = places.at[cell, 0] - places.at[excluded, 0]
                along = places.at[cell, 1] - places.at[excluded, 1]
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
    columns: CellColumns,
    bases: BaseScores,
    sample: CellSample,
    places: CellPlaces,
    buffer: NDArray[np.unsignedinteger],
    results: Comparisons,
) -> None:
    """Compare looks from cells with all cells, by the likelihood of each look there.

    `looks` (q,) are ``row * d + direction``, and `inside` (d, units) is whether each of d
    directions includes each bearing. `buffer` (2, s), at least a block wide, is working memory.
    Fills `results`, with `like` and `share` unsorted.
    """
    values, constants, powers = columns.values, columns.constants, columns.powers
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
    highest = np.empty(max(sample.rank, 1), np.int64)
    words = np.empty((2, max(size, BLOCK_CELLS) // 2), np.uint16)
    weights, terms = np.empty(size, np.float32), np.empty(size, np.float32)
    sees, nothing = np.zeros((count, classes), np.bool_), np.zeros(size, buffer.dtype)
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
        own[look] = bases.levels[direction, cell] + _sum_at(values, shown, cell)
        if size == 0 or len(shown) == 0:
            continue
        # Estimate the sum over the unlikely cells from the sample, without the circle of the cell.
        sums, part = buffer[0, :size], buffer[1, :size]
        _add_up(sample.pairs, shown, sample.bases.levels[direction], words, sums)
        _clear_circle(places.ids[cell], sums, sample.ids, places.circle)
        level[look] = max(_high(sums, sample.rank, highest), 1)
        trims, own_sum, least = sample.bases.trims[direction], np.int32(own[look]), level[look]
        for other in range(size):
            rise = min(max(np.int32(sums[other]) - own_sum, -top), top)
            weight = powers[top + rise] * trims[other]
            unlikely = (sums[other] > 0) & (sums[other] < least)
            weights[other] = weight if unlikely else np.float32(0.0)
        terms[:] = weights
        far[look] = _total(terms)
        # The same without each class: divide by the ratios of its detections, and multiply by that
        # of not having its objects.
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
    # Compare with the likely cells one by one, block by block, and keep the best candidates.
    pairs = values.view(np.uint16)
    best = np.full((count, _CANDIDATES), -np.inf, np.float32)
    apart = np.zeros((count, _CANDIDATES), np.int64)
    candidates = np.full((count, _CANDIDATES), -1, np.int64)
    candidate_counts = np.zeros(count, np.int64)
    tops = np.empty(LINE_CELLS, buffer.dtype)
    falls = np.empty(classes, np.int64)
    for block in range(len(values)):
        low = block * BLOCK_CELLS
        for look in range(count):
            shown = symbols[starts[look] : starts[look + 1]]
            if len(shown) == 0:
                continue
            cell, direction = divmod(looks[look], directions)
            sums = buffer[0, :BLOCK_CELLS]
            _add_up(
                pairs[block], shown, bases.levels[direction, low : low + BLOCK_CELLS], words, sums
            )
            # The highest sum at each place of the lines; most of them are below the level.
            tops[:] = sums[:LINE_CELLS]
            for line in range(LINE_CELLS, BLOCK_CELLS, LINE_CELLS):
                for place in range(LINE_CELLS):
                    tops[place] = max(tops[place], sums[line + place])
            for place in range(LINE_CELLS):
                if tops[place] < level[look]:
                    continue
                for inner in range(place, BLOCK_CELLS, LINE_CELLS):
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
                    # The same without each class.
                    falls[:] = 0
                    byte = _byte(inner)
                    for entry in range(starts[look], starts[look + 1]):
                        falls[kinds[entry]] += values[block, symbols[entry], byte]
                    for class_row in range(classes):
                        lift = np.float64(bases.lifts[direction, other, class_row])
                        lift *= powers[top - min(falls[class_row], top)]
                        if not sees[look, class_row]:
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
        trim = bases.trims[direction, cell]
        falls[:] = 0
        for entry in range(starts[look], starts[look + 1]):
            falls[kinds[entry]] += _sum_at(values, symbols[entry : entry + 1], cell)
        for class_row in range(classes):
            lift = (
                bases.lifts[direction, cell, class_row] * powers[top - min(falls[class_row], top)]
            )
            if not sees[look, class_row]:
                rest[look, class_row] += far[look]
            rest[look, class_row] /= lift * trim
        far[look] /= trim
        near[look] = (
            _sum_circle(cell, own[look], -1, direction, shown, values, bases, powers, places) / trim
        )
        # Take candidates from the best on, if their circles do not overlap with earlier ones.
        selected = 0
        for candidate in range(candidate_counts[look]):
            if selected == like.shape[1]:
                break
            new = candidates[look, candidate]
            free = True
            for place in range(selected):
                old = like[look, place]
                across = places.at[old, 0] - places.at[new, 0]
                along = places.at[old, 1] - places.at[new, 1]
                free = free and across * across + along * along > 4 * places.limit
            if free:
                like[look, selected] = new
                total = _sum_circle(
                    new, own[look], cell, direction, shown, values, bases, powers, places
                )
                share[look, selected] = total / trim
                selected += 1
