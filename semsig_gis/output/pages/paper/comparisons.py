"""Sections of the report that compare methods: measures, fusions and two stages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from semsig_gis.evaluation import FUSIONS, MANY, PERCENTS, READ_OFF, SINGLES, WEIGHTS
from semsig_gis.output.figures.shares import curve_of, plot_of, share_of
from semsig_gis.output.pages.paper.cases import case_of
from semsig_gis.output.report_model import Section

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from semsig_gis.evaluation import Reproduction
    from semsig_gis.output.figures.shares import Points
    from semsig_gis.output.report_model import Number, Plot


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A section that compares several methods.

    `figures` are the columns: distortion, metres and per cent. `best` are rows that compare the
    best of several methods with the paper's best: row, methods, distortion, metres and the paper's
    share. `plots` are a distortion, a kind of plot and the paper's points. A query succeeds if one
    of its `top` candidates does, except for recalls.
    """

    name: str
    title: str
    text: str
    subject: str
    labels: Mapping[str, str]
    top: int = MANY
    figures: tuple[tuple[str, int, int], ...]
    best: tuple[tuple[str, Iterable[str], str, int, float], ...] = ()
    plots: tuple[tuple[str, str, Points], ...]

    def section(self, results: Reproduction) -> Section:
        """Return the section of a reproduction."""
        numbers = (*self._numbers(results), *self._best_numbers(results))
        plots = (self._plot(results, *plot) for plot in self.plots)
        return Section(
            name=self.name,
            title=self.title,
            text=(self.text,),
            numbers=numbers,
            plots=tuple(plots),
        )

    def _numbers(self, results: Reproduction) -> Iterator[Number]:
        for distortion, metres, percent in self.figures:
            level = "no distortion" if distortion == "none" else distortion
            for method, label in self.labels.items():
                case = case_of(results, distortion, method, top=self.top)
                error, recall = f"P(error ≤ {metres} m)", f"recall@{percent} %"
                yield share_of(case, ("error", metres)).number(label, f"{level}: {error}")
                yield share_of(case, ("recall", percent)).number(label, f"{level}: {recall}")

    def _best_numbers(self, results: Reproduction) -> Iterator[Number]:
        for row, methods, distortion, metres, paper in self.best:
            cases = [case_of(results, distortion, method, top=self.top) for method in methods]
            shares = [share_of(case, ("error", metres)) for case in cases]
            best = max(shares, key=lambda share: share.ours or 0.0)
            level = "no distortion" if distortion == "none" else distortion
            yield best.number(row, f"{level}: P(error ≤ {metres} m)", paper)

    def _plot(self, results: Reproduction, distortion: str, kind: str, paper: Points) -> Plot:
        top = self.top if kind == "error" else 1
        level = "no" if distortion == "none" else distortion
        candidates = "first candidate" if top == 1 else f"best of {top} candidates"
        measure = f"error of the {candidates}" if kind == "error" else "recall"
        curves = (
            curve_of(case_of(results, distortion, method, top=top), label, kind, band=False)
            for method, label in self.labels.items()
        )
        title = f"{self.subject}, {level} distortion: {measure}"
        return plot_of(f"{self.name}-{distortion}", title, kind, curves, paper)


NAMES = {"jaccard": "Jaccard", "histogram": "histogram", "edit": "edit"}
FUSION_LABELS = {name: f"edit + {NAMES[name.split('-')[1]]}" for name in FUSIONS}
EDIT_LABELS = {"types-edit": "edit, types", "angles-edit": "edit, angles"}

COMPARISONS = (
    Comparison(
        name="single",
        title="One measure of one part",
        text=(
            "The paper's text reads more than 0.90 off its plots without distortion, and 0.50 at "
            "most after the medium one: of the best measure, without saying how exactly. Errors "
            f"are those of the best of {MANY} candidates, as in its plots."
        ),
        subject="One measure",
        labels={name: f"{NAMES[name.split('-')[1]]}, {name.split('-')[0]}" for name in SINGLES},
        figures=(("none", 10, 10), ("medium", 0, 20)),
        best=(
            ("best of these", SINGLES, "none", 10, READ_OFF["single_none_p10"]),
            ("best of these", SINGLES, "medium", 0, READ_OFF["single_medium_p0"]),
        ),
        plots=(
            ("none", "error", ((10.0, READ_OFF["single_none_p10"], "more than 0.90 (text)"),)),
            ("medium", "error", ((0.0, READ_OFF["single_medium_p0"], "at most 0.50 (text)"),)),
            ("none", "recall", ((10.0, 1.0, "all but Jaccard of types (text)"),)),
            ("medium", "recall", ((20.0, READ_OFF["single_medium_recall20"], "good ones (text)"),)),
        ),
    ),
    Comparison(
        name="fusion",
        title="Fusion of types and angles",
        text=(
            "Half of the edit distance of the types and half of a distance of the angles. The "
            f"paper's text reports 0.92 and 0.93 without distortion. Best of {MANY} candidates."
        ),
        subject="Fusion",
        labels={**FUSION_LABELS, **EDIT_LABELS},
        figures=(("none", 0, 10), ("medium", 0, 10)),
        best=(
            ("best of one part", EDIT_LABELS, "none", 0, READ_OFF["single_none_p0"]),
            ("best fusion", FUSION_LABELS, "none", 0, READ_OFF["fusion_none_p0"]),
        ),
        plots=(
            (
                "none",
                "error",
                ((0.0, READ_OFF["fusion_none_p0"], "best fusion, more than 0.93 (text)"),),
            ),
            ("medium", "error", ()),
            ("medium", "recall", ()),
        ),
    ),
    Comparison(
        name="weights",
        title="Weights of a fusion",
        text=(
            "Edit distances, medium distortion. The paper finds 0.3 or 0.5 of types best, and 0.9 "
            f"bad. Best of {MANY} candidates."
        ),
        subject="Weights",
        labels={name: f"types {share:g}, angles {1 - share:g}" for share, name in WEIGHTS.items()},
        figures=(("medium", 50, 10),),
        plots=(("medium", "error", ()),),
    ),
    Comparison(
        name="stages",
        title="Fusion in two stages",
        text=(
            "The edit distance of the types selects a percentage of the cells; the fusion ranks "
            "these. 100 % is the fusion. Only the first candidate counts. In the paper, the errors "
            "with up to 10 % are almost the same as with 100 %, and the recall is lower."
        ),
        subject="Two stages",
        labels={name: f"{percent} %" for percent, name in PERCENTS.items()},
        top=1,
        figures=(("none", 50, 10), ("medium", 50, 10)),
        plots=(("none", "error", ()), ("medium", "recall", ())),
    ),
)
