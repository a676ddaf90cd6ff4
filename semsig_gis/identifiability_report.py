"""Tables of how well a city can be told apart, and of what each class adds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.tables import Table, percent

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.identifiability import Identifiability

__all__ = ["identifiability_tables"]


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
    >>> from semsig_gis.identifiability import identify
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
