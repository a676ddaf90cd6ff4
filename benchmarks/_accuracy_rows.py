"""Rows of ``accuracy.json``: what came of many queries, and the bars that it is to reach."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from benchmarks._accuracy_methods import NEAR
from semsig_gis.core import wilson_interval
from semsig_gis.localization import expected_recall

if TYPE_CHECKING:
    from collections.abc import Sequence

    from benchmarks._accuracy_methods import Outcome
    from benchmarks._accuracy_queries import City

__all__ = ["Bar", "Row"]

MANY = 10
"""Objects that a place shows at least to count in ``p50_ten``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    """A figure to reach.

    Parameters
    ----------
    what : str
        What is asked for.
    value : float
        What came out.
    low, high : float
        Bounds of what is wanted.
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
            "value": _short(self.value),
            "low": _short(self.low),
            "high": _short(self.high),
            "met": self.met,
        }

    def __str__(self) -> str:
        """Return the bar for people."""
        wanted = f"at least {self.low:g}" if math.isfinite(self.low) else ""
        if math.isfinite(self.high):
            wanted += f"{', ' if wanted else ''}at most {self.high:g}"
        return f"{self.what}: {self.value:.3f}, {wanted} wanted: {'met' if self.met else 'NOT met'}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of the results.

    Parameters
    ----------
    city : City
        Where.
    distortion, method, setting : str
        How the queries were spoiled, what answered them, and what else was known.
    outcomes : sequence of Outcome
        What came of each query.
    coverage, precision : float or None
        Share of the queries that were answered where a method may decline, and of right answers
        in them.
    bars : list of Bar
        What is to be reached.
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
        """Return the share of the queries that are so near."""
        place = NEAR.index(limit)
        return _mean([one.within[place] for one in self.outcomes])

    @property
    def many(self) -> list[Outcome]:
        """The outcomes of places that show ten objects or more."""
        return [one for one in self.outcomes if one.length >= MANY]

    @property
    def share_of_many(self) -> float:
        """The share of these that are within 50 m."""
        return _mean([one.within[NEAR.index(50.0)] for one in self.many])

    def _told(self, name: str) -> float | None:
        """Return the mean of what the outcomes tell beside the place; None where none does."""
        values = [getattr(one, name) for one in self.outcomes]
        told = [float(value) for value in values if value is not None]
        return _mean(told) if told else None

    @property
    def in_exact_region(self) -> float | None:
        """How often the region of just 90 % holds the true cell; None where there is none."""
        return self._told("in_exact_region")

    def to_dict(self) -> dict[str, Any]:
        """Return the row as plain values."""
        count, cells = len(self.outcomes), len(self.city.database)
        low, high = wilson_interval(self.share(), count)
        recalls = expected_recall(
            *zip(*(one.ranks for one in self.outcomes), strict=True), cells=cells, percent=10
        )
        values = {
            "p5": self.share(5.0),
            "p25": self.share(25.0),
            "p50": self.share(),
            "p50_low": low,
            "p50_high": high,
            "recall10pct": float(recalls.mean()),
            "ms_per_query": 1e3 * _mean([one.seconds for one in self.outcomes]),
            "p50_ten": self.share_of_many,
            "chance": self._told("mass"),
            "in_exact_region": self.in_exact_region,
            "in_region": self._told("in_region"),
            "region_mass": self._told("region_mass"),
            "coverage": self.coverage,
            "precision": self.precision,
        }
        return {
            "city": self.city.name,
            "cells": cells,
            "queries": count,
            "distortion": self.distortion,
            "method": self.method,
            "setting": self.setting,
            **{name: _short(value) for name, value in values.items()},
            "queries_ten": len(self.many),
            "bars": [bar.to_dict() for bar in self.bars],
        }

    def __str__(self) -> str:
        """Return the row for people."""
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
        ):
            if values[name] is not None:
                line += f", {name} {values[name]}"
        return "\n  ".join([line, *map(str, self.bars)])


def _mean(values: Sequence[float]) -> float:
    return math.fsum(values) / len(values) if values else math.nan


def _short(value: float | None) -> float | None:
    """Return a number to four digits; JSON has no infinity."""
    return None if value is None or not math.isfinite(value) else float(f"{value:.4g}")
