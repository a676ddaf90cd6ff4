"""Shares, curves and plots of the experiments of the paper, for their report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from semsig_gis.intervals import wilson_interval
from semsig_gis.paper_experiments import BEST, FIRST_STAGE, MANY
from semsig_gis.report_parts import Curve, Number, Plot
from semsig_gis.scoring import THRESHOLDS, expected_recall

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.evaluation_result import Evaluation
    from semsig_gis.reproduction import Reproduction

METRES = tuple(one for one in THRESHOLDS if one <= 500)  # noqa: PLR2004 - what plots show
SHARES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 3, 5, 7, *range(10, 101, 5))
P50, RECALL10 = "P(error ≤ 50 m)", "recall@10 %"
JUST_5 = "recall@10 %, just 5 % kept"
ERROR_AXES = ("error in metres", "share of the queries")
RECALL_AXES = (
    "best ranked cells that are kept, in per cent",
    "share of the queries whose cell is kept",
)


class Share(NamedTuple):
    """A share of queries, with its interval of 95 %."""

    ours: float | None
    low: float | None = None
    high: float | None = None


def case_of(
    found: Reproduction, experiment: str, method: str, distortion: str | None = None, top: int = 1
) -> Evaluation:
    return found.experiments[experiment][f"{distortion or experiment}/{method}-top{top}"]


def level_case(found: Reproduction, name: str) -> Evaluation:
    """Return what the recommended method gives at a level of distortion."""
    return case_of(found, name if name in found.experiments else "levels", BEST, name)


def just_kept(found: Reproduction, experiment: str, distortion: str) -> Share:
    """Return the recall at 10 % if just 5 % of the cells are kept, whatever ties with the last.

    Then the best 10 % are those of the first stage.
    """
    return figure_share(case_of(found, experiment, FIRST_STAGE, distortion), "recall10")


def share_of(values: NDArray[np.float64]) -> Share:
    if not values.size:
        return Share(None)
    mean = float(values.mean())
    return Share(mean, *wilson_interval(mean, values.size))


def figure_share(case: Evaluation, key: str) -> Share:
    return share_of(case.figures[key].to_numpy(dtype=np.float64))


def share_within(case: Evaluation, metres: int) -> Share:
    return share_of(case.queries[f"p{metres}"].to_numpy(dtype=np.float64))


def recalls(case: Evaluation, percent: float) -> NDArray[np.float64]:
    ranks = case.queries["rank_low"], case.queries["rank_high"]
    return expected_recall(*ranks, cells=case.database["cells"], percent=percent)


def method_numbers(
    found: Reproduction,
    labels: Mapping[str, str],
    distortion: str,
    top: int,
    *,
    metres: int,
    percent: int,
) -> list[Number]:
    """Return errors and recalls of some methods."""
    said = "no distortion" if distortion == "none" else distortion
    numbers = []
    for name, label in labels.items():
        case = case_of(found, distortion, name, top=top)
        for column, share in (
            (f"{said}: P(error ≤ {metres} m)", share_within(case, metres)),
            (f"{said}: recall@{percent} %", share_of(recalls(case, percent))),
        ):
            numbers.append(Number(row=label, column=column, **share._asdict()))
    return numbers


def best_number(
    found: Reproduction,
    labels: Iterable[str],
    distortion: str,
    *,
    metres: int,
    paper: float,
    row: str = "best of these",
) -> list[Number]:
    """Return the best of some methods beside what the paper says of its best."""
    said = "no distortion" if distortion == "none" else distortion
    shares = [share_within(case_of(found, distortion, name, top=MANY), metres) for name in labels]
    best = max(shares, key=lambda share: share.ours or 0.0)
    column = f"{said}: P(error ≤ {metres} m)"
    return [Number(row=row, column=column, paper=paper, **best._asdict())]


def error_curve(
    case: Evaluation, label: str, some: NDArray[np.bool_] | None = None, *, band: bool = True
) -> Curve:
    queries = case.queries if some is None else case.queries[some]
    values = [queries[f"p{metres}"].to_numpy(dtype=np.float64) for metres in METRES]
    return _curve(label, METRES, values, band=band)


def recall_curve(
    case: Evaluation, label: str, some: NDArray[np.bool_] | None = None, *, band: bool = True
) -> Curve:
    chosen = slice(None) if some is None else some
    values = [recalls(case, percent)[chosen] for percent in SHARES]
    return _curve(label, SHARES, values, band=band)


def _curve(
    label: str, x: Sequence[float], values: Sequence[NDArray[np.float64]], *, band: bool
) -> Curve:
    points = [
        (place, *share)
        for place, share in zip(x, map(share_of, values), strict=True)
        if share.ours is not None
    ]
    if not points:
        return Curve(label=label, x=(), y=())
    places, means, lows, highs = (tuple(map(float, one)) for one in zip(*points, strict=True))
    ends: dict[str, Any] = {"low": lows, "high": highs} if band else {}
    return Curve(label=label, x=places, y=means, **ends)


def error_plot(
    found: Reproduction,
    name: str,
    title: str,
    labels: Mapping[str, str],
    distortion: str,
    *,
    top: int = MANY,
    paper: tuple[tuple[float, float, str], ...] = (),
) -> Plot:
    curves = [
        error_curve(case_of(found, distortion, method, top=top), label, band=False)
        for method, label in labels.items()
    ]
    which = "first candidate" if top == 1 else f"best of {top} candidates"
    return curve_plot(name, f"{title}: error of the {which}", curves, ERROR_AXES, paper=paper)


def recall_plot(
    found: Reproduction,
    name: str,
    title: str,
    labels: Mapping[str, str],
    distortion: str,
    *,
    paper: tuple[tuple[float, float, str], ...] = (),
) -> Plot:
    curves = [
        recall_curve(case_of(found, distortion, method), label, band=False)
        for method, label in labels.items()
    ]
    return curve_plot(name, f"{title}: recall", curves, RECALL_AXES, paper=paper)


def curve_plot(
    name: str,
    title: str,
    curves: Iterable[Curve],
    axes: tuple[str, str],
    *,
    paper: tuple[tuple[float, float, str], ...] = (),
) -> Plot:
    return Plot(
        name=name,
        title=title,
        x_label=axes[0],
        y_label=axes[1],
        curves=tuple(one for one in curves if one.x),
        paper=paper,
    )
