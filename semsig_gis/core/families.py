"""Families of classes: their titles, colours and pictograms on maps and in legends."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

from semsig_gis.core.pictograms import GENERAL_PICTOGRAM

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from semsig_gis.core.taxonomy import Taxonomy


@dataclass(frozen=True, slots=True)
class Family:
    """How a family of classes is shown: its title, colour ``#rrggbb`` and pictogram.

    The pictogram is drawn for classes that have none of their own.
    """

    title: str
    colour: str = "#6b7a80"
    pictogram: str = field(default=GENERAL_PICTOGRAM, repr=False)


FAMILIES: Mapping[str, Family] = MappingProxyType(
    {
        "furniture": Family("Street furniture", "#5f6b3a", "M2 2h9l3 3-3 3H9v7H7V8H2z"),
        "shop": Family(
            "Shops",
            "#e07a1f",
            "M3 5h10l1 10H2zM5 5V4a3 3 0 0 1 6 0v1H9.4V4a1.4 1.4 0 0 0-2.8 0v1z",
        ),
        "food": Family(
            "Food and drink",
            "#c4285b",
            "M3 1h1.2v5h.9V1h1.2v5h.9V1h1.2v6a2.5 2.5 0 0 1-1.7 2.3V15h-2V9.3A2.5 2.5 0 0 1 3 7z"
            "M10.7 1c2.2.8 2.9 4 2.9 8.4h-1.1V15h-1.8z",
        ),
        "service": Family(
            "Services",
            "#3f51b5",
            "M6 3h4v1.6H8.8v1.5A6 6 0 0 1 14 12H2A6 6 0 0 1 7.2 6.1V4.6H6zM1 13h14v2H1z",
        ),
        "worship": Family(
            "Places of worship",
            "#7b3fa0",
            "M8 .5l2 3.5v2.5l4 3V15H9.5v-3a1.5 1.5 0 0 0-3 0v3H2V9.5l4-3V4z",
        ),
        "culture": Family(
            "Culture",
            "#a0522d",
            "M8 1l7 4v1.6H1V5zM2.2 7.6h2V12h-2zM7 7.6h2V12H7zM11.8 7.6h2V12h-2zM1 13h14v2H1z",
        ),
        "transport": Family(
            "Transport",
            "#1479b8",
            "M6 .5h4V2h2a2 2 0 0 1 2 2v7.5a1.5 1.5 0 0 1-1.5 1.5l1.5 2h-2l-1.3-2H5.3L4 15H2l1.5-2"
            "A1.5 1.5 0 0 1 2 11.5V4a2 2 0 0 1 2-2h2zM4 4v4h8V4zM4 10v1.4h1.6V10z"
            "M10.4 10v1.4H12V10z",
        ),
        "power": Family("Power and masts", "#d4b000", "M9.5 1l-1 5.5H13L5.5 15 7 9H3z"),
        "barrier": Family(
            "Barriers",
            "#7d7d85",
            "M2 4l1.5-2L5 4v10H2zM6.5 4L8 2l1.5 2v10h-3zM11 4l1.5-2L14 4v10h-3z"
            "M1 6h14v1.6H1zM1 10.4h14V12H1z",
        ),
        "water": Family(
            "Water",
            "#2fa4c7",
            "M1 3.2c2.3-2 4.7-2 7 0s4.7 2 7 0v2c-2.3 2-4.7 2-7 0s-4.7-2-7 0z"
            "M1 7.5c2.3-2 4.7-2 7 0s4.7 2 7 0v2c-2.3 2-4.7 2-7 0s-4.7-2-7 0z"
            "M1 11.8c2.3-2 4.7-2 7 0s4.7 2 7 0v2c-2.3 2-4.7 2-7 0s-4.7-2-7 0z",
        ),
        "leisure": Family(
            "Leisure",
            "#3c9a3f",
            "M4.6 1h6.8l3.5 14h-1.8L10 2.6H9.3v7h.8v1.6H5.9V9.6h.8v-7H6L2.9 15H1.1z"
            "M7.6 2.6v7h.8v-7z",
        ),
        "building": Family("Buildings", "#8f7468", "M8 1l7 6.5h-2V15H9.5v-4.5h-3V15H3V7.5H1z"),
        "junction": Family(
            "Junctions",
            "#34495e",
            "M5 1h6v4h4v6h-4v4H5v-4H1V5h4zM7.5 2v2.5h1V2zM7.5 11.5V14h1v-2.5z"
            "M2 7.5v1h2.5v-1zM11.5 7.5v1H14v-1z",
        ),
        "landmark": Family(
            "Landmarks",
            "#c0392b",
            "M7.4.6h1.2V3l2 2.5v3h-.8l1.7 6.5h-7l1.7-6.5h-.8v-3l2-2.5z",
        ),
    }
)
"""The families of the built-in classes, in the order of legends."""


def family_named(name: str) -> Family:
    """Return how a family is shown; a family of a user's own has its name as the title.

    Examples
    --------
    >>> family_named("food").title, family_named("market_stall").title, family_named("").title
    ('Food and drink', 'Market stall', 'Other')
    """
    return FAMILIES.get(name) or Family(name.replace("_", " ").capitalize() or "Other")


def codes_by_family(taxonomy: Taxonomy, codes: Collection[int]) -> dict[str, list[int]]:
    """Return class codes by family, in the order of legends; those without a family last.

    Lists of classes have headings if there are several families.

    Parameters
    ----------
    taxonomy : Taxonomy
        The classes.
    codes : collection of int
        Codes of some of them; the order remains.

    Returns
    -------
    dict of str to list of int
        Codes by the name of the family; all of them by ``""`` if there are not several families.

    Examples
    --------
    >>> codes_by_family(demo_database.taxonomy, [3, 10])
    {'': [3, 10]}
    """
    family_of = {item.code: item.family for item in taxonomy.classes}
    groups: dict[str, list[int]] = {name: [] for name in FAMILIES}
    for code in codes:
        groups.setdefault(family_of[code], []).append(code)
    groups[""] = groups.pop("", [])
    present = {name: members for name, members in groups.items() if members}
    return present if len(present.keys() - {""}) > 1 else {"": [*codes]}
