"""Measure localization: draw queries of known places, let a method answer, score errors and ranks.

Equal scores are common, so every figure is an expectation over all orders of the tied cells.
"""

from __future__ import annotations

import functools
import math
import platform
from dataclasses import replace
from importlib import metadata
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd

from semsig_gis import __version__
from semsig_gis.core import (
    DEFAULT_METHOD,
    InputError,
    angular_distance,
    announce,
    cell_ids,
    wrap_degrees,
)
from semsig_gis.evaluation.queries.distortion_text import QueryDistortion, parse_chain
from semsig_gis.evaluation.queries.draw import QuerySpec, check_count, draw_queries
from semsig_gis.evaluation.result import QUERY_COLUMNS, Evaluation
from semsig_gis.localization import (
    NEAR_METRES,
    NEAR_PLACES,
    THRESHOLDS,
    LikelihoodMethod,
    Method,
    best_cells,
    chance_within,
    expected_best,
    make_locator,
    parse_method,
    rank_range,
    top_candidates,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation.queries.draw import Query
    from semsig_gis.localization import (
        Answer,
        AnyMethod,
        DistanceMemo,
        LikelihoodIndex,
        Locator,
        Ranking,
    )
    from semsig_gis.observation import Photo

# Seconds that a query, and a cell of a query, takes: only for telling how long the work is.
QUERY_S, PAIR_S = 5e-3, 1e-7
NEXT_CELLS = 4  # that are named after the best candidate

# What is told of an answer, in this order.
OUTCOME_COLUMNS = (
    *("distance", "rank_low", "rank_high", "chance", "in_region", "heading_error", "seconds"),
    *("best_cell_id", "best_x", "best_y", "tied", "next_cell_ids"),
    *(f"near{count}" for count in NEAR_PLACES),
    *("right", "error_m"),
    *(f"p{threshold}" for threshold in THRESHOLDS),
)


def evaluate(
    database: SignatureDatabase,
    *,
    queries: int = 500,
    method: str | Method | LikelihoodIndex = DEFAULT_METHOD,
    distortion: str | QueryDistortion | Sequence[QueryDistortion] = "medium",
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
    method : str, Method or LikelihoodIndex, default "likelihood"
        What ranks the cells: distances, or the likelihood with this index of the database; or the
        text of a method (see `parse_method`), such as ``"edit+edit:5%"``. Queries are from the
        middles of cells, and so the likelihood takes them.
    distortion : str, distortion or sequence of distortions, default "medium"
        What happens to the signatures: one of the paper's levels, or any of `queries.chain`,
        as text or as values.
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

    The likelihood method answers with the place around which most of the chance lies. That comes
    first; then follow the other cells, likeliest first. Queries from anywhere, and several
    methods on the same queries, are for `evaluation.spec`.

    Examples
    --------
    >>> evaluation = evaluate(demo_database, queries=20, distortion="none")
    >>> len(evaluation.queries), evaluation.recall(100)
    (20, 1.0)
    """
    check_count("queries", queries, len(database))
    check_count("candidates", top, len(database))
    if isinstance(distortion, str):
        distortion = parse_chain(distortion)
    chain = (distortion,) if isinstance(distortion, QueryDistortion) else tuple(distortion)
    spec = QuerySpec(number=queries, seeds=(seed,), distortions=chain)
    used: AnyMethod
    locator: Locator[Answer]
    if isinstance(method, str):
        used = parse_method(method)
        if isinstance(used, LikelihoodMethod):
            used = replace(used, on_grid=True)
        locator = make_locator(database, used)
    elif isinstance(method, Method):
        used, locator = method, make_locator(database, method)
    elif method.database is database:
        used = LikelihoodMethod(noise=method.noise, on_grid=True)
        locator = make_locator(database, used, index=method)
    else:
        raise InputError(
            "the likelihood index belongs to another database; build it for the database to search."
        )
    announce(queries * (QUERY_S + PAIR_S * len(database)), "evaluating")
    drawn = draw_queries(database, spec)
    outcomes = score_queries(database, locator, drawn, tops=(top,), progress=progress)
    scored = scored_tables(database, drawn, outcomes)[top]
    return make_evaluation(database, used, spec, scored, top=top)


def score_queries(
    database: SignatureDatabase,
    locator: Locator[Answer],
    queries: Sequence[Query],
    *,
    tops: Sequence[int] = (1,),
    memo: DistanceMemo | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[int, list[dict[str, Any]]]:
    """Let a method answer queries of known places, and score the answers.

    Return one row of outcomes a query for each of `tops` (how many best candidates count). `memo`
    keeps distances of these queries that other methods have needed.
    """
    views = [query.asked.signature for query in queries if len(query.asked)]
    rankings = locator.rankings(views, memo=memo)
    outcomes: dict[int, list[dict[str, Any]]] = {top: [] for top in tops}
    for done, query in enumerate(queries, start=1):
        if len(query.asked):
            ranking = next(rankings)
            pool = _Pool(database, query, ranking, max(*tops, *NEAR_PLACES))
            shared = pool.shared()
            for top in tops:
                outcomes[top].append(shared | pool.outcome(top))
        else:
            for top in tops:
                outcomes[top].append(_unlocalized(len(database)))
        if progress is not None:
            progress(done, len(queries))
    return outcomes


def scored_tables(
    database: SignatureDatabase,
    queries: Sequence[Query],
    outcomes: Mapping[int, Sequence[Mapping[str, Any]]],
) -> dict[int, pd.DataFrame]:
    """Return for each number of best candidates a table of what was asked and found.

    One row a query: the columns of `Evaluation.queries`, but ``x`` and ``y`` for ``geometry``, and
    ``seconds``, which is NaN where nothing was asked.
    """
    about = _query_table(database, queries)
    scored = {}
    for top, rows in outcomes.items():
        table = pd.DataFrame(list(rows), columns=OUTCOME_COLUMNS)
        table["best_cell_id"] = table["best_cell_id"].astype("Int64")
        scored[top] = pd.concat([about, table], axis=1)
    return scored


def make_evaluation(
    database: SignatureDatabase,
    method: AnyMethod,
    spec: QuerySpec,
    scored: pd.DataFrame,
    *,
    top: int,
    city: str | None = None,
    file_bytes: int | None = None,
) -> Evaluation:
    """Return the evaluation of all queries that `scored_tables` gave; see `Evaluation`."""
    points = gpd.points_from_xy(scored["x"], scored["y"], crs=database.crs)
    seconds = scored["seconds"].to_numpy(dtype=np.float64)
    timed = seconds[~np.isnan(seconds)]
    return Evaluation(
        queries=gpd.GeoDataFrame(scored[list(QUERY_COLUMNS)], geometry=points),
        method=method,
        asked=spec,
        city=city,
        top=top,
        seconds_per_query=float(timed.mean()) if timed.size else 0.0,
        database=_database_summary(database, file_bytes),
        versions=versions(),
    )


@functools.cache
def versions() -> dict[str, str]:
    """Return the versions of the software that decides the figures and their speed."""
    parts = {name: metadata.version(name) for name in ("numpy", "pandas", "rapidfuzz")}
    return {"semsig_gis": __version__, "python": platform.python_version(), **parts}


class _Pool:
    """The best cells of a ranking with all that tie with the last of them, and their errors."""

    def __init__(
        self, database: SignatureDatabase, query: Query, ranking: Ranking, count: int
    ) -> None:
        self.database, self.query, self.ranking = database, query, ranking
        self.cells = best_cells(ranking.scores, min(count, len(database)))
        places = database.xy.take(self.cells, axis=0)
        self.scores = ranking.scores[self.cells]
        if ranking.place is not None:
            places[self.scores.argmin()] = ranking.place
        places -= query.xy
        # So that a cell 50 m away is not a rounding beyond 50 m.
        self.errors = np.round(np.sqrt((places**2).sum(axis=1)), 6)
        self.better = self.tied = np.empty(0)

    def shared(self) -> dict[str, Any]:
        """Return the columns that do not depend on how many candidates count."""
        query, ranking = self.query, self.ranking
        cells = len(ranking.scores)
        low, high = rank_range(ranking.scores, query.cell) if query.cell >= 0 else (cells, cells)
        off, right = math.nan, math.nan
        if ranking.heading is not None:
            off = float(angular_distance(ranking.heading, query.asked.heading))
        near = {
            f"near{count}": chance_within(**self._cut(count), metres=NEAR_METRES)
            for count in NEAR_PLACES
        }
        if ranking.chances is not None:
            right = chance_within(**self._cut(1), metres=Evaluation.success_metres)
        return {
            "distance": ranking.best_score,
            "rank_low": low,
            "rank_high": high,
            "chance": ranking.chance,
            "in_region": self._in_region(),
            "heading_error": off,
            "seconds": ranking.seconds,
            **self._best(),
            **near,
            "right": right,
        }

    def outcome(self, top: int) -> dict[str, Any]:
        """Return the columns that depend on how many candidates count."""
        expected, within = expected_best(**self._cut(top))
        chances = {f"p{t}": float(p) for t, p in zip(THRESHOLDS, within, strict=True)}
        return {"error_m": expected, **chances}

    def _best(self) -> dict[str, Any]:
        """Return the best candidate, or one of equals, and the next ones."""
        best = self.cells[self.scores == self.scores.min()]
        shown = best[int(self.query.pick * len(best))]
        # Equals follow in the order of the cells.
        count = min(NEXT_CELLS + 1, len(self.scores))
        better, tied = top_candidates(self.scores, count)
        better = better[np.argsort(self.scores[better], kind="stable")]
        after = self.cells[np.concatenate([better, tied[: count - len(better)]])]
        after = after[after != shown][:NEXT_CELLS]
        database, place = self.database, self.ranking.place
        x, y = database.xy[shown].tolist() if place is None else place
        listed = np.append(shown, after)
        first, *others = cell_ids(database.columns[listed], database.rows[listed]).tolist()
        return {
            "best_cell_id": first,
            "best_x": x,
            "best_y": y,
            "tied": len(best),
            "next_cell_ids": ",".join(map(str, others)),
        }

    def _in_region(self) -> float:
        """Return the chance that the true cell is in the region; its last cell is one of equals."""
        chances, region, cell = self.ranking.chances, self.ranking.region, self.query.cell
        if chances is None or region is None:
            return math.nan
        if cell < 0:
            return 0.0
        least, own = chances[region[-1]], chances[cell]
        if own != least:
            return float(own > least)
        return float((chances[region] == least).sum() / (chances == least).sum())

    def _cut(self, count: int) -> dict[str, Any]:
        """Return the errors of those that are surely among so many best, and of the tied."""
        count = min(count, len(self.scores))
        slots = count - len(self.better)
        if not 0 < slots <= len(self.tied):  # else the cut is among the same cells as before
            better, tied = top_candidates(self.scores, count)
            self.better, self.tied = self.errors[better], self.errors[tied]
            slots = count - len(better)
        return {"better": self.better, "tied": self.tied, "slots": slots}


def _unlocalized(cells: int) -> dict[str, Any]:
    """Return the same columns for a query that had nothing to compare."""
    untold = ("chance", "right", "in_region", "heading_error", "seconds", "best_x", "best_y")
    return {
        "best_cell_id": None,
        "next_cell_ids": "",
        "tied": 0,
        **dict.fromkeys(("distance", "error_m"), math.inf),
        **{f"p{t}": 0.0 for t in THRESHOLDS},
        **{f"near{count}": 0.0 for count in NEAR_PLACES},
        **dict.fromkeys(("rank_low", "rank_high"), cells),
        **dict.fromkeys(untold, math.nan),
    }


def _query_table(database: SignatureDatabase, queries: Sequence[Query]) -> pd.DataFrame:
    """Return what was asked, and the truth, one row a query."""
    cells = np.array([one.cell for one in queries], np.int64)
    known = cells >= 0
    places = np.array([one.xy for one in queries], np.float64).reshape(-1, 2)
    return pd.DataFrame(
        {
            "seed": np.array([one.seed for one in queries], np.int64),
            "number": np.array([one.number for one in queries], np.int64),
            "cell": cells,
            "cell_id": cell_ids(*database.grid.cells_at(places)),
            "types": [database.types(cell) if cell >= 0 else "" for cell in cells.tolist()],
            "length": np.array([one.length for one in queries], np.int64),
            "type_group": np.where(known, database.type_group_sizes[cells], 0),
            "angle_group": np.where(known, database.angle_group_sizes[cells], 0),
            "query_types": [database.taxonomy.decode(one.asked.codes) for one in queries],
            "query_bearings": [_bearing_text(one.asked.bearings) for one in queries],
            "query_ranges": [_range_text(one.asked.ranges) for one in queries],
            "query_sectors": [_sector_text(one.asked.photo) for one in queries],
            "query_length": np.array([len(one.asked) for one in queries], np.int64),
            "heading": np.array([one.asked.heading for one in queries], np.float64),
            "x": places[:, 0],
            "y": places[:, 1],
        }
    )


def _bearing_text(bearings: NDArray[np.float64]) -> str:
    """Return bearings as the command line takes them, to a tenth of a degree."""
    tenths = np.floor(bearings * 10.0) / 10.0  # down, so that none becomes 360
    return ",".join(f"{value:.1f}" for value in tenths)


def _range_text(ranges: NDArray[np.float64] | None) -> str:
    """Return rough distances to a tenth of a metre, nothing where none were told."""
    return "" if ranges is None else ",".join(f"{value:.1f}" for value in ranges)


def _sector_text(photo: Photo) -> str:
    """Return the sectors that were looked at, nothing for the full turn."""
    ends = [wrap_degrees(np.array(sector)) for sector in photo.sectors]
    return ",".join(_bearing_text(pair).replace(",", "-") for pair in ends)


def _database_summary(database: SignatureDatabase, file_bytes: int | None) -> dict[str, Any]:
    """Return what identifies a database, as plain values."""
    covered = len(database) * database.grid.step**2 / 1e6
    return {
        "cells": len(database),
        "mean_length": float(database.lengths.mean()),
        "step_m": float(database.grid.step),
        "origin": [float(value) for value in database.grid.origin],
        "radius_m": float(database.spec.radius),
        "levels": int(database.spec.levels),
        "crs": database.crs.to_string(),
        "version": database.version,
        "mb_per_km2": None if file_bytes is None else file_bytes / 1e6 / covered,
    }
