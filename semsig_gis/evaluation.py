"""Measure localization: distort known signatures, rank the cells, score errors and ranks.

Equal scores are common (a street with three lamps looks like thousands of others), so every
figure is an expectation over all orders of the tied cells, worked out exactly, never the luck of
an array order.
"""

from __future__ import annotations

import dataclasses
import json
import math
import platform
import time
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
import pyarrow as pa

from semsig_gis import __version__
from semsig_gis.distortion import Distortion, distort, named_distortion
from semsig_gis.errors import DatabaseError, InputError
from semsig_gis.grid import cell_ids
from semsig_gis.matching import DEFAULT_METHOD, Method, score_cells
from semsig_gis.metrics import EditWeights
from semsig_gis.scoring import (
    THRESHOLDS,
    expected_best,
    expected_recall,
    rank_range,
    top_candidates,
)
from semsig_gis.storage import geo_metadata, read_geoparquet, whole_file, write_geoparquet

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.signatures import Signature

__all__ = ["Evaluation", "evaluate"]

SUCCESS_METRES = 50
SUCCESS_PROBABILITY = 0.5

_HEADLINE = (10, 25, 50, 100)
_RECALLS = (1, 10)
_LENGTHS = ((1, 4), (5, 9), (10, 19), (20, None))
_KIND = "localization evaluation"
_COLUMNS = (
    *("cell", "cell_id", "types", "length", "type_group", "angle_group"),
    *("query_types", "query_bearings", "query_length"),
    *("best_cell_id", "best_x", "best_y", "distance", "tied", "error_m"),
    *(f"p{threshold}" for threshold in THRESHOLDS),
    *("rank_low", "rank_high", "geometry"),
)
_QUERIES_FILE = "queries.parquet"
_SUMMARY_FILE = "evaluation.json"


