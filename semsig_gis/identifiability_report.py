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
    """Return what there is to say of a city as tables.

    Parameters
    ----------
    told : Identifiability
        What is known of its cells.
    object_counts : mapping of int to int, optional
        How many objects of each class code there are, where they are at hand.

    Returns
    -------
    tuple of Table
        The mean cell and the bands of cells; what each class adds.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.identifying import identify
    >>> from semsig_gis.likelihood import build_index
    >>> from semsig_gis.noise import named_noise
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=200.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> index = build_index(build_database(objects), named_noise("light"))
    >>> for table in identifiability_tables(identify(index, trials=20, class_trials=5)):
    ...     print(table.title)
    Identifiability, light noise
    What each class adds
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
    """Return what came of a check as tables.

    Parameters
    ----------
    check : IdentifiabilityCheck
        What was told beside what came of queries.

    Returns
    -------
    tuple of Table
        The calibration; the rank correlations.

    Examples
    --------
    >>> from semsig_gis.identifiability_check import ChanceBin, IdentifiabilityCheck
    >>> tenth = ChanceBin(
    ...     low=0.9, high=1.0, queries=50, stated=0.95, true=0.96, true_low=0.86, true_high=0.99
    ... )
    >>> check = IdentifiabilityCheck(
    ...     queries=50, seed=1, found=0.96, correlations={"found": 0.5}, attainable=0.6,
    ...     bins=(tenth,),
    ... )
    >>> check_tables(check)[0].rows[0]
    ('0.9 to 1', '50', '95.0 %', '96.0 %', '86.0 % to 99.0 %')
    """
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
