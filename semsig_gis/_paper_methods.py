"""The sections of the report of the paper's experiments that compare methods."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis._paper_curves import (
    best_number,
    error_plot,
    method_numbers,
    recall_plot,
)
from semsig_gis.paper_experiments import (
    FUSIONS,
    MANY,
    PERCENTS,
    SINGLES,
    WEIGHTS,
)
from semsig_gis.paper_figures import (
    PARIS_QUERY_MS,
    PARIS_READ_OFF,
)
from semsig_gis.report_parts import Number, Section

if TYPE_CHECKING:
    from semsig_gis.reproduction import Reproduction

NAMES = {"jaccard": "Jaccard", "histogram": "histogram", "edit": "edit"}
MEASURES_TIMED = {
    "Jaccard": ("types:jaccard", "angles:jaccard", "jaccard+jaccard:5%"),
    "histogram": ("types:histogram", "angles:histogram", "histogram+histogram:5%"),
    "edit": ("types:edit", "angles:edit", "edit+edit:5%"),
}
TIMED_COLUMNS = ("types", "angles", "types and angles, 5 %")


def single_section(found: Reproduction) -> Section:
    labels = {name: f"{NAMES[name.split('-')[1]]}, {name.split('-')[0]}" for name in SINGLES}
    numbers = [
        *method_numbers(found, labels, "none", MANY, metres=10, percent=10),
        *method_numbers(found, labels, "medium", MANY, metres=0, percent=20),
        *best_number(found, labels, "none", metres=10, paper=PARIS_READ_OFF["single_none_p10"]),
        *best_number(found, labels, "medium", metres=0, paper=PARIS_READ_OFF["single_medium_p0"]),
    ]
    return Section(
        name="single",
        title="One measure of one part",
        text=(
            (
                "The paper's text reads more than 0.90 off its plots without distortion, and 0.50 "
                "at most after the medium one: of the best measure, without saying how exactly. "
                f"Errors are those of the best of {MANY} candidates, as in its plots."
            ),
        ),
        numbers=tuple(numbers),
        plots=(
            error_plot(
                found,
                "single-none-error",
                "One measure, no distortion",
                labels,
                "none",
                paper=((10.0, PARIS_READ_OFF["single_none_p10"], "more than 0.90 (text)"),),
            ),
            error_plot(
                found,
                "single-medium-error",
                "One measure, medium distortion",
                labels,
                "medium",
                paper=((0.0, PARIS_READ_OFF["single_medium_p0"], "at most 0.50 (text)"),),
            ),
            recall_plot(
                found,
                "single-none-recall",
                "One measure, no distortion",
                labels,
                "none",
                paper=((10.0, 1.0, "all but Jaccard of types (text)"),),
            ),
            recall_plot(
                found,
                "single-medium-recall",
                "One measure, medium distortion",
                labels,
                "medium",
                paper=((20.0, PARIS_READ_OFF["single_medium_recall20"], "good ones (text)"),),
            ),
        ),
    )


def fusion_section(found: Reproduction) -> Section:
    labels = {
        **{name: f"edit + {NAMES[name.split('-')[1]]}" for name in FUSIONS},
        "types-edit": "edit, types",
        "angles-edit": "edit, angles",
    }
    fused = {name: labels[name] for name in FUSIONS}
    alone = {name: labels[name] for name in SINGLES if name in labels}
    numbers = [
        *method_numbers(found, labels, "none", MANY, metres=0, percent=10),
        *method_numbers(found, labels, "medium", MANY, metres=0, percent=10),
        *best_number(
            found,
            alone,
            "none",
            metres=0,
            paper=PARIS_READ_OFF["single_none_p0"],
            row="best of one part",
        ),
        *best_number(
            found,
            fused,
            "none",
            metres=0,
            paper=PARIS_READ_OFF["fusion_none_p0"],
            row="best fusion",
        ),
    ]
    return Section(
        name="fusion",
        title="Fusion of types and angles",
        text=(
            (
                "Half of the edit distance of the types and half of a distance of the angles. The "
                f"paper's text tells 0.92 and 0.93 without distortion. Best of {MANY} candidates."
            ),
        ),
        numbers=tuple(numbers),
        plots=(
            error_plot(found, "fusion-none-error", "Fusion, no distortion", labels, "none"),
            error_plot(found, "fusion-medium-error", "Fusion, medium distortion", labels, "medium"),
            recall_plot(
                found, "fusion-medium-recall", "Fusion, medium distortion", labels, "medium"
            ),
        ),
    )


def weight_section(found: Reproduction) -> Section:
    labels = {name: f"types {w:g}, angles {1 - w:g}" for w, name in WEIGHTS.items()}
    return Section(
        name="weights",
        title="Weights of a fusion",
        text=(
            (
                "Edit distances, medium distortion. The paper finds 0.3 or 0.5 of types best, and "
                f"0.9 bad. Best of {MANY} candidates."
            ),
        ),
        numbers=tuple(method_numbers(found, labels, "medium", MANY, metres=50, percent=10)),
        plots=(
            error_plot(
                found, "weights-medium-error", "Weights, medium distortion", labels, "medium"
            ),
        ),
    )


def stage_section(found: Reproduction) -> Section:
    labels = {name: f"{percent} %" for percent, name in PERCENTS.items()}
    return Section(
        name="stages",
        title="Fusion in two stages",
        text=(
            (
                "The edit distance of the types keeps so many per cent of the cells, and the "
                "fusion ranks these. 100 % is the fusion. The first candidate alone counts. The "
                "paper finds the errors of up to 10 % almost those of 100 %, and the recall "
                "lower."
            ),
        ),
        numbers=(
            *method_numbers(found, labels, "none", 1, metres=50, percent=10),
            *method_numbers(found, labels, "medium", 1, metres=50, percent=10),
        ),
        plots=(
            error_plot(
                found, "stages-none-error", "Two stages, no distortion", labels, "none", top=1
            ),
            recall_plot(
                found, "stages-medium-recall", "Two stages, medium distortion", labels, "medium"
            ),
        ),
    )


def time_section(found: Reproduction) -> Section:
    numbers = tuple(
        Number(
            row=f"{measure} distance",
            column=column,
            ours=1000.0 * found.seconds[text],
            paper=PARIS_QUERY_MS[text],
            unit="ms",
            decimals=2,
        )
        for measure, texts in MEASURES_TIMED.items()
        for column, text in zip(TIMED_COLUMNS, texts, strict=True)
    )
    return Section(
        name="times",
        title="Retrieval times",
        text=(
            (
                "Mean time to compare a query of 14 objects with all cells, of 100 queries, asked "
                "one by one on one thread. The paper used another computer and another program, so "
                f"that only orders of magnitude compare; it has 312,134 cells, we "
                f"{len(found.database):,}."
            ),
        ),
        numbers=numbers,
    )
