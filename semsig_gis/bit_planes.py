"""Unit-cost edit distances of a query to every sequence of a table at once, by bit slices.

Sequences are dealt into blocks of `STRIPE` words of 64 bits, one bit a sequence. For every
position of a block there are planes: the bits of the sequences that have a certain value there.
Neighbours in the table of costs of the edit distance differ by -1, 0 or 1. These steps are bits
too, so a dozen operations on words fill one entry of the table for 64 sequences, and one vector
instruction takes several words. Nothing depends on how long a query is but the time.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import ModuleType

    from numpy.typing import NDArray

__all__ = ["BLOCK", "BitPlanes"]

STRIPE = 64  # words in a plane: enough work for a loop, little enough for the nearest cache
BLOCK = 64 * STRIPE
"""Sequences in a block."""
_VALUES = 256


@dataclass(frozen=True, eq=False)
class BitPlanes:
    """Sequences of small integers, turned so that the same position of many lies together.

    For every block and position, from the longest sequence back to front, `planes`, shape (p, 64),
    tells which sequences reach that far and then, for each first and each second digit of a value,
    which have it there. All sequences end at the last position. Block ``b`` owns the rows
    ``bounds[b]:bounds[b + 1]``. `digits`, shape (256, 2), gives the two planes that are both set
    where a value stands; never both for a value that no sequence has.

    Two digits, of about the square root of the number of values each, need fewer planes than one
    plane a value: 8 bits an object for eleven classes, 9 for sixteen levels, 33 at most.

    Hyyrö (2004) gives the steps with bits along one sequence; here they lie across sequences. With
    the steps ``v`` down the left side of an entry and ``h`` along its top, and ``e`` set where the
    two values are equal, the diagonal step is 0 where ``d = e | (v < 0) | (h < 0)``. Then the right
    side is +1 where ``(h < 0) | ~(d | (h > 0))`` and -1 where ``(h > 0) & d``, and the bottom is
    the same of ``v``. A sequence that does not reach a position has steps of 0 along its top, which
    leaves its column of steps as it was.
    """

    planes: NDArray[np.uint64]
    bounds: NDArray[np.int64]
    digits: NDArray[np.int64]
    lengths: NDArray[np.int64]

    @classmethod
    def build(cls, values: NDArray[np.uint8], offsets: NDArray[np.int64]) -> BitPlanes:
        """Turn sequences given as flat values and offsets, shape (d + 1,).

        Any order gives the same distances, but sequences ordered by length waste no memory and no
        time.
        """
        present = np.flatnonzero(np.bincount(values, minlength=_VALUES))
        # At least two, so that two digits of one kind make the value that no sequence has.
        first = max(2, int(np.ceil(np.sqrt(len(present)))))
        second = max(1, -(-len(present) // first))
        digits = np.tile(np.array([1, 2]), (_VALUES, 1))
        digits[present, 0] = 1 + np.arange(len(present)) % first
        digits[present, 1] = 1 + first + np.arange(len(present)) // first
        lengths = np.diff(offsets)
        starts = np.arange(0, len(lengths), BLOCK)
        longest = np.maximum.reduceat(lengths, starts) if len(lengths) else lengths
        bounds = np.concatenate([[0], np.cumsum(longest * (1 + first + second))])
        planes = np.zeros((bounds[-1], STRIPE), np.uint64)
        _kernels().pack(values, offsets, digits, bounds, 1 + first + second, planes)
        for array in (planes, bounds, digits):
            array.setflags(write=False)
        return cls(planes, bounds, digits, lengths)

    def edit_distances(
        self,
        queries: Sequence[NDArray[np.uint8]],
        *,
        normalized: bool = True,
        wildcard: int | None = None,
        blocks: tuple[int, int] | None = None,
        threads: int = 1,
    ) -> NDArray[np.float32]:
        """Measure the fewest changes that turn each query into each sequence, shape (queries, d).

        `normalized` divides by the longer of the two lengths, and a `wildcard` in a query equals
        every value. `blocks` is the first block and the one after the last, if not all are wanted.
        """
        low, high = (0, len(self.bounds) - 1) if blocks is None else blocks
        lengths = self.lengths[low * BLOCK : high * BLOCK]
        bounds = self.bounds[low : high + 1]
        digits = self.digits
        if wildcard is not None:
            digits = digits.copy()
            digits[wildcard] = 0
        ends = np.cumsum([0, *map(len, queries)])
        wanted = digits[np.concatenate([*queries, np.empty(0, np.uint8)])]
        result = np.empty((len(queries), len(lengths)), np.float32)
        per_position = int(self.digits.max()) + 1
        scan = partial(
            _kernels().scan,
            self.planes,
            bounds,
            per_position,
            lengths,
            wanted,
            ends,
            normalized,
            result,
        )
        cuts = np.linspace(0, high - low, max(1, threads) + 1).astype(np.int64).tolist()
        if threads > 1:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(scan, cuts[:-1], cuts[1:]))
        else:
            scan(*cuts)
        return result


def _kernels() -> ModuleType:
    """Load the compiled loops, which takes about half a second, when they are first needed."""
    from semsig_gis import _bit_kernels  # noqa: PLC0415

    return _bit_kernels
