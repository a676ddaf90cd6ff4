"""Evaluate localization: draw queries from known places, locate them, score errors and ranks.

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
from semsig_gis.database import whole_database
from semsig_gis.evaluation.figures import LENGTHS, range_labels
from semsig_gis.evaluation.queries.distortion_text import QueryDistortion, parse_chain
from semsig_gis.evaluation.queries.draw import QuerySpec, check_count, draw_queries
from semsig_gis.evaluation.result import QUERY_COLUMNS, Evaluation
from semsig_gis.localization import (
    DEFAULT_RULE,
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
    from pathlib import Path

    from numpy.typing import NDArray

    from semsig_gis.database import City, SignatureDatabase
    from semsig_gis.evaluation.queries.draw import SimulatedQuery
    from semsig_gis.localization import (
        Answer,
        AnyMethod,
        DistanceMemo,
        LikelihoodIndex,
        Locator,
        Ranking,
    )
    from semsig_gis.observation import Photo

# Approximate seconds for each query and for each cell of a query, to announce the duration.
QUERY_S, QUERY_CELL_S = 5e-3, 1e-7
NEXT_CELLS = 4  # listed after the best candidate

# Columns of the outcome of a query, in their order.
OUTCOME_COLUMNS = (
    *("distance", "rank_low", "rank_high", "chance", "in_region", "heading_error", "seconds"),
    *("best_cell_id", "best_x", "best_y", "tied", "next_cell_ids"),
    *(f"near{count}" for count in NEAR_PLACES),
    *("right", "error_m"),
    *(f"p{threshold}" for threshold in THRESHOLDS),
)


def evaluate(
    database: SignatureDatabase | City | str | Path,
    *,
    queries: int = 500,
    method: str | Method | LikelihoodIndex = DEFAULT_METHOD,
    distortion: str | QueryDistortion | Sequence[QueryDistortion] = "medium",
    top: int = 1,
    seed: int = 0,
    surely_here: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Evaluation:
    """Search a database for distorted signatures of its own cells, and score the answers.

    Parameters
    ----------
    database : SignatureDatabase, City, str or Path
        The database to search.
    queries : int, default 500
        Number of cells to draw as queries, without replacement; 1 to the number of cells.
    method : str, Method or LikelihoodIndex, default "likelihood"
        The method that ranks the cells: a distance method, the likelihood index of this database,
        or the text of a method (see `parse_method`), such as ``"edit+edit:5%"``. Queries are from
        the centres of cells, and the likelihood method assumes that.
    distortion : str, distortion or sequence of distortions, default "medium"
        The distortion of the signatures: one of the paper's levels, or any of
        `queries.distortion_text`, as text or as values.
    top : int, default 1
        Number of best candidates that count (t); 1 to the number of cells.
    seed : int, default 0
        Random seed; 0 or more. Query number i is the same whatever the number of queries.
    surely_here : bool, default False
        Whether the likelihood method assumes that queries are from this database, as they are.
    progress : callable, optional
        Called with the number of finished queries and the number of queries.

    Returns
    -------
    Evaluation
        One row for each query, the settings and the mean time of a query.

    Raises
    ------
    InputError
        If a number is out of range, or the index belongs to another database.
    UnknownNameError
        If there is no distortion of that name.

    Notes
    -----
    Paper, section 4.2: the error is the distance from the true viewpoint to the nearest of the
    best t candidates; the recall uses the rank of the true cell among all cells. False objects
    have the classes that occur in the database.

    The first candidate of the likelihood method is the place with the most probability around it;
    the other cells follow by falling likelihood. For queries from any place, and several methods on
    the same queries, use an experiment (`ExperimentSpec`).

    Examples
    --------
    >>> evaluation = evaluate(demo_database, queries=20, distortion="none")
    >>> len(evaluation.queries), evaluation.recall(100)
    (20, 1.0)
    """
    database = whole_database(database)
    check_count("queries", queries, len(database))
    check_count("candidates", top, len(database))
    if isinstance(distortion, str):
        distortion = parse_chain(distortion)
    chain = (distortion,) if isinstance(distortion, QueryDistortion) else tuple(distortion)
    spec = QuerySpec(number=queries, seeds=(seed,), distortions=chain)
    ranking: AnyMethod
    index: LikelihoodIndex | None = None
    if isinstance(method, str):
        ranking = parse_method(method)
        if isinstance(ranking, LikelihoodMethod):
            ranking = replace(ranking, on_grid=True)
    elif isinstance(method, Method):
        ranking = method
    elif method.database is database:
        ranking, index = LikelihoodMethod(noise=method.noise, on_grid=True), method
    else:
        raise InputError(
            "the likelihood index belongs to another database; build it for the database to search."
        )
    if surely_here and isinstance(ranking, LikelihoodMethod):
        ranking = replace(ranking, surely_here=True)
    locator = make_locator(database, ranking, index=index)
    announce(queries * (QUERY_S + QUERY_CELL_S * len(database)), "evaluating")
    sample = draw_queries(database, spec)
    outcomes = score_queries(database, locator, sample, tops=(top,), progress=progress)
    scored = scored_tables(database, sample, outcomes)[top]
    return make_evaluation(database, ranking, spec, scored, top=top)


def score_queries(
    database: SignatureDatabase,
    locator: Locator[Answer],
    queries: Sequence[SimulatedQuery],
    *,
    tops: Sequence[int] = (1,),
    memo: DistanceMemo | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[int, list[dict[str, Any]]]:
    """Locate queries from known places, and score the answers.

    Return one row of outcomes for each query, by each of `tops` (number of best candidates that
    count). `memo` holds distances of these queries that several methods share.
    """
    views = [query.asked.signature for query in queries if len(query.asked)]
    rankings = locator.rankings(views, memo=memo)
    outcomes: dict[int, list[dict[str, Any]]] = {top: [] for top in tops}
    for count, query in enumerate(queries, start=1):
        if len(query.asked):
            scores = _QueryScores(database, query, next(rankings), max(*tops, *NEAR_PLACES))
            shared = scores.shared()
            for top in tops:
                outcomes[top].append(shared | scores.outcome(top))
        else:
            for top in tops:
                outcomes[top].append(_unlocalized(len(database)))
        if progress is not None:
            progress(count, len(queries))
    return outcomes


def foreign_answers(
    evaluation: Evaluation, database: SignatureDatabase, foreign: SignatureDatabase
) -> pd.DataFrame:
    """Return how many queries of an evaluation, and of another city like them, are answered.

    One row for each range of the number of objects in the query: ``objects``, the number of
    queries, ``own`` and ``foreign``, and the shares of them that are ``answered`` and
    ``answered_foreign``. Both databases may be in any CRS; `database` is the searched one.
    """
    spec = replace(evaluation.asked, number=min(evaluation.asked.number, len(foreign)))
    sample = draw_queries(database, spec, city=replace(foreign, crs=database.crs))
    outcomes = score_queries(database, make_locator(database, evaluation.method), sample)
    tables = evaluation.queries, scored_tables(database, sample, outcomes)[1]
    own, others = (
        (table["chance"] >= DEFAULT_RULE.threshold)
        .groupby(range_labels(table["query_length"].to_numpy(), LENGTHS))
        .agg(["size", "mean"])
        .reindex(list(LENGTHS))
        for table in tables
    )
    return pd.DataFrame(
        {
            "objects": LENGTHS,
            "own": own["size"].fillna(0).astype(int).to_numpy(),
            "answered": own["mean"].to_numpy(),
            "foreign": others["size"].fillna(0).astype(int).to_numpy(),
            "answered_foreign": others["mean"].to_numpy(),
        }
    )


def scored_tables(
    database: SignatureDatabase,
    queries: Sequence[SimulatedQuery],
    outcomes: Mapping[int, Sequence[Mapping[str, Any]]],
) -> dict[int, pd.DataFrame]:
    """Return a table of the queries and their outcomes for each number of best candidates.

    One row for each query: the columns of `Evaluation.queries`, with ``x`` and ``y`` in place of
    ``geometry``, and ``seconds``, which is NaN for an empty query.
    """
    query_table = _query_table(database, queries)
    scored = {}
    for top, rows in outcomes.items():
        table = pd.DataFrame(list(rows), columns=OUTCOME_COLUMNS)
        table["best_cell_id"] = table["best_cell_id"].astype("Int64")
        scored[top] = pd.concat([query_table, table], axis=1)
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
    """Build an `Evaluation` from one table of scored queries, as `scored_tables` returns it."""
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
    """Return the versions of the software that affects the figures and their speed."""
    packages = {name: metadata.version(name) for name in ("numpy", "pandas", "rapidfuzz")}
    return {"semsig_gis": __version__, "python": platform.python_version(), **packages}


class _QueryScores:
    """The best cells of a query and their errors, with all cells that tie with the last of them."""

    def __init__(
        self, database: SignatureDatabase, query: SimulatedQuery, ranking: Ranking, count: int
    ) -> None:
        self.database, self.query, self.ranking = database, query, ranking
        self.cells = best_cells(ranking.scores, min(count, len(database)))
        places = database.xy.take(self.cells, axis=0)
        self.scores = ranking.scores[self.cells]
        if ranking.place is not None:
            places[self.scores.argmin()] = ranking.place
        places -= query.xy
        # Rounded, so that a cell exactly 50 m away counts as within 50 m.
        self.errors = np.round(np.sqrt((places**2).sum(axis=1)), 6)
        self.better = self.tied = np.empty(0)

    def shared(self) -> dict[str, Any]:
        """Return the columns that do not depend on the number of candidates."""
        query, ranking = self.query, self.ranking
        cells = len(ranking.scores)
        low, high = rank_range(ranking.scores, query.cell) if query.cell >= 0 else (cells, cells)
        heading_error, right = math.nan, math.nan
        if ranking.heading is not None:
            heading_error = float(angular_distance(ranking.heading, query.asked.heading))
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
            "heading_error": heading_error,
            "seconds": ranking.seconds,
            **self._best(),
            **near,
            "right": right,
        }

    def outcome(self, top: int) -> dict[str, Any]:
        """Return the expected smallest error of `top` candidates, and its chances within limits."""
        expected, within = expected_best(**self._cut(top))
        chances = {f"p{t}": float(p) for t, p in zip(THRESHOLDS, within, strict=True)}
        return {"error_m": expected, **chances}

    def _best(self) -> dict[str, Any]:
        """Return the columns of the best candidate, drawn from the tied ones, and of the next."""
        best = self.cells[self.scores == self.scores.min()]
        chosen_cell = best[int(self.query.pick * len(best))]
        # The next cells by score; tied cells follow in the order of the cells.
        count = min(NEXT_CELLS + 1, len(self.scores))
        better, tied = top_candidates(self.scores, count)
        better = better[np.argsort(self.scores[better], kind="stable")]
        others = self.cells[np.concatenate([better, tied[: count - len(better)]])]
        others = others[others != chosen_cell][:NEXT_CELLS]
        database, place = self.database, self.ranking.place
        x, y = database.xy[chosen_cell].tolist() if place is None else place
        listed = np.append(chosen_cell, others)
        best_id, *next_ids = cell_ids(database.columns[listed], database.rows[listed]).tolist()
        return {
            "best_cell_id": best_id,
            "best_x": x,
            "best_y": y,
            "tied": len(best),
            "next_cell_ids": ",".join(map(str, next_ids)),
        }

    def _in_region(self) -> float:
        """Return the probability that the true cell is in the region of 90 %.

        The last cell of the region may tie with cells outside it: any of them may be the last one.
        """
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
        """Return the errors of the cells surely among the `count` best, and of the tied cells.

        ``slots`` is how many of the tied cells are among the best, too.
        """
        count = min(count, len(self.scores))
        slots = count - len(self.better)
        if not 0 < slots <= len(self.tied):  # otherwise the same cells tie as for the last count
            better, tied = top_candidates(self.scores, count)
            self.better, self.tied = self.errors[better], self.errors[tied]
            slots = count - len(better)
        return {"better": self.better, "tied": self.tied, "slots": slots}


def _unlocalized(cells: int) -> dict[str, Any]:
    """Return the outcome columns of an empty query, which cannot be located."""
    missing = ("chance", "right", "in_region", "heading_error", "seconds", "best_x", "best_y")
    return {
        "best_cell_id": None,
        "next_cell_ids": "",
        "tied": 0,
        **dict.fromkeys(("distance", "error_m"), math.inf),
        **{f"p{t}": 0.0 for t in THRESHOLDS},
        **{f"near{count}": 0.0 for count in NEAR_PLACES},
        **dict.fromkeys(("rank_low", "rank_high"), cells),
        **dict.fromkeys(missing, math.nan),
    }


def _query_table(database: SignatureDatabase, queries: Sequence[SimulatedQuery]) -> pd.DataFrame:
    """Return one row for each query: the query and its true place."""
    sights = [query.asked for query in queries]
    cells = np.array([query.cell for query in queries], np.int64)
    in_database = cells >= 0
    places = np.array([query.xy for query in queries], np.float64).reshape(-1, 2)
    return pd.DataFrame(
        {
            "seed": np.array([query.seed for query in queries], np.int64),
            "number": np.array([query.number for query in queries], np.int64),
            "cell": cells,
            "cell_id": cell_ids(*database.grid.cells_at(places)),
            "types": [database.types(cell) if cell >= 0 else "" for cell in cells.tolist()],
            "length": np.array([query.length for query in queries], np.int64),
            "type_group": np.where(in_database, database.type_group_sizes[cells], 0),
            "angle_group": np.where(in_database, database.angle_group_sizes[cells], 0),
            "query_types": [database.taxonomy.decode(sight.codes) for sight in sights],
            "query_bearings": [_bearing_text(sight.bearings) for sight in sights],
            "query_ranges": [
                "" if sight.ranges is None else ",".join(f"{value:.1f}" for value in sight.ranges)
                for sight in sights
            ],
            "query_sectors": [_sector_text(sight.photo) for sight in sights],
            "query_length": np.array([len(sight) for sight in sights], np.int64),
            "heading": np.array([sight.heading for sight in sights], np.float64),
            "x": places[:, 0],
            "y": places[:, 1],
        }
    )


def _bearing_text(bearings: NDArray[np.float64]) -> str:
    """Return bearings as text for the command line, to a tenth of a degree."""
    tenths = np.floor(bearings * 10.0) / 10.0  # down, so that none becomes 360
    return ",".join(f"{value:.1f}" for value in tenths)


def _sector_text(photo: Photo) -> str:
    """Return the observed sectors as text, empty for the full turn."""
    ends = [wrap_degrees(np.array(sector)) for sector in photo.sectors]
    return ",".join(_bearing_text(pair).replace(",", "-") for pair in ends)


def _database_summary(database: SignatureDatabase, file_bytes: int | None) -> dict[str, Any]:
    """Return the properties of a database that an evaluation stores, as plain values."""
    area_km2 = len(database) * database.grid.step**2 / 1e6
    return {
        "cells": len(database),
        "mean_length": float(database.lengths.mean()),
        "step_m": float(database.grid.step),
        "origin": [float(value) for value in database.grid.origin],
        "radius_m": float(database.spec.radius),
        "levels": int(database.spec.levels),
        "crs": database.crs.to_string(),
        "version": database.version,
        "mb_per_km2": None if file_bytes is None else file_bytes / 1e6 / area_km2,
    }
