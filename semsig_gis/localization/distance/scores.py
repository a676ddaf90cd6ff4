"""Score all cells for queries, by distance."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from semsig_gis.core import WILDCARD
from semsig_gis.database import PartitionedDatabase
from semsig_gis.localization.distance.memo import DistanceMemo
from semsig_gis.localization.distance.method import ANGLES, BOTH, FUSION, TYPES
from semsig_gis.localization.distance.metrics import metric
from semsig_gis.localization.distance.metrics.edit import EditWeights

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterator, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import SequenceTable, SignatureDatabase
    from semsig_gis.localization.distance.method import Method

    _SecondStage = Callable[[NDArray[np.int64]], NDArray[np.float32]]

_Value = TypeVar("_Value", bound=np.generic)

# Scores are rounded to this step, or rounding errors would break ties. Differences between scores
# are far larger than the step, and float32 represents its multiples exactly up to 256.
_SCORE_STEP = 2.0**-16
_BATCH_BYTES = 32 << 20  # memory for distances to distinct sequences
# With fewer queries, angle distances are faster for the cells of stage two than for all sequences.
_MANY_QUERIES = 8
_BATCH_QUERIES = 128  # RapidFuzz compares queries of similar length together: larger is faster
_CHUNK_CELLS = 1 << 16  # their scores fit the second-level cache


def score_cells(
    database: SignatureDatabase,
    queries: Sequence[Signature],
    method: Method = FUSION,
    *,
    memo: DistanceMemo | None = None,
) -> Iterator[NDArray[np.float32]]:
    """Yield the distances of each query to all cells, one query after the other.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    queries : sequence of Signature
        The queries; they may be empty.
    method : Method
        How the cells are ranked.
    memo : DistanceMemo, optional
        Distances of the same queries to this database, computed for other methods. New distances
        are added, one number for each query and distinct sequence.

    Yields
    ------
    ndarray of float32, shape (n,)
        Distances of one query to the cells, in the order of the database; lower is better.
        All are multiples of 2 ** -16, so that ties are exact. Memory does not grow with the number
        of queries.

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
    # Errors are raised here, not at the first score. Queries of a run compare the same parts.
    runs = [(part, list(run)) for part, run in itertools.groupby(queries, key=method.used)]
    return itertools.chain.from_iterable(
        _score_run(database, run, method, part, memo) for part, run in runs
    )


def score_parts(
    database: SignatureDatabase | PartitionedDatabase, query: Signature, method: Method
) -> Iterator[tuple[SignatureDatabase, NDArray[np.float32]]]:
    """Yield the parts of a database with the scores that they have in the whole database."""
    if not isinstance(database, PartitionedDatabase):
        yield database, next(iter(score_cells(database, [query], method)))
        return
    two_stage = method.keep is not None and method.used(query) == BOTH
    # Which cells pass stage one depends on the cells of all parts.
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
    """Yield the scores of queries that use the same parts, computed in batches."""
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
    """Yield the scores of a batch of queries by types and angles, in one stage or two."""
    types, angles = database.type_sequences, database.angle_sequences
    by_types = _distances(method, TYPES, codes, types, memo=memo)
    # The unit-weight edit kernel is faster on all sequences than other metrics on some.
    slow = method.angles != "edit" or method.weights != EditWeights()
    if method.keep is not None and slow and len(codes) < _MANY_QUERIES:
        for first, query_levels in zip(by_types, levels, strict=True):
            second_stage = partial(_angle_distances, method, query_levels, angles)
            yield _two_stage(method, first, types, angles, second_stage)
        return
    by_angles = _distances(method, ANGLES, levels, angles, memo=memo)
    for row, (first, second) in enumerate(zip(by_types, by_angles, strict=True)):
        if len(codes) >= _MANY_QUERIES:
            query = codes[row].tobytes(), levels[row].tobytes()
            query_memo = DistanceMemo() if memo is None else memo
            yield _score_compiled(
                method, first, types, second, angles, query=query, memo=query_memo
            )
        elif method.keep is None:
            yield _fused(method, first, types.inverse, second, angles.inverse)
        else:
            yield _two_stage(method, first, types, angles, second.__getitem__)


def _table(database: SignatureDatabase, part: str) -> SequenceTable:
    """Return the distinct sequences of one part; the others may not be computed yet."""
    return database.type_sequences if part == TYPES else database.angle_sequences


