"""Result of an evaluation: its queries, their outcomes and the figures computed from them."""

from __future__ import annotations

import functools
import math
import os
import platform
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NotRequired

import numpy as np
from typing_extensions import TypedDict

from semsig_gis.core import Displayed, InputError, map_with, percent, plot_with
from semsig_gis.database import rows_of_result, whole_database
from semsig_gis.evaluation.figures import (
    AMBIGUITIES,
    ELSEWHERE,
    LENGTHS,
    RECALLS,
    CalibrationRecord,
    CoverageRecord,
    MeanRecord,
    calibration_bins,
    coverage_curve,
    district_labels,
    figure_means,
    finite_or_none,
    grouped_means,
    percentile,
    plain_records,
    query_figures,
    range_labels,
)
from semsig_gis.evaluation.queries.distortion_text import chain_text
from semsig_gis.localization import NEAR_PLACES, THRESHOLDS, expected_recall

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import geopandas as gpd
    import pandas as pd
    from numpy.typing import NDArray

    from semsig_gis.core import Axes, MapFrame
    from semsig_gis.database import City, SignatureDatabase
    from semsig_gis.evaluation.queries.draw import QuerySpec
    from semsig_gis.localization import AnyMethod

QUERY_COLUMNS = (
    *("seed", "number", "cell", "cell_id", "types", "length", "type_group", "angle_group"),
    *("query_types", "query_bearings", "query_ranges", "query_sectors", "query_length", "heading"),
    *("best_cell_id", "best_x", "best_y", "distance", "tied", "next_cell_ids", "error_m"),
    *(f"p{threshold}" for threshold in THRESHOLDS),
    *(f"near{count}" for count in NEAR_PLACES),
    *("rank_low", "rank_high", "chance", "right", "in_region", "heading_error"),
)
"""Columns of the table of queries, in their order; ``geometry`` comes last."""

PlotKind = Literal["errors", "recall", "map"]
"""Kinds of plots of an evaluation."""


def machine() -> dict[str, Any]:
    """Return the properties of this machine that affect its speed; ``memory_gb`` may be None."""
    pages = "SC_PHYS_PAGES" in getattr(os, "sysconf_names", ())
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9 if pages else None
    return {
        "system": platform.platform(),
        "processor": platform.processor() or platform.machine(),
        "processors": os.cpu_count() or 1,
        "memory_gb": None if memory is None else round(memory, 1),
    }


class SettingsRecord(TypedDict):
    """The settings of an evaluation as plain values."""

    method: str
    distortions: list[str]
    seen_from: str
    city: str | None
    top: int
    seeds: list[int]
    queries: int


class SharesRecord(TypedDict):
    """The shares of `Evaluation.answers`."""

    coverage: NotRequired[float | None]
    precision: NotRequired[float | None]
    in_region: NotRequired[float | None]


class FiguresRecord(SharesRecord):
    """The figures of an evaluation as plain values; groups have a column for each figure."""

    p_error_within_m: dict[str, float]
    recall_at_percent: dict[str, float]
    recall_of_best_within_25_m: dict[str, float]
    median_error_m: float | None
    p90_error_m: float | None
    median_heading_error: float | None
    successful: float
    unlocalized: int
    intervals: list[MeanRecord]
    by_length: list[dict[str, str | float | None]]
    by_ambiguity: list[dict[str, str | float | None]]
    coverage_curve: list[CoverageRecord]
    calibration: list[CalibrationRecord]


class TimingRecord(TypedDict):
    """The time of a query, and the properties of the machine."""

    seconds_per_query: float | None
    machine: dict[str, Any]


class EvaluationRecord(TypedDict):
    """An evaluation as plain values; `foreign` is the result for views of another city."""

    settings: SettingsRecord
    database: dict[str, Any]
    results: FiguresRecord
    versions: dict[str, str]
    timing: TimingRecord
    foreign: NotRequired[list[dict[str, Any]]]


