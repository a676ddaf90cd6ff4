"""Trials: simulated queries from known cells with a noise model, and their outcomes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from itertools import repeat
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from semsig_gis.core import each_in_order, log_sum
from semsig_gis.database import visible_objects_in
from semsig_gis.evaluation.identifiability.lookalikes import city_extent
from semsig_gis.evaluation.identifiability.symbol_tables import symbol_columns
from semsig_gis.evaluation.queries.distortion_text import prepare_chain
from semsig_gis.evaluation.queries.distortions import SimulatedDetector
from semsig_gis.evaluation.queries.true_view import CitySights, Sight
from semsig_gis.localization import (
    CellScores,
    PhotoTable,
    build_index,
    photo_loglik,
    posterior,
    promising_cells,
    quick_scorer,
)
from semsig_gis.observation import FULL_VIEW, View

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation.identifiability.symbol_tables import SymbolColumns
    from semsig_gis.localization import LikelihoodIndex, Noise, NoiseSpec
    from semsig_gis.observation import Photo


LEANS = 300  # trials to fit the temperature of the likelihoods of signatures
# Cells that re-ranked ones are chosen from, and re-ranked ones: in the first batch, and all.
CHOSEN, FIRST_CHOSEN = 1024, 256
RERANKED, FIRST_RERANKED = 64, 32
RERANKED_SAMPLE, POOL = 64, 16  # of the other cells; it is drawn from this multiple of its size
WINDOWS = 8  # ranges of the likelihood, each with a shift of its own
MARGIN = 20.0  # nats below the best cell at which an upper bound of a quick sum is enough
LEAST_SHARE = 1e-3  # of the chance; if all others have less, no more cells are re-ranked
# Cells that are summed up one by one; every eighth of the others represents them.
LIKELIEST, THINNED = 4096, 8
# Nats; cells farther below the likeliest cell are omitted, before re-ranking and after.
NEGLIGIBLE, HOPELESS = 30.0, 20.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Trials:
    """Outcomes of simulated queries, one item for each query.

    A query is from a cell (a row number of `cells`) in one of the `looks`. `itself` is the
    probability that its answer gives to that cell, `near` the one of all cells near it; `found` is
    whether the best place is near, `bits` the entropy of all probabilities. `lean` is the mean, by
    these probabilities, of the log-likelihood of the look in a cell minus that in the true cell. It
    is computed for the first `LEANS` queries with visible objects, if columns are given; it is NaN
    for others and for queries without detections.
    """

    cells: NDArray[np.int64]
    looks: NDArray[np.int64]
    itself: NDArray[np.float64]
    near: NDArray[np.float64]
    found: NDArray[np.bool_]
    bits: NDArray[np.float64]
    lean: NDArray[np.float64]


MOST_TRIALS = 1_000_000
TRIAL_S = 1.5e-2  # approximate seconds of a trial


def trial_cells(cells: int, count: int, *, seed: int = 0) -> NDArray[np.int64]:
    """Return row numbers of the cells of `count` trials, every cell almost equally often.

    The first cells do not depend on the count.
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
    """Yield simulated queries from cells, with the noise model of the index.

    `cells` are row numbers; `photos` is the view from each, a full turn by default. Query number i
    is the same whatever the number of queries.
    """
    detector = SimulatedDetector(noise=index.noise)
    distort = prepare_chain((detector,), CitySights.of(index.database))
    looks = repeat(FULL_VIEW) if photos is None else photos
    for number, (cell, photo) in enumerate(zip(cells.tolist(), looks, strict=False)):
        query = distort(Sight.of_cell(index.database, cell), seed, number).signature
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
    omitted_class: tuple[int, NDArray[np.int64]] | None = None,
    radius: float = 50.0,
    seed: int = 0,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Trials:
    """Answer one query from each of some cells, given by row number; by default simulated ones.

    Detector and answer have the same noise model, that of the index; `radius` is the distance that
    counts as near, in metres. A query without objects gets no answer: its probabilities are 0.
    `columns` are required for `Trials.lean`; `looks` are the numbers of the looks of simulated
    queries, by default the first. `omitted_class` is a class row and the rows of the cells that
    `index` has without this class.
    """
    numbers = np.zeros(len(cells), np.int64) if looks is None else looks
    if queries is None:
        photos = None if columns is None else [columns.looks[look] for look in numbers.tolist()]
        queries = draw_trials(index, cells, photos=photos, seed=seed)
    places = _without_signatures(index.database, slice(None))
    radius = min(radius, city_extent(places))
    with_lean = np.zeros(len(cells), np.bool_)
    if columns is not None:
        bases = columns.bases(None if omitted_class is None else omitted_class[0])
        if omitted_class is None:
            seeing = columns.counts[numbers, :, cells].any(axis=1)
            with_lean[np.flatnonzero(seeing)[:LEANS]] = True

    def answer(item: tuple[int, Signature]) -> tuple[float, ...]:
        trial, query = item
        cell, look = int(cells[trial]), int(numbers[trial])
        if not len(query):
            return 0.0, 0.0, 0.0, float(np.log2(len(places))), np.nan
        if columns is None:
            scores = index.scores(query).loglik
        else:
            scores = columns.scores(query, look, bases=bases, margin=NEGLIGIBLE)
            scores = scores if omitted_class is None else scores[omitted_class[1]]
        some = _thinned(cell, scores)
        own = partial(columns.loglik, cell, look) if columns and with_lean[trial] else None
        return _outcome(index, places, cell, query, radius, some, own)

    outcomes: list[tuple[float, ...]] = []
    trials = zip(range(len(cells)), queries, strict=False)
    for outcome in each_in_order(answer, trials, threads=threads):
        outcomes.append(outcome)
        if progress is not None:
            progress(len(outcomes), len(cells))
    itself, near, success, bits, lean = np.array(outcomes, dtype=np.float64).reshape(-1, 5).T
    return Trials(
        cells=np.asarray(cells),
        looks=numbers,
        itself=itself,
        near=near,
        found=success.astype(np.bool_),
        bits=bits,
        lean=lean,
    )


