"""Distances of all cells to a query."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from semsig_gis.core.taxonomy import WILDCARD
from semsig_gis.database.file import PartitionedDatabase
from semsig_gis.localization.distance.memo import DistanceMemo
from semsig_gis.localization.distance.method import ANGLES, BOTH, FUSION, TYPES
from semsig_gis.localization.distance.metrics import metric
from semsig_gis.localization.distance.metrics.edit import EditWeights

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterator, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core.signature import Signature
    from semsig_gis.database.database import SequenceTable, SignatureDatabase
    from semsig_gis.localization.distance.method import Method

    _SecondStage = Callable[[NDArray[np.int64]], NDArray[np.float32]]

_Value = TypeVar("_Value", bound=np.generic)

# Equal scores must come out equal, however they were added up, or ties are broken by rounding.
# Real differences between scores are far larger than this step, and float32 holds its multiples
# exactly up to 256.
_SCORE_STEP = 2.0**-16
_BATCH_BYTES = 32 << 20  # distances to distinct sequences held at once
# For fewer queries, measuring what the first stage kept beats measuring all sequences at once.
_MANY_QUERIES = 8
_BATCH_QUERIES = 128  # RapidFuzz compares queries of like length together, so it wants many
_CELLS_AT_ONCE = 1 << 16  # scores of so many cells stay in a near cache


def score_cells(
    database: SignatureDatabase,
    queries: Sequence[Signature],
    method: Method = FUSION,
    *,
    memo: DistanceMemo | None = None,
) -> Iterator[NDArray[np.float32]]:
    """Give the distance of each query to every cell, one query after the other.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    queries : sequence of Signature
        What to search for. An empty query is compared like any other.
    method : Method
        How the cells are ranked.
    memo : DistanceMemo, optional
        Distances of these very queries to this database that other methods have needed; what is
        measured is added, a number for each query and distinct sequence.

    Yields
    ------
    ndarray of float32, shape (n,)
        Distances of one query to the cells, in the order of the database; lower is better.
        Equal scores are exactly equal: all are multiples of 2 ** -16. Memory stays bounded
        whatever the number of queries.

    Raises
    ------
    InputError
        If a query has no part that the method compares.

    Examples
    --------
    >>> from semsig_gis import Method
    >>> queries = [demo_database.signature(cell) for cell in (0, 10)]
    >>> for scores in score_cells(demo_database, queries, Method.parse("edit+jaccard:5%")):
    ...     print(len(scores) == len(demo_database), scores.min())
    True 0.0
    True 0.0
    """
    # Checked here, not when the first score is asked for. A run compares the same parts.
    runs = [(part, list(run)) for part, run in itertools.groupby(queries, key=method.used)]
    return itertools.chain.from_iterable(
        _score_run(database, run, method, part, memo) for part, run in runs
    )


def score_parts(
    database: SignatureDatabase | PartitionedDatabase, query: Signature, method: Method
) -> Iterator[tuple[SignatureDatabase, NDArray[np.float32]]]:
    """Score a query part by part, as if the parts were one database."""
    if not isinstance(database, PartitionedDatabase):
        yield database, next(iter(score_cells(database, [query], method)))
        return
    two_stage = method.keep is not None and method.used(query) == BOTH
    gate = _gate_of_parts(database, query, method) if two_stage else None
    for part in database.parts():
        if gate is None:
            yield part, next(iter(score_cells(part, [query], method)))
        else:
            by_types, second_stage = _stages(part, query, method)
            tables = part.type_sequences, part.angle_sequences
            yield part, _two_stage(method, by_types, *tables, second_stage, gate=gate)


def _score_run(
    database: SignatureDatabase,
    queries: Sequence[Signature],
    method: Method,
    used: str,
    memo: DistanceMemo | None,
) -> Iterator[NDArray[np.float32]]:
    """Score queries that use the same parts, batch by batch."""
    distinct = sum(len(_table(database, part)) for part in used.split("+"))
    size = min(_BATCH_QUERIES, max(1, _BATCH_BYTES // (4 * max(1, distinct))))
    for low in range(0, len(queries), size):
        batch = queries[low : low + size]
        codes = [query.codes for query in batch if query.codes is not None]
        levels = [query.levels(database.spec.levels) for query in batch if used != TYPES]
        if used == BOTH:
            yield from _score_both(database, codes, levels, method, memo)
        else:
            table = _table(database, used)
            parts = codes if used == TYPES else levels
            for row in _distances(method, used, parts, table, memo=memo):
                yield _spread(_on_steps(row), table)


def _score_both(
    database: SignatureDatabase,
    codes: Sequence[NDArray[np.uint8]],
    levels: Sequence[NDArray[np.uint8]],
    method: Method,
    memo: DistanceMemo | None,
) -> Iterator[NDArray[np.float32]]:
    """Score a batch of queries by types and angles, in one stage or two."""
    types, angles = database.type_sequences, database.angle_sequences
    by_types = _distances(method, TYPES, codes, types, memo=memo)
    # The kernel for weights of 1 measures all sequences sooner than others measure some.
    slow = method.angles != "edit" or method.weights != EditWeights()
    if method.keep is not None and slow and len(codes) < _MANY_QUERIES:
        for first, one in zip(by_types, levels, strict=True):
            yield _two_stage(method, first, types, angles, partial(_some, method, one, angles))
        return
    by_angles = _distances(method, ANGLES, levels, angles, memo=memo)
    for place, (first, second) in enumerate(zip(by_types, by_angles, strict=True)):
        if len(codes) >= _MANY_QUERIES:
            query = codes[place].tobytes(), levels[place].tobytes()
            kept = DistanceMemo() if memo is None else memo
            yield _joined(method, first, types, second, angles, query=query, memo=kept)
        elif method.keep is None:
            yield _fused(method, first, types.inverse, second, angles.inverse)
        else:
            yield _two_stage(method, first, types, angles, second.__getitem__)


def _table(database: SignatureDatabase, part: str) -> SequenceTable:
    """Return the distinct sequences of one part; the other part's are not looked for."""
    return database.type_sequences if part == TYPES else database.angle_sequences