@dataclass(frozen=True, eq=False, kw_only=True)
class Evaluation:
    """The outcome of many queries and all that is needed to repeat or redraw it.

    Parameters
    ----------
    queries : GeoDataFrame
        One row a query, in the database's CRS; `geometry` is the true viewpoint.

        - ``cell``, ``cell_id``: row number in the database and id of the true cell;
        - ``types``, ``length``: its symbols and how many there are;
        - ``type_group``, ``angle_group``: cells with its type and with its angle sequence;
        - ``query_types``, ``query_bearings``, ``query_length``: what was asked: symbols, degrees
          (text, comma-separated) and how many there are;
        - ``best_cell_id``, ``best_x``, ``best_y``, ``distance``: a best candidate and its score;
          one drawn from the tied when there are several; missing (score infinite) when
          unlocalized;
        - ``tied``: cells that share the best score, 0 when unlocalized;
        - ``error_m``: expected smallest error among the top t in metres, infinite when
          unlocalized;
        - ``p0``, ``p5``, ... (`THRESHOLDS`): probability that this error is at most so many
          metres;
        - ``rank_low``, ``rank_high``: first and last rank that ties allow for the true cell, from
          1; both the number of cells when unlocalized.
    method : Method
        What ranked the cells.
    distortion : Distortion
        What was done to the queries.
    top : int
        How many best candidates count (t).
    seed : int
        Seed of the sample and of all chances.
    seconds_per_query : float
        Mean time of scoring all cells, without distortion and statistics.
    database : mapping
        What was searched, as plain values: ``cells``, ``mean_length``, ``step_m``, ``origin``,
        ``radius_m``, ``levels``, ``crs``, ``version``.
    versions : mapping
        Versions of the software by name.

    Notes
    -----
    A query is unlocalized when the distortion left nothing of it.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> evaluation = evaluate(build_database(objects), queries=20, distortion="light")
    >>> bool(evaluation.cdf([50])[0] <= evaluation.cdf([100])[0])
    True
    """

    queries: gpd.GeoDataFrame
    method: Method
    distortion: Distortion
    top: int
    seed: int
    seconds_per_query: float
    database: Mapping[str, Any]
    versions: Mapping[str, str]

    @property
    def successful(self) -> NDArray[np.bool_]:
        """Whether each query has an error of at most 50 m with probability 0.5 or more."""
        within = self.queries[f"p{SUCCESS_METRES}"].to_numpy(dtype=np.float64)
        return np.asarray(within >= SUCCESS_PROBABILITY)

    @property
    def unlocalized(self) -> int:
        """Number of queries of which the distortion left nothing."""
        return int((self.queries["query_length"] == 0).sum())

    def cdf(self, thresholds: Sequence[float] = THRESHOLDS) -> NDArray[np.float64]:
        """Return the share of queries whose error is at most so many metres.

        Parameters
        ----------
        thresholds : sequence of float, optional
            Errors in metres, each one of `THRESHOLDS`.

        Returns
        -------
        ndarray of float64
            Mean probability over the queries, one value a threshold.

        Raises
        ------
        InputError
            If a threshold is not one of those kept.
        """
        for value in thresholds:
            if value not in THRESHOLDS:
                kept = ", ".join(str(one) for one in THRESHOLDS)
                msg = f"No probability is kept for an error of {value} m; give some of {kept} m."
                raise InputError(msg)
        columns = [f"p{int(value)}" for value in thresholds]
        return np.asarray(self.queries[columns].to_numpy(dtype=np.float64).mean(axis=0))

    def recall(self, percent: float) -> float:
        """Return the share of queries whose true cell ranks in the top so many per cent of cells.

        Parameters
        ----------
        percent : float
            Share of the cells kept, above 0 and at most 100. The number kept is rounded down.

        Returns
        -------
        float
            The recall in [0, 1]; the true cell's rank is uniform among the cells it ties with.

        Raises
        ------
        InputError
            If the percentage is out of range.
        """
        return float(self._recalls(percent).mean())

    def by_length(self) -> pd.DataFrame:
        """Return the figures by the length of the true signature.

        Returns
        -------
        DataFrame
            One row a range of lengths: ``length`` (text), ``n``, ``p10``, ``p25``, ``p50``,
            ``p100``, ``recall1``, ``recall10``. The figures are NaN where ``n`` is 0.
        """
        lengths = self.queries["length"].to_numpy()
        figures = {f"p{x}": self.queries[f"p{x}"].to_numpy() for x in _HEADLINE}
        figures |= {f"recall{k}": self._recalls(k) for k in _RECALLS}
        rows: list[dict[str, Any]] = []
        for low, high in _LENGTHS:
            chosen = (lengths >= low) & (lengths <= (math.inf if high is None else high))
            row: dict[str, Any] = {
                "length": f"{low}+" if high is None else f"{low}-{high}",
                "n": int(chosen.sum()),
            }
            for name, values in figures.items():
                row[name] = float(values[chosen].mean()) if chosen.any() else math.nan
            rows.append(row)
        return pd.DataFrame(rows)

    def summary(self) -> dict[str, Any]:
        """Return settings, figures and versions as plain values for JSON.

        Returns
        -------
        dict
            ``settings``, ``database``, ``results`` and ``versions``. No value is infinite or
            NaN: ``median_error_m`` is None when half of the queries or more are unlocalized, and
            so are the figures of a range of lengths without queries.
        """
        median = float(np.median(self.queries["error_m"].to_numpy(dtype=np.float64)))
        by_length = [
            {key: None if value != value else value for key, value in row.items()}  # noqa: PLR0124
            for row in self.by_length().to_dict("records")
        ]
        return {
            "settings": {
                "method": str(self.method),
                "distortion": dataclasses.asdict(self.distortion),
                "top": self.top,
                "seed": self.seed,
                "queries": len(self.queries),
            },
            "database": dict(self.database),
            "results": {
                "p_error_within_m": {
                    str(x): float(value) for x, value in zip(THRESHOLDS, self.cdf(), strict=True)
                },
                "recall_at_percent": {str(k): self.recall(k) for k in _RECALLS},
                "median_error_m": median if math.isfinite(median) else None,
                "successful": float(self.successful.mean()),
                "unlocalized": self.unlocalized,
                "seconds_per_query": self.seconds_per_query,
                "by_length": by_length,
            },
            "versions": dict(self.versions),
        }

    def save(self, folder: str | Path) -> None:
        """Write the evaluation to a folder.

        Parameters
        ----------
        folder : str or Path
            Folder to write to, made when missing. It gets ``queries.parquet`` (GeoParquet, with
            the settings in its metadata, so that it is enough to load and redraw everything) and
            ``evaluation.json`` (`summary`, for reading).

        Raises
        ------
        InputError
            If the folder cannot be written to.
        """
        plain = pd.DataFrame(self.queries.drop(columns="geometry"))
        table = pa.Table.from_pandas(plain, preserve_index=False)
        points = self.queries.geometry
        table = table.append_column("geometry", pa.array(points.to_wkb()))
        specs = {
            "kind": _KIND,
            "method": dataclasses.asdict(self.method),
            "distortion": dataclasses.asdict(self.distortion),
            "top": self.top,
            "seed": self.seed,
            "seconds_per_query": self.seconds_per_query,
            "database": dict(self.database),
            "versions": dict(self.versions),
        }
        geo = geo_metadata(points.crs, geometry_types=["Point"], bounds=points.total_bounds)
        write_geoparquet(table, Path(folder) / _QUERIES_FILE, geo=geo, specs=specs)
        with whole_file(Path(folder) / _SUMMARY_FILE) as partial:
            text = json.dumps(self.summary(), indent=2, allow_nan=False, ensure_ascii=False)
            partial.write_text(text + "\n", encoding="utf-8")

    @classmethod
    def load(cls, folder: str | Path) -> Evaluation:
        """Read an evaluation that `save` wrote.

        Parameters
        ----------
        folder : str or Path
            Folder with ``queries.parquet``.

        Returns
        -------
        Evaluation
            The same evaluation.

        Raises
        ------
        DatabaseError
            If the file is missing, damaged or of another kind.
        """
        file = Path(folder) / _QUERIES_FILE
        table, specs, crs = read_geoparquet(file, kind=_KIND, columns=list(_COLUMNS))
        try:
            frame = table.to_pandas()
            points = gpd.GeoSeries.from_wkb(frame.pop("geometry"), crs=crs)
            frame["best_cell_id"] = frame["best_cell_id"].astype("Int64")
            weights = EditWeights(**specs["method"].pop("weights"))
            return cls(
                queries=gpd.GeoDataFrame(frame, geometry=points),
                method=Method(weights=weights, **specs["method"]),
                distortion=Distortion(**specs["distortion"]),
                top=specs["top"],
                seed=specs["seed"],
                seconds_per_query=specs["seconds_per_query"],
                database=specs["database"],
                versions=specs["versions"],
            )
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            msg = f"{file} is damaged ({error}); evaluate again."
            raise DatabaseError(msg) from error

    def _recalls(self, percent: float) -> NDArray[np.float64]:
        """Return the chance of each query that its true cell is in the top `percent`."""
        ranks = self.queries["rank_low"], self.queries["rank_high"]
        return expected_recall(*ranks, cells=self.database["cells"], percent=percent)


