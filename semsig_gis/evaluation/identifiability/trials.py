"""Trials: queries drawn from a noise model at known cells, and what localization makes of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from itertools import repeat
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import each_in_order
from semsig_gis.evaluation.identifiability.lookalikes import city_extent
from semsig_gis.evaluation.identifiability.symbol_tables import symbol_columns
from semsig_gis.evaluation.queries.distortion_text import ready_chain
from semsig_gis.evaluation.queries.distortions import Detector
from semsig_gis.evaluation.queries.true_view import CitySights, Sight
from semsig_gis.localization import CellScores, build_index, posterior, rerank
from semsig_gis.observation import FULL_VIEW, View

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation.identifiability.symbol_tables import SymbolColumns
    from semsig_gis.localization import LikelihoodIndex, Noise, NoiseSpec
    from semsig_gis.observation import Photo


LEANS = 300  # trials, by which likelihoods of signatures are brought near the answers
# Cells that are re-ranked in a trial, whose answer counts among thousands, and of the others.
RERANKED, SAMPLE = 300, 512
HOPELESS = 20.0  # nats below the likeliest cell, at which a cell is left out of the sums


@dataclass(frozen=True, eq=False, kw_only=True)
class Trials:
    """What came of simulated queries, arrays of one item a query.

    The answer to a query from a cell (a row number of `cells`), in one of the `looks`, gave the
    chance `itself` to that cell and `near` to all cells near it; `found` tells whether the best
    place is near, `bits` the entropy of all chances. `lean` is the mean, by these chances, of the
    log-likelihood of what the look shows in a cell less that in the true one: for the first `LEANS`
    whose look shows something, if columns were given and something was detected, else NaN.
    """

    cells: NDArray[np.int64]
    looks: NDArray[np.int64]
    itself: NDArray[np.float64]
    near: NDArray[np.float64]
    found: NDArray[np.bool_]
    bits: NDArray[np.float64]
    lean: NDArray[np.float64]


MOST_TRIALS = 1_000_000
TRIAL_S = 1.5e-2  # about what one takes


def trial_cells(cells: int, count: int, *, seed: int = 0) -> NDArray[np.int64]:
    """Return row numbers of the cells of `count` trials: all equally often, the rest drawn.

    A larger count keeps the first ones.
    """
    rng = np.random.default_rng([seed, 0])
    rounds = [rng.permutation(cells) for _ in range(-(-count // cells))]
    return np.concatenate([np.zeros(0, np.int64), *rounds])[:count]


def draw_trials(
    index: LikelihoodIndex,
    cells: NDArray[np.int64],
    *,
    photos: Iterable[Photo] | None = None,
    seed: int = 0,
) -> Iterator[Signature]:
    """Yield what a detector tells of cells, if it fails as the noise model of the index says.

    `cells` are row numbers, `photos` what is looked at from each, a full turn by default. Query
    number i is the same whatever the number of queries.
    """
    detector = Detector(noise=index.noise)
    spoil = ready_chain((detector,), CitySights.of(index.database))
    looks = repeat(FULL_VIEW) if photos is None else photos
    for number, (cell, photo) in enumerate(zip(cells.tolist(), looks, strict=False)):
        query = spoil(Sight.of_cell(index.database, cell), seed, number).signature
        if photo.sectors and query.bearings is not None:
            query = View.of(query.select(photo.sees(query.bearings)), photos=(photo,))
        yield query


def try_cells(
    index: LikelihoodIndex,
    cells: NDArray[np.int64],
    *,
    queries: Iterable[Signature] | None = None,
    columns: SymbolColumns | None = None,
    looks: NDArray[np.int64] | None = None,
    left_out: tuple[int, NDArray[np.int64]] | None = None,
    radius: float = 50.0,
    seed: int = 0,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Trials:
    """Ask one query from each of some cells, given by row number; by default simulated ones.

    The noise model of the index is that of the detector and of the answer alike; `radius` is what
    counts as near, in metres. A query without objects is not answered: its chances are 0. `columns`
    are what `Trials.lean` is worked out by; `looks` are the numbers of the looks of simulated
    queries, the first by default.
    """
    numbers = np.zeros(len(cells), np.int64) if looks is None else looks
    if queries is None:
        photos = None if columns is None else [columns.looks[look] for look in numbers.tolist()]
        queries = draw_trials(index, cells, photos=photos, seed=seed)
    places = _without_signatures(index.database, slice(None))
    radius = min(radius, city_extent(places))
    leaning = np.zeros(len(cells), np.bool_)
    if columns is not None and left_out is None:
        leaning[np.flatnonzero(columns.counts[numbers, :, cells].any(axis=1))[:LEANS]] = True

    def ask(item: tuple[int, Signature]) -> tuple[float, ...]:
        trial, query = item
        cell, look = int(cells[trial]), int(numbers[trial])
        if not len(query):
            return 0.0, 0.0, 0.0, float(np.log2(len(places))), np.nan
        if columns is None:
            scores = index.scores(query)
        elif left_out is None:
            scores = CellScores(loglik=columns.scores(query, look))
        else:
            number, rows = left_out
            scores = CellScores(loglik=columns.scores(query, look, left_out=number)[rows])
        own = partial(columns.loglik, cell, look) if columns and leaning[trial] else None
        return _outcome(index, places, cell, query, radius, scores, own)

    rows: list[tuple[float, ...]] = []
    for row in each_in_order(ask, zip(range(len(cells)), queries, strict=False), threads=threads):
        rows.append(row)
        if progress is not None:
            progress(len(rows), len(cells))
    itself, near, found, bits, lean = np.array(rows, dtype=np.float64).reshape(-1, 5).T
    return Trials(
        cells=np.asarray(cells),
        looks=numbers,
        itself=itself,
        near=near,
        found=found.astype(np.bool_),
        bits=bits,
        lean=lean,
    )


def _without_signatures(
    database: SignatureDatabase, cells: slice | NDArray[np.int64]
) -> SignatureDatabase:
    """Return some cells alone, without what they see: far faster than to select them."""
    columns, nothing = database.columns[cells], slice(0)
    return replace(
        database,
        columns=columns,
        rows=database.rows[cells],
        offsets=np.zeros(len(columns) + 1, database.offsets.dtype),
        codes=database.codes[nothing],
        bearing_units=database.bearing_units[nothing],
        distance_units=database.distance_units[nothing],
    )


def _outcome(  # noqa: PLR0917 - a private helper of one caller
    index: LikelihoodIndex,
    places: SignatureDatabase,
    cell: int,
    query: Signature,
    radius: float,
    scores: CellScores,
    own: Callable[[NDArray[np.int64]], NDArray[np.float64]] | None = None,
) -> tuple[float, ...]:
    """Return what comes of one query, in the order of `Trials`."""
    loglik = rerank(index, query, scores, count=RERANKED, aside=False, sample=SAMPLE).loglik
    kept = loglik > loglik.max() - HOPELESS
    kept[cell] = True
    cells = np.flatnonzero(kept)
    answer = posterior(_without_signatures(places, cells), loglik[cells])
    true = int(np.searchsorted(cells, cell))
    best, _ = answer.best_place(radius)
    near = float(answer.mass_within(radius, np.array([true]))[0])
    apart = places.grid.step * math.hypot(
        int(places.columns[cells[best]]) - int(places.columns[cell]),
        int(places.rows[cells[best]]) - int(places.rows[cell]),
    )
    alike = None if own is None else own(cells)
    return (
        min(float(answer.chances[true]), near),
        near,
        float(apart <= radius + 1e-6),
        answer.entropy,
        np.nan if alike is None else float((answer.chances * alike).sum() - alike[true]),
    )


def leave_class_out(
    database: SignatureDatabase, code: int
) -> tuple[SignatureDatabase, NDArray[np.int64]]:
    """Return a database without the objects of a class.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    code : int
        Code of the class.

    Returns
    -------
    database : SignatureDatabase
        The cells that see other objects, too, and these objects; perhaps none.
    rows : ndarray of int64, shape (n,)
        For each cell of the given database, its row in the new one; -1 where it is not there.

    Examples
    --------
    >>> without, rows = leave_class_out(demo_database, 3)
    >>> bool((without.codes == 3).any()), len(without) == int((rows >= 0).sum())
    (False, True)
    """
    kept = database.codes != code
    lengths = np.add.reduceat(kept, database.offsets[:-1], dtype=np.int64)
    some = lengths > 0
    rows = np.where(some, np.cumsum(some) - 1, -1)
    left = replace(
        database,
        columns=database.columns[some],
        rows=database.rows[some],
        offsets=np.concatenate([[0], np.cumsum(lengths[some])]),
        codes=database.codes[kept],
        bearing_units=database.bearing_units[kept],
        distance_units=database.distance_units[kept],
    )
    return left, rows


def try_without_classes(
    index: LikelihoodIndex,
    cells: NDArray[np.int64],
    *,
    columns: SymbolColumns | None = None,
    looks: NDArray[np.int64] | None = None,
    radius: float = 50.0,
    seed: int = 0,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Ask simulated queries once more for each class, as if it had not been published.

    The queries are those of `try_cells`, without detections of the class; the results (m, k) are
    `Trials.near` and `Trials.bits` by class of ``index.table.codes``, NaN where neither the cell
    sees the class nor the query tells of it. A cell that sees nothing else cannot be found: no
    chance, and all bits are left.
    """
    codes = index.table.codes.tolist()
    columns = symbol_columns(index, threads=threads) if columns is None else columns
    numbers = np.zeros(len(cells), np.int64) if looks is None else looks
    photos = [columns.looks[look] for look in numbers.tolist()]
    queries = list(draw_trials(index, cells, photos=photos, seed=seed))
    near = np.zeros((len(cells), len(codes)))
    bits = np.full((len(cells), len(codes)), np.log2(len(index.database)))
    names = {item.code: item.name for item in index.database.taxonomy.classes}
    for number, code in enumerate(codes):
        without, rows = leave_class_out(index.database, code)
        sees = np.add.reduceat(index.database.codes == code, index.database.offsets[:-1])[cells]
        told = [bool((query.codes == code).any()) for query in queries]
        touched = np.array(told, np.bool_) | (sees > 0)
        near[~touched, number] = bits[~touched, number] = np.nan
        left = np.flatnonzero(touched & (rows[cells] >= 0))
        if len(left):
            noise = _without_class(index.noise, names[code], len(codes))
            trials = try_cells(
                build_index(without, noise),
                rows[cells[left]],
                queries=[_without_code(queries[one], code) for one in left.tolist()],
                columns=columns,
                looks=numbers[left],
                left_out=(number, np.flatnonzero(rows >= 0)),
                radius=radius,
                threads=threads,
            )
            near[left, number], bits[left, number] = trials.near, trials.bits
        if progress is not None:
            progress((number + 1) * len(cells), len(codes) * len(cells))
    return near, bits


def _without_code(query: Signature, code: int) -> Signature:
    """Return the detections of a query that do not bear the name of a class."""
    return query if query.codes is None else query.select(query.codes != code)


def _without_class(noise: Noise, name: str, classes: int) -> Noise:
    """Return a noise model of so many classes for all of them but one."""

    def without(spec: NoiseSpec) -> NoiseSpec:
        confusion = {own: row for own, row in spec.confusion.items() if own != name}
        # Equal shares of the false objects are taken of the classes that are left.
        clutter = spec.clutter if spec.clutter_shares else spec.clutter * (1.0 - 1.0 / classes)
        return replace(spec, confusion=confusion, clutter=clutter)

    return noise.changed(without)