def _joined(
    method: Method,
    by_types: NDArray[np.float32],
    types: SequenceTable,
    by_angles: NDArray[np.float32],
    angles: SequenceTable,
    *,
    query: tuple[bytes, bytes],
    memo: DistanceMemo,
) -> NDArray[np.float32]:
    """Return what `_fused` or `_two_stage` gives, compiled: it pays for many queries."""
    from semsig_gis.localization.distance import kernels  # noqa: PLC0415 - loads a compiler

    def known(what: Hashable, work_out: Callable[[], NDArray[Any]]) -> NDArray[Any]:
        kind = method.types, method.angles, method.normalized, method.weights
        return memo.get((what, *kind, *query), work_out)

    def fuse() -> NDArray[np.float32]:
        left, right = _shares(method, by_types, by_angles)
        scores = np.empty(len(types.inverse), np.float32)
        kernels.fuse(left, types.inverse, right, angles.inverse, _SCORE_STEP, scores)
        return scores

    if method.keep is None:
        return fuse()

    def count() -> NDArray[np.int64]:
        cells = np.zeros(round(1 / _SCORE_STEP) + 1, np.int64)
        kernels.count_steps(_on_steps(by_types), types.counts, _SCORE_STEP, cells)
        return cells.cumsum()

    # The percentage that is kept changes none of these.
    fused = known(("fused", method.alpha), fuse)
    first = known("first", lambda: _spread(_on_steps(by_types), types))
    if method.normalized:
        cut = _cut_at(method, known("cells up to each step", count))
    else:
        cut = _cut(method, _on_steps(by_types), types)
    worst = fused.compress(first <= cut).max()
    scores = np.empty(len(first), np.float32)
    kernels.put_behind(first, cut, fused, worst, _next(worst), scores)
    return scores