def _without_signatures(
    database: SignatureDatabase, cells: slice | NDArray[np.int64]
) -> SignatureDatabase:
    """Return a database of some cells without their objects; much faster than `select`."""
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


class _SomeCells(NamedTuple):
    """Rows and scores of some cells, and the number of cells that each represents."""

    rows: NDArray[np.int64]
    scores: NDArray[np.float32]
    weights: NDArray[np.float64]


def _thinned(cell: int, scores: NDArray[np.float32]) -> _SomeCells:
    """Return the likeliest cells, a sample of the others, and a cell that must be there.

    Cells that are `NEGLIGIBLE` are left out.
    """
    whole = np.zeros(len(scores), np.bool_)
    whole[promising_cells(scores, min(LIKELIEST, len(scores)))] = True
    selection = whole.copy()
    selection[::THINNED] = True
    least = scores.max() - np.float32(NEGLIGIBLE)
    selection &= scores > least
    if not selection[cell]:
        selection[cell] = whole[cell] = True
    rows = np.flatnonzero(selection)
    weights = np.where(whole[rows], 1.0, THINNED)
    return _SomeCells(rows, np.maximum(scores[rows], least), weights)


def _one_to_one(index: LikelihoodIndex, query: Signature, some: _SomeCells) -> NDArray[np.float64]:
    """Return the log-likelihood of a query in some cells, summed over one-to-one associations.

    It is as in `rerank`, but faster: computed for the likeliest cells and for a sample of the
    others, which are shifted by as much as the cells of the sample with similar scores.
    """
    (photo,) = View.of(query).split()
    scores = some.scores.astype(np.float64)
    quick = quick_scorer(index, photo, CellScores(loglik=scores), north_sigma=0.0)
    table = PhotoTable.of(photo, index.table)

    def exact(cells: NDArray[np.int64]) -> NDArray[np.float64]:
        objects = visible_objects_in(index.database, some.rows[cells])
        turns = np.zeros((len(cells), 1))
        return photo_loglik(table, objects, *index.models, turns=turns)[:, 0]

    # Choose some of the cells with the best first scores by quick sums.
    choice = promising_cells(some.scores, min(CHOSEN, len(scores)))
    choice = choice[np.argsort(-scores[choice], kind="stable")]
    first, later = choice[:FIRST_CHOSEN], choice[FIRST_CHOSEN:]
    sums, _ = quick(some.rows[first], np.full(len(first), -np.inf))
    least = np.full(len(later), sums.max() - MARGIN)
    sums = np.concatenate([sums, quick(some.rows[later], least)[0]])
    order = np.argsort(-sums, kind="stable")
    choice, sums = choice[order], sums[order]
    # The others change by as much as these, unless they matter: then by as much as a sample.
    after = exact(choice[:FIRST_RERANKED])
    before, half = sums[: len(after)], len(after) // 2
    rest = np.ones(len(scores), np.bool_)
    rest[choice] = False
    others = np.flatnonzero(rest)
    moves = np.logaddexp.reduce(after) - np.logaddexp.reduce(before)
    all_moves = moves + np.logaddexp.reduce(sums) - np.logaddexp.reduce(scores[choice])
    loglik = scores + all_moves
    loglik[choice] = sums + moves
    loglik[choice[: len(after)]] = after
    if log_sum(loglik) - log_sum(after[:half]) < LEAST_SHARE:
        return np.asarray(loglik)
    ranked, left = choice[len(after) : RERANKED], choice[RERANKED:]
    samples = _sample(sums[RERANKED:]), _sample(scores[others])
    new = exact(np.concatenate([ranked, left[samples[0]], others[samples[1]]]))
    loglik[ranked] = new[: len(ranked)]
    new = new[len(ranked) :]
    previous = sums[RERANKED:], scores[others]
    for cells, old, sample in zip((left, others), previous, samples, strict=True):
        if len(cells):
            loglik[cells] = old + _shifts(old, old[sample], new[: len(sample)])
        new = new[len(sample) :]
    return np.asarray(loglik)


