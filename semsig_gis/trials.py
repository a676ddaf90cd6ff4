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
    """What came of simulated queries, one a row.

    Parameters
    ----------
    cells : ndarray of int64, shape (m,)
        Row number of the true cell.
    itself : ndarray of float64, shape (m,)
        Chance that the answer gave to the true cell.
    near : ndarray of float64, shape (m,)
        Chance that it gave to the cells near the true one, itself among them.
    found : ndarray of bool, shape (m,)
        Whether the best place is near the true cell.
    bits : ndarray of float64, shape (m,)
        Entropy of the chances of the cells: what is left to be known.
    lean : ndarray of float64, shape (m,)
        Mean, by these chances, of the logarithm of the likelihood of the true cell's own
        signature in a cell over that in the true one; NaN where nothing was detected.
    """

    cells: NDArray[np.int64]
    itself: NDArray[np.float64]
    near: NDArray[np.float64]
    found: NDArray[np.bool_]
    bits: NDArray[np.float64]
    lean: NDArray[np.float64]


def trial_cells(cells: int, count: int, *, seed: int = 0) -> NDArray[np.int64]:
    """Return the cells of so many trials: all equally often, the rest drawn.

    Parameters
    ----------
    cells : int
        How many cells there are.
    count : int
        How many trials are wanted.
    seed : int, default 0
        Seed of the draw.

    Returns
    -------
    ndarray of int64, shape (count,)
        Row numbers; more of them keep the first ones.

    Examples
    --------
    >>> np.bincount(trial_cells(3, 7)).tolist() in ([2, 2, 3], [2, 3, 2], [3, 2, 2])
    True
    """
    rng = np.random.default_rng([seed, 0])
    rounds = [rng.permutation(cells) for _ in range(-(-count // cells))]
    return np.concatenate([np.zeros(0, np.int64), *rounds])[:count]


def draw_trials(
    index: LikelihoodIndex, cells: NDArray[np.int64], *, seed: int = 0
) -> Iterator[Signature]:
    """Draw what a detector tells of cells, if it fails as the noise model says.

    Parameters
    ----------
    index : LikelihoodIndex
        The cells and the noise model.
    cells : ndarray of int, shape (m,)
        Row numbers of the cells; one may come several times.
    seed : int, default 0
        Seed of the detections. Query number i is the same whatever the number of queries.

    Yields
    ------
    Signature
        The detections in each cell, clockwise; perhaps none.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.likelihood import build_index
    >>> from semsig_gis.noise import NoiseSpec
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=200.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> careful = NoiseSpec(detection=1.0, misnamed=0.0, clutter=0.0, bearing_sigma=0.01)
    >>> index = build_index(build_database(objects), careful)
    >>> (seen,) = draw_trials(index, np.array([0]))
    >>> index.database.taxonomy.decode(seen.codes) == index.database.types(0)
    True
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
    """Ask one simulated query from each of some cells.

    Parameters
    ----------
    index : LikelihoodIndex
        The cells and the noise model, of the detector and of the answer alike.
    cells : ndarray of int, shape (m,)
        Row numbers of the true cells.
    radius : float, default 50
        Metres that count as near.
    seed : int, default 0
        Seed of the detections.
    threads : int, default 1
        How many queries are worked on at once.
    progress : callable, optional
        Called with the number of queries done and in all.

    Returns
    -------
    Trials
        The outcomes.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.likelihood import build_index
    >>> from semsig_gis.noise import named_noise
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> index = build_index(database, named_noise("light"))
    >>> trials = try_cells(index, trial_cells(len(database), 50))
    >>> bool(trials.found.mean() > 0.5), bool((trials.itself <= trials.near).all())
    (True, True)
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
    """Ask queries of which the true cells are known.

    Parameters
    ----------
    index : LikelihoodIndex
        The cells and the noise model.
    cells : ndarray of int, shape (m,)
        Row numbers of the true cells.
    queries : iterable of Signature
        A query from each.
    radius : float, default 50
        Metres that count as near.
    threads : int, default 1
        How many queries are worked on at once.
    progress : callable, optional
        Called with the number of queries done and in all.

    Returns
    -------
    Trials
        The outcomes. A query without objects is not answered: chances of 0.
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
