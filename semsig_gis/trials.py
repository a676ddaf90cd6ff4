"""Trials: queries drawn from a noise model at known cells, and what localization makes of them."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.alignment import rerank
from semsig_gis.detector import Detector
from semsig_gis.distortion_chain import ready_chain
from semsig_gis.lookalikes import city_extent
from semsig_gis.posterior import posterior
from semsig_gis.sight import CitySights, Sight

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.likelihood import LikelihoodIndex
    from semsig_gis.signatures import Signature

__all__ = ["Trials", "draw_trials", "trial_cells", "try_cells", "try_queries"]

HOPELESS = 20.0  # nats below the likeliest cell, at which a cell is left out of the sums


@dataclass(frozen=True, eq=False, kw_only=True)
class Trials:
    """What came of simulated queries, arrays of one item a query.

    `cells` has row numbers of the true cells. The answer gave the chance `itself` to the true cell
    and `near` to all cells near it, itself among them; `found` tells whether the best place is
    near, `bits` the entropy of the chances of all cells. `lean` is the mean, by these chances, of
    the logarithm of the likelihood of the true cell's own signature in a cell over that in the true
    one; NaN where nothing was detected.
    """

    cells: NDArray[np.int64]
    itself: NDArray[np.float64]
    near: NDArray[np.float64]
    found: NDArray[np.bool_]
    bits: NDArray[np.float64]
    lean: NDArray[np.float64]


def trial_cells(cells: int, count: int, *, seed: int = 0) -> NDArray[np.int64]:
    """Return row numbers of the cells of `count` trials: all equally often, the rest drawn.

    A larger count keeps the first ones.
    """
    rng = np.random.default_rng([seed, 0])
    rounds = [rng.permutation(cells) for _ in range(-(-count // cells))]
    return np.concatenate([np.zeros(0, np.int64), *rounds])[:count]


def draw_trials(
    index: LikelihoodIndex, cells: NDArray[np.int64], *, seed: int = 0
) -> Iterator[Signature]:
    """Yield what a detector tells of cells, if it fails as the noise model of the index says.

    `cells` are row numbers and may repeat. Detections are clockwise, perhaps none. Query number i
    is the same whatever the number of queries.
    """
    detector = Detector(noise=index.noise)
    spoil = ready_chain((detector,), CitySights.of(index.database))
    for number, cell in enumerate(cells.tolist()):
        yield spoil(Sight.of_cell(index.database, cell), seed, number).signature


def try_cells(
    index: LikelihoodIndex,
    cells: NDArray[np.int64],
    *,
    radius: float = 50.0,
    seed: int = 0,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Trials:
    """Ask one simulated query from each of some cells, given by row number.

    The noise model of the index is that of the detector and of the answer alike; `radius` is what
    counts as near, in metres.
    """
    queries = draw_trials(index, cells, seed=seed)
    return try_queries(index, cells, queries, radius=radius, threads=threads, progress=progress)


def try_queries(
    index: LikelihoodIndex,
    cells: NDArray[np.int64],
    queries: Iterable[Signature],
    *,
    radius: float = 50.0,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Trials:
    """Ask queries of which the true cells are known, one a row number of `cells`.

    `radius` is what counts as near, in metres. A query without objects is not answered: its chances
    are 0.
    """
    places = _without_signatures(index.database)
    radius = min(radius, city_extent(places))

    def ask(cell: int, query: Signature) -> tuple[float, ...]:
        return _outcome(index, places, cell, query, radius)

    rows: list[tuple[float, ...]] = []
    with ThreadPoolExecutor(threads) as pool:
        for row in pool.map(ask, cells.tolist(), queries):
            rows.append(row)
            if progress is not None:
                progress(len(rows), len(cells))
    itself, near, found, bits, lean = np.array(rows, dtype=np.float64).reshape(-1, 5).T
    return Trials(
        cells=np.asarray(cells),
        itself=itself,
        near=near,
        found=found.astype(np.bool_),
        bits=bits,
        lean=lean,
    )


def _without_signatures(database: SignatureDatabase) -> SignatureDatabase:
    """Return the cells alone, some of which are selected far faster."""
    nothing = slice(0)
    return replace(
        database,
        offsets=np.zeros_like(database.offsets),
        codes=database.codes[nothing],
        bearing_units=database.bearing_units[nothing],
        distance_units=database.distance_units[nothing],
    )


def _outcome(
    index: LikelihoodIndex,
    places: SignatureDatabase,
    cell: int,
    query: Signature,
    radius: float,
) -> tuple[float, ...]:
    """Return what comes of one query, in the order of `Trials`."""
    if not len(query):
        return 0.0, 0.0, 0.0, float(np.log2(len(places))), np.nan
    loglik = rerank(index, query, index.scores(query)).loglik
    kept = loglik > loglik.max() - HOPELESS
    kept[cell] = True
    cells = np.flatnonzero(kept)
    found = posterior(places.select(cells), loglik[cells])
    true = int(np.searchsorted(cells, cell))
    best, _ = found.best_place(radius)
    near = float(found.mass_within(radius, np.array([true]))[0])
    apart = places.grid.step * math.hypot(
        int(places.columns[cells[best]]) - int(places.columns[cell]),
        int(places.rows[cells[best]]) - int(places.rows[cell]),
    )
    own = index.scores(index.database.signature(cell)).loglik
    return (
        min(float(found.chances[true]), near),
        near,
        float(apart <= radius + 1e-6),
        found.entropy,
        float(found.chances @ own[cells] - own[cell]),
    )
