"""Identifiability and its check as a report with plots."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from semsig_gis import __version__
from semsig_gis.evaluation_settings import machine
from semsig_gis.identifiability_report import SCORES
from semsig_gis.report_parts import Curve, Number, Plot, Report, Section

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.identifiability import Identifiability
    from semsig_gis.identifiability_check import IdentifiabilityCheck

__all__ = ["identifiability_page"]


def identifiability_page(
    told: Identifiability,
    check: IdentifiabilityCheck,
    *,
    name: str,
    object_counts: Mapping[int, int] | None = None,
) -> Report:
    """Put together what is known of a city's cells, and whether fresh queries bear it out.

    ``name`` is what the database is called; ``object_counts`` is by class code.
    """
    facts = told.summary(object_counts=object_counts)
    return Report(
        title=f"Where a query can be placed in {name}",
        text=(
            (
                "Before any query, every cell is told the chance that one from it will be placed "
                f"within {facts['radius_m']:g} m, by {facts['trials']:,} simulated queries and by "
                f"how like the other cells are. {check.queries:,} fresh queries tell whether the "
                "chances come true."
            ),
        ),
        settings=(
            ("Database", name),
            ("Cells", f"{facts['cells']:,}"),
            ("Noise model", facts["noise"]),
            ("Seeds", f"{facts['seed']} and, of the check, {check.seed}"),
            ("semsig_gis", __version__),
        ),
        sections=(
            _cells(facts),
            _classes(facts),
            _calibration(check),
            _ranks(check),
        ),
        taxonomy=told.database.taxonomy,
        facts={"identifiability": facts, "check": check.to_dict(), "machine": machine()},
    )


def _cells(facts: Mapping[str, Any]) -> Section:
    within = f"within {facts['radius_m']:g} m"
    rows = (
        ("chance given to the cell itself", facts["chance_itself"]),
        (f"chance given to the cells {within}", facts["chance_near"]),
        (f"chance that the answer is {within}", facts["chance_found"]),
    )
    bands = (
        (f"cells found with a chance of {band['from']:g} to {band['to']:g}", band["share"])
        for band in reversed(facts["bands"])
    )
    return Section(
        name="cells",
        title="Cells",
        text=("The first three are of a query from the mean cell, the others shares of cells.",),
        numbers=tuple(
            Number(row=row, column="share", ours=share) for row, share in (*rows, *bands)
        ),
    )


def _classes(facts: Mapping[str, Any]) -> Section:
    numbers = []
    for item in facts["classes"]:
        row = f"{item['title']} ({item['symbol']})"
        chance = f"chance within {facts['radius_m']:g} m"
        numbers += [
            Number(row=row, column=chance, ours=item["chance_near"]),
            Number(row=row, column="bits", ours=item["bits"], decimals=3),
        ]
        if item["objects"] is not None:
            numbers.append(Number(row=row, column="objects", ours=item["objects"], decimals=0))
    return Section(
        name="classes",
        title="What each class adds",
        text=("To a query from the mean cell, beyond what all other classes tell.",),
        numbers=tuple(numbers),
    )


def _calibration(check: IdentifiabilityCheck) -> Section:
    x, y, low, high = (
        tuple(getattr(one, part) for one in check.bins)
        for part in ("stated", "true", "true_low", "true_high")
    )
    numbers = []
    for one in check.bins:
        row = f"{one.low:g} to {one.high:g}"
        numbers += [
            Number(row=row, column="queries", ours=one.queries, decimals=0),
            Number(row=row, column="stated", ours=one.stated, decimals=3),
            Number(
                row=row,
                column="found",
                ours=one.true,
                low=one.true_low,
                high=one.true_high,
                decimals=3,
            ),
        ]
    return Section(
        name="calibration",
        title="Do the chances come true?",
        text=(f"Of {check.queries:,} fresh queries, {100 * check.found:.1f} % were found.",),
        numbers=tuple(numbers),
        plots=(
            Plot(
                name="identifiability-calibration",
                title="Chance to be found: told and true",
                x_label="chance told of the cell",
                y_label="share of the queries that were found",
                curves=(Curve(label="fresh queries", x=x, y=y, low=low, high=high),),
                diagonal=True,
            ),
        ),
    )


def _ranks(check: IdentifiabilityCheck) -> Section:
    numbers = [
        Number(
            row=SCORES[name],
            column="rank correlation with success",
            ours=None if math.isnan(value) else value,
            decimals=3,
        )
        for name, value in check.correlations.items()
    ]
    told = (
        ()
        if math.isnan(check.attainable)
        else (
            (
                "Success is yes or no, so that chances that are just right would have "
                f"{check.attainable:.3f}."
            ),
        )
    )
    return Section(
        name="ranks",
        title="Do cells with a higher score succeed more often?",
        text=told,
        numbers=tuple(numbers),
    )
