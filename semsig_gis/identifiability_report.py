"""Tables of how well a city can be told apart, and of what each class adds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from semsig_gis.tables import Table, percent

SCORES = {
    "found": "chance to be found",
    "near": "chance given to the cells near",
    "length": "number of objects, for comparison",
    "type_group": "how few cells have the same types, for comparison",
}

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.identifiability import Identifiability
    from semsig_gis.identifiability_check import IdentifiabilityCheck

__all__ = ["check_tables", "identifiability_tables"]


def identifiability_tables(
    told: Identifiability, *, object_counts: Mapping[int, int] | None = None
) -> tuple[Table, ...]:
    """Return the mean cell with the bands of cells, and what each class adds, as tables.

    ``object_counts`` is by class code; without it the columns about objects are left out.
    """
    facts = told.summary(object_counts=object_counts)
    within = f"within {facts['radius_m']:g} m"
    whole = Table(
        title=f"Identifiability, {facts['noise']} noise",
        columns=("A query from the mean cell", ""),
        rows=(
            ("chance given to the cell itself", percent(facts["chance_itself"])),
            (f"chance given to the cells {within}", percent(facts["chance_near"])),
            (f"chance that the answer is {within}", percent(facts["chance_found"])),
            ("bits left", f"{facts['bits_left']:.2f} of {facts['cell_bits']:.2f}"),
            *(
                (
                    f"cells found {within} with a chance of {band['from']:g} to {band['to']:g}",
                    percent(band["share"]),
                )
                for band in reversed(facts["bands"])
            ),
        ),
        note=f"Expected before any query, by {facts['trials']:,} simulated ones.",
    )
    counted = object_counts is not None
    classes = Table(
        title="What each class adds",
        columns=(
            "Class (symbol)",
            f"Chance {within}",
            "Bits",
            *(["Objects", "Chance by 1,000 objects"] if counted else []),
        ),
        rows=tuple(
            (
                f"{item['title']} ({item['symbol']})",
                f"{100 * item['chance_near']:+.2f} %",
                f"{item['bits']:+.3f}",
                *(
                    [
                        f"{item['objects']:,}",
                        ""
                        if item["chance_near_per_1000"] is None
                        else f"{100 * item['chance_near_per_1000']:+.3f} %",
                    ]
                    if counted
                    else []
                ),
            )
            for item in facts["classes"]
        ),
        note="To the mean cell: beyond what all other classes tell of it.",
    )
    return whole, classes


def check_tables(check: IdentifiabilityCheck) -> tuple[Table, ...]:
    """Return the calibration and the rank correlations of a check as tables."""
    calibration = Table(
        title="Do the chances come true?",
        columns=("Chance to be found", "Queries", "Stated", "Found", "Interval (95 %)"),
        rows=tuple(
            (
                f"{one.low:g} to {one.high:g}",
                f"{one.queries:,}",
                percent(one.stated),
                percent(one.true),
                f"{percent(one.true_low)} to {percent(one.true_high)}",
            )
            for one in check.bins
        ),
        note=f"Of {check.queries:,} fresh queries, {percent(check.found)} were found.",
    )
    ranks = Table(
        title="Do cells with a higher score succeed more often?",
        columns=("Score of a cell", "Rank correlation with success"),
        rows=tuple(
            (SCORES[name], "" if math.isnan(value) else f"{value:+.3f}")
            for name, value in check.correlations.items()
        ),
        note=""
        if math.isnan(check.attainable)
        else f"Success is yes or no: chances that are just right would have "
        f"{check.attainable:.3f}.",
    )
    return calibration, ranks
