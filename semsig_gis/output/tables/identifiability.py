"""Tables and report of the identifiability of the cells of a city, and of its classes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from semsig_gis import __version__
from semsig_gis.core import FULL_TURN, Table, figure, percent
from semsig_gis.evaluation import machine
from semsig_gis.output.report_model import Curve, Number, Plot, Report, Section
from semsig_gis.output.tables.database import class_label
from semsig_gis.output.tables.tables import short_percent

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from semsig_gis.evaluation import Identifiability, IdentifiabilityCheck

SCORES = {
    "found": "chance to be found",
    "near": "chance given to the cells near",
    "length": "number of objects, for comparison",
    "type_group": "how few cells have the same types, for comparison",
}


def query_name(view: float) -> str:
    """Return the name of a query with a field of view in degrees."""
    return "query" if view == FULL_TURN else f"photo of {view:g} degrees"


def identifiability_sentence(identifiability: Identifiability) -> str:
    """Return how well a query from the mean cell is placed."""
    return (
        f"From the mean cell, a {query_name(identifiability.view)} is placed within "
        f"{identifiability.radius:g} m with a chance of "
        f"{short_percent(float(identifiability.found.mean()))}"
    )


def identifiability_tables(
    identifiability: Identifiability, *, object_counts: Mapping[int, int] | None = None
) -> tuple[Table, ...]:
    """Return two tables: how well cells are found, and how much each class contributes to it.

    `object_counts` is by class code; without it the columns about objects are omitted.
    """
    facts = identifiability.summary(object_counts=object_counts)
    within = f"within {facts['radius_m']:g} m"
    cells = {label: percent(share, 1) for label, share in _cell_chances(facts).items()}
    bits = {"bits left": f"{facts['bits_left']:.2f} of {facts['cell_bits']:.2f}"}
    bands = {
        f"cells found {within} with a chance of {band}": percent(share, 1)
        for band, share in _band_shares(facts).items()
    }
    whole = Table(
        title=f"Identifiability, {facts['noise']} noise",
        columns=(f"A {query_name(facts['view_degrees'])} from the mean cell", ""),
        rows=tuple({**cells, **bits, **bands}.items()),
        note=f"Expected before any query, by {facts['trials']:,} simulated ones.",
    )
    items = facts["classes"]
    classes: dict[str, Iterable[str]] = {
        "Class": [class_label(item, symbols=False) for item in items],
        f"Chance {within}": [f"{100 * item['chance_near']:+.2f} %" for item in items],
        "Bits": [f"{item['bits']:+.3f}" for item in items],
    }
    if object_counts is not None:
        gains = [item["chance_near_per_1000"] for item in items]
        classes |= {
            "Objects": [f"{item['objects']:,}" for item in items],
            "Chance by 1,000 objects": [
                "" if gain is None else f"{100 * gain:+.3f} %" for gain in gains
            ],
        }
    note = "For the mean cell, beyond what all other classes say about it."
    return whole, Table.of_columns("What each class adds", classes, note)


def check_tables(check: IdentifiabilityCheck) -> tuple[Table, ...]:
    """Return the calibration and the rank correlations of a check as tables."""
    calibration = Table.of_columns(
        "Do the chances come true?",
        {
            "Chance to be found": [f"{item.low:g} to {item.high:g}" for item in check.bins],
            "Queries": [f"{item.queries:,}" for item in check.bins],
            "Stated": [percent(item.stated, 1) for item in check.bins],
            "Found": [percent(item.true, 1) for item in check.bins],
            "Interval (95 %)": [
                f"{percent(item.true_low, 1)} to {percent(item.true_high, 1)}"
                for item in check.bins
            ],
        },
        f"Of {check.queries:,} fresh queries, {percent(check.found, 1)} were found.",
    )
    names = [SCORES[name] for name in check.correlations]
    values = [figure(value, "+.3f") for value in check.correlations.values()]
    attainable = "Success is yes or no: chances that are just right would have {:.3f}."
    ranks = Table.of_columns(
        "Do cells with a higher score succeed more often?",
        {"Score of a cell": names, "Rank correlation with success": values},
        "" if math.isnan(check.attainable) else attainable.format(check.attainable),
    )
    return calibration, ranks


def identifiability_page(
    identifiability: Identifiability,
    check: IdentifiabilityCheck,
    *,
    name: str,
    object_counts: Mapping[int, int] | None = None,
    command: str = "",
) -> Report:
    """Return the report of the identifiability of a database and its check by new queries."""
    facts = identifiability.summary(object_counts=object_counts)
    query = query_name(facts["view_degrees"])
    shares = _cell_chances(facts)
    for band, share in _band_shares(facts).items():
        shares[f"cells found with a chance of {band}"] = share
    cells = Section(
        name="cells",
        title="Cells",
        text=("The first three are of a query from the mean cell, the others shares of cells.",),
        numbers=tuple(Number(row, "share", share) for row, share in shares.items()),
    )
    return Report(
        title=f"Where a query can be placed in {name}",
        headline=(
            f"{identifiability_sentence(identifiability)}; of {check.queries:,} fresh ones, "
            f"{short_percent(check.found)} were."
        ),
        command=command,
        text=(
            (
                "Before any query, every cell gets the chance that a "
                f"{query} from it will be placed "
                f"within {facts['radius_m']:g} m, by {facts['trials']:,} simulated queries and by "
                f"how like the other cells are. {check.queries:,} new queries show whether the "
                "chances come true."
            ),
        ),
        settings=(
            ("Database", name),
            ("Cells", f"{facts['cells']:,}"),
            ("Noise model", facts["noise"]),
            ("Field of view", f"{facts['view_degrees']:g} degrees"),
            ("Seeds", f"{facts['seed']} and, of the check, {check.seed}"),
            ("semsig_gis", __version__),
        ),
        sections=(
            cells,
            _class_section(facts),
            _calibration_section(check),
            _rank_section(check),
        ),
        taxonomy=identifiability.database.taxonomy,
        credits=identifiability.database.licenses,
        facts={"identifiability": facts, "check": check.to_dict(), "machine": machine()},
    )


def _cell_chances(facts: Mapping[str, Any]) -> dict[str, float]:
    """Return the chances of a query from the mean cell, by label."""
    within = f"within {facts['radius_m']:g} m"
    return {
        "chance given to the cell itself": facts["chance_itself"],
        f"chance given to the cells {within}": facts["chance_near"],
        f"chance that the answer is {within}": facts["chance_found"],
    }


def _band_shares(facts: Mapping[str, Any]) -> dict[str, float]:
    """Return the share of cells in each band of the chance to be found, highest first."""
    bands = reversed(facts["bands"])
    return {f"{band['from']:g} to {band['to']:g}": band["share"] for band in bands}


def _class_section(facts: Mapping[str, Any]) -> Section:
    numbers = []
    for item in facts["classes"]:
        row = class_label(item, symbols=False)
        numbers += [
            Number(row, f"chance within {facts['radius_m']:g} m", item["chance_near"]),
            Number(row, "bits", item["bits"], decimals=3),
        ]
        if item["objects"] is not None:
            numbers.append(Number(row, "objects", item["objects"], decimals=0))
    return Section(
        name="classes",
        title="What each class adds",
        text=("For a query from the mean cell, beyond what all other classes say.",),
        numbers=tuple(numbers),
    )


def _calibration_section(check: IdentifiabilityCheck) -> Section:
    numbers = []
    for item in check.bins:
        row = f"{item.low:g} to {item.high:g}"
        numbers += [
            Number(row, "queries", item.queries, decimals=0),
            Number(row, "stated", item.stated, decimals=3),
            Number(row, "found", item.true, low=item.true_low, high=item.true_high, decimals=3),
        ]
    points = [(item.stated, item.true, item.true_low, item.true_high) for item in check.bins]
    x, y, low, high = zip(*points, strict=True) if points else ((), (), (), ())
    curve = Curve(label="fresh queries", x=x, y=y, low=low, high=high)
    plot = Plot(
        name="identifiability-calibration",
        title="Chance to be found: predicted and observed",
        x_label="predicted chance of the cell",
        y_label="share of the queries that were found",
        curves=(curve,),
        diagonal=True,
    )
    return Section(
        name="calibration",
        title="Do the chances come true?",
        text=(f"Of {check.queries:,} fresh queries, {percent(check.found, 1)} were found.",),
        numbers=tuple(numbers),
        plots=(plot,),
    )


def _rank_section(check: IdentifiabilityCheck) -> Section:
    attainable = "Success is yes or no, so that chances that are just right would have {:.3f}."
    scores = {
        SCORES[name]: None if math.isnan(value) else value
        for name, value in check.correlations.items()
    }
    column = "rank correlation with success"
    return Section(
        name="ranks",
        title="Do cells with a higher score succeed more often?",
        text=() if math.isnan(check.attainable) else (attainable.format(check.attainable),),
        numbers=tuple(Number(row, column, value, decimals=3) for row, value in scores.items()),
    )
