"""Symbols and colours of classes and results on maps, in QGIS and in reports."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core.taxonomy import Taxonomy


# Those of Okabe and Ito, and two of Tol, which colour-blind people tell apart; then a lighter or
# darker one of each. Green comes first because trees do.
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
SHAPES = ("circle", "square", "diamond", "triangle", "hexagon", "triangle_down", "cross")
"""Names of the shapes, all with room for a letter; who draws a sign knows how each looks."""

# Triangles have more room where they are wider.
DROPS = {"triangle": 0.4, "triangle_down": -0.4}

BLACK, WHITE = "#000000", "#ffffff"
DARK = 0.04045


@dataclass(frozen=True, slots=True)
class ClassSign:
    """What an object of a class looks like: its symbol on one of `SHAPES`, coloured ``#rrggbb``."""

    symbol: str
    title: str
    shape: str
    colour: str

    @property
    def ink(self) -> str:
        """Colour of the letter: black or white, whichever contrasts more with the shape."""
        return max(BLACK, WHITE, key=lambda ink: _contrast(ink, self.colour))

    @property
    def drop(self) -> float:
        """How far below the middle the letter stands, in radii of a circle of the same size."""
        return DROPS.get(self.shape, 0.0)


def class_signs(taxonomy: Taxonomy) -> dict[int, ClassSign]:
    """Return the sign of each class.

    Parameters
    ----------
    taxonomy : Taxonomy
        The classes, in any order.

    Returns
    -------
    dict of int to ClassSign
        By class code. Up to 18 classes differ in colour, and up to 126 in colour or shape.

    Examples
    --------
    >>> class_signs(demo_database.taxonomy)[3]
    ClassSign(symbol='D', title='Street light', shape='diamond', colour='#e69f00')
    """
    ordered = sorted(taxonomy.classes, key=lambda item: item.code)
    return {
        item.code: ClassSign(
            item.symbol, item.title, SHAPES[number % len(SHAPES)], COLOURS[number % len(COLOURS)]
        )
        for number, item in enumerate(ordered)
    }


def _contrast(one: str, other: str) -> float:
    """Return the contrast of two colours as WCAG 2 defines it: 1 to 21; text needs 4.5."""
    darker, lighter = sorted((_luminance(one), _luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


def _luminance(colour: str) -> float:
    """Return the relative luminance of a colour of sRGB, which is a line in the dark."""
    shares = [part / 255 for part in bytes.fromhex(colour[1:])]
    red, green, blue = (
        share / 12.92 if share <= DARK else ((share + 0.055) / 1.055) ** 2.4 for share in shares
    )
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@dataclass(frozen=True, slots=True)
class Mark:
    """What stands for one thing alone: one of `SHAPES`, coloured ``#rrggbb``."""

    shape: str
    colour: str

    @property
    def edge(self) -> str:
        """Colour of the edge, which sets it off from whatever is below: black or white."""
        return max(BLACK, WHITE, key=lambda edge: _contrast(edge, self.colour))


OUTCOMES: Mapping[str, Mark] = MappingProxyType(
    {"successful": Mark("circle", "#4bb7f5"), "failed": Mark("triangle", "#570079")}
)
"""What became of a query."""

ANSWERS: Mapping[str, Mark] = MappingProxyType(
    {"given": Mark("diamond", "#aaff66"), "withheld": Mark("square", "#ee3311")}
)
"""The best place for a query, whether it is given as the answer or not."""

ERROR_BREAKS = (5, 10, 25, 50, 100)
"""Metres at which errors are told apart, on maps and in tables."""

# From the first that is seen on light and on dark, getting darker steadily.
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
"""Colour of a place by the least share of the queries around it that failed."""

RANK_RAMP = ("#fde0dd", "#fa9fb5", "#dd3497", "#7a0177")
"""Colours of the places of an answer, the best the darkest."""

CANDIDATE_RAMP = ("#31688e", "#35b779", "#fde725")  # of which none is lost in the dark

# Its lightness rises steadily.
FOUND_RAMP = (
    "#344d35",
    "#455631",
    "#56612f",
    "#686c2e",
    "#7b7a2f",
    "#8f8833",
    "#a59839",
    "#bdaa43",
    "#d7bd50",
    "#f3d260",
)
"""Colour of a cell by tenths of the chance to be found."""

SHADES: Mapping[int, str] = MappingProxyType(
    {1: "#dfdfdb", 5: "#c8c8c2", 10: "#aeaea7", 20: "#8f8f88"}
)
"""Colour of a cell by the smallest number of objects that are seen from it."""

CELL_CHANCES: Mapping[float, str] = MappingProxyType(
    {1e-5: "#d9bdf2", 1e-4: "#bd8be8", 1e-3: "#9650d2", 1e-2: "#6a1cb0", 1e-1: "#35006b"}
)
"""Colour of a cell by the least chance that the place is in it, or near it."""

CHANCES: Mapping[float, str] = MappingProxyType({0.5: "#00441b", 0.9: "#41ab5d", 0.99: "#c7e9c0"})
"""Colour of the fewest cells that hold a share of the chance."""

VERDICTS: Mapping[str, str] = MappingProxyType(
    {
        "matched": "#37de7f",
        "misnamed": "#b15a9f",
        "missed": "#ffffff",
        "false": "#e66817",
        "outside": "#bababa",
    }
)
"""Colour of what became of an object."""

GROUP_COLOURS: Mapping[int, str] = MappingProxyType(
    {
        1: "#fcc5ad",
        2: "#fb9d7c",
        10: "#f0694b",
        100: "#d5302a",
        1_000: "#a81016",
        10_000: "#6b000c",
    }
)
"""Colour of a cell by the smallest number of cells with its signature, itself among them."""


def group_labels() -> list[str]:
    """Return what is said of the cells of each of `GROUP_COLOURS`."""
    starts = list(GROUP_COLOURS)[1:]
    between = [f"{low:,} to {high - 1:,}" for low, high in itertools.pairwise(starts)]
    return ["no other", *between, f"{starts[-1]:,} or more"]


SAME_TYPES, SAME_LEVELS = "#f5f5ff", "#ffd43b"
"""Colours of the cells with the same types, and with the same angle levels, too."""

DRIFT_COLOURS: Mapping[str, str] = MappingProxyType(
    {"same": "#b3b3ad", "changed": "#ecc980", "appeared": "#73802e", "vanished": "#9c4263"}
)
"""Colour of a cell by what became of it."""

OBJECT_COLOURS: Mapping[str, str] = MappingProxyType(
    {"added": "#3d4a0c", "removed": "#6d1a47", "moved": "#c98a1b", "of another class": "#1f6a9c"}
)
"""Colour of an object by what became of it."""


def mixed(values: NDArray[np.float64], ramp: Sequence[str]) -> list[str]:
    """Return the colour of each value in [0, 1] on a ramp of evenly spaced colours."""
    anchors = np.array([list(bytes.fromhex(colour[1:])) for colour in ramp])
    stops = np.linspace(0.0, 1.0, len(ramp))
    parts = np.stack([np.interp(values, stops, part) for part in anchors.T], axis=1)
    return [f"#{bytes(row).hex()}" for row in np.rint(parts).astype(np.uint8)]
