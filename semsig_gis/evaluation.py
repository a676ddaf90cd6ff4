"""Measure localization: distort known signatures, rank the cells, score errors and ranks.

Equal scores are common (a street with three lamps looks like thousands of others), so every
figure is an expectation over all orders of the tied cells, worked out exactly, never the luck of
an array order.
"""

from __future__ import annotations

import math
import platform
import time
from importlib import metadata
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd

from semsig_gis import __version__
from semsig_gis.alignment import rerank
from semsig_gis.distortion import distort, named_distortion
from semsig_gis.errors import InputError
from semsig_gis.evaluation_result import SUCCESS_METRES, SUCCESS_PROBABILITY, Evaluation
from semsig_gis.grid import cell_ids
from semsig_gis.location import REGION_SHARE
from semsig_gis.matching import score_cells
from semsig_gis.method import DEFAULT_METHOD, LikelihoodMethod, Method
from semsig_gis.posterior import posterior
from semsig_gis.scoring import THRESHOLDS, expected_best, rank_range, top_candidates

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.distortion import Distortion
    from semsig_gis.likelihood import LikelihoodIndex
    from semsig_gis.posterior import Posterior
    from semsig_gis.signatures import Signature

    # Scores of all cells, what else is told of the answer, and the seconds they took.
    _Answer = tuple[NDArray[np.float32], Mapping[str, float], float]

__all__ = ["SUCCESS_METRES", "SUCCESS_PROBABILITY", "Evaluation", "evaluate"]

_UNTOLD = {"chance": math.nan, "right": math.nan, "in_region": math.nan}