def _score_compiled(
    method: Method,
    by_types: NDArray[np.float32],
    types: SequenceTable,
    by_angles: NDArray[np.float32],
    angles: SequenceTable,
    *,
    query: tuple[bytes, bytes],
    memo: DistanceMemo,
) -> NDArray[np.float32]:
    """Return the result of `_fused` or `_two_stage` from compiled kernels, for many queries."""
    from semsig_gis.localization.distance import kernels  # noqa: PLC0415 - numba takes 0.25 s

    def cached(name: Hashable, compute: Callable[[], NDArray[Any]]) -> NDArray[Any]:
        metrics = method.types, method.angles, method.normalized, method.weights
        return memo.get((name, *metrics, *query), compute)

    def fuse() -> NDArray[np.float32]:
        type_steps, angle_steps = _shares(method, by_types, by_angles)
        scores = np.empty(len(types.inverse), np.float32)
        kernels.fuse(type_steps, types.inverse, angle_steps, angles.inverse, _SCORE_STEP, scores)
        return scores

    if method.keep is None:
        return fuse()

    def count() -> NDArray[np.int64]:
        cells = np.zeros(round(1 / _SCORE_STEP) + 1, np.int64)
        kernels.count_steps(_on_steps(by_types), types.counts, _SCORE_STEP, cells)
        return cells.cumsum()

    # These are the same for every percentage `keep`.
    fused = cached(("fused", method.alpha), fuse)
    first = cached("first", lambda: _spread(_on_steps(by_types), types))
    if method.normalized:
        cut = _cut_at(method, cached("cells up to each step", count))
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
    """Return the scores of two-stage fusion.

    `second_stage` returns the angle distances of rows of distinct angle sequences. A `gate` is
    given if the cells are one part of a database.
    """
    first = _on_steps(by_types)
    cut = _cut(method, first, types) if gate is None else gate.cut
    passing = np.flatnonzero(_spread(first <= cut, types))
    second = second_stage(angles.inverse[passing])
    fused = _fused(method, by_types, types.inverse[passing], second, np.arange(len(passing)))
    worst = fused.max() if gate is None else gate.worst
    # Other cells follow in the order of the first stage.
    scores = _spread(np.maximum(worst + (first - cut), _next(worst)), types)
    scores[passing] = fused
    return scores


def _next(worst: np.float32) -> np.float32:
    """Return the next larger score, behind `worst` even if the difference is rounded to 0."""
    return np.float32(np.nextafter(worst, np.float32(np.inf)))


@dataclass(frozen=True, slots=True)
class _Gate:
    """The worst score of stage one that passes, and the worst fused score, of all cells."""

    cut: np.float32
    worst: np.float32


def _passing_count(method: Method, cells: int) -> int:
    """Return the number of cells that pass stage one, ties not counted."""
    # Exact fractions: 7 % of 100 cells are 7, although 100 * 0.07 is slightly more.
    return math.ceil(Fraction(str(method.keep)) * cells / 100)


def _cut(method: Method, first: NDArray[np.float32], types: SequenceTable) -> np.float32:
    """Return the worst score of stage one that passes, from the scores of the sequences."""
    if not method.normalized:  # raw distances can be negative or large: no bins
        count = _passing_count(method, len(types.inverse))
        each = _spread(first, types)
        return np.float32(np.partition(each, count - 1)[count - 1])
    steps = np.rint(first / _SCORE_STEP).astype(np.int64)
    return _cut_at(method, np.bincount(steps, weights=types.counts).cumsum())


def _cut_at(method: Method, cells: NDArray[Any]) -> np.float32:
    """Return the worst score that passes, from the cumulative number of cells by step."""
    count = _passing_count(method, int(cells[-1]))
    return np.float32(np.searchsorted(cells, count) * _SCORE_STEP)


def _gate_of_parts(database: PartitionedDatabase, query: Signature, method: Method) -> _Gate:
    """Return the gate of all parts, which are read one after the other."""
    count = _passing_count(method, len(database))
    # For each score of stage one: the number of cells, and their worst fused score.
    levels: NDArray[np.float32] = np.zeros(0, np.float32)
    sizes: NDArray[np.float64] = np.zeros(0)
    worst: NDArray[np.float32] = np.zeros(0, np.float32)
    cut = np.float32(np.inf)
    for part in database.parts():
        by_types, second_stage = _stages(part, query, method)
        types = part.type_sequences
        first = _spread(_on_steps(by_types), types)
        # The cut can only get lower, so cells beyond it need no angle distances.
        near = np.flatnonzero(first <= cut)
        second = second_stage(part.angle_sequences.inverse[near])
        fused = _fused(method, by_types, types.inverse[near], second, np.arange(len(near)))
        # Merge the levels of this part with those of the parts before.
        all_fused = np.append(worst, fused)
        counts = np.append(sizes, np.ones(len(near)))
        levels, rows = np.unique(np.append(levels, first[near]), return_inverse=True)
        sizes = np.bincount(rows, counts).astype(np.float64, copy=False)
        worst = np.full(len(levels), -np.inf, np.float32)
        np.maximum.at(worst, rows, all_fused)
        # Levels behind the cut are not needed.
        enough = np.flatnonzero(sizes.cumsum() >= count)
        if len(enough):
            passed = slice(enough[0] + 1)
            levels, sizes, worst = levels[passed], sizes[passed], worst[passed]
            cut = levels[-1]
    return _Gate(cut, worst.max())


