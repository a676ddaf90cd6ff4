"""Tables of how well a city can be told apart, and of what each class adds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from semsig_gis import __version__
from semsig_gis.evaluation.result import machine
from semsig_gis.reports.parts import Curve, Number, Plot, Report, Section
from semsig_gis.reports.tables import Table, percent

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.evaluation.identify.check import IdentifiabilityCheck
    from semsig_gis.evaluation.identify.result import Identifiability


SCORES = {
    "found": "chance to be found",
    "near": "chance given to the cells near",
    "length": "number of objects, for comparison",
    "type_group": "how few cells have the same types, for comparison",
}


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