def _two_stage(
    method: Method,
    by_types: NDArray[np.float32],
    types: SequenceTable,
    angles: SequenceTable,
    second_stage: _SecondStage,
    *,
    gate: _Gate | None = None,
) -> NDArray[np.float32]:
    """Re-rank the cells that are best by type; the others follow in their order.

    `second_stage` gives the distances to the distinct angle sequences that it is asked for. The
    gate is that of all cells, if these are only a part of them.
    """
    first = _on_steps(by_types)
    cut = _cut(method, first, types) if gate is None else gate.cut
    kept = np.flatnonzero(_spread(first <= cut, types))
    second = second_stage(angles.inverse[kept])
    fused = _fused(method, by_types, types.inverse[kept], second, np.arange(len(kept)))
    worst = fused.max() if gate is None else gate.worst
    # What is not kept follows in the order of the first stage.
    scores = _spread(np.maximum(worst + (first - cut), _next(worst)), types)
    scores[kept] = fused
    return scores


def _next(worst: np.float32) -> np.float32:
    """Return what is behind every kept cell even where the gap is lost in rounding."""
    return np.float32(np.nextafter(worst, np.float32(np.inf)))


@dataclass(frozen=True, slots=True)
class _Gate:
    """What the second stage needs to know of all cells: who passes, and how the last one ranks."""

    cut: np.float32
    worst: np.float32


def _kept(method: Method, cells: int) -> int:
    """Return how many of so many cells the types pass on, without those that tie with the last."""
    # Exact: 7 % of 100 cells are 7, though 100 * 0.07 is a little more.
    return math.ceil(Fraction(str(method.keep)) * cells / 100)


def _cut(method: Method, first: NDArray[np.float32], types: SequenceTable) -> np.float32:
    """Return the worst score of the first stage that passes, given that of each sequence."""
    if not method.normalized:  # raw distances may be negative, or large
        count = _kept(method, len(types.inverse))
        each = _spread(first, types)
        return np.float32(np.partition(each, count - 1)[count - 1])
    steps = np.rint(first / _SCORE_STEP).astype(np.int64)
    return _cut_at(method, np.bincount(steps, weights=types.counts).cumsum())


def _cut_at(method: Method, cells: NDArray[Any]) -> np.float32:
    """Return the worst score that passes, given how many cells are up to each whole step."""
    count = _kept(method, int(cells[-1]))
    return np.float32(np.searchsorted(cells, count) * _SCORE_STEP)


def _gate_of_parts(database: PartitionedDatabase, query: Signature, method: Method) -> _Gate:
    """Find the gate of all parts: of each score of the first stage, how many and the worst."""
    count = _kept(method, len(database))
    # By distance in the first stage: how many cells, and the worst of them after the second.
    levels: NDArray[np.float32] = np.zeros(0, np.float32)
    sizes: NDArray[np.float64] = np.zeros(0)
    worst: NDArray[np.float32] = np.zeros(0, np.float32)
    cut = np.float32(np.inf)
    for part in database.parts():
        by_types, second_stage = _stages(part, query, method)
        types = part.type_sequences
        first = _spread(_on_steps(by_types), types)
        # The cut only falls, so that no cell beyond it has to be measured by angles.
        near = np.flatnonzero(first <= cut)
        second = second_stage(part.angle_sequences.inverse[near])
        fused = _fused(method, by_types, types.inverse[near], second, np.arange(len(near)))
        known = np.append(worst, fused)
        each = np.append(sizes, np.ones(len(near)))
        levels, rows = np.unique(np.append(levels, first[near]), return_inverse=True)
        sizes = np.bincount(rows, each).astype(np.float64, copy=False)
        worst = np.full(len(levels), -np.inf, np.float32)
        np.maximum.at(worst, rows, known)
        enough = np.flatnonzero(sizes.cumsum() >= count)
        if len(enough):
            passed = slice(enough[0] + 1)
            levels, sizes, worst = levels[passed], sizes[passed], worst[passed]
            cut = levels[-1]
    return _Gate(cut, worst.max())


