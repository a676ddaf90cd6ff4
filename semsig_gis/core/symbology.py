"""Symbols and colours of classes and results on maps, in QGIS and in reports."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.families import family_named
from semsig_gis.core.pictograms import GENERAL_PICTOGRAM, PICTOGRAMS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core.taxonomy import ObjectClass, Taxonomy


# The palette of Okabe and Ito and two colours of Tol, which colour-blind people can distinguish;
# then a lighter or darker variant of each. Green is first because trees are the first class.
COLOURS = (
    "#009e73",
    "#0072b2",
    "#e69f00",
    "#cc79a7",
    "#d55e00",
    "#56b4e9",
    "#666666",
    "#aa4499",
    "#999933",
    "#8fdcc0",
    "#6a4fd8",
    "#8a5a00",
    "#f4a6cc",
    "#8c2d04",
    "#b3e6ea",
    "#b4b4b4",
    "#e3b5e3",
    "#dddd99",
)
PLAIN_FAMILIES = ("", "furniture")
"""Families with the colours of `COLOURS`; the classes of another have shades of its colour."""

SHADE_STEPS = (0.0, 0.4, -0.3, 0.65, -0.55)
"""Shares of white, or of black if negative, in the shades of the colour of a family."""

SHAPES = ("circle", "square", "diamond", "triangle", "hexagon", "triangle_down", "cross")
"""Names of the shapes of symbols, which leave room for a letter; each output format draws them."""

# A triangle has more room for the letter at its wider side.
DROPS = {"triangle": 0.4, "triangle_down": -0.4}

BLACK, WHITE = "#000000", "#ffffff"
LINEAR_LIMIT = 0.04045  # sRGB is linear below


@dataclass(frozen=True, slots=True)
class ClassSign:
    """Symbol of a class on a map: a letter on one of `SHAPES` in a colour ``#rrggbb``.

    Where there is room, a pictogram replaces shape and letter: SVG path data in a box of 16 x 16,
    filled with ``ink`` on a disc of the colour.
    """

    symbol: str
    title: str
    shape: str
    colour: str
    pictogram: str = field(default=GENERAL_PICTOGRAM, repr=False)
    family: str = field(default="", repr=False)
    ink: str = field(init=False, repr=False)
    """Colour of the letter or pictogram: black or white, whichever contrasts more."""

    def __post_init__(self) -> None:  # noqa: D105
        ink = max(BLACK, WHITE, key=lambda ink: _contrast(ink, self.colour))
        object.__setattr__(self, "ink", ink)

    @property
    def drop(self) -> float:
        """Offset of the letter below the centre, in radii of a circle of the same size."""
        return DROPS.get(self.shape, 0.0)


def class_signs(taxonomy: Taxonomy) -> dict[int, ClassSign]:
    """Return the map symbol of each class.

    Parameters
    ----------
    taxonomy : Taxonomy
        The classes, in any order.

    Returns
    -------
    dict of int to ClassSign
        By class code. Up to 18 classes of street furniture differ in colour, up to 126 in colour
        or shape. The classes of another family have shades of its colour, and its pictogram if they
        have none of their own; up to 35 differ in shade or shape.

    Examples
    --------
    >>> class_signs(demo_database.taxonomy)[3]
    ClassSign(symbol='D', title='Street light', shape='diamond', colour='#e69f00')
    """
    ordered = sorted(taxonomy.classes, key=lambda item: item.code)
    counts: Counter[str] = Counter()

    def sign(item: ObjectClass) -> ClassSign:
        plain, family = item.family in PLAIN_FAMILIES, family_named(item.family)
        scheme = "" if plain else item.family
        number, counts[scheme] = counts[scheme], counts[scheme] + 1
        colour = (
            COLOURS[number % len(COLOURS)]
            if plain
            else _shade(family.colour, SHADE_STEPS[number % len(SHADE_STEPS)])
        )
        return ClassSign(
            item.symbol,
            item.title,
            SHAPES[number % len(SHAPES)],
            colour,
            PICTOGRAMS.get(item.name, family.pictogram),
            item.family,
        )

    return {item.code: sign(item) for item in ordered}


def _shade(colour: str, step: float) -> str:
    """Return a colour mixed with white by a step above 0, or with black by a step below 0."""
    end, share = (255, step) if step > 0 else (0, -step)
    channels = (round(part + share * (end - part)) for part in bytes.fromhex(colour[1:]))
    return f"#{bytes(channels).hex()}"


def _contrast(*colours: str) -> float:
    """Return the contrast ratio of two colours by WCAG 2, from 1 to 21; text needs 4.5."""
    darker, lighter = sorted(map(_luminance, colours))
    return (lighter + 0.05) / (darker + 0.05)


def _luminance(colour: str) -> float:
    """Return the relative luminance of an sRGB colour."""
    values = [channel / 255 for channel in bytes.fromhex(colour[1:])]
    red, green, blue = (
        value / 12.92 if value <= LINEAR_LIMIT else ((value + 0.055) / 1.055) ** 2.4
        for value in values
    )
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@dataclass(frozen=True, slots=True)
class Mark:
    """Symbol without a letter: one of `SHAPES` in a colour ``#rrggbb``."""

    shape: str
    colour: str

    @property
    def edge(self) -> str:
        """Colour of the outline: black or white, whichever contrasts more with the fill."""
        return max(BLACK, WHITE, key=lambda edge: _contrast(edge, self.colour))


