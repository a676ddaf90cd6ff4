"""Compiled loops of the metrics and of their fusion.

Bit ``8 i + k`` of word ``w`` of a bit plane belongs to sequence ``8 (stripe i + w) + k`` of its
block, where ``stripe`` is the number of words in a plane. With this layout, the loop that spreads
the eight bits of an octet to eight bytes writes to consecutive addresses.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

_NONE, _ALL = np.uint64(0), np.uint64(0xFFFF_FFFF_FFFF_FFFF)
_OCTET, _TOP = np.uint64(0xFF), np.uint64(7)
_COPIES = np.uint64(0x0101_0101_0101_0101)  # multiplied by an octet: the octet in every byte
_OWN_BITS = np.uint64(0x8040_2010_0804_0201)  # bit k of byte k
_BELOW_TOP = np.uint64(0x7F7F_7F7F_7F7F_7F7F)
_TOP_BITS = np.uint64(0x8080_8080_8080_8080)


@compiled  # pragma: no cover - coverage does not see machine code
def pack(  # noqa: PLR0917
    values: NDArray[np.uint8],
    offsets: NDArray[np.int64],
    digits: NDArray[np.int64],
    bounds: NDArray[np.int64],
    per_position: int,
    planes: NDArray[np.uint64],
) -> None:
    """Set the bits of all sequences in `planes`, which contains zeros, shape (p, stripe).

    `values` and `offsets` are the sequences in CSR form, `digits`, shape (256, 2), the two planes
    of each value, and `bounds`, shape (blocks + 1,), the first plane of each block.
    """
    stripe = planes.shape[1]
    for index in range(len(offsets) - 1):
        block, place = divmod(index, 64 * stripe)
        octet, k = divmod(place, 8)
        i, w = divmod(octet, stripe)
        bit = np.uint64(1) << np.uint64(8 * i + k)
        # Sequences end at the last position of their block.
        row = bounds[block + 1] - per_position * (offsets[index + 1] - offsets[index])
        for entry in range(offsets[index], offsets[index + 1]):
            planes[row, w] |= bit
            planes[row + digits[values[entry], 0], w] |= bit
            planes[row + digits[values[entry], 1], w] |= bit
            row += per_position


@compiled  # pragma: no cover - coverage does not see machine code
def scan(  # noqa: PLR0917
    planes: NDArray[np.uint64],
    bounds: NDArray[np.int64],
    per_position: int,
    lengths: NDArray[np.int64],
    query_digits: NDArray[np.int64],
    ends: NDArray[np.int64],
    normalized: bool,  # noqa: FBT001
    result: NDArray[np.float32],
) -> None:
    """Fill `result`, shape (queries, d), with distances to the sequences of all blocks.

    `lengths`, shape (d,), are those of the sequences. `query_digits`, shape (entries, 2), has the
    two planes of each value of the concatenated queries; query i is ``ends[i]:ends[i + 1]``.
    `normalized` divides by the longer length.
    """
    stripe = planes.shape[1]
    longest = 0
    for query in range(len(ends) - 1):
        longest = max(longest, ends[query + 1] - ends[query])
    bits = 0  # that the largest sum of steps needs
    while 2 * longest >> bits:
        bits += 1
    plus, minus = np.empty((longest, stripe), np.uint64), np.empty((longest, stripe), np.uint64)
    spare = np.empty((2, stripe), np.uint64)
    sums = np.empty((bits, stripe), np.uint64)
    spread = np.empty(8 * stripe, np.uint64)
    costs = np.empty(64 * stripe, np.int32)
    for block in range(len(bounds) - 1):
        start = block * 64 * stripe
        own = lengths[start : start + 64 * stripe]
        for query in range(len(ends) - 1):
            digits = query_digits[ends[query] : ends[query + 1]]
            _step(
                planes, bounds[block], bounds[block + 1], per_position, digits, plus, minus, spare
            )
            _add(plus, minus, len(digits), spare[0], sums)
            # The cost starts at the length of the sequence; the steps down the last column follow.
            # The sum counts "+1" and "not -1", which is the steps plus the query's length.
            for place in range(len(own)):
                costs[place] = own[place] - len(digits)
            _spread(sums, spread, costs)
            row = result[query, start : start + len(own)]
            if normalized:
                for place in range(len(own)):
                    largest = max(own[place], len(digits), 1)
                    row[place] = np.float32(costs[place]) / np.float32(largest)
            else:
                for place in range(len(own)):
                    row[place] = costs[place]


@compiled  # pragma: no cover - coverage does not see machine code
def _step(  # noqa: PLR0917
    planes: NDArray[np.uint64],
    low: int,
    high: int,
    per_position: int,
    digits: NDArray[np.int64],
    plus: NDArray[np.uint64],
    minus: NDArray[np.uint64],
    top: NDArray[np.uint64],
) -> None:
    """Fill the cost tables of one block; `plus` and `minus` get the steps of the last column."""
    stripe = planes.shape[1]
    # Each step down the first column, before any value of the sequences, is +1.
    for i in range(len(digits)):
        for w in range(stripe):
            plus[i, w], minus[i, w] = _ALL, _NONE
    top_plus, top_minus = top[0], top[1]
    for row in range(low, high, per_position):
        # Steps along the top are +1 where the sequence has an entry, otherwise 0.
        for w in range(stripe):
            top_plus[w], top_minus[w] = planes[row, w], _NONE
        for i in range(len(digits)):
            # The values are equal where both digits are set; the recurrence is in `BitPlanes`.
            first, second = planes[row + digits[i, 0]], planes[row + digits[i, 1]]
            side_plus, side_minus = plus[i], minus[i]
            for w in range(stripe):
                v_plus, v_minus, h_plus, h_minus = (
                    side_plus[w],
                    side_minus[w],
                    top_plus[w],
                    top_minus[w],
                )
                level = (first[w] & second[w]) | v_minus | h_minus
                top_plus[w] = v_minus | ~(level | v_plus)
                top_minus[w] = v_plus & level
                side_plus[w] = h_minus | ~(level | h_plus)
                side_minus[w] = h_plus & level


@compiled  # pragma: no cover - coverage does not see machine code
def _add(
    plus: NDArray[np.uint64],
    minus: NDArray[np.uint64],
    length: int,
    carry: NDArray[np.uint64],
    sums: NDArray[np.uint64],
) -> None:
    """Set `sums` to the number of steps that are +1 or not -1 per sequence, one plane per bit."""
    stripe = plus.shape[1]
    for bit in range(len(sums)):
        for w in range(stripe):
            sums[bit, w] = _NONE
    for i in range(length):
        # Full adder for the lowest bit, then half adders that pass the carry on.
        plus_row, minus_row, digit = plus[i], minus[i], sums[0]
        for w in range(stripe):
            a, b, c = plus_row[w], ~minus_row[w], digit[w]
            digit[w] = a ^ b ^ c
            carry[w] = (a & b) | (c & (a ^ b))
        for bit in range(1, len(sums)):
            digit = sums[bit]
            for w in range(stripe):
                a, c = carry[w], digit[w]
                digit[w] = a ^ c
                carry[w] = a & c


@compiled  # pragma: no cover - coverage does not see machine code
def _spread(sums: NDArray[np.uint64], spread: NDArray[np.uint64], costs: NDArray[np.int32]) -> None:
    """Add the sums, one plane per bit, to the costs of the sequences."""
    stripe = sums.shape[1]
    each = spread.view(np.uint8)
    # Eight planes at a time make one byte per sequence.
    for byte in range(0, len(sums), 8):
        for octet in range(8 * stripe):
            spread[octet] = _NONE
        for bit in range(byte, min(byte + 8, len(sums))):
            digit, power = sums[bit], np.uint64(bit - byte)
            for i in range(8):
                shift, target = np.uint64(8 * i), spread[i * stripe : (i + 1) * stripe]
                # Copy the octet to eight bytes, keep bit k of byte k, and reduce it to 0 or 1.
                for w in range(stripe):
                    own = (((digit[w] >> shift) & _OCTET) * _COPIES) & _OWN_BITS
                    marks = ((own + _BELOW_TOP) | own) & _TOP_BITS
                    target[w] |= (marks >> _TOP) << power
        for place in range(len(costs)):
            costs[place] += np.int32(each[place]) << byte


@compiled  # pragma: no cover - coverage does not see machine code
def count_steps(
    first: NDArray[np.float32], counts: NDArray[np.int64], step: float, cells: NDArray[np.int64]
) -> None:
    """Add the cells of each sequence to a histogram of scores, where bin i is i steps.

    `first`, shape (d,), has the scores of distinct sequences, multiples of `step`, and `counts` the
    numbers of their cells.
    """
    for place in range(len(first)):
        cells[int(np.rint(first[place] / step))] += counts[place]


@compiled  # pragma: no cover - coverage does not see machine code
def fuse(  # noqa: PLR0917
    left: NDArray[np.float64],
    types: NDArray[np.int64],
    right: NDArray[np.float32],
    angles: NDArray[np.int64],
    step: float,
    scores: NDArray[np.float32],
) -> None:
    """Fill `scores`, shape (n,), with the fused type and angle distances of every cell.

    `left` and `right` are the weighted distances of the distinct sequences, in steps; `types` and
    `angles`, shape (n,), are the rows of the sequences of each cell.
    """
    for cell in range(len(types)):
        scores[cell] = np.rint(left[types[cell]] + right[angles[cell]]) * step


@compiled  # pragma: no cover - coverage does not see machine code
def put_behind(  # noqa: PLR0917
    first: NDArray[np.float32],
    cut: np.float32,
    fused: NDArray[np.float32],
    worst: np.float32,
    least: np.float32,
    scores: NDArray[np.float32],
) -> None:
    """Fill `scores` with `fused` for cells that pass stage one; rank all others behind them.

    `cut` is the worst score of stage one that passes, `worst` the worst fused score of a cell that
    passes, and `least` the lowest score for a cell that does not. Arrays have shape (n,).
    """
    for cell in range(len(first)):
        behind = max(worst + (first[cell] - cut), least)
        scores[cell] = fused[cell] if first[cell] <= cut else behind


@compiled  # pragma: no cover - coverage does not see machine code
def add_quotients(
    counts: NDArray[np.uint16 | np.uint32],
    quotients: NDArray[np.float64],
    total: NDArray[np.float64],
) -> None:
    """Add ``quotients[counts]`` to `total`, without a temporary array."""
    for row in range(len(counts)):
        total[row] += quotients[counts[row]]