def evaluate(
    database: SignatureDatabase,
    *,
    queries: int = 500,
    method: Method = DEFAULT_METHOD,
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
    method : Method, optional
        What ranks the cells; metric fusion of two edit distances unless given.
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
        If a number is out of range.
    UnknownNameError
        If there is no distortion of that name.

    Notes
    -----
    Paper, section 4.2: the error is the distance from the true viewpoint to the nearest of the
    best t candidates; the recall looks at the rank of the true cell among all cells. False
    objects have the classes that occur in the database.

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
    # A prefix of one permutation: more queries keep the first ones.
    cells = np.random.default_rng(np.random.SeedSequence(seed)).permutation(n)[:queries]
    asked, picks = _distorted(database, cells, chosen_distortion, seed)
    answers = _timed_scores(database, [one for one in asked if len(one)], method)
    outcomes: list[dict[str, Any]] = []
    seconds = 0.0
    for number, (cell, query, pick) in enumerate(zip(cells.tolist(), asked, picks, strict=True)):
        if len(query):
            scores, spent = next(answers)
            seconds += spent
            outcomes.append(_outcome(database, scores, cell=cell, top=top, pick=pick))
        else:
            outcomes.append(_unlocalized(n))
        if progress is not None:
            progress(number + 1, queries)
    localized = sum(len(one) > 0 for one in asked)
    return Evaluation(
        queries=_query_table(database, cells, asked, outcomes),
        method=method,
        distortion=chosen_distortion,
        top=top,
        seed=seed,
        seconds_per_query=seconds / localized if localized else 0.0,
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


def _timed_scores(
    database: SignatureDatabase, queries: Sequence[Signature], method: Method
) -> Iterator[tuple[NDArray[np.float32], float]]:
    """Yield the scores of all cells for each query, and the seconds they took."""
    if not queries:
        return
    # What the database works out once and keeps is no part of the time of a query.
    next(iter(score_cells(database, queries[:1], method)))
    rows = iter(score_cells(database, queries, method))
    for _ in queries:
        start = time.perf_counter()
        scores = next(rows)
        yield scores, time.perf_counter() - start


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