ExperimentRecord = dict[str, EvaluationRecord]
"""The evaluations of an experiment by case."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Evaluation(Displayed):
    """Queries, their outcomes and the settings to repeat the evaluation.

    Parameters
    ----------
    queries : GeoDataFrame
        One row for each query, in the database's CRS; `geometry` is the true place.

        - ``seed``, ``number``: its seed, and its number from 0;
        - ``cell``, ``cell_id``: row number in the database (-1 if it has no such cell) and id of
          the cell of that place;
        - ``types``, ``length``: symbols of this cell in the database, and number of objects that
          are visible from the true place;
        - ``type_group``, ``angle_group``: number of cells with its type and with its angle
          sequence, 0 if the database has no such cell;
        - ``query_types``, ``query_bearings``, ``query_length``: symbols, degrees (text,
          comma-separated) and number of objects of the query (0: the query is *unlocalized*);
          ``heading``: degrees to add to the bearings to get bearings from true north;
        - ``query_ranges``, ``query_sectors``: rough distances in metres, and the sectors that are
          stated as observed, such as ``340.0-50.0`` (text, comma-separated, else empty);
        - ``best_cell_id``, ``best_x``, ``best_y``, ``distance``: the best candidate, drawn from the
          tied, and its distance or negative log-likelihood; missing when unlocalized;
        - ``tied``: cells that share the best score, 0 when unlocalized; ``next_cell_ids``: the
          four best of the other cells (text, comma-separated), tied ones in the order of the cells;
        - ``error_m``: expected smallest error among the top t in metres, infinite when
          unlocalized; ``p0``, ``p5``, ...: probability that it is at most 0 m, 5 m, ...;
        - ``near1``, ``near5``, ...: probability that one of the N best cells (the answer first)
          is at most 25 m away;
        - ``rank_low``, ``rank_high``: first and last rank that ties allow for the true cell, from
          1; both the number of cells when unlocalized or when the database has no such cell;
        - ``chance``: probability that the likelihood method states for its answer to be within
          50 m; ``right``: probability that it is; ``in_region``: probability that its region of
          90 % contains the true cell. Missing for other methods and when unlocalized;
        - ``heading_error``: error of the estimated heading in degrees, if it was estimated.
    method : Method or LikelihoodMethod
        The method that ranked the cells.
    asked : QuerySpec
        Number, seeds, places and distortions of the queries.
    city : str, optional
        The observed city, if it is not the searched one.
    top : int
        Number of best candidates that count (t).
    seconds_per_query : float
        Mean time of an answer, without distortion and statistics; NaN if it was not stored.
    database : mapping
        Properties of the searched database: ``cells``, ``mean_length``, ``step_m``, ``origin``,
        ``radius_m``, ``levels``, ``crs``, ``version``, ``mb_per_km2`` (or None).
    versions : mapping
        Versions of the software by name.
    machine : mapping
        The computer: ``system``, ``processor``, ``processors`` and ``memory_gb`` (or None).

    Examples
    --------
    >>> from semsig_gis import evaluate
    >>> evaluation = evaluate(demo_database, queries=20, distortion="light")
    >>> bool(evaluation.cdf([50])[0] <= evaluation.cdf([100])[0])
    True
    """

    # A query is successful if its error is at most this distance with at least this probability.
    success_metres: ClassVar[int] = 50
    success_probability: ClassVar[float] = 0.5

    queries: gpd.GeoDataFrame
    method: AnyMethod
    asked: QuerySpec
    top: int
    seconds_per_query: float
    database: Mapping[str, Any]
    versions: Mapping[str, str]
    city: str | None = None
    machine: Mapping[str, Any] = field(default_factory=machine)

    def _facts(self) -> dict[str, object]:
        means = self.means()
        near = means.loc[[f"p{self.success_metres}"], ["value", "low", "high"]].to_numpy()[0]
        share, low, high = (percent(value, 1) for value in near.tolist())
        return {
            "queries": len(self.queries),
            "cells": self.database["cells"],
            "method": self.method,
            "distortion": chain_text(self.asked.distortions) or "none",
            "best of": self.top,
            f"within {self.success_metres} m": f"{share} ({low} to {high})",
            "recall@10 %": percent(means["value"]["recall10"], 1),
            "CRS": self.database["crs"],
        }

    @functools.cached_property
    def figures(self) -> pd.DataFrame:
        """Value of each query in each figure (see `evaluation.figures.query_figures`)."""
        return query_figures(self.queries, cells=self.database["cells"])

    def plot(
        self, kind: PlotKind = "errors", *, ax: Axes | None = None, label: str | None = None
    ) -> Axes:
        """Draw the curve of errors or of recall, or a map of failures (`plot_evaluation`)."""
        return plot_with("plot_evaluation", self, kind, ax=ax, label=label)

    def explore(self, database: SignatureDatabase | City) -> MapFrame:
        """Show the queries on a map in a notebook (see `evaluation_map`)."""
        return map_with("evaluation_map", self, whole_database(database))

    @property
    def query_bearings(self) -> list[list[float]]:
        """Bearings of each query in degrees."""
        texts = self.queries["query_bearings"]
        return [[float(bearing) for bearing in text.split(",") if bearing] for text in texts]

    @property
    def next_cell_ids(self) -> list[list[int]]:
        """Ids of the next best cells of each query, without the best candidate."""
        texts = self.queries["next_cell_ids"]
        return [[int(cell_id) for cell_id in text.split(",") if cell_id] for text in texts]

    @property
    def successful(self) -> NDArray[np.bool_]:
        """Whether each query has an error of at most 50 m with probability 0.5 or more."""
        within = self.queries[f"p{self.success_metres}"].to_numpy(dtype=np.float64)
        return np.asarray(within >= self.success_probability)

    @property
    def unlocalized(self) -> int:
        """Number of queries without objects after the distortion."""
        return int((self.queries["query_length"] == 0).sum())

    def rows_in(self, database: SignatureDatabase) -> NDArray[np.int64]:
        """Return the row of each query's true cell in the searched database, or -1.

        Raises InputError if `database` is not the searched one.
        """
        if len(database) != self.database["cells"]:
            raise InputError(
                f"This evaluation searched {self.database['cells']:,} cells, but the database has "
                f"{len(database):,}; give the database that it was made with, or evaluate again."
            )
        inside = self.queries["cell"].to_numpy() >= 0
        rows = np.full(len(inside), -1)
        rows[inside] = rows_of_result(
            database,
            self.queries["cell_id"][inside],
            self.queries["types"][inside],
            what="evaluation",
        )
        return rows

    def cdf(self, thresholds: Sequence[float] = THRESHOLDS) -> NDArray[np.float64]:
        """Return the share of queries with an error of at most each threshold, in metres.

        It is the mean probability over the queries. Raises InputError for a threshold that is not
        one of `THRESHOLDS`.
        """
        for value in thresholds:
            if value not in THRESHOLDS:
                stored = ", ".join(map(str, THRESHOLDS))
                raise InputError(
                    f"No probability is stored for an error of {value} m; choose from {stored} m."
                )
        columns = [f"p{int(value)}" for value in thresholds]
        return np.asarray(self.queries[columns].to_numpy(dtype=np.float64).mean(axis=0))

    def recall(self, percent: float) -> float:
        """Return the share of queries with the true cell in the top `percent` of the cells.

        The number of these cells is rounded down; all orders of tied cells are equally likely.
        Raises InputError unless 0 < percent <= 100.
        """
        ranks = self.queries["rank_low"], self.queries["rank_high"]
        chances = expected_recall(*ranks, cells=self.database["cells"], percent=percent)
        return float(chances.mean())

    def means(self) -> pd.DataFrame:
        """Return ``value``, ``low`` and ``high`` (95 %) and ``n`` of each of the `figures`."""
        return figure_means(self.figures)

    def by_length(self) -> pd.DataFrame:
        """Return the figures by the number of objects visible from the true place.

        One row for each range: ``length`` (text), ``n``, the figures (or NaN), ``p50_low`` and
        ``p50_high``.
        """
        return self._by_range("length", LENGTHS, label="length")

    def by_ambiguity(self) -> pd.DataFrame:
        """Return the figures by the number of cells with the types of the true one, as `by_length`.

        If some true cells are not in the database, there is a first row with ``cells_alike`` "0".
        """
        return self._by_range("type_group", AMBIGUITIES, label="cells_alike")

    def _by_range(self, column: str, ranges: Sequence[str], *, label: str) -> pd.DataFrame:
        labels = range_labels(self.queries[column].to_numpy(), ranges)
        order = [*(["0"] if "0" in labels else []), *ranges]
        return grouped_means(self.figures, labels, by=label, order=order)

    def by_district(self, districts: gpd.GeoDataFrame, name: str) -> pd.DataFrame:
        """Return the figures, as `by_length`, by the ``district`` of the true place.

        Districts are polygons in any CRS with names in the column `name`. Districts without queries
        are omitted, and places outside all districts are ``elsewhere``. Raises InputError if there
        is no such column.
        """
        labels = district_labels(self.queries, districts, name)
        order = [*dict.fromkeys(districts[name].astype(str)), ELSEWHERE]
        order = [district for district in order if district in labels]
        return grouped_means(self.figures, labels, by="district", order=order)

    def answers(self) -> dict[str, float]:
        """Return shares of the answers of the likelihood method; empty for other methods.

        ``coverage`` is the share of queries that `likelihood.answer_rule.DEFAULT_RULE` answers,
        ``precision`` the share of right answers, ``in_region`` the share of regions of 90 % that
        contain the true cell; NaN if there are no such queries.
        """
        if self.method.noise is None:
            return {}
        means = self.means()["value"]
        return {
            name: float(means.get(name, math.nan))
            for name in ("coverage", "precision", "in_region")
        }

    def coverage_curve(self) -> pd.DataFrame:
        """Return answers and right answers by threshold (`evaluation.figures.coverage_curve`)."""
        return coverage_curve(self.queries)

    def calibration(self) -> pd.DataFrame:
        """Return stated probabilities and right answers (`evaluation.figures.calibration_bins`)."""
        return calibration_bins(self.queries)

    def summary(self) -> EvaluationRecord:
        """Return ``settings``, ``database``, ``results``, ``versions`` and ``timing`` for JSON.

        All but ``timing`` are the same if the evaluation is repeated. Infinity and NaN are None.
        """
        errors = self.queries["error_m"].to_numpy(dtype=np.float64)
        turns = self.queries["heading_error"].to_numpy(dtype=np.float64)
        by_chance = self.method.noise is not None
        answers: Any = {name: finite_or_none(value) for name, value in self.answers().items()}
        shares: SharesRecord = answers
        return {
            "settings": {
                "method": str(self.method),
                "distortions": [chain_text([item]) for item in self.asked.distortions],
                "seen_from": self.asked.seen_from,
                "city": self.city,
                "top": self.top,
                "seeds": list(self.asked.seeds),
                "queries": len(self.queries),
            },
            "database": dict(self.database),
            "results": {
                "p_error_within_m": {
                    str(x): float(value) for x, value in zip(THRESHOLDS, self.cdf(), strict=True)
                },
                "recall_at_percent": {str(k): self.recall(k) for k in RECALLS},
                "recall_of_best_within_25_m": {
                    str(count): float(self.queries[f"near{count}"].mean()) for count in NEAR_PLACES
                },
                "median_error_m": finite_or_none(percentile(errors, 50)[0]),
                "p90_error_m": finite_or_none(percentile(errors, 90)[0]),
                "median_heading_error": finite_or_none(percentile(turns, 50)[0]),
                "successful": float(self.successful.mean()),
                "unlocalized": self.unlocalized,
                **shares,
                "intervals": plain_records(self.means().reset_index()),
                "by_length": plain_records(self.by_length()),
                "by_ambiguity": plain_records(self.by_ambiguity()),
                "coverage_curve": plain_records(self.coverage_curve()) if by_chance else [],
                "calibration": plain_records(self.calibration()) if by_chance else [],
            },
            "versions": dict(self.versions),
            "timing": {
                "seconds_per_query": finite_or_none(self.seconds_per_query),
                "machine": dict(self.machine),
            },
        }