def _sample(scores: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return a sample of cells by falling score, more of the likely ones than of the others."""
    pool = np.arange(0, len(scores), max(1, len(scores) // (POOL * RERANKED_SAMPLE)))
    pool = pool[np.argsort(-scores[pool], kind="stable")]
    ranks = np.geomspace(1, max(len(pool), 1), RERANKED_SAMPLE).astype(np.int64)
    return pool[np.unique(ranks[ranks <= len(pool)]) - 1]


def _shifts(
    scores: NDArray[np.float64], before: NDArray[np.float64], after: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how much some scores change, by those of a sample (falling) before and after.

    The changes of the chance in successive parts of the sample are interpolated.
    """
    starts = np.arange(0, len(before), RERANKED_SAMPLE // WINDOWS)
    moves = np.logaddexp.reduceat(after, starts) - np.logaddexp.reduceat(before, starts)
    levels = np.add.reduceat(before, starts) / np.diff(np.append(starts, len(before)))
    return np.asarray(np.interp(scores, levels[::-1], moves[::-1]))


def _outcome(  # noqa: PLR0917 - a private helper of one caller
    index: LikelihoodIndex,
    places: SignatureDatabase,
    cell: int,
    query: Signature,
    radius: float,
    some: _SomeCells,
    own: Callable[[NDArray[np.int64]], NDArray[np.float64]] | None = None,
) -> tuple[float, ...]:
    """Return the outcome of one simulated query: the fields of `Trials` from ``itself`` on."""
    loglik = _one_to_one(index, query, some)
    possible = loglik > loglik.max() - HOPELESS
    possible[np.searchsorted(some.rows, cell)] = True
    cells, weights = some.rows[possible], some.weights[possible]
    answer = posterior(_without_signatures(places, cells), loglik[possible] + np.log(weights))
    true = int(np.searchsorted(cells, cell))
    best, _ = answer.best_place(radius)
    near = float(answer.mass_within(radius, np.array([true]))[0])
    apart = places.grid.step * math.hypot(
        int(places.columns[cells[best]]) - int(places.columns[cell]),
        int(places.rows[cells[best]]) - int(places.rows[cell]),
    )
    own_loglik = None if own is None else own(cells)
    return (
        min(float(answer.chances[true]), near),
        near,
        float(apart <= radius + 1e-6),
        answer.entropy + float((answer.chances * np.log2(weights)).sum()),
        np.nan
        if own_loglik is None
        else float((answer.chances * own_loglik).sum() - own_loglik[true]),
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
        The cells that see objects of other classes, with these objects; it may have no cells.
    rows : ndarray of int64, shape (n,)
        For each cell of the given database, its row in the new one; -1 if it is not there.

    Examples
    --------
    >>> without, rows = leave_class_out(demo_database, 3)
    >>> bool((without.codes == 3).any()), len(without) == int((rows >= 0).sum())
    (False, True)
    """
    others = database.codes != code
    lengths = np.add.reduceat(others, database.offsets[:-1], dtype=np.int64)
    with_objects = lengths > 0
    rows = np.where(with_objects, np.cumsum(with_objects) - 1, -1)
    without_class = replace(
        database,
        columns=database.columns[with_objects],
        rows=database.rows[with_objects],
        offsets=np.concatenate([[0], np.cumsum(lengths[with_objects])]),
        codes=database.codes[others],
        bearing_units=database.bearing_units[others],
        distance_units=database.distance_units[others],
    )
    return without_class, rows


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
    """Repeat simulated queries for each class, with a city that has no data of this class.

    The queries are those of `try_cells`, without detections of the class. The results (m, k) are
    `Trials.near` and `Trials.bits` by class of ``index.table.codes``; NaN if the class is neither
    visible from the cell nor detected. A cell that sees no other class cannot be found: its
    probability is 0, and its entropy that of all cells.
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
        detected = np.array([bool((query.codes == code).any()) for query in queries], np.bool_)
        affected = detected | (sees > 0)
        near[~affected, number] = bits[~affected, number] = np.nan
        repeated = np.flatnonzero(affected & (rows[cells] >= 0))
        if len(repeated):
            noise = _without_class(index.noise, names[code], len(codes))
            trials = try_cells(
                build_index(without, noise),
                rows[cells[repeated]],
                queries=[queries[trial].select(queries[trial].codes != code) for trial in repeated],
                columns=columns,
                looks=numbers[repeated],
                omitted_class=(number, np.flatnonzero(rows >= 0)),
                radius=radius,
                threads=threads,
            )
            near[repeated, number], bits[repeated, number] = trials.near, trials.bits
        if progress is not None:
            progress((number + 1) * len(cells), len(codes) * len(cells))
    return near, bits


def _without_class(noise: Noise, name: str, classes: int) -> Noise:
    """Return a noise model of `classes` classes without one of them."""

    def without(spec: NoiseSpec) -> NoiseSpec:
        confusion = {own: row for own, row in spec.confusion.items() if own != name}
        # Without given shares, every class has an equal share of the false objects.
        clutter = spec.clutter if spec.clutter_shares else spec.clutter * (1.0 - 1.0 / classes)
        return replace(spec, confusion=confusion, clutter=clutter)

    return noise.changed(without)
