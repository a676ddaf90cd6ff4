"""Rows of ``accuracy.json``: figures of many queries, and the bars that they should reach."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks._accuracy_methods import NEAR
from benchmarks._measuring import short
from semsig_gis.core import wilson_interval
from semsig_gis.localization import expected_recall

if TYPE_CHECKING:
    from collections.abc import Sequence

    from benchmarks._accuracy_methods import Outcome
    from benchmarks._accuracy_queries import City

__all__ = ["PRECISIONS", "Bar", "Row"]

MANY = 10
"""Least number of visible objects of the queries in ``p50_ten``."""
PRECISIONS = (90, 95, 98)
"""Percent of the answers that are right, in ``most_at_90`` and so on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    """A figure to reach.

    Parameters
    ----------
    what : str
        What the figure is.
    value : float
        The measured value.
    low, high : float
        Bounds of the values that meet the bar.
    """

    what: str
    value: float
    low: float = -math.inf
    high: float = math.inf

    @property
    def met(self) -> bool:
        """Whether the value is between the bounds."""
        return self.low <= self.value <= self.high

    def to_dict(self) -> dict[str, Any]:
        """Return the bar as plain values."""
        return {
            "what": self.what,
            "value": short(self.value),
            "low": short(self.low),
            "high": short(self.high),
            "met": self.met,
        }

    def __str__(self) -> str:
        """Return the bar as text."""
        bounds = [f"at least {self.low:g}"] if math.isfinite(self.low) else []
        bounds += [f"at most {self.high:g}"] if math.isfinite(self.high) else []
        state = "met" if self.met else "NOT met"
        return f"{self.what}: {self.value:.3f}, {', '.join(bounds)} wanted: {state}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of the results.

    Parameters
    ----------
    city : City
        The city.
    distortion, method, setting : str
        Distortion of the queries, method, and other settings such as the error of north.
    outcomes : sequence of Outcome
        The outcome of each query.
    coverage, precision : float or None
        Share of the queries that were answered, if the method may decline, and of right answers
        among them.
    bars : list of Bar
        Bars for figures of this row.
    """

    city: City
    distortion: str
    method: str
    setting: str
    outcomes: Sequence[Outcome]
    coverage: float | None = None
    precision: float | None = None
    bars: list[Bar] = field(default_factory=list)

    def share(self, limit: float = 50.0) -> float:
        """Return the share of the queries with an error of at most `limit` metres."""
        place = NEAR.index(limit)
        return _mean([outcome.within[place] for outcome in self.outcomes])

    @property
    def many(self) -> list[Outcome]:
        """The outcomes of places with ten visible objects or more."""
        return [outcome for outcome in self.outcomes if outcome.length >= MANY]

    @property
    def share_of_many(self) -> float:
        """The share of these with an error of at most 50 m."""
        return _mean([outcome.within[NEAR.index(50.0)] for outcome in self.many])

    def _mean_of(self, name: str) -> float | None:
        """Return the mean of a field of the outcomes that is not None; None if all are None."""
        fields = (getattr(outcome, name) for outcome in self.outcomes)
        values = [float(value) for value in fields if value is not None]
        return _mean(values) if values else None

    @property
    def in_exact_region(self) -> float | None:
        """How often the region of exactly 90 % contains the true cell; None without regions."""
        return self._mean_of("in_exact_region")

    def most_answered(self, precision: float) -> float | None:
        """Return the largest share of the queries to answer with a share of right answers.

        The answers are those of the highest chances, equal ones together. None if all queries are
        answered.
        """
        if self.coverage is None:
            return None
        masses = np.array([outcome.mass or 0.0 for outcome in self.outcomes])
        right = np.array([outcome.within[-1] == 1.0 for outcome in self.outcomes])
        order = np.argsort(-masses, kind="stable")
        ends = np.append(np.diff(masses[order]) != 0.0, True)
        counts = np.arange(1, len(order) + 1)
        passes = ends & (np.cumsum(right[order]) >= precision * counts)
        return int(counts[passes].max(initial=0)) / len(order)

    def to_dict(self) -> dict[str, Any]:
        """Return the row as plain values."""
        count, cells = len(self.outcomes), len(self.city.database)
        low, high = wilson_interval(self.share(), count)
        recalls = expected_recall(
            *zip(*(outcome.ranks for outcome in self.outcomes), strict=True),
            cells=cells,
            percent=10,
        )
        values = {
            "p5": self.share(5.0),
            "p25": self.share(25.0),
            "p50": self.share(),
            "p50_low": low,
            "p50_high": high,
            "recall10pct": float(recalls.mean()),
            "ms_per_query": 1e3 * _mean([outcome.seconds for outcome in self.outcomes]),
            "p50_ten": self.share_of_many,
            "chance": self._mean_of("mass"),
            "in_exact_region": self.in_exact_region,
            "in_region": self._mean_of("in_region"),
            "region_mass": self._mean_of("region_mass"),
            "coverage": self.coverage,
            "precision": self.precision,
            **{f"most_at_{share}": self.most_answered(share / 100.0) for share in PRECISIONS},
        }
        return {
            "city": self.city.name,
            "cells": cells,
            "queries": count,
            "distortion": self.distortion,
            "method": self.method,
            "setting": self.setting,
            **{name: short(value) for name, value in values.items()},
            "queries_ten": len(self.many),
            "bars": [bar.to_dict() for bar in self.bars],
        }

    def __str__(self) -> str:
        """Return the row as text."""
        values = self.to_dict()
        line = (
            f"{self.city.name}, {self.distortion}, {self.method}, {self.setting} "
            f"(n={values['queries']}): P5 {values['p5']}, P25 {values['p25']}, P50 {values['p50']} "
            f"[{values['p50_low']}, {values['p50_high']}], of {MANY} objects or more "
            f"{values['p50_ten']}, recall at 10 % {values['recall10pct']}, "
            f"{values['ms_per_query']} ms"
        )
        for name in (
            "chance",
            "in_exact_region",
            "in_region",
            "region_mass",
            "coverage",
            "precision",
            *(f"most_at_{share}" for share in PRECISIONS),
        ):
            if values[name] is not None:
                line += f", {name} {values[name]}"
        return "\n  ".join([line, *map(str, self.bars)])


def _mean(values: Sequence[float]) -> float:
    return math.fsum(values) / len(values) if values else math.nan