def _stages(
    database: SignatureDatabase, query: Signature, method: Method
) -> tuple[NDArray[np.float32], _SecondStage]:
    """Measure a query by types, and return how to measure it by angles."""
    types, angles = database.type_sequences, database.angle_sequences
    codes = [] if query.codes is None else [query.codes]
    by_types = _distances(method, TYPES, codes, types)[0]
    levels = query.levels(database.spec.levels)
    return by_types, partial(_some, method, levels, angles)


def _some(
    method: Method,
    query_levels: NDArray[np.uint8],
    angles: SequenceTable,
    rows: NDArray[np.int64],
) -> NDArray[np.float32]:
    """Measure only the distinct angle sequences of some rows, each once."""
    only, place = np.unique(rows, return_inverse=True)
    distances = _distances(method, ANGLES, [query_levels], angles, only=only)[0]
    return np.asarray(distances[place])


def _distances(
    method: Method,
    part: str,
    sequences: Sequence[NDArray[np.uint8]],
    table: SequenceTable,
    *,
    only: NDArray[np.int64] | None = None,
    memo: DistanceMemo | None = None,
) -> NDArray[np.float32]:
    """Measure one part of some queries against distinct sequences, as the method says."""
    name = method.measures[part]
    wild = part == TYPES and any((sequence == WILDCARD).any() for sequence in sequences)
    measure = metric(name, weights=method.weights, wildcard=WILDCARD if wild else None)
    find = partial(measure, sequences, table, normalized=method.normalized, only=only)
    if memo is None:
        return find()
    queries = tuple(sequence.tobytes() for sequence in sequences)
    return memo.get((part, name, method.normalized, method.weights, queries), find)


def _fused(
    method: Method,
    by_types: NDArray[np.float32],
    types: NDArray[np.int64],
    by_angles: NDArray[np.float32],
    angles: NDArray[np.int64],
) -> NDArray[np.float32]:
    """Return the weighted sums of two distances of cells, given which distances each cell has."""
    left, right = _shares(method, by_types, by_angles)
    scores = np.empty(len(types), np.float32)
    total, other = np.empty(_CELLS_AT_ONCE), np.empty(_CELLS_AT_ONCE, right.dtype)
    for low in range(0, len(types), _CELLS_AT_ONCE):
        high = min(low + _CELLS_AT_ONCE, len(types))
        some, more = total[: high - low], other[: high - low]
        left.take(types[low:high], out=some, mode="wrap")
        some += right.take(angles[low:high], out=more, mode="wrap")
        np.rint(some, out=some)
        np.multiply(some, _SCORE_STEP, out=scores[low:high], casting="same_kind")
    return scores


def _shares(
    method: Method, by_types: NDArray[np.float32], by_angles: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Return what each of two distances adds to a fusion, in steps."""
    # In steps from the start: a factor that is a power of two changes no digit.
    left = method.alpha / _SCORE_STEP * by_types.astype(np.float64)
    return left, (1 - method.alpha) / _SCORE_STEP * by_angles


def _spread(values: NDArray[_Value], table: SequenceTable) -> NDArray[_Value]:
    """Give every cell the value of its sequence."""
    # The indices are in range, and "wrap" is the quickest mode.
    return values.take(table.inverse, mode="wrap")


def _on_steps(scores: NDArray[np.floating]) -> NDArray[np.float32]:
    """Round to whole steps, so that equal scores come out equal however they were added up."""
    steps = np.rint(scores / _SCORE_STEP)
    return np.asarray(steps * _SCORE_STEP, dtype=np.float32)