def evaluate(
    database: SignatureDatabase,
    *,
    queries: int = 500,
    method: Method | LikelihoodIndex = DEFAULT_METHOD,
    distortion: Distortion | str = "medium",
    top: int = 1,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Evaluation:
    """Query a database with distorted signatures of its own cells and score the answers.

    Parameters
    ----------
    database : SignatureDatabase
        What to search.
    queries : int, default 500
        How many cells to draw as queries, without replacement; 1 to the number of cells.
    method : Method or LikelihoodIndex, optional
        What ranks the cells: measures of distance, or the index of this database for the
        likelihood method; metric fusion of two edit distances unless given.
    distortion : Distortion or str, default "medium"
        What happens to the signatures, or the name of one of the paper's levels.
    top : int, default 1
        How many best candidates count (t); 1 to the number of cells.
    seed : int, default 0
        Seed of the sample and of all chances; 0 or more. Query number i is the same whatever
        the number of queries.
    progress : callable, optional
        Called with the number of queries done and the number of queries.

    Returns
    -------
    Evaluation
        One row a query, the settings and the mean time a query.

    Raises
    ------
    InputError
        If a number is out of range, or the index is that of another database.
    UnknownNameError
        If there is no distortion of that name.

    Notes
    -----
    Paper, section 4.2: the error is the distance from the true viewpoint to the nearest of the
    best t candidates; the recall looks at the rank of the true cell among all cells. False
    objects have the classes that occur in the database.

    The likelihood method, as `semsig_gis.locating` has it, answers with the place around which
    most of the chance lies. That comes first; then follow the other cells, likeliest first. So
    the best t candidates are the answer and the t - 1 likeliest other cells.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> evaluation = evaluate(build_database(objects), queries=20, distortion="none")
    >>> len(evaluation.queries), evaluation.recall(100)
    (20, 1.0)
    """
    n = len(database)
    _check_count("queries", queries, n)
    _check_count("candidates", top, n)
    if seed < 0:
        msg = f"A seed of {seed} was given; give a whole number, 0 or more."
        raise InputError(msg)
    chosen_distortion = named_distortion(distortion) if isinstance(distortion, str) else distortion
    if not isinstance(method, Method) and method.database is not database:
        msg = "the likelihood index belongs to another database; build that of the one to search."
        raise InputError(msg)
    # A prefix of one permutation: more queries keep the first ones.
    cells = np.random.default_rng(np.random.SeedSequence(seed)).permutation(n)[:queries]
    asked, picks = _distorted(database, cells, chosen_distortion, seed)
    truths = [(cell, one) for cell, one in zip(cells.tolist(), asked, strict=True) if len(one)]
    if isinstance(method, Method):
        answers = _by_distance(database, [one for _, one in truths], method)
    else:
        answers = _by_likelihood(method, truths)
    outcomes: list[dict[str, Any]] = []
    seconds = 0.0
    for number, (cell, query, pick) in enumerate(zip(cells.tolist(), asked, picks, strict=True)):
        if len(query):
            scores, told, spent = next(answers)
            seconds += spent
            outcome = _outcome(database, scores, cell=cell, top=top, pick=pick)
            outcomes.append(outcome | dict(told))
        else:
            outcomes.append(_unlocalized(n))
        if progress is not None:
            progress(number + 1, queries)
    return Evaluation(
        queries=_query_table(database, cells, asked, outcomes),
        method=method if isinstance(method, Method) else LikelihoodMethod(noise=method.noise),
        distortion=chosen_distortion,
        top=top,
        seed=seed,
        seconds_per_query=seconds / len(truths) if truths else 0.0,
        database=_database_summary(database),
        versions=_versions(),
    )


def _outcome(
    database: SignatureDatabase, scores: NDArray[np.float32], *, cell: int, top: int, pick: float
) -> dict[str, Any]:
    """Return the columns that depend on the scores; `pick` in [0, 1) chooses among ties."""
    better, tied = top_candidates(scores, top)
    expected, within = expected_best(
        _errors(database, cell, better), _errors(database, cell, tied), slots=top - len(better)
    )
    best = better[scores[better] == scores[better].min()] if len(better) else tied
    shown = best[int(pick * len(best))]
    x, y = database.xy[shown].tolist()
    low, high = rank_range(scores, cell)
    return {
        "best_cell_id": int(cell_ids(database.columns[shown], database.rows[shown])),
        "best_x": x,
        "best_y": y,
        "distance": float(scores[shown]),
        "tied": len(best),
        "error_m": expected,
        **{f"p{t}": float(p) for t, p in zip(THRESHOLDS, within, strict=True)},
        "rank_low": low,
        "rank_high": high,
    }


def _unlocalized(cells: int) -> dict[str, Any]:
    """Return the same columns for a query that had nothing to compare."""
    return {
        "best_cell_id": None,
        "best_x": math.nan,
        "best_y": math.nan,
        "distance": math.inf,
        "tied": 0,
        "error_m": math.inf,
        **{f"p{t}": 0.0 for t in THRESHOLDS},
        "rank_low": cells,
        "rank_high": cells,
        **_UNTOLD,
    }


def _errors(
    database: SignatureDatabase, cell: int, others: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return the distances of other cells from one, in metres."""
    # From whole cell numbers, so that a cell 50 m away is not a rounding beyond 50 m.
    columns = database.columns[others].astype(np.int64) - int(database.columns[cell])
    rows = database.rows[others].astype(np.int64) - int(database.rows[cell])
    return np.asarray(database.grid.step * np.sqrt(columns**2 + rows**2))


def _check_count(what: str, count: int, cells: int) -> None:
    """Refuse a number of queries or candidates that the database does not have."""
    if not 1 <= count <= cells:
        msg = (
            f"{count} {what} were asked for; give a number from 1 to {cells}, the number of cells."
        )
        raise InputError(msg)


def _distorted(
    database: SignatureDatabase, cells: NDArray[np.int64], distortion: Distortion, seed: int
) -> tuple[list[Signature], list[float]]:
    """Return the distorted signature of each cell, and a chance to pick among ties by."""
    classes = database.present_codes
    weights = database.occurrences[classes]
    asked: list[Signature] = []
    picks: list[float] = []
    for number, cell in enumerate(cells.tolist()):
        # Its own generator, so that no query depends on what happened to another.
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,)))
        true = database.signature(cell)
        asked.append(distort(true, distortion, classes=classes, weights=weights, rng=rng))
        picks.append(float(rng.random()))
    return asked, picks


def _by_distance(
    database: SignatureDatabase, queries: Sequence[Signature], method: Method
) -> Iterator[_Answer]:
    """Yield the distances of each query to all cells."""
    if not queries:
        return
    # What the database works out once and keeps is no part of the time of a query.
    next(iter(score_cells(database, queries[:1], method)))
    rows = iter(score_cells(database, queries, method))
    for _ in queries:
        start = time.perf_counter()
        scores = next(rows)
        yield scores, _UNTOLD, time.perf_counter() - start


def _by_likelihood(
    index: LikelihoodIndex, truths: Sequence[tuple[int, Signature]]
) -> Iterator[_Answer]:
    """Yield scores for each true cell and its query: the answer lowest, the likeliest next."""
    if truths:
        _located(index, truths[0][1])  # kernels are loaded once
    for cell, query in truths:
        start = time.perf_counter()
        loglik, found, answer, chance = _located(index, query)
        seconds = time.perf_counter() - start
        tied = _places_like(found, answer, chance)
        right = (_errors(index.database, cell, tied) <= SUCCESS_METRES).mean()
        told = {
            "distance": -float(loglik[answer]),
            "chance": chance,
            "right": float(right),
            "in_region": _in_region(found, cell),
        }
        scores = -loglik.astype(np.float32)
        scores[tied] = scores.min() - 1.0
        yield scores, told, seconds


def _located(
    index: LikelihoodIndex, query: Signature
) -> tuple[NDArray[np.floating], Posterior, int, float]:
    """Return the log-likelihoods and chances of all cells, the answer and its chance."""
    loglik = rerank(index, query, index.scores(query)).loglik
    found = posterior(index.database, loglik)
    return loglik, found, *found.best_place(SUCCESS_METRES)


def _places_like(found: Posterior, answer: int, chance: float) -> NDArray[np.intp]:
    """Return the cells that might have been the answer as well, and the answer."""
    alike = np.flatnonzero(found.chances == found.chances[answer])
    same = np.round(found.mass_within(SUCCESS_METRES, alike), 9) == chance
    return np.asarray(alike[same])


def _in_region(found: Posterior, cell: int) -> float:
    """Return the probability that a cell is in the region, whose last cell is one of equals."""
    region = found.credible_cells(REGION_SHARE)
    least, own = found.chances[region[-1]], found.chances[cell]
    if own != least:
        return float(own > least)
    return float((found.chances[region] == least).sum() / (found.chances == least).sum())


def _query_table(
    database: SignatureDatabase,
    cells: NDArray[np.int64],
    asked: Sequence[Signature],
    outcomes: Sequence[Mapping[str, Any]],
) -> gpd.GeoDataFrame:
    """Return one row a query."""
    table = pd.DataFrame(
        {
            "cell": cells,
            "cell_id": database.cell_ids[cells],
            "types": [database.types(cell) for cell in cells.tolist()],
            "length": database.lengths[cells].astype(np.int64),
            "type_group": database.type_group_sizes[cells],
            "angle_group": database.angle_group_sizes[cells],
            "query_types": [
                "" if one.codes is None else database.taxonomy.decode(one.codes) for one in asked
            ],
            "query_bearings": [_bearing_text(one) for one in asked],
            "query_length": [len(one) for one in asked],
        }
    )
    scored = pd.DataFrame(list(outcomes)).astype({"best_cell_id": "Int64"})
    places = database.xy[cells]
    points = gpd.points_from_xy(places[:, 0], places[:, 1], crs=database.crs)
    return gpd.GeoDataFrame(pd.concat([table, scored], axis=1), geometry=points)


def _bearing_text(signature: Signature) -> str:
    """Return bearings as the command line takes them, to a tenth of a degree."""
    if signature.bearings is None:
        return ""
    tenths = np.floor(signature.bearings * 10.0) / 10.0  # down, so that none becomes 360
    return ",".join(f"{value:.1f}" for value in tenths)


def _database_summary(database: SignatureDatabase) -> dict[str, Any]:
    """Return what identifies a database, as plain values."""
    return {
        "cells": len(database),
        "mean_length": float(database.lengths.mean()),
        "step_m": float(database.grid.step),
        "origin": [float(value) for value in database.grid.origin],
        "radius_m": float(database.spec.radius),
        "levels": int(database.spec.levels),
        "crs": database.crs.to_string(),
        "version": database.version,
    }


def _versions() -> dict[str, str]:
    """Return the versions that decide the figures and their speed."""
    parts = {name: metadata.version(name) for name in ("numpy", "pandas", "rapidfuzz")}
    return {"semsig_gis": __version__, "python": platform.python_version(), **parts}
