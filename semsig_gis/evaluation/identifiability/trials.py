"""Trials: simulated queries from known cells with a noise model, and their outcomes."""

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
from semsig_gis.evaluation.queries.distortion_text import prepare_chain
from semsig_gis.evaluation.queries.distortions import SimulatedDetector
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


LEANS = 300  # trials to fit the temperature of the likelihoods of signatures
# Re-ranked cells of a trial: the likeliest, and a sample of the others.
RERANKED, RERANKED_SAMPLE = 128, 256
HOPELESS = 20.0  # nats; cells farther below the likeliest cell are omitted from the sums


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
    if columns is not None and omitted_class is None:
        with_lean[np.flatnonzero(columns.counts[numbers, :, cells].any(axis=1))[:LEANS]] = True

    def answer(item: tuple[int, Signature]) -> tuple[float, ...]:
        trial, query = item
        cell, look = int(cells[trial]), int(numbers[trial])
        if not len(query):
            return 0.0, 0.0, 0.0, float(np.log2(len(places))), np.nan
        if columns is None:
            scores = index.scores(query)
        elif omitted_class is None:
            scores = CellScores(loglik=columns.scores(query, look))
        else:
            class_row, rows = omitted_class
            scores = CellScores(loglik=columns.scores(query, look, omitted_class=class_row)[rows])
        own = partial(columns.loglik, cell, look) if columns and with_lean[trial] else None
        return _outcome(index, places, cell, query, radius, scores, own)

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


def _outcome(  # noqa: PLR0917 - a private helper of one caller
    index: LikelihoodIndex,
    places: SignatureDatabase,
    cell: int,
    query: Signature,
    radius: float,
    scores: CellScores,
    own: Callable[[NDArray[np.int64]], NDArray[np.float64]] | None = None,
) -> tuple[float, ...]:
    """Return the outcome of one simulated query: the fields of `Trials` from ``itself`` on."""
    loglik = rerank(
        index, query, scores, count=RERANKED, off_centre=False, sample=RERANKED_SAMPLE
    ).loglik
    possible = loglik > loglik.max() - HOPELESS
    possible[cell] = True
    cells = np.flatnonzero(possible)
    answer = posterior(_without_signatures(places, cells), loglik[cells])
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
        answer.entropy,
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
