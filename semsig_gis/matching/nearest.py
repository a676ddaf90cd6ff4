"""The nearest sequences by edit distance, without measuring those that are too short or too long.

A sequence table is ordered by length, and the lengths alone bound the distance from below: what
one sequence is longer must be inserted. So a search measures the blocks of like length first, and
then only the blocks whose bound does not exceed what was found.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.database.sequences import checked_sequence
from semsig_gis.matching.metrics.edit import BLOCK, bit_planes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database.sequences import SequenceTable


@dataclass(frozen=True, eq=False, slots=True)
class Nearest:
    """The rows of a table nearest to a query, and how many rows were not measured (`skipped`).

    `rows` are nearest first, equal ones in table order, with every row that ties with the last.
    """

    rows: NDArray[np.int64]
    distances: NDArray[np.float32]
    skipped: int


def nearest(
    query: NDArray[np.uint8],
    table: SequenceTable,
    top: int,
    *,
    among: NDArray[np.bool_] | None = None,
    normalized: bool = True,
    wildcard: int | None = None,
) -> Nearest:
    """Find the `top` rows of a table nearest to a query by edit distance with weights of 1.

    The result is that of a full search, with all ties. `among`, shape (d,), is True for the
    distinct sequences that may be found (see `database.requirement`). `normalized` divides by the
    longer length; a `wildcard` in the query equals every value.
    """
    if top < 1:
        msg = f"the nearest {top} sequences were asked for; give a whole number from 1."
        raise InputError(msg)
    length = len(checked_sequence(query))
    bounds = _block_bounds(table.lengths, length, normalized=normalized)

    def measure(low: int, high: int) -> NDArray[np.float32]:
        (found,) = bit_planes(table).edit_distances(
            [query], normalized=normalized, wildcard=wildcard, blocks=(low, high)
        )
        if among is not None:
            found[~among[low * BLOCK : high * BLOCK]] = np.inf
        return np.asarray(found)

    # Bounds fall up to the query's length and rise after it, so what is below a limit is one run.
    low, high = _run(bounds <= bounds.min(initial=np.inf))
    found = measure(low, high)
    cut = _cut(found, table.counts[low * BLOCK : high * BLOCK], top)
    first, last = _run(bounds <= cut)
    if (first, last) != (low, high):
        found = np.concatenate([measure(first, low), found, measure(high, last)])
        cut = _cut(found, table.counts[first * BLOCK : last * BLOCK], top)
    kept = np.flatnonzero((found <= cut) & np.isfinite(found))
    distinct = kept + first * BLOCK
    rows = table.rows(distinct)
    distances = np.repeat(found[kept], table.counts[distinct])
    order = np.lexsort((rows, distances))
    measured = int(table.counts[first * BLOCK : last * BLOCK].sum())
    return Nearest(rows[order], distances[order], len(table.inverse) - measured)


def _block_bounds(
    lengths: NDArray[np.int64], length: int, *, normalized: bool
) -> NDArray[np.float32]:
    """Return the smallest distance that the lengths in each block allow."""
    starts = np.arange(0, len(lengths), BLOCK)
    shortest = lengths[starts]
    longest = lengths[np.minimum(starts + BLOCK, len(lengths)) - 1]
    closest = np.clip(length, shortest, longest)
    gap = np.abs(closest - length).astype(np.float32)
    # Both are rounded like the distances, so that a bound is never above one.
    if normalized:
        gap /= np.maximum(closest, max(length, 1)).astype(np.float32)
    return np.asarray(gap)


def _run(inside: NDArray[np.bool_]) -> tuple[int, int]:
    """Return where the only run of True begins and ends."""
    places = np.flatnonzero(inside)
    return (int(places[0]), int(places[-1]) + 1) if len(places) else (0, 0)


def _cut(distances: NDArray[np.float32], counts: NDArray[np.int64], top: int) -> float:
    """Return the distance of the last row that is wanted, infinity if there are too few rows."""
    if len(distances) == 0:
        return np.inf
    # So many sequences have at least so many rows, which leaves few rows to choose from.
    place = min(top, len(distances)) - 1
    few = distances <= np.partition(distances, place)[place]
    each = np.repeat(distances[few], counts[few])
    return float(np.partition(each, top - 1)[top - 1]) if top <= len(each) else np.inf
