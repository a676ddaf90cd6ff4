"""Shares of successful queries, as numbers and curves of a report.

Kinds: ``error`` (at most a number of metres), ``recall`` (true cell in the best per cent of cells).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from semsig_gis.core import wilson_interval
from semsig_gis.localization import THRESHOLDS, expected_recall
from semsig_gis.output.report_model import Curve, Number, Plot

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from semsig_gis.evaluation import Evaluation

    Points = tuple[tuple[float, float, str], ...]

Figure = tuple[str, float]  # kind, and metres or per cent

# Positions on the x axis of plots: metres, per cent.
STEPS: Mapping[str, tuple[float, ...]] = {
    "error": THRESHOLDS,
    "recall": (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 3, 5, 7, *range(10, 101, 5)),
}
AXES: Mapping[str, tuple[str, str]] = {
    "error": ("error in metres", "share of the queries"),
    "recall": (
        "best ranked cells that are kept, in per cent",
        "share of the queries whose cell is kept",
    ),
}
P10: Figure = ("error", 10)
P50: Figure = ("error", 50)
RECALL10: Figure = ("recall", 10)
COLUMNS: dict[Figure, str] = {
    P10: "P(error ≤ 10 m)",
    P50: "P(error ≤ 50 m)",
    RECALL10: "recall@10 %",
}


class Share(NamedTuple):
    """A share of queries, with its interval of 95 %; None without queries."""

    ours: float | None
    low: float | None = None
    high: float | None = None

    @classmethod
    def of(cls, values: NDArray[np.float64]) -> Share:
        """Return the mean of values from 0 to 1."""
        if not values.size:
            return cls(None)
        mean = float(values.mean())
        return cls(mean, *wilson_interval(mean, values.size))

    def number(self, row: str, column: str, paper: float | None = None) -> Number:
        """Return the share as a number of a table, with the paper's number."""
        return Number(row, column, self.ours, low=self.low, high=self.high, paper=paper)


def share_of(
    case: Evaluation, figure: Figure, rows: NDArray[np.bool_] | slice = slice(None)
) -> Share:
    """Return the share of the queries, or of the queries in `rows`, that succeed by a figure."""
    return Share.of(share_values(case, figure)[rows])


def share_values(case: Evaluation, figure: Figure) -> NDArray[np.float64]:
    """Return the chance of each query to succeed by a figure."""
    kind, at = figure
    if kind == "error":
        return np.asarray(case.queries[f"p{at}"], dtype=np.float64)
    ranks = case.queries["rank_low"], case.queries["rank_high"]
    return expected_recall(*ranks, cells=case.database["cells"], percent=at)


def curve_of(
    case: Evaluation,
    label: str,
    kind: str,
    rows: NDArray[np.bool_] | slice = slice(None),
    *,
    band: bool = True,
) -> Curve:
    """Return the curve of the queries in `rows`, with or without its intervals."""
    shares = {at: share_of(case, (kind, at), rows) for at in STEPS[kind]}
    points = [(float(at), *share) for at, share in shares.items() if share.ours is not None]
    x, y, low, high = zip(*points, strict=True) if points else ((), (), (), ())
    return Curve(label=label, x=x, y=y, low=low if band else (), high=high if band else ())


def plot_of(name: str, title: str, kind: str, curves: Iterable[Curve], paper: Points = ()) -> Plot:
    """Return a plot of the curves that have points, with the paper's points."""
    x_label, y_label = AXES[kind]
    return Plot(
        name=f"{name}-{kind}",
        title=title,
        x_label=x_label,
        y_label=y_label,
        curves=tuple(curve for curve in curves if curve.x),
        paper=paper,
        log=True,
    )


def calibration_plot(name: str, cases: Mapping[str, Evaluation]) -> Plot:
    """Return a plot of observed shares by predicted chances, with a curve for each case."""
    curves = []
    for label, case in cases.items():
        bins = case.calibration().dropna(subset=["true"])
        names = ("stated", "true", "low", "high")
        x, y, low, high = (tuple(bins[name].tolist()) for name in names)
        curves.append(Curve(label=label, x=x, y=y, low=low, high=high))
    return Plot(
        name=f"{name}-calibration",
        title="How often stated chances come true",
        x_label="chance stated",
        y_label="share that came true",
        curves=tuple(curves),
        diagonal=True,
    )
