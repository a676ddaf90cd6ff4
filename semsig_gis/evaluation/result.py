"""The outcome of an evaluation: its queries, how they were answered, and the figures of them."""

from __future__ import annotations

import functools
import math
import os
import platform
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from semsig_gis.core import Displayed, InputError, map_with, percent, plot_with
from semsig_gis.database import rows_of_result
from semsig_gis.evaluation.figures import (
    AMBIGUITIES,
    ELSEWHERE,
    LENGTHS,
    RECALLS,
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
    from semsig_gis.database import SignatureDatabase
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
"""What can be drawn of an evaluation."""


def machine() -> dict[str, Any]:
    """Return what decides how long things take here; ``memory_gb`` may be None."""
    pages = "SC_PHYS_PAGES" in getattr(os, "sysconf_names", ())
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9 if pages else None
    return {
        "system": platform.platform(),
        "processor": platform.processor() or platform.machine(),
        "processors": os.cpu_count() or 1,
        "memory_gb": None if memory is None else round(memory, 1),
    }


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Evaluation(Displayed):
    """The outcome of many queries and all that is needed to repeat or redraw it.

    Parameters
    ----------
    queries : GeoDataFrame
        One row a query, in the database's CRS; `geometry` is the true place.

        - ``seed``, ``number``: its seed, and its number from 0;
        - ``cell``, ``cell_id``: row number in the database (-1 where it has no such cell) and id of
          the cell of that place;
        - ``types``, ``length``: symbols that the database says are seen there, and how many objects
          really are;
        - ``type_group``, ``angle_group``: cells with its type and with its angle sequence, 0
          where the database has no such cell;
        - ``query_types``, ``query_bearings``, ``query_length``: what was asked: symbols, degrees
          (text, comma-separated) and how many there are (none: the query is *unlocalized*);
          ``heading``: degrees to add to the bearings to have them from true north;
        - ``query_ranges``, ``query_sectors``: rough distances in metres, and the sectors that were
          stated to have been looked at, such as ``340.0-50.0`` (text, comma-separated, else empty);
        - ``best_cell_id``, ``best_x``, ``best_y``, ``distance``: the best candidate, drawn from the
          tied, and its distance or negative log-likelihood; missing when unlocalized;
        - ``tied``: cells that share the best score, 0 when unlocalized; ``next_cell_ids``: the
          four best of the other cells (text, comma-separated), equals in the order of the cells;
        - ``error_m``: expected smallest error among the top t in metres, infinite when
          unlocalized; ``p0``, ``p5``, ...: probability that it is at most so many metres;
        - ``near1``, ``near5``, ...: probability that one of the N best cells (the answer first)
          is at most 25 m away;
        - ``rank_low``, ``rank_high``: first and last rank that ties allow for the true cell, from
          1; both the number of cells when unlocalized or when the database has no such cell;
        - ``chance``: by the likelihood method's own account, that its answer is right, within
          50 m; ``right``: probability that it was; ``in_region``: probability that its region of
          90 % held the true cell. Missing for other methods and when unlocalized;
        - ``heading_error``: by how many degrees the heading was off, where it was looked for.
    method : Method or LikelihoodMethod
        What ranked the cells.
    asked : QuerySpec
        Which queries were asked, and what happened to them.
    city : str, optional
        The city that was looked at, if not the one that was searched.
    top : int
        How many best candidates count (t).
    seconds_per_query : float
        Mean time of an answer, without distortion and statistics; NaN where it is not known.
    database : mapping
        What was searched: ``cells``, ``mean_length``, ``step_m``, ``origin``, ``radius_m``,
        ``levels``, ``crs``, ``version``, ``mb_per_km2`` (or None).
    versions : mapping
        Versions of the software by name.
    machine : mapping
        What it ran on: ``system``, ``processor``, ``processors`` and ``memory_gb`` (or None).

    Examples
    --------
    >>> from semsig_gis import evaluate
    >>> evaluation = evaluate(demo_database, queries=20, distortion="light")
    >>> bool(evaluation.cdf([50])[0] <= evaluation.cdf([100])[0])
    True
    """

    # A query is successful where the answer is so near with such a chance.
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
        share, low, high = map(percent, near.tolist())
        return {
            "queries": len(self.queries),
            "cells": self.database["cells"],
            "method": self.method,
            "distortion": chain_text(self.asked.distortions) or "none",
            "best of": self.top,
            f"within {self.success_metres} m": f"{share} ({low} to {high})",
            "recall@10 %": percent(means["value"]["recall10"]),
            "CRS": self.database["crs"],
        }

    @functools.cached_property
    def figures(self) -> pd.DataFrame:
        """What each query adds to each figure (see `evaluation.figures.query_figures`)."""
        return query_figures(self.queries, cells=self.database["cells"])

    def plot(
        self, kind: PlotKind = "errors", *, ax: Axes | None = None, label: str | None = None
    ) -> Axes:
        """Draw the curve of errors or of recall, or where queries failed (`plot_evaluation`)."""
        return plot_with("plot_evaluation", self, kind, ax=ax, label=label)

    def explore(self, database: SignatureDatabase) -> MapFrame:
        """Show the queries on a map in a notebook (see `evaluation_map`)."""
        return map_with("evaluation_map", self, database)

    @property
    def query_bearings(self) -> list[list[float]]:
        """Bearings of what each query asked for, in degrees."""
        texts = self.queries["query_bearings"]
        return [[float(one) for one in text.split(",") if one] for text in texts]

    @property
    def next_cell_ids(self) -> list[list[int]]:
        """Ids of the best cells of each query after the answer."""
        texts = self.queries["next_cell_ids"]
        return [[int(one) for one in text.split(",") if one] for text in texts]

    @property
    def successful(self) -> NDArray[np.bool_]:
        """Whether each query has an error of at most 50 m with probability 0.5 or more."""
        within = self.queries[f"p{self.success_metres}"].to_numpy(dtype=np.float64)
        return np.asarray(within >= self.success_probability)

    @property
    def unlocalized(self) -> int:
        """Number of queries in which the distortion left no object."""
        return int((self.queries["query_length"] == 0).sum())

    def rows_in(self, database: SignatureDatabase) -> NDArray[np.int64]:
        """Return the row of each query's true cell in the database that was searched, or -1.

        Raises InputError if another database was searched.
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
        """Return the share of queries with an error of at most each of some `THRESHOLDS` in metres.

        It is the mean probability over the queries. Raises InputError for another threshold.
        """
        for value in thresholds:
            if value not in THRESHOLDS:
                kept = ", ".join(str(one) for one in THRESHOLDS)
                raise InputError(
                    f"No probability is stored for an error of {value} m; choose from {kept} m."
                )
        columns = [f"p{int(value)}" for value in thresholds]
        return np.asarray(self.queries[columns].to_numpy(dtype=np.float64).mean(axis=0))

    def recall(self, percent: float) -> float:
        """Return the share of queries whose true cell is in the top per cent of cells.

        Rounded down; of tied cells each rank is as likely. InputError unless 0 < percent <= 100.
        """
        ranks = self.queries["rank_low"], self.queries["rank_high"]
        chances = expected_recall(*ranks, cells=self.database["cells"], percent=percent)
        return float(chances.mean())

    def means(self) -> pd.DataFrame:
        """Return ``value``, ``low`` and ``high`` (95 %) and ``n`` of each of the `figures`."""
        return figure_means(self.figures)

    def by_length(self) -> pd.DataFrame:
        """Return the figures by how many objects are really seen.

        One row a range: ``length`` (text), ``n``, the figures (or NaN), ``p50_low``, ``p50_high``.
        """
        return self._by_range("length", LENGTHS, label="length")

    def by_ambiguity(self) -> pd.DataFrame:
        """Return the figures by how many cells have the types of the true one, as `by_length`.

        ``cells_alike`` is ``"0"`` in a first row where some true cells are not in the database.
        """
        return self._by_range("type_group", AMBIGUITIES, label="cells_alike")

    def _by_range(self, column: str, ranges: Sequence[str], *, label: str) -> pd.DataFrame:
        labels = range_labels(self.queries[column].to_numpy(), ranges)
        order = [*(["0"] if "0" in labels else []), *ranges]
        return grouped_means(self.figures, labels, by=label, order=order)

    def by_district(self, districts: gpd.GeoDataFrame, name: str) -> pd.DataFrame:
        """Return the figures, as `by_length`, by the ``district`` that was seen.

        Districts are polygons in any CRS, named by the column `name`; those without queries are
        left out, and places in none are ``elsewhere``. InputError if there is no such column.
        """
        labels = district_labels(self.queries, districts, name)
        order = [*dict.fromkeys(districts[name].astype(str)), ELSEWHERE]
        order = [district for district in order if district in labels]
        return grouped_means(self.figures, labels, by="district", order=order)

    def answers(self) -> dict[str, float]:
        """Return how the likelihood method answers and declines; nothing for other methods.

        ``coverage`` is the share of queries that `likelihood.posterior.DEFAULT_RULE` answers,
        ``precision`` the share of answers that are right, ``in_region`` the share of regions of
        90 % that contain the true cell; NaN if there is no such query.
        """
        if self.method.noise is None:
            return {}
        means = self.means()["value"]
        return {
            name: float(means.get(name, math.nan))
            for name in ("coverage", "precision", "in_region")
        }

    def coverage_curve(self) -> pd.DataFrame:
        """Return `evaluation.figures.coverage_curve`: answers, and right ones, rule by rule."""
        return coverage_curve(self.queries)

    def calibration(self) -> pd.DataFrame:
        """Return `evaluation.figures.calibration_bins`: how often stated chances come true."""
        return calibration_bins(self.queries)

    def summary(self) -> dict[str, Any]:
        """Return ``settings``, ``database``, ``results``, ``versions`` and ``timing`` for JSON.

        All but the last are the same whenever it is repeated. None stands for infinity and NaN.
        """
        errors = self.queries["error_m"].to_numpy(dtype=np.float64)
        turns = self.queries["heading_error"].to_numpy(dtype=np.float64)
        by_chance = self.method.noise is not None
        return {
            "settings": {
                "method": str(self.method),
                "distortions": [chain_text([one]) for one in self.asked.distortions],
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
                **{name: finite_or_none(value) for name, value in self.answers().items()},
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