def _stages(
    database: SignatureDatabase, query: Signature, method: Method
) -> tuple[NDArray[np.float32], _SecondStage]:
    """Return the type distances of a query, and a function for its angle distances."""
    types, angles = database.type_sequences, database.angle_sequences
    codes = [] if query.codes is None else [query.codes]
    by_types = _distances(method, TYPES, codes, types)[0]
    levels = query.levels(database.spec.levels)
    return by_types, partial(_angle_distances, method, levels, angles)


def _angle_distances(
    method: Method,
    query_levels: NDArray[np.uint8],
    angles: SequenceTable,
    rows: NDArray[np.int64],
) -> NDArray[np.float32]:
    """Return the angle distances of some rows of sequences, each computed once."""
    only, inverse = np.unique(rows, return_inverse=True)
    distances = _distances(method, ANGLES, [query_levels], angles, only=only)[0]
    return np.asarray(distances[inverse])


def _distances(
    method: Method,
    part: str,
    sequences: Sequence[NDArray[np.uint8]],
    table: SequenceTable,
    *,
    only: NDArray[np.int64] | None = None,
    memo: DistanceMemo | None = None,
) -> NDArray[np.float32]:
    """Return the distances of one part of queries to distinct sequences, by the metric of it."""
    name = method.measures[part]
    wild = part == TYPES and any((sequence == WILDCARD).any() for sequence in sequences)
    measure = metric(name, weights=method.weights, wildcard=WILDCARD if wild else None)
    compute = partial(measure, sequences, table, normalized=method.normalized, only=only)
    if memo is None:
        return compute()
    queries = tuple(sequence.tobytes() for sequence in sequences)
    return memo.get((part, name, method.normalized, method.weights, queries), compute)


def _fused(
    method: Method,
    by_types: NDArray[np.float32],
    types: NDArray[np.int64],
    by_angles: NDArray[np.float32],
    angles: NDArray[np.int64],
) -> NDArray[np.float32]:
    """Return the fused distances of cells; `types` and `angles` are rows of the distances."""
    type_steps, angle_steps = _shares(method, by_types, by_angles)
    scores = np.empty(len(types), np.float32)
    total, other = np.empty(_CHUNK_CELLS), np.empty(_CHUNK_CELLS, angle_steps.dtype)
    for low in range(0, len(types), _CHUNK_CELLS):
        high = min(low + _CHUNK_CELLS, len(types))
        chunk, angle_chunk = total[: high - low], other[: high - low]
        type_steps.take(types[low:high], out=chunk, mode="wrap")
        chunk += angle_steps.take(angles[low:high], out=angle_chunk, mode="wrap")
        np.rint(chunk, out=chunk)
        np.multiply(chunk, _SCORE_STEP, out=scores[low:high], casting="same_kind")
    return scores


def _shares(
    method: Method, by_types: NDArray[np.float32], by_angles: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Return the weighted distances of types and of angles, in steps."""
    # Division by a step that is a power of two is exact.
    type_steps = method.alpha / _SCORE_STEP * by_types.astype(np.float64)
    return type_steps, (1 - method.alpha) / _SCORE_STEP * by_angles


def _spread(values: NDArray[_Value], table: SequenceTable) -> NDArray[_Value]:
    """Return the value of its sequence for every cell."""
    # The indices are in range; "wrap" is the fastest mode.
    return values.take(table.inverse, mode="wrap")


def _on_steps(scores: NDArray[np.floating]) -> NDArray[np.float32]:
    """Round scores to whole steps, so that ties are exact."""
    steps = np.rint(scores / _SCORE_STEP)
    return np.asarray(steps * _SCORE_STEP, dtype=np.float32)
