"""Shares of the queries that are answered well, as numbers and curves of a report.

Kinds: ``error`` (at most so many metres), ``recall`` (cell among the best so many per cent).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from semsig_gis.core.statistics import wilson_interval
from semsig_gis.experiments.paper.reproduce import BEST
from semsig_gis.matching.ties import THRESHOLDS, expected_recall
from semsig_gis.reports import paris
from semsig_gis.reports.parts import Curve, Number, Plot

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from semsig_gis.evaluation.result import Evaluation
    from semsig_gis.experiments.paper.reproduce import Reproduction

    Points = tuple[tuple[float, float, str], ...]

Figure = tuple[str, float]  # the kind of a figure, and how many metres or per cent

# What plots show: metres and per cent.
STEPS: Mapping[str, tuple[float, ...]] = {
    "error": tuple(one for one in THRESHOLDS if one <= 500),  # noqa: PLR2004
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
COLUMNS = {P10: "P(error ≤ 10 m)", P50: "P(error ≤ 50 m)", RECALL10: "recall@10 %"}


class Share(NamedTuple):
    """A share of queries, with its interval of 95 %; None of no queries."""

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
        """Return it for a place in a table, beside the paper's."""
        return Number(row, column, self.ours, low=self.low, high=self.high, paper=paper)


def case_of(
    results: Reproduction, experiment: str, method: str, distortion: str = "", *, top: int = 1
) -> Evaluation:
    """Return an evaluation; the distortion is by default that of the experiment's name."""
    return results.experiments[experiment][f"{distortion or experiment}/{method}-top{top}"]


def level_case(results: Reproduction, name: str) -> Evaluation:
    """Return the evaluation of the recommended method at a level of distortion."""
    return case_of(results, name if name in results.experiments else "levels", BEST, name)


def share_of(
    case: Evaluation, figure: Figure, some: NDArray[np.bool_] | slice = slice(None)
) -> Share:
    """Return the share of the queries, or of some, that are right by a figure."""
    return Share.of(_values(case, figure)[some])


def _values(case: Evaluation, figure: Figure) -> NDArray[np.float64]:
    """Return the chance of each query to be right."""
    kind, at = figure
    if kind == "error":
        return np.asarray(case.queries[f"p{at}"], dtype=np.float64)
    ranks = case.queries["rank_low"], case.queries["rank_high"]
    return expected_recall(*ranks, cells=case.database["cells"], percent=at)


def curve_of(
    case: Evaluation,
    label: str,
    kind: str,
    some: NDArray[np.bool_] | slice = slice(None),
    *,
    band: bool = True,
) -> Curve:
    """Return the curve of some of the queries, with or without its intervals."""
    shares = {at: share_of(case, (kind, at), some) for at in STEPS[kind]}
    points = [(float(at), *share) for at, share in shares.items() if share.ours is not None]
    x, y, low, high = zip(*points, strict=True) if points else ((), (), (), ())
    return Curve(label=label, x=x, y=y, low=low if band else (), high=high if band else ())


def plot_of(name: str, title: str, kind: str, curves: Iterable[Curve], paper: Points = ()) -> Plot:
    """Return a plot of the curves that have points, with the paper's."""
    x_label, y_label = AXES[kind]
    return Plot(
        name=f"{name}-{kind}",
        title=title,
        x_label=x_label,
        y_label=y_label,
        curves=tuple(one for one in curves if one.x),
        paper=paper,
    )


def is_alone(case: Evaluation) -> NDArray[np.bool_]:
    """Return which queries come from a cell that shares its types with no other."""
    return np.asarray(case.queries["type_group"] == 1)


def reweighted(case: Evaluation, figure: Figure) -> Share:
    """Return a share if as many queries were unambiguous as in the paper."""
    values, alone = _values(case, figure), is_alone(case)
    if alone.all() or not alone.any():
        return Share.of(values)
    parts = ((paris.ALONE, values[alone]), (1.0 - paris.ALONE, values[~alone]))
    mean = sum(weight * float(some.mean()) for weight, some in parts)
    variance = sum(weight**2 * float(some.var()) / len(some) for weight, some in parts)
    off = 1.96 * float(np.sqrt(variance))
    return Share(mean, max(mean - off, 0.0), min(mean + off, 1.0))