OUTCOMES: Mapping[str, Mark] = MappingProxyType(
    {"successful": Mark("circle", "#4bb7f5"), "failed": Mark("triangle", "#570079")}
)
"""Symbols of query outcomes."""

ANSWERS: Mapping[str, Mark] = MappingProxyType(
    {"given": Mark("diamond", "#aaff66"), "withheld": Mark("square", "#ee3311")}
)
"""Symbols of the best place of a query, given as the answer or withheld."""

ERROR_BREAKS = (5, 10, 25, 50, 100)
"""Limits of the error classes on maps and in tables, in metres."""

# How well something can be found has the same colours on all maps: well is bright, badly is dark.
# All are visible on light and dark grounds, and get steadily darker.
FAILURES: Mapping[float, str] = MappingProxyType(
    {
        0.0: "#fac712",
        0.1: "#e2a622",
        0.25: "#cb8823",
        0.5: "#b46c1d",
        0.75: "#9d5312",
        0.9: "#853b02",
    }
)
"""Colour of a place by the minimum share of failed queries around it."""

GROUP_COLOURS: Mapping[int, str] = MappingProxyType(
    dict(zip((1, 2, 10, 100, 1_000, 10_000), FAILURES.values(), strict=True))
)
"""Colour of a cell by the minimum number of cells with its signature, itself included."""

RANK_RAMP = ("#fde0dd", "#fa9fb5", "#dd3497", "#7a0177")
"""Colours of the places of an answer; the best is darkest."""

CANDIDATE_RAMP = ("#31688e", "#35b779", "#fde725")  # all visible on a dark ground

FOUND_RAMP = (
    "#853b02",
    "#92480b",
    "#a05613",
    "#ac6419",
    "#b9721e",
    "#c68222",
    "#d39223",
    "#dfa322",
    "#edb51b",
    "#fac712",
)
"""Colour of a cell by tenths of the probability to be found."""

SHADES: Mapping[int, str] = MappingProxyType(
    {1: "#dfdfdb", 5: "#c8c8c2", 10: "#aeaea7", 20: "#8f8f88"}
)
"""Colour of a cell by the minimum number of visible objects."""

CELL_CHANCES: Mapping[float, str] = MappingProxyType(
    {1e-5: "#d9bdf2", 1e-4: "#bd8be8", 1e-3: "#9650d2", 1e-2: "#6a1cb0", 1e-1: "#35006b"}
)
"""Colour of a cell by the minimum probability that the place is in it, or near it."""

CHANCES: Mapping[float, str] = MappingProxyType({0.5: "#00441b", 0.9: "#41ab5d", 0.99: "#c7e9c0"})
"""Colour of the smallest region that contains a share of the probability."""

VERDICTS: Mapping[str, str] = MappingProxyType(
    {
        "matched": "#37de7f",
        "misnamed": "#b15a9f",
        "missed": "#ffffff",
        "false": "#e66817",
        "outside": "#bababa",
    }
)
"""Colour of an object by the result of matching it with a query."""

SAME_TYPES, SAME_LEVELS = "#f5f5ff", "#7dffd0"
"""Colours of cells with the same types, and with the same types and angle levels."""

DRIFT_COLOURS: Mapping[str, str] = MappingProxyType(
    {"same": "#b3b3ad", "changed": "#ecc980", "appeared": "#73802e", "vanished": "#9c4263"}
)
"""Colour of a cell by its change between two dates."""

OBJECT_COLOURS: Mapping[str, str] = MappingProxyType(
    {"added": "#3d4a0c", "removed": "#6d1a47", "moved": "#c98a1b", "of another class": "#1f6a9c"}
)
"""Colour of an object by its change between two dates."""


def mixed(values: NDArray[np.float64], ramp: Sequence[str]) -> list[str]:
    """Return the interpolated colour of each value in [0, 1] on a ramp of evenly spaced colours."""
    anchors = np.array([list(bytes.fromhex(colour[1:])) for colour in ramp])
    stops = np.linspace(0.0, 1.0, len(ramp))
    rgb = np.stack([np.interp(values, stops, channel) for channel in anchors.T], axis=1)
    return [f"#{bytes(row).hex()}" for row in np.rint(rgb).astype(np.uint8)]
